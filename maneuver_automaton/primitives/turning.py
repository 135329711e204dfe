"""Maneuvers at the limit of one control: turns between headings, and hitches of a trailer."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from maneuver_automaton._arrays import Array, wrapped
from maneuver_automaton.models import CarWithTrailer, Model, OnlyTranslated
from maneuver_automaton.primitives.closed_form import Pairs
from maneuver_automaton.primitives.driving import drive_all
from maneuver_automaton.primitives.primitive import Maneuver, Trajectory, Trim

HEADING_TOLERANCE = 1e-9  # [rad] headings closer than this are one


def turns_between(
    model: Model, trims: Sequence[Trim], *, pairs: Pairs = "neighbours"
) -> tuple[Maneuver, ...]:
    """Turns at the greatest turn rate between trims of different headings, in one go.

    A turn begins in a trim, keeps its other controls, and ends in the trim that has these, or
    else in the first one, at the other heading. It takes the shorter side; half a turn, both.
    """
    if not isinstance(model, OnlyTranslated) or (rate := _turning_control(model)) is None:
        return ()
    chosen = list(_chosen(model, trims, pairs, rate))
    if not chosen:
        return ()
    controls = np.array([trims[a].control for a, _, _ in chosen])
    turns = np.array([turn for _, _, turn in chosen])
    limits = model.control_limits[rate]
    controls[:, rate] = np.where(turns > 0.0, limits[1], limits[0])
    courses = drive_all(
        model,
        [trims[a].reduced_state for a, _, _ in chosen],
        control=controls[:, None],
        durations=(turns / controls[:, rate])[:, None],
    )
    return tuple(
        Maneuver.along(
            course,
            name=f"{trims[a].name} to {trims[b].name}" + _side(turn),
            source=trims[a].name,
            target=trims[b].name,
        )
        for (a, b, turn), course in zip(chosen, courses, strict=True)
    )


def _side(turn: float) -> str:
    """Words for the side of half a turn, of which there are two."""
    if abs(turn) < math.pi - HEADING_TOLERANCE:
        return ""
    return " by the left" if turn > 0.0 else " by the right"


def _turning_control(model: OnlyTranslated) -> int | None:
    """The limited control that is the rate of the heading, the only reduced state; or None."""
    names = model.stated.reduced_names
    if len(names) != 1 or model.reduced_names == names:
        return None  # or it has a constant heading, and something else that changes
    n_controls = len(model.control_names)
    rng = np.random.default_rng(0)
    states, controls = rng.uniform(-3.0, 3.0, (5, 1)), rng.uniform(-1.0, 1.0, (5, n_controls))
    rates = model.stated.reduced_dynamics(states, controls)[:, 0]
    for k, (low, high) in enumerate(model.control_limits):
        limited = math.isfinite(low) and math.isfinite(high) and low < 0.0 < high
        if limited and (rates == controls[:, k]).all():
            return k
    return None


def _chosen(
    model: OnlyTranslated, trims: Sequence[Trim], pairs: Pairs, rate: int
) -> Iterator[tuple[int, int, float]]:
    """Positions of source and target, and the turn [rad] from one to the other."""
    headings = np.array([model.heading(trim.reduced_state) for trim in trims])
    if not isinstance(pairs, str):
        for a, b in pairs:
            yield from ((a, b, turn) for turn in _turns(float(headings[a]), float(headings[b])))
        return
    levels: list[float] = []
    for heading in sorted(headings.tolist()):
        if all(abs(wrapped(level - heading)) > HEADING_TOLERANCE for level in levels):
            levels.append(heading)
    if len(levels) < 2:
        return
    between = pairwise([*levels, levels[0]]) if len(levels) > 2 else [tuple(levels)]
    steps = {pair for a, b in between for pair in ((a, b), (b, a))}
    if pairs == "all":
        steps = {(a, b) for a in levels for b in levels if a != b}
    for a, trim in enumerate(trims):
        for here, there in sorted(steps):
            if abs(math.remainder(headings[a] - here, 2.0 * math.pi)) > HEADING_TOLERANCE:
                continue
            found = np.flatnonzero(np.abs(wrapped(headings - there)) <= HEADING_TOLERANCE).tolist()
            changes = (np.flatnonzero(trims[k].control != trim.control).tolist() for k in found)
            # The one whose other controls are those of the source, or else the first.
            kept = [k for k, which in zip(found, changes, strict=True) if set(which) <= {rate}]
            yield from ((a, (kept or found)[0], turn) for turn in _turns(here, there))


def _turns(here: float, there: float) -> tuple[float, ...]:
    """The turn to the shorter side [rad], or both half turns."""
    turn = math.remainder(there - here, 2.0 * math.pi)
    if abs(abs(turn) - math.pi) <= HEADING_TOLERANCE:
        return (math.pi, -math.pi)
    return (turn,)


POINTS = 64  # of the quadrature of the time
PARTS = 16  # intervals of the hitch that it is applied to


def hitch_trims(model: CarWithTrailer, hitches: Sequence[float]) -> tuple[Trim, ...]:
    """Rest, and steady motion at the greatest speeds ahead and back, at each angle of the hitch.

    Where the wheels cannot hold an angle there is rest alone.

    Source: ``hitch' = 0``: tan(steering) = wheelbase sin(hitch) / hitch_length.
    """
    trims = []
    for hitch in hitches:
        steering = math.atan(model.wheelbase * math.sin(hitch) / model.hitch_length)
        speeds = [("rest", 0.0)]
        if abs(steering) <= model.max_steering:
            low, high = model.control_limits[0].tolist()
            speeds += [(name, v) for name, v in (("ahead", high), ("back", low)) if v]
        for name, speed in speeds:
            state = np.array([hitch])
            control = np.array([speed, steering if speed else 0.0])
            trims.append(
                Trim(
                    name=f"{name}, hitch {hitch:.6g}",
                    body_velocity=model.body_velocity(state, control),
                    control=control,
                    reduced_state=state,
                )
            )
    return tuple(trims)


def connect_hitches(model: CarWithTrailer, trims: Sequence[Trim]) -> tuple[Maneuver, ...]:
    """Maneuvers between all angles of the hitch, ahead and back, from rest to rest of each.

    Speed and steering are inputs, so at one angle the vehicle changes between rest and motion at
    will.
    """
    rests = [trim for trim in trims if trim.is_rest]
    low, high = model.control_limits[0].tolist()
    return hitch_maneuvers(
        model,
        [
            (source, target, speed)
            for source in rests
            for target in rests
            if source.reduced_state[0] != target.reduced_state[0]
            for speed in (high, low)
            if speed
        ],
    )


def hitch_maneuvers(
    model: CarWithTrailer, wanted: Sequence[tuple[Trim, Trim, float]]
) -> tuple[Maneuver, ...]:
    """The maneuvers from trim to trim at a speed, those that exist, driven all at once."""
    begins = np.array([float(source.reduced_state[0]) for source, _, _ in wanted])
    ends = np.array([float(target.reduced_state[0]) for _, target, _ in wanted])
    speeds = np.array([speed for _, _, speed in wanted])
    steering = np.copysign(model.max_steering, (ends - begins) * speeds)
    control = np.stack([speeds, steering], axis=-1)
    durations = _times(model, control, begins, ends)
    can = np.flatnonzero(np.isfinite(durations))
    if not can.size:
        return ()
    courses = drive_all(
        model, begins[can, None], control=control[can, None], durations=durations[can, None]
    )
    return tuple(
        _maneuver(*wanted[k], course) for k, course in zip(can.tolist(), courses, strict=True)
    )


def _maneuver(source: Trim, target: Trim, speed: float, course: Trajectory) -> Maneuver:
    begin, end = float(source.reduced_state[0]), float(target.reduced_state[0])
    states = course.reduced_state.copy()
    states[-1] = end
    return Maneuver.along(
        replace(course, reduced_state=states),
        name=f"{'ahead' if speed > 0.0 else 'back'} from hitch {begin:.6g} to {end:.6g}",
        source=source.name,
        target=target.name,
    )


@functools.cache
def _gauss() -> tuple[Array, Array]:
    """Nodes and weights of the quadrature, which take longer than all else."""
    nodes, weights = np.polynomial.legendre.leggauss(POINTS)
    return nodes, weights


def _times(model: CarWithTrailer, control: Array, begin: Array, end: Array) -> Array:
    """How long (m,) hitches take at constant controls (m, 2) [s]; inf if one stops on the way."""
    nodes, weights = _gauss()
    edges = np.linspace(begin, end, PARTS + 1, axis=-1)
    half = 0.5 * np.diff(edges)[..., None]
    hitch = edges[:, :-1, None] + half + half * nodes
    (rates,) = model.dynamics([hitch], control.T[..., None, None])
    (at_ends,) = model.dynamics([edges[:, [0, -1]]], control.T[..., None])
    turned = (end - begin)[:, None]
    goes = ((rates * turned[..., None] > 0.0).all(axis=(1, 2))) & (at_ends * turned > 0.0).all(1)
    with np.errstate(divide="ignore"):
        shares = half * weights / rates
    return np.array([one.sum() if on else math.inf for one, on in zip(shares, goes, strict=True)])

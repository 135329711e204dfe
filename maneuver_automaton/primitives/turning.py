"""Turns of a vehicle whose heading is a reduced state: maneuvers from heading to heading."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array
from maneuver_automaton.models import Model, OnlyTranslated
from maneuver_automaton.primitives.bang_bang import Pairs
from maneuver_automaton.primitives.driving import drive_all
from maneuver_automaton.primitives.maneuver import Maneuver
from maneuver_automaton.primitives.trim import Trim

HEADING_TOLERANCE = 1e-9  # [rad] headings closer than this are one


def turns_between(
    model: Model, trims: Sequence[Trim], *, pairs: Pairs = "neighbours"
) -> tuple[Maneuver, ...]:
    """Turns at the greatest turn rate between trims of different headings, in one go.

    A turn begins in a trim, keeps its other controls, and ends in the trim that has these, or
    else in the first one, at the other heading. It takes the shorter side; half a turn, both.

    Parameters
    ----------
    model : Model
        The vehicle; one control is the rate of its heading, the only reduced state.
    trims : sequence of Trim
        Its trims.
    pairs : "neighbours", "all" or a sequence of pairs of int
        To the next heading on either side, of which longer turns are made; to every other one; or
        from and to the trims of these positions.

    Returns
    -------
    tuple of Maneuver
        None if the vehicle has one heading only, or no limited control is the rate of its heading.

    Examples
    --------
    >>> from maneuver_automaton.groups import translations
    >>> from maneuver_automaton.models import UserModel, in_world
    >>> from maneuver_automaton.primitives import trims_of
    >>> from maneuver_automaton.primitives.in_world import trim_in_world
    >>> boat = UserModel(name="boat", group=translations(2), control_names=("turn_rate",),
    ...                  reduced_names=("heading",), dynamics=lambda z, u: [u[0]],
    ...                  velocity=lambda z, u: [np.cos(z[0]) + 0.5, np.sin(z[0])],
    ...                  control_limits=[[-0.5, 0.5]])
    >>> stated = trims_of(boat, {"heading": [0.0, np.pi / 2]}).trims
    >>> boat = in_world(boat)
    >>> left, right = turns_between(boat, [trim_in_world(boat, trim) for trim in stated])
    >>> left.displacement.round(9).tolist()  # radius 2 m, and 0.5 m/s of current for pi seconds
    [3.570796327, 2.0, 1.570796327]
    """
    rate = _turning_control(model)
    if rate is None:
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


def _turning_control(model: Model) -> int | None:
    """The limited control that is the rate of the heading, the only reduced state; or None."""
    if not isinstance(model, OnlyTranslated) or len(model.stated.reduced_names) != 1:
        return None
    if model.reduced_names == model.stated.reduced_names:
        return None  # it has a constant heading, and something else that changes
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
    model: Model, trims: Sequence[Trim], pairs: Pairs, rate: int
) -> Iterator[tuple[int, int, float]]:
    """Positions of source and target, and the turn [rad] from one to the other."""
    assert isinstance(model, OnlyTranslated)
    headings = np.array([model.heading(trim.reduced_state) for trim in trims])
    if not isinstance(pairs, str):
        for a, b in pairs:
            yield from ((a, b, turn) for turn in _turns(float(headings[a]), float(headings[b])))
        return
    levels = _distinct(headings)
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
            b = _match(trims, np.abs(_off(headings, there)) <= HEADING_TOLERANCE, trim, rate)
            yield from ((a, b, turn) for turn in _turns(here, there))


def _match(trims: Sequence[Trim], there: NDArray[np.bool_], source: Trim, rate: int) -> int:
    """The trim among those `there` whose other controls are those of the source, or the first."""
    candidates = np.flatnonzero(there).tolist()
    kept = np.arange(source.control.size) != rate
    for k in candidates:
        if (trims[k].control[kept] == source.control[kept]).all():
            return int(k)
    return int(candidates[0])


def _distinct(headings: Array) -> list[float]:
    """Headings modulo a full turn, each once, in order."""
    levels: list[float] = []
    for heading in sorted(headings.tolist()):
        if all(abs(_off(level, heading)) > HEADING_TOLERANCE for level in levels):
            levels.append(heading)
    return levels


def _off(heading: Array | float, other: float) -> Array:
    """Differences of headings modulo a full turn, in [-pi, pi]."""
    return np.asarray(np.remainder(heading - other + math.pi, 2.0 * math.pi) - math.pi)


def _turns(here: float, there: float) -> tuple[float, ...]:
    """The turn to the shorter side [rad], or both half turns."""
    turn = math.remainder(there - here, 2.0 * math.pi)
    if abs(abs(turn) - math.pi) <= HEADING_TOLERANCE:
        return (math.pi, -math.pi)
    return (turn,)

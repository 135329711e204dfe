"""Maneuvers of a car with a trailer: the wheels at their limit until the hitch is where it goes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.models import CarWithTrailer
from maneuver_automaton.primitives.driving import drive_all
from maneuver_automaton.primitives.maneuver import Maneuver
from maneuver_automaton.primitives.trajectory import Trajectory
from maneuver_automaton.primitives.trim import Trim

POINTS = 64  # of the quadrature of the time
PARTS = 16  # intervals of the hitch that it is applied to


def hitch_trims(model: CarWithTrailer, hitches: Sequence[float]) -> tuple[Trim, ...]:
    """Rest, and steady motion at the greatest speeds ahead and back, at each angle of the hitch.

    Where the wheels cannot hold an angle there is rest alone.

    Source: ``hitch' = 0``: tan(steering) = wheelbase sin(hitch) / hitch_length.

    Examples
    --------
    >>> truck = CarWithTrailer(wheelbase=0.25, hitch_length=0.5, max_steering=1.0, max_speed=0.5)
    >>> [trim.name for trim in hitch_trims(truck, [0.0])]
    ['rest, hitch 0', 'ahead, hitch 0', 'back, hitch 0']
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
    return _maneuvers(
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


def _maneuvers(
    model: CarWithTrailer, wanted: Sequence[tuple[Trim, Trim, float]]
) -> tuple[Maneuver, ...]:
    """The maneuvers from trim to trim at a speed, those that exist, driven all at once."""
    begins = np.array([float(source.reduced_state[0]) for source, _, _ in wanted])
    ends = np.array([float(target.reduced_state[0]) for _, target, _ in wanted])
    speeds = np.array([speed for _, _, speed in wanted])
    steering = np.copysign(model.max_steering, (ends - begins) * speeds)
    control = np.stack([speeds, steering], axis=-1)
    rows = zip(control, begins.tolist(), ends.tolist(), strict=True)
    durations = np.array([_time(model, row, begin, end) for row, begin, end in rows])
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


def _time(model: CarWithTrailer, control: Array, begin: float, end: float) -> float:
    """How long the hitch takes at a constant control [s]; inf if it stops on the way."""
    nodes, weights = np.polynomial.legendre.leggauss(POINTS)
    edges = np.linspace(begin, end, PARTS + 1)
    half = 0.5 * np.diff(edges)
    hitch = (edges[:-1] + half)[:, None] + half[:, None] * nodes
    (rates,) = model.dynamics([hitch], control)
    ends = np.append(rates.ravel(), model.dynamics([np.array([begin, end])], control)[0])
    if not (ends * (end - begin) > 0.0).all():
        return math.inf
    return float((half[:, None] * weights / rates).sum())

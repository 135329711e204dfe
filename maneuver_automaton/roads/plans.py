"""Plans of a car on the road: controls that hold for a tick each, as trims and maneuvers."""

from __future__ import annotations

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.models import SecondOrderCar
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.primitives.driving import drive_all


def plan_of_controls(
    model: SecondOrderCar, state: Array, controls: Array, *, tick: float, start_time: float = 0.0
) -> Plan:
    """The plan that a car drives from a state (5,) under controls (n, 2), a `tick` [s] each.

    Every speed and steering angle is a trim of a second-order car, so a plan may begin and end
    between those of the library, and in the midst of a maneuver. Equal controls in a row are one
    primitive: a trim where nothing changes, else a maneuver, whose course is exact (`drive_all`).

    Examples
    --------
    >>> from maneuver_automaton.roads import RoadVehicle
    >>> controls = np.array([[2.0, 0.0], [2.0, 0.0], [0.0, 0.0]])
    >>> state = np.array([1.0, 0.0, 0.0, 5.0, 0.0])
    >>> plan = plan_of_controls(RoadVehicle().model, state, controls, tick=0.1)
    >>> plan.word, plan.primitive_durations.tolist(), plan.end.round(6).tolist()
    (('acceleration 2, steering rate 0', 'speed 5.4, steering 0'), [0.2, 0.1], [2.58, 0.0, 0.0])
    """
    # Equal to the last bit: controls that nearly are may change little by little over a long drive.
    new = (np.diff(controls, axis=0) != 0.0).any(axis=1)
    begins = np.flatnonzero(np.append(True, new)) if len(controls) else np.zeros(0, dtype=np.intp)
    ticks = np.diff(np.append(begins, len(controls)))
    held = controls[begins]
    gained = tick * np.cumsum(ticks[:, None] * held, axis=0)
    states = state[3:] + np.concatenate([np.zeros((1, 2)), gained])
    trims = [_trim(model, one) for one in states]
    word, durations, maneuvers = [trims[0]], [0.0], list[Maneuver]()
    courses = (
        drive_all(
            model, states[:-1], control=held[:, None], durations=tick * ticks[:, None].astype(float)
        )
        if len(held)
        else ()
    )
    for control, lasts, target, course in zip(held, tick * ticks, trims[1:], courses, strict=True):
        if not control.any():
            durations[-1] += float(lasts)
            continue
        maneuvers.append(
            Maneuver(
                name=f"acceleration {control[0]:.4g}, steering rate {control[1]:.3g}",
                source=word[-1].name,
                target=target.name,
                displacement=course.pose[-1],
                duration=float(course.time[-1]),
                course=course,
            )
        )
        word.append(target)
        durations.append(0.0)
    return Plan(
        state[:3], word, durations=durations, maneuvers=tuple(maneuvers), start_time=start_time
    )


def _trim(model: SecondOrderCar, reduced_state: Array) -> Trim:
    """The trim of a car that holds a speed and a steering angle (2,)."""
    control = np.zeros(2)
    return Trim(
        name=trim_name(*reduced_state.tolist()),
        body_velocity=model.body_velocity(reduced_state, control),
        control=control,
        reduced_state=reduced_state,
    )


def trim_name(speed: float, steering: float) -> str:
    """Name of the trim of a speed [m/s] and a steering angle [rad]; 0 is 0 in spite of rounding."""
    return f"speed {round(speed, 9) + 0.0:.4g}, steering {round(steering, 9) + 0.0:.3g}"

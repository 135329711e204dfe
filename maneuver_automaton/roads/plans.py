"""Plans of a car on the road: controls that hold for a tick each, as trims and maneuvers."""

from __future__ import annotations

from collections.abc import Sequence

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
    held, durations = controls[begins], tick * np.diff(np.append(begins, len(controls)))
    gained = np.cumsum(durations[:, None] * held, axis=0)
    trims = [trim_of(model, one) for one in state[3:] + np.concatenate([np.zeros((1, 2)), gained])]
    changing = (held != 0.0).any(axis=1)
    word, coasting = [trims[0]], [0.0]
    for target, duration, changes in zip(
        trims[1:], durations.tolist(), changing.tolist(), strict=True
    ):
        if changes:
            word.append(target)
            coasting.append(0.0)
        else:
            coasting[-1] += duration
    return Plan(
        state[:3],
        word,
        durations=coasting,
        maneuvers=ramps(
            model, word[:-1], word[1:], control=held[changing], durations=durations[changing]
        ),
        start_time=start_time,
    )


def ramps(
    model: SecondOrderCar,
    sources: Sequence[Trim],
    targets: Sequence[Trim],
    *,
    control: Array,
    durations: Array,
    max_step_m: float = 0.05,
) -> tuple[Maneuver, ...]:
    """Maneuvers from trim to trim (n,) under controls (n, 2) that are held for durations (n,) [s].

    Samples of their courses are exact, as `drive_all` says, and at most `max_step_m` [m] apart.
    """
    if not len(sources):
        return ()
    courses = drive_all(
        model,
        [source.reduced_state for source in sources],
        control=control[:, None],
        durations=durations[:, None],
        max_step_m=max_step_m,
    )
    return tuple(
        Maneuver.along(
            course,
            name=f"acceleration {along:.4g}, steering rate {rate:.3g}",
            source=source.name,
            target=target.name,
        )
        for (along, rate), source, target, course in zip(
            control.tolist(), sources, targets, courses, strict=True
        )
    )


def trim_of(model: SecondOrderCar, reduced_state: Array) -> Trim:
    """The trim that holds a speed [m/s] and a steering angle [rad] (2,).

    Its name says both; what rounding left of a zero is none.
    """
    speed, steering = (np.round(reduced_state, 9) + 0.0).tolist()
    control = np.zeros(2)
    return Trim(
        name=f"speed {speed:.4g}, steering {steering:.3g}",
        body_velocity=model.body_velocity(reduced_state, control),
        control=control,
        reduced_state=reduced_state,
    )

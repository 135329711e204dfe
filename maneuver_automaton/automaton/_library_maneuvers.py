"""Maneuvers in library files: read, driven along their inputs, and held against the model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton._library_values import (
    check_keys,
    listed,
    number_of,
    numbers_of,
    table_of,
    text_of,
)
from maneuver_automaton.automaton.automaton import Automaton
from maneuver_automaton.automaton.courses import (
    SAMPLED,
    Inputs,
    driven_courses,
    even_times,
    inputs_entry,
    inputs_of,
)
from maneuver_automaton.errors import InvalidLibrary
from maneuver_automaton.models import Model
from maneuver_automaton.primitives import Maneuver, Trajectory
from maneuver_automaton.primitives.primitive import CLOSED

WITHIN = 1e-9  # by which share of its size, at least 1, a value may exceed a limit
NEEDED = ("name", "source", "target", "displacement", "duration")
KNOWN = (*NEEDED, "control", "until", "samples", "cost_multiplier", "comment")


def maneuver_entry(maneuver: Maneuver, inputs: Inputs | None) -> dict[str, Any]:
    """The maneuver as a file states it; without inputs it has no course, or one of samples."""
    entry: dict[str, Any] = {
        "name": maneuver.name,
        "source": maneuver.source,
        "target": maneuver.target,
        "displacement": listed(maneuver.displacement),
        "duration": float(maneuver.duration),
    }
    if maneuver.cost_multiplier != 1.0:  # what says nothing new keeps its hash
        entry["cost_multiplier"] = float(maneuver.cost_multiplier)
    if inputs is None:
        inputs = None if maneuver.course is None else inputs_of(maneuver.course)
    return entry if inputs is None else entry | inputs_entry(*inputs)


def maneuver_of(k: int, entry: Any, model: Model) -> tuple[Maneuver, Inputs | None]:
    """Entry k of a file, with the course of its samples, if it has them; else with its inputs."""
    label = f"maneuvers[{k}]"
    check_keys(label, entry, known=KNOWN, needed=NEEDED)
    maneuver = Maneuver(
        name=text_of(f"{label}: name", entry["name"]),
        source=text_of(f"{label}: source", entry["source"]),
        target=text_of(f"{label}: target", entry["target"]),
        displacement=numbers_of(f"{label}: displacement", entry["displacement"]),
        duration=number_of(f"{label}: duration", entry["duration"]),
        cost_multiplier=number_of(f"{label}: cost_multiplier", entry.get("cost_multiplier", 1.0)),
    )
    if "samples" in entry:
        return replace(maneuver, course=_samples(label, entry["samples"])), None
    if "control" in entry:
        return maneuver, _inputs(label, entry, model, maneuver.duration)
    return maneuver, None


def driven(automaton: Automaton, inputs: Sequence[Inputs | None]) -> tuple[Maneuver, ...]:
    """The maneuvers of an automaton, those with inputs along the courses these lead.

    Raises
    ------
    InvalidLibrary
        If the inputs of one, or the reduced states of its course, break a limit of the model.
    ValueError
        If one leads elsewhere than it says.
    """
    model = automaton.model
    given = {k: one for k, one in enumerate(inputs) if one is not None}
    labels = {k: f"maneuvers[{k}] {automaton.maneuvers[k].name!r}" for k in given}
    for k, (_, control) in given.items():
        _check_limits(labels[k], model.control_limits, control, model.control_names)
    starts = [automaton[automaton.maneuvers[k].source].reduced_state for k in given]
    rides = driven_courses(model, starts, list(given.values()))
    courses = dict(zip(given, rides, strict=True))
    for k, course in courses.items():
        _check_limits(labels[k], model.reduced_limits, course.reduced_state, model.reduced_names)
    return tuple(
        replace(maneuver, course=courses[k]) if k in courses else maneuver
        for k, maneuver in enumerate(automaton.maneuvers)
    )


def _inputs(label: str, entry: Any, model: Model, duration: float) -> Inputs:
    """Until when each control of a maneuver holds, and the controls."""
    control = table_of(f"{label}: control", entry["control"], width=len(model.control_names))
    if "until" not in entry:
        return even_times(duration, len(control)), control
    until: Array = numbers_of(f"{label}: until", entry["until"])
    if until.shape != (len(control),) or not (np.diff(until, prepend=0.0) > 0.0).all():
        raise InvalidLibrary(
            f"{label}: until: got {until.tolist()!r:.60}, need {len(control)} rising times, one "
            "for each control"
        )
    if not abs(until[-1] - duration) <= CLOSED * max(1.0, duration):
        raise InvalidLibrary(
            f"{label}: until: ends with {until[-1]} s, need the duration {duration} s"
        )
    return until, control


def _samples(label: str, entry: Any) -> Trajectory:
    label = f"{label}: samples"
    check_keys(label, entry, known=SAMPLED, needed=SAMPLED)
    time = numbers_of(f"{label}: time", entry["time"])
    tables: dict[str, Any] = {
        name: table_of(f"{label}: {name}", entry[name]) for name in SAMPLED[1:]
    }
    for name, table in tables.items():
        if len(table) != time.size or not time.size:
            raise InvalidLibrary(
                f"{label}: {name}: got {len(table)} rows, need one for each of {time.size} times, "
                "and at least one"
            )
    return Trajectory(time=time, **tables)


def _check_limits(label: str, limits: Array, values: Array, names: Sequence[str]) -> None:
    low, high = limits.T
    beyond = np.maximum(low - values, values - high)
    outside = beyond > WITHIN * np.maximum(1.0, np.abs(values))
    if outside.any():
        row, i = np.argwhere(outside)[0]
        raise InvalidLibrary(
            f"{label}: {names[i]} = {values[row, i]:.6g} is outside the limits "
            f"[{low[i]:.6g}, {high[i]:.6g}]"
        )

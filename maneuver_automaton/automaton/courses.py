"""Maneuvers in library files: read, driven along their inputs, and held against the model.

A course of a few hundred samples is a few numbers: what was put in, and until when. Where the
inputs do not lead along the course, because it came from elsewhere, its samples are written.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton.automaton import Automaton
from maneuver_automaton.errors import InvalidLibrary
from maneuver_automaton.models import Model
from maneuver_automaton.primitives import Maneuver, Trajectory, connecting
from maneuver_automaton.primitives.driving import drive_all
from maneuver_automaton.primitives.primitive import CLOSED


def rows_of(document: Mapping[str, Any], key: str) -> list[Any]:
    """The list at a key, empty if there is none."""
    found = document.get(key, [])
    if not isinstance(found, list):
        raise InvalidLibrary(f"{key}: got {found!r:.60}, need a list")
    return found


def check_keys(label: str, entry: Any, *, known: Sequence[str], needed: Sequence[str]) -> None:
    """Refuse an entry that is no object, has an unknown key, or lacks one."""
    if not isinstance(entry, dict):
        raise InvalidLibrary(f"{label}: got {entry!r:.60}, need an object")
    for key in entry:
        if key not in known:
            raise InvalidLibrary(f"{label}: unknown key {key!r}, need {', '.join(known)}")
    for key in needed:
        if key not in entry:
            raise InvalidLibrary(f"{label}: the key {key!r} is missing")


def text_of(label: str, value: Any) -> str:
    """A text."""
    if not isinstance(value, str):
        raise InvalidLibrary(f"{label}: got {value!r:.60}, need a text")
    return value


def number_of(label: str, value: Any) -> float:
    """A finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InvalidLibrary(f"{label}: got {value!r:.60}, need a number")
    huge = isinstance(value, int) and abs(value) > 2**63
    if huge or not math.isfinite(value):
        raise InvalidLibrary(f"{label}: got {value!r:.60}, need a finite number")
    return float(value)


def numbers_of(label: str, value: Any) -> Array:
    """A list of numbers."""
    if not isinstance(value, list):
        raise InvalidLibrary(f"{label}: got {value!r:.60}, need a list of numbers")
    return np.array([number_of(label, item) for item in value], dtype=np.float64)


def table_of(label: str, value: Any, *, width: int | None = None) -> Array:
    """Rows (n, width) of numbers, at least one."""
    if not isinstance(value, list) or not value:
        raise InvalidLibrary(f"{label}: got {value!r:.60}, need a list of rows of numbers")
    rows = [numbers_of(f"{label}[{k}]", row) for k, row in enumerate(value)]
    width = rows[0].size if width is None else width
    for k, row in enumerate(rows):
        if row.size != width:
            raise InvalidLibrary(f"{label}[{k}]: got {row.size} numbers, need {width}")
    return np.array(rows, dtype=np.float64).reshape(len(rows), width)


def listed(array: Array) -> list[float]:
    """Numbers of an array as a file has them: -0.0 is 0.0."""
    return [value + 0.0 for value in array.tolist()]


EVEN = 1e-12  # by which share of a maneuver's duration equal intervals may differ
COURSE_TOLERANCE = 1e-9  # [m, rad, units of the reduced state] off its inputs driven again
SAMPLED = ("time", "pose", "reduced_state", "control")

Inputs = tuple[Array, Array]  # until when (n,) [s], and the controls (n, n_u)
Flags = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]


def samples_entry(course: Trajectory) -> dict[str, Any]:
    """All samples."""
    others = {name: [listed(row) for row in getattr(course, name)] for name in SAMPLED[1:]}
    return {"time": listed(course.time)} | others


def even_times(duration: float, count: int) -> Array:
    """Ends (count,) of equal intervals [s]."""
    return duration * (np.arange(1, count + 1) / max(count, 1))  # the last one is the duration


def is_reproduced(
    model: Model, starts: Mapping[str, Array], maneuvers: Sequence[Maneuver]
) -> Flags:
    """Whether the inputs of each maneuver lead where its course does, from the trims' states."""
    drivable = [k for k, one in enumerate(maneuvers) if _drivable(model, starts, one)]
    courses = {k: course for k in drivable if (course := maneuvers[k].course) is not None}
    driven = driven_courses(
        model,
        [starts[maneuvers[k].source] for k in courses],
        [inputs_of(course) for course in courses.values()],
    )
    flags = np.zeros(len(maneuvers), dtype=bool)
    for (k, course), again in zip(courses.items(), driven, strict=True):
        off = np.abs(again.pose[-1] - course.pose[-1]).max()
        off_state = np.abs(again.reduced_state[-1] - course.reduced_state[-1]).max(initial=0.0)
        flags[k] = max(off, off_state) <= COURSE_TOLERANCE
    return flags


def driven_courses(
    model: Model, starts: Sequence[Array], inputs: Sequence[Inputs]
) -> list[Trajectory]:
    """Courses from reduced states under inputs (until (n,) [s], control (n, n_u)), all at once.

    Rides of about as many inputs go together. The times are those of the inputs to the last bit.
    """
    groups: defaultdict[int, list[int]] = defaultdict(list)
    for k, (until, _) in enumerate(inputs):
        groups[(until.size - 1).bit_length()].append(k)
    courses: dict[int, Trajectory] = {}
    for ks in groups.values():
        rides = _driven_together(model, [starts[k] for k in ks], [inputs[k] for k in ks])
        courses |= dict(zip(ks, rides, strict=True))
    return [courses[k] for k in range(len(inputs))]


def _driven_together(
    model: Model, starts: Sequence[Array], inputs: Sequence[Inputs]
) -> list[Trajectory]:
    most = max(until.size for until, _ in inputs)
    control = np.zeros((len(inputs), most, len(model.control_names)))
    durations = np.zeros((len(inputs), most))
    for k, (until, values) in enumerate(inputs):
        control[k, : until.size] = values
        durations[k, : until.size] = np.diff(until, prepend=0.0)
    try:
        courses = drive_all(model, np.array(starts), control=control, durations=durations)
    except ValueError as error:
        raise InvalidLibrary(f"maneuvers: {error}") from error
    timed = []
    for course, (until, _) in zip(courses, inputs, strict=True):
        time = course.time.copy()  # changes of control are at the very times stated
        time[np.abs(time[:, None] - until).argmin(axis=0)] = until
        timed.append(replace(course, time=time))
    return timed


def inputs_of(course: Trajectory) -> Inputs:
    """Until when (n,) [s] each control (n, n_u) holds."""
    parts = connecting.pieces(course.time, course.control)
    until = np.array([end for _, end, _ in parts])
    even = even_times(float(course.time[-1]), len(parts))
    is_even = np.abs(until - even).max(initial=0.0) <= EVEN * course.time[-1]
    return (even if is_even else until), np.array([control for _, _, control in parts])


def _drivable(model: Model, starts: Mapping[str, Array], maneuver: Maneuver) -> bool:
    course = maneuver.course
    return (
        course is not None
        and course.time[-1] > 0.0
        and course.control.shape[1:] == (len(model.control_names),)
        and starts[maneuver.source].shape == (len(model.reduced_names),)
    )


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
    if inputs is not None:  # controls in order, and until when [s] unless all take equally long
        until, control = inputs
        entry["control"] = [listed(row) for row in control]
        if not np.array_equal(until, even_times(float(until[-1]), until.size)):
            entry["until"] = listed(until)
    return entry


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
    """The maneuvers of an automaton, those with inputs along the courses these lead."""
    model = automaton.model
    given = {k: one for k, one in enumerate(inputs) if one is not None}
    labels = {k: f"maneuvers[{k}] {automaton.maneuvers[k].name!r}" for k in given}
    for k, (_, control) in given.items():
        _check_within(labels[k], model.control_limits, control, model.control_names)
    starts = [automaton[automaton.maneuvers[k].source].reduced_state for k in given]
    rides = driven_courses(model, starts, list(given.values()))
    courses = dict(zip(given, rides, strict=True))
    for k, course in courses.items():
        _check_within(labels[k], model.reduced_limits, course.reduced_state, model.reduced_names)
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


def _check_within(label: str, limits: Array, values: Array, names: Sequence[str]) -> None:
    low, high = limits.T
    beyond = np.maximum(low - values, values - high)
    outside = beyond > WITHIN * np.maximum(1.0, np.abs(values))
    if outside.any():
        row, i = np.argwhere(outside)[0]
        raise InvalidLibrary(
            f"{label}: {names[i]} = {values[row, i]:.6g} is outside the limits "
            f"[{low[i]:.6g}, {high[i]:.6g}]"
        )

"""The courses of maneuvers in library files: inputs, from which they are driven again.

A course of a few hundred samples is a few numbers: what was put in, and until when. Where the
inputs do not lead along the course, because it came from elsewhere, its samples are written.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton._library_values import listed
from maneuver_automaton.errors import InvalidLibrary
from maneuver_automaton.models import Model
from maneuver_automaton.primitives import Maneuver, Trajectory
from maneuver_automaton.primitives.connecting import pieces
from maneuver_automaton.primitives.driving import drive_all

EVEN = 1e-12  # by which share of a maneuver's duration equal intervals may differ
COURSE_TOLERANCE = 1e-9  # [m, rad, units of the reduced state] off its inputs driven again
SAMPLED = ("time", "pose", "reduced_state", "control")

Inputs = tuple[Array, Array]  # until when (n,) [s], and the controls (n, n_u)
Flags = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]


def inputs_entry(until: Array, control: Array) -> dict[str, Any]:
    """Controls in order, and until when each holds [s] unless they all take equally long."""
    entry: dict[str, Any] = {"control": [listed(row) for row in control]}
    if not np.array_equal(until, even_times(float(until[-1]), until.size)):
        entry["until"] = listed(until)
    return entry


def samples_entry(course: Trajectory) -> dict[str, Any]:
    """All samples."""
    others = {name: [listed(row) for row in getattr(course, name)] for name in SAMPLED[1:]}
    return {"time": listed(course.time)} | others


def even_times(duration: float, count: int) -> Array:
    """Ends (count,) of equal intervals [s].

    Examples
    --------
    >>> even_times(3.0, 2).tolist()
    [1.5, 3.0]
    """
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

    Raises
    ------
    InvalidLibrary
        If the inputs lead nowhere.
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
    return [_timed(course, until) for course, (until, _) in zip(courses, inputs, strict=True)]


def _timed(course: Trajectory, until: Array) -> Trajectory:
    """The course, its changes of control at the very times stated."""
    time = course.time.copy()
    time[np.abs(time[:, None] - until).argmin(axis=0)] = until
    return replace(course, time=time)


def inputs_of(course: Trajectory) -> Inputs:
    """Until when (n,) [s] each control (n, n_u) holds."""
    parts = pieces(course.time, course.control)
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

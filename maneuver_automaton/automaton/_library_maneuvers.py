"""Maneuvers in library files: their controls, from which their courses are driven again."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array, vector_text
from maneuver_automaton.automaton._library_values import (
    check_keys,
    listed,
    number_of,
    numbers_of,
    rows_of,
    text_of,
)
from maneuver_automaton.automaton.automaton import Automaton
from maneuver_automaton.errors import InvalidLibrary
from maneuver_automaton.models import Model
from maneuver_automaton.primitives import Maneuver, Trajectory, drive_all

CONSISTENT = 1e-9  # [m, rad, s] between what a maneuver states and where its controls lead
REACHED = 1e-9  # between reduced states and their limits, over their size or 1
KEYS = ("name", "source", "target", "displacement", "duration", "controls", "comment")


def controls_of(maneuver: Maneuver) -> Array:
    """Controls of a maneuver as a file has them (k, 1 + n_u): until when [s], then the control."""
    if maneuver.course is None:
        return np.zeros((0, 0))
    until, controls = maneuver.course.control_pieces()
    return np.column_stack([until, controls])


def maneuver_entry(maneuver: Maneuver, controls: Array) -> dict[str, Any]:
    """The maneuver as a file states it; without controls it has no course."""
    entry: dict[str, Any] = {
        "name": maneuver.name,
        "source": maneuver.source,
        "target": maneuver.target,
        "displacement": listed(maneuver.displacement),
        "duration": float(maneuver.duration),
    }
    if controls.size:
        entry["controls"] = [listed(row) for row in controls]
    return entry


def maneuver_of(k: int, entry: Any, model: Model) -> tuple[Maneuver, Array]:
    """Entry k of a file as a maneuver without its course, and its controls."""
    label = f"maneuvers[{k}]"
    check_keys(label, entry, known=KEYS, needed=KEYS[:5])
    maneuver = Maneuver(
        name=text_of(f"{label}: name", entry["name"]),
        source=text_of(f"{label}: source", entry["source"]),
        target=text_of(f"{label}: target", entry["target"]),
        displacement=numbers_of(f"{label}: displacement", entry["displacement"]),
        duration=number_of(f"{label}: duration", entry["duration"]),
    )
    width = 1 + len(model.control_names)
    found = rows_of(entry, "controls", label=f"{label}: ")
    controls = [numbers_of(f"{label}: controls", row) for row in found]
    for row in controls:
        if row.size != width:
            raise InvalidLibrary(
                f"{label}: controls: got {row.size} numbers, need {width}: until when, then "
                f"{', '.join(model.control_names)}"
            )
    table = np.array(controls).reshape(-1, width)
    if (np.diff(table[:, 0], prepend=0.0) < 0.0).any():
        raise InvalidLibrary(f"{label}: controls: their times must rise from 0")
    return maneuver, table


def with_courses(
    maneuvers: Sequence[Maneuver], controls: Sequence[Array], *, automaton: Automaton
) -> tuple[Maneuver, ...]:
    """The maneuvers with the courses that their controls lead along.

    Raises
    ------
    InvalidLibrary
        If one leads elsewhere than it says, or breaks a limit of the model.
    """
    model = automaton.model
    rides = {}
    for k, (stated, table) in enumerate(zip(maneuvers, controls, strict=True)):
        if table.size:
            label = f"maneuvers[{k}] {stated.name!r}"
            _check_limits(label, model.control_limits, table[:, 1:], model.control_names)
            rides[k] = (automaton[stated.source].reduced_state, table)
    courses = _driven(model, rides)
    for k, course in courses.items():
        _check(f"maneuvers[{k}] {maneuvers[k].name!r}", maneuvers[k], course, model)
    return tuple(
        replace(stated, course=courses[k]) if k in courses else stated
        for k, stated in enumerate(maneuvers)
    )


def check_courses(automaton: Automaton, controls: Sequence[Array]) -> None:
    """Refuse a maneuver whose course is not where its controls lead: a file could not tell it."""
    without = [replace(maneuver, course=None) for maneuver in automaton.maneuvers]
    with_courses(without, controls, automaton=automaton)


def _driven(model: Model, pieces: Mapping[int, tuple[Array, Array]]) -> dict[int, Trajectory]:
    """Courses from reduced states (n_z,) under controls (k, 1 + n_u), until when and which.

    Rides of about as many controls go together.
    """
    groups: dict[int, list[int]] = defaultdict(list)
    for key, (_, controls) in pieces.items():
        groups[(controls.shape[0] - 1).bit_length()].append(key)
    courses = {}
    for keys in groups.values():
        most = max(pieces[key][1].shape[0] for key in keys)
        control = np.zeros((len(keys), most, len(model.control_names)))
        durations = np.zeros((len(keys), most))
        for row, key in enumerate(keys):
            until = pieces[key][1]
            control[row, : until.shape[0]] = until[:, 1:]
            durations[row, : until.shape[0]] = np.diff(until[:, 0], prepend=0.0)
        begins = [pieces[key][0] for key in keys]
        rides = drive_all(model, np.array(begins), control=control, durations=durations)
        for key, course in zip(keys, rides, strict=True):
            courses[key] = _at_times(course, pieces[key][1][:, 0])
    return courses


def _at_times(course: Trajectory, until: Array) -> Trajectory:
    """The course with its switches at exactly these times: sums of differences are off by a bit."""
    changes = course.control_changes()
    if changes.size != until.size:
        return course
    time = course.time.copy()
    time[np.append(changes[1:], time.size - 1)] = until
    return replace(course, time=time)


def _check(label: str, stated: Maneuver, course: Trajectory, model: Model) -> None:
    """A course leads where the maneuver says, within the limits of the reduced state."""
    off = float(np.abs(course.pose[-1] - stated.displacement).max())
    scale = max(1.0, stated.duration, float(np.abs(stated.displacement).max()))
    if not off <= CONSISTENT * scale:
        raise InvalidLibrary(
            f"{label}: got the displacement {vector_text(stated.displacement)}, but its controls "
            f"lead the {model.name} to {vector_text(course.pose[-1])}, {off:.3g} off"
        )
    late = abs(float(course.time[-1]) - stated.duration)
    if not late <= CONSISTENT * scale:
        raise InvalidLibrary(
            f"{label}: got the duration {stated.duration:.6g} s, but its controls end at "
            f"{course.time[-1]:.6g} s"
        )
    _check_limits(label, model.reduced_limits, course.reduced_state, model.reduced_names)


def _check_limits(label: str, limits: Array, values: Array, names: Sequence[str]) -> None:
    low, high = limits.T
    beyond = np.maximum(low - values, values - high)
    outside = beyond > REACHED * np.maximum(1.0, np.abs(values))
    if outside.any():
        row, i = np.argwhere(outside)[0]
        raise InvalidLibrary(
            f"{label}: {names[i]} = {values[row, i]:.6g} is outside the limits "
            f"[{low[i]:.6g}, {high[i]:.6g}]"
        )

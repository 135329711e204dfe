"""Trims and maneuvers with their times, as closed_loop.json states plans, and plans from them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Automaton, Plan, Primitive
from maneuver_automaton.automaton.courses import samples_entry
from maneuver_automaton.automaton.cutting import tail_of, with_samples_at
from maneuver_automaton.primitives import Maneuver, Trajectory, Trim


def plan_entries(plan: Plan, automaton: Automaton) -> list[dict[str, Any]]:
    """The primitives of a plan with their durations: enough to make it again from its start."""
    return [
        _primitive(primitive, float(duration), automaton)
        for primitive, duration in zip(plan.primitives, plan.primitive_durations, strict=True)
    ]


def _primitive(primitive: Primitive, duration: float, automaton: Automaton) -> dict[str, Any]:
    """A trim or maneuver by its name; with what it does if the library holds none such."""
    if isinstance(primitive, Trim):
        entry = {
            "kind": "trim",
            "name": primitive.name,
            "control": primitive.control.tolist(),
            "duration_s": duration,
        }
        known = primitive.name in automaton.trim_names
        if automaton.is_kinematic and _is_disturbed(primitive, automaton):
            entry["body_velocity"] = primitive.body_velocity.tolist()
        if not (automaton.is_kinematic or known):
            entry["body_velocity"] = primitive.body_velocity.tolist()
            entry["reduced_state"] = primitive.reduced_state.tolist()
        return entry
    entry = {
        "kind": "maneuver",
        "name": primitive.name,
        "source": primitive.source,
        "target": primitive.target,
        "duration_s": duration,
    }
    if primitive.course is not None and _in_library(entry, automaton) is None:
        entry["course"] = samples_entry(primitive.course)
    return entry


def _is_disturbed(trim: Trim, automaton: Automaton) -> bool:
    """Whether a trim of the library has another body velocity at the same control."""
    if trim.name not in automaton.trim_names:
        return False
    known = automaton[trim.name]
    same = np.array_equal(trim.control, known.control)
    return same and not np.array_equal(trim.body_velocity, known.body_velocity)


def plan_of_entries(
    pose: Array, entries: Sequence[Mapping[str, Any]], start_time: float, automaton: Automaton
) -> Plan:
    """The plan from a pose (dof,) that entries state; maneuvers are those of the library, or cut.

    Raises
    ------
    ValueError, KeyError, TypeError
        If an entry misses a key, or names what the library has not.
    """
    durations = [float(one["duration_s"]) for one in entries]
    if all(one["kind"] == "trim" for one in entries) and automaton.is_kinematic:
        trims = tuple(_trim(one, automaton) for one in entries)
        return Plan(pose, trims, durations=durations, start_time=start_time)
    primitives: list[Primitive] = [
        _coasted(one, automaton) if one["kind"] == "trim" else _maneuver(one, automaton)
        for one in entries
    ]
    if not primitives and automaton.rest is not None:
        at_rest = (automaton.trims[automaton.rest],)
        return Plan(pose, at_rest, durations=[0.0], start_time=start_time)
    return Plan.of_primitives(
        pose,
        primitives,
        durations=durations,
        trims=_passed(primitives, automaton),
        start_time=start_time,
    )


def _passed(primitives: Sequence[Primitive], automaton: Automaton) -> dict[str, Trim]:
    """Trims between maneuvers and at their ends, by name: of the library, or of a course's ends."""
    model = automaton.model
    still = np.zeros(len(model.control_names))
    known = {trim.name: trim for trim in automaton.trims}
    known |= {one.name: one for one in primitives if isinstance(one, Trim)}
    for one in primitives:
        if isinstance(one, Trim) or one.course is None:
            continue
        for name, state in ((one.source, 0), (one.target, -1)):
            if name not in known:
                reduced = one.course.reduced_state[state]
                velocity = np.asarray(model.body_velocity(reduced, still))
                known[name] = Trim(
                    name=name, body_velocity=velocity, control=still, reduced_state=reduced
                )
    return known


def _coasted(entry: Mapping[str, Any], automaton: Automaton) -> Trim:
    """A trim of the library, or one that the log tells all about."""
    if entry["name"] in automaton.trim_names or "reduced_state" not in entry:
        return automaton[entry["name"]]
    return Trim(
        name=entry["name"],
        body_velocity=entry["body_velocity"],
        control=entry["control"],
        reduced_state=entry["reduced_state"],
    )


def _in_library(entry: Mapping[str, Any], automaton: Automaton) -> Maneuver | None:
    """The maneuver of the library that has the name and the ends of an entry."""
    sought = (entry["name"], entry["source"], entry["target"])
    return next(
        (one for one in automaton.maneuvers if (one.name, one.source, one.target) == sought), None
    )


def _maneuver(entry: Mapping[str, Any], automaton: Automaton) -> Maneuver:
    """The maneuver of the library, or what was left of it when the step began."""
    one = _in_library(entry, automaton)
    if one is None:
        return _written(entry, automaton)
    begun = one.duration - float(entry["duration_s"])
    if begun <= 0.0:
        return one
    trims = (automaton[one.source], automaton[one.target])
    still = np.zeros(automaton.model.group.dof)
    whole = Plan(still, trims, durations=[0.0, 0.0], maneuvers=(one,))
    rest = tail_of(with_samples_at(whole, [begun], automaton.model), begun)
    assert rest.maneuvers[0] is not None
    return rest.maneuvers[0]


def _written(entry: Mapping[str, Any], automaton: Automaton) -> Maneuver:
    """A maneuver whose course is written in the log."""
    if "course" not in entry:
        raise ValueError(f"maneuver {entry['name']!r}: the library has none of this name and ends")
    rows: dict[str, Any] = {
        name: np.array(entry["course"][name], dtype=np.float64)
        for name in ("time", "pose", "reduced_state", "control")
    }
    course = Trajectory(**rows, model=automaton.model)
    return Maneuver.along(
        course,
        name=entry["name"],
        source=entry["source"],
        target=entry["target"],
    )


def _trim(entry: Mapping[str, Any], automaton: Automaton) -> Trim:
    """The trim of the library; one at another pace is made from its control."""
    name, control = entry["name"], entry["control"]
    if "body_velocity" in entry:
        return Trim(name=name, body_velocity=entry["body_velocity"], control=control)
    if name in automaton.trim_names:
        trim = automaton.trims[automaton.index_of(name)]
        if trim.control.tolist() == control:
            return trim
    return Automaton.of_controls(automaton.model, {name: control}).trims[0]

"""closed_loop.json: what a closed loop did, and the loop taken up again from it.

Strict JSON; numbers read back to the last bit, so a loop that was stopped goes on as if it had
not been. One entry per step applied, and a last one where the vehicle ended.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.automaton import Automaton, Plan, Primitive
from maneuver_automaton.automaton.courses import samples_entry
from maneuver_automaton.automaton.cutting import tail_of, with_samples_at
from maneuver_automaton.automaton.library import automaton_hash
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.json_source import Place
from maneuver_automaton.formats.plan_json import (
    package_version,
    read_json,
    vehicle_entry,
    write_document,
)
from maneuver_automaton.formats.yaml_source import shown
from maneuver_automaton.primitives import Maneuver, Trajectory, Trim
from maneuver_automaton.receding_horizon import (
    ClosedLoop,
    Deed,
    Guarantee,
    Origin,
    Step,
    Violation,
)

SCHEMA = 1
COUNTED = ("time_s", "value", "accumulated_cost")  # of every entry of `steps`, numbers
APPLIED = ("applied_s", "applied_cost", "lower_bound", "solve_s")  # of those applied
MOST_STEPS = 1_000_000
NEEDED = ("schema", "automaton_hash", "reached", "steps", "step_s")
NOT_APPLIED = ("control", "word", "plan", "replanned", "solve_s")


def closed_loop_to_dict(loop: ClosedLoop, *, name: str = "") -> dict[str, Any]:
    """The content of closed_loop.json, as plain values; `name` is that of the scenario.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Cost, Horizon, Problem, Unicycle
    >>> from maneuver_automaton.receding_horizon import simulate
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1.0, 0.0)})
    >>> loop = simulate(Problem(robot, [-1, 0, 0], [0, 0, 0]), step=0.5)
    >>> document = closed_loop_to_dict(loop)
    >>> document["reached"], document["cost"], [step["value"] for step in document["steps"]]
    (True, 1.0, [1.0, 0.5, 0.0])
    """
    return {
        "schema": SCHEMA,
        "version": package_version(),
        "name": name,
        "vehicle": vehicle_entry(loop.problem.automaton.model),
        "automaton_hash": automaton_hash(loop.problem.automaton),
        "status": loop.status,
        "reason": loop.reason,
        "reached": loop.reached,
        "cost": loop.cost,
        "duration_s": float(loop.times[-1] - loop.times[0]),
        "step_s": loop.step,
        "steps_bound": loop.steps_bound,
        "audit": {
            "pieces": len(loop.audits),
            "failed": sum(not audit.passed for audit in loop.audits),
            "max_dynamics_defect": max(
                (float(audit.max_dynamics_defect) for audit in loop.audits), default=None
            ),
        },
        "min_clearance_m": loop.min_clearance_m,
        "collisions": len(list(loop.collisions)),
        "broken_guarantees": [
            {"step": number, "guarantee": one.guarantee.value, "reason": one.reason}
            for number, one in loop.violations
        ],
        "steps": [
            *(
                _step(step, where.tolist(), loop.problem.automaton)
                for step, where in zip(loop.steps, loop.poses, strict=False)
            ),
            _last(loop),
        ],
    }


def save_closed_loop(
    loop: ClosedLoop, path: Path | str, *, name: str = "", interrupted: bool = False
) -> None:
    """Write closed_loop.json in one step; `interrupted` by a signal it says so.

    The `name` of the scenario heads the pictures that are drawn of the file.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    write_document(closed_loop_to_dict(loop, name=name), path, interrupted=interrupted)


def load_steps(path: Path | str, automaton: Automaton) -> tuple[tuple[Step, ...], Array]:
    """The steps of a closed_loop.json, and where the vehicle was before each and at the end.

    Any of the steps is what a `RecedingHorizon` goes on from, with the pose after it.

    Parameters
    ----------
    path : Path or str
    automaton : Automaton
        The library that the loop was planned with.

    Returns
    -------
    steps : tuple of Step
    poses : (n + 1, dof) array

    Raises
    ------
    InvalidScenario
        If the file cannot be read, is no closed_loop.json, or belongs to another library.
    """
    document = read_json(path, needed=NEEDED, kind="closed loop")
    if document["automaton_hash"] != automaton_hash(automaton):
        raise InvalidScenario(f"{path}: automaton_hash: this loop was planned with another library")
    _check_entries(document["steps"], automaton, str(path))
    try:
        steps = tuple(
            _step_of(number, entry, automaton)
            for number, entry in enumerate(document["steps"][:-1])
        )
        poses = np.array([entry["vehicle_pose"] for entry in document["steps"]], dtype=np.float64)
        as_array("vehicle_pose", poses, last=automaton.model.group.dof)
    except (ValueError, KeyError, TypeError, IndexError, OverflowError) as error:
        said = f"misses the key {error}" if isinstance(error, KeyError) else str(error)
        raise InvalidScenario(f"{path}: {said}") from error
    return steps, poses


def _check_entries(entries: Any, automaton: Automaton, file: str) -> None:
    """Every entry has its times, costs, poses and controls, as numbers."""
    if not isinstance(entries, list) or not entries:
        raise InvalidScenario(f"{file}: steps: got {shown(entries)}, need a list of steps")
    before, last = -math.inf, len(entries) - 1
    for k, entry in enumerate(entries):
        place = Place(entry, file, ("steps", k))
        for key in COUNTED if k == last else (*COUNTED, *APPLIED):
            place.get(key, float)
        time = place.value["time_s"]
        if time < before:
            raise place.get("time_s", float).error(f"got {time:g}, need at least {before:g}")
        before = time
        for key in ("pose", "vehicle_pose"):
            pose = place.get(key, list)
            if len(pose.numbers()) != automaton.model.group.dof:
                raise pose.error(f"need {automaton.model.group.dof} numbers")
        if k < last:
            _check_applied(place, automaton)


def _check_applied(place: Place, automaton: Automaton) -> None:
    """The number, the plan and the control of a step that was applied."""
    number = place.get("number", int)
    if not 0 <= number.value < MOST_STEPS:
        raise number.error(f"got {number.value}, need 0 to {MOST_STEPS - 1}")
    plan = place.get("plan", list)
    for j in range(len(plan.value)):
        plan.item(j).get("name", str)
        plan.item(j).get("duration_s", float)
    trim = bool(plan.value) and plan.item(0).get("kind", str).value == "trim"
    if not trim and place.value.get("control", "") is None:
        return  # nothing was left to do, or the control of a maneuver varies
    control = place.get("control", list)
    if len(control.numbers()) != len(automaton.model.control_names):
        raise control.error(f"need {', '.join(automaton.model.control_names)}")


def _step(step: Step, vehicle_pose: list[float], automaton: Automaton) -> dict[str, Any]:
    return {
        "time_s": step.time,
        "pose": step.pose.tolist(),
        "value": step.value,
        "accumulated_cost": step.accumulated_cost,
        "control": None if step.control is None else step.control.tolist(),
        "word": list(step.plan.word),
        "plan": [
            _primitive(primitive, float(duration), automaton)
            for primitive, duration in zip(
                step.plan.primitives, step.plan.primitive_durations, strict=True
            )
        ],
        "replanned": step.replanned,
        "solve_s": step.solve_s,
        "number": step.number,
        "vehicle_pose": vehicle_pose,
        "measured_pose": None if step.measured is None else step.measured.tolist(),
        "goal": step.goal_index,
        "applied_s": step.applied,
        "applied_cost": step.applied_cost,
        "origin": step.origin.value,
        "value_of_the_rest": step.shifted_value,
        "off_plan": step.off_plan,
        "lower_bound": step.lower_bound,
        "gap": step.gap,
        "exhaustive": step.exhaustive,
        "arrived": step.arrived,
        "deed": step.deed.value,
        "free_until_s": step.free_until,
        "clearance_m": step.clearance_m,
        "broken_guarantees": [
            {"guarantee": one.guarantee.value, "reason": one.reason} for one in step.violations
        ],
    }


def _primitive(primitive: Primitive, duration: float, automaton: Automaton) -> dict[str, Any]:
    """A trim or maneuver by its name; with what it does if the library holds none such."""
    if isinstance(primitive, Trim):
        entry = {
            "kind": "trim",
            "name": primitive.name,
            "control": primitive.control.tolist(),
            "duration_s": duration,
        }
        if not automaton.is_kinematic and primitive.name not in automaton.trim_names:
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


def _last(loop: ClosedLoop) -> dict[str, Any]:
    pose = loop.poses[-1].tolist()
    return {
        "time_s": float(loop.times[-1]),
        "pose": pose,
        "value": loop.value if math.isfinite(loop.value) else 0.0,
        "accumulated_cost": loop.cost,
        **dict.fromkeys(NOT_APPLIED),
        "vehicle_pose": pose,
    }


def _step_of(number: int, entry: Mapping[str, Any], automaton: Automaton) -> Step:
    where = f"steps[{number}]"
    pose = as_array(f"{where}.pose", entry["pose"], last=automaton.model.group.dof)
    plan = _plan(pose, entry["plan"], float(entry["time_s"]), automaton)
    return Step(
        time=float(entry["time_s"]),
        pose=pose,
        plan=plan,
        goal_index=int(entry["goal"]),
        value=float(entry["value"]),
        applied=float(entry["applied_s"]),
        applied_cost=float(entry["applied_cost"]),
        accumulated_cost=float(entry["accumulated_cost"]),
        origin=Origin(entry["origin"]),
        replanned=bool(entry["replanned"]),
        shifted_value=entry["value_of_the_rest"],
        off_plan=entry["off_plan"],
        lower_bound=float(entry["lower_bound"]),
        exhaustive=bool(entry["exhaustive"]),
        solve_s=float(entry["solve_s"]),
        number=int(entry["number"]),
        arrived=bool(entry["arrived"]),
        deed=Deed(entry["deed"]),
        free_until=entry["free_until_s"],
        clearance_m=entry["clearance_m"],
        measured=None if entry["measured_pose"] is None else np.array(entry["measured_pose"]),
        violations=tuple(
            Violation(guarantee=Guarantee(one["guarantee"]), reason=one["reason"])
            for one in entry["broken_guarantees"]
        ),
    )


def _plan(
    pose: Array, entries: list[Mapping[str, Any]], start_time: float, automaton: Automaton
) -> Plan:
    """The plan of a step; one with maneuvers has those of the library, the first cut if need be."""
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
        return _written(entry)
    begun = one.duration - float(entry["duration_s"])
    if begun <= 0.0:
        return one
    trims = (automaton[one.source], automaton[one.target])
    still = np.zeros(automaton.model.group.dof)
    whole = Plan(still, trims, durations=[0.0, 0.0], maneuvers=(one,))
    rest = tail_of(with_samples_at(whole, [begun], automaton.model), begun)
    assert rest.maneuvers[0] is not None
    return rest.maneuvers[0]


def _written(entry: Mapping[str, Any]) -> Maneuver:
    """A maneuver whose course is written in the log."""
    if "course" not in entry:
        raise ValueError(f"maneuver {entry['name']!r}: the library has none of this name and ends")
    course = Trajectory(
        **{
            name: np.array(entry["course"][name], dtype=np.float64)
            for name in ("time", "pose", "reduced_state", "control")
        }
    )
    return Maneuver.along(
        course,
        name=entry["name"],
        source=entry["source"],
        target=entry["target"],
    )


def _trim(entry: Mapping[str, Any], automaton: Automaton) -> Trim:
    """The trim of the library; one at another pace is made from its control."""
    name, control = entry["name"], entry["control"]
    if name in automaton.trim_names:
        trim = automaton.trims[automaton.index_of(name)]
        if trim.control.tolist() == control:
            return trim
    return Automaton.of_controls(automaton.model, {name: control}).trims[0]

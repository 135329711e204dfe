"""closed_loop.json: what a closed loop did, and the loop taken up again from it.

Strict JSON; numbers read back to the last bit, so a loop that was stopped goes on as if it had
not been. One entry per step applied, and a last one where the vehicle ended.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.library import automaton_hash
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.json_source import Place
from maneuver_automaton.formats.plan_json import (
    package_version,
    read_json,
    vehicle_entry,
    write_document,
)
from maneuver_automaton.formats.word_json import plan_entries, plan_of_entries
from maneuver_automaton.formats.yaml_source import shown
from maneuver_automaton.planning.polishing import left_out
from maneuver_automaton.receding_horizon import (
    ClosedLoop,
    Decision,
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
        "notes": list(left_out(loop.problem)),
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
        "broken_guarantees": entries_of(loop.violations),
        "disturbed": entries_of(loop.disturbed),
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
        "plan": plan_entries(step.plan, automaton),
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
        "decision": step.decision.value,
        "free_until_s": step.free_until,
        "clearance_m": step.clearance_m,
        "broken_guarantees": [_violation(one) for one in step.violations],
        "disturbed": [_violation(one) for one in step.disturbed],
    }


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
    plan = plan_of_entries(pose, entry["plan"], float(entry["time_s"]), automaton)
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
        decision=Decision(entry["decision"] if "decision" in entry else entry["deed"]),
        free_until=entry["free_until_s"],
        clearance_m=entry["clearance_m"],
        measured=None if entry["measured_pose"] is None else np.array(entry["measured_pose"]),
        violations=_violations(entry["broken_guarantees"]),
        disturbed=_violations(entry.get("disturbed", ())),
    )


def entries_of(found: Iterable[tuple[int, Violation]]) -> list[dict[str, Any]]:
    """Guarantees with the numbers of their steps, as the files have them."""
    return [{"step": number, **_violation(one)} for number, one in found]


def _violation(one: Violation) -> dict[str, Any]:
    return {"guarantee": one.guarantee.value, "reason": one.reason}


def _violations(entries: Iterable[Mapping[str, Any]]) -> tuple[Violation, ...]:
    return tuple(
        Violation(guarantee=Guarantee(one["guarantee"]), reason=one["reason"]) for one in entries
    )

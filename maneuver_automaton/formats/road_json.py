"""Plans and drives on roads as plan.json and closed_loop.json, in the words of the other files.

A primitive is a trim, which holds speed and steering angle, or a maneuver, which changes them at
constant rates. Poses are those of the rear axle. What does not apply to roads is null.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._files import write_text_atomically
from maneuver_automaton.formats.plan_json import package_version
from maneuver_automaton.primitives import Trajectory
from maneuver_automaton.roads import (
    RoadDrive,
    RoadPlan,
    RoadPlanner,
    RoadPlanResult,
    RoadStep,
    RoadVerdict,
)
from maneuver_automaton.roads.library import RoadLibrary

SCHEMA = 1
SAME = 1e-9  # of two controls in a row


def road_plan_to_dict(result: RoadPlanResult) -> dict[str, Any]:
    """The content of plan.json; without a plan the numbers are null and the lists empty."""
    planner, plan, verdict = result.planner, result.plan, result.verdict
    found = plan is not None
    n = plan.lasting if plan is not None else 0
    return {
        "schema": SCHEMA,
        "version": package_version(),
        "automaton_hash": library_hash(planner.library),
        "status": "found" if found else "no_plan",
        "reason": result.reason,
        "cost": None if plan is None else planner.price(plan),
        "duration_s": planner.tick * n if found else None,
        "lower_bound": None,
        "gap": None,
        "certificate": None,
        "primitives": [] if plan is None else _primitives(planner, plan, 0, n),
        "stop": [] if plan is None else _primitives(planner, plan, n),
        "terminal_error": None,
        "clearance_m": None if verdict is None else _number(verdict.clearance_m),
        "trajectory": _trajectory(result.driven),
        "audit": None if verdict is None else _audit(verdict),
        "alternatives": [],
        "timing_s": {"search": result.search_s},
        "counts": {},
    }


def road_drive_to_dict(drive: RoadDrive, *, before: RoadPlanResult | None = None) -> dict[str, Any]:
    """The content of closed_loop.json; `before` is the search that was made before the start."""
    spent = np.concatenate([[0.0], np.cumsum([step.applied_cost for step in drive.steps])])
    verdict, end = drive.verdict, drive.driven
    broken = [("no collision", name) for name in verdict.hit]
    if verdict.off_road:
        broken.append(("on the road", f"outside the lanelets at {verdict.off_road} poses"))
    return {
        "schema": SCHEMA,
        "version": package_version(),
        "automaton_hash": library_hash(drive.planner.library),
        "status": drive.status,
        "reason": drive.reason,
        "reached": drive.reached,
        "cost": float(spent[-1]),
        "duration_s": float(end.time[-1] - end.time[0]),
        "step_s": drive.planner.tick,
        "steps_bound": None,
        "planned_before_s": None if before is None else before.search_s,
        "audit": {**_audit(verdict), "pieces": len(drive.steps), "failed": len(broken)},
        "min_clearance_m": _number(verdict.clearance_m),
        "collisions": verdict.collisions,
        "broken_guarantees": [
            {"step": None, "guarantee": what, "reason": reason} for what, reason in broken
        ],
        "steps": [
            *(
                _step(drive.planner, step, float(cost))
                for step, cost in zip(drive.steps, spent, strict=False)
            ),
            {
                "time_s": float(end.time[-1]),
                "pose": end.pose[-1].tolist(),
                "reduced_state": end.reduced_state[-1].tolist(),
                "value": 0.0,
                "accumulated_cost": float(spent[-1]),
                **dict.fromkeys(("control", "word", "plan", "replanned", "solve_s")),
            },
        ],
    }


def save_road_document(document: dict[str, Any], path: Path | str) -> None:
    """Write a document in one step, strict JSON, one entry of a long list a line.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    lines = [f"  {json.dumps(key)}: {_json(key, value)}" for key, value in document.items()]
    write_text_atomically(Path(path), "{\n" + ",\n".join(lines) + "\n}\n")


def primitives_of(controls: Array, states: Array, *, tick: float = 0.1) -> list[dict[str, Any]]:
    """Controls (n, 2), a `tick` [s] each, as primitives.

    `states` (n, 5) are those at their beginnings.

    Examples
    --------
    >>> controls = np.array([[2.0, 0.0], [2.0, 0.0], [0.0, 0.0]])
    >>> states = np.array([[0, 0, 0, 5.0, 0], [0, 0, 0, 5.2, 0], [0, 0, 0, 5.4, 0]])
    >>> [(one["kind"], round(one["duration_s"], 3)) for one in primitives_of(controls, states)]
    [('maneuver', 0.2), ('trim', 0.1)]
    """
    if not len(controls):
        return []
    changes = np.flatnonzero((np.abs(np.diff(controls, axis=0)) > SAME).any(axis=1)) + 1
    bounds = [0, *changes.tolist(), len(controls)]
    return [_primitive(controls[a], states[a], b - a, tick) for a, b in itertools.pairwise(bounds)]


def _primitives(
    planner: RoadPlanner, plan: RoadPlan, begin: int = 0, end: int | None = None
) -> list[dict[str, Any]]:
    """Primitives of a plan from one of its ticks to another."""
    return primitives_of(plan.controls[begin:end], plan.states[begin:end], tick=planner.tick)


def library_hash(library: RoadLibrary) -> str:
    """Hash of the trims and maneuvers."""
    digest = hashlib.sha256()
    for part in (*library.trims[:2], library.maneuvers.target, library.maneuvers.control):
        digest.update(np.ascontiguousarray(part).tobytes())
    return digest.hexdigest()


def _primitive(control: Array, state: Array, ticks: int, tick: float) -> dict[str, Any]:
    trim = not control.any()
    speed, steering = state[3:].tolist()
    name = (
        f"speed {speed:.4g}, steering {steering:.3g}"
        if trim
        else f"acceleration {control[0]:.4g}, steering rate {control[1]:.3g}"
    )
    return {
        "kind": "trim" if trim else "maneuver",
        "name": name,
        "control": control.tolist(),
        "duration_s": tick * ticks,
    }


def _step(planner: RoadPlanner, step: RoadStep, spent: float) -> dict[str, Any]:
    plan = _primitives(planner, step.plan)
    return {
        "time_s": step.time,
        "pose": planner.world(step.state[:3]).tolist(),
        "reduced_state": step.state[3:].tolist(),
        "value": step.value,
        "accumulated_cost": spent,
        "control": step.control.tolist(),
        "word": [one["name"] for one in plan],
        "plan": plan,
        "replanned": step.replanned,
        "solve_s": step.solve_s,
        "number": step.number,
        "reaches": step.plan.reaches,
        "lasting_s": planner.tick * step.plan.lasting,
        "stops": step.plan.stops,
    }


def _trajectory(driven: Trajectory | None) -> dict[str, Any]:
    if driven is None:
        return {key: [] for key in ("origin", "time_s", "pose", "reduced_state", "control")}
    return {
        "origin": [0.0, 0.0],
        "time_s": driven.time.tolist(),
        "pose": driven.pose.tolist(),
        "reduced_state": driven.reduced_state.tolist(),
        "control": driven.control.tolist(),
    }


def _audit(verdict: RoadVerdict) -> dict[str, Any]:
    return {
        "passed": verdict.clean,
        "max_dynamics_defect": verdict.defect,
        "min_clearance_m": _number(verdict.clearance_m),
        "min_edge_m": _number(verdict.edge_m),
        "off_road": verdict.off_road,
    }


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _json(key: str, value: Any) -> str:
    if key in ("steps", "primitives", "stop") and isinstance(value, Sequence) and value:
        rows = ",\n".join(f"    {_json('', row)}" for row in value)
        return f"[\n{rows}\n  ]"
    return json.dumps(value, ensure_ascii=False, allow_nan=False)

"""closed_loop.json of several vehicles: what each did, and what holds of them together.

Strict JSON; numbers read back to the last bit. Names are those of one vehicle's closed_loop.json
wherever they mean the same: under `vehicles` each has steps as that file has them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.automaton.library import automaton_hash
from maneuver_automaton.fleet import FleetLog, FleetStep, FleetViolation, Swap
from maneuver_automaton.fleet.driven import DrivenVerdict
from maneuver_automaton.formats.closed_loop_json import NOT_APPLIED
from maneuver_automaton.formats.fleet_json import closest_entry, finite_number, source_entry
from maneuver_automaton.formats.plan_json import (
    FLEET,
    SCHEMA,
    package_version,
    vehicle_entry,
    write_document,
)
from maneuver_automaton.formats.word_json import plan_entries
from maneuver_automaton.planning.polishing import left_out
from maneuver_automaton.problem import Problem

NOT_DECIDED = ("gap_m", "distance_m", "solve_s")  # of the last entry of `steps`
LISTED = ("swaps", "asked", "void", "refused", "broken_guarantees")  # empty there


def fleet_loop_to_dict(log: FleetLog, driven: DrivenVerdict, *, name: str = "") -> dict[str, Any]:
    """The content of closed_loop.json for several vehicles, as plain values.

    Parameters
    ----------
    log : FleetLog
    driven : DrivenVerdict
        What `verify_driven` says of it.
    name : str
        Of the scenario.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Disc, Problem, Unicycle
    >>> from maneuver_automaton.fleet import FleetProblem, simulate_fleet, verify_driven
    >>> robot = Automaton.of_controls(Unicycle(), {"rest": (0, 0), "on": (1, 0), "spin": (0, 1)})
    >>> rows = [Problem(robot, [0, y, 0], [2, y, 0], footprint=Disc(0.3)) for y in (0.0, 1.0)]
    >>> log = simulate_fleet(FleetProblem(rows, names=["a", "b"]), step=0.5, first_time_limit=1.0)
    >>> document = fleet_loop_to_dict(log, verify_driven(log))
    >>> document["kind"], document["status"], document["cost"], len(document["steps"])
    ('fleet', 'reached', 4.0, 6)
    >>> [step["value"] for step in document["vehicles"]["a"]["steps"]]
    [2.0, 1.5, 1.0, 0.5, 0.0, 0.0]
    """
    fleet, times = log.problem, log.times
    vehicles = {
        one: _vehicle(log, one, problem)
        for one, problem in zip(fleet.names, fleet.problems, strict=True)
    }
    return {
        "schema": SCHEMA,
        "version": package_version(),
        "kind": FLEET,
        "name": name,
        "status": log.status,
        "reason": log.reason,
        "notes": list(left_out(*fleet.problems)),
        "reached": log.reached,
        "cost": float(log.cost),
        "duration_s": float(times[-1] - times[0]),
        "step_s": float(log.step),
        "sum_s": float(log.sum_s),
        "last_s": float(log.last_s),
        "clearance_m": {
            "between": finite_number(driven.distance_m),
            "to_obstacles": finite_number(driven.clearance_m),
        },
        "closest": [closest_entry(one) for one in driven.closest],
        "collisions": list(driven.collisions),
        "broken_guarantees": [
            {"step": number, **_broken(violation)} for number, violation in log.violations
        ],
        "counts": {key: int(value) for key, value in log.counts.items()},
        "vehicles": vehicles,
        "steps": _steps(log, vehicles),
    }


def save_fleet_loop(
    log: FleetLog,
    path: Path | str,
    *,
    driven: DrivenVerdict,
    name: str = "",
    source: Mapping[str, Any] | None = None,
    interrupted: bool = False,
) -> None:
    """Write closed_loop.json of several vehicles in one step.

    Parameters
    ----------
    log : FleetLog
    path : Path or str
    driven : DrivenVerdict
        What `verify_driven` says of it.
    name : str
        Of the scenario, which heads pictures.
    source : mapping, optional
        The files that it was driven from, for `check` and `plot`: `file`, `with`, `case`. Paths are
        written as seen from the file.
    interrupted : bool
        Whether a signal came before the loop was over, which the file says then.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    document = fleet_loop_to_dict(log, driven, name=name)
    if source is not None:
        document["source"] = source_entry(source, Path(path))
    write_document(document, path, interrupted=interrupted)


# -- all together


def _steps(log: FleetLog, vehicles: Mapping[str, Any]) -> list[dict[str, Any]]:
    """What holds of all vehicles in each step, and where it ended."""
    spent = {name: {e["time_s"]: e for e in one["steps"]} for name, one in vehicles.items()}
    known = dict.fromkeys(vehicles, 0.0)
    rows = []
    for step, value in zip(log.steps, log.values.tolist(), strict=True):
        for name, entries in spent.items():
            if step.time in entries:
                known[name] = entries[step.time]["accumulated_cost"]
        rows.append(
            {
                "time_s": float(step.time),
                "value": finite_number(value),
                "accumulated_cost": math.fsum(known.values()),
                "number": step.number,
                "swaps": [_swap(one) for one in step.swaps],
                "asked": list(step.asked),
                "void": list(step.void),
                "refused": list(step.refused),
                "arrived": list(step.arrived),
                "gap_m": finite_number(step.gap_m),
                "distance_m": finite_number(step.distance_m),
                "solve_s": float(step.solve_s),
                "broken_guarantees": [_broken(one) for one in step.violations],
            }
        )
    return [*rows, _ended(log, vehicles)]


def _ended(log: FleetLog, vehicles: Mapping[str, Any]) -> dict[str, Any]:
    last = [one["steps"][-1] for one in vehicles.values()]
    values = [
        one["steps"][-1]["value"] for name, one in vehicles.items() if name not in log.broken_down
    ]
    return {
        "time_s": float(log.times[-1]),
        "value": None if None in values else math.fsum(values),
        "accumulated_cost": math.fsum(one["accumulated_cost"] for one in last),
        "arrived": sorted(log.arrived_s),
        **{key: [] for key in LISTED},
        **dict.fromkeys(NOT_DECIDED),
    }


def _swap(swap: Swap) -> dict[str, Any]:
    return {
        "vehicles": list(swap.names),
        "before": finite_number(swap.before),
        "after": float(swap.after),
        "past": {name: int(version) for name, version in swap.past},
        "holds": {name: int(version) for name, version in swap.holds},
    }


def _broken(violation: FleetViolation) -> dict[str, Any]:
    return {
        "guarantee": violation.guarantee.value,
        "vehicles": list(violation.names),
        "reason": violation.reason,
    }


# -- one vehicle


def _vehicle(log: FleetLog, name: str, problem: Problem) -> dict[str, Any]:
    """What one vehicle did, as closed_loop.json of one vehicle says it."""
    automaton, pieces = problem.automaton, log.pieces_of(name)
    spent = list(accumulate(log.costs_of(name).values(), initial=0.0))
    rows, held = [], None
    for cost, (k, piece) in zip(spent, pieces.items(), strict=False):
        step = log.steps[k]
        rows.append(_row(step, name, piece, cost, held, problem))
        held = step.plans[name]
    broken, arrived = name in log.broken_down, log.arrived_s.get(name)
    status = "broken_down" if broken else "under_way" if arrived is None else "arrived"
    return {
        "vehicle": vehicle_entry(automaton.model),
        "automaton_hash": automaton_hash(automaton),
        "status": status if pieces else "not_there" if arrived is None else status,
        "reached": arrived is not None,
        "arrived_s": None if arrived is None else float(arrived),
        "cost": spent[-1],
        "steps": [*rows, _last_row(log, name, problem, spent[-1])],
    }


def _row(
    step: FleetStep, name: str, piece: Plan, cost: float, held: Plan | None, problem: Problem
) -> dict[str, Any]:
    plan, automaton = step.driven[name], problem.automaton
    now, control = step.plans[name], step.control_of(name)
    exchanged = {one for swap in step.swaps for one in swap.names} | set(step.void)
    return {
        "time_s": float(step.time),
        "pose": plan.start.tolist(),
        "value": finite_number(step.values[name]),
        "accumulated_cost": cost,
        "control": None if control is None else control.tolist(),
        "word": list(plan.word),
        "plan": plan_entries(plan, automaton),
        "replanned": name in exchanged,
        "number": step.number,
        "vehicle_pose": piece.start.tolist(),
        "measured_pose": step.poses[name].tolist(),
        "arrival_s": finite_number(step.arrivals[name]),
        "off_plan_m": float(step.off_plan[name]),
        "plan_time_s": float(plan.start_time),
        "held": None if now is held else _held(now, automaton),
        "driven": plan_entries(piece, automaton) if _is_other(piece, plan) else None,
    }


def _held(plan: Plan, automaton: Automaton) -> dict[str, Any]:
    """The plan that is held from a step on, from where and when it began."""
    return {
        "time_s": float(plan.start_time),
        "pose": plan.start.tolist(),
        "plan": plan_entries(plan, automaton),
    }


def _is_other(piece: Plan, plan: Plan) -> bool:
    """Whether what was driven is not the begin of the plan, but of other velocities."""
    return any(
        not np.array_equal(one.body_velocity, other.body_velocity)
        for one, other in zip(piece.trims, plan.trims, strict=False)
    )


def _last_row(log: FleetLog, name: str, problem: Problem, cost: float) -> dict[str, Any]:
    """Where a vehicle ended: at the end of the loop, or where it left."""
    when, pose, value = _end_of(log, name, problem)
    return {
        "time_s": when,
        "pose": pose.tolist(),
        "value": finite_number(value),
        "accumulated_cost": cost,
        **dict.fromkeys(NOT_APPLIED),
        "vehicle_pose": pose.tolist(),
    }


def _end_of(log: FleetLog, name: str, problem: Problem) -> tuple[float, Array, float]:
    """When and where a vehicle ended, and what it had left to pay."""
    pieces = log.pieces_of(name)
    if not pieces:
        return float(log.times[0]), problem.start, math.inf
    k, piece = next(reversed(pieces.items()))
    gone = next((step for step in log.steps[k + 1 :] if name in step.plans), None)
    if gone is not None:  # it has arrived, and left
        return float(gone.time), gone.poses[name], 0.0
    value = 0.0 if name in log.arrived_s else log.steps[k].values[name] - log.costs_of(name)[k]
    return float(log.times[k + 1]), piece.end, max(value, 0.0)

"""Plans and drives on roads as plan.json and closed_loop.json, in the words of the other files.

Poses are those of the rear axle. What does not apply to roads is null.
"""

from __future__ import annotations

import hashlib
import math
from typing import Annotated, Any, Literal, NotRequired

import numpy as np
from pydantic import Field
from typing_extensions import TypedDict

from maneuver_automaton.automaton import Plan
from maneuver_automaton.formats.documents import (
    FLEET,
    BrokenEntry,
    ClearanceEntry,
    ClosestEntry,
    DocumentHead,
    ModelEntry,
    document_of,
    vehicle_entry,
)
from maneuver_automaton.formats.entries import Flag, Known, Number, Whole, entry, number, of, says
from maneuver_automaton.formats.plan_json import (
    PlanDocument,
    PrimitiveEntry,
    primitive_entries,
    trajectory_entry,
)
from maneuver_automaton.primitives import Maneuver
from maneuver_automaton.recording.road_drives import joint_notes
from maneuver_automaton.roads import (
    RoadDrive,
    RoadFleetDrive,
    RoadFleetResult,
    RoadPlanner,
    RoadPlanResult,
    RoadStep,
    RoadVerdict,
)

GUARANTEES = {"touched": "no collision", "off_road": "on the road", "undrivable": "drivable"}


class RoadAuditEntry(TypedDict):
    """What the judge found."""

    passed: Annotated[Flag, of("clean")]
    max_dynamics_defect: Number
    min_clearance_m: Annotated[Known, of("clearance_m"), says("to any road user")]
    min_edge_m: Annotated[Known, of("edge_m"), says("of the body to the edge of the road")]
    off_road: Annotated[Whole, says("1 if the road was left")]
    pieces: NotRequired[Annotated[Whole, says("of a drive: steps")]]
    failed: NotRequired[Annotated[Whole, says("of a drive: faults")]]


class RoadPlanDocument(PlanDocument):
    """A plan on a road."""

    audit: RoadAuditEntry | None  # type: ignore[misc]
    stop: Annotated[list[PrimitiveEntry], says("how it stops where it cannot go on")]


class DriveStepEntry(TypedDict):
    """A step of a drive; in the last entry, where it ended, the plan is null."""

    time_s: Number
    pose: Annotated[list[Number], says("of the rear axle")]
    reduced_state: Annotated[list[Number], says("speed and steering")]
    value: Number
    accumulated_cost: Number
    control: list[Number] | None
    word: list[str] | None
    plan: list[PrimitiveEntry] | None
    replanned: Flag | None
    solve_s: Known
    number: NotRequired[Whole]
    reaches: NotRequired[Annotated[Flag, says("the plan leads to a goal")]]
    lasting_s: NotRequired[Number]
    stops: NotRequired[Annotated[Flag, says("the plan stops on the way")]]


class DriveDocument(DocumentHead):
    """A drive on a road."""

    vehicle: NotRequired[ModelEntry | None]
    automaton_hash: NotRequired[str]
    status: NotRequired[str]
    reached: Flag
    cost: NotRequired[Number]
    duration_s: NotRequired[Number]
    step_s: Number
    steps_bound: NotRequired[None]
    planned_before_s: NotRequired[Annotated[Known, says("the search before the start")]]
    audit: NotRequired[RoadAuditEntry]
    min_clearance_m: NotRequired[Known]
    collisions: NotRequired[Whole]
    broken_guarantees: NotRequired[list[BrokenEntry]]
    steps: Annotated[list[DriveStepEntry], Field(min_length=1)]


class SeveralEntry(DocumentHead):
    """What files of several vehicles on one road have."""

    kind: Literal["fleet"]
    status: str
    cost: NotRequired[Annotated[Known, says("sum of the costs")]]
    last_s: NotRequired[Annotated[Number, says("when the last one arrives")]]
    clearance_m: NotRequired[ClearanceEntry]
    closest: NotRequired[list[ClosestEntry]]


class RoadFleetDocument(SeveralEntry):
    """Plans of several vehicles on one road."""

    sum_s: NotRequired[Number]
    order: NotRequired[Annotated[list[str], says("in which they were planned")]]
    timing_s: NotRequired[dict[str, Known]]
    vehicles: dict[str, RoadPlanDocument]


class RoadFleetDriveDocument(SeveralEntry):
    """Drives of several vehicles on one road."""

    reached: Flag
    duration_s: NotRequired[Number]
    planned_before_s: NotRequired[Known]
    collisions: NotRequired[Whole]
    vehicles: dict[str, DriveDocument]


def road_plan_to_dict(result: RoadPlanResult) -> RoadPlanDocument:
    """The content of plan.json; without a plan the numbers are null and the lists empty."""
    plan, verdict = result.plan, result.verdict
    return document_of(
        RoadPlanDocument,
        result,
        **_library(result.planner),
        **dict.fromkeys(("lower_bound", "bound", "gap", "certificate", "terminal_error")),
        status="no_plan" if plan is None else "found",
        duration_s=None if plan is None else plan.duration,
        primitives=_primitives(plan),
        stop=_primitives(result.stop),
        clearance_m=None if verdict is None else verdict.clearance_m,
        trajectory=trajectory_entry(plan),
        audit=None if verdict is None else _audit(verdict),
        alternatives=[],
        timing_s={"search": result.search_s},
        counts={},
        improvements=[],
    )


def road_fleet_to_dict(result: RoadFleetResult, *, status: str, reason: str) -> RoadFleetDocument:
    """The content of plan.json for several vehicles on one road."""
    return document_of(
        RoadFleetDocument,
        result,
        **_together(result),
        status=status,
        reason=reason,
        cost=math.fsum(one.cost or 0.0 for one in result.results.values() if one.plan),
        sum_s=math.fsum(plan.duration for plan in result.plans.values()),
        timing_s={"search": result.search_s},
        vehicles={
            name: {**road_plan_to_dict(one), "name": name} for name, one in result.results.items()
        },
    )


def road_fleet_drive_to_dict(drive: RoadFleetDrive) -> RoadFleetDriveDocument:
    """The content of closed_loop.json for several vehicles on one road."""
    vehicles = {
        name: DriveDocument(
            **{**road_drive_to_dict(one, before=drive.before.results[name]), "name": name}
        )
        for name, one in drive.results.items()
    }
    return document_of(
        RoadFleetDriveDocument,
        drive,
        **_together(drive),
        cost=math.fsum(one["cost"] for one in vehicles.values()),
        duration_s=max((plan.duration for plan in drive.plans.values()), default=0.0),
        planned_before_s=drive.before.search_s,
        collisions=sum(one.verdict.collisions for one in drive.results.values()),
        vehicles=vehicles,
    )


def _together(fleet: RoadFleetResult | RoadFleetDrive) -> dict[str, Any]:
    """What holds of several vehicles on one road together."""
    ends = (plan.start_time + plan.duration for plan in fleet.plans.values())
    verdicts = [one.verdict for one in fleet.results.values() if one.verdict is not None]
    near = min((one.clearance_m for one in verdicts), default=None)
    return {
        "kind": FLEET,
        "last_s": max(ends, default=0.0),
        "clearance_m": {"between": number(fleet.distance_m), "to_obstacles": number(near)},
        "closest": fleet.pairs,
        "notes": joint_notes(fleet),
    }


def road_drive_to_dict(drive: RoadDrive, *, before: RoadPlanResult | None = None) -> DriveDocument:
    """The content of closed_loop.json; `before` is the search that was made before the start."""
    spent = np.concatenate([[0.0], np.cumsum([step.applied_cost for step in drive.steps])])
    verdict, driven = drive.verdict, drive.driven
    return document_of(
        DriveDocument,
        drive,
        **_library(drive.planner),
        cost=spent[-1],
        duration_s=driven.duration,
        step_s=drive.planner.scene.step,
        steps_bound=None,
        planned_before_s=None if before is None else before.search_s,
        audit={**_audit(verdict), "pieces": len(drive.steps), "failed": len(verdict.faults)},
        min_clearance_m=verdict.clearance_m,
        collisions=verdict.collisions,
        broken_guarantees=[
            {"step": None, "guarantee": GUARANTEES[what], "reason": reason}
            for what, reason in verdict.faults
        ],
        steps=[
            *(
                _step(drive.planner, step, float(cost))
                for step, cost in zip(drive.steps, spent, strict=False)
            ),
            entry(
                DriveStepEntry,
                None,
                time_s=driven.start_time + driven.duration,
                pose=driven.end,
                reduced_state=driven.trims[-1].reduced_state,
                value=0.0,
                accumulated_cost=spent[-1],
            ),
        ],
    )


def _library(planner: RoadPlanner) -> dict[str, Any]:
    """The keys that name a road, a vehicle and its library."""
    digest, library = hashlib.sha256(), planner.library
    for part in (*library.trims[:2], library.maneuvers.target, library.maneuvers.control):
        digest.update(np.ascontiguousarray(part).tobytes())
    return {
        "name": planner.scene.name,
        "vehicle": vehicle_entry(planner.vehicle.model),
        "automaton_hash": digest.hexdigest(),
    }


def _primitives(plan: Plan | None) -> list[PrimitiveEntry]:
    """Trims and maneuvers in order; a maneuver on roads has one control throughout."""
    entries = primitive_entries(plan)
    for row, one in zip(entries, () if plan is None else plan.primitives, strict=True):
        if isinstance(one, Maneuver) and one.course is not None:
            row["control"] = one.course.control[0].tolist()
    return entries


def _step(planner: RoadPlanner, step: RoadStep, spent: float) -> DriveStepEntry:
    decision = step.decision
    # Words need no samples, which take most of the time to make.
    held = planner.plan_of(step.state, decision.controls, tick=decision.tick, max_step=math.inf)
    plan = _primitives(held)
    return entry(
        DriveStepEntry,
        step,
        pose=planner.world(step.state[:3]),
        reduced_state=step.state[3:],
        accumulated_cost=spent,
        word=[one["name"] for one in plan],
        plan=plan,
        reaches=decision.reaches,
        lasting_s=planner.tick * decision.lasting,
        stops=decision.stops,
    )


def _audit(verdict: RoadVerdict) -> RoadAuditEntry:
    defect = verdict.audit.max_dynamics_defect
    return entry(RoadAuditEntry, verdict, max_dynamics_defect=defect)

"""`plan` and `mpc` of a CommonRoad file: one drive on roads, or several, each past all others."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from maneuver_automaton._interrupts import patient, stopped
from maneuver_automaton.cli.guard import complain
from maneuver_automaton.cli.inputs import states_several
from maneuver_automaton.cli.jobs import INTERRUPTED, Job, JobResult
from maneuver_automaton.cli.loop_tables import times_of
from maneuver_automaton.cli.progress import progress_bar, waiting
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.documents import source_entry, write_document
from maneuver_automaton.formats.road_json import (
    joint_notes,
    road_drive_to_dict,
    road_fleet_drive_to_dict,
    road_fleet_to_dict,
    road_plan_to_dict,
)
from maneuver_automaton.roads import (
    RoadDrive,
    RoadFleetDrive,
    RoadFleetResult,
    RoadPlanResult,
    RoadScene,
    RoadVehicle,
    drive_roads,
    drive_scene,
    plan_before,
    plan_road,
    plan_roads,
    road_planner,
)
from maneuver_automaton.roads.search_arrays import LONGEST
from maneuver_automaton.roads.vehicle import tick_of
from maneuver_automaton.scenario import RoadScenario, load_roads, load_scenario

TIME_LIMIT = 10.0  # [s] of one plan
COLUMNS = ["vehicle", "status", "cost", "arrival [s]", "clearance [m]", "edge [m]"]
Facts = Mapping[str, str]


def planned(job: Job, _: None) -> JobResult:
    """Plan one drive, or all of them."""
    if states_several(job.path, job.parts):
        return _plans(job)
    found = _scenario(job)
    limit = job.options.budgets.time_limit or TIME_LIMIT
    with waiting(f"planning, at most {limit:g} s", quiet=job.options.quiet):
        try:
            result = plan_road(found.scene, found.vehicle, time_limit=limit)
        except ValueError as error:
            raise job.wrong(error) from error
    if stopped() and result.plan is None:
        result = replace(result, reason=INTERRUPTED)
    status = "found" if result.plan is not None else "out_of_budget" if stopped() else "no_plan"
    document = road_plan_to_dict(result) | {"status": status}
    return _outcome(
        result,
        document,
        name=found.scene.name,
        facts=_plan_facts(result),
        done=result.plan is not None,
        complaint=f"{status}: {result.reason}",
        first_plan=result.search_s,
    )


def driven(job: Job, _: None) -> JobResult:
    """Close the loop of one drive, or of all of them.

    Where the search of one step finds no plan to a goal from the start, a wider one is made before
    the vehicle sets off, and told apart from the steps.
    """
    if states_several(job.path, job.parts):
        return _drives(job)
    found, budgets = _scenario(job), job.options.budgets
    with patient():
        try:
            planner = road_planner(found.scene, found.vehicle)
        except ValueError as error:
            raise job.wrong(error) from error
        limit = budgets.time_limit or TIME_LIMIT
        with waiting(f"planning before the start, at most {limit:g} s", quiet=job.options.quiet):
            before = plan_before(planner, time_limit=limit)
        if before is not None and before.plan is None and planner.hopeless() is None:
            complain(f"{job.path}: no plan before the start: {before.reason}")
        most = min(budgets.steps or planner.last_tick, planner.last_tick)
        with progress_bar("steps", most, quiet=job.options.quiet) as advance:
            drive = drive_scene(
                planner,
                steps=budgets.steps,
                first=None if before is None else before.decision,
                progress=lambda _: advance(),
            )
    return _outcome(
        drive,
        road_drive_to_dict(drive, before=before),
        name=found.scene.name,
        facts=_drive_facts(drive, before),
        done=drive.reached,
        complaint=f"{drive.status}: {drive.reason}",
    )


def _scenario(job: Job) -> RoadScenario:
    """One drive, and who drives."""
    found = load_scenario(job.path, beside=job.parts.beside, case=job.parts.case)
    assert isinstance(found, RoadScenario)  # by its ending
    return found


def _plans(job: Job) -> JobResult:
    """Plan them all."""
    scenes, vehicle, name = _scenes(job)
    limit = job.options.budgets.time_limit or TIME_LIMIT * len(scenes)
    with waiting(f"planning, at most {limit:g} s", quiet=job.options.quiet):
        try:
            result = plan_roads(scenes, vehicle, name=name, time_limit=limit)
        except ValueError as error:
            raise InvalidScenario(f"{job.path}: {error}") from error
    status = "found" if result.found else "partial" if result.plans else "no_plan"
    missing = [(vehicle, one) for vehicle, one in result.results.items() if one.plan is None]
    reason = "; ".join(f"{vehicle}: {one.reason}" for vehicle, one in missing)
    said = "interrupted before all had a plan: " if stopped() else ""
    return _outcome(
        result,
        road_fleet_to_dict(result, status=status, reason=reason),
        name=result.name,
        rows=[
            [
                vehicle,
                "no plan" if one.plan is None else "found",
                "" if one.plan is None else f"{one.cost:.6g}",
                "" if one.plan is None else f"{one.plan.switching_times[-1]:.6g}",
                "" if one.verdict is None else f"{one.verdict.clearance_m:.3g}",
                "" if one.verdict is None else f"{one.verdict.edge_m:.3g}",
            ]
            for vehicle, one in result.results.items()
        ],
        facts={
            "plans": f"{len(result.plans)} of {len(result.results)}",
            "nearest": _nearest(result),
            "order": ", ".join(result.order),
            "searched": f"{result.search_s:.3g} s",
        },
        done=result.found,
        complaint=f"{status}: {said}{reason}",
        source=job,
        first_plan=result.search_s,
    )


def _drives(job: Job) -> JobResult:
    """Close the loop of them all."""
    scenes, vehicle, name = _scenes(job)
    steps, quiet = job.options.budgets.steps, job.options.quiet
    limit = job.options.budgets.time_limit or TIME_LIMIT * len(scenes)
    most = sum(_most_steps(scene, steps) for scene in scenes.values())
    with progress_bar("planning before the start, then steps", most, quiet=quiet) as advance:
        try:
            drive = drive_roads(
                scenes, vehicle, name=name, steps=steps, time_limit=limit, progress=advance
            )
        except ValueError as error:
            raise InvalidScenario(f"{job.path}: {error}") from error
    taken = [step for one in drive.results.values() for step in one.steps]
    reached = sum(one.reached for one in drive.results.values())
    return _outcome(
        drive,
        road_fleet_drive_to_dict(drive),
        name=drive.name,
        rows=[
            [
                vehicle,
                one.status,
                f"{math.fsum(step.applied_cost for step in one.steps):.6g}",
                f"{one.driven.start_time + one.driven.duration:.6g}" if one.reached else "",
                f"{one.verdict.clearance_m:.3g}",
                f"{one.verdict.edge_m:.3g}",
            ]
            for vehicle, one in drive.results.items()
        ],
        facts={
            "reached": f"{reached} of {len(drive.results)}",
            "nearest": _nearest(drive),
            "steps": f"{len(taken)}, {sum(step.replanned for step in taken)} replanned",
            "time per step": times_of(step.solve_s for step in taken),
            "planned before": f"{drive.before.search_s:.3g} s",
        },
        done=drive.reached,
        complaint=f"{drive.status}: {drive.reason}",
        source=job,
    )


def _most_steps(scene: RoadScene, steps: int | None) -> int:
    """How many steps a vehicle may take, so that a bar has an end."""
    lasting = min(scene.last_time - scene.start.time, LONGEST)
    most = max(math.ceil(lasting / tick_of(scene.step)), 1)
    return most if steps is None else min(steps, most)


def _scenes(job: Job) -> tuple[dict[str, RoadScene], RoadVehicle, str]:
    """What each has to do, by the id of its problem; the vehicle, and the name of all."""
    drives = load_roads(job.path, beside=job.parts.beside)
    scenes = {}
    for k, one in enumerate(drives):
        known = one.scene.benchmark
        scenes[str(k if known is None else known.problem)] = one.scene
    if len(scenes) < len(drives):
        raise InvalidScenario(f"{job.path}: two planning problems have one id, need distinct ids")
    return scenes, drives[0].vehicle, drives[0].name.removesuffix(" case 0")


def _outcome(
    result: RoadPlanResult | RoadDrive | RoadFleetResult | RoadFleetDrive,
    said: Mapping[str, object],
    *,
    name: str,
    facts: Facts,
    done: bool,
    complaint: str,
    rows: Sequence[Sequence[str]] | None = None,
    source: Job | None = None,
    first_plan: float | None = None,
) -> JobResult:
    """What came of any job on roads; of several vehicles with a row each, and their `source`."""
    document: dict[str, Any] = dict(said)
    if isinstance(result, RoadFleetResult | RoadFleetDrive):
        notes: Sequence[str] = joint_notes(result)
    else:
        notes = result.notes

    def save(path: Path) -> None:
        if source is not None:
            made_from = {"file": source.path, "with": source.parts.beside, "case": None}
            document["source"] = source_entry(made_from, path)
        write_document(document, path, interrupted=stopped())

    def tell(folder: str) -> None:
        from maneuver_automaton.cli.tables import console, print_facts, table

        if rows is not None:
            console().print(table(name, COLUMNS, rows, numbers=(2, 3, 4, 5)))
        elif facts or notes:
            console().print(name, soft_wrap=True)
        written = {"written to": folder} if facts else {}
        print_facts({**facts, **written, "notes": "; ".join(notes)})

    apart = document.get("clearance_m")
    distances = (
        apart.values() if isinstance(apart, dict) else (apart, document.get("min_clearance_m"))
    )
    duration = document.get("duration_s")
    if isinstance(result, RoadFleetResult):
        duration = max((one.duration for one in result.plans.values()), default=None)
    known = done or isinstance(result, RoadDrive | RoadFleetDrive)
    return JobResult(
        name=name,
        result=result,
        save=save,
        tell=tell,
        done=done,
        status=document["status"],
        complaints=() if done else (complaint,),
        cost=document["cost"] if known else None,
        duration=duration if known else None,
        clearance=min((one for one in distances if one is not None), default=None),
        first_plan=first_plan,
    )


def _plan_facts(result: RoadPlanResult) -> dict[str, str]:
    plan, verdict, decision = result.plan, result.verdict, result.decision
    if plan is None or verdict is None or decision is None:
        return {}
    return {
        "goal": f"reached at {plan.switching_times[-1]:.6g} s",
        "cost": f"{result.cost:.6g}",
        "clearance": verdict.room,
        "stop after it": "free" if decision.stops else "none was found",
        "searched": f"{result.search_s:.3g} s",
    }


def _drive_facts(drive: RoadDrive, before: RoadPlanResult | None) -> dict[str, str]:
    verdict = drive.verdict
    end = drive.driven.switching_times[-1]
    facts = {
        "goal": f"reached at {end:.6g} s" if drive.reached else f"{drive.status}: {drive.reason}",
        "steps": f"{len(drive.steps)}, {sum(step.replanned for step in drive.steps)} replanned",
        "collisions": str(len(verdict.hit)),
        "clearance": verdict.room,
        "written to": "",  # its place
    }
    if before is not None and before.plan is not None:
        facts["first plan"] = f"made in {before.search_s:.3g} s before the start"
    return {**facts, "time per step": times_of(drive.solve_s)}


def _nearest(result: RoadFleetResult | RoadFleetDrive) -> str:
    if not result.pairs:
        return ""
    one = result.pairs[0]
    return f"{' and '.join(one.pair)} {one.distance_m:.3g} m at {one.time_s:.4g} s"

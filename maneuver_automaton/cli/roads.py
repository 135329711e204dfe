"""`plan` and `mpc` of a CommonRoad file: one drive on roads, or several, each past all others."""

from __future__ import annotations

import math
from dataclasses import replace

from maneuver_automaton._interrupts import patient, stopped
from maneuver_automaton.cli.guard import complain
from maneuver_automaton.cli.inputs import naming, states_several
from maneuver_automaton.cli.jobs import INTERRUPTED, Job, JobResult
from maneuver_automaton.cli.terminal import progress_bar, waiting
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.road_json import (
    road_drive_to_dict,
    road_fleet_drive_to_dict,
    road_fleet_to_dict,
    road_plan_to_dict,
)
from maneuver_automaton.recording import Fact
from maneuver_automaton.roads import (
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
from maneuver_automaton.scenario import RoadScenario, load_roads, load_scenario

TIME_LIMIT = 10.0  # [s] of one plan


def planned(job: Job, _: None) -> JobResult:
    """Plan one drive, or all of them."""
    if states_several(job.path, job.parts):
        return _plans(job)
    found = _scenario(job)
    limit = job.options.time_limit or TIME_LIMIT
    with waiting(f"planning, at most {limit:g} s", quiet=job.options.quiet), naming(job.path):
        result = plan_road(found.scene, found.vehicle, time_limit=limit)
    if stopped() and result.plan is None:
        result = replace(result, reason=INTERRUPTED)
    status = "found" if result.plan is not None else "out_of_budget" if stopped() else "no_plan"
    return JobResult(
        name=found.scene.name,
        result=result,
        document=road_plan_to_dict(result) | {"status": status},
        done=result.plan is not None,
        status=status,
        complaints=()
        if result.plan is not None
        else ("; ".join([f"{status}: {result.reason}", *result.notes]),),
        first_plan=result.search_s,
    )


def driven(job: Job, _: None) -> JobResult:
    """Close the loop of one drive, or of all of them.

    Where the search of one step finds no plan to a goal from the start, a wider one is made before
    the vehicle sets off, and told apart from the steps.
    """
    if states_several(job.path, job.parts):
        return _drives(job)
    found, options = _scenario(job), job.options
    with patient():
        with naming(job.path):
            planner = road_planner(found.scene, found.vehicle)
        limit = options.time_limit or TIME_LIMIT
        with waiting(f"planning before the start, at most {limit:g} s", quiet=options.quiet):
            before = plan_before(planner, time_limit=limit)
        if before is not None and before.plan is None and planner.hopeless() is None:
            complain(f"{job.path}: no plan before the start: {before.reason}")
        last = planner.last_tick // planner.every
        most = min(options.steps or last, last)
        with progress_bar("steps", most, quiet=options.quiet) as advance:
            drive = drive_scene(
                planner,
                steps=options.steps,
                first=None if before is None else before.decision,
                progress=lambda _: advance(),
            )
    first = ""
    if before is not None and before.plan is not None:
        first = f"made in {before.search_s:.3g} s before the start"
    return JobResult(
        name=found.scene.name,
        result=drive,
        document=road_drive_to_dict(drive, before=before),
        done=drive.reached,
        status=drive.status,
        complaints=() if drive.reached else (f"{drive.status}: {drive.reason}",),
        facts=(Fact(label="first plan", value=first),),
    )


def _scenario(job: Job) -> RoadScenario:
    found = load_scenario(job.path, beside=job.parts.beside, case=job.parts.case)
    assert isinstance(found, RoadScenario)  # by its ending
    return found


def _plans(job: Job) -> JobResult:
    scenes, vehicle, name = _scenes(job)
    limit = job.options.time_limit or TIME_LIMIT * len(scenes)
    with waiting(f"planning, at most {limit:g} s", quiet=job.options.quiet), naming(job.path):
        result = plan_roads(scenes, vehicle, name=name, time_limit=limit)
    status = "found" if result.found else "partial" if result.plans else "no_plan"
    missing = [(vehicle, one) for vehicle, one in result.results.items() if one.plan is None]
    reason = "; ".join(f"{vehicle}: {one.reason}" for vehicle, one in missing)
    said = "interrupted before all had a plan: " if stopped() else ""
    return JobResult(
        name=result.name,
        result=result,
        document=road_fleet_to_dict(result, status=status, reason=reason),
        done=result.found,
        status=status,
        complaints=() if result.found else (f"{status}: {said}{reason}",),
        first_plan=result.search_s,
    )


def _drives(job: Job) -> JobResult:
    scenes, vehicle, name = _scenes(job)
    steps, quiet = job.options.steps, job.options.quiet
    limit = job.options.time_limit or TIME_LIMIT * len(scenes)
    lasting = [min(one.last_time - one.start.time, LONGEST) for one in scenes.values()]
    clocks = [one.step for one in scenes.values()]
    ends = [max(math.ceil(s / step), 1) for s, step in zip(lasting, clocks, strict=True)]
    most = sum(n if steps is None else min(steps, n) for n in ends)  # so that a bar has an end
    shown = progress_bar("planning before the start, then steps", most, quiet=quiet)
    with shown as advance, naming(job.path):
        drive = drive_roads(
            scenes, vehicle, name=name, steps=steps, time_limit=limit, progress=advance
        )
    return JobResult(
        name=drive.name,
        result=drive,
        document=road_fleet_drive_to_dict(drive),
        done=drive.reached,
        status=drive.status,
        complaints=() if drive.reached else (f"{drive.status}: {drive.reason}",),
    )


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

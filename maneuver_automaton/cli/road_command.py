"""`plan` and `mpc` of a drive on roads."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from maneuver_automaton._interrupts import patient, stopped
from maneuver_automaton.cli.guard import FOUND, NO_PLAN, complain
from maneuver_automaton.cli.inputs import Parts, make_folder, not_written
from maneuver_automaton.cli.progress import announced, progress_bar, waiting
from maneuver_automaton.errors import InvalidScenario

if TYPE_CHECKING:
    from maneuver_automaton.automaton import Plan
    from maneuver_automaton.cli import mpc_command
    from maneuver_automaton.cli.plan_settings import Settings as PlanSettings
    from maneuver_automaton.roads import RoadDrive, RoadPlanResult, RoadScene, RoadVehicle

TIME_LIMIT = 10.0  # [s] of one plan
ENDING = ".xml"


def is_road(path: Path) -> bool:
    """Whether a file is one of CommonRoad, by its ending."""
    return path.suffix.lower() == ENDING


def plan_file(path: Path, out: Path, *, settings: PlanSettings, parts: Parts) -> RoadPlanResult:
    """Plan one drive into the folder `out`, and print the plan; the result."""
    from maneuver_automaton.formats.documents import write_document
    from maneuver_automaton.formats.road_json import road_plan_to_dict
    from maneuver_automaton.roads import plan_road

    scene, vehicle = _road(path, parts)
    make_folder(out)
    limit = settings.time_limit or TIME_LIMIT
    with (
        announced(quiet=settings.quiet),
        waiting(f"planning, at most {limit:g} s", quiet=settings.quiet),
    ):
        try:
            result = plan_road(scene, vehicle, time_limit=limit)
        except ValueError as error:
            raise _in_file(path, error) from error
    if stopped() and result.plan is None:
        result = replace(result, reason="interrupted before there was a plan")
    document = road_plan_to_dict(result) | {"status": status_of(result)}

    def write() -> None:
        write_document(document, out / "plan.json", interrupted=stopped())
        for name in ("plan.png", "plan.gif", "plan.html"):
            (out / name).unlink(missing_ok=True)  # of an earlier plan
        if result.plan is not None:
            _draw(scene, vehicle, result.plan, out / "plan", settings)
        if settings.html and not stopped():
            result.player(title=settings.look.title or scene.name).save(out / "plan.html")

    _written(write, out)
    if not settings.quiet and (result.plan is not None or result.notes):
        facts = {} if result.plan is None else _plan_facts(result, out)
        _print(scene.name, {**facts, "notes": "; ".join(result.notes)})
    return result


def status_of(result: RoadPlanResult) -> str:
    """How planning a drive ended."""
    if result.plan is not None:
        return "found"
    return "out_of_budget" if stopped() else "no_plan"


def drive_file(path: Path, out: Path, *, settings: mpc_command.Settings, parts: Parts) -> int:
    """Close the loop of one drive into the folder `out`, print it, return the exit code.

    Where the search of one step finds no plan to a goal from the start, a wider one is made before
    the vehicle sets off, and told apart from the steps.
    """
    from maneuver_automaton.formats.documents import write_document
    from maneuver_automaton.formats.road_json import road_drive_to_dict
    from maneuver_automaton.roads import drive_scene, plan_before, road_planner

    for name, value in (("--seeds", settings.seeds), ("--resume", settings.resume)):
        if value is not None:
            raise InvalidScenario(f"{name}: drives on roads have no such option; leave it out")
    scene, vehicle = _road(path, parts)
    make_folder(out)
    with announced(quiet=settings.quiet), patient():
        try:
            planner = road_planner(scene, vehicle)
        except ValueError as error:
            raise _in_file(path, error) from error
        limit = settings.time_limit or TIME_LIMIT
        with waiting(f"planning before the start, at most {limit:g} s", quiet=settings.quiet):
            before = plan_before(planner, time_limit=limit)
        if before is not None and before.plan is None and planner.hopeless() is None:
            complain(f"{path}: no plan before the start: {before.reason}")
        most = min(settings.steps or planner.last_tick, planner.last_tick)
        with progress_bar("steps", most, quiet=settings.quiet) as advance:
            drive = drive_scene(
                planner,
                steps=settings.steps,
                first=None if before is None else before.decision,
                progress=lambda _: advance(),
            )
    document = road_drive_to_dict(drive, before=before)

    def write() -> None:
        write_document(document, out / "closed_loop.json", interrupted=stopped())
        for name in ("closed_loop.png", "closed_loop.gif", "closed_loop.html"):
            (out / name).unlink(missing_ok=True)  # of an earlier loop
        _draw(scene, vehicle, drive.driven, out / "closed_loop", settings)
        if (settings.animate or settings.html) and not stopped():
            page = drive.player(title=settings.look.title or scene.name)
            page.save(out / "closed_loop.html")

    _written(write, out)
    if not settings.quiet:
        facts = _drive_facts(drive, before, out)
        _print(scene.name, {**facts, "notes": "; ".join(drive.notes)})
    if not drive.reached:
        complain(f"{path}: {drive.status}: {drive.reason}")
    return FOUND if drive.reached else NO_PLAN


def _road(path: Path, parts: Parts) -> tuple[RoadScene, RoadVehicle]:
    from maneuver_automaton.scenario import RoadScenario, load_scenario

    if parts.model is not None:
        raise InvalidScenario("--model: is for scenarios and libraries, not for drives on roads")
    found = load_scenario(path, beside=parts.beside, case=parts.case)
    assert isinstance(found, RoadScenario)  # by its ending
    return found.scene, found.vehicle


def _draw(
    scene: RoadScene,
    vehicle: RoadVehicle,
    plan: Plan,
    file: Path,
    settings: PlanSettings | mpc_command.Settings,
) -> None:
    """Write the pictures that were asked for, `file` with their endings."""
    if stopped() or not (settings.plot or settings.animate):
        return
    from maneuver_automaton import plotting
    from maneuver_automaton.cli.pictures import skip_documentation

    skip_documentation()

    if settings.plot:
        picture, look = file.with_suffix(".png"), settings.look.look(scene.name)
        plotting.save_road_figure(scene, vehicle, plan, picture, look=look)
    if settings.animate:
        titled = replace(scene, name=settings.look.title or scene.name)
        plotting.save_road_animation(titled, vehicle, plan, file.with_suffix(".gif"))


def _written(write: Callable[[], None], out: Path) -> None:
    try:
        write()
    except OSError as error:
        raise not_written(Path(error.filename or out), error) from error


def _plan_facts(result: RoadPlanResult, out: Path) -> dict[str, str]:
    plan, verdict, decision = result.plan, result.verdict, result.decision
    assert plan is not None
    assert verdict is not None
    assert decision is not None
    return {
        "goal": f"reached at {plan.switching_times[-1]:.6g} s",
        "cost": f"{result.cost:.6g}",
        "clearance": verdict.room,
        "stop after it": "free" if decision.stops else "none was found",
        "searched": f"{result.search_s:.3g} s",
        "written to": str(out),
    }


def _drive_facts(drive: RoadDrive, before: RoadPlanResult | None, out: Path) -> dict[str, str]:
    verdict = drive.verdict
    milliseconds, end = 1e3 * drive.solve_s, drive.driven.switching_times[-1]
    facts = {
        "goal": f"reached at {end:.6g} s" if drive.reached else f"{drive.status}: {drive.reason}",
        "steps": f"{len(drive.steps)}, {sum(step.replanned for step in drive.steps)} replanned",
        "collisions": str(len(verdict.hit)),
        "clearance": verdict.room,
        "written to": str(out),
    }
    if before is not None and before.plan is not None:
        facts["first plan"] = f"made in {before.search_s:.3g} s before the start"
    if len(milliseconds):
        facts["time per step"] = (
            f"{np.median(milliseconds):.2f} ms median, {milliseconds.max():.2f} ms at most"
        )
    return facts


def _print(name: str, facts: dict[str, str]) -> None:
    from maneuver_automaton.cli.tables import console, print_facts

    console().print(name, soft_wrap=True)
    print_facts(facts)


def _in_file(path: Path, error: ValueError) -> InvalidScenario:
    return error if isinstance(error, InvalidScenario) else InvalidScenario(f"{path}: {error}")

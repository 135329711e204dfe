"""`plan` and `mpc` of a CommonRoad file with several planning problems: each past all others."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from maneuver_automaton._interrupts import stopped
from maneuver_automaton.cli.folder_runs import Row
from maneuver_automaton.cli.guard import FOUND, NO_PLAN, complain
from maneuver_automaton.cli.inputs import Parts, make_folder, not_written
from maneuver_automaton.cli.plan_settings import Settings
from maneuver_automaton.cli.progress import announced, progress_bar, waiting
from maneuver_automaton.cli.road_command import TIME_LIMIT
from maneuver_automaton.errors import InvalidScenario

if TYPE_CHECKING:
    from maneuver_automaton.cli import mpc_command
    from maneuver_automaton.roads import (
        RoadFleetDrive,
        RoadFleetResult,
        RoadPair,
        RoadScene,
        RoadVehicle,
    )

COLUMNS = ["vehicle", "status", "cost", "arrival [s]", "clearance [m]", "edge [m]"]


def states_several(path: Path, parts: Parts) -> bool:
    """Whether a file of CommonRoad states several problems, and --case picks none of them."""
    from maneuver_automaton.formats.commonroad import n_problems

    try:
        return parts.case is None and n_problems(path) > 1
    except OSError:
        return False  # told by who reads it


def plan_file(path: Path, out: Path, *, settings: Settings, parts: Parts) -> RoadFleetResult:
    """Plan them all into the folder `out`, and print the plans; the result."""
    from maneuver_automaton.roads import plan_roads

    _refuse({"--model": parts.model is not None})
    scenes, vehicle, name = _roads(path, parts)
    make_folder(out)
    limit = settings.time_limit or TIME_LIMIT * len(scenes)
    with (
        announced(quiet=settings.quiet),
        waiting(f"planning, at most {limit:g} s", quiet=settings.quiet),
    ):
        try:
            result = plan_roads(scenes, vehicle, name=name, time_limit=limit)
        except ValueError as error:
            raise InvalidScenario(f"{path}: {error}") from error
    try:
        _write(path, out, result, vehicle, settings, parts)
    except OSError as error:
        raise not_written(Path(error.filename or out), error) from error
    if not settings.quiet:
        _print(result, out)
    return result


def drive_file(path: Path, out: Path, *, settings: mpc_command.Settings, parts: Parts) -> int:
    """Close the loop of them all into the folder `out`, print it; the exit code."""
    from maneuver_automaton.roads import drive_roads

    given = {"--seeds": settings.seeds, "--resume": settings.resume}
    loops = {option: value is not None for option, value in given.items()}
    _refuse({"--model": parts.model is not None} | loops)
    scenes, vehicle, name = _roads(path, parts)
    make_folder(out)
    limit = settings.time_limit or TIME_LIMIT * len(scenes)
    most = sum(_most_steps(scene, settings.steps) for scene in scenes.values())
    with (
        announced(quiet=settings.quiet),
        progress_bar("planning before the start, then steps", most, quiet=settings.quiet) as step,
    ):
        try:
            drive = drive_roads(
                scenes, vehicle, name=name, steps=settings.steps, time_limit=limit, progress=step
            )
        except ValueError as error:
            raise InvalidScenario(f"{path}: {error}") from error
    try:
        _write_drive(path, out, drive, vehicle, settings, parts)
    except OSError as error:
        raise not_written(Path(error.filename or out), error) from error
    if not settings.quiet:
        _print_drive(drive, out)
    if not drive.reached:
        complain(f"{path}: {drive.status}: {drive.reason}")
    return FOUND if drive.reached else NO_PLAN


def _most_steps(scene: RoadScene, steps: int | None) -> int:
    """How many steps a vehicle may take, so that a bar has an end."""
    from maneuver_automaton.roads.library import tick_of
    from maneuver_automaton.roads.search_arrays import LONGEST

    lasting = min(scene.last_time - scene.start.time, LONGEST)
    most = max(math.ceil(lasting / tick_of(scene.step)), 1)
    return most if steps is None else min(steps, most)


def _refuse(given: Mapping[str, bool]) -> None:
    """Refuse options that are for one vehicle."""
    for option, is_given in given.items():
        if is_given:
            raise InvalidScenario(
                f"{option}: is not for several vehicles on roads; leave it out, or pick one with "
                "--case"
            )


def _roads(path: Path, parts: Parts) -> tuple[dict[str, RoadScene], RoadVehicle, str]:
    """What each has to do, by the id of its problem; the vehicle, and the name of all."""
    from maneuver_automaton.scenario import load_roads

    drives = load_roads(path, beside=parts.beside)
    scenes = {}
    for k, one in enumerate(drives):
        known = one.scene.benchmark
        scenes[str(k if known is None else known.problem)] = one.scene
    if len(scenes) < len(drives):
        raise InvalidScenario(f"{path}: two planning problems have one id, need distinct ids")
    return scenes, drives[0].vehicle, drives[0].name.removesuffix(" case 0")


def code_of(result: RoadFleetResult) -> int:
    """The exit code."""
    return FOUND if result.found else NO_PLAN


def why_not(result: RoadFleetResult) -> str:
    """Status and reasons, if a vehicle has no plan."""
    if result.found:
        return ""
    said = "interrupted before all had a plan: " if stopped() else ""
    return f"{_status(result)}: {said}{_reason(result)}"


def row(path: Path, result: RoadFleetResult) -> Row:
    """For the table of a folder."""
    plans, least = result.plans.values(), result.distance_m
    return Row(
        name=path.name,
        code=code_of(result),
        status=_status(result),
        reason="" if result.found else f"{path}: {why_not(result)}",
        cost=_cost(result) if result.found else None,
        duration=max((one.duration for one in plans), default=None) if result.found else None,
        clearance=None if math.isinf(least) else least,
        first_plan=result.search_s,
    )


def _cost(result: RoadFleetResult) -> float:
    return math.fsum(one.cost or 0.0 for one in result.results.values() if one.plan is not None)


def _status(result: RoadFleetResult) -> str:
    if result.found:
        return "found"
    return "partial" if result.plans else "no_plan"


def _reason(result: RoadFleetResult) -> str:
    return "; ".join(
        f"{name}: {one.reason}" for name, one in result.results.items() if one.plan is None
    )


def _write(
    path: Path,
    out: Path,
    result: RoadFleetResult,
    vehicle: RoadVehicle,
    settings: Settings,
    parts: Parts,
) -> None:
    from maneuver_automaton.formats.documents import source_entry, write_document
    from maneuver_automaton.formats.road_json import road_fleet_to_dict

    document = road_fleet_to_dict(result, status=_status(result), reason=_reason(result))
    source = {"file": path, "with": parts.beside, "case": None}
    document["source"] = source_entry(source, out / "plan.json")
    write_document(document, out / "plan.json", interrupted=stopped())
    _draw(result, vehicle, out / "plan", settings)


def _write_drive(
    path: Path,
    out: Path,
    drive: RoadFleetDrive,
    vehicle: RoadVehicle,
    settings: mpc_command.Settings,
    parts: Parts,
) -> None:
    from maneuver_automaton.formats.documents import source_entry, write_document
    from maneuver_automaton.formats.road_json import road_fleet_drive_to_dict

    file = out / "closed_loop.json"
    source = {"file": path, "with": parts.beside, "case": None}
    document = road_fleet_drive_to_dict(drive) | {"source": source_entry(source, file)}
    write_document(document, file, interrupted=stopped())
    _draw(drive, vehicle, out / "closed_loop", settings)


def _draw(
    what: RoadFleetResult | RoadFleetDrive,
    vehicle: RoadVehicle,
    file: Path,
    settings: Settings | mpc_command.Settings,
) -> None:
    """Write the pictures that were asked for, `file` with their endings."""
    for ending in (".png", ".gif", ".html"):
        file.with_suffix(ending).unlink(missing_ok=True)  # of an earlier one
    if not what.plans or stopped():
        return
    if settings.html:
        what.player(title=settings.look.title or what.name).save(file.with_suffix(".html"))
    if not (settings.plot or settings.animate):
        return
    from maneuver_automaton import plotting
    from maneuver_automaton.cli.pictures import skip_documentation

    skip_documentation()
    look = settings.look.look(what.name)
    if settings.plot:
        plotting.save_road_fleet_figure(what, vehicle, file.with_suffix(".png"), look=look)
    if settings.animate:
        plotting.save_road_fleet_animation(what, vehicle, file.with_suffix(".gif"), look=look)


def _print(result: RoadFleetResult, out: Path) -> None:
    from maneuver_automaton.cli.tables import console, print_facts, table
    from maneuver_automaton.formats.road_json import joint_notes

    rows = [
        [
            name,
            "no plan" if one.plan is None else "found",
            "" if one.plan is None else f"{one.cost:.6g}",
            "" if one.plan is None else f"{one.plan.switching_times[-1]:.6g}",
            "" if one.verdict is None else f"{one.verdict.clearance_m:.3g}",
            "" if one.verdict is None else f"{one.verdict.edge_m:.3g}",
        ]
        for name, one in result.results.items()
    ]
    console().print(table(result.name, COLUMNS, rows, numbers=(2, 3, 4, 5)))
    print_facts(
        {
            "plans": f"{len(result.plans)} of {len(result.results)}",
            "nearest": _nearest(result.pairs),
            "order": ", ".join(result.order),
            "searched": f"{result.search_s:.3g} s",
            "written to": str(out),
            "notes": "; ".join(joint_notes(result)),
        }
    )


def _print_drive(drive: RoadFleetDrive, out: Path) -> None:
    from maneuver_automaton.cli.tables import console, print_facts, table
    from maneuver_automaton.formats.road_json import joint_notes

    rows = [
        [
            name,
            one.status,
            f"{math.fsum(step.applied_cost for step in one.steps):.6g}",
            f"{one.driven.start_time + one.driven.duration:.6g}" if one.reached else "",
            f"{one.verdict.clearance_m:.3g}",
            f"{one.verdict.edge_m:.3g}",
        ]
        for name, one in drive.results.items()
    ]
    steps = [step for one in drive.results.values() for step in one.steps]
    milliseconds = sorted(1e3 * step.solve_s for step in steps)
    console().print(table(drive.name, COLUMNS, rows, numbers=(2, 3, 4, 5)))
    print_facts(
        {
            "reached": f"{sum(one.reached for one in drive.results.values())} of {len(rows)}",
            "nearest": _nearest(drive.pairs),
            "steps": f"{len(steps)}, {sum(step.replanned for step in steps)} replanned",
            "time per step": f"{milliseconds[len(steps) // 2]:.2f} ms median, "
            f"{milliseconds[-1]:.2f} ms at most"
            if steps
            else "",
            "planned before": f"{drive.before.search_s:.3g} s",
            "written to": str(out),
            "notes": "; ".join(joint_notes(drive)),
        }
    )


def _nearest(pairs: Sequence[RoadPair]) -> str:
    if not pairs:
        return ""
    one = pairs[0]
    return f"{' and '.join(one.pair)} {one.distance_m:.3g} m at {one.time_s:.4g} s"

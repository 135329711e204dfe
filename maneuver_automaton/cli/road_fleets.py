"""`plan` of a CommonRoad file with several planning problems: each past all others."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from maneuver_automaton._interrupts import stopped
from maneuver_automaton.cli.compiling import announced
from maneuver_automaton.cli.folder_runs import Row
from maneuver_automaton.cli.guard import FOUND, NO_PLAN
from maneuver_automaton.cli.inputs import Parts, make_folder, not_written
from maneuver_automaton.cli.plan_settings import Settings
from maneuver_automaton.cli.progress import waiting
from maneuver_automaton.cli.road_command import TIME_LIMIT
from maneuver_automaton.errors import InvalidScenario

if TYPE_CHECKING:
    from maneuver_automaton.roads import RoadFleetResult, RoadVehicle


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
    from maneuver_automaton.scenario import load_roads

    for option, given in (
        ("--model", parts.model is not None),
        ("--animate", settings.animate),
        ("--html", settings.html),
    ):
        if given:
            raise InvalidScenario(
                f"{option}: is not for several vehicles on roads; leave it out, or pick one with "
                "--case"
            )
    drives = load_roads(path, beside=parts.beside)
    scenes = {}
    for k, one in enumerate(drives):
        known = one.scene.benchmark
        scenes[str(k if known is None else known.problem)] = one.scene
    if len(scenes) < len(drives):
        raise InvalidScenario(f"{path}: two planning problems have one id, need distinct ids")
    make_folder(out)
    limit, vehicle = settings.time_limit or TIME_LIMIT * len(drives), drives[0].vehicle
    with (
        announced(quiet=settings.quiet),
        waiting(f"planning, at most {limit:g} s", quiet=settings.quiet),
    ):
        try:
            result = plan_roads(scenes, vehicle, name=_name(drives[0].name), time_limit=limit)
        except ValueError as error:
            raise InvalidScenario(f"{path}: {error}") from error
    try:
        _write(path, out, result, vehicle, settings, parts)
    except OSError as error:
        raise not_written(Path(error.filename or out), error) from error
    if not settings.quiet:
        _print(result, out)
    return result


def _name(name: str) -> str:
    """The name of the file's scene, which its problems are numbered in."""
    return name.removesuffix(" case 0")


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
    from maneuver_automaton.formats.fleet_json import source_entry
    from maneuver_automaton.formats.plan_json import write_document
    from maneuver_automaton.formats.road_json import road_fleet_to_dict

    document = road_fleet_to_dict(result, status=_status(result), reason=_reason(result))
    source = {"file": path, "with": parts.beside, "case": None}
    document["source"] = source_entry(source, out / "plan.json")
    write_document(document, out / "plan.json", interrupted=stopped())
    for name in ("plan.png", "plan.gif", "plan.html"):
        (out / name).unlink(missing_ok=True)  # of an earlier plan
    if settings.plot and result.plans and not stopped():
        from maneuver_automaton import plotting
        from maneuver_automaton.cli.pictures import skip_documentation

        skip_documentation()
        look = settings.look.look(result.name)
        plotting.save_road_fleet_figure(result, vehicle, out / "plan.png", look=look)


def _print(result: RoadFleetResult, out: Path) -> None:
    from rich.text import Text

    from maneuver_automaton.cli.tables import console, table

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
    columns = ["vehicle", "status", "cost", "arrival [s]", "clearance [m]", "to the edge [m]"]
    console().print(table(result.name, columns, rows, numbers=(2, 3, 4, 5)))
    nearest = result.pairs[0] if result.pairs else None
    facts = {
        "plans": f"{len(result.plans)} of {len(result.results)}",
        "nearest": ""
        if nearest is None
        else f"{' and '.join(nearest.pair)} {nearest.distance_m:.3g} m at {nearest.time_s:.4g} s",
        "order": ", ".join(result.order),
        "searched": f"{result.search_s:.3g} s",
        "written to": str(out),
    }
    for what, value in facts.items():
        if value:
            console().print(Text(f"  {what + ':':<16}{value}"), soft_wrap=True)

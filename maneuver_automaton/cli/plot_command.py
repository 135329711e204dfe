"""`plot`: a plan.json or closed_loop.json drawn again, without planning."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from maneuver_automaton.cli.guard import FOUND
from maneuver_automaton.cli.inputs import Parts, make_folder, not_written, scenario_of
from maneuver_automaton.cli.options import LookOptions
from maneuver_automaton.cli.pictures import ready_to_draw, save_film, why_no_film
from maneuver_automaton.cli.planned import fleet_planned, road_fleet
from maneuver_automaton.cli.tables import print_written
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.closed_loop_json import (
    driven_document,
    load_closed_loop,
    read_closed_loop_document,
)
from maneuver_automaton.formats.fleet_json import load_fleet
from maneuver_automaton.formats.fleet_loop_json import load_fleet_loop, read_fleet_loop_document
from maneuver_automaton.formats.plan_json import (
    load_result,
    plan_of_document,
    read_fleet_document,
    read_plan_document,
)
from maneuver_automaton.recording import recording_of
from maneuver_automaton.recording.plans import stated

ENDINGS = {
    "picture": (".png", ".pdf", ".svg"),
    "animation": (".gif",),
    "page": (".html",),
}


def plot(
    file: Path,
    out: Path | None,
    *,
    animate: bool,
    look: LookOptions,
    html: bool = False,
    beside: Path | None = None,
) -> int:
    """Draw a plan.json or closed_loop.json again, still, in motion, or as a page that plays it."""
    if animate and html:
        raise InvalidScenario("--html: writes a page, and --animate an animation; need one of them")
    what = "animation" if animate else "page" if html else "picture"
    path = _target(file, out, what)
    with _named(file):
        result, name = _result_of(file, beside)
    make_folder(path.parent)
    try:
        with _named(file):
            if isinstance(result, dict):
                _draw_motion(result, path, what, look)
            elif what == "page":
                result.player(title=look.title or name).save(path)
            elif what == "picture":
                ready_to_draw().save_picture(result, path, look=look.look(name))
            elif why := why_no_film(recording_of(result)):
                raise ValueError(why)
            else:
                save_film(recording_of(result), path, look.look(name))
    except OSError as error:
        raise not_written(path, error) from error
    print_written(path)
    return FOUND


@contextlib.contextmanager
def _named(file: Path) -> Iterator[None]:
    """Name the file in what is wrong with it."""
    try:
        yield
    except InvalidScenario:
        raise
    except (KeyError, ValueError, TypeError, IndexError, AttributeError) as error:
        said = f"misses the key {error}" if isinstance(error, KeyError) else str(error)
        raise InvalidScenario(f"{file}: {said}") from error


def _result_of(file: Path, beside: Path | None) -> tuple[Any, str]:
    """What a file holds, in the world that it was made for, and its name; else the document."""
    parts = Parts(beside=beside)
    if (roads := road_fleet(file, parts, alone=True)) is not None:
        return roads, roads.name
    if (driven := read_fleet_loop_document(file)) is not None:
        fleet = fleet_planned(file, driven, parts)
        return load_fleet_loop(file, fleet.fleet), fleet.name
    try:
        plans = read_fleet_document(file)
    except InvalidScenario:  # told by who reads the plan of one vehicle
        plans = None
    if plans is not None:
        fleet = fleet_planned(file, plans, parts)
        return load_fleet(file, fleet.fleet), fleet.name
    if beside is None:
        loop = read_closed_loop_document(file)
        return (read_plan_document(file) if loop is None else driven_document(loop)), ""
    scenario = scenario_of(beside)
    if read_closed_loop_document(file) is None:
        return load_result(file, scenario.problem), scenario.name
    return load_closed_loop(file, scenario.problem), scenario.name


def _draw_motion(document: dict[str, Any], path: Path, what: str, look: LookOptions) -> None:
    """Draw what a file states: the motion, without body and obstacles."""
    plotting = ready_to_draw()
    name = str(document.get("name") or "")
    found = document["status"] == "found" and bool(document["trajectory"])
    if not found and what != "picture":
        raise ValueError(f"holds no plan, its status is {document['status']!r}")
    plan = plan_of_document(document) if found else None
    if what == "picture":
        plotting.save_picture(stated(document, plan), path, look=look.look(name))
    elif what == "animation":
        plotting.save_film(plan, path)
    else:
        title = look.title or name or path.stem
        plotting.player_of_file(document, plan, title=title).save(path)


def _target(file: Path, out: Path | None, what: str) -> Path:
    """Where the picture goes: beside the file, into a folder, or to the file given."""
    endings = ENDINGS[what]
    path = file.with_suffix(endings[0]) if out is None else out
    if path.is_dir():
        path = path / file.with_suffix(endings[0]).name
    if path.suffix.lower() not in endings:
        raise InvalidScenario(
            f"{path}: is no {what} that this version draws, need an ending of {', '.join(endings)}"
        )
    return path

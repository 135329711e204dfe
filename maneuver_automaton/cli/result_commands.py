"""`plot` and `export`: result files drawn again, or written for another program."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from maneuver_automaton import exports
from maneuver_automaton.cli.guard import FOUND, complain
from maneuver_automaton.cli.inputs import Parts, make_folder, naming, opened, user_model, writing
from maneuver_automaton.cli.pictures import LookOptions, ready_to_draw, save_film, why_no_film
from maneuver_automaton.cli.terminal import print_written
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.exports.earth import degrees_of
from maneuver_automaton.formats.closed_loop_json import driven_document
from maneuver_automaton.formats.documents import errors_at
from maneuver_automaton.formats.plan_json import plan_of_document
from maneuver_automaton.recording import recording_of
from maneuver_automaton.recording.plans import stated


@dataclass(frozen=True, slots=True, kw_only=True)
class Format:
    """A format that is written."""

    function: str  # of `exports`, that writes it
    name: str  # of what is written: that of the file stands for {}
    steps: bool  # whether it has rows in time
    places: bool = False  # whether it can hold longitudes and latitudes

    @property
    def ending(self) -> str:
        """Ending of its files; a folder has none."""
        return Path(self.name).suffix


FORMATS: Mapping[str, Format] = {
    "commonroad": Format(
        function="save_commonroad_solution", name="{}_commonroad.xml", steps=False
    ),
    "csv": Format(function="save_csv", name="{}.csv", steps=True, places=True),
    "geojson": Format(function="save_geojson", name="{}.geojson", steps=False, places=True),
    "rerun": Format(function="save_rerun", name="{}.rrd", steps=True),
    "ros2": Format(function="save_ros2_bag", name="{}_ros2", steps=True),
}


def export(
    file: Path,
    kind: str,
    out: Path | None,
    *,
    parts: Parts,
    step: float | None,
    rate: float | None,
    origin: str | None,
) -> int:
    """Write the plans or loops of `file` in a format; say where a goal was not reached."""
    if rate is not None:
        if step is not None or not 0.0 < rate < math.inf:
            raise InvalidScenario(f"--rate: got {rate}, need a positive number, and no --step")
        step = 1.0 / rate
    if kind not in FORMATS:
        raise InvalidScenario(f"--to: got {kind!r}, need one of {', '.join(FORMATS)}")
    form = FORMATS[kind]
    if step is not None and not form.steps:
        raise InvalidScenario(f"--step: {kind} has no rows in time; leave it out")
    options: dict[str, Any] = {} if step is None else {"step": step}
    if origin is not None:
        if not form.places:
            raise InvalidScenario(f"--origin: {kind} has no longitudes; leave it out")
        options["origin"] = origin_of(origin)
    own = None if parts.model is None else user_model(parts.model)
    recording = exports.load_recording(file, beside=parts.beside, case=parts.case, model=own)
    path = _export_target(file, out, form, kind)
    make_folder(path.parent)
    with naming(file), writing(path):
        getattr(exports, form.function)(recording, path, **options)
    print_written(path)
    clean = all(one.reached and not one.reason for one in recording.movers)
    if kind == "commonroad" and not clean:
        complain(f"{file}: it is no clean drive to a goal: the official checker refuses {path}")
    return FOUND


def origin_of(text: str) -> tuple[float, float]:
    """Latitude and longitude [deg] of the text LAT,LON; raises InvalidScenario."""
    try:
        latitude, longitude = (float(part) for part in text.split(","))
        degrees_of([0.0, 0.0], origin=(latitude, longitude))
    except ValueError as error:
        what = str(error) if str(error).startswith("origin: ") else f"origin: got {text!r}"
        raise InvalidScenario(f"--{what}; need LAT,LON in degrees, as 52.1,13.4") from error
    return latitude, longitude


def _export_target(file: Path, out: Path | None, form: Format, kind: str) -> Path:
    """Where it goes: beside the file, into a folder, or to the file or folder given."""
    name = form.name.format(file.stem)
    if out is None:
        return file.with_name(name)
    if form.ending and out.is_dir():
        return out / name
    if form.ending and out.suffix.lower() != form.ending:
        raise InvalidScenario(f"--out: {out}: need an ending of {form.ending} for {kind}")
    return out


ENDINGS = {"picture": (".png", ".pdf", ".svg"), "animation": (".gif",), "page": (".html",)}


def plot(file: Path, out: Path | None, *, look: LookOptions, beside: Path | None) -> int:
    """Draw a plan.json or closed_loop.json again, still, in motion, or as a page that plays it."""
    if look.animate and look.html:
        raise InvalidScenario("--html: writes a page, and --animate an animation; need one of them")
    what = "animation" if look.animate else "page" if look.html else "picture"
    endings = ENDINGS[what]
    path = file.with_suffix(endings[0]) if out is None else out
    if path.is_dir():
        path = path / file.with_suffix(endings[0]).name
    if path.suffix.lower() not in endings:
        raise InvalidScenario(
            f"{path}: is no {what} that this version draws, need an ending of {', '.join(endings)}"
        )
    result: Any
    with errors_at(file):
        found, name = opened(file, Parts(beside=beside)), ""
        if found.beside is None and not found.several:  # nobody says in which world it was made
            result = (
                driven_document(found.document) if "steps" in found.document else found.document
            )
        else:
            result = found.result()
            name = result.name if found.scenario is None else found.scenario.name
    make_folder(path.parent)
    with writing(path), errors_at(file):
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
    print_written(path)
    return FOUND


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
        plotting.player_of_file(document, plan, title=look.title or name or path.stem).save(path)

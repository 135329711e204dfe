"""`export`: plans or closed loops as a file of another program, without planning."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from maneuver_automaton.cli.guard import FOUND, complain
from maneuver_automaton.cli.inputs import Parts, make_folder, not_written
from maneuver_automaton.cli.planned import road_fleet, source_of
from maneuver_automaton.cli.tables import print_written
from maneuver_automaton.cli.user_model import user_model
from maneuver_automaton.errors import InvalidScenario, ManeuverAutomatonError

if TYPE_CHECKING:
    from maneuver_automaton.recording import Recording


@dataclass(frozen=True, slots=True, kw_only=True)
class Format:
    """A format that is written."""

    function: str  # of `exports`, that writes it
    name: str  # of what is written: that of the file stands for {}
    steps: bool  # whether it has rows in time

    @property
    def ending(self) -> str:
        """Ending of its files; a folder has none."""
        return Path(self.name).suffix


FORMATS: Mapping[str, Format] = {
    "commonroad": Format(
        function="save_commonroad_solution", name="{}_commonroad.xml", steps=False
    ),
    "csv": Format(function="save_csv", name="{}.csv", steps=True),
    "geojson": Format(function="save_geojson", name="{}.geojson", steps=False),
    "rerun": Format(function="save_rerun", name="{}.rrd", steps=True),
    "ros2": Format(function="save_ros2_bag", name="{}_ros2", steps=True),
}


def export(
    file: Path, kind: str, out: Path | None, *, parts: Parts, step: float | None = None
) -> int:
    """Write the plans or loops of `file` in a format; say where a goal was not reached."""
    from maneuver_automaton import exports

    if kind not in FORMATS:
        raise InvalidScenario(f"--to: got {kind!r}, need one of {', '.join(FORMATS)}")
    form = FORMATS[kind]
    if step is not None and not form.steps:
        raise InvalidScenario(f"--step: {kind} has no rows in time; leave it out")
    recording = _recording(file, parts)
    path = _target(file, out, form, kind)
    options: dict[str, Any] = {} if step is None else {"step": step}
    write: Callable[..., None] = getattr(exports, form.function)
    make_folder(path.parent)
    try:
        write(recording, path, **options)
    except ManeuverAutomatonError:
        raise
    except OSError as error:
        raise not_written(path, error) from error
    except ValueError as error:
        raise InvalidScenario(f"{file}: {error}") from error
    print_written(path)
    clean = all(one.reached and not one.reason for one in recording.movers)
    if kind == "commonroad" and not clean:
        complain(f"{file}: it is no clean drive to a goal: the official checker refuses {path}")
    return FOUND


def _recording(file: Path, parts: Parts) -> Recording:
    """What the file holds; several vehicles in the world that it names itself."""
    from maneuver_automaton import exports
    from maneuver_automaton.formats.plan_json import read_fleet_document
    from maneuver_automaton.recording import recording_of

    if (roads := road_fleet(file, parts)) is not None:
        return recording_of(roads)
    document = read_fleet_document(file)
    if document is not None and (parts.beside is not None or document.get("source")):
        beside, its = source_of(file, document, parts)
        return exports.load_recording(file, beside=beside, case=its.case)
    own = None if parts.model is None else user_model(parts.model)
    return exports.load_recording(file, beside=parts.beside, case=parts.case, model=own)


def _target(file: Path, out: Path | None, form: Format, kind: str) -> Path:
    """Where it goes: beside the file, into a folder, or to the file or folder given."""
    name = form.name.format(file.stem)
    if out is None:
        return file.with_name(name)
    if form.ending and out.is_dir():
        return out / name
    if form.ending and out.suffix.lower() != form.ending:
        raise InvalidScenario(f"--out: {out}: need an ending of {form.ending} for {kind}")
    return out

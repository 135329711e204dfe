"""What is written for other programs, and the numbers of the player's page, of every kind.

``exports`` holds what every value writes in every format that takes it, ``pages`` the data of its
page. rerun is stood in for by a module that notes what it is told: its recordings cannot be read
back without its SDK.
"""

from __future__ import annotations

import csv
import json
import sys
import tempfile
import types
import warnings
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

import maneuver_automaton as ma
from maneuver_automaton.plotting import player_of, player_of_file
from tests.exports.cases import inertia, slalom, trailer
from tests.goldens.digest import digest
from tests.plotting.cases import flight_plan, parking_plan
from tests.plotting.loops import flight_loop, pushed_loop, unfinished_loop
from tests.results import RESULTS

VALUES: dict[str, Callable[[], Any]] = {
    "a plan alone": parking_plan,
    "among obstacles": slalom,
    "flight": flight_plan,
    "trailer": trailer,
    "inertia": inertia,
    "pushed loop": pushed_loop,
    "unfinished loop": unfinished_loop,
    "flight loop": flight_loop,
    **{name: make for name, make in RESULTS.items() if name not in ("plan.json", "statistics")},
}
STEP = 0.25  # [s]


def of_csv(value: Any, path: Path) -> Any:
    """Columns of numbers, and the primitives."""
    ma.save_csv(value, path, step=STEP)
    with path.open(newline="") as stream:
        header, *lines = csv.reader(stream)
    columns = zip(*lines, strict=True)
    return {
        name: digest([_number(cell) for cell in column])
        for name, column in zip(header, columns, strict=True)
    }


def of_geojson(value: Any, path: Path) -> Any:
    """The document."""
    ma.save_geojson(value, path)
    return digest(json.loads(path.read_text()))


def of_messages(value: Any, path: Path) -> Any:
    """The messages, by topic."""
    return digest(ma.ros_messages(value, step=STEP, stamp=100.5))


def of_bag(value: Any, path: Path) -> Any:
    """Messages of each topic, and how long they are."""
    from rosbags.highlevel import AnyReader

    ma.save_ros2_bag(value, path, step=STEP)
    found: dict[str, list[int]] = {}
    with AnyReader([path]) as bag:
        for one, _, raw in bag.messages():
            found.setdefault(f"{one.topic} {one.msgtype}", []).append(len(raw))
    return {topic: digest(sizes) for topic, sizes in sorted(found.items())}


def of_rerun(value: Any, path: Path) -> Any:
    """What the viewer is told, by entity."""
    told: dict[str, list[Any]] = {}
    with mock.patch.dict(sys.modules, {"rerun": _rerun(told)}):
        ma.save_rerun(value, path, step=STEP)
    return {at: digest(what) for at, what in told.items()}


def of_commonroad(value: Any, path: Path) -> Any:
    """Attributes and states of the solution."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        ma.save_commonroad_solution(value, path)
    root = ElementTree.parse(path).getroot()
    ways = [
        {**way.attrib, "states": [{c.tag: float(c.text or "nan") for c in row} for row in way]}
        for way in root
    ]
    return digest({"attributes": dict(root.attrib), "trajectories": ways})


FORMATS: dict[str, tuple[Callable[[Any, Path], Any], str]] = {
    "csv": (of_csv, "x.csv"),
    "geojson": (of_geojson, "x.geojson"),
    "ros messages": (of_messages, ""),
    "ros bag": (of_bag, "bag"),
    "rerun": (of_rerun, "x.rrd"),
    "commonroad": (of_commonroad, "x.xml"),
}


def exported(form: str, name: str) -> Any:
    """What is kept of a value in a format; an exception by its name and its message."""
    write, file = FORMATS[form]
    with tempfile.TemporaryDirectory() as folder:
        try:
            return write(VALUES[name](), Path(folder) / file)
        except (TypeError, ValueError) as error:
            return {type(error).__name__: str(error)}


def paged(name: str) -> Any:
    """What is kept of the data of a player's page; not how long a search took."""
    if name == "plan.json":
        player = player_of_file(RESULTS[name](), parking_plan(), title="A file")
    else:
        player = player_of(VALUES[name]())
    content = json.loads(json.dumps(player.content))
    for step in content.get("steps", ()):
        step.pop("solve_s")
    search = content.get("search", {})
    for curve in ("costs", "bounds"):
        search |= {curve: [value for _, value in search.get(curve, ())]}
    return digest(content)


PAGES = [*VALUES, "plan.json"]
EXPORTS = [(form, name) for form in FORMATS for name in VALUES]


def recorded() -> dict[str, Any]:
    """What every value writes in every format."""
    return {f"{form}: {name}": exported(form, name) for form, name in EXPORTS}


def recorded_pages() -> dict[str, Any]:
    """What every page shows."""
    return {name: paged(name) for name in PAGES}


def _number(cell: str) -> float | str:
    try:
        return float(cell)
    except ValueError:
        return cell


def _rerun(told: dict[str, list[Any]]) -> types.ModuleType:
    """A module that stands for rerun: what is logged is noted in `told`, by entity."""
    module, now = types.ModuleType("rerun"), [0.0]

    def noted(name: str) -> Callable[..., Any]:
        def make(*arguments: Any, **named: Any) -> dict[str, Any]:
            return {name: [*map(_plain, arguments)], **{k: _plain(v) for k, v in named.items()}}

        make.columns = make  # type: ignore[attr-defined]
        return make

    class Stream:
        def __init__(self, application: str) -> None:
            told["/"] = [application]

        def log(self, at: str, what: Any, *, static: bool = False) -> None:
            told.setdefault(at, []).append({"static": static, "at": now[0], "what": what})

        def send_columns(self, at: str, *, indexes: Any, columns: Any) -> None:
            told.setdefault(at, []).append({"indexes": indexes, "columns": columns})

        def send_recording_name(self, name: str) -> None:
            told["/"].append(name)

        def set_time(self, line: str, *, duration: float) -> None:
            now[0] = float(duration)

        def save(self, path: Path, **_: Any) -> None:
            path.touch()

        def flush(self) -> None: ...

        def disconnect(self) -> None: ...

    names = (
        "LineStrips3D Points3D Arrows3D Transform3D SeriesLines Scalars TimeColumn TextLog Clear "
        "Boxes3D Color"
    )
    for name in names.split():
        setattr(module, name, noted(name))
    module.RecordingStream = Stream  # type: ignore[attr-defined]
    module.ViewCoordinates = types.SimpleNamespace(RIGHT_HAND_Z_UP="z is up")  # type: ignore[attr-defined]
    module.blueprint = mock.MagicMock()  # type: ignore[attr-defined]
    module.new_entity_path = lambda parts: "/" + "/".join(map(str, parts))  # type: ignore[attr-defined]
    return module


def _plain(value: Any) -> Any:
    """Numbers of NumPy as lists."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return [_plain(one) for one in value] if isinstance(value, list | tuple) else value

"""What can be done with every kind of result: ``python -m tests.matrix.kinds`` prints the table.

A cell works, or makes no sense, and then whoever tries it is told why in one line.
"""

from __future__ import annotations

import contextlib
import functools
import io
import json
import os
import tempfile
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

import maneuver_automaton as ma
from maneuver_automaton.cli import run
from maneuver_automaton.exports import load_recording
from maneuver_automaton.formats.closed_loop_json import load_statistics
from maneuver_automaton.formats.plan_json import plan_of_document
from maneuver_automaton.plotting import player_of, player_of_file, save_film, save_picture
from maneuver_automaton.recording import recording_of
from tests.goldens.messages import LOOP
from tests.results import ALONE, RESULTS, TOGETHER
from tests.test_cli_fleets import FLEET

KINDS = tuple(RESULTS)
# Of every kind the file that states it, the command that makes its result, and what that writes.
MADE = {
    "plan": ("loop.yaml", ["plan"], "plan.json"),
    "plan.json": ("loop.yaml", ["plan"], "plan.json"),
    "closed loop": ("loop.yaml", ["mpc"], "closed_loop.json"),
    "statistics": ("loop.yaml", ["mpc", "--seeds", "2"], "statistics.json"),
    "fleet": ("fleet.yaml", ["plan", "--time-limit", "20"], "plan.json"),
    "fleet log": ("fleet.yaml", ["mpc", "--steps", "20"], "closed_loop.json"),
    "road plan": ("road.xml", ["plan"], "plan.json"),
    "road drive": ("road.xml", ["mpc"], "closed_loop.json"),
    "road fleet": ("two.xml", ["plan"], "plan.json"),
    "road fleet drive": ("two.xml", ["mpc"], "closed_loop.json"),
}
FILES = {
    "loop.yaml": LOOP + "obstacles: [{disc_m: {center: [0.0, 3.0], radius: 0.5}}]\n",
    "fleet.yaml": FLEET + "receding_horizon: {step_s: 0.5}\n",
    "road.xml": ALONE,
    "two.xml": TOGETHER,
}


class Refused(Exception):
    """What was asked for makes no sense, and one line says why."""


@functools.cache
def made(kind: str) -> tuple[Path, int, str]:
    """The folder of a kind with its files, made once; exit code, and what was printed."""
    folder = Path(tempfile.mkdtemp(prefix="kinds_"))
    stated, (command, *more), _ = MADE[kind]
    (folder / stated).write_text(FILES[stated])
    with _within(folder):
        code, out, err = printed(command, stated, "--no-plot", *more)
    assert code == 0, err
    return folder, code, out


@contextlib.contextmanager
def _within(folder: Path) -> Iterator[None]:
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


def printed(*arguments: str) -> tuple[int, str, str]:
    """Exit code and what a command prints on both streams."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = run(list(arguments))
    return code, out.getvalue(), err.getvalue()


def asked(kind: str, command: str, *more: str) -> str:
    """What a command says of the file of a kind, with the file that states it."""
    folder, *_ = made(kind)
    stated, _, written = MADE[kind]
    with _within(folder):
        code, out, err = printed(command, f"out/{written}", *more, "--with", stated)
    if code == 2:
        raise Refused(err)
    assert code == 0, err
    return out


def write(kind: str) -> None:
    """Its command writes a document that says how it ended."""
    folder, *_ = made(kind)
    document = json.loads((folder / "out" / MADE[kind][2]).read_text())
    assert "status" in document or "loops" in document


def read(kind: str) -> None:
    """Its document is read, and they who move in it end where it says."""
    folder, *_ = made(kind)
    stated, _, written = MADE[kind]
    file = folder / "out" / written
    if kind == "statistics":
        loops = json.loads(file.read_text())["loops"]
        assert [one.reached for one in load_statistics(file).outcomes] == [
            one["reached"] for one in loops
        ]
        return
    try:
        movers = load_recording(file, beside=folder / stated).movers
    except ma.errors.InvalidScenario as error:
        raise Refused(str(error)) from error
    document = json.loads(file.read_text())
    several = document.get("vehicles") or {"": document}
    assert len(movers) == len(several)
    for mover, one in zip(movers, several.values(), strict=True):
        end = one["trajectory"]["pose"][-1] if "trajectory" in one else one["steps"][-1]["pose"]
        where = one["steps"][-1].get("vehicle_pose") if "steps" in one else None
        off = np.asarray(mover.end)[:2] - np.array(where or end)[:2]
        assert np.abs(off).max() < 1e-6


def draw(kind: str) -> None:
    """It has a picture."""
    with tempfile.TemporaryDirectory() as name:
        save_picture(_result(kind), Path(name) / "x.png")
        assert (Path(name) / "x.png").read_bytes()[1:4] == b"PNG"


def film(kind: str) -> None:
    """It has a film."""
    with tempfile.TemporaryDirectory() as name:
        save_film(_result(kind), Path(name) / "x.gif")
        assert (Path(name) / "x.gif").read_bytes()[:3] == b"GIF"


def play(kind: str) -> None:
    """It has a page that plays it."""
    page = player_of_file(_document(), _plan(), title="x") if kind == "plan.json" else None
    content = (page or player_of(_result(kind))).content
    assert any(one["twists"] for one in content["motions"])


def show(kind: str) -> None:
    """A notebook shows it."""
    value = _result(kind)
    if not hasattr(value, "_repr_html_"):
        raise Refused(f"{type(value).__name__} shows nothing in a notebook")
    assert value._repr_html_().startswith("<iframe")
    assert value._repr_png_()[1:4] == b"PNG"


def tell(kind: str) -> None:
    """Its command says what came of it."""
    _, _, out = made(kind)
    assert "written to:" in out


def row(kind: str) -> None:
    """A folder with it has a row for it in its table."""
    stated, (command, *more), _ = MADE[kind]
    with tempfile.TemporaryDirectory() as name, _within(Path(name)):
        Path("many").mkdir()
        Path("many", stated).write_text(FILES[stated])
        code, out, err = printed(command, "many", "--no-plot", *more)
        if code == 2:
            raise Refused(err)
        assert code == 0, err
        assert any(line.strip().startswith(stated) for line in out.splitlines()), out


def check(kind: str) -> None:
    """It is checked again, by those who did not make it."""
    assert "yes" in asked(kind, "check")


def export(kind: str) -> None:
    """It is written for other programs."""
    value = _result(kind)
    try:
        messages = ma.ros_messages(value, step=0.5)
        with tempfile.TemporaryDirectory() as name:
            ma.save_csv(value, Path(name) / "x.csv", step=0.5)
            ma.save_geojson(value, Path(name) / "x.geojson")
            assert (Path(name) / "x.csv").read_text().count("\n") > 2
            features = json.loads((Path(name) / "x.geojson").read_text())["features"]
    except TypeError as error:
        raise Refused(str(error)) from error
    assert "tf" in messages
    assert any(one["properties"]["kind"] == "path" for one in features)


def draw_again(kind: str) -> None:
    """It is drawn again from its file."""
    folder, *_ = made(kind)
    asked(kind, "plot")
    picture = folder / "out" / Path(MADE[kind][2]).with_suffix(".png")
    assert picture.read_bytes()[1:4] == b"PNG"


def distances(kind: str) -> None:
    """How far it is from what is around, or from each other, over time."""
    folder, *_ = made(kind)
    stated, _, written = MADE[kind]
    try:
        recording = load_recording(folder / "out" / written, beside=folder / stated)
    except ma.errors.InvalidScenario as error:
        raise Refused(str(error)) from error
    content = player_of(recording).content
    several = content.get("fleet", {"distance": content["motions"][0]["clearance"]})
    assert min(several["distance"]["v"]) > 0.0


def _document() -> dict[str, Any]:
    return dict(RESULTS["plan.json"]())


def _plan() -> ma.Plan:
    return plan_of_document(_document())


def _result(kind: str) -> Any:
    value = _plan() if kind == "plan.json" else RESULTS[kind]()
    try:
        recording_of(value)
    except TypeError as error:
        raise Refused(str(error)) from error
    return value


ACTIONS: dict[str, Callable[[str], None]] = {
    "write": write,
    "read": read,
    "draw": draw,
    "film": film,
    "play": play,
    "show in a notebook": show,
    "tell": tell,
    "row of a folder": row,
    "check again": check,
    "export": export,
    "draw again": draw_again,
    "distances": distances,
}
NO_MOTION = (
    "draw", "film", "play", "show in a notebook", "check again", "export", "draw again",
    "distances",
)  # fmt: skip
SENSELESS = {("statistics", action): "no motion of many loops is kept" for action in NO_MOTION}
# Cells that somebody is to fill: the line goes with the commit that does.
NOT_YET: dict[tuple[str, str], str] = {}


def main() -> None:
    """Print the table: ``.`` works, ``-`` makes no sense, ``F`` fails."""
    warnings.simplefilter("ignore")
    notes = []
    lines = ["| action | " + " | ".join(KINDS) + " |", "| --- |" + " --- |" * len(KINDS)]
    for action, does in ACTIONS.items():
        signs = []
        for kind in KINDS:
            sign, said = ".", ""
            try:
                does(kind)
            except Refused as error:
                sign, said = "-", str(error)
            except Exception as error:  # noqa: BLE001, whatever it is, it is this cell's alone
                sign, said = "F", f"{type(error).__name__}: {error}"
            signs.append(sign)
            if said:
                notes.append(f"- {kind}, {action} `{sign}`: {said.strip().splitlines()[0][:160]}")
        lines.append(f"| {action} | " + " | ".join(signs) + " |")
    print("\n".join([*lines, "", *notes]))  # noqa: T201


if __name__ == "__main__":
    main()

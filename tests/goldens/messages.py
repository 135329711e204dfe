"""What commands print: of inputs that cannot be used the whole message, of others the tables too.

Numbers that are times of this machine, or no more than rounding, are masked, and so is how wide the
columns are that hold them.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

import maneuver_automaton as ma
from maneuver_automaton.cli import run
from tests.inertia import unicycle_automaton
from tests.results import ALONE, TOGETHER
from tests.scenario.files import SCENARIO, but, grid
from tests.scenario.files import automaton as library
from tests.test_cli_fleets import FLEET

UNIT = "{min: -1, max: 1, step: 1}"
LOOP = SCENARIO + "receding_horizon: {step_s: 0.5}\n"
FIXED = SCENARIO.replace("time_s: free", "time_s: 4.0")


def _obstacle(text: str) -> str:
    return f"{SCENARIO}obstacles:\n  - {text}\n"


def _vehicle(text: str) -> str:
    return but("{model: unicycle}", text)


# Scenario files, read by `plan`.
FILES: dict[str, str] = {
    "unknown key": but("name: A case", "nam: A case"),
    "unknown key inside": but("max_trims: 4", "max_trim: 4"),
    "wrong schema": but("schema: 1", "schema: 2"),
    "no goal": but("goal: {pose: [1.0, 1.0, 0.0]}\n", ""),
    "no pose": but("goal: {pose: [1.0, 1.0, 0.0]}", "goal: {tolerance_m: 0.1}"),
    "pose too short": but("goal: {pose: [1.0, 1.0, 0.0]}", "goal: {pose: [1.0, 1.0]}"),
    "pose with height": but("goal: {pose: [1.0, 1.0, 0.0]}", "goal: {pose: [1, 1, 0, 2]}"),
    "pose that is nan": but("goal: {pose: [1.0, 1.0, 0.0]}", "goal: {pose: [.nan, 1, 0]}"),
    "trim of the goal": but("1.0, 0.0]}\ncost", "1.0, 0.0], trim: spinn}\ncost"),
    "control of a word": but("control: [0.0, 1.0]", "control: abc"),
    "two trims of a name": but("name: spin", "name: ahead"),
    "unknown preset": library("preset: dubbins"),
    "library that is missing": library("file: nowhere.json"),
    "grid of one axis": grid(f"[{UNIT}]"),
    "grid that is huge": grid(f"[{{min: -1, max: 1, count: 100001}}, {UNIT}]"),
    "unknown model": _vehicle("{model: tank}"),
    "car without wheelbase": _vehicle("{model: car}"),
    "beyond the limits": _vehicle("{model: unicycle, max_speed_m_s: 0.5}"),
    "footprint of no area": _vehicle("{model: unicycle, footprint: {rectangle_m: [1, 0]}}"),
    "negative weight": but("effort: 1.0", "effort: -1.0"),
    "all weights zero": but("effort: 1.0", "effort: 0.0"),
    "time and greatest time": but("time_s: free", "time_s: 8.0, max_time_s: 9.0"),
    "time of zero": but("time_s: free", "time_s: 0"),
    "unknown method": but("time_limit_s: 5.0", "method: astar"),
    "obstacle that crosses itself": _obstacle("{polygon_m: [[0, 0], [2, 2], [2, 0], [0, 3]]}"),
    "obstacle of two kinds": _obstacle("{disc_m: {center: [3, 0], radius: 1}, map: a.yaml}"),
    "motion backwards": _obstacle(
        "{disc_m: {center: [3, 0], radius: 1}, motion: [[0, 0, 0, 0], [0, 1, 0, 0]]}"
    ),
    "map that is missing": _obstacle("{map: nowhere.yaml}"),
    "bounds reversed": SCENARIO + "bounds_m: {x: [5, -5]}\n",
    "loop without a step": SCENARIO + "receding_horizon: {steps: 12}\n",
    "the key twice": SCENARIO + "name: again\n",
    "empty": "",
}

# Command lines; the folder holds x.yaml, a scenario, and loop.yaml, one with a closed loop.
COMMANDS: dict[str, list[str]] = {
    "no such file": ["plan", "nowhere.yaml"],
    "time limit of zero": ["plan", "x.yaml", "--time-limit", "0"],
    "a scenario beside a scenario": ["plan", "x.yaml", "--with", "x.yaml"],
    "a case that is not there": ["plan", "x.yaml", "--case", "1"],
    "no closed loop": ["mpc", "x.yaml"],
    "resume and seeds": ["mpc", "loop.yaml", "--resume", "a.json", "--seeds", "2"],
    "resume from nothing": ["mpc", "loop.yaml", "--resume", "a.json"],
    "out is a file": ["plan", "x.yaml", "--out", "x.yaml"],
    "no such plan": ["plot", "plan.json"],
    "convert to what is not written": ["convert", "x.yaml", "x.csv"],
    "check nothing": ["check", "nowhere.yaml"],
    "show nothing": ["automaton", "show", "nowhere.json"],
    "a folder of nothing": ["plan", "empty"],
    "a step longer than the horizon": ["mpc", "long.yaml"],
    "time limit that is nan": ["plan", "x.yaml", "--time-limit", "nan"],
    "time limit of a loop": ["mpc", "loop.yaml", "--time-limit", "0"],
    "out of a loop is a file": ["mpc", "loop.yaml", "--out", "x.yaml"],
    "alternatives of a loop": ["mpc", "loop.yaml", "--alternatives", "2"],
    "retimed without a fixed time": ["mpc", "retimed.yaml"],
    "noise of another group": ["mpc", "climbing.yaml"],
    "two files of one name": ["plan", "twice"],
    "convert a scenario to a map": ["convert", "x.yaml", "x.map"],
    "processes for one file": ["plan", "x.yaml", "--dask", "local"],
    "resume a folder": ["mpc", "many", "--resume", "log.json"],
    "size of a word": ["plan", "x.yaml", "--size", "wide"],
    "size of nothing": ["mpc", "loop.yaml", "--size", "0x3"],
    "unknown style": ["plot", "x.yaml", "--style", "poster"],
    "unknown style of a library": ["automaton", "draw", "x.yaml", "--style", "poster"],
    "no such road": ["plan", "nowhere.xml"],
    "seeds on roads": ["mpc", "road.xml", "--seeds", "2"],
    "check a road": ["check", "road.xml"],
    "check two roads": ["check", "two.xml"],
    "a case that a road has not": ["mpc", "road.xml", "--case", "3"],
    "a unicycle on roads": ["plan", "road.xml", "--with", "x.yaml"],
    "alternatives of a fleet": ["plan", "fleet.yaml", "--alternatives", "2"],
    "gap of a fleet": ["plan", "fleet.yaml", "--gap", "0.1"],
    "a case of a fleet": ["plan", "fleet.yaml", "--case", "1"],
    "a fleet with a scenario": ["plan", "fleet.yaml", "--with", "x.yaml"],
    "library of a fleet": ["automaton", "show", "fleet.yaml"],
    "seeds of a fleet": ["mpc", "fleet.yaml", "--seeds", "3"],
    "gap of a fleet's loop": ["mpc", "fleet.yaml", "--gap", "0.1"],
    "no closed loop of a fleet": ["mpc", "still.yaml"],
}

# Wrong usage: only the exit code is kept, the words are those of the library that parses it.
USAGE: dict[str, list[str]] = {
    "no command": [],
    "unknown command": ["plam"],
    "no file": ["plan"],
    "unknown option": ["plan", "x.yaml", "--bad"],
    "no whole number": ["mpc", "loop.yaml", "--steps", "two"],
    "no steps": ["mpc", "loop.yaml", "--steps", "0"],
    "seed below zero": ["mpc", "loop.yaml", "--seed", "-1"],
    "no seeds": ["mpc", "loop.yaml", "--seeds", "0"],
    "no processes": ["plan", "x.yaml", "--jobs", "0"],
}


# What commands print that do their work, one after another in a folder: each row is a folder of its
# own, and what its last command prints is kept.
QUIET = ["--no-plot", "--quiet"]
PRINTED: dict[str, list[list[str]]] = {
    "plan": [["plan", "x.yaml", "--no-plot"]],
    "plan, alternatives": [["plan", "x.yaml", "--no-plot", "--alternatives", "1"]],
    "plan, none": [["plan", "none.yaml", "--no-plot"]],
    "plan, figure": [["plan", "x.yaml", "--quiet"]],
    "plan a folder": [["plan", "many", "--no-plot"]],
    "loop": [["mpc", "loop.yaml", "--no-plot"]],
    "loop, two steps": [["mpc", "loop.yaml", "--no-plot", "--steps", "2"]],
    "loop, seeds": [["mpc", "loop.yaml", "--no-plot", "--seeds", "2"]],
    "loop a folder": [["mpc", "many", "--no-plot", "--steps", "2"]],
    "fleet": [["plan", "fleet.yaml", "--no-plot", "--time-limit", "20"]],
    "fleet, loop": [["mpc", "fleet.yaml", "--no-plot", "--steps", "6"]],
    "road": [["plan", "road.xml", "--no-plot"]],
    "road, loop": [["mpc", "road.xml", "--no-plot"]],
    "roads": [["plan", "two.xml", "--no-plot"]],
    "roads, loop": [["mpc", "two.xml", "--no-plot"]],
    "check": [["check", "x.yaml"]],
    "check a plan": [["plan", "x.yaml", *QUIET], ["check", "out/plan.json", "--with", "x.yaml"]],
    "check a fleet": [
        ["plan", "fleet.yaml", *QUIET], ["check", "out/plan.json", "--with", "fleet.yaml"]
    ],
    "convert": [["convert", "x.yaml", "y.yaml"]],
    "plot": [["plan", "x.yaml", *QUIET], ["plot", "out/plan.json"]],
    "export": [["plan", "x.yaml", *QUIET], ["export", "out/plan.json", "--to", "csv"]],
    "show a library": [["automaton", "show", "x.yaml"]],
    "build a library": [["automaton", "build", "x.yaml", "--out", "library.json"]],
    "draw a library": [["automaton", "draw", "x.yaml"]],
}  # fmt: skip
# Lines, and last columns of tables, whose numbers are times of this machine.
BY_THE_CLOCK = re.compile(r"^ *(timing|time per step|searched|planned before|counts):")
TIMED_COLUMN = re.compile(r"(first plan \[s\]|solved \[ms\])$")


def _robot() -> ma.Automaton:
    return ma.Automaton.of_controls(ma.Unicycle(), {"rest": (0, 0), "ahead": (1, 0)})


def _problem(**changed: Any) -> ma.Problem:
    return ma.Problem(_robot(), [0, 0, 0], [1, 0, 0], **changed)


# Calls, and the exception that each raises.
CALLS: dict[str, Callable[[], Any]] = {
    "pose of two numbers": lambda: ma.Problem(_robot(), [0, 0], [1, 0, 0]),
    "goal of four numbers": lambda: ma.Problem(_robot(), [0, 0, 0], [1, 0, 0, 2]),
    "no goal": lambda: ma.Problem(_robot(), [0, 0, 0], []),
    "start that is nan": lambda: ma.Problem(_robot(), [np.nan, 0, 0], [1, 0, 0]),
    "unknown start trim": lambda: _problem(start_trim="ahed"),
    "margin below zero": lambda: _problem(margin=-0.1),
    "start time that is infinite": lambda: _problem(start_time=np.inf),
    "time and greatest time": lambda: ma.Horizon(time=1.0, max_time=2.0),
    "no trims at all": lambda: ma.Horizon(max_trims=0),
    "least coasting time below zero": lambda: ma.Horizon(min_coast=-1.0),
    "cost of nothing": lambda: ma.Cost(),
    "matrix that is indefinite": lambda: ma.Cost(
        effort=1.0, effort_matrix=np.array([[1.0, 2.0], [2.0, 1.0]])
    ),
    "time limit of zero": lambda: ma.plan(_problem(), time_limit=0.0),
    "alternatives below zero": lambda: ma.plan(_problem(), alternatives=-1),
    "unknown method": lambda: ma.SearchSettings(method="astar"),
    "no expansions": lambda: ma.SearchSettings(max_expansions=0),
    "bounds reversed": lambda: ma.Bounds(x=(1.0, 0.0)),
    "tolerance below zero": lambda: ma.Goal(pose=[0, 0, 0], tolerance_m=-1.0),
    "disc of no size": lambda: ma.Disc(0.0),
    "polygon of two corners": lambda: ma.Polygon([[0, 0], [1, 1]]),
    "motion backwards": lambda: ma.Motion([1.0, 0.0], [[0, 0, 0], [1, 0, 0]]),
    "unknown trim": lambda: _robot().index_of("ahed"),
    "no trim": lambda: ma.Automaton.of_controls(ma.Unicycle(), {}),
    "steps of zero": lambda: ma.simulate(_problem(), step=0.5, steps=0),
    "step of zero": lambda: ma.simulate(_problem(), step=0.0),
    "step of zero with inertia": lambda: ma.simulate(
        ma.Problem(unicycle_automaton(), [0, 0, 0], [1, 0, 0]), step=0.0
    ),
    "noise below zero": lambda: ma.Disturbance(position_m=-1.0),
    "unknown stock library": lambda: ma.load_stock_library("hovercrafts"),
    "plan that is missing": lambda: ma.load_plan("nowhere.json"),
    "library that is missing": lambda: ma.load_library("nowhere.json"),
    "bounds that would have to move": lambda: _problem(bounds=ma.Bounds(x=(0.0, 1.0))).moved(
        ma.SE2([1.0, 0.0, 0.0])
    ),
    "part that is not carried": lambda: _problem(parts={"trailer": ma.Disc(1.0)}),
    "attribute that is not there": lambda: getattr(ma, "plam"),  # noqa: B009
}


@contextlib.contextmanager
def folder() -> Iterator[Path]:
    """A current folder of its own, with the files that the commands read."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as name:
        os.chdir(name)
        try:
            Path("empty").mkdir()
            Path("x.yaml").write_text(SCENARIO)
            Path("loop.yaml").write_text(LOOP)
            Path("none.yaml").write_text(SCENARIO + "bounds_m: {x: [-0.5, 0.5]}\n")
            fleet = FLEET.replace("time_limit_s: 1", "time_limit_s: 20")  # it ends before
            loop = "receding_horizon: {step_s: 0.5, time_limit_s: 20}\n"
            Path("fleet.yaml").write_text(fleet + loop)
            Path("still.yaml").write_text(fleet)
            Path("road.xml").write_text(ALONE)
            Path("two.xml").write_text(TOGETHER)
            Path("many").mkdir()
            Path("many", "a.yaml").write_text(LOOP)
            Path("many", "b.yaml").write_text(LOOP.replace("A case", "Another"))
            Path("twice").mkdir()
            Path("twice", "a.yaml").write_text(SCENARIO)
            Path("twice", "a.yml").write_text(SCENARIO)
            Path("retimed.yaml").write_text(LOOP.replace("0.5}", "0.5, retimed: true}"))
            noise = "0.5, disturbance: {twist_scale: [1, 1, 1, 1]}}"
            Path("climbing.yaml").write_text(LOOP.replace("0.5}", noise))
            Path("long.yaml").write_text(FIXED + "receding_horizon: {step_s: 5.0}\n")
            yield Path(name)
        finally:
            os.chdir(before)


def of_command(arguments: list[str]) -> dict[str, Any]:
    """Exit code, and what is printed where."""
    out, err = io.StringIO(), io.StringIO()
    with folder(), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = run(arguments)
    return {"exit": code, "out": out.getvalue(), "err": err.getvalue()}


def of_printed(commands: list[list[str]]) -> dict[str, Any]:
    """Exit code of the last of several commands, and what it prints, masked."""
    out, err = io.StringIO(), io.StringIO()
    with folder(), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        for arguments in commands:
            for stream in (out, err):
                stream.truncate(0)
                stream.seek(0)
            code = run(arguments)
    return {"exit": code, "out": masked(out.getvalue()), "err": masked(err.getvalue())}


def masked(text: str) -> list[str]:
    """The lines of a text without what depends on the machine; empty lines and rules left out."""
    lines, timed = [], False
    for line in (" ".join(one.split()) for one in text.splitlines()):
        timed = (timed or bool(TIMED_COLUMN.search(line))) and bool(line)
        if not line.strip("─ "):
            timed = timed and bool(line)
            continue
        if BY_THE_CLOCK.match(line):
            line = re.sub(r"[0-9.]+", "#", line)
        elif timed and not TIMED_COLUMN.search(line):
            line = re.sub(r"[0-9.e-]+$", "#", line)
        lines.append(re.sub(r"\b[0-9.]+e-[0-9]{2}\b", "tiny", line))
    return lines


def of_file(text: str) -> dict[str, Any]:
    """Exit code and message of `plan` for a scenario file."""
    err = io.StringIO()
    with folder(), contextlib.redirect_stderr(err):
        Path("bad.yaml").write_text(text)
        code = run(["plan", "bad.yaml", "--quiet", "--no-plot"])
    return {"exit": code, "err": err.getvalue()}


def of_call(call: Callable[[], Any]) -> dict[str, Any]:
    """Name and message of the exception that a call raises."""
    with folder():
        try:
            call()
        except Exception as error:  # noqa: BLE001, whatever it is, it is kept
            return {"error": type(error).__name__, "message": str(error)}
    return {"error": None, "message": ""}


def of_usage(arguments: list[str]) -> dict[str, Any]:
    """Exit code of a wrong command line."""
    return {"exit": of_command(arguments)["exit"]}


def cases() -> dict[str, Callable[[], dict[str, Any]]]:
    """What to call for the answer to every bad input, by its name."""
    kinds: list[tuple[str, dict[str, Any], Callable[[Any], dict[str, Any]]]] = [
        ("file", FILES, of_file),
        ("command", COMMANDS, of_command),
        ("usage", USAGE, of_usage),
        ("printed", PRINTED, of_printed),
        ("call", CALLS, of_call),
    ]
    return {
        f"{kind}: {name}": lambda answer=answer, given=given: answer(given)
        for kind, inputs, answer in kinds
        for name, given in inputs.items()
    }


def recorded() -> dict[str, Any]:
    """The answers to all of them."""
    return {name: answer() for name, answer in cases().items()}

"""Keys, status and exit code of the files that every scenario leads to, by the command line."""

from __future__ import annotations

import contextlib
import io
import json
import os
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from maneuver_automaton.cli import run
from tests.goldens.scenes import SCENARIOS
from tests.scenario.files import SCENARIO, but

# Counts that are there only where the time was enough for what they count; a certificate only
# where the best plan is a word of the library, and not a polished one.
BY_THE_CLOCK = {"certificate", "counts.polished", "counts.solver_errors"}
KEYS = "keys of "
LIMITS = {"helicopter_city": "20", "tpcap_full": "6"}  # [s], elsewhere 3

AMONG = """schema: 1
vehicle: {model: unicycle, footprint: {disc_m: 0.2}}
automaton: {preset: reeds_shepp}
start: {pose: [0.0, 0.0, 0.0]}
goal: {pose: [2.0, 0.0, 0.0]}
obstacles:
  - {box_m: {center: [1.0, 0.2], size: [0.2, 0.5]}}
search: {max_expansions: 2000}
"""
RING = (
    "{polygon_m: [[-9, -9], [9, -9], [9, 9], [-9, 9]], "
    "holes_m: [[[-8, -8], [8, -8], [8, 8], [-8, 8]]]}"
)
MOVES = "{disc_m: {center: [0, 0], radius: 0.2}, motion: [[0, 2, -3, 0], [9, 2, 3, 0]]}"
AHEAD_ONLY = but("    - {name: spin, control: [0.0, 1.0]}\n", "")
STEPS = "receding_horizon: {step_s: 0.5}\n"
NOISE = "disturbance: {position_m: 0.01, heading_rad: 0.01, seed: 1}"
NEAR = "pose: [1.0, 1.0, 0.0], tolerance_m: 0.2, tolerance_rad: 0.2"
ROBOT = """schema: 1
vehicle: {model: second_order_unicycle, max_speed_m_s: 0.5, max_turn_rate_rad_s: 0.5,
  max_acceleration_m_s2: 0.25, max_angular_acceleration_rad_s2: 0.25}
automaton: {preset: second_order_unicycle}
start: {pose: [0.0, 0.0, 0.0]}
goal: {pose: [1.5, 0.5, 0.5]}
receding_horizon: {step_s: 1.0, steps: 3}
"""
TEXTS = {  # name: (file, arguments)
    "found": (SCENARIO, ["plan"]),
    "found, alternatives": (SCENARIO, ["plan", "--alternatives", "2"]),
    "found, among obstacles": (AMONG, ["plan", "--alternatives", "2"]),
    "found, something moves": (AMONG.replace("search:", f"  - {MOVES}\nsearch:"), ["plan"]),
    "start is goal": (but("pose: [1.0, 1.0, 0.0]", "pose: [0.0, 0.0, 0.0]"), ["plan"]),
    "start blocked": (AMONG.replace("center: [1.0, 0.2]", "center: [0.1, 0.2]"), ["plan"]),
    "goal blocked": (AMONG.replace("center: [1.0, 0.2]", "center: [1.9, 0.2]"), ["plan"]),
    "unreachable": (AHEAD_ONLY, ["plan"]),
    "unreachable, enclosed": (
        AMONG.replace("[2.0, 0.0, 0.0]", "[20.0, 0.0, 0.0]").replace(
            "search:", f"  - {RING}\nsearch:"
        ),
        ["plan"],
    ),
    "out of budget": (
        AMONG.replace("[0.2, 0.5]", "[0.2, 60.0]").replace("2000", "30"),
        ["plan"],
    ),
    "goal outside": (SCENARIO + "bounds_m: {x: [-0.5, 0.5]}\n", ["plan"]),
    "with inertia": (ROBOT, ["plan"]),
    "with inertia, alternatives": (ROBOT, ["plan", "--alternatives", "2"]),
    "loop": (SCENARIO + STEPS, ["mpc"]),
    "loop, three steps": (SCENARIO + STEPS, ["mpc", "--steps", "3"]),
    "loop, noise": (
        but("pose: [1.0, 1.0, 0.0]", NEAR)
        + f"receding_horizon: {{step_s: 0.5, steps: 20, {NOISE}}}\n",
        ["mpc"],
    ),
    "loop, seeds": (SCENARIO + STEPS, ["mpc", "--seeds", "2"]),
    "loop, no plan": (AHEAD_ONLY + STEPS, ["mpc"]),
    "loop, start is goal": (
        but("pose: [1.0, 1.0, 0.0]", "pose: [0.0, 0.0, 0.0]") + STEPS,
        ["mpc"],
    ),
    "loop, among obstacles": (AMONG + STEPS, ["mpc"]),
    "loop, with inertia": (ROBOT, ["mpc"]),
}
QUICK_SCENARIOS = {"parking", "table1", "parking_loop"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A command line, and the text of the file it reads, if it is none of the scenarios."""

    arguments: list[str]  # {file} stands for the file
    text: str | None = None
    quick: bool = False


def all_cases() -> dict[str, Case]:
    """The command lines by their names."""
    return dict(_cases())


def _cases() -> Iterator[tuple[str, Case]]:
    for name, (text, (command, *more)) in TEXTS.items():
        limit = [] if "inertia" not in name else ["--time-limit", "5"]
        quick = name != "with inertia"  # which has no other keys than with alternatives
        yield name, Case(arguments=[command, "x.yaml", *more, *limit], text=text, quick=quick)
    for path in sorted(SCENARIOS.glob("*.yaml")):
        limit = ["--time-limit", LIMITS.get(path.stem, "3")]
        quick = path.stem in QUICK_SCENARIOS
        yield f"plan {path.stem}", Case(arguments=["plan", str(path), *limit], quick=quick)
        if "receding_horizon:" in path.read_text(encoding="utf-8"):
            yield f"mpc {path.stem}", Case(arguments=["mpc", str(path), *limit], quick=quick)


def answer(case: Case) -> dict[str, Any]:
    """Exit code, status, and the keys (with their types) of the file that is written."""
    err = io.StringIO()
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as name, contextlib.redirect_stderr(err):
        os.chdir(name)
        try:
            if case.text is not None:
                Path("x.yaml").write_text(case.text)
            code = run([*case.arguments, "--quiet", "--no-plot"])
            written = sorted(Path("out").glob("*.json"))
            contents = {path.name: json.loads(path.read_text()) for path in written}
        finally:
            os.chdir(before)
    (file, content), *rest = contents.items()
    assert not rest, f"{sorted(contents)} were written, expected one file"
    types = keys(content)
    for key in BY_THE_CLOCK:
        types.pop(key, None)
    return {
        "exit": code,
        "file": file,
        "status": content.get("status"),
        "keys": {key: "|".join(sorted(kinds)) for key, kinds in sorted(types.items())},
    }


def keys(value: Any, at: str = "") -> dict[str, set[str]]:
    """Every key of a document, with the types of its values.

    [] stands for all entries of a list, [trim] for those of the kind trim. Numbers and whole
    numbers count as one type.
    """
    if isinstance(value, dict):
        inside = [(f"{at}.{key}" if at else key, one) for key, one in value.items()]
        found = {at: {"object"}} if at else {}
    elif isinstance(value, list):
        inside = [(f"{at}[{_kind(one)}]", one) for one in value]
        found = {at: {"list"}}
    else:
        return {at: {_TYPES[type(value)]}}
    for key, one in inside:
        for name, kinds in keys(one, key).items():
            found.setdefault(name, set()).update(kinds)
    return found


def _kind(value: Any) -> str:
    """The kind of an entry of a list, where it states one."""
    return str(value.get("kind", "")) if isinstance(value, dict) else ""


def differences(before: dict[str, str], now: dict[str, str]) -> dict[str, tuple[Any, Any]]:
    """Keys that are gone, are new, or have another type, with the types before and now.

    Of what has kinds only those kinds are compared that both hold: whether a plan coasts, or is one
    maneuver, or breaks a guarantee, is no matter of its format.
    """
    found = {}
    for key in sorted({*before, *now}):
        ends = [at + len(end) for end in OF_A_KIND if (at := key.find(end)) >= 0]
        if all(key[:end] in before and key[:end] in now for end in ends):
            found[key] = (before.get(key), now.get(key))
    return {key: pair for key, pair in found.items() if pair[0] != pair[1]}


OF_A_KIND = ("[trim]", "[maneuver]", "broken_guarantees[]")
_TYPES = {bool: "bool", int: "number", float: "number", str: "text", type(None): "null"}


def recorded() -> dict[str, Any]:
    """The answers of all cases."""
    return packed({name: answer(case) for name, case in all_cases().items()})


def packed(answers: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Answers that name their keys, and every list of keys once, after the first case it is of."""
    tables: dict[str, dict[str, str]] = {}
    short = {}
    for name, one in answers.items():
        table = next((known for known, keys in tables.items() if keys == one["keys"]), None)
        if table is None:
            table = f"{KEYS}{name}"
            tables[table] = one["keys"]
        short[name] = one | {"keys": table}
    return tables | short


def unpacked(content: dict[str, Any], name: str) -> dict[str, Any]:
    """The answer of one case, its keys written out."""
    return {**content[name], "keys": content[content[name]["keys"]]}

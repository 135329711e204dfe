"""How long the shipped libraries take to build and to load, how exact they are, how large.

    python -m benchmarks.library_build [--jobs N] [NAME ...]

Every library is built from its build file, killed half way (if it has a journal) and gone on with,
loaded, and all its trims and maneuvers are driven again by an ODE solver at rtol 1e-10.
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import maneuver_automaton
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.building import journal_path, read_journal
from maneuver_automaton.automaton.library import load_library, stock_libraries
from maneuver_automaton.primitives.connecting import maneuver_defect
from maneuver_automaton.scenario.build_file import load_build_file
from tests.reference_dynamics import trim_defect

RECIPES = Path(maneuver_automaton.__file__).parent / "libraries"
COLUMNS = (
    "library", "trims", "maneuvers", "build s", "killed at", "resumed s", "same file", "load s",
    "kB", "trim defect", "maneuver defect",
)  # fmt: skip


def command(recipe: Path, out: Path, jobs: int) -> list[str]:
    options = ["--out", str(out), "--jobs", str(jobs), "--quiet"]
    return [sys.executable, "-m", "maneuver_automaton", "automaton", "build", str(recipe), *options]


def build_killed(recipe: Path, out: Path, jobs: int, pairs: int) -> tuple[int, float]:
    """Kill a build after a quarter of its pairs and go on: lines of the journal then, seconds."""
    journal = journal_path(out)
    with subprocess.Popen(command(recipe, out, jobs), start_new_session=True) as process:
        while process.poll() is None and len(read_journal(journal)) < pairs // 4:
            time.sleep(0.05)
        os.killpg(process.pid, signal.SIGKILL)
    lines = len(read_journal(journal))
    begin = time.perf_counter()
    subprocess.run(command(recipe, out, jobs), check=True)
    return lines, time.perf_counter() - begin


def defects(automaton: Automaton) -> tuple[float, float]:
    """Of the trims after 5 s, and of the maneuvers."""
    model = automaton.model
    return max(trim_defect(model, trim) for trim in automaton.trims), max(
        maneuver_defect(model, one, source=automaton[one.source], target=automaton[one.target])
        for one in automaton.maneuvers
    )


def row(name: str, jobs: int, folder: Path) -> list[str]:
    recipe, out = RECIPES / f"{name}.yaml", folder / f"{name}.json"
    begin = time.perf_counter()
    subprocess.run(command(recipe, out, jobs), check=True)
    build_s = time.perf_counter() - begin
    pairs = len(load_build_file(recipe).pairs())
    killed, resumed_s, same = "-", "-", "-"
    if pairs:
        lines, seconds = build_killed(recipe, folder / f"{name}-killed.json", jobs, pairs)
        again = (folder / f"{name}-killed.json").read_bytes()
        killed, resumed_s = str(lines), f"{seconds:.1f}"
        same = "yes" if again == out.read_bytes() else "NO"
    begin = time.perf_counter()
    automaton = load_library(out)
    load_s = time.perf_counter() - begin
    of_trims, of_maneuvers = defects(automaton)
    return [
        name, str(len(automaton)), str(len(automaton.maneuvers)), f"{build_s:.1f}", killed,
        resumed_s, same, f"{load_s:.2f}", f"{out.stat().st_size / 1e3:.0f}", f"{of_trims:.1e}",
        f"{of_maneuvers:.1e}",
    ]  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=list(stock_libraries()))
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    print(" | ".join(COLUMNS))
    with tempfile.TemporaryDirectory() as folder:
        for name in options.names:
            print(" | ".join(row(name, options.jobs, Path(folder))), flush=True)


if __name__ == "__main__":
    main()

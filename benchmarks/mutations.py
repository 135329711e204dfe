"""Damaged files of every kind: each is a plan, no plan, or one line that says what is wrong.

``python benchmarks/mutations.py [--count N] [--seed S] [--cases ...] [--keep DIR]``: case k
of a seed is always the same file and command. Each runs in a process of its own, forked from one
that has planned the undamaged files, with a limit of memory and of the time of the processor. What
ends in an internal error, by a signal, beyond 10 s or 1 GB is listed, and kept in DIR. A case
reaches the numbers if it is accepted, or refused for more than syntax, keys and kinds of values.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import re
import resource
import sys
import tempfile
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

sys.path.append(str(Path(__file__).parents[1]))

from benchmarks.mutated import mutated
from maneuver_automaton.cli import guard, run

ROOT = Path(__file__).parents[1]
SCENARIOS, DATA = ROOT / "scenarios", ROOT.parent / "shared" / "data"
MOST_SECONDS, MOST_BYTES = (
    10.0,
    1_000_000_000,
)  # of one case: processor, and memory beside the start
STOP_SECONDS = 30  # a case that takes so long is stopped
EVERY = 500  # cases between two lines on how far the run is
LONGEST = 130_000  # bytes of a file that is damaged
FAST = ["--quiet", "--no-plot", "--time-limit", "0.2", "--out", "out"]
PARSERS = ("read_bytes", "read_text", "too_long", "read_json_document", "parse", "need", "_take")
SYNTAX = re.compile(
    r"not valid|not a text|unknown|missing|stands twice|is empty|no such|second document|alias|tag "
    r"|need (a list|an object|a mapping|a text|a word|true|one of)"
)
BUILD = """\
schema: 1
library: cars
model: {kind: second_order_unicycle, max_speed: 0.5, max_turn_rate: 1.0, max_acceleration: 0.5,
        max_angular_acceleration: 2.0}
trims: {speed: [-0.5, 0, 0.5], turn_rate: [-1, 0, 1]}
maneuvers: {strokes_m: [0.5, 1.5], turns_rad: [0.3]}
"""


@dataclass(frozen=True, slots=True)
class Kind:
    """Files that are damaged alike, and the commands that read them."""

    name: str
    files: tuple[Path, ...]
    commands: tuple[tuple[str, ...], ...]  # FILE stands for the damaged file
    beside: tuple[Path, ...] = ()  # copied next to it


@dataclass(frozen=True, slots=True)
class Outcome:
    """How one case ended."""

    code: int  # of the command; negative: the signal that ended it
    said: str  # on stderr
    reached: bool  # the numbers
    seconds: float  # of the processor
    grown: int  # [bytes] beyond what the process began with


def kinds(made: Path) -> list[Kind]:
    """What there is of files; `made` is a folder for those that commands write."""
    plan = ("plan", "FILE", *FAST)
    show = ("automaton", "show", "FILE")
    shown_and_written = (show, ("convert", "FILE", "out/l.json"))
    again = ("convert", "FILE", "out/a.yaml")
    rewritten = ("convert", "FILE", "out/l.mprim")
    beside = ("--with", str(SCENARIOS / "tpcap.yaml"))
    listed = [
        Kind("scenario", _in(SCENARIOS, "*.yaml"), (plan, plan, plan, ("check", "FILE"), again)),
        Kind("loop", _in(SCENARIOS, "*loop*.yaml"), (("mpc", "FILE", "--steps", "2", *FAST),)),
        Kind("nav2 map", _in(SCENARIOS, "maps/*.yaml"), (("convert", "FILE", "out/m.map"),)),
        Kind("tpcap", _in(DATA, "tpcap/Case*.csv"), (plan, again)),
        Kind("dynobench", _in(DATA, "dynobench/envs/[cu][an]*/*.yaml"), (plan, plan, again)),
        Kind("parkbench", _in(DATA, "parkbench/*.yaml"), (plan, again)),
        Kind("car", _in(DATA, "car-scenarios/*.yaml"), (plan, again)),
        Kind("sbpl", _in(DATA, "sbpl/*/*/*.cfg"), ((*plan, *beside), (*again, *beside))),
        Kind(
            "mprim",
            _in(DATA, "sbpl/mprim/*"),
            (*shown_and_written, rewritten),
        ),
        Kind("lattice", _in(DATA, "nav2-lattice/*.json"), shown_and_written),
        Kind("road", _in(DATA, "commonroad/scenarios/*.xml"), (plan,)),
        Kind("road primitives", _in(DATA, "commonroad/primitives/*.xml"), shown_and_written),
        Kind(
            "movingai",
            _in(DATA, "movingai/*256.map.scen"),
            ((*again, *beside, "--case", "3"),),
            _in(DATA, "movingai/*256.map"),
        ),
        Kind("map", _in(made, "*.map"), (("convert", "FILE", "out/m.yaml"),)),
        Kind("library", _in(made, "lib*.json"), shown_and_written),
        Kind(
            "library used",
            _in(made, "lib1.json"),
            (("plan", "used.yaml", *FAST), ("check", "used.yaml")),
            _in(made, "used.yaml"),
        ),
        Kind("build", _in(made, "build.yaml"), (("automaton", "build", "FILE", "--quiet"),)),
        Kind("plan.json", _in(made, "plan*.json"), (("plot", "FILE", "--out", "out/p.png"),)),
        Kind(
            "closed_loop.json",
            _in(made, "closed_loop.json"),
            (("mpc", "loop.yaml", "--resume", "FILE", "--steps", "4", *FAST),),
            _in(made, "loop.yaml"),
        ),
    ]
    return [kind for kind in listed if kind.files]


def make(folder: Path) -> None:
    """Write one file of every kind that commands write."""
    (folder / "build.yaml").write_text(BUILD)
    (folder / "loop.yaml").write_text((SCENARIOS / "parking_loop.yaml").read_text())
    slot = (SCENARIOS / "car_slot.yaml").read_text()
    automaton = slot[slot.index("automaton:") : slot.index("start:")]
    (folder / "used.yaml").write_text(slot.replace(automaton, "automaton: {file: lib1.json}\n"))
    asked = [
        ["automaton", "build", str(SCENARIOS / "car_slot.yaml"), "-o", str(folder / "lib1.json")],
        ["automaton", "build", str(folder / "build.yaml"), "-o", str(folder / "lib2.json")],
        ["convert", str(SCENARIOS / "warehouse.yaml"), str(folder / "warehouse.map")],
        ["mpc", str(folder / "loop.yaml"), "--steps", "3", *FAST[:-1], str(folder)],
        ["plan", str(SCENARIOS / "car_slot.yaml"), *FAST[:-1], str(folder)],
    ]
    for arguments in asked:
        run(arguments)
    for path in folder.glob("lib*.json"):  # a changed library is taken as it is without its hash
        document = json.loads(path.read_text())
        del document["hash"]
        path.write_text(json.dumps(document, indent=1))


def _in(folder: Path, pattern: str) -> tuple[Path, ...]:
    return tuple(p for p in sorted(folder.glob(pattern)) if p.stat().st_size <= LONGEST)


def case(kind: Kind, rng: np.random.Generator, folder: Path) -> list[str]:
    """Write the damaged file of a case into `folder`; the command that reads it."""
    file = kind.files[rng.integers(len(kind.files))]
    command = kind.commands[rng.integers(len(kind.commands))]
    path = folder / file.name
    path.write_bytes(mutated(file.read_bytes(), file.suffix, rng))
    for other in (*kind.beside, *_around(kind, file)):
        with contextlib.suppress(FileExistsError):
            (folder / other.name).symlink_to(other)
    return [word.replace("FILE", path.name) for word in command]


def _around(kind: Kind, file: Path) -> list[Path]:
    """What files of some kinds name: models, maps, images."""
    if kind.name == "dynobench":
        return [DATA / "dynobench" / "models"]
    if kind.name == "nav2 map":
        return [file.with_suffix(".pgm")]
    return [SCENARIOS / "maps"] if kind.name == "scenario" else []


def outcome(command: list[str], folder: Path) -> Outcome:
    """Run a command in a forked process, in `folder`."""
    report, began = folder / ".report", resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    child = os.fork()
    if child == 0:
        os._exit(_in_child(command, folder, report))
    _, status, used = os.wait4(child, 0)
    said = (folder / ".stderr").read_text(errors="replace")
    code = os.waitstatus_to_exitcode(status)
    last = report.read_text() if report.exists() else ""
    reached = code in (0, 1) or (code == 2 and last not in PARSERS and not SYNTAX.search(said))
    grown = 1024 * max(0, used.ru_maxrss - began)
    return Outcome(code, said, reached, used.ru_utime + used.ru_stime, grown)


def _in_child(command: list[str], folder: Path, report: Path) -> int:
    """The exit code of a command; its words go to files, what raised to `report`."""
    os.chdir(folder)
    for number, name in ((1, ".stdout"), (2, ".stderr")):
        os.dup2(os.open(name, os.O_CREAT | os.O_WRONLY), number)
    sys.stdout, sys.stderr = open(1, "w", closefd=False), open(2, "w", closefd=False)  # noqa: SIM115
    resource.setrlimit(resource.RLIMIT_CPU, (STOP_SECONDS, STOP_SECONDS + 1))
    now = 4096 * int(Path("/proc/self/statm").read_text().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (now + 2 * MOST_BYTES,) * 2)
    explained: Callable[[Exception], str] = guard.explained

    def noting(error: Exception) -> str:
        frames = traceback.extract_tb(error.__traceback__)
        report.write_text(frames[-1].name if frames else "")
        if (text := explained(error)).startswith("internal error"):
            sys.stderr.write("".join(traceback.format_exception(error)))
        return text

    guard.explained = noting
    code = run(command)
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    return code


def wrong(ended: Outcome) -> str:
    """Why an outcome is none that may be; empty if it is."""
    if ended.code not in (0, 1, 2):
        return f"ended by signal {-ended.code}" if ended.code < 0 else f"exit code {ended.code}"
    if "internal error" in ended.said or "out of memory" in ended.said or "Traceback" in ended.said:
        return "internal error"
    if ended.seconds > MOST_SECONDS:
        return f"{ended.seconds:.1f} s"
    if ended.grown > MOST_BYTES:
        return f"{ended.grown / 1e9:.1f} GB"
    return "" if ended.code != 2 or ended.said.strip() else "not a word"


def numbered(count: int, seed: int, all_kinds: list[Kind]) -> Iterator[tuple[int, Kind, Any]]:
    """Cases one after the other, kind after kind."""
    for k in range(count):
        yield k, all_kinds[k % len(all_kinds)], np.random.default_rng([seed, k])


def main() -> None:
    """Damage files, run commands on them, print a table."""
    asked = _arguments()
    made = Path(tempfile.mkdtemp(prefix="mutations-"))
    make(made)
    chosen = [one for one in kinds(made) if not asked.kinds or one.name in asked.kinds]
    _warm(chosen)
    codes: Counter[tuple[str, str]] = Counter()
    slowest = largest = 0.0
    failures = 0
    for k, kind, rng in numbered(asked.count, asked.seed, chosen):
        if asked.cases is not None and k not in asked.cases:
            continue
        with tempfile.TemporaryDirectory(prefix="mutation-") as name:
            folder = Path(name)
            command = case(kind, rng, folder)
            ended = outcome(command, folder)
            codes[kind.name, str(ended.code)] += 1
            codes[kind.name, "reached"] += ended.reached
            slowest, largest = max(slowest, ended.seconds), max(largest, ended.grown)
            if why := wrong(ended):
                failures += 1
                _keep(asked.keep, k, command, folder, f"{why}\n{ended.said}")
                last = ended.said.strip().splitlines()[-1:] or [""]
                print(f"{k} {kind.name}: {why}: {' '.join(command)}: {last[0][:200]}", flush=True)
        if k % EVERY == EVERY - 1:
            reached = sum(n for (_, what), n in codes.items() if what == "reached")
            print(f"{k + 1} cases, {failures} wrong, {reached} reached the numbers", flush=True)
    _print(chosen, codes, failures, slowest, largest)
    raise SystemExit(bool(failures))


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--cases", type=int, nargs="*", help="only those of these numbers")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kinds", nargs="*", default=[])
    parser.add_argument("--keep", type=Path)
    return parser.parse_args()


def _warm(chosen: list[Kind]) -> None:
    """Run every command on undamaged files, so that modules and kernels are there."""
    with tempfile.TemporaryDirectory() as name, contextlib.chdir(name):
        for kind in chosen:
            for file in kind.files[:6]:
                for other in (file, *kind.beside, *_around(kind, file)):
                    with contextlib.suppress(FileExistsError):
                        Path(other.name).symlink_to(other)
            for file in kind.files[:6]:
                for command in set(kind.commands):
                    with contextlib.redirect_stdout(io.StringIO()):
                        run([word.replace("FILE", file.name) for word in command])


def _keep(folder: Path | None, k: int, command: list[str], files: Path, said: str) -> None:
    """Keep what went wrong: files, command, words."""
    if folder is None:
        return
    place = folder / str(k)
    place.mkdir(parents=True, exist_ok=True)
    (place / "said.txt").write_text(f"{' '.join(command)}\n{said}")
    for path in files.iterdir():
        if path.is_file() and not path.is_symlink() and path.stat().st_size <= LONGEST * 2:
            (place / path.name).write_bytes(path.read_bytes())


def _print(
    chosen: list[Kind],
    codes: Counter[tuple[str, str]],
    failures: int,
    slowest: float,
    largest: float,
) -> None:
    """A row a kind, and the whole."""
    print(f"{'kind':<18}{'cases':>8}{'0':>7}{'1':>7}{'2':>7}{'reached':>9}")
    total: Counter[str] = Counter()
    for kind in chosen:
        row = {one: codes[kind.name, one] for one in ("0", "1", "2", "reached")}
        cases = sum(n for (name, one), n in codes.items() if name == kind.name and one != "reached")
        total.update(row, cases=cases)
        print(f"{kind.name:<18}{cases:>8}" + "".join(f"{n:>7}" for n in row.values()))
    share = total["reached"] / max(1, total["cases"])
    print(
        f"{total['cases']} cases, {failures} wrong, {100 * share:.0f} % reached the numbers; "
        f"{slowest:.1f} s and {largest / 1e9:.2f} GB at most"
    )


if __name__ == "__main__":
    main()

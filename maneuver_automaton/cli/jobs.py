"""`plan` and `mpc`: read a file, do the job, write, draw, tell, complain; one file or a folder."""

from __future__ import annotations

import contextlib
import functools
import importlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from maneuver_automaton._interrupts import stopped
from maneuver_automaton._kernel_list import load_kernels
from maneuver_automaton.cli import folder_runs
from maneuver_automaton.cli.guard import BAD_INPUT, FOUND, NO_PLAN, complain, explained
from maneuver_automaton.cli.inputs import (
    Options,
    Parts,
    make_folder,
    printed,
    problem_of,
    refuse_unknown,
    states_several,
    writing,
)
from maneuver_automaton.cli.pictures import Draughtsman, draw
from maneuver_automaton.cli.terminal import announced, print_result, say
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.documents import write_document
from maneuver_automaton.formats.registry import is_road
from maneuver_automaton.recording import Fact, recording_of, tables_of
from maneuver_automaton.scenario import Scenario

NEAR = ("clearance", "least clearance", "apart")  # facts that are distances
INTERRUPTED = "interrupted before there was a plan"
DOCUMENTS = {"plan": "plan", "mpc": "closed_loop"}  # and what pictures are called
PICTURES = {
    "plan": ("plan.png", "plan_3d.png", "alternatives.png", "progress.png", "plan.gif",
             "plan.html"),
    "mpc": ("closed_loop.png", "closed_loop.gif", "closed_loop.html"),
}  # fmt: skip
WORK = {"plan": "planned", "mpc": "driven"}


@dataclass(frozen=True, kw_only=True)
class JobResult:
    """What came of a job: how it is written and told, and its row in the table of a folder."""

    name: str  # of the scenario
    result: Any  # what is drawn; None: nothing
    document: Mapping[str, Any]
    done: bool  # whether all is as asked
    status: str
    complaints: tuple[str, ...] = ()  # a line each
    facts: tuple[Fact, ...] = ()  # beside those of its recording, or instead of those so called
    measured: tuple[Any, ...] = ()  # again, of all that was driven
    remarks: tuple[str, ...] = ()  # a line each, below the facts
    first_plan: float | None = None  # [s]
    file: str = ""  # the name of its document; empty: that of the command

    @functools.cached_property
    def all_facts(self) -> tuple[Fact, ...]:
        """All that is said of it."""
        known = () if self.result is None else recording_of(self.result).facts
        return tuple({one.label: one for one in (*known, *self.facts)}.values())

    def tell(self, folder: str) -> None:
        """Print it, and the folder that it is in; nothing where one vehicle has no plan."""
        movers = () if self.result is None else recording_of(self.result).movers
        if len(movers) == 1 and not movers[0].has_plan:
            return
        tables = [] if self.result is None else tables_of(self.result, *self.measured)
        print_result(self.name, tables, (*self.all_facts, Fact(label="written to", value=folder)))
        for line in self.remarks:
            say(f"  {line}")

    def row(self, path: Path, *, known: bool) -> folder_runs.Row:
        """For the table of a folder; with its numbers, if they are `known`."""
        found = {one.label: one.value for one in self.all_facts if not isinstance(one.value, str)}
        numbers = found if known else {}
        return folder_runs.Row(
            name=path.name,
            code=FOUND if self.done else NO_PLAN,
            status=self.status,
            reason="".join(f"{path}: {line}\n" for line in self.complaints),
            cost=numbers.get("cost"),
            duration=numbers.get("duration", numbers.get("last arrival")),
            clearance=min([numbers[one] for one in NEAR if one in numbers], default=None),
            first_plan=self.first_plan,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """One file for one command."""

    command: str  # plan | mpc
    path: Path
    parts: Parts
    options: Options

    def done(self, out: Path) -> JobResult:
        """Do it, and write its document into the folder `out`; no picture."""
        kind, scenario = self._read()
        refuse_unknown(self.path, self.command, kind, self.options, self.parts)
        if kind == "fleet":
            folder_runs.check_address(self.options.scheduler)
        make_folder(out)
        home = "single" if kind == "one" else "fleets" if kind == "fleet" else "roads"
        work = getattr(importlib.import_module(f"{__package__}.{home}"), WORK[self.command])
        with announced(quiet=self.options.quiet):
            outcome: JobResult = work(self, scenario)
        with writing(out):
            file = out / f"{outcome.file or DOCUMENTS[self.command]}.json"
            source = {"file": self.path, "with": self.parts.beside, "case": self.parts.case}
            write_document(
                outcome.document,
                file,
                source=source if "vehicles" in outcome.document else None,
                interrupted=stopped(),
            )
            for name in PICTURES[self.command] if outcome.result is not None else ():
                (out / name).unlink(missing_ok=True)  # of an earlier one
        return outcome

    def _read(self) -> tuple[str, Any]:
        if is_road(self.path):
            return ("roads" if states_several(self.path, self.parts) else "road"), None
        scenario = problem_of(self.path, self.parts)
        if self.command == "mpc" and scenario.receding_horizon is None:
            raise InvalidScenario(
                f"{self.path}: receding_horizon: missing, need {{step_s: ...}}, the time between "
                "two plans"
            )
        return ("one" if isinstance(scenario, Scenario) else "fleet"), scenario

    def drawn(self, outcome: JobResult, out: Path) -> None:
        """Write the pictures that were asked for, in this process."""
        look = self.options.look
        wanted = look.plot or look.animate or look.html
        if wanted and outcome.result is not None and not stopped():
            with writing(out):
                draw(*self.order(outcome, out))

    def order(self, outcome: JobResult, out: Path) -> tuple[Any, ...]:
        """What `draw` is asked for."""
        result, look = outcome.result, self.options.look
        if not (progress := self.options.gap is not None):
            result = recording_of(result)  # which is read without all that plans
        return result, outcome.name, out / DOCUMENTS[self.command], look, progress


def plan(*, file: Path, out: Path, parts: Parts, options: Options, as_json: bool) -> int:
    """Plan a file, or all of a folder; the exit code."""
    with printed(out / "plan.json", file, as_json=as_json):
        return _run("plan", file, out, options, parts)


def mpc(*, file: Path, out: Path, parts: Parts, options: Options, as_json: bool) -> int:
    """Close the loop of a file, or of all of a folder; the exit code."""
    if alternatives := options.alternatives:
        raise InvalidScenario(
            f"--alternatives: got {alternatives}, but a closed loop keeps one plan a step; "
            "leave it out, or ask plan for them"
        )
    document = "closed_loop.json" if options.seeds is None else "statistics.json"
    with printed(out / document, file, as_json=as_json):
        return _run("mpc", file, out, options, parts)


def _run(command: str, path: Path, out: Path, options: Options, parts: Parts) -> int:
    one = Draughtsman.at_hand
    if one is not None and (path.is_dir() or is_road(path)):
        one.dismiss()
        one = None
    if path.is_dir():
        return _run_folder(command, path, out, options, parts)
    job = Job(command=command, path=path, parts=parts, options=options)
    outcome = job.done(out)
    begun = one is not None and not stopped() and one.begin(draw, *job.order(outcome, out))
    if not begun:
        job.drawn(outcome, out)
    try:
        if not options.quiet:
            outcome.tell(str(out))
        for line in outcome.complaints:
            complain(f"{path}: {line}")
        if command == "plan" and outcome.done and stopped():
            complain(f"{path}: interrupted: the best plan so far is in {out / 'plan.json'}")
    finally:
        if begun and one is not None and not one.is_done():
            job.drawn(outcome, out)
    return FOUND if outcome.done else NO_PLAN


def _run_folder(command: str, folder: Path, out: Path, options: Options, parts: Parts) -> int:
    if options.resume is not None:
        raise InvalidScenario("--resume: goes on with one loop, and a folder has many; need a file")
    folder_runs.check_address(options.scheduler)
    problems = folder_runs.problems_in(folder, parts)
    if command == "mpc":
        problems = [one for one in problems if _has_loop(*one)]
        if not problems:
            raise InvalidScenario(f"{folder}: no scenario in it has a receding_horizon, need one")
    make_folder(out)
    alone = replace(options, jobs=1, scheduler=None)

    def ready() -> None:  # with the kernels in the cache, or every process would compile them
        with announced(quiet=options.quiet):
            load_kernels("words", "insertion", "lattice", "improvement")

    return folder_runs.run_folder(
        functools.partial(_row, command=command, out=out, options=alone, folder=Path.cwd()),
        problems,
        out,
        options=f"{command} {replace(alone, quiet=True)}",
        jobs=options.jobs,
        scheduler=options.scheduler,
        quiet=options.quiet,
        ready=ready,
    )


def _has_loop(path: Path, parts: Parts) -> bool:
    """Whether a file is for mpc: a drive on roads, a closed loop, or what cannot be read."""
    if is_road(path):
        return True
    try:
        return problem_of(path, parts, remark=False).receding_horizon is not None
    except Exception:  # noqa: BLE001, told when it is driven
        return True


def _row(
    problem: tuple[Path, Parts], *, command: str, out: Path, options: Options, folder: Path
) -> tuple[Path, folder_runs.Row]:
    """Do the job of one file of a folder; what goes wrong is told in its row."""
    path, parts = problem
    row, out = folder_runs.Row, out / path.stem
    if stopped():
        reason = f"{path}: interrupted before it was {WORK[command]}"
        return path, row(name=path.name, code=NO_PLAN, status="interrupted", reason=reason)
    try:
        with contextlib.chdir(folder):
            job = Job(command=command, path=path, parts=parts, options=options)
            outcome = job.done(out)
            job.drawn(outcome, out)
    except Exception as error:  # noqa: BLE001, one bad file must not stop the others
        reason = explained(error)
        return path, row(name=path.name, code=BAD_INPUT, status="bad input", reason=reason)
    return path, outcome.row(path, known=outcome.done or command == "mpc")

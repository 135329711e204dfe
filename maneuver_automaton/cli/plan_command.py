"""`plan`: the problem of a file, or of every file of a folder."""

from __future__ import annotations

import contextlib
import functools
from dataclasses import replace
from pathlib import Path

from maneuver_automaton._interrupts import stopped
from maneuver_automaton.cli import road_command, road_fleets
from maneuver_automaton.cli.answers import Answer, PlanTask, Task
from maneuver_automaton.cli.folder_runs import Row, check_address, run_folder
from maneuver_automaton.cli.guard import BAD_INPUT, FOUND, NO_PLAN, complain, explained
from maneuver_automaton.cli.inputs import Parts, make_folder, not_written, problem_of
from maneuver_automaton.cli.pictures import Draughtsman, draughtsman, skip_documentation
from maneuver_automaton.cli.plan_settings import Settings
from maneuver_automaton.cli.progress import announced, waiting
from maneuver_automaton.errors import InvalidScenario

PICTURES = (
    "plan.png", "plan_3d.png", "alternatives.png", "plan.gif", "plan.html", "progress.png",
)  # fmt: skip


def plan_file(path: Path, out: Path, *, settings: Settings, parts: Parts) -> int:
    """Plan one problem into the folder `out`, print the plan, return the exit code."""
    if road_command.is_road(path):
        if settings.leave:
            raise _needs_one(path)
        if settings.scheduler is not None:
            raise _needs_several(path)
        if road_fleets.states_several(path, parts):
            several = road_fleets.plan_file(path, out, settings=settings, parts=parts)
            if not several.found:
                complain(f"{path}: {road_fleets.why_not(several)}")
            return road_fleets.code_of(several)
        found = road_command.plan_file(path, out, settings=settings, parts=parts)
        if found.plan is None:
            complain(f"{path}: {road_command.status_of(found)}: {found.reason}")
        elif stopped():
            complain(f"{path}: interrupted: the best plan so far is in {out / 'plan.json'}")
        return NO_PLAN if found.plan is None else FOUND
    with draughtsman(wanted=settings.plot) as beside:
        return _plan_alone(path, out, settings, parts, beside)


def _plan_alone(
    path: Path, out: Path, settings: Settings, parts: Parts, beside: Draughtsman | None
) -> int:
    task = _task(path, parts, settings)
    said = f"planning, at most {task.limit_s:g} s"
    with waiting(said, quiet=settings.quiet, more=task.so_far):
        answer = _answered(task, out, settings)
    drawn = beside is not None and not stopped() and beside.begin(answer.draw, out, settings)
    if not drawn:
        _drawn_here(answer, out, settings)
    try:
        return _told(path, answer, out, settings)
    finally:
        if drawn and beside is not None and not beside.is_done():
            _drawn_here(answer, out, settings)


def _task(path: Path, parts: Parts, settings: Settings) -> Task:
    """What there is to plan in a file."""
    from maneuver_automaton.scenario import Scenario

    found = problem_of(path, parts)
    if isinstance(found, Scenario):
        if settings.scheduler is not None:
            raise _needs_several(path)
        return PlanTask.of(found, settings)
    if settings.leave:
        raise _needs_one(path)
    check_address(settings.scheduler)
    from maneuver_automaton.cli.fleets import FleetTask

    return FleetTask(scenario=found, settings=settings, path=path, parts=parts)


def _needs_several(path: Path) -> InvalidScenario:
    return InvalidScenario(
        f"--dask: {path} is planned in one process, need a folder, or several vehicles"
    )


def _needs_one(path: Path) -> InvalidScenario:
    return InvalidScenario(
        f"--leave: is for one vehicle off the road, but {path} is no such; omit it"
    )


def _told(path: Path, answer: Answer, out: Path, settings: Settings) -> int:
    """Print what was planned, or why there is no plan, and return the exit code."""
    if answer.why_not:
        complain(f"{path}: {answer.why_not}")
    elif stopped():
        complain(f"{path}: interrupted: the best plan so far is in {out / 'plan.json'}")
    if not settings.quiet:
        answer.tell(str(out))
    return NO_PLAN if answer.why_not else FOUND


def plan_folder(
    folder: Path,
    out: Path,
    *,
    settings: Settings,
    parts: Parts,
    jobs: int,
    scheduler: str | None = None,
) -> int:
    """Plan every problem of a folder into `out`/STEM, print a table, return the exit code."""
    from maneuver_automaton.cli.folder_runs import problems_in

    check_address(scheduler)
    problems = problems_in(folder, parts)
    make_folder(out)
    return run_folder(
        functools.partial(_row, out=out, settings=settings, folder=Path.cwd()),
        problems,
        out,
        options=f"plan {replace(settings, quiet=True)}",
        jobs=jobs,
        scheduler=scheduler,
        quiet=settings.quiet,
        ready=functools.partial(compile_first, quiet=settings.quiet),
    )


def _answered(task: Task, out: Path, settings: Settings) -> Answer:
    """Plan and write plan.json."""
    make_folder(out)
    try:
        with announced(quiet=settings.quiet):
            answer = task.answer()
    except KeyboardInterrupt:
        if not stopped():
            raise  # in somebody else's program
        answer = task.given_up()
    try:
        answer.save(out / "plan.json")
        for picture in PICTURES:
            (out / picture).unlink(missing_ok=True)  # of an earlier plan
    except OSError as error:
        raise not_written(Path(error.filename or out), error) from error
    return answer


def _drawn_here(answer: Answer, out: Path, settings: Settings) -> None:
    """Draw in this process."""
    if stopped() or not (settings.plot or settings.animate or settings.html):
        return
    skip_documentation()
    try:
        answer.draw(out, settings)
    except OSError as error:
        raise not_written(Path(error.filename or out), error) from error


def _row(problem: tuple[Path, Parts], *, out: Path, settings: Settings, folder: Path) -> Row:
    """Plan one file of a folder; what goes wrong is told in the row.

    Paths are relative to `folder`: a process that works for others may have begun elsewhere.
    """
    path, parts = problem
    out = out / path.stem
    if stopped():
        reason = f"{path}: interrupted before it was planned"
        return Row(name=path.name, code=NO_PLAN, status="interrupted", reason=reason)
    try:
        with contextlib.chdir(folder):
            if road_command.is_road(path):
                return _road_row(path, parts, out, settings)
            answer = _answered(_task(path, parts, settings), out, settings)
            _drawn_here(answer, out, settings)
    except Exception as error:  # noqa: BLE001, one bad file must not stop the others
        return Row(name=path.name, code=BAD_INPUT, status="bad input", reason=explained(error))
    return answer.row(path)


def _road_row(path: Path, parts: Parts, out: Path, settings: Settings) -> Row:
    """Plan one drive on roads of a folder, or the several of one file."""
    if road_fleets.states_several(path, parts):
        quiet = replace(settings, quiet=True)
        several = road_fleets.plan_file(path, out, settings=quiet, parts=parts)
        return road_fleets.row(path, several)
    result = road_command.plan_file(path, out, settings=replace(settings, quiet=True), parts=parts)
    if result.plan is None or result.verdict is None:
        status = road_command.status_of(result)
        reason = f"{path}: {status}: {result.reason}"
        return Row(name=path.name, code=NO_PLAN, status=status, reason=reason)
    return Row(
        name=path.name,
        code=FOUND,
        status="found",
        cost=result.cost,
        duration=result.plan.duration,
        clearance=result.verdict.clearance_m,
        first_plan=result.search_s,
    )


def compile_first(*, quiet: bool) -> None:
    """Have the kernels in the cache, or every process would compile them for itself."""
    from maneuver_automaton.refinement.ready import load_lattice
    from maneuver_automaton.search.choose import load_insertion_kernels, load_word_kernels

    with announced(quiet=quiet):
        load_word_kernels(4)
        load_insertion_kernels()
        load_lattice()

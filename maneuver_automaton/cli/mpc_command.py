"""`mpc`: a scenario in closed loop, once or with many seeds."""

from __future__ import annotations

import contextlib
import functools
import io
import json
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from maneuver_automaton._interrupts import stopped
from maneuver_automaton.cli import road_command
from maneuver_automaton.cli.guard import BAD_INPUT, FOUND, NO_PLAN, complain, explained
from maneuver_automaton.cli.inputs import Parts, make_folder, not_written, problem_of
from maneuver_automaton.cli.plan_settings import LookOptions
from maneuver_automaton.cli.progress import announced, progress_bar
from maneuver_automaton.errors import InvalidScenario

if TYPE_CHECKING:
    from maneuver_automaton.cli.folder_runs import Row
    from maneuver_automaton.fleet import FleetLog
    from maneuver_automaton.receding_horizon import ClosedLoop, Disturbance
    from maneuver_automaton.scenario import Scenario
    from maneuver_automaton.scenario.schema import Disturbance as DisturbancePart

STEPS = 100  # at most, where neither file nor option says
PICTURES = ("closed_loop.png", "closed_loop.gif", "closed_loop.html")


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Options of `mpc`."""

    steps: int | None = None  # None: those of the scenario
    seed: int | None = None
    seeds: int | None = None  # how many seeds in a row, for statistics
    jobs: int = 1
    scheduler: str | None = None
    resume: Path | None = None
    time_limit: float | None = None  # [s] per step
    gap: float | None = None  # share of the cost, None: nothing is proven
    plot: bool = True
    animate: bool = False
    html: bool = False
    quiet: bool = False
    look: LookOptions = field(default_factory=LookOptions)


def drive_file(path: Path, out: Path, *, settings: Settings, parts: Parts) -> int:
    """Close the loop of one problem into the folder `out`, print it, return the exit code."""
    if road_command.is_road(path):
        from maneuver_automaton.cli import road_fleets

        of_one = not road_fleets.states_several(path, parts)
        drive = road_command.drive_file if of_one else road_fleets.drive_file
        return drive(path, out, settings=settings, parts=parts)
    from maneuver_automaton.scenario import FleetScenario

    scenario = problem_of(path, parts)
    if scenario.receding_horizon is None:
        raise InvalidScenario(
            f"{path}: receding_horizon: missing, need {{step_s: ...}}, the time between two plans"
        )
    if isinstance(scenario, FleetScenario):
        from maneuver_automaton.cli import fleet_loops

        return fleet_loops.drive(path, scenario, out, settings=settings, parts=parts)
    if settings.seeds is not None and settings.resume is not None:
        raise InvalidScenario("--resume: goes on with one loop, and --seeds runs many; need one")
    from maneuver_automaton.receding_horizon import Guarantee

    make_folder(out)
    if settings.seeds is not None:
        return _statistics(path, scenario, out, settings)
    loop = _loop(path, scenario, settings)
    try:
        _write(loop, scenario.name, out, settings)
    except OSError as error:
        raise not_written(Path(error.filename or out), error) from error
    if not settings.quiet:
        from maneuver_automaton.cli.loop_tables import print_loop

        print_loop(scenario.name, loop, folder=str(out))
    for number, violation in loop.violations:
        complain(f"{path}: step {number} broke a guarantee: {violation}")
    for number, violation in loop.disturbed:
        if violation.guarantee is not Guarantee.DECREASE:  # what noise does, in every other step
            complain(f"{path}: step {number} was disturbed: {violation}")
    if not loop.reached:
        complain(f"{path}: {loop.status}: {loop.reason}")
    return FOUND if loop.reached and not any(loop.collisions) else NO_PLAN


def drive_folder(folder: Path, out: Path, *, settings: Settings, parts: Parts) -> int:
    """Close the loop of every problem of a folder that has one, each into `out`/STEM."""
    from maneuver_automaton.cli.folder_runs import check_address, problems_in, run_folder
    from maneuver_automaton.cli.plan_command import compile_first

    if settings.resume is not None:
        raise InvalidScenario("--resume: goes on with one loop, and a folder has many; need a file")
    check_address(settings.scheduler)
    problems = [one for one in problems_in(folder, parts) if _has_loop(*one)]
    if not problems:
        raise InvalidScenario(f"{folder}: no scenario in it has a receding_horizon, need one")
    make_folder(out)
    alone = replace(settings, quiet=True, jobs=1, scheduler=None)
    return run_folder(
        functools.partial(_row, out=out, settings=alone, folder=Path.cwd()),
        problems,
        out,
        options=f"mpc {alone}",
        jobs=settings.jobs,
        scheduler=settings.scheduler,
        quiet=settings.quiet,
        ready=functools.partial(compile_first, quiet=settings.quiet),
    )


def _has_loop(path: Path, parts: Parts) -> bool:
    """Whether a file is for mpc: a drive on roads, a closed loop, or what cannot be read."""
    if road_command.is_road(path):
        return True
    try:
        return problem_of(path, parts, remark=False).receding_horizon is not None
    except Exception:  # noqa: BLE001, told when it is driven
        return True


def _row(problem: tuple[Path, Parts], *, out: Path, settings: Settings, folder: Path) -> Row:
    """Drive one file of a folder; what is complained of is told in the row.

    Paths are relative to `folder`: a process that works for others may have begun elsewhere.
    """
    from maneuver_automaton.cli.folder_runs import Row

    path, parts = problem
    out = out / path.stem
    if stopped():
        reason = f"{path}: interrupted before it was driven"
        return Row(name=path.name, code=NO_PLAN, status="interrupted", reason=reason)
    said = io.StringIO()
    try:
        with contextlib.chdir(folder), contextlib.redirect_stderr(said):
            code = drive_file(path, out, settings=settings, parts=parts)
            numbers = _numbers(out, settings)
    except Exception as error:  # noqa: BLE001, one bad file must not stop the others
        return Row(name=path.name, code=BAD_INPUT, status="bad input", reason=explained(error))
    return Row(name=path.name, code=code, reason=said.getvalue(), **numbers)


def _numbers(out: Path, settings: Settings) -> dict[str, Any]:
    """Status and numbers of a row, from the file that was written."""
    if settings.seeds is not None:
        return {"status": f"{settings.seeds} loops"}
    document = json.loads((out / "closed_loop.json").read_text(encoding="utf-8"))
    least = document.get("clearance_m") or {"to_obstacles": document.get("min_clearance_m")}
    return {
        "status": document["status"],
        "cost": document["cost"],
        "duration": document["duration_s"],
        "clearance": min((one for one in least.values() if one is not None), default=None),
    }


def _loop(path: Path, scenario: Scenario, settings: Settings) -> ClosedLoop:
    from maneuver_automaton.receding_horizon import simulate

    part, problem, last = scenario.receding_horizon, scenario.problem, None
    assert part is not None
    steps = settings.steps or part.steps or STEPS
    if settings.resume is not None:
        from maneuver_automaton.formats.closed_loop_json import load_steps

        done, poses = load_steps(settings.resume, problem.automaton)
        if done:
            last, problem = done[-1], replace(problem, start=poses[-1])
    with (
        announced(quiet=settings.quiet),
        progress_bar("steps", steps, quiet=settings.quiet) as advance,
    ):
        try:
            return simulate(
                problem,
                step=part.step_s,
                steps=steps,
                disturbance=_disturbance(part.disturbance, settings.seed),
                margin=part.margin,
                time_limit=settings.time_limit or scenario.time_limit_s,
                last=last,
                stay=part.stay,
                retimed=part.retimed,
                pieces=part.pieces or 0,
                gap=settings.gap,
                progress=lambda _: advance(),
            )
        except ValueError as error:
            raise _in_file(path, error) from error


def _statistics(path: Path, scenario: Scenario, out: Path, settings: Settings) -> int:
    """Drive the loop with seed after seed; print a table and write statistics.json."""
    from maneuver_automaton.formats.closed_loop_json import save_statistics
    from maneuver_automaton.receding_horizon import simulate_many

    part = scenario.receding_horizon
    assert part is not None
    assert settings.seeds is not None
    first = settings.seed or 0
    with (
        announced(quiet=settings.quiet),
        progress_bar("loops", settings.seeds, quiet=settings.quiet) as advance,
    ):
        done = 0

        def count(n: int, _total: int) -> None:
            nonlocal done
            advance(n - done)
            done = n

        try:
            statistics = simulate_many(
                scenario.problem,
                seeds=range(first, first + settings.seeds),
                step=part.step_s,
                steps=settings.steps or part.steps or STEPS,
                disturbance=_disturbance(part.disturbance, None),
                margin=part.margin,
                time_limit=settings.time_limit or scenario.time_limit_s,
                stay=part.stay,
                retimed=part.retimed,
                pieces=part.pieces or 0,
                gap=settings.gap,
                audit=bool(scenario.problem.obstacles),  # else nothing looks for collisions
                jobs=settings.jobs,
                scheduler=settings.scheduler,
                progress=count,
            )
        except ValueError as error:
            raise _in_file(path, error) from error
    try:
        save_statistics(statistics, out / "statistics.json", interrupted=stopped())
    except OSError as error:
        raise not_written(Path(error.filename or out), error) from error
    if not settings.quiet:
        from maneuver_automaton.cli.loop_tables import print_statistics

        print_statistics(scenario.name, statistics, folder=str(out))
    well = all(one.reached and not any(one.collisions) for one in statistics.outcomes)
    return FOUND if well else NO_PLAN


def _in_file(path: Path, error: ValueError) -> InvalidScenario:
    if isinstance(error, InvalidScenario):
        return error
    said = str(error).removeprefix("receding horizon: ")
    return InvalidScenario(f"{path}: receding_horizon: {said}")


def _disturbance(part: DisturbancePart | None, seed: int | None) -> Disturbance | None:
    from maneuver_automaton.scenario.disturbances import disturbance_of

    return None if part is None else disturbance_of(part, seed=seed)


def _write(loop: ClosedLoop, name: str, out: Path, settings: Settings) -> None:
    from maneuver_automaton.formats.closed_loop_json import save_closed_loop

    save_closed_loop(loop, out / "closed_loop.json", name=name, interrupted=stopped())
    draw_loop(
        loop, name, out, settings,
        figure="save_closed_loop_figure", film="save_closed_loop_animation",
    )  # fmt: skip


def draw_loop(
    loop: ClosedLoop | FleetLog, name: str, out: Path, settings: Settings, *, figure: str, film: str
) -> None:
    """Write the pictures of a loop that were asked for; `figure` and `film` are of `plotting`."""
    for picture in PICTURES:
        (out / picture).unlink(missing_ok=True)  # of an earlier loop
    if stopped() or not (settings.plot or settings.animate or settings.html):
        return
    from maneuver_automaton import plotting
    from maneuver_automaton.cli.pictures import skip_documentation

    skip_documentation()

    if settings.plot:
        getattr(plotting, figure)(loop, out / "closed_loop.png", look=settings.look.look(name))
    if settings.animate:
        getattr(plotting, film)(loop, out / "closed_loop.gif")
    if settings.animate or settings.html:
        loop.player(title=settings.look.title or name).save(out / "closed_loop.html")

"""`plan`: the problem of a file, or of every file of a folder."""

from __future__ import annotations

import contextlib
import functools
import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from maneuver_automaton._interrupts import stopped
from maneuver_automaton.budget import Watch
from maneuver_automaton.cli import road_command
from maneuver_automaton.cli.compiling import announced
from maneuver_automaton.cli.folder_runs import Row, check_address, run_folder
from maneuver_automaton.cli.guard import BAD_INPUT, FOUND, NO_PLAN, complain, explained
from maneuver_automaton.cli.inputs import Parts, make_folder, not_written, scenario_of
from maneuver_automaton.cli.looks import LookOptions
from maneuver_automaton.cli.pictures import Draughtsman, draughtsman, skip_documentation
from maneuver_automaton.cli.progress import has_terminal, waiting
from maneuver_automaton.errors import InvalidScenario

if TYPE_CHECKING:
    from maneuver_automaton.planning import PlanResult
    from maneuver_automaton.scenario import Scenario

PICTURES = (
    "plan.png", "plan_3d.png", "alternatives.png", "plan.gif", "plan.html", "progress.png",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Options of `plan`, the same for every file of a folder."""

    time_limit: float | None = None  # [s], None: that of the scenario
    alternatives: int = 0
    plot: bool = True
    animate: bool = False
    html: bool = False
    quiet: bool = False
    gap: float | None = None  # share of the cost, None: nothing is proven beside the search
    look: LookOptions = field(default_factory=LookOptions)

    def __post_init__(self) -> None:
        if self.time_limit is not None and not 0.0 < self.time_limit < math.inf:
            raise InvalidScenario(
                f"--time-limit: got {self.time_limit}, need a positive number of seconds"
            )
        if self.gap is not None and not 0.0 <= self.gap < 1.0:
            raise InvalidScenario(
                f"--gap: got {self.gap}, need a share of the cost from 0 to below 1, such as 0.05"
            )


def plan_file(path: Path, out: Path, *, settings: Settings, parts: Parts) -> int:
    """Plan one problem into the folder `out`, print the plan, return the exit code."""
    if road_command.is_road(path):
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
    scenario = scenario_of(path, parts)
    limit = settings.time_limit or scenario.time_limit_s
    said = f"planning, at most {limit:g} s"
    shown = None if settings.quiet or not has_terminal() else SoFar.of_gap(settings.gap)
    with waiting(said, quiet=settings.quiet, more=lambda: shown.text if shown else ""):
        result = _plan(scenario, out, settings, shown)
    pictures = (result, scenario.name, out, settings)
    drawn = beside is not None and not stopped() and beside.begin(_draw, *pictures)
    if not drawn:
        _drawn_here(*pictures)
    try:
        return _told(path, scenario.name, result, out, settings)
    finally:
        if drawn and beside is not None and not beside.is_done():
            _drawn_here(*pictures)


def _told(path: Path, name: str, result: PlanResult, out: Path, settings: Settings) -> int:
    """Print the plan, or why there is none, and return the exit code."""
    if result.plan is None:
        complain(f"{path}: {result.status.value}: {result.reason}")
        return NO_PLAN
    if stopped():
        complain(f"{path}: interrupted: the best plan so far is in {out / 'plan.json'}")
    if not settings.quiet:
        from maneuver_automaton.cli.tables import print_result

        print_result(name, result, folder=str(out))
    return FOUND


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
    from maneuver_automaton.cli.folders import problems_in

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


@dataclass(slots=True, kw_only=True)
class SoFar:
    """The best plan while it is being improved, for a line on the terminal."""

    watch: Watch
    best: PlanResult | None = None

    @classmethod
    def of_gap(cls, gap: float | None) -> SoFar:
        """Nothing yet of a search that ends with a `gap`, if one is stated."""
        return cls(watch=Watch(gap=-math.inf if gap is None else gap))

    def better(self, result: PlanResult) -> None:
        """Take a plan that is better than the one before, and passed all checks."""
        self.best = result

    @property
    def text(self) -> str:
        """Cost, bound, gap and clearance."""
        best = self.best
        if best is None or best.cost is None:
            return ""
        bound = max(self.watch.bound, best.lower_bound or 0.0)
        share = max(0.0, 1.0 - bound / best.cost) if best.cost > 0.0 else 0.0
        parts = [f"cost {best.cost:.6g}, at least {bound:.6g}, gap {100.0 * share:.2g} %"]
        if best.clearance_m is not None:
            parts.append(f"clearance {best.clearance_m:.3g} m")
        return ", ".join(parts)


def _plan(
    scenario: Scenario, out: Path, settings: Settings, shown: SoFar | None = None
) -> PlanResult:
    """Plan and write plan.json."""
    from maneuver_automaton import planning

    make_folder(out)
    try:
        with announced(quiet=settings.quiet):
            result = planning.plan(
                scenario.problem,
                time_limit=settings.time_limit or scenario.time_limit_s,
                alternatives=settings.alternatives,
                gap=settings.gap,
                watch=shown.watch if shown else None,
                on_better=shown.better if shown else None,
            )
    except KeyboardInterrupt:
        if not stopped():
            raise  # in somebody else's program
        result = planning.PlanResult(
            problem=scenario.problem,
            status=planning.PlanStatus.OUT_OF_BUDGET,
            reason="interrupted before there was a plan",
        )
    if stopped() and result.plan is None:
        result = replace(result, reason="interrupted before there was a plan")
    result = replace(result, timing_s={**scenario.timing_s, **result.timing_s})
    try:
        _write(result, scenario.name, out)
    except OSError as error:
        raise not_written(Path(error.filename or out), error) from error
    return result


def _write(result: PlanResult, name: str, out: Path) -> None:
    from maneuver_automaton.formats.plan_json import save_plan

    save_plan(result, out / "plan.json", name=name, interrupted=stopped())
    for picture in PICTURES:
        (out / picture).unlink(missing_ok=True)  # of an earlier plan


def _drawn_here(result: PlanResult, name: str, out: Path, settings: Settings) -> None:
    """Draw in this process."""
    if stopped() or not (settings.plot or settings.animate or settings.html):
        return
    skip_documentation()
    try:
        _draw(result, name, out, settings)
    except OSError as error:
        raise not_written(Path(error.filename or out), error) from error


def _draw(result: PlanResult, name: str, out: Path, settings: Settings) -> None:
    """Write the pictures of a plan."""
    from maneuver_automaton import plotting

    if settings.plot:
        look = settings.look.look(name)
        plotting.save_plan_figure(result, out / "plan.png", nodes=result.nodes, look=look)
        if plotting.flies_among_heights(result.problem):
            plotting.save_space_figure(result, out / "plan_3d.png", title=look.title)
        if settings.gap is not None and result.plan is not None:
            plotting.save_progress_figure(result, out / "progress.png", title=look.title)
        if result.alternatives:
            plotting.save_alternatives_figure(result, out / "alternatives.png", title=look.title)
    if settings.animate and result.plan is not None:
        plotting.save_plan_animation(result.plan, out / "plan.gif", problem=result.problem)
    if settings.html:
        result.player(title=settings.look.title or name).save(out / "plan.html")


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
            scenario = scenario_of(path, parts)
            result = _plan(scenario, out, settings)
            _drawn_here(result, scenario.name, out, settings)
    except Exception as error:  # noqa: BLE001, one bad file must not stop the others
        return Row(name=path.name, code=BAD_INPUT, status="bad input", reason=explained(error))
    found = result.plan is not None
    status = result.status.value
    return Row(
        name=path.name,
        code=FOUND if found else NO_PLAN,
        status=status,
        reason="" if found else f"{path}: {status}: {result.reason}",
        cost=result.cost,
        duration=None if result.plan is None else result.plan.duration,
        clearance=result.clearance_m,
        first_plan=result.timing_s.get("first_plan"),
    )


def _road_row(path: Path, parts: Parts, out: Path, settings: Settings) -> Row:
    """Plan one drive on roads of a folder."""
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
    from maneuver_automaton.search.ready import load_insertion_kernels, load_word_kernels

    with announced(quiet=quiet):
        load_word_kernels(4)
        load_insertion_kernels()
        load_lattice()

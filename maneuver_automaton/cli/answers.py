"""What `plan` does with a file of one vehicle: plan, write, draw, tell; of several see `fleets`."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from maneuver_automaton._interrupts import stopped
from maneuver_automaton.budget import Watch
from maneuver_automaton.cli.folder_runs import Row
from maneuver_automaton.cli.guard import FOUND, NO_PLAN
from maneuver_automaton.cli.plan_settings import Settings
from maneuver_automaton.cli.progress import has_terminal

if TYPE_CHECKING:
    from maneuver_automaton.planning import PlanResult
    from maneuver_automaton.scenario import Scenario

INTERRUPTED = "interrupted before there was a plan"


class Answer(Protocol):
    """What planning a file came to."""

    @property
    def name(self) -> str:
        """Of the scenario."""
        ...

    @property
    def why_not(self) -> str:
        """Status and reason, if there is no plan, or one is missing; else empty."""
        ...

    def save(self, path: Path) -> None:
        """Write plan.json."""
        ...

    def draw(self, out: Path, settings: Settings) -> None:
        """Write the pictures that were asked for."""
        ...

    def tell(self, folder: str) -> None:
        """Print it."""
        ...

    def row(self, path: Path) -> Row:
        """For the table of a folder."""
        ...


class Task(Protocol):
    """What there is to plan in a file."""

    @property
    def limit_s(self) -> float:
        """Upper bound for it [s]."""
        ...

    def so_far(self) -> str:
        """What there is while it is being planned, for a line on the terminal."""
        ...

    def answer(self) -> Answer:
        """Plan it; raises KeyboardInterrupt if a signal came first."""
        ...

    def given_up(self) -> Answer:
        """The answer if a signal came before there was a plan."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanAnswer:
    """The plan of one vehicle, or none."""

    name: str
    result: PlanResult
    share: bool = False  # whether the gap is told as a share of the cost

    @property
    def why_not(self) -> str:
        """Status and reason, if there is no plan, and what was left out."""
        result = self.result
        if result.plan is not None:
            return ""
        return "; ".join([f"{result.status.value}: {result.reason}", *result.notes])

    def save(self, path: Path) -> None:
        """Write plan.json."""
        from maneuver_automaton.formats.plan_json import save_plan

        save_plan(self.result, path, name=self.name, interrupted=stopped())

    def draw(self, out: Path, settings: Settings) -> None:
        """Write the pictures that were asked for."""
        from maneuver_automaton import plotting

        result, look = self.result, settings.look.look(self.name)
        if settings.plot:
            plotting.save_picture(result, out / "plan.png", look=look)
            if plotting.flies_among_heights(result):
                plotting.save_picture(result, out / "plan_3d.png", look=look, view="space")
            if settings.gap is not None and result.plan is not None:
                plotting.save_progress_figure(result, out / "progress.png", title=look.title)
            if result.alternatives:
                path = out / "alternatives.png"
                plotting.save_picture(result, path, look=look, view="alternatives")
        if settings.animate and result.plan is not None:
            plotting.save_film(result, out / "plan.gif")
        if settings.html:
            result.player(title=settings.look.title or self.name).save(out / "plan.html")

    def tell(self, folder: str) -> None:
        """Print it."""
        from maneuver_automaton.cli.tables import print_result

        print_result(self.name, self.result, folder=folder, share=self.share)

    def row(self, path: Path) -> Row:
        """For the table of a folder."""
        result = self.result
        return Row(
            name=path.name,
            code=NO_PLAN if self.why_not else FOUND,
            status=result.status.value,
            reason=f"{path}: {self.why_not}" if self.why_not else "",
            cost=result.cost,
            duration=None if result.plan is None else result.plan.duration,
            clearance=result.clearance_m,
            first_plan=result.timing_s.get("first_plan"),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanTask:
    """The problem of one vehicle."""

    scenario: Scenario
    settings: Settings
    shown: SoFar

    @classmethod
    def of(cls, scenario: Scenario, settings: Settings) -> PlanTask:
        """The task of a scenario."""
        return cls(scenario=scenario, settings=settings, shown=SoFar.of_gap(settings.gap))

    @property
    def limit_s(self) -> float:
        """Upper bound for it [s]."""
        return self.settings.time_limit or self.scenario.time_limit_s

    def so_far(self) -> str:
        """Cost, bound and clearance of the best plan so far, and its gap if one was asked for."""
        return self.shown.text

    def answer(self) -> PlanAnswer:
        """Plan it."""
        from maneuver_automaton import planning

        told = not self.settings.quiet and has_terminal()
        result = planning.plan(
            self.scenario.problem,
            time_limit=self.limit_s,
            alternatives=self.settings.alternatives,
            gap=self.settings.gap,
            watch=self.shown.watch if told else None,
            on_better=self.shown.better if told else None,
            leave=self.settings.leave,
        )
        return self._answered(result)

    def given_up(self) -> PlanAnswer:
        """The answer if a signal came before there was a plan."""
        from maneuver_automaton import planning

        status = planning.PlanStatus.OUT_OF_BUDGET
        problem = self.scenario.problem
        return self._answered(
            planning.PlanResult(problem=problem, status=status, reason=INTERRUPTED)
        )

    def _answered(self, result: PlanResult) -> PlanAnswer:
        if stopped() and result.plan is None:
            result = replace(result, reason=INTERRUPTED)
        timing = {**self.scenario.timing_s, **result.timing_s}
        return PlanAnswer(
            name=self.scenario.name,
            result=replace(result, timing_s=timing),
            share=self.settings.gap is not None,
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
        """Cost, bound, gap if one was asked for, and clearance."""
        best = self.best
        if best is None or best.cost is None:
            return ""
        bound = max(self.watch.bound, best.lower_bound or 0.0)
        share = max(0.0, 1.0 - bound / best.cost) if best.cost > 0.0 else 0.0
        parts = [f"cost {best.cost:.6g}, proven: at least {bound:.6g}"]
        if self.watch.gap > -math.inf:
            parts.append(f"gap {100.0 * share:.2g} %")
        if best.clearance_m is not None:
            parts.append(f"clearance {best.clearance_m:.3g} m")
        return ", ".join(parts)

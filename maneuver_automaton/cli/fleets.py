"""What `plan` does with a file of several vehicles: plan, write, draw and tell."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from maneuver_automaton._interrupts import stopped
from maneuver_automaton.cli.answers import INTERRUPTED
from maneuver_automaton.cli.folder_runs import Row
from maneuver_automaton.cli.guard import FOUND, NO_PLAN
from maneuver_automaton.cli.inputs import Parts
from maneuver_automaton.cli.plan_settings import Settings
from maneuver_automaton.errors import InvalidScenario

if TYPE_CHECKING:
    from maneuver_automaton.fleet import FleetResult
    from maneuver_automaton.scenario import FleetScenario


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetAnswer:
    """The plans of several vehicles, or of some of them."""

    name: str
    result: FleetResult
    path: Path  # of the file
    parts: Parts

    @property
    def why_not(self) -> str:
        """Status and reasons, if a vehicle has no plan."""
        from maneuver_automaton.fleet import FleetStatus
        from maneuver_automaton.formats.fleet_json import reason_of

        result = self.result
        if result.status is FleetStatus.FOUND:
            return ""
        said = "interrupted before all had a plan: " if stopped() else ""
        return f"{result.status.value}: {said}{reason_of(result)}"

    def save(self, path: Path) -> None:
        """Write plan.json."""
        from maneuver_automaton.formats.fleet_json import save_fleet

        source = {"file": self.path, "with": self.parts.beside, "case": self.parts.case}
        save_fleet(self.result, path, name=self.name, source=source, interrupted=stopped())

    def draw(self, out: Path, settings: Settings) -> None:
        """Write the pictures that were asked for."""
        from maneuver_automaton import plotting

        if settings.plot:
            look = settings.look.look(self.name)
            plotting.save_picture(self.result, out / "plan.png", look=look)
        if settings.animate and self.result.plans:
            plotting.save_film(self.result, out / "plan.gif")
        if settings.html:
            self.result.player(title=settings.look.title or self.name).save(out / "plan.html")

    def tell(self, folder: str) -> None:
        """Print it."""
        from maneuver_automaton.cli.fleet_tables import print_fleet

        print_fleet(self.name, self.result, folder=folder)

    def row(self, path: Path) -> Row:
        """For the table of a folder."""
        from maneuver_automaton.cli.fleet_tables import least_clearance

        result, whole = self.result, not self.why_not
        return Row(
            name=path.name,
            code=FOUND if whole else NO_PLAN,
            status=result.status.value,
            reason="" if whole else f"{path}: {self.why_not}",
            cost=result.cost if whole else None,
            duration=result.last_s if whole else None,
            clearance=least_clearance(result),
            first_plan=result.timing_s.get("first_plan"),
        )


@dataclass(slots=True, kw_only=True)
class BestSoFar:
    """The objective of the best plans of all while they are improved."""

    objective: str
    text: str = ""

    def better(self, seconds: float, value: float) -> None:
        """Take what plans were found after so many seconds."""
        self.text = f"{self.objective} {value:.6g}, found after {seconds:.3g} s"


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetTask:
    """The problem of several vehicles."""

    scenario: FleetScenario
    settings: Settings
    path: Path
    parts: Parts
    shown: BestSoFar = field(init=False)

    def __post_init__(self) -> None:
        settings, shown = self.settings, BestSoFar(objective=self.scenario.settings.objective)
        object.__setattr__(self, "shown", shown)
        for option, given in (
            ("--alternatives", settings.alternatives > 0),
            ("--gap", settings.gap is not None),
        ):
            if given:
                raise InvalidScenario(
                    f"{option}: is for one vehicle, but {self.path} states several; leave it out"
                )

    @property
    def limit_s(self) -> float:
        """Upper bound for it [s]."""
        return self.settings.time_limit or self.scenario.time_limit_s

    def so_far(self) -> str:
        """The objective so far."""
        return self.shown.text

    def answer(self) -> FleetAnswer:
        """Plan them all."""
        from maneuver_automaton.fleet import plan_fleet

        said = self.scenario.settings
        result = plan_fleet(
            self.scenario.fleet,
            time_limit=self.limit_s,
            objective=said.objective,
            orders=said.orders,
            on_better=self.shown.better,
            jobs=self.settings.jobs,
            scheduler=self.settings.scheduler,
        )
        return self._answered(result)

    def given_up(self) -> FleetAnswer:
        """The answer if a signal came before there was a plan."""
        from maneuver_automaton.fleet import FleetResult, FleetStatus
        from maneuver_automaton.planning import PlanResult, PlanStatus

        fleet, status = self.scenario.fleet, PlanStatus.OUT_OF_BUDGET
        results = {
            name: PlanResult(problem=problem, status=status, reason=INTERRUPTED)
            for name, problem in zip(fleet.names, fleet.problems, strict=True)
        }
        return self._answered(
            FleetResult(
                problem=fleet,
                status=FleetStatus.NO_PLAN,
                results=results,
                objective=self.scenario.settings.objective,
                reasons=dict.fromkeys(fleet.names, INTERRUPTED),
            )
        )

    def _answered(self, result: FleetResult) -> FleetAnswer:
        timing = {**self.scenario.timing_s, **result.timing_s}
        return FleetAnswer(
            name=self.scenario.name,
            result=replace(result, timing_s=timing),
            path=self.path,
            parts=self.parts,
        )

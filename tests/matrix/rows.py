"""Rows of the matrix: a check of a feature, and beside it a planner that ignores the feature.

A check is given the planner, so that it can be shown to fail: with one to which the feature means
nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from maneuver_automaton.costs import Cost
from maneuver_automaton.exports import save_csv
from maneuver_automaton.formats.closed_loop_json import load_steps
from maneuver_automaton.formats.plan_json import save_plan
from maneuver_automaton.planning import Planner, PlanResult, plan
from maneuver_automaton.problem import Bounds, Goal, Horizon, Problem
from maneuver_automaton.receding_horizon import ClosedLoop, simulate
from tests.matrix.vehicles import Vehicle


@dataclass(frozen=True, kw_only=True)
class Engine:
    """What is asked for plans and loops: the package, or one that ignores something."""

    plan: Callable[..., PlanResult] = plan
    simulate: Callable[..., ClosedLoop] = simulate
    planner: Callable[..., Planner] = Planner
    save_plan: Callable[[PlanResult, Path], None] = save_plan
    save_table: Callable[..., None] = save_csv
    save_figure: Callable[[PlanResult, Path], None] | None = None
    load_last: Callable[..., Any] = load_steps


PACKAGE = Engine()
Check = Callable[[Vehicle, Engine], None]


@dataclass(frozen=True, kw_only=True)
class Feature:
    """One row of the matrix."""

    name: str
    check: Check
    mutant: Engine  # the feature means nothing to it
    mutant_vehicle: str  # on which the check fails with the mutant
    says: str  # how it then complains
    applies: Callable[[Vehicle], bool]
    refused: Callable[[Vehicle], str]  # why, in the words of the package; empty if it is not

    def __call__(self, vehicle: Vehicle, engine: Engine = PACKAGE) -> None:
        """Fail unless the feature works for the vehicle, or is refused for the reason stated."""
        reason = self.refused(vehicle)
        if not reason:
            self.check(vehicle, engine)
            return
        try:
            self.check(vehicle, engine)
        except ValueError as error:
            if reason not in str(error):
                raise AssertionError(f"refused because {error}") from error
            return
        raise AssertionError(f"it is not refused, though {reason}")


def feature(
    mutant: Engine,
    *,
    says: str,
    on: str = "dubins",
    applies: Callable[[Vehicle], bool] = lambda _: True,
    refused: Callable[[Vehicle], str] = lambda _: "",
) -> Callable[[Check], Feature]:
    """Make a check a row of the matrix, under its name."""

    def entered(check: Check) -> Feature:
        return Feature(
            name=check.__name__,
            check=check,
            mutant=mutant,
            mutant_vehicle=on,
            says=says,
            applies=applies,
            refused=refused,
        )

    return entered


def without(*names: str, **changes: object) -> Engine:
    """A planner to which some fields of a problem mean nothing; `changes` are what it takes."""
    defaults: dict[str, object] = {
        "obstacles": (),
        "zones": (),
        "bounds": Bounds(),
        "horizon": Horizon(),
        "margin": 0.0,
        "cost": Cost(time=1.0),
        "start_trim": None,
        "start_state": None,
        "place_costs": (),
        "via": (),
    }
    values = {name: defaults[name] for name in names} | changes

    def stripped(problem: Problem) -> Problem:
        return replace(problem, **values)  # type: ignore[arg-type]

    return changed(stripped)


def changed(change: Callable[[Problem], Problem]) -> Engine:
    """A planner that takes every problem for another one."""

    def planned(problem: Problem, **options: Any) -> PlanResult:
        return plan(change(problem), **options)

    def driven(problem: Problem, **options: Any) -> ClosedLoop:
        return simulate(change(problem), **options)

    def ready(automaton: Any, **options: Any) -> Planner:
        start = np.zeros(automaton.model.group.dof)
        there = change(Problem(automaton, start, start + 1.0, **options))
        return Planner(automaton, **{name: getattr(there, name) for name in options})

    return Engine(plan=planned, simulate=driven, planner=ready)


def with_goals(change: Callable[[Goal], Goal]) -> Engine:
    """A planner that takes every goal for another one."""

    def aimed(problem: Problem) -> Problem:
        return replace(problem, goals=tuple(change(goal) for goal in problem.goals))

    return changed(aimed)

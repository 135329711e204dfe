"""Our planner as the benchmarks call it: one run as a value, and a second opinion on its plan."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

import maneuver_automaton as ma
from maneuver_automaton.automaton import Plan
from maneuver_automaton.problem import Goal, Problem
from tests.solids import PlanCheck, check_plan


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Run:
    """What one call of the planner did."""

    problem: Problem
    status: str
    reason: str
    wall_s: float  # of the whole call
    search_s: float  # of search and refinement, what the time limit is for
    first_s: float  # inf without a plan
    check_s: float  # FCL and audit of the answer
    improvements: tuple[tuple[float, float], ...]  # seconds, cost
    plan: Plan | None
    goal_index: int
    cost: float  # inf without a plan
    lower_bound: float  # nan where nothing says
    clearance_m: float  # nan where nothing says
    audited: bool
    counts: Mapping[str, int]

    @property
    def found(self) -> bool:
        return self.plan is not None

    def cost_at(self, seconds: float) -> float:
        """Cost of the best plan known after `seconds`, inf if there was none."""
        return min((cost for at, cost in self.improvements if at <= seconds), default=math.inf)

    @property
    def direction_changes(self) -> int:
        """Changes between forward and reverse, whatever turns or rests lie between."""
        if self.plan is None:
            return 0
        moving = zip(self.plan.trims, self.plan.durations, strict=True)
        signs = [np.sign(t.body_velocity[0]) for t, s in moving if s > 0.0 and t.body_velocity[0]]
        return int((np.diff(signs) != 0.0).sum())

    @property
    def length_m(self) -> float:
        """Sum of driven lengths, inf without a plan."""
        if self.plan is None:
            return math.inf
        twists = np.array([trim.body_velocity for trim in self.plan.trims]).reshape(-1, 3)
        return float(np.hypot(twists[:, 0], twists[:, 1]) @ self.plan.durations)

    def second_opinion(self, *, step_m: float = 0.01) -> PlanCheck | None:
        """What shapely says of the plan, sampled every `step_m`; None without a plan."""
        if self.plan is None:
            return None
        return check_plan(self.problem, self.plan, self.goal_index, step_m=step_m)

    def sound(self, *, step_m: float = 0.01) -> bool:
        """Whether there is no plan, or one that the second opinion accepts."""
        opinion = self.second_opinion(step_m=step_m)
        return opinion is None or opinion.passes(self.problem, self.goal_index)


def solve(problem: Problem, *, time_limit: float) -> Run:
    """One call of `plan`."""
    began = time.perf_counter()
    result = ma.plan(problem, time_limit=time_limit)
    return _run(problem, result, time.perf_counter() - began)


def solver_on(problem: Problem) -> Callable[[np.ndarray, tuple[Goal, ...], float], Run]:
    """A planner for many queries on the map of `problem`: called with start, goals, limit [s]."""
    planner = ma.Planner(
        problem.automaton,
        cost=problem.cost,
        horizon=problem.horizon,
        bounds=problem.bounds,
        search=problem.search,
        obstacles=problem.obstacles,
        footprint=problem.footprint,
        margin=problem.margin,
    )

    def query(start: np.ndarray, goals: tuple[Goal, ...], time_limit: float) -> Run:
        began = time.perf_counter()
        result = planner.plan(start, goals, time_limit=time_limit)
        wall = time.perf_counter() - began
        return _run(replace(problem, start=start, goals=goals), result, wall)

    return query


def _run(problem: Problem, result: ma.PlanResult, wall: float) -> Run:
    timing = result.timing_s
    check = timing.get("audit", 0.0)
    found = result.plan is not None
    return Run(
        problem=problem,
        status=result.status.value,
        reason=result.reason,
        wall_s=wall,
        search_s=wall - check,
        first_s=timing.get("first_plan", math.inf) if found else math.inf,
        check_s=check if found else math.nan,
        improvements=tuple(result.improvements),
        plan=result.plan,
        goal_index=result.goal_index or 0,
        cost=result.cost if found else math.inf,
        lower_bound=math.nan if result.lower_bound is None else result.lower_bound,
        clearance_m=math.nan if result.clearance_m is None else result.clearance_m,
        audited=result.audit is not None and result.audit.passed,
        counts=result.counts,
    )


def warm_up(problem: Problem) -> None:
    """Compile and load what the first call needs."""
    solve(problem, time_limit=0.3)


def rejected(runs: list[Run]) -> str:
    """How many candidates FCL and the audit turned down, in words."""
    by = {name: sum(run.counts.get(f"rejected_by_{name}", 0) for run in runs)
          for name in ("fcl", "audit")}  # fmt: skip
    return f"candidates rejected by FCL {by['fcl']}, by the audit {by['audit']}"


def failures(runs: Mapping[str, Run]) -> list[str]:
    """A line for every query without a plan: how it ended and why."""
    return [f"{name}: {run.status} ({run.reason})" for name, run in runs.items() if not run.found]

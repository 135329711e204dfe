"""The answer of a planner."""

from __future__ import annotations

import enum
from collections.abc import Sequence
from dataclasses import dataclass, field

from maneuver_automaton._arrays import Array
from maneuver_automaton.audit import Audit, TerminalError, terminal_error
from maneuver_automaton.automaton import Plan
from maneuver_automaton.problem import Problem


class PlanStatus(enum.Enum):
    """How planning ended; the values are those of plan.json."""

    FOUND = "found"
    START_BLOCKED = "start_blocked"
    GOAL_BLOCKED = "goal_blocked"
    UNREACHABLE = "unreachable"
    NO_PLAN = "no_plan"
    OUT_OF_BUDGET = "out_of_budget"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Alternative:
    """Another locally optimal plan, dearer than the best."""

    plan: Plan
    cost: float
    terminal_error: TerminalError


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlanResult:
    """The answer to a problem; without a plan the numbers are None and the tuples empty."""

    problem: Problem
    status: PlanStatus
    reason: str  # one line; empty if found
    plan: Plan | None = None
    goal_index: int | None = None  # which of the problem's goals it reaches
    cost: float | None = None
    lower_bound: float | None = None
    gap: float | None = None  # (cost - lower_bound) / cost
    certificate: float | None = None  # smallest reduced cost over the library and all times
    terminal_error: TerminalError | None = None
    clearance_m: float | None = None
    audit: Audit | None = None
    alternatives: tuple[Alternative, ...] = ()
    timing_s: dict[str, float] = field(default_factory=dict)
    counts: dict[str, int] = field(default_factory=dict)
    improvements: tuple[tuple[float, float], ...] = ()  # seconds since the start, cost
    nodes: Array | None = None  # (n, 4) x, y, heading, cost of what was expanded, if asked for


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Accepted:
    """A plan that passed every check."""

    plan: Plan
    goal_index: int
    cost: float
    audit: Audit

    def terminal_error(self, problem: Problem) -> TerminalError:
        """How far its last pose is from its goal."""
        return terminal_error(self.plan, problem.goals[self.goal_index])


def found_plans(
    problem: Problem,
    plans: Sequence[Accepted],
    *,
    bound: float,
    timing_s: dict[str, float],
    counts: dict[str, int],
    certificate: float | None = None,
    improvements: tuple[tuple[float, float], ...] = (),
    nodes: Array | None = None,
) -> PlanResult:
    """The answer where plans were found, the cheapest first; no plan at all is below `bound`."""
    best, *others = plans
    bound = min(best.cost, bound)
    return PlanResult(
        problem=problem,
        status=PlanStatus.FOUND,
        reason="",
        plan=best.plan,
        goal_index=best.goal_index,
        cost=best.cost,
        lower_bound=bound,
        gap=(best.cost - bound) / best.cost if bound < best.cost else 0.0,
        certificate=certificate,
        terminal_error=best.terminal_error(problem),
        clearance_m=best.audit.min_clearance_m,
        audit=best.audit,
        alternatives=tuple(
            Alternative(
                plan=other.plan, cost=other.cost, terminal_error=other.terminal_error(problem)
            )
            for other in others
        ),
        timing_s=timing_s,
        counts=counts,
        improvements=improvements,
        nodes=nodes,
    )

"""The answer of a planner."""

from __future__ import annotations

import enum
from dataclasses import dataclass, field
from typing import Protocol

from maneuver_automaton._arrays import Array
from maneuver_automaton.audit import Audit, TerminalError
from maneuver_automaton.automaton import Plan
from maneuver_automaton.bounds import Narrowest
from maneuver_automaton.budget import Budget
from maneuver_automaton.planning.workspace import Workspace
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
    narrowest: Narrowest | None = None  # the passage that is too narrow, of a proof
    reached: Array | None = None  # (n, 4, 2) squares that the pose never leaves, of that proof
    nodes: Array | None = None  # (n, 4) x, y, heading, cost of what was expanded, if asked for


class Answer(Protocol):
    """A planner, of all problems or of simpler ones."""

    def __call__(
        self, problem: Problem, budget: Budget, workspace: Workspace, /, *, alternatives: int
    ) -> PlanResult:
        """The cheapest plan found, and so many dearer ones."""
        ...

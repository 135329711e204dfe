"""The answer for a fleet."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, field
from typing import NamedTuple

from maneuver_automaton._brief import brief
from maneuver_automaton._display import Played
from maneuver_automaton.automaton import Plan
from maneuver_automaton.fleet.problem import FleetProblem
from maneuver_automaton.planning.result import PlanResult


class FleetStatus(enum.Enum):
    """How planning a fleet ended; the values are those of plan.json."""

    FOUND = "found"  # every vehicle has a plan
    PARTIAL = "partial"  # some have one, past the starts of those that have none
    NO_PLAN = "no_plan"  # none has


class Closest(NamedTuple):
    """Where two vehicles are nearest to each other."""

    pair: tuple[str, str]
    time_s: float  # [s] on the clock of all
    distance_m: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FleetResult(Played):
    """The answer to a fleet's problem. Who has no plan stands at its start, past which others go.

    `results` has the answer of every vehicle by its name: its plan past static obstacles and past
    the plans of the others, its cost, a lower bound of it, its audit; or why it has none.
    """

    problem: FleetProblem
    status: FleetStatus
    results: dict[str, PlanResult]
    objective: str = "sum"  # what was improved: the sum of costs, or the last arrival
    lower_bound: float = 0.0  # no plans of all vehicles have less of the objective
    alone_cost: float = 0.0  # sum of the costs of the ways of all by themselves, as found
    clearance_m: float = math.inf  # that any two vehicles keep at least, proven
    closest: tuple[Closest, ...] = ()  # pairs that come near each other, the nearest first
    reasons: dict[str, str] = field(default_factory=dict)  # who has no plan, and what is in the way
    order: tuple[str, ...] = ()  # in which the vehicles were planned at last
    improvements: tuple[tuple[float, float], ...] = ()  # seconds since the start, objective
    timing_s: dict[str, float] = field(default_factory=dict)
    counts: dict[str, int] = field(default_factory=dict)

    __repr__ = brief

    @property
    def notes(self) -> tuple[str, ...]:
        """What was left out for any of the vehicles, and why."""
        return tuple(dict.fromkeys(note for one in self.results.values() for note in one.notes))

    @property
    def plans(self) -> dict[str, Plan]:
        """The plans of those that have one, by name."""
        return {name: one.plan for name, one in self.results.items() if one.plan is not None}

    @property
    def arrivals_s(self) -> dict[str, float]:
        """How long after its start time each that has a plan arrives [s]."""
        return {name: plan.duration for name, plan in self.plans.items()}

    @property
    def sum_s(self) -> float:
        """Sum of the times until those that have a plan arrive [s]."""
        return math.fsum(self.arrivals_s.values())

    @property
    def last_s(self) -> float:
        """When the last of those that have a plan arrives, on the clock of all [s]."""
        return max((p.start_time + p.duration for p in self.plans.values()), default=0.0)

    @property
    def cost(self) -> float:
        """Sum of the costs of the plans."""
        return math.fsum(one.cost for one in self.results.values() if one.cost is not None)

    @property
    def value(self) -> float:
        """What the objective is: the sum of the costs, or the last arrival [s]."""
        return self.cost if self.objective == "sum" else self.last_s

    @property
    def gap(self) -> float | None:
        """Share of the objective that is at most to be saved; None if someone has no plan."""
        if self.status is not FleetStatus.FOUND:
            return None
        return max(0.0, 1.0 - self.lower_bound / self.value) if self.value > 0.0 else 0.0

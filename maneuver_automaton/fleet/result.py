"""The answer for a fleet, and the log of its closed loop, as values."""

from __future__ import annotations

import enum
import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._brief import brief
from maneuver_automaton._display import Played
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.cutting import NOTHING, head_of, with_samples_at
from maneuver_automaton.fleet.problem import FleetProblem
from maneuver_automaton.models import Model
from maneuver_automaton.planning.result import PlanResult
from maneuver_automaton.problem import Problem


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
        """Share of the objective that is to be saved at most; None without plans or of nothing."""
        if self.status is not FleetStatus.FOUND or self.lower_bound < self.value == 0.0:
            return None
        share = 1.0 - self.lower_bound / self.value if self.value else 0.0
        return max(0.0, share if self.value > 0.0 else -share)  # a clock may begin before 0


class FleetGuarantee(enum.Enum):
    """Guarantees of every step of a fleet's loop."""

    APART = "apart"  # what is left of any two plans held keeps the margin for ever, rest included
    HELD = "held"  # everybody holds a plan that begins where the vehicle is, to within its tube
    DECREASE = "value decrease"  # the sum falls by what was driven, and by the gain of the swaps
    ARRIVAL = "arrival"  # nobody arrives later than its last plan said
    STILL = "still is free"  # what is left of each plan is free of what is not of the fleet
    ORDER = "commit order"  # each swap is proven past the plans that are held when it is made
    KNOWN = "known"  # what a vehicle drives is one of the plans that the others expect of it
    SAFETY = "safety"  # who cannot keep apart, and cannot stop in time
    NO_COLLISION = "no collision"  # of any two bodies along what was driven, measured


class FleetViolation(NamedTuple):
    """A guarantee that a step broke, by which vehicles, and why."""

    guarantee: FleetGuarantee
    names: tuple[str, ...]
    reason: str

    def __str__(self) -> str:
        return f"{self.guarantee.value}: {', '.join(self.names)}: {self.reason}"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Swap:
    """Plans exchanged for others: of one vehicle, or of several at once."""

    names: tuple[str, ...]
    before: float  # sum of the costs of what was left of their plans; inf if one did not arrive
    after: float
    past: tuple[tuple[str, int], ...]  # that it was proven past: whose plan, and which
    holds: tuple[tuple[str, int], ...]  # the plans that are held from then on
    order: int  # 0 for the first of the step

    __repr__ = brief

    @property
    def gain(self) -> float:
        """What is saved; inf if somebody arrives who did not."""
        return self.before - self.after


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FleetStep:
    """One step: where the vehicles are, and the plans they hold from then on, by name."""

    number: int  # 0 for the first
    time: float  # [s]
    poses: dict[str, Array]  # as they were measured
    plans: dict[str, Plan]  # held; each began at its own time, and ends in a rest
    driven: dict[str, Plan]  # from the measured pose on, at `time`
    values: dict[str, float]  # cost of what is left; inf if the plan does not arrive
    arrivals: dict[str, float]  # [s] on the clock of all; inf if the plan does not arrive
    off_plan: dict[str, float]  # [m] any point of the body from where the plan has it
    solve_s: float
    arrived: tuple[str, ...] = ()
    swaps: tuple[Swap, ...] = ()
    asked: tuple[str, ...] = ()  # who looked for another plan, in this order
    void: tuple[str, ...] = ()  # whose plans were void, and planned anew
    refused: tuple[str, ...] = ()  # who has not been let in yet
    gap_m: float = math.inf  # any two bodies keep it over the rest of the plans: a lower bound
    violations: tuple[FleetViolation, ...] = ()
    distance_m: float = math.inf  # least of any two bodies along what was driven, measured
    silent: tuple[str, ...] = ()  # whose workers do not answer: they drive the plans that they hold

    __repr__ = brief

    @property
    def value(self) -> float:
        """Cost of what is left of all plans."""
        return math.fsum(self.values.values())

    def control_of(self, name: str) -> Array | None:
        """The control of a vehicle from now on; None if it has nothing to do."""
        plan = self.driven[name]
        if not plan.primitives or plan.duration <= NOTHING:
            return None
        return plan.control_at(plan.start_time)

    def piece_of(self, name: str, pose: Array, until: float, model: Model) -> Plan:
        """What a vehicle at a pose (dof,) drives of its plan until a time [s], undisturbed."""
        plan = self.driven[name]
        if until - plan.start_time <= NOTHING or not plan.trims:
            return Plan(pose, (), durations=[], start_time=self.time)
        cut = with_samples_at(plan, [until], model)
        return replace(head_of(cut, until - plan.start_time), start=pose)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FleetLog(Played):
    """A fleet's closed loop from its begin to where it ended."""

    problem: FleetProblem
    step: float  # [s]
    steps: tuple[FleetStep, ...]
    driven: dict[str, tuple[Plan, ...]]  # piece after piece, from where the vehicle was
    arrived_s: dict[str, float]  # when each arrived, on the clock of all [s]
    broken_down: tuple[str, ...]
    closest: Closest | None  # of all that was driven; None if nobody came near anybody
    status: str  # reached | steps_spent
    reason: str = ""
    cost: float = 0.0  # of all that was driven
    counts: dict[str, int] = field(default_factory=dict)

    __repr__ = brief

    @property
    def times(self) -> Array:
        """When each step began, and when the last one ended: (n + 1,) [s]; the begin alone (1,)."""
        if not self.steps:
            return np.array([min(one.start_time for one in self.problem.problems)])
        return np.array([*(step.time for step in self.steps), self.steps[-1].time + self.step])

    def pieces_of(self, name: str) -> dict[int, Plan]:
        """What a vehicle drove, by the number in `steps` of the step it began in."""
        leaves = self.problem.leaves[self.problem.names.index(name)]
        driving = (
            k
            for k, step in enumerate(self.steps)
            if name in step.plans and not (leaves and name in step.arrived)
        )
        return dict(zip(driving, self.driven[name], strict=True))

    @property
    def values(self) -> Array:
        """What all had left to pay when each step began (n,); inf if somebody held no such plan.

        Who has broken down counts no more.
        """
        lost = set(self.broken_down)
        return np.array(
            [
                math.fsum(
                    value
                    for name, value in step.values.items()
                    if value < math.inf or name not in lost
                )
                for step in self.steps
            ]
        )

    def costs_of(self, name: str) -> dict[int, float]:
        """Cost of these pieces: a disturbed vehicle pays for what it was told to drive."""
        problem = self.problem.problems[self.problem.names.index(name)]
        return {k: _cost(problem, piece) for k, piece in self.pieces_of(name).items()}

    @property
    def reached(self) -> bool:
        """Whether everybody who can has arrived."""
        return self.status == "reached"

    @property
    def distance_m(self) -> float:
        """Least distance of any two bodies along what was driven [m]; inf if none came near."""
        return min((one.distance_m for one in self.steps), default=math.inf)

    @property
    def sum_s(self) -> float:
        """Sum of the times until those that arrived did [s]."""
        begins = dict(zip(self.problem.names, self.problem.problems, strict=True))
        return math.fsum(when - begins[name].start_time for name, when in self.arrived_s.items())

    @property
    def last_s(self) -> float:
        """When the last one arrived, on the clock of all [s]."""
        return max(self.arrived_s.values(), default=0.0)

    @property
    def violations(self) -> Iterator[tuple[int, FleetViolation]]:
        """Number of the step and the guarantee it broke, in order."""
        for step in self.steps:
            for violation in step.violations:
                yield step.number, violation

    @property
    def swaps(self) -> Iterator[tuple[int, Swap]]:
        """Number of the step and the swap, in order."""
        for step in self.steps:
            for swap in step.swaps:
                yield step.number, swap


def _cost(problem: Problem, piece: Plan) -> float:
    """Cost of a piece at the velocities of the library."""
    if not piece.trims:
        return 0.0
    known = problem.automaton
    if not piece.maneuvers:
        trims = tuple(known[t.name] if t.name in known.trim_names else t for t in piece.trims)
        lasting: list[float] = piece.durations.tolist()
        piece = Plan.of_parts(piece.start, trims, lasting, start_time=piece.start_time)
    return float(problem.cost_of(piece))

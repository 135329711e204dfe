"""The log of a closed loop, step by step, as values."""

from __future__ import annotations

import enum
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from maneuver_automaton._arrays import Array, freeze
from maneuver_automaton._brief import brief
from maneuver_automaton._display import Played
from maneuver_automaton.audit import Audit
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.cutting import head_of
from maneuver_automaton.planning.on_the_way import Passed
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.problem import Problem


class Guarantee(enum.Enum):
    """What holds in every step of an undisturbed loop; the values are those of closed_loop.json."""

    FEASIBILITY = "recursive feasibility"
    DECREASE = "value decrease"
    LEAST_COST = "least cost per step"
    STEPS = "number of steps"
    EFFORT = "decrease by the effort"
    HORIZON = "horizon"
    BUDGET = "time budget"
    BOUNDS = "bounds"
    SAFETY = "safety"  # the applied motion is free, and a free motion follows
    NO_COLLISION = "no collision"  # found by the audit of the driven motion


@dataclass(frozen=True, slots=True, kw_only=True)
class Violation:
    """A guarantee that a step broke, or that a disturbance took from it, and why."""

    guarantee: Guarantee
    reason: str  # one line, with the numbers

    __repr__ = brief

    def __str__(self) -> str:
        return f"{self.guarantee.value}: {self.reason}"


class Origin(enum.Enum):
    """Where the plan of a step comes from."""

    FIRST = "first"  # told to the first step, or nothing to be done at it
    SHIFTED = "shifted"  # the rest of the last plan
    REANCHORED = "reanchored"  # the rest of the last plan, made to meet the goal from elsewhere
    SEARCHED = "searched"  # found anew


class Decision(enum.Enum):
    """What a step decides to drive."""

    PLANNED = "planned"  # the first plan to the goal
    KEPT = "kept"  # the last plan
    IMPROVED = "improved"  # the last plan's word with better times
    REPLANNED = "replanned"  # another word to the goal
    APPROACHED = "approached"  # towards the goal, then a fail-safe trajectory
    STOPPED = "stopped"  # it waits at rest
    EVADED = "evaded"  # a fail-safe trajectory that does not wait
    MITIGATED = "harmful"  # no motion is free: the one that collides last

    @property
    def leads(self) -> bool:
        """Whether the step's plan ends at the goal."""
        return self._name_ in ("PLANNED", "KEPT", "IMPROVED", "REPLANNED")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Step:
    """One step: the pose of the vehicle, the plan from there, and the piece that is applied."""

    time: float  # [s]
    plan: Plan  # from `pose` to the goal, or, if its decision does not lead there, fail-safe
    goal_index: int  # which of the problem's goals it reaches
    value: float  # cost of the whole plan; of one that does not lead to the goal, a lower bound
    applied: float  # [s] until the next step
    applied_cost: float
    accumulated_cost: float  # of all steps before
    origin: Origin
    replanned: bool  # the word is not the rest of the previous one
    shifted_value: float | None  # cost of the rest of the last plan, None if it has none here
    off_plan: float | None  # [m or rad] between `pose` and the prediction of the last plan
    bound: Callable[[], float]  # no plan costs less: worked out when it is asked for
    exhaustive: bool  # no admitted word is cheaper
    solve_s: float
    number: int  # 0 for the first
    arrived: bool = False  # nothing remains to be done but to rest
    violations: tuple[Violation, ...] = ()
    disturbed: tuple[Violation, ...] = ()  # what noise, or obstacles seen anew, took from it
    measured: Array | None = None  # (dof,) pose that was measured, if it is used a step later
    decision: Decision = Decision.PLANNED
    free_until: float | None = None  # [s] no contact is predicted until then; None: nothing there
    is_sole: bool = False  # no other plan was found that costs as much
    clearance_m: float | None = None  # least one while it was driven, by the audit
    passed: tuple[Passed, ...] = ()  # on the way, before it; by its end, once it was driven

    __repr__ = brief

    @property
    def pose(self) -> Array:
        """Pose (dof,) of the vehicle, where the plan starts [m, m, rad(, m)]."""
        return self.plan.start

    @property
    def lower_bound(self) -> float:
        """No plan costs less, as far as is known."""
        return min(self.value, self.bound())

    @property
    def control(self) -> Array | None:
        """Control (n_u,) that holds from `time`; None if there is nothing to do."""
        if not (self.plan.maneuvers and self.plan.primitives):
            return self.plan.trims[0].control if self.plan.trims else None
        first = self.plan.primitives[0]
        if isinstance(first, Maneuver) and first.course is not None:
            return np.asarray(first.course.control[0])
        return first.control if isinstance(first, Trim) else None

    @property
    def piece(self) -> Plan:
        """The piece of the plan that is applied, until the next step."""
        return first_part(self.plan, self.applied)

    @property
    def predicted(self) -> Array:
        """Pose (dof,) at the next step if nothing disturbs."""
        return self.plan.pose_at(self.plan.start_time + self.applied)

    @property
    def gap(self) -> float:
        """How far the plan may be from the best one, relative to its value."""
        return 0.0 if self.value <= self.lower_bound else 1.0 - self.lower_bound / self.value


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ClosedLoop(Played):
    """A closed loop from its start to where it ended."""

    problem: Problem
    step: float  # [s]
    steps: tuple[Step, ...]  # one per step applied
    poses: Array  # (n + 1, dof) where the vehicle was, the last one where it ended
    times: Array  # (n + 1,) [s]
    reached: bool
    status: str  # reached | steps_spent | no_plan
    reason: str  # one line; empty if reached
    cost: float  # accumulated over the steps applied
    value: float  # cost of the plan at the end, 0 at the goal
    driven: tuple[Plan, ...] = ()  # the driven piece of each plan, from where the vehicle was
    audits: tuple[Audit, ...] = ()  # of the pieces driven
    inside: tuple[bool, ...] = ()  # (n + 1) whether each pose is within the goal's tolerance
    steps_bound: int | None = None  # the paper's bound on the number of steps
    counts: dict[str, int] = field(default_factory=dict)

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "poses", last=(3, 4))
        freeze(self, "times")

    @property
    def min_clearance_m(self) -> float | None:
        """Least distance to an obstacle that the audit measured [m]; None if it measured none."""
        known = [step.clearance_m for step in self.steps if step.clearance_m is not None]
        return min(known, default=None)

    @property
    def passed(self) -> tuple[Passed, ...]:
        """What was passed on the way, or where the vehicle has begun to stay."""
        return self.steps[-1].passed if self.steps else ()

    @property
    def collisions(self) -> Iterator[tuple[int, Violation]]:
        """Number of the step, and the obstacle it hit, by the audit."""
        for step in self.steps:
            for violation in (*step.violations, *step.disturbed):
                if violation.guarantee is Guarantee.NO_COLLISION:
                    yield step.number, violation

    @property
    def violations(self) -> Iterator[tuple[int, Violation]]:
        """Number of the step and the guarantee it broke, in order."""
        return ((step.number, one) for step in self.steps for one in step.violations)

    @property
    def disturbed(self) -> Iterator[tuple[int, Violation]]:
        """Number of the step and the guarantee that a disturbance took from it, in order."""
        return ((step.number, one) for step in self.steps for one in step.disturbed)

    @property
    def solve_s(self) -> Array:
        """Time (n,) that every step took to decide [s]."""
        return np.array([step.solve_s for step in self.steps])


def first_part(plan: Plan, until: float) -> Plan:
    """The first `until` seconds of a plan.

    Examples
    --------
    >>> from maneuver_automaton.primitives import Trim
    >>> ahead = Trim(name="ahead", body_velocity=[1, 0, 0], control=[1, 0])
    >>> first_part(Plan([0, 0, 0], (ahead,), durations=[2.0]), 0.5).end.tolist()
    [0.5, 0.0, 0.0]
    """
    return head_of(plan, until) if plan.trims else plan

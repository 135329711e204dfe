"""The situation of a step: state, last plan, its committed part, and the problem after it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.cutting import NOTHING, committed, head_of, joined
from maneuver_automaton.budget import Budget
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Problem, apart
from maneuver_automaton.receding_horizon.candidates import Candidate, candidate, preference, within
from maneuver_automaton.receding_horizon.log import Decision, Guarantee, Origin, Step, Violation
from maneuver_automaton.receding_horizon.pace import between_trims
from maneuver_automaton.receding_horizon.reanchoring import (
    distance,
    missed,
    reanchored,
    same_word,
)
from maneuver_automaton.receding_horizon.settings import EXACT, Settings
from maneuver_automaton.receding_horizon.shifting import moves_on, rest_of, rested
from maneuver_automaton.search.result import TIE

FINISHED = 2  # candidates of a step for which controls between those of the library are sought
ROUNDING = 1e-13  # relative, of a pose that was computed from a plan


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Chosen:
    """The result of a step."""

    plan: Plan
    goal_index: int
    value: float
    origin: Origin
    shifted_value: float | None
    arrived: bool = False
    decision: Decision | None = None  # None: told by the plan
    free_until: float | None = None  # [s]


class Situation:
    """One step under way: all that is known before a search.

    Parameters
    ----------
    settings : Settings
    here : Problem
        From where the vehicle was measured, at that time.
    last : Step or None
        The last step, as it was driven.
    passed : float
        [s] since the last step.
    budget : Budget
        Its time is for all of this step.
    changed : bool
        Whether other obstacles are seen than at the last step.
    """

    def __init__(
        self,
        settings: Settings,
        here: Problem,
        last: Step | None,
        *,
        passed: float,
        budget: Budget,
        changed: bool,
    ) -> None:
        self.settings = settings
        self.here = here
        self.last = last
        self.budget = budget
        self.passed = passed
        self.changed = changed
        self.violations: list[Violation] = []
        self.exhaustive = False
        self.is_sole = False  # whether no other plan was found that costs as much as the best
        self.off_plan: float | None = None
        self.rounding = False  # whether no more than rounding parts the vehicle from its plan
        self.rest: Plan | None = None
        self.bound = 0.0  # no plan costs less, as is known before a search
        self.busy = 0.0  # [s] that are committed: until the maneuver under way ends
        if last is not None:
            off = max(apart(last.plan.pose_at(last.time + passed), here.start))
            self.off_plan = 0.0 if off <= EXACT * self.size else off
            self.rounding = off <= ROUNDING * self.size
            self.rest = rest_of(last.plan, passed, start=here.start, pad=settings.pad_of(here))
            self.busy = committed(last.plan, passed)

    def is_near_optimal(self, kept: Candidate | None) -> bool:
        """Whether the plan that is kept is proven to be near enough to the optimum, if asked."""
        gap = self.settings.gap
        return gap is not None and kept is not None and kept.cost - self.bound <= gap * kept.cost

    @cached_property
    def size(self) -> float:
        """The size [m or rad] that errors of rounding grow with."""
        numbers: list[float] = self.here.start.tolist()
        return 1.0 + max(map(abs, numbers))

    @cached_property
    def head(self) -> Plan | None:
        """The committed part, to the end of the maneuver under way; None if there is none."""
        return head_of(self.rest, self.busy) if self.rest is not None and self.busy else None

    @property
    def trim(self) -> Trim:
        """The trim in which the vehicle is, or will be at the end of the committed part."""
        if self.head is not None:
            return self.head.trims[-1]
        if self.rest is not None and self.rest.trims:
            return self.rest.trims[0]
        if self.last is not None and self.last.plan.trims:
            return self.last.plan.trims[-1]
        return self.here.first_trim

    @property
    def as_it_moves(self) -> Problem | None:
        """The problem from here, which starts in a trim that moves if the vehicle does.

        None for a vehicle with inertia whose library has no such trim. Bounds ask for no more.
        """
        here, automaton = self.here, self.here.automaton
        if not here.has_inertia or (self.trim.is_rest and not self.busy):
            return here
        moving = next((trim.name for trim in automaton.trims if not trim.is_rest), None)
        return None if moving is None else replace(here, start_trim=moving)

    @property
    def onward(self) -> Problem | None:
        """The problem from the end of the committed part; None if no time is left then."""
        head, horizon = self.head, self.here.horizon
        if head is None:
            return self.here
        total = None if horizon.time is None else horizon.time - self.busy
        longest = None if horizon.max_time is None else horizon.max_time - self.busy
        if any(left is not None and left <= NOTHING for left in (total, longest)):
            return None
        return replace(
            self.here,
            start=head.end,
            start_time=self.here.start_time + self.busy,
            horizon=replace(horizon, time=total, max_time=longest),
        )

    def whole(self, plan: Plan) -> Plan:
        """The committed part, then `plan`, which starts at its end."""
        return plan if self.head is None else joined(self.head, plan)

    @property
    def may_rest(self) -> bool:
        """Whether the vehicle may end its drive here: it switches at will, or its plan is over."""
        if self.rest is not None and not moves_on(self.rest):
            return True
        fixed = self.here.horizon.time is not None and self.settings.pad is None
        return self.settings.at_will and not fixed

    def given(self, first: Plan) -> Chosen:
        """The plan that the first step was told to apply."""
        here = self.here
        plan = self.filled(replace(first, start=here.start, start_time=here.start_time))
        for index, goal in enumerate(here.goals):
            if missed(plan, goal) <= EXACT * self.size:
                return self.as_chosen(self.candidate(plan, index, Origin.FIRST), None)
        raise ValueError(
            f"receding horizon: first ends at {plan.end.round(9).tolist()}, need a plan that ends "
            "at the goal"
        )

    def filled(self, plan: Plan) -> Plan:
        """A plan that takes no longer than it may, with rest for the remainder of a fixed time."""
        limit = self.longest
        if limit is not None and plan.duration > limit * (1.0 + EXACT):
            raise ValueError(
                f"receding horizon: first takes {plan.duration:g} s, need at most {limit:g} s"
            )
        return self.padded(plan)

    @property
    def longest(self) -> float | None:
        """How long a plan may take [s]; None if as long as it likes."""
        horizon = self.here.horizon
        return horizon.time if horizon.time is not None else horizon.max_time

    def padded(self, plan: Plan) -> Plan:
        """The plan, then rest for the remainder of a fixed time."""
        total, pad = self.here.horizon.time, self.settings.pad
        if total is None or pad is None:
            return plan
        return rested(plan, pad, total - plan.duration)

    def as_chosen(self, best: Candidate, shifted_value: float | None) -> Chosen:
        """A candidate as the result of the step."""
        return Chosen(
            plan=best.plan,
            goal_index=best.goal_index,
            value=best.cost,
            origin=best.origin,
            shifted_value=shifted_value,
        )

    def exactly_at(self) -> int | None:
        """Number of the goal at which the vehicle is, and may rest; None if at none."""
        for index, goal in enumerate(self.here.goals if self.may_rest else ()):
            if distance(self.here.start, goal) <= EXACT:
                return index
        return None

    def ended_within(self) -> int | None:
        """Number of the goal within whose tolerance the last plan is over; None if none is."""
        if self.last is None or self.rest is None or moves_on(self.rest):
            return None
        index = self.last.goal_index
        return index if within(self.here.start, self.here.goals[index]) else None

    def resting(self, index: int) -> Chosen:
        """To rest at a goal."""
        here, pad = self.here, self.settings.pad
        total = here.horizon.time
        plan = Plan(here.start, (), durations=[], start_time=here.start_time)
        if self.rest is not None and self.rest.trims and not moves_on(self.rest):
            plan = self.rest
        elif total is not None and pad is not None:
            plan = rested(plan, pad, total)
        elif pad is not None and distance(here.start, here.goals[index]) > EXACT:
            plan = rested(plan, pad, self.settings.step)
        value = here.cost_of(plan)
        shifted = None if self.rest is None else min(value, here.cost_of(self.rest))
        self.exhaustive = True
        return Chosen(
            plan=plan,
            goal_index=index,
            value=value,
            origin=Origin.FIRST if self.last is None else Origin.SHIFTED,
            shifted_value=shifted,
            arrived=True,
        )

    def planned(self) -> Plan:
        """The rest of the last plan from where it had said the vehicle would be."""
        if self.last is None:
            return Plan(self.here.start, (), durations=[], start_time=self.here.start_time)
        return rest_of(self.last.plan, self.passed, pad=self.settings.pad_of(self.here))

    def rests(self) -> Iterator[tuple[Plan, Origin]]:
        """The rest of the last plan from here: as it is, or made to meet the goal again."""
        if self.rest is None or self.last is None:
            return
        here, goal = self.here, self.here.goals[self.last.goal_index]
        pad, under_way = self.settings.pad_of(here), self.busy > 0.0
        leads = missed(self.rest, goal) <= EXACT * self.size or within(self.rest.end, goal)
        if self.off_plan == 0.0 and leads:
            if self.settings.margin:
                again = same_word(here, self.rest, goal, pad=pad, under_way=under_way)
                if again is not None and here.cost_of(again) < here.cost_of(self.rest):
                    yield again, Origin.REANCHORED
            yield self.rest, Origin.SHIFTED
            return
        for plan in reanchored(here, self.planned(), goal, pad=pad, under_way=under_way):
            yield plan, Origin.REANCHORED

    def rest_within(self) -> Plan | None:
        """The rest of the last plan as it is, if it ends within the tolerance of its goal."""
        if self.rest is None or self.last is None:
            return None
        goal = self.here.goals[self.last.goal_index]
        return self.rest if within(self.rest.end, goal) else None

    def is_detour(self, plan: Plan) -> bool:
        """Whether a plan drives other trims than the last one, or costs more."""
        if self.last is None or self.rest is None:
            return False
        same = [trim.name for trim in plan.trims] == [trim.name for trim in self.rest.trims]
        return not same or self.here.cost_of(plan) > self.last.value

    def best(self, kept: Candidate | None, found: Iterable[Candidate]) -> Candidate | None:
        """The cheapest; of equal ones, that which costs most at first; of these, the known word."""
        everything = [*found] if kept is None else [kept, *found]
        if not everything:
            return None
        least = min(one.cost for one in everything)
        if (
            kept is not None
            and least >= kept.cost - self.settings.margin
            and self.settings.margin > 0.0
        ):
            self.exhaustive = self.exhaustive and least == kept.cost
            return kept
        tied = [one for one in everything if one.cost <= least + TIE * (1.0 + abs(least))]
        self.is_sole = len(tied) == 1
        if self.is_sole:
            return tied[0]
        return min(tied, key=lambda one: preference(one, self.here, self.settings.step))

    def between_trims(self, kept: Candidate | None, found: Sequence[Candidate]) -> list[Candidate]:
        """The cheapest of some candidates again, with controls between those of the library."""
        everything = [*found] if kept is None else [kept, *found]
        better: list[Candidate] = []
        for one in sorted(everything, key=lambda one: one.cost)[:FINISHED]:
            plan = between_trims(self.here, one.plan, self.settings.pieces)
            if plan is not one.plan:
                better.append(self.candidate(plan, one.goal_index, one.origin))
        return better

    def candidate(self, plan: Plan, index: int, origin: Origin) -> Candidate:
        """A plan from here, with the costs by which it is compared."""
        return candidate(self.here, self.settings, plan, goal_index=index, origin=origin)

    def flag(self, guarantee: Guarantee, reason: str) -> None:
        """Say that a guarantee is broken."""
        self.violations.append(Violation(guarantee=guarantee, reason=reason))

    def flag_late(self, plan: Plan) -> None:
        """Say so if a plan takes longer than it may."""
        limit = self.longest
        if limit is not None and plan.duration > limit * (1.0 + EXACT):
            self.flag(
                Guarantee.HORIZON,
                f"no plan was found that takes at most {limit:g} s; the one applied takes "
                f"{plan.duration:.6g} s",
            )

    def goal_within(self, pose: Array) -> int | None:
        """Number of the goal that a pose is, to within its tolerances."""
        for index, goal in enumerate(self.here.goals):
            if within(pose, goal):
                return index
        return None

"""The situation of a step: state, last plan, its committed part, and the problem after it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.cutting import (
    NOTHING,
    begin_state,
    committed,
    head_of,
    joined,
    tail_of,
)
from maneuver_automaton.budget import Budget
from maneuver_automaton.planning.from_state import leg_from
from maneuver_automaton.planning.on_the_way import (
    going_on,
    passed_on_the_way,
    still_ahead,
    what_is_missed,
)
from maneuver_automaton.primitives import Trim
from maneuver_automaton.primitives.on_the_spot import trim_at
from maneuver_automaton.problem import Goal, Problem, apart
from maneuver_automaton.receding_horizon.candidates import (
    StepPlan,
    between_trims,
    candidate,
    preference,
    within,
)
from maneuver_automaton.receding_horizon.log import Guarantee, Origin, Step, Violation
from maneuver_automaton.receding_horizon.rest_of_plan import (
    followed_by,
    missed,
    moves_on,
    reanchored,
    rest_of,
    rested,
    same_word,
)
from maneuver_automaton.receding_horizon.settings import EXACT, Settings
from maneuver_automaton.search.result import TIE

FINISHED = 2  # candidates of a step for which controls between those of the library are sought
ROUNDING = 1e-13  # relative, of a pose that was computed from a plan


class Situation:
    """One step under way: all that is known before a search.

    `here` starts where the vehicle was measured, `passed` seconds after the `last` step as it was
    driven; `budget` is for all of this step; `changed`: other obstacles are seen than before. Where
    another reduced `state` is measured than the plan says, a maneuver leads from there to the plan.
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
        state: Array | None = None,
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
        self.off_state = False  # whether another reduced state was measured than the plan says
        self.size = 1.0 + max(map(abs, here.start.tolist()))  # [m or rad] rounding grows with it
        self.off = [goal.off(here.start) for goal in here.goals]  # how far it is off every goal
        self.accumulated = 0.0 if last is None else last.accumulated_cost + last.applied_cost
        if last is not None:
            off = max(apart(last.plan.pose_at(last.time + passed), here.start))
            self.off_plan = 0.0 if off <= EXACT * self.size else off
            self.rounding = off <= ROUNDING * self.size
            self.rest = rest_of(last.plan, passed, start=here.start, pad=settings.pad_of(here))
            self.busy = committed(last.plan, passed)
            if state is not None:
                self._go_on_from(state, last)

    def _go_on_from(self, state: Array, last: Step) -> None:
        """Put a maneuver from the measured state in place of what was committed, if they differ."""
        # Where the plan is over, one leads to the trim in which it ended, unless the vehicle
        # stands.
        assert self.rest is not None
        here, model = self.here, self.here.automaton.model
        if self.rest.trims:
            expected = begin_state(self.rest)
            after = tail_of(self.rest, self.busy, start=here.start)
        else:
            measured = trim_at(model, state, "measured state")
            if measured.is_rest and not model.reduced_dynamics(state, measured.control).any():
                return
            trim = (last.plan.trims or (here.last_trim(here.goals[last.goal_index]),))[-1]
            expected = trim.reduced_state
            after = Plan(here.start, (trim,), durations=[0.0], start_time=here.start_time)
        off = float(np.abs(expected - state).max())
        if off <= EXACT:
            return
        self.off_plan, self.off_state = max(self.off_plan or 0.0, off), True
        leg = leg_from(here, state, after.trims[0])
        if leg is None:
            self.flag(Guarantee.FEASIBILITY, "no maneuver was found from the measured state")
            return
        begun = Plan(
            here.start,
            (leg.state, leg.trim),
            durations=[0.0, 0.0],
            maneuvers=(leg.maneuver,),
            start_time=here.start_time,
        )
        back = leg.trim is after.trims[0]
        self.rest, self.busy = joined(begun, after) if back else begun, leg.maneuver.duration

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
        return None if moving is None else replace(here, start_trim=moving, start_state=None)

    @property
    def onward(self) -> Problem | None:
        """The problem from the end of the committed part; None if no time is left then."""
        head, horizon, here = self.head, self.here.horizon, self.here
        if head is None:
            return here
        total = None if horizon.time is None else horizon.time - self.busy
        longest = None if horizon.max_time is None else horizon.max_time - self.busy
        if any(left is not None and left <= NOTHING for left in (total, longest)):
            return None
        return replace(
            here,
            start=head.end,
            start_time=here.start_time + self.busy,
            horizon=replace(horizon, time=total, max_time=longest),
            via=still_ahead(here, going_on(here, (), head)),
        )

    def whole(self, plan: Plan) -> Plan:
        """The committed part, then `plan`, which starts at its end."""
        return plan if self.head is None else joined(self.head, plan)

    @property
    def is_over(self) -> bool:
        """Whether nothing of the last plan is left but to stand still."""
        return self.rest is not None and not moves_on(self.rest)

    @property
    def may_rest(self) -> bool:
        """Whether the vehicle may end its drive here: it switches at will, or its plan is over."""
        fixed = self.here.horizon.time is not None and self.settings.pad is None
        return (not self.here.has_inertia and not fixed) or self.is_over

    def given(self, first: Plan) -> StepPlan:
        """The plan that the first step was told to apply, which may not take too long."""
        here, limit = self.here, self.longest
        if limit is not None and first.duration > limit * (1.0 + EXACT):
            raise ValueError(
                f"receding horizon: first takes {first.duration:g} s, need at most {limit:g} s"
            )
        plan = self.padded(replace(first, start=here.start, start_time=here.start_time))
        said = what_is_missed(here, plan)
        if said:
            raise ValueError(f"receding horizon: first: {said}")
        for index, goal in enumerate(here.goals):
            if self._leads_to(goal, plan):
                return self.candidate(plan, index, Origin.FIRST)
        raise ValueError(
            f"receding horizon: first ends at {plan.end.round(9).tolist()}, need a plan that ends "
            "at the goal"
        )

    def _leads_to(self, goal: Goal, plan: Plan) -> bool:
        """Whether a plan ends at a goal: where it is, or anywhere within its tolerances."""
        return missed(plan, goal) <= EXACT * self.size or within(plan.end, goal)

    @property
    def longest(self) -> float | None:
        """How long a plan may take [s]; None if as long as it likes."""
        horizon = self.here.horizon
        return horizon.time if horizon.time is not None else horizon.max_time

    def padded(self, plan: Plan) -> Plan:
        """The plan, then rest for the remainder of a fixed time."""
        total, pad = self.here.horizon.time, self.settings.pad
        return plan if total is None or pad is None else rested(plan, pad, total - plan.duration)

    def resting(self, index: int) -> StepPlan:
        """To rest at a goal."""
        here, pad = self.here, self.settings.pad
        if pad is not None and here.has_inertia:
            pad = here.last_trim(here.goals[index])  # in the state in which the plan has ended
        total = here.horizon.time
        plan = Plan(here.start, (), durations=[], start_time=here.start_time)
        if self.rest is not None and self.rest.trims and self.is_over:
            plan = self.rest
        elif total is not None and pad is not None:
            plan = rested(plan, pad, total)
        elif pad is not None and max(self.off[index]) > EXACT:
            plan = rested(plan, pad, self.settings.step)
        value = here.cost_of(plan)
        shifted = None if self.rest is None else min(value, here.cost_of(self.rest))
        self.exhaustive = True
        return StepPlan(
            plan=plan,
            goal_index=index,
            cost=value,
            origin=Origin.FIRST if self.last is None else Origin.SHIFTED,
            shifted_value=shifted,
            arrived=True,
        )

    def planned(self) -> Plan:
        """The rest of the last plan from where it had said the vehicle would be."""
        if self.last is None:
            return Plan(self.here.start, (), durations=[], start_time=self.here.start_time)
        if self.off_state and self.rest is not None:
            return self.rest
        return rest_of(self.last.plan, self.passed, pad=self.settings.pad_of(self.here))

    def rests(self) -> Iterator[tuple[Plan, Origin]]:
        """The rest of the last plan from here: as it is, or made to meet the goal again."""
        if self.rest is None or self.last is None:
            return
        here, goal = self.here, self.here.goals[self.last.goal_index]
        pad, under_way = self.settings.pad_of(here), self.busy > 0.0
        if self.off_plan == 0.0 and self._leads_to(goal, self.rest):
            if self.settings.margin:
                again = same_word(here, self.rest, goal, pad=pad, under_way=under_way)
                if again is not None and here.cost_of(again) < here.cost_of(self.rest):
                    yield again, Origin.REANCHORED
            yield self.rest, Origin.SHIFTED
            return
        known, then = self.until_next()
        aim = goal if then is None else Goal(then.start, trim=then.trims[0].name)
        for plan in reanchored(here, known, aim, pad=pad, under_way=under_way):
            yield plan if then is None else followed_by(plan, then), Origin.REANCHORED

    def until_next(self) -> tuple[Plan, Plan | None]:
        """The last plan to the next pose on the way, and its rest; None if it leads past none."""
        plan = self.planned()
        ahead = [one.time - plan.start_time for one in passed_on_the_way(self.here, plan)]
        if not ahead or committed(plan, ahead[0]) > NOTHING:
            return plan, None
        then = tail_of(plan, ahead[0])
        return (head_of(plan, ahead[0]), then) if then.trims else (plan, None)

    def best(self, kept: StepPlan | None, found: Iterable[StepPlan]) -> StepPlan | None:
        """The cheapest; of equal ones, that which costs most at first; of these, the known word."""
        everything = [*found] if kept is None else [kept, *found]
        if len(everything) < 2:
            self.is_sole = bool(found or (kept and not self.settings.margin))
            return everything[0] if everything else None
        least = min(one.cost for one in everything)
        margin = self.settings.margin
        if kept is not None and least >= kept.cost - margin and margin > 0.0:
            self.exhaustive = self.exhaustive and least == kept.cost
            return kept
        tied = [one for one in everything if one.cost <= least + TIE * (1.0 + abs(least))]
        self.is_sole = len(tied) == 1
        if self.is_sole:
            return tied[0]
        return min(tied, key=lambda one: preference(one, self.here, self.settings.step))

    def between_trims(self, kept: StepPlan | None, found: Sequence[StepPlan]) -> list[StepPlan]:
        """The cheapest of some candidates again, with controls between those of the library."""
        everything = [*found] if kept is None else [kept, *found]
        better: list[StepPlan] = []
        for one in sorted(everything, key=lambda one: one.cost)[:FINISHED]:
            plan = between_trims(self.here, one.plan, self.settings.pieces)
            if plan is not one.plan:
                better.append(self.candidate(plan, one.goal_index, one.origin))
        return better

    def candidate(self, plan: Plan, index: int, origin: Origin) -> StepPlan:
        """A plan from here, with the costs by which it is compared."""
        return candidate(self.here, self.settings, plan, goal_index=index, origin=origin)

    def flag(self, guarantee: Guarantee, reason: str) -> None:
        """Say that a guarantee is broken."""
        self.violations.append(Violation(guarantee=guarantee, reason=reason))

"""Where a step stands: the state, the last plan, and what both kinds of decision need of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.receding_horizon.candidates import Candidate, candidate, within
from maneuver_automaton.receding_horizon.log import Deed, Guarantee, Origin, Step, Violation
from maneuver_automaton.receding_horizon.reanchoring import (
    distance,
    missed,
    reanchored,
    same_word,
)
from maneuver_automaton.receding_horizon.settings import EXACT, Settings
from maneuver_automaton.receding_horizon.shifting import merged, rest_of
from maneuver_automaton.search.alternatives import TIE


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Chosen:
    """What a step came to."""

    plan: Plan
    goal_index: int
    value: float
    origin: Origin
    rest: Plan | None  # of the last plan
    shifted_value: float | None
    off_plan: float | None
    exhaustive: bool
    arrived: bool
    violations: tuple[Violation, ...]
    deed: Deed | None = None  # None: told by the plan
    free_until: float | None = None  # [s]


class Situation:
    """One step under way: what is known before anything is searched."""

    def __init__(
        self,
        settings: Settings,
        here: Problem,
        last: Step | None,
        passed: float,
        began: float,
    ) -> None:
        self.settings = settings
        self.here = here
        self.last = last
        self.began = began
        self.violations: list[Violation] = []
        self.exhaustive = False
        self.off_plan: float | None = None
        self.rest: Plan | None = None
        self.passed = passed
        if last is not None:
            goal = Goal(pose=last.plan.pose_at(last.time + passed))
            off = distance(here.start, goal)
            self.off_plan = 0.0 if off <= EXACT * (1.0 + float(np.abs(here.start).max())) else off
            pad = settings.pad_of(here)
            self.rest = rest_of(last.plan, passed, start=here.start, pad=pad)

    def given(self, first: Plan) -> Chosen:
        """The plan that the first step was told to apply."""
        here = self.here
        plan = self.filled(replace(first, start=here.start, start_time=here.start_time))
        for index, goal in enumerate(here.goals):
            if missed(plan, goal) <= EXACT * (1.0 + float(np.abs(here.start).max())):
                return self.as_chosen(self.candidate(plan, index, Origin.FIRST), None)
        raise ValueError(
            f"receding horizon: first ends at {plan.end.round(9).tolist()}, need a plan that ends "
            "at the goal"
        )

    def filled(self, plan: Plan) -> Plan:
        """A plan that takes no longer than it may, with rest for what is left of a fixed time."""
        horizon = self.here.horizon
        limit = horizon.time if horizon.time is not None else horizon.max_time
        if limit is not None and plan.duration > limit * (1.0 + EXACT):
            raise ValueError(
                f"receding horizon: first takes {plan.duration:g} s, need at most {limit:g} s"
            )
        return self.padded(plan)

    def padded(self, plan: Plan) -> Plan:
        """The plan, then rest for what is left of a fixed time."""
        horizon, pad = self.here.horizon, self.settings.pad
        if horizon.time is None or pad is None:
            return plan
        left = max(0.0, horizon.time - plan.duration)
        word, times = merged((*plan.trims, pad), [*plan.durations.tolist(), left])
        return replace(plan, trims=word, durations=np.array(times))

    def as_chosen(self, best: Candidate, shifted_value: float | None) -> Chosen:
        """A candidate as what the step came to."""
        return Chosen(
            plan=best.plan,
            goal_index=best.goal_index,
            value=best.cost,
            origin=best.origin,
            rest=self.rest,
            shifted_value=shifted_value,
            off_plan=self.off_plan,
            exhaustive=self.exhaustive,
            arrived=False,
            violations=tuple(self.violations),
        )

    def arrived(self) -> Chosen | None:
        """At a goal there is nothing to do but to rest."""
        for index, goal in enumerate(self.here.goals):
            if distance(self.here.start, goal) <= EXACT:
                return self.resting(index)
        return None

    def resting(self, index: int) -> Chosen:
        """To rest at a goal."""
        here, pad = self.here, self.settings.pad
        total = here.horizon.time
        at = here.start_time
        if total is not None and pad is not None:
            plan = Plan(here.start, (pad,), durations=[total], start_time=at)
        elif pad is not None and distance(here.start, here.goals[index]) > EXACT:
            plan = Plan(here.start, (pad,), durations=[self.settings.step], start_time=at)
        else:
            plan = Plan(here.start, (), durations=[], start_time=at)
        value = here.cost_of(plan)
        shifted = None if self.rest is None else min(value, here.cost_of(self.rest))
        return Chosen(
            plan=plan,
            goal_index=index,
            value=value,
            origin=Origin.FIRST if self.last is None else Origin.SHIFTED,
            rest=plan if self.rest is None else self.rest,
            shifted_value=shifted,
            off_plan=self.off_plan,
            exhaustive=True,
            arrived=True,
            violations=(),
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
        pad = self.settings.pad_of(here)
        if self.off_plan == 0.0 and missed(self.rest, goal) <= EXACT:
            yield self.rest, Origin.SHIFTED
            solved = same_word(here, self.rest, goal, pad=pad) if self.settings.margin else None
            if solved is not None:
                yield solved, Origin.REANCHORED
            return
        for plan in reanchored(here, self.planned(), goal, pad=pad):
            yield plan, Origin.REANCHORED

    def best(self, kept: Candidate | None, found: Iterable[Candidate]) -> Candidate | None:
        """The cheapest; of equal ones, what costs most at first; of these, the known word."""
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
        return min(tied, key=lambda one: one.preference)

    def candidate(self, plan: Plan, index: int, origin: Origin) -> Candidate:
        """A plan from here, with what it is compared by."""
        return candidate(self.here, self.settings, plan, goal_index=index, origin=origin)

    def held(self, one: Candidate) -> Chosen:
        """A plan that stays within the goal: nothing else is left to be done."""
        chosen = self.as_chosen(one, one.cost)
        return replace(chosen, arrived=True, violations=())

    def flag_late(self, plan: Plan) -> None:
        """Say so if a plan takes longer than it may."""
        limit = self.here.horizon.time or self.here.horizon.max_time
        if limit is not None and plan.duration > limit * (1.0 + EXACT):
            self.violations.append(
                Violation(
                    guarantee=Guarantee.HORIZON,
                    reason=f"no plan was found that takes at most {limit:g} s; the one applied "
                    f"takes {plan.duration:.6g} s",
                )
            )

    def goal_within(self, pose: Array) -> int | None:
        """Number of the goal that a pose is, to within its tolerances."""
        for index, goal in enumerate(self.here.goals):
            if within(pose, goal):
                return index
        return None

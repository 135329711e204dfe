"""What a step decides: the rest of the last plan, or a cheaper one."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.receding_horizon.candidates import (
    EXACT,
    Candidate,
    Settings,
    allowed,
    candidate,
    within,
)
from maneuver_automaton.receding_horizon.holding import holding
from maneuver_automaton.receding_horizon.log import Guarantee, Origin, Step, Violation
from maneuver_automaton.receding_horizon.reanchoring import (
    distance,
    missed,
    quickest,
    reanchored,
    rejoining,
    same_word,
)
from maneuver_automaton.receding_horizon.shifting import merged, rest_of
from maneuver_automaton.search.choose import search_goal
from maneuver_automaton.search.result import SearchStatus, plan_of
from maneuver_automaton.search.words import TIE

SECOND_OPINION = 0.02  # [s] for short words beside insertion
PACES = 5  # dearer plans, which may be cheaper at another pace


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


class Decision:
    """One step under way."""

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

    def chosen(self) -> Chosen:
        """The plan to apply."""
        arrived = self._arrived()
        if arrived is not None:
            return arrived
        inside = self._goal_within(self.here.start) if self.settings.hold else None
        if inside is not None:
            held = holding(self.here, self.settings, inside)
            return self._resting(inside) if held is None else self._held(held)
        if self.last is None and self.settings.first is not None:
            return self._given(self.settings.first)
        kept = self._kept()
        searched = self._searched(None if kept is None else kept.plan)
        best = self._best(kept, searched) or self._late()
        if best is None:
            return self._helpless()
        self._flag_late(best.plan)
        return self._as_chosen(best, None if kept is None else kept.cost)

    def _given(self, first: Plan) -> Chosen:
        """The plan that the first step was told to apply."""
        here = self.here
        plan = self._filled(replace(first, start=here.start, start_time=here.start_time))
        for index, goal in enumerate(here.goals):
            if missed(plan, goal) <= EXACT * (1.0 + float(np.abs(here.start).max())):
                return self._as_chosen(self._candidate(plan, index, Origin.FIRST), None)
        raise ValueError(
            f"receding horizon: first ends at {plan.end.round(9).tolist()}, need a plan that ends "
            "at the goal"
        )

    def _filled(self, plan: Plan) -> Plan:
        """A plan that takes no longer than it may, with rest for what is left of a fixed time."""
        horizon = self.here.horizon
        limit = horizon.time if horizon.time is not None else horizon.max_time
        if limit is not None and plan.duration > limit * (1.0 + EXACT):
            raise ValueError(
                f"receding horizon: first takes {plan.duration:g} s, need at most {limit:g} s"
            )
        return self._padded(plan)

    def _padded(self, plan: Plan) -> Plan:
        """The plan, then rest for what is left of a fixed time."""
        horizon, pad = self.here.horizon, self.settings.pad
        if horizon.time is None or pad is None:
            return plan
        left = max(0.0, horizon.time - plan.duration)
        word, times = merged((*plan.trims, pad), [*plan.durations.tolist(), left])
        return replace(plan, trims=word, durations=np.array(times))

    def _as_chosen(self, best: Candidate, shifted_value: float | None) -> Chosen:
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

    def _arrived(self) -> Chosen | None:
        """At a goal there is nothing to do but to rest."""
        for index, goal in enumerate(self.here.goals):
            if distance(self.here.start, goal) <= EXACT:
                return self._resting(index)
        return None

    def _resting(self, index: int) -> Chosen:
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

    def _planned(self) -> Plan:
        """The rest of the last plan from where it had said the vehicle would be."""
        if self.last is None:
            return Plan(self.here.start, (), durations=[], start_time=self.here.start_time)
        return rest_of(self.last.plan, self.passed, pad=self.settings.pad_of(self.here))

    def _kept(self) -> Candidate | None:
        """The rest of the last plan from here: as it is, or made to meet the goal again."""
        if self.rest is None or self.last is None:
            return None
        here, index = self.here, self.last.goal_index
        goal = here.goals[index]
        pad = self.settings.pad_of(here)
        plans: list[tuple[Plan, Origin]] = []
        if self.off_plan == 0.0 and missed(self.rest, goal) <= EXACT:
            plans.append((self.rest, Origin.SHIFTED))
            solved = same_word(here, self.rest, goal, pad=pad) if self.settings.margin else None
            if solved is not None:
                plans.append((solved, Origin.REANCHORED))
        else:
            around = reanchored(here, self._planned(), goal, pad=pad)
            first = next(around, None)
            if first is not None:
                plans.append((first, Origin.REANCHORED))
                same = [trim.name for trim in first.trims] == [t.name for t in self.rest.trims]
                if not same or here.cost_of(first) > self.last.value:  # a detour: look further
                    plans += [(plan, Origin.REANCHORED) for plan in around]
        candidates = [
            self._candidate(plan, index, origin) for plan, origin in plans if allowed(here, plan)
        ]
        return min(candidates, key=lambda one: one.cost, default=None)

    def _searched(self, known: Plan | None) -> list[Candidate]:
        """What a search from here finds."""
        here = self.here
        found: list[Candidate] = []
        self.exhaustive = True
        bounded = any(getattr(here.bounds, name) is not None for name in ("x", "y", "z"))
        alternatives = None if bounded else PACES if self.settings.retimed else 0
        for index, goal in enumerate(here.goals):
            left = self.began + self.settings.time_limit - time.monotonic()
            to_known = known if self.last is None or index == self.last.goal_index else None
            if left <= 0.0 and (known is not None or found):
                self.exhaustive = False
                self._over_budget()
                break
            results = search_goal(
                here,
                goal,
                alternatives=alternatives,
                time_limit=max(left, 1e-6),
                known=None if self.settings.retimed else to_known,
                ties=True,
                second_opinion=SECOND_OPINION,
            )
            proven = any(one.exhaustive for one in results)
            self.exhaustive = self.exhaustive and proven and not (self.settings.retimed or bounded)
            if any(one.status is SearchStatus.OUT_OF_BUDGET for one in results):
                self._over_budget()
            for result in results:
                for solution in result.solutions:
                    plan = plan_of(here, solution)
                    if allowed(here, plan):
                        found.append(self._candidate(plan, index, Origin.SEARCHED))
        return found

    def _over_budget(self) -> None:
        if any(one.guarantee is Guarantee.BUDGET for one in self.violations):
            return
        limit = self.settings.time_limit
        self.violations.append(
            Violation(
                guarantee=Guarantee.BUDGET,
                reason=f"the search was cut short after {limit:g} s; the best plan so far is kept",
            )
        )

    def _best(self, kept: Candidate | None, found: Iterable[Candidate]) -> Candidate | None:
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

    def _candidate(self, plan: Plan, index: int, origin: Origin) -> Candidate:
        return candidate(self.here, self.settings, plan, goal_index=index, origin=origin)

    def _held(self, one: Candidate) -> Chosen:
        chosen = self._as_chosen(one, one.cost)
        return replace(chosen, arrived=True, violations=())

    def _helpless(self) -> Chosen:
        """Nothing leads to the goal: rest, and say so."""
        here, pad = self.here, self.settings.pad
        trims = () if pad is None else (pad,)
        lasting = [self.settings.step] * len(trims)
        rest = Plan(here.start, trims, durations=lasting, start_time=here.start_time)
        self.violations.append(
            Violation(
                guarantee=Guarantee.FEASIBILITY,
                reason=f"no plan leads from {here.start.tolist()} to the goal, in whatever time",
            )
        )
        nowhere = Candidate(
            plan=rest, cost=math.inf, goal_index=0, origin=Origin.SEARCHED, at_first=0.0
        )
        return self._as_chosen(nowhere, None)

    def _late(self) -> Candidate | None:
        """No plan arrives in time: the quickest there is, flagged; None if there is none."""
        here = self.here
        hurry = quickest(here)
        found: list[Candidate] = []
        for index, goal in enumerate(here.goals):
            plans = list(rejoining(hurry, self._planned(), goal, pad=None))
            for result in search_goal(
                hurry, goal, alternatives=0, time_limit=self.settings.time_limit
            ):
                plans += [plan_of(here, solution) for solution in result.solutions]
            found += [
                self._candidate(self._padded(plan), index, Origin.SEARCHED)
                for plan in plans
                if allowed(here, plan)
            ]
        if not found:
            return None
        best = min(found, key=lambda one: one.plan.duration)
        self.exhaustive = False
        return best

    def _flag_late(self, plan: Plan) -> None:
        limit = self.here.horizon.time or self.here.horizon.max_time
        if limit is not None and plan.duration > limit * (1.0 + EXACT):
            self.violations.append(
                Violation(
                    guarantee=Guarantee.HORIZON,
                    reason=f"no plan was found that takes at most {limit:g} s; the one applied "
                    f"takes {plan.duration:.6g} s",
                )
            )

    def _goal_within(self, pose: Array) -> int | None:
        for index, goal in enumerate(self.here.goals):
            if within(pose, goal):
                return index
        return None

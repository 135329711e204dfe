"""Plans of a step in free space, for trims that are switched at will: words."""

from __future__ import annotations

import math
from collections.abc import Iterator

from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.cutting import NOTHING
from maneuver_automaton.budget import Budget
from maneuver_automaton.costs import prices_switches
from maneuver_automaton.problem import Goal
from maneuver_automaton.receding_horizon.candidates import Candidate, allowed, bounded
from maneuver_automaton.receding_horizon.log import Decision, Guarantee, Origin
from maneuver_automaton.receding_horizon.mitigation import Mitigation
from maneuver_automaton.receding_horizon.reanchoring import quickest, rejoining
from maneuver_automaton.receding_horizon.shifting import rested
from maneuver_automaton.receding_horizon.situation import Situation
from maneuver_automaton.search.choose import search_goal
from maneuver_automaton.search.limits import closed_bound, sole_bound
from maneuver_automaton.search.result import SearchStatus, plan_of, tied
from maneuver_automaton.words.word import is_word_of

SECOND_OPINION = 0.02  # [s] for short words beside insertion
PACES = 5  # costlier plans, which may be cheaper at another pace


class InFreeSpace:
    """A `StepSearch`: exhaustive words, or insertion, whatever the library suits."""

    free_until = None
    knows_all = True
    improves = False

    def __init__(self, now: Situation) -> None:
        self.now = now
        self.here = now.here
        self.settings = now.settings

    def is_safe(self, plan: Plan) -> bool:
        """Whether a plan stays inside the bounds."""
        return allowed(self.here, plan)

    def cheaper(self, kept: Candidate | None) -> list[Candidate]:
        """The result of a search from here for each goal."""
        now, here = self.now, self.here
        found: list[Candidate] = []
        now.exhaustive = True
        alternatives = PACES if self.settings.retimed else 0
        for index, goal in enumerate(here.goals):
            same_goal = now.last is None or index == now.last.goal_index
            known = kept.plan if kept is not None and same_goal else None
            if now.budget.is_over and (kept is not None or found):
                now.exhaustive = False
                self._over_budget()
                break
            cost = kept.cost if kept is not None and same_goal else None
            if cost is not None and self._is_sole(cost, goal):
                continue
            results = search_goal(
                here,
                goal,
                alternatives=None if bounded(here) else alternatives,
                budget=now.budget,
                known=None if self.settings.continuous else known,
                known_cost=cost,
                ties=True,
                second_opinion=SECOND_OPINION,
                not_first=None if cost is None else self._driven(cost),
                seeds=0 if cost is not None and self._goes_on(alternatives) else None,
            )
            proven = any(one.exhaustive for one in results)
            decisive = not (self.settings.continuous or bounded(here))
            now.exhaustive = now.exhaustive and proven and decisive
            if any(one.status is SearchStatus.OUT_OF_BUDGET for one in results):
                self._over_budget()
            for result in results:
                for solution in result.solutions:
                    if known is not None and is_word_of(here.automaton, known, solution):
                        continue  # the plan that is kept was found again
                    plan = plan_of(here, solution)
                    if self.is_safe(plan):
                        found.append(now.candidate(plan, index, Origin.SEARCHED))
        return found

    def _is_sole(self, cost: float, goal: Goal) -> bool:
        """Whether a plan of this cost is the cheapest, and the only one that is so cheap."""
        searched = self.settings.continuous or bounded(self.here)
        return not searched and cost <= tied(sole_bound(self.here, goal))

    def _goes_on(self, alternatives: int) -> bool:
        """Whether insertion begins with the plan that is kept alone.

        It is the rest of what a search has found from several words, and other words lose to it. No
        theorem says so, but of 2832 steps with 1681 trims not one went on otherwise, and a step
        takes a third of the time; of the recorded loops a glider's alone costs more, by 2e-6.
        Insertion takes the other words where it has no solution.
        """
        now = self.now
        searched = not (self.settings.continuous or bounded(self.here) or alternatives)
        return searched and now.rounding and not now.changed

    def _driven(self, cost: float) -> int | None:
        """The trim that was driven since the last step, where that tells which words may win.

        Bellman's principle of optimality: where the last step has searched every word of up to S
        trims, no word W of fewer than S trims from here costs less than the rest of its plan,
        which has this `cost`; nor does one of S trims that begins with the trim driven since, for
        as long as one trim was driven alone. For with the part that was driven in front, W would
        have been a word of at most S trims from there, to the same goal, and cheaper than the plan
        found. Its cost is the sum, since switches cost nothing, and no time is fixed or limited.
        Where no other plan cost as much there, none does here.

        Source: Bellman (1957), *Dynamic Programming*, Sec. III.3.
        """
        now, here, last = self.now, self.here, self.now.last
        horizon = here.horizon
        limited = horizon.time is not None or horizon.max_time is not None
        if last is None or limited or prices_switches(here.cost) or horizon.max_trims is None:
            return None
        if not now.rounding or now.changed or not (last.exhaustive and last.is_sole):
            return None
        left = last.value - last.applied_cost
        if self.settings.continuous or bounded(here) or cost > tied(left):
            return None
        if not last.plan.trims or last.plan.durations[0] < last.applied - NOTHING:
            return None
        return here.automaton.index_of(last.plan.trims[0].name)

    def _over_budget(self) -> None:
        if all(one.guarantee is not Guarantee.BUDGET for one in self.now.violations):
            limit = self.settings.time_limit
            self.now.flag(
                Guarantee.BUDGET,
                f"the search was cut short after {limit:g} s; the best plan so far is kept",
            )

    def otherwise(self) -> Candidate | None:
        """No plan arrives in time: the quickest there is; None if there is none."""
        now, here = self.now, self.here
        hurry = quickest(here)
        found: list[Candidate] = []
        for index, goal in enumerate(here.goals):
            plans = list(rejoining(hurry, now.planned(), goal, pad=None))
            again = Budget.from_now(self.settings.time_limit)
            for result in search_goal(hurry, goal, alternatives=0, budget=again):
                plans += [plan_of(here, solution) for solution in result.solutions]
            found += [
                now.candidate(now.padded(plan), index, Origin.SEARCHED)
                for plan in plans
                if self.is_safe(plan)
            ]
        if not found:
            return None
        now.exhaustive = False
        return min(found, key=lambda one: one.plan.duration)

    def why_none(self) -> str:
        """Why there is no plan to the goal."""
        return f"no plan leads from {self.here.start.tolist()} to the goal, in whatever time"

    def fail_safe(self) -> Iterator[tuple[Plan, Decision]]:
        """Rest for a step."""
        plan = Plan(self.here.start, (), durations=[], start_time=self.here.start_time)
        pad = self.settings.pad
        yield (plan if pad is None else rested(plan, pad, self.settings.step)), Decision.STOPPED

    def mitigation(self) -> Mitigation:
        """Nothing is hit in free space."""
        plan, _ = next(self.fail_safe())
        return Mitigation(plan=plan, contact=math.inf, clearance=math.inf, reason="")

    def lower_bound(self) -> float:
        """No plan to any goal costs less."""
        return min(closed_bound(self.here, goal) for goal in self.here.goals)

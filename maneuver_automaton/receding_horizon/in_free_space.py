"""Plans of a step in free space, for trims that are switched at will: words."""

from __future__ import annotations

import math
from collections.abc import Iterator

from maneuver_automaton._interrupts import clock
from maneuver_automaton.automaton import Plan
from maneuver_automaton.receding_horizon.candidates import Candidate, allowed, bounded
from maneuver_automaton.receding_horizon.log import Deed, Guarantee, Origin
from maneuver_automaton.receding_horizon.mitigation import Mitigation
from maneuver_automaton.receding_horizon.reanchoring import quickest, rejoining
from maneuver_automaton.receding_horizon.shifting import rested
from maneuver_automaton.receding_horizon.situation import Situation
from maneuver_automaton.search.choose import search_goal
from maneuver_automaton.search.limits import closed_bound
from maneuver_automaton.search.result import SearchStatus, plan_of

SECOND_OPINION = 0.02  # [s] for short words beside insertion
PACES = 5  # dearer plans, which may be cheaper at another pace


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
            left = now.deadline - clock()
            same_goal = now.last is None or index == now.last.goal_index
            known = kept.plan if kept is not None and same_goal else None
            if left <= 0.0 and (kept is not None or found):
                now.exhaustive = False
                self._over_budget()
                break
            results = search_goal(
                here,
                goal,
                alternatives=None if bounded(here) else alternatives,
                time_limit=max(left, 1e-6),
                known=None if self.settings.retimed else known,
                ties=True,
                second_opinion=SECOND_OPINION,
            )
            proven = any(one.exhaustive for one in results)
            decisive = not (self.settings.retimed or bounded(here))
            now.exhaustive = now.exhaustive and proven and decisive
            if any(one.status is SearchStatus.OUT_OF_BUDGET for one in results):
                self._over_budget()
            for result in results:
                for solution in result.solutions:
                    plan = plan_of(here, solution)
                    if self.is_safe(plan):
                        found.append(now.candidate(plan, index, Origin.SEARCHED))
        return found

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
            for result in search_goal(
                hurry, goal, alternatives=0, time_limit=self.settings.time_limit
            ):
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

    def fail_safe(self) -> Iterator[tuple[Plan, Deed]]:
        """Rest for a step."""
        plan = Plan(self.here.start, (), durations=[], start_time=self.here.start_time)
        pad = self.settings.pad
        yield (plan if pad is None else rested(plan, pad, self.settings.step)), Deed.STOPPED

    def mitigation(self) -> Mitigation:
        """Nothing is hit in free space."""
        plan, _ = next(self.fail_safe())
        return Mitigation(plan=plan, contact=math.inf, clearance=math.inf, reason="")

    def lower_bound(self) -> float:
        """No plan to any goal costs less."""
        return min(closed_bound(self.here, goal) for goal in self.here.goals)

"""What a step decides: the rest of the last plan, or a cheaper one."""

from __future__ import annotations

import math
import time

from maneuver_automaton.automaton import Plan
from maneuver_automaton.receding_horizon.candidates import Candidate, allowed
from maneuver_automaton.receding_horizon.holding import holding
from maneuver_automaton.receding_horizon.log import Guarantee, Origin, Violation
from maneuver_automaton.receding_horizon.reanchoring import quickest, rejoining
from maneuver_automaton.receding_horizon.situation import Chosen, Situation
from maneuver_automaton.search.choose import search_goal
from maneuver_automaton.search.result import SearchStatus, plan_of

SECOND_OPINION = 0.02  # [s] for short words beside insertion
PACES = 5  # dearer plans, which may be cheaper at another pace


class Decision:
    """What a step decides where nothing is in the way."""

    def __init__(self, now: Situation) -> None:
        self.now = now
        self.settings = now.settings
        self.here = now.here

    def chosen(self) -> Chosen:
        """The plan to apply."""
        arrived = self.now.arrived()
        if arrived is not None:
            return arrived
        inside = self.now.goal_within(self.here.start) if self.settings.hold else None
        if inside is not None:
            held = holding(self.here, self.settings, inside)
            return self.now.resting(inside) if held is None else self.now.held(held)
        if self.now.last is None and self.settings.first is not None:
            return self.now.given(self.settings.first)
        kept = self._kept()
        searched = self._searched(None if kept is None else kept.plan)
        best = self.now.best(kept, searched) or self._late()
        if best is None:
            return self._helpless()
        self.now.flag_late(best.plan)
        return self.now.as_chosen(best, None if kept is None else kept.cost)

    def _kept(self) -> Candidate | None:
        """The cheapest rest of the last plan that is allowed; others only where it is a detour."""
        here, last, rest = self.here, self.now.last, self.now.rest
        candidates: list[Candidate] = []
        if last is None or rest is None:
            return None
        for k, (plan, origin) in enumerate(self.now.rests()):
            if allowed(here, plan):
                candidates.append(self.now.candidate(plan, last.goal_index, origin))
            same = [trim.name for trim in plan.trims] == [trim.name for trim in rest.trims]
            detour = not same or here.cost_of(plan) > last.value
            if k == 0 and origin is Origin.REANCHORED and not detour:
                break
        return min(candidates, key=lambda one: one.cost, default=None)

    def _searched(self, known: Plan | None) -> list[Candidate]:
        """What a search from here finds."""
        here = self.here
        found: list[Candidate] = []
        self.now.exhaustive = True
        bounded = any(getattr(here.bounds, name) is not None for name in ("x", "y", "z"))
        alternatives = None if bounded else PACES if self.settings.retimed else 0
        for index, goal in enumerate(here.goals):
            left = self.now.began + self.settings.time_limit - time.monotonic()
            to_known = known if self.now.last is None or index == self.now.last.goal_index else None
            if left <= 0.0 and (known is not None or found):
                self.now.exhaustive = False
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
            decisive = not (self.settings.retimed or bounded)
            self.now.exhaustive = self.now.exhaustive and proven and decisive
            if any(one.status is SearchStatus.OUT_OF_BUDGET for one in results):
                self._over_budget()
            for result in results:
                for solution in result.solutions:
                    plan = plan_of(here, solution)
                    if allowed(here, plan):
                        found.append(self.now.candidate(plan, index, Origin.SEARCHED))
        return found

    def _over_budget(self) -> None:
        if any(one.guarantee is Guarantee.BUDGET for one in self.now.violations):
            return
        limit = self.settings.time_limit
        self.now.violations.append(
            Violation(
                guarantee=Guarantee.BUDGET,
                reason=f"the search was cut short after {limit:g} s; the best plan so far is kept",
            )
        )

    def _helpless(self) -> Chosen:
        """Nothing leads to the goal: rest, and say so."""
        here, pad = self.here, self.settings.pad
        trims = () if pad is None else (pad,)
        lasting = [self.settings.step] * len(trims)
        rest = Plan(here.start, trims, durations=lasting, start_time=here.start_time)
        self.now.violations.append(
            Violation(
                guarantee=Guarantee.FEASIBILITY,
                reason=f"no plan leads from {here.start.tolist()} to the goal, in whatever time",
            )
        )
        nowhere = Candidate(
            plan=rest, cost=math.inf, goal_index=0, origin=Origin.SEARCHED, at_first=0.0
        )
        return self.now.as_chosen(nowhere, None)

    def _late(self) -> Candidate | None:
        """No plan arrives in time: the quickest there is, flagged; None if there is none."""
        here = self.here
        hurry = quickest(here)
        found: list[Candidate] = []
        for index, goal in enumerate(here.goals):
            plans = list(rejoining(hurry, self.now.planned(), goal, pad=None))
            for result in search_goal(
                hurry, goal, alternatives=0, time_limit=self.settings.time_limit
            ):
                plans += [plan_of(here, solution) for solution in result.solutions]
            found += [
                self.now.candidate(self.now.padded(plan), index, Origin.SEARCHED)
                for plan in plans
                if allowed(here, plan)
            ]
        if not found:
            return None
        best = min(found, key=lambda one: one.plan.duration)
        self.now.exhaustive = False
        return best

"""Plans of a step for trims that are switched at will: words, or their lattice among obstacles.

A plan to the goal is safe if all of it is proven collision-free and the vehicle can stay at its
end. Where there is none, the step goes towards the goal as far as a fail-safe trajectory follows,
waits or evades; where nothing is free, the motion whose first contact is latest is driven.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.cutting import NOTHING
from maneuver_automaton.budget import Budget
from maneuver_automaton.costs import prices_switches
from maneuver_automaton.planning.tracking import (
    LITTLE,
    Tracked,
    clearance_at,
    free_until,
    stands_free,
    track,
)
from maneuver_automaton.problem import Bounds, Problem
from maneuver_automaton.receding_horizon.candidates import StepPlan, bounded
from maneuver_automaton.receding_horizon.failsafe import FailSafe
from maneuver_automaton.receding_horizon.log import Decision, Guarantee, Origin
from maneuver_automaton.receding_horizon.rest_of_plan import moves_on, quickest, rejoining, rested
from maneuver_automaton.receding_horizon.situation import Situation
from maneuver_automaton.receding_horizon.step_search import LATE, StepSearch
from maneuver_automaton.refinement.improve import Patience
from maneuver_automaton.search.choose import search_goal
from maneuver_automaton.search.limits import busy_bound, outside, sole_bound
from maneuver_automaton.search.result import SearchStatus, plan_of, tied
from maneuver_automaton.words.word import is_word_of

SEARCHING = 0.6  # share of a step's budget after which no plan to the goal is searched
MOST_EXPANSIONS = 4_000  # of such a search, among moving obstacles
ANEW = Patience(attempts=8_000, passes=6)  # where there is no plan to go on from
MOMENT = 1e-9  # [s]
SECOND_OPINION = 0.02  # [s] for short words beside insertion
PACES = 5  # costlier plans, which may be cheaper at another pace


class InFreeSpace(StepSearch):
    """Exhaustive words, or insertion, whatever the library suits."""

    def is_free(self, plan: Plan) -> bool:
        """Nothing is hit in free space."""
        return True

    def may_end(self, plan: Plan) -> bool:
        """Nothing comes either."""
        return True

    def cheaper(self, kept: StepPlan | None) -> list[StepPlan]:
        """The result of a search from here for each goal."""
        now, here = self.now, self.here
        found: list[StepPlan] = []
        now.exhaustive = True
        alternatives, limited = PACES if self.settings.retimed else 0, bounded(here)
        searched = limited or self.settings.continuous
        for index, goal in enumerate(here.goals):
            same_goal = now.last is None or index == now.last.goal_index
            known = kept.plan if kept is not None and same_goal else None
            if now.budget.is_over and (kept is not None or found):
                now.exhaustive = False
                self._over_budget()
                break
            cost = kept.cost if kept is not None and same_goal else None
            sole = 0.0 if cost is None or searched else sole_bound(here, goal, now.off[index])
            if cost is not None and not searched and cost <= tied(sole):
                continue  # it is the cheapest, and the only one that is so cheap
            # Insertion begins with the plan that is kept alone, the rest of what a search has found
            # from several words: others lose to it. No theorem says so, but of 2832 steps with 1681
            # trims not one went on otherwise, and a step takes a third of the time; of the recorded
            # loops a glider's alone costs more, by 2e-6. Where it fails, others are taken.
            alone = cost is not None and not (searched or alternatives or now.changed)
            results = search_goal(
                here,
                goal,
                alternatives=None if limited else alternatives,
                budget=now.budget,
                known=None if self.settings.continuous else known,
                known_cost=cost,
                ties=True,
                second_opinion=SECOND_OPINION,
                not_first=None if cost is None or searched else self._driven(cost),
                seeds=0 if alone and now.rounding else None,
            )
            proven = False
            for result in results:
                proven = proven or result.exhaustive
                if result.status is SearchStatus.OUT_OF_BUDGET:
                    self._over_budget()
                for solution in result.solutions:
                    if known is not None and is_word_of(here.automaton, known, solution):
                        continue  # the plan that is kept was found again
                    plan = plan_of(here, solution)
                    if self.is_safe(plan):
                        found.append(now.candidate(plan, index, Origin.SEARCHED))
            now.exhaustive = now.exhaustive and proven and not searched
        return found

    def _driven(self, cost: float) -> int | None:
        """The trim that was driven since the last step, where that tells which words may win."""
        # Bellman's principle of optimality: where the last step has searched every word of up to S
        # trims, no word W of fewer than S trims from here costs less than the rest of its plan,
        # which has this `cost`; nor does one of S trims that begins with the trim driven since, for
        # as long as one trim was driven alone. For with the part that was driven in front, W would
        # have been a word of at most S trims from there, to the same goal, and cheaper than the
        # plan found. Its cost is the sum, since switches cost nothing, and no time is limited, or
        # a word that would have been too late there costs too much. Where no other plan cost as
        # much there, none does here.
        # Source: Bellman (1957), *Dynamic Programming*, Sec. III.3.
        now, here, last = self.now, self.here, self.now.last
        if last is None or here.horizon.max_time is not None or here.horizon.max_trims is None:
            return None
        if not now.rounding or now.changed or not (last.exhaustive and last.is_sole):
            return None
        if prices_switches(here.cost) or not tied(cost) < busy_bound(here, now.passed):
            return None
        if cost > tied(last.value - last.applied_cost):
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

    def otherwise(self) -> StepPlan | None:
        """No plan arrives in time: the quickest there is; None if there is none."""
        now, here = self.now, self.here
        hurry = quickest(here)
        found: list[StepPlan] = []
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


class AmongObstacles(StepSearch):
    """The lattice, proven by kernels."""

    improves = True

    def __init__(self, now: Situation) -> None:
        super().__init__(now)
        self.free_until = self.until

    def is_free(self, plan: Plan) -> bool:
        """Whether all of a plan is free."""
        return free_until(self.here, plan) >= plan.duration

    def may_end(self, plan: Plan) -> bool:
        """Whether a plan is free, and the vehicle may stand at its end or leave it safely.

        Without moving obstacles, the end of a free plan is free for ever.
        """
        if not self.is_free(plan):
            return False
        if not self.here.moves:
            return True
        arrival = plan.start_time + plan.duration
        left = max(self.stand, self.until - arrival)
        free = stands_free(self.here, plan.end, time=arrival, duration=left)
        if free >= left:
            return True
        if free < self.stand:
            return False
        if self.here.automaton.body_velocities.any(axis=1).all():
            return True  # without rest the end of the plan is the end
        return self.fail_safe_from(plan.end, arrival + self.stand).complete

    def leaving(self, piece: Plan) -> FailSafe | None:
        """A fail-safe trajectory from the end of a piece of plan that is free."""
        if not self.is_free(piece):
            return None
        return self.fail_safe_from(piece.end, piece.start_time + piece.duration)

    def cheaper(self, kept: StepPlan | None) -> list[StepPlan]:
        """The plan that a search from here finds, if it is safe."""
        known = None if kept is None or self.settings.continuous else kept.plan
        found = self._candidate(self._tracked(self.here, known))
        return [] if found is None else [found]

    def _tracked(
        self, problem: Problem, known: Plan | None = None, *, share: float = SEARCHING
    ) -> Tracked:
        moving = self.here.moves
        return track(
            problem,
            budget=self.now.budget.before((1.0 - share) * self.settings.time_limit),
            known=known,
            max_expansions=MOST_EXPANSIONS if moving else None,
            # a first plan decides on which side moving obstacles are passed
            patience=ANEW if moving and known is None else LITTLE,
        )

    def _candidate(self, found: Tracked) -> StepPlan | None:
        """The plan found; it is proven free, but among moving obstacles its end may not stay so."""
        if found.plan is None or found.goal_index is None:
            return None
        one = self.now.candidate(found.plan, found.goal_index, Origin.SEARCHED)
        return one if not self.here.moves or self.is_safe(one.plan) else None

    def otherwise(self) -> StepPlan | None:
        """No plan arrives in time: one that takes longer."""
        horizon = self.here.horizon
        if horizon.time is None and horizon.max_time is None:
            return None
        anyhow = replace(horizon, time=None, max_time=None)
        found = self._candidate(self._tracked(replace(self.here, horizon=anyhow), share=LATE))
        if found is None:
            return None
        padded = self.now.padded(found.plan)
        late = self.now.candidate(padded, found.goal_index, Origin.SEARCHED)
        return late if self.is_safe(padded) else None

    def why_none(self) -> str:
        """Why there is no plan to the goal."""
        ends = any(map(moves_on, self.unsafe))
        return (
            f"no safe plan leads to the goal from {self.here.start.round(3).tolist()} at "
            f"{self.here.start_time:.6g} s"
            f"{'; the goal does not stay free after arrival' if ends else ''}"
        )

    def fail_safe(self) -> Iterator[tuple[Plan, Decision]]:
        """Towards the goal as long as it is safe, then to wait or evade, then the last plan."""
        here, rest = self.here, self.now.rest
        yield from self.approaches()
        found = self.fail_safe_from(here.start, here.start_time)
        if found.complete:
            yield found.plan, _evading(found.plan)
        self.tried = [found.plan] if rest is None else [found.plan, rest]
        tail = None if rest is None else self.continued(rest, rest.duration)
        if tail is not None:  # a fail-safe trajectory of the last step goes on
            yield tail, _evading(tail)

    def ambitions(self) -> Iterator[Plan]:
        """Paths to the goal that may be followed; where nothing moves, the last one alone."""
        self.unsafe = [plan for plan in self.unsafe if moves_on(plan)]
        if self.here.moves:
            yield from super().ambitions()
        elif self.now.rest is not None and moves_on(self.now.rest):
            yield self.now.rest

    def heedless(self, static: Problem) -> Plan | None:
        """A plan to the goal of the problem without what moves in it."""
        return self._tracked(static, share=LATE).plan


def _evading(plan: Plan) -> Decision:
    """Fail-safe trajectories: to wait, or to make room."""
    waits = bool(plan.trims) and plan.trims[0].is_rest
    return Decision.STOPPED if waits else Decision.EVADED


def as_it_stands(here: Problem) -> tuple[Problem, str]:
    """The problem with limits that the vehicle's pose keeps, and the limit that it breaks.

    A vehicle that is closer to an obstacle than the margin keeps half of its clearance; one outside
    its bounds is not held by them.
    """
    at, broken = here.start_time, ""
    if not stands_free(here, here.start, time=at, duration=MOMENT) > 0.0:
        clearance = max(float(clearance_at(here, here.start[None], np.array([at]))[0]), 0.0)
        broken = f"the clearance is {clearance:.3g} m, need more than {here.margin:g} m"
        here = replace(here, margin=0.5 * min(clearance, here.margin))
    if outside(here.start, here.bounds):
        here = replace(here, bounds=Bounds())
    return here, broken

"""The search of a step: keep the rest of the last plan, find a cheaper one, or stay safe.

`StepSearch.decide` is the one sequence for every vehicle and every world. Where plans come from,
and what proves that they are free, is said by its kinds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.cutting import committed
from maneuver_automaton.budget import Budget
from maneuver_automaton.planning import plan as planned
from maneuver_automaton.planning.on_the_way import goal_around, what_is_missed
from maneuver_automaton.planning.tracking import free_until
from maneuver_automaton.problem import Goal, Horizon, Problem, moves
from maneuver_automaton.receding_horizon.candidates import StepPlan, allowed, holding, within
from maneuver_automaton.receding_horizon.failsafe import (
    FailSafe,
    Mitigation,
    looked_at,
    mitigate,
    search_fail_safe,
)
from maneuver_automaton.receding_horizon.log import Decision, Guarantee, Origin, first_part
from maneuver_automaton.receding_horizon.rest_of_plan import followed_by
from maneuver_automaton.receding_horizon.settings import EXACT
from maneuver_automaton.receding_horizon.situation import Situation

LEAST_AHEAD = 1e-9  # [s] that a fail-safe trajectory covers at least
LATE = 0.8  # share of a step's time after which no path to the goal is searched
SHARES = (1.0, 0.5, 0.25)  # of how far a path to the goal is followed before it is left
NEARLY = 0.98  # of the free part of a path, after which there is room to stand


class StepSearch:
    """One step: which plans lead to the goal, which are safe, and what is driven otherwise.

    All plans start with the committed part of the last one. A kind says what follows; those for
    free space need neither `leaving` nor `heedless`.
    """

    is_free: Callable[[Plan], bool]  # whether all of a plan is free
    may_end: Callable[[Plan], bool]  # and the vehicle may stay at its end, or leave it safely
    cheaper: Callable[[StepPlan | None], list[StepPlan]]  # safe ones, if some cost less than it
    otherwise: Callable[[], StepPlan | None]  # safe, where there is none: late, or searched longer
    why_none: Callable[[], str]  # why there is no plan to the goal
    fail_safe: Callable[[], Iterator[tuple[Plan, Decision]]]  # trajectories; the first is driven
    leaving: Callable[[Plan], FailSafe | None]  # fail-safe, from the end of a piece
    heedless: Callable[[Problem], Plan | None]  # a plan to its goal, of it without what moves

    improves = False  # whether it starts from the plan that is kept, so that any safe one will do
    finds_words = True  # of the library: of others no bound is known in closed form

    def __init__(self, now: Situation) -> None:
        self.now = now
        self.here = now.here
        self.settings = now.settings
        self.stand = max(now.settings.stand, now.settings.step)  # [s] that the end must stay free
        self.until = looked_at(now.here, now.settings)  # [s] of the world's clock
        # time [s] until which plans are proven collision-free; None if nothing can come
        self.free_until = self.until if now.here.moves else None
        self.unsafe: list[Plan] = []  # free plans that end where the vehicle cannot stay
        self.tried: list[Plan] = []  # motions that are not free for long enough
        self.reason = ""  # why a planner finds nothing

    def onward(self) -> Problem | None:
        """The problem that a search is asked; None if there is none."""
        return self.here

    def mitigation(self) -> Mitigation:
        """The motion that collides last, where none is safe."""
        return mitigate(self.here, step=self.settings.step, until=self.until, known=self.tried)

    def planned_anew(
        self, share: float = 1.0, *, improve: bool = True, then: Plan | None = None
    ) -> StepPlan | None:
        """The plan of a planner, from the end of the committed part on, in a share of the time.

        It leads to a goal, or to where a plan begins that leads on from there.
        """
        now, limit, problem = self.now, self.now.longest, self.onward()
        if problem is None:
            return None
        if then is not None:
            trim = then.trims[0].name if self.here.has_inertia else None
            problem = replace(problem, via=(), goals=(Goal(then.start, trim=trim),))
        search = replace(problem.search, improve=improve and problem.search.improve)
        if self.here.moves:  # a motion in one piece could not be left where something comes
            search = replace(search, polish=False)
        problem = replace(problem, search=search)
        result = planned(problem, time_limit=max(share * self.for_plans.left, 1e-3))
        if result.plan is None or result.goal_index is None:
            self.reason = f": {result.reason}"
            return None
        plan, index = now.whole(result.plan), result.goal_index
        if then is not None and now.last is not None:
            plan, index = followed_by(plan, then), now.last.goal_index
        if limit is not None and plan.duration > limit * (1.0 + EXACT):
            self.reason = ": it takes too long"
        elif (self.here.moves or self.here.via) and not self.is_safe(plan):
            self.reason = ": the goal does not stay free after arrival"
        else:
            return now.candidate(now.padded(plan), index, Origin.SEARCHED)
        return None

    @property
    def for_plans(self) -> Budget:
        """The budget to search a plan in: where something moves, a part is for a fail-safe one."""
        late = 1.0 - LATE if self.here.moves else 0.0
        return self.now.budget.before(late * self.settings.time_limit) if late else self.now.budget

    def on_the_way(self, kept: StepPlan | None) -> list[StepPlan]:
        """The plan of a planner, which alone knows what is passed on the way.

        The rest of the last plan is followed as long as it is driven as planned, and nothing moves;
        if it is lost, that after the next pose on the way.
        """
        followed = kept is not None and not (self.now.off_plan or self.now.changed)
        if followed and not self.here.moves:
            return []
        _, then = self.now.until_next()
        found = None
        if kept is None and then is not None:
            found = self.planned_anew(0.5, improve=False, then=then)
        if found is None:
            found = self.planned_anew(improve=kept is None)
        return [] if found is None else [found]

    # --- the decision ---

    def decide(self) -> StepPlan:
        """The plan to apply."""
        now = self.now
        there = self._there()
        if there is not None:
            return self._known_free(there)
        first = now.settings.first
        if now.last is None and first is not None:
            given = now.given(first)
            if not self.is_safe(given.plan):
                raise ValueError(
                    "receding horizon: first hits an obstacle, or ends where one comes; need a "
                    "plan that is free"
                )
            return self._known_free(given)
        kept = self._kept()
        gap = now.settings.gap
        proven = gap is not None and kept is not None and kept.cost - now.bound <= gap * kept.cost
        passes = bool(now.here.via)
        found = [] if proven else self.on_the_way(kept) if passes else self.cheaper(kept)
        if now.settings.pieces:
            better = now.between_trims(kept, found)
            found = [*found, *(one for one in better if self.is_safe(one.plan))]
        best = now.best(kept, found) or (None if passes else self.otherwise())
        if best is None:
            return self._without_plan()
        limit, lasting = now.longest, best.plan.duration
        if limit is not None and lasting > limit * (1.0 + EXACT):
            now.flag(
                Guarantee.HORIZON,
                f"no plan was found that takes at most {limit:g} s; the one applied takes "
                f"{lasting:.6g} s",
            )
        best.shifted_value = None if kept is None else kept.cost
        return self._known_free(best)

    def is_safe(self, plan: Plan) -> bool:
        """Whether a plan stays inside the bounds, is free, and can be followed by a free motion."""
        if not allowed(self.here, plan) or what_is_missed(self.here, plan):
            return False
        if self.may_end(plan):
            return True
        if self.here.moves and self.is_free(plan):
            self.unsafe.append(plan)
        return False

    def _known_free(self, chosen: StepPlan) -> StepPlan:
        """What is applied, with the time until which it is known to be free [s]."""
        until, plan = self.free_until, chosen.plan
        if until is not None and plan.trims and not plan.trims[-1].is_rest:
            until = min(until, plan.start_time + plan.duration)
        return chosen if until == chosen.free_until else replace(chosen, free_until=until)

    def _there(self) -> StepPlan | None:
        """At the goal, or within it if that is to be held: rest, if that is safe."""
        now, here = self.now, self.here
        if here.via:
            return None
        goals = here.goals if now.may_rest else ()
        index = next((n for n in range(len(goals)) if max(now.off[n]) <= EXACT), None)
        if index is None and now.settings.hold:
            index = next((n for n, goal in enumerate(goals) if within(here.start, goal)), None)
            held = None if index is None else holding(here, now.settings, index)
            if held is not None and self.is_safe(held.plan):
                return replace(held, shifted_value=held.cost, arrived=True)
        if index is None and now.last is not None:
            before = now.last.goal_index
            index = before if within(here.start, here.goals[before]) and now.is_over else None
        if index is None:
            return None
        there = now.resting(index)
        return there if self.is_safe(there.plan) else None

    def _kept(self) -> StepPlan | None:
        """The first safe rest of the last plan that is no detour; else the cheapest safe one."""
        now, last, rest = self.now, self.now.last, self.now.rest
        if last is None or rest is None or (now.here.moves and not last.decision.leads):
            return None
        safe: list[StepPlan] = []
        for plan, origin in now.rests():
            if not self.is_safe(plan):
                continue
            one = now.candidate(plan, last.goal_index, origin)
            same = [trim.name for trim in plan.trims] == [trim.name for trim in rest.trims]
            cost = one.cost if one.plan is plan else now.here.cost_of(plan)
            if self.improves or (same and cost <= last.value):
                return one
            safe.append(one)
        near = within(rest.end, now.here.goals[last.goal_index])
        if near and not (safe and not now.here.has_inertia) and self.is_safe(rest):
            return now.candidate(rest, last.goal_index, Origin.SHIFTED)
        return min(safe, key=lambda one: one.cost, default=None)

    # --- where no safe plan leads to the goal from here, now ---

    def _without_plan(self) -> StepPlan:
        now = self.now
        if not now.here.moves or (now.last is not None and now.last.decision.leads):
            said = f"no plan leads through what is on the way{self.reason}"
            now.flag(Guarantee.FEASIBILITY, said if now.here.via else self.why_none())
        for plan, decision in self.fail_safe():
            return self._known_free(self._leading_nowhere(plan, decision))
        least = self.mitigation()
        now.flag(Guarantee.SAFETY, least.reason)
        harmful = self._leading_nowhere(least.plan, Decision.MITIGATED)
        return replace(harmful, free_until=least.contact)

    def _leading_nowhere(self, plan: Plan, decision: Decision) -> StepPlan:
        last = self.now.last
        return StepPlan(
            plan=plan,
            cost=math.inf,
            goal_index=0 if last is None else last.goal_index,
            origin=Origin.SHIFTED if plan is self.now.rest else Origin.SEARCHED,
            decision=decision,
        )

    def approaches(self) -> Iterator[tuple[Plan, Decision]]:
        """Beginnings of paths to the goal, each with a fail-safe trajectory after it."""
        for plan in self.ambitions():
            # what stands still leaves no reason to go on in steps
            reach = self.settings.step if self.here.moves else NEARLY * free_until(self.here, plan)
            for share in SHARES:
                towards = self.continued(plan, share * reach)
                if towards is not None:
                    yield towards, Decision.APPROACHED

    def ambitions(self) -> Iterator[Plan]:
        """Paths to the goal that may be followed for a moment, or as far as they are free."""
        now, onward = self.now, self.onward()
        yield from self.unsafe
        if now.last is not None and now.last.decision.leads and now.rest is not None:
            yield now.rest
        if onward is None:
            return
        static = tuple(one for one in self.here.obstacles if not moves(one))
        anyhow = Horizon(max_trims=onward.horizon.max_trims, min_coast=onward.horizon.min_coast)
        onward = replace(onward, obstacles=static, horizon=anyhow)
        if onward.via:  # what is to be passed next comes before the goal
            next_ones = onward.via[:1] if onward.order == "given" else onward.via
            onward = replace(onward, via=(), goals=tuple(map(goal_around, next_ones)))
        plan = self.heedless(onward)
        if plan is not None:
            yield plan

    def continued(self, plan: Plan, after: float) -> Plan | None:
        """The first seconds of a plan, then a fail-safe trajectory; None if either is not free.

        A maneuver that is under way then is driven to its end.
        """
        piece = first_part(plan, after + committed(plan, after))
        then = self.leaving(piece)
        return followed_by(piece, then.plan) if then is not None and then.complete else None

    def fail_safe_from(self, pose: Array, time: float, trim: str | None = None) -> FailSafe:
        """A motion from a pose and a time that is free for as long as is looked ahead."""
        there = replace(self.here, start=pose, start_time=time)
        if trim is not None:
            there = replace(there, start_trim=trim, start_state=None)
        until = max(self.until, time + LEAST_AHEAD)
        return search_fail_safe(there, until=until, budget=self.now.budget)

"""The decision of a step: the rest of the last plan, a cheaper one, or a fail-safe trajectory.

This is the one sequence for every vehicle and every world. A `StepSearch` says where plans come
from, and whether one is safe.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Protocol

from maneuver_automaton.automaton import Plan
from maneuver_automaton.receding_horizon.candidates import Candidate
from maneuver_automaton.receding_horizon.holding import holding
from maneuver_automaton.receding_horizon.log import Decision, Guarantee, Origin
from maneuver_automaton.receding_horizon.mitigation import Mitigation
from maneuver_automaton.receding_horizon.situation import Chosen, Situation


class StepSearch(Protocol):
    """The source of the plans of a step. All start with the committed part of the last one."""

    @property
    def free_until(self) -> float | None:
        """Time [s] until which plans are proven collision-free; None without obstacles."""

    @property
    def knows_all(self) -> bool:
        """Whether there is no plan, in whatever time, where none is found."""

    @property
    def improves(self) -> bool:
        """Whether it starts from the plan that is kept, so that any safe one will do."""

    def is_safe(self, plan: Plan) -> bool:
        """Whether a plan keeps to the bounds, is collision-free, and may end where it does."""

    def cheaper(self, kept: Candidate | None) -> list[Candidate]:
        """Safe plans, which may cost less than the one that is kept."""

    def otherwise(self) -> Candidate | None:
        """A safe plan where none is kept and none was found: late, or from a longer search."""

    def why_none(self) -> str:
        """Why there is no plan to the goal."""

    def fail_safe(self) -> Iterator[tuple[Plan, Decision]]:
        """Fail-safe trajectories with their decisions; the first one is driven."""

    def mitigation(self) -> Mitigation:
        """The motion that collides last, where none is safe."""

    def lower_bound(self) -> float:
        """Lower bound of the cost of all plans to any goal."""


def decide(now: Situation, search: StepSearch) -> Chosen:
    """The plan to apply."""
    there = _there(now, search)
    if there is not None:
        return _known_free(there, search)
    first = now.settings.first
    if now.last is None and first is not None:
        chosen = now.given(first)
        if not search.is_safe(chosen.plan):
            raise ValueError(
                "receding horizon: first hits an obstacle, or ends where one comes; need a plan "
                "that is free"
            )
        return _known_free(chosen, search)
    kept = _kept(now, search)
    found = [] if now.is_near_optimal(kept) else search.cheaper(kept)
    if now.settings.pieces:
        better = now.between_trims(kept, found)
        found = [*found, *(one for one in better if search.is_safe(one.plan))]
    best = now.best(kept, found) or search.otherwise()
    if best is None:
        return _without_plan(now, search)
    now.flag_late(best.plan)
    shifted = None if kept is None else kept.cost
    return _known_free(now.as_chosen(best, shifted), search)


def _known_free(chosen: Chosen, search: StepSearch) -> Chosen:
    """What is applied, with the time until which it is known to be free [s].

    A plan that ends in motion was looked at to its end alone.
    """
    until, plan = search.free_until, chosen.plan
    if until is not None and plan.trims and not plan.trims[-1].is_rest:
        until = min(until, plan.start_time + plan.duration)
    return chosen if until == chosen.free_until else replace(chosen, free_until=until)


def _there(now: Situation, search: StepSearch) -> Chosen | None:
    """At the goal, or within it if that is to be held: rest, if that is safe."""
    index = now.exactly_at()
    inside = now.goal_within(now.here.start) if now.settings.hold and now.may_rest else None
    if index is None and inside is not None:
        held = holding(now.here, now.settings, inside)
        if held is not None and search.is_safe(held.plan):
            return replace(now.as_chosen(held, held.cost), arrived=True)
        index = inside
    index = now.ended_within() if index is None else index
    if index is None:
        return None
    there = now.resting(index)
    return there if search.is_safe(there.plan) else None


def _kept(now: Situation, search: StepSearch) -> Candidate | None:
    """The first safe rest of the last plan that is no detour; else the cheapest that is safe.

    As it is, it may end within the goal's tolerance: that will do where no other is safe, and with
    inertia before a detour.
    """
    last = now.last
    if last is None or (now.here.moves and not last.decision.leads):
        return None
    safe: list[Candidate] = []
    for plan, origin in now.rests():
        if not search.is_safe(plan):
            continue
        safe.append(now.candidate(plan, last.goal_index, origin))
        if search.improves or not now.is_detour(plan):
            return safe[-1]
    rest = now.rest_within() if not (safe and now.settings.at_will) else None
    if rest is not None and search.is_safe(rest):
        return now.candidate(rest, last.goal_index, Origin.SHIFTED)
    return min(safe, key=lambda one: one.cost, default=None)


def _without_plan(now: Situation, search: StepSearch) -> Chosen:
    """No safe plan leads to the goal from here, now."""
    if not now.here.moves or (now.last is not None and now.last.decision.leads):
        now.flag(Guarantee.FEASIBILITY, search.why_none())
    for plan, decision in search.fail_safe():
        return _known_free(_leading_nowhere(now, plan, decision, None), search)
    least = search.mitigation()
    now.flag(Guarantee.SAFETY, least.reason)
    return _leading_nowhere(now, least.plan, Decision.MITIGATED, least.contact)


def _leading_nowhere(
    now: Situation, plan: Plan, decision: Decision, free_until: float | None
) -> Chosen:
    index = 0 if now.last is None else now.last.goal_index
    origin = Origin.SHIFTED if plan is now.rest else Origin.SEARCHED
    one = Candidate(plan=plan, cost=math.inf, goal_index=index, origin=origin)
    return replace(now.as_chosen(one, None), decision=decision, free_until=free_until)

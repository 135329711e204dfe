"""What a step decides where something is in the way: nothing is driven without a way out.

A plan to the goal is applied if all of it is free and the vehicle can stay at its end. Where there
is none, the step goes towards the goal as far as a motion follows that stays free, waits or evades;
where nothing is free, it does the least harm.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from maneuver_automaton.automaton import Plan
from maneuver_automaton.planning.tracking import Tracked, clearance_at, stands_free, track
from maneuver_automaton.problem import Bounds, Horizon, Problem, moves
from maneuver_automaton.receding_horizon.candidates import Candidate, allowed
from maneuver_automaton.receding_horizon.harm import least_harmful
from maneuver_automaton.receding_horizon.holding import holding
from maneuver_automaton.receding_horizon.log import Deed, Guarantee, Origin, Step, Violation
from maneuver_automaton.receding_horizon.outlook import Outlook, outlook
from maneuver_automaton.receding_horizon.settings import Settings
from maneuver_automaton.receding_horizon.situation import Chosen, Situation
from maneuver_automaton.search.inside import outside

SEARCHING = 0.6  # share of a step's budget after which no plan to the goal is searched
LATE = 0.8  # after which no way to the goal is; the rest is for a way out
MOST_EXPANSIONS = 4_000  # of such a search, where something moves
MOMENT = 1e-9  # [s]
SHARES = (1.0, 0.5, 0.25)  # of a step that a way is gone towards the goal before it is left


class AmongObstacles:
    """One step under way."""

    def __init__(self, now: Situation, outlook: Outlook) -> None:
        self.now = now
        self.here = now.here
        self.settings = now.settings
        self.outlook = outlook
        self.unsafe: list[Plan] = []  # free plans that end where the vehicle cannot stay

    def chosen(self) -> Chosen:
        """The plan to apply."""
        now = self.now
        there = self._there()
        if there is not None:
            said = tuple(now.violations)
            return replace(there, violations=said, free_until=self.outlook.until)
        if now.last is None and self.settings.first is not None:
            return self._given(self.settings.first)
        kept = self._kept()
        best = now.best(kept, self._searched(kept)) or self._late()
        if best is None:
            return self._without_plan()
        now.flag_late(best.plan)
        shifted = None if kept is None else kept.cost
        return replace(now.as_chosen(best, shifted), free_until=self.outlook.until)

    def _there(self) -> Chosen | None:
        """At the goal, or within it if that is to be held: rest, if that is safe."""
        now, here = self.now, self.here
        arrived = now.arrived()
        inside = now.goal_within(here.start) if self.settings.hold else None
        if arrived is None and inside is None:
            return None
        if arrived is None and inside is not None:
            held = holding(here, self.settings, inside)
            if held is not None and self.outlook.is_safe(held.plan):
                return now.held(held)
            arrived = now.resting(inside)
        assert arrived is not None
        return arrived if self.outlook.is_safe(arrived.plan) else None

    def _given(self, first: Plan) -> Chosen:
        given = self.now.given(first)
        if not self.outlook.is_safe(given.plan):
            raise ValueError(
                "receding horizon: first hits an obstacle, or ends where one comes; need a plan "
                "that is free"
            )
        return replace(given, free_until=self.outlook.until)

    def _kept(self) -> Candidate | None:
        """The first rest of the last plan that is safe."""
        last = self.now.last
        if last is None or not last.deed.leads:
            return None
        for plan, origin in self.now.rests():
            if allowed(self.here, plan) and self._is_safe(plan):
                return self.now.candidate(plan, last.goal_index, origin)
        return None

    def _searched(self, kept: Candidate | None) -> list[Candidate]:
        """The plan that a search from here finds, if it is safe."""
        known = None if kept is None or self.settings.retimed else kept.plan
        found = self._candidate(self._tracked(self.here, known))
        return [] if found is None else [found]

    def _tracked(
        self, problem: Problem, known: Plan | None = None, *, share: float = SEARCHING
    ) -> Tracked:
        left = self.now.began + share * self.settings.time_limit - time.monotonic()
        most = MOST_EXPANSIONS if self.here.moves else None
        return track(problem, time_limit=max(left, 1e-6), known=known, max_expansions=most)

    def _candidate(self, found: Tracked) -> Candidate | None:
        """What was found; it is proven free, but where something moves its end may not stay so."""
        if found.plan is None or found.goal_index is None:
            return None
        one = self.now.candidate(found.plan, found.goal_index, Origin.SEARCHED)
        return one if not self.here.moves or self._is_safe(one.plan) else None

    def _late(self) -> Candidate | None:
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
        return late if self._is_safe(padded) else None

    def _is_safe(self, plan: Plan) -> bool:
        if self.outlook.is_safe(plan):
            return True
        if self.outlook.is_free(plan):
            self.unsafe.append(plan)
        return False

    def _without_plan(self) -> Chosen:
        """No safe plan leads to the goal from here, now."""
        now, here = self.now, self.here
        if not here.moves or (now.last is not None and now.last.deed.leads):
            end = "; the goal does not stay free after arrival" if self.unsafe else ""
            now.violations.append(
                Violation(
                    guarantee=Guarantee.FEASIBILITY,
                    reason=f"no safe plan leads to the goal from {here.start.round(3).tolist()} at "
                    f"{here.start_time:.6g} s{end}",
                )
            )
        for plan in self._ambitions() if here.moves else ():
            for share in SHARES:
                towards = self.outlook.continued(plan, share * self.settings.step)
                if towards is not None:
                    return self._leading_nowhere(towards, Deed.APPROACHED, self.outlook.until)
        out = self.outlook.way_out(here.start, here.start_time)
        if out.complete:
            return self._evading(out.plan)
        if now.rest is None:
            return self._harmful((out.plan,))
        tail = self.outlook.continued(now.rest, now.rest.duration)  # a way out a step ago
        return self._harmful((out.plan, now.rest)) if tail is None else self._evading(tail)

    def _evading(self, plan: Plan) -> Chosen:
        """To wait, or to go out of the way."""
        waits = bool(plan.trims) and plan.trims[0].is_rest
        return self._leading_nowhere(
            plan, Deed.STOPPED if waits else Deed.EVADED, self.outlook.until
        )

    def _ambitions(self) -> Iterator[Plan]:
        """Ways to the goal that may be followed for a moment."""
        now, here = self.now, self.here
        yield from self.unsafe
        if now.last is not None and now.last.deed.leads and now.rest is not None:
            yield now.rest
        still = tuple(one for one in here.obstacles if not moves(one))
        anyhow = Horizon(max_trims=here.horizon.max_trims, min_coast=here.horizon.min_coast)
        found = self._tracked(replace(here, obstacles=still, horizon=anyhow), share=LATE)
        if found.plan is not None:
            yield found.plan

    def _harmful(self, known: tuple[Plan, ...]) -> Chosen:
        now, here = self.now, self.here
        until = self.outlook.until
        least = least_harmful(here, step=self.settings.step, until=until, known=known)
        said = (
            f"contact is predicted at {least.contact:.6g} s"
            if least.contact < until
            else f"the clearance is predicted to fall to {least.clearance:.3g} m"
        )
        now.violations.append(
            Violation(guarantee=Guarantee.SAFETY, reason=f"no motion is free until {until:.6g} s; "
                      f"{said}")
        )  # fmt: skip
        return self._leading_nowhere(least.plan, Deed.HARMFUL, least.contact)

    def _leading_nowhere(self, plan: Plan, deed: Deed, free_until: float) -> Chosen:
        index = 0 if self.now.last is None else self.now.last.goal_index
        one = Candidate(
            plan=plan, cost=math.inf, goal_index=index, origin=Origin.SEARCHED, at_first=0.0
        )
        self.now.exhaustive = False
        return replace(self.now.as_chosen(one, None), deed=deed, free_until=free_until)


def decide_among_obstacles(
    settings: Settings, here: Problem, last: Step | None, passed: float, began: float
) -> Chosen:
    """What to do from a state, at a time, among obstacles as they are predicted now.

    A vehicle that is closer to something than the margin keeps half of what it has; one outside its
    bounds is not held by them.
    """
    flagged: list[Violation] = []
    at = here.start_time
    if not stands_free(here, here.start, time=at, duration=MOMENT) > 0.0:
        gap = max(float(clearance_at(here, here.start[None], np.array([at]))[0]), 0.0)
        flagged.append(
            Violation(
                guarantee=Guarantee.SAFETY,
                reason=f"the clearance is {gap:.3g} m, need more than {here.margin:g} m",
            )
        )
        here = replace(here, margin=0.5 * min(gap, here.margin))
    if outside(here.start, here.bounds):
        here = replace(here, bounds=Bounds())
    now = Situation(settings, here, last, passed, began)
    now.violations += flagged
    ahead = outlook(here, settings, deadline=began + settings.time_limit)
    return AmongObstacles(now, ahead).chosen()

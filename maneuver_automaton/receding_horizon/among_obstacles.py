"""Plans of a step among obstacles, for trims that are switched at will: the lattice.

A plan to the goal is safe if all of it is proven collision-free and the vehicle can stay at its
end. Where there is none, the step goes towards the goal as far as a fail-safe trajectory follows,
waits or evades; where nothing is free, the motion whose first contact is latest is driven.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from maneuver_automaton.automaton import Plan
from maneuver_automaton.planning.tracking import (
    LITTLE,
    Tracked,
    clearance_at,
    free_until,
    stands_free,
    track,
)
from maneuver_automaton.problem import Bounds, Horizon, Problem, moves
from maneuver_automaton.receding_horizon.candidates import Candidate, allowed
from maneuver_automaton.receding_horizon.failsafe import predicted
from maneuver_automaton.receding_horizon.log import Decision, Origin
from maneuver_automaton.receding_horizon.mitigation import Mitigation, mitigate
from maneuver_automaton.receding_horizon.shifting import moves_on
from maneuver_automaton.receding_horizon.situation import Situation
from maneuver_automaton.refinement.improve import Patience
from maneuver_automaton.search.limits import closed_bound, outside

SEARCHING = 0.6  # share of a step's budget after which no plan to the goal is searched
LATE = 0.8  # after which no path to the goal is; the rest is for a fail-safe trajectory
MOST_EXPANSIONS = 4_000  # of such a search, among moving obstacles
ANEW = Patience(attempts=8_000, passes=6)  # where there is no plan to go on from
MOMENT = 1e-9  # [s]
NEARLY = 0.98  # of the free part of a path, after which there is room to stand
SHARES = (1.0, 0.5, 0.25)  # of how far a path to the goal is followed before it is left


class AmongObstacles:
    """A `StepSearch`: the lattice, proven by kernels."""

    knows_all = False
    improves = True

    def __init__(self, now: Situation) -> None:
        self.now = now
        self.here = now.here
        self.settings = now.settings
        self.predicted = predicted(now.here, now.settings, budget=now.budget)
        self.unsafe: list[Plan] = []  # free plans that end where the vehicle cannot stay
        self.tried: tuple[Plan, ...] = ()  # motions that are not free for long enough

    @property
    def free_until(self) -> float:
        """Time [s] until which plans are proven collision-free."""
        return self.predicted.until

    def is_safe(self, plan: Plan) -> bool:
        """Whether a plan stays inside the bounds, is free, and can be followed by a free motion."""
        if not allowed(self.here, plan):
            return False
        if self.predicted.is_safe(plan):
            return True
        if moves_on(plan) and self.predicted.is_free(plan):
            self.unsafe.append(plan)
        return False

    def cheaper(self, kept: Candidate | None) -> list[Candidate]:
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

    def _candidate(self, found: Tracked) -> Candidate | None:
        """The plan found; it is proven free, but among moving obstacles its end may not stay so."""
        if found.plan is None or found.goal_index is None:
            return None
        one = self.now.candidate(found.plan, found.goal_index, Origin.SEARCHED)
        return one if not self.here.moves or self.is_safe(one.plan) else None

    def otherwise(self) -> Candidate | None:
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
        end = "; the goal does not stay free after arrival" if self.unsafe else ""
        return (
            f"no safe plan leads to the goal from {self.here.start.round(3).tolist()} at "
            f"{self.here.start_time:.6g} s{end}"
        )

    def fail_safe(self) -> Iterator[tuple[Plan, Decision]]:
        """Towards the goal as long as it is safe, then to wait or evade, then the last plan."""
        here, rest = self.here, self.now.rest
        for plan in self._ambitions():
            # what stands still leaves no reason to go on in steps
            reach = self.settings.step if here.moves else NEARLY * free_until(here, plan)
            for share in SHARES:
                towards = self.predicted.continued(plan, share * reach)
                if towards is not None:
                    yield towards, Decision.APPROACHED
        found = self.predicted.fail_safe(here.start, here.start_time)
        if found.complete:
            yield found.plan, _evading(found.plan)
        self.tried = (found.plan,) if rest is None else (found.plan, rest)
        if rest is not None:  # a fail-safe trajectory of the last step
            tail = self.predicted.continued(rest, rest.duration)
            if tail is not None:
                yield tail, _evading(tail)

    def _ambitions(self) -> Iterator[Plan]:
        """Paths to the goal that may be followed for a moment, or as far as they are free."""
        now, here = self.now, self.here
        yield from self.unsafe
        if not here.moves:
            yield from [now.rest] if now.rest is not None and moves_on(now.rest) else []
            return
        if now.last is not None and now.last.decision.leads and now.rest is not None:
            yield now.rest
        static = tuple(one for one in here.obstacles if not moves(one))
        anyhow = Horizon(max_trims=here.horizon.max_trims, min_coast=here.horizon.min_coast)
        found = self._tracked(replace(here, obstacles=static, horizon=anyhow), share=LATE)
        if found.plan is not None:
            yield found.plan

    def mitigation(self) -> Mitigation:
        """The motion that collides last, where none is safe."""
        return mitigate(
            self.here, step=self.settings.step, until=self.predicted.until, known=self.tried
        )

    def lower_bound(self) -> float:
        """No plan to any goal costs less."""
        return min(closed_bound(self.here, goal) for goal in self.here.goals)


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

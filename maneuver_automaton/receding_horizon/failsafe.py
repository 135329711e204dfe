"""Safe plans: collision-free, and followed by a rest or by a fail-safe trajectory."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision import AnyObstacle, Obstacle
from maneuver_automaton.planning.tracking import free_until, stands_free
from maneuver_automaton.problem import Problem
from maneuver_automaton.receding_horizon.failsafe_search import FailSafe, search_fail_safe
from maneuver_automaton.receding_horizon.log import first_part
from maneuver_automaton.receding_horizon.settings import Settings
from maneuver_automaton.receding_horizon.shifting import followed_by

LEAST_AHEAD = 1e-9  # [s] that a fail-safe trajectory covers at least


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Prediction:
    """The obstacles as they are predicted now, and how far ahead that is looked at."""

    here: Problem
    stand: float  # [s] that the goal must stay free after arrival
    until: float  # [s] of the world's clock
    budget: Budget  # of the step

    def is_free(self, plan: Plan) -> bool:
        """Whether all of a plan is free."""
        return free_until(self.here, plan) >= plan.duration

    def is_safe(self, plan: Plan) -> bool:
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
        return self.fail_safe(plan.end, arrival + self.stand).complete

    def fail_safe(self, pose: Array, time: float) -> FailSafe:
        """A motion from a pose and a time that is free for as long as is looked ahead."""
        there = replace(self.here, start=pose, start_time=time)
        return search_fail_safe(
            there, until=max(self.until, time + LEAST_AHEAD), budget=self.budget
        )

    def continued(self, plan: Plan, after: float) -> Plan | None:
        """The first seconds of a plan, then a fail-safe trajectory; None if either is not free."""
        piece = first_part(plan, after)
        if not self.is_free(piece):
            return None
        then = self.fail_safe(piece.end, piece.start_time + piece.duration)
        return followed_by(piece, then.plan) if then.complete else None


def predicted(here: Problem, settings: Settings, *, budget: Budget) -> Prediction:
    """The obstacles from here on, and how far they are looked at."""
    return Prediction(
        here=here,
        stand=max(settings.stand, settings.step),
        until=looked_at(here, settings),
        budget=budget,
    )


def looked_at(here: Problem, settings: Settings) -> float:
    """Time [s] that is looked at: as far as is asked for, or until all obstacles are static."""
    until = here.start_time + settings.look_ahead
    if here.moves and settings.pad is not None:
        quiet = here.quiet_after
        comes = (isinstance(one, Obstacle) and one.presence[0] == quiet for one in here.obstacles)
        until = min(until, quiet + settings.step if any(comes) else quiet)  # what comes last counts
    return max(until, here.start_time + settings.step)


def settled(problem: Problem) -> Problem:
    """The problem without what is gone by its start, and with what has come to rest as it stands.

    A search is quicker among static obstacles.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Disc, Motion, Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1.0, 0.0), "spin": (0.0, 1.0)})
    >>> passing = Obstacle(Disc(1.0), motion=Motion([0, 4], [[2, -4, 0], [2, 4, 0]]))
    >>> problem = Problem(robot, [0, 0, 0], [9, 0, 0], obstacles=passing)
    >>> settled(problem).moves, settled(replace(problem, start_time=4.0)).moves
    (True, False)
    """
    now, kinds = problem.start_time, []
    for one in problem.obstacles:
        kind = _KEPT
        if isinstance(one, Obstacle) and one.motion is not None:
            first, last = one.presence
            if last < now:
                kind = _GONE
            elif one.motion.time[-1] <= now and first <= now and last == math.inf:
                kind = _STANDS
        kinds.append(kind)
    if not any(kinds):
        return problem
    return replace(problem, obstacles=_as_they_stand(problem.obstacles, tuple(kinds)))


_KEPT, _STANDS, _GONE = range(3)


@functools.lru_cache(maxsize=8)
def _as_they_stand(
    obstacles: tuple[AnyObstacle, ...], kinds: tuple[int, ...]
) -> tuple[AnyObstacle, ...]:
    """The same values at every call, so that what was prepared for them serves again."""
    found: list[AnyObstacle] = []
    for one, kind in zip(obstacles, kinds, strict=True):
        if kind == _STANDS and isinstance(one, Obstacle):
            found.append(Obstacle(one.at(math.inf), height=one.height, name=one.name))
        elif kind == _KEPT:
            found.append(one)
    return tuple(found)

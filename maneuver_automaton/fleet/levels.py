"""Between which heights a vehicle of a fleet is over time, so that one may fly above another."""

from __future__ import annotations

import functools
import itertools
import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, freeze
from maneuver_automaton.automaton import Plan
from maneuver_automaton.problem import Problem
from maneuver_automaton.search.lattice_library import altitude_ranges

STAGES = 8  # into which a climb is cut at most, about, to be an obstacle of one height in each
THIN = 1e-6  # [m] by which what is flat stands out, either way


class Stage(NamedTuple):
    """From when until when [s] a body keeps between two heights [m]."""

    begin: float
    end: float
    low: float
    high: float

    def above(self, low: float, high: float) -> float:
        """How far [m] it is above or below what stands between two heights; 0 if beside it.

        Examples
        --------
        >>> Stage(0.0, 9.0, 20.0, 23.0).above(0.0, 4.0)
        16.0
        """
        return max(self.low - high, low - self.high, 0.0)


ALWAYS = (Stage(-math.inf, math.inf, -math.inf, math.inf),)  # of what has no height of its own


@dataclass(frozen=True, eq=False)
class Levels:
    """The altitude of a vehicle in time, linear between, and how far its body reaches about it.

    Examples
    --------
    >>> climb = Levels([0.0, 2.0], [10.0, 18.0], (-1.0, 2.0))
    >>> [(one.begin, round(one.low, 3), round(one.high, 3)) for one in climb.stages]
    [(-inf, 9.0, 14.667), (0.6666666666666666, 11.667, 17.333), (1.3333333333333333, 14.333, 20.0)]
    """

    time: Array  # (n,) [s]
    altitude: Array  # (n,) [m], held before and after
    body: tuple[float, float]  # [m] lowest and highest point about it
    swing: Array = field(default_factory=lambda: np.zeros(0))  # (n - 1,) [m] off that line at most

    if TYPE_CHECKING:

        def __init__(
            self,
            time: ArrayLike,
            altitude: ArrayLike,
            body: tuple[float, float],
            swing: ArrayLike = (),
        ) -> None: ...

    def __post_init__(self) -> None:
        freeze(self, "time")
        freeze(self, "altitude")
        if not np.size(self.swing):
            object.__setattr__(self, "swing", np.zeros(self.time.size - 1))
        freeze(self, "swing")

    @classmethod
    def of_plan(cls, plan: Plan, body: tuple[float, float]) -> Levels:
        """Those of a vehicle that drives a plan in space; a body from low to high about its z [m].

        Raises
        ------
        ValueError
            If a maneuver has no course.

        Examples
        --------
        >>> from maneuver_automaton.primitives import Trim
        >>> climb = Trim(name="climb", body_velocity=[1.0, 0.0, 0.0, 2.0], control=[0.0])
        >>> plan = Plan([0.0, 0.0, 0.0, 5.0], (climb,), durations=[3.0])
        >>> Levels.of_plan(plan, (0.0, 1.0)).altitude.tolist()
        [5.0, 11.0]
        """
        times, _, _ = plan.coasts
        of = np.searchsorted(plan.switching_times, 0.5 * (times[1:] + times[:-1])) - 1
        off = _swings(plan)
        swing = [off.get(id(plan.primitives[k]), 0.0) for k in of.tolist()]
        return cls(times, plan.pose_at(times)[:, 3], body, swing)

    @functools.cached_property
    def stages(self) -> tuple[Stage, ...]:
        """Stretches of time, for ever in both directions, each with heights that are not left.

        Source: interval arithmetic; what is linear lies between its ends.
        """
        spread = float(np.ptp(self.altitude))
        most = max(spread / STAGES, self.body[1] - self.body[0], THIN) * (1.0 + 1e-9)
        found: list[Stage] = []
        for one in self._pieces(most):
            low, high = one.low, one.high
            if found:
                low, high = min(low, found[-1].low), max(high, found[-1].high)
            if found and high - low <= most:
                found[-1] = Stage(found[-1].begin, one.end, low, high)
            else:
                found.append(one)
        below, above = self.body[0] - THIN, self.body[1] + THIN
        grown = [one._replace(low=one.low + below, high=one.high + above) for one in found]
        grown[0] = grown[0]._replace(begin=-math.inf)
        grown[-1] = grown[-1]._replace(end=math.inf)
        return tuple(grown)

    def _pieces(self, most: float) -> list[Stage]:
        """Stretches between two times, cut where they climb more than that [m]."""
        at = float(self.altitude[0])
        pieces = [Stage(float(self.time[0]), float(self.time[0]), at, at)]
        rows = itertools.pairwise(zip(self.time.tolist(), self.altitude.tolist(), strict=True))
        for ((begin, first), (end, last)), off in zip(rows, self.swing.tolist(), strict=True):
            n = max(1, math.ceil(abs(last - first) / most))
            times, levels = np.linspace(begin, end, n + 1), np.linspace(first, last, n + 1)
            for (t, z), (t_after, z_after) in itertools.pairwise(
                zip(times.tolist(), levels.tolist(), strict=True)
            ):
                pieces.append(Stage(t, t_after, min(z, z_after) - off, max(z, z_after) + off))
        return pieces

    @property
    def reach(self) -> tuple[float, float]:
        """How far the body reaches about its altitude where that may be off [m]."""
        off = float(np.max(self.swing, initial=0.0))
        return self.body[0] - off, self.body[1] + off

    def at(self, time: ArrayLike) -> Array:
        """Altitudes (...,) at `time` (...,) [s]."""
        return np.asarray(np.interp(np.asarray(time), self.time, self.altitude))


def levels_of(problem: Problem, plan: Plan | None = None) -> Levels | None:
    """Those of a vehicle that drives a plan, or stands at its start; None if it has no height.

    In the plane a body whose height is not stated counts at all heights.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"on": (1, 0)})
    >>> levels_of(Problem(robot, [0, 0, 0], [1, 0, 0])) is None
    True
    >>> truck = Problem(robot, [0, 0, 0], [1, 0, 0], body_height=(0.0, 3.5))
    >>> round(levels_of(truck).stages[0].high, 3)
    3.5
    """
    low, high = problem.body_height
    if problem.start.size == 3:
        return Levels([problem.start_time], [0.0], (low, high)) if low < high else None
    if plan is None:
        return Levels([problem.start_time], problem.start[3:], (low, high))
    return Levels.of_plan(plan, (low, high))


def _swings(plan: Plan) -> dict[int, float]:
    """How far [m] altitudes of maneuvers are off the lines between their samples, by identity."""
    found = {}
    for source, one, target in zip(plan.trims, plan.maneuvers, plan.trims[1:], strict=False):
        if one is None or one.course is None:
            continue
        samples = one.course.pose[:, 3]
        climbs = np.array([[source.body_velocity[3], target.body_velocity[3]]])
        low, _ = altitude_ranges([one], climbs, np.array([0]), np.array([samples.size - 1]))
        found[id(one)] = float(samples.min() - low[0])
    return found

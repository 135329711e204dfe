"""Motions of a vehicle as a bound knows them: how far and how much it turns for a unit of cost."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.costs import Cost, terms_of
from maneuver_automaton.models import Car
from maneuver_automaton.problem import Problem
from maneuver_automaton.refinement.stop_and_steer import extreme_automaton, follows_paths
from maneuver_automaton.search.limits import rest_rate

MOST_DIRECTIONS = 8  # of driving; more are replaced by the rectangle around them
SAME = 1e-9  # relative, by which rates are equal


class Families(NamedTuple):
    """Families of motions: all that drive in one direction at a speed and turn at most at a rate.

    Any motion of the vehicle is an average of motions of the families, for the same cost.
    """

    speed: Array  # (F,) [m per unit of cost]
    angle: Array  # (F,) [rad] of the driving direction, seen from the vehicle
    turn_rate: Array  # (F,) [rad per unit of cost], to both sides
    side: IntArray  # (F,) 0: the opposite direction as well, -1: this direction only
    gear: IntArray  # (F,) which function is meant, where forward and reverse have one each


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Motions:
    """All motions of a vehicle, by families, and what else a plan costs."""

    families: Families
    price: float  # of a change between forward and reverse; 0: one function does for both
    besides: float  # cost of every plan that does not depend on its path

    @property
    def speed(self) -> float:
        """Greatest distance for a unit of cost [m]."""
        return float(self.families.speed.max())

    @property
    def turn_rate(self) -> float:
        """Greatest turn for a unit of cost [rad]."""
        return float(self.families.turn_rate.max())


def motions_of(problem: Problem) -> Motions | None:
    """Motions of a problem's vehicle in the plane; None where no bound on cells follows from them.

    Of a vehicle with inertia they are those of the kinematic one at its limits, whose poses it
    shares. Prices of switches are left out, and climbing too: a bound without them holds.
    """
    if problem.automaton.translated:
        return None
    cost = terms_of(problem.cost)
    if not problem.has_inertia:
        twists, rates = problem.automaton.body_velocities[:, :3], problem.rates
        price = cost.direction_change if cost else 0.0  # at least that
        if (rest := rest_rate(problem)) is not None:
            rates = rates - rest
    elif cost and (cost.time or cost.length) and (simpler := _at_the_limits(problem.automaton)):
        twists, price = simpler.body_velocities[:, :3], 0.0
        rates = Cost(time=cost.time, length=cost.length).rates(simpler.controls, twists)
    else:
        return None
    moving = twists.any(axis=1)
    free = (rates < 0.0).any() or (rates[moving] <= 0.0).any()  # also to climb instead of resting
    if free or not twists[:, :2].any():
        return None
    families = _families(twists[moving] / rates[moving, None], gears=price > 0.0)
    return Motions(families=families, price=price, besides=besides(problem))


def _at_the_limits(automaton: Automaton) -> Automaton | None:
    """Trims of a kinematic vehicle that reach all poses of one with inertia; None if not known."""
    if follows_paths(model := automaton.model):
        return extreme_automaton(automaton)
    kinematic, limits = getattr(model, "kinematic", None), model.control_limits
    if not (isinstance(kinematic, Car) and np.isfinite(limits).all()):
        return None  # of another, twists between the limits may lie beyond theirs
    levels = [sorted({low, high, min(max(0.0, low), high)}) for low, high in limits.tolist()]
    return Automaton.of_controls(kinematic, {str(one): one for one in itertools.product(*levels)})


def besides(problem: Problem) -> float:
    """Cost of every plan that does not depend on its path: of resting for a fixed time."""
    lasts = 0.0 if problem.has_inertia else problem.horizon.time or 0.0
    return lasts * (rest_rate(problem) or 0.0)


def _families(per_cost: Array, *, gears: bool) -> Families:
    """Families of twists (n, 3) per unit of cost; those with gears are of forward or reverse."""
    senses = 1.0, -1.0
    if not per_cost[:, 1].any():
        found = [
            [
                (speed, 0.0 if sign > 0 else math.pi, rate)
                for speed, rate in _corners(sign * per_cost[:, 0], np.abs(per_cost[:, 2]))
            ]
            for sign in senses
        ]
    else:
        rate, parts = float(np.abs(per_cost[:, 2]).max()), [per_cost]
        if gears:  # what drives neither forward nor back is of both
            own = [per_cost[sign * per_cost[:, 0] >= 0.0] for sign in senses]
            parts = [np.vstack([one, np.zeros((1, 3))]) for one in own]
        found = [
            [(float(np.hypot(*one)), math.atan2(one[1], one[0]), rate) for one in directions]
            for directions in (_directions(part[:, :2]) for part in parts)
        ]
    if gears:
        rows = [(*one, -1, gear) for gear, part in enumerate(found) for one in part]
        for gear, part in enumerate(found):  # a gear that no motion has may not rise without end
            if not part:
                rows.append((0.0, 0.0, max(row[2] for row in rows), -1, gear))
        rows.sort(key=lambda row: row[4])
    else:
        rows = _merged([*itertools.chain(*found)])
    table = np.array(rows, dtype=np.float64)
    return Families(
        speed=table[:, 0].copy(),
        angle=table[:, 1].copy(),
        turn_rate=table[:, 2].copy(),
        side=table[:, 3].astype(np.int64),
        gear=table[:, 4].astype(np.int64),
    )


def _corners(speeds: Array, rates: Array) -> list[tuple[float, float]]:
    """Speed and turn rate of at most two boxes that hold all motions that do not go backwards."""
    ahead = speeds >= 0.0
    if not (speeds > 0.0).any():
        return []
    fastest, spin = float(speeds.max()), float(rates[ahead].max())
    at_speed = float(rates[speeds >= fastest * (1.0 - SAME)].max())
    # A motion (v, w) is an average of (fastest, at_speed) and (0, spin) below the line between.
    below = rates[ahead] <= (at_speed + (spin - at_speed) * (1.0 - speeds[ahead] / fastest)) * (
        1.0 + SAME
    )
    if spin > at_speed * (1.0 + SAME) and below.all():
        return [(fastest, at_speed), (0.0, spin)]
    return [(fastest, spin)]


def _directions(velocities: Array) -> Array:
    """Corners (n, 2) of a convex polygon that holds all velocities."""
    from scipy.spatial import ConvexHull, QhullError

    low, high = np.minimum(velocities.min(axis=0), 0.0), np.maximum(velocities.max(axis=0), 0.0)
    around = np.array([[x, y] for x in (low[0], high[0]) for y in (low[1], high[1])])
    try:
        hull = velocities[ConvexHull(velocities).vertices]
    except (QhullError, ValueError):
        hull = around
    corners = hull if len(hull) <= MOST_DIRECTIONS else around
    return np.asarray(corners[corners.any(axis=1)])


def _merged(found: list[tuple[float, float, float]]) -> list[tuple[float, float, float, int, int]]:
    """Families of one function; two that differ in nothing but the sense become one."""
    rows: list[tuple[float, float, float, int, int]] = []
    left = list(found)
    while left:
        speed, angle, rate = left.pop(0)
        twin = next(
            (
                one
                for one in left
                if math.isclose(one[0], speed, rel_tol=SAME)
                and math.isclose(one[2], rate, rel_tol=SAME)
                and (speed == 0.0 or abs(math.remainder(one[1] - angle - math.pi, math.tau)) < SAME)
            ),
            None,
        )
        if twin is not None:
            left.remove(twin)
        rows.append((speed, angle, rate, 0 if twin is not None or speed == 0.0 else -1, 0))
    return rows

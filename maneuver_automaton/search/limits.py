"""Limits known without searching: goals out of reach, and bounds that hold for every plan."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._kept import kept_by_first
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.costs import StageCost, prices_switches
from maneuver_automaton.groups import group_of
from maneuver_automaton.primitives import Maneuver
from maneuver_automaton.problem import Bounds, Goal, Problem
from maneuver_automaton.search.setup import SearchSetup, goal_from_start, is_still, search_setup
from maneuver_automaton.words.library import MovingTrims, moving_trims
from maneuver_automaton.words.shortest import least_radius, reeds_shepp_length, shortest_paths
from maneuver_automaton.words.word import Word

MISSED = 1e-6  # [m, rad] for a goal a metre away: what is nearer may be met
CLEARLY = 1e-3  # share by which a price is higher that nobody takes for the same
ALONE = 1e-6  # [rad] in which a goal differs from its images, if there is one shortest path
LASTING = 1e-9  # [rad] of a part of a path that is one
ALIKE = 1e-12  # relative, of prices and curvatures that are one but for rounding
HARDLY_TURNING = 1e-6  # turn rate, as a share of a twist, that is too small to measure a path by


def why_impossible(problem: Problem) -> str:
    """Why no word of whatever length can reach any goal, as far as a glance proves it."""
    reasons = [_impossible(problem, goal, search_setup(problem, goal)) for goal in problem.goals]
    return reasons[0] if all(reasons) else ""


def _impossible(problem: Problem, goal: Goal, setup: SearchSetup) -> str:
    """Why no word ends within the tolerance of a goal, as far as a glance proves it."""
    if not len(setup.library.trims):
        return "no trim of the library moves"
    turn = _turn_to(setup.goal, goal)
    if turn > 1e-9 and not setup.library.twists[:, 2].any():
        return f"no trim of the library turns, and the goal is {turn:.6g} rad away"
    climb = abs(setup.goal[3]) - goal.tolerance_m
    if climb > 1e-9 and not (setup.library.twists[:, 3] * setup.goal[3] > 0.0).any():
        return f"no trim of the library climbs towards the goal, {setup.goal[3]:.6g} m away"
    directions = setup.library.twists / np.linalg.norm(setup.library.twists, axis=1, keepdims=True)
    one_curve = np.linalg.matrix_rank(directions, tol=1e-9) == 1
    exact = goal.tolerance_m == goal.tolerance_rad == 0.0 and not setup.free_heading
    if one_curve and exact and _misses(directions, setup.goal):
        return "all trims of the library move along one and the same curve, which misses the goal"
    limit = problem.horizon.time or problem.horizon.max_time
    if limit is not None:
        distance = _distance_to(setup.goal, goal)
        speed = float(np.linalg.norm(setup.library.twists[:, [0, 1, 3]], axis=1).max())
        turning = float(np.abs(setup.library.twists[:, 2]).max())
        least = max(distance / speed if speed else 0.0, turn / turning if turning else 0.0)
        if least > limit * (1.0 + 1e-9):
            return (
                f"the goal cannot be reached in {limit:g} s: "
                f"way and turn alone take at least {least:.6g} s"
            )
    return ""


def _distance_to(relative: Array, goal: Goal) -> float:
    """Distance to the nearest place within the tolerance of a goal, seen from the start [m]."""
    way = relative[[0, 1, 3]]
    return max(0.0, math.sqrt(way.dot(way)) - goal.tolerance_m)


def _turn_to(relative: Array, goal: Goal) -> float:
    """Turn to the nearest heading within the tolerance of a goal, seen from the start [rad]."""
    if goal.free_heading:
        return 0.0
    return max(0.0, abs(math.remainder(relative[2], 2.0 * math.pi)) - goal.tolerance_rad)


def _misses(directions: Array, goal: Array) -> bool:
    """Whether the one curve that trims of parallel twists (n, 4) follow surely misses a goal."""
    along = directions[0]
    turn_rate, climb = float(along[2]), float(along[3])
    if 0.0 < abs(turn_rate) < HARDLY_TURNING:
        return False
    turn = math.remainder(float(goal[2]), 2.0 * math.pi)
    if climb:
        length = float(goal[3]) / climb
    elif turn_rate:
        length = turn / turn_rate
    else:
        length = float(goal[:2] @ along[:2])
    met = group_of(4).exp(length * along).pose
    gap = np.append((goal - met)[[0, 1, 3]], math.remainder(turn - float(met[2]), 2.0 * math.pi))
    slack = MISSED * (1.0 + float(np.linalg.norm(goal[[0, 1, 3]])))
    closed = turn_rate and not climb
    backwards = length < -slack and not (directions @ along < 0.0).any() and not closed
    return bool(backwards or np.abs(gap).max() > slack)


def closed_bound(problem: Problem, *goals: Goal) -> float:
    """No plan that ends within the tolerance of one of `goals` is cheaper, whatever its word.

    The largest of: the distance at the best price per metre, and the shortest path of a car at it;
    the turn at the best price per radian; a fixed time at the best price per second, and, for a
    fixed time T, ``k (distance^2 + turn^2) / T`` with the largest k for which no trim costs less
    than ``k (speed^2 + turn rate^2)`` per second.
    The last one is the paper's bound on the effort, with k = c1 lambda_min(R) for the unicycle.

    Source: the paper, Appendix; Cauchy-Schwarz.
    """
    return min(max(closed_bounds(problem, goal).values()) for goal in goals)


def closed_bounds(problem: Problem, goal: Goal) -> dict[str, float]:
    """The bounds of `closed_bound`, each by what it counts; a distance of 0 where none is known."""
    limit, library = problem.horizon.time, moving_trims(problem.automaton, problem.cost)
    relative = goal_from_start(problem, goal)
    pads = limit is not None and library.rest is not None
    prices = _prices(library, pads) if len(library.rates) else None
    if prices is None or is_still(relative, free_heading=goal.free_heading):
        return {"distance": 0.0}
    distance, turn = _distance_to(relative, goal), _turn_to(relative, goal)
    ways = (
        (distance, prices.per_metre),
        (math.hypot(*relative[:2]) - goal.tolerance_m, prices.per_metre_level),
        (abs(relative[3]) - goal.tolerance_m, prices.per_metre_up_down[int(relative[3] < 0.0)]),
    )
    bounds = {
        "distance": max((way * price for way, price in ways if way > 0.0), default=0.0),
        "turn": turn * prices.per_radian if turn > 0.0 else 0.0,
    }
    radius = prices.least_radius if problem.automaton.is_kinematic else 0.0
    if radius > 0.0 and not (goal.free_heading or goal.tolerance_m or goal.tolerance_rad):
        length = float(reeds_shepp_length(relative[:3], radius=radius))
        bounds["shortest"] = length * (1.0 - ALIKE) * prices.per_metre_level
    if limit is not None:
        bounds["effort"] = prices.per_square * (distance * distance + turn * turn) / limit
        if not pads:
            bounds["time"] = limit * prices.per_second
    if not math.isfinite(max(bounds.values())):
        bounds = {"distance": 0.0}
    padded = library.rest_rate * limit if pads and limit is not None else 0.0
    return {what: padded + bound for what, bound in bounds.items()}


def sole_bound(problem: Problem, goal: Goal, off: tuple[float, float]) -> float:
    """Cost of the only cheapest plan to a goal, if there is one that costs no more; else 0 or less.

    Of what it is `off`, the distance at the best price per metre or the turn at that per radian,
    where one trim alone has that price. A plan that costs no more drives straight to the goal, or
    turns on the spot, and uses no other trim; so none is cheaper, and no other as cheap.
    """
    limit, library = problem.horizon.time, moving_trims(problem.automaton, problem.cost)
    pads = limit is not None and library.rest is not None
    exact = goal.tolerance_m == goal.tolerance_rad == 0.0
    prices = _prices(library, pads) if exact else None
    if prices is None or (limit is not None and not pads) or prices_switches(problem.cost):
        return 0.0
    distance, turn = off
    bound = max(
        distance * prices.per_metre if prices.one_per_metre else 0.0,
        turn * prices.per_radian if prices.one_per_radian else 0.0,
    )
    return bound + (library.rest_rate * limit if limit is not None else 0.0)


def busy_bound(problem: Problem, at_rest: float) -> float:
    """Cost of plans that rest less than `at_rest` [s] of a fixed time, at least; inf if free."""
    limit = problem.horizon.time
    if limit is None:
        return math.inf
    library = moving_trims(problem.automaton, problem.cost)
    prices = None if library.rest is None or library.rest_rate else _prices(library, True)
    return 0.0 if prices is None else prices.per_second * (limit - at_rest)


def three_are_enough(problem: Problem) -> bool:
    """Whether the cheapest word of at most three trims is the cheapest of all.

    It is where all trims drive forward, and none is cheaper per metre than straight ahead and the
    turns of the least radius to both sides.
    Source: Dubins (1957), *On curves of minimal length with a constraint on average curvature*.
    """
    automaton, horizon = problem.automaton, problem.horizon
    limits = {horizon.time, horizon.max_time, *(trim.max_duration for trim in automaton.trims)}
    if not automaton.is_kinematic or not limits <= {None, math.inf} or horizon.min_coast:
        return False
    library = moving_trims(automaton, problem.cost)
    speeds = library.twists[:, 0]
    if not (speeds > 0.0).all() or library.twists[:, [1, 3]].any() or prices_switches(problem.cost):
        return False
    curvatures, prices = library.twists[:, 2] / speeds, library.rates / speeds
    cheapest = curvatures[prices <= prices.min(initial=np.inf) * (1.0 + ALIKE)]
    most = np.abs(curvatures).max(initial=0.0)
    return all((np.abs(cheapest - one) <= ALIKE * most).any() for one in (-most, 0.0, most))


def sole_shortest(problem: Problem, goal: Goal) -> Word | None:
    """The cheapest word to a goal in free space, where it follows the only shortest path of a car.

    None for other libraries and conditions, and where another path is as short: where the goal is
    an image of its own, and where no path turns in vain.
    """
    horizon, driven = problem.horizon, shortest_trims(problem.automaton, problem.cost)
    limited = horizon.time is not None or horizon.max_time is not None or horizon.min_coast > 0.0
    relative = goal_from_start(problem, goal)
    if driven is None or limited or goal.free_heading or relative[3] != 0.0:
        return None
    pose = relative[:3] / [driven.radius, driven.radius, 1.0]
    turn = math.remainder(float(pose[2]), 2.0 * math.pi)
    c, s = math.cos(0.5 * turn), math.sin(0.5 * turn)
    image = c * pose[0] + s * pose[1], c * pose[1] - s * pose[0], turn, math.pi - abs(turn)
    turns, parts = shortest_paths(pose[None], 1.0)
    metres = driven.radius * np.abs(parts[0])
    vain = float(np.abs(parts).sum()) - abs(turn)
    used = metres > driven.radius * LASTING
    most = horizon.max_trims or used.size
    if min(vain, *map(abs, image)) < ALONE or np.count_nonzero(used) > most:
        return None
    trims = driven.trims[turns[0][used] + 1, (parts[0][used] > 0.0).astype(int)]
    return Word(
        trims=trims,
        durations=metres[used] / np.abs(problem.automaton.body_velocities[trims, 0]),
        cost=float(metres[used].sum()) * driven.per_metre,
    )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ShortestTrims:
    """The trims that the shortest paths of a car are made of, the cheapest per metre of all."""

    trims: IntArray  # (3, 2) right, straight, left; backwards and ahead
    radius: float  # [m]
    per_metre: float


@kept_by_first
def shortest_trims(automaton: Automaton, cost: StageCost) -> ShortestTrims | None:
    """The trims of a car's shortest paths; None where one is missing, or two do the same."""
    library = moving_trims(automaton, cost)
    speeds, radius = library.twists[:, 0], least_radius(library.twists)
    able = automaton.is_kinematic and not (library.climbs or prices_switches(cost))
    if radius == 0.0 or not able or any(one.max_duration < math.inf for one in automaton.trims):
        return None
    prices, bends = library.rates / np.abs(speeds), radius * library.twists[:, 2] / speeds
    least = float(prices.min())
    trims = np.empty((3, 2), dtype=np.int64)
    for side, gear in itertools.product((-1, 0, 1), (-1, 1)):
        same = (np.abs(bends - side) <= ALIKE) & (speeds * gear > 0.0)
        (rows,) = np.nonzero(same & (prices <= least * (1.0 + ALIKE)))
        if rows.size != 1:
            return None
        trims[side + 1, (gear + 1) // 2] = library.trims[rows[0]]
    return ShortestTrims(trims=trims, radius=radius, per_metre=least)


@dataclass(frozen=True, slots=True, kw_only=True)
class _LeastPrices:
    """Best prices of a library; what rest costs is taken off where it pads."""

    per_metre: float
    per_metre_level: float  # of the way in the plane alone
    per_metre_up_down: tuple[float, float]
    per_radian: float
    per_second: float
    per_square: float  # per (m/s)^2 + (rad/s)^2 and second
    one_per_metre: bool  # whether one trim alone has the best price
    one_per_radian: bool
    least_radius: float  # [m] of a turn, 0 where shortest paths say nothing


@kept_by_first
def _prices(library: MovingTrims, pads: bool) -> _LeastPrices | None:
    """None where a trim is cheaper than the rest that pads."""
    rates = library.rates - (library.rest_rate if pads else 0.0)
    if (rates < 0.0).any():
        return None
    squares = library.speeds**2 + library.turn_rates**2
    with np.errstate(divide="ignore", invalid="ignore"):
        metre = np.where(library.speeds > 0.0, rates / library.speeds, np.inf)
        radian = np.where(library.turn_rates > 0.0, rates / library.turn_rates, np.inf)
        level = np.hypot(library.twists[:, 0], library.twists[:, 1])
        climb = library.twists[:, 3]
        up, down = (np.where(v > 0.0, rates / v, np.inf) for v in (climb, -climb))
        return _LeastPrices(
            per_metre=float(metre.min()),
            per_metre_level=float(np.where(level > 0.0, rates / level, np.inf).min()),
            per_metre_up_down=(float(up.min()), float(down.min())),
            per_radian=float(radian.min()),
            per_second=float(rates.min()),
            per_square=float(np.min(rates / squares)),
            one_per_metre=_is_alone(metre),
            one_per_radian=_is_alone(radian),
            least_radius=least_radius(library.twists),
        )


def _is_alone(prices: Array) -> bool:
    """Whether one price is the best by far."""
    least = float(prices.min())
    return math.isfinite(least) and np.count_nonzero(prices <= least * (1.0 + CLEARLY)) == 1


def rest_rate(problem: Problem) -> float | None:
    """Cost per second of the cheapest rest where it pads a fixed time; None if nothing pads."""
    if problem.horizon.time is None:
        return None
    still = ~problem.automaton.body_velocities.any(axis=1)
    return float(problem.rates[still].min()) if still.any() else None


def outside(pose: Array, bounds: Bounds) -> str:
    """Which bound a pose is outside of, in words; empty if it is inside."""
    for name, index in (("x", 0), ("y", 1), ("z", 3)):
        pair = getattr(bounds, name)
        if pair is not None and index < pose.size and not pair[0] <= pose[index] <= pair[1]:
            return f"{name} = {pose[index]:.6g} m, need {pair[0]:.6g} to {pair[1]:.6g} m"
    return ""


def stays_inside(plan: Plan, bounds: Bounds) -> bool:
    """Whether every pose of a plan is inside the bounds, extreme points of arcs included."""
    if bounds.x is None and bounds.y is None and bounds.z is None:
        return True
    times, begins, along = list[Array](), list[Array](), list[Array]()
    for k, primitive in enumerate(plan.primitives):
        if isinstance(primitive, Maneuver):
            if primitive.course is not None:
                along.append(primitive.course.pose)
                begins.append(np.tile(plan.switching_poses[k], (len(along[-1]), 1)))
            continue
        v_x, v_y, turn_rate = primitive.body_velocity[:3]
        duration = plan.primitive_durations[k]
        if turn_rate:  # the path is level with an axis where the velocity's direction is
            heading = plan.switching_poses[k][2] + math.atan2(v_y, v_x)
            quarter = 0.5 * math.pi
            first = math.ceil(min(heading, heading + turn_rate * duration) / quarter)
            last = math.floor(max(heading, heading + turn_rate * duration) / quarter)
            angles = np.arange(first, last + 1) * quarter
            times.append(plan.switching_times[k] + (angles - heading) / turn_rate)
    known = [plan.switching_poses]
    if along:  # all courses at once
        group = group_of(plan.start.size)
        known.append((group(np.concatenate(begins)) @ group(np.concatenate(along))).pose)
    if times:
        known.append(plan.pose_at(np.concatenate(times)))
    poses = np.concatenate(known)
    slack = 1e-9 * (1.0 + float(np.abs(poses).max()))
    for index, pair in ((0, bounds.x), (1, bounds.y), (3, bounds.z)):
        if pair is not None and index < poses.shape[1]:
            values = poses[:, index]
            if values.min() < pair[0] - slack or values.max() > pair[1] + slack:
                return False
    return True

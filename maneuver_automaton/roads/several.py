"""Several vehicles on one road: one after another, past the plans of those before.

A file of CommonRoad with several planning problems asks for one trajectory each. As of all road
users, what counts of a vehicle is its trajectory: before its begin and after its end it is not
there. Whoever finds no plan past the others is planned before them in the next order.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._brief import brief
from maneuver_automaton._display import Played
from maneuver_automaton._interrupts import stopped
from maneuver_automaton.audit import closest_to
from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import Box, Motion, Obstacle
from maneuver_automaton.collision.blocked import too_close
from maneuver_automaton.roads.judge import RoadVerdict, judged
from maneuver_automaton.roads.scene import RoadScene, presence_of
from maneuver_automaton.roads.single_plan import RoadPlanResult, plan_road
from maneuver_automaton.roads.vehicle import RoadVehicle

SAMPLE_S = 0.05  # between places of a plan, as others see it while they are planned
ROOM = 0.05  # [m] on each side by which they see it larger then: more than its arcs leave chords


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadPair:
    """Two vehicles, and where they are nearest to each other while both are there."""

    pair: tuple[str, str]
    time_s: float  # [s] on the clock of the scene
    distance_m: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RoadFleetResult(Played):
    """Plans of several vehicles on one road, each with its verdict past all others."""

    name: str
    results: Mapping[str, RoadPlanResult]
    pairs: tuple[RoadPair, ...]  # of those that have plans, the nearest first
    order: tuple[str, ...]  # in which they were planned at last
    search_s: float

    __repr__ = brief

    @property
    def plans(self) -> dict[str, Plan]:
        """The plans of those that have one, by name."""
        return {name: one.plan for name, one in self.results.items() if one.plan is not None}

    @property
    def found(self) -> bool:
        """Whether all have plans."""
        return len(self.plans) == len(self.results)

    @property
    def distance_m(self) -> float:
        """Least distance of any two [m]; inf if no two are there at once."""
        return min((one.distance_m for one in self.pairs), default=math.inf)


def plan_roads(
    scenes: Mapping[str, RoadScene],
    vehicle: RoadVehicle | None = None,
    *,
    name: str = "",
    time_limit: float = 10.0,
) -> RoadFleetResult:
    """Plans of several vehicles on one road that touch nobody, nor each other.

    Parameters
    ----------
    scenes : mapping of str to RoadScene
        What each has to do, on one clock and among the same road users.
    vehicle : RoadVehicle, optional
        All of them; the BMW 320i of CommonRoad if omitted.
    name : str
        Of the scene of all.
    time_limit : float
        Once it is over no new order is begun, and no search [s].

    Returns
    -------
    RoadFleetResult

    Raises
    ------
    ValueError
        If there is no scene, or one cannot be planned.

    Examples
    --------
    >>> from maneuver_automaton.roads import GoalRegion, Lanelet, RoadStart
    >>> lane = Lanelet(1, [[0, 2], [200, 2]], [[0, -2], [200, -2]])
    >>> scenes = {
    ...     name: RoadScene(name=name, lanelets=(lane,), goals=(GoalRegion(time=(1.0, 2.0)),),
    ...                     start=RoadStart(middle=[x, 0.0, 0.0], speed=10.0))
    ...     for name, x in (("first", 30.0), ("second", 10.0))
    ... }
    >>> result = plan_roads(scenes)
    >>> result.found, result.pairs[0].pair, result.distance_m > 0.0
    (True, ('first', 'second'), True)
    """
    if not scenes:
        raise ValueError("road fleet: there is no vehicle, need at least one")
    vehicle, begin = vehicle or RoadVehicle(), time.perf_counter()
    order, best = list(scenes), dict[str, RoadPlanResult]()
    tried: set[tuple[str, ...]] = set()
    last = tuple(order)
    while tuple(order) not in tried:
        tried.add(tuple(order))
        left = time_limit - (time.perf_counter() - begin)
        found = _in_order(scenes, vehicle, order, max(left, 0.0))
        if _count(found) > _count(best) or not best:
            best, last = found, tuple(order)
        over = stopped() or time.perf_counter() - begin > time_limit
        failed = [one for one in order if found[one].plan is None]
        if not failed or over:
            break
        order = [*failed, *(one for one in order if one not in failed)]
    checked = _checked(scenes, vehicle, best)
    return RoadFleetResult(
        name=name,
        results=checked,
        pairs=nearest_pairs(vehicle, {k: one.plan for k, one in checked.items() if one.plan}),
        order=last,
        search_s=time.perf_counter() - begin,
    )


def _count(results: Mapping[str, RoadPlanResult]) -> int:
    return sum(one.plan is not None for one in results.values())


def _in_order(
    scenes: Mapping[str, RoadScene], vehicle: RoadVehicle, order: Sequence[str], time_limit: float
) -> dict[str, RoadPlanResult]:
    """Plans one after another, past those before; by name in the order of the scenes."""
    results, others = dict[str, RoadPlanResult](), list[Obstacle]()
    for name in order:
        scene = scenes[name]
        past = replace(scene, traffic=(*scene.traffic, *others))
        results[name] = one = plan_road(past, vehicle, time_limit=time_limit / len(order))
        if one.plan is not None:
            others.append(_seen_by_others(vehicle, one.plan, name))
    return {name: results[name] for name in scenes}


def _seen_by_others(vehicle: RoadVehicle, plan: Plan, name: str) -> Obstacle:
    """A plan as a road user for those that are planned after it."""
    steps = max(math.ceil(plan.duration / SAMPLE_S), 1)
    times = np.linspace(plan.start_time, plan.start_time + plan.duration, steps + 1)
    return seen_by_others(vehicle, times, plan.pose_at(times), name)


def seen_by_others(vehicle: RoadVehicle, times: Array, poses: Array, name: str) -> Obstacle:
    """What a vehicle is going to do as a road user for others, a little larger than it is.

    It is there between the first and the last of the times (n,) [s] of its poses (n, 3).
    """
    size = [vehicle.length + 2.0 * ROOM, vehicle.width + 2.0 * ROOM]
    body = Box(size, [vehicle.ahead, 0.0])
    return Obstacle(body, motion=Motion(times, poses), name=name)


def driving(vehicle: RoadVehicle, plan: Plan, name: str) -> Obstacle:
    """A plan as a road user, exactly."""
    return Obstacle(vehicle.footprint, motion=Motion.of_plan(plan), name=name)


def judged_together(
    scenes: Mapping[str, RoadScene], vehicle: RoadVehicle, plans: Mapping[str, Plan]
) -> dict[str, RoadVerdict]:
    """The verdict on each plan past all others."""
    there = {name: driving(vehicle, plan, name) for name, plan in plans.items()}
    return {
        name: judged(
            replace(
                scenes[name],
                traffic=(
                    *scenes[name].traffic,
                    *(there[other] for other in plans if other != name),
                ),
            ),
            vehicle,
            plan,
        )
        for name, plan in plans.items()
    }


def _checked(
    scenes: Mapping[str, RoadScene], vehicle: RoadVehicle, results: Mapping[str, RoadPlanResult]
) -> dict[str, RoadPlanResult]:
    """The answers as the judge sees them past all others; a plan that hits one is left out."""
    kept = dict(results)
    while True:
        plans = {name: one.plan for name, one in kept.items() if one.plan is not None}
        verdicts = judged_together(scenes, vehicle, plans)
        kept |= {name: replace(kept[name], verdict=one) for name, one in verdicts.items()}
        wrong = [name for name, one in verdicts.items() if not one.clean]
        if not wrong:
            return kept
        said = "; ".join(words for _, words in verdicts[wrong[-1]].faults)
        reason = f"its plan fails the judge past the others: {said}"
        kept[wrong[-1]] = replace(kept[wrong[-1]], plan=None, verdict=None, reason=reason)


def nearest_pairs(vehicle: RoadVehicle, plans: Mapping[str, Plan]) -> tuple[RoadPair, ...]:
    """Least distances of those that are there at once, by the audit's bounds."""
    rows, named = [], [*plans.items()]
    for k, (name, plan) in enumerate(named):
        for other, its in named[k + 1 :]:
            body = driving(vehicle, its, other)
            least = closest_to(
                plan,
                vehicle.model,
                (body,),
                footprint=(vehicle.footprint,),
                within=presence_of(body),
                enough=too_close(0.0),
            )
            if math.isfinite(least.distance):
                row = RoadPair(
                    pair=(name, other), time_s=least.time, distance_m=float(least.distance)
                )
                rows.append(row)
    return tuple(sorted(rows, key=lambda row: row.distance_m))

"""Several vehicles on one road: planned one after another, and driven past what the others hold.

A file of CommonRoad with several planning problems asks for one trajectory each. As of all road
users, what counts of a vehicle is its trajectory: before its begin and after its end it is not
there. Whoever finds no plan past the others is planned before them in the next order.

In a loop each holds a plan with a stop after it, past those of all others. If all drive their
begins, what is left is past each other too; and whoever takes another plan has proven it past those
that the others hold at that moment. Who finds no better one goes on with its own.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._brief import brief
from maneuver_automaton._display import Played
from maneuver_automaton._interrupts import patient, stopped
from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import Box, Motion, Obstacle
from maneuver_automaton.collision.blocked import too_close
from maneuver_automaton.fleet.result import Closest
from maneuver_automaton.roads.driving import Driver, RoadDrive, RoadPlanResult, plan_road
from maneuver_automaton.roads.planner import LONGEST_STOP, road_planner
from maneuver_automaton.roads.plans import RoadSettings
from maneuver_automaton.roads.rules import RoadVerdict, judged, nearest_to
from maneuver_automaton.roads.scene import TIME_TOLERANCE, RoadScene
from maneuver_automaton.roads.vehicle import RoadVehicle

SAMPLE_S = 0.05  # between places of a plan, as others see it while they are planned
ROOM = 0.05  # [m] on each side by which they see it larger then: more than its arcs leave chords
WORST_FIRST = ("touched", "off_road", "undrivable", "missed", "steps_spent", "reached")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RoadFleetResult(Played):
    """Plans of several vehicles on one road, each with its verdict past all others."""

    name: str
    results: Mapping[str, RoadPlanResult]
    pairs: tuple[Closest, ...]  # of those that have plans, the nearest first
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
    order, best, most = list(scenes), dict[str, RoadPlanResult](), -1
    tried: set[tuple[str, ...]] = set()
    while tuple(order) not in tried:
        tried.add(tuple(order))
        left = time_limit - (time.perf_counter() - begin)
        found = _in_order(scenes, vehicle, order, max(left, 0.0))
        failed = [one for one in order if found[one].plan is None]
        if len(order) - len(failed) > most:
            best, last, most = found, tuple(order), len(order) - len(failed)
        over = stopped() or time.perf_counter() - begin > time_limit
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


def _in_order(
    scenes: Mapping[str, RoadScene], vehicle: RoadVehicle, order: Sequence[str], time_limit: float
) -> dict[str, RoadPlanResult]:
    """Plans one after another, past those before; by name in the order of the scenes."""
    results, others = dict[str, RoadPlanResult](), list[Obstacle]()
    for name in order:
        scene = _among(scenes[name], others)
        results[name] = one = plan_road(scene, vehicle, time_limit=time_limit / len(order))
        if one.plan is not None:
            plan = one.plan
            steps = max(math.ceil(plan.duration / SAMPLE_S), 1)
            times = np.linspace(plan.start_time, plan.start_time + plan.duration, steps + 1)
            others.append(_seen_by_others(vehicle, times, plan.pose_at(times), name))
    return {name: results[name] for name in scenes}


def _seen_by_others(vehicle: RoadVehicle, times: Array, poses: Array, name: str) -> Obstacle:
    """What a vehicle is going to do as a road user for others, a little larger than it is."""
    body = Box([vehicle.length + 2.0 * ROOM, vehicle.width + 2.0 * ROOM], [vehicle.ahead, 0.0])
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
        name: judged(_among(scenes[name], _others(there, name)), vehicle, plan)
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


def nearest_pairs(vehicle: RoadVehicle, plans: Mapping[str, Plan]) -> tuple[Closest, ...]:
    """Least distances of those that are there at once, by the audit's bounds."""
    rows, named = [], [*plans.items()]
    for k, (name, plan) in enumerate(named):
        for other, its in named[k + 1 :]:
            least = nearest_to(plan, vehicle, driving(vehicle, its, other), enough=too_close(0.0))
            if math.isfinite(least.distance):
                rows.append(Closest((name, other), least.time, float(least.distance)))
    return tuple(sorted(rows, key=lambda row: row.distance_m))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RoadFleetDrive(Played):
    """What several vehicles drove on one road, each with its verdict past all others."""

    name: str
    results: Mapping[str, RoadDrive]
    pairs: tuple[Closest, ...]  # the nearest first
    before: RoadFleetResult  # the plans made before the start

    __repr__ = brief

    @property
    def plans(self) -> dict[str, Plan]:
        """What each drove, by name."""
        return {name: one.driven for name, one in self.results.items() if one.steps}

    @property
    def reached(self) -> bool:
        """Whether all reached a goal."""
        return all(one.reached for one in self.results.values())

    @property
    def status(self) -> str:
        """The worst of all: touched, off_road, undrivable, missed, steps_spent, reached."""
        return min((one.status for one in self.results.values()), key=WORST_FIRST.index)

    @property
    def reason(self) -> str:
        """Why some did not reach a goal; empty if all did."""
        rows = self.results.items()
        return "; ".join(f"{name}: {one.reason}" for name, one in rows if not one.reached)

    @property
    def distance_m(self) -> float:
        """Least distance of any two [m]; inf if no two were there at once."""
        return min((one.distance_m for one in self.pairs), default=math.inf)


def drive_roads(
    scenes: Mapping[str, RoadScene],
    vehicle: RoadVehicle | None = None,
    settings: RoadSettings | None = None,
    *,
    name: str = "",
    steps: int | None = None,
    time_limit: float = 10.0,
    progress: Callable[[], None] | None = None,
) -> RoadFleetDrive:
    """Several vehicles on one road in closed loop, from plans made before the start.

    Parameters
    ----------
    scenes : mapping of str to RoadScene
        What each has to do, on one clock and among the same road users.
    vehicle : RoadVehicle, optional
        All of them; the BMW 320i of CommonRoad if omitted.
    settings : RoadSettings, optional
    name : str
        Of the scene of all.
    steps : int, optional
        Of each vehicle at most.
    time_limit : float
        Of the plans before the start [s].
    progress : callable, optional
        Called after each step of a vehicle.

    Raises
    ------
    ValueError
        If there is no scene, or one cannot be planned.

    Examples
    --------
    >>> from maneuver_automaton.roads import GoalRegion, Lanelet, RoadStart
    >>> lane = Lanelet(1, [[0, 2], [200, 2]], [[0, -2], [200, -2]])
    >>> scenes = {
    ...     name: RoadScene(name=name, lanelets=(lane,), goals=(GoalRegion(time=(0.5, 0.8)),),
    ...                     start=RoadStart(middle=[x, 0.0, 0.0], speed=10.0))
    ...     for name, x in (("first", 30.0), ("second", 10.0))
    ... }
    >>> drive = drive_roads(scenes)
    >>> drive.reached, drive.distance_m > 0.0
    (True, True)
    """
    vehicle = vehicle or RoadVehicle()
    before = plan_roads(scenes, vehicle, name=name, time_limit=time_limit)
    planners = {one: road_planner(scene, vehicle, settings) for one, scene in scenes.items()}
    first = {one: found.decision for one, found in before.results.items() if found.plan is not None}
    begins = {
        one: planner.plan_of(planner.start_state, np.zeros((1, 2)))
        for one, planner in planners.items()
    }
    starts = {one: driving(vehicle, begin, one) for one, begin in begins.items()}
    drivers = {
        one: Driver(planner, first.get(one), steps, _others(starts, one))
        for one, planner in planners.items()
    }
    with patient():
        for planner in planners.values():
            planner.warm()
        _drive(drivers, progress)
    # Who does not set off, as it touches another at the start, is there all the same.
    driven = {
        one: begins[one] if driver.hopeless else driver.driven
        for one, driver in drivers.items()
        if driver.done or driver.hopeless
    }
    there = {one: driving(vehicle, plan, one) for one, plan in driven.items()}
    drives = {
        one: driver.drive(_among(scenes[one], _others(there, one)))
        for one, driver in drivers.items()
    }
    return RoadFleetDrive(
        name=name, results=drives, pairs=nearest_pairs(vehicle, driven), before=before
    )


def _among(scene: RoadScene, others: Sequence[Obstacle]) -> RoadScene:
    return replace(scene, traffic=(*scene.traffic, *others))


def _others(bodies: Mapping[str, Obstacle], name: str) -> list[Obstacle]:
    return [body for other, body in bodies.items() if other != name]


def _drive(drivers: Mapping[str, Driver], progress: Callable[[], None] | None) -> None:
    """Step by step, one after another in the order of their names, until all are done."""
    step = min(one.planner.scene.step for one in drivers.values())
    now = min(one.planner.time_of(0) for one in drivers.values())
    last = max(  # when nobody looks at one any more [s]
        one.planner.time_of(one.limit) + one.planner.settings.horizon_s + LONGEST_STOP
        for one in drivers.values()
    )
    number = 0
    while not (all(one.is_done for one in drivers.values()) or stopped()):
        time = now + number * step
        for name, driver in drivers.items():
            if driver.is_done or (driver.planner.time_of(driver.tick) > time + TIME_TOLERANCE):
                continue
            others = [
                held
                for other, one in drivers.items()
                if other != name and (held := _held(other, one, last)) is not None
            ]
            driver.step(driver.planner.past(others))
            if progress is not None:
                progress()
        number += 1


def _held(name: str, driver: Driver, last: float) -> Obstacle | None:
    """What a vehicle is going to do, as the others see it; None once it has reached its goal."""
    decision, planner = driver.tail, driver.planner
    if driver.reached or driver.hopeless or (decision is None and not driver.done):
        return None  # it is gone, does not set off, or has no plan and has not begun
    if decision is None or not len(decision.controls):
        states, reaches = driver.state[None], False
    else:
        count = decision.lasting if decision.reaches else len(decision.controls)
        states, reaches = decision.states[: count + 1], decision.reaches
    ticks = range(driver.tick, driver.tick + len(states))
    times = np.array([planner.time_of(tick) for tick in ticks])
    poses = planner.world(states[:, :3])
    if not reaches:
        times, poses = np.append(times, last), np.concatenate([poses, poses[-1:]])
    return _seen_by_others(planner.vehicle, times, poses, name)

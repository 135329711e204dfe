"""Several vehicles on one road in closed loop: in every tick each plans past what the others hold.

Each holds a plan with a stop after it, past those of all others. If all drive their begins, what is
left is past each other too; and whoever takes another plan has proven it past those that the others
hold at that moment. Who finds no better one goes on with its own. As of all road users, nothing is
there of a vehicle before its begin, and after it has reached its goal.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton._brief import brief
from maneuver_automaton._display import Player, picture, player_frame, player_page
from maneuver_automaton._interrupts import patient, stopped
from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import Obstacle
from maneuver_automaton.roads.decision import RoadSettings
from maneuver_automaton.roads.driving import Driver, RoadDrive
from maneuver_automaton.roads.planner import LONGEST_STOP, road_planner
from maneuver_automaton.roads.scene import TIME_TOLERANCE, RoadScene
from maneuver_automaton.roads.several import (
    RoadFleetResult,
    RoadPair,
    driving,
    nearest_pairs,
    plan_roads,
    seen_by_others,
)
from maneuver_automaton.roads.vehicle import RoadVehicle

WORST_FIRST = ("touched", "off_road", "undrivable", "missed", "steps_spent", "reached")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RoadFleetDrive:
    """What several vehicles drove on one road, each with its verdict past all others."""

    name: str
    results: Mapping[str, RoadDrive]
    pairs: tuple[RoadPair, ...]  # the nearest first
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

    def player(self, *, title: str = "") -> Player:
        """A page that plays it: `.html`, or `.save(path)`; `title` heads it."""
        return player_page(self, title=title)

    def _repr_html_(self) -> str:
        return player_frame(self)

    def _repr_png_(self) -> bytes | None:
        return picture(self)


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
    starts = {
        one: driving(vehicle, planner.plan_of(planner.start_state, np.zeros((1, 2))), one)
        for one, planner in planners.items()
    }
    drivers = {
        one: Driver(planner, first.get(one), steps, _others(starts, one))
        for one, planner in planners.items()
    }
    with patient():
        for planner in planners.values():
            planner.warm()
        _drive(drivers, progress)
    there = {one: driving(vehicle, driver.driven, one) for one, driver in drivers.items()}
    there = {one: body for one, body in there.items() if drivers[one].done}
    # Who does not set off, as it touches another at the start, is there all the same.
    there |= {one: starts[one] for one, driver in drivers.items() if driver.hopeless}
    drives = {
        one: driver.drive(
            replace(scenes[one], traffic=(*scenes[one].traffic, *_others(there, one)))
        )
        for one, driver in drivers.items()
    }
    driven = {one: drive.driven for one, drive in drives.items() if drive.steps}
    return RoadFleetDrive(
        name=name, results=drives, pairs=nearest_pairs(vehicle, driven), before=before
    )


def _others(bodies: Mapping[str, Obstacle], name: str) -> list[Obstacle]:
    return [body for other, body in bodies.items() if other != name]


def _drive(drivers: Mapping[str, Driver], progress: Callable[[], None] | None) -> None:
    """Tick by tick, one after another in the order of their names, until all are done."""
    tick = min(one.planner.tick for one in drivers.values())
    now = min(one.planner.time_of(0) for one in drivers.values())
    last = max(_end_of(one) for one in drivers.values())
    number = 0
    while not (all(one.is_done for one in drivers.values()) or stopped()):
        time = now + number * tick
        for name, driver in drivers.items():
            waits = driver.planner.time_of(driver.tick) > time + TIME_TOLERANCE
            if driver.is_done or waits:
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


def _end_of(driver: Driver) -> float:
    """When nobody looks at it any more [s]."""
    planner = driver.planner
    return planner.time_of(driver.limit) + planner.settings.horizon_s + LONGEST_STOP


def _held(name: str, driver: Driver, last: float) -> Obstacle | None:
    """What a vehicle is going to do, as the others see it; None once it has reached its goal.

    Where its plan does not lead to a goal it stands at the end of its stop.
    """
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
    return seen_by_others(planner.vehicle, times, poses, name)

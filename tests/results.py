"""One result of every kind, small and the same at every run, for judges that look at all kinds."""

from __future__ import annotations

import functools
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import maneuver_automaton as ma
from maneuver_automaton.fleet import FleetLog, FleetResult, simulate_fleet
from maneuver_automaton.formats.commonroad import read_commonroad
from maneuver_automaton.receding_horizon import Disturbance, Statistics, simulate_many
from maneuver_automaton.roads import (
    RoadDrive,
    RoadFleetDrive,
    RoadFleetResult,
    RoadPlanResult,
    drive_roads,
    drive_scene,
    plan_road,
    plan_roads,
    road_planner,
)
from tests.fleet.robots import crossing as crossing_robots
from tests.plotting.cases import document_of, parking_plan
from tests.plotting.fleets import crossing
from tests.plotting.loops import NEAR, parking, parking_loop
from tests.roads.files import LANES, car, commonroad, problem

# Two vehicles on two lanes, behind a car that is slower; the name is one that CommonRoad knows.
ALONE = commonroad().replace("TST_Lanes", "ZAM_Lanes")
TOGETHER = commonroad(
    *LANES,
    car(7, x=60.0, y=2.0, speed=6.0, steps=60),
    problem(100, x=10.0, y=2.0, speed=14.0),
    problem(101, x=30.0, y=2.0, speed=9.0),
).replace("TST_Lanes", "ZAM_Lanes")


def scenes_in(text: str) -> dict[str, Any]:
    """The scenes of a CommonRoad file, by the number of their planning problem."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "road.xml"
        file.write_text(text)
        roads = [one.road for one in read_commonroad(file)]
    return {str(one.benchmark.problem): one for one in roads}


@functools.cache
def statistics() -> Statistics:
    """Two loops with noise."""
    noise = Disturbance(position_m=0.01, heading_rad=0.01)
    return simulate_many(parking(NEAR), step=1.0, disturbance=noise, seeds=[1, 2])


@functools.cache
def fleet_plan() -> FleetResult:
    """Two that pass each other, and one that is stuck; put together by hand."""
    return crossing()


@functools.cache
def fleet_log() -> FleetLog:
    """Two robots whose paths cross, each with noise."""
    return simulate_fleet(
        crossing_robots(tolerance=0.1, margin=0.2), step=0.5, steps=40, first_time_limit=60.0
    )


@functools.cache
def road_plan() -> RoadPlanResult:
    """A change of lane behind a slower car."""
    (scene,) = scenes_in(ALONE).values()
    return plan_road(scene)


@functools.cache
def road_drive() -> RoadDrive:
    """The same in closed loop."""
    (scene,) = scenes_in(ALONE).values()
    return drive_scene(road_planner(scene))


@functools.cache
def road_fleet() -> RoadFleetResult:
    """Plans of two vehicles on one road."""
    return plan_roads(scenes_in(TOGETHER), name="two", time_limit=60.0)


@functools.cache
def road_fleet_drive() -> RoadFleetDrive:
    """Both in closed loop."""
    return drive_roads(scenes_in(TOGETHER), name="two", time_limit=60.0)


@functools.cache
def planned() -> ma.PlanResult:
    """The plan of a parking manoeuvre, as its planner answers."""
    return ma.plan(parking(), time_limit=60.0)


RESULTS: dict[str, Callable[[], Any]] = {
    "plan": planned,
    "plan.json": lambda: document_of(parking_plan()),
    "closed loop": parking_loop,
    "statistics": statistics,
    "fleet": fleet_plan,
    "fleet log": fleet_log,
    "road plan": road_plan,
    "road drive": road_drive,
    "road fleet": road_fleet,
    "road fleet drive": road_fleet_drive,
}

"""Several vehicles on recorded roads in closed loop: who reaches its goal, and who comes near whom.

``python benchmarks/road_fleets.py [NAME ...] [--most N]``: of every scene of
``../shared/data/commonroad`` some of the recorded cars are driven as vehicles of their own, from
where they were recorded first to where they were recorded last, beside the problem of the file.
The others drive as recorded, and react to nobody. A row has how many there are, how many had a plan
before the start and reach their goals, the least distance of two of them by the audit's bounds and
by shapely at 5 ms, how many verdicts are not clean, the steps, and milliseconds for one.
"""

from __future__ import annotations

import argparse
import itertools
import math
import sys
import time
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import shapely

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.cases import DATA, present
from benchmarks.tables import show
from maneuver_automaton import Plan
from maneuver_automaton.collision import Box, Obstacle
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.commonroad import read_commonroad
from maneuver_automaton.groups import SE2
from maneuver_automaton.roads import (
    GoalRegion,
    RoadScene,
    RoadStart,
    RoadVehicle,
    drivable_area,
    drive_roads,
)

SCENARIOS = DATA / "commonroad/scenarios"
LEAST_STATES, LEAST_WAY = 20, 10.0  # recorded states, and [m], of a car that is driven
SPEEDS = (3.0, 30.0)  # [m/s] of its start at least, and at most
STEP = 0.005  # [s] between two looks at the bodies
VEHICLE = RoadVehicle()


def driven_as(scene: RoadScene, one: Obstacle) -> RoadScene | None:
    """What a recorded car has to do as a vehicle of its own; None if it is not fit for that."""
    motion = one.motion
    if motion is None or not isinstance(one.shape, Box) or len(motion.time) < LEAST_STATES:
        return None
    begin, end = motion.pose[0], motion.pose[-1]
    speed = float(motion.speeds[0])
    body = Box([VEHICLE.length + 0.2, VEHICLE.width + 0.2], begin[:2], float(begin[2]))
    inside = drivable_area(scene.lanelets).contains(shapely.Polygon(body.corners))
    far = math.dist(begin[:2], end[:2]) >= LEAST_WAY
    if motion.time[0] != scene.start.time or not SPEEDS[0] <= speed <= SPEEDS[1]:
        return None
    if not (inside and far and motion.speeds.max() <= SPEEDS[1]):
        return None
    last = float(motion.time[-1])
    place = Box([6.0, 3.0], end[:2], float(end[2]))
    return replace(
        scene,
        start=RoadStart(middle=begin, speed=speed, time=float(motion.time[0])),
        goals=(GoalRegion(places=(place,), time=(last - 0.5, last + 1.5)),),
    )


def scenes_of(scene: RoadScene, most: int) -> dict[str, RoadScene]:
    """The problem of a file, and up to so many recorded cars, none of them traffic any more."""
    found = {"own": scene}
    for one in scene.traffic:
        driven = driven_as(scene, one) if len(found) <= most else None
        if driven is not None:
            found[one.name] = driven
    return {
        name: replace(one, traffic=tuple(o for o in one.traffic if o.name not in found))
        for name, one in found.items()
    }


def least_by_shapely(plans: Iterable[Plan]) -> float:
    """Least distance of any two while both are there [m]."""
    least = math.inf
    for one, other in itertools.combinations(plans, 2):
        begin = max(one.start_time, other.start_time)
        end = min(plan.start_time + plan.duration for plan in (one, other))
        times = np.arange(begin, end, STEP)
        bodies = [
            shapely.polygons(SE2(plan.pose_at(times)[:, None]).act(VEHICLE.footprint.corners))
            for plan in (one, other)
        ]
        least = min(least, float(shapely.distance(*bodies).min(initial=math.inf)))
    return least


def row(path: Path, most: int) -> list[str] | None:
    """What became of a file; None if it has no such cars, or is damaged."""
    try:
        scenes = scenes_of(read_commonroad(path)[0].road, most)
    except InvalidScenario as error:
        print(error, file=sys.stderr)
        return None
    if len(scenes) < 2:
        return None
    begun = time.perf_counter()
    drive = drive_roads(scenes, VEHICLE, time_limit=10.0)
    took = time.perf_counter() - begun - drive.before.search_s
    drives = drive.results.values()
    steps = sum(len(one.steps) for one in drives)
    return [
        path.stem,
        str(len(scenes)),
        str(len(drive.before.plans)),
        str(sum(one.reached for one in drives)),
        f"{drive.distance_m:.3f}",
        f"{least_by_shapely(drive.plans.values()):.3f}",
        str(sum(not one.verdict.clean for one in drives)),
        str(steps),
        f"{1e3 * took / max(steps, 1):.0f}",
    ]


def main() -> None:
    """Drive them all, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--most", type=int, default=3)
    arguments = parser.parse_args()
    if not present("commonroad/scenarios"):
        return
    rows = []
    for path in sorted(SCENARIOS.glob("*.xml")):
        if arguments.names and not any(name in path.name for name in arguments.names):
            continue
        found = row(path, arguments.most)
        if found is not None:
            rows.append(found)
            print(*found, flush=True)
    print()
    columns = ["scene", "vehicles", "planned", "reached", "least [m]", "shapely [m]"]
    show([*columns, "not clean", "steps", "ms a step"], rows)


if __name__ == "__main__":
    main()

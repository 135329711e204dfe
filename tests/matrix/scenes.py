"""Scenes of a vehicle: made of what it does where there is nothing in its way."""

from __future__ import annotations

import functools
import math

import numpy as np

from maneuver_automaton.collision import Disc, Motion, Obstacle
from maneuver_automaton.planning import PlanResult, plan
from tests.matrix import outside
from tests.matrix.measuring import TIME_LIMIT, found
from tests.matrix.vehicles import Vehicle


@functools.cache
def _base(vehicle_name: str) -> PlanResult:
    from tests.matrix.vehicles import VEHICLES

    vehicle = VEHICLES[vehicle_name]
    return plan(vehicle.problem(), time_limit=TIME_LIMIT)


def base(vehicle: Vehicle) -> PlanResult:
    """The plan in free space."""
    result = _base(vehicle.name)
    found(result)
    return result


def midway(vehicle: Vehicle, share: float = 0.5) -> np.ndarray:
    """Pose in the middle of the plan in free space."""
    motion = found(base(vehicle))
    return np.asarray(motion.pose_at(share * motion.duration))


def heading_midway(vehicle: Vehicle) -> float:
    """Its heading there; where it never turns, the direction in which it drives."""
    if vehicle.has_heading:
        return float(outside.flat(midway(vehicle))[2])
    way = midway(vehicle, 0.501) - midway(vehicle)
    return math.atan2(way[1], way[0])


def pillar(vehicle: Vehicle) -> Disc:
    """A disc that stands in the way."""
    return Disc(0.8 * vehicle.size, midway(vehicle)[:2])


@functools.cache
def _passing(vehicle_name: str) -> PlanResult:
    from tests.matrix.vehicles import VEHICLES

    vehicle = VEHICLES[vehicle_name]
    return plan(vehicle.problem(obstacles=[pillar(vehicle)]), time_limit=TIME_LIMIT)


def passing(vehicle: Vehicle) -> PlanResult:
    """The plan past the pillar."""
    return _passing(vehicle.name)


def beside(vehicle: Vehicle, offset: float) -> np.ndarray:
    """A place to the left of the middle of the plan in free space, so far off [m]."""
    return midway(vehicle)[:2] + offset * left(heading_midway(vehicle))


def left(heading: float) -> np.ndarray:
    """Unit vector to the left of a heading."""
    return np.array([-math.sin(heading), math.cos(heading)])


def crossing(vehicle: Vehicle) -> Obstacle:
    """A disc that crosses the way where the vehicle would be."""
    duration = found(base(vehicle)).duration
    reach = 0.3 * vehicle.reach
    here, there = beside(vehicle, reach), beside(vehicle, -reach)
    motion = Motion([0.0, duration], [[*here, 0.0], [*there, 0.0]])
    return Obstacle(Disc(0.6 * vehicle.size), motion=motion)


def slow_speed(vehicle: Vehicle) -> float:
    """A speed [m/s] that only the slower trims keep."""
    return (vehicle.slow or 0.5 * vehicle.fastest) * 1.02


def fixed_duration(vehicle: Vehicle) -> float:
    """A duration [s] that leaves the plan half as much again as it needs."""
    return 1.5 * found(base(vehicle)).duration

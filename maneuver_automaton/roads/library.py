"""The maneuver automaton of a car on the road: trims on a grid, ramps between them.

A trim is a speed and a steering angle that are held. The angles of a speed are spread between
those of the lateral limit, closer to straight ahead, so that fast driving has as many as slow
driving. Every maneuver lasts the same time and changes both at constant rates.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from maneuver_automaton.roads import _kernels_library
from maneuver_automaton.roads._kernels_library import Limits, Maneuvers, Trims
from maneuver_automaton.roads.vehicle import RoadVehicle

TICK = 0.1  # [s]
TICKS = 5  # of a maneuver
SPEED_STEP = 1.0  # [m/s]
SHARES = (0.0, 0.05, 0.16, 0.36, 0.66, 1.0)  # of the sharpest angle, to either side
SHARPEST = 0.6  # [rad] of the angles of a trim
FASTEST = 4  # steps of speed that a maneuver spans at most
LEFT_OUT = (2.5, 3.5)  # [m/s] changes of speed that others do as well


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RoadLibrary:
    """Trims and maneuvers of one vehicle."""

    limits: Limits
    trims: Trims
    maneuvers: Maneuvers

    def name(self, trim: int) -> str:
        """What pictures and files call a trim."""
        speed, steering = self.trims.speed[trim], self.trims.steering[trim]
        return f"speed {speed:g}, steering {steering:.3g}"


def road_library(vehicle: RoadVehicle, *, top_speed: float) -> RoadLibrary:
    """Trims of speeds up to `top_speed` [m/s], and all maneuvers between them.

    Examples
    --------
    >>> library = road_library(RoadVehicle(), top_speed=3.0)
    >>> library.trims.speed.size, library.maneuvers.pose.shape[1:]
    (44, (5, 3))
    """
    speeds = SPEED_STEP * np.arange(math.floor(top_speed / SPEED_STEP + 1e-9) + 1)
    shares = np.array([*(-share for share in SHARES[:0:-1]), *SHARES])
    sharpest = np.minimum(vehicle.sharpest(speeds), min(SHARPEST, vehicle.model.max_steering))
    limits = Limits(
        wheelbase=vehicle.model.wheelbase,
        tick=TICK,
        ticks=TICKS,
        rate=vehicle.model.max_steering_rate,
        braking=vehicle.model.max_acceleration,
        lateral=vehicle.lateral,
        friction=vehicle.friction,
        engine=min(vehicle.engine, vehicle.model.max_acceleration),
        power_speed=vehicle.power_speed,
        left_out=LEFT_OUT,
        fastest_change=FASTEST,
        mind_braking=0.05,
        mind_lateral=0.05,
        mind_jerk=0.002,
    )
    trims = Trims(
        speed=np.repeat(speeds, shares.size),
        steering=(sharpest[:, None] * shares).ravel(),
        per_speed=shares.size,
    )
    most = trims.speed.size * (2 * FASTEST + 1) * shares.size
    return RoadLibrary(
        limits=limits,
        trims=trims,
        maneuvers=_kernels_library.maneuvers_between(limits, trims, most),
    )

"""The maneuver automaton of a car on the road: trims on a grid, ramps between them.

A trim is a speed and a steering angle that are held. The angles of a speed are spread between
those of the lateral limit and of the car itself, closer to straight ahead, and no two neighbours
are further apart than a maneuver can steer: tight turns, which only slow driving admits, need more
of them. Every maneuver lasts the same time and changes both at constant rates.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.roads import _kernels_library
from maneuver_automaton.roads._kernels_library import Limits, Maneuvers, Trims
from maneuver_automaton.roads.vehicle import RoadVehicle

LONGEST_TICK = 0.1  # [s] the proof between two ticks is for motions this short
LASTING = 0.5  # [s] of a maneuver, or the nearest number of ticks
SPEED_STEP = 1.0  # [m/s]
SHARES = (0.0, 0.05, 0.16, 0.36, 0.66, 1.0)  # of the sharpest angle, to either side
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


def tick_of(step: float) -> float:
    """The longest tick of at most 0.1 s that divides the time step [s] of a scene.

    Examples
    --------
    >>> tick_of(0.1), tick_of(0.25), tick_of(0.04)
    (0.1, 0.08333333333333333, 0.04)
    """
    return step / math.ceil(step / LONGEST_TICK - 1e-9)


def road_library(
    vehicle: RoadVehicle, *, top_speed: float, tick: float = LONGEST_TICK
) -> RoadLibrary:
    """Trims of speeds up to `top_speed` [m/s], and all maneuvers between them.

    Examples
    --------
    >>> library = road_library(RoadVehicle(), top_speed=3.0)
    >>> library.trims.speed.size, library.maneuvers.pose.shape[1:]
    (66, (5, 3))
    >>> float(library.trims.steering.max())
    1.066
    """
    speeds = SPEED_STEP * np.arange(math.floor(top_speed / SPEED_STEP + 1e-9) + 1)
    ticks = max(round(LASTING / tick), 1)
    angles = [
        _angles(float(sharpest), most=vehicle.model.max_steering_rate * tick * ticks)
        for sharpest in vehicle.sharpest(speeds)
    ]
    counts = [len(one) for one in angles]
    limits = Limits(
        wheelbase=vehicle.model.wheelbase,
        tick=tick,
        ticks=ticks,
        rate=vehicle.model.max_steering_rate,
        sharpest=vehicle.model.max_steering,
        braking=vehicle.model.max_acceleration,
        lateral=vehicle.lateral,
        friction=vehicle.friction,
        engine=min(vehicle.engine, vehicle.model.max_acceleration),
        power_speed=vehicle.power_speed,
        left_out=LEFT_OUT,
        fastest_change=FASTEST,
        weight_along=0.05,
        weight_across=0.05,
        weight_jerk=0.002,
    )
    trims = Trims(
        speed=np.repeat(speeds, counts),
        steering=np.concatenate(angles),
        first=np.cumsum([0, *counts]).astype(np.int64),
    )
    most = trims.speed.size * (2 * FASTEST + 1) * max(counts)
    return RoadLibrary(
        limits=limits,
        trims=trims,
        maneuvers=_kernels_library.maneuvers_between(limits, trims, most),
    )


def _angles(sharpest: float, *, most: float) -> Array:
    """Steering angles (n,) of one speed, neighbours at most `most` apart [rad]."""
    right = [0.0]
    for before, after in itertools.pairwise(SHARES):
        parts = max(math.ceil((after - before) * sharpest / most - 1e-9), 1)
        right += [sharpest * (before + (after - before) * k / parts) for k in range(1, parts + 1)]
    return np.array([*(-angle for angle in right[:0:-1]), *right])

"""The vehicle on the road: a second-order car, its body, and how hard it is driven."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, plain_numbers
from maneuver_automaton._brief import brief
from maneuver_automaton.collision import Box
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import SecondOrderCar


def bmw_320i() -> SecondOrderCar:
    """The car of CommonRoad's benchmarks, its acceleration held to what a dry road gives.

    Source: Althoff, Würsching (2020), *CommonRoad: Vehicle Models*, vehicle 2: wheelbase, limits of
    steering, speed. The 11.5 m/s^2 that it states are the limit of its tyres; 8 are used here.

    Examples
    --------
    >>> bmw_320i().max_steering
    1.066
    """
    return SecondOrderCar(
        wheelbase=2.5789,
        max_steering=1.066,
        max_speed=50.8,
        min_speed=0.0,
        max_acceleration=8.0,
        max_steering_rate=0.4,
    )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RoadVehicle:
    """A car with a rectangular body; the pose is that of the rear axle's middle.

    Source of the numbers: as `bmw_320i`; the middle is the center of mass.

    Examples
    --------
    >>> car = RoadVehicle()
    >>> car.middle_of([0.0, 0.0, 0.0]).round(4).tolist()
    [1.4227, 0.0, 0.0]
    >>> car.rear_of([3.0, 0.0, 0.0]).round(4).tolist()
    [1.5773, 0.0, 0.0]
    """

    model: SecondOrderCar = field(default_factory=bmw_320i)
    length: float = 4.508  # [m]
    width: float = 1.610  # [m]
    ahead: float = 1.42273  # [m] from the rear axle to the middle of the body
    power_speed: float = 7.319  # [m/s] beyond it, what the engine gives falls with speed
    engine: float = 8.0  # [m/s^2] the engine gives up to that speed
    lateral: float = 5.0  # [m/s^2] across, at most
    friction: float = 9.0  # [m/s^2] along and across together, at most

    __repr__ = brief

    def __post_init__(self) -> None:
        plain_numbers(self)
        for name in ("length", "width", "power_speed", "engine", "lateral", "friction"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"road vehicle: {name} must be positive, got {value}")
        if not math.isfinite(self.ahead):
            raise ValueError(f"road vehicle: ahead must be finite, got {self.ahead} m")

    @property
    def footprint(self) -> Box:
        """The body, seen from the rear axle."""
        return Box([self.length, self.width], [self.ahead, 0.0])

    def middle_of(self, rear: ArrayLike) -> Array:
        """Pose (..., 3) of the body's middle where the rear axle is at `rear` (..., 3)."""
        return (SE2(np.asarray(rear)) @ SE2(np.array([self.ahead, 0.0, 0.0]))).pose

    def rear_of(self, middle: ArrayLike) -> Array:
        """Pose (..., 3) of the rear axle where the body's middle is at `middle` (..., 3)."""
        return (SE2(np.asarray(middle)) @ SE2(np.array([-self.ahead, 0.0, 0.0]))).pose

    def steering_of(self, speed: float, turn_rate: float) -> float:
        """Steering angle that turns at a rate [rad/s], within the limit; zero at rest [rad]."""
        if speed <= 0.0:
            return 0.0
        angle = math.atan(turn_rate * self.model.wheelbase / speed)
        return min(max(angle, -self.model.max_steering), self.model.max_steering)

    def sharpest(self, speed: ArrayLike) -> Array:
        """Greatest steering angle at speeds [m/s] that keeps the lateral limit [rad]."""
        squares = np.maximum(np.square(np.asarray(speed, dtype=np.float64)), 1e-9)
        angles = np.arctan(self.lateral * self.model.wheelbase / squares)
        return np.minimum(angles, self.model.max_steering)

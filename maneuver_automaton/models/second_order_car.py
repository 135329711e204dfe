"""The second-order car: speed and steering angle change at limited rates."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from maneuver_automaton._arrays import Array, plain_numbers
from maneuver_automaton.groups import SE2, LieGroup
from maneuver_automaton.models._components import Components, no_parts, on_arrays
from maneuver_automaton.models._limits import (
    check_positive,
    check_steering,
    speed_limits,
    symmetric_limits,
)
from maneuver_automaton.models.car import Car


@dataclass(frozen=True, slots=True, kw_only=True)
class SecondOrderCar:
    """``speed' = acceleration, steering' = steering_rate``, rolling without slip.

    The reduced state is [speed, steering], the control [acceleration, steering_rate]; the pose is
    that of the middle of the rear axle, and ``heading' = speed tan(steering) / wheelbase``.

    Source: the *kinematic single-track model* of Althoff, Koschi, Manzinger (2017), CommonRoad:
    composable benchmarks for motion planning on roads, and its vehicle models.

    Parameters
    ----------
    wheelbase : float
        Distance from the rear to the front axle [m].
    max_steering : float
        Greatest steering angle to either side, less than pi / 2 [rad].
    max_speed : float
        Greatest speed [m/s].
    max_acceleration : float
        Greatest rate of the speed, up and down [m/s^2].
    max_steering_rate : float
        Greatest rate of the steering angle to either side [rad/s].
    min_speed : float, optional
        Least speed, negative in reverse [m/s]; ``-max_speed`` if None.
    max_lateral_acceleration : float, optional
        Greatest speed times turn rate [m/s^2]; no limit if None.

    Examples
    --------
    >>> car = SecondOrderCar(wheelbase=2.8, max_steering=0.75, max_speed=2.5,
    ...                      max_acceleration=1.0, max_steering_rate=0.5)
    >>> car.body_velocity(np.array([2.0, 0.5]), np.array([1.0, 0.0])).round(3).tolist()
    [2.0, 0.0, 0.39]
    >>> car.reduced_limits.tolist()
    [[-2.5, 2.5], [-0.75, 0.75]]
    """

    wheelbase: float  # [m]
    max_steering: float  # [rad]
    max_speed: float  # [m/s]
    max_acceleration: float  # [m/s^2]
    max_steering_rate: float  # [rad/s]
    min_speed: float | None = None  # [m/s]
    max_lateral_acceleration: float | None = None  # [m/s^2]
    name: ClassVar[str] = "second_order_car"
    group: ClassVar[type[LieGroup]] = SE2
    control_names: ClassVar[tuple[str, ...]] = ("acceleration", "steering_rate")
    reduced_names: ClassVar[tuple[str, ...]] = ("speed", "steering")
    part_names: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        plain_numbers(self)
        check_positive(
            self.name,
            wheelbase=self.wheelbase,
            max_steering=self.max_steering,
            max_speed=self.max_speed,
            max_acceleration=self.max_acceleration,
            max_steering_rate=self.max_steering_rate,
            max_lateral_acceleration=self.max_lateral_acceleration,
        )
        check_steering(self.name, self.max_steering)
        speed_limits(self.name, self.min_speed, self.max_speed)

    @property
    def turning_radius(self) -> float:
        """Radius of the tightest circle of the rear axle [m]."""
        return self.wheelbase / math.tan(self.max_steering)

    @property
    def control_limits(self) -> Array:
        """Least and greatest acceleration [m/s^2] and steering rate [rad/s]: (2, 2)."""
        return symmetric_limits(self.max_acceleration, self.max_steering_rate)

    @property
    def reduced_limits(self) -> Array:
        """Least and greatest speed [m/s] and steering angle [rad]: (2, 2)."""
        limits = symmetric_limits(self.max_speed, self.max_steering)
        limits[0] = speed_limits(self.name, self.min_speed, self.max_speed)
        return limits

    @property
    def kinematic(self) -> Car:
        """The car whose paths it can follow if it stops where the curvature jumps."""
        return Car(wheelbase=self.wheelbase, max_steering=self.max_steering)

    def state_along(self, twist: Array, pace: float) -> Array:
        """Reduced state (2,) in which it moves with ``pace * twist``: the wheel stays as it is.

        Examples
        --------
        >>> car = SecondOrderCar(wheelbase=2.0, max_steering=1.0, max_speed=2.0,
        ...                      max_acceleration=1.0, max_steering_rate=0.5)
        >>> car.state_along(np.array([-1.0, 0.0, 0.5]), 0.0).round(4).tolist()
        [-0.0, -0.7854]
        """
        steering = math.atan(self.wheelbase * float(twist[2]) / float(twist[0]))
        return np.array([pace * float(twist[0]), steering])

    def velocity(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Components of the twist: (speed, 0, speed tan(steering) / wheelbase)."""
        return z[0], 0.0, z[0] * np.tan(z[1]) / self.wheelbase

    def dynamics(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Rates of [speed, steering]: the control."""
        return u[0], u[1]

    def body_velocity(self, reduced_state: Array, control: Array) -> Array:
        """Twist (..., 3) [m/s, m/s, rad/s]; see `velocity`."""
        return on_arrays(self.velocity, reduced_state, control, sizes=(2, 2, 3))

    def reduced_dynamics(self, reduced_state: Array, control: Array) -> Array:
        """Rates (..., 2) [m/s^2, rad/s]; see `dynamics`."""
        return on_arrays(self.dynamics, reduced_state, control, sizes=(2, 2, 2))

    def part_poses(self, reduced_state: Array) -> Array:
        """Carries nothing: (..., 0, 3)."""
        return no_parts(reduced_state)

"""The car whose speed changes at limited rates, and whose steering is at once where it is asked."""

from __future__ import annotations

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


@dataclass(frozen=True, slots=True, kw_only=True)
class AcceleratingCar:
    """``speed' = acceleration``, rolling without slip; control [acceleration, steering].

    The reduced state is [speed]; ``heading' = speed tan(steering) / wheelbase``. The pose is that
    of the middle of the rear axle.

    Source: the car of the toolbox AROC; Kochdumper et al. (2021), *AROC: a toolbox for automated
    reachset optimal controller synthesis*, HSCC.

    Parameters
    ----------
    wheelbase : float
        Distance from the rear to the front axle [m].
    max_steering : float
        Greatest steering angle to either side, less than pi / 2 [rad].
    max_speed, max_acceleration : float
        Greatest speed [m/s], greatest rate of it up and down [m/s^2].
    min_speed : float, optional
        Least speed, negative in reverse [m/s]; ``-max_speed`` if None.
    max_lateral_acceleration : float, optional
        Greatest speed times turn rate [m/s^2]; no limit if None.

    Examples
    --------
    >>> car = AcceleratingCar(wheelbase=2.3, max_steering=1.0, max_speed=30.0, max_acceleration=9.0)
    >>> car.body_velocity(np.array([2.3]), np.array([1.0, np.pi / 4])).round(3).tolist()
    [2.3, 0.0, 1.0]
    """

    wheelbase: float  # [m]
    max_steering: float  # [rad]
    max_speed: float  # [m/s]
    max_acceleration: float  # [m/s^2]
    min_speed: float | None = None  # [m/s]
    max_lateral_acceleration: float | None = None  # [m/s^2]
    name: ClassVar[str] = "accelerating_car"
    group: ClassVar[type[LieGroup]] = SE2
    control_names: ClassVar[tuple[str, ...]] = ("acceleration", "steering")
    reduced_names: ClassVar[tuple[str, ...]] = ("speed",)
    part_names: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        plain_numbers(self)
        check_positive(
            self.name,
            wheelbase=self.wheelbase,
            max_steering=self.max_steering,
            max_speed=self.max_speed,
            max_acceleration=self.max_acceleration,
            max_lateral_acceleration=self.max_lateral_acceleration,
        )
        check_steering(self.name, self.max_steering)
        speed_limits(self.name, self.min_speed, self.max_speed)

    @property
    def control_limits(self) -> Array:
        """Least and greatest acceleration [m/s^2] and steering angle [rad]: (2, 2)."""
        return symmetric_limits(self.max_acceleration, self.max_steering)

    @property
    def reduced_limits(self) -> Array:
        """Least and greatest speed [m/s]: (1, 2)."""
        return np.array([speed_limits(self.name, self.min_speed, self.max_speed)])

    def velocity(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Components of the twist: (speed, 0, speed tan(steering) / wheelbase)."""
        return z[0], 0.0, z[0] * np.tan(u[1]) / self.wheelbase

    def dynamics(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Rate of [speed]: the acceleration."""
        return (u[0],)

    def body_velocity(self, reduced_state: Array, control: Array) -> Array:
        """Twist (..., 3) [m/s, m/s, rad/s]; see `velocity`."""
        return on_arrays(self.velocity, reduced_state, control, sizes=(1, 2, 3))

    def reduced_dynamics(self, reduced_state: Array, control: Array) -> Array:
        """Rate (..., 1) [m/s^2]; see `dynamics`."""
        return on_arrays(self.dynamics, reduced_state, control, sizes=(1, 2, 1))

    def part_poses(self, reduced_state: Array) -> Array:
        """Carries nothing: (..., 0, 3)."""
        return no_parts(reduced_state)

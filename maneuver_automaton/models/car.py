"""The kinematic car: a single-track vehicle that rolls without slip."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from maneuver_automaton._arrays import Array, as_array, plain_numbers
from maneuver_automaton.groups import SE2, LieGroup
from maneuver_automaton.models._components import Components, no_parts, no_rates, on_arrays
from maneuver_automaton.models._limits import check_positive, check_steering, symmetric_limits


@dataclass(frozen=True, slots=True, kw_only=True)
class Car:
    """``heading' = v tan(steering) / wheelbase``, driving along its heading; control [v, steering].

    The pose is that of the middle of the rear axle.

    Source: LaValle (2006), *Planning Algorithms*, Eq. (13.15).

    Parameters
    ----------
    wheelbase : float
        Distance from the rear to the front axle [m].
    max_steering : float, optional
        Greatest steering angle to either side, less than pi / 2 [rad]; pi / 2 itself if None.
    max_speed : float, optional
        Greatest speed, forward and in reverse [m/s]; no limit if None.
    max_lateral_acceleration : float, optional
        Greatest speed times turn rate [m/s^2]; no limit if None.

    Examples
    --------
    >>> car = Car(wheelbase=2.5, max_steering=0.6)
    >>> car.body_velocity(np.zeros(0), np.array([2.0, 0.5])).round(3).tolist()
    [2.0, 0.0, 0.437]
    >>> round(car.turning_radius, 2)
    3.65
    """

    wheelbase: float  # [m]
    max_steering: float | None = None  # [rad]
    max_speed: float | None = None  # [m/s]
    max_lateral_acceleration: float | None = None  # [m/s^2]
    name: ClassVar[str] = "car"
    group: ClassVar[type[LieGroup]] = SE2
    control_names: ClassVar[tuple[str, ...]] = ("speed", "steering")
    reduced_names: ClassVar[tuple[str, ...]] = ()
    part_names: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        plain_numbers(self)
        if not (math.isfinite(self.wheelbase) and self.wheelbase > 0.0):
            raise ValueError(f"car: wheelbase must be positive, got {self.wheelbase} m")
        check_positive(
            self.name,
            max_steering=self.max_steering,
            max_speed=self.max_speed,
            max_lateral_acceleration=self.max_lateral_acceleration,
        )
        if self.max_steering is not None:
            check_steering(self.name, self.max_steering)

    @property
    def turning_radius(self) -> float:
        """Radius of the tightest circle of the rear axle [m]; zero if steering has no limit."""
        if self.max_steering is None:
            return 0.0
        return self.wheelbase / math.tan(self.max_steering)

    @property
    def control_limits(self) -> Array:
        """Least and greatest speed [m/s] and steering angle [rad]: (2, 2)."""
        steering = math.pi / 2 if self.max_steering is None else self.max_steering
        return symmetric_limits(self.max_speed, steering)

    @property
    def reduced_limits(self) -> Array:
        """No reduced state: (0, 2)."""
        return np.zeros((0, 2))

    def velocity(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Components of the twist: (speed, 0, speed tan(steering) / wheelbase)."""
        return u[0], 0.0, u[0] * np.tan(u[1]) / self.wheelbase

    def dynamics(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """No reduced state: ()."""
        return no_rates(z, u)

    def body_velocity(self, reduced_state: Array, control: Array) -> Array:
        """Twist (..., 3) [m/s, m/s, rad/s]; see `velocity`."""
        steering = np.abs(as_array("control", control, last=2)[..., 1])
        if np.any(steering >= math.pi / 2):
            worst = float(steering.max())
            raise ValueError(f"car: steering must be less than pi / 2, got {worst:.6g} rad")
        return on_arrays(self.velocity, reduced_state, control, sizes=(0, 2, 3))

    def reduced_dynamics(self, reduced_state: Array, control: Array) -> Array:
        """No reduced state: (..., 0)."""
        return on_arrays(self.dynamics, reduced_state, control, sizes=(0, 2, 0))

    def part_poses(self, reduced_state: Array) -> Array:
        """Carries nothing: (..., 0, 3)."""
        return no_parts(reduced_state)

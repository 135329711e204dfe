"""The car with a trailer: the angle at the hitch is its reduced state."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from maneuver_automaton._arrays import Array, as_array, plain_numbers
from maneuver_automaton.groups import SE2, LieGroup
from maneuver_automaton.models._components import Components, on_arrays
from maneuver_automaton.models._limits import (
    check_positive,
    check_steering,
    speed_limits,
    symmetric_limits,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class CarWithTrailer:
    """A kinematic car that pulls one trailer, hitched at its rear axle; control [speed, steering].

    The reduced state is [hitch], the heading of the car less that of the trailer:
    ``hitch' = speed tan(steering) / wheelbase - speed sin(hitch) / hitch_length``. The pose is
    that of the middle of the car's rear axle. In reverse the hitch is unstable.

    Source: LaValle (2006), *Planning Algorithms*, Eq. (13.19), for one trailer.

    Parameters
    ----------
    wheelbase, hitch_length : float
        Distance of the axles of the car; of the trailer's axle from the hitch [m].
    max_steering : float
        Greatest steering angle to either side, less than pi / 2 [rad].
    max_speed : float
        Greatest speed [m/s].
    min_speed : float, optional
        Least speed, negative in reverse [m/s]; ``-max_speed`` if None.
    max_hitch : float, optional
        Greatest angle at the hitch to either side [rad]; no limit if None.
    max_lateral_acceleration : float, optional
        Greatest speed times turn rate [m/s^2]; no limit if None.

    Examples
    --------
    >>> truck = CarWithTrailer(wheelbase=0.25, hitch_length=0.5, max_steering=1.0, max_speed=0.5)
    >>> truck.reduced_dynamics(np.array([np.pi / 2]), np.array([0.5, 0.0])).tolist()
    [-1.0]
    >>> (truck.part_poses(np.array([np.pi / 2])).round(3) + 0.0).tolist()
    [[0.0, 0.5, -1.571]]
    """

    wheelbase: float  # [m]
    hitch_length: float  # [m]
    max_steering: float  # [rad]
    max_speed: float  # [m/s]
    min_speed: float | None = None  # [m/s]
    max_hitch: float | None = None  # [rad]
    max_lateral_acceleration: float | None = None  # [m/s^2]
    name: ClassVar[str] = "car_with_trailer"
    group: ClassVar[type[LieGroup]] = SE2
    control_names: ClassVar[tuple[str, ...]] = ("speed", "steering")
    reduced_names: ClassVar[tuple[str, ...]] = ("hitch",)
    part_names: ClassVar[tuple[str, ...]] = ("trailer",)

    def __post_init__(self) -> None:
        plain_numbers(self)
        check_positive(
            self.name,
            wheelbase=self.wheelbase,
            hitch_length=self.hitch_length,
            max_steering=self.max_steering,
            max_speed=self.max_speed,
            max_hitch=self.max_hitch,
            max_lateral_acceleration=self.max_lateral_acceleration,
        )
        check_steering(self.name, self.max_steering)
        speed_limits(self.name, self.min_speed, self.max_speed)

    @property
    def control_limits(self) -> Array:
        """Least and greatest speed [m/s] and steering angle [rad]: (2, 2)."""
        limits = symmetric_limits(self.max_speed, self.max_steering)
        limits[0] = speed_limits(self.name, self.min_speed, self.max_speed)
        return limits

    @property
    def reduced_limits(self) -> Array:
        """Least and greatest angle at the hitch [rad]: (1, 2)."""
        return symmetric_limits(self.max_hitch)

    def velocity(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Components of the twist: (speed, 0, speed tan(steering) / wheelbase)."""
        return u[0], 0.0, u[0] * np.tan(u[1]) / self.wheelbase

    def dynamics(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Rate of [hitch]: turn rate of the car less that of the trailer."""
        return (u[0] * np.tan(u[1]) / self.wheelbase - u[0] * np.sin(z[0]) / self.hitch_length,)

    def body_velocity(self, reduced_state: Array, control: Array) -> Array:
        """Twist (..., 3) [m/s, m/s, rad/s]; see `velocity`."""
        return on_arrays(self.velocity, reduced_state, control, sizes=(1, 2, 3))

    def reduced_dynamics(self, reduced_state: Array, control: Array) -> Array:
        """Rate (..., 1) [rad/s]; see `dynamics`."""
        return on_arrays(self.dynamics, reduced_state, control, sizes=(1, 2, 1))

    def part_frames(self, z: Components, /) -> tuple[tuple[Any, Any, Any], ...]:
        """Components of the pose of each part: the middle of the trailer's axle.

        Source: turned back by the hitch angle, then back along the trailer by its length.
        """
        return ((-self.hitch_length * np.cos(z[0]), self.hitch_length * np.sin(z[0]), -z[0]),)

    def part_poses(self, reduced_state: Array) -> Array:
        """Pose (..., 1, 3) of the trailer, seen from the car; see `part_frames`."""
        hitch = as_array("reduced state", reduced_state, last=1)[..., 0]
        ((x, y, heading),) = self.part_frames([hitch])
        return np.stack([x, y, heading], axis=-1)[..., None, :]

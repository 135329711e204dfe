"""The second-order unicycle: a robot whose speed and turn rate change at limited rates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from maneuver_automaton._arrays import Array, plain_numbers
from maneuver_automaton.groups import SE2, LieGroup
from maneuver_automaton.models._components import Components, no_parts, on_arrays
from maneuver_automaton.models._limits import check_positive, speed_limits, symmetric_limits
from maneuver_automaton.models.unicycle import Unicycle


@dataclass(frozen=True, slots=True, kw_only=True)
class SecondOrderUnicycle:
    """``speed' = acceleration, turn_rate' = angular_acceleration``, driving along its heading.

    The reduced state is [speed, turn_rate], the control [acceleration, angular_acceleration].

    Source: Ortiz-Haro, Hönig, Hartmann, Toussaint, iDb-A*: iterative search and optimization
    for optimal kinodynamic motion planning (2024), second-order unicycle; LaValle (2006),
    *Planning Algorithms*, Sec. 13.2.4.

    Parameters
    ----------
    max_speed, max_turn_rate : float
        Greatest speed [m/s]; greatest turn rate to either side [rad/s].
    max_acceleration, max_angular_acceleration : float
        Greatest rate of the speed [m/s^2] and of the turn rate [rad/s^2], up and down.
    min_speed : float, optional
        Least speed, negative in reverse [m/s]; ``-max_speed`` if None.

    Examples
    --------
    >>> robot = SecondOrderUnicycle(max_speed=0.5, max_turn_rate=0.5, max_acceleration=0.25,
    ...                             max_angular_acceleration=0.25)
    >>> robot.velocity([0.4, 0.1], [0.25, 0.0])
    (0.4, 0.0, 0.1)
    >>> robot.dynamics([0.4, 0.1], [0.25, 0.0])
    (0.25, 0.0)
    """

    max_speed: float  # [m/s]
    max_turn_rate: float  # [rad/s]
    max_acceleration: float  # [m/s^2]
    max_angular_acceleration: float  # [rad/s^2]
    min_speed: float | None = None  # [m/s]
    name: ClassVar[str] = "second_order_unicycle"
    group: ClassVar[type[LieGroup]] = SE2
    control_names: ClassVar[tuple[str, ...]] = ("acceleration", "angular_acceleration")
    reduced_names: ClassVar[tuple[str, ...]] = ("speed", "turn_rate")
    part_names: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        plain_numbers(self)
        check_positive(
            self.name,
            max_speed=self.max_speed,
            max_turn_rate=self.max_turn_rate,
            max_acceleration=self.max_acceleration,
            max_angular_acceleration=self.max_angular_acceleration,
        )
        speed_limits(self.name, self.min_speed, self.max_speed)

    @property
    def control_limits(self) -> Array:
        """Least and greatest acceleration [m/s^2] and angular acceleration [rad/s^2]: (2, 2)."""
        return symmetric_limits(self.max_acceleration, self.max_angular_acceleration)

    @property
    def reduced_limits(self) -> Array:
        """Least and greatest speed [m/s] and turn rate [rad/s]: (2, 2)."""
        limits = symmetric_limits(self.max_speed, self.max_turn_rate)
        limits[0] = speed_limits(self.name, self.min_speed, self.max_speed)
        return limits

    @property
    def kinematic(self) -> Unicycle:
        """The unicycle whose paths it can follow if it stops where the twist jumps."""
        return Unicycle()

    def state_along(self, twist: Array, pace: float) -> Array:
        """Reduced state (2,) in which it moves with ``pace * twist``."""
        return np.array([pace * float(twist[0]), pace * float(twist[2])])

    def velocity(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Components of the twist: (speed, 0, turn_rate)."""
        return z[0], 0.0, z[1]

    def dynamics(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Rates of [speed, turn_rate]: the control."""
        return u[0], u[1]

    def body_velocity(self, reduced_state: Array, control: Array) -> Array:
        """Twist (..., 3) [m/s, m/s, rad/s]; see `velocity`."""
        return on_arrays(self.velocity, reduced_state, control, sizes=(2, 2, 3))

    def reduced_dynamics(self, reduced_state: Array, control: Array) -> Array:
        """Rates (..., 2) [m/s^2, rad/s^2]; see `dynamics`."""
        return on_arrays(self.dynamics, reduced_state, control, sizes=(2, 2, 2))

    def part_poses(self, reduced_state: Array) -> Array:
        """Carries nothing: (..., 0, 3)."""
        return no_parts(reduced_state)

"""The helicopter: it tilts to go where it wants, and climbs and turns beside."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from maneuver_automaton._arrays import Array, plain_numbers
from maneuver_automaton.groups import LieGroup, SE2xR
from maneuver_automaton.models._components import Components, no_parts, on_arrays
from maneuver_automaton.models._limits import check_positive, speed_limits, symmetric_limits


@dataclass(frozen=True, slots=True, kw_only=True)
class Helicopter:
    """A small helicopter, seen in the upright frame that turns with its heading.

    The reduced state is [speed, lateral_speed, climb, turn_rate, tilt, lateral_tilt], the control
    [tilt_rate, lateral_tilt_rate, climb_acceleration, angular_acceleration]. Tilt is counted from
    the vertical, ahead and to the left; with w = g + climb_acceleration, the thrust over the mass
    that is left upright,

    ``v_x' = w tan(tilt) - c v_x + r v_y``, ``v_y' = w tan(lateral_tilt) - c v_y - r v_x``,
    ``v_z' = climb_acceleration``, ``r' = angular_acceleration``.

    Simplified against the source: the inner loops are taken to follow, so tilt changes at a rate
    that is commanded, not by moments; the two tilts are angles of the thrust against the vertical
    in the two upright planes of the body, so they do not couple; no thrust from the tail rotor, no
    flapping, drag linear in the speed, and a limit of the climb's acceleration instead of thrust.

    Source: Frazzoli, Dahleh, Feron (2002), *Real-time motion planning for agile autonomous
    vehicles*, Sec. V; (2005), *Maneuver-based motion planning for nonlinear systems with
    symmetries*, Sec. II: symmetric under translations and turns about the vertical.

    Parameters
    ----------
    max_speed, max_lateral_speed, max_climb : float
        Greatest speed ahead, aside and up or down [m/s].
    max_turn_rate : float
        Greatest turn rate to either side [rad/s].
    max_tilt : float
        Greatest tilt in either direction, less than pi / 2 [rad].
    max_tilt_rate : float
        Greatest rate of tilt [rad/s].
    max_climb_acceleration, max_angular_acceleration : float
        Greatest rate of the climb [m/s^2], less than gravity, and of the turn rate [rad/s^2].
    drag : float
        Drag over speed and mass [1/s].
    min_speed : float, optional
        Least speed, negative backwards [m/s]; ``-max_speed`` if None.
    gravity : float
        Acceleration of free fall [m/s^2].

    Examples
    --------
    >>> craft = Helicopter(max_speed=10.0, max_lateral_speed=3.0, max_climb=3.0, max_turn_rate=1.0,
    ...                    max_tilt=0.6, max_tilt_rate=1.5, max_climb_acceleration=3.0,
    ...                    max_angular_acceleration=2.0)
    >>> left_turn = [5.0, 0.0, 1.0, 0.5, 0.0, np.arctan(2.5 / 9.81)]
    >>> [round(float(rate), 9) + 0.0 for rate in craft.dynamics(left_turn, [0.0, 0.0, 0.0, 0.0])]
    [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    """

    max_speed: float  # [m/s]
    max_lateral_speed: float  # [m/s]
    max_climb: float  # [m/s]
    max_turn_rate: float  # [rad/s]
    max_tilt: float  # [rad]
    max_tilt_rate: float  # [rad/s]
    max_climb_acceleration: float  # [m/s^2]
    max_angular_acceleration: float  # [rad/s^2]
    drag: float = 0.0  # [1/s]
    min_speed: float | None = None  # [m/s]
    gravity: float = 9.81  # [m/s^2]
    name: ClassVar[str] = "helicopter"
    group: ClassVar[type[LieGroup]] = SE2xR
    control_names: ClassVar[tuple[str, ...]] = (
        "tilt_rate",
        "lateral_tilt_rate",
        "climb_acceleration",
        "angular_acceleration",
    )
    reduced_names: ClassVar[tuple[str, ...]] = (
        "speed",
        "lateral_speed",
        "climb",
        "turn_rate",
        "tilt",
        "lateral_tilt",
    )
    part_names: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        plain_numbers(self)
        check_positive(
            self.name,
            max_speed=self.max_speed,
            max_lateral_speed=self.max_lateral_speed,
            max_climb=self.max_climb,
            max_turn_rate=self.max_turn_rate,
            max_tilt=self.max_tilt,
            max_tilt_rate=self.max_tilt_rate,
            max_climb_acceleration=self.max_climb_acceleration,
            max_angular_acceleration=self.max_angular_acceleration,
            gravity=self.gravity,
        )
        if not 0.0 <= self.drag < math.inf:
            raise ValueError(f"{self.name}: drag must not be negative, got {self.drag} 1/s")
        if not self.max_tilt < math.pi / 2:
            raise ValueError(
                f"{self.name}: max_tilt must be less than pi / 2, got {self.max_tilt} rad"
            )
        if not self.max_climb_acceleration < self.gravity:
            raise ValueError(
                f"{self.name}: max_climb_acceleration must be less than gravity "
                f"{self.gravity} m/s^2, got {self.max_climb_acceleration} m/s^2"
            )
        speed_limits(self.name, self.min_speed, self.max_speed)

    @property
    def control_limits(self) -> Array:
        """Least and greatest tilt rates [rad/s] and accelerations [m/s^2, rad/s^2]: (4, 2)."""
        return symmetric_limits(
            self.max_tilt_rate,
            self.max_tilt_rate,
            self.max_climb_acceleration,
            self.max_angular_acceleration,
        )

    @property
    def reduced_limits(self) -> Array:
        """Least and greatest speeds [m/s], turn rate [rad/s] and tilts [rad]: (6, 2)."""
        limits = symmetric_limits(
            self.max_speed,
            self.max_lateral_speed,
            self.max_climb,
            self.max_turn_rate,
            self.max_tilt,
            self.max_tilt,
        )
        limits[0] = speed_limits(self.name, self.min_speed, self.max_speed)
        return limits

    def velocity(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Components of the twist: (speed, lateral_speed, turn_rate, climb)."""
        return z[0], z[1], z[3], z[2]

    def dynamics(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Rates of [speed, lateral_speed, climb, turn_rate, tilt, lateral_tilt]."""
        upright = self.gravity + u[2]
        return (
            upright * np.tan(z[4]) - self.drag * z[0] + z[3] * z[1],
            upright * np.tan(z[5]) - self.drag * z[1] - z[3] * z[0],
            u[2],
            u[3],
            u[0],
            u[1],
        )

    def body_velocity(self, reduced_state: Array, control: Array) -> Array:
        """Twist (..., 4) [m/s, m/s, rad/s, m/s]; see `velocity`."""
        return on_arrays(self.velocity, reduced_state, control, sizes=(6, 4, 4))

    def reduced_dynamics(self, reduced_state: Array, control: Array) -> Array:
        """Rates (..., 6) of the reduced state per second; see `dynamics`."""
        return on_arrays(self.dynamics, reduced_state, control, sizes=(6, 4, 6))

    def part_poses(self, reduced_state: Array) -> Array:
        """Carries nothing: (..., 0, 3)."""
        return no_parts(reduced_state)

"""The omnidirectional platform: it moves ahead, aside and turns at once, as on mecanum wheels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from maneuver_automaton._arrays import Array, plain_numbers
from maneuver_automaton.groups import SE2, LieGroup
from maneuver_automaton.models._components import Components, no_parts, no_rates, on_arrays
from maneuver_automaton.models._limits import check_positive, symmetric_limits


@dataclass(frozen=True, slots=True, kw_only=True)
class Omnidirectional:
    """The control is the twist: [speed, lateral_speed, turn_rate], each with limits of its own.

    Source: Siegwart, Nourbakhsh, Scaramuzza (2011), *Introduction to Autonomous Mobile Robots*,
    Sec. 3.3, robots of three degrees of mobility.

    Parameters
    ----------
    max_speed : float, optional
        Greatest speed ahead and back [m/s]; no limit if None.
    max_lateral_speed : float, optional
        Greatest speed to either side [m/s]; no limit if None.
    max_turn_rate : float, optional
        Greatest turn rate to either side [rad/s]; no limit if None.

    Examples
    --------
    >>> platform = Omnidirectional(max_speed=1.0, max_lateral_speed=0.5)
    >>> platform.body_velocity(np.zeros(0), np.array([1.0, -0.5, 0.2])).tolist()
    [1.0, -0.5, 0.2]
    >>> platform.control_limits.tolist()
    [[-1.0, 1.0], [-0.5, 0.5], [-inf, inf]]
    """

    max_speed: float | None = None  # [m/s]
    max_lateral_speed: float | None = None  # [m/s]
    max_turn_rate: float | None = None  # [rad/s]
    name: ClassVar[str] = "omnidirectional"
    group: ClassVar[type[LieGroup]] = SE2
    control_names: ClassVar[tuple[str, ...]] = ("speed", "lateral_speed", "turn_rate")
    reduced_names: ClassVar[tuple[str, ...]] = ()
    part_names: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        plain_numbers(self)
        check_positive(
            self.name,
            max_speed=self.max_speed,
            max_lateral_speed=self.max_lateral_speed,
            max_turn_rate=self.max_turn_rate,
        )

    @property
    def control_limits(self) -> Array:
        """Least and greatest speed, lateral speed [m/s] and turn rate [rad/s]: (3, 2)."""
        return symmetric_limits(self.max_speed, self.max_lateral_speed, self.max_turn_rate)

    @property
    def reduced_limits(self) -> Array:
        """No reduced state: (0, 2)."""
        return np.zeros((0, 2))

    def velocity(self, z: Components, u: Components, /) -> Components:
        """Components of the twist: the control."""
        return u

    def dynamics(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """No reduced state: ()."""
        return no_rates(z, u)

    def body_velocity(self, reduced_state: Array, control: Array) -> Array:
        """Twist (..., 3) [m/s, m/s, rad/s]; see `velocity`."""
        return on_arrays(self.velocity, reduced_state, control, sizes=(0, 3, 3))

    def reduced_dynamics(self, reduced_state: Array, control: Array) -> Array:
        """No reduced state: (..., 0)."""
        return on_arrays(self.dynamics, reduced_state, control, sizes=(0, 3, 0))

    def part_poses(self, reduced_state: Array) -> Array:
        """Carries nothing: (..., 0, 3)."""
        return no_parts(reduced_state)

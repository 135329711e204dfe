"""The unicycle, the paper's mobile robot: it drives ahead and turns on the spot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from maneuver_automaton._arrays import Array, plain_numbers
from maneuver_automaton.groups import SE2, LieGroup
from maneuver_automaton.models._components import Components, no_parts, no_rates, on_arrays
from maneuver_automaton.models._limits import check_positive, symmetric_limits


@dataclass(frozen=True, slots=True, kw_only=True)
class Unicycle:
    """``x' = v cos(heading), y' = v sin(heading), heading' = omega``; control [v, omega].

    Source: LaValle (2006), *Planning Algorithms*, Sec. 13.1.2.3; the paper, Example 1.

    Parameters
    ----------
    max_speed : float, optional
        Greatest speed, forward and in reverse [m/s]; no limit if None.
    max_turn_rate : float, optional
        Greatest turn rate to either side [rad/s]; no limit if None.

    Examples
    --------
    >>> Unicycle().body_velocity(np.zeros(0), np.array([1.5, 0.2])).tolist()
    [1.5, 0.0, 0.2]
    >>> Unicycle(max_speed=2.0).control_limits.tolist()
    [[-2.0, 2.0], [-inf, inf]]
    """

    max_speed: float | None = None  # [m/s]
    max_turn_rate: float | None = None  # [rad/s]
    name: ClassVar[str] = "unicycle"
    group: ClassVar[type[LieGroup]] = SE2
    control_names: ClassVar[tuple[str, ...]] = ("speed", "turn_rate")
    reduced_names: ClassVar[tuple[str, ...]] = ()
    part_names: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        plain_numbers(self)
        check_positive(self.name, max_speed=self.max_speed, max_turn_rate=self.max_turn_rate)

    @property
    def control_limits(self) -> Array:
        """Least and greatest speed [m/s] and turn rate [rad/s]: (2, 2)."""
        return symmetric_limits(self.max_speed, self.max_turn_rate)

    @property
    def reduced_limits(self) -> Array:
        """No reduced state: (0, 2)."""
        return np.zeros((0, 2))

    def velocity(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Components of the twist: (speed, 0, turn_rate)."""
        return u[0], 0.0, u[1]

    def dynamics(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """No reduced state: ()."""
        return no_rates(z, u)

    def body_velocity(self, reduced_state: Array, control: Array) -> Array:
        """Twist (..., 3) [m/s, m/s, rad/s]; see `velocity`."""
        return on_arrays(self.velocity, reduced_state, control, sizes=(0, 2, 3))

    def reduced_dynamics(self, reduced_state: Array, control: Array) -> Array:
        """No reduced state: (..., 0)."""
        return on_arrays(self.dynamics, reduced_state, control, sizes=(0, 2, 0))

    def part_poses(self, reduced_state: Array) -> Array:
        """Carries nothing: (..., 0, 3)."""
        return no_parts(reduced_state)

"""Robots that state their speeds and turn rate, or the rates of these; bodies on a lattice."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.models.vehicle import Components, Vehicle


@dataclass(frozen=True, slots=True, kw_only=True)
class Unicycle(Vehicle):
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
    control_names: ClassVar[tuple[str, ...]] = ("speed", "turn_rate")

    def velocity(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Components of the twist: (speed, 0, turn_rate)."""
        return u[0], 0.0, u[1]


@dataclass(frozen=True, slots=True, kw_only=True)
class SecondOrderUnicycle(Vehicle):
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
    control_names: ClassVar[tuple[str, ...]] = ("acceleration", "angular_acceleration")
    reduced_names: ClassVar[tuple[str, ...]] = ("speed", "turn_rate")

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Omnidirectional(Vehicle):
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
    control_names: ClassVar[tuple[str, ...]] = ("speed", "lateral_speed", "turn_rate")

    def velocity(self, z: Components, u: Components, /) -> Components:
        """Components of the twist: the control."""
        return u


@dataclass(frozen=True, slots=True, kw_only=True)
class LatticeBody(Vehicle):
    """Its control is its twist; its reduced state is the direction it faces, as (cos, sin).

    Files of lattice primitives state poses, no vehicle: their motions hold on one grid, from one
    heading of a few to another. Such a grid has the symmetry of translations alone, so a heading
    is part of the reduced state. It stands here beside the pose of SE(2), which has it too:
    primitives that begin at a heading then join those that end there, and no others, and every plan
    stays on the grid.

    Source: Pivtoraiko, Kelly (2005), *Efficient constrained path planning via search in state
    lattices*, i-SAIRAS, for primitives that are fixed to their headings.

    Parameters
    ----------
    resolution : float
        Side of a cell [m].
    turning_radius : float, optional
        Least radius that the motions keep, where a file states one [m].

    Examples
    --------
    >>> body = LatticeBody(resolution=0.05)
    >>> north, spin = np.array([0.0, 1.0]), np.array([0.0, 0.0, 2.0])
    >>> body.body_velocity(north, spin).tolist(), body.reduced_dynamics(north, spin).tolist()
    ([0.0, 0.0, 2.0], [-2.0, 0.0])
    """

    resolution: float  # [m]
    turning_radius: float | None = None  # [m]
    name: ClassVar[str] = "lattice_body"
    control_names: ClassVar[tuple[str, ...]] = ("speed_ahead", "speed_aside", "turn_rate")
    reduced_names: ClassVar[tuple[str, ...]] = ("heading_cos", "heading_sin")

    @property
    def control_limits(self) -> Array:
        """No limits: (3, 2)."""
        return np.tile([-np.inf, np.inf], (3, 1))

    @property
    def reduced_limits(self) -> Array:
        """Limits of a cosine and a sine: (2, 2)."""
        return np.tile([-1.0, 1.0], (2, 1))

    def heading(self, reduced_state: Array) -> float:
        """Heading of the lattice [rad] that a direction (cos, sin) is."""
        return math.atan2(float(reduced_state[1]), float(reduced_state[0]))

    def velocity(self, z: Components, u: Components, /) -> Components:
        """Components of the twist: the control."""
        return u

    def dynamics(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Rates of the direction (cos, sin), which turns at the turn rate."""
        return -z[1] * u[2], z[0] * u[2]

"""A body on a lattice of positions and headings, which moves at any twist."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from maneuver_automaton._arrays import Array, plain_numbers
from maneuver_automaton.groups import SE2, LieGroup
from maneuver_automaton.models._components import Components, no_parts, on_arrays
from maneuver_automaton.models._limits import check_positive


@dataclass(frozen=True, slots=True, kw_only=True)
class LatticeBody:
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
    group: ClassVar[type[LieGroup]] = SE2
    control_names: ClassVar[tuple[str, ...]] = ("speed_ahead", "speed_aside", "turn_rate")
    reduced_names: ClassVar[tuple[str, ...]] = ("heading_cos", "heading_sin")
    part_names: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        plain_numbers(self)
        check_positive(self.name, resolution=self.resolution, turning_radius=self.turning_radius)

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

    def body_velocity(self, reduced_state: Array, control: Array) -> Array:
        """Twist (..., 3) [m/s, m/s, rad/s]; see `velocity`."""
        return on_arrays(self.velocity, reduced_state, control, sizes=(2, 3, 3))

    def reduced_dynamics(self, reduced_state: Array, control: Array) -> Array:
        """Rates (..., 2) [1/s]; see `dynamics`."""
        return on_arrays(self.dynamics, reduced_state, control, sizes=(2, 3, 2))

    def part_poses(self, reduced_state: Array) -> Array:
        """Carries nothing: (..., 0, 3)."""
        return no_parts(reduced_state)

"""The unicycle, the paper's mobile robot: it drives ahead and turns on the spot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array
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


def spatial_twist(state: ArrayLike, control: ArrayLike) -> Array:
    """Twist (..., 3) of the unicycle in the world frame: (v_1, v_2, u_2).

    With it the flow is ``exp(t xi) @ start``, with the twist in front; it depends on the state.
    The body twist of a trim stands behind, ``start @ exp(t xi)``, and does not. The two are
    related by ``spatial == Ad(start) body``.

    Source: the paper, Prop. 6.

    Examples
    --------
    >>> spatial_twist([0.0, 2.0, 0.0], [1.0, 0.5]).tolist()
    [2.0, 0.0, 0.5]
    """
    x, y, heading = np.moveaxis(as_array("state", state, last=3), -1, 0)
    speed, turn_rate = np.moveaxis(as_array("control", control, last=2), -1, 0)
    v_1 = speed * np.cos(heading) + turn_rate * y
    v_2 = speed * np.sin(heading) - turn_rate * x
    return np.stack([v_1, v_2, np.broadcast_to(turn_rate, v_1.shape)], axis=-1)


def flow(state: ArrayLike, control: ArrayLike, *, duration: ArrayLike) -> Array:
    """States (..., 3) reached under a constant control after `duration` (...,) [s].

    Source: the paper, Prop. 6, by its spatial twist. The second entry of the translation in
    the proof has a wrong sign in print; the statement, used here, is right.

    Examples
    --------
    >>> flow([0.0, 2.0, 0.0], [1.0, 0.5], duration=np.pi).round(3).tolist()
    [2.0, 4.0, 1.571]
    """
    seconds = as_array("duration", duration)[..., None]
    return (SE2.exp(seconds * spatial_twist(state, control)) @ SE2(as_array("state", state))).pose


def symmetry_matrix(shift: ArrayLike) -> Array:
    """Matrices (..., 4, 4) of the symmetry group of the unicycle, for shifts (..., 3) [m, m, rad].

    They multiply the state in homogeneous coordinates, (x, y, heading, 1).

    Source: the paper, Prop. 3.

    Examples
    --------
    >>> symmetry_matrix([1.0, 2.0, 0.0])[:, 3].tolist()
    [1.0, 2.0, 0.0, 1.0]
    """
    shift = as_array("shift", shift, last=3)
    matrix = np.zeros((*shift.shape[:-1], 4, 4))
    matrix[..., :2, :2] = SE2(shift).matrix()[..., :2, :2]
    matrix[..., 2, 2] = matrix[..., 3, 3] = 1.0
    matrix[..., :3, 3] = shift
    return matrix


def symmetry_action(shift: ArrayLike, state: ArrayLike) -> Array:
    """States (..., 3) moved by shifts (..., 3): ``E g (x, 1)``; the same as ``SE2(g) @ SE2(x)``.

    Source: the paper, Prop. 3.

    Examples
    --------
    >>> symmetry_action([1.0, 0.0, np.pi / 2], [2.0, 0.0, 0.0]).round(3).tolist()
    [1.0, 2.0, 1.571]
    """
    state = as_array("state", state, last=3)
    homogeneous = np.concatenate([state, np.ones((*state.shape[:-1], 1))], axis=-1)
    projection = np.eye(3, 4)
    moved: Array = np.einsum("ij,...jk,...k->...i", projection, symmetry_matrix(shift), homogeneous)
    return moved

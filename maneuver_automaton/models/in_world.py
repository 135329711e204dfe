"""A vehicle that translations alone move, with the pose that vehicles in the plane have."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.groups import SE2, LieGroup, SE2xR, translations
from maneuver_automaton.models.model import Model
from maneuver_automaton.models.vehicle import Components

HEADING = "heading"  # name of the component of a reduced state that is the heading [rad]
GROUPS: dict[type[LieGroup], type[LieGroup]] = {translations(2): SE2, translations(3): SE2xR}


@dataclass(frozen=True, slots=True, eq=False)
class InWorld:
    """A vehicle of a group of translations, whose pose has a heading all the same.

    Where a current or a pair of rails breaks the symmetry of rotations, the heading is no
    coordinate of the group: it is constant, or a component of the reduced state named
    ``heading``. It stands beside the pose of SE(2), which has it too; in the reduced state it is
    its cosine and sine, which are the same after a full turn. Trims of one heading then follow
    trims and maneuvers that end at it, and no others, so rotations are never used; planning,
    collision checks and files see the poses of every other vehicle.

    Source: Frazzoli, Dahleh, Feron (2005), Sec. II: what the group does not move is reduced
    state. The velocity is seen from the body: ``R(-heading) v``, and the heading's own rate.

    Parameters
    ----------
    stated : Model
        The vehicle on translations of the plane or of space; `velocity` is along the world's axes.

    Examples
    --------
    >>> from maneuver_automaton.models import UserModel
    >>> river = UserModel(name="boat", group=translations(2), control_names=("speed", "turn_rate"),
    ...                   reduced_names=("heading",), dynamics=lambda z, u: [u[1]],
    ...                   velocity=lambda z, u: [u[0] * np.cos(z[0]) + 0.5, u[0] * np.sin(z[0])])
    >>> boat = InWorld(river)
    >>> boat.reduced_names
    ('heading_cos', 'heading_sin')
    >>> boat.body_velocity(boat.seen(np.array([np.pi])), np.array([2.0, 0.1])).round(9).tolist()
    [1.5, -0.0, 0.1]
    """

    stated: Model

    @property
    def name(self) -> str:
        """Name of the vehicle."""
        return self.stated.name

    @property
    def group(self) -> type[LieGroup]:
        """SE(2), or SE(2) x R in space."""
        return GROUPS[self.stated.group]

    @property
    def control_names(self) -> tuple[str, ...]:
        """Names of the controls."""
        return self.stated.control_names

    @property
    def control_limits(self) -> Array:
        """Limits (n_u, 2) of the controls."""
        return self.stated.control_limits

    @property
    def part_names(self) -> tuple[str, ...]:
        """Names of what it carries."""
        return self.stated.part_names

    @property
    def reduced_names(self) -> tuple[str, ...]:
        """Names of the reduced state: the heading is a cosine and a sine."""
        names = list(self.stated.reduced_names)
        if self._place is not None:
            names[self._place : self._place + 1] = [f"{HEADING}_cos", f"{HEADING}_sin"]
        return tuple(names)

    @property
    def reduced_limits(self) -> Array:
        """Limits (n_z, 2); a heading has none."""
        limits = self.stated.reduced_limits
        if self._place is None:
            return limits
        open_ = np.tile([-np.inf, np.inf], (2, 1))
        return np.concatenate([limits[: self._place], open_, limits[self._place + 1 :]])

    @property
    def _place(self) -> int | None:
        """Where the heading stands in the stated reduced state; None if it is constant."""
        names = self.stated.reduced_names
        return names.index(HEADING) if HEADING in names else None

    @property
    def follows_pose(self) -> tuple[int, ...]:
        """Numbers of the reduced states that the pose determines: the heading's cosine and sine."""
        return () if self._place is None else (self._place, self._place + 1)

    def heading(self, reduced_state: Array) -> float:
        """Heading [rad] in a reduced state (n_z,); 0 if it is constant."""
        if self._place is None:
            return 0.0
        cos, sin = reduced_state[self._place : self._place + 2]
        return math.atan2(float(sin), float(cos))

    def seen(self, reduced_state: Array) -> Array:
        """The reduced states (..., n_z) of stated ones, in which the heading is one number."""
        k = self._place
        if k is None:
            return np.asarray(reduced_state, dtype=np.float64)
        heading = reduced_state[..., k : k + 1]
        before, after = reduced_state[..., :k], reduced_state[..., k + 1 :]
        return np.concatenate([before, _exact(np.cos(heading)), _exact(np.sin(heading)), after], -1)

    def velocity(self, z: Components, u: Components, /) -> Components:
        """Components of the twist, seen from the body."""
        z, cos, sin = self._stated(z)
        v_x, v_y, *climb = self.stated.velocity(z, u)
        turn = 0.0 if self._place is None else self.stated.dynamics(z, u)[self._place]
        return [cos * v_x + sin * v_y, cos * v_y - sin * v_x, turn, *climb]

    def dynamics(self, z: Components, u: Components, /) -> Components:
        """Rates of the reduced state; cosine and sine turn with the heading."""
        k = self._place
        stated, cos, sin = self._stated(z)
        rates = list(self.stated.dynamics(stated, u))
        if k is not None:
            rates[k : k + 1] = [-sin * rates[k], cos * rates[k]]
        return rates

    def body_velocity(self, reduced_state: Array, control: Array) -> Array:
        """Twist (..., dof) seen from the body; see `velocity`."""
        z, cos, sin = self._stated_rows(reduced_state)
        v_x, v_y, *climb = np.moveaxis(self.stated.body_velocity(z, control), -1, 0)
        turn = np.zeros(())
        if self._place is not None:
            turn = self.stated.reduced_dynamics(z, control)[..., self._place]
        columns = [cos * v_x + sin * v_y, cos * v_y - sin * v_x, turn, *climb]
        return np.stack(np.broadcast_arrays(*columns), axis=-1)

    def reduced_dynamics(self, reduced_state: Array, control: Array) -> Array:
        """Rates (..., n_z) of the reduced state; see `dynamics`."""
        k = self._place
        z, cos, sin = self._stated_rows(reduced_state)
        rates = self.stated.reduced_dynamics(z, control)
        if k is None:
            return rates
        turning = np.stack([-sin * rates[..., k], cos * rates[..., k]], axis=-1)
        return np.concatenate([rates[..., :k], turning, rates[..., k + 1 :]], axis=-1)

    def part_poses(self, reduced_state: Array) -> Array:
        """Planar poses (..., n, 3) of what it carries, seen from the vehicle."""
        return self.stated.part_poses(self._stated_rows(reduced_state)[0])

    def _stated(self, z: Components) -> tuple[Components, Any, Any]:
        """The stated reduced state by components, and cosine and sine of the heading."""
        k = self._place
        if k is None:
            return z, 1.0, 0.0
        cos, sin = z[k], z[k + 1]
        return [*z[:k], np.arctan2(sin, cos), *z[k + 2 :]], cos, sin

    def _stated_rows(self, reduced_state: Array) -> tuple[Array, Array, Array]:
        """The stated reduced states, cosines and sines, as arrays with components last."""
        k = self._place
        z = np.asarray(reduced_state, dtype=np.float64)
        if k is None:
            return z, np.ones(z.shape[:-1]), np.zeros(z.shape[:-1])
        cos, sin = z[..., k], z[..., k + 1]
        heading = np.arctan2(sin, cos)[..., None]
        return np.concatenate([z[..., :k], heading, z[..., k + 2 :]], axis=-1), cos, sin


def _exact(values: Array) -> Array:
    """Cosines or sines, zero where they are rounding: quarter turns are exact."""
    return np.where(np.abs(values) < 1e-15, 0.0, values)


def in_world(model: Model) -> Model:
    """The model with poses of SE(2) if translations alone move it; any other one as it is.

    Examples
    --------
    >>> from maneuver_automaton.models import Unicycle, UserModel
    >>> stage = UserModel(name="stage", group=translations(2), control_names=("v_x", "v_y"),
    ...                   velocity=lambda z, u: [u[0], u[1]])
    >>> in_world(stage).body_velocity(np.zeros(0), np.array([1.0, 2.0])).tolist()
    [1.0, 2.0, 0.0]
    >>> in_world(Unicycle()).name
    'unicycle'
    """
    return InWorld(model) if model.group in GROUPS else model

"""Planar poses with a height, SE(2) x R: the motions of vehicles under gravity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array, freeze
from maneuver_automaton._brief import brief
from maneuver_automaton.groups.lie_group import LieGroup
from maneuver_automaton.groups.se2 import SE2


@dataclass(frozen=True, slots=True, eq=False)
class SE2xR:
    """A batch of poses with height: `pose` is (..., 4), x [m], y [m], heading [rad], z [m].

    Planar motions are those with z = 0. The heading is not wrapped.

    Source: Frazzoli, Dahleh, Feron (2005), Sec. II: translations, and rotations about the vertical.

    Examples
    --------
    >>> climbing_turn = SE2xR.exp([np.pi, 0.0, np.pi, 0.5])
    >>> climbing_turn.pose.round(3).tolist()
    [0.0, 2.0, 3.142, 0.5]
    >>> (climbing_turn @ SE2xR([1.0, 0.0, 0.0, 0.5])).pose.round(3).tolist()
    [-1.0, 2.0, 3.142, 1.0]
    """

    pose: Array
    dof: ClassVar[int] = 4
    space: ClassVar[int] = 3
    coordinates: ClassVar[tuple[str, ...]] = ("x", "y", "heading", "z")

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "pose", last=4)

    def __matmul__(self, other: SE2xR) -> SE2xR:
        """Do `other` in the frame of `self`."""
        planar = self.planar @ other.planar
        return SE2xR(_with_last(planar.pose, self.pose[..., 3] + other.pose[..., 3]))

    @property
    def planar(self) -> SE2:
        """The planar poses, without their height."""
        return SE2(self.pose[..., :3])

    def inverse(self) -> SE2xR:
        """Motion back."""
        return SE2xR(_with_last(self.planar.inverse().pose, -self.pose[..., 3]))

    @classmethod
    def identity(cls) -> SE2xR:
        """Motion that changes nothing."""
        return cls(np.zeros(4))

    @classmethod
    def exp(cls, twist: ArrayLike) -> SE2xR:
        """Pose reached by a constant body twist (..., 4), [m/s, m/s, rad/s, m/s], after 1 s."""
        twist = as_array("twist", twist, last=4)
        return cls(_with_last(SE2.exp(twist[..., :3]).pose, twist[..., 3]))

    def log(self, *, position_tolerance: float = 1e-9) -> Array:
        """Constant body twist (..., 4) that leads from the identity here in 1 s; see `SE2.log`."""
        return _with_last(self.planar.log(position_tolerance=position_tolerance), self.pose[..., 3])

    def adjoint(self) -> Array:
        """Ad (..., 4, 4): ``g @ exp(xi) @ g.inverse() == exp(Ad xi)``."""
        matrix = np.zeros((*self.pose.shape, 4))
        matrix[..., :3, :3] = self.planar.adjoint()
        matrix[..., 3, 3] = 1.0
        return matrix

    def coadjoint(self) -> Array:
        """Ad* (..., 4, 4), which moves momenta: ``<Ad* p, Ad xi> == <p, xi>``."""
        return np.swapaxes(self.inverse().adjoint(), -1, -2)

    def act(self, points: ArrayLike) -> Array:
        """Points (..., 3) [m] given in the body frame, seen from the world.

        Examples
        --------
        >>> SE2xR([1.0, 0.0, np.pi / 2, 10.0]).act([2.0, 0.0, 0.5]).round(3).tolist()
        [1.0, 2.0, 10.5]
        """
        points = as_array("points", points, last=3)
        return _with_last(self.planar.act(points[..., :2]), self.pose[..., 3] + points[..., 2])

    def pose_rates(self, twist: ArrayLike) -> Array:
        """Time derivative (..., 4) of `pose` while the body moves with a twist (..., 4)."""
        twist = as_array("twist", twist, last=4)
        return _with_last(self.planar.pose_rates(twist[..., :3]), twist[..., 3])

    def body_twist(self, rates: ArrayLike) -> Array:
        """Twist (..., 4) of a body whose `pose` changes at `rates` (..., 4)."""
        rates = as_array("rates", rates, last=4)
        return _with_last(self.planar.body_twist(rates[..., :3]), rates[..., 3])


def group_of(dof: int) -> type[LieGroup]:
    """Group whose poses have `dof` components: SE2 for 3, SE2xR for 4.

    Raises
    ------
    ValueError
        For any other number.

    Examples
    --------
    >>> group_of(4).__name__
    'SE2xR'
    """
    if dof == 3:
        return SE2
    if dof == 4:
        return SE2xR
    raise ValueError(f"dof: got {dof}, need 3 (x, y, heading) or 4 (x, y, heading, z)")


def _with_last(planar: Array, last: Array) -> Array:
    """(..., 3) and (...,) side by side: (..., 4)."""
    return np.concatenate([planar, np.broadcast_to(last, planar.shape[:-1])[..., None]], axis=-1)

"""Translations of R^n: the symmetry that is left where rotations are broken."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import ClassVar, Self, cast

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array, freeze
from maneuver_automaton._brief import brief
from maneuver_automaton.groups.lie_group import LieGroup


@dataclass(frozen=True, slots=True, eq=False)
class Translations:
    """A batch of translations: `pose` is (..., n) [m]; `translations` makes the class for n."""

    pose: Array
    dof: ClassVar[int]
    space: ClassVar[int]
    coordinates: ClassVar[tuple[str, ...]]

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "pose", last=self.dof)

    def __matmul__(self, other: Self) -> Self:
        """Do `other` in the frame of `self`."""
        return type(self)(self.pose + other.pose)

    def inverse(self) -> Self:
        """Motion back."""
        return type(self)(-self.pose)

    @classmethod
    def identity(cls) -> Self:
        """Motion that changes nothing."""
        return cls(np.zeros(cls.dof))

    @classmethod
    def exp(cls, twist: ArrayLike) -> Self:
        """Element reached by a constant velocity (..., n) [m/s] after 1 s."""
        return cls(as_array("twist", twist, last=cls.dof))

    def log(self) -> Array:
        """Constant velocity (..., n) [m/s] that leads here in 1 s."""
        return self.pose.copy()

    def adjoint(self) -> Array:
        """Ad (..., n, n): the identity, because translations commute."""
        return np.broadcast_to(np.eye(self.dof), (*self.pose.shape, self.dof)).copy()

    def coadjoint(self) -> Array:
        """Ad* (..., n, n): the identity, because translations commute."""
        return self.adjoint()

    def act(self, points: ArrayLike) -> Array:
        """Points (..., n) [m], moved."""
        return self.pose + as_array("points", points, last=self.space)

    def pose_rates(self, twist: ArrayLike) -> Array:
        """Velocity (..., n) [m/s] itself: body and world have the same axes."""
        twist = as_array("twist", twist, last=self.dof)
        return np.broadcast_to(twist, np.broadcast_shapes(twist.shape, self.pose.shape)).copy()

    def body_twist(self, rates: ArrayLike) -> Array:
        """Rates (..., n) [m/s] themselves: body and world have the same axes."""
        return self.pose_rates(as_array("rates", rates, last=self.dof))


@functools.cache
def translations(n: int) -> type[LieGroup]:
    """Group of the translations of R^n, as a class; the same class for the same `n`.

    Raises
    ------
    ValueError
        If `n` is less than 1.

    Examples
    --------
    >>> group = translations(2)
    >>> (group([1.0, 2.0]) @ group([0.5, 0.0])).pose.tolist()
    [1.5, 2.0]
    >>> group is translations(2)
    True
    """
    if n < 1:
        raise ValueError(f"translations: got n = {n}, need at least 1")
    names = ("x", "y", "z") if n <= 3 else tuple(f"x{i + 1}" for i in range(n))
    members = {"__slots__": (), "dof": n, "space": n, "coordinates": names[:n]}
    return cast(type[LieGroup], type(f"Translations{n}", (Translations,), members))

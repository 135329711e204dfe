"""Lie groups: what every room may ask of one, and those made of others."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import ClassVar, Protocol, Self, cast

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array, check_range, freeze
from maneuver_automaton._brief import brief
from maneuver_automaton.groups.se2 import SE2


class LieGroup(Protocol):
    """A batch of group elements; `pose` is (..., dof), components last.

    A pose is read as ``world_from_body``, and time runs left to right: ``start @ motion``. A
    twist is a velocity in the body frame, in the order of the pose. Every method broadcasts over
    the batch axes as NumPy does.

    Source: Solà, Deray, Atchuthan (2018), Sec. II; the conventions are theirs.

    Examples
    --------
    >>> import numpy as np
    >>> from maneuver_automaton.groups import SE2
    >>> quarter_turn = SE2.exp([np.pi / 2, 0.0, np.pi / 2])
    >>> (quarter_turn @ quarter_turn).pose.round(3).tolist()
    [0.0, 2.0, 3.142]
    """

    dof: ClassVar[int]  # components of a pose, and of a twist
    space: ClassVar[int]  # coordinates of the points it moves
    coordinates: ClassVar[tuple[str, ...]]  # names of the components of a pose

    def __init__(self, pose: Array) -> None: ...

    @property
    def pose(self) -> Array:
        """Coordinates (..., dof) [m, rad]; a heading keeps the full turns it has made."""
        ...

    def __matmul__(self, other: Self) -> Self:
        """Do `other` in the frame of `self`."""
        ...

    def inverse(self) -> Self:
        """Motion back."""
        ...

    @classmethod
    def identity(cls) -> Self:
        """Motion that changes nothing."""
        ...

    @classmethod
    def exp(cls, twist: ArrayLike) -> Self:
        """Pose reached by a constant body twist (..., dof) after 1 s, from the identity."""
        ...

    def log(self) -> Array:
        """Constant body twist (..., dof) that leads from the identity here in 1 s."""
        ...

    def adjoint(self) -> Array:
        """Ad (..., dof, dof): ``g @ exp(xi) @ g.inverse() == exp(Ad xi)``."""
        ...

    def act(self, points: ArrayLike) -> Array:
        """Points (..., space) [m] given in the body frame, seen from the world."""
        ...

    def pose_rates(self, twist: ArrayLike) -> Array:
        """Time derivative (..., dof) of `pose` while the body moves with a twist (..., dof)."""
        ...

    def body_twist(self, rates: ArrayLike) -> Array:
        """Twist (..., dof) of a body whose `pose` changes at `rates` (..., dof)."""
        ...


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
    check_range("translations: n", n, least=1)
    names = ("x", "y", "z") if n <= 3 else tuple(f"x{i + 1}" for i in range(n))
    members = {"__slots__": (), "dof": n, "space": n, "coordinates": names[:n]}
    return cast(type[LieGroup], type(f"Translations{n}", (Translations,), members))


@dataclass(frozen=True, slots=True, eq=False)
class Product:
    """A batch of pairs: `pose` is (..., dof), both poses in a row; `product` makes the class."""

    pose: Array
    first_group: ClassVar[type[LieGroup]]
    second_group: ClassVar[type[LieGroup]]
    dof: ClassVar[int]
    space: ClassVar[int]
    coordinates: ClassVar[tuple[str, ...]]

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "pose", last=self.dof)

    @property
    def first(self) -> LieGroup:
        """The first of each pair."""
        return self.first_group(self.pose[..., : self.first_group.dof])

    @property
    def second(self) -> LieGroup:
        """The second of each pair."""
        return self.second_group(self.pose[..., self.first_group.dof :])

    def __matmul__(self, other: Self) -> Self:
        """Do `other` in the frame of `self`."""
        first, second = self.first @ other.first, self.second @ other.second
        return type(self)(_concatenated(first.pose, second.pose))

    def inverse(self) -> Self:
        """Motion back."""
        return type(self)(_concatenated(self.first.inverse().pose, self.second.inverse().pose))

    @classmethod
    def identity(cls) -> Self:
        """Motion that changes nothing."""
        return cls(np.zeros(cls.dof))

    @classmethod
    def exp(cls, twist: ArrayLike) -> Self:
        """Pair reached by a constant body twist (..., dof) after 1 s."""
        one, two = cls._parts("twist", twist)
        return cls(_concatenated(cls.first_group.exp(one).pose, cls.second_group.exp(two).pose))

    def log(self) -> Array:
        """Constant body twist (..., dof) that leads from the identity here in 1 s."""
        return _concatenated(self.first.log(), self.second.log())

    def adjoint(self) -> Array:
        """Ad (..., dof, dof): ``g @ exp(xi) @ g.inverse() == exp(Ad xi)``; two blocks."""
        n = self.first_group.dof
        matrix = np.zeros((*self.pose.shape, self.dof))
        matrix[..., :n, :n] = self.first.adjoint()
        matrix[..., n:, n:] = self.second.adjoint()
        return matrix

    def act(self, points: ArrayLike) -> Array:
        """Points (..., space) [m] of the joint space, each part moved by its own group."""
        points, n = as_array("points", points, last=self.space), self.first_group.space
        return _concatenated(self.first.act(points[..., :n]), self.second.act(points[..., n:]))

    def pose_rates(self, twist: ArrayLike) -> Array:
        """Time derivative (..., dof) of `pose` while the pair moves with a twist (..., dof)."""
        one, two = self._parts("twist", twist)
        return _concatenated(self.first.pose_rates(one), self.second.pose_rates(two))

    def body_twist(self, rates: ArrayLike) -> Array:
        """Twist (..., dof) of a pair whose `pose` changes at `rates` (..., dof)."""
        one, two = self._parts("rates", rates)
        return _concatenated(self.first.body_twist(one), self.second.body_twist(two))

    @classmethod
    def _parts(cls, name: str, value: ArrayLike) -> tuple[Array, Array]:
        array = as_array(name, value, last=cls.dof)
        return array[..., : cls.first_group.dof], array[..., cls.first_group.dof :]


@functools.cache
def product(first: type[LieGroup], second: type[LieGroup]) -> type[LieGroup]:
    """Direct product of two groups, as a class; the same class for the same pair.

    Coordinates whose names occur in both groups get ``_1`` and ``_2`` appended.

    Examples
    --------
    >>> from maneuver_automaton.groups import SE2, translations
    >>> two_robots = product(SE2, SE2)
    >>> two_robots.exp([1.0, 0.0, 0.0, 2.0, 0.0, 0.0]).pose.tolist()
    [1.0, 0.0, 0.0, 2.0, 0.0, 0.0]
    >>> product(SE2, translations(3)).coordinates
    ('x_1', 'y_1', 'heading', 'x_2', 'y_2', 'z')
    """
    shared = set(first.coordinates) & set(second.coordinates)
    members = {
        "__slots__": (),
        "first_group": first,
        "second_group": second,
        "dof": first.dof + second.dof,
        "space": first.space + second.space,
        "coordinates": (
            *(f"{name}_1" if name in shared else name for name in first.coordinates),
            *(f"{name}_2" if name in shared else name for name in second.coordinates),
        ),
    }
    name = f"{first.__name__}x{second.__name__}"
    return cast(type[LieGroup], type(name, (Product,), members))


def _concatenated(first: Array, second: Array) -> Array:
    """(..., n) and (..., m) side by side, after broadcasting their batch axes: (..., n + m)."""
    batch = np.broadcast_shapes(first.shape[:-1], second.shape[:-1])
    parts = (np.broadcast_to(part, (*batch, part.shape[-1])) for part in (first, second))
    return np.concatenate([*parts], axis=-1)


class SE2xR(Product):
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

    __slots__ = ()
    first_group = SE2
    second_group = translations(1)
    dof = 4
    space = 3
    coordinates: ClassVar[tuple[str, ...]] = ("x", "y", "heading", "z")

    @property
    def planar(self) -> SE2:
        """The planar poses, without their height."""
        return SE2(self.pose[..., :3])

    def log(self, *, position_tolerance: float = 1e-9) -> Array:
        """Constant body twist (..., 4) that leads from the identity here in 1 s; see `SE2.log`."""
        planar = self.planar.log(position_tolerance=position_tolerance)
        return np.concatenate([planar, self.pose[..., 3:]], axis=-1)


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

"""The Protocol `LieGroup`: what every room may ask of a group that moves a vehicle."""

from __future__ import annotations

from typing import ClassVar, Protocol, Self

from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array


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

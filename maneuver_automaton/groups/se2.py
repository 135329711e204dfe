"""Poses in the plane, SE(2): the motions of vehicles on flat ground, and chains of them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array, freeze
from maneuver_automaton._brief import brief

# |sin(w/2) / (w/2)| of the float64 nearest to a multiple of a full turn stays below this.
FULL_TURN = 4 * float(np.finfo(np.float64).eps)


@dataclass(frozen=True, slots=True, eq=False)
class SE2:
    """A batch of planar poses: `pose` is (..., 3), x [m], y [m], heading [rad].

    The heading is not wrapped: it carries the turns that were made.

    Source: Solà, Deray, Atchuthan (2018), Appendix C; the paper's Prop. 3.

    Examples
    --------
    >>> facing_left = SE2([1.0, 0.0, np.pi / 2])
    >>> (facing_left @ SE2([2.0, 0.0, 0.0])).pose.round(3).tolist()
    [1.0, 2.0, 1.571]
    >>> facing_left.inverse().pose.round(3).tolist()
    [-0.0, 1.0, -1.571]
    """

    pose: Array
    dof: ClassVar[int] = 3
    space: ClassVar[int] = 2
    coordinates: ClassVar[tuple[str, ...]] = ("x", "y", "heading")

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "pose", last=3)

    def __matmul__(self, other: SE2) -> SE2:
        """Do `other` in the frame of `self`."""
        heading = self.pose[..., 2] + other.pose[..., 2]
        return SE2(np.concatenate([self.act(other.pose[..., :2]), heading[..., None]], axis=-1))

    def inverse(self) -> SE2:
        """Motion back."""
        return SE2(-self.body_twist(self.pose))

    @classmethod
    def identity(cls) -> SE2:
        """Motion that changes nothing."""
        return cls(np.zeros(3))

    @classmethod
    def exp(cls, twist: ArrayLike) -> SE2:
        """Pose reached by a constant body twist (..., 3), [m/s, m/s, rad/s], after 1 s.

        Source: Solà, Deray, Atchuthan (2018), Eqs. (156), (158), here in half-angle form.

        Examples
        --------
        >>> SE2.exp([np.pi, 0.0, np.pi]).pose.round(3).tolist()
        [0.0, 2.0, 3.142]
        """
        rates = as_array("twist", twist, last=3)
        v_x, v_y, turn = rates[..., 0], rates[..., 1], rates[..., 2]
        ahead, aside = np.sinc(turn / np.pi), np.sin(turn / 2) * np.sinc(turn / (2 * np.pi))
        return cls(np.stack([ahead * v_x - aside * v_y, aside * v_x + ahead * v_y, turn], axis=-1))

    def log(self, *, position_tolerance: float = 1e-9) -> Array:
        """Constant body twist (..., 3) that leads from the identity here in 1 s.

        The heading is taken as it is, so a motion of several turns has a twist of several turns,
        and `log` inverts `exp` at any turn rate except whole turns per second. There a constant
        twist closes its circle, so only a pure spin can be undone.

        Source: Solà, Deray, Atchuthan (2018), Eqs. (157), (158), here in half-angle form.

        Parameters
        ----------
        position_tolerance : float
            After whole turns, positions up to this distance from the origin count as zero [m].

        Returns
        -------
        (..., 3) array
            Body twists [m/s, m/s, rad/s].

        Raises
        ------
        ValueError
            If a heading is a nonzero multiple of 2 pi and the position is not zero: no constant
            twist leads there.

        Examples
        --------
        >>> SE2([0.0, 2.0, np.pi]).log().round(3).tolist()
        [3.142, 0.0, 3.142]
        >>> SE2([1.0, 0.0, 2 * np.pi]).log()
        Traceback (most recent call last):
            ...
        ValueError: log: pose (1, 0, 6.28319) is 1 m away after 1 full turn, where a constant \
twist is back at the start; need another heading
        """
        x, y, turn = np.moveaxis(self.pose, -1, 0)
        chord = np.sinc(turn / (2 * np.pi))
        whole_turns = np.abs(chord) < FULL_TURN
        self._refuse(whole_turns & (np.hypot(x, y) > position_tolerance))
        x, y = np.where(whole_turns, 0.0, x), np.where(whole_turns, 0.0, y)
        ahead, aside = np.cos(turn / 2) / np.where(whole_turns, 1.0, chord), turn / 2
        return np.stack([ahead * x + aside * y, ahead * y - aside * x, turn], axis=-1)

    def _refuse(self, impossible: Array) -> None:
        if not np.any(impossible):
            return
        x, y, heading = self.pose[impossible][0] if self.pose.ndim > 1 else self.pose
        turns = abs(round(heading / (2 * np.pi)))
        raise ValueError(
            f"log: pose ({x:.6g}, {y:.6g}, {heading:.6g}) is {np.hypot(x, y):.6g} m away after "
            f"{turns} full turn{'s' if turns > 1 else ''}, where a constant twist is back at the "
            "start; need another heading"
        )

    def adjoint(self) -> Array:
        """Ad (..., 3, 3): ``g @ exp(xi) @ g.inverse() == exp(Ad xi)``.

        Source: Solà, Deray, Atchuthan (2018), Eq. (159).

        Examples
        --------
        >>> SE2([1.0, 2.0, 0.0]).adjoint().tolist()
        [[1.0, -0.0, 2.0], [0.0, 1.0, -1.0], [0.0, 0.0, 1.0]]
        """
        matrix = self.matrix()
        matrix[..., 0, 2], matrix[..., 1, 2] = self.pose[..., 1], -self.pose[..., 0]
        return matrix

    def act(self, points: ArrayLike) -> Array:
        """Points (..., 2) [m] given in the body frame, seen from the world.

        Examples
        --------
        >>> SE2([1.0, 0.0, np.pi / 2]).act([[2.0, 0.0], [0.0, 2.0]]).round(3).tolist()
        [[1.0, 2.0], [-1.0, 0.0]]
        """
        return self.pose[..., :2] + _turned(self.pose[..., 2], as_array("points", points, last=2))

    def pose_rates(self, twist: ArrayLike) -> Array:
        """Time derivative (..., 3) of `pose` while the body moves with a twist (..., 3).

        Source: g' = g xi, by components.

        Examples
        --------
        >>> SE2([5.0, 5.0, np.pi / 2]).pose_rates([1.0, 0.0, 0.3]).round(3).tolist()
        [0.0, 1.0, 0.3]
        """
        return _planar(self.pose[..., 2], as_array("twist", twist, last=3))

    def body_twist(self, rates: ArrayLike) -> Array:
        """Twist (..., 3) of a body whose `pose` changes at `rates` (..., 3)."""
        return _planar(-self.pose[..., 2], as_array("rates", rates, last=3))

    def matrix(self) -> Array:
        """Homogeneous matrices (..., 3, 3), which multiply (x, y, 1).

        Source: Solà, Deray, Atchuthan (2018), Eq. (152).

        Examples
        --------
        >>> SE2([1.0, 2.0, 0.0]).matrix().tolist()
        [[1.0, -0.0, 1.0], [0.0, 1.0, 2.0], [0.0, 0.0, 1.0]]
        """
        x, y, heading = np.moveaxis(self.pose, -1, 0)
        c, s, zero, one = np.cos(heading), np.sin(heading), np.zeros_like(x), np.ones_like(x)
        rows = [[c, -s, x], [s, c, y], [zero, zero, one]]
        return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def _turned(angle: Array, vectors: Array) -> Array:
    """Vectors (..., 2) rotated by angles (...,) [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


def _planar(angle: Array, vectors: Array) -> Array:
    """Vectors (..., 3) of which the first two components are rotated by angles (...,) [rad]."""
    planar = _turned(angle, vectors[..., :2])
    last = np.broadcast_to(vectors[..., 2:], (*planar.shape[:-1], 1))
    return np.concatenate([planar, last], axis=-1)


FEW = 20  # trims, up to which plain numbers are quicker than arrays


def chained(start: Array, steps: Array) -> Array:
    """Poses (n + 1, dof) from `start` (dof,) on, each one of `steps` (n, dof) after the last.

    The products ``start @ steps[0] @ ... @ steps[k - 1]``, all at once.
    """
    poses = np.empty((len(steps) + 1, start.size))
    poses[0] = start
    poses[1:] = steps
    np.cumsum(poses[:, 2:], axis=0, out=poses[:, 2:])
    poses[1:, :2] = _turned(poses[:-1, 2], steps[:, :2])
    np.cumsum(poses[:, :2], axis=0, out=poses[:, :2])
    return poses


def coasted(start: Array, twists: Array, durations: Array) -> Array:
    """Poses (n + 1, dof) from `start` (dof,) on, after each of n trims; the heading is the third.

    To the last bit ``chained(start, exp(durations * twists))``: on plain numbers for a word of a
    few trims, which takes a tenth of the time that arrays take.
    """
    if len(durations) > FEW:
        return chained(start, displacements(twists, durations))
    pose: list[float] = start.tolist()
    poses = [pose]
    for twist, duration in zip(twists.tolist(), durations.tolist(), strict=True):
        pose = _after(pose, twist, duration)
        poses.append(pose)
    return np.array(poses)


def displacements(twists: Array, durations: Array) -> Array:
    """Displacements (n, dof) of trims, ``exp(durations * twists)`` to the last bit."""
    steps = durations[:, None] * twists
    turn = np.pi * (steps[:, 2] / np.pi)
    half = np.pi * (steps[:, 2] / (2 * np.pi))
    straight = turn == 0.0
    turn[straight] = half[straight] = 1.0
    ahead, aside = np.sin(turn) / turn, np.sin(steps[:, 2] / 2) * (np.sin(half) / half)
    ahead[straight] = 1.0
    x, y = ahead * steps[:, 0] - aside * steps[:, 1], aside * steps[:, 0] + ahead * steps[:, 1]
    steps[:, 0], steps[:, 1] = x, y
    return steps


def after(poses: Array, steps: Array) -> Array:
    """Poses (n, dof) after steps (n, dof), each in the frame of one of `poses` (n, dof)."""
    found = poses + steps
    found[:, :2] = poses[:, :2] + _turned(poses[:, 2], steps[:, :2])
    return found


def end_of_coasting(start: Array, twists: Iterable[Array], durations: Iterable[float]) -> Array:
    """Pose (dof,) from `start` (dof,) after all trims: the last one of `coasted`."""
    pose: list[float] = start.tolist()
    for twist, duration in zip(twists, durations, strict=False):
        pose = _after(pose, twist.tolist(), duration)
    return np.array(pose)


def seen_from(start: Array, pose: Array) -> list[float]:
    """A pose (dof,) seen from another: places are subtracted first, so that no digit is lost.

    To the last bit ``start.inverse() @ pose`` of poses that are moved to where `start` is 0.
    """
    here, there = start.tolist(), pose.tolist()
    x, y = there[0] - here[0], there[1] - here[1]
    c, s = math.cos(-here[2]), math.sin(-here[2])
    planar = [c * x - s * y, s * x + c * y, there[2] - here[2]]
    return planar if len(here) == 3 else [*planar, there[3] - here[3]]


def _after(pose: list[float], twist: list[float], duration: float) -> list[float]:
    """Pose after a trim; the formula of `SE2.exp`, in the same order of operations."""
    x, y, turn = duration * twist[0], duration * twist[1], duration * twist[2]
    if turn:
        # Twice `np.sinc`: where a share of a half turn is rounded to no angle at all, it is one.
        whole, half = math.pi * (turn / math.pi), math.pi * (turn / (2 * math.pi))
        ahead = math.sin(whole) / whole if whole else 1.0
        aside = math.sin(turn / 2) * (math.sin(half) / half if half else 1.0)
        x, y = ahead * x - aside * y, aside * x + ahead * y
    c, s = math.cos(pose[2]), math.sin(pose[2])
    planar = [pose[0] + (c * x - s * y), pose[1] + (s * x + c * y), pose[2] + turn]
    return planar if len(pose) == 3 else [*planar, pose[3] + duration * twist[3]]

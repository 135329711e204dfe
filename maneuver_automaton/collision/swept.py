"""Where a body passes while it coasts: convex hulls in the body's frame, moved by symmetry.

A coast is cut into slices that last a power of two seconds. One hull for each twist and each such
time serves every slice of every plan. Half a slice is again a slice, of less excess.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.collision.shapes import Shape
from maneuver_automaton.collision.solids import body_pieces, convex_hull
from maneuver_automaton.groups import SE2

Twist = tuple[float, float, float]  # [m/s, m/s, rad/s]
MOST_TURN = 0.25  # [rad] of one slice
MOST_STEPS = 32  # of a course in one hull
STANDING = 1e-12  # [m] a body that moves no point further is taken to stand


@dataclass(frozen=True, slots=True, eq=False)
class GrownBody:
    """Convex pieces that cover a body grown by a margin, in its frame, and a disc around them."""

    pieces: tuple[Array, ...]  # (n, 2) each [m]

    if TYPE_CHECKING:

        def __init__(self, pieces: tuple[Array, ...]) -> None: ...

    @property
    def middle(self) -> Array:
        """Center (2,) of the box around the pieces [m]."""
        corners = np.concatenate(self.pieces)
        return np.asarray(0.5 * (corners.min(axis=0) + corners.max(axis=0)))

    @property
    def reach(self) -> float:
        """No point is further from the middle [m]."""
        return float(np.hypot(*(np.concatenate(self.pieces) - self.middle).T).max())


class Windows(NamedTuple):
    """Slices of one level that cover a coast; the last may overlap the one before."""

    level: int  # each lasts 2^-level s
    begins: Array  # (n,) [s]

    @property
    def length(self) -> float:
        """How long each lasts [s]."""
        return math.ldexp(1.0, -self.level)


@functools.lru_cache(maxsize=16)
def grown_body(footprint: tuple[Shape, ...], margin: float, excess: float) -> GrownBody:
    """A footprint grown by a margin [m], round corners by at most `excess` [m] more."""
    return GrownBody(body_pieces(footprint, margin=margin, excess=excess))


def box_around(body: GrownBody) -> GrownBody:
    """The rectangle, along the axes of its frame, that holds a body.

    Examples
    --------
    >>> triangle = GrownBody((np.array([[0.0, 0.0], [2.0, 0.0], [1.0, 1.0]]),))
    >>> box_around(triangle).pieces[0].tolist()
    [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]]
    """
    corners = np.concatenate(body.pieces)
    (left, low), (right, high) = corners.min(axis=0), corners.max(axis=0)
    return GrownBody((np.array([[left, low], [right, low], [right, high], [left, high]]),))


def slice_hulls(body: GrownBody, twist: Twist, duration: float) -> list[Array]:
    """Convex polygons (m, 2) that hold every point of the body at every time of a short coast.

    A corner runs along an arc, which lies in the triangle of its ends and the point where the
    tangents there meet; points between corners are between such triangles.

    Examples
    --------
    >>> square = GrownBody((np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]),))
    >>> (ahead,) = slice_hulls(square, (1.0, 0.0, 0.0), 3.0)
    >>> ahead.min(axis=0).tolist(), ahead.max(axis=0).tolist()
    ([-1.0, -1.0], [4.0, 1.0])
    """
    v_x, v_y, turn_rate = twist
    end = SE2.exp(duration * np.array(twist))
    half = 0.5 * turn_rate * duration
    to_tangents = 0.5 * duration * (math.tan(half) / half if half else 1.0)
    hulls = []
    for corners in body.pieces:
        points = [corners, end.act(corners)]
        if turn_rate:
            rates = np.stack([v_x - turn_rate * corners[:, 1], v_y + turn_rate * corners[:, 0]], 1)
            points.append(corners + to_tangents * rates)
        hulls.append(convex_hull(np.concatenate(points)))
    return hulls


def course_hulls(body: GrownBody, poses: Array, steps: Array) -> list[Array]:
    """Convex polygons that hold every point of the body along a course.

    It stands at `poses` (n + 1, 3) and moves from each to the next with a constant twist, which
    makes the step of `steps` (n, 3) in the frame of the first: hulls as in `slice_hulls`, in the
    frame of the poses.

    Examples
    --------
    >>> square = GrownBody((np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]),))
    >>> steps = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    >>> poses = np.array([[0.0, 0, 0], [1.0, 0, 0], [2.0, 0, 0]])
    >>> (ahead,) = course_hulls(square, poses, steps)
    >>> ahead.min(axis=0).tolist(), ahead.max(axis=0).tolist()
    ([-1.0, -1.0], [3.0, 1.0])
    """
    v_x, v_y, turn = (column[:, None] for column in steps.T)
    half = np.where(turn == 0.0, 1.0, 0.5 * turn)
    to_tangents = np.where(turn == 0.0, 0.5, 0.5 * np.tan(half) / half)
    hulls = []
    for corners in body.pieces:
        x, y = corners.T
        rates = np.stack([v_x - turn * y, v_y + turn * x], axis=-1)
        meeting = corners + to_tangents[..., None] * rates
        points = [
            SE2(poses[:, None]).act(np.broadcast_to(corners, (len(poses), *corners.shape))),
            SE2(poses[:-1, None]).act(meeting),
        ]
        hulls.append(convex_hull(np.concatenate([one.reshape(-1, 2) for one in points])))
    return hulls


def chunks(steps: Array) -> list[tuple[int, int]]:
    """Runs [first, last) of steps (n, 3) that turn by at most `MOST_TURN` together, in order.

    Examples
    --------
    >>> chunks(np.array([[1.0, 0.0, 0.1], [1.0, 0.0, 0.1], [1.0, 0.0, 0.1]]))
    [(0, 2), (2, 3)]
    """
    runs: list[tuple[int, int]] = []
    first, turned = 0, 0.0
    for k, turn in enumerate(np.abs(steps[:, 2]).tolist()):
        if k > first and (turned + turn > MOST_TURN or k - first >= MOST_STEPS):
            runs.append((first, k))
            first, turned = k, 0.0
        turned += turn
    if len(steps):
        runs.append((first, len(steps)))
    return runs


def slice_excess(body: GrownBody, twist: Twist, duration: float) -> float:
    """No point of the hulls is further than this [m] from where the body passes.

    A point of a hull is a mean of corners seen at several times. Hold the same mean of corners
    against it at the mean time: the common velocity cancels, and the turning remains,
    at most ``reach * |turn| / 2``, the curvature of the arcs, and the tips of the triangles.
    """
    v_x, v_y, turn_rate = twist
    turn = abs(turn_rate) * duration
    if turn == 0.0:
        return 0.0
    excess = 0.0
    for corners in body.pieces:
        center = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        reach = float(np.hypot(*(corners - center).T).max())
        speed = np.hypot(v_x - turn_rate * corners[:, 1], v_y + turn_rate * corners[:, 0]).max()
        radius = float(speed) / abs(turn_rate)
        arcs = radius * (0.125 * turn**2 + 2.0 * math.sin(0.25 * turn) ** 2 / math.cos(0.5 * turn))
        excess = max(excess, 0.5 * reach * turn + arcs)
    return excess


def windows(twist: Twist, duration: float) -> Windows:
    """The fewest slices that cover a coast of `duration` > 0 [s]; none lasts longer.

    Examples
    --------
    >>> windows((1.0, 0.0, 0.0), 5.0)
    Windows(level=-2, begins=array([0., 1.]))
    >>> windows((1.0, 0.0, 1.0), 0.7)
    Windows(level=2, begins=array([0.  , 0.25, 0.45]))
    """
    level = -math.floor(math.log2(duration))
    while math.ldexp(max(1.0 / duration, abs(twist[2]) / MOST_TURN), -level) > 1.0:
        level += 1
    length = math.ldexp(1.0, -level)
    count = math.ceil(duration / length)
    return Windows(level, np.minimum(length * np.arange(count), duration - length))


def halves(parts: Windows) -> Windows:
    """Slices half as long that cover the time of `parts`."""
    begins = parts.begins[:, None] + [0.0, 0.5 * parts.length]
    return Windows(parts.level + 1, begins.reshape(-1))


def along(start: Array, twist: Twist, times: Array) -> Array:
    """Poses (n, 3) of a coast after `times` (n,) [s]."""
    return (SE2(start) @ SE2.exp(np.multiply.outer(times, twist))).pose


def fastest(body: GrownBody, twist: Twist) -> float:
    """Speed [m/s] no point of the body exceeds."""
    corners = np.concatenate(body.pieces)
    v_x, v_y, turn_rate = twist
    return float(np.hypot(v_x - turn_rate * corners[:, 1], v_y + turn_rate * corners[:, 0]).max())

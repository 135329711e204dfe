"""Where a body passes while it coasts: convex hulls in the body's frame, moved by symmetry.

A coast is cut into slices that last a power of two seconds. One hull for each twist and each such
time serves every slice of every plan. Half a slice is again a slice, of less excess.

The hull of a side that turns about a point beside its middle fills the angle between where it was
and where it will be: the excess falls with the turn, not with its square. So the body is cut there
first (`cut_where_it_pivots`), and a slice of a quarter of a radian stands out by centimetres.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.collision._kernels_swept import MOST_TURN
from maneuver_automaton.collision.motion import point_speeds
from maneuver_automaton.collision.shapes import Shape
from maneuver_automaton.collision.solids import body_pieces, convex_hull
from maneuver_automaton.groups import SE2

Twist = tuple[float, float, float]  # [m/s, m/s, rad/s]
MOST_STEPS = 32  # of a course in one hull
FAR = 1e9  # [m] what turns about a point further away is taken to go straight
ROUND = 0.1  # of a piece's extent: sides of less than this on either side of a pivot stay whole


@dataclass(frozen=True, slots=True, eq=False)
class GrownBody:
    """Convex pieces that cover a body grown by a margin, in its frame, and a disc around them."""

    pieces: tuple[Array, ...]  # (n, 2) each [m]

    middle: Array = field(init=False)  # (2,) of the box around the pieces [m]
    half: Array = field(init=False)  # (2,) half the sides of that box [m]
    reach: float = field(init=False)  # [m] no point is further from the middle

    def __post_init__(self) -> None:
        corners = np.concatenate(self.pieces)
        low, high = corners.min(axis=0), corners.max(axis=0)
        middle = 0.5 * (low + high)
        object.__setattr__(self, "middle", middle)
        object.__setattr__(self, "half", 0.5 * (high - low))
        object.__setattr__(self, "reach", float(np.hypot(*(corners - middle).T).max()))


class Windows(NamedTuple):
    """Slices that cover coasts, in order; the last of each may overlap the one before."""

    coast: IntArray  # (n,) number of the coast
    level: IntArray  # (n,) each lasts 2^-level s
    begins: Array  # (n,) [s]

    @property
    def lengths(self) -> Array:
        """How long each lasts (n,) [s]."""
        return np.ldexp(1.0, -self.level)

    def of(self, rows: Any) -> Windows:
        """Some of them, by number or truth."""
        return Windows(self.coast[rows], self.level[rows], self.begins[rows])


@functools.lru_cache(maxsize=16)
def grown_body(footprint: tuple[Shape, ...], margin: float, excess: float) -> GrownBody:
    """A footprint grown by a margin [m], round corners by at most `excess` [m] more."""
    return GrownBody(body_pieces(footprint, margin=margin, excess=excess))


def cut_where_it_pivots(body: GrownBody, twist: Twist) -> GrownBody:
    """The same body in pieces none of whose long sides turns about a point beside its middle.

    All that a turning body does at an instant is to turn about one point, which stays where it is
    in the body's frame. A side is cut, and the whole piece with it, where it is nearest to that
    point: it moves outwards on one side of there, and inwards on the other.
    """
    v_x, v_y, turn_rate = twist
    if turn_rate == 0.0 or math.hypot(v_x, v_y) > FAR * abs(turn_rate):
        return body
    pivot = np.array([-v_y / turn_rate, v_x / turn_rate])
    whole, todo = [], list(body.pieces)
    while todo:
        corners = todo.pop()
        sides = np.roll(corners, -1, axis=0) - corners
        lengths = np.maximum(np.hypot(*sides.T), 1e-300)
        feet = ((pivot - corners) * sides).sum(axis=1) / lengths  # [m] from where each begins
        shorter = np.minimum(feet, lengths - feet)
        k = int(np.argmax(shorter))
        extent = float((corners.max(axis=0) - corners.min(axis=0)).max())
        if shorter[k] > ROUND * extent:
            along = sides[k] / lengths[k]
            parts = _halves_of(corners, (corners - corners[k]) @ along - feet[k])
            todo += parts
        else:
            whole.append(corners)
    return GrownBody(tuple(whole))


def _halves_of(corners: Array, aside: Array) -> list[Array]:
    """A convex polygon (n, 2) cut by a line that its corners are `aside` (n,) [m] of."""
    after, aside_after = np.roll(corners, -1, axis=0), np.roll(aside, -1)
    halves: list[list[Array]] = [[], []]
    for k, here in enumerate(aside.tolist()):
        for side, sign in enumerate((-1.0, 1.0)):
            if sign * here >= 0.0:
                halves[side].append(corners[k])
        if here * aside_after[k] < 0.0:
            cut = corners[k] + here / (here - aside_after[k]) * (after[k] - corners[k])
            halves[0].append(cut)
            halves[1].append(cut)
    return [np.array(one) for one in halves]


def swept_hulls(body: GrownBody, poses: Array, steps: Array) -> list[Array]:
    """Convex polygons that hold every point of the body along a course.

    It stands at `poses` (n + 1, 3) and moves from each to the next with a constant twist, which
    makes the step of `steps` (n, 3) in the frame of the first; the hulls are seen as the poses are.
    A corner runs along an arc, which lies in the triangle of its ends and the point where the
    tangents there meet; points between corners are between such triangles.
    """
    v_x, v_y, turn = (column[:, None] for column in steps.T)
    straight = 0.5 * turn == 0.0
    half = np.where(straight, 1.0, 0.5 * turn)
    to_tangents = np.where(straight, 0.5, 0.5 * np.tan(half) / half)
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


def course_boxes(
    body: GrownBody, poses: Array, steps: Array, firsts: IntArray, lasts: IntArray
) -> Array:
    """Rectangles (m, 4, 2) that hold every point of the body along parts of a course.

    Step k goes from ``poses[0, k]`` to ``poses[1, k]``, (2, n, 3), with a constant twist, which
    makes the step of `steps` (n, 3) in the frame of the first. Part i is of the steps from
    ``firsts[i]`` to before ``lasts[i]``; its rectangle lies along the body in the middle of it.
    """
    middle, half = body.middle, body.half
    count = lasts - firsts
    starts = np.cumsum(count) - count
    part = np.repeat(np.arange(count.size), count)
    rows = np.arange(part.size) - starts[part] + firsts[part]
    frames = SE2(poses[0, (firsts + lasts) // 2])
    inverse, here = SE2(frames.inverse().pose[part]), poses[:, rows]
    seen = inverse.act(SE2(here).act(middle))
    turned = here[..., 2] - frames.pose[part, 2]
    cosine, sine = np.abs(np.cos(turned)), np.abs(np.sin(turned))
    # An arc lies in the triangle of its ends and the point where the tangents there meet.
    turn = np.abs(steps[rows, 2])
    swing = np.hypot(steps[rows, 0], steps[rows, 1]) + (np.hypot(*middle) + body.reach) * turn
    off = np.where(turn < 1.0, 0.5 * swing * np.tan(0.5 * np.minimum(turn, 1.0)), swing)
    reach = np.stack(
        [cosine * half[0] + sine * half[1], sine * half[0] + cosine * half[1]], axis=-1
    )
    reach += off[:, None]
    low = np.minimum.reduceat((seen - reach).min(axis=0), starts)
    high = np.maximum.reduceat((seen + reach).max(axis=0), starts)
    x, y = np.stack([low[:, 0], high[:, 0]]), np.stack([low[:, 1], high[:, 1]])
    rings = np.stack([x[[0, 1, 1, 0]], y[[0, 0, 1, 1]]], axis=-1)
    return np.swapaxes(frames.act(rings), 0, 1)


def chunks(steps: Array, begins: NDArray[np.bool_]) -> tuple[IntArray, IntArray]:
    """Where runs of steps (n, 3) of courses begin and end; each turns by at most `MOST_TURN`.

    A course begins with each of the steps that `begins` (n,) marks. A single step may turn more.
    """
    firsts: list[int] = []
    turned = 0.0
    turns = np.abs(steps[:, 2]).tolist()
    for k, (turn, begin) in enumerate(zip(turns, begins.tolist(), strict=True)):
        if begin or turned + turn > MOST_TURN or k - firsts[-1] >= MOST_STEPS:
            firsts.append(k)
            turned = 0.0
        turned += turn
    first = np.array(firsts, dtype=np.int64)
    return first, np.append(first[1:], len(steps))


def slice_excess(body: GrownBody, twist: Twist, duration: float) -> float:
    """No point of the hulls is further than this [m] from where the body passes.

    A point of a hull is a mean of corners seen at several times. Hold the same mean of corners
    against it at the mean time: the common velocity cancels, and the turning remains,
    at most ``reach * |turn| / 2``, the curvature of the arcs, and the tips of the triangles.
    """
    turn = abs(twist[2]) * duration
    if turn == 0.0:
        return 0.0
    excess = 0.0
    for corners in body.pieces:
        center = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        reach = float(np.hypot(*(corners - center).T).max())
        radius = float(point_speeds(np.array([twist]), corners).max()) / abs(twist[2])
        arcs = radius * (0.125 * turn**2 + 2.0 * math.sin(0.25 * turn) ** 2 / math.cos(0.5 * turn))
        excess = max(excess, 0.5 * reach * turn + arcs)
    return excess


def halves(parts: Windows) -> Windows:
    """Slices half as long that cover the time of `parts`."""
    second = np.stack([np.zeros(parts.begins.size), 0.5 * parts.lengths], axis=1)
    begins = (parts.begins[:, None] + second).reshape(-1)
    return Windows(np.repeat(parts.coast, 2), np.repeat(parts.level + 1, 2), begins)

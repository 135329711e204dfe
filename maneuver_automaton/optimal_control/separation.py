"""Lines that part a moving body from what stands in its way, interval by interval.

One line for each interval, convex piece of an obstacle and convex piece of the body. It parts the
obstacle from the whole motion between the two nodes: every corner of the body stays on its side
with both ends of its way and with the two control points of the cubic that has the same places and
velocities at both ends. The cubic lies in the hull of its control points, and what the corner's
true way differs from it is of fourth order in the step, so that a small gap covers it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.optimal_control.problem import Components

Solid = tuple[Array, float]
"""Corners (n, 2) of a convex polygon, and the radius that rounds it: one corner makes a disc."""

PartPose = Callable[[Components], Sequence[Any]]
"""Pose (x, y, heading) of a part in the frame of the vehicle, from the reduced state."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class BodyPart:
    """A rigid part of a vehicle: convex solids in its own frame, and where that frame is.

    Examples
    --------
    >>> hull = np.array([[-1.0, -0.5], [3.0, -0.5], [3.0, 0.5], [-1.0, 0.5]])
    >>> round(BodyPart(solids=((hull, 0.0),)).reach, 3)
    2.062
    """

    solids: tuple[Solid, ...]
    pose: PartPose | None = None  # in the frame of the vehicle; None: the same

    @property
    def reach(self) -> float:
        """Radius of the smallest box's circle around the part [m]: how big it is."""
        low = np.min([corners.min(axis=0) - by for corners, by in self.solids], axis=0)
        high = np.max([corners.max(axis=0) + by for corners, by in self.solids], axis=0)
        return float(np.hypot(*(high - low))) / 2.0


class Pairs(NamedTuple):
    """Which interval, piece of the body and piece of the obstacles each line parts."""

    interval: IntArray  # (n,)
    body: IntArray  # (n,) among all solids of all parts
    piece: IntArray  # (n,)

    def joined(self, other: Pairs) -> Pairs:
        """These and those of the others that are not among them."""
        have = set(zip(*(column.tolist() for column in self), strict=True))
        rows = list(zip(*(column.tolist() for column in other), strict=True))
        new = np.array([k for k, row in enumerate(rows) if row not in have], dtype=np.int64)
        columns = (
            np.concatenate([old, column[new]]) for old, column in zip(self, other, strict=True)
        )
        return Pairs(*columns)


class Ways(NamedTuple):
    """Control points of the ways of a solid's corners: rows (4 m) of points, columns intervals."""

    x: Any  # (4 m, n - 1)
    y: Any  # (4 m, n - 1)


class Lines(NamedTuple):
    """A line for each pair: its points p have ``normal . (p - anchor) = offset``."""

    angle: Array  # (n,) [rad] of the normal, which points to the obstacle
    anchor: Array  # (n, 2) [m]
    gap: Array  # (n,) [m] between the two at the guess, negative where they overlap


class Frames(NamedTuple):
    """Where the vehicle is and how it moves, in symbols: at one node of each interval."""

    pose: Any  # (dof, n - 1)
    twist: Sequence[Any]  # dof rows (1, n - 1)
    reduced: Any  # (n_z, n - 1)
    reduced_rates: Any  # (n_z, n - 1)


def ways(
    casadi: Any, parts: Sequence[BodyPart], begin: Frames, end: Frames, *, step: Any
) -> list[Ways]:
    """Control points of every solid's corners in every interval, in symbols.

    Source: Farin (2002), *Curves and Surfaces for CAGD*, Sec. 7.5 (cubic Hermite interpolation in
    Bernstein form).

    Parameters
    ----------
    casadi : module
    parts : sequence of BodyPart
    begin, end : Frames
        At the begin and at the end of each interval, with the control of the interval.
    step : (1, n - 1) symbols
        Duration of each interval [s].
    """
    found = []
    for part in parts:
        for corners, _ in part.solids:
            x_0, y_0, v_0, w_0 = _corners(casadi, part, corners, begin)
            x_1, y_1, v_1, w_1 = _corners(casadi, part, corners, end)
            third = casadi.repmat(step / 3.0, len(corners), 1)
            x = casadi.vertcat(x_0, x_0 + third * v_0, x_1 - third * v_1, x_1)
            y = casadi.vertcat(y_0, y_0 + third * w_0, y_1 - third * w_1, y_1)
            found.append(Ways(x, y))
    return found


def _corners(casadi: Any, part: BodyPart, corners: Array, at: Frames) -> tuple[Any, ...]:
    """Places x, y and velocities (m, n - 1) of the corners of a part."""
    count = at.pose.shape[1]
    ones = casadi.SX.ones(1, count)
    along, aside = casadi.DM(corners[:, 0]), casadi.DM(corners[:, 1])
    if part.pose is None:
        x, y = along @ ones, aside @ ones
        v = w = casadi.SX.zeros(len(corners), count)
    else:
        place = part.pose(casadi.vertsplit(at.reduced))
        p_x, p_y, turn = (casadi.SX(value) * ones for value in place)
        every = casadi.SX.ones(len(corners), 1)
        x = every @ p_x + along @ casadi.cos(turn) - aside @ casadi.sin(turn)
        y = every @ p_y + along @ casadi.sin(turn) + aside @ casadi.cos(turn)
        v = casadi.jtimes(x, at.reduced, at.reduced_rates)
        w = casadi.jtimes(y, at.reduced, at.reduced_rates)
    ahead, sideways, turning = (
        casadi.repmat(casadi.SX(at.twist[k]) * ones, len(corners), 1) for k in range(3)
    )
    v, w = ahead - turning * y + v, sideways + turning * x + w
    cosine, sine, p_x, p_y = (
        casadi.repmat(row, len(corners), 1)
        for row in (casadi.cos(at.pose[2, :]), casadi.sin(at.pose[2, :]), at.pose[0, :],
                    at.pose[1, :])
    )  # fmt: skip
    return (
        p_x + cosine * x - sine * y,
        p_y + sine * x + cosine * y,
        cosine * v - sine * w,
        sine * v + cosine * w,
    )


def near_pairs(
    points: Sequence[tuple[Array, Array]],
    body: Sequence[Solid],
    pieces: Sequence[Solid],
    *,
    within: float,
) -> Pairs:
    """Pairs that are nearer than `within` [m], from control points in numbers."""
    import shapely

    solid = np.array([_geometry(corners) for corners, _ in pieces], dtype=object)
    rounding = np.array([by for _, by in pieces])
    tree = shapely.STRtree(solid)
    intervals, bodies, found = [], [], []
    for k, ((x, y), (_, by)) in enumerate(zip(points, body, strict=True)):
        hulls = _hulls(x, y)
        most = within + by + float(rounding.max(initial=0.0))
        interval, piece = tree.query(hulls, predicate="dwithin", distance=most)
        apart = shapely.distance(hulls[interval], solid[piece]) - by - rounding[piece]
        close = apart < within
        intervals.append(interval[close])
        bodies.append(np.full(int(close.sum()), k))
        found.append(piece[close])
    return Pairs(*(np.concatenate(column).astype(np.int64) for column in (intervals, bodies, found)))


def first_lines(
    points: Sequence[tuple[Array, Array]],
    body: Sequence[Solid],
    pieces: Sequence[Solid],
    pairs: Pairs,
) -> Lines:
    """Lines between nearest points; where two solids overlap, along their least penetration."""
    import shapely

    solid = np.array([_geometry(corners) for corners, _ in pieces], dtype=object)
    hulls = [_hulls(x, y) for x, y in points]
    mine = np.array([hulls[b][k] for k, b in zip(pairs.interval, pairs.body, strict=True)],
                    dtype=object)  # fmt: skip
    if not len(mine):
        return Lines(np.zeros(0), np.zeros((0, 2)), np.zeros(0))
    ends = shapely.get_coordinates(shapely.shortest_line(mine, solid[pairs.piece]))
    here, there = ends[0::2], ends[1::2]
    gap = np.hypot(*(there - here).T)
    angle = np.arctan2(there[:, 1] - here[:, 1], there[:, 0] - here[:, 0])
    anchor = 0.5 * (here + there)
    rounding = np.array([body[b][1] + pieces[p][1] for b, p in zip(*pairs[1:], strict=True)])
    for row in np.flatnonzero(gap < 1e-6):
        own = shapely.get_coordinates(mine[row])
        angle[row], gap[row], anchor[row] = _least_penetration(own, pieces[pairs.piece[row]][0])
    return Lines(angle, anchor, gap - rounding)


def line_rows(
    casadi: Any,
    found: Sequence[Ways],
    body: Sequence[Solid],
    pieces: Sequence[Solid],
    pairs: Pairs,
    *,
    anchor: Array,
    lines: tuple[Any, Any],
    gap: float,
) -> Any:
    """What must not be positive: how far each side reaches over its line, as one column.

    Parameters
    ----------
    found : sequence of Ways
        One for each solid of the body.
    anchor : (n, 2) array
    lines : (angle, offset)
        Rows (1, n), symbols or numbers.
    gap : float
        Kept between the body and the line [m].
    """
    angle, offset = lines
    cosine, sine = casadi.cos(angle), casadi.sin(angle)
    rows = []
    for number, way in enumerate(found):
        which = np.flatnonzero(pairs.body == number).tolist()
        if not which:
            continue
        columns = pairs.interval[which].tolist()
        count = way.x.shape[0]
        c, s, o = (casadi.repmat(row[:, which], count, 1) for row in (cosine, sine, offset))
        x = way.x[:, columns] - casadi.repmat(casadi.DM(anchor[which, 0]).T, count, 1)
        y = way.y[:, columns] - casadi.repmat(casadi.DM(anchor[which, 1]).T, count, 1)
        rows.append(casadi.vec(c * x + s * y - o + (body[number][1] + gap)))
    owner = np.concatenate([np.full(len(pieces[p][0]), k) for k, p in enumerate(pairs.piece)])
    corner = np.concatenate([pieces[p][0] for p in pairs.piece]) - anchor[owner]
    rounding = np.array([pieces[pairs.piece[k]][1] for k in owner])
    own = owner.tolist()
    x, y = casadi.DM(corner[:, 0]).T, casadi.DM(corner[:, 1]).T
    beyond = cosine[:, own] * x + sine[:, own] * y - offset[:, own] - casadi.DM(rounding).T
    return casadi.vertcat(*rows, casadi.vec(-beyond))


def support_offsets(pieces: Sequence[Solid], pairs: Pairs, lines: Lines) -> Array:
    """Offsets (n,) of the lines that touch the pieces, their angles kept."""
    normal = np.stack([np.cos(lines.angle), np.sin(lines.angle)], axis=1)
    nearest = [
        float(((pieces[p][0] - lines.anchor[k]) @ normal[k]).min()) - pieces[p][1]
        for k, p in enumerate(pairs.piece)
    ]
    return np.array(nearest)


def _geometry(corners: Array) -> Any:
    import shapely

    if len(corners) == 1:
        return shapely.Point(corners[0])
    return shapely.LineString(corners) if len(corners) == 2 else shapely.Polygon(corners)


def _hulls(x: Array, y: Array) -> Any:
    import shapely

    count = x.shape[1]
    points = np.stack([x.T, y.T], axis=-1).reshape(-1, 2)
    owner = np.repeat(np.arange(count), x.shape[0])
    return shapely.convex_hull(shapely.multipoints(points, indices=owner))


def _least_penetration(own: Array, other: Array) -> tuple[float, float, Array]:
    """Direction, gap (negative) and a point between of two overlapping convex polygons."""
    best = (0.0, -np.inf, own.mean(axis=0))
    for ring, sign in ((own, 1.0), (other, -1.0)):
        edge = np.roll(ring, -1, axis=0) - ring
        for x, y in np.concatenate([edge, -edge]):
            length = float(np.hypot(x, y))
            if length < 1e-9:
                continue
            normal = sign * np.array([y, -x]) / length
            reach, begin = float((own @ normal).max()), float((other @ normal).min())
            if begin - reach > best[1]:
                centre = own.mean(axis=0)
                middle = centre + (0.5 * (reach + begin) - float(centre @ normal)) * normal
                best = (float(np.arctan2(normal[1], normal[0])), begin - reach, middle)
    return best

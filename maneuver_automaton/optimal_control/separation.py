"""Lines that part a moving body from obstacles in its path, interval by interval.

One line for each interval, convex piece of an obstacle and convex piece of the body. It parts the
obstacle from the body at both nodes, and from how far the corners swing out between them: a margin
that is computed from the motion and frozen while the solver runs. To check, each corner's path is a
cubic with the same places and velocities at both nodes. It lies in the hull of its control points,
and the true path differs from it by a fourth order of the step, which a small margin covers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.optimal_control.problem import Components

TOUCHING = 1e-6  # [m] nearer solids have no direction between them

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

    def extended(self, other: Pairs) -> Pairs:
        """These and those of the others that are not among them."""
        have = set(zip(*(column.tolist() for column in self), strict=True))
        rows = list(zip(*(column.tolist() for column in other), strict=True))
        new = np.array([k for k, row in enumerate(rows) if row not in have], dtype=np.int64)
        columns = (
            np.concatenate([old, column[new]]) for old, column in zip(self, other, strict=True)
        )
        return Pairs(*columns)


class Paths(NamedTuple):
    """Control points of the paths of m corners: first all begins, all ends, then those between."""

    x: Any  # (4 m, n - 1)
    y: Any  # (4 m, n - 1)


class Lines(NamedTuple):
    """A line for each pair, through its anchor; the normal points from the body to the piece."""

    angle: Array  # (n,) [rad] of the normal
    anchor: Array  # (n, 2) [m]

    @property
    def normal(self) -> Array:
        """Unit normals (n, 2)."""
        return np.stack([np.cos(self.angle), np.sin(self.angle)], axis=1)

    def extended(self, other: Lines) -> Lines:
        """These, then the others."""
        return Lines(*(np.concatenate(pair) for pair in zip(self, other, strict=True)))

    def shifted(self, offset: Array) -> Lines:
        """The lines moved along their normals."""
        return Lines(self.angle, self.anchor + offset[:, None] * self.normal)


class Frames(NamedTuple):
    """Where the vehicle is and how it moves, in symbols: at one node of each interval."""

    pose: Any  # (dof, n - 1)
    twist: Sequence[Any]  # dof rows (1, n - 1)
    reduced: Any  # (n_z, n - 1)
    reduced_rates: Any  # (n_z, n - 1)


def paths(
    casadi: Any, parts: Sequence[BodyPart], begin: Frames, end: Frames, *, step: Any
) -> list[Paths]:
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
            x = casadi.vertcat(x_0, x_1, x_0 + third * v_0, x_1 - third * v_1)
            y = casadi.vertcat(y_0, y_1, y_0 + third * w_0, y_1 - third * w_1)
            found.append(Paths(x, y))
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
    return Pairs(
        *(np.concatenate(column).astype(np.int64) for column in (intervals, bodies, found))
    )


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
        return Lines(np.zeros(0), np.zeros((0, 2)))
    ends = shapely.get_coordinates(shapely.shortest_line(mine, solid[pairs.piece]))
    here, there = ends[0::2], ends[1::2]
    angle = np.arctan2(there[:, 1] - here[:, 1], there[:, 0] - here[:, 0])
    anchor = 0.5 * (here + there)
    for row in np.flatnonzero(np.hypot(*(there - here).T) < TOUCHING):
        own = shapely.get_coordinates(mine[row])
        angle[row], anchor[row] = _least_penetration(own, pieces[pairs.piece[row]][0])
    return Lines(angle, anchor)


def line_rows(
    casadi: Any,
    found: Sequence[Paths],
    scene: tuple[Sequence[Solid], Sequence[Solid]],
    pairs: Pairs,
    *,
    anchor: Any,
    lines: tuple[Any, Any],
    margin: Any,
    pieces_too: bool,
) -> Any:
    """What must not be positive: how far each side reaches over its line, as one column.

    Parameters
    ----------
    found : sequence of Paths
        One for each solid of the body.
    scene : (body, pieces)
        Solids of both sides.
    anchor : (2, n) symbols
        A place near each line [m].
    lines : (angle, offset)
        Rows (1, n) of symbols: how far beyond its anchor each line runs.
    margin : (1, n) symbols
        Kept between the body at the nodes and the line [m].
    pieces_too : bool
        Whether the pieces need rows of their own; not where the lines stand still.
    """
    body, pieces = scene
    angle, offset = lines
    cosine, sine = casadi.cos(angle), casadi.sin(angle)
    rows = []
    for number, path in enumerate(found):
        which = np.flatnonzero(pairs.body == number).tolist()
        if not which:
            continue
        columns = pairs.interval[which].tolist()
        count = path.x.shape[0] // 2
        c, s, o = (
            casadi.repmat(row[:, which], count, 1) for row in (cosine, sine, offset - margin)
        )
        x = path.x[:count, columns] - casadi.repmat(anchor[0, which], count, 1)
        y = path.y[:count, columns] - casadi.repmat(anchor[1, which], count, 1)
        rows.append(casadi.vec(c * x + s * y - o + body[number][1]))
    if pieces_too:
        owner = np.concatenate([np.full(len(pieces[p][0]), k) for k, p in enumerate(pairs.piece)])
        corner = np.concatenate([pieces[p][0] for p in pairs.piece])
        rounding = casadi.DM([pieces[pairs.piece[k]][1] for k in owner]).T
        own = owner.tolist()
        x = casadi.DM(corner[:, 0]).T - anchor[0, own]
        y = casadi.DM(corner[:, 1]).T - anchor[1, own]
        beyond = cosine[:, own] * x + sine[:, own] * y - offset[:, own] - rounding
        rows.append(casadi.vec(-beyond))
    return casadi.vertcat(*rows)


class Reach(NamedTuple):
    """How far beyond its anchor each side of a line comes, along the normal."""

    nodes: Array  # (n,) [m] of the body at the nodes
    between: Array  # (n,) [m] of the body on its path
    piece: Array  # (n,) [m] of the obstacle, that is where it begins


def reaches(
    points: Sequence[tuple[Array, Array]],
    scene: tuple[Sequence[Solid], Sequence[Solid]],
    pairs: Pairs,
    lines: Lines,
) -> Reach:
    """How far both sides come, from control points in numbers."""
    body, pieces = scene
    normal = lines.normal
    nodes, between = np.empty(len(normal)), np.empty(len(normal))
    for number, (x, y) in enumerate(points):
        which = np.flatnonzero(pairs.body == number)
        columns = pairs.interval[which]
        along = normal[which, 0] * (x[:, columns] - lines.anchor[which, 0])
        along += normal[which, 1] * (y[:, columns] - lines.anchor[which, 1])
        half = len(along) // 2
        nodes[which] = along[:half].max(axis=0) + body[number][1]
        between[which] = along.max(axis=0) + body[number][1]
    begin = [
        float(((pieces[p][0] - lines.anchor[k]) @ normal[k]).min()) - pieces[p][1]
        for k, p in enumerate(pairs.piece)
    ]
    return Reach(nodes, between, np.array(begin))


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


def _least_penetration(own: Array, other: Array) -> tuple[float, Array]:
    """Direction of the least penetration of two convex polygons, and a point in its middle."""
    best, angle, anchor = -np.inf, 0.0, own.mean(axis=0)
    for ring, sign in ((own, 1.0), (other, -1.0)):
        edge = np.roll(ring, -1, axis=0) - ring
        for x, y in np.concatenate([edge, -edge]):
            length = float(np.hypot(x, y))
            if length < TOUCHING:
                continue
            normal = sign * np.array([y, -x]) / length
            reach, begin = float((own @ normal).max()), float((other @ normal).min())
            if begin - reach > best:
                best, angle = begin - reach, float(np.arctan2(normal[1], normal[0]))
                centre = own.mean(axis=0)
                anchor = centre + (0.5 * (reach + begin) - float(centre @ normal)) * normal
    return angle, anchor

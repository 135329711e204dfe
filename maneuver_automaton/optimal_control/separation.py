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
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.optimal_control.problem import Components

TOUCHING = 1e-6  # [m] nearer solids have no direction between them
SHARED = 0.1  # share of the distance by which a piece may stand out before the line of another one
TURNED = np.radians(np.linspace(-70.0, 70.0, 9))  # by which lines may turn

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

    def of(self, which: IntArray) -> Lines:
        """Some of the lines."""
        return Lines(self.angle[which], self.anchor[which])

    def shifted(self, offset: Array) -> Lines:
        """The lines moved along their normals."""
        return Lines(self.angle, self.anchor + offset[:, None] * self.normal)


def near_pairs(
    points: Sequence[tuple[Array, Array]],
    body: Sequence[Solid],
    pieces: Sequence[Solid],
    *,
    within: float,
    during: IntArray | None = None,
) -> Pairs:
    """Pairs that are nearer than `within` [m], from control points in numbers.

    `during` is the interval in which alone each piece counts; -1 for all, -2 for none.
    """
    import shapely

    solid = _geometries([corners for corners, _ in pieces])
    rounding = np.array([by for _, by in pieces])
    tree = shapely.STRtree(solid)
    intervals, bodies, found = [], [], []
    for k, ((x, y), (_, by)) in enumerate(zip(points, body, strict=True)):
        hulls = _hulls(x, y)
        most = within + by + float(rounding.max(initial=0.0))
        interval, piece = tree.query(hulls, predicate="dwithin", distance=most)
        if during is not None:
            there = (during[piece] == -1) | (during[piece] == interval)
            interval, piece = interval[there], piece[there]
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

    if not len(pairs.piece):
        return Lines(np.zeros(0), np.zeros((0, 2)))
    used, owner = np.unique(pairs.piece, return_inverse=True)
    solid = _geometries([pieces[k][0] for k in used.tolist()])
    hulls = [_hulls(x, y) for x, y in points]
    mine = np.array([hulls[b][k] for k, b in zip(pairs.interval, pairs.body, strict=True)],
                    dtype=object)  # fmt: skip
    ends = shapely.get_coordinates(shapely.shortest_line(mine, solid[owner]))
    here, there = ends[0::2], ends[1::2]
    angle = np.arctan2(there[:, 1] - here[:, 1], there[:, 0] - here[:, 0])
    anchor = 0.5 * (here + there)
    for row in np.flatnonzero(np.hypot(*(there - here).T) < TOUCHING):
        own = shapely.get_coordinates(mine[row])
        angle[row], anchor[row] = _least_penetration(own, pieces[pairs.piece[row]][0])
    return Lines(angle, anchor)


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
    if not len(normal):
        return Reach(nodes, between, np.zeros(0))
    corners, rounding = _padded(pieces, pairs.piece)
    there = corners - lines.anchor[:, None]
    begin = np.einsum("nkd,nd->nk", there, normal).min(axis=1) - rounding
    return Reach(nodes, between, begin)


def shared_lines(pieces: Sequence[Solid], pairs: Pairs, lines: Lines, reach: Reach) -> IntArray:
    """For each pair the pair whose line parts it: lines of near pieces part those behind them.

    Parameters
    ----------
    pieces : sequence of Solid
    pairs : Pairs
    lines : Lines
        One for each pair.
    reach : Reach
        How far both sides of its line come, for each pair.

    Returns
    -------
    (n,) integers
        Of a pair that keeps its own line, its own number.

    Examples
    --------
    >>> pairs = Pairs(*np.array([[0, 0], [0, 0], [0, 1]]))
    >>> lines = Lines(np.zeros(2), np.array([[1.0, 0.0], [2.0, 0.0]]))
    >>> walls = [(np.array([[x, -1.0], [x, 1.0]]), 0.0) for x in (2.0, 4.0)]
    >>> reach = Reach(-np.ones(2), -np.ones(2), np.array([1.0, 2.0]))
    >>> shared_lines(walls, pairs, lines, reach).tolist()
    [0, 0]
    """
    owner = np.arange(len(pairs.interval))
    if not len(owner):
        return owner
    corners, rounding = _padded(pieces, pairs.piece)
    gap = reach.piece - reach.between
    limit = reach.piece - SHARED * np.maximum(gap, 0.0)
    normal = lines.normal
    order = np.lexsort((gap, pairs.body, pairs.interval))
    changes = np.diff(pairs.interval[order]) | np.diff(pairs.body[order])
    for group in np.split(order, np.flatnonzero(changes) + 1):
        left = group
        while len(left):
            k, left = left[0], left[1:]
            owner[k] = k
            behind = ((corners[left] - lines.anchor[k]) @ normal[k]).min(axis=1)
            parted = behind - rounding[left] >= limit[k]
            owner[left[parted]] = k
            left = left[~parted]
    return owner


def _padded(solids: Sequence[Solid], which: IntArray) -> tuple[Array, Array]:
    """Corners (n, most, 2) of some solids, the last one repeated, and radii (n,)."""
    used, owner = np.unique(which, return_inverse=True)
    some = [solids[k] for k in used.tolist()]
    most = max(len(corners) for corners, _ in some)
    rows = [np.pad(corners, ((0, most - len(corners)), (0, 0)), "edge") for corners, _ in some]
    return np.array(rows)[owner], np.array([by for _, by in some])[owner]


class Facing(NamedTuple):
    """Corners that may touch a line as it turns a little."""

    body: NDArray[np.bool_]  # (n, 2, most) of the body: at the begin and at the end
    piece: NDArray[np.bool_]  # (n, most)

    def joined(self, other: Facing) -> Facing:
        """Corners of both, those of the other for its pairs, which are the first of these.

        The other's pieces may have fewer corners, and so fewer columns.
        """
        body, piece = self.body.copy(), self.piece.copy()
        body[: len(other.body)] |= other.body
        rows, columns = other.piece.shape
        piece[:rows, :columns] |= other.piece
        return Facing(body, piece)

    def holds(self, other: Facing) -> bool:
        """Whether it has all corners of another one."""
        return bool((self.body >= other.body).all() and (self.piece >= other.piece).all())


def facing(
    points: Sequence[tuple[Array, Array]],
    scene: tuple[Sequence[Solid], Sequence[Solid]],
    pairs: Pairs,
    lines: Lines,
    owner: IntArray,
    *,
    turned: Array,
) -> Facing:
    """Corners of both sides that are foremost for some line, `turned` by some angle [rad].

    Of pieces that share a line only the corners that are foremost among those of all.
    """
    body, pieces = scene
    count = len(pairs.interval)
    most = max((len(corners) for corners, _ in body), default=0)
    here = np.zeros((count, 2, most), dtype=np.bool_)
    angle = lines.angle[:, None] + turned
    c, s = np.cos(angle)[..., None], np.sin(angle)[..., None]
    for number, (x, y) in enumerate(points):
        which = np.flatnonzero(pairs.body == number)
        m = len(body[number][0])
        for node in (0, 1):
            columns = pairs.interval[which]
            rows = slice(node * m, (node + 1) * m)
            along = c[which] * x[rows, columns].T[:, None] + s[which] * y[rows, columns].T[:, None]
            foremost = along.argmax(axis=2)
            here[which[:, None], node, foremost] = True
    if not count:
        return Facing(here, np.zeros((0, 0), dtype=np.bool_))
    corners, rounding = _padded(pieces, pairs.piece)
    there = np.zeros((count, corners.shape[1]), dtype=np.bool_)
    own = corners - lines.anchor[:, None]
    along = c * own[:, None, :, 0] + s * own[:, None, :, 1] - rounding[:, None, None]
    least = along.min(axis=2)
    first = np.full(least.shape, np.inf)
    np.minimum.at(first, owner, least)
    which, turn = np.nonzero(least <= first[owner])
    there[which, along.argmin(axis=2)[which, turn]] = True
    return Facing(here, there)


def _geometries(rings: Sequence[Array]) -> Any:
    """Hulls (n,) of corners in any order: points, edges and polygons, of as many at once."""
    import shapely

    counts = np.array([len(ring) for ring in rings])
    found = np.empty(len(rings), dtype=object)
    for count in np.unique(counts).tolist():
        which = np.flatnonzero(counts == count)
        corners = np.stack([rings[k] for k in which.tolist()])
        make = shapely.linestrings if count == 2 else shapely.polygons
        found[which] = (
            shapely.points(corners[:, 0]) if count == 1 else shapely.convex_hull(make(corners))
        )
    return found


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

"""Lines that part a moving body from obstacles in its path, interval by interval.

One line for each interval, convex piece of an obstacle and convex piece of the body. It parts the
obstacle from the body at both nodes, and from how far the corners swing out between them: a margin
that is computed from the motion and frozen while the solver runs. To check, each corner's path is a
cubic with the same places and velocities at both nodes. It lies in the hull of its control points,
and the true path differs from it by a fourth order of the step, which a small margin covers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._lazy import shapely
from maneuver_automaton.optimal_control.polish_program import PolishProgram
from maneuver_automaton.optimal_control.scene import ALWAYS, Point, Solid

TOUCHING = 1e-6  # [m] nearer solids have no direction between them
SHARED = 0.1  # share of the distance by which a piece may stand out before the line of another one
TURNED = np.radians(np.linspace(-70.0, 70.0, 9))  # by which lines may turn


class SolidPairs(NamedTuple):
    """Which interval, piece of the body and piece of the obstacles each line parts."""

    interval: IntArray  # (n,)
    body: IntArray  # (n,) among all solids of all parts
    piece: IntArray  # (n,)

    def extended(self, other: SolidPairs) -> SolidPairs:
        """These and those of the others that are not among them."""
        have = set(zip(*(column.tolist() for column in self), strict=True))
        rows = list(zip(*(column.tolist() for column in other), strict=True))
        new = np.array([k for k, row in enumerate(rows) if row not in have], dtype=np.int64)
        columns = (
            np.concatenate([old, column[new]]) for old, column in zip(self, other, strict=True)
        )
        return SolidPairs(*columns)


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


def pairs_near(program: PolishProgram, point: Point, within: float) -> SolidPairs:
    """Pairs that are nearer than `within` [m] at a point, from control points in numbers."""
    pieces, body = program.pieces(point), program.scene.body
    if not (pieces.solids and body):
        empty = np.zeros(0, dtype=np.int64)
        return SolidPairs(empty, empty, empty)
    solid = _geometries([corners for corners, _ in pieces.solids])
    rounding = np.array([by for _, by in pieces.solids])
    tree = shapely.STRtree(solid)
    intervals, bodies, found = [], [], []
    for k, ((x, y), (_, by)) in enumerate(zip(program.points(point), body, strict=True)):
        hulls = _hulls(x, y)
        most = within + by + float(rounding.max(initial=0.0))
        interval, piece = tree.query(hulls, predicate="dwithin", distance=most)
        if pieces.move:
            there = (pieces.interval[piece] == ALWAYS) | (pieces.interval[piece] == interval)
            interval, piece = interval[there], piece[there]
        apart = shapely.distance(hulls[interval], solid[piece]) - by - rounding[piece]
        close = apart < within
        intervals.append(interval[close])
        bodies.append(np.full(int(close.sum()), k))
        found.append(piece[close])
    return SolidPairs(
        *(np.concatenate(column).astype(np.int64) for column in (intervals, bodies, found))
    )


def first_lines(program: PolishProgram, point: Point, pairs: SolidPairs) -> Lines:
    """Lines midway between nearest points; of solids that overlap, along the least penetration."""
    if not len(pairs.piece):
        return Lines(np.zeros(0), np.zeros((0, 2)))
    pieces = program.pieces(point).solids
    used, owner = np.unique(pairs.piece, return_inverse=True)
    solid = _geometries([pieces[k][0] for k in used.tolist()])
    hulls = [_hulls(x, y) for x, y in program.points(point)]
    mine = np.array([hulls[b][k] for k, b in zip(pairs.interval, pairs.body, strict=True)],
                    dtype=object)  # fmt: skip
    ends = shapely.get_coordinates(shapely.shortest_line(mine, solid[owner]))
    here, there = ends[0::2], ends[1::2]
    angle = np.arctan2(there[:, 1] - here[:, 1], there[:, 0] - here[:, 0])
    anchor = 0.5 * (here + there)
    for row in np.flatnonzero(np.hypot(*(there - here).T) < TOUCHING):
        own = shapely.get_coordinates(mine[row])
        angle[row], anchor[row] = _least_penetration(own, pieces[pairs.piece[row]][0])
    body, gone = program.scene.body, np.array([pieces[k][1] for k in used.tolist()])[owner]
    rounding = np.array([by for _, by in body])[pairs.body]
    return Lines(angle, anchor).shifted(0.5 * (rounding - gone))


class Reach(NamedTuple):
    """How far beyond its anchor each side of a line comes, along the normal."""

    nodes: Array  # (n,) [m] of the body at the nodes
    between: Array  # (n,) [m] of the body on its path
    piece: Array  # (n,) [m] of the obstacle, that is where it begins


def reaches(
    points: Sequence[tuple[Array, Array]],
    scene: tuple[Sequence[Solid], Sequence[Solid]],
    pairs: SolidPairs,
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
        nodes[which] = along[: len(along) // 2].max(axis=0) + body[number][1]
        between[which] = along.max(axis=0) + body[number][1]
    if not len(normal):
        return Reach(nodes, between, np.zeros(0))
    corners, rounding = _padded(pieces, pairs.piece)
    there = corners - lines.anchor[:, None]
    return Reach(nodes, between, np.einsum("nkd,nd->nk", there, normal).min(axis=1) - rounding)


def shared_lines(
    pieces: Sequence[Solid], pairs: SolidPairs, lines: Lines, reach: Reach
) -> IntArray:
    """For each pair the pair whose line parts it: lines of near pieces part those behind them.

    `lines`: one for each pair. `reach`: how far both sides of its line come, for each pair. Returns
    of a pair that keeps its own line, its own number.
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
    pairs: SolidPairs,
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
            here[which[:, None], node, along.argmax(axis=2)] = True
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
    return shapely.convex_hull(shapely.linestrings(np.stack([x.T, y.T], axis=-1)))


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


SWING = 1.1  # of what corners swing out between nodes is kept as a margin
FURTHER = 2.0  # steps from a wall, from where the path between nodes does not reach it
STANDS_OUT = 1e-6  # [m] before the piece that a line belongs to


class Parting(NamedTuple):
    """Pairs, and the lines that part them at a margin: one for each, those of an owner alike."""

    pairs: SolidPairs  # (n,)
    owner: IntArray  # (n,) the pair whose line it is
    lines: Lines  # (n,)
    margins: Array  # (n,) [m] kept at the nodes
    facing: Facing  # of n: corners that the program looks at

    @property
    def own(self) -> IntArray:
        """The pairs (m,) that have lines of their own."""
        return np.flatnonzero(self.owner == np.arange(len(self.owner)))

    def lacks(self, pairs: SolidPairs) -> bool:
        """Whether some pairs are not among these."""
        return len(self.pairs.extended(pairs).interval) > len(self.owner)

    def depth(self, program: PolishProgram, point: Point) -> float:
        """How deep the body is inside obstacles [m]."""
        reach = self._reach(program, point)
        return float((reach.between - reach.piece).max(initial=0.0))

    def is_kept(self, program: PolishProgram, point: Point) -> bool:
        """Whether every path keeps half of the margin to its piece."""
        reach = self._reach(program, point)
        return bool((reach.between - reach.piece <= -0.5 * program.settings.clearance).all())

    def binding(self, program: PolishProgram, point: Point, tight: float) -> int:
        """How many lines that stand still at the pieces hold the body back, nearer than so [m]."""
        return int(np.count_nonzero(self._reach(program, point).nodes + self.margins > -tight))

    def with_margins(self, program: PolishProgram, point: Point, *, fixed: bool) -> Parting:
        """With room for what corners swing out between nodes; `fixed` lines touch the pieces."""
        reach, lines = self._reach(program, point), self.lines
        if fixed:
            nearest = np.full(len(self.owner), np.inf)
            np.minimum.at(nearest, self.owner, reach.piece)
            lines = lines.shifted(nearest[self.owner])
        swing = program.settings.clearance + SWING * (reach.between - reach.nodes)
        return self._replace(lines=lines, margins=np.maximum(self.margins, swing))

    def moved(self, angle: Array, offset: Array) -> Parting:
        """With its own lines at other angles, and moved along their normals by offsets."""
        slot = np.cumsum(self.owner == np.arange(len(self.owner))) - 1
        mine = slot[self.owner]
        return self._replace(lines=Lines(angle[mine], self.lines.anchor).shifted(offset[mine]))

    def joined(self, program: PolishProgram, point: Point, others: SolidPairs) -> Parting:
        """With the pairs that were not among them, parted by lines of their own."""
        pairs = self.pairs.extended(others)
        count = len(self.owner)
        if len(pairs.interval) == count:
            return self
        new = parted(program, point, SolidPairs(*(column[count:] for column in pairs)))
        both = self._replace(
            pairs=pairs,
            owner=np.concatenate([self.owner, new.owner + count]),
            lines=self.lines.extended(new.lines),
            margins=np.concatenate([self.margins, new.margins]),
        )
        return both._refaced(program, point)

    def split(self, program: PolishProgram, point: Point, tight: float) -> Parting:
        """With lines of their own for pieces that hold back the line of another, `tight` [m]."""
        reach = self._reach(program, point)
        before = reach.piece < reach.piece[self.owner] - STANDS_OUT
        which = np.flatnonzero(before & (reach.piece - reach.between < tight))
        if not len(which):
            return self
        own = first_lines(program, point, SolidPairs(*(one[which] for one in self.pairs)))
        lines = Lines(self.lines.angle.copy(), self.lines.anchor.copy())
        lines.angle[which], lines.anchor[which] = own
        owner = self.owner.copy()
        owner[which] = which
        return self._replace(owner=owner, lines=lines)._refaced(program, point)

    def faced(self, program: PolishProgram, point: Point) -> Parting:
        """With the corners too that are foremost now, if some are not looked at."""
        now = self._facing(program, point, np.zeros(1))
        return self if self.facing.holds(now) else self._refaced(program, point)

    def _refaced(self, program: PolishProgram, point: Point) -> Parting:
        return self._replace(facing=self._facing(program, point, TURNED).joined(self.facing))

    def _facing(self, program: PolishProgram, point: Point, turned: Array) -> Facing:
        points, both = program.points(point), _both(program, point)
        return facing(points, both, self.pairs, self.lines, self.owner, turned=turned)

    def _reach(self, program: PolishProgram, point: Point) -> Reach:
        return reaches(program.points(point), _both(program, point), self.pairs, self.lines)


def parted(program: PolishProgram, point: Point, pairs: SolidPairs) -> Parting:
    """Pairs with first lines at a point, of which pieces behind one another share one."""
    lines = first_lines(program, point, pairs)
    points, both = program.points(point), _both(program, point)
    owner = shared_lines(both[1], pairs, lines, reaches(points, both, pairs, lines))
    lines = lines.of(owner)
    faces = facing(points, both, pairs, lines, owner, turned=TURNED)
    return Parting(pairs, owner, lines, np.zeros(len(owner)), faces)


def _both(program: PolishProgram, point: Point) -> tuple[list[Solid], list[Solid]]:
    """Solids of the body, and of the obstacles while the motion of a point is driven."""
    return program.scene.body, program.pieces(point).solids


def held_near(program: PolishProgram, point: Point, within: float) -> list[IntArray]:
    """For each guard of the scene the intervals (k,) in which the body comes nearer than so [m].

    Then for each wall those from whose nodes a step twice as long may lead nearer than so.
    """
    found = []
    for guard in program.scene.guards:
        if guard.solids is None:
            found.append(np.arange(program.n_intervals))
            continue
        among = replace(program.scene, pieces=guard.solids, movers=())
        found.append(np.unique(pairs_near(program._replace(scene=among), point, within).interval))
    places = point.state[:, :2]
    steps = np.hypot(*np.diff(places, axis=0).T)
    for a, b, c in program.scene.walls:
        room = c - places @ np.array([a, b])
        found.append(np.flatnonzero(np.minimum(room[:-1], room[1:]) < within + FURTHER * steps))
    return found

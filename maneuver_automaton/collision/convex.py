"""Shapes as convex pieces with rounded corners: what the kernels know."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.collision.outline import solid_parts
from maneuver_automaton.collision.shapes import (
    NOWHERE,
    AnyObstacle,
    Box,
    Disc,
    Polygon,
    Shape,
    box_corners,
    by_kind,
)

TINY_EDGE = 1e-6  # [m]
MOST_MERGED = 60  # triangles that are joined to larger pieces; more stay as they are
DIGITS = 9  # decimals of coordinates seen from a frame [m, rad]

_Corner: TypeAlias = tuple[float, float]
_Ring: TypeAlias = tuple[_Corner, ...]


class Solids(NamedTuple):
    """Pieces as the kernels take them."""

    edges: Array  # (V, 5) a corner, the outward normal of the edge that ends there, its offset
    first: IntArray  # (P + 1,) where each piece begins among the edges
    plates: Array  # (P, 5) [low x, low y, high x, high y], rounding included, and the rounding


class ConvexPieces(NamedTuple):
    """Convex polygons, counter-clockwise, each rounded by a radius; one corner makes a disc."""

    corners: Array  # (V, 2) [m] those of each piece, one after the other
    counts: IntArray  # (P,) how many each has
    radius: Array  # (P,) [m]

    def each(self) -> Iterator[tuple[Array, float]]:
        """Corners and rounding of each."""
        rings = np.split(self.corners, np.cumsum(self.counts)[:-1])
        return zip(rings[: self.counts.size], self.radius.tolist(), strict=True)


NO_PIECES = ConvexPieces(NOWHERE, np.zeros(0, dtype=np.int64), np.zeros(0))


def convex_pieces(shape: Shape) -> list[tuple[Array, float]]:
    """Convex pieces (corners counter-clockwise, rounding) that together are the shape."""
    if isinstance(shape, Disc):
        return [(shape.center[None].copy(), shape.radius)]
    if isinstance(shape, Box):
        return [(shape.corners, 0.0)]
    if not shape.holes and len(simple := _simple(shape.corners)) >= 3 and _is_convex(simple):
        return [(simple, 0.0)]
    return [(piece, 0.0) for piece in _decomposed(shape)]


def pieces_seen_from(shapes: tuple[AnyObstacle | Shape, ...], frame: Array) -> ConvexPieces:
    """Convex pieces, seen from a frame (3,), of polygons, those with holes, boxes, and discs.

    Places are counted from the frame before they are turned, and rounded before they are cut, so
    that no digit is lost far away and a moved scene comes out the same. Maps are left out.
    """
    kinds = by_kind(shapes)
    rings = [one.corners for _, one in kinds.polygons if not one.holes]
    places = [*rings, kinds.centers, *(one.center[None] for _, one in kinds.discs)]
    seen = seen_from(np.concatenate(places), frame)
    begin, end = len(seen) - len(kinds.centers) - len(kinds.discs), len(seen) - len(kinds.discs)
    found = [_plain_pieces(seen[:begin], np.array([len(ring) for ring in rings]))] if rings else []
    for one in (one for _, one in kinds.polygons if one.holes):
        holes = [seen_from(hole, frame) for hole in one.holes]
        found.append(pieces_of(convex_pieces(Polygon(seen_from(one.corners, frame), holes))))
    if end > begin:
        turned = box_corners(seen[begin:end], kinds.headings - frame[2], kinds.sizes)
        boxes = turned.round(DIGITS).reshape(-1, 2)
        found.append(ConvexPieces(boxes, np.full(end - begin, 4), np.zeros(end - begin)))
    if kinds.discs:
        radius = np.array([one.radius for _, one in kinds.discs])
        found.append(ConvexPieces(seen[end:], np.ones(radius.size, dtype=np.int64), radius))
    return joined(found)


def seen_from(points: Array, frame: Array) -> Array:
    """Points (..., 2) seen from a frame (3,), rounded."""
    c, s = math.cos(frame[2]), math.sin(frame[2])
    turned = (points - frame[:2]) @ np.array([[c, -s], [s, c]])
    return np.asarray(turned.round(DIGITS) + 0.0)


def _plain_pieces(corners: Array, counts: IntArray) -> ConvexPieces:
    """Pieces of polygons without holes; the convex ones are found all at once."""
    first, after = counts.cumsum() - counts, np.arange(len(corners)) + 1
    after[first + counts - 1] = first
    edge = corners[after] - corners
    following = edge[after]
    cross = edge[:, 0] * following[:, 1] - edge[:, 1] * following[:, 0]
    turn = np.arctan2(cross, np.einsum("ij,ij->i", edge, following))
    left = np.minimum.reduceat(cross, first) >= 0.0
    right = np.maximum.reduceat(cross, first) <= 0.0
    apart = np.logical_and.reduceat(edge.any(axis=1), first)
    # A ring is convex if it turns one way at all corners, once around: twice, it crosses itself.
    once = apart & (np.abs(np.abs(np.add.reduceat(turn, first)) - 2.0 * math.pi) < 1.0)
    if (once & left).all():
        return ConvexPieces(corners, counts, np.zeros(counts.size))
    pieces: list[tuple[Array, float]] = []
    for k, ring in enumerate(np.split(corners, first[1:])):
        if once[k] and (left[k] or right[k]):
            pieces.append((ring if left[k] else ring[::-1], 0.0))
        else:
            pieces += convex_pieces(Polygon(ring))
    return pieces_of(pieces)


def pieces_of(each: Iterable[tuple[Array, float]]) -> ConvexPieces:
    """Pieces from corners and rounding of each."""
    every = list(each)
    counts = np.array([len(ring) for ring, _ in every], dtype=np.int64)
    radius = np.array([by for _, by in every], dtype=np.float64)
    return ConvexPieces(np.concatenate([NOWHERE, *(ring for ring, _ in every)]), counts, radius)


def joined(parts: Sequence[ConvexPieces]) -> ConvexPieces:
    """All pieces, those of each part one after the other."""
    return ConvexPieces(*map(np.concatenate, zip(NO_PIECES, *parts, strict=True)))


def solids_of(pieces: ConvexPieces) -> Solids:
    """Arrays of pieces for the kernels."""
    corners, counts, radius = pieces
    first = np.zeros(counts.size + 1, dtype=np.int64)
    counts.cumsum(out=first[1:])
    if not counts.size:
        return Solids(np.zeros((0, 5)), first, np.zeros((0, 5)))
    begins, before = first[:-1], np.arange(-1, len(corners) - 1)
    before[begins] = first[1:] - 1
    edge = corners - corners[before]
    length = np.hypot(edge[:, 0], edge[:, 1])
    short = length < TINY_EDGE
    if short.any():
        single = (counts == 1).repeat(counts)
        if not (length[~single] > 0.0).all():  # corners that rounding has made one
            kept = [(a[(a != _next(a)).any(axis=1)], a, by) for a, by in pieces.each()]
            return solids_of(pieces_of((some if len(some) else a[:1], by) for some, a, by in kept))
        length[single], short = 1.0, short & ~single
    normal = edge[:, ::-1] * (1.0, -1.0) / length[:, None]
    offset = np.einsum("ij,ij->i", normal, corners)
    for k in short.nonzero()[0].tolist():  # its normal is rounded, like its ends
        piece = int(np.searchsorted(first, k, side="right")) - 1
        offset[k] = (corners[first[piece] : first[piece + 1]] @ normal[k]).max()
    around = radius[:, None]
    low, high = np.minimum.reduceat(corners, begins), np.maximum.reduceat(corners, begins)
    edges = np.concatenate([corners, normal, offset[:, None]], axis=1)
    return Solids(edges, first, np.concatenate([low - around, high + around, around], axis=1))


def _simple(ring: Array) -> Array:
    """Counter-clockwise, without repeated corners."""
    after = _next(ring)
    differs = (ring != after).any(axis=1)
    if not differs.all():
        ring = ring[differs]
        after = _next(ring) if len(ring) else ring
    area = float(ring[:, 0] @ after[:, 1] - ring[:, 1] @ after[:, 0])
    return ring if area >= 0.0 else ring[::-1].copy()


def _next(ring: Array) -> Array:
    """The corner after each corner."""
    return np.concatenate([ring[1:], ring[:1]])


def _is_convex(ring: Array) -> bool:
    """Whether a counter-clockwise ring turns left everywhere, once around."""
    edge = _next(ring) - ring
    after = _next(edge)
    cross = edge[:, 0] * after[:, 1] - edge[:, 1] * after[:, 0]
    if (cross < 0.0).any() or not (cross > 0.0).any():
        return False
    turns = np.arctan2(cross, np.einsum("ij,ij->i", edge, after))
    return bool(turns.sum() < 3.0 * math.pi)


def _decomposed(shape: Polygon) -> list[Array]:
    """Pieces of a polygon that is concave, has holes, or is none: nothing solid is lost."""
    import shapely

    pieces: list[Array] = []
    for part in solid_parts(shape):
        triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(part))
        pieces += _merged([_simple(shapely.get_coordinates(one)[:3]) for one in triangles])
    whole = shapely.Polygon(shape.corners, shape.holes)
    if whole.is_valid:
        return pieces
    # What rounding has left without width is solid still: a line, or a single point.
    for part in shapely.get_parts(shapely.get_parts(shapely.make_valid(whole))):
        points = shapely.get_coordinates(part)
        if part.geom_type == "Point":
            pieces.append(points)
        elif part.geom_type != "Polygon":
            pieces += [np.stack([a, b]) for a, b in itertools.pairwise(points) if (a != b).any()]
    return pieces


def _merged(pieces: list[Array]) -> list[Array]:
    """Join neighbours across an edge as long as what comes out is convex."""
    rings = [tuple((x, y) for x, y in piece.tolist()) for piece in pieces if len(piece) >= 3]
    if len(rings) > MOST_MERGED:
        return [np.array(ring) for ring in rings]
    apart: set[tuple[int, int, _Corner]] = set()  # pairs that stay two, and where they meet
    numbered = dict(enumerate(rings))
    number = len(rings)
    while pair := _first_to_join(numbered, apart):
        k, other, union = pair
        del numbered[k], numbered[other]
        numbered[number] = union  # it comes last
        number += 1
    return [np.array(ring) for ring in numbered.values()]


def _first_to_join(
    numbered: dict[int, _Ring], apart: set[tuple[int, int, _Corner]]
) -> tuple[int, int, _Ring] | None:
    """The first two neighbours that are convex together, and their ring."""
    edges = {e: k for k, ring in numbered.items() for e in itertools.pairwise([*ring, ring[0]])}
    for (a, b), k in edges.items():
        other = edges.get((b, a), k)
        if other == k or (k, other, a) in apart:
            continue
        union = _union(numbered[k], numbered[other], a, b)
        if union is not None and _is_convex(np.array(union)):
            return k, other, union
        apart.add((k, other, a))
    return None


def _union(one: _Ring, other: _Ring, a: _Corner, b: _Corner) -> _Ring | None:
    """Ring of two pieces that share the edge from `a` to `b`."""
    begin = one.index(b)
    first = one[begin:] + one[:begin]  # b ... a
    begin = other.index(a)
    second = other[begin:] + other[:begin]  # a ... b
    if first[-1] != a or second[-1] != b:
        return None
    return first + second[1:-1]

"""Shapes as convex pieces with rounded corners: what the kernels know."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from typing import NamedTuple, TypeAlias

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.collision.outline import solid_parts
from maneuver_automaton.collision.shapes import Box, Disc, Polygon, Shape

TINY_EDGE = 1e-6  # [m]
MOST_MERGED = 60  # triangles that are joined to larger pieces; more stay as they are
DIGITS = 9  # decimals of coordinates seen from a frame [m, rad]

_Corner: TypeAlias = tuple[float, float]
_Ring: TypeAlias = tuple[_Corner, ...]


class Solids(NamedTuple):
    """Convex polygons, counter-clockwise, each rounded by a radius; one corner makes a disc."""

    edges: Array  # (V, 5) a corner, the outward normal of the edge that ends there, its offset
    first: IntArray  # (P + 1,) where each piece begins among the edges
    plates: Array  # (P, 5) [low x, low y, high x, high y], rounding included, and the rounding


def convex_pieces(shape: Shape) -> list[tuple[Array, float]]:
    """Convex pieces (corners counter-clockwise, rounding) that together are the shape."""
    if isinstance(shape, Disc):
        return [(shape.center[None].copy(), shape.radius)]
    if isinstance(shape, Box):
        return [(shape.corners, 0.0)]
    if not shape.holes and len(simple := _simple(shape.corners)) >= 3 and _is_convex(simple):
        return [(simple, 0.0)]
    return [(piece, 0.0) for piece in _decomposed(shape)]


def pieces_seen_from(shapes: list[Shape], frame: Array) -> list[list[tuple[Array, float]]]:
    """Convex pieces, seen from a frame (3,), of polygons, those with holes, boxes, and discs.

    Places are counted from the frame before they are turned, and rounded before they are cut, so
    that no digit is lost far away and a moved scene comes out the same.
    """
    polygons = [shape for shape in shapes if isinstance(shape, Polygon)]
    plain = _plain_pieces([one.corners for one in polygons if not one.holes], frame)
    pierced: list[tuple[Array, float]] = []
    for one in polygons:
        if one.holes:
            holes = [seen_from(hole, frame) for hole in one.holes]
            pierced += convex_pieces(Polygon(seen_from(one.corners, frame), holes))
    boxes = _box_pieces([shape for shape in shapes if isinstance(shape, Box)], frame)
    discs = [shape for shape in shapes if isinstance(shape, Disc)]
    centers = seen_from(np.array([one.center[None] for one in discs]), frame) if discs else ()
    rounded = [(one, disc.radius) for one, disc in zip(centers, discs, strict=True)]
    return [plain, pierced, boxes, rounded]


def seen_from(points: Array, frame: Array) -> Array:
    """Points (..., 2) seen from a frame (3,), rounded."""
    c, s = math.cos(frame[2]), math.sin(frame[2])
    turned = (points - frame[:2]) @ np.array([[c, -s], [s, c]])
    return np.asarray(np.round(turned, DIGITS) + 0.0)


def _plain_pieces(rings: list[Array], frame: Array) -> list[tuple[Array, float]]:
    """Pieces of polygons without holes; the convex ones, most as a rule, are found all at once."""
    if not rings:
        return []
    counts = np.array([len(ring) for ring in rings])
    first = np.concatenate([[0], np.cumsum(counts)[:-1]])
    corners = seen_from(np.concatenate(rings), frame)
    after = np.arange(1, len(corners) + 1)
    after[first + counts - 1] = first
    edge = corners[after] - corners
    following = edge[after]
    cross = edge[:, 0] * following[:, 1] - edge[:, 1] * following[:, 0]
    turn = np.arctan2(cross, np.einsum("ij,ij->i", edge, following))
    total = np.add.reduceat(turn, first)
    left = np.minimum.reduceat(cross, first) >= 0.0
    right = np.maximum.reduceat(cross, first) <= 0.0
    apart = np.logical_and.reduceat(edge.any(axis=1), first)
    # A ring is convex if it turns one way at all corners and once around; twice around crosses
    # itself.
    once = apart & (np.abs(np.abs(total) - 2.0 * math.pi) < 1.0)
    pieces: list[tuple[Array, float]] = []
    for k, begin in enumerate(first):
        ring = corners[begin : begin + counts[k]]
        if once[k] and left[k]:
            pieces.append((ring, 0.0))
        elif once[k] and right[k]:
            pieces.append((ring[::-1], 0.0))
        else:
            pieces += convex_pieces(Polygon(ring))
    return pieces


def _box_pieces(boxes: list[Box], frame: Array) -> list[tuple[Array, float]]:
    if not boxes:
        return []
    center = seen_from(np.array([box.center for box in boxes]), frame)
    half = 0.5 * np.array([box.size for box in boxes])
    heading = np.array([box.heading for box in boxes]) - frame[2]
    c, s = np.cos(heading), np.sin(heading)
    along, aside = half[:, :1] * np.array([c, s]).T, half[:, 1:] * np.array([-s, c]).T
    rings = np.array([-along - aside, along - aside, along + aside, aside - along]).swapaxes(0, 1)
    return [(ring, 0.0) for ring in np.round(rings + center[:, None], DIGITS)]


def solids_of(pieces: Iterable[tuple[Array, float]]) -> Solids:
    """Arrays of pieces for the kernels."""
    every = list(pieces)
    rings, rounding = [ring for ring, _ in every], [by for _, by in every]
    counts = np.array([len(ring) for ring in rings], dtype=np.int64)
    first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    corners = np.concatenate([np.zeros((0, 2)), *rings])
    radius = np.array(rounding, dtype=np.float64)
    if not rings:
        return Solids(np.zeros((0, 5)), first, np.zeros((0, 5)))
    before = np.arange(len(corners)) - 1
    before[first[:-1]] = first[1:] - 1
    edge = corners - corners[before]
    length = np.hypot(edge[:, 0], edge[:, 1])
    single = np.repeat(counts == 1, counts)
    if not (length[~single] > 0.0).all():  # corners that rounding has made one
        return solids_of(_without_repeats(ring, by) for ring, by in zip(rings, radius, strict=True))
    normal = edge[:, ::-1] * (1.0, -1.0) / np.where(single, 1.0, length)[:, None]
    low = np.minimum.reduceat(corners, first[:-1]) - radius[:, None]
    high = np.maximum.reduceat(corners, first[:-1]) + radius[:, None]
    offset = np.einsum("ij,ij->i", normal, corners)
    for k in ((length < TINY_EDGE) & ~single).nonzero()[0]:  # its normal is rounded, like its ends
        piece = int(np.searchsorted(first, k, side="right")) - 1
        offset[k] = (corners[first[piece] : first[piece + 1]] @ normal[k]).max()
    return Solids(
        edges=np.concatenate([corners, normal, offset[:, None]], axis=1),
        first=first,
        plates=np.concatenate([low, high, radius[:, None]], axis=1),
    )


def _without_repeats(ring: Array, rounding: float) -> tuple[Array, float]:
    kept = ring[(ring != _next(ring)).any(axis=1)]
    return (kept if len(kept) else ring[:1]), float(rounding)


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

"""Shapes as their outlines, in the audit's own reading of them."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.audit.arrays import BLOCK, BodyOutline, EdgeBoxes, Outline, Points
from maneuver_automaton.audit.frames import placed
from maneuver_automaton.collision.motion import Knots, Motion
from maneuver_automaton.collision.shapes import (
    AnyObstacle,
    OccupancyMap,
    Shape,
    box_corners,
    by_kind,
)

LOST = 1e-9  # share of an area, that a union may lose


@functools.lru_cache(maxsize=32)
def body_outline(shapes: tuple[Shape, ...]) -> BodyOutline:
    """The outline of a body; those of the last bodies are kept."""
    point = np.zeros(1, dtype=np.complex128)
    edges = Outline(point, point, np.zeros(1), np.zeros(1, dtype=np.int64))
    if shapes:
        edges = _outlined(shapes, np.zeros((len(shapes), 2)))[0]
    corners, reach = edges.begins, np.abs(edges.begins)
    x, y = corners.real, corners.imag
    middle = complex(0.5 * (x.min() + x.max()), 0.5 * (y.min() + y.max()))
    return BodyOutline(
        edges=edges,
        firsts=corners[edges.firsts],
        reach=reach,
        most_reach=float(reach.max()),
        radius=float(edges.radius.max()),
        middle=middle,
        size=float((np.abs(corners - middle) + edges.radius).max()),
    )


def map_outline(one: OccupancyMap, origin: tuple[float, float]) -> Outline:
    """The borders between blocked cells and free ones, counted from an origin [m].

    Every border has its blocked cell on the left, so they run around what is blocked.
    """
    cells = np.pad(one.blocked, 1).astype(np.int8)
    level = [_borders(np.diff(cells, axis=0)[:, 1:-1].T), _borders(np.diff(cells, axis=1)[1:-1])]
    (x0, x1, y, up), (y0, y1, x, right) = level
    low = np.concatenate([np.stack([x0, y], axis=1), np.stack([x, y0], axis=1)])
    high = np.concatenate([np.stack([x1, y], axis=1), np.stack([x, y1], axis=1)])
    forward = np.concatenate([up > 0, right < 0])[:, None]
    ends = np.stack([np.where(forward, low, high), np.where(forward, high, low)])
    seen = np.concatenate([one.resolution * ends, np.zeros((2, len(low), 1))], axis=-1)
    corners = placed(one.origin - [*origin, 0.0], seen)
    n = len(low)
    begins, ends = points_of(corners)
    return Outline(begins, ends, np.zeros(n), np.zeros(n, dtype=np.int64))


def _borders(changes: Array) -> tuple[Array, Array, Array, Array]:
    """Runs of equal changes along the first axis: from, to, where on the second, and the change."""
    step = np.diff(np.pad(changes, ((1, 1), (0, 0))), axis=0) != 0
    place, at = np.nonzero(step.T)  # along one line after the other
    begin, end = at[:-1], at[1:]
    same = (place[:-1] == place[1:]) & (begin < changes.shape[0])
    begin, end, place = begin[same], end[same], place[:-1][same]
    change = changes[begin, place]
    kept = change != 0
    whole = np.stack([begin, end, place, change])[:, kept].astype(np.float64)
    return whole[0], whole[1], whole[2], whole[3]


def _outlined(solids: tuple[AnyObstacle | Shape, ...], origins: Array) -> tuple[Outline, IntArray]:
    """The outline of solids, counted from origins of their own (n, 2) [m], and whose each edge is.

    A map without a blocked cell has no edge, and is no solid.
    """
    nothing = np.zeros(0, dtype=np.complex128)
    found = [(np.zeros(0, dtype=np.int64), nothing, nothing, np.zeros(0))]
    kinds = by_kind(solids)
    discs, others = kinds.discs, kinds.others
    if kinds.quads.size:
        corners = kinds.corners
        if origins.any():
            corners = corners - origins[kinds.quads, None]
            near = kinds.centers - origins[kinds.boxes]  # centers first, so that no digit is lost
            corners[: len(near)] = box_corners(near, kinds.headings, kinds.sizes)
        points = points_of(corners)
        both = points.ravel(), points[:, [1, 2, 3, 0]].ravel()
        found.append((kinds.quads.repeat(4), *both, np.zeros(points.size)))
    if discs:
        numbers = np.array([k for k, _ in discs])
        points = points_of(np.array([one.center for _, one in discs]) - origins[numbers])
        found.append((numbers, points, points, np.array([one.radius for _, one in discs])))
    if others:
        rings = [(k, [one.corners - origins[k]]) for k, one in others if one.is_plain]
        given = {
            k: (one.corners - origins[k], [hole - origins[k] for hole in one.holes])
            for k, one in others
            if not one.is_plain
        }
        rings += zip(given, _solid_rings([*given.values()]), strict=True)
        numbers = np.array([k for k, _ in rings]).repeat([sum(map(len, some)) for _, some in rings])
        both = _edges([ring for _, some in rings for ring in some])
        found.append((numbers, *both, np.zeros(numbers.size)))
    for k, one in kinds.maps:
        begins, ends, radius, _ = map_outline(one, (float(origins[k, 0]), float(origins[k, 1])))
        found.append((np.full(radius.size, k), begins, ends, radius))
    owner, begins, ends, radius = (np.concatenate(column) for column in zip(*found, strict=True))
    order = owner.argsort(kind="stable")
    owner, another = owner[order], np.zeros(owner.size, dtype=np.int64)
    another[1:] = owner[1:] != owner[:-1]
    return Outline(begins[order], ends[order], radius[order], another.cumsum()), owner


def _edges(rings: Sequence[Array]) -> tuple[Points, Points]:
    """Where the edges of rings begin and end."""
    lasts = np.array([len(ring) for ring in rings]).cumsum() - 1
    following = np.arange(1, lasts[-1] + 2)
    following[lasts] = [0, *(lasts[:-1] + 1).tolist()]
    begins = points_of(np.concatenate(rings))
    return begins, begins[following]


def _solid_rings(polygons: Sequence[tuple[Array, Sequence[Array]]]) -> Iterator[list[Array]]:
    """Rings of polygons, corners and holes, the holes the other way around than what they are in.

    Rings that cross or touch themselves are cut into faces; those that they run around are solid.
    """
    import shapely

    if not polygons:
        return
    corners = [ring for ring, _ in polygons]
    numbers = np.repeat(np.arange(len(corners)), [len(ring) for ring in corners])
    rings = shapely.linearrings(np.concatenate(corners), indices=numbers)
    every = shapely.polygons(rings)
    plain = shapely.is_valid(every) & (shapely.area(every) > 0.0)
    for (ring, holes), one in zip(polygons, plain.tolist(), strict=True):
        yield [ring] if one and not holes else _cut_rings(ring, holes)


def _cut_rings(corners: Array, holes: Sequence[Array]) -> list[Array]:
    """Rings of one polygon that has holes, or whose ring crosses or touches itself."""
    import shapely

    whole = shapely.Polygon(corners, holes)
    if not whole.is_valid:
        whole = _faces(corners)
        for hole in holes:
            whole = shapely.difference(whole, _faces(hole))
    parts = [
        part for part in shapely.get_parts(whole) if part.geom_type == "Polygon" and part.area > 0.0
    ]
    if not parts:
        raise ValueError(f"polygon: got {len(corners)} corners around no area")
    return [
        np.asarray(shapely.get_coordinates(ring)[:-1])
        for part in map(shapely.geometry.polygon.orient, parts)
        for ring in (part.exterior, *part.interiors)
    ]


def _faces(ring: Array) -> Any:
    """The faces of the plane that a closed line runs around, as one geometry."""
    import shapely

    lines = shapely.get_parts(shapely.node(shapely.LineString(np.vstack([ring, ring[:1]]))))
    faces = shapely.get_parts(shapely.polygonize(lines))
    inner = [[face.representative_point().x, face.representative_point().y] for face in faces]
    n = len(ring)
    own = Outline(*_edges([ring]), np.zeros(n), np.zeros(n, dtype=np.int64))
    around = own.holds(points_of(np.array(inner).reshape(-1, 2)))[0]
    whole = shapely.union_all(faces[around])
    area = float(shapely.area(faces[around]).sum())
    if abs(whole.area - area) > LOST * area:  # uniting all at once has lost a face
        return functools.reduce(shapely.union, faces[around])
    return whole


LEAST = 1e-300  # a squared length that is none


def points_of(places: Array) -> Points:
    """Places (..., 2 or more) [m] as points (...,)."""
    points = np.empty(places.shape[:-1], dtype=np.complex128)
    points.real, points.imag = places[..., 0], places[..., 1]
    return points


def directions(angles: Array) -> Points:
    """Unit vectors at angles [rad]: what turns by these when multiplied."""
    units = np.empty(np.shape(angles), dtype=np.complex128)
    np.cos(angles, out=units.real)
    np.sin(angles, out=units.imag)
    return units


def squared(vectors: Points) -> Array:
    """Squared lengths of vectors."""
    return np.asarray((vectors * vectors.conj()).real)


def point_apart(points: Any, a: Any, b: Any) -> Array:
    """Squared distances of points to segments from a to b."""
    along, to = b - a, points - a
    back = along.conj()
    share = (to * back).real / np.maximum((along * back).real, LEAST)
    np.maximum(share, 0.0, out=share)
    np.minimum(share, 1.0, out=share)
    return squared(to - share * along)


def crossed(p: Any, q: Any, a: Any, b: Any) -> NDArray[np.bool_]:
    """Whether segments from p to q and from a to b cross."""
    first = _side(p, q, a) * _side(p, q, b)
    second = _side(a, b, p) * _side(a, b, q)
    return np.asarray((first < 0.0) & (second < 0.0))


def _side(a: Any, b: Any, point: Any) -> Array:
    return np.asarray(((b - a).conjugate() * (point - a)).imag)


class MovingEdges(NamedTuple):
    """The edges of obstacles that move, and how: one row for each motion."""

    motions: tuple[Motion, ...]
    knots: Knots  # of all motions, side by side
    present: Array  # (motions, 2) [s] from when until when a moving obstacle is there
    fastest: Array  # (motions,) [m/s] of the frame at most
    speeds: Array  # (motions,) the same where it coasts on arcs; else 0
    bends: Array  # (motions,) [m/s^2] how fast its velocity changes then; else 0
    edges: IntArray  # numbers of their edges, motion by motion
    firsts: IntArray  # (motions + 1,) where those of each motion begin among them
    groups: tuple[Outline, ...]  # (motions,) the edges of each motion
    reaches: Array  # (motions,) [m] how far they are from their frames at most


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Surroundings:
    """The edges of all obstacles; those that move are seen from their own frames.

    Examples
    --------
    >>> from maneuver_automaton.collision import Box, Obstacle
    >>> crate = Obstacle(Box([1.0, 1.0], center=[3.0, 0.0]))
    >>> surroundings_of((crate,), (1.0, 0.0)).outline.begins.real.tolist()
    [1.5, 2.5, 2.5, 1.5]
    """

    outline: Outline
    owners: IntArray  # (n,) which obstacle each edge is of
    heights: Array  # (n, 2) [m] from where to where they stand
    motion_of_edge: IntArray  # (n,) which motion an edge has; -1 if it is static
    movers: MovingEdges
    still: IntArray  # (k,) numbers of the static edges
    index: EdgeBoxes  # of these; where one of what may be flown over is near, all of its edges are
    rounds: bool  # whether any edge has a radius


def surroundings_around(
    obstacles: tuple[AnyObstacle, ...], origin: tuple[float, float]
) -> Surroundings:
    """Obstacles counted from an origin [m].

    Raises
    ------
    ValueError
        If a polygon has no area.
    """
    moving = [k for k, one in enumerate(obstacles) if getattr(one, "motion", None) is not None]
    each = [getattr(one, "height", None) or (-math.inf, math.inf) for one in obstacles]
    heights = np.array(each, dtype=np.float64).reshape(-1, 2)
    number = np.full(len(obstacles), -1)
    number[moving] = np.arange(len(moving))
    whole, owners = _outlined(obstacles, np.where(number[:, None] < 0, origin, 0.0))
    index, heights_of = number[owners], heights.take(owners, axis=0)
    still, movers = (index < 0).nonzero()[0], [obstacles[k] for k in moving]
    return Surroundings(
        outline=whole,
        owners=owners,
        heights=heights_of,
        motion_of_edge=index,
        movers=_moving_edges(movers, origin, whole, index) if movers else NO_MOVERS,
        still=still,
        index=_boxed(whole, still, heights_of),
        rounds=bool(whole.radius.any()),
    )


def _moving_edges(
    movers: list[Any], origin: tuple[float, float], whole: Outline, index: IntArray
) -> MovingEdges:
    """Those of obstacles in an outline; `index`: which of these each edge is of, -1 of none."""
    motions = [Motion(m.time, m.pose - [*origin, 0.0], m.twist) for m in (o.motion for o in movers)]
    knots, edges = Knots.of(motions), (index >= 0).nonzero()[0]
    fastest = np.array([float(one.speeds.max(initial=0.0)) for one in motions])
    groups = tuple(whole.of(index == k) for k in range(len(motions)))
    return MovingEdges(
        motions=tuple(motions),
        knots=knots,
        present=np.array([one.presence for one in movers], dtype=np.float64).reshape(-1, 2),
        fastest=fastest,
        speeds=np.where(knots.arcs, fastest, 0.0),
        bends=np.array([float(one.bends.max(initial=0.0)) for one in motions]),
        edges=edges,
        firsts=index[edges].searchsorted(np.arange(len(motions) + 1)),
        groups=groups,
        reaches=np.array([float((np.abs(one.begins) + one.radius).max()) for one in groups]),
    )


NO_MOVERS = _moving_edges([], (0.0, 0.0), *_outlined((), np.zeros((0, 2))))
surroundings_of = functools.lru_cache(maxsize=8)(surroundings_around)  # those of the last maps


def _boxed(outline: Outline, still: IntArray, heights: Array) -> EdgeBoxes:
    """Boxes around still edges; around whole solids where these have a height."""
    ends = (one[still].view(np.float64).reshape(-1, 2) for one in (outline.begins, outline.ends))
    a, b, radius = *ends, outline.radius[still, None]
    low, high = np.minimum(a, b) - radius, np.maximum(a, b) + radius
    whole = np.isfinite(heights[still, :1])
    if whole.any():
        solid, solids = outline.solid[still], int(outline.solid.max()) + 1
        least, most = np.full((solids, 2), math.inf), np.full((solids, 2), -math.inf)
        np.minimum.at(least, solid, low)
        np.maximum.at(most, solid, high)
        low, high = np.where(whole, least[solid], low), np.where(whole, most[solid], high)
    # In columns of as many edges, and upwards within each.
    x, y = (low + high).T
    n, ranks = still.size, np.empty(still.size, dtype=np.int64)
    ranks[x.argsort()] = np.arange(n)
    order = np.lexsort((y, ranks * math.ceil(math.sqrt(n / BLOCK)) // max(n, 1)))
    low, high, firsts = low[order], high[order], np.arange(0, n, BLOCK)
    blocks = np.minimum.reduceat(low, firsts), np.maximum.reduceat(high, firsts)
    return EdgeBoxes(
        still[order], np.concatenate([low, high], axis=1), np.concatenate(blocks, axis=1)
    )

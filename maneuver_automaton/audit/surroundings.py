"""Obstacles as the audit sees them, prepared once for any number of plans."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.audit.outlines import Outline, joined, map_outline, outline_of
from maneuver_automaton.collision.motion import Knots, Motion
from maneuver_automaton.collision.shapes import (
    AnyObstacle,
    OccupancyMap,
)

GRID = 65536.0  # [m] between the places from where obstacles are counted


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
    motions: tuple[Motion, ...]
    knots: Knots  # of all motions, side by side
    present: Array  # (motions, 2) [s] from when until when a moving obstacle is there
    fastest: Array  # (motions,) [m/s] of the frame at most
    speeds: Array  # (motions,) the same where it coasts on arcs; else 0
    bends: Array  # (motions,) [m/s^2] how fast its velocity changes then; else 0
    still: IntArray  # (k,) numbers of the static edges
    moving: IntArray  # those of the others, motion by motion
    firsts: IntArray  # (motions + 1,) where those of each motion begin among them
    groups: tuple[Outline, ...]  # (motions,) the edges of each motion
    reaches: Array  # (motions,) [m] how far they are from their frames at most
    tree: Any  # STRtree of these
    right: float  # [m] no edge is further to the right
    rounds: bool  # whether any edge has a radius

    def near(self, boxes: Array) -> tuple[IntArray, IntArray]:
        """Which boxes (m, 4) [low x, low y, high x, high y] may meet which still edges.

        Of what has a height, and so may be flown over, all edges if one of them does.
        """
        import shapely

        which, edges = self.tree.query(shapely.box(*boxes.T))
        return which, self.still[edges]


def origin_of(place: ArrayLike) -> tuple[float, float]:
    """From where to count so that coordinates near `place` (2 or more) lose no digit.

    Examples
    --------
    >>> origin_of([3.0, -4.0]), origin_of([1e9 + 5.0, 0.0])
    ((0.0, 0.0), (1000013824.0, 0.0))
    """
    x, y = GRID * np.round(np.asarray(place, dtype=np.float64)[:2] / GRID) + 0.0
    return float(x), float(y)


@functools.lru_cache(maxsize=8)
def surroundings_of(
    obstacles: tuple[AnyObstacle, ...], origin: tuple[float, float]
) -> Surroundings:
    """As `surroundings_around`; those of the last maps are kept."""
    return surroundings_around(obstacles, origin)


def surroundings_around(
    obstacles: tuple[AnyObstacle, ...], origin: tuple[float, float]
) -> Surroundings:
    """Obstacles counted from an origin [m].

    Raises
    ------
    ValueError
        If a polygon has no area.
    """
    import shapely

    outlines, heights, indices = [], [], []
    motions: list[Motion] = []
    present: list[tuple[float, float]] = []
    for one in obstacles:
        if isinstance(one, OccupancyMap):
            outline, height, motion, there = map_outline(one, origin), None, None, None
        else:
            height, motion, there = one.height, one.motion, one.presence
            outline = outline_of((one.shape,), origin if motion is None else (0.0, 0.0))
        if motion is not None and there is not None:
            motions.append(Motion(motion.time, motion.pose - [*origin, 0.0], motion.twist))
            present.append(there)
        outlines.append(outline)
        heights.append(height or (-math.inf, math.inf))
        indices.append(-1 if motion is None else len(motions) - 1)
    counts = [outline.radius.size for outline in outlines]
    whole = joined(outlines)
    index = np.repeat(np.array(indices, dtype=np.int64), counts)
    still = np.flatnonzero(index < 0)
    heights_of = np.repeat(np.array(heights).reshape(-1, 2), counts, axis=0)
    moving = np.flatnonzero(index >= 0)
    firsts = np.searchsorted(index[moving], np.arange(len(motions) + 1))
    knots = Knots.of(motions)
    fastest = np.array([float(one.speeds.max(initial=0.0)) for one in motions])
    groups = tuple(whole.of(index == number) for number in range(len(motions)))
    return Surroundings(
        outline=whole,
        owners=np.repeat(np.arange(len(counts)), counts),
        heights=heights_of,
        motion_of_edge=index,
        motions=tuple(motions),
        knots=knots,
        present=np.array(present, dtype=np.float64).reshape(-1, 2),
        fastest=fastest,
        speeds=np.where(knots.arcs, fastest, 0.0),
        bends=np.array([float(one.bends.max(initial=0.0)) for one in motions]),
        still=still,
        moving=moving,
        firsts=firsts,
        groups=groups,
        reaches=np.array([_reach(group) for group in groups]),
        tree=shapely.STRtree(_geometries(whole, still, heights_of)),
        rounds=bool(whole.radius.any()),
        right=float((whole.begins.real + whole.radius).max(initial=0.0)),
    )


def _reach(outline: Outline) -> float:
    """How far [m] an outline is from the frame that it is seen from at most."""
    return float((np.abs(outline.begins) + outline.radius).max())


def _geometries(outline: Outline, still: IntArray, heights: Array) -> Any:
    """What the tree holds: edges, boxes around discs, and around solids that have a height."""
    import shapely

    both = np.stack([outline.begins[still], outline.ends[still]], axis=1)
    ends, radius = both.view(np.float64).reshape(-1, 2, 2), outline.radius[still, None]
    edges = shapely.linestrings(ends)
    low, high = ends.min(axis=1) - radius, ends.max(axis=1) + radius
    solids = int(outline.solid.max(initial=-1)) + 1
    least, most = np.full((solids, 2), math.inf), np.full((solids, 2), -math.inf)
    np.minimum.at(least, outline.solid[still], low)
    np.maximum.at(most, outline.solid[still], high)
    whole = np.isfinite(heights[still, :1])
    low = np.where(whole, least[outline.solid[still]], low)
    high = np.where(whole, most[outline.solid[still]], high)
    boxed = np.flatnonzero(whole | (radius > 0.0))
    edges[boxed] = shapely.box(*low[boxed].T, *high[boxed].T)
    return edges

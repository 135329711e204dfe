"""Land beside the road, as static obstacles."""

from __future__ import annotations

from typing import Any

import numpy as np

from maneuver_automaton.collision import Obstacle, Polygon

TILE = 20.0  # [m] pieces are cut to this size: a search tree, or a bucket, then leaves most out
SLIVER = 1e-6  # [m^2] smaller pieces are what rounding left between lanelets


def obstacles_in(land: Any) -> tuple[Obstacle, ...]:
    """A shapely area as static obstacles, cut into tiles.

    Examples
    --------
    >>> import shapely
    >>> len(obstacles_in(shapely.box(0.0, 0.0, 50.0, 10.0)))
    3
    """
    import shapely

    if land.is_empty:
        return ()
    low_x, low_y, high_x, high_y = land.bounds
    x, y = np.meshgrid(np.arange(low_x, high_x, TILE), np.arange(low_y, high_y, TILE))
    tiles = shapely.box(x.ravel(), y.ravel(), x.ravel() + TILE, y.ravel() + TILE)
    shapely.prepare(land)
    pieces = shapely.get_parts(shapely.intersection(land, tiles[shapely.intersects(land, tiles)]))
    return tuple(
        Obstacle(
            Polygon(
                shapely.get_coordinates(piece.exterior)[:-1],
                [shapely.get_coordinates(hole)[:-1] for hole in piece.interiors],
            )
        )
        for piece in pieces
        if piece.geom_type == "Polygon" and piece.area > SLIVER
    )

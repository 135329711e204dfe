"""Bodies: their outlines along a motion, and the area that they sweep."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.collision import Disc, Polygon, Shape
from maneuver_automaton.collision.convex import convex_pieces
from maneuver_automaton.groups import SE2
from maneuver_automaton.plotting.track import Track, TrackPiece

DISC_CORNERS = 48


def footprint_polygons(shapes: Sequence[Shape]) -> list[Array]:
    """Outlines (n, 2) of shapes in their own frame [m]."""
    angle = np.linspace(0.0, 2.0 * np.pi, DISC_CORNERS, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return [
        one.radius * circle + one.center if isinstance(one, Disc) else one.corners for one in shapes
    ]


def placed(outlines: Sequence[Array], poses: Array) -> list[Array]:
    """Outlines (n, 2) at `poses` (m, dof) in the plane: m times len(outlines) arrays (n, 2)."""
    frames = SE2(poses[:, None, :3])
    return [corners for outline in outlines for corners in frames.act(outline)]


STRAIGHT_RAD, DETOUR = 1e-9, 1e-12  # turn, and way over chord, of a piece drawn by its two ends


def swept_region(track: Track, outlines: Sequence[Array]) -> list[Any]:
    """Shapely polygons that a body of `outlines` (n, 2) covers along a `track`.

    Between two samples, which are a few hundredths of a radian apart, each convex piece of the
    body is taken to fill the hull of its two places: on a circle of radius r that is off by
    ``r * angle**2 / 8``, a millimetre for a car.
    """
    import shapely

    pieces = [corners for outline in outlines for corners, _ in convex_pieces(Polygon(outline))]
    parts: list[Any] = []
    for corners in pieces:
        at = [track.start[None], *(_samples(piece) for piece in track.pieces)]
        for poses in at:
            places = np.array(placed([corners], poses))
            pairs = np.concatenate([places[:-1], places[1:]], axis=1) if len(places) > 1 else places
            parts += shapely.convex_hull(shapely.multipoints(pairs)).tolist()
    return merged(parts)


def merged(parts: Sequence[Any]) -> list[Any]:
    """Shapely polygons that cover what the `parts` cover, each place once."""
    import shapely

    whole = shapely.union_all(np.array(parts))
    return [part for part in shapely.get_parts(whole).tolist() if part.geom_type == "Polygon"]


def _samples(piece: TrackPiece) -> Array:
    """Poses (n, dof) of a piece, no more than it takes."""
    pose = piece.pose
    chord = pose[-1, :2] - pose[0, :2]
    steps = np.diff(pose[:, :2], axis=0)
    length = float(np.linalg.norm(chord))
    detour = float(np.linalg.norm(steps, axis=1).sum()) - length
    straight = np.ptp(pose[:, 2]) <= STRAIGHT_RAD and detour <= DETOUR * (1.0 + length)
    return pose[[0, -1]] if straight else pose

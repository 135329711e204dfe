"""Area that a body sweeps along a track, as one region of the plane."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.collision import Polygon
from maneuver_automaton.collision.convex import convex_pieces
from maneuver_automaton.plotting.footprint import placed
from maneuver_automaton.plotting.track import Track, TrackPiece

STRAIGHT_RAD, DETOUR = 1e-9, 1e-12  # turn, and way over chord, of a piece drawn by its two ends


def swept_region(track: Track, outlines: Sequence[Array]) -> list[Any]:
    """Shapely polygons that a body of `outlines` (n, 2) covers along a `track`.

    Between two samples, which are a few hundredths of a radian apart, each convex piece of the
    body is taken to fill the hull of its two places: on a circle of radius r that is off by
    ``r * angle**2 / 8``, a millimetre for a car.

    Examples
    --------
    >>> from maneuver_automaton.automaton import Plan
    >>> from maneuver_automaton.plotting.track import track_of_plan
    >>> from maneuver_automaton.primitives import Trim
    >>> ahead = Trim(name="ahead", body_velocity=[1.0, 0.0, 0.0], control=[1.0])
    >>> track = track_of_plan(Plan([0.0, 0.0, 0.0], (ahead,), durations=[3.0]))
    >>> [part.area for part in swept_region(track, [np.array([[0, 0], [1, 0], [1, 2], [0, 2]])])]
    [8.0]
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
    """Poses (n, dof) of a piece, no more than it takes.

    That it turns by nothing in all is not enough: a lane change goes left and right again.
    """
    pose = piece.pose
    chord = pose[-1, :2] - pose[0, :2]
    steps = np.diff(pose[:, :2], axis=0)
    length = float(np.linalg.norm(chord))
    detour = float(np.linalg.norm(steps, axis=1).sum()) - length
    straight = np.ptp(pose[:, 2]) <= STRAIGHT_RAD and detour <= DETOUR * (1.0 + length)
    return pose[[0, -1]] if straight else pose

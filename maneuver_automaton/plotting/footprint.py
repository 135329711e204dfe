"""Bodies: their outlines along a motion, and the area that they sweep."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.collision import Box, Disc, Polygon
from maneuver_automaton.collision.convex import convex_pieces
from maneuver_automaton.groups import SE2
from maneuver_automaton.plotting.track import Track, TrackPiece

DISC_CORNERS = 48


def footprint_polygons(footprint: Any) -> list[Array]:
    """Outlines of a footprint in the body frame; none if `footprint` is None."""
    if footprint is None:
        return []
    if isinstance(footprint, Polygon | Box):
        return [footprint.corners]
    if isinstance(footprint, Disc):
        return [_circle(footprint.radius) + footprint.center]
    if isinstance(footprint, Mapping):
        return [_of_mapping(footprint)]
    if _is_polygon(footprint):
        return [_polygon(footprint)]
    if isinstance(footprint, Sequence) and not isinstance(footprint, str):
        return [outline for part in footprint for outline in footprint_polygons(part)]
    raise ValueError(f"footprint: got {footprint!r}, need a shape, corners, a mapping, or several")


def placed(outlines: Sequence[Array], poses: Array) -> list[Array]:
    """Outlines (n, 2) at `poses` (m, dof) in the plane: m times len(outlines) arrays (n, 2)."""
    frames = SE2(poses[:, None, :3])
    return [corners for outline in outlines for corners in frames.act(outline)]


def _is_polygon(footprint: Any) -> bool:
    if isinstance(footprint, np.ndarray):
        return not footprint.dtype.hasobject
    return bool(
        isinstance(footprint, Sequence)
        and len(footprint)
        and all(
            isinstance(corner, Sequence | np.ndarray)
            and len(corner) == 2
            and all(np.isscalar(number) for number in corner)
            for corner in footprint
        )
    )


def _polygon(corners: Any) -> Array:
    outline = as_array("footprint: polygon", corners)
    if outline.ndim != 2 or outline.shape[1] != 2 or len(outline) < 3:
        raise ValueError(f"footprint: polygon has shape {outline.shape}, need (n, 2) with n >= 3")
    return outline


def _of_mapping(footprint: Mapping[str, Any]) -> Array:
    if "polygon_m" in footprint:
        return _polygon(footprint["polygon_m"])
    if "disc_m" in footprint:
        radius = as_array("footprint: disc_m", footprint["disc_m"])
        if radius.ndim or not radius > 0.0:
            raise ValueError(f"footprint: disc_m must be a positive radius, got {radius} m")
        return _circle(float(radius))
    if "rectangle_m" in footprint:
        size = as_array("footprint: rectangle_m", footprint["rectangle_m"], last=2)
        if not (size > 0.0).all():
            raise ValueError(f"footprint: rectangle_m must be positive, got {size.tolist()} m")
        reference = as_array(
            "footprint: reference_m", footprint.get("reference_m", (0.0, 0.0)), last=2
        )
        signs = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
        return 0.5 * signs * size - reference
    raise ValueError(
        f"footprint: got the keys {', '.join(map(repr, footprint))}, "
        "need rectangle_m, polygon_m or disc_m"
    )


def _circle(radius: float) -> Array:
    angle = np.linspace(0.0, 2.0 * np.pi, DISC_CORNERS, endpoint=False)
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


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

"""Outlines of a vehicle's body, from any of the forms a user may state them in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.collision import Box, Disc, Polygon
from maneuver_automaton.groups import SE2

DISC_CORNERS = 48


def footprint_polygons(footprint: Any) -> list[Array]:
    """Outlines of a footprint in the body frame; none if `footprint` is None.

    Parameters
    ----------
    footprint : None, shape, (n, 2) array, mapping, or a sequence of these
        A `Polygon`, `Disc` or `Box`; corners [m]; or a mapping of a scenario file:
        ``{"polygon_m": corners}``, ``{"disc_m": radius}``,
        ``{"rectangle_m": [length, width], "reference_m": [x, y]}``.
        `reference_m` says where the pose sits, measured from the centre of the rectangle: the
        body spans ``[-length / 2 - x, length / 2 - x]`` ahead; (0, 0) if left out.

    Returns
    -------
    list of (n, 2) array
        Corners of every outline [m], x ahead and y to the left, the first not repeated.

    Raises
    ------
    ValueError
        If it is none of these, a polygon has fewer than three corners, or a size is not positive.

    Examples
    --------
    >>> footprint_polygons({"rectangle_m": [4.0, 2.0], "reference_m": [-1.0, 0.0]})[0].tolist()
    [[-1.0, -1.0], [3.0, -1.0], [3.0, 1.0], [-1.0, 1.0]]
    """
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

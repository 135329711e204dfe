"""Polygons from files: rings that enclose something and cross nothing."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.collision import Polygon
from maneuver_automaton.formats.text_source import FARTHEST

FLAT = 1e-14  # width of a ring over its length, below which it is a line
_PLACE = re.compile(r"(.*)\[(\S+) (\S+)\]")


def simple_polygon(corners: ArrayLike, holes: Sequence[ArrayLike] = ()) -> Polygon:
    """A polygon of rings as a file lists them.

    A corner that is listed twice in a row, or again at the end, counts once.
    """
    rings = [_ring(corners, "the ring"), *(_ring(hole, "a hole") for hole in holes)]
    import shapely

    polygon = shapely.Polygon(rings[0], rings[1:])
    if not polygon.is_valid:
        raise ValueError(_words(shapely.is_valid_reason(polygon)))
    return Polygon(rings[0], tuple(rings[1:]))


def _ring(corners: ArrayLike, what: str) -> Array:
    ring = as_array(what, corners, last=2)
    ring = np.asarray(ring[(ring != np.roll(ring, -1, axis=0)).any(axis=1)])
    if len(ring) < 3:
        raise ValueError(f"{what} has {len(ring)} different corners, need at least 3")
    if np.abs(ring).max() > FARTHEST:
        raise ValueError(f"{what} has a corner beyond {FARTHEST:g} m, need one that is nearer")
    sides = ring[1:] - ring[0]
    if np.linalg.svd(sides / np.abs(sides).max(), compute_uv=False)[1] < FLAT:
        raise ValueError(f"{what} encloses no area, need corners that are not on one line")
    return ring


def _words(reason: str) -> str:
    """What Shapely says of a polygon, in words that say what would be right."""
    match = _PLACE.fullmatch(reason)
    kind = match.group(1) if match else reason
    at = f" at ({float(match.group(2)):.6g}, {float(match.group(3)):.6g})" if match else ""
    if "Self-intersection" in kind:
        return f"the ring crosses or touches itself{at}, need a simple polygon"
    if "Hole lies outside" in kind:
        return f"a hole lies outside the polygon{at}, need holes inside it"
    if "nested" in kind:
        return f"a hole lies inside another one{at}, need holes apart from each other"
    return f"is no simple polygon: {kind.lower()}{at}"

"""Rings of polygons from what a user has: shapely geometry, or lists of points."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array


class Geometry(Protocol):
    """Geometry of shapely."""

    @property
    def geom_type(self) -> str:
        """Polygon, MultiPolygon, ..."""
        ...


class Rings(NamedTuple):
    """Corners (n, 2) of an outer ring and of its holes [m]."""

    corners: Any  # an array, or the points as the user gave them
    holes: Sequence[Array] = ()


def is_geometry(value: Any) -> bool:
    """Whether it is geometry of shapely, which need not be imported to know."""
    return hasattr(value, "geom_type")


def rings_of_geometry(what: str, geometry: Any) -> Iterator[Rings]:
    """The outer ring and the holes of each polygon of a shapely geometry, corner for corner.

    Heights (z) of its points are left out.
    """
    import shapely

    kind = geometry.geom_type
    if shapely.is_empty(geometry):
        raise ValueError(f"{what}: got an empty {kind} of shapely, need one with an area")
    if not shapely.is_valid(geometry):
        raise ValueError(
            f"{what}: got an invalid {kind} of shapely ({shapely.is_valid_reason(geometry)}), need "
            "a valid one, such as shapely.make_valid gives"
        )
    for part in shapely.get_parts(geometry):
        if part.geom_type in ("MultiPolygon", "GeometryCollection"):
            yield from rings_of_geometry(what, part)
        elif part.geom_type == "Polygon":
            rings = [shapely.get_coordinates(r)[:-1] for r in (part.exterior, *part.interiors)]
            yield Rings(rings[0], rings[1:])
        else:
            raise ValueError(
                f"{what}: got a {part.geom_type} of shapely, which has no area; need a Polygon, "
                "such as geometry.buffer(radius) gives"
            )


def one_ring(what: str, geometry: Any) -> Rings:
    """The rings of a geometry that is one polygon."""
    first, *others = rings_of_geometry(what, geometry)
    if others:
        raise ValueError(
            f"{what}: got a {geometry.geom_type} of {1 + len(others)} polygons, need one; give "
            "each of geometry.geoms by itself"
        )
    return first


def are_points(value: Any) -> bool:
    """Whether an array, or a sequence, is a list of points and not one of shapes."""
    if isinstance(value, np.ndarray):
        return value.ndim < 3 and _holds_numbers(value)
    return len(value) > 0 and all(_is_point(one) for one in value)


def _is_point(value: Any) -> bool:
    """Whether it is a number, or a row of numbers."""
    if isinstance(value, np.ndarray):
        return value.ndim < 2 and _holds_numbers(value)
    if isinstance(value, Sequence) and not isinstance(value, str):
        return len(value) > 0 and all(map(_is_number, value))
    return _is_number(value)


def _holds_numbers(array: NDArray[Any]) -> bool:
    return array.dtype != np.object_ or (array.size > 0 and all(map(_is_number, array.flat)))


def _is_number(value: Any) -> bool:
    if isinstance(value, np.ndarray):
        return not value.ndim and _holds_numbers(value)
    return bool(np.isscalar(value)) and not isinstance(value, str)

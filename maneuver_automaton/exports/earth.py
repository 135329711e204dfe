"""Places on the Earth of places in a plane, and back: longitude and latitude about an origin."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array

SEMI_MAJOR_M, SEMI_MINOR_M = 6378137.0, 6356752.314245179  # of the ellipsoid of WGS 84
HALF_AXES = np.array([SEMI_MAJOR_M, SEMI_MAJOR_M, SEMI_MINOR_M])
MOST_LATITUDE = 89.0  # [deg] of an origin: at a pole nothing is east
MOST_M = 100e3  # [m] from the origin


def degrees_of(places: ArrayLike, *, origin: ArrayLike) -> Array:
    """Longitude and latitude [deg] of places (..., 2) [m] east and north of an origin, on WGS 84.

    The plane touches the ellipsoid at the origin, and every place lies straight below its point of
    the plane. Distances d from the origin are longer on the ground, by a share of d^2 / 6 R^2:
    0.004 mm at 1 km, 4 mm at 10 km.

    Source: Snyder (1987), *Map Projections: a Working Manual*, orthographic projection; here that
    of the ellipsoid, which is cut with the line through the point.

    Parameters
    ----------
    places : (..., 2) array
    origin : (float, float)
        Latitude and longitude [deg].

    Raises
    ------
    ValueError
        If the origin is no place of the Earth or beside a pole, or a place more than 100 km away.
    """
    longitude, foot, axes = _plane_at(origin)
    flat = as_array("places", places, last=2)
    _check_near(flat)
    # in units of the half axes the ellipsoid is a sphere of radius 1, on which the foot is
    beside, up = flat @ (axes[:2] / HALF_AXES), axes[2] / HALF_AXES
    outside = (beside * beside).sum(axis=-1)  # |foot + beside|^2 - 1, as they are perpendicular
    along, steep = (foot / HALF_AXES + beside) @ up, up @ up
    below = outside / (along + np.sqrt(along * along - steep * outside))
    x, y, z = np.moveaxis(foot / HALF_AXES + beside - below[..., None] * up, -1, 0)
    east = np.remainder(longitude + np.arctan2(y, x) + np.pi, 2.0 * np.pi) - np.pi
    north = np.arctan2(z * SEMI_MAJOR_M, np.hypot(x, y) * SEMI_MINOR_M)
    degrees: Array = np.degrees(np.stack([east, north], axis=-1))
    return degrees


def metres_of(degrees: ArrayLike, *, origin: ArrayLike) -> Array:
    """Places (..., 2) [m] of longitudes and latitudes (..., 2) [deg]; undoes `degrees_of`."""
    longitude, foot, axes = _plane_at(origin)
    turned, latitude = np.moveaxis(np.radians(as_array("degrees", degrees, last=2)), -1, 0)
    seen: Array = (_on_ellipsoid(turned - longitude, latitude) - foot) @ axes.T
    _check_near(seen)
    return seen[..., :2]


def _check_near(places: Array) -> None:
    farthest = float(np.linalg.norm(places, axis=-1).max(initial=0.0))
    if farthest > MOST_M:
        raise ValueError(
            f"origin: positions are up to {farthest / 1e3:.0f} km from it, need at most "
            f"{MOST_M / 1e3:.0f} km"
        )


def _plane_at(origin: ArrayLike) -> tuple[float, Array, Array]:
    """Longitude [rad], point (3,) [m] and axes (3, 3) east, north, up; longitude 0 is its own."""
    latitude, longitude = as_array("origin", origin, last=2).tolist()
    if not (abs(latitude) <= MOST_LATITUDE and abs(longitude) <= 180.0):
        raise ValueError(
            f"origin: got {latitude:g},{longitude:g}, need a latitude within {MOST_LATITUDE:g} "
            "degrees and a longitude within 180"
        )
    angle = math.radians(latitude)
    sin, cos = math.sin(angle), math.cos(angle)
    axes = np.array([[0.0, 1.0, 0.0], [-sin, 0.0, cos], [cos, 0.0, sin]])
    return math.radians(longitude), _on_ellipsoid(np.zeros(()), np.array(angle)), axes


def _on_ellipsoid(longitude: Array, latitude: Array) -> Array:
    """Points (..., 3) [m] of the ellipsoid, from the middle of the Earth."""
    cos, sin = np.cos(latitude), np.sin(latitude)
    size = np.hypot(SEMI_MAJOR_M * cos, SEMI_MINOR_M * sin)
    flat, high = SEMI_MAJOR_M**2 * cos / size, SEMI_MINOR_M**2 * sin / size
    return np.stack([flat * np.cos(longitude), flat * np.sin(longitude), high], axis=-1)

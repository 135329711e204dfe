"""Distances between segments in the plane, many at once; points are complex numbers x + i y [m]."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array

Points: TypeAlias = NDArray[np.complex128]
"""Points x + i y [m]; those of one call have shapes that broadcast."""

LEAST = 1e-300  # a squared length that is none


def points_of(places: Array) -> Points:
    """Places (..., 2 or more) [m] as points (...,).

    Examples
    --------
    >>> points_of(np.array([[1.0, 2.0], [0.0, -1.0]])).tolist()
    [(1+2j), -1j]
    """
    points = np.empty(places.shape[:-1], dtype=np.complex128)
    points.real, points.imag = places[..., 0], places[..., 1]
    return points


def directions(angles: Array) -> Points:
    """Unit vectors at angles [rad]: what turns by these when multiplied.

    Examples
    --------
    >>> directions(np.array([0.0, np.pi / 2])).round(9).tolist()
    [(1+0j), 1j]
    """
    units = np.empty(np.shape(angles), dtype=np.complex128)
    np.cos(angles, out=units.real)
    np.sin(angles, out=units.imag)
    return units


def squared(vectors: Points) -> Array:
    """Squared lengths of vectors.

    Examples
    --------
    >>> squared(np.array([3.0 + 4.0j])).tolist()
    [25.0]
    """
    return np.asarray((vectors * vectors.conj()).real)


def point_apart(points: Any, a: Any, b: Any) -> Array:
    """Squared distances of points to segments from a to b.

    Examples
    --------
    >>> point_apart(np.array([0.5 + 2.0j]), np.array([0j]), np.array([1.0 + 0j])).tolist()
    [4.0]
    """
    along, to = b - a, points - a
    back = along.conj()
    share = (to * back).real / np.maximum((along * back).real, LEAST)
    np.maximum(share, 0.0, out=share)
    np.minimum(share, 1.0, out=share)
    return squared(to - share * along)


def crossed(p: Any, q: Any, a: Any, b: Any) -> NDArray[np.bool_]:
    """Whether segments from p to q and from a to b cross.

    Examples
    --------
    >>> bool(crossed(0j, 2.0 + 2.0j, 2.0j, 2.0 + 0j))
    True
    """
    first = _side(p, q, a) * _side(p, q, b)
    second = _side(a, b, p) * _side(a, b, q)
    return np.asarray((first < 0.0) & (second < 0.0))


def _side(a: Any, b: Any, point: Any) -> Array:
    return np.asarray(((b - a).conjugate() * (point - a)).imag)

"""The route as kernels see it: stations along it, offsets from it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from maneuver_automaton._compile import bare_inner_kernel

AGAIN = 2.0  # [m] by which a route may be nearer when it passes a place again


class RouteArrays(NamedTuple):
    """The line to follow, as equally spaced points."""

    # Equal spacing makes the number of a point its station: nothing has to be searched for.
    point: np.ndarray  # (n, 2)
    heading: np.ndarray  # (n,)
    direction: np.ndarray  # (n, 2) cosine and sine of it: every node of the search asks for them
    limit: np.ndarray  # (n,) speed limit [m/s]
    spacing: float  # [m]


@bare_inner_kernel
def nearest_point(route: RouteArrays, x: float, y: float, guess: int) -> int:
    """Index of the point of the route that is nearest, downhill from a guess."""
    last = route.point.shape[0] - 1
    k = min(max(guess, 0), last)
    best = (x - route.point[k, 0]) ** 2 + (y - route.point[k, 1]) ** 2
    for step in (1, -1):
        while 0 <= k + step <= last:
            d_x, d_y = x - route.point[k + step, 0], y - route.point[k + step, 1]
            square = d_x * d_x + d_y * d_y
            if square >= best:
                break
            best, k = square, k + step
    return k


@bare_inner_kernel
def nearest_of_all(route: RouteArrays, x: float, y: float) -> int:
    """Index of the point of the route that is nearest.

    Where the route passes a place twice, as at the end of a loop, the first time counts.
    """
    best = math.inf
    for k in range(route.point.shape[0]):
        away = math.hypot(x - route.point[k, 0], y - route.point[k, 1])
        best = min(best, away)
    for k in range(route.point.shape[0]):
        away = math.hypot(x - route.point[k, 0], y - route.point[k, 1])
        if away <= best + AGAIN:
            return nearest_point(route, x, y, k)
    return 0


@bare_inner_kernel
def on_route(route: RouteArrays, x: float, y: float, near: int) -> tuple[float, float]:
    """Station and offset of a place whose nearest point of the route is known."""
    c, s = route.direction[near, 0], route.direction[near, 1]
    d_x, d_y = x - route.point[near, 0], y - route.point[near, 1]
    return route.spacing * near + c * d_x + s * d_y, c * d_y - s * d_x

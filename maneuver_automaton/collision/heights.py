"""Obstacles in space: upright prisms, grouped by the heights between which they stand.

A body is upright too, so two of them touch exactly if they touch in the plane and overlap in
height: their clearance is the hypotenuse of the planar and the vertical one.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.collision.shapes import AnyObstacle, Obstacle


class Layer(NamedTuple):
    """Obstacles that stand between the same heights [m]; infinite ones block every altitude."""

    low: float
    high: float
    obstacles: tuple[AnyObstacle, ...]
    numbers: tuple[int, ...]  # where they are among all obstacles

    def clearance(self, altitude: Array, body: tuple[float, float]) -> Array:
        """Vertical clearance (n,) [m] to a body that reaches from low to high about its altitude.

        Examples
        --------
        >>> Layer(0.0, 10.0, (), ()).clearance(np.array([5.0, 12.0]), (-1.0, 1.0)).tolist()
        [0.0, 1.0]
        """
        above = altitude + body[0] - self.high
        below = self.low - (altitude + body[1])
        return np.maximum(np.maximum(above, below), 0.0)


@functools.lru_cache(maxsize=16)
def layers_of(obstacles: tuple[AnyObstacle, ...], *, in_space: bool) -> tuple[Layer, ...]:
    """Obstacles by height; in the plane all of them are one layer that blocks every altitude.

    Examples
    --------
    >>> from maneuver_automaton.collision import Disc
    >>> tower = Obstacle(Disc(1.0), height=(0.0, 20.0))
    >>> [layer.high for layer in layers_of((tower, Obstacle(Disc(2.0))), in_space=True)]
    [20.0, inf]
    """
    groups: dict[tuple[float, float], list[int]] = {}
    for k, obstacle in enumerate(obstacles):
        height = obstacle.height if in_space and isinstance(obstacle, Obstacle) else None
        groups.setdefault(height or (-np.inf, np.inf), []).append(k)
    return tuple(
        Layer(low, high, tuple(obstacles[k] for k in index), tuple(index))
        for (low, high), index in groups.items()
    )

"""The Protocol `CollisionChecker`: what decides whether a pose or a motion is free."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

GRID = 65536.0  # [m] between the origins of neighbourhoods: far enough to share, near enough to see


class CollisionChecker(Protocol):
    """A body among obstacles, all of them solid and closed: to touch is to collide."""

    def pose_hit(self, pose: ArrayLike, *, time: float = 0.0) -> int | None:
        """Which obstacle the body touches at a pose (3,) and a time [s]; None if it is free."""
        ...

    def motion_hit(
        self,
        start: ArrayLike,
        body_velocity: ArrayLike,
        duration: float,
        *,
        start_time: float = 0.0,
    ) -> int | None:
        """Which obstacle the body touches while it coasts from a pose; None if the path is free.

        Coasting is ``start @ exp(t * body_velocity)`` for t from 0 to `duration` [s]; it begins at
        `start_time` [s] of the world's clock.
        """
        ...

    def clearance(self, poses: ArrayLike, *, times: ArrayLike | None = None) -> float:
        """Least distance [m] to any obstacle at poses (n, 3) and times (n,) [s], 0 if none given.

        Zero on contact, infinite without obstacles.
        """
        ...


def origin_near(place: ArrayLike) -> tuple[float, float]:
    """Where to count from so that coordinates near `place` (2 or more) lose no digit.

    The same for all places of a neighbourhood, so that what is prepared for one serves all.

    Examples
    --------
    >>> origin_near([3.0, -4.0]), origin_near([1e9 + 5.0, 0.0])
    ((0.0, 0.0), (1000013824.0, 0.0))
    """
    x, y = GRID * np.round(np.asarray(place, dtype=np.float64)[:2] / GRID) + 0.0
    return float(x), float(y)

"""Limits of numbers that are planned with: no vehicle is so far away, so large, so fast or slow.

Coordinates may be counted from far away: published parking cases lie 7e9 m from their origin.
Beyond these limits numbers have no digits left for a body's size, fields and swept solids have no
end, and the proof that two bodies do not meet takes steps without number.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import FEW

FARTHEST = 1e10  # [m] of a coordinate or a size, and of any other number of a file
FASTEST = 5e3  # [m/s] of a trim, and of an obstacle that moves
FASTEST_TURN = 1e4  # [rad/s] of an obstacle that moves
FASTEST_SPIN = 1e3  # [rad/s] of a trim, which a plan may hold for long
MOST_HEADING = 1e6  # [rad] of a pose, which has no digits left for a millimetre beyond
MOST_TURNS = 200  # whole turns within a fixed time, of which plans may have any number
LARGEST_BODY = 1e7  # [m] from a vehicle's pose to any point of its body
STEEPEST_STEERING = 1.5  # [rad] of a wheel; at a right angle nothing rolls
SMALLEST = 1e-100  # of a vehicle's parameter and of a trim's twist: what divides by less is inf
LONGEST_STROKE = 1e4  # [m, rad] of one maneuver from rest to rest, which is sampled all along


def check_size(name: str, values: ArrayLike) -> None:
    """Raise a ValueError if a coordinate or a size [m] is beyond `FARTHEST`."""
    numbers = np.asarray(values, dtype=np.float64)
    if numbers.ndim == 1 and numbers.size <= FEW:
        few: list[float] = numbers.tolist()
        if all(abs(number) <= FARTHEST for number in few):
            return
    if numbers.size and not np.abs(numbers).max() <= FARTHEST:
        far = np.atleast_1d(numbers)
        far = far[np.abs(far) > FARTHEST]
        if far.size:
            raise ValueError(f"{name}: got {far.flat[0]:g} m, need at most {FARTHEST:g} m in size")


def check_heading(name: str, pose: ArrayLike) -> None:
    """Raise a ValueError if the heading [rad] of a pose is beyond `MOST_HEADING`."""
    for heading in np.asarray(pose, dtype=np.float64)[2:3]:
        if abs(heading) > MOST_HEADING:
            raise ValueError(
                f"{name}: got the heading {heading:g} rad, need at most {MOST_HEADING:g} rad in "
                "size"
            )

"""Slabs of time: a box for each moving obstacle in each, so that most are passed over at a look."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from maneuver_automaton.collision import _kernels_slabs
from maneuver_automaton.collision.arrays import Slabs

if TYPE_CHECKING:
    from maneuver_automaton.collision.arrays import MovingObstacles

FEW_MOVING = 4  # obstacles that are followed one by one sooner than looked up
MOST_SLABS = 128  # of the shortest; a power of two
OWN_SIZES = 2.0  # that an obstacle may cover in one of them


NO_SLABS = Slabs(0.0, 1.0, 0, 0, np.zeros((0, 4)))


def slabs_of(moving: MovingObstacles, reach: float) -> Slabs:
    """The slabs of moving obstacles for a body of some reach [m]; none where there are few.

    The shortest are about as long as an obstacle takes to cover its own size and the body's.
    """
    n = moving.speed.size
    if n < FEW_MOVING:
        return NO_SLABS
    events = np.concatenate([moving.time, moving.present.ravel()])
    events = events[np.isfinite(events)]
    begin, span = float(events.min()), float(np.ptp(events))
    covered = float(np.median(moving.speed * span / (moving.reach + reach))) / OWN_SIZES
    leaves = 1 << math.ceil(math.log2(min(max(covered, 1.0), MOST_SLABS)))
    width = span / leaves if span > 0.0 else 1.0
    box = np.empty((2 * leaves * n, 4))
    _kernels_slabs.write_slabs(moving, begin, width, leaves, box)
    return Slabs(begin, width, leaves, 0, box)

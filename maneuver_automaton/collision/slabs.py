"""Slabs of time: a box for each moving obstacle in each, so that most are passed over at a look."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.collision import _kernels_slabs

if TYPE_CHECKING:
    from maneuver_automaton.collision.world import MovingObstacles

FEW_MOVING = 4  # obstacles that are followed one by one sooner than looked up
MOST_SLABS = 128  # of the shortest; a power of two
OWN_SIZES = 2.0  # that an obstacle may cover in one of them


class Slabs(NamedTuple):
    """Boxes around all that moving obstacles sweep in slabs of time, longer and shorter ones.

    The slabs are a binary tree: the first is all of the time, the halves of slab k are the slabs
    2 k and 2 k + 1, and the last ones, the leaves, are the shortest. The box of obstacle m of M in
    slab k is in row ``first + k M + m``: around the disc that holds the obstacle, as long as it is
    there. Where it never is in a slab, the box is empty, and infinitely far from everything.
    """

    begin: float  # [s] of the first leaf, which also holds what was before: there all stand
    width: float  # [s] of a leaf; the last one also holds what comes after
    leaves: int  # a power of two; 0 where every obstacle is followed by itself
    first: int  # row of slab 0, which is none
    box: Array  # (rows, 4) [low x, low y, high x, high y]


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

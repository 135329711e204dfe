"""The window of a search of the lattice: the bounds, or a box around everything."""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.collision.world import World
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Bounds


def pad_around(world: World, radius: float) -> float:
    """How far [m] a window without bounds goes beyond all that stands, and the ends."""
    return 4.0 * radius + 4.0 * world.body.reach


def window_of(
    bounds: Bounds, world: World, poses: Array, *, radius: float
) -> tuple[Array, Array, bool]:
    """The window to search: the bounds, and where there are none, a box around everything.

    A box (4,) in the world's frame, a window as in `_kernels_window.inside_window`, and whether
    the window's rim is a wall on every side. `poses` (n, 3 or more) lie inside.
    """
    pad = pad_around(world, radius)
    # Plain numbers: arrays of two take longer than a first plan may.
    low_x, low_y, high_x, high_y = world.box.tolist()
    xs, ys = poses[:, 0].tolist(), poses[:, 1].tolist()
    low_x, low_y = min(low_x, *xs) - pad, min(low_y, *ys) - pad
    high_x, high_y = max(high_x, *xs) + pad, max(high_y, *ys) + pad
    if bounds.x is None and bounds.y is None:
        window = np.array([low_x, low_y, high_x, high_y, 0.0, 0.0, 1.0, 0.0, 0.0])
        return window[:4], window, False
    low, high = np.array([low_x, low_y]), np.array([high_x, high_y])
    turn = float(world.frame[2])
    c, s = math.cos(turn), math.sin(turn)
    corners = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    seen = corners @ np.array([[c, s], [-s, c]])  # along the axes of the problem
    low, high = seen.min(axis=0), seen.max(axis=0)
    for axis, pair in enumerate((bounds.x, bounds.y)):
        if pair is not None:
            low[axis], high[axis] = pair[0] - world.frame[axis], pair[1] - world.frame[axis]
    slack = 1e-9 * (1.0 + float(np.abs(np.append(low, high)).max()))
    window = np.array([low[0], low[1], high[0], high[1], 0.0, 0.0, c, s, slack])
    inner = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    back = np.asarray(SE2(np.array([0.0, 0.0, -turn])).act(inner))
    # What lies on a bound is inside of it, wherever its place is rounded to.
    box = np.concatenate([back.min(axis=0) - slack, back.max(axis=0) + slack])
    return box, window, bounds.x is not None and bounds.y is not None

"""What kernels of bounds take: boxes and cells of poses, and the rows of a linear program."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.collision.arrays import Buckets


class PoseArrays(NamedTuple):
    """Convex parts of a body and convex obstacles that never leave, for the kernels.

    Round corners are cut by sides inside of them, so what collides with these arrays collides;
    they lack at most `body_loose` and `loose`, so what is further apart than those is free.
    """

    body: Array  # (V, 5) as in `Solids`, seen from the vehicle
    body_first: IntArray  # (P + 1,)
    body_loose: Array  # (P,) [m]
    solids: Array  # (W, 5) as in `Solids`, grown by the margin
    first: IntArray  # (O + 1,)
    plates: Array  # (O, 5) rectangles around the obstacles, without the margin
    loose: Array  # (O,) [m]
    buckets: Buckets  # obstacles near each place of the middle of the body
    limits: Array  # (L, 3) n_x, n_y, c: a pose is within the bounds where n . (x, y) <= c
    middle_x: float  # [m] of a disc that holds the body ...
    middle_y: float
    reach: float  # ... and its radius
    margin: float  # [m] kept from every obstacle
    touching: float  # [m] depth and clearance below which nothing is said


Single = NDArray[np.float32]


class Rows(NamedTuple):
    """Rows of the program: weights of the directions at each layer, and sizes of dual steps."""

    table: Single  # (F * 7 * (K + 1),) both layers' directions, and three steps; the last is 0
    turn: Single  # (F,)
    side: IntArray  # (F,)
    gear: IntArray  # (F,)


class Grid(NamedTuple):
    """Sizes of the boxes of a tree, level by level, the roots first."""

    origin_x: float
    origin_y: float
    origin_heading: float
    columns: int
    rows: int
    size: Array  # (levels,) [m] in x and y
    price: Array  # (levels,) of a box that is not known to be free
    half_turn: Array  # (levels,) [rad] half a size in heading
    turns: IntArray  # (levels,) how many boxes fill the circle; 1 where no heading matters
    splits: NDArray[np.bool_]  # (levels,) whether the next level is finer in heading
    doublings: IntArray  # (levels,) how often it has become so
    touching: float  # [m, rad] by which an end may be beside a box that holds it


class Cells(NamedTuple):
    """Boxes of a tree; the roots come first, the children of a cell stand together."""

    level: NDArray[np.int8]  # (n,)
    at: NDArray[np.int32]  # (n, 3) column, row and heading in the grid of its level
    state: NDArray[np.int8]  # (n,) 0 blocked, 1 not known, 2 free
    child: IntArray  # (n,) the first of its children, -1 of a leaf
    ends: NDArray[np.int8]  # (n,) 1 if it holds the start, 2 a goal, 3 both

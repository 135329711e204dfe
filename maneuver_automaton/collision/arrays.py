"""What kernels of collision take: the world, what moves in it, and what bodies sweep."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.collision.convex import Solids


class Place(NamedTuple):
    """Where a body is: a pose, by cosine and sine of its heading."""

    x: float  # [m]
    y: float
    c: float
    s: float


class Coast(NamedTuple):
    """A constant twist from a pose on. Rows of motions (n, 9) have these fields."""

    x: float  # [m]
    y: float
    heading: float  # [rad]
    v_x: float  # [m/s] in the body's frame
    v_y: float
    turn_rate: float  # [rad/s]
    speed: float  # [m/s] that no point of the body exceeds
    duration: float  # [s]; a negative one drives, and dates, the motion backwards
    clock: float  # [s] time of the world where it begins


class AboutCenter(NamedTuple):
    """How a body goes on from where it is: it turns about a centre, or keeps its velocity."""

    center_x: float  # [m]
    center_y: float
    v_x: float  # [m/s] in the world
    v_y: float
    turn: float  # [rad/s]; 0 on a straight, inf where the centre is too far away to count from


class Field(NamedTuple):
    """Distances to the nearest solid at cell centres, capped; written where they are asked for."""

    distance: Array  # (rows, columns) [m]; 0 where none is known yet
    origin_x: float
    origin_y: float
    cell: float  # [m]
    outside: float  # [m] distance that holds outside the field
    solids: Solids  # to which distances are written; none where all are


class Buckets(NamedTuple):
    """Solids near each place: those left out are at least `reach` from a body in the middle."""

    start: IntArray  # (rows * columns + 1,)
    items: IntArray
    origin_x: float
    origin_y: float
    cell: float  # [m]
    columns: int
    rows: int
    reach: float  # [m]


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


class MovingObstacles(NamedTuple):
    """Moving obstacles: each a range of solids in its own frame, and knots in time."""

    solids: Solids
    first_piece: IntArray  # (M + 1,)
    first_knot: IntArray  # (M + 1,)
    time: Array  # (K,) [s]
    pose: Array  # (K, 3)
    speed: Array  # (M,) [m/s] greatest of any of its points
    middle: Array  # (M, 2) of a disc around it, in its frame
    reach: Array  # (M,) radius of that disc
    present: Array  # (M, 2) [s] it is there from and until; held at its first and last knot beyond
    rate: Array  # (K, 3) after each knot: of the pose, or the twist in the frame of what coasts
    arcs: NDArray[np.bool_]  # (M,) whether it coasts on arcs from knot to knot
    slabs: Slabs  # where each may be, by time


class WorldArrays(NamedTuple):
    """Arrays of a world for the kernels."""

    solids: Solids
    buckets: Buckets
    field: Field
    moving: MovingObstacles


class SweptAreas(NamedTuple):
    """Convex polygons, one for every motion and piece of the body, that hold all it covers.

    They are grown by the rounding of the piece, which the body knows.
    """

    edges: Array  # (V, 5) as in `Solids`
    first: IntArray  # (m k P + 1,) where each polygon begins, those of a motion one after the other
    places: Array  # (m k, 5) middle x, y, and radius of a disc around all; cosine, sine of the turn

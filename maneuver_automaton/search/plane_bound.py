"""Length of the shortest path of the pose among static obstacles: a lower bound of every plan."""

from __future__ import annotations

import numpy as np

from maneuver_automaton.search import _kernels_plane
from maneuver_automaton.search.distance_grid import OCTILE, distance_grid
from maneuver_automaton.search.lattice_query import LatticeQuery


def plane_bound(query: LatticeQuery) -> float:
    """Lower bound [m] of the path in the plane from the start to a goal's tolerance; 0 if unknown.

    The shortest path round blocked cells leads over their corners, and among the corners of cells
    an octile path is at most 1.0824 times as long; start and goal are at most half a diagonal from
    a corner. Cells are blocked only where the pose cannot be at all, as `distance_grid` says: by
    obstacles at every altitude, and the body that the pose lies in.

    Source: Bailey, Tovey, Uras, Koenig, Nash (2015), *Path planning on grids: the effect of vertex
    placement on path length*.
    """
    grid = distance_grid(query.plane, query.box, query.goals, query.start, prepared=query.prepared)
    if not grid.columns:
        return 0.0
    length: float = _kernels_plane.corner_path(
        grid,
        query.plane.arrays.field,
        np.ascontiguousarray(query.goals[:, :2]),
        float(query.start[0]),
        float(query.start[1]),
    )
    if not np.isfinite(length):
        return 0.0
    beside = max(query.problem.goals[k].tolerance_m for k in query.goal_index)
    return max(0.0, length / OCTILE - grid.cell * float(np.sqrt(2.0)) - beside)

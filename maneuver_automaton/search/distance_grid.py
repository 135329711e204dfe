"""The plane as cells through which the pose must pass: distances that know the obstacles."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._compile import plain
from maneuver_automaton._kept import RECENT, Prepared
from maneuver_automaton.collision.world import World
from maneuver_automaton.search import _kernels_distance
from maneuver_automaton.search._kernels_distance import BUCKETS
from maneuver_automaton.search.arrays import (
    CellQueue,
    DistanceGrid,
    GridLayout,
    GridWalls,
    LeastPrices,
)

MOST_CELLS = 1_000_000
OCTILE = 1.0823922002923938  # 1 / cos(pi / 8): most of a path along cells over a straight one
COARSER = 3  # field cells along a side of a coarse cell
TOUCHING = 1e-6  # [m] what is less deep in an obstacle may pass: checks and places are rounded
COARSEST = 1.05  # half diagonals of a coarse cell over the body's inscribed radius, at most


# A grid without cells, where no obstacle is static: the straight line is as good.
NONE = np.zeros(0, dtype=np.int64)
NO_PRICES = LeastPrices(np.zeros((0, 0), dtype=np.float32), 0.0, 0.0, 1.0, 0.0, 1.0, 0.0)
NO_GRID = DistanceGrid(
    value=NONE,
    rank=NONE,
    mark=np.zeros(0, dtype=np.uint8),
    state=np.zeros(6, dtype=np.int64),
    queue=CellQueue(np.zeros(0), NONE, NONE, NONE),
    layout=GridLayout(0.0, 0.0, 1.0, 0, 0, 1, 0, 0, 0, 0),
    walls=GridWalls(0.0, 0.0, -math.inf, 0),
    prices=NO_PRICES,
    window=np.zeros(9),
)


def distance_grid(
    world: World,
    box: Array,
    window: Array,
    seeds: Array,
    aim: Array,
    *,
    coarse: bool = False,
    prices: Callable[[DistanceGrid], LeastPrices] | None = None,
    prepared: Prepared = RECENT,
) -> DistanceGrid:
    """Distances from `seeds` (n, 2 or more) inside `box` (4,), grown towards `aim` (2 or more,).

    Outside of the `window` (9,), as in `_kernels_coast.inside_window`, no pose may be: its sides
    are walls too, which the box around it need not follow.

    Where places cost something, `prices` says what they cost at least in cells of a grid.

    Coarse cells, where the body is large enough for them, show fewer passages to be closed, and
    take a ninth of the time.

    Source of the inflation: a pose in a cell is at most half its diagonal from the centre, and a
    disc of the body's inscribed radius around it must be free. A wall between the middles of two
    neighbours is at most half a diagonal from one of them, which is blocked if the radius is a
    whole diagonal.

    A blocked cell rests on no more than that: the window; static obstacles of the world, whatever
    their number and shape; the part of the vehicle whose frame is the pose, and of it a disc around
    the pose. A pose outside its body blocks no cell. Where the field is capped nothing is blocked.
    """
    if not world.arrays.field.distance.size:
        return NO_GRID
    grid = laid_grid(world, box, window, aim, coarse=coarse)
    grid = grid if prices is None else grid._replace(prices=prices(grid))
    n = grid.layout.columns * grid.layout.rows
    most = 8 * n + 8  # each cell is reached once from each of its neighbours at most
    memory = prepared.room(2 * n + 3 * most, np.int64)
    keys, items, links = (memory[2 * n + k * most : 2 * n + (k + 1) * most] for k in range(3))
    grid = grid._replace(
        value=memory[:n],
        rank=memory[n : 2 * n],
        mark=np.zeros(n, dtype=np.uint8),
        state=np.zeros(6, dtype=np.int64),
        queue=CellQueue(keys.view(np.float64), items, links, np.zeros(BUCKETS, dtype=np.int64)),
    )
    _kernels_distance.seed(grid, np.ascontiguousarray(seeds[:, :2]))
    return grid


def laid_grid(
    world: World,
    box: Array,
    window: Array,
    aim: Array,
    *,
    coarse: bool = False,
    like: DistanceGrid | None = None,
) -> DistanceGrid:
    """The grid of `distance_grid` without its arrays, or with those of another one."""
    field = world.arrays.field
    low_x, low_y, high_x, high_y = box.tolist()
    area = max(high_x - low_x, field.cell) * max(high_y - low_y, field.cell)
    few = area <= MOST_CELLS * field.cell * field.cell
    stride = 1 if few else stride_of(area, field.cell)
    if coarse and COARSER * field.cell * math.sqrt(0.5) <= COARSEST * world.body.inscribed:
        stride = max(stride, COARSER)
    cell = stride * field.cell
    along = plain(_kernels_distance.grid_layout)
    first_i, columns, start_x = along(field.origin_x, low_x, high_x, cell, field.cell, stride)
    first_j, rows, start_y = along(field.origin_y, low_y, high_y, cell, field.cell, stride)
    half_diagonal, inscribed = cell * math.sqrt(0.5), world.body.inscribed
    aim_x, aim_y = aim[:2].tolist()
    return (like or NO_GRID)._replace(
        layout=GridLayout(
            origin_x=start_x,
            origin_y=start_y,
            cell=cell,
            columns=columns,
            rows=rows,
            stride=stride,
            shift_x=first_i * stride,
            shift_y=first_j * stride,
            aim_i=math.floor((aim_x - start_x) / cell),
            aim_j=math.floor((aim_y - start_y) / cell),
        ),
        walls=GridWalls(
            inflation=min(inscribed - half_diagonal - TOUCHING, field.outside),
            wanted=min(max(inscribed, 0.0), field.outside),
            cut=min(half_diagonal, field.outside) if inscribed < 2.0 * half_diagonal else -math.inf,
            detour=plain(_kernels_distance.detour_of)(columns, rows),
        ),
        window=window,
    )


def with_cells(grid: DistanceGrid, n: int) -> DistanceGrid:
    """The grid with memory of its own for `n` cells, of which nothing is known."""
    most = 8 * n + 8
    return grid._replace(
        value=np.zeros(n, dtype=np.int64),
        rank=np.zeros(n, dtype=np.int64),
        mark=np.zeros(n, dtype=np.uint8),
        state=np.zeros(6, dtype=np.int64),
        queue=CellQueue(
            np.zeros(most), *(np.zeros(room, dtype=np.int64) for room in (most, most, BUCKETS))
        ),
    )


def stride_of(area: float, cell: float) -> int:
    """Least odd number of field cells [m] a cell that parts an area [m^2] into few enough.

    Odd, so that centres of cells stay centres of field cells.
    """
    least = math.ceil(math.sqrt(area / MOST_CELLS) / cell)
    stride = max(least - 2 + (least - 1) % 2, 1)  # one less than that, for what rounding has done
    while area / (stride * cell) ** 2 > MOST_CELLS:
        stride += 2
    return stride

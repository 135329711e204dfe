"""Whether poses are connected: a tree of boxes of poses, refined where a way may be.

Boxes that collide throughout are left out. Where the rest does not connect a start to a goal, no
plan exists, for any vehicle with this body, however it moves; where boxes that are wholly free
connect them, a way exists. In between, the boxes that are not known to be free are split along the
way that leads through as little of them as can be, so that work goes where the scene is narrow.
"""

from __future__ import annotations

import enum
import math
import time
from dataclasses import dataclass

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.bounds import _kernels_connectivity
from maneuver_automaton.bounds._kernels_boxes import UNKNOWN
from maneuver_automaton.bounds._kernels_connectivity import GOAL, ROUNDED, START
from maneuver_automaton.bounds.arrays import Cells, Grid
from maneuver_automaton.bounds.pose_scene import TOUCHING, PoseScene
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Bounds
from maneuver_automaton.search.scene import window_of

HEADINGS = 8  # of the roots of the tree
MOST_ROOTS = 4096  # in the plane: a long corridor has as small ones as a room
FINEST = 2e-4  # [m] smallest side of a box ...
FINEST_SHARE = 1e-8  # ... or this share of the scene: places are counted by 32 bits
PRICE = 0.85  # power of its side that a box costs: large ones are split before many small ones
MOST_BOXES = 1_000_000
NO_WAY = np.zeros(0)  # prices of the other way, where they are not known


class Connection(enum.Enum):
    """Whether two sets of poses are connected."""

    CONNECTED = "connected"  # through boxes that are free
    SEPARATED = "separated"  # proven: no path leads through boxes that may be free
    OPEN = "open"  # not known after the work that was allowed


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Connectivity:
    """The answer, and the boxes that it rests on."""

    answer: Connection
    boxes: int  # that were tested
    reached: Array  # (n, 4, 2) corners of the places of boxes that may be reached, of a separation
    path: Array  # (n, 3) poses of a way through free boxes, also on what two of them share


def connectivity(
    scene: PoseScene,
    starts: Array,
    goals: Array,
    *,
    bounds: Bounds | None = None,
    give: float = 0.0,
    most_boxes: int = MOST_BOXES,
    deadline: float = math.inf,
    price: float = PRICE,
) -> Connectivity:
    """Whether a way leads from one of `starts` to one of `goals`, both boxes (n, 6) as the scene's.

    Parameters
    ----------
    scene : PoseScene
    starts, goals : (n, 6) array
        Boxes of poses in the scene's frame: middles, and half sizes, which may be zero.
    bounds : Bounds, optional
        Those of the scene's problem.
    give : float
        [m] by which all obstacles draw back; if negative they come nearer, which proves nothing.
    most_boxes : int
        Work that is allowed; the answer is the same at every call that is not out of time.
    deadline : float
        As `time.monotonic` counts [s].
    price : float
        Power of its side that a box costs on a way.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Box, Problem, Unicycle
    >>> from maneuver_automaton.bounds import pose_scene
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1, 0), "left": (0, 1)})
    >>> walls = [Box([1.0, 8.0], [4.0, 4.9]), Box([1.0, 8.0], [4.0, -4.9])]
    >>> bounds = Bounds(x=(-2.0, 10.0), y=(-4.0, 4.0))
    >>> ends = np.array([[[0.0, 0, 0, 0, 0, 0]], [[8.0, 0, 0, 0, 0, 0]]])
    >>> for width in (1.75, 1.85):  # the walls leave 1.8 m
    ...     body = Box([3.0, width])
    ...     problem = Problem(robot, [0, 0, 0], [8, 0, 0], obstacles=walls, footprint=body)
    ...     scene = pose_scene(problem, frame=np.zeros(3))
    ...     connectivity(scene, *ends, bounds=bounds).answer.value
    'connected'
    'separated'
    """
    grid = _grid(scene, np.concatenate([starts, goals])[:, :3], bounds or Bounds(), price)
    used = int(grid.columns * grid.rows * grid.turns[0])
    cells = _room(max(most_boxes, used))
    ends = (starts, goals, give)
    _kernels_connectivity.judge_roots(scene.arrays, grid, cells, *ends)
    answer, to_start, to_goal = Connection.OPEN, *np.empty((2, len(cells.level)))
    while answer is Connection.OPEN:
        _kernels_connectivity.spread(grid, cells, used, START, NO_WAY, math.inf, to_start)
        leaf = cells.child[:used] < 0
        least = to_start[:used][leaf & (cells.ends[:used] & GOAL > 0)].min(initial=math.inf)
        if least == 0.0 or math.isinf(least):
            answer = Connection.CONNECTED if least == 0.0 else Connection.SEPARATED
            break
        most = float(least) * (1.0 + 2.0 * ROUNDED)
        _kernels_connectivity.spread(grid, cells, used, GOAL, to_start, most, to_goal)
        levels = cells.level[:used]
        through = to_start[:used] + to_goal[:used] - grid.price[levels]
        able = leaf & (cells.state[:used] == UNKNOWN) & (levels < len(grid.size) - 1)
        chosen = np.flatnonzero(able & (through <= most))
        if not len(chosen) or used + 8 * len(chosen) > len(cells.level):
            break
        used = _kernels_connectivity.split_cells(scene.arrays, grid, cells, chosen, used, *ends)
        if time.monotonic() > deadline:
            break
    separated, connected = answer is Connection.SEPARATED, answer is Connection.CONNECTED
    known = np.isfinite(to_start[:used]) & (cells.child[:used] < 0)
    path = _kernels_connectivity.free_path(grid, cells, used) if connected else np.zeros(0, int)
    return Connectivity(
        answer=answer,
        boxes=used,
        reached=_places(scene, grid, cells, np.flatnonzero(known & separated)),
        path=_path(scene, grid, cells, path),
    )


def _room(most: int) -> Cells:
    """Room for so many boxes."""
    return Cells(
        level=np.empty(most, dtype=np.int8),
        at=np.empty((most, 3), dtype=np.int32),
        state=np.empty(most, dtype=np.int8),
        child=np.empty(most, dtype=np.int64),
        ends=np.empty(most, dtype=np.int8),
    )


def _grid(scene: PoseScene, poses: Array, bounds: Bounds, price: float) -> Grid:
    """Roots that are about as large as the vehicle, and cover all that is in the way.

    Beyond them nothing is in the way that is not beside them too. A box is about as large in
    heading as in the plane, by how far the body's farthest corner moves.
    """
    arrays = scene.arrays
    arm = float(np.hypot(arrays.body[:, 0], arrays.body[:, 1]).max())
    around = arm + arrays.margin
    turns = HEADINGS if scene.turns else 1
    turn = 2.0 * math.pi / turns
    box, _, _ = window_of(bounds, scene.world, poses, radius=around)
    extent = float((box[2:] - box[:2]).max())
    area = float(np.prod(box[2:] - box[:2]))
    size = max(turn * arm if scene.turns else around, math.sqrt(area / MOST_ROOTS))
    box[:2] -= 0.0 if bounds.x is not None and bounds.y is not None else size
    box[2:] += 0.0 if bounds.x is not None and bounds.y is not None else size
    columns, rows = np.maximum(np.ceil((box[2:] - box[:2]) / size), 1.0).astype(int).tolist()
    sizes, widths, doublings, splits = [size], [turn], [0], []
    while sizes[-1] > max(FINEST, FINEST_SHARE * extent):
        splits.append(scene.turns and widths[-1] * arm > 0.7 * sizes[-1])
        sizes.append(0.5 * sizes[-1])
        widths.append(0.5 * widths[-1] if splits[-1] else widths[-1])
        doublings.append(doublings[-1] + splits[-1])
    # What cannot be split is avoided as long as something else is left to split.
    prices = np.append(np.array(sizes[:-1]) ** price, size)
    return Grid(
        origin_x=float(box[0]),
        origin_y=float(box[1]),
        origin_heading=0.0 if scene.turns else float(poses[0, 2]) - 0.5 * turn,
        columns=columns,
        rows=rows,
        size=np.array(sizes),
        price=prices,
        half_turn=0.5 * np.array(widths),
        turns=turns * 2 ** np.array(doublings, dtype=np.int64),
        splits=np.array([*splits, False], dtype=np.bool_),
        doublings=np.array(doublings, dtype=np.int64),
        touching=TOUCHING,
    )


def _middles(grid: Grid, cells: Cells, chosen: IntArray) -> Array:
    """Middles (n, 3) of cells in the scene's frame."""
    level = cells.level[chosen]
    at = cells.at[chosen] + 0.5
    steps = np.column_stack([grid.size[level], grid.size[level], 2.0 * grid.half_turn[level]])
    origin = [grid.origin_x, grid.origin_y, grid.origin_heading]
    return np.asarray(origin + at * steps, dtype=np.float64)


def _path(scene: PoseScene, grid: Grid, cells: Cells, chosen: IntArray) -> Array:
    """Middles of boxes that touch one another and of the faces between, as the problem sees them.

    From a pose of one box to the next straight lines stay inside of the boxes.
    """
    middles = _middles(grid, cells, chosen)
    middles[:, 2] = np.unwrap(middles[:, 2])
    level = cells.level[chosen]
    halves = np.column_stack(
        [0.5 * grid.size[level], 0.5 * grid.size[level], grid.half_turn[level]]
    )
    low, high = middles - halves, middles + halves
    faces = 0.5 * (np.maximum(low[:-1], low[1:]) + np.minimum(high[:-1], high[1:]))
    poses = np.empty((max(2 * len(chosen) - 1, 0), 3))
    poses[::2], poses[1::2] = middles, faces
    return (SE2(scene.world.frame) @ SE2(poses)).pose


def _places(scene: PoseScene, grid: Grid, cells: Cells, chosen: IntArray) -> Array:
    """Corners (n, 4, 2) of the places of cells, each place once, whatever the headings."""
    keys = np.column_stack([cells.level[chosen], cells.at[chosen, :2]])
    _, first = np.unique(keys, axis=0, return_index=True)
    once = chosen[first]
    signs = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    middles = _middles(grid, cells, once)[:, None, :2]
    corners = middles + signs * grid.size[cells.level[once]][:, None, None]
    return np.asarray(SE2(scene.world.frame).act(corners))

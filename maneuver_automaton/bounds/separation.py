"""The proof that no plan exists, and where the way is too narrow by how much.

A tree of boxes of poses is refined where a way may be. Boxes that collide throughout are left out.
Where the rest does not connect a start to a goal, no plan exists, for any vehicle with this body,
however it moves; where boxes that are wholly free connect them, a way exists. In between, the boxes
that are not known to be free are split along the way that leads through as little of them as can
be, so that work goes where the scene is narrow. A long corridor has many such ways beside one
another: they are split together in the end, since to look for one takes longer than to test its
boxes.
"""

from __future__ import annotations

import enum
import functools
import itertools
import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._kept import kept_by_first
from maneuver_automaton.bounds import _kernels_connectivity
from maneuver_automaton.bounds._kernels_boxes import UNKNOWN
from maneuver_automaton.bounds._kernels_connectivity import GOAL, ROUNDED, START
from maneuver_automaton.bounds.arrays import Cells, Grid
from maneuver_automaton.bounds.cells import TOUCHING, PoseScene, lasting_obstacles, pose_scene
from maneuver_automaton.collision.outline import united
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Bounds, Goal, Problem
from maneuver_automaton.search.scene import window_of

HEADINGS = 8  # of the roots of the tree
MOST_ROOTS = 4096  # in the plane: a long corridor has as small ones as a room
FINEST = 2e-4  # [m] smallest side of a box ...
FINEST_SHARE = 1e-8  # ... or this share of the scene: places are counted by 32 bits
ALONE = 30  # rounds in which the way through as little as can be is split alone ...
MANY = 30_000  # ... and boxes until which it is, as rounds among few take no time; later ...
NEARLY = 1.3  # ... the coarsest boxes of ways that cost so many times as much are split with it
PRICE = 0.85  # power of its side that a box costs: large ones are split before many small ones
MOST_BOXES = 1_000_000
AROUND = np.deg2rad([9.0, 27.0, 45.0, 63.0, 81.0])
WITHIN = np.column_stack([np.cos(AROUND), np.sin(AROUND)])  # corners on a circle
NOWHERE = np.full(3, math.nan)
NO_WAY = np.zeros(0)  # prices of the other way, where they are not known
TRIES = 10  # lengths by which obstacles draw back that are tried for the narrowest place ...
MOST_TRIED = 60_000  # ... each with so many boxes
MOST_AROUND = 4_000  # ... or so many around a goal alone
AGREE = 0.08  # share of what is missing to which it is found ...
CLOSE = 5e-4  # [m] ... or this length
ROUGHLY = 0.5  # share by which a length that is said may be too large
FIRST = 0.02  # [m] by which obstacles draw back at first


class Reachability(enum.Enum):
    """Whether two sets of poses are connected."""

    CONNECTED = "connected"  # through boxes that are free
    SEPARATED = "separated"  # proven: no path leads through boxes that may be free
    OPEN = "open"  # not known after the work that was allowed


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Connectivity:
    """The answer, and the boxes that it rests on."""

    answer: Reachability
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
    answer, to_start, to_goal = Reachability.OPEN, *np.empty((2, len(cells.level)))
    for turn in itertools.count():
        _kernels_connectivity.spread(grid, cells, used, START, NO_WAY, math.inf, to_start)
        leaf = cells.child[:used] < 0
        least = to_start[:used][leaf & (cells.ends[:used] & GOAL > 0)].min(initial=math.inf)
        if least == 0.0 or math.isinf(least):
            answer = Reachability.CONNECTED if least == 0.0 else Reachability.SEPARATED
            break
        most = float(least) * (1.0 + 2.0 * ROUNDED)
        wide = most * (NEARLY if turn > ALONE and used > MANY else 1.0)
        _kernels_connectivity.spread(grid, cells, used, GOAL, to_start, wide, to_goal)
        levels = cells.level[:used]
        through = to_start[:used] + to_goal[:used] - grid.price[levels]
        able = leaf & (cells.state[:used] == UNKNOWN) & (levels < len(grid.size) - 1)
        least_way = able & (through <= most)
        coarsest = levels <= levels[least_way].min(initial=len(grid.size))
        chosen = np.flatnonzero(least_way | (able & coarsest & (through <= wide)))
        if not len(chosen) or used + 8 * len(chosen) > len(cells.level):
            break
        used = _kernels_connectivity.split_cells(scene.arrays, grid, cells, chosen, used, *ends)
        if time.monotonic() > deadline:
            break
    separated, connected = answer is Reachability.SEPARATED, answer is Reachability.CONNECTED
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
    """Roots that are about as large as the vehicle, and cover all that is in the way."""
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


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Narrowest:
    """Where a way is too narrow, and by how much: with as much more room there is one."""

    place: tuple[float, float]  # [m]
    missing: float  # [m]

    def __str__(self) -> str:
        x, y = (f"{round(value, 2) + 0.0:g}" for value in self.place)
        return f"the passage at ({x}, {y}) is {float(f'{self.missing:.2g}'):g} m too narrow"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Separation:
    """A proof that no plan exists."""

    boxes: int  # of poses that it took
    reached: Array  # (n, 4, 2) corners of squares: the vehicle's place never leaves them
    narrowest: Narrowest | None  # None where it was not found in time

    @property
    def reason(self) -> str:
        """The proof in one line."""
        why = f": {self.narrowest}" if self.narrowest else ""
        return f"no collision-free path leads from the start to the goal, however it is driven{why}"


def separation(
    problem: Problem, *, most_boxes: int = MOST_BOXES, deadline: float = math.inf
) -> Separation | None:
    """A proof that obstacles part the start from every goal; None if it is not found.

    Only the poses of the body count, not how the vehicle moves: what is proven holds for every
    vehicle with this body, with any library, cost and horizon. The body is as it is: concave, of
    several parts, wherever its pose lies. What moves, what can be flown over, zones, and what is
    carried are left out, and a goal is all of its tolerance.

    Parameters
    ----------
    problem : Problem
    most_boxes : int
        Boxes of poses that are tested at most.
    deadline : float
        As `time.monotonic` counts [s].

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Box, Problem, Unicycle
    >>> from maneuver_automaton.problem import Bounds
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1, 0), "left": (0, 1)})
    >>> walls = [Box([1.0, 8.0], [4.0, 4.9]), Box([1.0, 8.0], [4.0, -4.9])]
    >>> problem = Problem(robot, [0, 0, 0], [8, 0, 0], obstacles=walls, footprint=Box([3.0, 2.0]),
    ...                   bounds=Bounds(x=(-2.0, 10.0), y=(-4.0, 4.0)))
    >>> separation(problem).reason  # the walls leave 1.8 m
    'no collision-free path leads from the start to the goal, however it is driven: the passage at \
(3.56, 0) is 0.22 m too narrow'
    """
    proof = _proof(problem, most_boxes, deadline)
    if proof is None:
        return None
    narrowest = _narrowest(problem, *_asked(problem), deadline)
    return Separation(boxes=proof.boxes, reached=proof.reached, narrowest=narrowest)


def widest_path(
    problem: Problem, *, first: float, most_boxes: int = MOST_BOXES, deadline: float = math.inf
) -> tuple[Reachability, Array, float]:
    """Whether a path leads to a goal, its poses (n, 3), and how far it stays from all [m].

    The path that is found with the most room, of some that are tried: `first` [m] at first. It
    knows nothing of what moves, as the proof of `separation` does not.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Box, Unicycle
    >>> from maneuver_automaton.problem import Bounds
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1, 0), "left": (0, 1)})
    >>> walls = [Box([1.0, 8.0], [4.0, 5.2]), Box([1.0, 8.0], [4.0, -5.2])]
    >>> problem = Problem(robot, [0, 0, 0], [8, 0, 0], obstacles=walls, footprint=Box([3.0, 2.0]),
    ...                   bounds=Bounds(x=(-2.0, 10.0), y=(-4.0, 4.0)))
    >>> answer, path, apart = widest_path(problem, first=0.1)  # the walls leave 2.4 m
    >>> answer.value, len(path) > 2, 0.1 <= apart < 0.2
    ('connected', True, True)
    """
    scene, start, goals = _asked(problem)
    ask = functools.partial(
        connectivity, scene, start, goals, bounds=problem.bounds, deadline=deadline
    )
    wider = functools.partial(ask, price=1.0, most_boxes=MOST_TRIED)
    found, kept = _widened(ask(most_boxes=most_boxes), wider, first=first, deadline=deadline)
    _proofs(problem).extend([found] if found.answer is Reachability.SEPARATED else [])
    return found.answer, found.path, kept


def _widened(
    found: Connectivity, ask: Callable[..., Connectivity], *, first: float, deadline: float
) -> tuple[Connectivity, float]:
    """Of some connections that are tried the one that keeps farthest from all, and how far [m]."""
    kept, apart = 0.0, first
    for _ in range(TRIES if found.answer is Reachability.CONNECTED else 0):
        if time.monotonic() > deadline or apart - kept <= ROUGHLY * kept / 2.0:
            break
        wider = ask(give=-apart)
        if wider.answer is Reachability.CONNECTED:
            found, kept, apart = wider, apart, (1.0 + ROUGHLY) * apart
        else:
            apart = 0.5 * (kept + apart)
    return found, kept


def are_apart(problem: Problem, *, most_boxes: int, deadline: float = math.inf) -> bool:
    """Whether obstacles are proven to part the start from every goal, as in `separation`.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Box, Unicycle
    >>> from maneuver_automaton.problem import Bounds
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1, 0), "left": (0, 1)})
    >>> walls = [Box([1.0, 8.0], [4.0, 4.9]), Box([1.0, 8.0], [4.0, -4.9])]
    >>> problem = Problem(robot, [0, 0, 0], [8, 0, 0], obstacles=walls, footprint=Box([3.0, 2.0]),
    ...                   bounds=Bounds(x=(-2.0, 10.0), y=(-4.0, 4.0)))
    >>> are_apart(problem, most_boxes=10_000)  # the walls leave 1.8 m
    True
    """
    return _proof(problem, most_boxes, deadline) is not None


def _proof(problem: Problem, most_boxes: int, deadline: float) -> Connectivity | None:
    """That obstacles part the start from every goal; found once for a problem."""
    known = _proofs(problem)
    if not known and lasting_obstacles(problem):
        asked = _asked(problem)
        found = connectivity(
            *asked, bounds=problem.bounds, most_boxes=most_boxes, deadline=deadline
        )
        known.extend([found] if found.answer is Reachability.SEPARATED else [])
    return known[0] if known else None


@kept_by_first
def _proofs(problem: Problem) -> list[Connectivity]:
    """Where a search that has met the proof for a problem leaves it for `separation`."""
    del problem
    return []


def free_end(
    problem: Problem, goal: Goal, *, most_boxes: int, deadline: float = math.inf
) -> Array | None:
    """A pose within the tolerance of a goal, with room around it; None: proven that all collide.

    NaN where neither was found. The proof rests on what that of `separation` rests on, and the pose
    is free of no more than that.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Box, Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1, 0), "left": (0, 1)})
    >>> near, wall = Goal([4.0, 0.0, 0.0], tolerance_m=0.2), Box([2.0, 8.0], [4.95, 0.0])
    >>> problem = Problem(robot, [0, 0, 0], near, obstacles=wall, footprint=Box([0.2, 0.2]))
    >>> 3.8 <= free_end(problem, near, most_boxes=20_000)[0].item() <= 3.85
    True
    """
    scene = pose_scene(problem)
    whole = _box_of(scene, goal)
    within = np.repeat(whole, len(WITHIN), axis=0)
    within[:, 3:5] *= WITHIN  # rectangles in the disc that is admitted, whose square is `whole`
    sides = []
    for at, own in zip(goal.pose[:2].tolist(), (problem.bounds.x, problem.bounds.y), strict=True):
        low, high = own or (-math.inf, math.inf)
        sides.append((max(low, at - goal.tolerance_m), min(high, at + goal.tolerance_m)))
        if sides[-1][0] >= sides[-1][1]:
            return NOWHERE
    around = Bounds(x=sides[0], y=sides[1])
    ask = functools.partial(connectivity, scene, bounds=around, deadline=deadline)
    ends = functools.partial(ask, within, within)
    wider = functools.partial(ends, price=1.0, most_boxes=MOST_AROUND)
    found, _ = _widened(ends(most_boxes=most_boxes), wider, first=FIRST, deadline=deadline)
    if found.answer is not Reachability.CONNECTED:
        outer = ask(whole, whole, most_boxes=most_boxes)
        return None if outer.answer is Reachability.SEPARATED else NOWHERE
    off = scene.world.into(found.path[0]) - whole[0, :3]  # of a box that meets a rectangle
    off[2] = math.remainder(off[2], 2.0 * math.pi) if scene.turns else 0.0
    nearest = np.clip(off, -within[:, 3:], within[:, 3:])
    off = nearest[np.abs(nearest - off)[:, :2].max(axis=1).argmin()]
    place = SE2(scene.world.frame).act(whole[0, :2] + off[:2])
    return np.append(place, goal.pose[2] + off[2])


def _asked(problem: Problem) -> tuple[PoseScene, Array, Array]:
    """The scene of a problem, and boxes (n, 6) of its start and of all goals."""
    scene = pose_scene(problem)
    goals = np.concatenate([_box_of(scene, goal) for goal in problem.goals])
    return scene, _seen(scene, problem.start), goals


def _seen(scene: PoseScene, pose: Array) -> Array:
    """A pose as a box without extent, in the frame of a scene."""
    return np.append(scene.world.into(pose[:3]), np.zeros(3))[None]


def _box_of(scene: PoseScene, goal: Goal) -> Array:
    """A box (1, 6) around all poses that a plan may end at."""
    box = _seen(scene, goal.pose)
    box[0, 3:5] = goal.tolerance_m
    box[0, 5] = math.pi if goal.free_heading else min(goal.tolerance_rad, math.pi)
    return box


def _narrowest(
    problem: Problem, scene: PoseScene, start: Array, goals: Array, deadline: float
) -> Narrowest | None:
    """The narrowest place: where obstacles must draw back so that there is a way."""
    low, high, path = 0.0, math.inf, np.zeros((0, 3))
    for _ in range(TRIES):
        if time.monotonic() > deadline or high - low <= max(CLOSE, AGREE * low):
            break
        give = 0.5 * (low + high) if math.isfinite(high) else max(FIRST, 4.0 * low)
        tried = connectivity(
            scene,
            start,
            goals,
            bounds=problem.bounds,
            give=give,
            most_boxes=MOST_TRIED,
            price=1.0,  # which finds ways sooner than it proves that there is none
            deadline=deadline,
        )
        if tried.answer is Reachability.CONNECTED:
            high, path = give, tried.path
        else:
            low = give
    if not len(path) or high - low > ROUGHLY * high:  # out of time
        return None
    place, sides = _deepest(scene, path, high)
    # Each side draws back by `high`: between two the passage is wider by twice as much.
    return Narrowest(place=place, missing=high * min(sides, 2))


def _deepest(scene: PoseScene, path: Array, most: float) -> tuple[tuple[float, float], int]:
    """Where a body on a path is deepest in obstacles, and in how many parts of them it is."""
    import shapely

    seen = scene.world.into(path)
    boxes = np.concatenate([seen, np.zeros_like(seen)], axis=1)
    low, high, deepest = 0.0, most, 0
    for _ in range(TRIES):
        middle = 0.5 * (low + high)
        blocked = np.flatnonzero(scene.states(boxes, give=middle) == 0)
        low, high = (middle, high) if len(blocked) else (low, middle)
        deepest = int(blocked[len(blocked) // 2]) if len(blocked) else deepest
    body = united(_polygons(scene.arrays.body, scene.arrays.body_first))
    there = shapely.transform(body, lambda points: np.asarray(SE2(seen[deepest]).act(points)))
    near = [
        one for one in _polygons(scene.arrays.solids, scene.arrays.first) if there.intersects(one)
    ]
    touched = shapely.get_parts(there.intersection(united(near)))
    if not len(touched):
        return (float(path[deepest, 0]), float(path[deepest, 1])), 1
    middles = shapely.get_coordinates(shapely.centroid(touched))
    place = np.asarray(SE2(scene.world.frame).act(middles.mean(axis=0)))
    return (float(place[0]), float(place[1])), len(touched)


def _polygons(edges: Array, first: IntArray) -> list[object]:
    """Convex pieces as shapely's geometries, also those without area."""
    import shapely

    ends = zip(first[:-1].tolist(), first[1:].tolist(), strict=True)
    return [shapely.MultiPoint(edges[a:b, :2]).convex_hull for a, b in ends]

"""The permanent obstacles that boxes of poses meet; cells of poses, nodes and functions on them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.bounds import _kernels_boxes, _kernels_certificate
from maneuver_automaton.bounds.arrays import PoseArrays
from maneuver_automaton.collision import AnyObstacle
from maneuver_automaton.collision.convex import Solids, pieces_of, solids_of
from maneuver_automaton.collision.layers import always
from maneuver_automaton.collision.world import World, own_frame, world_of
from maneuver_automaton.problem import Bounds, Goal, Problem, moves

TOUCHING = 1e-6  # [m] what is less deep in an obstacle may pass: checks and places are rounded
FLAT = 2e-3  # [m] that the sides of a polygon in a disc may cut off
MOST_SIDES = 64  # of such a polygon


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PoseScene:
    """What never leaves a vehicle's poses: static obstacles, and bounds."""

    world: World  # its frame is the one in which boxes are counted
    arrays: PoseArrays
    turns: bool  # whether the heading of the vehicle changes, and matters

    @property
    def box(self) -> Array:
        """Rectangle (4,) [low x, low y, high x, high y] around the obstacles, inf without any."""
        return self.world.box

    def states(self, boxes: Array, *, give: float = 0.0) -> NDArray[np.int8]:
        """States (n,) of boxes (n, 6): 0 all poses collide, 2 all are free, 1 not known.

        A box is its middle (x, y, heading) in the scene's frame, and half its sizes, in heading at
        most a quarter turn. Obstacles draw back by `give` [m].

        Examples
        --------
        >>> from maneuver_automaton import Automaton, Box, Problem, Unicycle
        >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1, 0), "left": (0, 1)})
        >>> wall = Box([1.0, 8.0], [4.0, 0.0])
        >>> problem = Problem(robot, [0, 0, 0], [9, 0, 0], obstacles=wall, footprint=Box([2, 1]))
        >>> scene = pose_scene(problem, frame=np.zeros(3))
        >>> small = [0.1, 0.1, 0.05]
        >>> scene.states(np.array([[x, 0, 0.0, *small] for x in (0, 2.5, 3)])).tolist()
        [2, 1, 0]
        """
        if (boxes[:, 5] > 0.5 * math.pi).any():
            raise ValueError("boxes: half a size in heading must be at most a quarter turn")
        states = np.empty(len(boxes), dtype=np.int8)
        _kernels_boxes.box_states(self.arrays, np.ascontiguousarray(boxes), give, states)
        return states


def pose_scene(problem: Problem, *, frame: Array | None = None) -> PoseScene:
    """The scene of a problem, seen from the pose `frame` (3,); one that moves with it if omitted.

    Moving obstacles, those at some of the altitudes only that the bounds admit, and what the
    vehicle carries are left out, and so are zones: fewer poses collide, so that every proof from
    the scene holds for the problem.
    """
    obstacles = lasting_obstacles(problem)
    seen_from = own_frame(obstacles, problem.goals[0].pose) if frame is None else tuple(frame)
    world = world_of(obstacles, problem.footprint, seen_from[:3], keep=problem.margin)
    body, body_loose = _inside(world.body.edges, world.body.first, world.body.radius)
    near = world.arrays.solids
    solids, loose = _inside(near.edges, near.first, near.plates[:, 4] + problem.margin)
    arrays = PoseArrays(
        body=body.edges,
        body_first=body.first,
        body_loose=body_loose,
        solids=solids.edges,
        first=solids.first,
        plates=near.plates,
        loose=loose,
        buckets=world.arrays.buckets,
        limits=_limits(problem.bounds, world.frame),
        middle_x=world.body.middle_x,
        middle_y=world.body.middle_y,
        reach=world.body.reach,
        margin=float(problem.margin),
        touching=TOUCHING,
    )
    turns = world.body.edges[:, :2].any()  # not a disc around the pose
    # With inertia a vehicle turns between its trims, and its library may hold no more than a rest.
    turns &= problem.has_inertia or problem.automaton.body_velocities[:, 2].any()
    return PoseScene(world=world, arrays=arrays, turns=bool(turns))


def lasting_obstacles(problem: Problem) -> tuple[AnyObstacle, ...]:
    """Obstacles that never move, and that stand at every altitude within the bounds."""
    obstacles = tuple(one for one in problem.obstacles if not moves(one))
    if problem.start.size == 3:
        return obstacles
    low, high = problem.bounds.z or (-math.inf, math.inf)
    below, above = problem.body_height
    return always(obstacles, low=low + below, high=high + above)


def _limits(bounds: Bounds, frame: Array) -> Array:
    """Bounds of the place as half planes (L, 3) seen from a frame."""
    c, s = math.cos(frame[2]), math.sin(frame[2])
    rows = []
    for (n_x, n_y), at, pair in ((c, -s), frame[0], bounds.x), ((s, c), frame[1], bounds.y):
        if pair is not None:
            rows += [[-n_x, -n_y, at - pair[0]], [n_x, n_y, pair[1] - at]]
    return np.array(rows, dtype=np.float64).reshape(-1, 3)


def _inside(edges: Array, first: IntArray, rounding: Array) -> tuple[Solids, Array]:
    """Polygons inside of rounded ones, and what each lacks at most (n,) [m]; all sides stay."""
    rings, lacks = [], []
    for k, radius in enumerate(rounding.tolist()):
        ring, lack = _cut(edges[first[k] : first[k + 1]], radius)
        rings.append((ring, 0.0))
        lacks.append(lack)
    return solids_of(pieces_of(rings)), np.array(lacks, dtype=np.float64)


def _cut(edges: Array, radius: float) -> tuple[Array, float]:
    """Corners of a polygon inside of one that is rounded, and what it lacks at most [m]."""
    corners, normals = edges[:, :2], edges[:, 2:4]
    if radius == 0.0:
        return corners, 0.0
    step = max(math.acos(max(1.0 - FLAT / radius, -1.0)) * 2.0, 2.0 * math.pi / MOST_SIDES)
    if len(corners) == 1:
        count = max(math.ceil(2.0 * math.pi / step), 3)
        angles = np.arange(count) * 2.0 * math.pi / count
        around = radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        return corners + around, radius * (1.0 - math.cos(math.pi / count))
    ring, widest = [], 0.0
    for corner, before, after in zip(corners, normals, np.roll(normals, -1, axis=0), strict=True):
        begin = math.atan2(before[1], before[0])
        cross = before[0] * after[1] - before[1] * after[0]
        turn = math.atan2(cross, float(before @ after)) % (2.0 * math.pi)
        turn = turn if turn < 1.5 * math.pi else 0.0  # rounding: sides in one line
        count = max(math.ceil(turn / step), 1)
        widest = max(widest, turn / count)
        angles = begin + turn * np.arange(count + 1) / count
        ring.append(corner + radius * np.stack([np.cos(angles), np.sin(angles)], axis=1))
    return np.concatenate(ring), radius * (1.0 - math.cos(0.5 * widest))


ON_EDGE = 1e-7  # of a cell's size: a pose this near to a neighbour lies in it too
JUDGED = 20_000  # cells between two looks at the clock
MOST_BOXED = 12_000_000  # nodes of the box around the cells of one level

Index = tuple[int, int, int]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PoseCells:
    """Cells [i, i + 1] x [j, j + 1] x [k, k + 1] times their sizes, seen from a goal.

    The goal is the node (0, 0, 0), in the scene's frame. Nodes of a coarser level are nodes of the
    next one, whose cells have half the size.
    """

    size: float  # [m]
    headings: int  # cells around a whole turn
    low: IntArray  # (3,) first cell in x, y and heading
    active: NDArray[np.uint8]  # (I, J, K) 0: no plan visits it, 1: one may, 2: it is free as well
    round_trip: bool  # whether the headings are a whole turn

    @property
    def turn(self) -> float:
        """Size of a cell in heading [rad]."""
        return 2.0 * math.pi / self.headings

    @property
    def nodes(self) -> tuple[int, int, int]:
        """Nodes in each direction; the last layer of a whole turn is the first one again."""
        i, j, k = self.active.shape
        return i + 1, j + 1, k + 1

    @property
    def columns(self) -> IntArray:
        """Columns (C, 4) of active cells: i, j, first k, number."""
        shape = self.active.shape
        padded = np.zeros((*shape[:2], shape[2] + 2), dtype=np.int8)
        padded[..., 1:-1] = self.active > 0
        steps = np.diff(padded, axis=2)
        begins, ends = np.argwhere(steps == 1), np.argwhere(steps == -1)
        counts = ends[:, 2:] - begins[:, 2:]
        return np.hstack([begins, counts])

    @property
    def layers(self) -> Array:
        """Headings (K + 1,) of the layers of nodes [rad], in the scene's frame."""
        layers: Array = (self.low[2] + np.arange(self.active.shape[2] + 1)) * self.turn
        return layers

    def coordinates(self, pose: Array) -> Array:
        """Place (3,) of a pose in the scene's frame, in cells from the first node."""
        at = np.asarray(pose[:3]) / (self.size, self.size, self.turn) - self.low
        if self.round_trip:
            at[2] %= self.headings
        else:
            middle = 0.5 * self.active.shape[2]
            at[2] = math.remainder(at[2] - middle, self.headings) + middle
        return np.asarray(at, dtype=np.float64)

    def around(self, at: Array, reach: tuple[float, float]) -> list[Index]:
        """Cells within a reach in place and heading of coordinates, in cells."""
        ranges = []
        for axis, beside in enumerate((reach[0], reach[0], reach[1])):
            low = math.floor(at[axis] - beside - ON_EDGE)
            high = math.floor(at[axis] + beside + ON_EDGE)
            within = list(range(low, high + 1))
            if axis == 2:  # in an opened circle, too, both ends may be near
                turns = range(low, min(high, low + self.headings) + 1)
                within = sorted({k % self.headings for k in turns})
            ranges.append([k for k in within if 0 <= k < self.active.shape[axis]])
        return [(i, j, k) for i in ranges[0] for j in ranges[1] for k in ranges[2]]

    def corners(self, at: Array) -> tuple[list[Index], Array]:
        """The eight nodes of a cell that holds coordinates, and their weights (8,)."""
        limits = np.array(self.active.shape) - 1
        cell = np.clip(np.floor(at + 1e-9).astype(np.int64), 0, limits)
        inside = at - cell
        nodes, weights = [], []
        for corner in range(8):
            bits = np.array([corner & 1, (corner >> 1) & 1, corner >> 2])
            nodes.append(tuple(int(n) for n in cell + bits))
            weights.append(float(np.prod(np.where(bits, inside, 1.0 - inside))))
        return nodes, np.array(weights)  # type: ignore[return-value]

    def value_at(self, value: Array, at: Array) -> float:
        """Least value over the gears at coordinates, of a function (gears, nodes)."""
        nodes, weights = self.corners(at)
        return float(
            min(sum(w * one[n] for n, w in zip(nodes, weights, strict=True)) for one in value)
        )


def first_cells(
    scene: PoseScene,
    *,
    size: float,
    headings: int,
    box: Array,
    over: Callable[[], bool] = lambda: False,
) -> PoseCells:
    """All cells of a rectangle (4,) of places, and of all headings, that a plan may visit."""
    low = np.floor(box[:2] / size).astype(np.int64)
    high = np.maximum(np.ceil(box[2:] / size).astype(np.int64), low + 1)
    shape = (*(high - low).tolist(), headings)
    cells = PoseCells(
        size=size,
        headings=headings,
        low=np.array([low[0], low[1], 0]),
        active=np.ones(shape, dtype=np.uint8),
        round_trip=True,
    )
    return _classified(cells, scene, over)


def finer(
    cells: PoseCells,
    kept: NDArray[np.bool_],
    scene: PoseScene,
    over: Callable[[], bool] = lambda: False,
) -> PoseCells | None:
    """Halves of the cells that are kept; None if there are none left, or too many to hold."""
    active = np.where(kept, cells.active, 0).astype(np.uint8)
    low = cells.low
    used = np.flatnonzero(active.any(axis=(0, 1)))
    if not used.size:
        return None
    round_trip = cells.round_trip
    if round_trip:
        gaps = np.diff(np.append(used, used[0] + cells.headings))
        if gaps.max() > 2:  # the circle is opened where no plan has a heading
            first = int(used[(int(gaps.argmax()) + 1) % used.size])
            active = np.roll(active, -first, axis=2)
            shift = first if first <= cells.headings // 2 else first - cells.headings
            low, round_trip = low + np.array([0, 0, shift]), False
    occupied = np.argwhere(active)
    begin, end = occupied.min(axis=0), occupied.max(axis=0) + 1
    if round_trip:
        begin[2], end[2] = 0, cells.headings
    if 8 * int(np.prod(end - begin)) > MOST_BOXED:
        return None
    part = active[begin[0] : end[0], begin[1] : end[1], begin[2] : end[2]]
    halves = part.repeat(2, axis=0).repeat(2, axis=1).repeat(2, axis=2)
    halved = PoseCells(
        size=0.5 * cells.size,
        headings=2 * cells.headings,
        low=2 * (low + begin),
        active=halves,
        round_trip=round_trip,
    )
    return _classified(halved, scene, over)


def _classified(cells: PoseCells, scene: PoseScene, over: Callable[[], bool]) -> PoseCells:
    """Without the cells all of whose poses collide, as far as there is time to judge them."""
    unknown = np.argwhere(cells.active == 1)
    half = 0.5 * np.array([cells.size, cells.size, cells.turn])
    boxes = np.empty((len(unknown), 6))
    boxes[:, :3] = (unknown + cells.low) * (2.0 * half) + half
    boxes[:, 3:] = half
    for at in range(0, len(boxes), JUDGED):
        if over():  # a cell that is not judged may be visited
            break
        part = slice(at, at + JUDGED)
        cells.active[tuple(unknown[part].T)] = scene.states(boxes[part])
    return cells


def connected(cells: PoseCells, seeds: list[Index]) -> NDArray[np.bool_]:
    """Active cells that hang together with the seeds, by faces, edges or corners."""
    seen = np.zeros_like(cells.active)
    stack = np.empty(cells.active.size + len(seeds), dtype=np.int64)
    found = 0
    for seed in seeds:
        if cells.active[seed] and not seen[seed]:
            seen[seed] = 1
            stack[found] = np.ravel_multi_index(seed, cells.active.shape)
            found += 1
    _kernels_certificate.connected(cells.active, seen, stack, found, cells.round_trip)
    return seen.astype(bool)


def on_finer(cells: PoseCells, halved: PoseCells, value: Array) -> Array:
    """A function (gears, nodes) of a level at the nodes of the next one; it stays the same."""
    for axis in range(3):
        at = (np.arange(halved.nodes[axis]) + halved.low[axis]) * 0.5 - cells.low[axis]
        count = cells.nodes[axis]
        if axis == 2 and cells.round_trip:
            at %= cells.headings
        low = np.clip(np.floor(at).astype(np.int64), 0, count - 1)
        high = np.clip(low + 1, 0, count - 1)
        share = (at - low).reshape([-1 if axis == a else 1 for a in range(3)])
        value = (
            np.take(value, low, axis + 1) * (1.0 - share) + np.take(value, high, axis + 1) * share
        )
    return value


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class CostToGo:
    """What plans cost at least from poses of some cells to the goals: costs are lower bounds.

    A plan that stays in the cells costs at least what the
    value falls by; one that leaves them has to leave them somewhere, at a cost of its own.
    """

    world: World  # in whose frame the cells are counted
    cells: PoseCells
    value: Array  # (gears, nodes), falls along no motion faster than the cost rises
    at_goal: float  # greatest value at a goal
    start: Array  # (3,) the pose it was proven for, in that frame
    least: float  # cost of any plan from there
    limit: float  # cost of any plan from there that leaves the cells
    goals: tuple[Goal, ...]  # in that frame
    speed: float  # greatest distance for a unit of cost [m]
    priced: bool  # whether changes between forward and reverse cost something
    whole: bool  # whether the cells are all that may be free in a rectangle

    def after(self, pose: Array, driven: float) -> float:
        """Bound from a pose (3,) that was reached from the one it was proven for at a cost.

        The way to there and a plan from there make one plan together, unless changes of direction
        are priced: there may be one between them.
        """
        inside = self._inside(self.world.into(pose))
        return max(self.least - driven, min(inside, self.limit - driven))

    def anywhere(self, pose: Array) -> float:
        """Bound from any pose (3,), 0 if nothing is known of it."""
        seen = self.world.into(pose)
        if np.array_equal(seen, self.start):
            return self.after(pose, 0.0)
        return min(self._inside(seen), self._outside(seen)) if self.whole else 0.0

    def _inside(self, pose: Array) -> float:
        """Cost of plans that stay in the cells, at least; 0 outside of them."""
        at = self.cells.coordinates(pose)
        shape = np.array(self.cells.active.shape)
        cell = np.floor(at).astype(np.int64)
        if (cell < 0).any() or (cell >= shape).any() or not self.cells.active[tuple(cell)]:
            return 0.0
        return max(self.cells.value_at(self.value, at) - self.at_goal, 0.0)

    def _outside(self, pose: Array) -> float:
        """Cost of plans that leave the rectangle and come back, at least."""
        low = self.cells.low[:2] * self.cells.size
        high = low + np.array(self.cells.active.shape[:2]) * self.cells.size
        least = math.inf
        for goal in self.goals:
            for axis in (0, 1):
                across = abs(pose[1 - axis] - goal.pose[1 - axis])
                for side in (low[axis], high[axis]):
                    along = abs(pose[axis] - side) + abs(goal.pose[axis] - side)
                    least = min(least, math.hypot(along, across) - goal.tolerance_m)
        return max(least, 0.0) / self.speed

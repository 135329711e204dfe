"""OMPL 2 on the same problems: Reeds-Shepp space, and a compiled test of the same footprint.

``pip install ompl``; ``python benchmarks/peers.py`` times the test itself. BIT* and RRT*
publish only when `solve` returns, so they are called in short slices. A motion is sampled every
0.1 m; lengths are sums of Reeds-Shepp lengths, so that nothing is lost at a cusp. OMPL runs in a
process of its own: on rare occasions it ends with a segmentation fault.
"""

from __future__ import annotations

import argparse
import importlib.util
import itertools
import math
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks import apart
from maneuver_automaton._compile import inner_kernel, kernel
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.collision import Obstacle, OccupancyMap, Polygon, Shape
from maneuver_automaton.problem import Problem
from tests.scenes import room_queries
from tests.solids import Rounded, World, map_boxes

PLANNERS = ("RRTConnect", "BITstar", "RRTstar")
MOTION_STEP = 0.1  # [m] between states that a motion is tested at
SLICES = ((0.1, 0.005), (1.0, 0.02), (math.inf, 0.1))  # [s] until then, slices of this length
CHECK_STEP = 0.05  # [m] between poses at which a finished path is checked
ATTEMPTS = 3
START_UP = 120.0  # [s] that a process may take to be ready
CUSP_STEP = 0.01  # [m] between poses from which cusps are counted


def available() -> bool:
    """Whether OMPL is installed; a sentence is printed if not."""
    if importlib.util.find_spec("ompl") is not None:
        return True
    print("OMPL is not installed (pip install ompl): its side is left out")
    return False


@dataclass(frozen=True, slots=True, eq=False)
class PeerRun:
    """What one planner of OMPL did with one query."""

    planner: str
    first_s: float  # inf without a path
    improvements: tuple[tuple[float, float], ...]  # seconds, length [m]
    direction_changes: int
    terminal_m: float
    terminal_rad: float
    valid: bool  # no pose of it, every 5 cm, overlaps an obstacle

    def cost_at(self, seconds: float) -> float:
        """Length [m] of the best path known after `seconds`, inf if there was none."""
        return min((cost for at, cost in self.improvements if at <= seconds), default=math.inf)

    @property
    def cost(self) -> float:
        return self.cost_at(math.inf)


def turning_radius(automaton: Automaton) -> float:
    """Radius [m] of the tightest circle of the trims that drive."""
    twists = automaton.body_velocities
    speeds, turns = np.abs(twists[:, 0]), np.abs(twists[:, 2])
    return float((speeds / np.maximum(turns, 1e-12))[(speeds > 0.0) & (turns > 0.0)].min())


def solve(
    problem: Problem, planner: str, *, time_limit: float, radius: float | None = None
) -> PeerRun:
    """One planner on the first goal of `problem`; the clock runs from a prepared world.

    Parameters
    ----------
    problem : Problem
    planner : str
        One of `PLANNERS`.
    time_limit : float
        [s] of wall time.
    radius : float, optional
        Least turning radius [m], that of the library if omitted.

    Returns
    -------
    PeerRun
        Without a path also if OMPL crashed at every attempt; a line is printed for each.
    """
    for _ in range(ATTEMPTS):
        try:
            run: PeerRun = apart.call(
                _solve, problem, planner, time_limit, radius, patience=START_UP + 2.0 * time_limit
            )
            return run
        except apart.Lost as lost:
            print(f"OMPL's {planner} {lost}; it is started again", flush=True)
    return _without_path(planner)


def _without_path(planner: str) -> PeerRun:
    return PeerRun(planner, math.inf, (), 0, math.nan, math.nan, valid=False)


def _solve(problem: Problem, planner: str, time_limit: float, radius: float | None) -> PeerRun:
    from ompl import base, geometric, util

    util.setLogLevel(util.LOG_NONE)
    space = base.ReedsSheppStateSpace(radius or turning_radius(problem.automaton))
    space.setBounds(_bounds(problem))
    free, packed = is_free, packed_world(problem)
    free(0.0, 0.0, 0.0, packed)  # compiled before the clock starts
    began = time.perf_counter()
    information = base.SpaceInformation(space)
    information.setStateValidityChecker(
        lambda state: free(state.getX(), state.getY(), state.getYaw(), packed)
    )
    resolution = MOTION_STEP / information.getMaximumExtent()
    information.setStateValidityCheckingResolution(resolution)
    information.setup()
    task = base.ProblemDefinition(information)
    start, goal = (_state(space, pose) for pose in (problem.start, problem.goals[0].pose))
    task.setStartAndGoalStates(start, goal, 1e-9)
    task.setOptimizationObjective(base.PathLengthOptimizationObjective(information))
    method = getattr(geometric, planner)(information)
    method.setProblemDefinition(task)
    method.setup()
    improvements = _anytime(method, task, began, time_limit, once=planner == "RRTConnect")
    if not improvements:
        return _without_path(planner)
    poses, changes = _walked(space, task.getSolutionPath())
    world = World(problem)
    relative = poses - np.append(world.origin, 0.0)
    off = poses[-1] - problem.goals[0].pose
    return PeerRun(
        planner=planner,
        first_s=improvements[0][0],
        improvements=tuple(improvements),
        direction_changes=changes,
        terminal_m=float(np.hypot(off[0], off[1])),
        terminal_rad=abs(math.remainder(float(off[2]), 2.0 * math.pi)),
        valid=bool(world.clearance(relative).min() > 0.0),
    )


def _anytime(method, task, began: float, time_limit: float, *, once: bool):
    """Seconds and lengths, each shorter than the last, as the slices return them."""
    found: list[tuple[float, float]] = []
    now = time.perf_counter() - began
    while now < time_limit and not (once and found):
        piece = next(length for until, length in SLICES if now < until)
        method.solve(min(time_limit - now if once else piece, time_limit - now))
        now = time.perf_counter() - began
        if task.hasExactSolution():
            length = task.getSolutionPath().length()
            if not found or length < found[-1][1] - 1e-9:
                found.append((now, length))
    return found


def _walked(space, path) -> tuple[np.ndarray, int]:
    """Poses (n, 3) along a path, closer than the check asks, and its changes of direction."""
    states = path.getStates()
    rows = []
    between = space.allocState()
    for one, other in itertools.pairwise(states):
        n = max(1, math.ceil(space.distance(one, other) / CUSP_STEP))
        for k in range(n + 1):
            space.interpolate(one, other, k / n, between)
            rows.append((between.getX(), between.getY(), between.getYaw()))
    poses = np.array(rows)
    steps = np.diff(poses[:, :2], axis=0)
    turns = np.remainder(np.diff(poses[:, 2]) + np.pi, 2 * np.pi) - np.pi
    middle = poses[:-1, 2] + 0.5 * turns
    ahead = steps[:, 0] * np.cos(middle) + steps[:, 1] * np.sin(middle)
    signs = np.sign(ahead[np.abs(ahead) > 1e-6])
    every = max(1, int(CHECK_STEP / CUSP_STEP))
    kept = np.append(poses[:-1:every], poses[-1:], axis=0)
    return kept, int((np.diff(signs) != 0.0).sum())


def _state(space, pose: np.ndarray):
    state = space.allocState()
    state.setXY(float(pose[0]), float(pose[1]))
    state.setYaw(math.remainder(float(pose[2]), 2.0 * math.pi))
    return state


def _bounds(problem: Problem):
    """The problem's bounds, or the rectangle around all obstacles and both ends."""
    from ompl import base

    ends = np.array([problem.start[:2], problem.goals[0].pose[:2]])
    corners = np.concatenate([ends, *(_pieces(problem)[0])])
    bounds = base.RealVectorBounds(2)
    for axis, pair in enumerate((problem.bounds.x, problem.bounds.y)):
        low, high = pair or (float(corners[:, axis].min()), float(corners[:, axis].max()))
        bounds.setLow(axis, low)
        bounds.setHigh(axis, high)
    return bounds


# The test of a footprint: convex pieces in square buckets, and separating axes.
# A shape is [n, radius, middle x, y, reach, corners ...]; a disc has one corner and a radius.
HEADER = 9  # parts, shapes, buckets at; left, low, 1 / size, columns, rows; most corners


def packed_world(problem: Problem) -> np.ndarray:
    """Footprint, obstacles and their buckets in one row of numbers, which is quick to hand over."""
    parts = [piece for shape in problem.footprint for piece in _convex(shape)]
    rings, radii = _pieces(problem)
    records = [_record(np.zeros((1, 2)), 0.0)] if not parts else [_record(*p) for p in parts]
    body = np.concatenate([[len(records)], *records])
    shapes = [_record(ring, radius) for ring, radius in zip(rings, radii, strict=True)]
    places = np.cumsum([0, *(len(shape) for shape in shapes)])
    low, high = _extents(rings, radii)
    size = max(1.0, math.sqrt(float(np.prod(high.max(0) - low.min(0))) / 40_000.0))
    left, bottom = low.min(axis=0) - 1e-9
    columns, rows = (np.ceil((high.max(0) - [left, bottom]) / size).astype(int) + 1).tolist()
    buckets: list[list[int]] = [[] for _ in range(columns * rows)]
    for place, lowest, highest in zip(places, low, high, strict=False):
        (i0, j0), (i1, j1) = (
            np.floor((corner - [left, bottom]) / size).astype(int).tolist()
            for corner in (lowest, highest)
        )
        for j in range(j0, j1 + 1):
            for i in range(i0, i1 + 1):
                buckets[j * columns + i].append(int(place))
    shapes_at = HEADER + len(body)
    buckets_at = shapes_at + int(places[-1])
    table = np.cumsum([0, *(len(bucket) for bucket in buckets)])
    header = [HEADER, shapes_at, buckets_at, left, bottom, 1.0 / size, columns, rows]
    header.append(max(record[0] for record in records))
    content = [float(place) for bucket in buckets for place in bucket]
    return np.concatenate([header, body, *shapes, table, content]).astype(float)


def _pieces(problem: Problem) -> tuple[list[np.ndarray], list[float]]:
    """Corners and radii of convex pieces of all static obstacles."""
    pieces: list[tuple[np.ndarray, float]] = []
    for obstacle in problem.obstacles:
        if isinstance(obstacle, OccupancyMap):
            pieces += [(box, 0.0) for box in map_boxes(obstacle)]
        elif isinstance(obstacle, Obstacle):
            pieces += _convex(obstacle.shape)
    return [ring for ring, _ in pieces], [radius for _, radius in pieces]


def _convex(shape: Shape) -> list[tuple[np.ndarray, float]]:
    """Corners (n, 2) and radius of convex pieces of a shape."""
    rounded = Rounded.of(shape)
    if not isinstance(shape, Polygon):
        return [(rounded.corners, rounded.radius)]
    solid = shapely.Polygon(shape.corners, shape.holes)
    if solid.convex_hull.area - solid.area <= 1e-12 * solid.convex_hull.area:
        return [(shapely.get_coordinates(shapely.normalize(solid.convex_hull))[:-1], 0.0)]
    triangles = shapely.constrained_delaunay_triangles(solid)
    return [(shapely.get_coordinates(piece)[:-1], 0.0) for piece in triangles.geoms]


def _record(corners: np.ndarray, radius: float) -> np.ndarray:
    middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    reach = float(np.hypot(*(corners - middle).T).max()) + radius
    return np.concatenate([[len(corners), radius, *middle, reach], corners.ravel()])


def _extents(rings: Sequence[np.ndarray], radii: Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest corner (n, 2) of shapes; a unit square if there are none."""
    if not rings:
        return np.zeros((1, 2)), np.ones((1, 2))
    low = [ring.min(axis=0) - radius for ring, radius in zip(rings, radii, strict=True)]
    high = [ring.max(axis=0) + radius for ring, radius in zip(rings, radii, strict=True)]
    return np.array(low), np.array(high)


@kernel
def is_free(x, y, yaw, world):
    """Whether the footprint overlaps nothing at a pose."""
    shapes_at, buckets_at = int(world[1]), int(world[2])
    left, low, per_size = world[3], world[4], world[5]
    columns, rows = int(world[6]), int(world[7])
    content_at = buckets_at + columns * rows + 1
    cos, sin = math.cos(yaw), math.sin(yaw)
    moved = np.empty((int(world[8]), 2))
    part = int(world[0]) + 1
    for _ in range(int(world[int(world[0])])):
        n, radius, reach = int(world[part]), world[part + 1], world[part + 4]
        mx, my = world[part + 2], world[part + 3]
        middle_x, middle_y = x + cos * mx - sin * my, y + sin * mx + cos * my
        for k in range(n):
            px, py = world[part + 5 + 2 * k], world[part + 6 + 2 * k]
            moved[k, 0], moved[k, 1] = x + cos * px - sin * py, y + sin * px + cos * py
        first_i = max(0, int((moved[:n, 0].min() - radius - left) * per_size))
        last_i = min(columns - 1, int((moved[:n, 0].max() + radius - left) * per_size))
        first_j = max(0, int((moved[:n, 1].min() - radius - low) * per_size))
        last_j = min(rows - 1, int((moved[:n, 1].max() + radius - low) * per_size))
        for j in range(first_j, last_j + 1):
            for i in range(first_i, last_i + 1):
                bucket = buckets_at + j * columns + i
                for e in range(int(world[bucket]), int(world[bucket + 1])):
                    shape = shapes_at + int(world[content_at + e])
                    far = reach + world[shape + 4]
                    dx, dy = middle_x - world[shape + 2], middle_y - world[shape + 3]
                    if dx * dx + dy * dy > far * far:
                        continue
                    if not _apart(moved, n, radius, world, shape):
                        return False
        part += 5 + 2 * n
    return True


@inner_kernel
def _apart(moved, n, radius, world, shape):
    """Whether an axis separates a convex part (n corners of `moved`) from a convex shape."""
    m, kept = int(world[shape]), radius + world[shape + 1]
    corners = world[shape + 5 : shape + 5 + 2 * m].reshape(m, 2)
    for side in range(2):
        count = n if side == 0 else m
        if count == 1:
            continue
        for k in range(count):
            after = k + 1 if k + 1 < count else 0
            if side == 0:
                ax, ay = moved[k, 1] - moved[after, 1], moved[after, 0] - moved[k, 0]
            else:
                ax, ay = corners[k, 1] - corners[after, 1], corners[after, 0] - corners[k, 0]
            if _axis_clearance(moved, n, corners, m, ax, ay) > kept:
                return True
    if n > 1 and m > 1:
        return False
    # A disc is nearest along an edge's normal, seen above, or to a corner.
    best, ax, ay = math.inf, 1.0, 0.0
    for k in range(n):
        for i in range(m):
            dx, dy = moved[k, 0] - corners[i, 0], moved[k, 1] - corners[i, 1]
            if dx * dx + dy * dy < best:
                best, ax, ay = dx * dx + dy * dy, dx, dy
    return _axis_clearance(moved, n, corners, m, ax, ay) > kept


@inner_kernel
def _axis_clearance(moved, n, corners, m, ax, ay):
    """Clearance between two sets of corners seen along an axis, negative where they overlap."""
    length = math.hypot(ax, ay)
    if length == 0.0:
        return -math.inf
    low_a, high_a, low_b, high_b = math.inf, -math.inf, math.inf, -math.inf
    for k in range(n):
        along = (moved[k, 0] * ax + moved[k, 1] * ay) / length
        low_a, high_a = min(low_a, along), max(high_a, along)
    for i in range(m):
        along = (corners[i, 0] * ax + corners[i, 1] * ay) / length
        low_b, high_b = min(low_b, along), max(high_b, along)
    return max(low_a - high_b, low_b - high_a)


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    problem = room_queries(1)[0]
    world, packed = World(problem), packed_world(problem)
    rng = np.random.default_rng(0)
    poses = np.column_stack([rng.uniform(0.0, 30.0, (100_000, 2)), rng.uniform(-4.0, 4.0, 100_000)])
    rows = poses.tolist()
    is_free(0.0, 0.0, 0.0, packed)
    began = time.perf_counter()
    free = [is_free(x, y, yaw, packed) for x, y, yaw in rows]
    micros = 1e6 * (time.perf_counter() - began) / len(rows)
    clearances = world.clearance(poses - np.append(world.origin, 0.0))
    wrong = int(((clearances > 1e-9) != np.array(free)).sum())
    print(f"compiled test: {micros:.2f} us a pose, {np.mean(free):.0%} free, "
          f"{wrong} of {len(rows)} judged otherwise by shapely")  # fmt: skip


if __name__ == "__main__":
    main()

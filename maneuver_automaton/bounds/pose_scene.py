"""The permanent obstacles of a vehicle, as boxes of poses are tested against them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.bounds import _kernels_boxes
from maneuver_automaton.bounds.arrays import PoseArrays
from maneuver_automaton.collision import AnyObstacle
from maneuver_automaton.collision.convex import Solids, pieces_of, solids_of
from maneuver_automaton.collision.layers import always
from maneuver_automaton.collision.world import World, own_frame, world_of
from maneuver_automaton.problem import Bounds, Problem, moves

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
    return PoseScene(world=world, arrays=arrays, turns=_turns(problem, world))


def lasting_obstacles(problem: Problem) -> tuple[AnyObstacle, ...]:
    """Obstacles that never move, and that stand at every altitude within the bounds."""
    obstacles = tuple(one for one in problem.obstacles if not moves(one))
    if problem.start.size == 3:
        return obstacles
    low, high = problem.bounds.z or (-math.inf, math.inf)
    below, above = problem.body_height
    return always(obstacles, low=low + below, high=high + above)


def _turns(problem: Problem, world: World) -> bool:
    """Whether the heading changes and matters: not of a disc around the pose, nor without turns."""
    body = world.body
    if not body.edges[:, :2].any():
        return False
    # With inertia a vehicle turns between its trims, and its library may hold no more than a rest.
    return problem.has_inertia or bool(problem.automaton.body_velocities[:, 2].any())


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

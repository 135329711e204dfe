"""The proof that no plan exists, and where the way is too narrow by how much."""

from __future__ import annotations

import functools
import math
import time
from dataclasses import dataclass

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._kept import kept_by_first
from maneuver_automaton.bounds.connectivity import (
    MOST_BOXES,
    Connection,
    Connectivity,
    connectivity,
)
from maneuver_automaton.bounds.pose_scene import PoseScene, lasting_obstacles, pose_scene
from maneuver_automaton.collision.outline import united
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Goal, Problem

TRIES = 10  # lengths by which obstacles draw back that are tried for the narrowest place ...
MOST_TRIED = 60_000  # ... each with so many boxes
AGREE = 0.08  # share of what is missing to which it is found ...
CLOSE = 5e-4  # [m] ... or this length
ROUGHLY = 0.5  # share by which a length that is said may be too large
FIRST = 0.02  # [m] by which obstacles draw back at first


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
    if not lasting_obstacles(problem):
        return None
    scene, start, goals = _asked(problem)
    known = _proofs(problem)
    proof = (
        known[0]
        if known
        else connectivity(
            scene, start, goals, bounds=problem.bounds, most_boxes=most_boxes, deadline=deadline
        )
    )
    if proof.answer is not Connection.SEPARATED:
        return None
    narrowest = _narrowest(problem, scene, start, goals, deadline)
    return Separation(boxes=proof.boxes, reached=proof.reached, narrowest=narrowest)


def widest_path(
    problem: Problem, *, first: float, most_boxes: int = MOST_BOXES, deadline: float = math.inf
) -> tuple[Connection, Array, float]:
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
    ask = functools.partial(connectivity, scene, start, goals, bounds=problem.bounds)
    found, kept, apart = ask(most_boxes=most_boxes, deadline=deadline), 0.0, first
    _proofs(problem).extend([found] if found.answer is Connection.SEPARATED else [])
    for _ in range(TRIES if found.answer is Connection.CONNECTED else 0):
        if time.monotonic() > deadline or apart - kept <= ROUGHLY * kept / 2.0:
            break
        wider = ask(give=-apart, price=1.0, most_boxes=MOST_TRIED, deadline=deadline)
        if wider.answer is Connection.CONNECTED:
            found, kept, apart = wider, apart, (1.0 + ROUGHLY) * apart
        else:
            apart = 0.5 * (kept + apart)
    return found.answer, found.path, kept


@kept_by_first
def _proofs(problem: Problem) -> list[Connectivity]:
    """Where a search that has met the proof for a problem leaves it for `separation`."""
    del problem
    return []


def goals_blocked(problem: Problem, *, most_boxes: int, deadline: float = math.inf) -> bool:
    """Whether every pose at which a plan may end is proven to collide or to be out of bounds.

    Of all goals, with their tolerances; the proof rests on what that of `separation` rests on.
    """
    scene = pose_scene(problem)
    for goal in problem.goals:
        ends = _box_of(scene, goal)
        proof = connectivity(
            scene, ends, ends, bounds=problem.bounds, most_boxes=most_boxes, deadline=deadline
        )
        if proof.answer is not Connection.SEPARATED:
            return False
    return True


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
    problem: Problem,
    scene: PoseScene,
    start: Array,
    goals: Array,
    deadline: float,
) -> Narrowest | None:
    """The narrowest place: where obstacles must draw back so that there is a way.

    The least length is bisected; a length at which nothing is proven counts as too small.
    """
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
        if tried.answer is Connection.CONNECTED:
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

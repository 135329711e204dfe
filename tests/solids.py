"""Solids by shapely: what a body is clear of, found without the package's own geometry.

A disc is a point with a radius, exact; all else is a polygon. Coordinates are taken relative to
the problem's start, so that nothing is lost far from the origin.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import Disc, Obstacle, OccupancyMap, Polygon, Shape
from maneuver_automaton.problem import Problem


@dataclass(frozen=True, slots=True, eq=False)
class Rounded:
    """Everything within `radius` [m] of rings of corners: a disc has one corner."""

    corners: np.ndarray  # (n, 2) [m]
    holes: tuple[np.ndarray, ...]
    radius: float

    @classmethod
    def of(cls, shape: Shape) -> Rounded:
        if isinstance(shape, Disc):
            return cls(shape.center[None], (), shape.radius)
        holes = shape.holes if isinstance(shape, Polygon) else ()
        return cls(shape.corners, tuple(holes), 0.0)

    def at(self, poses: np.ndarray) -> np.ndarray:
        """Geometries (n,), without the radius, at `poses` (n, 3)."""
        if len(self.corners) == 1:
            return np.asarray(shapely.points(_placed(self.corners, poses)[:, 0]))
        shells = shapely.linearrings(_placed(self.corners, poses))
        holes = [shapely.linearrings(_placed(ring, poses)) for ring in self.holes]
        solids = shapely.polygons(shells, np.stack(holes, axis=-1) if holes else None)
        return np.asarray(shapely.make_valid(solids))


def map_boxes(cells: OccupancyMap) -> np.ndarray:
    """Blocked cells as a few large boxes, corners (n, 4, 2) [m].

    Runs along a row, joined with those of the rows before that begin and end alike.
    """
    size = cells.resolution
    boxes: list[tuple[int, int, int, int]] = []
    open_runs: dict[tuple[int, int], int] = {}
    for row in range(cells.blocked.shape[0] + 1):
        runs = set(_runs(cells.blocked[row])) if row < cells.blocked.shape[0] else set()
        ended = [run for run in open_runs if run not in runs]
        boxes += [(left, open_runs.pop((left, right)), right, row) for left, right in ended]
        for run in runs:
            open_runs.setdefault(run, row)
    corners = np.array([[[a, b], [c, b], [c, d], [a, d]] for a, b, c, d in boxes], dtype=float)
    return _placed(corners.reshape(-1, 2) * size, cells.origin[None])[0].reshape(-1, 4, 2)


def _runs(row: np.ndarray) -> Iterator[tuple[int, int]]:
    """Begin and end of every stretch of blocked cells."""
    padded = np.concatenate([[False], row, [False]]).astype(np.int8)
    edges = np.flatnonzero(np.diff(padded)).tolist()
    return zip(edges[::2], edges[1::2], strict=True)


class World:
    """The obstacles of a problem, relative to its start."""

    def __init__(self, problem: Problem) -> None:
        self.origin = problem.start[:2]
        self.parts = tuple(Rounded.of(shape) for shape in problem.footprint) or (
            Rounded(np.zeros((1, 2)), (), 0.0),
        )
        still = [o for o in problem.obstacles if isinstance(o, Obstacle) and o.motion is None]
        shapes = [Rounded.of(obstacle.shape) for obstacle in still]
        here = -np.append(self.origin, 0.0)[None]
        solids = [shape.at(here)[0] for shape in shapes if not shape.radius]
        for cells in problem.obstacles:
            if isinstance(cells, OccupancyMap):
                solids += list(shapely.polygons(map_boxes(cells) - self.origin))
        self.tree = shapely.STRtree(solids)
        self.discs = [(shape.at(here)[0], shape.radius) for shape in shapes if shape.radius]
        self.moving = [
            (Rounded.of(obstacle.shape), obstacle.motion)
            for obstacle in problem.obstacles
            if isinstance(obstacle, Obstacle) and obstacle.motion is not None
        ]

    def clearance(self, poses: np.ndarray, times: np.ndarray | None = None) -> np.ndarray:
        """Distance (n,) [m] of the body at `poses` (n, 3), relative to the origin, from all else.

        At most 0 where they touch or overlap, inf where there is nothing; moving obstacles are
        where they are at `times` (n,) [s].
        """
        least = np.full(len(poses), np.inf)
        for part in self.parts:
            bodies = part.at(poses)
            distances = [shapely.distance(bodies, center) - radius for center, radius in self.discs]
            if len(self.tree):
                distances.append(self._nearest(bodies))
            if times is not None:
                for shape, motion in self.moving:
                    placed = motion.at(times) - np.append(self.origin, 0.0)
                    distances.append(shapely.distance(bodies, shape.at(placed)) - shape.radius)
            for distance in distances:
                least = np.minimum(least, distance - part.radius)
        return least

    def _nearest(self, bodies: np.ndarray) -> np.ndarray:
        (rows, _), distances = self.tree.query_nearest(
            bodies, return_distance=True, all_matches=False
        )
        every = np.full(len(bodies), np.inf)
        every[rows] = distances
        return every


def clearance_at(problem: Problem, pose: Sequence[float] | np.ndarray) -> float:
    """Distance [m] of the body at one pose from every obstacle, at the problem's start time."""
    world = World(problem)
    relative = np.asarray(pose, dtype=float) - np.append(world.origin, 0.0)
    return float(world.clearance(relative[None], np.array([problem.start_time]))[0])


@dataclass(frozen=True, slots=True)
class PlanCheck:
    """What a second opinion says of a finished plan."""

    clearance_m: float  # least distance from all obstacles, at most 0 in a collision
    outside_m: float  # how far the pose leaves the bounds
    start_m: float  # between the plan's first pose and the problem's start
    terminal_m: float
    terminal_rad: float

    def passes(self, problem: Problem, goal_index: int, *, tolerance: float = 1e-6) -> bool:
        goal = problem.goals[goal_index]
        free = self.clearance_m >= problem.margin - tolerance and self.clearance_m > 0.0
        return (
            free
            and max(self.outside_m, self.start_m) <= tolerance
            and self.terminal_m <= goal.tolerance_m + tolerance
            and self.terminal_rad <= goal.tolerance_rad + tolerance
        )


def check_plan(
    problem: Problem, plan: Plan, goal_index: int, *, step_m: float = 0.01, step_rad: float = 0.01
) -> PlanCheck:
    """Drive `plan` by its twists, sample it closely, and compare with obstacles and bounds."""
    world = World(problem)
    times, poses = driven(plan, world.origin, step_m=step_m, step_rad=step_rad)
    goal = problem.goals[goal_index]
    off = poses[-1] - (goal.pose - np.append(world.origin, 0.0))
    turn = 0.0 if goal.free_heading else abs(np.remainder(off[2] + np.pi, 2 * np.pi) - np.pi)
    return PlanCheck(
        clearance_m=float(world.clearance(poses, times).min()),
        outside_m=float(outside(problem, poses[:, :2] + world.origin).max()),
        start_m=float(np.abs(plan.start - problem.start).max()),
        terminal_m=float(np.hypot(off[0], off[1])),
        terminal_rad=float(turn),
    )


def driven(
    plan: Plan, origin: np.ndarray, *, step_m: float, step_rad: float
) -> tuple[np.ndarray, np.ndarray]:
    """Times (n,) [s] and poses (n, 3) relative to `origin` of a plan, no further apart."""
    place = complex(*(plan.start[:2] - origin))
    heading = float(plan.start[2])
    now = plan.start_time
    times, poses = [np.array([now])], [np.array([[place.real, place.imag, heading]])]
    for trim, duration in zip(plan.trims, plan.durations.tolist(), strict=True):
        v_x, v_y, turn = trim.body_velocity.tolist()
        steps = duration * max(np.hypot(v_x, v_y) / step_m, abs(turn) / step_rad, 1.0 / 0.05)
        since = np.linspace(0.0, duration, 2 + int(steps))[1:]
        chord = np.exp(0.5j * turn * since) * np.sinc(0.5 * turn * since / np.pi) * since
        places = place + np.exp(1j * heading) * complex(v_x, v_y) * chord
        headings = heading + turn * since
        times.append(now + since)
        poses.append(np.stack([places.real, places.imag, headings], axis=-1))
        place, heading, now = complex(places[-1]), float(headings[-1]), now + duration
    return np.concatenate(times), np.concatenate(poses)


def outside(problem: Problem, places: np.ndarray) -> np.ndarray:
    """How far (n,) [m] places (n, 2) lie outside the problem's bounds, 0 inside."""
    off = np.zeros(len(places))
    for axis, pair in enumerate((problem.bounds.x, problem.bounds.y)):
        if pair is not None:
            beyond = np.maximum(pair[0] - places[:, axis], places[:, axis] - pair[1])
            off = np.maximum(off, beyond)
    return off


def _placed(points: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """Points (k, 2) carried to poses (n, 3): (n, k, 2)."""
    cos, sin = np.cos(poses[:, 2, None]), np.sin(poses[:, 2, None])
    x = poses[:, 0, None] + cos * points[:, 0] - sin * points[:, 1]
    y = poses[:, 1, None] + sin * points[:, 0] + cos * points[:, 1]
    return np.stack([x, y], axis=-1)

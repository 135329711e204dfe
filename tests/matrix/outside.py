"""What a plan does, measured without the package: its samples, shapely, and plain arithmetic."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import AnyObstacle, Box, Disc, OccupancyMap, Polygon, Shape
from maneuver_automaton.problem import Bounds, Goal

ROUND = 32  # segments of a quarter of a disc


@dataclass(frozen=True, eq=False)
class Course:
    """Samples of a plan: times [s], poses (n, 3 or 4), reduced states, controls."""

    time: np.ndarray
    pose: np.ndarray
    state: np.ndarray
    control: np.ndarray

    @classmethod
    def of(cls, plan: Plan, *, step_m: float = 0.05, step_rad: float = 0.02) -> Course:
        """Samples of a plan, closer than both steps."""
        samples = plan.sample(max_step_m=step_m, max_step_rad=step_rad)
        return cls(samples.time, samples.pose, samples.reduced_state, samples.control)

    @property
    def flat(self) -> np.ndarray:
        """Planar poses (n, 3); the heading is zero where there is none."""
        return flat(self.pose)

    @property
    def duration(self) -> float:
        return float(self.time[-1] - self.time[0])

    @property
    def ways(self) -> np.ndarray:
        """Length (n - 1,) of every step [m], climbs included."""
        places = [0, 1, *range(3, self.pose.shape[1])]
        return np.linalg.norm(np.diff(self.pose[:, places], axis=0), axis=1)

    @property
    def length(self) -> float:
        return float(self.ways.sum())

    @property
    def lasting(self) -> np.ndarray:
        return np.diff(self.time)

    @property
    def effort(self) -> float:
        """Integral of the squared norm of the control."""
        return float(self.lasting @ (self.control[:-1] ** 2).sum(axis=1))

    @property
    def norm(self) -> float:
        """Integral of the norm of the control."""
        return float(self.lasting @ np.linalg.norm(self.control[:-1], axis=1))

    @property
    def forward(self) -> np.ndarray:
        """Speed (n - 1,) along the body's own axis, by differences [m/s]; NaN where no time is."""
        step = np.diff(self.pose[:, :2], axis=0)
        middle = (self.flat[1:, 2] + self.flat[:-1, 2]) / 2.0
        along = step[:, 0] * np.cos(middle) + step[:, 1] * np.sin(middle)
        return _ratio(along, self.lasting)

    @property
    def speed(self) -> np.ndarray:
        """Speed (n - 1,) in the plane, by differences [m/s]; NaN where no time passes."""
        return _ratio(np.linalg.norm(np.diff(self.pose[:, :2], axis=0), axis=1), self.lasting)

    def changes_of_direction(self, *, slow: float) -> int:
        """How often it turns from forward to reverse or back; below `slow` [m/s] it is neither."""
        speed = self.forward
        driving = np.sign(speed[np.abs(speed) > slow])
        return int(np.count_nonzero(np.diff(driving)))


def _ratio(way: np.ndarray, time: np.ndarray) -> np.ndarray:
    lasting = time > 1e-12
    return np.where(lasting, way / np.where(lasting, time, 1.0), np.nan)


def flat(pose: np.ndarray) -> np.ndarray:
    """Planar poses (..., 3) of poses, or of twists: zero turns where there are none."""
    if pose.shape[-1] > 2:
        return pose[..., :3]
    return np.concatenate([pose, np.zeros((*pose.shape[:-1], 1))], axis=-1)


def solid(shape: Shape) -> shapely.Geometry:
    """A shape as shapely has it; a disc as a polygon around it."""
    if isinstance(shape, Disc):
        outside = shape.radius / math.cos(math.pi / (4 * ROUND))
        return shapely.Point(shape.center).buffer(outside, quad_segs=ROUND)
    if isinstance(shape, Box):
        length, width = shape.size / 2.0
        corners = np.array([[-length, -width], [length, -width], [length, width], [-length, width]])
        return shapely.Polygon(_placed(corners, np.append(shape.center, shape.heading)))
    assert isinstance(shape, Polygon)
    return shapely.Polygon(shape.corners, [np.asarray(hole) for hole in shape.holes])


def _placed(points: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Points (m, 2) of a body at poses (..., 3): (..., m, 2)."""
    cos, sin = np.cos(pose[..., 2])[..., None], np.sin(pose[..., 2])[..., None]
    x = pose[..., 0, None] + cos * points[:, 0] - sin * points[:, 1]
    y = pose[..., 1, None] + sin * points[:, 0] + cos * points[:, 1]
    return np.stack([x, y], axis=-1)


def bodies(
    course: Course,
    footprint: Sequence[Shape],
    parts: Mapping[str, Sequence[Shape]] | None = None,
    *,
    hitch_length: float = 0.0,
) -> np.ndarray:
    """Geometries (n, shapes) of the body along a course, its trailer included.

    A trailer's axle is `hitch_length` [m] behind the vehicle's, its heading less by the first
    component of the reduced state.
    """
    columns = [_along(shape, course.flat) for shape in footprint]
    for shapes in (parts or {}).values():
        heading = course.flat[:, 2] - course.state[:, 0]
        behind = hitch_length * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
        frames = np.column_stack([course.pose[:, :2] - behind, heading])
        columns += [_along(shape, frames) for shape in shapes]
    return np.stack(columns, axis=-1)


def _along(shape: Shape, poses: np.ndarray) -> np.ndarray:
    ring = np.asarray(shapely.get_coordinates(solid(shape).exterior))[:-1]
    return np.asarray(shapely.polygons(_placed(ring, poses)))


def clearances(
    course: Course,
    around: np.ndarray,
    obstacles: Sequence[AnyObstacle],
    *,
    body_height: tuple[float, float] = (0.0, 0.0),
) -> np.ndarray:
    """Least distance (n,) [m] of a body `around` its poses (n, shapes) to obstacles.

    Zero where they overlap, infinite without obstacles; one at another height is none.
    """
    least = np.full(len(course.time), np.inf)
    for obstacle in obstacles:
        if isinstance(obstacle, OccupancyMap):
            least = np.minimum(least, _nearest(around, _blocked(obstacle)))
            continue
        if obstacle.motion is None:
            gap = _nearest(around, solid(obstacle.shape))
        else:
            place = [
                np.interp(course.time, obstacle.motion.time, obstacle.motion.pose[:, k])
                for k in range(3)
            ]
            moving = _along(obstacle.shape, np.stack(place, axis=-1))
            gap = shapely.distance(around, moving[:, None]).min(axis=1)
        if obstacle.height is not None:
            low, high = obstacle.height
            z = course.pose[:, 3] if course.pose.shape[1] > 3 else 0.0
            apart = (z + body_height[0] > high) | (z + body_height[1] < low)
            gap = np.where(apart, np.inf, gap)
        least = np.minimum(least, gap)
    return least


def _nearest(around: np.ndarray, thing: shapely.Geometry) -> np.ndarray:
    return np.asarray(shapely.distance(around, thing).min(axis=1))


def _blocked(cells: OccupancyMap) -> shapely.Geometry:
    """Blocked cells of a map as one geometry."""
    size = cells.resolution
    corner = np.array([[0.0, 0.0], [size, 0.0], [size, size], [0.0, size]])
    squares = [
        shapely.Polygon(_placed(corner + size * np.array([column, row]), cells.origin))
        for row, column in np.argwhere(cells.blocked)
    ]
    return shapely.union_all(squares)


def inside(around: np.ndarray, shape: Shape, *, depth: float = 0.0) -> np.ndarray:
    """Whether any part of a body (n, shapes) is in a shape, by more than `depth` [m]: (n,)."""
    zone = solid(shape)
    zone = zone.buffer(-depth) if depth else zone
    return np.asarray(shapely.intersects(around, zone).any(axis=1))


def outside_bounds(course: Course, bounds: Bounds) -> float:
    """How far the poses are out of the bounds [m], at most."""
    worst = -math.inf
    for name, k in (("x", 0), ("y", 1), ("z", 3)):
        pair = getattr(bounds, name)
        if pair is not None:
            worst = max(worst, pair[0] - course.pose[:, k].min(), course.pose[:, k].max() - pair[1])
    return worst


def off_goal(pose: np.ndarray, goal: Goal) -> tuple[float, float]:
    """Distance [m] and difference of headings modulo a turn [rad] between a pose and a goal."""
    places = [0, 1, *range(3, len(pose))]
    turn = math.remainder(float(flat(pose)[2] - flat(goal.pose)[2]), 2.0 * math.pi)
    return float(np.linalg.norm((pose - goal.pose)[places])), abs(turn)


def apart(one: Plan, other: Plan, *, samples: int = 400) -> float:
    """How far two motions are apart at most [m or rad]: at equal times, from their starts."""
    times = np.linspace(0.0, max(one.duration, other.duration), samples)
    a, b = one.pose_at(one.start_time + times), other.pose_at(other.start_time + times)
    return float(np.abs(a - b).max())


def repeated(plans: Sequence[Plan], *, tolerance: float) -> Iterator[tuple[int, int]]:
    """Pairs of plans that are the same motion, to within a tolerance [m or rad]."""
    for i, one in enumerate(plans):
        for j in range(i + 1, len(plans)):
            if apart(one, plans[j]) <= tolerance:
                yield i, j


def moved(pose: np.ndarray, by: np.ndarray) -> np.ndarray:
    """Poses (..., 3 or 4) moved by a motion (3 or 4,) of the plane or of space."""
    place = _placed(pose[..., :2].reshape(-1, 2), flat(by)).reshape(*pose.shape[:-1], 2)
    rest = pose[..., 2:] + by[2:]
    return np.concatenate([place, rest], axis=-1)

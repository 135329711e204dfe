"""What a plan does, measured without the package: its samples, shapely, and plain arithmetic."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import AnyObstacle, Box, Disc, OccupancyMap, Shape
from maneuver_automaton.models import Model
from maneuver_automaton.primitives import Maneuver, Trajectory
from maneuver_automaton.problem import Bounds, Goal


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

    @classmethod
    def driven(cls, plan: Plan, model: Model, *, step_m: float, step_rad: float = 0.02) -> Course:
        """Samples of a plan whose maneuvers are driven again, from one of their samples on.

        Between those the plan says where it is by constant twists, which is a little off.
        """
        if not any(plan.maneuvers):
            return cls.of(plan, step_m=step_m, step_rad=step_rad)
        columns: list[tuple[np.ndarray, ...]] = []
        begin = plan.start_time
        for primitive, lasting in zip(plan.primitives, plan.primitive_durations, strict=True):
            if isinstance(primitive, Maneuver):
                assert primitive.course is not None
                time, pose, state, control = _driven(primitive.course, model, step_m)
            else:
                alone = Plan(np.zeros_like(plan.start), (primitive,), durations=[lasting])
                one = cls.of(alone, step_m=step_m, step_rad=step_rad)
                time, pose, state, control = one.time, one.pose, one.state, one.control
            columns.append((begin + time, moved(pose, plan.pose_at(begin)), state, control))
            begin += lasting
        return cls(*(np.concatenate(parts) for parts in zip(*columns, strict=True)))

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


def _driven(
    course: Trajectory, model: Model, step_m: float, *, to_the_end: bool = False
) -> tuple[np.ndarray, ...]:
    """Times, poses, states and controls of a course, every interval integrated from its begin.

    Runge-Kutta of order four, all intervals at once: in each the control is constant. `to_the_end`
    gives the end of every interval alone.
    """
    lasting, control = np.diff(course.time), course.control[:-1]
    speed = np.abs(model.body_velocity(course.reduced_state, course.control)[:, :2]).max()
    steps = max(4, math.ceil(float(speed * lasting.max(initial=0.0)) / step_m))
    size, dof = (lasting / steps)[:, None], course.pose.shape[1]

    def rates(x: np.ndarray) -> np.ndarray:
        twist = model.body_velocity(x[:, dof:], control)
        heading = flat(x[:, :dof])[:, 2]
        cos, sin = np.cos(heading), np.sin(heading)
        forward, aside = twist[:, 0], twist[:, 1]
        world = np.stack([cos * forward - sin * aside, sin * forward + cos * aside], axis=-1)
        return np.hstack([world, twist[:, 2:], model.reduced_dynamics(x[:, dof:], control)])

    x = np.hstack([course.pose, course.reduced_state])[:-1]
    rows = [x]
    for _ in range(steps if to_the_end else steps - 1):
        a = rates(x)
        b = rates(x + size / 2.0 * a)
        c = rates(x + size / 2.0 * b)
        d = rates(x + size * c)
        x = x + size / 6.0 * (a + 2.0 * b + 2.0 * c + d)
        rows.append(x)
    if to_the_end:
        return course.time[1:], x[:, :dof], x[:, dof:], control
    every = np.stack(rows, axis=1).reshape(-1, x.shape[1])
    last = np.append(course.pose[-1], course.reduced_state[-1])
    every = np.vstack([every, last])
    since = size * np.arange(steps)
    time = np.append((course.time[:-1, None] + since).ravel(), course.time[-1])
    controls = np.vstack([np.repeat(control, steps, axis=0), course.control[-1:]])
    return time, every[:, :dof], every[:, dof:], controls


@dataclass(frozen=True, eq=False)
class Bodies:
    """Bodies (n,) made of shapes (k,): all within `radii` [m] of geometries without a radius."""

    shapes: np.ndarray  # (n, k) geometries
    radii: np.ndarray  # (k,) [m], zero but for discs

    def clearance(self, thing: shapely.Geometry | np.ndarray, radius: float = 0.0) -> np.ndarray:
        """Distance (n,) [m] of each to a geometry, or its own one, with a radius; 0 if it meets."""
        things = thing[:, None] if isinstance(thing, np.ndarray) else thing
        apart = shapely.distance(self.shapes, things) - self.radii - radius
        return np.maximum(apart, 0.0).min(axis=1)


def core(shape: Shape) -> tuple[np.ndarray, float]:
    """Corners (m, 2) and radius [m] of a shape without holes: a disc is a point with a radius."""
    if isinstance(shape, Disc):
        return np.array([shape.center]), shape.radius
    if isinstance(shape, Box):
        x, y = shape.size / 2.0
        corners = np.array([[-x, -y], [x, -y], [x, y], [-x, y]])
        return _placed(corners, np.append(shape.center, shape.heading)), 0.0
    assert not shape.holes
    return np.asarray(shape.corners), 0.0


def _geometries(corners: np.ndarray) -> np.ndarray:
    """Points or polygons of corners (..., m, 2)."""
    if corners.shape[-2] == 1:
        return np.asarray(shapely.points(corners[..., 0, :]))
    return np.asarray(shapely.polygons(corners))


def solid(shape: Shape) -> tuple[shapely.Geometry, float]:
    """A shape as a geometry and a radius [m]."""
    corners, radius = core(shape)
    return _geometries(corners).item(), radius


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
    joints: Sequence[tuple[float, float]] = (),
) -> Bodies:
    """The body along a course (n,), what it pulls included.

    Each joint is so far [m] behind the axle that pulls it, and the next axle behind the joint; its
    heading is less by the angle at the joint, the next component of the reduced state.
    """
    placed = [(core(shape), course.flat) for shape in footprint]
    frames = np.array(course.flat[:, :3])
    for k, (shapes, (offset, length)) in enumerate(
        zip((parts or {}).values(), joints, strict=False)
    ):
        place, heading = frames[:, :2], frames[:, 2]
        place = place - offset * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
        heading = heading - course.state[:, k]
        place = place - length * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
        frames = np.column_stack([place, heading])
        placed += [(core(shape), frames) for shape in shapes]
    columns = [_geometries(_placed(corners, poses)) for (corners, _), poses in placed]
    return Bodies(np.stack(columns, axis=-1), np.array([radius for (_, radius), _ in placed]))


def clearances(
    course: Course,
    around: Bodies,
    obstacles: Sequence[AnyObstacle],
    *,
    body_height: tuple[float, float] = (0.0, 0.0),
) -> np.ndarray:
    """Least distance (n,) [m] of bodies along a course to obstacles.

    Zero where they overlap, infinite without obstacles; one at another height is none.
    """
    least = np.full(len(course.time), np.inf)
    for obstacle in obstacles:
        if isinstance(obstacle, OccupancyMap):
            least = np.minimum(least, around.clearance(_blocked(obstacle)))
            continue
        corners, radius = core(obstacle.shape)
        if obstacle.motion is None:
            clearance = around.clearance(_geometries(corners).item(), radius)
        else:
            place = [
                np.interp(course.time, obstacle.motion.time, obstacle.motion.pose[:, k])
                for k in range(3)
            ]
            clearance = around.clearance(
                _geometries(_placed(corners, np.stack(place, axis=-1))), radius
            )
        if obstacle.height is not None:
            low, high = obstacle.height
            z = course.pose[:, 3] if course.pose.shape[1] > 3 else 0.0
            apart = (z + body_height[0] > high) | (z + body_height[1] < low)
            clearance = np.where(apart, np.inf, clearance)
        least = np.minimum(least, clearance)
    return least


def _blocked(cells: OccupancyMap) -> shapely.Geometry:
    """Blocked cells of a map as one geometry."""
    size = cells.resolution
    corner = np.array([[0.0, 0.0], [size, 0.0], [size, size], [0.0, size]])
    squares = [
        shapely.Polygon(_placed(corner + size * np.array([column, row]), cells.origin))
        for row, column in np.argwhere(cells.blocked)
    ]
    return shapely.union_all(squares)


def inside(around: Bodies, shape: Shape, *, depth: float = 0.0) -> np.ndarray:
    """Whether any part of each body is in a shape, by more than `depth` [m]: (n,)."""
    zone, radius = solid(shape)
    if radius:
        return around.clearance(zone, radius - depth) == 0.0
    return around.clearance(zone.buffer(-depth)) == 0.0


def outside_bounds(course: Course, bounds: Bounds) -> float:
    """How far the poses are out of the bounds [m], at most."""
    worst = -math.inf
    for name, k in (("x", 0), ("y", 1), ("z", 3)):
        pair = getattr(bounds, name)
        if pair is not None:
            worst = max(worst, pair[0] - course.pose[:, k].min(), course.pose[:, k].max() - pair[1])
    return worst


def price_near(
    course: Course, clearance: np.ndarray, *, weight: float, within: float, per_second: bool = False
) -> float:
    """What it costs to be near: the integral of ``weight (1 - d / within)^2``, by trapezoids."""
    rates = weight * np.maximum(1.0 - clearance / within, 0.0) ** 2
    steps = course.lasting if per_second else course.ways
    return float(steps @ (rates[1:] + rates[:-1]) / 2.0)


def way_within(course: Course, shape: Shape) -> float:
    """Length [m] of the way of the pose inside a shape, climbs included: each step by its share."""
    area, radius = solid(shape)
    area = area.buffer(radius, quad_segs=200) if radius else area
    ends = np.stack([course.pose[:-1, :2], course.pose[1:, :2]], axis=1)
    moving = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) > 1e-12
    lines = shapely.linestrings(ends[moving])
    shares = shapely.length(shapely.intersection(lines, area)) / shapely.length(lines)
    return float(course.ways[moving] @ shares)


def defect(plan: Plan, model: Model) -> float:
    """How far any maneuver's interval, integrated from its begin, ends from the next sample."""
    worst = 0.0
    for maneuver in filter(None, plan.maneuvers):
        course = maneuver.course
        assert course is not None
        ends = _driven(course, model, 0.05, to_the_end=True)
        samples = np.hstack([course.pose, course.reduced_state])[1:]
        worst = max(worst, float(np.abs(np.hstack([ends[1], ends[2]]) - samples).max()))
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

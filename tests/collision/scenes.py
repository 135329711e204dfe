"""Random scenes, and the slow, obvious distance in them."""

from __future__ import annotations

import math

import numpy as np
import shapely

from maneuver_automaton.collision import Box, Disc, Motion, Obstacle, OccupancyMap, Polygon
from maneuver_automaton.groups import SE2

CAR = Polygon([[-0.95, -0.95], [3.75, -0.95], [3.75, 0.95], [-0.95, 0.95]])
ANGLE = Polygon([[-0.5, -0.5], [2.0, -0.5], [2.0, 0.0], [0.0, 0.0], [0.0, 1.5], [-0.5, 1.5]])
FRAME = Polygon(
    [[-2, -2], [2, -2], [2, 2], [-2, 2]], [[[-1.6, -1.6], [1.6, -1.6], [1.6, 1.6], [-1.6, 1.6]]]
)
FOOTPRINTS = {
    "car": (CAR,),
    "angle": (ANGLE,),
    "frame": (FRAME,),
    "disc": (Disc(0.6, center=[0.3, 0.0]),),
    "truck": (Box([2.0, 1.6], center=[1.5, 0.0]), Box([3.0, 1.8], center=[-1.2, 0.0]), Disc(0.5)),
    "point": (),
}
TWISTS = [(1.0, 0.0, 0.25), (1.0, 0.0, 0.0), (-1.0, 0.0, -0.4), (0.0, 0.0, 1.0), (0.5, 0.7, -0.9)]


def slow_distance(footprint, obstacles, pose, time=0.0):
    """Least distance over all pairs of parts, one after the other."""
    body = [_core(shape) for shape in (part.moved(SE2(pose)) for part in footprint)]
    body = body or [(shapely.Point(pose[:2]), 0.0)]
    others = [core for obstacle in obstacles for core in _cores(obstacle, time)]
    distances = [max(0.0, a.distance(b) - r - s) for a, r in body for b, s in others]
    return min(distances, default=math.inf)


def _cores(obstacle, time):
    if isinstance(obstacle, Obstacle):
        return [_core(obstacle.at(time))]
    rows, columns = np.nonzero(obstacle.blocked)
    frame, size = SE2(obstacle.origin), obstacle.resolution
    corners = [[0, 0], [1, 0], [1, 1], [0, 1]]
    return [
        (shapely.Polygon(frame.act(size * np.add(corners, [column, row]))), 0.0)
        for row, column in zip(rows, columns, strict=True)
    ]


def _core(shape):
    if isinstance(shape, Disc):
        return shapely.Point(shape.center), shape.radius
    return shapely.Polygon(shape.corners, getattr(shape, "holes", ())), 0.0


def random_shape(rng):
    kind = rng.integers(6)
    if kind == 0:
        return Disc(rng.uniform(0.05, 1.5), center=rng.uniform(-6, 6, 2))
    if kind == 1:
        return Box(
            rng.uniform(0.1, 3.0, 2), center=rng.uniform(-6, 6, 2), heading=rng.uniform(0, 9)
        )
    if kind == 2:  # a thin wall
        return Box(
            [rng.uniform(1, 6), 1e-6], center=rng.uniform(-6, 6, 2), heading=rng.uniform(0, 9)
        )
    place = SE2([*rng.uniform(-5, 5, 2), rng.uniform(-4, 4)])
    if kind == 3:
        return ANGLE.moved(place)
    if kind == 4:
        return FRAME.moved(place)
    angles = (
        2 * np.pi / 7 * (np.arange(7) + rng.uniform(0.0, 0.9, 7))
    )  # a star, concave as it comes
    radii = rng.uniform(0.2, 2.0, 7)
    return Polygon(np.stack([radii * np.cos(angles), radii * np.sin(angles)], 1)).moved(place)


def random_map(rng):
    cells = rng.random((6, 9)) < 0.25
    origin = [*rng.uniform(-5, 3, 2), rng.uniform(-4, 4)]
    return OccupancyMap(cells, resolution=0.4, origin=origin)


def random_moving_obstacle(rng):
    n = rng.integers(1, 5)
    time = np.cumsum(rng.uniform(0.3, 2.0, n)) - 1.0
    pose = np.column_stack([rng.uniform(-6, 6, (n, 2)), rng.uniform(-4, 4, n)])
    if rng.random() < 0.4:
        pose[:, 2] = pose[0, 2]
    shapes = [Disc(0.4), Box([2.0, 1.0]), ANGLE, FRAME]
    return Obstacle(shapes[rng.integers(4)], motion=Motion(time, pose))


def random_traffic(rng, n):
    """Movers far and near, on lines and on arcs, some there for a while only."""
    found = []
    for one in (random_moving_obstacle(rng) for _ in range(n)):
        motion, present = one.motion, None
        if rng.random() < 0.5:
            twists = rng.uniform(-2.0, 2.0, (motion.time.size - 1, 3))
            poses = [motion.pose[0]]
            for twist, lasting in zip(twists, np.diff(motion.time), strict=True):
                there = (SE2(poses[-1]) @ SE2.exp(lasting * twist)).pose
                poses.append(np.append(there[:2], poses[-1][2] + lasting * twist[2]))
            motion = Motion(motion.time, poses, twists)
        if rng.random() < 0.3:
            begin = rng.uniform(-2.0, 6.0)
            present = (begin, begin + rng.uniform(0.1, 5.0))
        away = SE2([*rng.uniform(-15.0, 15.0, 2), 0.0])
        found.append(Obstacle(one.shape, motion=motion.moved(away), present_s=present))
    return tuple(found)


def random_scene(rng, *, moving=0):
    static = tuple(Obstacle(random_shape(rng)) for _ in range(rng.integers(1, 4)))
    maps = (random_map(rng),) if rng.random() < 0.2 else ()
    traffic = tuple(random_moving_obstacle(rng) for _ in range(moving))
    order = rng.permutation(len(static) + len(maps) + len(traffic))
    every = (*static, *maps, *traffic)
    return tuple(every[k] for k in order)


def random_pose(rng, *, reach=7.0):
    return np.array([*rng.uniform(-reach, reach, 2), rng.uniform(-7, 7)])

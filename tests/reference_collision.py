"""Slow twins of the collision kernels: shapely, at one pose after the other."""

from __future__ import annotations

import numpy as np

from maneuver_automaton._compile import kernel
from maneuver_automaton.collision import Obstacle
from maneuver_automaton.collision._kernels_advancement import free_time
from maneuver_automaton.collision._kernels_field import write_all
from maneuver_automaton.collision._kernels_moving import coast_of
from maneuver_automaton.collision.body import fastest_points
from maneuver_automaton.collision.world import World, own_frame, world_of
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Problem
from tests import solids
from tests.scenes import differential_robot


def shapely_world(footprint, obstacles) -> solids.World:
    """Everything in its place: the clearance of poses (n, 3) at times (n,)."""
    robot = differential_robot()
    return solids.World(Problem(robot, [0, 0, 0], [0, 0, 0], obstacles=obstacles,
                                footprint=footprint))  # fmt: skip


def world_around(footprint, obstacles, *, keep: float = 0.0, present=None) -> World:
    """The world as the kernels see it, from its own frame."""
    listed = tuple(obstacles)
    frame = own_frame(listed, np.zeros(3))
    return world_of(listed, tuple(footprint), frame, keep=keep, present=present)


def distances_of(field) -> np.ndarray:
    """All distances (rows, columns) of a field, which else are written where they are asked for."""
    write_all(field)
    return field.distance


def driven(pose, twist, times) -> np.ndarray:
    """Poses (n, 3) after `times` (n,) [s] of a constant twist."""
    return (SE2(np.asarray(pose)) @ SE2.exp(np.multiply.outer(times, twist))).pose


def moved(obstacles, by: SE2):
    return tuple(obstacle.moved(by) for obstacle in obstacles)


@kernel
def _free_times_and_clearances(world, body, motions, keep, margin, out):
    for k in range(motions.shape[0]):
        out[k, 0], out[k, 1] = free_time(world, body, coast_of(motions, k), keep, margin)


def free_times_and_clearances(
    world: World, poses, twists, durations, *, margin, keep=0.0, times=0.0
):
    """What `free_time` returns (k, 2): proven time, and a bound of the last clearance."""
    twists = np.array(twists, dtype=np.float64)
    n = len(twists)
    out = np.empty((n, 2))
    durations, clocks = (np.broadcast_to(one, n) for one in (durations, times))
    speeds = fastest_points(world.body, twists)
    motions = np.column_stack([poses, twists[:, :3], speeds, durations, clocks])
    _free_times_and_clearances(world.arrays, world.body, np.ascontiguousarray(motions, dtype=float),
                               keep, margin, out)  # fmt: skip
    return out


def still(obstacles):
    return tuple(o for o in obstacles if not isinstance(o, Obstacle) or o.motion is None)

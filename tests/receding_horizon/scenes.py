"""Small scenes for closed loops: a robot of 0.3 m among static and moving obstacles."""

from __future__ import annotations

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.collision import Box, Disc, Motion, Obstacle
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.receding_horizon import ClosedLoop
from tests.scenes import differential_robot, dubins
from tests.solids import World, driven

BODY = Disc(0.3)
FREE_GOAL = Goal(pose=[6.0, 0.0, 0.0], free_heading=True)


def among(*obstacles, start=(0.0, 0.0, 0.0), goal=FREE_GOAL, robot=None, **changed) -> Problem:
    """The robot at the origin, its goal 6 m ahead."""
    settings = {"footprint": BODY} | changed
    automaton = differential_robot(1.0, 1.5) if robot is None else robot
    return Problem(automaton, start, goal, obstacles=obstacles, **settings)


def moving_obstacle(times, poses, shape=None) -> Obstacle:
    """A disc of 0.5 m, or another shape, at places (x, y) in time."""
    turned = [[x, y, 0.0] for x, y in poses]
    return Obstacle(shape or Disc(0.5), motion=Motion(times, turned))


def crossing() -> Obstacle:
    """Through the way at its middle, when the robot would be there."""
    return moving_obstacle([0.0, 6.0], [(3.0, -3.0), (3.0, 3.0)])


def on_the_goal(until: float = 12.0) -> Obstacle:
    """Stands on the goal, then leaves at 1 m/s."""
    return moving_obstacle([0.0, until, until + 6.0], [(6.0, 0.0), (6.0, 0.0), (6.0, 6.0)])


def door(opens: float = 8.0) -> tuple[Obstacle, ...]:
    """A wall across the way with a door in it that slides aside."""
    posts = [Obstacle(Box([0.2, 9.0], [3.0, side * 5.25])) for side in (1, -1)]
    leaf = moving_obstacle(
        [0.0, opens, opens + 2.0], [(3.0, 0.0), (3.0, 0.0), (3.0, 1.6)], Box([0.1, 1.5])
    )
    return (*posts, leaf)


def cannot_stop() -> Automaton:
    """Ahead and to both sides, never at rest."""
    return dubins(1.0)


def clearances(loop: ClosedLoop, problem: Problem | None = None) -> Array:
    """Least distance (n,) [m] of every piece driven from the problem's obstacles, by shapely."""
    world = World(problem or loop.problem)
    clearances = []
    for piece in loop.driven:
        times, poses = driven(piece, world.origin, step_m=0.02, step_rad=0.05)
        clearances.append(float(world.clearance(poses, times).min()))
    return np.array(clearances)

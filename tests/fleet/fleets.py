"""Small fleets, and what is looked at beside the library: bodies by shapely at short steps."""

from __future__ import annotations

import itertools
import math

import numpy as np
import shapely

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.collision import Box, Disc, Obstacle
from maneuver_automaton.collision.surroundings import parts_of
from maneuver_automaton.costs import Cost
from maneuver_automaton.fleet import FleetProblem
from maneuver_automaton.models import Unicycle
from maneuver_automaton.problem import Bounds, Problem

STEP = 0.01  # [s]
CAR = (Box([1.2, 0.8], center=[0.2, 0.0]),)


def car():
    """A car that turns with a radius of a metre, ahead and back, and can wait."""
    turns = {"rest": (0, 0), "on": (1, 0), "left": (1, 1), "right": (1, -1)}
    back = {"back": (-1, 0), "back left": (-1, -1), "back right": (-1, 1)}
    return Automaton.of_controls(Unicycle(), turns | back)


def fleet_of(ends, *, obstacles=(), bounds=None, footprint=CAR, **more):
    """A fleet of cars from starts to goals."""
    automaton = car()
    problems = [
        Problem(
            automaton,
            start,
            goal,
            cost=Cost(time=1.0),
            obstacles=obstacles,
            bounds=bounds or Bounds(),
            footprint=footprint,
        )
        for start, goal in ends
    ]
    return FleetProblem(problems, **more)


def crossing():
    """Two cars whose ways cross."""
    return fleet_of(
        [([-4, 0, 0], [4, 0, 0]), ([0, -4, math.pi / 2], [0, 4, math.pi / 2])], names="ab"
    )


def swap(n=2):
    """Cars on a circle, each to the other side of it."""
    turns = 2.0 * math.pi * np.arange(n) / n
    ends = [
        ([-5 * math.cos(a), -5 * math.sin(a), a], [5 * math.cos(a), 5 * math.sin(a), a])
        for a in turns
    ]
    return fleet_of(ends)


def random_fleet(n, seed, *, discs=4):
    """Cars at random places of a yard of which nobody stands in another's place."""
    rng = np.random.default_rng(seed)
    size = 5.0 + 3.0 * math.sqrt(n)
    obstacles = tuple(Obstacle(Disc(0.4, rng.uniform(0.0, size, 2).tolist())) for _ in range(discs))
    free = []
    while len(free) < 2 * n:
        pose = [*rng.uniform(1.5, size - 1.5, 2), rng.uniform(-3.0, 3.0)]
        same = free[:n] if len(free) < n else free[n:]
        apart = all(math.dist(pose[:2], one[:2]) > 3.0 for one in same)
        clear = all(math.dist(pose[:2], one.shape.center) > 1.8 for one in obstacles)
        if apart and clear:
            free.append(pose)
    bounds = Bounds(x=(0.0, size), y=(0.0, size))
    return fleet_of(list(zip(free[:n], free[n:], strict=True)), obstacles=obstacles, bounds=bounds)


def least_distances(result):
    """Least distance of two bodies, and of any body to an obstacle, by shapely at short steps."""
    plans = result.plans
    problems = dict(zip(result.problem.names, result.problem.problems, strict=True))
    last = max((p.start_time + p.duration for p in plans.values()), default=0.0)
    first = min(one.start_time for one in problems.values())
    times = np.arange(first, last + 1.0, STEP)
    bodies = {}
    for name, problem in problems.items():
        if name in plans:
            clock = np.clip(
                times, plans[name].start_time, plans[name].start_time + plans[name].duration
            )
            poses = plans[name].pose_at(clock)
        else:
            poses = np.repeat(problem.start[None], len(times), axis=0)
        (part,) = parts_of(problem.footprint)
        bodies[name] = part.at(poses[:, :3])
    pairs = [
        float(shapely.distance(bodies[a], bodies[b]).min())
        for a, b in itertools.combinations(bodies, 2)
    ]
    static = [
        float(shapely.distance(bodies[name], core).min()) - radius
        for name in plans
        for obstacle in problems[name].obstacles
        for core, radius, *_ in parts_of((obstacle.shape,))
    ]
    return min(pairs, default=math.inf), min(static, default=math.inf)

"""Small fleets of robots that loops drive, and their distances by shapely."""

from __future__ import annotations

import itertools
import math

import numpy as np
import shapely

from maneuver_automaton import Automaton, Box, Disc, FleetProblem, Goal, Problem, Unicycle
from maneuver_automaton.collision.surroundings import parts_of
from maneuver_automaton.fleet import FleetResult, FleetStatus

ROBOT = Automaton.of_controls(
    Unicycle(),
    {
        "rest": (0, 0),
        "on": (1, 0),
        "back": (-0.5, 0),
        "left": (0, 1),
        "right": (0, -1),
        "arc left": (1, 0.7),
        "arc right": (1, -0.7),
    },
)
BODY = Disc(0.3)
LOOK = 0.005  # [s] between two looks by shapely


def problem_of(start, goal, *, tolerance=0.0, obstacles=(), **more) -> Problem:
    """One robot from a pose to a pose."""
    end = Goal(pose=goal, tolerance_m=tolerance, tolerance_rad=tolerance)
    keeps = {"footprint": BODY, "margin": 0.02, "obstacles": obstacles}
    return Problem(ROBOT, start, end, **{**keeps, **more})


def crossing(*, tolerance=0.0, margin=0.1, **more) -> FleetProblem:
    """Two robots whose ways cross."""
    return FleetProblem(
        [
            problem_of([-3, 0, 0], [3, 0, 0], tolerance=tolerance),
            problem_of([0, -3, np.pi / 2], [0, 3, np.pi / 2], tolerance=tolerance),
        ],
        names=("a", "b"),
        margin=margin,
        **more,
    )


def swapping(**more) -> FleetProblem:
    """Two robots that change places, with room beside them."""
    return FleetProblem(
        [
            problem_of([-2, 0, 0], [2, 0, 0], tolerance=0.05),
            problem_of([2, 0, np.pi], [-2, 0, np.pi], tolerance=0.05),
        ],
        names=("a", "b"),
        margin=0.1,
        **more,
    )


def through_a_door(**more) -> FleetProblem:
    """Three robots on either side of a wall with one door, which is wide enough for one."""
    wall = (Box([0.4, 4.0], [0.0, 2.6]), Box([0.4, 4.0], [0.0, -2.6]))
    ways = (
        ([-2, 0, 0], [2, 1, 0]),
        ([2, 0, np.pi], [-2, -1, np.pi]),
        ([-2, 1.5, 0], [2, -1, 0]),
    )
    return FleetProblem(
        [problem_of(start, goal, tolerance=0.1, obstacles=wall) for start, goal in ways],
        names=("a", "b", "c"),
        margin=0.1,
        **more,
    )


def scattered(n: int, seed: int, *, size: float = 6.0) -> FleetProblem:
    """Robots from random places to random places, with a box in the middle of the square."""
    rng = np.random.default_rng(seed)
    box = Box([0.8, 0.8], [0.5 * size, 0.5 * size])

    def places() -> list:
        chosen: list = [np.full(2, 0.5 * size)]
        while len(chosen) <= n:
            one = rng.uniform(0.0, size, 2)
            if all(np.hypot(*(one - other)) > 1.1 for other in chosen):
                chosen.append(one)
        return chosen[1:]

    def pose(place) -> list[float]:
        return [*place, rng.uniform(-3.0, 3.0)]

    ends = [(pose(start), pose(goal)) for start, goal in zip(places(), places(), strict=True)]
    return FleetProblem(
        [problem_of(a, b, tolerance=0.1, obstacles=(box,)) for a, b in ends], margin=0.1
    )


def at_rest(fleet: FleetProblem) -> FleetResult:
    """No plans to begin with: all rest at their starts."""
    return FleetResult(problem=fleet, status=FleetStatus.NO_PLAN, results={})


def least_distance(log) -> float:
    """Least distance of two bodies along what was driven, by shapely at short steps."""
    least = math.inf
    problems = dict(zip(log.problem.names, log.problem.problems, strict=True))
    for step in log.steps:
        times = step.time + np.arange(0.0, log.step, LOOK)
        bodies = []
        for name, pieces in log.driven.items():
            here = [one for one in pieces if abs(one.start_time - step.time) < 1e-9]
            if here:
                clock = np.minimum(times, here[0].start_time + here[0].duration)
                poses = here[0].pose_at(clock)
                parts = parts_of(problems[name].footprint)
                bodies.append([(part.at(poses[:, :3]), part.radius) for part in parts])
        for one, other in itertools.combinations(bodies, 2):
            for (a, grown), (b, wide) in itertools.product(one, other):
                least = min(least, float(shapely.distance(a, b).min()) - grown - wide)
    return least

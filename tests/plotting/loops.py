"""Closed loops that the tests of their pictures share."""

from __future__ import annotations

import functools

import numpy as np

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.costs import Cost
from maneuver_automaton.models import Unicycle
from maneuver_automaton.problem import Goal, Horizon, Problem
from maneuver_automaton.receding_horizon import ClosedLoop, Disturbance, simulate
from tests.plotting.cases import ROBOT
from tests.search.cases import helicopter

START, ORIGIN = (0.0, 1.0, 0.0), (0.0, 0.0, 0.0)
NEAR = Goal(pose=ORIGIN, tolerance_m=0.1, tolerance_rad=0.1)
EIGHT_SECONDS = Horizon(time=8.0, max_trims=4)


def parking(goal=ORIGIN, start=START):
    return Problem(ROBOT, start, goal, cost=Cost(effort=1.0), horizon=EIGHT_SECONDS)


@functools.cache
def straight_loop() -> ClosedLoop:
    """35 steps on a line, 18 of them replanned."""
    speeds = [0.1 * k for k in range(-20, 21)]
    robot = Automaton.of_controls(Unicycle(), {f"{v:.1f}": (v, 0.0) for v in speeds})
    horizon = Horizon(time=1.0)
    problem = Problem(robot, [-2, 0, 0], ORIGIN, cost=Cost(effort=1.0), horizon=horizon)
    return simulate(problem, step=0.1, audit=False)


@functools.cache
def parking_loop() -> ClosedLoop:
    """Four steps: two on circles, a straight and a turn on the spot."""
    return simulate(parking(), step=1.0, audit=False)


@functools.cache
def pushed_loop() -> ClosedLoop:
    """Noise after every step, and a push that raises the value."""
    upset = Disturbance(position_m=0.03, heading_rad=0.03, seed=3, pushes={4: (0.3, 0.3, 0.2)})
    return simulate(parking(NEAR), step=0.5, disturbance=upset, audit=False)


@functools.cache
def unfinished_loop() -> ClosedLoop:
    return simulate(parking(), step=0.5, steps=2, audit=False)


@functools.cache
def helpless_loop() -> ClosedLoop:
    """Pushed off the only line that it can drive along."""
    robot = Automaton.of_controls(Unicycle(), {"rest": (0.0, 0.0), "ahead": (1.0, 0.0)})
    problem = Problem(robot, [-3, 0, 0], ORIGIN, cost=Cost(effort=1.0), horizon=Horizon(time=4.0))
    upset = Disturbance(pushes={1: (0.0, 0.2, 0.1)})
    return simulate(problem, step=1.0, disturbance=upset, audit=False)


@functools.cache
def empty_loop() -> ClosedLoop:
    return simulate(parking(start=ORIGIN), step=1.0, audit=False)


@functools.cache
def flight_loop() -> ClosedLoop:
    """In SE(2) x R: up, ahead, and round a turn."""
    horizon = Horizon(max_trims=4)
    problem = Problem(helicopter(), [0, 0, 0, 0], [4, 3, 1, 2], horizon=horizon)
    return simulate(problem, step=1.0, audit=False)


def moments(loop: ClosedLoop, count: int) -> np.ndarray:
    """`count` times of a loop, its first and last among them."""
    return np.linspace(loop.times[0], loop.times[-1], count)


LOOPS = {
    "straight": straight_loop,
    "parking": parking_loop,
    "pushed": pushed_loop,
    "unfinished": unfinished_loop,
    "helpless": helpless_loop,
    "empty": empty_loop,
    "flight": flight_loop,
}

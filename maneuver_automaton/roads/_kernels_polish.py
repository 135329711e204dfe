"""Local improvement of a plan on the road: controls are moved to and fro where that is cheaper.

A move adds a pattern to one control, block by block: the weights of a pattern add up to zero, so
speed and steering after it are what they were, and so are the controls of all that follows. What
follows is displaced, so it is priced, and proven free, once more, the stop after the plan included.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from maneuver_automaton._compile import bare_inner_kernel, kernel
from maneuver_automaton.roads._kernels_costs import cost_of_tick
from maneuver_automaton.roads._kernels_free import free_tick
from maneuver_automaton.roads._kernels_goals import goal_at
from maneuver_automaton.roads._kernels_library import admitted
from maneuver_automaton.roads._kernels_motion import drive_tick
from maneuver_automaton.roads._kernels_route import nearest_of_all

if TYPE_CHECKING:
    from maneuver_automaton._arrays import Array
    from maneuver_automaton.roads._kernels_beam import Horizon

GAIN = 1e-6  # share of the cost that a move has to save
LONG = 64  # ticks of a plan from which on a pass leaves places out


class Moves(NamedTuple):
    """What is tried: patterns, by sizes, one pair of them in a pass."""

    pattern: np.ndarray  # (P, blocks) weights of the blocks of a move, no further than 1 from zero
    blocks: np.ndarray  # (P,) how many of them
    size: np.ndarray  # (S, 2) of acceleration [m/s^2] and steering rate [rad/s]


class Course(NamedTuple):
    """A plan tick by tick, the stop after it included."""

    states: np.ndarray  # (m + 1, 5)
    controls: np.ndarray  # (m, 2)
    # Of the plan alone, up to each state: what a move leaves as it is needs no second look.
    cost: np.ndarray  # (m + 1,)
    near: np.ndarray  # (m + 1,) nearest point of the route


@bare_inner_kernel
def drive_on(horizon: Horizon, course: Course, begin: int, lasting: int, most: float) -> bool:
    """Drive the controls from the tick `begin` on; whether limits hold and it costs less.

    Costs only rise, so the drive ends where they reach `most`.
    """
    limits, states, controls = horizon.limits, course.states, course.controls
    for k in range(begin, controls.shape[0]):
        drive_tick(limits.wheelbase, limits.tick, states, controls, k)
        if k >= lasting:
            continue  # the stop keeps its speeds and angles, and costs nothing
        speed, steering = states[k + 1, 3], states[k + 1, 4]
        if speed < 0.0 or abs(steering) > limits.sharpest:
            return False
        possible, _, _, _ = admitted(
            limits, limits.tick, states[k, 3], states[k, 4], speed, steering
        )
        cost, course.near[k + 1] = cost_of_tick(horizon, states, controls, k, course.near[k])
        course.cost[k + 1] = course.cost[k] + cost
        if not possible or course.cost[k + 1] >= most:
            return False
    return True


@bare_inner_kernel
def still_free(horizon: Horizon, course: Course, begin: int, tick: int) -> bool:
    """Whether a course that starts at a tick is free from its tick `begin` on."""
    states = course.states
    for k in range(begin, course.controls.shape[0]):
        if not free_tick(
            horizon.clearing,
            states[k, 0],
            states[k, 1],
            states[k, 2],
            states[k + 1, 0],
            states[k + 1, 1],
            states[k + 1, 2],
            tick + k,
        ):
            return False
    return True


@bare_inner_kernel
def take_over(source: Course, course: Course, begin: int) -> None:
    """Copy all of a course from a tick on, the state there included."""
    for k in range(begin, course.states.shape[0]):
        for i in range(5):
            course.states[k, i] = source.states[k, i]
        course.cost[k], course.near[k] = source.cost[k], source.near[k]
    for k in range(begin, course.controls.shape[0]):
        course.controls[k, 0], course.controls[k, 1] = source.controls[k, 0], source.controls[k, 1]


@bare_inner_kernel
def is_better(
    horizon: Horizon, course: Course, trial: Course, begin: int, lasting: int, tick: int
) -> bool:
    """Whether a trial, its controls changed from `begin` on, is cheaper, free, and at the goal."""
    if not drive_on(horizon, trial, begin, lasting, (1.0 - GAIN) * course.cost[lasting]):
        return False
    x, y, heading = trial.states[lasting, 0], trial.states[lasting, 1], trial.states[lasting, 2]
    if goal_at(horizon, x, y, heading, trial.states[lasting, 3], tick + lasting) < 0:
        return False
    return still_free(horizon, trial, begin, tick)


@bare_inner_kernel
def try_pass(
    horizon: Horizon,
    moves: Moves,
    course: Course,
    trial: Course,
    lasting: int,
    tick: int,
    number: int,
) -> int:
    """Try one pattern in one size along all of a plan; how many moves were made.

    `trial` is equal to `course` before and after.
    """
    ticks, made = horizon.limits.ticks, 0
    # A move costs as much as what follows it is long: a pass of a long plan leaves places out,
    # which later passes take, so that it takes no longer than that of a short one.
    stride = ticks * (1 + lasting // LONG) ** 2
    pattern = number % moves.blocks.shape[0]
    size = number // moves.blocks.shape[0] % moves.size.shape[0]
    length = moves.blocks[pattern] * ticks
    for begin in range(number % stride, lasting - length + 1, stride):
        for column in range(2):
            for sign in (1.0, -1.0):
                step = sign * moves.size[size, column]
                for k in range(length):
                    trial.controls[begin + k, column] += step * moves.pattern[pattern, k // ticks]
                better = is_better(horizon, course, trial, begin, lasting, tick)
                take_over(trial if better else course, course if better else trial, begin)
                made += better
    return made


@kernel
def polish(
    horizon: Horizon,
    moves: Moves,
    state: Array,
    controls: Array,
    lasting: int,
    tick: int,
    first: int,
    passes: int,
) -> int:
    """Make a plan to a goal cheaper by moves, controls (m, 2) in place; how many were made.

    It starts from a state (5,) at a tick, and is at the goal `lasting` ticks later. Passes from
    number `first` on each try one pattern in one size along all of it.
    """
    m = controls.shape[0]
    course = Course(np.empty((m + 1, 5)), controls, np.zeros(m + 1), np.zeros(m + 1, np.int64))
    trial = Course(
        np.empty((m + 1, 5)), np.empty((m, 2)), np.zeros(m + 1), np.zeros(m + 1, np.int64)
    )
    course.states[0] = state
    course.near[0] = nearest_of_all(horizon.route, state[0], state[1])
    drive_on(horizon, course, 0, lasting, math.inf)
    take_over(course, trial, 0)
    made = 0
    for number in range(first, first + passes):
        made += try_pass(horizon, moves, course, trial, lasting, tick, number)
    return made

"""Local improvement of a plan on the road: controls are moved to and fro where that is cheaper.

A move adds a pattern to one control, block by block: the weights of a pattern add up to zero, so
speed and steering after it are what they were, and so are the controls of all that follows. What
follows is displaced, so it is priced, and proven free, once more, the stop after the plan included.
"""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._compile import bare_inner_kernel, kernel
from maneuver_automaton.roads._kernels_costs import cost_of_tick, goal_at, nearest_of_all
from maneuver_automaton.roads._kernels_motion import admitted, drive_tick, free_from
from maneuver_automaton.roads.arrays import Course, Horizon, Moves

GAIN = 1e-6  # share of the cost that a move has to save
LONG = 64  # ticks of a plan from which on a pass leaves places out


@bare_inner_kernel
def drive_on(horizon: Horizon, course: Course, begin: int, lasting: int, most: float) -> bool:
    """Drive the controls from the tick `begin` on; whether limits hold and it costs less.

    Costs only rise, so the drive ends where they reach `most`.
    """
    limits, states, controls = horizon.limits, course.states, course.controls
    kept = True
    for k in range(begin, controls.shape[0]):
        drive_tick(limits.wheelbase, limits.tick, states, controls, k)
        if k >= lasting:
            continue  # the stop keeps its speeds and angles, and costs nothing
        before, after = (states[k, 3], states[k, 4]), (states[k + 1, 3], states[k + 1, 4])
        if after[0] < 0.0 or abs(after[1]) > limits.sharpest:
            kept = False
        possible, _, _, _ = admitted(limits, limits.tick, before, after)
        cost, course.near[k + 1], obeyed = cost_of_tick(
            horizon, states, controls, k, course.near[k]
        )
        course.cost[k + 1] = course.cost[k] + cost
        kept = kept and possible and obeyed
        # A course that is only to be laid out, at any cost, is driven to its end.
        if most < math.inf and (not kept or course.cost[k + 1] >= most):
            return False
    return kept


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
    return free_from(horizon.clearing, trial.states, begin, tick) == trial.controls.shape[0]


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

"""Three times of a word in closed form, the others given, and the gradient left for the others.

A word of n trims has n - 3 times more than the planar pose fixes. Three are solved for, `triple`
says at which positions; both branches of the closed form are continuous in the others, but for
whole turns, which it leaves open.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import bare_inner_kernel, by_value
from maneuver_automaton.search._kernels_problem import (
    Candidates,
    Nodes,
    WordProblem,
    is_straight,
    propose,
    time_left,
)
from maneuver_automaton.words._kernels_steering import steer, unit
from maneuver_automaton.words._kernels_times import end_and_columns


@bare_inner_kernel
def choose_triple(problem: WordProblem, word: IntArray, n: int, triple: IntArray) -> bool:
    """Fill `triple` with the positions solved in closed form, the last to fit; False if none."""
    # Parallel neighbours cannot both be solved for, nor three straights. Two straights have a pole
    # where they are parallel, so one is solved for if possible, or two without a turn in between.
    for straights in range(1, 4):
        for k in range(n - 1, 1, -1):
            for j in range(k - 1, 0, -1):
                if j == k - 1 and problem.trims.parallel[word[j], word[k]]:
                    continue
                for i in range(j - 1, -1, -1):
                    if i == j - 1 and problem.trims.parallel[word[i], word[j]]:
                        continue
                    count = 0
                    for position in (i, j, k):
                        if is_straight(problem, word[position]):
                            count += 1
                    apart = count == 2 and not is_straight(problem, word[j])
                    if count < 3 and count + apart <= straights:
                        triple[0], triple[1], triple[2] = i, j, k
                        return True
    return False


@bare_inner_kernel
def moved(
    pose: tuple[complex, float], velocity: complex, turn_rate: float, time: float
) -> tuple[complex, float]:
    """A complex pose after coasting."""
    position, heading = pose
    half = 0.5 * turn_rate * time
    scale = time if half == 0.0 else time * (math.sin(half) / half)
    return position + velocity * scale * unit(heading + half), heading + 2.0 * half


@bare_inner_kernel
def solve_triple(
    steering: tuple[Array, Array, float, IntArray],
    word: IntArray,
    n: int,
    triple: IntArray,
    times: Array,
    out: Array,
) -> None:
    """Both branches (2, 3) of the times at `triple`, the other `times` being given."""
    # It takes twists, goal, tolerance and the counter of its calls, and not the problem: a call
    # hands over every field of every structure, at every node. A function for that would not do: it
    # counts no references, so it may not return an array to one that does.
    twists, goal, tolerance, counter = steering
    counter[2] += 1
    pose = (0j, 0.0)
    lead = pose
    between_1 = pose
    between_2 = pose
    stage = 0
    for i in range(n):
        if stage < 3 and i == triple[stage]:
            if stage == 0:
                lead = pose
            elif stage == 1:
                between_1 = pose
            else:
                between_2 = pose
            pose = (0j, 0.0)
            stage += 1
        else:
            t = word[i]
            pose = moved(pose, complex(twists[t, 0], twists[t, 1]), twists[t, 2], times[i])
    # goal seen from the end of the lead, before the tail
    z = complex(goal[0], goal[1])
    heading = goal[2] - pose[1]
    z -= pose[0] * unit(heading)
    z = (z - lead[0]) * unit(-lead[1])
    heading -= lead[1]
    a, b, c = word[triple[0]], word[triple[1]], word[triple[2]]
    trims = (
        (complex(twists[a, 0], twists[a, 1]), twists[a, 2]),
        (complex(twists[b, 0], twists[b, 1]), twists[b, 2]),
        (complex(twists[c, 0], twists[c, 1]), twists[c, 2]),
    )
    aim = (z, heading, unit(heading))
    steer(trims, (between_1, between_2), aim, (tolerance, -math.inf), out)


@by_value
class FreeTime(NamedTuple):
    """A word of four trims with one time free."""

    word: IntArray  # (n,)
    n: int
    triple: IntArray  # (3,) positions that are solved for
    q: int  # the position that is free


@bare_inner_kernel
def reduced_gradient(problem: WordProblem, room: Nodes, four: FreeTime, times: Array) -> float:
    """How the cost changes with the free time, the other three following; NaN if singular."""
    columns, rates, word = room.columns, problem.library.rates, four.word
    end_and_columns(room.twists, times, columns)
    # Cramer's rule: the three change so that the end stays where it is.
    a, b, c = four.triple[0], four.triple[1], four.triple[2]
    u0 = columns[b, 1] * columns[c, 2] - columns[b, 2] * columns[c, 1]
    u1 = columns[b, 2] * columns[c, 0] - columns[b, 0] * columns[c, 2]
    u2 = columns[b, 0] * columns[c, 1] - columns[b, 1] * columns[c, 0]
    det = columns[a, 0] * u0 + columns[a, 1] * u1 + columns[a, 2] * u2
    if det == 0.0:
        return math.nan
    v0 = columns[c, 1] * columns[a, 2] - columns[c, 2] * columns[a, 1]
    v1 = columns[c, 2] * columns[a, 0] - columns[c, 0] * columns[a, 2]
    v2 = columns[c, 0] * columns[a, 1] - columns[c, 1] * columns[a, 0]
    w0 = columns[a, 1] * columns[b, 2] - columns[a, 2] * columns[b, 1]
    w1 = columns[a, 2] * columns[b, 0] - columns[a, 0] * columns[b, 2]
    w2 = columns[a, 0] * columns[b, 1] - columns[a, 1] * columns[b, 0]
    x, y, h = columns[four.q, 0], columns[four.q, 1], columns[four.q, 2]
    share_a = (x * u0 + y * u1 + h * u2) / det
    share_b = (x * v0 + y * v1 + h * v2) / det
    share_c = (x * w0 + y * w1 + h * w2) / det
    return (
        rates[word[four.q]]
        - share_a * rates[word[a]]
        - share_b * rates[word[b]]
        - share_c * rates[word[c]]
    )


@bare_inner_kernel
def take_branch(
    problem: WordProblem, room: Nodes, four: FreeTime, branch: int, times: Array
) -> float:
    """Fill `times` from a branch that is solved; the reduced gradient there, NaN if it is empty."""
    # With linear conditions these must vanish, and not the gradient: it is 0.
    if math.isnan(room.both[branch, 0]):
        return math.nan
    for s in range(3):
        times[four.triple[s]] = room.both[branch, s]
    if problem.library.targets.size > 0:
        return 0.0
    return reduced_gradient(problem, room, four, times)


@bare_inner_kernel
def solve(problem: WordProblem, candidates: Candidates, four: FreeTime, times: Array) -> None:
    """Solve for the triple at a given free time."""
    library = problem.library
    steering = (library.twists, library.goal, problem.scan.tolerance, candidates.counter)
    solve_triple(steering, four.word, four.n, four.triple, times, candidates.nodes.both)


@bare_inner_kernel
def evaluate(
    problem: WordProblem, candidates: Candidates, four: FreeTime, times: Array, branch: int
) -> float:
    """Solve for the triple at a given free time, and take one branch."""
    solve(problem, candidates, four, times)
    return take_branch(problem, candidates.nodes, four, branch, times)


@bare_inner_kernel
def unwrap(
    problem: WordProblem, word: IntArray, triple: IntArray, reference: Array, times: Array
) -> None:
    """Shift the solved turning times by whole turns to lie nearest to `reference`, in place."""
    for s in range(3):
        i = triple[s]
        period = problem.trims.periods[word[i]]
        if period < np.inf:
            times[i] -= period * round((times[i] - reference[i]) / period)


@bare_inner_kernel
def levels(
    problem: WordProblem,
    candidates: Candidates,
    word: IntArray,
    n: int,
    start: Array,
    low: Array,
    high: Array,
    span: Array,
) -> None:
    """Propose `start` for all whole turns with which the linear conditions can be met."""
    # `low` and `high` bound the times in a cell, unwrapped; `span` (m, 2) the conditions' values.
    m = problem.library.targets.size
    shifts, first, last = candidates.turns[0], candidates.turns[1], candidates.turns[2]
    times = candidates.work
    for i in range(n):
        first[i], last[i] = 0, 0
        period = problem.trims.periods[word[i]]
        if period < np.inf:
            first[i] = -math.floor(high[i] / period)
            last[i] = 1 if low[i] <= max(1e-9, high[i] - low[i]) else 0  # it may get to none
            if problem.terms.more_turns == 1 and m > 0:
                most = min(time_left(problem) / period, 1e6)
                last[i] += 2 if time_left(problem) == np.inf else math.floor(most)
            last[i] = max(last[i], first[i])
        shifts[i] = first[i]
    while True:
        inside = True
        for i in range(n):
            times[i] = start[i]
            if shifts[i] != 0:
                times[i] += shifts[i] * problem.trims.periods[word[i]]
            if times[i] + (high[i] - low[i]) <= 0.0:
                inside = False
        for r in range(m):
            shift = 0.0
            for i in range(n):
                if shifts[i] != 0:
                    turned = shifts[i] * problem.trims.periods[word[i]]
                    shift += turned * problem.library.rows[r, word[i]]
            if not span[r, 0] <= problem.library.targets[r] - shift <= span[r, 1]:
                inside = False
        if inside:
            propose(problem, candidates, word, n, times)
        k = 0
        while k < n:
            shifts[k] += 1
            if shifts[k] <= last[k]:
                break
            shifts[k] = first[k]
            k += 1
        if k == n:
            return

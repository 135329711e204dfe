"""Three times of a word in closed form, the others given, and the gradient left for the others.

A word of n trims has n - 3 times more than the planar pose fixes. Three are solved for, `triple`
says at which positions; both branches of the closed form are continuous in the others.
"""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import bare_inner_kernel, inner_kernel
from maneuver_automaton.search._kernels_problem import Candidates, WordProblem, is_straight
from maneuver_automaton.words._kernels_steering import steer, unit
from maneuver_automaton.words._kernels_times import assign, end_and_columns


@bare_inner_kernel
def choose_triple(problem: WordProblem, word: IntArray, n: int, triple: IntArray) -> bool:
    """Fill `triple` with the positions solved in closed form, the last ones that fit.

    False if none fit: parallel neighbours cannot both be solved for, nor three straights. Two
    straights have a pole where they are parallel, so one is solved for if possible.
    """
    for straights in range(1, 3):
        for k in range(n - 1, 1, -1):
            for j in range(k - 1, 0, -1):
                if j == k - 1 and problem.parallel[word[j], word[k]]:
                    continue
                for i in range(j - 1, -1, -1):
                    if i == j - 1 and problem.parallel[word[i], word[j]]:
                        continue
                    count = 0
                    for position in (i, j, k):
                        if is_straight(problem, word[position]):
                            count += 1
                    if count <= straights:
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
    """Both branches (2, 3) of the times at `triple`, the other `times` being given.

    It takes what it needs, twists, goal, tolerance and the counter of its calls, and not the
    problem: a call hands over every field of every structure, and this is called at every node. A
    function for that would not do: it counts no references, so it may not return an array to one
    that does.
    """
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
            pose = moved(
                pose,
                complex(twists[t, 0], twists[t, 1]),
                twists[t, 2],
                times[i],
            )
    # goal seen from the end of the lead, before the tail
    z = complex(goal[0], goal[1])
    heading = goal[2] - pose[1]
    z -= pose[0] * unit(heading)
    z = (z - lead[0]) * unit(-lead[1])
    heading -= lead[1]
    a, b, c = word[triple[0]], word[triple[1]], word[triple[2]]
    steer(
        (complex(twists[a, 0], twists[a, 1]), twists[a, 2]),
        between_1,
        (complex(twists[b, 0], twists[b, 1]), twists[b, 2]),
        between_2,
        (complex(twists[c, 0], twists[c, 1]), twists[c, 2]),
        (z, heading),
        tolerance,
        out,
        -math.inf,
    )


@inner_kernel
def scratch_for(
    problem: WordProblem, word: IntArray, n: int, n_free: int
) -> tuple[Array, Array, Array, Array]:
    """Room for one word: branches (2, 3), columns (n, 3), gradients (1 + m, d), twists (n, 4)."""
    twists = np.empty((n, 4))
    for i in range(n):
        assign(twists[i], problem.twists[word[i]])
    return np.empty((2, 3)), np.empty((n, 3)), np.empty((1 + problem.targets.size, n_free)), twists


@bare_inner_kernel
def reduced_gradient(
    problem: WordProblem,
    word: IntArray,
    triple: IntArray,
    times: Array,
    free: IntArray,
    scratch: tuple[Array, Array, Array, Array],
) -> bool:
    """Fill the gradients of `scratch`: of the cost, and each linear condition, by the free times.

    The three solved times follow; row 0 is the cost, row 1 + r condition r. False if singular.
    """
    _, columns, out, twists = scratch
    end_and_columns(twists, times, columns)
    a, b, c = triple[0], triple[1], triple[2]
    u0 = columns[b, 1] * columns[c, 2] - columns[b, 2] * columns[c, 1]
    u1 = columns[b, 2] * columns[c, 0] - columns[b, 0] * columns[c, 2]
    u2 = columns[b, 0] * columns[c, 1] - columns[b, 1] * columns[c, 0]
    det = columns[a, 0] * u0 + columns[a, 1] * u1 + columns[a, 2] * u2
    if det == 0.0:
        return False
    v0 = columns[c, 1] * columns[a, 2] - columns[c, 2] * columns[a, 1]
    v1 = columns[c, 2] * columns[a, 0] - columns[c, 0] * columns[a, 2]
    v2 = columns[c, 0] * columns[a, 1] - columns[c, 1] * columns[a, 0]
    w0 = columns[a, 1] * columns[b, 2] - columns[a, 2] * columns[b, 1]
    w1 = columns[a, 2] * columns[b, 0] - columns[a, 0] * columns[b, 2]
    w2 = columns[a, 0] * columns[b, 1] - columns[a, 1] * columns[b, 0]
    for q in range(free.size):
        x, y, h = columns[free[q], 0], columns[free[q], 1], columns[free[q], 2]
        share_a = (x * u0 + y * u1 + h * u2) / det
        share_b = (x * v0 + y * v1 + h * v2) / det
        share_c = (x * w0 + y * w1 + h * w2) / det
        out[0, q] = (
            problem.rates[word[free[q]]]
            - share_a * problem.rates[word[a]]
            - share_b * problem.rates[word[b]]
            - share_c * problem.rates[word[c]]
        )
        for r in range(problem.targets.size):
            out[1 + r, q] = (
                problem.rows[r, word[free[q]]]
                - share_a * problem.rows[r, word[a]]
                - share_b * problem.rows[r, word[b]]
                - share_c * problem.rows[r, word[c]]
            )
    return True


@bare_inner_kernel
def take_branch(
    problem: WordProblem,
    word: IntArray,
    n: int,
    triple: IntArray,
    free: IntArray,
    branch: int,
    scratch: tuple[Array, Array, Array, Array],
    times: Array,
    values: Array,
) -> bool:
    """Fill `times` and `values` from one branch of `solve_triple`; False if it is empty.

    values[0] is what must vanish besides the linear conditions: the reduced gradient by the first
    free time, or its cross product with the condition's; values[1] by the second.
    """
    out, _, gradient, _ = scratch
    if math.isnan(out[branch, 0]):
        return False
    for s in range(3):
        times[triple[s]] = out[branch, s]
    d, m = free.size, problem.targets.size
    if d <= m:
        return True
    if not reduced_gradient(problem, word, triple, times, free, scratch):
        return False
    if m == 0:
        for q in range(d):
            values[q] = gradient[0, q]
    elif d == 2:
        values[0] = gradient[0, 0] * gradient[1, 1] - gradient[0, 1] * gradient[1, 0]
    return True


@bare_inner_kernel
def evaluate(
    problem: WordProblem,
    candidates: Candidates,
    word: IntArray,
    n: int,
    triple: IntArray,
    free: IntArray,
    times: Array,
    branch: int,
    scratch: tuple[Array, Array, Array, Array],
    values: Array,
) -> bool:
    """Solve one branch at given free times, and take it."""
    steering = (problem.twists, problem.goal, problem.tolerance, candidates.counter)
    solve_triple(steering, word, n, triple, times, scratch[0])
    return take_branch(problem, word, n, triple, free, branch, scratch, times, values)

"""Words with more times than the pose fixes: scan the others, solve three in closed form.

What vanishes at an optimum (the reduced gradient) or at a solution (a linear condition) is
bracketed between neighbouring nodes; Newton refines it later. Both branches of the closed form
are continuous, so a change of sign is a root.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from maneuver_automaton._compile import bare_inner_kernel, inner_kernel, merged_kernel
from maneuver_automaton.groups._kernels import coast, compose
from maneuver_automaton.search._kernels_problem import (
    AIM,
    FIRST,
    FOLLOWING,
    condition,
    is_straight,
    propose,
    time_left,
    word_extra,
)
from maneuver_automaton.words._kernels_steering import steer, unit
from maneuver_automaton.words._kernels_times import assign, end_and_columns

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from maneuver_automaton._arrays import Array, IntArray
    from maneuver_automaton.search._kernels_problem import Candidates, WordProblem

NONE_LEFT = 1e-9  # [m] that only rounding leaves


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
def unwrap(
    problem: WordProblem, word: IntArray, triple: IntArray, reference: Array, times: Array
) -> None:
    """Shift the solved turning times by whole turns to lie nearest to `reference`, in place."""
    for s in range(3):
        i = triple[s]
        period = problem.periods[word[i]]
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
    """Propose `start` for all whole turns with which the linear conditions can be met.

    `low` and `high` bound the times in a cell, unwrapped; `span` (m, 2) the conditions' values.
    """
    m = problem.targets.size
    shifts, first, last = candidates.turns[0], candidates.turns[1], candidates.turns[2]
    times = candidates.work
    for i in range(n):
        first[i], last[i] = 0, 0
        period = problem.periods[word[i]]
        if period < np.inf:
            first[i] = -math.floor(high[i] / period)
            last[i] = 1 if low[i] <= 1e-9 else 0
            if problem.more_turns == 1 and m > 0:
                most = (
                    2 if time_left(problem) == np.inf else math.floor(time_left(problem) / period)
                )
                last[i] += int(most)
            last[i] = max(last[i], first[i])
        shifts[i] = first[i]
    while True:
        inside = True
        for i in range(n):
            times[i] = start[i]
            if shifts[i] != 0:
                times[i] += shifts[i] * problem.periods[word[i]]
            if times[i] + (high[i] - low[i]) <= 0.0:
                inside = False
        for r in range(m):
            shift = 0.0
            for i in range(n):
                if shifts[i] != 0:
                    shift += shifts[i] * problem.periods[word[i]] * problem.rows[r, word[i]]
            if not span[r, 0] <= problem.targets[r] - shift <= span[r, 1]:
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


@bare_inner_kernel
def affordable(
    problem: WordProblem, word: IntArray, n: int, trim: int, upper_bound: float
) -> float:
    """How long one trim of a word may last before it alone costs more than `upper_bound`."""
    reach = problem.reaches[trim]
    if problem.rates[trim] > 0.0:
        left = upper_bound - problem.pad_cost - word_extra(problem, word, n)
        reach = min(reach, left / problem.rates[trim])
    return reach


@bare_inner_kernel
def copy_branches(target: Array, source: Array) -> None:
    """Copy what `solve_triple` filled in."""
    for branch in range(2):
        assign(target[branch], source[branch])


@inner_kernel
def scan_one(
    problem: WordProblem,
    candidates: Candidates,
    word: IntArray,
    n: int,
    triple: IntArray,
    free: IntArray,
    upper_bound: float,
) -> None:
    """Words with one free time: roots of a scalar function along both branches."""
    q = free[0]
    m = problem.targets.size
    reach = affordable(problem, word, n, word[q], upper_bound)
    if not reach > 0.0:
        return
    nodes = max(8, math.ceil(problem.nodes * reach / problem.reaches[word[q]]))
    scratch = scratch_for(problem, word, n, 1)
    values = np.zeros(2)
    both = np.empty((2, 3))
    times = np.zeros(n)
    there = np.zeros((2, nodes + 1), dtype=np.bool_)
    node_times = np.zeros((2, nodes + 1, n))
    node_values = np.zeros((2, nodes + 1))
    costs = np.zeros((2, nodes + 1))
    steering = (problem.twists, problem.goal, problem.tolerance, candidates.counter)
    most = nearly_cheap(problem, word, n, upper_bound)
    for j in range(nodes + 1):
        times[q] = reach * j / nodes
        solve_triple(steering, word, n, triple, times, both)
        for branch in range(2):
            costs[branch, j] = coasting_cost(problem, word, triple, q, times[q], both[branch])
            copy_branches(scratch[0], both)
            if take_branch(problem, word, n, triple, free, branch, scratch, times, values):
                there[branch, j] = True
                assign(node_times[branch, j], times)
                if m == 0:
                    node_values[branch, j] = values[0]
                elif j > 0 and there[branch, j - 1]:  # continuous from node to node
                    unwrap(problem, word, triple, node_times[branch, j - 1], times)
                    step = condition(problem, word, n, m - 1, times)
                    step -= condition(problem, word, n, m - 1, node_times[branch, j - 1])
                    node_values[branch, j] = node_values[branch, j - 1] + step
                else:
                    node_values[branch, j] = condition(problem, word, n, m - 1, times)
    stack = (np.zeros((24, n)), np.zeros((24, n)), np.zeros((24, 4)))
    for branch in range(2):
        for j in range(nodes):
            if not may_be_cheap(costs[branch, j], costs[branch, j + 1], most):
                continue
            if not (there[branch, j] or there[branch, j + 1]):
                continue
            bend = np.inf
            if j > 0 and j + 2 <= nodes and there[branch, j] and there[branch, j + 1]:
                bend = 0.0
                for k in range(j, j + 2):
                    if there[branch, k - 1] and there[branch, k + 1]:
                        second = node_values[branch, k - 1] - 2.0 * node_values[branch, k]
                        bend = max(bend, 0.5 * abs(second + node_values[branch, k + 1]))
                    else:
                        bend = np.inf
            low, high, numbers = stack
            assign(low[0], node_times[branch, j])
            assign(high[0], node_times[branch, j + 1])
            low[0, q], high[0, q] = reach * j / nodes, reach * (j + 1) / nodes
            numbers[0, 0], numbers[0, 1] = node_values[branch, j], node_values[branch, j + 1]
            numbers[0, 2], numbers[0, 3] = bend, 0.0
            if not there[branch, j + 1]:  # the branch ends in between
                assign(high[0], low[0])
                numbers[0, 1] = fold(
                    problem, candidates, word, n, triple, free, high[0], reach * (j + 1) / nodes,
                    branch, scratch, values,
                )  # fmt: skip
            elif not there[branch, j]:
                assign(low[0], high[0])
                numbers[0, 0] = fold(
                    problem, candidates, word, n, triple, free, low[0], reach * j / nodes,
                    branch, scratch, values,
                )  # fmt: skip
            bisect(problem, candidates, word, n, triple, free, branch, scratch, values, stack)


@merged_kernel
def any_node_may_do(
    problem: WordProblem,
    candidates: Candidates,
    word: IntArray,
    n: int,
    triple: IntArray,
    room: tuple[Array, Array, Array],
    upper_bound: float,
) -> bool:
    """Whether a word with one free time may have a solution, as far as its nodes show.

    At one of them it costs little more than the upper bound and, where a time is to be met, at one
    of them, maybe another, the last condition comes near to its target. That is no proof, but takes
    a tenth of the time that the reduced gradients and the bisection take. To climb is no reason:
    of words that climb too many were left out, and plans came out 3 % dearer.
    """
    times, out, _ = room
    q = 6 - triple[0] - triple[1] - triple[2]  # the position of four that is not solved for
    reach = affordable(problem, word, n, word[q], upper_bound)
    if not reach > 0.0:
        return False
    m = problem.targets.size
    most = nearly_cheap(problem, word, n, upper_bound)
    lowest = upper_bound - problem.pad_cost - word_extra(problem, word, n)
    nodes = max(8, math.ceil(problem.nodes * reach / problem.reaches[word[q]]))
    is_cheap, is_near = False, m == 0 or time_left(problem) == np.inf
    before = (math.nan, math.nan)  # what each branch lacked at the node before
    per_metre = least_per_metre(problem, word, n, q)
    steering = (problem.twists, problem.goal, problem.tolerance, candidates.counter)
    for j in range(nodes + 1):
        times[q] = reach * j / nodes
        if is_near and q == 0 and least_after(problem, word[0], times[0], per_metre) >= lowest:
            continue  # no time of the others makes it cheap
        solve_triple(steering, word, n, triple, times, out)
        lacks = (math.nan, math.nan)
        for branch in range(2):
            cost = coasting_cost(problem, word, triple, q, times[q], out[branch])
            is_cheap = is_cheap or cost < most  # not where the branch is empty: NaN
            if is_near:
                continue
            for s in range(3):
                times[triple[s]] = out[branch, s]
            lack = problem.targets[m - 1] - condition(problem, word, n, m - 1, times)
            is_near = is_met_nearby(problem, word, triple, lack, before[branch])
            lacks = (lack, lacks[1]) if branch == 0 else (lacks[0], lack)
        if is_cheap and is_near:
            return True
        before = lacks
    return False


@merged_kernel
def nearly_cheap(problem: WordProblem, word: IntArray, n: int, upper_bound: float) -> float:
    """What the trims of a word may cost at a node for it to be looked at."""
    if problem.slack == np.inf:
        return np.inf
    extra = problem.pad_cost + word_extra(problem, word, n)
    return upper_bound * (1.0 + problem.slack) - extra


@bare_inner_kernel
def may_be_cheap(one: float, other: float, most: float) -> bool:
    """Whether a branch that costs `one` and `other` at two nodes may cost less between them.

    Less than `most`, if it falls no more than it does from one to the other. NaN where it is not at
    a node.
    """
    change = abs(other - one)
    if math.isnan(change):
        return one < most or other < most
    return min(one, other) - change < most


@merged_kernel
def coasting_cost(
    problem: WordProblem, word: IntArray, triple: IntArray, free: int, time: float, solved: Array
) -> float:
    """What the trims of a word cost: one for a given time, three for the times of a branch.

    A negative time, of a straight, costs as much as a positive one: so far it is from admissible.
    """
    cost = problem.rates[word[free]] * time
    for s in range(3):
        cost += problem.rates[word[triple[s]]] * abs(solved[s])
    return cost


@merged_kernel
def least_per_metre(problem: WordProblem, word: IntArray, n: int, left_out: int) -> float:
    """Best price per metre among the trims of a word but one; -inf where one of them pays."""
    price = np.inf
    for i in range(n):
        if i != left_out:
            price = min(price, problem.prices[word[i], 0])
            if problem.rates[word[i]] < 0.0:
                price = -np.inf
    return price


@merged_kernel
def least_after(problem: WordProblem, trim: int, time: float, per_metre: float) -> float:
    """Lower bound of what coasting costs in a word whose first trim lasts `time`.

    From where it ends, and the transition before it began, the rest of the word has to lead to the
    goal: as far as its transitions cannot, at `per_metre`. NaN for no bound.
    """
    v, u, w = problem.twists[trim, 0], problem.twists[trim, 1], problem.twists[trim, 2]
    dx, dy, heading = coast(v, u, w, time)
    x, y, _ = compose(dx, dy, heading, problem.fixed[FIRST], problem.fixed[FIRST + 1], 0.0)
    distance = math.hypot(problem.fixed[AIM] - x, problem.fixed[AIM + 1] - y)
    left = distance - problem.fixed[FOLLOWING]
    if per_metre < 0.0:
        return math.nan
    return problem.rates[trim] * time + (left * per_metre if left > NONE_LEFT else 0.0)


@merged_kernel
def is_met_nearby(
    problem: WordProblem, word: IntArray, triple: IntArray, lack: float, before: float
) -> bool:
    """Whether what a condition lacks at a node is next to nothing, or whole turns can make it up.

    Somewhere it lacks nothing if that changes its sign since the node `before`: NaN for none.
    """
    target = problem.targets[problem.targets.size - 1]
    if abs(lack) <= problem.slack * abs(target) or lack * before <= 0.0:
        return True
    if problem.more_turns == 1:
        for s in range(3):
            i = word[triple[s]]
            if problem.periods[i] < np.inf:
                turn = problem.periods[i] * problem.rows[problem.targets.size - 1, i]
                if lack * turn > 0.0 and abs(lack) >= (1.0 - problem.slack) * abs(turn):
                    return True
    return False


@inner_kernel
def fold(
    problem: WordProblem,
    candidates: Candidates,
    word: IntArray,
    n: int,
    triple: IntArray,
    free: IntArray,
    edge: Array,
    beyond: float,
    branch: int,
    scratch: tuple[Array, Array, Array, Array],
    values: Array,
) -> float:
    """Move `edge` along its branch as far towards `beyond` as the branch goes; its value there."""
    q = free[0]
    trial = np.empty(edge.size)
    assign(trial, edge)
    evaluate(problem, candidates, word, n, triple, free, trial, branch, scratch, values)
    value = values[0]
    good = edge[q]
    for _ in range(30):
        trial[q] = 0.5 * (good + beyond)
        if evaluate(problem, candidates, word, n, triple, free, trial, branch, scratch, values):
            good = trial[q]
            assign(edge, trial)
            value = values[0]
        else:
            beyond = trial[q]
    return value


@inner_kernel
def bisect(
    problem: WordProblem,
    candidates: Candidates,
    word: IntArray,
    n: int,
    triple: IntArray,
    free: IntArray,
    branch: int,
    scratch: tuple[Array, Array, Array, Array],
    values: Array,
    stack: tuple[Array, Array, Array],
) -> None:
    """Halve the interval on the stack where its bend leaves room for a root; propose the roots."""
    lows, highs, numbers = stack
    q = free[0]
    m = problem.targets.size
    middle = np.empty(n)
    ends = np.empty((2, n))
    span = np.empty((m, 2))
    top = 0
    while top >= 0:
        low, high = lows[top], highs[top]
        value_low, value_high, bend, depth = (
            numbers[top, 0], numbers[top, 1], numbers[top, 2], numbers[top, 3],
        )  # fmt: skip
        top -= 1
        for i in range(n):
            middle[i] = 0.5 * (low[i] + high[i])
        if m == 0:
            change = abs(value_high - value_low)
            possible = min(abs(value_low), abs(value_high)) <= bend or value_low * value_high <= 0.0
            if max(abs(value_low), abs(value_high)) < 1e-9:
                possible = False  # flat: all these times cost the same
            settled = bend <= 0.5 * change
            if possible and settled and value_low < 0.0 <= value_high:
                secant(problem, candidates, word, n, triple, free, branch, scratch, values,
                       low, value_low, high, value_high, middle, span)  # fmt: skip
        else:
            unwrap(problem, word, triple, low, high)
            at_low = condition(problem, word, n, m - 1, low)
            at_high = condition(problem, word, n, m - 1, high)
            change = abs(at_high - at_low)
            wide = bend if bend < np.inf else 1e300
            span[0, 0], span[0, 1] = min(at_low, at_high) - wide, max(at_low, at_high) + wide
            for i in range(n):
                middle[i] = 0.5 * (low[i] + high[i])
            settled = bend <= 0.5 * change
            before = candidates.counter[0]
            for i in range(n):
                ends[0, i], ends[1, i] = min(low[i], high[i]), max(low[i], high[i])
            levels(problem, candidates, word, n, middle, ends[0], ends[1], span)
            possible = candidates.counter[0] > before
            if bend > 0.0:  # that was with room for the bend: only what is left counts
                candidates.counter[0] = before
                if possible and (settled or depth >= 8.0):
                    span[0, 0], span[0, 1] = min(at_low, at_high), max(at_low, at_high)
                    levels(problem, candidates, word, n, middle, ends[0], ends[1], span)
        if not possible or depth >= 8.0 or (settled and bend <= 0.25 * change):
            continue
        middle[q] = 0.5 * (low[q] + high[q])
        if not evaluate(
            problem, candidates, word, n, triple, free, middle, branch, scratch, values
        ):
            continue
        if m == 0:
            off = abs(values[0] - 0.5 * (value_low + value_high))
        else:
            unwrap(problem, word, triple, low, middle)
            off = abs(condition(problem, word, n, m - 1, middle) - 0.5 * (at_low + at_high))
        # upper half first onto the stack: it overwrites the interval that was taken off
        assign(lows[top + 2], middle)
        assign(highs[top + 2], high)
        assign(highs[top + 1], middle)
        numbers[top + 2, 0], numbers[top + 2, 1] = values[0], value_high
        numbers[top + 1, 0], numbers[top + 1, 1] = value_low, values[0]
        for k in range(1, 3):
            numbers[top + k, 2], numbers[top + k, 3] = off, depth + 1.0
        top += 2


@bare_inner_kernel
def secant(
    problem: WordProblem,
    candidates: Candidates,
    word: IntArray,
    n: int,
    triple: IntArray,
    free: IntArray,
    branch: int,
    scratch: tuple[Array, Array, Array, Array],
    values: Array,
    low: Array,
    value_low: float,
    high: Array,
    value_high: float,
    middle: Array,
    span: Array,
) -> None:
    """Narrow down where the reduced gradient rises through zero, and propose it."""
    q = free[0]
    left, right = low[q], high[q]
    for step in range(12):
        share = 0.5
        if step % 3 != 2 and value_high > value_low:
            share = min(0.9, max(0.1, -value_low / (value_high - value_low)))
        middle[q] = left + share * (right - left)
        if not evaluate(
            problem, candidates, word, n, triple, free, middle, branch, scratch, values
        ):
            return
        if values[0] < 0.0:
            left, value_low = middle[q], values[0]
        else:
            right, value_high = middle[q], values[0]
        if right - left < 1e-3:
            break
    levels(problem, candidates, word, n, middle, middle, middle, span)


@inner_kernel
def scan_two(
    problem: WordProblem,
    candidates: Candidates,
    word: IntArray,
    n: int,
    triple: IntArray,
    free: IntArray,
    upper_bound: float,
) -> None:
    """Words with two free times: cells of a grid in which both functions change sign."""
    reaches = np.empty(2)
    counts = np.empty(2, dtype=np.int64)
    for k in range(2):
        full = problem.reaches[word[free[k]]]
        reaches[k] = affordable(problem, word, n, word[free[k]], upper_bound)
        if not reaches[k] > 0.0:
            return
        counts[k] = max(4, math.ceil(problem.nodes_2d * reaches[k] / full))
    scratch = scratch_for(problem, word, n, 2)
    n_0, n_1 = counts[0] + 1, counts[1] + 1
    there = np.zeros((2, n_0, n_1), dtype=np.bool_)
    node_times = np.zeros((2, n_0, n_1, n))
    node_values = np.zeros((2, n_0, n_1, 2))
    times = np.zeros(n)
    values = np.zeros(2)
    steering = (problem.twists, problem.goal, problem.tolerance, candidates.counter)
    for i in range(n_0):
        for j in range(n_1):
            times[free[0]] = reaches[0] * i / counts[0]
            times[free[1]] = reaches[1] * j / counts[1]
            total = times[free[0]] + times[free[1]]
            if total > time_left(problem) * (1.0 + 2.0 / problem.nodes_2d):
                continue
            solve_triple(steering, word, n, triple, times, scratch[0])
            for branch in range(2):
                if take_branch(problem, word, n, triple, free, branch, scratch, times, values):
                    there[branch, i, j] = True
                    assign(node_times[branch, i, j], times)
                    assign(node_values[branch, i, j], values)
    for branch in range(2):
        for i in range(n_0 - 1):
            for j in range(n_1 - 1):
                cell(
                    problem, candidates, word, n, triple,
                    there[branch], node_times[branch], node_values[branch], i, j,
                )  # fmt: skip


@inner_kernel
def cell(
    problem: WordProblem,
    candidates: Candidates,
    word: IntArray,
    n: int,
    triple: IntArray,
    there: NDArray[np.bool_],
    node_times: Array,
    node_values: Array,
    i: int,
    j: int,
) -> None:
    """Propose a start in a cell if what must vanish can vanish in it."""
    m = problem.targets.size
    first_i, first_j = -1, -1
    corners = 0
    low_0, high_0 = np.inf, -np.inf
    low_1, high_1 = np.inf, -np.inf
    for di in range(2):
        for dj in range(2):
            if there[i + di, j + dj]:
                corners += 1
                if first_i < 0:
                    first_i, first_j = i + di, j + dj
                low_0 = min(low_0, node_values[i + di, j + dj, 0])
                high_0 = max(high_0, node_values[i + di, j + dj, 0])
                low_1 = min(low_1, node_values[i + di, j + dj, 1])
                high_1 = max(high_1, node_values[i + di, j + dj, 1])
    if corners == 0:
        return
    if corners == 4 and m <= 1 and not low_0 <= 0.0 <= high_0:
        return
    if corners == 4 and m == 0 and not low_1 <= 0.0 <= high_1:
        return
    reference = node_times[first_i, first_j]
    mean = np.zeros(n)
    low = np.empty(n)
    high = np.empty(n)
    times = np.empty(n)
    for k in range(n):
        low[k], high[k] = np.inf, -np.inf
    span = np.empty((m, 2))
    for r in range(m):
        span[r, 0], span[r, 1] = np.inf, -np.inf
    for di in range(2):
        for dj in range(2):
            if there[i + di, j + dj]:
                assign(times, node_times[i + di, j + dj])
                unwrap(problem, word, triple, reference, times)
                for k in range(n):
                    mean[k] += times[k] / corners
                    low[k] = min(low[k], times[k])
                    high[k] = max(high[k], times[k])
                for r in range(m):
                    value = condition(problem, word, n, r, times)
                    span[r, 0] = min(span[r, 0], value)
                    span[r, 1] = max(span[r, 1], value)
    if corners < 4:  # a branch ends here, and bends sharply: look a little further
        for r in range(m):
            width = span[r, 1] - span[r, 0]
            span[r, 0] -= width
            span[r, 1] += width
    levels(problem, candidates, word, n, mean, low, high, span)

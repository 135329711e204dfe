"""What a word costs at the nodes of its scan, and whether it is worth a closer look.

A word is left out before its gradients are asked for: where no node is nearly cheap enough, or
where a time that is to be met is not nearly met.
"""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import bare_inner_kernel
from maneuver_automaton.groups._kernels import coast, compose
from maneuver_automaton.search._kernels_cell_turns import TINY, least_turn
from maneuver_automaton.search._kernels_problem import (
    AIM,
    FIRST,
    FOLLOWING,
    Candidates,
    WordProblem,
    condition,
    time_left,
    word_extra,
)
from maneuver_automaton.search._kernels_triple import solve_triple
from maneuver_automaton.words._kernels_steering import phase, unit

NONE_LEFT = 1e-9  # [m] that only rounding leaves


@bare_inner_kernel
def affordable(
    problem: WordProblem, word: IntArray, n: int, trim: int, reach: float, upper_bound: float
) -> float:
    """How long, of `reach`, one trim may last before it alone costs more than `upper_bound`."""
    if problem.library.rates[trim] > 0.0:
        left = upper_bound - problem.terms.pad_cost - word_extra(problem, word, n)
        reach = min(reach, left / problem.library.rates[trim])
    return reach


@bare_inner_kernel
def any_node_may_do(
    problem: WordProblem,
    candidates: Candidates,
    word: IntArray,
    n: int,
    triple: IntArray,
    room: tuple[Array, Array, Array],
    upper_bound: float,
) -> bool:
    """Whether a word with one free time may have a solution, as far as its nodes show."""
    # At one of them it costs little more than the upper bound and, where a time is to be met, at
    # one the last condition comes near to its target. No proof, but a tenth of the time that the
    # reduced gradients and the bisection take. To climb is no reason: of words that climb too many
    # were left out, and plans came out 3 % costlier.
    times, out, _ = room
    q = 6 - triple[0] - triple[1] - triple[2]  # the position of four that is not solved for
    reach = affordable(problem, word, n, word[q], problem.trims.reaches[word[q]], upper_bound)
    if not reach > 0.0:
        return False
    m = problem.library.targets.size
    most = nearly_cheap(problem, word, n, upper_bound)
    lowest = upper_bound - problem.terms.pad_cost - word_extra(problem, word, n)
    nodes = max(8, math.ceil(problem.scan.nodes * reach / problem.trims.reaches[word[q]]))
    is_cheap, is_near = False, m == 0 or time_left(problem) == np.inf
    before = (math.nan, math.nan)  # what each branch lacked at the node before
    per_metre = least_per_metre(problem, word, n, q)
    library = problem.library
    steering = library.twists, library.goal, problem.scan.tolerance, candidates.counter
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
            lack = problem.library.targets[m - 1] - condition(problem, word, n, m - 1, times)
            is_near = is_met_nearby(problem, word, triple, lack, before[branch])
            lacks = (lack, lacks[1]) if branch == 0 else (lacks[0], lack)
        if is_cheap and is_near:
            return True
        before = lacks
    return False


@bare_inner_kernel
def may_be_optimal(problem: WordProblem, word: IntArray, number: int, upper_bound: float) -> bool:
    """Whether the word of a number, of four trims, may be locally optimal below `upper_bound`."""
    # Its momentum lies in a cell of one of its rows: there start and goal alone decide what has to
    # be met, and the cost is at least that of the trims between and of the turns and ways outside.
    known = problem.scan.momenta
    if problem.library.targets.size > 0 or upper_bound == np.inf or known.cells.shape[0] == 0:
        return True
    if known.rows[number, 0] > known.rows[number, 1]:
        return True
    most = upper_bound + TINY * (1.0 + abs(upper_bound))
    most -= problem.terms.pad_cost + word_extra(problem, word, 4)
    one, other = problem.library.twists[word[0]], problem.library.twists[word[3]]
    goal, facing = problem.library.goal, unit(problem.library.goal[2])
    way = complex(goal[0], goal[1])  # from the centre of the first trim to that of the last one
    if one[2] != 0.0:
        way -= 1j * one[0] / one[2]
    if other[2] != 0.0:
        way += 1j * other[0] / other[2] * facing
    if one[2] != 0.0 and other[2] != 0.0:
        aim = phase(way)
        met, first, last = way.real * way.real + way.imag * way.imag, aim, goal[2] - aim
    elif one[2] != 0.0:
        way *= facing.conjugate()
        met, first, last = way.imag, goal[2], way.real
    else:
        met, first, last = way.imag, way.real, goal[2]
    for k in range(known.rows[number, 0], known.rows[number, 1]):
        for j in range(known.cells.shape[1]):
            cell = known.cells[k, j]
            if not cell[0] <= met <= cell[1] or cell[2] >= most:
                continue
            cost = cell[2] + least_alone(problem, word[0], first + cell[3], first + cell[4])
            if cost + least_alone(problem, word[3], last + cell[5], last + cell[6]) < most:
                return True
    return False


@bare_inner_kernel
def least_alone(problem: WordProblem, trim: int, low: float, high: float) -> float:
    """Least cost of a trim that turns by an angle, or goes a way, from `low` to `high`."""
    v, w = problem.library.twists[trim, 0], problem.library.twists[trim, 2]
    if w != 0.0:
        return problem.library.rates[trim] / abs(w) * least_turn(low, high, w)
    if v < 0.0:
        low, high = -high, -low
    return problem.library.rates[trim] / abs(v) * max(low, 0.0) if high >= 0.0 else math.inf


@bare_inner_kernel
def nearly_cheap(problem: WordProblem, word: IntArray, n: int, upper_bound: float) -> float:
    """What the trims of a word may cost at a node for it to be looked at."""
    if problem.scan.slack == np.inf:
        return np.inf
    extra = problem.terms.pad_cost + word_extra(problem, word, n)
    return upper_bound * (1.0 + problem.scan.slack) - extra


@bare_inner_kernel
def may_be_cheap(one: float, other: float, most: float) -> bool:
    """Whether a branch that costs `one` and `other` at two nodes may cost below `most` between."""
    # It may fall as much as it does from one to the other. NaN where it is not at a node.
    change = abs(other - one)
    if math.isnan(change):
        return one < most or other < most
    return min(one, other) - change < most


@bare_inner_kernel
def coasting_cost(
    problem: WordProblem, word: IntArray, triple: IntArray, free: int, time: float, solved: Array
) -> float:
    """What the trims of a word cost: one for a given time, three for the times of a branch."""
    # A negative time, of a straight, costs as much as a positive one: so far it is from admissible.
    cost = problem.library.rates[word[free]] * time
    for s in range(3):
        cost += problem.library.rates[word[triple[s]]] * abs(solved[s])
    return cost


@bare_inner_kernel
def least_per_metre(problem: WordProblem, word: IntArray, n: int, left_out: int) -> float:
    """Best price per metre among the trims of a word but one; -inf where one of them pays."""
    price = np.inf
    for i in range(n):
        if i != left_out:
            price = min(price, problem.trims.prices[word[i], 0])
            if problem.library.rates[word[i]] < 0.0:
                price = -np.inf
    return price


@bare_inner_kernel
def least_after(problem: WordProblem, trim: int, time: float, per_metre: float) -> float:
    """Lower bound of what coasting costs in a word whose first trim lasts `time`."""
    # From where it ends, and the transition before it began, the rest of the word has to lead to
    # the goal: as far as its transitions cannot, at `per_metre`. NaN for no bound.
    v, u, w = problem.library.twists[trim, :3]
    dx, dy, heading = coast(v, u, w, time)
    x, y, _ = compose(dx, dy, heading, problem.fixed[FIRST], problem.fixed[FIRST + 1], 0.0)
    distance = math.hypot(problem.fixed[AIM] - x, problem.fixed[AIM + 1] - y)
    left = distance - problem.fixed[FOLLOWING]
    if per_metre < 0.0:
        return math.nan
    return problem.library.rates[trim] * time + (left * per_metre if left > NONE_LEFT else 0.0)


@bare_inner_kernel
def is_met_nearby(
    problem: WordProblem, word: IntArray, triple: IntArray, lack: float, before: float
) -> bool:
    """Whether what a condition lacks at a node is next to nothing, or whole turns make it up."""
    # Somewhere it lacks nothing if that changes its sign since the node `before`: NaN for none.
    target = problem.library.targets[-1]
    if abs(lack) <= problem.scan.slack * abs(target) or lack * before <= 0.0:
        return True
    if problem.terms.more_turns == 1:
        for s in range(3):
            i = word[triple[s]]
            if problem.trims.periods[i] < np.inf:
                turn = problem.trims.periods[i] * problem.library.rows[-1, i]
                if lack * turn > 0.0 and abs(lack) >= (1.0 - problem.scan.slack) * abs(turn):
                    return True
    return False

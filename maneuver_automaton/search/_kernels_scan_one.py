"""Words with one free time: scan it, bracket the roots, and halve the brackets.

What vanishes at an optimum (the reduced gradient) or at a solution (a linear condition) is
bracketed between neighbouring nodes; Newton refines it later. Both branches of the closed form
are continuous, so a change of sign is a root.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import bare_inner_kernel
from maneuver_automaton.search._kernels_cell_costs import (
    closed_form,
    has_bounds,
    least_costs,
    margin,
    mark_cheap_cells,
)
from maneuver_automaton.search._kernels_cell_turns import TINY, ClosedForm, Four
from maneuver_automaton.search._kernels_problem import (
    Candidates,
    WordProblem,
    condition,
    is_straight,
    time_left,
    word_extra,
)
from maneuver_automaton.search._kernels_scan_costs import (
    affordable,
    coasting_cost,
    may_be_cheap,
    nearly_cheap,
)
from maneuver_automaton.search._kernels_triple import (
    FreeTime,
    evaluate,
    levels,
    solve,
    take_branch,
    unwrap,
)
from maneuver_automaton.words._kernels_times import assign

NEARLY = 1e-4  # [m, s] a linear condition is met where branches end
NOTHING = 1e-7  # [s] that only rounding leaves of a time: arc cosines lose half of the digits
LEAST_NODES = 8
QUARTER = 0.25  # of a period, by which nearest whole turns may mislead
DOUBLED = 16  # cells beyond the usual reach, each twice as long
GOLDEN, SECTION = 40, 0.5 * (math.sqrt(5.0) - 1.0)
HALVED = 30  # times, of a cell in which branches end


@bare_inner_kernel
def scan_one(
    problem: WordProblem,
    candidates: Candidates,
    word: IntArray,
    n: int,
    triple: IntArray,
    upper_bound: float,
) -> None:
    """Words with one free time: roots of a scalar function along both branches."""
    room, q = candidates.nodes, 6 - triple[0] - triple[1] - triple[2]
    usual, grid = problem.trims.reaches[word[q]], room.grid
    reach = affordable(problem, word, n, word[q], usual, upper_bound)
    if not reach > 0.0:
        return
    nodes = max(LEAST_NODES, math.ceil(problem.scan.nodes * reach / usual))
    nodes = min(nodes, room.ends.size - DOUBLED)  # not one more by rounding
    for j in range(nodes + 1):
        grid[j] = reach * j / nodes
    if problem.library.targets.size > 0 and is_straight(problem, word[q]):
        # There and back it may be as long as the time admits, of which ever less depends then.
        latest = affordable(problem, word, n, word[q], time_left(problem), upper_bound)
        while grid[nodes] < latest < np.inf and nodes < room.ends.size:
            nodes += 1
            grid[nodes] = min(2.0 * grid[nodes - 1], latest)
    # cells between nodes in which a branch may be cheap enough: the others have no solution that
    # counts, and most words have none of these
    live, four = room.live[:, :nodes], FreeTime(word, n, triple, q)
    live[:] = True
    known = closed_form(problem, word, triple, q, room.stretches)
    cheap = np.inf  # what its trims may cost
    bounded = problem.library.targets.size == 0 and upper_bound < np.inf
    if bounded and has_bounds(problem, word, triple, q):
        cheap = upper_bound + TINY * (1.0 + abs(upper_bound))
        cheap -= problem.terms.pad_cost + word_extra(problem, word, n)
        if not mark_cheap_cells(known, reach, cheap, live):
            return
    for i in range(n):
        assign(room.twists[i], problem.library.twists[word[i]])
    room.ends[:nodes] = math.nan
    for j in range(nodes + 1):
        solve_node(problem, candidates, four, live, j)
    if problem.library.targets.size > 0:
        move_nodes(problem, candidates, four, nodes, known)
    most = nearly_cheap(problem, word, n, upper_bound)
    for branch in range(2):
        for j in range(nodes):
            if not live[branch, j]:
                continue
            if not may_be_cheap(room.costs[branch, j], room.costs[branch, j + 1], most):
                continue
            cell = j, nodes, cheap < np.inf
            if first_interval(problem, candidates, four, branch, cell, known):
                bisect(problem, candidates, four, branch, known, cheap)


@bare_inner_kernel
def solve_node(
    problem: WordProblem, candidates: Candidates, four: FreeTime, live: NDArray[np.bool_], j: int
) -> None:
    """Fill in a node, if it is at an end of a live cell, or next to one that is."""
    room, m = candidates.nodes, problem.library.targets.size
    times, values = room.work[0], room.values
    values[0, j], values[1, j] = math.nan, math.nan
    if not (is_wanted(live, 0, j) or is_wanted(live, 1, j)):
        return
    times[four.q] = room.grid[j]
    solve(problem, candidates, four, times)
    for branch in range(2):
        if not is_wanted(live, branch, j):
            continue
        room.costs[branch, j] = coasting_cost(
            problem, four.word, four.triple, four.q, times[four.q], room.both[branch]
        )
        value = take_branch(problem, room, four, branch, times)
        if math.isnan(value):
            continue
        assign(room.times[branch, j], times)
        if m > 0:
            value = condition(problem, four.word, four.n, m - 1, times)
            if j > 0 and not math.isnan(values[branch, j - 1]):  # continuous from node to node
                unwrap(problem, four.word, four.triple, room.times[branch, j - 1], times)
                step = condition(problem, four.word, four.n, m - 1, times)
                step -= condition(problem, four.word, four.n, m - 1, room.times[branch, j - 1])
                value = values[branch, j - 1] + step
        values[branch, j] = value


@bare_inner_kernel
def move_nodes(
    problem: WordProblem, candidates: Candidates, four: FreeTime, nodes: int, known: ClosedForm
) -> None:
    """Move nodes without solutions to where there are some between their neighbours."""
    # Branches may be there for a moment only: where circles touch, as after turns by exactly pi.
    room, grid, margins = candidates.nodes, candidates.nodes.grid, candidates.nodes.margins
    for j in range(nodes + 1):
        margins[j] = margin(known, grid[j]) if math.isnan(room.values[0, j]) else math.inf
    for j in range(nodes + 1):
        low, high = max(j - 1, 0), min(j + 1, nodes)
        least, greatest = min(margins[low], margins[high]), max(margins[low], margins[high])
        if 0.0 > margins[j] >= greatest and 2.0 * margins[j] >= least:
            left, right = grid[low], grid[high]
            for _ in range(GOLDEN):
                width = SECTION * (right - left)
                if margin(known, right - width) < margin(known, left + width):
                    left = right - width
                else:
                    right = left + width
            grid[j] = 0.5 * (left + right)
            solve_node(problem, candidates, four, room.live[:, :nodes], j)


@bare_inner_kernel
def is_wanted(live: NDArray[np.bool_], branch: int, j: int) -> bool:
    """Whether a node is at an end of a live cell, or next to one that is."""
    wanted = False
    for cell in range(max(j - 2, 0), min(j + 2, live.shape[1])):
        wanted = wanted or live[branch, cell]
    return wanted


@bare_inner_kernel
def unused_trims(problem: WordProblem, four: FreeTime, times: Array) -> int:
    """A bit for each trim of the triple that lasts no time, or a full turn."""
    unused = 0
    for s in range(3):
        i = four.triple[s]
        if min(abs(times[i]), problem.trims.periods[four.word[i]] - times[i]) <= NOTHING:
            unused |= 1 << s
    return unused


@bare_inner_kernel
def first_interval(
    problem: WordProblem,
    candidates: Candidates,
    four: FreeTime,
    branch: int,
    cell: tuple[int, int, bool],
    known: ClosedForm,
) -> bool:
    """Put a cell of a branch onto the stack; False where there is nothing to look for."""
    room, (j, nodes, pruned) = candidates.nodes, cell
    grid, values, (low, high, numbers) = room.grid, room.values[branch], room.stack[:, 0]
    at_low, at_high = not math.isnan(values[j]), not math.isnan(values[j + 1])
    if not (at_low or at_high):
        return False
    bend = np.inf
    if 0 < j < nodes - 1:
        bend = max(bend_at(values, j), bend_at(values, j + 1))
    assign(low, room.times[branch, j])
    assign(high, room.times[branch, j + 1])
    low[four.q], high[four.q] = grid[j], grid[j + 1]
    numbers[0], numbers[1], numbers[2], numbers[3] = values[j], values[j + 1], bend, 0.0
    here, beyond = (j, j + 1) if at_low else (j + 1, j)
    if not (at_low and at_high):  # both branches end in between, where they meet
        if math.isnan(room.ends[j]):
            room.ends[j] = end_of_branches(known, grid[here], grid[beyond])
        edge = high if beyond > here else low
        edge[four.q] = room.ends[j]
        numbers[beyond - j] = take_edge(problem, candidates, four, branch, edge)
    if pruned:
        # A trim that lasts no time at both ends and halfway lasts none in between, as the branch is
        # analytic: what there is to find is a shorter word, and the gradient nothing but rounding.
        unused = unused_trims(problem, four, low) & unused_trims(problem, four, high)
        middle = room.work[0]
        middle[four.q] = 0.5 * (low[four.q] + high[four.q])
        if unused and not math.isnan(evaluate(problem, candidates, four, middle, branch)):
            return not unused & unused_trims(problem, four, middle)
    return True


@bare_inner_kernel
def take_edge(
    problem: WordProblem, candidates: Candidates, four: FreeTime, branch: int, edge: Array
) -> float:
    """Fill `edge` with the times where a branch ends, and propose them; what is to vanish there."""
    value = evaluate(problem, candidates, four, edge, branch)
    if problem.library.targets.size > 0:  # branches may meet in a solution: then no sign changes
        assign(candidates.nodes.work[1], edge)
        assign(candidates.nodes.work[2], edge)
        propose_near(problem, candidates, four, edge, NEARLY)
    return value


@bare_inner_kernel
def propose_near(
    problem: WordProblem, candidates: Candidates, four: FreeTime, start: Array, around: float
) -> None:
    """Propose times of an interval where the last condition is met but for `around`."""
    room, library = candidates.nodes, problem.library
    _, least, greatest = room.work
    m = library.targets.size
    for r in range(m):
        value, wide = condition(problem, four.word, four.n, r, start), around
        for i in range(four.n if r < m - 1 else 0):
            wide += abs(library.rows[r, four.word[i]]) * (greatest[i] - least[i])
        room.span[r, 0], room.span[r, 1] = value - wide, value + wide
    levels(problem, candidates, four.word, four.n, start, least, greatest, room.span[:m])


@bare_inner_kernel
def bend_at(values: Array, k: int) -> float:
    """By how much a function bends at a node; inf where it is not known."""
    second = values[k - 1] - 2.0 * values[k] + values[k + 1]
    return np.inf if math.isnan(second) else 0.5 * abs(second)


@bare_inner_kernel
def end_of_branches(known: ClosedForm, good: float, beyond: float) -> float:
    """How far both branches go from a free time with solutions towards one without."""
    for _ in range(HALVED):  # where they end in the plane takes no angle
        middle = 0.5 * (good + beyond)
        if margin(known, middle) >= 0.0:
            good = middle
        else:
            beyond = middle
    return good


@bare_inner_kernel
def bisect(
    problem: WordProblem,
    candidates: Candidates,
    four: FreeTime,
    branch: int,
    known: ClosedForm,
    cheap: float,
) -> None:
    """Halve the interval on the stack if below `cheap` and bent enough for roots; propose these."""
    room, word, n, triple, q = candidates.nodes, four.word, four.n, four.triple, four.q
    (lows, highs, numbers), (middle, least, greatest) = room.stack, room.work
    top, m = 0, problem.library.targets.size
    while top >= 0:
        low, high = lows[top], highs[top]
        value_low, value_high, bend, depth = numbers[top]
        top -= 1
        if depth > 0.0 and cheap < np.inf and least_costs(known, low[q], high[q])[branch] > cheap:
            continue
        for i in range(n):
            middle[i] = 0.5 * (low[i] + high[i])
        if m == 0:
            change = abs(value_high - value_low)
            possible = min(abs(value_low), abs(value_high)) <= bend or value_low * value_high <= 0.0
            if max(abs(value_low), abs(value_high)) < 1e-9:
                possible = False  # flat: all these times cost the same
            settled = bend <= 0.5 * change
            if possible and settled and value_low < 0.0 <= value_high:
                ends_of_root = (low[q], value_low, high[q], value_high)
                secant(problem, candidates, four, branch, ends_of_root)
        else:
            unwrap(problem, word, triple, low, high)
            for i in triple:  # a turn may as well go the other way round: next to a centre
                if abs(high[i] - low[i]) > QUARTER * problem.trims.periods[word[i]]:
                    bend = np.inf
            for i in range(n):
                middle[i] = 0.5 * (low[i] + high[i])
                least[i], greatest[i] = min(low[i], high[i]), max(low[i], high[i])
            at_low = condition(problem, word, n, m - 1, low)
            at_high = condition(problem, word, n, m - 1, high)
            change = abs(at_high - at_low)
            settled = bend <= 0.5 * change
            before = candidates.counter[0]
            propose_near(problem, candidates, four, middle, 0.5 * change + bend)
            possible = candidates.counter[0] > before
            if bend > 0.0:  # that was with room for the bend: only what is left counts
                candidates.counter[0] = before
                if possible and settled:
                    propose_near(problem, candidates, four, middle, 0.5 * change)
                    propose_near(problem, candidates, four, low, NEARLY)
                    propose_near(problem, candidates, four, high, NEARLY)
                elif possible and depth >= 8.0:
                    propose_all_along(problem, candidates, four, top + 1, bend)
        if not possible or depth >= 8.0 or (settled and bend <= 0.25 * change):
            continue
        middle[q] = 0.5 * (low[q] + high[q])
        value = evaluate(problem, candidates, four, middle, branch)
        if math.isnan(value) and m == 0:
            continue
        # upper half first onto the stack: it overwrites the interval that was taken off
        assign(highs[top + 2], high)
        if math.isnan(value):  # branches end in between, and come back
            hole, off = middle[q], np.inf
            lows[top + 2, q] = end_of_branches(known, high[q], hole)
            take_edge(problem, candidates, four, branch, lows[top + 2])
            highs[top + 1, q] = end_of_branches(known, low[q], hole)
            take_edge(problem, candidates, four, branch, highs[top + 1])
        elif m == 0:
            off = abs(value - 0.5 * (value_low + value_high))
        else:
            unwrap(problem, word, triple, low, middle)
            off = abs(condition(problem, word, n, m - 1, middle) - 0.5 * (at_low + at_high))
        if not math.isnan(value):
            assign(lows[top + 2], middle)
            assign(highs[top + 1], middle)
        numbers[top + 2, 0], numbers[top + 2, 1] = value, value_high
        numbers[top + 1, 0], numbers[top + 1, 1] = value_low, value
        for k in range(1, 3):
            numbers[top + k, 2], numbers[top + k, 3] = off, depth + 1.0
        top += 2


@bare_inner_kernel
def propose_all_along(
    problem: WordProblem, candidates: Candidates, four: FreeTime, at: int, bend: float
) -> None:
    """Propose times of a short interval: at a root it may turn back, or jump from side to side."""
    room, (middle, least, greatest) = candidates.nodes, candidates.nodes.work
    low, high, around = (
        room.stack[0, at],
        room.stack[1, at],
        NEARLY + (bend if bend < np.inf else 0.0),
    )
    last = problem.library.targets.size - 1
    for way in range(8):  # every turn that jumps may do so either way
        i = four.triple[0 if way % 2 else 1 if way % 4 else 2]
        period = problem.trims.periods[four.word[i]]
        if way > 0:
            if not abs(high[i] - low[i]) > QUARTER * period:
                continue
            high[i] -= math.copysign(period, high[i] - low[i])
        for i in range(four.n):
            least[i], greatest[i], middle[i] = min(low[i], high[i]), max(low[i], high[i]), low[i]
        change = condition(problem, four.word, four.n, last, high)
        change -= condition(problem, four.word, four.n, last, low)
        for _ in range(5):
            propose_near(problem, candidates, four, middle, around + QUARTER * abs(change))
            for i in range(four.n):
                middle[i] += QUARTER * (high[i] - low[i])


@bare_inner_kernel
def secant(
    problem: WordProblem, candidates: Candidates, four: FreeTime, branch: int, ends: Four
) -> None:
    """Narrow down where the reduced gradient rises through zero, and propose it."""
    room, q = candidates.nodes, four.q
    middle = room.work[0]
    left, value_low, right, value_high = ends
    for step in range(12):
        share = 0.5
        if step % 3 != 2 and value_high > value_low:
            share = min(0.9, max(0.1, -value_low / (value_high - value_low)))
        middle[q] = left + share * (right - left)
        value = evaluate(problem, candidates, four, middle, branch)
        if math.isnan(value):
            return
        if value < 0.0:
            left, value_low = middle[q], value
        else:
            right, value_high = middle[q], value
        if right - left < 1e-3:
            break
    levels(problem, candidates, four.word, four.n, middle, middle, middle, room.span[:0])

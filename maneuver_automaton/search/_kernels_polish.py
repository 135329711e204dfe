"""From a rough start to a solution: refined to machine precision, checked, recorded once."""

from __future__ import annotations

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import bare_inner_kernel, inner_kernel, kernel, shared_kernel
from maneuver_automaton.search._kernels_problem import (
    Candidates,
    Found,
    Links,
    WordProblem,
    look,
    look_ahead,
    room_for,
    time_left,
    word_extra,
    write,
)
from maneuver_automaton.words._kernels_times import (
    TimesProblem,
    columns_of,
    curvature,
    newton_feasible,
    newton_stationary,
)

NEXT = 0.01  # relative, by which the cost of a start with one time free may be off
SAME = 1e-7  # relative, of costs: starts that cost the same may lead to one solution
MOMENT = 1e-6  # of the whole time: shorter trims may be due to rounding


@bare_inner_kernel
def place(
    problem: WordProblem, found: Found, word: IntArray, n: int, times: Array, cost: float
) -> None:
    """Record a solution unless the same one is there; keep the list of best costs."""
    count = found.counter[0]
    here = min(count, found.costs.size)  # there is a row more than solutions have room in
    write(problem, word, n, times, found.words[here], found.times[here])
    for k in range(here):
        if abs(found.costs[k] - cost) <= 1e-7 * (1.0 + abs(cost)):
            same = True
            for i in range(found.words.shape[1]):
                lasting = found.times[here, i]
                if found.words[k, i] != found.words[here, i]:
                    same = False
                    break
                if abs(found.times[k, i] - lasting) > 1e-6 * (1.0 + lasting):
                    same = False
                    break
            if same:
                return
    if count < found.costs.size:
        found.costs[count] = cost
    found.counter[0] = count + 1
    k = found.best.size
    if cost < found.best[k - 1]:
        k -= 1
        while k > 0 and found.best[k - 1] > cost:
            found.best[k] = found.best[k - 1]
            k -= 1
        found.best[k] = cost


@bare_inner_kernel
def accept(
    problem: WordProblem, found: Found, word: IntArray, n: int, times: Array, max_trims: int
) -> None:
    """Check a polished solution against all limits, and record it."""
    total = 0.0
    cost = 0.0
    trims = 0
    for i in range(n):
        if times[i] <= 1e-9:
            return
        if problem.terms.more_turns == 0 and times[i] > problem.trims.periods[word[i]] * (
            1.0 + 1e-9
        ):
            return
        if problem.trims.weights[word[i]] > 0.0:
            if times[i] < problem.terms.shortest - 1e-9:
                return
            trims += 1
            total += times[i]
            cost += times[i] * problem.library.rates[word[i]]
    if total > time_left(problem) + 1e-9:
        return
    padded = 0
    if problem.terms.pad == 1:
        cost += problem.terms.pad_cost
        if time_left(problem) - total > 1e-9:
            padded = 1
    if trims + padded > max_trims:
        return
    cost += word_extra(problem, word, trims) + problem.terms.switch * padded
    place(problem, found, word, n, times, cost)


@inner_kernel
def accept_with_turns(
    problem: WordProblem, found: Found, word: IntArray, n: int, times: Array, max_trims: int
) -> None:
    """Record a solution and, where admitted, the same with whole extra turns."""
    accept(problem, found, word, n, times, max_trims)
    if (
        problem.terms.more_turns == 0
        or time_left(problem) == np.inf
        or problem.library.targets.size > 0
    ):
        return
    total = 0.0
    shortest = np.inf
    for i in range(n):
        total += problem.trims.weights[word[i]] * times[i]
        shortest = min(shortest, problem.trims.periods[word[i]])
    if total + shortest > time_left(problem) + 1e-9:
        return
    extra = np.zeros(n, dtype=np.int64)
    longer = np.empty(n)
    while True:  # an odometer over the numbers of extra turns
        k = 0
        while k < n:
            extra[k] += 1
            total = 0.0
            for i in range(n):
                longer[i] = times[i]
                if extra[i] > 0 and problem.trims.weights[word[i]] > 0.0:
                    longer[i] += extra[i] * problem.trims.periods[word[i]]
                total += problem.trims.weights[word[i]] * longer[i]
            if total <= time_left(problem) + 1e-9 and problem.trims.weights[word[k]] > 0.0:
                break
            extra[k] = 0
            k += 1
        if k == n:
            return
        accept(problem, found, word, n, longer, max_trims)


@inner_kernel
def polish(
    problem: WordProblem,
    found: Found,
    word: IntArray,
    n: int,
    times: Array,
    isolated: int,
    max_trims: int,
) -> None:
    """Refine times to machine precision, check that they are locally optimal, and record them."""
    # Without linear conditions, a start with at most one time free lies next to its solution, and
    # Newton changes its cost by next to nothing. A start much costlier than all words asked for
    # need not be refined: most of the time would go there.
    m = problem.library.targets.size
    if n <= 4 and m == 0:
        costliest = found.best[found.best.size - 1]
        if start_cost(problem, word, n, times) > costliest + NEXT * (1.0 + abs(costliest)):
            return
    some = columns_of(problem.library, word, n)
    if isolated == 0:
        p, worst, slope = newton_stationary(some, times, 30)
        if not (worst < 1e-10 and slope < 1e-8):
            return
        for i in range(n):
            if times[i] <= 1e-9:
                return
        if not curvature(some, times, p) > 1e-10:
            return
    worst = newton_feasible(some, times, 8)
    if worst < 1e-10 and not is_neighbour(some, n, times):
        accept_with_turns(problem, found, word, n, times, max_trims)


@inner_kernel
def is_neighbour(problem: TimesProblem, n: int, times: Array) -> bool:
    """Whether a solution is one with a trim less, which rounding gives a moment."""
    # Where the conditions are tangent, times wrong by the root of the rounding error meet them to
    # the last bit. The word without its shortest trim then meets them as well.
    total = 0.0
    k = 0
    for i in range(n):
        total += times[i]
        if times[i] < times[k]:
            k = i
    if n < 2 or times[k] > MOMENT * total:
        return False
    kept = np.empty(n - 1, dtype=np.int64)
    left = np.empty(n - 1)
    for i in range(n - 1):
        kept[i] = i if i < k else i + 1
        left[i] = times[kept[i]]
    worst = newton_feasible(columns_of(problem, kept, n - 1), left, 8)
    return worst < 1e-13 * (1.0 + abs(problem.goal[0]) + abs(problem.goal[1]))


@bare_inner_kernel
def start_cost(problem: WordProblem, word: IntArray, n: int, times: Array) -> float:
    """What a word costs with the times from which it is refined."""
    cost: float = problem.terms.pad_cost + word_extra(problem, word, n)
    for i in range(n):
        cost += problem.library.rates[word[i]] * times[i]
    return cost


@bare_inner_kernel
def cheapest_start(problem: WordProblem, candidates: Candidates, count: int) -> int:
    """The first of the starts that cost least, of those with no time free; -1 if none."""
    # Of others several lead to one solution, and which of these comes first decides its last digit.
    least, first = np.inf, -1
    for k in range(count):
        if candidates.isolated[k] == 0:
            continue
        cost = start_cost(problem, candidates.words[k], candidates.sizes[k], candidates.times[k])
        if cost < least - SAME * (1.0 + abs(least)) or first < 0:
            least, first = cost, k
    return first


@kernel
def polish_candidates(
    problem: WordProblem, links: Links, candidates: Candidates, found: Found, max_trims: int
) -> None:
    """`polish_all`, for Python to call."""
    polish_all(problem, links, candidates, found, max_trims)


@shared_kernel
def polish_all(
    problem: WordProblem, links: Links, candidates: Candidates, found: Found, max_trims: int
) -> None:
    """Polish all candidates in order, and empty their buffer."""
    linked, width = links.cost.shape[0] > 1, candidates.words.shape[1]
    seen = room_for(problem, width) if linked else problem
    rows = np.empty(width, dtype=np.int64)
    count = min(candidates.counter[0], candidates.words.shape[0])
    # Where one solution is asked for, others need not be refined once the cheapest one is known.
    alone = found.best.size == 1 and problem.library.targets.size == 0 and not linked
    first = cheapest_start(problem, candidates, count) if alone else -1
    for step in range(-1, count):
        k = first if step < 0 else step
        if k < 0 or step == first:
            continue
        word, size = candidates.words[k], candidates.sizes[k]
        if linked:
            look_ahead(problem, links, seen, word, size)
            look(problem, links, seen, word, size, rows)
        times = np.empty(size)
        n = 0
        for i in range(size):
            # in a word with transitions, a trim that is passed through for no time has no row
            if not linked or candidates.times[k, i] != 0.0:
                rows[n], times[n] = i if linked else word[i], candidates.times[k, i]
                n += 1
        polish(seen, found, rows, n, times[:n], candidates.isolated[k], max_trims)
    candidates.counter[0] = 0

"""What every kernel of the search over words shares: the problem, its buffers, small helpers.

A word with transitions, seen from before all of them, is a word without: its trims have conjugated
twists, its goal lies before their product, and what the transitions cost and last is known
beforehand. So a word has two forms: the numbers of its trims in the whole problem, and the rows of
the problem that is `seen`, one for each of its trims. Without transitions, `seen` is the problem
itself, and both forms are the same.

Source: ``D exp(xi) = exp(Ad(D) xi) D``; Solà, Deray, Atchuthan (2018), Eq. (30).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import bare_inner_kernel, by_value, inner_kernel
from maneuver_automaton.groups._kernels import back_from, compose
from maneuver_automaton.words._kernels_times import TimesProblem

PARALLEL = 1e-9  # sine of the angle between twists below which they span one line


@by_value
class Alphabet(NamedTuple):
    """What a search over words knows of its trims, beside their motion and rates."""

    numbers: IntArray  # (M,) the number of each row in the whole problem
    prices: Array  # (M, 2) cost per metre and per radian, inf where a trim makes none
    periods: Array  # (M,) [s] time of a full turn, inf for straights
    reaches: Array  # (M,) [s] longest time of interest
    parallel: NDArray[np.bool_]  # (M, M) whether two twists are parallel
    weights: Array  # (M,) 1 where a trim takes time and counts, 0 for the turn of a free heading


class WordTerms(NamedTuple):
    """Limits and prices of a whole word."""

    time_limit: float  # [s] sum of all times at most this, transitions included; inf
    pad: int  # 1 where rest fills up to time_limit
    pad_cost: float  # cost of time_limit seconds of rest
    switch: float
    direction_change: float
    more_turns: int  # 1 where whole extra turns are admitted
    shortest: float  # [s] a shorter coasting time is not admitted


class Momenta(NamedTuple):
    """Bounds of what is locally optimal in words of four trims; see `momenta`."""

    rows: IntArray  # (M ** 4, 2) the rows of each word, from and to; 1 and 0 if not known
    cells: Array  # (R, N, 7) of what has to be met, the least cost, and of the outer trims


class ScanSettings(NamedTuple):
    """How closely the free time of a word is looked at."""

    nodes: int  # of the grid
    slack: float  # share by which a grid node may cost more than the upper bound, and be looked at
    tolerance: float  # of the steering function, relative
    momenta: Momenta


@by_value
class WordProblem(NamedTuple):
    """Trims and conditions: of all words of one search, or of the one word that is seen."""

    library: TimesProblem  # M trims; rates less that of rest where it pads, twists as they are seen
    trims: Alphabet
    size: IntArray  # (1,) trims of the word that is seen; 0 in the whole problem
    fixed: Array  # (9,) what is known of a word before its times are: COST, TIME, ... below
    terms: WordTerms
    scan: ScanSettings
    tail: int  # trim that ends every word without counting, -1 for none


# Places in `fixed`:
COST, TIME = 0, 1  # of the transitions
DISTANCE, TURN = 2, 3  # that are left to the trims at least
FIRST = 4  # x and y of the place after the first transition
FOLLOWING = 6  # distance that the transitions after the first cover, at most
AIM = 7  # x and y of the goal itself


class Links(NamedTuple):
    """The transitions between C classes of trims; one class, whose transition is the identity."""

    class_of: IntArray  # (M,) of each trim of the whole problem
    start: int  # class of the trim before the word
    goal: int  # class of the trim after it
    displacement: Array  # (C, C, 4)
    cost: Array  # (C, C) inf where there is none
    time: Array  # (C, C)
    gains: Array  # (m, C, C) what a transition adds to each linear condition


class Nodes(NamedTuple):
    """Room to look at a word with one free time, at N + 1 nodes of it at most, on both branches."""

    live: NDArray[np.bool_]  # (2, N) cells between nodes that may be cheap enough
    stretches: IntArray  # (40, 2) of cells that are looked at next
    times: Array  # (2, N + 1, 4) of its trims
    values: Array  # (2, N + 1) of what is to vanish, NaN where there is none
    costs: Array  # (2, N + 1)
    ends: Array  # (N,) free times at which branches end, where they do in a cell
    grid: Array  # (N + 1,) free times of the nodes
    margins: Array  # (N + 1,) how far from their ends both branches are, inf where they are there
    stack: Array  # (3, 24, 4) intervals: times at both ends; values there, bend, how often halved
    both: Array  # (2, 3) times of the triple
    twists: Array  # (4, 4) of the word's trims
    columns: Array  # (4, 3) derivatives of its end by the times
    work: Array  # (3, 4) times in the middle of an interval, the least and the greatest
    span: Array  # (2, 2) values of linear conditions


class Candidates(NamedTuple):
    """Starting points for Newton, filled by the scan and emptied by `polish_candidates`."""

    words: IntArray  # (capacity, S)
    times: Array  # (capacity, S)
    sizes: IntArray  # (capacity,) trims in the word
    isolated: IntArray  # (capacity,) 1 where the conditions alone fix the times
    counter: IntArray  # (3,): candidates, words looked at, steering calls
    turns: IntArray  # (3, S) integers to work with
    work: Array  # (S,) numbers to work with
    nodes: Nodes


class Found(NamedTuple):
    """Buffers of what has been found."""

    words: IntArray  # (capacity + 1, S) -1 after the last trim; the last row to work with
    times: Array  # (capacity + 1, S)
    costs: Array  # (capacity,)
    counter: IntArray  # (1,)
    best: Array  # (K + 1,) cheapest costs so far, ascending; the last is the upper bound


@bare_inner_kernel
def word_extra(problem: WordProblem, word: IntArray, n: int) -> float:
    """Price of the switches and transitions of a word."""
    return problem.fixed[COST] + switch_prices(problem, word, n)


@bare_inner_kernel
def switch_prices(problem: WordProblem, word: IntArray, n: int) -> float:
    """Price of the switches of a word.

    A problem with transitions has none: a conjugated twist has no gear. The turn of a free heading
    is no trim to switch to.
    """
    if n > 1 and problem.trims.weights[word[n - 1]] == 0.0:
        n -= 1
    price = problem.terms.switch * (n - 1)
    if problem.terms.direction_change > 0.0:
        sign = 0.0
        for i in range(n):
            v = problem.library.twists[word[i], 0]
            if v != 0.0:
                if sign * v < 0.0:
                    price += problem.terms.direction_change
                sign = v
    return price


@bare_inner_kernel
def time_left(problem: WordProblem) -> float:
    """What the coasting times of a word may add up to."""
    return problem.terms.time_limit - problem.fixed[TIME]


@bare_inner_kernel
def write(
    problem: WordProblem, word: IntArray, n: int, times: Array, trims: IntArray, lasting: Array
) -> int:
    """Fill `trims` and `lasting` with `n` rows as a word of the whole problem; its size.

    Rows of a word that is seen are the positions of its trims. A position that is not among them
    is passed through for no time. After the word there is -1 and 0.
    """
    size = problem.size[0]
    for i in range(trims.size):
        trims[i] = problem.trims.numbers[i] if i < size else -1
        lasting[i] = 0.0
    for i in range(n):
        at = i if size == 0 else word[i]
        trims[at], lasting[at] = problem.trims.numbers[word[i]], times[i]
    return n if size == 0 else size


@bare_inner_kernel
def propose(
    problem: WordProblem, candidates: Candidates, word: IntArray, n: int, times: Array
) -> None:
    """Add a starting point for Newton; beyond the capacity it is counted, not kept."""
    count = candidates.counter[0]
    if count < candidates.words.shape[0]:
        candidates.sizes[count] = write(
            problem, word, n, times, candidates.words[count], candidates.times[count]
        )
        candidates.isolated[count] = 1 if n <= 3 + problem.library.targets.size else 0
    candidates.counter[0] = count + 1


@bare_inner_kernel
def is_straight(problem: WordProblem, trim: int) -> bool:
    """Whether a trim does not turn."""
    return problem.library.twists[trim, 2] == 0.0


@bare_inner_kernel
def condition(problem: WordProblem, word: IntArray, n: int, r: int, times: Array) -> float:
    """Left-hand side of linear condition r."""
    value = 0.0
    for i in range(n):
        value += problem.library.rows[r, word[i]] * times[i]
    return value


@bare_inner_kernel
def transitions_cost(links: Links, word: IntArray, n: int, tail: int) -> float:
    """What the transitions of a word cost: a lower bound, since coasting costs something too.

    inf where one is missing, or where a trim follows itself.
    """
    cost = 0.0
    before = links.start
    for i in range(n):
        if word[i] != tail:
            if i > 0 and word[i] == word[i - 1]:
                return math.inf
            after = links.class_of[word[i]]
            cost += links.cost[before, after]
            before = after
    return cost + links.cost[before, links.goal]


@inner_kernel
def room_for(problem: WordProblem, n: int) -> WordProblem:
    """A problem of `n` rows as yet empty, in which words of so many trims are seen."""
    m = problem.library.targets.size
    return WordProblem(
        TimesProblem(np.zeros((n, 4)), np.zeros(n), np.zeros((m, n)), np.zeros(4), np.zeros(m)),
        Alphabet(
            np.zeros(n, dtype=np.int64),
            np.zeros((n, 2)),
            np.zeros(n),
            np.zeros(n),
            np.zeros((n, n), dtype=np.bool_),
            np.zeros(n),
        ),
        np.zeros(1, dtype=np.int64),
        np.zeros(problem.fixed.size),
        problem.terms,
        problem.scan,
        problem.tail,
    )


@bare_inner_kernel
def look_ahead(
    problem: WordProblem, links: Links, seen: WordProblem, word: IntArray, n: int
) -> None:
    """Fill in the distance, turn and conditions that a word's transitions leave to its trims."""
    # That takes no pose, and most words are too costly already then.
    for k in range(seen.fixed.size):
        seen.fixed[k] = problem.fixed[k]
    for r in range(problem.library.targets.size):
        seen.library.targets[r] = problem.library.targets[r]
    before = links.start
    for i in range(n + 1):
        after = class_after(problem, links, word, n, i)
        if after < 0:
            break
        step = links.displacement[before, after]
        distance = math.hypot(step[0], step[1])
        seen.fixed[COST] += links.cost[before, after]
        seen.fixed[TIME] += links.time[before, after]
        seen.fixed[DISTANCE] -= distance
        seen.fixed[TURN] -= abs(step[2])
        if i > 0:
            seen.fixed[FOLLOWING] += distance
        for r in range(problem.library.targets.size):
            seen.library.targets[r] -= links.gains[r, before, after]
        before = after


@bare_inner_kernel
def class_after(problem: WordProblem, links: Links, word: IntArray, n: int, i: int) -> int:
    """Class of trims that the transition before position `i` leads to; -1 for no transition."""
    # The turn of a free heading comes after the last transition, and has none after it.
    if i < n and word[i] != problem.tail:
        return links.class_of[word[i]]
    if i == n and word[n - 1] == problem.tail:
        return -1
    return links.goal


@bare_inner_kernel
def look(
    problem: WordProblem, links: Links, seen: WordProblem, word: IntArray, n: int, rows: IntArray
) -> None:
    """Fill `seen` with a word as it looks from before its transitions, and `rows` with its rows."""
    x, y, heading, rise = 0.0, 0.0, 0.0, 0.0  # product of the displacements so far
    seen.size[0] = n
    before = links.start
    for i in range(n + 1):
        after = class_after(problem, links, word, n, i)
        if after < 0:
            break
        step = links.displacement[before, after]
        x, y, heading = compose(x, y, heading, step[0], step[1], step[2])
        rise += step[3]
        if i == 0:
            seen.fixed[FIRST], seen.fixed[FIRST + 1] = x, y
        before = after
        if i < n:
            rows[i] = i
            copy_row(problem, word[i], seen, i)
            conjugate(seen.library.twists[i], x, y, heading)
    seen.library.goal[0], seen.library.goal[1], seen.library.goal[2] = back_from(
        problem.library.goal[0], problem.library.goal[1], problem.library.goal[2], x, y, heading
    )
    seen.library.goal[3] = problem.library.goal[3] - rise
    for i in range(n):
        for k in range(i + 1):
            seen.trims.parallel[i, k] = is_parallel(seen.library.twists[i], seen.library.twists[k])
            seen.trims.parallel[k, i] = seen.trims.parallel[i, k]


@bare_inner_kernel
def copy_row(problem: WordProblem, trim: int, seen: WordProblem, row: int) -> None:
    """What a search knows of a trim, as a row of the problem that is seen."""
    seen.trims.numbers[row] = trim
    for k in range(4):
        seen.library.twists[row, k] = problem.library.twists[trim, k]
    seen.library.rates[row] = problem.library.rates[trim]
    for k in range(2):
        seen.trims.prices[row, k] = problem.trims.prices[trim, k]
    seen.trims.periods[row] = problem.trims.periods[trim]
    seen.trims.reaches[row] = problem.trims.reaches[trim]
    seen.trims.weights[row] = problem.trims.weights[trim]
    for r in range(problem.library.targets.size):
        seen.library.rows[r, row] = problem.library.rows[r, trim]


@bare_inner_kernel
def conjugate(twist: Array, x: float, y: float, heading: float) -> None:
    """See a twist from before the displacement (x, y, heading), in place: ``Ad(d) xi``."""
    c, s = math.cos(heading), math.sin(heading)
    v, u, w = twist[0], twist[1], twist[2]
    twist[0] = c * v - s * u + w * y
    twist[1] = s * v + c * u - w * x


@bare_inner_kernel
def moves_in_plane(twist: Array) -> bool:
    """Whether a trim drives or turns: one that only climbs, or rests, is parallel to any other."""
    return twist[0] != 0.0 or twist[1] != 0.0 or twist[2] != 0.0


@bare_inner_kernel
def is_parallel(one: Array, other: Array) -> bool:
    """Whether two twists span one line only, altitude aside."""
    size = math.sqrt(
        (one[0] * one[0] + one[1] * one[1] + one[2] * one[2])
        * (other[0] * other[0] + other[1] * other[1] + other[2] * other[2])
    )
    a = one[0] * other[1] - one[1] * other[0]
    b = one[1] * other[2] - one[2] * other[1]
    c = one[2] * other[0] - one[0] * other[2]
    return math.sqrt(a * a + b * b + c * c) <= PARALLEL * size

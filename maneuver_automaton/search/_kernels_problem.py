"""What every kernel of the search over words shares: the problem, its buffers, small helpers."""

from __future__ import annotations

from typing import Any, NamedTuple

from maneuver_automaton._compile import inner_kernel


class WordProblem(NamedTuple):
    """What every word of one search shares; times in seconds, angles in radians."""

    twists: Any  # (M, 4)
    rates: Any  # (M,) cost per second, that of rest taken off where rest pads
    rows: Any  # (m, M) linear conditions on the times: altitude, fixed time
    targets: Any  # (m,)
    periods: Any  # (M,) time of a full turn, inf for straights
    reaches: Any  # (M,) longest time of interest
    parallel: Any  # (M, M) whether two twists are parallel
    weights: Any  # (M,) 1 where a trim takes time and counts, 0 for the turn of a free heading
    goal: Any  # (4,) relative to the start
    time_limit: float  # sum of all times at most this; inf
    pad: int  # 1 where rest fills up to time_limit
    pad_cost: float  # cost of time_limit seconds of rest
    switch: float
    direction_change: float
    more_turns: int  # 1 where whole extra turns are admitted
    nodes: int  # grid nodes per scanned time, for words with one scanned time
    nodes_2d: int  # the same for two scanned times
    tolerance: float
    shortest: float  # [s] a shorter coasting time is not admitted
    tail: int  # trim that ends every word without counting, -1 for none


class Candidates(NamedTuple):
    """Starting points for Newton, filled by the scan and emptied by `polish_candidates`."""

    words: Any  # (capacity, S)
    times: Any  # (capacity, S)
    sizes: Any  # (capacity,) trims in the word
    isolated: Any  # (capacity,) 1 where the conditions alone fix the times
    counter: Any  # (3,): candidates, words looked at, steering calls
    turns: Any  # (3, S) integers to work with
    work: Any  # (S,) numbers to work with


class Found(NamedTuple):
    """Buffers of what has been found."""

    words: Any  # (capacity, S)
    times: Any  # (capacity, S)
    costs: Any  # (capacity,)
    counter: Any  # (1,)
    best: Any  # (K + 1,) cheapest costs so far, ascending


@inner_kernel
def word_extra(problem, word, n):
    """Price of the switches of a word."""
    price = problem.switch * (n - 1)
    if problem.direction_change > 0.0:
        sign = 0.0
        for i in range(n):
            v = problem.twists[word[i], 0]
            if v != 0.0:
                if sign * v < 0.0:
                    price += problem.direction_change
                sign = v
    return price


@inner_kernel
def propose(problem, candidates, word, n, times):
    """Add a starting point for Newton; beyond the capacity it is counted, not kept."""
    count = candidates.counter[0]
    if count < candidates.words.shape[0]:
        for i in range(n):
            candidates.words[count, i] = word[i]
            candidates.times[count, i] = times[i]
        candidates.sizes[count] = n
        candidates.isolated[count] = 1 if n <= 3 + problem.targets.size else 0
    candidates.counter[0] = count + 1


@inner_kernel
def is_straight(problem, trim):
    """Whether a trim does not turn."""
    return problem.twists[trim, 2] == 0.0


@inner_kernel
def condition(problem, word, n, r, times):
    """Left-hand side of linear condition r."""
    value = 0.0
    for i in range(n):
        value += problem.rows[r, word[i]] * times[i]
    return value

"""Exhaustive search of a small library in one call: every word, and its solutions.

It does what `WordScan` does portion by portion. Where a whole scan takes less than a glance at the
clock is worth, calls from Python would take most of the time.
"""

from __future__ import annotations

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import inner_kernel, kernel
from maneuver_automaton.search._kernels_polish import polish_all
from maneuver_automaton.search._kernels_problem import Candidates, Found, Links, WordProblem
from maneuver_automaton.search._kernels_words import propose_flat_words, propose_words


@inner_kernel
def tied_to_best(found: Found, tie: float) -> float:
    """Largest cost that counts as equal to the dearest solution asked for."""
    best: float = found.best[found.best.size - 1]
    return best + tie * (1.0 + abs(best))


@inner_kernel
def scan_mode(
    problem: WordProblem,
    links: Links,
    candidates: Candidates,
    found: Found,
    n: int,
    tail: int,
    portions: IntArray,
    most: int,
    tie: float,
    not_first: int,
) -> None:
    """Scan all words of `n` trims, and of a free turn where `tail` is 1; polish what comes up.

    But for those that begin with the trim `not_first`.
    """
    last = (problem.twists.shape[0] - tail) ** n
    each = (problem.twists.shape[0] - tail) ** (n - 1)  # words that begin with the same trim
    left_out = not_first * each if not_first >= 0 else last
    n += tail
    for scan in range(2):  # words that cannot span the plane; those that can
        if (scan == 0 and n > 2 + problem.targets.size) or (scan == 1 and n < 3):
            continue
        portion = portions[0] if scan == 0 or n == 3 else portions[1]
        number = 0
        while number < last:
            if number == left_out:
                number += each
                continue
            upper_bound = tied_to_best(found, tie)
            end = min(number + portion, left_out if number < left_out else last)
            if scan == 0:
                number = propose_flat_words(problem, links, candidates, n, number, end, upper_bound)
            else:
                number = propose_words(problem, links, candidates, n, number, end, upper_bound)
            if candidates.counter[0] > 0:
                polish_all(problem, links, candidates, found, most)


@kernel
def scan_all_words(
    one: WordProblem,
    links_of_one: Links,
    other: WordProblem,
    links_of_other: Links,
    most_moving: IntArray,
    at_least: Array,
    candidates: Candidates,
    found: Found,
    tail: int,
    portions: IntArray,
    most: int,
    tie: float,
    not_first: int,
) -> None:
    """Scan and polish all words of up to `most` trims, at most four with the free turn.

    In one or two ways to meet the time, each with its greatest number of moving trims, 0 for a way
    that is none, and with a lower bound of what its words cost. Shorter words come first;
    `portions` says how many words, of three trims and of four, are scanned before the solutions of
    some lower the upper bound of the others. Where `not_first` is a trim, only words of `most`
    trims that do not begin with it are scanned.
    """
    for n in range(1 if not_first < 0 else most, most + 1):
        if n <= most_moving[0] and not at_least[0] > tied_to_best(found, tie):
            scan_mode(one, links_of_one, candidates, found, n, tail, portions, most, tie, not_first)
        if n <= most_moving[1] and not at_least[1] > tied_to_best(found, tie):
            scan_mode(
                other, links_of_other, candidates, found, n, tail, portions, most, tie, not_first
            )

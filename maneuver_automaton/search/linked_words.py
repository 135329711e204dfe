"""Words whose trims are linked by transitions of any size: steered first, then scanned.

Words of up to three trims follow from the steering function at once. Longer ones are those of the
exhaustive search, as they are seen from before their transitions. What neither knows is made good
afterwards: trims that must last a while, or may not last longer, a time to be met, and the prices
of switches within maneuvers.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array
from maneuver_automaton.budget import UNLIMITED, Budget, Pace
from maneuver_automaton.costs import terms_of
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.search.result import TIE, SearchResult, SearchStatus, TimedWord, in_order
from maneuver_automaton.search.word_scan import Extent, WordScan
from maneuver_automaton.search.word_setup import WordSetup, word_setup
from maneuver_automaton.words import _kernels_candidates as kernels
from maneuver_automaton.words.library import NO_TRIM, four_columns

ALPHABET = 24  # trims that words are made of, of a larger library those that differ most
LONGEST = 4  # trims of a scanned word, unless fewer are asked for
NODES = 12  # grid nodes per scanned time: a rough answer will do, insertion follows
HEADINGS = 24  # a free heading is tried at so many
SLACK = 0.1  # share by which a word may be costlier than what is asked for before it is made good
WORDS_AN_EXPANSION = 16  # that are looked at in the time of one expansion of the lattice
EXPANSIONS_A_WORD = 8  # in place of solving one word for its times
STEERED = 2000  # words between the first looks at the clock, some ms
LATE_WORDS = 8  # that are made good once the time is over, where none has been before


def steer_linked_words(
    problem: Problem,
    goal: Goal,
    *,
    alternatives: int = 0,
    budget: Budget = UNLIMITED,
    upper_bound: float = math.inf,
) -> SearchResult:
    """Words of up to three trims, and a climb, from the steering function; see `scan_linked_words`.

    A first answer, and a bound for all that follows: it takes a hundredth of the time of a scan.
    Where more is asked of a word than to end at the goal, its times are a start to be solved from.
    """
    setup = word_setup(problem, goal, most_trims=ALPHABET, steers=True)
    # the times of so few trims follow from the pose: to meet a time exactly is left to the scan
    headings = _headings(problem, goal)[: 0 if setup.exactly else None]
    refined = bool(goal.free_heading or setup.limit or problem.horizon.min_coast)
    steered = _steered(setup, headings, budget)
    good = _made_good(setup, steered, alternatives, upper_bound, budget, refined=refined)
    found = list(good)  # before the status is known
    return _result(
        setup,
        found,
        alternatives,
        upper_bound,
        none=SearchStatus.OUT_OF_BUDGET if budget.is_over else SearchStatus.EXHAUSTED,
        counts={"expansions": len(headings)},
    )


def scan_linked_words(
    problem: Problem,
    goal: Goal,
    *,
    alternatives: int | None = 0,
    budget: Budget = UNLIMITED,
    upper_bound: float = math.inf,
    max_trims: int = LONGEST,
    alphabet: int = ALPHABET,
) -> SearchResult:
    """Words from the problem's first trim to the goal's last one, with transitions in between.

    Between two trims stands the cheapest chain of maneuvers, so a word of the library's graph with
    costlier ones, or with maneuvers that lead from a trim to itself, is not among them. All trims
    of a word coast for a while. With an upper bound, or a number of alternatives, a word of four
    trims is left out where no node of its scanned time is nearly cheap enough.

    Most parameters are those of `search_words`; ``search.max_expansions`` of the problem limits the
    number of words instead of the time: the same at every call. `max_trims` are those that coast.
    Words are made of `alphabet` trims of the library, of a larger one of those that differ most.
    """
    setup = word_setup(problem, goal, most_trims=alphabet)
    expansions = problem.search.max_expansions
    terms = terms_of(problem.cost)
    exact = terms is not None and terms.direction_change == 0.0  # parts and switches are all
    later = setup.is_mended or not exact
    pads = problem.horizon.time is not None and setup.pad is not None  # rest is a trim more
    most = min(max_trims, LONGEST - int(goal.free_heading)) + int(pads)
    everything = alternatives is None and upper_bound == math.inf
    extent = Extent(
        most=min(most, problem.horizon.max_trims or most),
        alternatives=None if later else alternatives,
        nodes=NODES,
        spare=pads,
        slack=math.inf if everything else SLACK,
    )
    scan = WordScan(problem, setup.as_search(), extent)
    scan.begin(scan.setup, upper_bound=upper_bound * (1.0 + SLACK * later) + TIE)
    most_words = None if expansions is None else WORDS_AN_EXPANSION * expansions
    finished = scan.run(budget, most_words)
    found = _made_good(
        setup, scan.timed(), alternatives, upper_bound, budget, refined=setup.is_mended
    )
    return _result(
        setup,
        found,
        alternatives,
        upper_bound,
        none=SearchStatus.EXHAUSTED if finished else SearchStatus.OUT_OF_BUDGET,
        complete=everything and finished,
        counts={
            "expansions": -(-scan.n_words // WORDS_AN_EXPANSION),
            "steering_calls": scan.n_steering,
        },
    )


def _made_good(
    setup: WordSetup,
    rough: Iterable[TimedWord],
    alternatives: int | None,
    upper_bound: float,
    budget: Budget,
    *,
    refined: bool,
) -> Iterator[TimedWord]:
    """Words found by rising cost, with times that meet all conditions, and their own prices."""
    most = setup.problem.search.max_expansions
    prices = list[float]()
    slack = 1.0 + SLACK * refined + TIE
    for n, found in enumerate(rough):
        costliest = upper_bound
        if alternatives is not None and len(prices) > alternatives:
            costliest = min(upper_bound, sorted(prices)[alternatives])
        if found.cost > costliest * slack:
            return
        if budget.is_over and (prices or n >= LATE_WORDS):
            return
        if most is not None and EXPANSIONS_A_WORD * n > most:
            return
        if refined:
            word = setup.solved(found.trims, [found.durations])
        else:
            word = setup.closed(found.trims, found.durations)
        if word is not None:
            prices.append(word.cost)
            yield word


def _result(
    setup: WordSetup,
    found: Iterable[TimedWord],
    alternatives: int | None,
    upper_bound: float,
    *,
    none: SearchStatus,
    complete: bool = False,
    counts: dict[str, int],
) -> SearchResult:
    """Result with the words asked for, cheapest first; `none` is its status if there are none."""
    kept = [one for one in found if one.cost <= upper_bound * (1.0 + TIE)]
    kept.sort(key=lambda one: (one.cost, len(one.trims), one.trims))
    asked = kept if alternatives is None else kept[: alternatives + 1]
    return SearchResult(
        status=SearchStatus.FOUND if asked else none,
        solutions=tuple(in_order(setup.word(one) for one in asked)),
        complete=complete,
        counts=counts,
    )


def _headings(problem: Problem, goal: Goal) -> Array:
    """Headings at the goal that are steered to: where any will do, seeds from the start's on."""
    if not goal.free_heading:
        return goal.pose[2:3]
    return np.linspace(0.0, 2.0 * np.pi, HEADINGS, endpoint=False) + float(problem.start[2])


def _steered(setup: WordSetup, headings: Array, budget: Budget) -> Iterator[TimedWord]:
    """Words of up to three trims and a climb to the goal, cheapest first, as time allows."""
    arrays, scratch = setup.library.arrays, setup.library.scratch()
    tried = arrays.tried
    start, goal = four_columns(np.array([setup.problem.start, setup.goal.pose]))[:, None]
    found: list[tuple[NDArray[Any], ...]] = []  # costs, numbers of headings, climbs, rows, times
    for number, heading in enumerate(headings):
        goal[0, 2], row = heading, 0
        pace = Pace(budget, steps=max(1, STEERED // (1 + len(arrays.tried.climbs))))
        while left := len(tried.words) - row:
            step = pace.take(left) or (0 if found else min(pace.steps, left))
            if not step:
                break
            n = kernels.candidate_batch(
                arrays._replace(tried=tried._replace(words=tried.words[row : row + step])),
                step,
                start,
                setup.start_trim,
                goal,
                setup.goal_trim,
                math.inf,
                scratch,
            )
            costs, times = scratch.costs[:n].copy(), scratch.times[:n].copy()
            rows, climbs = scratch.rows[:n] + row, scratch.climbs[:n].copy()
            found.append((costs, np.full(n, number), climbs, rows, times))
            row += step
    if not found:
        return
    costs, numbers, climbs, rows, times = (
        np.concatenate(each) for each in zip(*found, strict=True)
    )
    costs = costs + setup.switch * np.maximum(np.count_nonzero(times > 0.0, axis=1) - 1, 0)
    in_turn = (climbs[:, None] == [NO_TRIM, *arrays.tried.climbs]).argmax(axis=1)
    for k in np.lexsort((rows, in_turn, numbers, costs)):  # the same however it is parted
        word = np.append(tried.words[rows[k], :3], climbs[k])
        used = word >= 0
        yield TimedWord(tuple(word[used].tolist()), times[k, used], cost=float(costs[k]))

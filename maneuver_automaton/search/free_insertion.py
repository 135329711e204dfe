"""Insertion of trims that switch at will: what pays most, where it pays most, times solved again.

The price of every trim at every moment of a word is known, so a word that nothing improves has a
certificate over the whole library. The work grows with the number of trims, not with its power.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.budget import Budget
from maneuver_automaton.costs import Cost, prices_switches
from maneuver_automaton.problem import Horizon, Problem
from maneuver_automaton.search import _kernels_insertion
from maneuver_automaton.search.result import (
    BestWords,
    InsertionTask,
    SearchResult,
    SearchStatus,
    TimedWord,
    in_order,
)
from maneuver_automaton.search.setup import (
    FEW,
    UNUSED,
    InsertionLibrary,
    SearchSetup,
    insertion_library,
    search_setup,
    sub_library,
    with_fewer_digits,
)
from maneuver_automaton.search.shortening import shortened
from maneuver_automaton.search.words import resting, search_setup_words
from maneuver_automaton.words.word import Word, normal_form

SEEDS = 10  # cheapest words that are improved, where the library is its own sub-library
SEEDS_OF_MANY = 4  # the same for larger libraries: insertion makes more of them
ACCURACY = 1e-9  # reduced costs above minus this, relative, count as none
LONGEST = 24  # trims of one word under way
FIRST_ROUNDS = 4  # insertions into every seed
FIRST_ROUNDS_OF_MANY = 2
FULL = 2  # how many of the then cheapest words go on
FULL_OF_MANY = 1
ROUNDS = 60  # insertions into these
SECONDS_A_ROUND = 3e-6  # for every trim of the library, measured
GROWN = 2  # seeds that may grow beyond the limit before they are shortened
SHORTENED = 3  # words that are tried with fewer trims where switches cost
RUN = 5  # trims of a word in which two may alternate, the faster the better
CLOSING = 1e-6  # relative, by which a cost changes where a word is closed at the exact goal
LATE = 1e-9  # [s] by which rounding may exceed a time


def free_stages(task: InsertionTask) -> Iterator[SearchResult]:
    """Words of one class of trims; again with the greatest time as a condition where it binds.

    Their certificate is the smallest reduced cost over the whole library and all times.
    """
    problem = task.problem
    setup = search_setup(problem, task.goal)
    if setup.start_is_goal and (problem.horizon.time is None or setup.library.rest is not None):
        yield resting(problem, setup)
        return
    if not len(setup.library.trims):  # nothing that words are made of
        yield SearchResult(status=SearchStatus.EXHAUSTED, solutions=())
        return
    found = BestWords(problem, task.alternatives + 1, task.budget)
    exact, setup = setup.goal, with_fewer_digits(setup)
    seeds = _usual_seeds(task, setup) if task.seeds is None else task.seeds
    work = _Insertion(problem, setup, insertion_library(problem, setup), exact, task, seeds)
    most_time = problem.horizon.max_time
    free = _improved(work)
    latest = math.inf if most_time is None else most_time + LATE
    found.add(_in_time(free, latest))
    yield found.result()
    late = most_time and (not free.solutions or free.solutions[0].duration > latest)
    if most_time is not None and late and not task.budget.is_over:
        library = work.library.within_time(most_time)
        found.add(_in_time(_improved(replace(work, library=library, limit=most_time)), latest))
        yield found.result()


def _in_time(found: SearchResult, latest: float) -> SearchResult:
    """The solutions that end in time."""
    kept = [one for one in found.solutions if latest == math.inf or one.duration <= latest]
    return found if len(kept) == len(found.solutions) else replace(found, solutions=tuple(kept))


def _usual_seeds(task: InsertionTask, setup: SearchSetup) -> int:
    """How many words a search starts from."""
    few = SEEDS_OF_MANY if len(setup.library.trims) > FEW else SEEDS
    return max(few, 2 * task.alternatives + 1)


@dataclass(frozen=True, slots=True, eq=False)
class _Insertion:
    """One search by insertion: for what, and with which library."""

    problem: Problem
    setup: SearchSetup
    library: InsertionLibrary
    exact: Array  # (4,) the goal with all its digits
    task: InsertionTask
    seeds: int
    limit: float | None = None  # [s] greatest time, if the library prices it

    @property
    def total(self) -> float | None:
        """Sum of the times of a word, rest or unused time included; None if free [s]."""
        return self.problem.horizon.time if self.limit is None else self.limit

    @property
    def most(self) -> int:
        """Columns of the library that one word may have."""
        most = self.problem.horizon.max_trims
        return LONGEST if most is None else min(most + int(self.limit is not None), LONGEST)


def _improved(work: _Insertion) -> SearchResult:
    """Solutions of all seeds, or of the known plan's where none are asked for, each word once."""
    known, plan, automaton = [], work.task.known, work.problem.automaton
    names = [] if plan is None else [trim.name for trim in plan.trims]
    if plan is not None and len(names) <= LONGEST and all(map(automaton.__contains__, names)):
        numbers = np.array(list(map(automaton.index_of, names)), dtype=np.int64)
        word = _in_library(work, numbers, plan.durations)
        if min(word.trims, default=0) >= 0:  # its trims are those of the library
            known.append(word)
    if work.seeds == 0:
        found = _improved_from(work, known)
        if found.solutions:
            return found
        work = replace(work, seeds=_usual_seeds(work.task, work.setup))
    seeds = _words_of_few(work, work.problem)
    if not seeds and work.total is not None and not work.task.budget.is_over:
        seeds = _fast_words(work, work.total)
    return _improved_from(work, [*known, *seeds])


def _improved_from(work: _Insertion, begun: list[TimedWord]) -> SearchResult:
    """Solutions of some words and of what insertion makes of them, each word once."""
    problem, library, task, most = work.problem, work.library, work.task, work.most
    many = len(work.setup.library.trims) > FEW
    counts = {"expansions": 0, "insertions": 0, "seeds": 0}
    limit = problem.search.max_expansions
    words: list[TimedWord] = []
    status = SearchStatus.EXHAUSTED
    alone = len(begun) == 1  # nothing is to be compared with it: it has all its rounds at once
    rounds = ROUNDS if alone else FIRST_ROUNDS_OF_MANY if many else FIRST_ROUNDS
    for seed in begun:
        if words and (task.budget.is_over or (limit is not None and len(words) >= limit)):
            status = SearchStatus.OUT_OF_BUDGET
            break
        words.append(_with_insertions(library, seed, most, _fitting(work, rounds), counts))
    counts["expansions"] = counts["seeds"] = len(words)
    words = sorted((word for word in words if math.isfinite(word.cost)), key=attrgetter("cost"))
    full = 0 if alone else max(FULL_OF_MANY if many else FULL, task.alternatives + 1)
    pays = -ACCURACY * library.scale
    for k, word in enumerate(words[:full]):
        if word.certificate < pays and not task.budget.is_over:
            again = _with_insertions(library, word, most, _fitting(work, ROUNDS), counts)
            words[k] = again if math.isfinite(again.cost) else word  # its times may fail to solve
    words = [_with_short_runs(library, word) for word in words]
    binding = not words or min(words, key=attrgetter("cost")).certificate < pays
    if most < LONGEST and binding and not library.tail and not task.budget.is_over:
        words += _from_longer(work, begun, counts)
    if prices_switches(problem.cost) and not task.budget.is_over:
        words += _with_fewer_switches(library, words, task.budget)
    # The best times of a seed's own word are locally optimal, too.
    if task.alternatives > 0 and not task.budget.is_over:
        words += [_with_insertions(library, seed, most, 0, counts) for seed in begun]
    if task.budget.is_over:
        status = SearchStatus.OUT_OF_BUDGET
    return SearchResult(
        status=status, solutions=tuple(in_order(_closed(work, words))), counts=counts
    )


def _fitting(work: _Insertion, rounds: int) -> int:
    """As many of some rounds of insertion as fit into the time left, at least one."""
    fits = work.task.budget.left / (SECONDS_A_ROUND * len(work.library.problem.rates))
    return max(1, int(min(rounds, fits)))


def _closed(work: _Insertion, words: Sequence[TimedWord]) -> list[Word]:
    """Solutions of words; where one is asked for, or the time is over, no costlier ones."""
    budget = work.task.budget
    in_turn = work.task.alternatives == 0 and not prices_switches(work.problem.cost)
    solutions: list[Word] = []
    enough = math.inf
    for word in sorted(words, key=attrgetter("cost")) if in_turn or budget.is_over else words:
        if word.cost > enough or (solutions and budget.is_over):
            break
        if len(word.trims) - work.library.tail <= work.most:
            most = work.problem.horizon.max_trims or LONGEST
            solutions += [one for one in _solutions(work, word) if one.trims.size <= most]
            if solutions and in_turn:  # closing changes a cost by less
                enough = min(enough, word.cost + CLOSING * (1.0 + abs(word.cost)))
    return solutions


def _from_longer(
    work: _Insertion, begun: list[TimedWord], counts: dict[str, int]
) -> Iterator[TimedWord]:
    """The word of the cheapest seed that may grow first, and is shortened afterwards."""
    library, most, grown = work.library, work.most, []
    for seed in begun[:GROWN]:
        if work.task.budget.is_over:
            return
        word = _with_insertions(library, seed, LONGEST, _fitting(work, ROUNDS), counts)
        grown.append(_with_short_runs(library, word))
    longer = [word for word in grown if math.isfinite(word.cost) and len(word.trims) > most]
    for word in sorted(longer, key=attrgetter("cost"))[:1]:
        short = None if work.task.budget.is_over else shortened(library, word, most)
        if short is not None and len(short.trims) <= most:
            again = _with_insertions(library, short, most, _fitting(work, ROUNDS), counts)
            if math.isfinite(again.cost) and len(again.trims) <= most:
                yield again


def _with_fewer_switches(
    library: InsertionLibrary, words: Sequence[TimedWord], budget: Budget
) -> Iterator[TimedWord]:
    """The words found with fewer and fewer trims: where switches cost, these may pay."""
    if library.tail:
        return
    for word in words[:SHORTENED]:
        longer = word
        for most in range(len(word.trims) - 1, 0, -1):
            short = None if budget.is_over else shortened(library, longer, most)
            if short is None:
                break
            yield short
            longer = short


def _with_insertions(
    library: InsertionLibrary, word: TimedWord, most: int, rounds: int, counts: dict[str, int]
) -> TimedWord:
    """The word with its best times, after inserting what pays, at most `rounds` times."""
    trims, times = _with_room(word)
    size, cost, least, used = _kernels_insertion.improve_word(
        library.problem,
        library.n_priced,
        library.tail,
        trims,
        times,
        len(word.trims),
        min(most, LONGEST),
        ACCURACY * library.scale,
        rounds,
    )
    counts["insertions"] += int(used)
    return TimedWord(tuple(trims[:size].tolist()), times[:size], float(cost), float(least))


def _with_short_runs(library: InsertionLibrary, word: TimedWord) -> TimedWord:
    """The word with its runs of two trims that alternate shortened."""
    last = len(word.trims) - library.tail - RUN
    parts = (word.trims[k : k + RUN] for k in range(last + 1))
    if not any(part[2:] == part[:-2] for part in parts):  # no two that take turns
        return word
    trims, times = _with_room(word)
    size, cost, least = _kernels_insertion.word_with_short_runs(
        library.problem, library.n_priced, library.tail, trims, times, len(word.trims), word.cost
    )
    return TimedWord(tuple(trims[:size].tolist()), times[:size], float(cost), float(least))


def _with_room(word: TimedWord) -> tuple[IntArray, Array]:
    """Trims and times in buffers that a kernel lengthens in place."""
    trims, times = np.zeros(LONGEST + 4, dtype=np.int64), np.zeros(LONGEST + 4)
    trims[: len(word.trims)], times[: len(word.trims)] = word.trims, word.durations
    return trims, times


def _solutions(work: _Insertion, word: TimedWord) -> Iterator[Word]:
    """The solution from a word under work, closed at the exact goal; none if it cannot be."""
    problem, library = work.problem, work.library
    numbers = word.numbers
    times = library.corrected(numbers, word.durations, work.exact)
    if times is None:
        return
    cost = word.cost + float(library.problem.rates[numbers].dot(times - word.durations))
    kept = slice(0, numbers.size - library.tail)
    trims, lasting = library.trims[numbers[kept]], times[kept]
    if UNUSED in trims.tolist():  # neighbours that unused time parts are one
        used = trims != UNUSED
        trims, lasting = normal_form(trims[used], lasting[used], shortest=-math.inf)
    switching = problem.cost.switching(problem.automaton.body_velocities[trims])
    yield Word(
        trims=trims,
        durations=lasting,
        cost=cost + library.fixed_cost + switching,
        certificate=word.certificate,
    )


def _words_of_few(work: _Insertion, problem: Problem) -> list[TimedWord]:
    """Cheapest words of the sub-library, in the library's numbers, rest and free turn appended."""
    solutions = search_setup_words(
        problem,
        sub_library(work.setup),
        alternatives=work.seeds - 1,
        budget=work.task.budget,
        spare=True,
    )
    return [_in_library(work, solution.trims, solution.durations) for solution in solutions]


def _fast_words(work: _Insertion, limit: float) -> list[TimedWord]:
    """For a time that no seed meets: first insert for least time, then fill up the time.

    Where no trim stands still, detours fill it up: what is inserted leaves the least unused.
    """
    hurry = replace(work.problem, cost=Cost(time=1.0), horizon=Horizon())
    setup = search_setup(hurry, hurry.goals[0])
    setup = replace(setup, goal=work.setup.goal, free_heading=work.setup.free_heading)
    library = insertion_library(hurry, setup)
    least = replace(
        work, problem=hurry, setup=setup, library=library, exact=library.problem.goal, limit=None
    )
    filled, earliest = None, -math.inf
    if work.library.rest is None:
        library, earliest = library.within_time(limit), limit - LATE
        idle = np.eye(len(library.problem.rates))[library.n_priced - 1]
        library = replace(library, problem=library.problem._replace(rates=idle))
        filled = replace(least, library=library, limit=limit)
    met = []
    for seed in _words_of_few(least, hurry):
        if work.task.budget.is_over:
            break
        quick = _grown(least, seed)
        if quick is not None and filled is not None and quick.duration <= limit + LATE:
            quick = _grown(filled, _in_library(filled, quick.trims, quick.durations))
        if quick is not None and earliest <= quick.duration <= limit + LATE:
            met.append(_in_library(work, quick.trims, quick.durations))
    return met


def _grown(work: _Insertion, seed: TimedWord) -> Word | None:
    """The solution that insertion makes of a seed, if there is one."""
    rounds = _fitting(work, ROUNDS)
    word = _with_insertions(work.library, seed, LONGEST, rounds, {"insertions": 0})
    return next(_solutions(work, word), None) if math.isfinite(word.cost) else None


def _in_library(work: _Insertion, trims: IntArray, durations: Array) -> TimedWord:
    """A word of the automaton in the library's numbers, rest and free turn appended."""
    library, limit = work.library, work.total
    word = library.number_of[trims].tolist()
    times = durations.tolist()
    if limit is not None and library.rest is not None and word[-1:] != [library.rest]:
        word.append(library.rest)
        times.append(max(0.0, limit - sum(times)))
    if library.tail:
        turned = float(library.problem.twists[word, 2] @ np.array(times))  # the rest: at 1 rad/s
        word.append(len(library.problem.rates) - 1)
        times.append(float(np.remainder(library.problem.goal[2] - turned, 2.0 * np.pi)))
    return TimedWord(tuple(word), np.array(times))

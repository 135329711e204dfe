"""Search by insertion: libraries of thousands of trims, with a certificate over all of them.

A plan from a small sub-library is improved by inserting whichever trim of the whole library pays
most, at the moment where it pays most, and solving the coasting times again. The work grows with
the number of trims, not with its power.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._kept import kept_by_first
from maneuver_automaton.automaton import Plan
from maneuver_automaton.costs import Cost
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.search.alternatives import distinct, in_order
from maneuver_automaton.search.exact_end import corrected, with_fewer_digits
from maneuver_automaton.search.library_arrays import LibraryArrays, library_arrays
from maneuver_automaton.search.result import SearchResult, SearchStatus
from maneuver_automaton.search.setup import SearchSetup, search_setup
from maneuver_automaton.search.shortening import shortened
from maneuver_automaton.search.time_limit import UNUSED, within_time
from maneuver_automaton.search.timed_word import TimedWord
from maneuver_automaton.search.words import resting, search_setup_words
from maneuver_automaton.words.library import MovingTrims
from maneuver_automaton.words.word import Word

SEEDS = 10  # cheapest words that are improved, where the library is its own sub-library
SEEDS_OF_MANY = 4  # the same for larger libraries: insertion makes more of them
FEW = 14  # a library of up to this many moving trims is its own sub-library
ACCURACY = 1e-9  # reduced costs above minus this, relative, count as none
LONGEST = 24  # trims of one word under way
FIRST_ROUNDS = 4  # insertions into every seed
FIRST_ROUNDS_OF_MANY = 2
FULL = 2  # how many of the then cheapest words go on
FULL_OF_MANY = 1
ROUNDS = 60  # insertions into these
GROWN = 2  # seeds that may grow beyond the limit before they are shortened
SHORTENED = 3  # words that are tried with fewer trims where switches cost
CHATTER = 5  # trims of a word in which two may chatter
LATE = 1e-9  # [s] by which rounding may exceed a time


def search_insertion(
    problem: Problem,
    goal: Goal,
    *,
    alternatives: int = 0,
    seeds: int | None = None,
    time_limit: float = math.inf,
    known: Plan | None = None,
) -> SearchResult:
    """Improve the cheapest words of a sub-library by insertion from the whole library.

    Parameters
    ----------
    problem : Problem
    goal : Goal
    alternatives : int
        How many solutions beside the cheapest, as far as the seeds lead to different words.
    seeds : int, optional
        How many words of the sub-library to start from; by default 10, or 4 for large libraries.
    time_limit : float
        [s] after which no further seed is begun.
    known : Plan, optional
        A plan of this library from start to goal, improved before any seed.

    Returns
    -------
    SearchResult
        Solutions by rising cost; the certificate of each is its smallest reduced cost over the
        whole library and all times: at least ``-1e-9`` where Pontryagin's condition holds.

    Examples
    --------
    >>> from maneuver_automaton.automaton import Automaton
    >>> from maneuver_automaton.costs import Cost
    >>> from maneuver_automaton.models import Unicycle
    >>> speeds = [-2, -1.5, -1, -0.5, 0, 0.5, 1, 1.5, 2]
    >>> robot = Automaton.of_grid(Unicycle(), [speeds, speeds])
    >>> from maneuver_automaton.problem import Horizon
    >>> cost, horizon = Cost(effort=1), Horizon(time=1.25)
    >>> problem = Problem(robot, [-2, 0, 0], [0, 0, 0], cost=cost, horizon=horizon)
    >>> best = search_insertion(problem, problem.goals[0]).solutions[0]
    >>> round(best.cost, 6), best.certificate > -1e-9
    (3.25, True)
    """
    deadline = time.monotonic() + time_limit
    setup = search_setup(problem, goal)
    if setup.start_is_goal and (problem.horizon.time is None or setup.rest is not None):
        return resting(problem, setup)
    exact, setup = setup.goal, with_fewer_digits(setup)
    if seeds is None:
        many = len(setup.trims) > FEW
        seeds = max(SEEDS_OF_MANY if many else SEEDS, 2 * alternatives + 1)
    library = library_arrays(problem, setup)
    asked = _Asked(problem, setup, library, exact, alternatives, seeds, deadline)
    found = _improved(asked, known)
    most_time = problem.horizon.max_time
    if most_time is not None:
        late = not found.solutions or found.solutions[0].duration > most_time + LATE
        in_time = [one for one in found.solutions if one.duration <= most_time + LATE]
        if late and time.monotonic() < deadline:  # the limit binds: it is a condition of the search
            limited = replace(asked, library=within_time(library, most_time), limit=most_time)
            more = _improved(limited, known)
            in_time += [one for one in more.solutions if one.duration <= most_time + LATE]
            found = more.after(found)
        found = replace(found, solutions=in_time)
    solutions = tuple(distinct(problem, found.solutions, most=alternatives + 1))
    return SearchResult(
        status=SearchStatus.FOUND if solutions else found.status,
        solutions=solutions,
        complete=False,
        counts=found.counts,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Asked:
    """One search by insertion: what it is asked, and until when."""

    problem: Problem
    setup: SearchSetup
    library: LibraryArrays
    exact: Array  # (4,) the goal with all its digits
    alternatives: int
    seeds: int
    deadline: float
    limit: float | None = None  # [s] greatest time, if the library prices it

    @property
    def total(self) -> float | None:
        """What the times of a word add up to, rest or unused time included; None if free [s]."""
        return self.problem.horizon.time if self.limit is None else self.limit

    @property
    def most(self) -> int:
        """Columns of the library that one word may have."""
        most = self.problem.horizon.max_trims
        return LONGEST if most is None else min(most + int(self.limit is not None), LONGEST)


@dataclass(frozen=True, slots=True, eq=False)
class _Improved:
    """What one search by insertion came to."""

    solutions: list[Word]
    status: SearchStatus
    counts: dict[str, int]

    def after(self, first: _Improved) -> _Improved:
        """The same with what the search before it took."""
        counts = {name: first.counts[name] + count for name, count in self.counts.items()}
        return replace(self, counts=counts)


def _improved(asked: _Asked, known: Plan | None) -> _Improved:
    """Solutions of all seeds and of what insertion makes of them, each word once."""
    problem, setup, library = asked.problem, asked.setup, asked.library
    deadline, alternatives, most = asked.deadline, asked.alternatives, asked.most
    many = len(setup.trims) > FEW
    begun = list(_seeds(asked))
    if known is not None:
        begun = [*_as_seed(asked, known), *begun]
    counts = {"expansions": 0, "insertions": 0, "seeds": 0}
    limit = problem.search.max_expansions
    words: list[TimedWord] = []
    status = SearchStatus.EXHAUSTED
    rounds = FIRST_ROUNDS_OF_MANY if many else FIRST_ROUNDS
    for seed in begun:
        if words and (time.monotonic() > deadline or (limit is not None and len(words) >= limit)):
            status = SearchStatus.OUT_OF_BUDGET
            break
        words.append(_with_insertions(library, seed, most, rounds, counts))
    counts["expansions"] = counts["seeds"] = len(words)
    words = sorted((word for word in words if math.isfinite(word.cost)), key=_cost)
    for k in range(min(len(words), max(FULL_OF_MANY if many else FULL, alternatives + 1))):
        if words[k].certificate < -ACCURACY * library.scale and time.monotonic() < deadline:
            words[k] = _with_insertions(library, words[k], most, ROUNDS, counts)
    words = [_calmed(library, word) for word in words]
    binding = not words or min(words, key=_cost).certificate < -ACCURACY * library.scale
    if most < LONGEST and binding and not library.free_heading and time.monotonic() < deadline:
        words += _from_longer(library, begun, most, counts)
    if _prices_switches(problem) and time.monotonic() < deadline:
        words += _with_fewer_switches(library, words)
    if alternatives > 0:  # the best times of a seed's own word are locally optimal, too
        words += [_with_insertions(library, seed, most, 0, counts) for seed in begun]
    if time.monotonic() > deadline:
        status = SearchStatus.OUT_OF_BUDGET
    improved = [
        solution
        for word in words
        if len(word.trims) - library.tail <= most
        for solution in _solutions(asked, word)
        if solution.trims.size <= (problem.horizon.max_trims or LONGEST)
    ]
    return _Improved(list(in_order(improved)), status, counts)


def _cost(word: TimedWord) -> float:
    return word.cost


def compile_calming(problem: Problem) -> None:
    """Have the kernel that shortens chattering words compiled, for any problem like this one."""
    library = library_arrays(problem, search_setup(problem, problem.goals[0]))
    _calmed(library, TimedWord((0,) * CHATTER, np.ones(CHATTER), cost=1.0))


def _from_longer(
    library: LibraryArrays, begun: list[TimedWord], most: int, counts: dict[str, int]
) -> Iterator[TimedWord]:
    """What becomes of the cheapest seed if it may grow first, and is shortened afterwards."""
    grown = [
        _calmed(library, _with_insertions(library, seed, LONGEST, ROUNDS, counts))
        for seed in begun[:GROWN]
    ]
    longer = [word for word in grown if math.isfinite(word.cost) and len(word.trims) > most]
    for word in sorted(longer, key=_cost)[:1]:
        short = shortened(library, word, most)
        if short is not None and len(short.trims) <= most:
            again = _with_insertions(library, short, most, ROUNDS, counts)
            if math.isfinite(again.cost) and len(again.trims) <= most:
                yield again


def _prices_switches(problem: Problem) -> bool:
    """Whether a switch of trims costs something by itself."""
    cost = problem.cost
    return not isinstance(cost, Cost) or cost.switch > 0.0 or cost.direction_change > 0.0


def _with_fewer_switches(library: LibraryArrays, words: Sequence[TimedWord]) -> Iterator[TimedWord]:
    """The words found with fewer and fewer trims: where switches cost, these may pay."""
    if library.free_heading:
        return
    for word in words[:SHORTENED]:
        longer = word
        for most in range(len(word.trims) - 1, 0, -1):
            short = shortened(library, longer, most)
            if short is None:
                break
            yield short
            longer = short


def _as_seed(asked: _Asked, known: Plan) -> Iterator[TimedWord]:
    """A plan in the library's numbers, rest and free turn appended.

    None if a trim is not in the library, or the word is longer than those that are searched.
    """
    automaton, library = asked.problem.automaton, asked.library
    names = set(automaton.trim_names)
    if len(known.trims) <= LONGEST and all(trim.name in names for trim in known.trims):
        word = np.array([automaton.index_of(trim.name) for trim in known.trims], dtype=np.int64)
        if not word.size or (library.number_of[word] >= 0).all():
            yield _in_library(asked, word, known.durations)


def _with_insertions(
    library: LibraryArrays, word: TimedWord, most: int, rounds: int, counts: dict[str, int]
) -> TimedWord:
    """The word with its best times, after inserting what pays, at most `rounds` times."""
    from maneuver_automaton.search import _kernels_insertion as kernels

    trims, times = _with_room(word)
    size, cost, least, used = kernels.improve_word(
        *_seen_by_kernels(library),
        trims,
        times,
        len(word.trims),
        min(most, LONGEST),
        ACCURACY * library.scale,
        rounds,
    )
    counts["insertions"] += int(used)
    return TimedWord(tuple(trims[:size].tolist()), times[:size], float(cost), float(least))


def _seen_by_kernels(library: LibraryArrays) -> tuple[Array, Array, Array, Array, Array, int, int]:
    """The library and the conditions of a problem, in the order in which kernels take them."""
    conditions = library.goal, library.rows, library.targets
    return library.twists, library.rates, *conditions, library.n_priced, library.tail


def _calmed(library: LibraryArrays, word: TimedWord) -> TimedWord:
    """The word with its runs of trims that chatter shortened."""
    from maneuver_automaton.search import _kernels_insertion as kernels

    if len(word.trims) - library.tail < CHATTER:
        return word
    trims, times = _with_room(word)
    size, cost, least = kernels.calm_word(
        *_seen_by_kernels(library),
        trims,
        times,
        len(word.trims),
        word.cost,
    )
    return TimedWord(tuple(trims[:size].tolist()), times[:size], float(cost), float(least))


def _with_room(word: TimedWord) -> tuple[IntArray, Array]:
    """Trims and times in buffers that a kernel lengthens in place."""
    trims, times = np.zeros(LONGEST + 4, dtype=np.int64), np.zeros(LONGEST + 4)
    trims[: len(word.trims)], times[: len(word.trims)] = word.trims, word.durations
    return trims, times


def _solutions(asked: _Asked, word: TimedWord) -> Iterator[Word]:
    """What a word under work has come to, ending at the goal itself; none if it cannot."""
    problem, library = asked.problem, asked.library
    numbers = word.numbers
    times = corrected(library, numbers, word.durations, asked.exact)
    if times is None:
        return
    cost = word.cost + float(library.rates[numbers] @ (times - word.durations))
    kept = slice(0, numbers.size - library.tail)
    trims, lasting = _without_unused(library.trims[numbers[kept]], times[kept])
    switching = problem.cost.switching(problem.automaton.body_velocities[trims])
    yield Word(
        trims=trims,
        durations=lasting,
        cost=cost + library.fixed_cost + switching,
        certificate=word.certificate,
    )


def _without_unused(trims: IntArray, times: Array) -> tuple[IntArray, Array]:
    """A word without unused time; neighbours that it has parted become one."""
    if not (trims == UNUSED).any():
        return trims, times
    used = trims != UNUSED
    trims, times = trims[used], times[used]
    if not trims.size:
        return trims, times
    begins = np.flatnonzero(np.append(True, trims[1:] != trims[:-1]))
    return trims[begins], np.add.reduceat(times, begins)


def _seeds(asked: _Asked) -> Iterator[TimedWord]:
    """Cheapest words of the sub-library, in the library's numbers, rest and free turn appended."""
    found = _words_of_few(asked, asked.problem)
    if not found and asked.total is not None:
        found = _fast_words(asked)
    yield from found


def _words_of_few(asked: _Asked, problem: Problem) -> list[TimedWord]:
    """Seeds of `problem` from the sub-library."""
    solutions = search_setup_words(
        problem,
        sub_library(asked.setup),
        alternatives=asked.seeds - 1,
        deadline=asked.deadline,
        spare=True,
    )
    return [_in_library(asked, solution.trims, solution.durations) for solution in solutions]


def _fast_words(asked: _Asked) -> list[TimedWord]:
    """For a time that no seed meets: first insert for least time, then fill up the time."""
    from maneuver_automaton.problem import Horizon

    limit = asked.total
    hurry = replace(asked.problem, cost=Cost(time=1.0), horizon=Horizon())
    setup = search_setup(hurry, hurry.goals[0])
    setup = replace(setup, goal=asked.setup.goal, free_heading=asked.setup.free_heading)
    library = library_arrays(hurry, setup)
    least = replace(
        asked, problem=hurry, setup=setup, library=library, exact=library.goal, limit=None
    )
    met = []
    for seed in _words_of_few(least, hurry):
        word = _with_insertions(library, seed, LONGEST, ROUNDS, {"insertions": 0})
        if not math.isfinite(word.cost):
            continue
        quick = next(_solutions(least, word), None)
        if quick is not None and limit is not None and quick.duration <= limit + LATE:
            met.append(_in_library(asked, quick.trims, quick.durations))
    return met


def _in_library(asked: _Asked, trims: IntArray, durations: Array) -> TimedWord:
    """A word of the automaton in the library's numbers, rest and free turn appended."""
    library, limit = asked.library, asked.total
    word = library.number_of[trims].tolist()
    times = durations.tolist()
    if limit is not None and library.rest is not None and word[-1:] != [library.rest]:
        word.append(library.rest)
        times.append(max(0.0, limit - sum(times)))
    if library.free_heading:
        word.append(len(library.rates) - 1)
        times.append(_free_turn(library, word[:-1], times))
    return TimedWord(tuple(word), np.array(times))


def _free_turn(library: LibraryArrays, word: list[int], times: list[float]) -> float:
    """Time of the turn that a free heading needs at the end of a word [s], at 1 rad/s."""
    turned = float(library.twists[word, 2] @ np.array(times))
    return float(np.remainder(library.goal[2] - turned, 2.0 * np.pi))


def sub_library(setup: SearchSetup) -> SearchSetup:
    """A few trims that reach far: extreme in eight directions, fast and cheap straights, spins."""
    if len(setup.trims) <= FEW:
        return setup
    rows = _far_reaching(setup.library)
    return replace(
        setup,
        trims=setup.trims[rows],
        twists=setup.twists[rows],
        rates=setup.rates[rows],
        periods=setup.periods[rows],
    )


@kept_by_first
def _far_reaching(library: MovingTrims) -> IntArray:
    """The trims of a sub-library: the same for every start and goal."""
    twists, rates = library.twists, library.rates
    scaled = twists / np.abs(twists).max(axis=0).clip(min=1e-300)
    chosen: list[int] = []

    def choose(score: Array, mask: Array) -> None:
        rows = np.flatnonzero(mask)
        if rows.size:
            order = np.lexsort((rates[rows], -score[rows].round(12)))
            chosen.append(int(rows[order[0]]))

    everything = np.ones(len(twists), dtype=bool)
    straight = twists[:, 2] == 0.0
    spin = np.linalg.norm(scaled[:, :2], axis=1) == 0.0
    speed = np.linalg.norm(twists[:, :2], axis=1)
    for sign in (1.0, -1.0):
        forward = sign * twists[:, 0] > 0.0
        choose(speed, straight & forward)
        choose(-rates / speed.clip(min=1e-300), straight & forward)
        choose(sign * twists[:, 2], spin)
        if twists[:, 1].any():
            choose(sign * twists[:, 1], straight)
        if twists[:, 3].any():
            choose(sign * twists[:, 3], everything)
    for angle in np.arange(8) * np.pi / 4.0:
        choose(np.cos(angle) * scaled[:, 0] + np.sin(angle) * scaled[:, 2], everything)
    return np.array(list(dict.fromkeys(chosen)))

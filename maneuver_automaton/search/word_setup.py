"""The best times, the price and the plan of a given word, from start and trim to goal and trim.

A word under work names the trims that a search chooses. What leads from one to the next, and from
the first trim and to the last, is the cheapest chain of maneuvers, so it need not be named.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._kept import kept_by_first
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.automaton.headings import origin_of
from maneuver_automaton.automaton.validation import trims_between
from maneuver_automaton.costs import StageCost, prices_switches, terms_of
from maneuver_automaton.groups import LieGroup, group_of
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.search.result import TimedWord, plan_of
from maneuver_automaton.search.setup import SearchSetup, goal_from_start
from maneuver_automaton.words import TimesStatus, solve_switching_times
from maneuver_automaton.words.closing import closed_at
from maneuver_automaton.words.library import (
    SWITCH,
    Library,
    MovingTrims,
    library_of,
    most_different,
    with_words,
    words_of,
)
from maneuver_automaton.words.word import Word

LATE = 1e-9  # relative, by which a plan may take longer than it is allowed
VANISHING = 1e-9  # [s] what lasts no longer lasts no time


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class WordSetup:
    """A problem, one of its goals, and the transitions of its automaton with their prices."""

    problem: Problem
    goal: Goal
    library: Library
    alphabet: tuple[int, ...]  # trims that words are made of
    start_trim: int
    goal_trim: int

    @property
    def group(self) -> type[LieGroup]:
        """The group that moves the vehicle."""
        return self.problem.automaton.model.group

    @property
    def pad(self) -> int | None:
        """Where the word may wait for what is left of a fixed time: at its first or last trim."""
        for index in (self.goal_trim, self.start_trim):
            if self.problem.automaton.trims[index].is_rest:
                return index
        return None

    @property
    def limit(self) -> float | None:
        """The longest time a plan may take [s]; exactly so long with a fixed time."""
        horizon = self.problem.horizon
        return horizon.time if horizon.time is not None else horizon.max_time

    @property
    def exactly(self) -> bool:
        """Whether a plan has to last as long as is asked for with no rest to fill the time."""
        return self.problem.horizon.time is not None and self.pad is None

    @property
    def is_mended(self) -> bool:
        """Whether times must meet more than the goal: a least or a longest one, or a sum."""
        longest = self.library.arrays.longest[list(self.alphabet)]
        least = self.problem.horizon.min_coast
        return bool(self.limit or least > 0.0 or (longest < math.inf).any())

    def as_search(self) -> SearchSetup:
        """Arrays for an exhaustive search: the alphabet, and the transitions within it."""
        rows, arrays, problem = list(self.alphabet), self.library.arrays, self.problem
        known, relative = self.library.transitions, goal_from_start(problem, self.goal)
        twists, waiting = arrays.twists[rows], _waiting_rate(problem)
        climbs = twists[:, 3].any() or known.displacement[..., 3].any()
        library = MovingTrims(
            trims=np.array(rows, dtype=np.int64),
            twists=twists,
            rates=arrays.rates[rows] + waiting,
            periods=arrays.periods[rows],
            of=len(arrays.rates),
            rest=self.pad,
            rest_rate=waiting,
            climbs=bool(climbs),
            speeds=np.linalg.norm(twists[:, [0, 1, 3]], axis=1),
            turn_rates=np.abs(twists[:, 2]),
        )
        return SearchSetup(
            library=library,
            goal=relative,
            free_heading=self.goal.free_heading,
            climbs=bool(climbs or relative[3] != 0.0),
            transitions=replace(known, cost=known.cost + waiting * known.time),
            start_class=int(known.class_of[self.start_trim]),
            goal_class=int(known.class_of[self.goal_trim]),
        )

    def links(self, trims: Sequence[int]) -> list[tuple[int, int]]:
        """Neighbours in the word, the first and last trim included."""
        return list(pairwise((self.start_trim, *trims, self.goal_trim)))

    def fixed(self, trims: Sequence[int]) -> tuple[float, float]:
        """Cost and time [s] of the transitions of a word; inf where there is none."""
        pair = self.library.class_pair(*np.array(self.links(trims)).T)
        known = self.library.transitions
        return float(known.cost[pair].sum()), float(known.time[pair].sum())

    def solved(
        self, trims: Sequence[int], guesses: Sequence[Array] = (), *, restarts: int = 0
    ) -> TimedWord | None:
        """The word with locally best times; None if none lead to the goal, or in time."""
        price, lasting = self.fixed(trims)
        if not math.isfinite(price):
            return None
        if not len(trims):
            return self._without_trims()
        total = None if not self.exactly or self.limit is None else self.limit - lasting
        times = self._times(trims, guesses, total, restarts)
        if times is None:
            return None
        too_late = self.limit is not None and self._is_late(float(times.sum()) + lasting)
        if too_late and not self.exactly and self.limit is not None:
            times = self._times(trims, [times], self.limit - lasting, restarts)
            if times is None:
                return None
        return self.priced(trims, times)

    def closed(self, trims: Sequence[int], times: Array) -> TimedWord | None:
        """The word with times next to these, which lead to the goal; None if not in time."""
        if not len(trims):
            return self._without_trims()
        twists, steps = self._rows(trims)
        begin, end, free = self._begin(trims), self.goal.pose, self.goal.free_heading
        closed = closed_at(begin, twists, times, end, displacements=steps, free_heading=free)
        if self._is_late(float(closed.sum()) + self.fixed(trims)[1]):
            return None
        return None if self.exactly else self.priced(trims, closed)

    def priced(self, trims: Sequence[int], durations: Array) -> TimedWord | None:
        """The word with these times and its cost; None if it has too many trims."""
        times = np.where(durations <= VANISHING, 0.0, durations)
        price, lasting = self.fixed(trims)
        total, most = self.problem.horizon.time, self.problem.horizon.max_trims
        waits = total is not None and float(times.sum()) + lasting < total * (1.0 - LATE)
        if most is not None and np.count_nonzero(times) + waits > most:
            return None
        cost = price + float(self.library.arrays.rates[list(trims)] @ times)
        if total is not None or prices_switches(self.problem.cost):
            cost = self.problem.invariant_cost_of(self.plan(trims, times))
        return TimedWord(tuple(trims), times, cost)

    @property
    def switch(self) -> float:
        """Cost of a word for each of its trims but the first, as far as known."""
        terms = terms_of(self.problem.cost)
        return terms.switch if terms else 0.0

    def plan(self, trims: Sequence[int], durations: Array) -> Plan:
        """The plan of a word from the problem's start, padded by rest where the time is fixed."""
        return plan_of(self.problem, self._complete(trims, durations))

    def word(self, timed: TimedWord) -> Word:
        """A word under work with all its trims and transitions, and with its cost."""
        word = self._complete(timed.trims, timed.durations)
        return replace(word, cost=self.problem.invariant_cost_of(plan_of(self.problem, word)))

    def _complete(self, trims: Sequence[int], durations: Array) -> Word:
        """The word with the trims and transitions between those given, and with rest as padding."""
        maneuvers = self.problem.automaton.maneuvers
        chain, times, transitions = [self.start_trim], [0.0], list[int]()
        for trim, time in zip((*trims, self.goal_trim), (*durations.tolist(), 0.0), strict=True):
            for maneuver, following in self.library.chain(chain[-1], trim):
                transitions.append(maneuver)
                chain.append(following)
                times.append(0.0)
            times[-1] += time
        lasting = sum(maneuvers[k].duration for k in transitions if k != SWITCH)
        total, pad = self.problem.horizon.time, self.pad
        if total is not None and pad is not None:
            times[-1 if pad == self.goal_trim else 0] += max(0.0, total - (sum(times) + lasting))
        return _without_idle(chain, times, transitions, maneuver_time=lasting)

    def timed(self, word: Word) -> TimedWord:
        """A word without what follows by itself: rest as padding, trims that chains pass through.

        The first trim and the last are those of the problem.
        """
        trims = [self.start_trim, *word.trims.tolist(), self.goal_trim]
        times = [0.0, *word.durations.tolist(), 0.0]
        links = np.array([SWITCH, *word.transitions.tolist(), SWITCH])
        if self.problem.horizon.time is not None and self.pad is not None and word.trims.size:
            times[-2 if self.pad == self.goal_trim else 1] = 0.0
        kept = [0]
        for k in range(1, len(trims) - 1):
            passed = links[kept[-1] : k + 1]
            chain = self.library.transitions.chain(trims[kept[-1]], trims[k + 1])
            known = [maneuver for maneuver, _ in chain if maneuver != SWITCH]
            if times[k] > 0.0 or passed[passed != SWITCH].tolist() != known:
                kept.append(k)
        return TimedWord(tuple(trims[k] for k in kept[1:]), np.array([times[k] for k in kept[1:]]))

    def _times(
        self, trims: Sequence[int], guesses: Sequence[Array], total: float | None, restarts: int
    ) -> Array | None:
        if total is not None and total < 0.0:
            return None
        twists, steps = self._rows(trims)
        begin, group = group_of(self.goal.pose.size)(self._begin(trims)), self.group
        rows, arrays = list(trims), self.library.arrays
        solved = solve_switching_times(
            twists,
            arrays.rates[rows],
            (begin.inverse() @ group(self.goal.pose)).pose,
            displacements=steps,
            total=total,
            free_heading=self.goal.free_heading,
            least=np.full(len(rows), self.problem.horizon.min_coast),
            longest=arrays.longest[rows],
            guesses=guesses,
            restarts=restarts,
        )
        return None if solved.status is TimesStatus.FAILED else np.array(solved.durations)

    def _begin(self, trims: Sequence[int]) -> Array:
        """Pose (dof,) after the transition out of the first trim."""
        group, dof = self.group, self.problem.start.size
        (out,) = self.library.displacements([self.start_trim, trims[0]])
        return (group(self.problem.start) @ group(out[:dof])).pose

    def _rows(self, trims: Sequence[int]) -> tuple[Array, Array]:
        """Twists (n, dof), and displacements (n, dof) of the transitions after each trim."""
        dof = self.problem.start.size
        steps = self.library.displacements([*trims, self.goal_trim])
        return self.library.arrays.twists[list(trims), :dof], steps[:, :dof]

    def _without_trims(self) -> TimedWord | None:
        """The transition from the first trim to the last, if it leads to the goal."""
        group, dof = self.group, self.problem.start.size
        (over,) = self.library.displacements([self.start_trim, self.goal_trim])
        end = np.array((group(self.problem.start) @ group(over[:dof])).pose)
        misses = max(self.goal.off(end)) > self.library.arrays.rounding.met
        if misses or self.exactly or self._is_late(self.fixed(())[1]):
            return None
        return self.priced((), np.zeros(0))

    def _is_late(self, duration: float) -> bool:
        return self.limit is not None and duration > self.limit * (1.0 + LATE)


def word_setup(
    problem: Problem, goal: Goal, *, most_trims: int, also: Sequence[int] = (), steers: bool = False
) -> WordSetup:
    """Library and alphabet from which every search over words with maneuvers starts.

    Words are made of the trims that differ most where the library has more than `most_trims`; the
    first trim, the last, and those of the indices `also` are among them. Where it
    `steers`, the library lists the words to be steered along.
    """
    automaton = problem.automaton
    start_trim = automaton.index_of(problem.first_trim.name)
    goal_trim = automaton.index_of(problem.last_trim(goal).name)
    wanted = tuple(sorted({start_trim, goal_trim, *also}))
    useful = trims_between(automaton, start_trim, [goal_trim])
    kept = None if len(useful) == len(automaton) else tuple(useful.tolist())
    alphabet, library = _library(
        automaton, problem.cost, _waiting_rate(problem), most_trims, wanted, steers, kept
    )
    return WordSetup(
        problem=problem,
        goal=goal,
        library=library,
        alphabet=alphabet,
        start_trim=start_trim,
        goal_trim=goal_trim,
    )


@kept_by_first
def maneuver_prices(automaton: Automaton, cost: StageCost) -> Array:
    """Cost of every maneuver (M,), with the switches to it and within it as far as known."""
    name, still = automaton.trim_names[0], origin_of(automaton, automaton.trims[0])
    any_problem = Problem(automaton, still, Goal(pose=still, trim=name), cost=cost, start_trim=name)
    terms = terms_of(cost)
    if terms is None or not prices_switches(cost):
        return np.array([any_problem.maneuver_cost(one) for one in automaton.maneuvers])
    costs = list[float]()
    for one in automaton.maneuvers:
        ends = automaton[one.source], automaton[one.target]
        alone = Plan(still, ends, durations=[0.0, 0.0], maneuvers=(one,))
        costs.append(any_problem.invariant_cost_of(alone))
    return np.array(costs) + terms.switch


@kept_by_first
def _library(
    automaton: Automaton,
    cost: StageCost,
    waiting: float,
    most_trims: int,
    wanted: tuple[int, ...],
    steers: bool,
    useful: tuple[int, ...] | None,
) -> tuple[tuple[int, ...], Library]:
    """Trims that words are made of, of the `useful` ones, the transitions, and words to steer."""
    library = _transitions(automaton, cost, waiting)
    twists = library.arrays.twists[: library.arrays.n_trims]
    moving = np.flatnonzero(twists[:, :3].any(axis=1))
    if useful is not None:
        moving = np.intersect1d(moving, useful)
    chosen = set(moving[most_different(twists[moving], most_trims)].tolist())
    chosen |= set(wanted) & set(moving.tolist())
    if steers:
        words, n_few = words_of(sorted(chosen), library.transitions, library.arrays.twists)
        library = replace(library, arrays=with_words(library.arrays, words, n_few))
    upright = library.arrays.tried.climbs[: library.arrays.tried.n_upright].tolist()
    return tuple(sorted(chosen.union(upright))), library


@kept_by_first
def _transitions(automaton: Automaton, cost: StageCost, waiting: float) -> Library:
    """The library with its prices, less what rest would cost per second meanwhile."""
    rates = cost.rates(automaton.controls, automaton.body_velocities)
    prices = maneuver_prices(automaton, cost)
    lasting = np.array([maneuver.duration for maneuver in automaton.maneuvers])
    prices = np.maximum(prices - waiting * lasting, 0.0)
    rates = np.maximum(rates - waiting, 0.0)
    return library_of(automaton, rates=rates, maneuver_costs=prices, trims=())


def _waiting_rate(problem: Problem) -> float:
    """Cost per second of the rest that fills a fixed time; 0 where none does."""
    rest = problem.automaton.rest
    if problem.horizon.time is None or rest is None:
        return 0.0
    return float(problem.rates[rest])


def _without_idle(
    trims: Sequence[int],
    durations: Sequence[float],
    transitions: Sequence[int],
    *,
    maneuver_time: float,
) -> Word:
    """The word without trims that last no time and stand between no maneuvers."""
    kept = [
        k
        for k in range(len(trims))
        if durations[k] > 0.0
        or (k > 0 and transitions[k - 1] != SWITCH)
        or (k < len(transitions) and transitions[k] != SWITCH)
    ] or [0]
    # what was left out had switches on either side
    links = [transitions[a] if b == a + 1 else SWITCH for a, b in pairwise(kept)]
    return Word(
        trims=np.array([trims[k] for k in kept]),
        durations=np.array([durations[k] for k in kept]),
        transitions=np.array(links, dtype=np.int64),
        maneuver_time=maneuver_time,
    )

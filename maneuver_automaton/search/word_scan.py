"""A scan of all words of trims, shorter ones first, by kernels that propose and polish times.

Words with transitions are scanned as they are seen from before them; see `_kernels_problem`.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._kept import kept_by_first
from maneuver_automaton.budget import Budget, EvenPace
from maneuver_automaton.costs import terms_of
from maneuver_automaton.problem import Problem
from maneuver_automaton.search import _kernels_words
from maneuver_automaton.search._kernels_polish import polish_candidates
from maneuver_automaton.search._kernels_problem import (
    Alphabet,
    Candidates,
    Found,
    Links,
    ScanSettings,
    WordProblem,
    WordTerms,
)
from maneuver_automaton.search.result import TIE, TimedWord, tied
from maneuver_automaton.search.setup import Columns, SearchSetup, columns
from maneuver_automaton.words._kernels_times import TimesProblem
from maneuver_automaton.words.library import FULL_TURN, MovingTrims, Transitions
from maneuver_automaton.words.word import Word

MOST_TRIMS = 4  # trims of one word, the free turn among them: three in closed form, one scanned
NODES = 64  # per scanned time, bisected where the function bends
TOLERANCE = 1e-12  # relative, for tangent circles and parallel lines
CAPACITY = 4096
SECONDS_IF_FREE = (0.0, 1e-6, 1e-6, 1e-6, 5e-5)  # by trims, for words of no linear condition
PORTIONS_AT_ONCE = np.array([128, 8])  # words of three trims, and of four, before solutions count
MOMENT = 0.02  # [s] that nobody minds to wait for
AT_ONCE = 0.1  # share of the time left that a scan may take without a look at the clock
SECONDS_PER_WORD = (1e-6, 1e-6, 1e-6, 5e-6, 1e-3)  # by trims, where little time is left

BoolArray = NDArray[np.bool_]
KernelProblem = tuple[WordProblem, Links]


@dataclass(frozen=True, slots=True, eq=False)
class Mode:
    """One way to meet the time: padded by rest, exactly, or free."""

    kernel_problem: KernelProblem  # its trims and conditions, its transitions
    most_moving: int
    at_least: float = -math.inf  # cost of the whole time at the cheapest trim, where it is fixed


class WordScan:
    """A scan of all words of up to `most` trims: its buffers, and what it has found.

    Where `not_first` is a trim of the automaton, fewer words need to be scanned: those of `most`
    trims that do not begin with it.
    """

    def __init__(
        self,
        problem: Problem,
        setup: SearchSetup,
        most: int,
        alternatives: int | None,
        *,
        nodes: int = NODES,
        spare: bool = False,
        slack: float = math.inf,
        upper_bound: float = math.inf,
        not_first: int | None = None,
    ) -> None:
        self.problem = problem
        self.setup = setup
        self.most = most
        self.nodes = nodes
        self.spare = spare
        self.slack = slack
        self.tables = tables(setup.library, free_heading=setup.free_heading)
        trims = setup.library.trims.tolist()
        self.not_first = trims.index(not_first) if not_first in trims else -1  # a row of the search
        # a user's own price of switches is added afterwards: what is cheap now may be costly then
        self.own_prices = terms_of(problem.cost) is None
        if self.own_prices:
            alternatives = None
        self.pruned = alternatives is not None or upper_bound < math.inf
        self.asked = None if alternatives is None else alternatives + 1
        self.upper_bound = upper_bound
        self._begin(CAPACITY)

    def _begin(self, capacity: int) -> None:
        """Begin to scan, with room for so many solutions."""
        width = MOST_TRIMS + 1
        self.candidates = Candidates(
            words=np.empty((CAPACITY, width), dtype=np.int64),
            times=np.empty((CAPACITY, width)),
            sizes=np.empty(CAPACITY, dtype=np.int64),
            isolated=np.empty(CAPACITY, dtype=np.int64),
            counter=np.zeros(3, dtype=np.int64),
            turns=np.zeros((3, width), dtype=np.int64),
            work=np.zeros(width),
        )
        self.found = Found(
            words=np.empty((capacity + 1, width), dtype=np.int64),
            times=np.empty((capacity + 1, width)),
            costs=np.empty(capacity),
            counter=np.zeros(1, dtype=np.int64),
            best=np.full(self.asked or capacity, self.upper_bound),
        )

    @property
    def n_found(self) -> int:
        """Solutions found, also those for which there was no room."""
        return int(self.found.counter[0])

    @property
    def n_words(self) -> int:
        """Words looked at that may be cheap enough."""
        return int(self.candidates.counter[1])

    @property
    def n_steering(self) -> int:
        """Calls of the steering function."""
        return int(self.candidates.counter[2])

    def run(self, budget: Budget, max_words: int | None) -> bool:
        """Scan and polish, shorter words first; False if a limit ended it.

        Where there is no room for all solutions they are scanned again, if there is time.
        """
        modes = list(self.modes())
        tail = 1 if self.setup.free_heading else 0
        if max_words is None:
            at_once = [mode for mode in modes if self._takes_a_moment(mode, budget)]
            modes = [mode for mode in modes if mode not in at_once]
            if at_once:  # in one call: calls take longer than a scan of few words
                both = (*at_once, at_once[0])[:2]  # in place of a second way to meet the time
                limits = [min(mode.most_moving, self.most) for mode in at_once]
                _kernels_words.scan_all_words(
                    *both[0].kernel_problem,
                    *both[1].kernel_problem,
                    np.array([*limits, 0][:2]),
                    np.array([mode.at_least for mode in both]),
                    self.candidates,
                    self.found,
                    tail,
                    PORTIONS_AT_ONCE,
                    self.most,
                    TIE,
                    self.not_first,
                )
        finished = all(
            self._scan_all(flat, chunk, mode, n, budget, max_words)
            for n in range(1, self.most + 1)
            for mode in modes
            if n <= mode.most_moving and mode.at_least <= tied(float(self.found.best[-1]))
            for flat, chunk in self._scans(n + tail, mode)
        )
        if self.n_found <= len(self.found.costs):
            return finished
        if budget.is_over:
            return False
        self._begin(2 * self.n_found)
        return self.run(budget, max_words)

    def _takes_a_moment(self, mode: Mode, budget: Budget) -> bool:
        """Whether a whole scan is so short that nobody asks the clock meanwhile."""
        tail = 1 if self.setup.free_heading else 0
        if self.most + tail > MOST_TRIMS:
            return False
        each = SECONDS_PER_WORD if mode.kernel_problem[0].library.targets.size else SECONDS_IF_FREE
        numbers = range(1, min(self.most, mode.most_moving) + 1)
        seconds = math.fsum(len(self.setup.library.trims) ** n * each[n + tail] for n in numbers)
        return seconds <= MOMENT and seconds <= AT_ONCE * budget.left

    def _scan_all(
        self, flat: bool, chunk: int, mode: Mode, n: int, budget: Budget, max_words: int | None
    ) -> bool:
        """Scan all words of `n` trims that span the plane, or not; `chunk` at a time."""
        tail = 1 if self.setup.free_heading else 0
        number, last = 0, len(self.setup.library.trims) ** n
        # Another portion may prune other words, and count them so: it is smaller only at the end.
        pace = EvenPace(budget, most=chunk, each=SECONDS_PER_WORD[n + tail])
        while number < last:
            left = last if max_words is None else max(max_words - self.n_words, 1)
            step = pace.take(min(left, last - number))
            if not step:
                return False
            upper_bound = tied(float(self.found.best[-1]))
            numbers = (n + tail, number, number + step)
            number = _kernels_words.scan_words(
                *mode.kernel_problem, self.candidates, flat, numbers, upper_bound
            )
            if self.candidates.counter[0]:
                polish_candidates(*mode.kernel_problem, self.candidates, self.found, self.most)
            if max_words is not None and self.n_words >= max_words:
                return False
        return True

    def _scans(self, n: int, mode: Mode) -> Iterator[tuple[bool, int]]:
        """Whether words of `n` trims are looked at that do not span; how many at a time."""
        # Every chunk may lower the upper bound, and costs a call with all arrays. The clock is
        # asked between chunks: one of long words takes up to 25 ms.
        few = 1024 if self.pruned else 2048
        if n <= 2 + mode.kernel_problem[0].library.targets.size:
            yield True, few
        if n >= 3:
            yield False, few if n == 3 else 50

    def modes(self) -> Iterator[Mode]:
        """A fixed time padded by rest; free; a fixed or longest time met exactly.

        The last one not where the cheapest trim for so long is too costly.
        """
        horizon, setup = self.problem.horizon, self.setup
        longest = MOST_TRIMS - int(setup.free_heading)
        exact = horizon.time if horizon.time is not None else horizon.max_time
        if horizon.time is None:
            kernel_problem = self._kernel_problem(horizon.max_time, pad=False, fixed=False)
            yield Mode(kernel_problem, min(self.most, longest))
        elif setup.library.rest is not None:
            # of `max_trims`, rest is one, unless the rest of the time happens to be none
            kernel_problem = self._kernel_problem(horizon.time, pad=True, fixed=False)
            yield Mode(kernel_problem, min(self.most - 1, longest))
        if exact is not None:
            most = min(self.most, 2 if self.spare else longest)
            at_least = exact * self.tables.least_rate if len(setup.library.rates) else math.inf
            if at_least > tied(float(self.found.best[-1])):
                return
            yield Mode(self._kernel_problem(exact, pad=False, fixed=True), most, at_least)

    def _kernel_problem(self, limit: float | None, *, pad: bool, fixed: bool) -> KernelProblem:
        """The kernels' problem and its transitions; of one class of trims, the identity."""
        setup, terms, tables = self.setup, terms_of(self.problem.cost), self.tables
        rest_rate = setup.library.rest_rate if pad else 0.0
        ends = setup.start_class, setup.goal_class
        same = _same_for_all(tables, setup.transitions, rest_rate, setup.climbs, fixed, *ends)
        targets = [float(setup.goal[3])] if setup.climbs else []
        if fixed and limit is not None:
            targets.append(limit)
        linked = len(same.links.cost) > 1
        x, y, heading, _ = setup.goal.tolist()
        distance = math.hypot(x, y)
        turn = abs(math.remainder(heading, FULL_TURN))
        bounded = math.inf if limit is None else limit
        fixed_time = self.problem.horizon.time is not None
        problem = WordProblem(
            library=TimesProblem(
                twists=tables.columns.twists,
                rates=same.rates,
                rows=same.rows,
                goal=np.array(setup.goal),
                targets=np.array(targets, dtype=np.float64),
            ),
            trims=Alphabet(
                numbers=same.trims,
                prices=same.per_unit,
                periods=tables.periods,
                reaches=tables.reaches(setup, most=bounded),
                parallel=tables.parallel,
                weights=tables.columns.weights,
            ),
            size=same.size,
            fixed=np.array([0.0, 0.0, distance, turn, 0.0, 0.0, 0.0, x, y]),
            terms=WordTerms(
                time_limit=float(bounded),
                pad=int(pad),
                pad_cost=float(setup.library.rest_rate * bounded) if pad else 0.0,
                switch=terms.switch if terms else 0.0,
                direction_change=0.0 if linked or not terms else terms.direction_change,
                more_turns=int((fixed_time and not self.spare) or setup.climbs),
                shortest=setup.shortest,
            ),
            scan=ScanSettings(nodes=self.nodes, slack=self.slack, tolerance=TOLERANCE),
            tail=len(same.rates) - 1 if setup.free_heading else -1,
        )
        return problem, same.links

    def solutions(self) -> Iterator[Word]:
        """Words found by rising cost, rest last; if pruned, those asked for, and ties."""
        for word, times, cost in self._rows():
            yield self._padded(word, times, cost)

    def timed(self) -> Iterator[TimedWord]:
        """The moving trims of what was found, by the automaton's numbers, and their times."""
        for word, times, cost in self._rows():
            yield TimedWord(tuple(word.tolist()), times, cost=cost)

    def _rows(self) -> Iterator[tuple[IntArray, Array, float]]:
        """Moving trims, their times and cost of what was found, by rising cost."""
        costs: list[float] = self.found.costs[: self.n_found].tolist()
        costliest = math.inf if self.own_prices else tied(float(self.found.best[-1]))
        for k in sorted(range(len(costs)), key=costs.__getitem__):
            if self.pruned and costs[k] > costliest:
                break
            numbers = self.found.words[k]
            size = sum(number >= 0 for number in numbers.tolist()) - int(self.setup.free_heading)
            yield self.setup.library.trims[numbers[:size]], self.found.times[k, :size], costs[k]

    def _padded(self, word: IntArray, times: Array, cost: float) -> Word:
        time_s = self.problem.horizon.time
        if time_s is not None and self.setup.library.rest is not None:
            left = time_s - float(times.sum())
            if left > 1e-9:
                word = np.array([*word.tolist(), self.setup.library.rest], dtype=np.int64)
                times = np.array([*times.tolist(), left])
        if self.own_prices:
            cost += self.problem.cost.switching(self.problem.automaton.body_velocities[word])
        return Word(trims=word, durations=times, cost=cost)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Tables:
    """Tables of every trim for kernels, the turn of a free heading last."""

    columns: Columns
    least_rate: float  # of all trims but the free turn
    periods: Array  # (M,) [s]
    paces: Array  # (M, 2) metres and radians per second
    parallel: BoolArray  # (M, M)
    turns: Array  # (M,) [s] of a full turn, 0 for straights
    straights: IntArray  # trims that move and do not turn
    fastest: Array  # [m/s] of these on the way to a goal, in the plane or upwards
    largest: float  # [m] radius of a turn

    def reaches(self, setup: SearchSetup, *, most: float) -> Array:
        """Longest time of interest per trim: a full turn, or a path well beyond the goal.

        Not more than `most` [s].
        """
        place = math.hypot(float(setup.goal[0]), float(setup.goal[1]))
        length = max(2.0 * (place + 4.0 * self.largest) + abs(float(setup.goal[3])), 1e-3)
        reaches = self.turns.copy()
        reaches[self.straights] = length / self.fastest
        return reaches if most == math.inf else np.minimum(reaches, most)


class _SameForAll(NamedTuple):
    """What all searches of a library with some conditions share, for every start and goal."""

    trims: IntArray  # (M,)
    size: IntArray  # (1,)
    rates: Array  # (M,)
    per_unit: Array  # (M, 2)
    rows: Array  # (m, M)
    links: Links


@kept_by_first
def _same_for_all(
    tables: _Tables,
    known: Transitions,
    rest_rate: float,
    climbs: bool,
    fixed: bool,
    start: int,
    goal: int,
) -> _SameForAll:
    """Trims above a rest of this rate, linear conditions, transitions; kernels only read them."""
    rates, per_unit = _rates_above(tables, rest_rate)
    met = [(tables.columns.twists[:, 3], known.displacement[..., 3])] if climbs else []
    met += [(tables.columns.weights, known.time)] if fixed else []
    links = Links(
        class_of=known.class_of[tables.columns.trims],
        start=start,
        goal=goal,
        displacement=np.array(known.displacement),
        cost=known.cost - rest_rate * known.time if rest_rate else np.array(known.cost),
        time=np.array(known.time),
        gains=np.array([gain for _, gain in met]).reshape(len(met), *known.time.shape),
    )
    return _SameForAll(
        trims=np.arange(len(rates)),
        size=np.zeros(1, dtype=np.int64),
        rates=rates,
        per_unit=per_unit,
        rows=np.array([row for row, _ in met]).reshape(len(met), len(rates)),
        links=links,
    )


@kept_by_first
def _rates_above(tables: _Tables, rest: float) -> tuple[Array, Array]:
    """Cost per second (M,) less a rest's; and (M, 2) per metre and per radian, inf for none."""
    rates = tables.columns.rates - rest * tables.columns.weights if rest else tables.columns.rates
    none = np.full(tables.paces.shape, np.inf)
    return rates, np.divide(rates[:, None], tables.paces, out=none, where=tables.paces > 0.0)


@kept_by_first
def tables(library: MovingTrims, *, free_heading: bool) -> _Tables:
    """The tables of a library, for every start and goal."""
    kept = columns(library, pads=False, free_heading=free_heading)
    twists, periods = kept.twists, np.array(library.periods)
    if free_heading:
        periods = np.append(periods, FULL_TURN)
    turning = twists[:, 2] != 0.0
    speeds = np.sqrt(twists[:, 0] ** 2 + twists[:, 1] ** 2)
    fastest = np.maximum(speeds, np.abs(twists[:, 3]))
    straights = np.flatnonzero(~turning & (fastest > 0.0))
    return _Tables(
        columns=kept,
        least_rate=float(library.rates.min(initial=math.inf)),
        periods=periods,
        paces=np.stack([np.hypot(twists[:, 0], twists[:, 1]), np.abs(twists[:, 2])], axis=1),
        parallel=_parallel(twists[:, :3].tobytes(), len(twists)),
        turns=np.where(turning, periods, 0.0),
        straights=straights,
        fastest=fastest[straights],
        largest=float((speeds[turning] / np.abs(twists[turning, 2])).max(initial=0.0)),
    )


@functools.lru_cache(maxsize=4)
def _parallel(rows: bytes, n: int) -> BoolArray:
    """Which pairs of `n` twists span one line only (n, n): of thousands it takes long."""
    twists = np.frombuffer(rows).reshape(n, 3)
    lengths = np.sqrt((twists**2).sum(axis=1)).clip(min=1e-300)
    a, b, c = (twists / lengths[:, None]).T
    minors = [np.outer(p, q) for p, q in ((a, b), (b, c), (c, a))]
    square = sum((minor - minor.T) ** 2 for minor in minors)
    return np.asarray(np.sqrt(square) < 1e-9)

"""A scan of all words of trims, shorter ones first, by kernels that propose and polish times.

Words with transitions are scanned as they are seen from before them; see `_kernels_problem`.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array
from maneuver_automaton.budget import Budget, EvenPace
from maneuver_automaton.costs import Cost
from maneuver_automaton.problem import Problem
from maneuver_automaton.search.alternatives import tied
from maneuver_automaton.search.setup import SearchSetup
from maneuver_automaton.search.timed_word import TimedWord
from maneuver_automaton.words.library import FULL_TURN
from maneuver_automaton.words.word import Word

MOST_TRIMS = 5  # moving trims of one word; each beyond three is scanned on a grid
NODES = 64  # per scanned time, bisected where the function bends
NODES_2D = 32  # per scanned time where there are two
TOLERANCE = 1e-12  # relative, for tangent circles and parallel lines
CAPACITY = 4096
SECONDS_PER_WORD = (1e-6, 1e-6, 1e-6, 5e-6, 1e-3, 2e-2)  # by trims, where little time is left

BoolArray = NDArray[np.bool_]


def scanned(
    problem: Problem,
    setup: SearchSetup,
    most: int,
    *,
    alternatives: int | None,
    upper_bound: float,
    nodes: int,
    budget: Budget,
    spare: bool = False,
    slack: float = math.inf,
    most_words: int | None,
) -> tuple[WordScan, bool]:
    """A scan of all words of up to `most` trims, and whether no limit ended it."""
    capacity = CAPACITY
    while True:
        scan = WordScan(
            problem,
            setup,
            most,
            alternatives,
            capacity=capacity,
            nodes=nodes,
            spare=spare,
            slack=slack,
            upper_bound=upper_bound,
        )
        finished = scan.run(budget, most_words)
        if scan.n_found <= capacity:
            return scan, finished
        if budget.is_over:  # there is no time to scan them again, with room for all
            return scan, False
        capacity = 2 * scan.n_found


@dataclass(frozen=True, slots=True, eq=False)
class Mode:
    """One way to meet the time: padded by rest, exactly, or free."""

    kernel_problem: tuple[Any, Any]  # its trims and conditions, its transitions
    most_moving: int
    at_least: float = -math.inf  # cost of the whole time at the cheapest trim, where it is fixed


class WordScan:
    """A scan of all words: its buffers, and what it has found."""

    def __init__(
        self,
        problem: Problem,
        setup: SearchSetup,
        most: int,
        alternatives: int | None,
        *,
        capacity: int = CAPACITY,
        nodes: int = NODES,
        spare: bool = False,
        slack: float = math.inf,
        upper_bound: float = math.inf,
    ) -> None:
        from maneuver_automaton.search import _kernels_polish, _kernels_problem, _kernels_words

        self.kernels = _kernels_words
        self.polish = _kernels_polish.polish_candidates
        self.problem = problem
        self.setup = setup
        self.most = most
        self.nodes = nodes
        self.spare = spare
        self.slack = slack
        self.tables = _tables(setup)
        self._gridded = False
        width = MOST_TRIMS + 1
        # a user's own price of switches is added afterwards: what is cheap now may be dear then
        self.own_prices = not isinstance(problem.cost, Cost)
        if self.own_prices:
            alternatives = None
        self.pruned = alternatives is not None or upper_bound < math.inf
        asked = capacity if alternatives is None else alternatives + 1
        self.candidates = _kernels_problem.Candidates(
            words=np.zeros((CAPACITY, width), dtype=np.int64),
            times=np.zeros((CAPACITY, width)),
            sizes=np.zeros(CAPACITY, dtype=np.int64),
            isolated=np.zeros(CAPACITY, dtype=np.int64),
            counter=np.zeros(3, dtype=np.int64),
            turns=np.zeros((3, width), dtype=np.int64),
            work=np.zeros(width),
        )
        self.found = _kernels_problem.Found(
            words=np.zeros((capacity + 1, width), dtype=np.int64),
            times=np.zeros((capacity + 1, width)),
            costs=np.zeros(capacity),
            counter=np.zeros(1, dtype=np.int64),
            best=np.full(asked, upper_bound),
        )

    @property
    def gridded(self) -> bool:
        """Whether a word with two times free was scanned, which may miss a solution."""
        return self._gridded

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
        """Scan and polish, shorter words first; False if a limit ended it."""
        modes = list(self.modes())
        tail = 1 if self.setup.free_heading else 0
        for n in range(1, self.most + 1):
            for mode in modes:
                if n > mode.most_moving or mode.at_least > tied(float(self.found.best[-1])):
                    continue
                calls = self.n_steering
                for scan, chunk in self._scans(n + tail, mode):
                    if not self._scan_all(scan, chunk, mode, n, budget, max_words):
                        return False
                if n + tail > 4 and self.n_steering > calls:
                    self._gridded = True
        return True

    def _scan_all(
        self,
        scan: Callable[..., int],
        chunk: int,
        mode: Mode,
        n: int,
        budget: Budget,
        max_words: int | None,
    ) -> bool:
        """Scan all words of `n` trims with one kernel, `chunk` at a time; False at a limit."""
        tail = 1 if self.setup.free_heading else 0
        number, last = 0, len(self.setup.trims) ** n
        # Another portion may prune other words, and count them so: it is smaller only at the end.
        pace = EvenPace(budget, most=chunk, each=SECONDS_PER_WORD[min(n + tail, 5)])
        while number < last:
            left = last if max_words is None else max(max_words - self.n_words, 1)
            step = pace.take(min(left, last - number))
            if not step:
                return False
            upper_bound = tied(float(self.found.best[-1]))
            number = scan(
                *mode.kernel_problem, self.candidates, n + tail, number, number + step, upper_bound
            )
            if self.candidates.counter[0]:
                self.polish(*mode.kernel_problem, self.candidates, self.found, self.most)
            if max_words is not None and self.n_words >= max_words:
                return False
        return True

    def _scans(self, n: int, mode: Mode) -> Iterator[tuple[Callable[..., int], int]]:
        """Kernels that words of `n` trims need, and how many words at a time."""
        # Every chunk may lower the upper bound, and costs a call with all arrays. The clock is
        # asked between chunks: one of long words takes up to 25 ms.
        few = 1024 if self.pruned else 2048
        if n <= 2 + mode.kernel_problem[0].targets.size:
            yield self.kernels.scan_flat_words, few
        if n == 3:
            yield self.kernels.scan_words, few
        elif n == 4:
            yield self.kernels.scan_words, 50
        elif n > 4:
            yield self.kernels.scan_long_words, 2

    def modes(self) -> Iterator[Mode]:
        """A fixed time padded by rest; free; a fixed or longest time met exactly."""
        horizon, setup = self.problem.horizon, self.setup
        exact = horizon.time if horizon.time is not None else horizon.max_time
        if horizon.time is None:
            yield Mode(self._kernel_problem(horizon.max_time, pad=False, fixed=False), self.most)
        elif setup.rest is not None:
            # of `max_trims`, rest is one, unless the rest of the time happens to be none
            yield Mode(self._kernel_problem(horizon.time, pad=True, fixed=False), self.most - 1)
        if exact is not None:
            most = min(2, self.most) if self.spare else self.most
            at_least = exact * float(setup.rates.min()) if len(setup.rates) else math.inf
            yield Mode(self._kernel_problem(exact, pad=False, fixed=True), most, at_least)

    def _kernel_problem(self, limit: float | None, *, pad: bool, fixed: bool) -> tuple[Any, Any]:
        """The kernels' problem and its transitions; of one class of trims, the identity."""
        from maneuver_automaton.search._kernels_problem import Links, WordProblem

        setup, cost, tables = self.setup, self.problem.cost, self.tables
        rates, weights = tables.rates, tables.weights
        known = setup.transitions
        rows, targets, gains = [], [], []
        if setup.climbs:
            rows.append(tables.twists[:, 3])
            targets.append(setup.goal[3])
            gains.append(known.displacement[..., 3])
        if fixed:
            rows.append(weights)
            targets.append(limit)
            gains.append(known.time)
        prices = known.cost
        if pad:
            rates = rates - setup.rest_rate * weights
            prices = prices - setup.rest_rate * known.time
        linked = len(prices) > 1
        distance = math.hypot(*setup.goal[:2])
        turn = abs(math.remainder(setup.goal[2], FULL_TURN))
        bounded = math.inf if limit is None else limit
        fixed_time = self.problem.horizon.time is not None
        problem = WordProblem(
            trims=np.arange(len(rates)),
            size=np.zeros(1, dtype=np.int64),
            twists=tables.twists,
            rates=rates,
            prices=np.divide(
                rates[:, None],
                tables.paces,
                out=np.full(tables.paces.shape, np.inf),
                where=tables.paces > 0.0,
            ),
            rows=np.array(rows).reshape(len(rows), len(rates)),
            targets=np.array(targets, dtype=np.float64),
            periods=tables.periods,
            reaches=np.minimum(tables.reaches, bounded),
            parallel=tables.parallel,
            weights=weights,
            goal=np.array(setup.goal),
            fixed=np.array([0.0, 0.0, distance, turn, 0.0, 0.0, 0.0, *setup.goal[:2]]),
            time_limit=float(bounded),
            pad=int(pad),
            pad_cost=float(setup.rest_rate * bounded) if pad else 0.0,
            switch=float(getattr(cost, "switch", 0.0)),
            direction_change=0.0 if linked else float(getattr(cost, "direction_change", 0.0)),
            more_turns=int((fixed_time and not self.spare) or setup.climbs),
            nodes=self.nodes,
            nodes_2d=NODES_2D,
            slack=self.slack,
            tolerance=TOLERANCE,
            shortest=setup.shortest,
            tail=len(rates) - 1 if setup.free_heading else -1,
        )
        links = Links(
            class_of=known.class_of[setup.trims],
            start=setup.start_class,
            goal=setup.goal_class,
            displacement=np.array(known.displacement),
            cost=np.array(prices),
            time=np.array(known.time),
            gains=np.array(gains).reshape(len(gains), *known.time.shape),
        )
        return problem, links

    def solutions(self) -> Iterator[Word]:
        """Words found by rising cost, rest last; if pruned, those asked for, and ties."""
        yield from map(self._padded, self.timed())

    def timed(self) -> Iterator[TimedWord]:
        """The moving trims of what was found, by the automaton's numbers, and their times."""
        n = self.n_found
        costs = self.found.costs[:n]
        dearest = math.inf if self.own_prices else tied(float(self.found.best[-1]))
        for k in np.argsort(costs, kind="stable"):
            if self.pruned and costs[k] > dearest:
                break
            size = int(np.count_nonzero(self.found.words[k] >= 0))
            if self.setup.free_heading:
                size -= 1
            word = self.setup.trims[self.found.words[k, :size]]
            times = self.found.times[k, :size]
            yield TimedWord(tuple(word.tolist()), times, cost=float(costs[k]))

    def _padded(self, found: TimedWord) -> Word:
        word, times, cost = found.numbers, found.durations, found.cost
        time_s = self.problem.horizon.time
        if time_s is not None and self.setup.rest is not None:
            left = time_s - float(times.sum())
            if left > 1e-9:
                word = np.append(word, self.setup.rest)
                times = np.append(times, left)
        if self.own_prices:
            cost += self.problem.cost.switching(self.problem.automaton.body_velocities[word])
        return Word(trims=word, durations=times, cost=cost)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Tables:
    """Tables of every trim for kernels, the turn of a free heading last."""

    twists: Array  # (M, 4)
    rates: Array  # (M,)
    periods: Array  # (M,) [s]
    weights: Array  # (M,) 0 for the free turn, otherwise 1
    paces: Array  # (M, 2) metres and radians per second
    parallel: BoolArray  # (M, M)
    reaches: Array  # (M,) [s]


def load_tables(setup: SearchSetup) -> None:
    """Have ready what all problems of a library share."""
    _tables(setup)


def _priced(rates: Array, paces: Array) -> Array:
    """Cost (M, 2) per metre and per radian, inf where a trim makes none."""
    none = np.full(paces.shape, np.inf)
    return np.asarray(np.divide(rates[:, None], paces, out=none, where=paces > 0.0))


def _tables(setup: SearchSetup) -> _Tables:
    twists, rates, periods = np.array(setup.twists), np.array(setup.rates), np.array(setup.periods)
    weights = np.ones(len(rates))
    if setup.free_heading:
        twists = np.vstack([twists, [0.0, 0.0, 1.0, 0.0]])
        rates = np.append(rates, 0.0)
        periods = np.append(periods, FULL_TURN)
        weights = np.append(weights, 0.0)
    return _Tables(
        twists=twists,
        rates=rates,
        periods=periods,
        weights=weights,
        paces=np.stack([np.hypot(twists[:, 0], twists[:, 1]), np.abs(twists[:, 2])], axis=1),
        parallel=_parallel(twists),
        reaches=_reaches(setup, twists, periods),
    )


def _reaches(setup: SearchSetup, twists: Array, periods: Array) -> Array:
    """Longest time of interest per trim: a full turn, or a path well beyond the goal."""
    turning = twists[:, 2] != 0.0
    speeds = np.sqrt(twists[:, 0] ** 2 + twists[:, 1] ** 2)
    radii = speeds[turning] / np.abs(twists[turning, 2])
    place = math.hypot(float(setup.goal[0]), float(setup.goal[1]))
    length = 2.0 * (place + 4.0 * radii.max(initial=0.0)) + abs(setup.goal[3])
    pace = np.maximum(speeds, np.abs(twists[:, 3]))
    with np.errstate(divide="ignore"):
        straight = np.where(pace > 0.0, max(length, 1e-3) / pace, 0.0)
    return np.where(turning, periods, straight)


def _parallel(twists: Array) -> BoolArray:
    """Which pairs of twists span one line only (M, M), altitude aside."""
    return _parallel_rows(twists[:, :3].tobytes(), len(twists))


@functools.lru_cache(maxsize=4)
def _parallel_rows(rows: bytes, n: int) -> BoolArray:
    """The same of `n` twists; of thousands it takes longer than most searches, so it is kept."""
    twists = np.frombuffer(rows).reshape(n, 3)
    lengths = np.sqrt((twists**2).sum(axis=1)).clip(min=1e-300)
    a, b, c = (twists / lengths[:, None]).T
    minors = [np.outer(p, q) for p, q in ((a, b), (b, c), (c, a))]
    square = sum((minor - minor.T) ** 2 for minor in minors)
    return np.asarray(np.sqrt(square) < 1e-9)

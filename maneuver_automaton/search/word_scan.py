"""A scan of all words of trims, shorter ones first, by kernels that propose and polish times.

Words with transitions are scanned as they are seen from before them; see `_kernels_problem`.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import bound
from maneuver_automaton._kept import kept_by_first
from maneuver_automaton._kernel_list import many_calls_are_expected
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
    Nodes,
    ScanSettings,
    WordProblem,
    WordTerms,
)
from maneuver_automaton.search._kernels_scan_one import DOUBLED, LEAST_NODES
from maneuver_automaton.search.momenta import NONE, momenta_of
from maneuver_automaton.search.result import TIE, TimedWord, tied
from maneuver_automaton.search.setup import Columns, SearchSetup, columns
from maneuver_automaton.words._kernels_times import TimesProblem
from maneuver_automaton.words.library import FULL_TURN, MovingTrims
from maneuver_automaton.words.word import Word

MOST_TRIMS = 4  # trims of one word, the free turn among them: three in closed form, one scanned
NODES = 64  # per scanned time, bisected where the function bends
BLEND = 0.618034  # [s/m] of altitude in the condition of the time; hardly a ratio of two trims
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
    at_least: float  # cost of the whole time at the cheapest trim, where it is fixed
    seconds: float  # that a whole scan may take; inf where words are too long for one


class Extent(NamedTuple):
    """Which words a scan looks at, and how closely."""

    most: int  # trims
    alternatives: int | None  # beside the cheapest; None for all
    nodes: int = NODES
    spare: bool = False
    slack: float = math.inf


class WordScan:
    """A scan of all words of up to so many trims: its buffers, and what it has found.

    Where `not_first` is a trim of the automaton, fewer words need to be scanned: of the longest
    ones those that do not begin with it.
    """

    def __init__(self, problem: Problem, setup: SearchSetup, extent: Extent) -> None:
        self.automaton, self.cost, self.horizon = problem.automaton, problem.cost, problem.horizon
        self.setup, alternatives = setup, extent.alternatives
        self.most, self.nodes, self.spare = extent.most, extent.nodes, extent.spare
        self.slack = extent.slack
        self.tables = tables(setup.library, free_heading=setup.free_heading)
        # a user's own price of switches is added afterwards: what is cheap now may be costly then
        self.own_prices = terms_of(problem.cost) is None
        self.asked = None if alternatives is None or self.own_prices else alternatives + 1
        limit = self.horizon.max_time if self.horizon.time is None else self.horizon.time
        self.limit = math.inf if limit is None else limit  # [s]
        self.idle: list[WordScan] = []  # where it is put once its results are read
        self.upper_bound = math.inf
        self.ends = np.zeros(13)
        self.goal, self.fixed = self.ends[:4], self.ends[4:]  # of all modes
        self.reaches = np.minimum(self.tables.turns, self.limit)
        self.modes = tuple(self._modes())
        self._make_room(CAPACITY)
        self.begin(setup)

    def begin(
        self, setup: SearchSetup, *, upper_bound: float = math.inf, not_first: int | None = None
    ) -> None:
        """Begin with another goal, in the memory of the last scan."""
        self.setup = setup
        left_out = -1 if not_first is None else self.tables.columns.number_of[not_first]
        self.pruned = self.asked is not None or upper_bound < math.inf
        self.upper_bound = upper_bound
        x, y, heading, rise = setup.goal.tolist()
        distance, turn = math.hypot(x, y), abs(math.remainder(heading, FULL_TURN))
        self.ends[:] = x, y, heading, rise, 0.0, 0.0, distance, turn, 0.0, 0.0, 0.0, x, y
        # longest time of interest: a full turn, or a path well beyond the goal
        length = max(2.0 * (distance + 4.0 * self.tables.largest) + abs(rise), 1e-3)
        straight = length / self.tables.fastest
        self.reaches[self.tables.straights] = np.minimum(straight, self.limit)
        if setup.climbs:
            for mode in self.modes:
                targets = mode.kernel_problem[0].library.targets
                targets[0], targets[1:] = rise, self.limit + BLEND * rise
        if len(self.found.costs) > CAPACITY:
            self._make_room(CAPACITY)
        self.counters[:] = 0, 0, 0, 0, left_out
        self.found.best[:] = upper_bound

    def _make_room(self, capacity: int) -> None:
        """Make room for so many solutions."""
        width, self.counters = MOST_TRIMS + 1, np.zeros(5, dtype=np.int64)
        self.candidates = Candidates(
            words=np.empty((CAPACITY, width), dtype=np.int64),
            times=np.empty((CAPACITY, width)),
            sizes=np.empty(CAPACITY, dtype=np.int64),
            isolated=np.empty(CAPACITY, dtype=np.int64),
            counter=self.counters[:3],
            turns=np.zeros((3, width), dtype=np.int64),
            work=np.zeros(width),
            nodes=_room(self.nodes),
        )
        self.found = Found(
            words=np.empty((capacity + 1, width), dtype=np.int64),
            times=np.empty((capacity + 1, width)),
            costs=np.empty(capacity),
            counter=self.counters[3:4],
            best=np.full(self.asked or capacity, self.upper_bound),
        )
        self.calls: dict[int, Callable[[], None]] = {}  # by the number of modes at once

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
        upper_bound = tied(float(self.found.best[-1]))
        modes = [one for one in self.modes if one.at_least <= upper_bound]
        tail = 1 if self.setup.free_heading else 0
        if max_words is None:
            moment = min(MOMENT, AT_ONCE * budget.left)  # in which nobody asks the clock
            at_once = [mode for mode in modes if mode.seconds <= moment]
            modes = [mode for mode in modes if mode not in at_once]
            if at_once:  # in one call: calls take longer than a scan of few words
                self._scan_at_once(at_once, tail)
        finished = not modes or all(
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
        self._make_room(2 * self.n_found)
        return self.run(budget, max_words)

    def _scan_at_once(self, modes: list[Mode], tail: int) -> None:
        """Scan all words of one or two modes, whose arrays stay what they are at every call."""
        if len(modes) not in self.calls:
            both = (*modes, modes[0])[:2]  # in place of a second way to meet the time
            limits = [min(mode.most_moving, self.most) for mode in modes]
            self.calls[len(modes)] = bound(
                _kernels_words.scan_all_words,
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
                self.counters[4:],
            )
        self.calls[len(modes)]()

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

    def _modes(self) -> Iterator[Mode]:
        """A fixed time padded by rest; free; a fixed or longest time met exactly."""
        horizon, setup = self.horizon, self.setup
        longest = MOST_TRIMS - int(setup.free_heading)
        if horizon.time is None:
            yield self._mode(min(self.most, longest))
        elif setup.library.rest is not None:
            # of `max_trims`, rest is one, unless the rest of the time happens to be none
            yield self._mode(min(self.most - 1, longest), pad=True)
        if self.limit < math.inf:
            yield self._mode(min(self.most, 2 if self.spare else longest), fixed=True)

    def _mode(self, most_moving: int, *, pad: bool = False, fixed: bool = False) -> Mode:
        """The kernels' problem and its transitions; of one class of trims, the identity."""
        setup, terms, tables, limit = self.setup, terms_of(self.cost), self.tables, self.limit
        known, kept, rest_rate = setup.transitions, tables.columns, setup.library.rest_rate * pad
        height, rise = known.displacement[..., 3], float(setup.goal[3])
        met = [(kept.twists[:, 3], height, rise)] if setup.climbs else []
        if fixed:  # with a share of the altitude: trims alike but for that take the same time
            b = BLEND if setup.climbs else 0.0
            met += [
                (kept.weights + b * kept.twists[:, 3], known.time + b * height, limit + b * rise)
            ]
        links = Links(
            class_of=known.class_of[kept.trims],
            start=setup.start_class,
            goal=setup.goal_class,
            displacement=np.array(known.displacement),
            cost=known.cost - rest_rate * known.time if rest_rate else np.array(known.cost),
            time=np.array(known.time),
            gains=np.array([gain for _, gain, _ in met]).reshape(len(met), *known.time.shape),
        )
        rates = kept.rates - rest_rate * kept.weights if rest_rate else kept.rates
        prices = np.full(tables.paces.shape, np.inf)  # where a trim makes no metre, or no radian
        np.divide(rates[:, None], tables.paces, out=prices, where=tables.paces > 0.0)
        tabled = not (met or pad or setup.free_heading) and self.most == 4 and len(links.cost) == 1
        momenta = momenta_of(setup.library) if tabled and many_calls_are_expected() else NONE
        gears = terms.direction_change if terms and len(links.cost) == 1 else 0.0
        problem = WordProblem(
            library=TimesProblem(
                twists=kept.twists,
                rates=rates,
                rows=np.array([row for row, *_ in met]).reshape(len(met), len(rates)),
                goal=self.goal,
                targets=np.array([target for *_, target in met], dtype=np.float64),
            ),
            trims=Alphabet(
                numbers=np.arange(len(rates)),
                prices=prices,
                periods=tables.periods,
                reaches=self.reaches,
                parallel=tables.parallel,
                weights=kept.weights,
            ),
            size=np.zeros(1, dtype=np.int64),
            fixed=self.fixed,
            terms=WordTerms(
                time_limit=float(limit),
                pad=int(pad),
                pad_cost=float(setup.library.rest_rate * limit) if pad else 0.0,
                switch=terms.switch if terms else 0.0,
                direction_change=gears,
                more_turns=int((self.horizon.time is not None and not self.spare) or setup.climbs),
                shortest=setup.shortest,
            ),
            scan=ScanSettings(self.nodes, self.slack, TOLERANCE, momenta),
            tail=len(rates) - 1 if setup.free_heading else -1,
        )
        tail, trims = int(setup.free_heading), len(setup.library.trims)
        each, seconds = SECONDS_PER_WORD if met else SECONDS_IF_FREE, math.inf
        if self.most + tail <= MOST_TRIMS:
            numbers = range(1, min(self.most, most_moving) + 1)
            seconds = math.fsum(trims**n * each[n + tail] for n in numbers)
        at_least = (limit * tables.least_rate if trims else math.inf) if fixed else -math.inf
        return Mode((problem, links), most_moving, at_least, seconds)

    def solutions(self) -> Iterator[Word]:
        """Words found by rising cost, rest last; if pruned, those asked for, and ties."""
        return itertools.starmap(self._padded, self._rows())

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
            size = numbers.tolist().index(-1) - int(self.setup.free_heading)
            yield self.setup.library.trims[numbers[:size]], self.found.times[k, :size], costs[k]

    def _padded(self, word: IntArray, times: Array, cost: float) -> Word:
        time_s, numbers, lasting = self.horizon.time, word.tolist(), times.tolist()
        if time_s is not None and self.setup.library.rest is not None:
            left = time_s - float(np.add.reduce(times))
            if left > 1e-9:
                numbers.append(self.setup.library.rest)
                lasting.append(left)
        if self.own_prices:
            cost += self.cost.switching(self.automaton.body_velocities[numbers])
        return Word(trims=np.array(numbers, dtype=np.int64), durations=np.array(lasting), cost=cost)


def _room(most: int) -> Nodes:
    """Room for the nodes of a word's free time."""
    n = max(most, LEAST_NODES) + DOUBLED
    nodes = (2, n + 1, 4), (2, n + 1), (2, n + 1), (n,), (n + 1,), (n + 1,)
    others = (3, 24, 4), (2, 3), (4, 4), (4, 3), (3, 4), (2, 2)
    live, stretches = np.empty((2, n), dtype=np.bool_), np.empty((40, 2), dtype=np.int64)
    return Nodes(live, stretches, *[np.empty(shape) for shape in (*nodes, *others)])


@kept_by_first
def _idle(library: MovingTrims, *asked: Hashable) -> list[WordScan]:
    return []


def scan_of(problem: Problem, setup: SearchSetup, extent: Extent) -> WordScan:
    """A scan that begins; if there is one, in the memory of one that differs in the goal alone.

    For trims that switch at will. Once its results are read, it goes back to the `idle` ones.
    """
    asked = problem.cost, problem.horizon, extent
    idle = _idle(setup.library, *asked, setup.free_heading, setup.climbs)
    try:
        job = idle.pop()
    except IndexError:  # asked for before, another thread might take the last one
        job = WordScan(problem, setup, extent)
    job.idle = idle
    return job


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

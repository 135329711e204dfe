"""Exhaustive search over words: every locally optimal solution, cheapest first."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.costs import Cost
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.search.alternatives import in_order, tied
from maneuver_automaton.search.result import SearchResult, SearchStatus
from maneuver_automaton.search.setup import SearchSetup, search_setup
from maneuver_automaton.words.word import Word

MOST_TRIMS = 5  # moving trims of one word; each beyond three is scanned on a grid
NODES = 64  # per scanned time, bisected where the function bends
SEED_NODES = 24  # where a rough answer will do
NODES_2D = 32  # per scanned time where there are two
TOLERANCE = 1e-12  # relative, for tangent circles and parallel lines
CAPACITY = 4096

BoolArray = NDArray[np.bool_]


def search_words(
    problem: Problem,
    goal: Goal,
    *,
    alternatives: int | None = 0,
    time_limit: float = math.inf,
    nodes: int = NODES,
    ceiling: float = math.inf,
    ties: bool = False,
) -> SearchResult:
    """Search every word of at most ``max_trims`` trims for its locally optimal coasting times.

    *Locally optimal*: all times are positive and no small feasible change of them is cheaper;
    isolated solutions count. Words of up to four moving trims are scanned in one dimension with
    roots bracketed; words of five on a grid of two, which can miss solutions that lie closer than
    its cells.

    Parameters
    ----------
    problem : Problem
    goal : Goal
    alternatives : int, optional
        How many solutions beside the cheapest; bounds prune what cannot be among them. None asks
        for the complete list, and nothing is pruned.
    time_limit : float
        [s] after which the search ends with what it has.
    nodes : int
        Grid nodes per scanned time.
    ceiling : float
        Cost of a plan that is known: what is dearer may be left out, and so there may be none.
    ties : bool
        Whether to list, beside the solutions asked for, all that cost as much as the last of them.

    Returns
    -------
    SearchResult
        Solutions by rising cost, then fewer trims, then word; ``complete`` if nothing was pruned.

    Raises
    ------
    ValueError
        If more trims are admitted than an exhaustive search can take.

    Examples
    --------
    >>> from maneuver_automaton.automaton import Automaton
    >>> from maneuver_automaton.models import Unicycle
    >>> controls = {"ahead": (1, 0), "left": (0, 1), "right": (0, -1)}
    >>> robot = Automaton.of_controls(Unicycle(), controls)
    >>> problem = Problem(robot, [0, 0, 0], [1, 1, 0])
    >>> best = search_words(problem, problem.goals[0]).solutions[0]
    >>> [robot.trim_names[k] for k in best.trims], round(best.cost, 4)
    (['left', 'ahead', 'right'], 2.985)
    """
    deadline = time.monotonic() + time_limit
    setup = search_setup(problem, goal)
    most = problem.horizon.max_trims
    limit = MOST_TRIMS - (1 if setup.free_heading else 0)
    if most is None:
        most = limit
    elif most > limit:
        raise ValueError(
            f"search by words: max_trims is {most}, need at most {limit}; use insertion for more"
        )
    if setup.start_is_goal and (problem.horizon.time is None or setup.rest is not None):
        return resting(problem, setup)
    capacity = CAPACITY
    while True:
        job = _Job(
            problem,
            setup,
            most,
            alternatives,
            capacity=capacity,
            nodes=nodes,
            ceiling=ceiling,
        )
        finished = job.run(deadline, problem.search.max_expansions)
        if job.n_found <= capacity:
            break
        capacity = 2 * job.n_found
    solutions = tuple(in_order(job.solutions()))
    if alternatives is not None and len(solutions) > alternatives + 1:
        asked = solutions[: alternatives + 1]
        most_tied = tied(asked[-1].cost) if ties else -math.inf
        solutions = asked + tuple(
            one for one in solutions[alternatives + 1 :] if one.cost <= most_tied
        )
    if solutions:
        status = SearchStatus.FOUND
    else:
        status = SearchStatus.EXHAUSTED if finished else SearchStatus.OUT_OF_BUDGET
    return SearchResult(
        status=status,
        solutions=solutions,
        complete=alternatives is None and finished and ceiling == math.inf,
        exhaustive=finished and problem.horizon.max_trims is not None and not job.gridded,
        counts={"expansions": job.n_words, "steering_calls": job.n_steering},
    )


def compile_scanning(problem: Problem) -> None:
    """Have the kernel that scans words compiled, for any problem like this one."""
    job, mode = _first_job(problem)
    job.kernels.scan_words(mode.kernel_problem, job.candidates, 3, 0, 0, math.inf)


def compile_polishing(problem: Problem) -> None:
    """Have the other kernels of the search compiled, for any problem like this one."""
    job, mode = _first_job(problem)
    job.kernels.scan_flat_words(mode.kernel_problem, job.candidates, 1, 0, 0, math.inf)
    job.polish(mode.kernel_problem, job.candidates, job.found, MOST_TRIMS)


def _first_job(problem: Problem) -> tuple[_Job, _Mode]:
    job = _Job(problem, search_setup(problem, problem.goals[0]), MOST_TRIMS, 0)
    return job, next(job.modes())


def search_setup_words(
    problem: Problem,
    setup: SearchSetup,
    *,
    alternatives: int,
    deadline: float,
    spare: bool,
) -> list[Word]:
    """Cheapest words of as few trims as the conditions need, from the trims of `setup` alone.

    `spare`: where a rest pads a fixed time, words that meet it exactly have two trims at most.
    """
    conditions = 3 + int(setup.climbs)
    padded = problem.horizon.time is not None and setup.rest is not None
    exact = problem.horizon.time is not None and not padded
    most = min(conditions + int(exact), MOST_TRIMS)
    job = _Job(
        problem, setup, most + int(padded), alternatives, nodes=SEED_NODES, spare=spare and padded
    )
    job.run(deadline, None)
    return list(in_order(job.solutions()))[: alternatives + 1]


def resting(problem: Problem, setup: SearchSetup) -> SearchResult:
    """Start equal to goal: an empty word, or the whole of a fixed time at rest."""
    time_s = problem.horizon.time
    if time_s is None or setup.rest is None:
        empty = Word(trims=np.zeros(0, dtype=np.int64), durations=np.zeros(0), cost=0.0)
        return SearchResult(
            status=SearchStatus.FOUND, solutions=(empty,), complete=False, exhaustive=True
        )
    rest = Word(
        trims=np.array([setup.rest]),
        durations=np.array([time_s]),
        cost=setup.rest_rate * time_s,
    )
    return SearchResult(
        status=SearchStatus.FOUND, solutions=(rest,), complete=False, exhaustive=True
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Mode:
    """One way to meet the time: padded by rest, exactly, or free."""

    kernel_problem: Any
    most_moving: int
    at_least: float = -math.inf  # cost of the whole time at the cheapest trim, where it is fixed


class _Job:
    """One search under way: its buffers, and what it has found."""

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
        ceiling: float = math.inf,
    ) -> None:
        from maneuver_automaton.search import _kernels_polish, _kernels_problem, _kernels_words

        self.kernels = _kernels_words
        self.polish = _kernels_polish.polish_candidates
        self.problem = problem
        self.setup = setup
        self.most = most
        self.nodes = nodes
        self.spare = spare
        self.tables = _tables(setup)
        self._gridded = False
        width = MOST_TRIMS + 1
        # a user's own price of switches is added afterwards, so nothing is pruned by it
        self.own_prices = not isinstance(problem.cost, Cost)
        if self.own_prices:
            alternatives, ceiling = None, math.inf
        self.pruned = alternatives is not None or ceiling < math.inf
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
            words=np.zeros((capacity, width), dtype=np.int64),
            times=np.zeros((capacity, width)),
            costs=np.zeros(capacity),
            counter=np.zeros(1, dtype=np.int64),
            best=np.full(asked, ceiling),
        )

    @property
    def gridded(self) -> bool:
        """Whether a word with two times free was scanned, which may miss a solution."""
        return self._gridded

    @property
    def n_found(self) -> int:
        return int(self.found.counter[0])

    @property
    def n_words(self) -> int:
        return int(self.candidates.counter[1])

    @property
    def n_steering(self) -> int:
        return int(self.candidates.counter[2])

    def run(self, deadline: float, max_words: int | None) -> bool:
        """Scan and polish, shorter words first; False if a limit ended it."""
        modes = list(self.modes())
        tail = 1 if self.setup.free_heading else 0
        for n in range(1, self.most + 1):
            for mode in modes:
                if n > mode.most_moving or mode.at_least > tied(float(self.found.best[-1])):
                    continue
                calls = self.n_steering
                for scan, chunk in self._scans(n + tail, mode):
                    if not self._scan_all(scan, chunk, mode, n, deadline, max_words):
                        return False
                if n + tail > 4 and self.n_steering > calls:
                    self._gridded = True
        return True

    def _scan_all(
        self,
        scan: Callable[..., int],
        chunk: int,
        mode: _Mode,
        n: int,
        deadline: float,
        max_words: int | None,
    ) -> bool:
        """Scan all words of `n` trims with one kernel, `chunk` at a time; False at a limit."""
        tail = 1 if self.setup.free_heading else 0
        number, last = 0, len(self.setup.trims) ** n
        while number < last:
            until = min(number + chunk, last)
            ceiling = tied(float(self.found.best[-1]))
            number = scan(mode.kernel_problem, self.candidates, n + tail, number, until, ceiling)
            if self.candidates.counter[0]:
                self.polish(mode.kernel_problem, self.candidates, self.found, self.most)
            if time.monotonic() > deadline:
                return False
            if max_words is not None and self.n_words >= max_words:
                return False
        return True

    def _scans(self, n: int, mode: _Mode) -> Iterator[tuple[Callable[..., int], int]]:
        """Kernels that words of `n` trims need, and how many words at a time."""
        few = 256 if self.pruned else 50_000
        if n <= 2 + mode.kernel_problem.targets.size:
            yield self.kernels.scan_flat_words, few
        if n == 3:
            yield self.kernels.scan_words, few
        elif n == 4:
            yield self.kernels.scan_words, 500
        elif n > 4:
            yield self.kernels.scan_long_words, 10

    def modes(self) -> Iterator[_Mode]:
        """A fixed time padded by rest; free; a fixed or longest time met exactly."""
        horizon, setup = self.problem.horizon, self.setup
        exact = horizon.time if horizon.time is not None else horizon.max_time
        if horizon.time is None:
            yield _Mode(self._kernel_problem(horizon.max_time, pad=False, fixed=False), self.most)
        elif setup.rest is not None:
            # of `max_trims`, rest is one, unless the rest of the time happens to be none
            yield _Mode(self._kernel_problem(horizon.time, pad=True, fixed=False), self.most - 1)
        if exact is not None:
            most = min(2, self.most) if self.spare else self.most
            at_least = exact * float(setup.rates.min()) if len(setup.rates) else math.inf
            yield _Mode(self._kernel_problem(exact, pad=False, fixed=True), most, at_least)

    def _kernel_problem(self, limit: float | None, *, pad: bool, fixed: bool) -> Any:
        from maneuver_automaton.search._kernels_problem import WordProblem

        setup, cost, tables = self.setup, self.problem.cost, self.tables
        rates, weights = tables.rates, tables.weights
        rows, targets = [], []
        if setup.climbs:
            rows.append(tables.twists[:, 3])
            targets.append(setup.goal[3])
        if fixed:
            rows.append(weights)
            targets.append(limit)
        if pad:
            rates = rates - setup.rest_rate * weights
        bounded = math.inf if limit is None else limit
        fixed_time = self.problem.horizon.time is not None
        return WordProblem(
            twists=tables.twists,
            rates=rates,
            rows=np.array(rows).reshape(len(rows), len(rates)),
            targets=np.array(targets, dtype=np.float64),
            periods=tables.periods,
            reaches=np.minimum(tables.reaches, bounded),
            parallel=tables.parallel,
            weights=weights,
            goal=np.array(setup.goal),
            time_limit=float(bounded),
            pad=int(pad),
            pad_cost=float(setup.rest_rate * bounded) if pad else 0.0,
            switch=float(getattr(cost, "switch", 0.0)),
            direction_change=float(getattr(cost, "direction_change", 0.0)),
            more_turns=int((fixed_time and not self.spare) or setup.climbs),
            nodes=self.nodes,
            nodes_2d=NODES_2D,
            tolerance=TOLERANCE,
            shortest=self.problem.horizon.min_coast,
            tail=len(rates) - 1 if setup.free_heading else -1,
        )

    def solutions(self) -> Iterator[Word]:
        """What was found by rising cost, rest last; if pruned, what was asked for, and ties."""
        n = self.n_found
        costs = self.found.costs[:n]
        rows = []
        dearest = math.inf if self.own_prices else tied(float(self.found.best[-1]))
        for k in np.argsort(costs, kind="stable"):
            if self.pruned and costs[k] > dearest:
                break
            size = int(np.count_nonzero(self.found.words[k] >= 0))
            if self.setup.free_heading:
                size -= 1
            word = self.setup.trims[self.found.words[k, :size]]
            rows.append(self._padded(word, self.found.times[k, :size], float(costs[k])))
        yield from rows

    def _padded(self, word: IntArray, times: Array, cost: float) -> Word:
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
    """What a kernel needs of every trim, the turn of a free heading last."""

    twists: Array  # (M, 4)
    rates: Array  # (M,)
    periods: Array  # (M,) [s]
    weights: Array  # (M,) 0 for the free turn, otherwise 1
    parallel: BoolArray  # (M, M)
    reaches: Array  # (M,) [s]


def _tables(setup: SearchSetup) -> _Tables:
    twists, rates, periods = np.array(setup.twists), np.array(setup.rates), np.array(setup.periods)
    weights = np.ones(len(rates))
    if setup.free_heading:
        twists = np.vstack([twists, [0.0, 0.0, 1.0, 0.0]])
        rates = np.append(rates, 0.0)
        periods = np.append(periods, 2.0 * np.pi)
        weights = np.append(weights, 0.0)
    return _Tables(
        twists=twists,
        rates=rates,
        periods=periods,
        weights=weights,
        parallel=_parallel(twists),
        reaches=_reaches(setup, twists, periods),
    )


def _reaches(setup: SearchSetup, twists: Array, periods: Array) -> Array:
    """Longest time of interest per trim: a full turn, or a way well beyond the goal."""
    turning = twists[:, 2] != 0.0
    speeds = np.sqrt(twists[:, 0] ** 2 + twists[:, 1] ** 2)
    radii = speeds[turning] / np.abs(twists[turning, 2])
    place = math.hypot(float(setup.goal[0]), float(setup.goal[1]))
    way = 2.0 * (place + 4.0 * radii.max(initial=0.0)) + abs(setup.goal[3])
    pace = np.maximum(speeds, np.abs(twists[:, 3]))
    with np.errstate(divide="ignore"):
        straight = np.where(pace > 0.0, max(way, 1e-3) / pace, 0.0)
    return np.where(turning, periods, straight)


def _parallel(twists: Array) -> BoolArray:
    """Which pairs of twists span one line only (M, M), altitude aside."""
    lengths = np.sqrt((twists[:, :3] ** 2).sum(axis=1)).clip(min=1e-300)
    a, b, c = (twists[:, :3] / lengths[:, None]).T
    minors = [np.outer(p, q) for p, q in ((a, b), (b, c), (c, a))]
    square = sum((minor - minor.T) ** 2 for minor in minors)
    return np.asarray(np.sqrt(square) < 1e-9)

"""Exhaustive search over words of trims and maneuvers: locally optimal ones, cheapest first.

The last three trims follow in closed form; times of those before them are scanned on a grid, and
what is cheaper there than its neighbours is refined.
"""

from __future__ import annotations

import functools
import itertools
import math
import time
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.groups import group_of
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.search.alternatives import TIE, in_order
from maneuver_automaton.search.result import SearchResult, SearchStatus
from maneuver_automaton.search.timed_word import TimedWord
from maneuver_automaton.search.word_setup import WordSetup, word_setup
from maneuver_automaton.words import _kernels_candidates as kernels
from maneuver_automaton.words.word import Word

MOST_TRIMS = 24  # of a larger library those that differ most
MOST_LETTERS = 4  # trims of one word, unless more are asked for
CLOSED_FORM = 3  # trims at the end of a word whose times are not scanned
NODES = (0, 16, 8, 5)  # grid nodes per scanned time, by how many times are scanned
HEADINGS = 24  # a free heading is tried at so many
SLACK = 0.1  # share by which a grid value may be dearer than what is asked for, and yet be refined
EXPANSIONS_A_WORD = 8  # steering calls, or expansions, in place of solving one word for its times
NO_WAY = 1e-6  # [m] between the ends of a transition that is not priced by the metre
SAME = 1e-9  # relative, between durations; and of twists whose bracket is none
LEAP = 0.35  # share of the grid's step by which times of one family change more, at most, per time


def search_maneuver_words(
    problem: Problem,
    goal: Goal,
    *,
    alternatives: int | None = 0,
    time_limit: float = math.inf,
    ceiling: float = math.inf,
    most_letters: int = MOST_LETTERS,
    most_trims: int = MOST_TRIMS,
) -> SearchResult:
    """Words from the problem's first trim to the goal's last one, with maneuvers in between.

    Between two trims stands the cheapest chain of maneuvers, so a word of the library's graph with
    dearer ones, or with maneuvers that lead from a trim to itself, is not among them. A word's
    trims each coast for a while, or for no time between two maneuvers.

    Parameters
    ----------
    problem : Problem
    goal : Goal
    alternatives : int, optional
        How many solutions beside the cheapest. None: all that are found, nothing is pruned.
    time_limit : float
        [s] after which the search ends with what it has; ``search.max_expansions`` of the problem
        limits it by the number of steering calls, and of words solved for their times, instead:
        the same at every call.
    ceiling : float
        Cost of a plan that is known: what is dearer may be left out.
    most_letters : int
        Trims of a word that coast, at most; the horizon's ``max_trims`` may be less.
    most_trims : int
        Words are made of so many trims of the library, of a larger one of those that differ most.

    Returns
    -------
    SearchResult
        ``complete`` if all words of up to three trims were searched, nothing pruned, and no longer
        ones were asked for: those are scanned on a grid, which may miss some.

    Examples
    --------
    >>> from maneuver_automaton.automaton import Automaton
    >>> from maneuver_automaton.models import Unicycle
    >>> controls = {"ahead": (1, 0), "left": (1, 1), "right": (1, -1)}
    >>> robot = Automaton.of_controls(Unicycle(), controls)
    >>> from maneuver_automaton.problem import Goal
    >>> goal = Goal(pose=[3.0, 1.0, 0.0], trim="ahead")
    >>> problem = Problem(robot, [0, 0, 0], goal, start_trim="ahead")
    >>> best = search_maneuver_words(problem, goal).solutions[0]
    >>> [robot.trim_names[k] for k in best.trims], round(best.cost, 4)
    (['left', 'ahead', 'right'], 3.1754)
    """
    setup = word_setup(problem, goal, most_trims=most_trims)
    job = _Job(setup, alternatives, ceiling, time.monotonic() + time_limit)
    letters = min(most_letters, problem.horizon.max_trims or most_letters)
    finished = job.run(letters)
    found = tuple(job.kept())
    if found:
        status = SearchStatus.FOUND
    else:
        status = SearchStatus.EXHAUSTED if finished else SearchStatus.OUT_OF_BUDGET
    everything = alternatives is None and ceiling == math.inf and finished
    return SearchResult(
        status=status,
        solutions=found,
        complete=everything and letters <= CLOSED_FORM and not goal.free_heading,
        counts={"expansions": job.calls, "polished": job.polished},
    )


@functools.cache
def load_maneuver_words() -> None:
    """Have the kernels ready that search words with maneuvers."""
    from maneuver_automaton.automaton import Automaton
    from maneuver_automaton.models import Unicycle

    robot = Automaton.of_controls(Unicycle(), {"ahead": (1, 0), "left": (1, 1)})
    goal = Goal(pose=np.array([1.0, 1.0, 1.0]), trim="ahead")
    problem = Problem(robot, [0, 0, 0], goal, start_trim="ahead")
    search_maneuver_words(problem, goal)


class _Candidates(NamedTuple):
    """What one steering call found."""

    costs: Array  # (n,)
    durations: Array  # (n,) [s]
    rows: IntArray  # (n,) which word
    climbs: IntArray  # (n,) vertical trim at the end, -1 for none
    times: Array  # (n, 4)


class _Prefix(NamedTuple):
    """Trims before the last three, with grid nodes of their times."""

    trims: tuple[int, ...]
    nodes: tuple[int, ...]
    times: tuple[float, ...]
    pose: Array
    cost: float
    duration: float  # [s] transitions included


class _Job:
    """One search under way."""

    def __init__(
        self, setup: WordSetup, alternatives: int | None, ceiling: float, deadline: float
    ) -> None:
        self.setup = setup
        self.problem = setup.problem
        self.alternatives = alternatives
        self.ceiling = ceiling
        self.deadline = deadline
        self.scratch = setup.library.scratch()
        self.found: list[TimedWord] = []
        self.calls = 0
        self.polished = 0
        self.letters = list(setup.letters)
        self.per_metre = _least_price(setup)

    def run(self, most_letters: int) -> bool:
        """Search words of up to so many trims; False if a limit ended it."""
        for word in self._closed_form(most_letters):
            self._keep(word)
        for scanned in range(1, most_letters - CLOSED_FORM + 1):
            for trims in itertools.product(self.letters, repeat=scanned):
                if any(a == b for a, b in itertools.pairwise(trims)):
                    continue
                if not self._scan(trims):
                    return False
        return not self._over()

    def kept(self) -> list[Word]:
        """What was found and asked for, cheapest first."""
        order = sorted(self.found, key=lambda one: (one.cost, len(one.trims), one.trims))
        asked = order if self.alternatives is None else order[: self.alternatives + 1]
        return list(in_order(self.setup.word(one) for one in asked))

    def _over(self) -> bool:
        limit = self.problem.search.max_expansions
        work = self.calls + EXPANSIONS_A_WORD * self.polished
        return time.monotonic() > self.deadline or (limit is not None and work >= limit)

    def _bar(self) -> float:
        """What costs more is not asked for."""
        if self.alternatives is None:
            return self.ceiling
        order = sorted(one.cost for one in self.found)
        known = order[self.alternatives] if len(order) > self.alternatives else math.inf
        return min(known, self.ceiling)

    def _keep(self, word: TimedWord | None) -> None:
        if word is None or word.cost > self.ceiling * (1.0 + TIE):
            return
        if not any(word.same_as(other) for other in self.found if other.trims == word.trims):
            self.found.append(word)

    def _closed_form(self, most_letters: int) -> Iterator[TimedWord | None]:
        """Words whose times all follow in closed form, refined where the conditions ask for it."""
        setup, refine = self.setup, self._is_refined()
        for heading in self._headings():
            goal = np.array(setup.goal.pose)
            goal[2] = heading
            found = self._steered(self.problem.start, goal, setup.start_trim, math.inf)
            fitting = self._fitting(found)
            for k in np.argsort(found.costs, kind="stable"):
                if found.costs[k] > self._bar() * (1.0 + SLACK * refine + TIE) or self._over():
                    break
                trims, times = self._word(found, int(k))
                if len(trims) > most_letters or not fitting[k]:
                    continue
                self.polished += 1
                yield setup.solved(trims, [times]) if refine else setup.closed(trims, times)

    def _fitting(self, found: _Candidates) -> NDArray[np.bool_]:
        """Which candidates (n,) may last exactly as long as is asked for, if it is.

        The pose decides all times of so few trims, unless any heading will do, or two neighbours
        commute.
        """
        setup, arrays = self.setup, self.setup.library.arrays
        if not setup.exactly or setup.goal.free_heading:
            return np.ones(len(found.costs), dtype=np.bool_)
        words = arrays.words[found.rows]
        rows = arrays.twists[words]
        brackets = rows[:, :-1, 2:3] * rows[:, 1:, :2] - rows[:, 1:, 2:3] * rows[:, :-1, :2]
        commute = (np.abs(brackets) < SAME).all(axis=2) & (words[:, 1:] >= 0)
        return (self._off(found.durations) <= SAME) | commute.any(axis=1) | (found.climbs >= 0)

    def _off(self, durations: Array) -> Array:
        """Share of the time asked for by which words are longer or shorter."""
        return np.abs(durations / (self.setup.limit or math.inf) - 1.0)

    def _is_refined(self) -> bool:
        """Whether more is asked of a word than to end at the goal."""
        horizon = self.problem.horizon
        return bool(self.setup.goal.free_heading or self.setup.limit or horizon.min_coast)

    def _headings(self) -> Array:
        """Headings at the goal that are tried: seeds where any will do."""
        if not self.setup.goal.free_heading:
            return self.setup.goal.pose[2:3]
        return np.linspace(0.0, 2.0 * np.pi, HEADINGS, endpoint=False)

    def _steered(self, start: Array, goal: Array, trim: int, ceiling: float) -> _Candidates:
        begin, end = _four(start), _four(goal)
        scratch = self.scratch
        n = kernels.candidate_batch(
            self.setup.library.arrays,
            len(self.setup.library.arrays.words),
            begin[None],
            trim,
            end[None],
            self.setup.goal_trim,
            ceiling,
            scratch,
        )
        self.calls += 1
        return _Candidates(
            costs=scratch.costs[:n].copy(),
            durations=scratch.durations[:n].copy(),
            rows=scratch.rows[:n].copy(),
            climbs=scratch.climbs[:n].copy(),
            times=scratch.times[:n].copy(),
        )

    def _word(self, found: _Candidates, k: int) -> tuple[tuple[int, ...], Array]:
        """Trims and times of one candidate."""
        word = self.setup.library.arrays.words[found.rows[k]]
        used = word >= 0
        trims, times = word[used].tolist(), found.times[k, :3][used]
        if found.climbs[k] >= 0:
            trims, times = [*trims, int(found.climbs[k])], np.append(times, found.times[k, 3])
        return tuple(trims), times

    def _scan(self, trims: tuple[int, ...]) -> bool:
        """Words that begin with these trims, refined where the grid is cheapest; False at a limit.

        Families are told apart by their word; a word's solutions on a node by the change of times.
        """
        setup, steps = self.setup, self._steps(trims)
        # Times change by no more than a leap from one node to the next: others never last so long.
        most = max(steps) / LEAP / (setup.limit or math.inf) if setup.exactly else math.inf
        families: dict[tuple[int, ...], list[_Node]] = {}
        for prefix in self._prefixes(trims):
            if self._over():
                return False
            bar = self._bar() * (1.0 + SLACK)
            for goal in self._goals():
                found = self._steered(prefix.pose, goal, trims[-1], bar - prefix.cost)
                costs = prefix.cost + found.costs
                order = self._off(prefix.duration + found.durations) if setup.exactly else costs
                for k in np.flatnonzero(order <= most).tolist():
                    last, times = self._word(found, k)
                    if len(last) < CLOSED_FORM or last[0] == trims[-1]:
                        continue
                    lasting = np.concatenate([prefix.times, times])
                    node = _Node(prefix.nodes, lasting, float(costs[k]), float(order[k]))
                    families.setdefault((*trims, *last), []).append(node)
        lowest = [
            (node.cost, word, node.times)
            for word, nodes in families.items()
            for node in _lowest(nodes, steps)
        ]
        for cost, word, times in sorted(lowest, key=lambda one: one[:2]):
            if cost > self._bar() * (1.0 + SLACK) or self._over():
                break
            self.polished += 1
            self._keep(setup.solved(word, [times]))
        return not self._over()

    def _goals(self) -> Iterator[Array]:
        for heading in self._headings():
            goal = np.array(self.setup.goal.pose)
            goal[2] = heading
            yield goal

    def _steps(self, trims: Sequence[int]) -> list[float]:
        """Distance of grid nodes [s] for each scanned trim."""
        nodes = NODES[min(len(trims), len(NODES) - 1)]
        return [self._reach(trim) / nodes for trim in trims]

    def _reach(self, trim: int) -> float:
        """Longest time of interest [s]: a full turn, or a way beyond the goal."""
        arrays = self.setup.library.arrays
        if math.isfinite(arrays.periods[trim]):
            return float(min(arrays.periods[trim], arrays.longest[trim]))
        way = float(np.linalg.norm(self.setup.goal.pose[:2] - self.problem.start[:2]))
        rows = arrays.twists[self.letters]
        speeds = np.linalg.norm(rows[:, :2], axis=1)
        turning = rows[:, 2] != 0.0
        radius = float((speeds[turning] / np.abs(rows[turning, 2])).min(initial=math.inf))
        far = 1.5 * (way + (2.0 * radius if math.isfinite(radius) else 1.0))
        speed = float(np.linalg.norm(arrays.twists[trim, [0, 1, 3]]))
        return float(min(far / speed, arrays.longest[trim]))

    def _prefixes(self, trims: tuple[int, ...]) -> Iterator[_Prefix]:
        """Grid nodes of the times of the first trims, as far as they may be cheap enough."""
        library, dof = self.setup.library, self.problem.start.size
        arrays, group = library.arrays, group_of(dof)
        steps = self._steps(trims)
        nodes = NODES[min(len(trims), len(NODES) - 1)]
        for node in itertools.product(range(nodes + 1), repeat=len(trims)):
            pose, before = group(self.problem.start), self.setup.start_trim
            cost, duration = 0.0, 0.0
            times = tuple(n * step for n, step in zip(node, steps, strict=True))
            for trim, lasting in zip(trims, times, strict=True):
                pair = library.class_pair(before, trim)
                pose = pose @ group(library.transitions.displacement[pair][:dof])
                pose = pose @ group.exp(lasting * arrays.twists[trim, :dof])
                cost += float(library.transitions.cost[pair] + lasting * arrays.rates[trim])
                duration += float(library.transitions.time[pair]) + lasting
                before = trim
            way = float(np.linalg.norm(self.setup.goal.pose[:2] - pose.pose[:2]))
            if cost + self.per_metre * way < self._bar() * (1.0 + TIE):
                yield _Prefix(trims, node, times, pose.pose, cost, duration)


class _Node(NamedTuple):
    """A word on a node of the grid."""

    node: tuple[int, ...]
    times: Array
    cost: float
    order: float  # by which it is compared: how far off the time asked for, otherwise the cost


def _lowest(nodes: list[_Node], steps: list[float]) -> Iterator[_Node]:
    """Nodes that no neighbour of the same family comes before."""
    by_index: dict[tuple[int, ...], list[_Node]] = {}
    for node in nodes:
        by_index.setdefault(node.node, []).append(node)
    leap = max(steps) / LEAP
    for node in nodes:
        around = (
            (*node.node[:axis], node.node[axis] + side, *node.node[axis + 1 :])
            for axis in range(len(steps))
            for side in (-1, 1)
        )
        beside = itertools.chain.from_iterable(by_index.get(index, ()) for index in around)
        if not any(
            other.order < node.order and np.abs(other.times - node.times).max() < leap
            for other in beside
        ):
            yield node


def _least_price(setup: WordSetup) -> float:
    """Cost per metre of way that no word falls below."""
    arrays = setup.library.arrays
    speeds = np.linalg.norm(arrays.twists[:, :2], axis=1)
    ways = arrays.length
    fast = speeds > 0.0
    prices = arrays.rates[fast] / speeds[fast]
    joined = np.isfinite(arrays.cost) & (ways > NO_WAY)
    links = arrays.cost[joined] / ways[joined]
    return float(np.concatenate([prices, links]).min(initial=math.inf)) if prices.size else 0.0


def _four(pose: Array) -> Array:
    return np.append(pose, np.zeros(4 - pose.size))

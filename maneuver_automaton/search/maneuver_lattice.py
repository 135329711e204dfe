"""Lattice A* over trims and maneuvers: a first plan soon, then cheaper ones while there is time."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.automaton import Plan
from maneuver_automaton.search import _kernels_maneuver_lattice as kernels
from maneuver_automaton.search.distance_grid import DistanceGrid, distance_grid
from maneuver_automaton.search.lattice_memory import widened
from maneuver_automaton.search.maneuver_query import ManeuverQuery
from maneuver_automaton.search.maneuver_reversal import forward_word, reversed_query
from maneuver_automaton.search.maneuver_shortcuts import LEAST, shortened
from maneuver_automaton.search.maneuver_task import Rung, Task, task_of, transfer_steps
from maneuver_automaton.search.result import SearchStatus
from maneuver_automaton.words.library import Scratch
from maneuver_automaton.words.word import MANEUVER, TRIM, Word, with_price, word_of_steps
from maneuver_automaton.words.word import plan_of as plan_of_word

FIRST_CHUNK = 128  # expansions
MOST_CHUNK = 16384
TIMELY = 256  # expansions between two looks at the clock
SMALLEST = 4096  # nodes
LONGER = 1.6  # times a least coasting time, for the longer of two coasts


FIRST: tuple[tuple[int, tuple[Rung, ...]], ...] = (
    # after so many expansions of all passes together, or when all are exhausted
    (0, (Rung(stop=True),)),
    (300, (Rung(scale=0.5, quanta=0.5, stop=True), Rung(quanta=0.7, stop=True))),
    (2000, (Rung(scale=0.25, quanta=0.25, stop=True), Rung(scale=0.5, quanta=0.7, stop=True))),
    (2000, (Rung(stop=True, backwards=True),)),
    (8000, (Rung(scale=0.5, quanta=0.5, weight=1.5, stop=True, backwards=True),)),
    (40000, (Rung(scale=0.25, quanta=0.25, stop=True, margin=0.1),)),
)
LATER: tuple[Rung, ...] = (
    Rung(weight=1.5),
    Rung(weight=1.2),
    Rung(weight=1.0),
    Rung(scale=0.5, quanta=0.5, weight=1.2),
    Rung(scale=0.5, quanta=0.5, weight=1.0),
)
FAST = 1.5  # length scales of the tightest turn from which on there are passes of its size
FAST_WEIGHT = 1.2  # of these: there is little to be decided at a place, so that greed leads astray
IN_SPACE: tuple[Rung, ...] = (
    # one more dimension: coarse cells and little greed find the way, fine ones do not end
    Rung(scale=12.0, quanta=4.0, weight=1.0, most=40000),
    Rung(scale=8.0, quanta=3.0, weight=1.0, most=60000),
    Rung(scale=4.0, quanta=2.0, weight=1.2, most=60000),
    Rung(scale=4.0, quanta=2.0, weight=1.1, most=100000),
    Rung(scale=6.0, quanta=2.0, weight=1.0, most=100000),
)


class ManeuverSearchArrays(NamedTuple):
    """Nodes, their hash table, the heap, and a few numbers."""

    nodes: Array  # (n, 9)
    links: NDArray[np.int32]  # (n, 4)
    table: IntArray  # (4 n, 2) key, generation and node
    heap_key: Array
    heap_node: IntArray
    state: IntArray  # (11,)
    found: Array  # (5,) cost, four durations
    scratch: Scratch


class Heard(NamedTuple):
    """What a search has to say: a better word, or how it ended."""

    word: Word | None
    expansions: int
    status: SearchStatus
    nearest: float = math.inf  # [m] from a goal to the nearest place that was reached


@dataclass(slots=True, eq=False)
class ManeuverPass:
    """A search at one resolution and weight; it can be stopped and resumed."""

    query: ManeuverQuery
    rung: Rung
    task: Task
    grid: DistanceGrid
    arrays: ManeuverSearchArrays
    quanta: Array
    moves: Array
    chunk: int = FIRST_CHUNK
    alive: bool = True

    @property
    def may_go_on(self) -> bool:
        """Whether there is something left to expand, and leave to do so."""
        return self.alive and self.expansions < self.rung.most

    @property
    def expansions(self) -> int:
        """Nodes expanded so far."""
        return int(self.arrays.state[kernels.EXPANSIONS])

    def run(self, n: int, ceiling: float, *, deadline: float = math.inf) -> Word | None:
        """Expand up to `n` more nodes; a word that costs less than `ceiling` if one was found."""
        library = self.query.library.arrays._replace(quanta=self.quanta, moves=self.moves)
        left = self.expansions + n
        while self.alive and self.expansions < left and time.monotonic() < deadline:
            step = min(left - self.expansions, TIMELY)
            used = int(self.arrays.state[kernels.N_NODES])
            self.arrays = with_room(self.arrays, used + library.most_children * (step + 1) + 2)
            self.alive = bool(
                kernels.expand(
                    self.arrays,
                    self.task,
                    library,
                    self.query.layers,
                    self.grid,
                    step,
                    ceiling,
                )
            )
            if self.arrays.found[0] < ceiling * (1.0 - LEAST):
                break
        return self._word() if self.arrays.state[kernels.FOUND] else None

    def _word(self) -> Word:
        """The word that was found, from start to goal."""
        arrays, query = self.arrays, self.query
        state, library = arrays.state, query.library
        node = int(state[kernels.NODE])
        last = int(arrays.links[node, 1])
        steps: list[tuple[int, int, float]] = []
        targets: list[int] = []
        while arrays.links[node, 0] >= 0:
            edge = int(arrays.links[node, 2])
            if edge == kernels.COAST:
                steps.append((TRIM, int(arrays.links[node, 1]), float(arrays.nodes[node, 6])))
            else:
                steps.append((MANEUVER, int(library.edge_maneuver[edge]), 0.0))
                targets.append(int(arrays.links[node, 1]))
            node = int(arrays.links[node, 0])
        goal = int(state[kernels.GOAL])
        tail = [int(trim) for trim in query.transfer.arrays.words[state[kernels.ROW]]]
        times = arrays.found[1:5].tolist()
        tail += [int(state[kernels.CLIMB]), int(query.goal_trims[goal])]
        ahead, beyond = transfer_steps(query.transfer, last, tail, [*times, 0.0])
        word = word_of_steps(
            query.transfer,
            start_trim=query.start_trim,
            steps=steps[::-1] + ahead,
            targets=targets[::-1] + beyond,
            goal=goal,
        )
        return forward_word(word) if self.rung.backwards else word

    @property
    def nearest(self) -> float:
        """Distance [m] from the nearest place that was reached to where the pass leads."""
        places = self.arrays.nodes[: self.arrays.state[kernels.N_NODES], :2]
        aims = self.query.seen_goals[:, :2]
        gaps = np.linalg.norm(places[:, None] - aims[None], axis=-1)
        return float(gaps.min(initial=math.inf))


def maneuver_words(
    query: ManeuverQuery,
    *,
    deadline: float = math.inf,
    max_expansions: int | None = None,
    better_share: float = 1.0,
    known: Word | None = None,
) -> Iterator[Heard]:
    """Words from the start to a goal as they are found, each cheaper than the one before.

    Where cost is time, the first words may last longer than the query admits: what they are
    improved to need not. Passes of greater weight come first; every word is shortened, and later
    passes are pruned by the best. What is found in a number of expansions is the same at every
    call; shortcuts are rounds that are not counted. The last thing heard has no word.

    Parameters
    ----------
    query : ManeuverQuery
    deadline : float
        Of `time.monotonic()` [s].
    max_expansions : int, optional
        Nodes of all passes together.
    better_share : float
        Of the time that is left when the first word is found: so much is for better ones.
    known : Word, optional
        A word that is free, with its cost: better ones are searched at once.
    """
    room = 2**62 if max_expansions is None else max_expansions

    def ended(total: int) -> SearchStatus:
        over = time.monotonic() >= deadline or total >= room
        return SearchStatus.OUT_OF_BUDGET if over else SearchStatus.EXHAUSTED

    grid = _grid(query)
    word, first, nearest = known, 0, 0.0
    if word is None:
        word, first, nearest = _first(query, grid, room=room, deadline=deadline)
    total = first
    if word is not None:
        if known is None:
            yield Heard(word, first, SearchStatus.FOUND)
        if better_share < 1.0:
            now = time.monotonic()
            deadline = now + better_share * (deadline - now)
        for better, more in _better(query, grid, word, room=room - first, deadline=deadline):
            total = first + more
            if better is not None:
                yield Heard(better, total, SearchStatus.FOUND)
    yield Heard(None, total, ended(total), nearest)


def _grid(query: ManeuverQuery) -> DistanceGrid:
    """Distances in the plane to the goals of a query."""
    own = query.around(query.parts[0], query.plane)
    return distance_grid(own, query.window[0], query.seen_goals, query.seen_start)


def quick_word(
    query: ManeuverQuery,
    quick: ManeuverQuery,
    *,
    deadline: float = math.inf,
    max_expansions: int | None = None,
) -> tuple[Word | None, int]:
    """The first word in time for `quick`, the same at the price of time, and expansions.

    Its cost is that at the prices of `query`. Where coasting costs next to nothing, a search by
    cost alone looks everywhere.
    """
    total = 0
    for heard in maneuver_words(quick, deadline=deadline, max_expansions=max_expansions):
        total = heard.expansions
        if heard.word is not None and heard.word.duration <= query.most_time:
            return with_price(query.transfer, heard.word), total
    return None, total


def plan_of(query: ManeuverQuery, word: Word) -> Plan:
    """A word as a plan that ends exactly at its goal, in the frame of the query."""
    return plan_of_word(
        query.automaton,
        word,
        query.start,
        goal=query.goals[word.goal],
        start_time=query.start_time,
    )


def _first(
    query: ManeuverQuery, grid: DistanceGrid, *, room: int, deadline: float
) -> tuple[Word | None, int, float]:
    """Passes of rising resolution in turn until one connects.

    The word, expansions, and the distance [m] from a goal to the nearest place that was reached.
    """
    schedule = _first_schedule(query)
    passes: list[ManeuverPass] = []
    total = 0
    while total < room and time.monotonic() < deadline:
        alive = [one for one in passes if one.alive]
        if schedule and (not alive or total >= schedule[0][0]):
            passes += _passes_of(query, schedule.pop(0)[1], grid)
            alive = [one for one in passes if one.alive]
        if not alive and not schedule:
            break
        for one in alive:
            before = one.expansions
            n = min(one.chunk, room - total)
            word = one.run(n, math.inf, deadline=deadline) if n > 0 else None
            total += one.expansions - before
            one.chunk = min(2 * one.chunk, MOST_CHUNK)
            if word is not None:
                return word, total, 0.0
    ahead = [one.nearest for one in passes if not one.rung.backwards]
    return None, total, min(ahead, default=math.inf)


def _first_schedule(query: ManeuverQuery) -> list[tuple[int, tuple[Rung, ...]]]:
    """Which passes begin after how many expansions of all of them together.

    A vehicle that turns widely for its size gets passes whose cells and coasts are as wide: it
    decides little from one length of its body to the next.
    """
    wide = query.library.turns
    schedule = list(FIRST)
    if wide > FAST:
        fast = Rung(scale=wide, quanta=wide, weight=FAST_WEIGHT, stop=True)
        schedule.insert(1, (FIRST[1][0], (fast,)))
    return schedule


def _passes_of(
    query: ManeuverQuery, rungs: Sequence[Rung], grid: DistanceGrid
) -> list[ManeuverPass]:
    """Passes that are ready to run; those from the goal only where that can be asked."""
    passes = []
    for rung in rungs:
        if not rung.backwards:
            passes.append(pass_of(query, rung, grid))
            continue
        back = reversed_query(query)
        if back is not None:
            passes.append(pass_of(back, rung, _grid(back)))
    return passes


def _better(
    query: ManeuverQuery, grid: DistanceGrid, best: Word, *, room: int, deadline: float
) -> Iterator[tuple[Word | None, int]]:
    """Shortcuts, then passes of falling weight below the cost of the best word, one by one."""
    total = 0
    arrays: ManeuverSearchArrays | None = None
    coarse = IN_SPACE if query.start.size > 3 else ()
    wide = query.library.turns
    fast = tuple(Rung(scale=wide, quanta=wide, weight=w) for w in (FAST_WEIGHT, 1.0))
    later = LATER if wide <= FAST else (*fast, *LATER)
    for rungs, all_words in ((coarse, False), (later, True)):
        for shorter in _shorter(query, best, rungs, all_words=all_words, deadline=deadline):
            best = shorter
            yield best, total
        for rung in rungs:
            one = pass_of(query, rung, grid, arrays=arrays)
            while one.may_go_on and total < room and time.monotonic() < deadline:
                before = one.expansions
                word = one.run(min(one.chunk, room - total), best.cost, deadline=deadline)
                total += one.expansions - before
                one.chunk = min(2 * one.chunk, MOST_CHUNK)
                if word is None or not word.cost < best.cost * (1.0 - LEAST):
                    continue
                best = word
                yield best, total
                for shorter in _shorter(query, best, rungs, all_words=all_words, deadline=deadline):
                    best = shorter
                    yield best, total
            arrays = one.arrays
            yield None, total


def _shorter(
    query: ManeuverQuery,
    best: Word,
    rungs: Sequence[Rung],
    *,
    all_words: bool,
    deadline: float,
) -> Iterator[Word]:
    """Shortcuts of the best word, where passes are to come."""
    if rungs:
        yield from shortened(query, best, all_words=all_words, deadline=deadline)


def pass_of(
    query: ManeuverQuery,
    rung: Rung,
    grid: DistanceGrid,
    *,
    arrays: ManeuverSearchArrays | None = None,
) -> ManeuverPass:
    """A pass that is ready to run."""
    library = query.library.arrays
    quanta = library.quanta * rung.quanta
    if query.least_coast > 0.0:  # no coast that would have to be gone on with
        lasting = np.array([not trim.is_rest for trim in query.automaton.trims])[:, None]
        least = query.least_coast * np.array([1.0, LONGER])
        quanta = np.where(lasting & (quanta > 0.0), np.maximum(quanta, least), quanta)
    steps = quanta[..., None] * library.transfer.twists[: library.transfer.n_trims, None]
    task = task_of(query, rung)
    room = _search_arrays(query) if arrays is None else arrays
    kernels.begin(room, task, query.layers, grid)
    return ManeuverPass(
        query=query,
        rung=rung,
        task=task,
        grid=grid,
        arrays=room,
        quanta=quanta,
        moves=_moves(steps),
    )


def with_room(search: ManeuverSearchArrays, nodes: int) -> ManeuverSearchArrays:
    """The same search in arrays that hold at least so many nodes."""
    return cast(ManeuverSearchArrays, widened(search, nodes))


def _moves(steps: Array) -> Array:
    from maneuver_automaton.groups import SE2

    return np.concatenate([SE2.exp(steps[..., :3]).pose, steps[..., 3:]], axis=-1)


def _search_arrays(query: ManeuverQuery) -> ManeuverSearchArrays:
    n = SMALLEST
    return ManeuverSearchArrays(
        nodes=np.empty((n, 9)),
        links=np.empty((n, 4), dtype=np.int32),
        table=np.zeros((4 * n, 2), dtype=np.int64),
        heap_key=np.empty(n),
        heap_node=np.empty(n, dtype=np.int64),
        state=np.zeros(11, dtype=np.int64),
        found=np.zeros(5),
        scratch=query.transfer.scratch(),
    )

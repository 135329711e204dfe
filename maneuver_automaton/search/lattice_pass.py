"""One search of the lattice: from one end, at one resolution; it can be stopped and resumed."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton._arrays import wrapped
from maneuver_automaton._compile import called_again, plain
from maneuver_automaton._kept import Prepared, kept_with
from maneuver_automaton.automaton import Plan
from maneuver_automaton.budget import UNLIMITED, Budget, Pace
from maneuver_automaton.search import _kernels_lattice as kernels
from maneuver_automaton.search import _kernels_nodes as layout
from maneuver_automaton.search._kernels_place import places_cost
from maneuver_automaton.search.arrays import (
    CostTable,
    DistanceGrid,
    LatticeArrays,
    LatticeSearch,
    SearchArrays,
    Task,
)
from maneuver_automaton.search.cost_to_go import NO_TABLE
from maneuver_automaton.search.lattice_library import LatticeLibrary, coasts_of
from maneuver_automaton.search.lattice_query import LatticeQuery
from maneuver_automaton.search.lattice_task import SAMPLED_HEADINGS, Resolution, task_of
from maneuver_automaton.words.library import NO_TRIM, SWITCH, LibraryArrays, scratch_of
from maneuver_automaton.words.word import Word, plan_of, with_price, word_of_steps

SMALLEST = 2048  # nodes
MOST_SPARE = 4  # searches of one library whose arrays are kept
LARGEST_SPARE = 1 << 15  # nodes of such a search, some 5 MB
GROWN_S = 2.5e-7  # [s] that room for one node takes, what there is moved there
FIRST_CHUNK = 64  # expansions
TIMELY = 256  # expansions between two looks at what was found
AT_FIRST = 200_000  # words steered at the first expansion for which one is a portion of its own
STEERED_S = 2.5e-8  # [s] that steering one word takes
LONGER = 1.6  # times a least coasting time, for the longer of two coasts
NO_EDGE = layout.COASTED
SAME_PLACE = 1e-6  # [m] by which poses at one place differ
LEAST = 1e-5  # share of the cost that a better word has to save


@dataclass(slots=True, eq=False)
class Pass:
    """A search from one end at one resolution; it can be stopped and resumed."""

    query: LatticeQuery
    resolution: Resolution
    search: LatticeSearch
    pace: Pace
    chunk: int = FIRST_CHUNK
    alive: bool = True
    is_late: bool = False  # no time is left to make room for more nodes
    begun_with: int = 0  # expansions that were done before it was asked to run
    expand: Callable[[LatticeSearch, int, float], int] = kernels.expand

    @property
    def arrays(self) -> SearchArrays:
        """What is known so far."""
        return self.search.arrays

    @property
    def expansions(self) -> int:
        """Nodes expanded so far."""
        return int(self.arrays.state[layout.EXPANSIONS])

    @property
    def may_expand(self) -> bool:
        """Whether there is something left to expand, and time to do so."""
        return self.alive and not self.is_late

    @property
    def first_takes(self) -> float:
        """About how long the first expansion takes, which nobody can stop [s]."""
        begun = self.arrays.state[layout.BEGUN]
        return 0.0 if begun else first_takes(self.search.library, self.search.task)

    @property
    def queries(self) -> int:
        """Motions and connections whose collisions were asked for."""
        return int(self.arrays.state[layout.QUERIES])

    @property
    def may_go_on(self) -> bool:
        """Whether there is something left to expand, and leave to do so."""
        return self.may_expand and self.expansions < self.resolution.most

    @property
    def nearest(self) -> tuple[float, float]:
        """Distance [m] and turn [rad] from the nearest pose that was reached to an aim.

        Of poses at one place the one whose heading is nearest; 0 where any heading will do.
        """
        poses = self.arrays.nodes[: int(self.arrays.state[layout.N_NODES]), :3]
        best = (math.inf, math.inf)
        aims = self.search.task.aims
        for aim, free in zip(aims.poses, aims.free, strict=True):
            if len(poses):
                off = np.hypot(*(poses[:, :2] - aim[:2]).T)
                near = off <= off.min() + SAME_PLACE
                turns = np.zeros(1) if free else np.abs(wrapped(poses[near, 2] - aim[2]))
                best = min(best, (float(off.min()), float(turns.min())))
        return best

    def run(self, n: int, upper_bound: float, *, budget: Budget = UNLIMITED) -> Word | None:
        """Expand up to `n` more nodes; a plan, if one was found that costs less than the bound."""
        left, self.begun_with = self.expansions - self.begun_with + n, 0
        self.pace.go_on(budget)
        while self.may_expand and self.expansions < left and not budget.is_over:
            if self.search.task.stop_at_first and self.arrays.state[layout.FOUND]:
                break
            until = min(left, self.expansions + TIMELY)
            while self.alive and (step := self.pace.take(until - self.expansions)):
                used = int(self.arrays.state[layout.N_NODES])
                most = used + self.search.library.most_children * (step + 1) + 2
                room = len(self.arrays.nodes)
                takes = GROWN_S * max(most, 2 * room)  # [s], to copy what there is
                self.is_late = most > room and takes > self.pace.budget.left
                if self.is_late:
                    break
                self.search = self.search._replace(arrays=with_room(self.arrays, most))
                self.alive = bool(self.expand(self.search, step, upper_bound))
                self.expand = called_again(kernels.expand)
                found = self.search.task.stop_at_first and self.arrays.state[layout.FOUND]
                if self.expansions >= until or found:
                    break
            if self.search.task.ends_early and self.arrays.found[0] < upper_bound * (1.0 - LEAST):
                break
        return _word(self) if self.arrays.state[layout.FOUND] else None


def pass_of(
    query: LatticeQuery,
    resolution: Resolution,
    *,
    grid: DistanceGrid,
    sign: float = 1.0,
    table: CostTable = NO_TABLE,
    arrays: SearchArrays | None = None,
) -> Pass:
    """A search that is ready to run, in arrays of an earlier one if there are any."""
    scaled = _with_coasts(query, resolution, sign)
    task = task_of(query, resolution, sign=sign)
    scene = query.scene(query.margin * resolution.margin)
    room = arrays_for(query.prepared, query.library, len(task.roots.poses) + 4, arrays)
    search = LatticeSearch(room, task, scaled, scene, grid, table)
    return Pass(query, resolution, search, Pace(UNLIMITED, steps=first_steps(scaled, task)))


def first_steps(library: LatticeArrays, task: Task) -> int:
    """Expansions before the clock is looked at first."""
    return max(1, min(FIRST_CHUNK, AT_FIRST // _steered(library, task)))


def first_takes(library: LatticeArrays, task: Task) -> float:
    """About how long the first expansion takes [s]."""
    return STEERED_S * _steered(library, task)


def _steered(library: LatticeArrays, task: Task) -> int:
    """Words that are steered at the first expansion."""
    known = library.library
    return max(len(known.tried.words) * (1 + len(known.tried.climbs)) * len(task.aims.poses), 1)


def _with_coasts(query: LatticeQuery, resolution: Resolution, sign: float) -> LatticeArrays:
    """The library with coasts as long as a resolution asks for, along or against time."""
    library = query.library.arrays if sign > 0.0 else query.library.backwards
    if resolution.durations == 1.0 and query.least_coast == 0.0:
        return library
    twists = library.library.twists[: library.library.n_trims]
    durations = library.coasts.durations * resolution.durations
    if query.least_coast > 0.0:  # no coast that would have to be gone on with
        lasting = np.asarray(twists.any(axis=1))[:, None] & (durations > 0.0)
        least = query.least_coast * np.array([1.0, LONGER])
        durations = np.where(lasting, np.maximum(durations, least), durations)
    coasts = coasts_of(twists, sign * durations, library.parts.body, durations)
    return library._replace(coasts=coasts)


def _word(one: Pass) -> Word:
    """The word that a search has found, from start to goal, at the prices of its library."""
    arrays, library, query = one.arrays, one.search.library, one.query
    state, links = arrays.state.tolist(), arrays.links
    numbered = library.library
    words = numbered.tried.free_words if state[layout.FREE] else numbered.tried.words
    row = [*words[state[layout.ROW], :3].tolist(), state[layout.CLIMB]]
    connection = [
        (NO_EDGE, trim, t)
        for trim, t in zip(row, arrays.found[1:5].tolist(), strict=True)
        if 0 <= trim < numbered.n_trims
    ]
    path: list[tuple[int, int, float]] = []
    node = state[layout.NODE]
    link = links[node].tolist()
    while link[layout.PARENT] >= 0:
        coast = float(arrays.nodes[node, layout.COAST])
        path.append((link[layout.EDGE], link[layout.TRIM], coast))
        node = link[layout.PARENT]
        link = links[node].tolist()
    goal = state[layout.GOAL]
    if one.search.task.sign < 0.0:
        roots = np.cumsum(np.where(query.free_heading, SAMPLED_HEADINGS, 1))
        goal = int(np.searchsorted(roots, link[layout.ROOT], side="right"))
        return query.word_of(_with_maneuvers(query, connection + path, NO_TRIM), goal)
    end = int(one.search.task.aims.trims[goal])
    steps = _with_maneuvers(query, path[::-1] + connection, end)
    word = word_of_steps(steps, goal=goal, library=query.library.priced)
    priced = plain(places_cost)(query.around)  # the search has paid for the places of all of it
    return replace(word, cost=float(arrays.found[0])) if priced else word


def _with_maneuvers(
    query: LatticeQuery, steps: Sequence[tuple[int, int, float]], end: int
) -> list[tuple[int, int, float]]:
    """Steps in the automaton's numbers, with the edges of their transitions; `end` -1: any trim."""
    arrays, trims = query.library.arrays, query.library.trims
    at, linked = query.start_trim, len(arrays.edges.cost) > 0
    found = [(SWITCH, int(trims[at]), 0.0)] if at >= 0 else []
    last = [(NO_EDGE, end, 0.0)] if end >= 0 else []
    for n, (edge, trim, t) in enumerate([*steps, *last]):
        for link in [edge] if edge >= 0 else _edges_between(arrays, at, trim) if linked else ():
            source = int(arrays.edges.source[link])
            if source != at:
                found.append((SWITCH, int(trims[source]), 0.0))
            at = int(arrays.edges.target[link])
            found.append((int(arrays.edges.maneuver[link]), int(trims[at]), 0.0))
        if t > 0.0 or (n == len(steps) and trim != at):
            found.append((SWITCH, int(trims[trim]), t))
            at = trim
    return found


def _edges_between(library: LatticeArrays, source: int, target: int) -> list[int]:
    """Edges of the transition between two trims; none within a class, or where there is no trim."""
    if min(source, target) < 0:
        return []
    edges: list[int] = []
    at, goal = (int(library.library.class_of[trim]) for trim in (source, target))
    while at != goal:
        edges.append(int(library.edges.via[at, goal]))
        at = int(library.library.class_of[library.edges.target[edges[-1]]])
    return edges


def with_cost(word: Word, query: LatticeQuery) -> Word:
    """The word with its cost in the lattice library, prices of switches and places included."""
    return query.with_places(with_price(query.library.priced, word))


def plan_of_word(query: LatticeQuery, word: Word) -> Plan:
    """The word from the problem's own start, its times corrected until it ends at the goal.

    Where trims are switched at will, a rest fills a fixed time.
    """
    problem = query.problem
    plan = plan_of(
        query.automaton,
        word,
        problem.start,
        goal=query.goal_poses[word.goal],
        free_heading=bool(query.free_heading[word.goal]),
        start_time=problem.start_time,
    )
    fixed, rest = problem.horizon.time, query.library.rest
    if fixed is None or rest is None:
        return plan
    if not plan.duration < fixed:
        return plan
    return replace(
        plan,
        trims=(*plan.trims, problem.automaton.trims[rest]),
        durations=np.append(plan.durations, fixed - plan.duration),
    )


def search_arrays(library: LibraryArrays) -> SearchArrays:
    """Room for a small search."""
    n = SMALLEST
    return SearchArrays(
        nodes=np.empty((n, 9)),
        links=np.empty((n, 7), dtype=np.int32),
        table=np.zeros((4 * n, 2), dtype=np.int64),
        heap_key=np.empty(n),
        heap_node=np.empty(n, dtype=np.int64),
        state=np.zeros(13, dtype=np.int64),
        found=np.zeros(6),
        scratch=scratch_of(library),
    )


def arrays_for(
    prepared: Prepared, library: LatticeLibrary, nodes: int, known: SearchArrays | None = None
) -> SearchArrays:
    """Arrays in which nothing is searched, with room: `known` ones, or an earlier search's."""
    if known is None:
        try:
            known = kept_with(library, prepared, list[SearchArrays]).pop()
        except IndexError:  # asked for before, another thread might take the last one
            known = search_arrays(library.arrays.library)
    search = with_room(known, nodes)
    generation = search.state[layout.GENERATION] + 1  # frees all rows of the hash table at once
    search.state[:] = 0
    search.state[layout.GENERATION] = generation
    search.found[0] = math.inf
    return search


def give_back(prepared: Prepared, library: LatticeLibrary, arrays: SearchArrays) -> None:
    """Leave the arrays of a search that is over to the next one: fresh memory costs more."""
    spare = kept_with(library, prepared, list[SearchArrays])
    if len(spare) < MOST_SPARE and len(arrays.nodes) <= LARGEST_SPARE:
        spare.append(arrays)


def with_room(search: SearchArrays, nodes: int) -> SearchArrays:
    """A copy of a search in arrays that hold at least so many nodes; itself if it has room."""
    n = len(search.nodes)
    if nodes <= n:
        return search
    while n < nodes:
        n *= 2
    used = int(search.state[layout.N_NODES])
    wide_nodes = np.empty((n, search.nodes.shape[1]))
    wide_links = np.empty((n, search.links.shape[1]), dtype=np.int32)
    wide_nodes[:used], wide_links[:used] = search.nodes[:used], search.links[:used]
    queued = int(search.state[layout.HEAP])
    heap_key, heap_node = np.empty(n), np.empty(n, dtype=np.int64)
    heap_key[:queued], heap_node[:queued] = search.heap_key[:queued], search.heap_node[:queued]
    table = np.zeros((4 * n, 2), dtype=np.int64)
    layout.rehash(search.table, int(search.state[layout.GENERATION]), table)
    return search._replace(
        nodes=wide_nodes, links=wide_links, table=table, heap_key=heap_key, heap_node=heap_node
    )

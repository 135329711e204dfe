"""Exact search of a state lattice: nodes of whole numbers, an admissible bound, all aims at once.

A library whose maneuvers end in the middle of cells, at its own headings, is a graph: its cheapest
plan is a shortest path. A* finds it, and proves it, from the start or from the goals.

Source: Pivtoraiko, Kelly (2005), *Efficient constrained path planning via search in state
lattices*, i-SAIRAS; Likhachev, Ferguson (2009), *Planning long dynamically feasible maneuvers for
autonomous vehicles*, IJRR 28(8), for the search from the goal.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray, wrapped
from maneuver_automaton._compile import called_again
from maneuver_automaton._kept import Prepared
from maneuver_automaton.budget import Budget, Pace
from maneuver_automaton.costs import Cost, terms_of
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Problem
from maneuver_automaton.search import _kernels_nodes as layout
from maneuver_automaton.search import _kernels_state_lattice as kernels
from maneuver_automaton.search.arrays import Aims, GraphArrays, GraphQuery, StateLattice, Tested
from maneuver_automaton.search.lattice_goals import EXACT, at_headings, cells_within, facing
from maneuver_automaton.search.lattice_library import LatticeLibrary, library_of_trims
from maneuver_automaton.search.lattice_pass import GROWN_S
from maneuver_automaton.search.lattice_query import LatticeQuery, lattice_query
from maneuver_automaton.search.lattice_trims import trims_of
from maneuver_automaton.search.scene import for_library
from maneuver_automaton.words.library import SWITCH
from maneuver_automaton.words.word import Word

CLOSE = 1e-9  # [half widths of the body] by which pieces of courses may be off: bounds are as exact
MARGIN = 2e-5  # [m] what is nearer to a solid touches it; as fine as the checks of a plan
MOST_ROOTS = 1 << 16  # nodes at the goals that a search begins from
MOST_STATES = 256  # at a place, which has room for all of them
FIRST_CHUNK = 512  # motions
SMALLEST = 2048  # nodes and places, and eight times as many motions
DIRECTIONS = 16  # in which a displacement is priced
# Of the highest price in a direction: the full one is tight far from the aims, where the
# displacement decides, a lower one where turns do. Of a car's library both leave four of five
# nodes that the full one leaves (98,000 of 127,000, for 23 drawn goals).
SHARES = 1.0 - 1e-9, 0.25
HALVINGS = 14  # of the range in which the highest price is looked for
STEEPEST = 8.0  # times the least price of an edge, up to which it is


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Graph:
    """A problem on a state lattice, ready to be searched."""

    query: LatticeQuery
    lattice: StateLattice  # along time, from the start
    aims: Aims
    coarse: Tested
    fine: Tested
    goal_index: tuple[int, ...]  # (G,) which of the problem's goals the aims are
    surcharge: float  # that each edge has and a plan has once less: the price of a switch

    def widened(self) -> Graph:
        """The same in a window twice as wide."""
        window = self.fine.scene.edge_window.copy()
        half = 0.5 * (window[2:4] - window[:2])
        window[:2] -= half
        window[2:4] += half
        coarse = self.coarse._replace(scene=self.coarse.scene._replace(edge_window=window))
        fine = self.fine._replace(scene=self.fine.scene._replace(edge_window=window))
        return replace(self, coarse=coarse, fine=fine)

    def backwards(self) -> Graph | None:
        """The search from the goals to the start; None if they hold too many nodes to list.

        None for such a search, too.
        """
        ahead, aims = self.lattice, self.aims
        roots = nodes_within(aims, ahead.cell) if ahead.sign > 0 else None
        if roots is None:
            return None
        at, order = ahead.roots[0], ahead.into_edge
        admits = np.zeros((1, len(ahead.heading)), dtype=np.bool_)
        admits[0, at[2]] = True
        into_first, into_edge = _by_state(ahead.source[order], len(ahead.heading))
        lattice = ahead._replace(
            sign=-1,
            first=ahead.into_first,
            target=ahead.source[order],
            step=-ahead.step[order],
            cost=ahead.cost[order],
            edge=ahead.edge[order],
            travel=ahead.travel[order],
            source=ahead.target[order],
            into_first=into_first,
            into_edge=into_edge,
            roots=roots[:, :3].copy(),
        )
        place, within = at[None, :2] * ahead.cell, np.full(1, EXACT)
        start = priced(place, within, admits, lattice, -aims.slope)
        goals = tuple(self.goal_index[g] for g in roots[:, 3])
        return replace(self, lattice=lattice, aims=start, goal_index=goals)


def graph_of(problem: Problem, goals: Sequence[int], prepared: Prepared) -> Graph | None:
    """The state lattice of a problem and the nodes within the tolerance of some of its goals.

    None if it has none whose search is exact: the library is on no lattice, something moves, the
    time counts beside the cost, or nothing is known of what the cost of a switch depends on.
    """
    model, horizon = problem.automaton.lattice, problem.horizon
    timed = horizon.time is not None or horizon.max_time is not None or horizon.stay
    if model is None or problem.moves or timed:
        return None
    cost = terms_of(problem.cost)
    if cost is None or problem.automaton.body_velocities.any():
        return None
    named = [goal for k in goals for goal in at_headings(problem, problem.goals[k])]
    if not named:
        return None
    there = problem.starting_at(problem.start, time=problem.start_time, goals=named)
    query = lattice_query(there, range(len(named)), prepared=prepared)
    fine = prepared.once(_followed, query.library, cost)
    states = prepared.once(_states, query.library, fine, problem.setting)
    if states is None:
        return None
    lattice, surcharge, slope = states
    begun = query.start_trim * (len(lattice.heading) // len(query.library.trims))
    turn = float(query.start[2] - lattice.heading[begun])
    world = SE2(problem.start) @ SE2(np.array([0.0, 0.0, turn - float(query.start[2])]))
    aims = _aims(problem, goals, world, lattice, slope)
    x, y = query.start[:2].tolist()
    frame = x, y, turn, math.cos(turn), math.sin(turn)
    lattice = lattice._replace(frame=frame, roots=np.array([[0, 0, begun]]))
    scene = for_library(query.scene(min(MARGIN, query.margin)), problem, fine)
    return Graph(
        query=query,
        lattice=lattice,
        aims=aims,
        coarse=Tested(query.library.arrays, query.around),
        fine=Tested(fine.arrays, scene),
        goal_index=tuple(goals),
        surcharge=surcharge,
    )


def _followed(library: LatticeLibrary, cost: Cost) -> LatticeLibrary:
    """The library with courses that are followed exactly, piece by piece."""
    trims = trims_of(library.priced, cost)
    return library_of_trims(trims, library.parts, waits=False, close=CLOSE)


def _states(
    library: LatticeLibrary, fine: LatticeLibrary, problem: Problem
) -> tuple[StateLattice, float, Array] | None:
    """Graph (three states a heading where directions are priced), switch price, and slopes."""
    arrays, automaton, cost = library.arrays, library.priced.automaton, terms_of(problem.cost)
    model = automaton.lattice
    assert model is not None
    assert cost is not None
    heading = np.array([model.heading(automaton.trims[k].reduced_state) for k in library.trims])
    source, target = arrays.edges.source, arrays.edges.target
    ends = (SE2(facing(heading[source])) @ SE2(arrays.edges.displacement[:, :3])).pose
    step = np.round(ends[:, :2] / model.resolution)
    off = np.abs(ends[:, :2] - step * model.resolution).max(initial=0.0)
    turned = np.abs(wrapped(ends[:, 2] - heading[target])).max(initial=0.0)
    directed = 3 if cost.direction_change > 0.0 else 1
    exact = max(off, turned) <= EXACT and directed * len(heading) <= MOST_STATES
    if not exact or not np.array_equal(fine.arrays.edges.maneuver, arrays.edges.maneuver):
        return None
    rows = []  # state, target, edge, cost
    for e, k in enumerate(arrays.edges.maneuver.tolist()):
        signs = np.sign(problem.velocities_along(automaton.maneuvers[k])[:, 0])
        signs = signs[signs != 0.0].astype(int)
        for gear in range(directed):
            before, after = (0, 1, -1)[gear], gear
            if len(signs) and directed > 1:
                after = {1: 1, -1: 2}[int(signs[-1])]
            turns = bool(len(signs) and before and before != signs[0])
            paid = float(arrays.edges.cost[e]) + cost.direction_change * turns
            ends_in = int(target[e]) * directed + after
            rows.append((int(source[e]) * directed + gear, ends_in, e, paid))
    rows.sort(key=lambda row: row[:1])
    begins, targets, edges = np.array([row[:3] for row in rows], dtype=np.int64).reshape(-1, 3).T
    first, _ = _by_state(begins, directed * len(heading))
    into_first, into_edge = _by_state(targets, directed * len(heading))
    along = fine.arrays.pieces
    lengths = along.speed * along.time + 2.0 * along.error
    pose_pieces = along.first[fine.arrays.parts.n * len(fine.arrays.edges.cost) : -1]
    lattice = StateLattice(
        cell=float(model.resolution),
        frame=(0.0, 0.0, 0.0, 1.0, 0.0),
        sign=1,
        heading=np.repeat(heading, directed),
        first=first,
        target=np.ascontiguousarray(targets),
        step=step[edges].astype(np.int64),
        cost=np.array([row[3] for row in rows], dtype=np.float64),
        edge=np.ascontiguousarray(edges),
        travel=np.add.reduceat(np.append(lengths, 0.0), pose_pieces)[edges],
        source=np.ascontiguousarray(begins),
        into_first=into_first,
        into_edge=into_edge,
        most_links=int(max(np.diff(first).max(), np.diff(into_first).max())),
        roots=np.zeros((0, 3), dtype=np.int64),
    )
    return lattice, float(cost.switch), slopes(lattice)


def _by_state(state: IntArray, n: int) -> tuple[IntArray, IntArray]:
    """Where the edges of each state begin (n + 1,) in a list (E,) of all, which is the second."""
    counts = np.bincount(state, minlength=n)
    return np.concatenate([[0], np.cumsum(counts)]), np.argsort(state, kind="stable")


def _aims(
    problem: Problem, goals: Sequence[int], world: SE2, lattice: StateLattice, slope: Array
) -> Aims:
    """The nodes of a lattice, whose frame is seen from the world, within the goals' tolerances."""
    model, automaton = problem.automaton.lattice, problem.automaton
    assert model is not None
    place, within, admits = [], [], []
    for k in goals:
        goal = problem.goals[k]
        place.append((world.inverse() @ SE2(goal.pose)).pose[:2])
        within.append(goal.tolerance_m + EXACT * (1.0 + float(np.abs(goal.pose[:2]).max())))
        names = {one.trim for one in at_headings(problem, goal)}
        headings = [
            model.heading(trim.reduced_state) for trim in automaton.trims if trim.name in names
        ]
        off = np.abs(wrapped(np.subtract.outer(lattice.heading, headings)))
        admits.append((off <= EXACT).any(axis=1))
    return priced(np.array(place), np.array(within), np.array(admits), lattice, slope)


def slopes(lattice: StateLattice) -> Array:
    """Prices of a displacement (2, K) [1/m] by which no cycle of edges costs less than nothing.

    A plan is a path of states and its displacement. Who prices the latter may leave it out: what
    the edges cost beyond the price has a least sum between two states, which bounds the cost to go
    with it. That holds for every price that is low enough, here the highest in each direction.
    """
    angle = np.arange(DIRECTIONS) * (2.0 * math.pi / DIRECTIONS)
    ahead = np.array([np.cos(angle), np.sin(angle)])
    moved = lattice.cell * np.hypot(*lattice.step.T)
    moves = moved > 0.0
    least = float((lattice.cost[moves] / moved[moves]).min()) if moves.any() else 0.0
    low, high = np.full(DIRECTIONS, least), np.full(DIRECTIONS, STEEPEST * least)
    for _ in range(HALVINGS):
        middle, steady = 0.5 * (low + high), np.empty(DIRECTIONS, dtype=np.int64)
        offset = np.zeros((len(lattice.heading), DIRECTIONS))
        kernels.lower_offsets(lattice, middle * ahead, offset, steady)
        low, high = np.where(steady, middle, low), np.where(steady, high, middle)
    return np.concatenate([share * low * ahead for share in SHARES], axis=1)


def priced(
    place: Array, within: Array, admits: NDArray[np.bool_], lattice: StateLattice, slope: Array
) -> Aims:
    """Aims with what bounds the cost on the way there."""
    steady = np.empty(slope.shape[1], dtype=np.int64)
    offset = np.repeat(np.where(admits, 0.0, np.inf)[..., None], slope.shape[1], axis=2)
    for one in offset:
        kernels.lower_offsets(lattice, slope, one, steady)
    return Aims(
        place, within, admits, slope, offset - np.multiply.outer(within, np.hypot(*slope))[:, None]
    )


def nodes_within(aims: Aims, cell: float) -> IntArray | None:
    """Nodes (R, 4) that aims hold, and the number of the aim; None if there are too many."""
    found = []
    for g, (place, within) in enumerate(zip(aims.place, aims.within.tolist(), strict=True)):
        states = np.flatnonzero(aims.admits[g])
        if (2.0 * within / cell + 1.0) ** 2 * len(states) > MOST_ROOTS:
            return None
        near = cells_within(place, within, cell)
        aim = np.full(len(near) * len(states), g)
        rows_of = np.repeat(near, len(states), axis=0)
        found.append(np.column_stack([rows_of, np.tile(states, len(near)), aim]))
    return np.concatenate(found)


@dataclass(slots=True, eq=False)
class GraphSearch:
    """A* on a state lattice, which can be stopped and resumed."""

    graph: Graph
    weight: float
    arrays: GraphArrays
    pace: Pace
    alive: bool = True
    is_late: bool = False  # no time is left to make room for more nodes
    expand: Callable[[GraphQuery, int, float], int] = kernels.expand_lattice

    @classmethod
    def of(cls, graph: Graph, *, weight: float, budget: Budget) -> GraphSearch:
        """A search that is ready to run."""
        n, most = SMALLEST, graph.lattice.most_links
        while n < len(graph.lattice.roots) + most:
            n *= 2
        states = len(graph.lattice.heading)
        arrays = GraphArrays(
            table=np.zeros((4 * n, 2), dtype=np.int64),
            node=np.empty((n, states), dtype=np.int32),
            least=np.empty((n, states)),
            cost=np.empty(n),
            clearance=np.empty(n),
            links=np.empty((n, 5), dtype=np.int32),
            heap_key=np.empty(8 * n),
            heap_item=np.empty(8 * n, dtype=np.int64),
            state=np.zeros(7, dtype=np.int64),
            found=np.full(1, np.inf),
            places=np.empty(most, dtype=np.int64),
            costs=np.empty(most),
        )
        return cls(graph, weight, arrays, Pace(budget, FIRST_CHUNK))

    @property
    def expansions(self) -> int:
        """Nodes expanded so far."""
        return int(self.arrays.state[kernels.N_NODES])

    @property
    def queries(self) -> int:
        """Motions that were tested."""
        return int(self.arrays.state[kernels.QUERIES])

    @property
    def cost(self) -> float:
        """Cost of the path that was found; inf if none is."""
        if not self.arrays.state[kernels.FOUND]:
            return math.inf
        cost = float(self.arrays.cost[self.expansions - 1])
        return cost - self.graph.surcharge if cost > 0.0 else cost

    @property
    def cut(self) -> float:
        """No plan that leaves the window costs less; inf if the window's rim is a wall."""
        bounds = self.graph.query.problem.bounds
        if bounds.x is not None or bounds.y is not None:
            return math.inf
        return float(self.arrays.found[0]) - self.graph.surcharge

    @property
    def least_open(self) -> float:
        """No plan costs less, of a search with the weight 1 that has not come to its end."""
        begun = self.arrays.state[kernels.BEGUN] and self.arrays.state[kernels.HEAP]
        return max(float(self.arrays.heap_key[0]) - self.graph.surcharge, 0.0) if begun else 0.0

    @property
    def nodes(self) -> Array:
        """Poses (n, 4) of the nodes that were expanded, seen from the world's frame, and costs."""
        lattice, n = self.graph.lattice, self.expansions
        column, row, state = self.arrays.links[:n, :3].T
        flat = np.column_stack([column * lattice.cell, row * lattice.cell, lattice.heading[state]])
        poses = (SE2(np.array(lattice.frame[:3])) @ SE2(flat)).pose
        return np.column_stack([poses, self.arrays.cost[:n]])

    def run(self, n: int, upper_bound: float) -> None:
        """Expand up to `n` more nodes, as long as they lead to less than a cost."""
        last = self.expansions + n
        graph = self.graph
        self.pace.go_on(self.pace.budget)
        while self.alive and self.expansions < last:
            step = self.pace.take(last - self.expansions)
            if not step or not self._makes_room():
                return
            tested = graph.coarse, graph.fine
            query = GraphQuery(self.arrays, graph.lattice, graph.aims, *tested, self.weight)
            self.alive = bool(self.expand(query, step, upper_bound + graph.surcharge))
            self.expand = called_again(kernels.expand_lattice)

    def _makes_room(self) -> bool:
        """Widen the arrays that are full; whether there is time to do so."""
        one, most = self.arrays, self.graph.lattice.most_links
        nodes, places, queued = one.state[: kernels.HEAP + 1].tolist()
        n, p, m = len(one.cost), len(one.node), len(one.heap_key)
        self.is_late = n == nodes and GROWN_S * n > self.pace.budget.left
        if self.is_late:
            return False
        full = [*one._fields[3:6]] if n == nodes else []
        full += one._fields[6:8] if m < queued + most else []
        if p < places + most:
            full += one._fields[1:3]
            table = np.zeros((8 * p, 2), dtype=np.int64)
            layout.rehash(one.table, kernels.SEARCH, table)
            self.arrays = self.arrays._replace(table=table)
        for name in full:
            array = getattr(one, name)
            room = np.empty((2 * len(array), *array.shape[1:]), dtype=array.dtype)
            room[: len(array)] = array
            self.arrays = self.arrays._replace(**{name: room})
        return True

    def word(self) -> tuple[Word, int]:
        """The path that was found, as a word, and the number of the goal where it ends."""
        graph, links = self.graph, self.arrays.links
        library, forwards = graph.query.library, graph.lattice.sign > 0
        edges: list[int] = []
        node = self.expansions - 1
        while links[node, kernels.PARENT] >= 0:
            edges.append(int(graph.lattice.edge[links[node, kernels.EDGE]]))
            node = int(links[node, kernels.PARENT])
        aim = int(self.arrays.state[kernels.AIM]) if forwards else int(links[node, kernels.EDGE])
        at = graph.query.start_trim
        steps = [(SWITCH, int(library.trims[at]), 0.0)]
        for edge in edges[::-1] if forwards else edges:
            trim = int(library.trims[library.arrays.edges.target[edge]])
            steps.append((int(library.arrays.edges.maneuver[edge]), trim, 0.0))
        return graph.query.word_of(steps, 0), graph.goal_index[aim]

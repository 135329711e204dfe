"""One pass of the lattice: from one end, at one resolution; it can be stopped and resumed."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array
from maneuver_automaton.search import _kernels_lattice as kernels
from maneuver_automaton.search.cost_to_go import NO_TABLE, CostTable
from maneuver_automaton.search.distance_grid import DistanceGrid
from maneuver_automaton.search.lattice_library import LatticeArrays, moves_of
from maneuver_automaton.search.lattice_memory import SearchArrays, search_arrays, with_room
from maneuver_automaton.search.lattice_query import LatticeQuery
from maneuver_automaton.words.word import Word

CELL = 0.122  # of the first pass, in turning radii
HEADINGS = 72
WEIGHT = 2.0
FIRST_CHUNK = 64  # expansions
TIMELY = 256  # expansions between two looks at the clock
TRIES = 6  # candidates of one steering that are tried
PATIENCE = 1.5  # a connection may cost so much more than the estimate ...
SLACK = 2.0  # ... and so many turning radii
MOST_JOINTS = 4  # of a connection of three trims, those with what is before and after it included
BACK_OFF = 0.01  # [half widths of the body] kept before contact
SHORTEST_CONTACT = 0.03  # [half widths] of an edge that ends there
SAMPLED_HEADINGS = 16  # roots at a goal whose heading is free


@dataclass(frozen=True, slots=True, kw_only=True)
class Rung:
    """One resolution of the lattice."""

    scale: float = 1.0  # of the cells
    quanta: float = 1.0  # of the lengths of edges
    weight: float = WEIGHT
    contact: bool = False  # keep what was driven before a contact
    fine: float = 0.4  # cells of such edges, in cells of this rung
    margin: float = 1.0  # of the proven clearance
    guided: bool = False  # by the table of the cost to go
    stop: bool = True  # at the first connection
    layered: bool = False  # whether cells know the gear and the trim that prices ask for


class Task(NamedTuple):
    """One search from one end, as the kernels see it."""

    sign: float  # 1: from the start, -1: from the goals backwards
    roots: Array  # (R, 3)
    aims: Array  # (A, 3)
    aim_free: NDArray[np.bool_]  # (A,)
    frame_x: float
    frame_y: float
    frame_heading: float
    frame_cos: float
    frame_sin: float
    cell: float
    headings: int
    fine_cell: float
    fine_headings: int
    tick: float
    weight: float
    per_metre: float
    per_shot: float
    patience: float
    slack: float
    tries: int
    stop_at_first: bool
    contact: bool
    back_off: float
    shortest_contact: float
    keep: float
    margin: float
    clock: float
    most_time: float
    stay_until: float
    most_trims: int
    by_gear: bool
    by_trim: bool
    by_count: bool
    window: Array


@dataclass(slots=True, eq=False)
class Pass:
    """A search from one end at one resolution; it can be stopped and resumed."""

    query: LatticeQuery
    rung: Rung
    task: Task
    grid: DistanceGrid
    table: CostTable
    arrays: SearchArrays
    library: LatticeArrays
    chunk: int = FIRST_CHUNK
    alive: bool = True

    @property
    def expansions(self) -> int:
        """Nodes expanded so far."""
        return int(self.arrays.state[kernels.EXPANSIONS])

    @property
    def queries(self) -> int:
        """Motions and connections whose collisions were asked for."""
        return int(self.arrays.state[kernels.QUERIES])

    def run(self, n: int, ceiling: float, *, deadline: float = math.inf) -> Word | None:
        """Expand up to `n` more nodes; a plan, if one was found that costs less than `ceiling`."""
        query = self.query
        left = self.expansions + n
        while self.alive and self.expansions < left and time.monotonic() < deadline:
            state = self.arrays.state
            per_node = len(query.library.trims) * 2
            step = min(left - self.expansions, TIMELY)
            self.arrays = with_room(
                self.arrays, int(state[kernels.N_NODES]) + per_node * (step + 1) + 2
            )
            going = kernels.expand(
                self.arrays,
                self.task,
                self.library,
                query.world.arrays,
                query.world.body,
                self.grid,
                self.table,
                step,
                ceiling,
            )
            self.alive = bool(going)
            if self.arrays.state[kernels.FOUND] and self.task.stop_at_first:
                break
        if not self.arrays.state[kernels.FOUND]:
            return None
        return _word(self)


def both_ends(
    query: LatticeQuery,
    rung: Rung,
    *,
    grids: tuple[DistanceGrid, DistanceGrid],
    table: CostTable = NO_TABLE,
    arrays: SearchArrays | None = None,
    ends: tuple[float, ...] = (1.0, -1.0),
) -> list[Pass]:
    """Passes from the start and, where nothing moves, from the goals."""
    return [
        _pass(query, rung, sign, grids[0 if sign > 0 else 1], table, arrays)
        for sign in ends
        if sign > 0.0 or not query.problem.moves
    ]


def _pass(
    query: LatticeQuery,
    rung: Rung,
    sign: float,
    grid: DistanceGrid,
    table: CostTable,
    arrays: SearchArrays | None,
) -> Pass:
    library = query.library.arrays
    quanta = np.maximum(library.quanta * rung.quanta, library.library.min_coast)
    quanta = np.where(library.quanta > 0.0, quanta, 0.0)
    moves = moves_of(library.library.twists[: library.library.n_trims, :3], sign * quanta)
    scaled = library._replace(quanta=quanta, moves=moves)
    task = task_of(query, rung, sign)
    room = search_arrays(library.library) if arrays is None else arrays
    room = with_room(room, len(task.roots) + 4)
    kernels.begin(room, task, scaled, query.world.arrays, grid, table)
    return Pass(query, rung, task, grid, table, room, scaled)


def task_of(query: LatticeQuery, rung: Rung, sign: float) -> Task:
    """Limits and sizes of a pass, as the kernels see them."""
    library, problem = query.library, query.problem
    settings = problem.search
    radius, body = library.radius, query.world.body
    goals = query.goals
    frame = goals[0]
    cell = rung.scale * (settings.cell or CELL * radius)
    size = body.half_width or radius * 0.1
    cost = library.arrays.library
    price = library.per_metre
    sharp = 0.25 * radius * price
    return Task(
        sign=sign,
        roots=query.start[None].copy() if sign > 0.0 else _goal_roots(query),
        aims=goals.copy() if sign > 0.0 else query.start[None].copy(),
        aim_free=query.free_heading.copy() if sign > 0.0 else np.zeros(1, dtype=np.bool_),
        frame_x=float(frame[0]),
        frame_y=float(frame[1]),
        frame_heading=float(frame[2]),
        frame_cos=math.cos(float(frame[2])),
        frame_sin=math.sin(float(frame[2])),
        cell=float(cell),
        headings=int(settings.headings or HEADINGS),
        fine_cell=float(rung.fine * cell),
        fine_headings=250,
        tick=_tick(query, rung),
        weight=float(rung.weight),
        per_metre=float(price),
        per_shot=float(sharp) if sharp > 0.0 else 1.0,
        patience=PATIENCE,
        slack=_slack(query),
        tries=TRIES,
        stop_at_first=bool(rung.stop),
        contact=rung.contact,
        back_off=float(max(BACK_OFF * size, 2.0 * query.margin)),
        shortest_contact=float(SHORTEST_CONTACT * size),
        keep=float(query.keep),
        margin=float(query.margin * rung.margin),
        clock=float(problem.start_time),
        most_time=float(query.most_time),
        stay_until=query.stay_until,
        most_trims=query.most_trims,
        by_gear=bool(rung.layered and cost.direction_change > 0.0),
        by_trim=bool(cost.min_coast > 0.0 or (rung.layered and cost.switch > 0.0)),
        by_count=problem.horizon.max_trims is not None,
        window=query.window,
    )


def _slack(query: LatticeQuery) -> float:
    """What a connection may cost beyond a multiple of the estimate, which knows no prices.

    Two turning radii and a full turn, and the switches and changes of direction of three trims and
    of the joints at both their ends.
    """
    library, arrays = query.library, query.library.arrays.library
    way = SLACK * library.radius * library.per_metre + library.per_turn
    prices = MOST_JOINTS * (arrays.switch + arrays.direction_change)
    return float(way + prices) if way > 0.0 else math.inf


def _tick(query: LatticeQuery, rung: Rung) -> float:
    """Length in time of a cell [s]; 0 where the time does not matter."""
    if not (query.problem.moves or math.isfinite(query.most_time)):
        return 0.0
    quanta = query.library.arrays.quanta
    return float(rung.quanta * quanta[quanta > 0.0].min()) if (quanta > 0.0).any() else 0.0


def _goal_roots(query: LatticeQuery) -> Array:
    """Poses at the goals; a few headings where any will do."""
    rows = []
    for goal, free in zip(query.goals, query.free_heading, strict=True):
        turns = np.arange(SAMPLED_HEADINGS if free else 1) * (2.0 * np.pi / SAMPLED_HEADINGS)
        rows += [goal + np.array([0.0, 0.0, turn]) for turn in turns]
    return np.array(rows)


def _word(one: Pass) -> Word:
    """The plan that a pass has found, from start to goal."""
    arrays, library = one.arrays, one.query.library.arrays.library
    state = arrays.state
    words = library.free_words if state[kernels.FREE] else library.words
    middle = [
        (int(trim), float(t))
        for trim, t in zip(words[state[kernels.ROW]], arrays.found[1:4], strict=True)
        if t > 0.0 and trim < library.n_trims
    ]
    edges: list[tuple[int, float]] = []
    node = int(state[kernels.NODE])
    while arrays.links[node, 0] >= 0:
        edges.append((int(arrays.links[node, 1]), float(arrays.nodes[node, 5])))
        node = int(arrays.links[node, 0])
    root = int(arrays.links[node, 4])
    if one.task.sign > 0.0:
        parts, goal = edges[::-1] + middle, int(state[kernels.GOAL])
    else:
        parts, goal = middle + edges, _goal_of_root(one.query, root)
    return joined(parts, one.query, goal=goal)


def _goal_of_root(query: LatticeQuery, root: int) -> int:
    counts = np.where(query.free_heading, SAMPLED_HEADINGS, 1)
    return int(np.searchsorted(np.cumsum(counts), root, side="right"))


def joined(parts: list[tuple[int, float]], query: LatticeQuery, *, goal: int) -> Word:
    """A word of trims, as the lattice numbers them, and times, without neighbours that repeat."""
    trims: list[int] = []
    durations: list[float] = []
    for trim, t in parts:
        if trims and trims[-1] == trim:
            durations[-1] += t
        else:
            trims.append(trim)
            durations.append(t)
    return Word(
        trims=query.library.trims[trims] if trims else np.zeros(0, dtype=np.int64),
        durations=np.array(durations, dtype=np.float64),
        goal=goal,
    )


def with_cost(word: Word, query: LatticeQuery) -> Word:
    """The word with what it costs in the lattice library, prices of switches included."""
    library, numbers = query.library.arrays.library, query.library.number_of[word.trims]
    cost = float(library.rates[numbers] @ word.durations)
    cost += library.switch * max(0, len(numbers) - 1)
    gears = library.gears[numbers]
    gears = gears[gears != 0]
    cost += library.direction_change * int(np.count_nonzero(gears[1:] != gears[:-1]))
    return replace(word, cost=cost)

"""What kernels of the searches take: grids and graphs, open lists, and what is asked."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.search.lattice_arrays import LatticeArrays
from maneuver_automaton.search.scene import Scene
from maneuver_automaton.words.library import Scratch


class DistanceGrid(NamedTuple):
    """The grid as the kernels see it; its cells coincide with those of the world's field."""

    value: IntArray  # (cells,) [units] length of the path that ranks first, where one is known
    rank: IntArray  # (cells,) [units] that length with a detour for every cell a wall may cut
    mark: NDArray[np.uint8]  # (cells,) 0 nothing is known, 1 blocked, 2 settled, 3 reached
    keys: Array  # (8 cells + 8,) of the part of the open list that is far away, a binary heap
    items: IntArray  # its cells; from the other end on those of the rest of the open list
    links: IntArray  # the places before them in their bucket, plus 1; 0: none
    heads: IntArray  # (BUCKETS,) the last place of each bucket, plus 1
    state: IntArray  # (6,) as numbered by the kernels
    origin_x: float
    origin_y: float
    cell: float
    columns: int
    rows: int
    stride: int  # field cells a cell
    shift_x: int  # field cell of cell (0, 0)
    shift_y: int
    inflation: float  # [m] clearance of a cell's centre below which the pose cannot be in it
    wanted: float  # [m] clearance of a cell's centre below which the vehicle cannot be there
    cut: float  # [m] clearance of a cell's centre below which a wall may cut the cell; -inf: none
    detour: int  # [units] how much longer a path is preferred to one through such a cell
    aim_i: int  # cell towards which it grows first
    aim_j: int


class SearchArrays(NamedTuple):
    """Nodes, their hash table, the heap, and a few numbers, as in `_kernels_nodes`."""

    nodes: Array  # (n, 9)
    links: NDArray[np.int32]  # (n, 7)
    table: IntArray  # (4 n, 2) key, generation and node
    heap_key: Array
    heap_node: IntArray
    state: IntArray  # (13,)
    found: Array  # (5,) cost, three durations and that of a climb
    scratch: Scratch


class Task(NamedTuple):
    """One search from one end, as the kernels see it."""

    sign: float  # 1: along time, -1: against it
    roots: Array  # (R, 4)
    root_trims: IntArray  # (R,) -1 where any will do
    aims: Array  # (A, 4)
    aim_trims: IntArray  # (A,)
    aim_free: NDArray[np.bool_]  # (A,) whether any heading will do
    lag: Array  # (m + 1,) least surplus of maneuvers from a trim to an aim's; the last of no trim
    frame_x: float
    frame_y: float
    frame_heading: float
    frame_cos: float
    frame_sin: float
    cell: float  # [m]
    headings: int
    fine_cell: float  # of truncated edges
    fine_headings: int
    rise: float  # [m] of altitude that makes another cell
    tick: float  # [s] of the clock that makes another cell, 0 where it makes none
    radix: tuple[int, int, int, int]  # cells along a side, headings, levels, ticks
    weight: float  # of the estimate in the open list
    per_metre: float  # least cost per metre
    per_climb: float  # least cost per metre of altitude
    per_interval: float  # cost to go for each expansion between two analytic expansions
    least_interval: float  # expansions between two of them, at least ...
    most_interval: float  # ... and at most
    connection_factor: float  # a connection may cost so many times the estimate ...
    connection_slack: float  # ... and so much more
    tries: int  # candidates of one connection that are proven, at most
    stop_at_first: bool  # connection
    ends_early: bool  # when the most promising node is not below the upper bound
    truncated: bool  # whether the part of an edge before a contact is kept
    back_off: float  # [m]
    shortest_truncated: float  # [m]
    clock: float  # [s] time of the world at the start
    most_time: float  # [s]
    stay_until: float  # [s] time of the world until which the goal is kept
    most_trims: int  # 0: no limit
    least_coast: float  # [s]
    checks_words: bool  # whether connections have limits of single words to keep
    by_gear: bool  # whether cells know the gear, ...
    by_trim: bool  # the trim, ...
    by_count: bool  # and the number of trims


class Desk(NamedTuple):
    """Where a query lays down its poses, and where its call leaves what it has found out."""

    poses: Array  # (1 + n, 3) start and goals as the problem sees them
    seen: Array  # (1 + n, 4) as the search does
    clear: Array  # (1 + n,) [m] clearance there
    margin: Array  # (1,) [m] proven clearance
    window_box: Array  # (4,) of the window in the world's frame
    asked: IntArray  # (1,) how many expansions
    frame: tuple[float, float, float, float, float]  # the world's: x, y, heading, cosine, sine of -
    box: tuple[float, float, float, float]  # of what stands
    pad: float  # [m] around it and the ends
    bounded: bool  # whether the window is that of the bounds
    low_x: float  # bounds of the pose [m]
    low_y: float
    high_x: float
    high_y: float
    clearly: float  # [m]
    usual: float  # [m] proven clearance, if the ends allow it
    least: float  # [m]
    back_off: float  # [m] as in the task, as far as the margin does not ask for more
    others: int  # numbers that layers, headings and so on of cells need


class PathArrays(NamedTuple):
    """Pieces of a path and the states along it, as the kernel sees them."""

    trims: IntArray  # (n,)
    durations: Array  # (n,)
    poses: Array  # (n + 1, 4)
    links: IntArray  # (s, 2) joint and parent of each state
    times: Array  # (s, 3) arrival, until when it may stand there, departure from the parent [s]
    before: IntArray  # (s,) the state of the same joint that was found before, -1 for none
    latest: IntArray  # (n + 1,) the state of each joint that was found last, -1 for none
    keys: Array  # (s,) of the open list
    items: IntArray  # (s,)


class FreeCosts(NamedTuple):
    """Least costs to the aims of a query without obstacles, as far as they are known."""

    value: Array  # (columns, rows, S)
    column: int  # of the first entry
    row: int
    most: float  # costs above it are not known, and no less


class StateLattice(NamedTuple):
    """The graph of a library with S states and E edges, along time or against it."""

    cell: float  # [m]
    frame: tuple[float, float, float, float, float]  # x, y, heading, cos, sin in the world's frame
    sign: int  # 1: along time, -1: against it
    heading: Array  # (S,) [rad] in the frame of the lattice
    first: IntArray  # (S + 1,) where the edges out of each state begin
    target: IntArray  # (E,)
    step: IntArray  # (E, 2) columns and rows
    cost: Array  # (E,)
    edge: IntArray  # (E,) in the arrays of the library
    travel: Array  # (E,) [m] length of the path of the pose, or more
    source: IntArray  # (E,)
    into_first: IntArray  # (S + 1,) where the edges that lead to each state begin ...
    into_edge: IntArray  # (E,) ... in this list of them
    most_links: int  # edges of a state that lead away, or those that lead to it
    roots: IntArray  # (R, 3) column, row, state


class GraphArrays(NamedTuple):
    """Arrays of a search, as in `_kernels_state_lattice`."""

    table: IntArray  # (4 p, 2)
    node: NDArray[np.int32]  # (p, S)
    least: Array  # (p, S)
    cost: Array  # (n,)
    clearance: Array  # (n,)
    links: NDArray[np.int32]  # (n, 5)
    heap_key: Array  # (m,)
    heap_item: IntArray  # (m,)
    state: IntArray  # (7,)
    found: Array  # (1,)


class Aims(NamedTuple):
    """Where a search leads: the nodes of some states within a distance of some places."""

    place: Array  # (G, 2) [m] in the frame of the lattice
    within: Array  # (G,) [m]
    admits: NDArray[np.bool_]  # (G, S)
    per_metre: float  # least cost of a displacement
    surplus: Array  # (S,) least cost beyond that of the displacement, from a state to an aim's


class Tested(NamedTuple):
    """What motions are tested with: pieces of their courses, and a scene that knows these."""

    lib: LatticeArrays
    scene: Scene

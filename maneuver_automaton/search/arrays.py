"""What kernels of the searches take: the library, the scene, and what is asked and found.

A record holds what changes together. `LatticeSearch` is all that a search of the lattice needs.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.collision.arrays import SweptAreas
from maneuver_automaton.collision.body import Body
from maneuver_automaton.collision.layers import LayerArrays
from maneuver_automaton.words.library import LibraryArrays, Scratch

# The library of m trims in C classes, with E maneuvers between these, of a vehicle of P parts.


class BodyArrays(NamedTuple):
    """Bodies of all parts, one after the other, as in `Body`."""

    edges: Array
    first: IntArray
    radius: Array
    discs: Array
    piece_of: IntArray  # (P + 1,) first piece of each part
    disc_of: IntArray  # (P + 1,)
    sizes: Array  # (P, 5) middle x, middle y, reach, inscribed, half width


class PartArrays(NamedTuple):
    """Rigid parts of a vehicle, and how its trims move them."""

    n: int
    body: Body  # of the first part
    bodies: BodyArrays
    offsets: Array  # (P, m, 3) of the parts in the trims
    twists: Array  # (P, m, 3)
    speeds: Array  # (P, m) [m/s] of the fastest point
    fastest: Array  # (m,) [m/s] over the parts


class CoastArrays(NamedTuple):
    """Coasts of edges: how long they last, where they lead, and what the first part covers."""

    durations: Array  # (m, 2) [s], 0 for none
    moves: Array  # (m, 2, 4) poses they lead to, forwards or backwards
    swept: SweptAreas


class EdgeArrays(NamedTuple):
    """Maneuvers between classes of trims, those out of one class next to each other."""

    first: IntArray  # (C + 1,) where those out of each class begin
    source: IntArray  # (E,) trims
    target: IntArray  # (E,)
    maneuver: IntArray  # (E,) index in the automaton
    displacement: Array  # (E, 4)
    cost: Array  # (E,)
    time: Array  # (E,) [s]
    reach: Array  # (E,) [m] that any point of the vehicle moves
    low: Array  # (E,) [m] altitudes above where it begins
    high: Array  # (E,)
    via: IntArray  # (C, C) first edge of a transition between classes, -1 for none


class PieceArrays(NamedTuple):
    """Motions of constant twist of every part, then of the pose alone, along every edge."""

    first: IntArray  # ((P + 1) E + 1,) of each part and edge; the last part is the pose
    pose: Array  # (N, 3)
    twist: Array  # (N, 3)
    time: Array  # (N,) [s]
    error: Array  # (N,) [m]
    speed: Array  # (N,) [m/s]
    low: Array  # (N,) [m] altitudes above where the edge begins
    high: Array  # (N,)


class LatticeArrays(NamedTuple):
    """Trims and maneuvers as the kernels see them, whatever the vehicle.

    One that changes between all its trims at will has one class and no edges.
    """

    library: LibraryArrays  # numbered as `Library.trims` lists them
    parts: PartArrays
    coasts: CoastArrays
    edges: EdgeArrays
    pieces: PieceArrays
    first_trim: IntArray  # (C + 1,) where the trims of each class begin ...
    trims_of: IntArray  # (m,) ... in this list
    most_children: int


# What motions are tested against, and what leads a search.


class PlaceArrays(NamedTuple):
    """What places cost: clearance by the distance to obstacles, all else by a raster of rates.

    Of the sheets of the raster the first is per metre; where the way matters, the second is per
    metre of driving back; and the third is per second. Between its samples a rate is linear.
    """

    weight: float  # of the clearance, per metre; 0: it costs nothing
    within: float  # [m] from obstacles, beyond which it costs nothing
    per_second: bool  # whether it costs by time and not by the way
    step: float  # [m] that no point of the vehicle moves farther in, from sample to sample
    value: NDArray[np.float32]  # (1 or 3, headings, rows, columns); no cells where there is none
    origin_x: float  # of the first sample
    origin_y: float
    cell: float  # [m]


class Scene(NamedTuple):
    """Where a motion is free."""

    layers: LayerArrays  # a planar world for every range of altitudes, then one for every zone
    keep: float  # [m] distance kept from obstacles ...
    margin: float  # [m] ... and the clearance beyond it that a proof needs
    far: float  # [m] clearance where no obstacle is near
    window: Array  # (9,) as in `_kernels_coast.inside_window`
    edge_window: Array  # (9,) narrower by the deviation of the courses of maneuvers
    lowest: float  # [m] altitudes within the bounds
    highest: float
    zone_trims: NDArray[np.bool_]  # (Z, m) trims that a zone admits
    zone_pieces: NDArray[np.bool_]  # (Z, N) pieces of maneuvers that a zone admits
    place: PlaceArrays  # what it costs there


class CellQueue(NamedTuple):
    """The open list of a grid: near cells in buckets, those that are far away in a binary heap."""

    keys: Array  # (8 cells + 8,) of the heap
    items: IntArray  # its cells; from the other end on those in the buckets
    links: IntArray  # the places before them in their bucket, plus 1; 0: none
    heads: IntArray  # (BUCKETS,) the last place of each bucket, plus 1


class GridLayout(NamedTuple):
    """Where the cells of a grid are; they coincide with those of the world's field."""

    origin_x: float
    origin_y: float
    cell: float
    columns: int
    rows: int
    stride: int  # field cells a cell
    shift_x: int  # field cell of cell (0, 0)
    shift_y: int
    aim_i: int  # cell towards which it grows first
    aim_j: int


class GridWalls(NamedTuple):
    """Which cells of a grid are closed, dear, or only to be reached by a detour."""

    inflation: float  # [m] clearance of a cell's centre below which the pose cannot be in it
    wanted: float  # [m] clearance of a cell's centre below which the vehicle cannot be there
    cut: float  # [m] clearance of a cell's centre below which a wall may cut the cell; -inf: none
    detour: int  # [units] how much longer a path is preferred to one through such a cell


class LeastPrices(NamedTuple):
    """How much more a metre costs, at least, for its place: in shares of the least cost of one."""

    value: NDArray[
        np.float32
    ]  # (rows, columns) least about each sample; no rows where none has one
    origin_x: float  # of the sample (0, 0)
    origin_y: float
    cell: float
    near: float  # the share where the body touches an obstacle, 0: none
    within: float  # [m] of the body, from which on it is 0
    reach: float  # [m] that the body is nearer than the middle of a cell at least


class DistanceGrid(NamedTuple):
    """Distances in the plane that know the obstacles, as far as they are grown."""

    value: IntArray  # (cells,) [units] length of the path that ranks first, where one is known
    rank: IntArray  # (cells,) [units] that length with a detour for every cell a wall may cut
    mark: NDArray[np.uint8]  # (cells,) 0 nothing is known, 1 blocked, 2 settled, 3 reached
    state: IntArray  # (6,) as numbered by the kernels
    queue: CellQueue
    layout: GridLayout
    walls: GridWalls
    prices: LeastPrices
    window: Array  # (9,) as in `_kernels_coast.inside_window`, outside of which no pose may be


class CostTable(NamedTuple):
    """Cost to go around a goal; a table of no cells where there is none."""

    value: NDArray[np.float32]  # (headings, 2 half + 1, 2 half + 1), inf where not known
    free: NDArray[np.float32]  # the same to a goal whose heading is free
    cell: float  # [m]
    half: int


# One search of the lattice.


class SearchArrays(NamedTuple):
    """Nodes, their hash table, the heap, and a few numbers, as in `_kernels_nodes`."""

    nodes: Array  # (n, 9)
    links: NDArray[np.int32]  # (n, 7)
    table: IntArray  # (4 n, 2) key, generation and node
    heap_key: Array
    heap_node: IntArray
    state: IntArray  # (13,)
    found: Array  # (6,) cost, three durations and that of a climb, and an excess
    scratch: Scratch


class EndArrays(NamedTuple):
    """Poses at one end of a search: where it begins, or where it leads."""

    poses: Array  # (n, 4)
    trims: IntArray  # (n,) -1 where any will do
    free: NDArray[np.bool_]  # (n,) whether any heading will do


class CellSizes(NamedTuple):
    """How poses are told apart: the cells of a lattice, seen from a frame."""

    frame: tuple[float, float, float, float, float]  # x, y, heading, its cosine and sine
    cell: float  # [m]
    headings: int
    fine_cell: float  # of truncated edges
    fine_headings: int
    rise: float  # [m] of altitude that makes another cell
    tick: float  # [s] of the clock that makes another cell, 0 where it makes none
    radix: tuple[int, int, int, int]  # cells along a side, headings, levels, ticks
    by_gear: bool  # whether cells know the gear, ...
    by_trim: bool  # the trim, ...
    by_count: bool  # and the number of trims


class Estimates(NamedTuple):
    """What the way to an aim costs at least, as the search takes it."""

    weight: float  # of the estimate in the open list
    per_metre: float  # least cost per metre
    per_climb: float  # least cost per metre of altitude
    radius: float  # [m] of turns, for `least_cost`; 0 where any is left to maneuvers
    surplus: Array  # (m + 1,) of maneuvers from a trim to an aim's, the least; the last of no trim


class Connecting(NamedTuple):
    """When a node is joined with the other end by a word, and what that may cost."""

    per_interval: float  # cost to go for each expansion between two connections
    least_interval: float  # expansions between two of them, at least ...
    most_interval: float  # ... and at most
    factor: float  # a connection may cost so many times the estimate ...
    slack: float  # ... and so much more
    tries: int  # candidates of one connection that are proven, at most
    checks_words: bool  # whether connections have limits of single words to keep


class Truncation(NamedTuple):
    """What is left of an edge that meets an obstacle."""

    kept: bool  # whether the part before the contact is
    back_off: float  # [m] before it
    shortest: float  # [m]


class WordLimits(NamedTuple):
    """What a plan has to keep, from a start at a time of the world."""

    clock: float  # [s] that time
    most_time: float  # [s]
    stay_until: float  # [s] time of the world until which the goal is kept
    most_trims: int  # 0: no limit
    least_coast: float  # [s]


class Task(NamedTuple):
    """What one search is asked, from one end."""

    sign: float  # 1: along time, -1: against it
    roots: EndArrays
    aims: EndArrays
    cells: CellSizes
    estimates: Estimates
    connecting: Connecting
    truncation: Truncation
    limits: WordLimits
    stop_at_first: bool  # connection
    ends_early: bool  # when the most promising node is not below the upper bound


class LatticeSearch(NamedTuple):
    """A search of the lattice: what is known, what is asked, of which vehicle, among what."""

    arrays: SearchArrays
    task: Task
    library: LatticeArrays
    scene: Scene
    grid: DistanceGrid
    table: CostTable


class Joint(NamedTuple):
    """Two ends that a word shall join, and what it may cost."""

    pose: tuple[float, float, float, float]  # where it begins
    before: int  # trim there, -1 for any
    after: int  # trim at its end, -1 for any
    clock: float  # [s] time of the world at its begin
    tries: int  # words that are proven, at most
    most_cost: float  # that it has to undercut
    most_time: float  # [s] that it may last


class Margins(NamedTuple):
    """Clearances [m] that a query needs."""

    clearly: float  # of ends, beyond what is kept, that leaves no doubt
    usual: float  # proven clearance, if the ends allow it
    least: float
    back_off: float  # as in `Truncation`, as far as the margin does not ask for more


class FirstCallArrays(NamedTuple):
    """Where a query lays down its poses, and where its first call leaves what it has found out."""

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
    bounds: tuple[float, float, float, float]  # of the pose [m]: low x, low y, high x, high y
    margins: Margins
    others: int  # numbers that layers, headings and so on of cells need


# A path among movers.


class PathArrays(NamedTuple):
    """Pieces of a path and the states along it."""

    trims: IntArray  # (n,)
    durations: Array  # (n,)
    poses: Array  # (n + 1, 4)
    links: IntArray  # (s, 2) joint and parent of each state
    times: Array  # (s, 3) arrival, until when it may stand there, departure from the parent [s]
    before: IntArray  # (s,) the state of the same joint that was found before, -1 for none
    latest: IntArray  # (n + 1,) the state of each joint that was found last, -1 for none
    last: Array  # (n,) [s] who leaves a joint later never ends the path
    keys: Array  # (s,) of the open list
    items: IntArray  # (s,)
    state: IntArray  # (2,) states in use, and those in the open list


class PathSearch(NamedTuple):
    """When to drive along a path: what is known, of which vehicle, among what."""

    path: PathArrays
    library: LatticeArrays
    scene: Scene
    limits: WordLimits
    quiet: float  # [s] since the start, after which nothing changes any more
    rest: int  # trim that waits, -1 if none
    tick: float  # [s] between departures that are tried


# A library on a lattice, which is a graph of S states and E edges.


class KnownCosts(NamedTuple):
    """Costs to go, or times; those outside are inf."""

    value: Array  # (columns, rows, S)
    column: int  # of the first entry
    row: int


class StateLattice(NamedTuple):
    """The graph, along time or against it."""

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
    places: IntArray  # (most_links,)
    costs: Array  # (most_links,)


class Aims(NamedTuple):
    """Where a search leads: the nodes of some states within a distance of some places."""

    place: Array  # (G, 2) [m] in the frame of the lattice
    within: Array  # (G,) [m]
    admits: NDArray[np.bool_]  # (G, S)
    slope: Array  # (2, K) prices of a displacement [1/m], K a multiple of 4
    offset: Array  # (G, S, K) least cost beyond that price, from a state to one of the aim


class Tested(NamedTuple):
    """What motions are tested with: pieces of their courses, and a scene that knows these."""

    lib: LatticeArrays
    scene: Scene


class GraphQuery(NamedTuple):
    """A search of a state lattice: what is known, where it leads, and what motions are tested with.

    Those of `coarse` are fewer and prove most edges free, those of `fine` decide.
    """

    arrays: GraphArrays
    lattice: StateLattice
    aims: Aims
    coarse: Tested
    fine: Tested
    weight: float  # of the bound of the cost to go


class TimedArrays(NamedTuple):
    """Arrays of a search in time, as in `_kernels_timed_lattice`."""

    table: IntArray  # (4 p, 2)
    latest: NDArray[np.int32]  # (p, S)
    links: IntArray  # (n, 6)
    times: Array  # (n, 3)
    cost: Array  # (n,)
    heap_key: Array  # (m,)
    heap_item: IntArray  # (m,)
    state: IntArray  # (7,)
    found: Array  # (1,)


class Timing(NamedTuple):
    """When things happen in a search in time, and what it costs to wait."""

    clock: float  # [s] time of the world at the start
    quiet: float  # [s] since the start, after which nothing moves
    most_time: float  # [s]
    stays: bool  # whether a plan ends where nothing comes later
    tick: float  # [s] between departures that are tried
    least_wait: float  # [s]
    rate: float  # cost of a second that is waited
    pause: float  # cost of waiting at all


class TimedQuery(NamedTuple):
    """A search of a state lattice in time: what stands is tested as in `GraphQuery`."""

    arrays: TimedArrays
    lattice: StateLattice
    aims: Aims
    free: KnownCosts  # costs to go among all that stands
    soon: KnownCosts  # times to go [s]
    coarse: Tested
    fine: Tested
    moving: Tested  # all that moves, and what stands, in another frame
    frame: tuple[float, float, float, float, float]  # of the lattice, seen from there
    directed: int  # states of a heading
    timing: Timing

"""One search of the lattice: its resolution, its limits as kernels see them, and the schedules."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from maneuver_automaton._compile import plain
from maneuver_automaton._kept import kept_by_first
from maneuver_automaton.problem import SearchSettings
from maneuver_automaton.search._kernels_nodes import cells_along
from maneuver_automaton.search.arrays import (
    CellSizes,
    Connecting,
    EndArrays,
    Estimates,
    Task,
    Truncation,
    WordLimits,
)
from maneuver_automaton.search.distance_grid import OCTILE
from maneuver_automaton.search.lattice_library import LatticeLibrary
from maneuver_automaton.search.lattice_query import LatticeQuery
from maneuver_automaton.words.shortest import least_radius

HEADINGS = 72
FINE_HEADINGS = 250
WEIGHT = 2.0
TRIES = 6  # candidates of one connection that are tried
CONNECTION_FACTOR = 1.5  # a connection may cost so many times the estimate ...
SLACK = 2.0  # ... and so many length scales, and a full turn, and the prices of its joints
MOST_JOINTS = 4  # of a connection of three trims, those with the trims before and after it included
INTERVAL = 0.25  # [cost of a length scale] to go for each expansion between connections ...
FIRST_INTERVAL = 0.75  # ... and in the first stages, which end with the first of them that is free
RISE = 0.25  # [length scales] of altitude that make another cell
BACK_OFF = 0.01  # [half widths of the body] kept before contact
SHORTEST_TRUNCATED = 0.03  # [half widths] of an edge that ends there
SAMPLED_HEADINGS = 16  # roots at a goal whose heading is free
ROUNDING = 1e-12  # relative, by which a coast may fall short of the least one
MOST_LEVELS, MOST_TICKS = 1 << 8, 1 << 11  # that have numbers of their own
MOST_COUNTS = 16  # of trims that make another cell


@dataclass(frozen=True, slots=True, kw_only=True)
class Resolution:
    """One resolution and weight of the lattice."""

    scale: float = 1.0  # of the cells
    durations: float = 1.0  # of the edges
    weight: float = WEIGHT
    truncated: bool = False  # keep the part of an edge before a contact
    fine: float = 0.4  # cells of such edges, in cells of this resolution
    margin: float = 1.0  # of the proven clearance
    guided: bool = False  # by the table of the cost to go
    coarse: bool = False  # led by distances along coarse cells
    stop: bool = True  # at the first connection
    layered: bool = False  # whether cells know the gear and the trim that prices ask for
    most: int = 2**62  # expansions
    backwards: bool = False  # from the goal
    ends_early: bool = False  # when the most promising node is not below the upper bound
    straight: bool = False  # whether estimates in the open are no longer than straight lines


def limits_of(query: LatticeQuery) -> WordLimits:
    """What a plan of a query has to keep."""
    clock, horizon = query.problem.start_time, query.problem.horizon
    rests_until = -math.inf if horizon.time is None else clock + horizon.time
    return WordLimits(
        clock=float(clock),
        most_time=float(query.most_time),
        stay_until=float(query.world.last_event if horizon.stay else rests_until),
        most_trims=int(query.most_trims),
        least_coast=float(query.least_coast),
    )


def task_of(query: LatticeQuery, resolution: Resolution, *, sign: float = 1.0) -> Task:
    """Limits and sizes of a search, as the kernels see them."""
    x, y, heading, _ = query.goals[0].tolist()
    none, start_trim = np.zeros(1, dtype=np.bool_), np.array([query.start_trim], dtype=np.int64)
    start = EndArrays(np.array(query.start)[None], start_trim, none)
    goal_trims = np.array(query.goal_trims, dtype=np.int64)
    goals = EndArrays(np.array(query.goals), goal_trims, np.array(query.free_heading))
    aims, roots = (goals, start) if sign > 0.0 else (start, goal_roots(query))
    timed, limits = query.moves or math.isfinite(query.most_time), limits_of(query)
    settings, count, coast = query.problem.search, limits.most_trims, limits.least_coast
    asked = settings.cell, settings.headings
    known, layers = _sizes(query.library, asked, resolution, timed, count, coast)
    cells = known.cells._replace(frame=(x, y, heading, math.cos(heading), math.sin(heading)))
    least, most = query.library.interval  # as a connection takes as long as some expansions
    least *= len(query.goals)
    back_off = float(max(back_off_of(query.library), 2.0 * query.margin))
    # of each trim, and of none, the least surplus of maneuvers from there to an aim's trim
    numbered = query.library.arrays.library
    surplus = np.zeros(1 + numbered.n_trims)
    if query.library.surplus.any():
        to_aims = query.library.surplus[:, numbered.class_of[aims.trims]].min(axis=1)
        surplus[:] = np.append(to_aims[numbered.class_of[: numbered.n_trims]], to_aims[0])
    return known._replace(
        sign=sign,
        roots=roots,
        aims=aims,
        cells=cells._replace(radix=_radix(query, cells, layers)),
        estimates=known.estimates._replace(surplus=surplus),
        connecting=known.connecting._replace(least_interval=least, most_interval=most),
        truncation=known.truncation._replace(back_off=back_off),
        limits=limits._replace(least_coast=limits.least_coast * (1.0 - ROUNDING)),
    )


NO_ENDS = EndArrays(np.zeros((0, 4)), np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.bool_))


@kept_by_first
def _sizes(
    library: LatticeLibrary,
    asked: tuple[float | None, int | None],
    resolution: Resolution,
    timed: bool,
    most_trims: int,
    least_coast: float,
) -> tuple[Task, int]:
    """What tasks of all queries share, their own values left open; the layers of their cells."""
    cell = resolution.scale * (asked[0] or library.cell)
    interval = FIRST_INTERVAL if resolution.coarse else INTERVAL
    sharp = interval * library.radius * library.per_metre
    by_gear, by_trim, by_count, layers = _layers(library, resolution, most_trims, least_coast)
    numbered, durations = library.arrays.library, library.arrays.coasts.durations
    lasting = durations[durations > 0.0]
    tick = resolution.durations * float(lasting.min()) if lasting.size else 1.0
    task = Task(
        sign=1.0,
        roots=NO_ENDS,
        aims=NO_ENDS,
        cells=CellSizes(
            frame=(0.0, 0.0, 0.0, 1.0, 0.0),
            cell=float(cell),
            headings=int(asked[1] or HEADINGS),
            fine_cell=float(resolution.fine * cell),
            fine_headings=FINE_HEADINGS,
            rise=float(resolution.scale * RISE * library.radius),
            tick=tick if timed else 0.0,  # of two nodes of a cell the costlier may be in time
            radix=(1, 1, 1, 1),
            by_gear=by_gear,
            by_trim=by_trim,
            by_count=by_count,
        ),
        estimates=Estimates(
            weight=float(resolution.weight),
            per_metre=float(library.per_metre) / (OCTILE if resolution.straight else 1.0),
            per_climb=float(library.per_climb),
            radius=least_radius(numbered.twists[:-1]) if library.at_will else 0.0,
            surplus=np.zeros(0),
        ),
        connecting=Connecting(
            # The path to the goal says how long to wait, unless no trim moves: then nothing is
            # solved for, and the node that ends at the goal must not be missed.
            per_interval=(float(sharp) or 1.0) if library.drives else math.inf,
            least_interval=0.0,
            most_interval=math.inf,
            factor=CONNECTION_FACTOR,
            slack=_slack(library),
            tries=TRIES,
            checks_words=bool(most_trims > 0 or least_coast > 0.0 or library.limits_coasts),
        ),
        truncation=Truncation(
            kept=resolution.truncated,
            back_off=0.0,
            shortest=float(SHORTEST_TRUNCATED * _size(library)),
        ),
        limits=WordLimits(0.0, math.inf, -math.inf, 0, 0.0),
        stop_at_first=bool(resolution.stop),
        ends_early=bool(resolution.ends_early),
    )
    return task, layers


def _layers(
    library: LatticeLibrary, resolution: Resolution, most_trims: int, least_coast: float
) -> tuple[bool, bool, bool, int]:
    """Whether cells know the gear, the trim and the count of trims, and how many layers that is."""
    numbered = library.arrays.library
    by_gear = bool(resolution.layered and numbered.direction_change > 0.0)
    by_trim = len(library.arrays.trims_of) > len(numbered.transitions.cost) and bool(
        least_coast > 0.0 or library.limits_coasts or (resolution.layered and numbered.switch > 0.0)
    )
    by_count = most_trims > 0
    layers = len(numbered.transitions.cost) * (numbered.n_trims + 1 if by_trim else 1)
    layers *= (3 if by_gear else 1) * (MOST_COUNTS if by_count else 1)
    return by_gear, by_trim, by_count, layers


def goal_roots(query: LatticeQuery) -> EndArrays:
    """Poses (R, 4) at the goals, a few headings where any will do, and their trims."""
    rows, numbers = [], []
    for goal, free, trim in zip(query.goals, query.free_heading, query.goal_trims, strict=True):
        turns = np.arange(SAMPLED_HEADINGS if free else 1) * (2.0 * np.pi / SAMPLED_HEADINGS)
        rows += [goal + np.array([0.0, 0.0, turn, 0.0]) for turn in turns]
        numbers += [int(trim)] * len(turns)
    none = np.zeros(len(rows), dtype=np.bool_)
    return EndArrays(np.array(rows), np.array(numbers, dtype=np.int64), none)


def _slack(library: LatticeLibrary) -> float:
    """Cost of two length scales, a full turn and the joints: the estimate knows no prices."""
    numbered = library.arrays.library
    path = SLACK * library.radius * library.per_metre + library.per_turn
    prices = MOST_JOINTS * (numbered.switch + numbered.direction_change)
    return float(path + prices) if path > 0.0 else math.inf


def _radix(query: LatticeQuery, cells: CellSizes, layers: int) -> tuple[int, int, int, int]:
    """Numbers that coordinates of cells need; far cells may share one, which drops no proof."""
    low_x, low_y, high_x, high_y = query.box.tolist()
    far = max(high_x - low_x, high_y - low_y)  # no pose of the window is farther from the frame
    turns = max(cells.headings, cells.fine_headings) + 1
    levels = MOST_LEVELS if query.library.climbs else 1
    ticks = MOST_TICKS if cells.tick > 0.0 else 1
    others = layers * 2 * ticks * levels * turns  # two: truncated edges have cells of their own
    return plain(cells_along)(cells.fine_cell, far, others), turns, levels, ticks


def numbers_of_cells(query: LatticeQuery, task: Task, resolution: Resolution) -> int:
    """How many numbers the cells of one place need: the `others` of `cells_along`."""
    *_, layers = _layers(query.library, resolution, query.most_trims, query.least_coast)
    _, turns, levels, ticks = task.cells.radix
    return layers * 2 * ticks * levels * turns


def back_off_of(library: LatticeLibrary) -> float:
    """Distance kept before contact, as far as the margin does not ask for more [m]."""
    return BACK_OFF * _size(library)


def _size(library: LatticeLibrary) -> float:
    """Half the width of the body [m]; of a point a share of its turns."""
    return library.half_width or library.radius * 0.1


FAST = 1.5  # length scales of the tightest turn from which on there is a search of its size
FAST_WEIGHT = 1.0  # of that: a fast vehicle cannot make up for greed once it is near the goal
FAST_ALONE = 2000  # expansions of a search as wide as the turns, until others run in turn with it


class Schedule(NamedTuple):
    """Which resolutions begin after so many expansions of all together, or when none is left.

    They run in turn, each twice as many expansions as in its turn before.
    """

    stages: tuple[tuple[int, tuple[Resolution, ...]], ...]
    first_chunk: int
    most_chunk: int
    ends: tuple[float, ...] = (1.0,)  # where each begins: 1 at the start, -1 at the goals


AT_WILL = Schedule(
    (
        (0, (Resolution(coarse=True),)),
        (
            300,
            (
                Resolution(truncated=True, guided=True, coarse=True),
                Resolution(scale=0.5, durations=0.5, truncated=True, guided=True, coarse=True),
            ),
        ),
        (1500, (Resolution(scale=0.24, durations=0.25, truncated=True, guided=True),)),
        (
            8000,
            (
                Resolution(scale=0.5, durations=0.5, truncated=True, fine=0.2, guided=True),
                Resolution(scale=0.5, durations=0.5, truncated=True),
                Resolution(scale=0.12, durations=0.17),
            ),
        ),
        (2**62, (Resolution(scale=0.24, durations=0.25, truncated=True, margin=0.1, guided=True),)),
    ),
    first_chunk=64,
    most_chunk=8192,
    ends=(1.0, -1.0),
)
LINKED = Schedule(
    (
        (0, (Resolution(),)),
        (300, (Resolution(scale=0.5, durations=0.5), Resolution(durations=0.7))),
        (2000, (Resolution(scale=0.25, durations=0.25), Resolution(scale=0.5, durations=0.7))),
        (2000, (Resolution(backwards=True),)),
        (8000, (Resolution(scale=0.5, durations=0.5, weight=1.5, backwards=True),)),
        (40000, (Resolution(scale=0.25, durations=0.25, margin=0.1),)),
    ),
    first_chunk=128,
    most_chunk=16384,
)


def schedule_of(library: LatticeLibrary) -> Schedule:
    """The schedule for a library: trims that are switched at will, or linked by transitions.

    A vehicle that turns widely for its size begins with a search whose cells and coasts are as
    wide: it decides little from one length of its body to the next.
    """
    if library.at_will:
        return AT_WILL
    fast = as_wide_as_turns(library)
    (_, first), *later = LINKED.stages
    stages = ((0, fast), (FAST_ALONE, first), *later) if fast else LINKED.stages
    early = ((k, tuple(replace(one, ends_early=True) for one in begun)) for k, begun in stages)
    return LINKED._replace(stages=tuple(early))


def first_resolutions(library: LatticeLibrary, settings: SearchSettings) -> tuple[Resolution, ...]:
    """The resolutions with which a search begins, at the weight that is asked for."""
    _, begun = schedule_of(library).stages[0]
    if settings.weight is None:
        return begun
    return tuple(replace(one, weight=settings.weight) for one in begun)


def as_wide_as_turns(library: LatticeLibrary) -> tuple[Resolution, ...]:
    """The resolution of a vehicle that turns widely for its size; none for others."""
    wide = library.turns
    return (Resolution(scale=wide, durations=wide, weight=FAST_WEIGHT),) if wide > FAST else ()

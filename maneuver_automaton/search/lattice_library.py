"""An automaton as the lattice uses it: trims, edges, sizes, for every start, goal and map."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._kept import kept_by_first
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.validation import part_between
from maneuver_automaton.collision import Shape
from maneuver_automaton.collision.body import body_of
from maneuver_automaton.costs import StageCost
from maneuver_automaton.primitives import Maneuver
from maneuver_automaton.problem import Problem
from maneuver_automaton.search.lattice_arrays import (
    CELL,
    EdgeArrays,
    LatticeLibrary,
    MotionArrays,
    coasts_of,
    edge_durations_of,
    lattice_arrays,
    length_scale,
    tightest_turn,
)
from maneuver_automaton.search.lattice_trims import (
    TURN,
    Chosen,
    PricedTrims,
    is_mirrored,
    priced_library,
    trims_at_will,
    trims_of,
)
from maneuver_automaton.search.part_motion import (
    CLOSE,
    Part,
    bodies_of,
    carried_twists,
    course_of,
    fastest_of,
    pieces_of,
    posed_parts,
)
from maneuver_automaton.search.prepared import RECENT, Prepared
from maneuver_automaton.words.library import Library
from maneuver_automaton.words.transitions import SWITCH, transitions_of

OF_A_LATTICE = 0.7  # of its resolution: a cell's diagonal is shorter than the step between poses
Carried = tuple[tuple[str, tuple[Shape, ...]], ...]


def lattice_library(
    problem: Problem, goals: Sequence[int] = (), *, prepared: Prepared = RECENT
) -> LatticeLibrary:
    """The part of a lattice search that is the same for every start, goal and map.

    Trims that lead to none of the goals of these numbers are left out: their speeds would make the
    estimates of cost too low. A vehicle that switches at will can use all of them.

    Raises
    ------
    ValueError
        If a maneuver has no course, and so no known cost.
    """
    automaton = problem.automaton
    if automaton.is_kinematic:
        return _library_on(problem.setting, automaton, prepared)
    first = automaton.index_of(problem.first_trim.name)
    ends = [automaton.index_of(problem.last_trim(problem.goals[k]).name) for k in goals]
    return _library_on(problem.setting, part_between(automaton, first, ends), prepared)


@kept_by_first
def _library_on(setting: Problem, automaton: Automaton, prepared: Prepared) -> LatticeLibrary:
    return prepared.once(_library, automaton, *_asked(setting))


def library_with(problem: Problem, choice: Chosen) -> LatticeLibrary:
    """`lattice_library` with other trims, for a vehicle that switches at will; not kept."""
    return _library(problem.automaton, *_asked(problem), choice)


def _asked(
    problem: Problem,
) -> tuple[StageCost, tuple[Shape, ...], Carried, bool, bool, float, bool]:
    """What a library depends on beside its automaton, as `_library` takes it."""
    carried, horizon = tuple(problem.parts.items()), problem.horizon
    fixed, limited = horizon.time is not None, horizon.max_time is not None
    times = fixed, problem.moves, horizon.min_coast, fixed or limited
    return (problem.cost, problem.footprint, carried, *times)


def _library(
    automaton: Automaton,
    cost: StageCost,
    footprint: tuple[Shape, ...],
    carried: Carried,
    fixed_time: bool,
    waits: bool,
    min_coast: float,
    limited: bool,
    choice: Chosen | None = None,
) -> LatticeLibrary:
    if automaton.is_kinematic and automaton.model.group.dof == 3:
        trims = trims_at_will(
            automaton,
            cost,
            fixed_time=fixed_time,
            waits=waits,
            min_coast=min_coast,
            limited=limited,
            choice=choice,
        )
    else:
        trims = trims_of(priced_library(automaton, cost), cost)
    parts = posed_parts(automaton, footprint, dict(carried), trims.library.trims)
    return library_of_trims(trims, parts, waits=waits)


def library_of_trims(
    priced: PricedTrims, parts: tuple[Part, ...], *, waits: bool, close: float = CLOSE
) -> LatticeLibrary:
    """Trims and the maneuvers between them; `waits`: obstacles move, and rest is an edge.

    Courses are followed as closely as `motion_along` says.
    """
    library, arrays = priced.library, priced.library.arrays
    lattice = library.automaton.lattice
    twists, rates = arrays.twists[: arrays.n_trims], arrays.rates[: arrays.n_trims]
    edges = edges_of(library)
    motion, spans = motion_along(library, parts, edges, timed=waits, close=close)
    edge_of = np.full(len(library.maneuver_costs) + 1, SWITCH)  # the last is that of none
    edge_of[edges.maneuver] = np.arange(len(edges.maneuver))
    radius = length_scale(twists, body_of(parts[0].shapes), wide=priced.wide)
    speed = np.hypot(twists[:, 0], twists[:, 1])
    lengths = np.array([path_length(library.automaton, k) for k in edges.maneuver])
    # where no trim moves, only maneuvers cover ground
    per_metre = _least(rates, speed) if speed.any() else _least(edges.cost, lengths)
    surplus = np.maximum(edges.cost - per_metre * lengths, 0.0)
    pose_rows = motion.first_piece[len(parts) * len(edges.cost)]
    durations = edge_durations_of(twists, radius, waits=waits)
    made = lattice_arrays(
        arrays,
        parts,
        edges,
        motion,
        edge_durations=durations,
        via_edge=np.asarray(edge_of[library.transitions.first], dtype=np.int64),
    )
    return LatticeLibrary(
        arrays=made,
        backwards=made._replace(**coasts_of(twists, -durations, made.body)._asdict()),
        priced=library,
        parts=parts,
        trims=library.trims,
        number_of=library.number_of,
        edge_maneuver=edges.maneuver,
        radius=radius,
        # poses of a lattice must not share a cell, since each has to be reached
        cell=CELL * radius if lattice is None else OF_A_LATTICE * lattice.resolution,
        turns=tightest_turn(twists) / radius or 1.0,
        per_metre=per_metre,
        per_climb=_least(rates, np.abs(twists[:, 3])),
        per_turn=TURN * radius * per_metre if priced.per_turn is None else priced.per_turn,
        lag=lags(library, surplus, edges),
        worst_error=float(motion.piece_error[pose_rows:].max(initial=0.0)),
        spans=spans,
        rest=priced.rest,
        rest_rate=priced.rest_rate,
        interval=priced.interval,
        at_will=priced.at_will,
        mirrored=is_mirrored(twists[:, :3], rates),
    )


def _least(rates: Array, speed: Array) -> float:
    """Least cost per metre; 0 if no trim moves."""
    moving = speed > 0.0
    return float((rates[moving] / speed[moving]).min()) if moving.any() else 0.0


def edges_of(library: Library) -> EdgeArrays:
    """The maneuvers, sorted by the class they lead out of, then as the automaton lists them."""
    automaton, transitions = library.automaton, library.transitions
    order = np.argsort(transitions.class_of[transitions.sources], kind="stable")
    displacement, time = np.zeros((len(order), 4)), np.zeros(len(order))
    for e, k in enumerate(order.tolist()):
        displacement[e, : automaton.model.group.dof] = automaton.maneuvers[k].displacement
        time[e] = automaton.maneuvers[k].duration
    return EdgeArrays(
        source=transitions.sources[order],
        target=transitions.targets[order],
        maneuver=order,
        displacement=displacement,
        cost=library.maneuver_costs[order],
        time=time,
    )


def motion_along(
    library: Library,
    parts: Sequence[Part],
    edges: EdgeArrays,
    *,
    timed: bool,
    close: float = CLOSE,
) -> tuple[MotionArrays, IntArray]:
    """Pieces of every part, then of the pose alone, along every edge; samples of the parts.

    `timed`: obstacles move, so that it matters when the vehicle is where. Pieces follow the course
    to within so many half widths of the body as `close` says.
    """
    if not edges.maneuver.size:
        first, rows, none = np.zeros(1, dtype=np.int64), np.zeros((0, 3)), np.zeros(0)
        return MotionArrays(first, rows, rows, *[none] * 7), np.zeros((0, 2), dtype=np.int64)
    automaton, bodies = library.automaton, bodies_of(parts)
    trim_twists = library.arrays.twists[: library.arrays.n_trims]
    twists = [carried_twists(trim_twists, part.trim_poses) for part in parts]
    own = carried_twists(automaton.body_velocities, np.zeros((len(automaton), 3)))
    close *= min(b.half_width or 0.05 * max(b.reach, 1.0) for b in bodies)
    sources, targets = edges.source, edges.target
    chosen = [automaton.maneuvers[k] for k in edges.maneuver]
    climbs = automaton.body_velocities[:, 3:].sum(axis=1)
    ends = np.stack([climbs[sources], climbs[targets]], axis=1)
    found, counts, speeds, heights = [], [np.zeros(1, dtype=np.int64)], [], []
    spans: list[IntArray] = []
    for p in range(len(parts) + 1):
        body = bodies[p] if p < len(parts) else None
        table = own if body is None else twists[p]
        reach = 0.0  # of the farthest point of the body from the pose of its part [m]
        if body is not None:
            reach = float(np.hypot(body.middle_x, body.middle_y)) + body.reach
        courses = []
        for k, maneuver in zip(edges.maneuver, chosen, strict=True):
            n = 2 if maneuver.course is None else len(maneuver.course.time)
            poses = np.zeros((n, 3)) if body is None else parts[p].course_poses[k]
            courses.append(course_of(maneuver, poses))
        pieces = pieces_of(
            courses,
            ends=np.stack([table[sources], table[targets]], axis=1),
            reach=reach,
            close=close,
            timed=timed,
            stepwise=automaton.lattice is not None,
        )
        if body is not None:
            sizes = np.array([len(times) for _, times in courses], dtype=np.int64)
            begins = np.repeat(np.cumsum(sizes) - sizes, np.diff(pieces.first))
            spans.append(np.stack([pieces.begin - begins, pieces.end - begins], axis=1))
        counts.append(np.diff(pieces.first))
        found.append(pieces)
        flat = np.hypot(pieces.twist[:, 0], pieces.twist[:, 1])
        speeds.append(flat if body is None else fastest_of(body, pieces.twist))
        heights.append(altitude_ranges(chosen, ends, pieces.begin, pieces.end))
    low = np.minimum.reduceat(heights[-1][0], pieces.first[:-1])
    high = np.maximum.reduceat(heights[-1][1], pieces.first[:-1])
    motion = MotionArrays(
        first_piece=np.cumsum(np.concatenate(counts)),
        piece_pose=np.concatenate([row.pose for row in found]),
        piece_twist=np.concatenate([row.twist for row in found]),
        piece_time=np.concatenate([row.time for row in found]),
        piece_error=np.concatenate([row.error for row in found]),
        piece_speed=np.concatenate(speeds),
        piece_low=np.concatenate([row for row, _ in heights]),
        piece_high=np.concatenate([row for _, row in heights]),
        edge_low=low,
        edge_high=high,
    )
    return motion, np.concatenate(spans)


def lags(library: Library, surplus: Array, edges: EdgeArrays) -> Array:
    """Least surplus (C, C) of chains of maneuvers over the price of the path they make."""
    by_maneuver = np.zeros(len(library.maneuver_costs))
    by_maneuver[edges.maneuver] = surplus
    return transitions_of(library.automaton, by_maneuver).cost


def path_length(automaton: Automaton, k: int) -> float:
    """Length of the path of a maneuver [m]."""
    maneuver = automaton.maneuvers[k]
    if maneuver.course is None:
        return float(np.hypot(*maneuver.displacement[:2]))
    return float(np.hypot(*np.diff(maneuver.course.pose[:, :2], axis=0).T).sum())


BETWEEN = 0.25  # of the change of climb from sample to sample times their spacing


def altitude_ranges(
    maneuvers: Sequence[Maneuver], climbs: Array, begin: IntArray, end: IntArray
) -> tuple[Array, Array]:
    """Least and greatest altitude (n,) [m] of pieces, seen from where their maneuver begins.

    `climbs` (k, 2) [m/s] in the trims before and after each maneuver; `begin` and `end` (n,) are
    the first and last sample of every piece, of all courses one after the other.

    Examples
    --------
    >>> stroke = Maneuver(name="up", source="low", target="high", duration=2.0,
    ...                   displacement=[1.0, 0.0, 0.0, 3.0])
    >>> low, high = altitude_ranges([stroke], np.full((1, 2), 1.5), np.array([0]), np.array([1]))
    >>> low.tolist(), high.tolist()
    ([0.0], [3.0])
    """
    if not begin.size:
        return np.zeros(0), np.zeros(0)
    rows, swings = [], []
    for maneuver, (before, after) in zip(maneuvers, climbs.tolist(), strict=True):
        if maneuver.displacement.size == 3:
            n = 2 if maneuver.course is None else len(maneuver.course.time)
            rows.append(np.zeros(n))
            swings.append(np.zeros(n))
            continue
        if maneuver.course is None:
            z, t = np.array([0.0, maneuver.displacement[3]]), np.array([0.0, maneuver.duration])
        else:
            z, t = maneuver.course.pose[:, 3], maneuver.course.time
        spacing = np.maximum(np.diff(t), 1e-300)
        rates = np.concatenate([[before], np.diff(z) / spacing, [after]])
        change = np.abs(np.diff(rates))
        rows.append(z)
        swings.append(np.append(BETWEEN * np.maximum(change[:-1], change[1:]) * np.diff(t), 0.0))
    altitude, swing = np.concatenate(rows), np.concatenate(swings)
    span = np.stack([begin, end + 1], axis=1).ravel()
    more = np.maximum.reduceat(np.append(swing, 0.0), span)[::2]
    low = np.minimum.reduceat(np.append(altitude, np.inf), span)[::2] - more
    high = np.maximum.reduceat(np.append(altitude, -np.inf), span)[::2] + more
    return np.asarray(low), np.asarray(high)

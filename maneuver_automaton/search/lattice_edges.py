"""Maneuvers as edges of the lattice: their ends, costs, and motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.primitives import Maneuver
from maneuver_automaton.search.lattice_arrays import (
    EdgeArrays,
    MotionArrays,
)
from maneuver_automaton.search.part_motion import (
    CLOSE,
    Part,
    bodies_of,
    carried_twists,
    course_of,
    fastest_of,
    pieces_of,
)
from maneuver_automaton.words.library import Library
from maneuver_automaton.words.transitions import SWITCH, transitions_of


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


def via_edges(library: Library, edges: EdgeArrays) -> IntArray:
    """Edge (C, C) of the first maneuver of the transition between two classes, -1 for none."""
    edge_of = np.full(len(library.maneuver_costs) + 1, SWITCH)  # the last is that of none
    edge_of[edges.maneuver] = np.arange(len(edges.maneuver))
    return np.asarray(edge_of[library.transitions.first], dtype=np.int64)


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

"""An automaton as the lattice of maneuvers uses it: edges, pieces of motion, sizes."""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.collision.body import body_of
from maneuver_automaton.models import OnLattice
from maneuver_automaton.search.lattice_arrays import (
    CELL,
    EdgeArrays,
    LatticeLibrary,
    MotionArrays,
    edge_durations_of,
    lattice_arrays,
    length_scale,
    no_edges,
    tightest_turn,
)
from maneuver_automaton.search.maneuver_heights import altitude_ranges
from maneuver_automaton.search.maneuver_motion import (
    CLOSE,
    Part,
    bodies_of,
    body_reach,
    carried_twists,
    course_of,
    fastest_of,
    pieces_of,
)
from maneuver_automaton.words.library import Library
from maneuver_automaton.words.transitions import SWITCH, transitions_of

OF_A_LATTICE = 0.7  # of its resolution: a cell's diagonal is shorter than the step between poses
TURN = 4.0  # length scales that a full turn is taken for, whose radius the speed decides


@functools.lru_cache(maxsize=16)
def maneuver_library(
    transfer: Library, parts: tuple[Part, ...], *, timed: bool, waits: bool
) -> LatticeLibrary:
    """Everything about an automaton that is the same for every start, goal and map.

    `timed`: something moves, so that it matters when the vehicle is where; `waits`: rest is a trim
    like any other.
    """
    automaton, arrays = transfer.automaton, transfer.arrays
    trim_twists, trim_rates = arrays.twists[: arrays.n_trims], arrays.rates[: arrays.n_trims]
    edges = _edges(automaton, transfer)
    twists = [carried_twists(trim_twists, part.trim_poses) for part in parts]
    motion, spans = no_edges()[1], np.zeros((0, 2), dtype=np.int64)
    if edges.maneuver.size:
        motion, spans = _motion(automaton, parts, edges, np.array(twists), timed=timed)
    radius = length_scale(trim_twists, body_of(parts[0].shapes), wide=False)
    speed = np.hypot(trim_twists[:, 0], trim_twists[:, 1])
    lengths = np.array([_path_length(automaton, k) for k in edges.maneuver])
    # where no trim moves, only maneuvers cover ground
    per_metre = _least(trim_rates, speed) if speed.any() else _least(edges.cost, lengths)
    pose_rows = motion.first_piece[len(parts) * len(edges.cost)]
    return LatticeLibrary(
        arrays=lattice_arrays(
            arrays,
            parts,
            edges,
            motion,
            edge_durations=edge_durations_of(trim_twists, radius, waits=waits),
            via_edge=_via_edges(transfer, edges),
        ),
        trims=np.arange(len(automaton)),
        number_of=np.arange(len(automaton)),
        edge_maneuver=edges.maneuver,
        radius=radius,
        cell=_cell(automaton, radius),
        turns=tightest_turn(trim_twists) / radius or 1.0,
        per_metre=per_metre,
        per_climb=_least(trim_rates, np.abs(trim_twists[:, 3])),
        per_turn=TURN * radius * per_metre,
        lag=_lags(transfer, np.maximum(edges.cost - per_metre * lengths, 0.0), edges),
        worst_error=float(motion.piece_error[pose_rows:].max(initial=0.0)),
        spans=spans,
        rest=automaton.rest,
        rest_rate=0.0,
        mirrored=False,
    )


def _edges(automaton: Automaton, transfer: Library) -> EdgeArrays:
    """The maneuvers, sorted by the class they lead out of, then as the automaton lists them."""
    order = np.argsort(transfer.transitions.class_of[transfer.transitions.sources], kind="stable")
    displacement, time = np.zeros((len(order), 4)), np.zeros(len(order))
    for e, k in enumerate(order.tolist()):
        displacement[e, : automaton.model.group.dof] = automaton.maneuvers[k].displacement
        time[e] = automaton.maneuvers[k].duration
    return EdgeArrays(
        source=transfer.transitions.sources[order],
        target=transfer.transitions.targets[order],
        maneuver=order,
        displacement=displacement,
        cost=transfer.maneuver_costs[order],
        time=time,
    )


def _motion(
    automaton: Automaton, parts: Sequence[Part], edges: EdgeArrays, twists: Array, *, timed: bool
) -> tuple[MotionArrays, IntArray]:
    """Pieces of every part, then of the pose alone, along every edge; samples of the first part."""
    bodies = bodies_of(parts)
    own = carried_twists(automaton.body_velocities, np.zeros((len(automaton), 3)))
    close = CLOSE * min(b.half_width or 0.05 * max(b.reach, 1.0) for b in bodies)
    sources, targets = edges.source, edges.target
    chosen = [automaton.maneuvers[k] for k in edges.maneuver]
    climbs = automaton.body_velocities[:, 3:].sum(axis=1)
    ends = np.stack([climbs[sources], climbs[targets]], axis=1)
    found, counts, speeds, heights = [], [np.zeros(1, dtype=np.int64)], [], []
    spans: list[IntArray] = []
    for p in range(len(parts) + 1):
        body = bodies[p] if p < len(parts) else None
        table = own if body is None else twists[p]
        courses = []
        for k, maneuver in zip(edges.maneuver, chosen, strict=True):
            n = 2 if maneuver.course is None else len(maneuver.course.time)
            poses = np.zeros((n, 3)) if body is None else parts[p].course_poses[k]
            courses.append(course_of(maneuver, poses))
        pieces = pieces_of(
            courses,
            ends=np.stack([table[sources], table[targets]], axis=1),
            reach=0.0 if body is None else body_reach(body),
            close=close,
            timed=timed,
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


def _via_edges(transfer: Library, edges: EdgeArrays) -> IntArray:
    """Edge (C, C) of the first maneuver of the transition between two classes."""
    edge_of = np.full(len(transfer.maneuver_costs) + 1, SWITCH)  # the last is that of none
    edge_of[edges.maneuver] = np.arange(len(edges.maneuver))
    return np.asarray(edge_of[transfer.transitions.first], dtype=np.int64)


def _lags(transfer: Library, surplus: Array, edges: EdgeArrays) -> Array:
    """Least surplus (C, C) of chains of maneuvers over the price of the way they make."""
    by_maneuver = np.zeros(len(transfer.maneuver_costs))
    by_maneuver[edges.maneuver] = surplus
    return transitions_of(transfer.automaton, by_maneuver).cost


def _path_length(automaton: Automaton, k: int) -> float:
    """Length of the path of a maneuver [m]."""
    maneuver = automaton.maneuvers[k]
    if maneuver.course is None:
        return float(np.hypot(*maneuver.displacement[:2]))
    return float(np.hypot(*np.diff(maneuver.course.pose[:, :2], axis=0).T).sum())


def _least(rates: Array, speed: Array) -> float:
    """Least cost per metre; 0 if nothing moves."""
    moving = speed > 0.0
    return float((rates[moving] / speed[moving]).min()) if moving.any() else 0.0


def _cell(automaton: Automaton, radius: float) -> float:
    """Side of a cell [m]: poses of a lattice must not share one, since each has to be reached."""
    model = automaton.model
    return OF_A_LATTICE * model.resolution if isinstance(model, OnLattice) else CELL * radius

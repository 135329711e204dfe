"""An automaton as the lattice of maneuvers uses it: edges, pieces of motion, sizes."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import OnLattice
from maneuver_automaton.search.maneuver_heights import altitude_ranges
from maneuver_automaton.search.maneuver_motion import (
    CLOSE,
    BodyArrays,
    Part,
    bodies_of,
    body_arrays,
    body_reach,
    carried_twists,
    course_of,
    fastest_of,
    pieces_of,
)
from maneuver_automaton.words.library import Library, LibraryArrays
from maneuver_automaton.words.transitions import SWITCH, transitions_of

QUANTA = (0.17, 0.5)  # lengths of coasts, in length scales
SPIN_QUANTA = (math.pi / 12.0, math.pi / 4.0)  # [rad] of turns on the spot
CELL = 0.122  # side of a cell of the first pass, in length scales
OF_A_LATTICE = (
    0.7  # of its resolution: the diagonal of a cell is shorter than the way between poses
)


class ManeuverArrays(NamedTuple):
    """What the kernels see; edges are maneuvers and switches at will, sorted by source."""

    transfer: LibraryArrays
    n_parts: int
    bodies: BodyArrays
    offsets: Array  # (P, m, 3) of the parts in the trims
    part_twists: Array  # (P, m, 3)
    speeds: Array  # (P, m) [m/s] of the fastest point
    fastest: Array  # (m,) [m/s] over the parts
    quanta: Array  # (m, 2) [s] lengths of coasts, 0 for none
    moves: Array  # (m, 2, 4) poses they lead to
    first_edge: IntArray  # (m + 1,)
    edge_target: IntArray  # (E,)
    edge_shift: Array  # (E, 4)
    edge_cost: Array  # (E,)
    edge_time: Array  # (E,) [s]
    edge_reach: Array  # (E,) [m] that any point of the vehicle moves
    first_piece: IntArray  # ((P + 1) E + 1,) of each part and edge; the last part is the pose
    piece_pose: Array  # (N, 3)
    piece_twist: Array  # (N, 3)
    piece_time: Array  # (N,) [s]
    piece_error: Array  # (N,) [m]
    piece_speed: Array  # (N,) [m/s]
    piece_low: Array  # (N,) [m] altitudes above where the edge begins
    piece_high: Array  # (N,)
    edge_low: Array  # (E,) of all pieces of an edge
    edge_high: Array  # (E,)
    via_edge: IntArray  # (C, C) first edge of a transition between classes, -1 for none
    most_children: int


class ManeuverLibrary(NamedTuple):
    """The arrays with what the wrapper needs beside them."""

    arrays: ManeuverArrays
    transfer: Library
    edge_maneuver: IntArray  # (E,) index in the automaton, -1 for a switch at will
    radius: float  # [m] length scale: the tightest turn, or the size of the body
    cell: float  # [m] side of a cell of the first pass
    turns: float  # radius of the tightest turn, in length scales; 1 for none
    per_metre: float  # least cost per metre
    per_climb: float  # least cost per metre of altitude
    lag: Array  # (C, C) least cost of maneuvers between classes beyond that of their way
    worst_error: float  # [m] of the pose along any piece
    spans: IntArray  # (N, 2) samples of its course between which each piece of a part lies


@functools.lru_cache(maxsize=16)
def maneuver_library(
    transfer: Library, parts: tuple[Part, ...], *, timed: bool, waits: bool
) -> ManeuverLibrary:
    """Everything about an automaton that is the same for every start, goal and map.

    `timed`: something moves, so that it matters when the vehicle is where; `waits`: rest is a trim
    like any other.
    """
    automaton, arrays = transfer.automaton, transfer.arrays
    trim_twists, trim_rates = arrays.twists[: arrays.n_trims], arrays.rates[: arrays.n_trims]
    m = len(automaton)
    edges = _edges(automaton, transfer)
    bodies = bodies_of(parts)
    offsets = np.array([part.trim_poses for part in parts])
    twists = [carried_twists(trim_twists, poses) for poses in offsets]
    speeds = np.array([fastest_of(b, t) for b, t in zip(bodies, twists, strict=True)])
    motion, spans = _motion(automaton, parts, edges, np.array(twists), timed=timed)
    radius = _length_scale(trim_twists, bodies[0].half_width, bodies[0].reach)
    quanta = _quanta(trim_twists, radius, waits=waits)
    counts = np.bincount(edges.source, minlength=m)
    steps = quanta[..., None] * trim_twists[:, None]
    moves = np.concatenate([SE2.exp(steps[..., :3]).pose, steps[..., 3:]], axis=-1)
    speed = np.hypot(trim_twists[:, 0], trim_twists[:, 1])
    lengths = np.array([0.0 if k < 0 else _way(automaton, k) for k in edges.maneuver])
    # where no trim moves, only maneuvers cover ground
    per_metre = _least(trim_rates, speed) if speed.any() else _least(edges.cost, lengths)
    reach = motion.piece_speed * motion.piece_time + 2.0 * motion.piece_error
    per_group = np.add.reduceat(np.append(reach, 0.0), motion.first_piece[:-1])
    per_group = np.where(np.diff(motion.first_piece) > 0, per_group, 0.0)
    pose_rows = motion.first_piece[len(parts) * len(edges.cost)]
    return ManeuverLibrary(
        arrays=ManeuverArrays(
            transfer=arrays,
            n_parts=len(parts),
            bodies=body_arrays(bodies),
            offsets=offsets,
            part_twists=np.array(twists),
            speeds=speeds,
            fastest=speeds.max(axis=0),
            quanta=quanta,
            moves=moves,
            first_edge=np.concatenate([[0], np.cumsum(counts)]),
            edge_target=edges.target,
            edge_shift=edges.shift,
            edge_cost=edges.cost,
            edge_time=edges.time,
            edge_reach=per_group.reshape(len(parts) + 1, -1)[:-1].max(axis=0),
            **motion._asdict(),
            via_edge=_via_edges(transfer, edges),
            most_children=int(counts.max(initial=0)) + quanta.shape[1],
        ),
        transfer=transfer,
        edge_maneuver=edges.maneuver,
        radius=radius,
        cell=_cell(automaton, radius),
        turns=_tightest(trim_twists) / radius if _tightest(trim_twists) else 1.0,
        per_metre=per_metre,
        per_climb=_least(trim_rates, np.abs(trim_twists[:, 3])),
        lag=_lags(transfer, np.maximum(edges.cost - per_metre * lengths, 0.0), edges),
        worst_error=float(motion.piece_error[pose_rows:].max(initial=0.0)),
        spans=spans,
    )


class _Edges(NamedTuple):
    source: IntArray
    target: IntArray
    maneuver: IntArray  # index in the automaton, -1 for a switch at will
    shift: Array
    cost: Array
    time: Array


class _Motion(NamedTuple):
    first_piece: IntArray
    piece_pose: Array
    piece_twist: Array
    piece_time: Array
    piece_error: Array
    piece_speed: Array
    piece_low: Array
    piece_high: Array
    edge_low: Array
    edge_high: Array


def _edges(automaton: Automaton, transfer: Library) -> _Edges:
    """Maneuvers and switches at will, sorted by source, then as the automaton lists them."""
    classes, dof = automaton.trim_classes, automaton.model.group.dof
    rows: list[tuple[int, int, int]] = []
    for k, maneuver in enumerate(automaton.maneuvers):
        i, j = automaton.index_of(maneuver.source), automaton.index_of(maneuver.target)
        rows.append((i, j, k))
    alike = (classes[:, None] == classes[None]) & ~np.eye(len(classes), dtype=np.bool_)
    rows += [(int(i), int(j), -1) for i, j in zip(*np.nonzero(alike), strict=True)]
    rows.sort(key=lambda row: row[0])
    table = np.array(rows, dtype=np.int64).reshape(-1, 3)
    shift = np.zeros((len(rows), 4))
    time = np.zeros(len(rows))
    for e, (_, _, k) in enumerate(rows):
        if k >= 0:
            shift[e, :dof] = automaton.maneuvers[k].displacement
            time[e] = automaton.maneuvers[k].duration
    prices = np.append(transfer.maneuver_costs, 0.0)
    return _Edges(
        source=table[:, 0].copy(),
        target=table[:, 1].copy(),
        maneuver=table[:, 2].copy(),
        shift=shift,
        cost=prices[table[:, 2]],
        time=time,
    )


def _motion(
    automaton: Automaton, parts: Sequence[Part], edges: _Edges, twists: Array, *, timed: bool
) -> tuple[_Motion, IntArray]:
    """Pieces of every part, then of the pose alone, along every edge; samples of the first part."""
    bodies = bodies_of(parts)
    own = carried_twists(automaton.body_velocities, np.zeros((len(automaton), 3)))
    close = CLOSE * min(b.half_width or 0.05 * max(b.reach, 1.0) for b in bodies)
    driven = np.flatnonzero(edges.maneuver >= 0)
    sources, targets = edges.source[driven], edges.target[driven]
    chosen = [automaton.maneuvers[k] for k in edges.maneuver[driven]]
    climbs = automaton.body_velocities[:, 3:].sum(axis=1)
    ends = np.stack([climbs[sources], climbs[targets]], axis=1)
    found, counts, speeds, heights = [], [np.zeros(1, dtype=np.int64)], [], []
    spans: list[IntArray] = []
    for p in range(len(parts) + 1):
        body = bodies[p] if p < len(parts) else None
        table = own if body is None else twists[p]
        courses = []
        for k, maneuver in zip(edges.maneuver[driven], chosen, strict=True):
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
        count = np.zeros(len(edges.source), dtype=np.int64)
        count[driven] = np.diff(pieces.first)
        counts.append(count)
        found.append(pieces)
        flat = np.hypot(pieces.twist[:, 0], pieces.twist[:, 1])
        speeds.append(flat if body is None else fastest_of(body, pieces.twist))
        heights.append(altitude_ranges(chosen, ends, pieces.begin, pieces.end))
    low, high = np.zeros(len(edges.source)), np.zeros(len(edges.source))
    if driven.size:
        low[driven] = np.minimum.reduceat(heights[-1][0], pieces.first[:-1])
        high[driven] = np.maximum.reduceat(heights[-1][1], pieces.first[:-1])
    motion = _Motion(
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


def _via_edges(transfer: Library, edges: _Edges) -> IntArray:
    """Edge (C, C) of the first maneuver of the transition between two classes."""
    edge_of = np.full(len(transfer.maneuver_costs) + 1, -1)
    edge_of[edges.maneuver] = np.arange(len(edges.maneuver))
    edge_of[SWITCH] = -1
    return np.asarray(edge_of[transfer.transitions.first], dtype=np.int64)


def _quanta(twists: Array, radius: float, *, waits: bool) -> Array:
    """Lengths (m, 2) of coasts [s]; none for rest unless it waits, none for what only climbs."""
    speed, turn = np.hypot(twists[:, 0], twists[:, 1]), np.abs(twists[:, 2])
    fastest = max(float(speed.max()), 1e-9)
    columns = []
    for share, angle in zip(QUANTA, SPIN_QUANTA, strict=True):
        with np.errstate(divide="ignore"):
            straight = np.where(speed > 0.0, share * radius / speed, np.inf)
            turning = np.where(turn > 0.0, angle / turn, np.inf)
        t = np.where(speed > 0.1 * turn * radius, straight, turning)
        waiting = share * radius / fastest if waits else 0.0
        still = (speed == 0.0) & (turn == 0.0)
        climbing = share * radius / np.maximum(np.abs(twists[:, 3]), 1e-9)
        t = np.where(still, np.where(twists[:, 3] != 0.0, climbing, waiting), t)
        columns.append(t)
    return np.stack(columns, axis=1)


def _lags(transfer: Library, surplus: Array, edges: _Edges) -> Array:
    """Least surplus (C, C) of chains of maneuvers over the price of the way they make."""
    by_maneuver = np.zeros(len(transfer.maneuver_costs))
    driven = edges.maneuver != SWITCH
    by_maneuver[edges.maneuver[driven]] = surplus[driven]
    return transitions_of(transfer.automaton, by_maneuver).cost


def _way(automaton: Automaton, k: int) -> float:
    """Length of the way of a maneuver [m]."""
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


def _tightest(twists: Array) -> float:
    """Radius of the tightest turn that drives [m]; 0 if none does."""
    speed, turn = np.hypot(twists[:, 0], twists[:, 1]), np.abs(twists[:, 2])
    turns = (turn > 0.0) & (speed > 0.0)
    return float((speed[turns] / turn[turns]).min(initial=np.inf)) if turns.any() else 0.0


def _length_scale(twists: Array, half_width: float, reach: float) -> float:
    """Radius of the tightest turn that drives, at most a few widths of the body."""
    radius, body = _tightest(twists), 4.0 * half_width or 4.0 * reach
    if radius == 0.0:
        return body or 1.0
    return min(max(radius, 0.5 * body), 2.0 * body) if body else radius

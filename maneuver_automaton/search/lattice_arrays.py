"""Trims and maneuvers as the kernels of the lattice see them, whatever the vehicle."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.collision.advancement import swept_areas
from maneuver_automaton.collision.arrays import SweptAreas
from maneuver_automaton.collision.body import Body, body_of
from maneuver_automaton.groups import SE2
from maneuver_automaton.search.part_motion import (
    BodyArrays,
    Part,
    bodies_of,
    body_arrays,
    carried_twists,
    fastest_of,
)
from maneuver_automaton.words.library import Library, LibraryArrays

DURATIONS = (0.17, 0.5)  # of the coasts of edges, in the time a length scale takes
SPINS = (math.pi / 12.0, math.pi / 4.0)  # [rad] of turns on the spot
CELL = 0.122  # side of a cell at the first resolution, in length scales


class LatticeArrays(NamedTuple):
    """Arrays for the kernels of m trims in C classes, E maneuvers between these, and P parts.

    Edges are maneuvers, those out of one class next to each other. A vehicle that changes between
    all its trims at will has one class and no edges.
    """

    library: LibraryArrays  # numbered as `LatticeLibrary.trims` lists them
    n_parts: int
    body: Body  # of the first part
    bodies: BodyArrays
    offsets: Array  # (P, m, 3) of the parts in the trims
    part_twists: Array  # (P, m, 3)
    speeds: Array  # (P, m) [m/s] of the fastest point
    fastest: Array  # (m,) [m/s] over the parts
    edge_durations: Array  # (m, 2) [s] of coasts, 0 for none
    moves: Array  # (m, 2, 4) poses they lead to, forwards or backwards
    swept: SweptAreas  # what the first part covers along them
    first_trim: IntArray  # (C + 1,) where the trims of each class begin ...
    trims_of: IntArray  # (m,) ... in this list
    first_edge: IntArray  # (C + 1,)
    edge_source: IntArray  # (E,) trims
    edge_target: IntArray  # (E,)
    edge_displacement: Array  # (E, 4)
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


@dataclass(frozen=True, eq=False, kw_only=True)
class LatticeLibrary:
    """The arrays, and the values that the wrapper needs beside them."""

    arrays: LatticeArrays
    backwards: LatticeArrays  # the same with coasts that lead against time
    priced: Library  # its trims and maneuvers, with their costs
    parts: tuple[Part, ...]  # rigid parts of the vehicle, posed in these trims
    trims: IntArray  # (m,) their indices in the automaton
    number_of: IntArray  # from the indices in the automaton to these, -1 for none
    edge_maneuver: IntArray  # (E,) index in the automaton
    radius: float  # [m] length scale: the tightest turn, or the size of the body
    cell: float  # [m] side of a cell at the first resolution
    turns: float  # radius of the tightest turn, in length scales; 1 for none
    per_metre: float  # least cost per metre
    per_climb: float  # least cost per metre of altitude
    per_turn: float  # cost of the cheapest full turn
    lag: Array  # (C, C) least cost of maneuvers between classes beyond that of their path
    worst_error: float  # [m] of the pose along any piece
    spans: IntArray  # (N, 2) samples of its course between which each piece of a part lies
    rest: int | None  # index in the automaton of the rest that pads
    rest_rate: float
    interval: tuple[float, float]  # least expansions, for each goal, and most, between connections
    at_will: bool  # whether plans begin and end in any trim, and may end with a turn on the spot
    mirrored: bool  # whether the mirror image of every trim is a trim of the same cost

    @functools.cached_property
    def half_width(self) -> float:
        """Half the width of the narrowest part [m]."""
        return min(body_of(part.shapes).half_width for part in self.parts)

    @functools.cached_property
    def drives(self) -> bool:
        """Whether a trim moves."""
        numbered = self.arrays.library
        return bool(numbered.twists[: numbered.n_trims].any())

    @functools.cached_property
    def lags(self) -> bool:
        """Whether maneuvers between classes cost more than their paths."""
        return bool(self.lag.any())

    @functools.cached_property
    def climbs(self) -> bool:
        """Whether a trim or a maneuver leads up or down."""
        arrays = self.arrays
        return bool(arrays.library.twists[:, 3].any() or arrays.edge_displacement[:, 3].any())

    @functools.cached_property
    def limits_coasts(self) -> bool:
        """Whether a trim has a longest time."""
        numbered = self.arrays.library
        return bool(np.isfinite(numbered.longest[: numbered.n_trims]).any())

    def edges_of(self, maneuvers: IntArray) -> IntArray:
        """Edges of maneuvers of the automaton."""
        order = np.argsort(self.edge_maneuver)
        places = np.searchsorted(self.edge_maneuver, maneuvers, sorter=order)
        return np.asarray(order[places], dtype=np.int64)


class EdgeArrays(NamedTuple):
    """Maneuvers between classes of trims, those out of one class next to each other."""

    source: IntArray  # (E,) trims
    target: IntArray
    maneuver: IntArray  # (E,) index in the automaton
    displacement: Array  # (E, 4)
    cost: Array
    time: Array


class MotionArrays(NamedTuple):
    """Pieces of constant twist of every part, then of the pose alone, along every edge."""

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


def lattice_arrays(
    library: LibraryArrays,
    parts: Sequence[Part],
    edges: EdgeArrays,
    motion: MotionArrays,
    *,
    edge_durations: Array,
    via_edge: IntArray,
) -> LatticeArrays:
    """The arrays of trims (m) with the maneuvers between their classes.

    `edge_durations` (m, 2) [s] of the coasts of each trim, `via_edge` (C, C) the first edge of the
    transition between two classes; the parts are those of the trims of the library, in its order.
    """
    m, n_classes = library.n_trims, len(library.transitions.cost)
    classes = library.class_of[:m]
    twists = library.twists[:m]
    bodies = bodies_of(parts)
    offsets = np.array([part.trim_poses for part in parts])
    part_twists = np.array([carried_twists(twists, poses) for poses in offsets])
    speeds = np.array([fastest_of(b, t) for b, t in zip(bodies, part_twists, strict=True)])
    edges_of = np.bincount(classes[edges.source], minlength=n_classes)
    coasts = np.bincount(classes, minlength=n_classes)
    children = coasts * edge_durations.shape[1] + edges_of
    return LatticeArrays(
        library=library,
        n_parts=len(parts),
        body=bodies[0],
        bodies=body_arrays(bodies),
        offsets=offsets,
        part_twists=part_twists,
        speeds=speeds,
        fastest=speeds.max(axis=0),
        edge_durations=edge_durations,
        **coasts_of(twists, edge_durations, bodies[0])._asdict(),
        first_trim=np.concatenate([[0], np.cumsum(coasts)]),
        trims_of=np.argsort(classes, kind="stable"),
        first_edge=np.concatenate([[0], np.cumsum(edges_of)]),
        edge_source=edges.source,
        edge_target=edges.target,
        edge_displacement=edges.displacement,
        edge_cost=edges.cost,
        edge_time=edges.time,
        edge_reach=_reaches(motion, len(parts)),
        **motion._asdict(),
        via_edge=via_edge,
        most_children=int(children.max(initial=0)),
    )


class Coasts(NamedTuple):
    """Where coasts lead from the identity, and what the first part covers along them."""

    moves: Array  # (m, k, 4)
    swept: SweptAreas


def coasts_of(twists: Array, durations: Array, body: Body) -> Coasts:
    """Coasts by twists (m, 4) for durations (m, k) [s], negative ones backwards."""
    steps = durations[..., None] * twists[:, None, :]
    moves = np.concatenate([SE2.exp(steps[..., :3]).pose, steps[..., 3:]], axis=-1)
    return Coasts(moves, swept_areas(body, twists, durations))


def edge_durations_of(twists: Array, radius: float, *, waits: bool) -> Array:
    """Coasting times (m, 2) of edges [s]; none for rest unless it waits.

    A trim that moves makes a share of the length scale, one that turns on the spot a share of a
    turn; one that only climbs, or rests, goes on for as long as the fastest takes for its share.
    """
    speed, turn = np.hypot(twists[:, 0], twists[:, 1]), np.abs(twists[:, 2])
    fastest = max(float(speed.max(initial=0.0)), 1e-9)
    columns = []
    for share, angle in zip(DURATIONS, SPINS, strict=True):
        with np.errstate(divide="ignore"):
            straight = np.where(speed > 0.0, share * radius / speed, np.inf)
            turning = np.where(turn > 0.0, angle / turn, np.inf)
        t = np.where(speed > 0.1 * turn * radius, straight, turning)
        waiting = share * radius / fastest if waits else 0.0
        still = (speed == 0.0) & (turn == 0.0)
        climbing = share * radius / np.maximum(np.abs(twists[:, 3]), 1e-9)
        columns.append(np.where(still, np.where(twists[:, 3] != 0.0, climbing, waiting), t))
    return np.stack(columns, axis=1)


def tightest_turn(twists: Array) -> float:
    """Radius of the tightest turn that drives [m]; 0 if none does."""
    speed, turn = np.hypot(twists[:, 0], twists[:, 1]), np.abs(twists[:, 2])
    turns = (turn > 0.0) & (speed > 0.0)
    return float((speed[turns] / turn[turns]).min()) if turns.any() else 0.0


def length_scale(twists: Array, body: Body, *, wide: bool) -> float:
    """Radius of the tightest turn that drives; a few widths of the body where there is none.

    Unless turns may be `wide`, it is at most that: a vehicle that can turn without driving a
    circle decides on the scale of its body.
    """
    radius, size = tightest_turn(twists), 4.0 * body.half_width or 4.0 * body.reach
    if radius == 0.0:
        return size or 1.0
    radius = max(radius, 0.5 * size)
    return min(radius, 2.0 * size) if size and not wide else radius


def _reaches(motion: MotionArrays, n_parts: int) -> Array:
    """How far any point of the vehicle moves along each edge (E,) [m]."""
    reach = motion.piece_speed * motion.piece_time + 2.0 * motion.piece_error
    groups = np.diff(motion.first_piece)
    if not groups.size:
        return np.zeros(0)
    sums = np.add.reduceat(np.append(reach, 0.0), motion.first_piece[:-1])
    sums = np.where(groups > 0, sums, 0.0)
    return np.asarray(sums.reshape(n_parts + 1, -1)[:-1].max(axis=0))

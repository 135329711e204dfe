"""The trims of a problem as the lattice uses them: edges, triples for steering, sizes."""

from __future__ import annotations

import functools
import itertools
import math
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.collision import Shape
from maneuver_automaton.collision.body import body_of, fastest_points
from maneuver_automaton.costs import StageCost
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Problem
from maneuver_automaton.words.library import (
    NO_TRIM,
    STRAIGHT,
    LibraryArrays,
    four_columns,
    library_arrays,
    moving_trims,
)
from maneuver_automaton.words.transitions import identities

MOST_TRIMS = 10  # of a larger library the most useful ones
QUANTA = (0.17, 0.5)  # lengths of the edges, in turning radii
SPIN_QUANTA = (math.pi / 12.0, math.pi / 4.0)  # [rad] of turns on the spot


class LatticeArrays(NamedTuple):
    """What the kernels see of the m trims that a lattice is made of."""

    library: LibraryArrays  # numbered as `LatticeLibrary.trims` lists them
    speeds: Array  # (m + 1,) [m/s] of the fastest point of the body
    quanta: Array  # (m, 2) [s] lengths of the edges, 0 for none
    moves: Array  # (m, 2, 3) poses they lead to, forwards or backwards


class LatticeLibrary(NamedTuple):
    """The arrays with what the wrapper needs beside them."""

    arrays: LatticeArrays
    trims: IntArray  # (m,) their indices in the automaton
    number_of: IntArray  # from the indices in the automaton to these, -1 for none
    radius: float  # [m] length scale: the tightest turn, or the size of the body
    per_metre: float  # least cost per metre
    per_turn: float  # cost of the cheapest full turn
    rest: int | None  # index in the automaton of the rest that pads
    rest_rate: float
    mirrored: bool  # whether the mirror image of every trim is a trim of the same cost


def lattice_library(problem: Problem) -> LatticeLibrary:
    """The part of a lattice search that is the same for every start, goal and map."""
    horizon = problem.horizon
    return _library(
        problem.automaton,
        problem.cost,
        problem.footprint,
        fixed_time=horizon.time is not None,
        waits=problem.moves,
        min_coast=horizon.min_coast,
    )


@functools.lru_cache(maxsize=16)
def _library(
    automaton: Automaton,
    cost: StageCost,
    footprint: tuple[Shape, ...],
    *,
    fixed_time: bool,
    waits: bool,
    min_coast: float,
) -> LatticeLibrary:
    library = moving_trims(automaton, cost)
    body = body_of(footprint)
    pads = fixed_time and library.rest is not None
    rates = library.rates - (library.rest_rate if pads else 0.0)
    chosen = _most_useful(library.twists, rates)
    trims = library.trims[chosen]
    twists, rates = library.twists[chosen, :3], rates[chosen]
    twists[np.abs(twists[:, 2]) < STRAIGHT, 2] = 0.0
    radius = _length_scale(twists, body.half_width, body.reach)
    if waits and library.rest is not None:
        trims = np.append(trims, library.rest)
        twists = np.vstack([twists, np.zeros(3)])
        rates = np.append(rates, 0.0 if pads else library.rest_rate)
    still = ~twists.any(axis=1)
    speed = np.hypot(twists[:, 0], twists[:, 1])
    moving = np.flatnonzero(~still)
    quanta = np.zeros((len(trims), 2))
    for k, share in enumerate(QUANTA):
        with np.errstate(divide="ignore", invalid="ignore"):
            straight = np.where(speed > 0.0, share * radius / speed, np.inf)
            turning = np.where(twists[:, 2] != 0.0, SPIN_QUANTA[k] / np.abs(twists[:, 2]), np.inf)
        quanta[:, k] = np.where(speed > 0.1 * np.abs(twists[:, 2]) * radius, straight, turning)
        if still.any():
            quanta[still, k] = share * radius / max(float(speed.max()), 1e-9)
    quanta = np.maximum(quanta, min_coast)
    with np.errstate(divide="ignore", invalid="ignore"):
        per_metre = np.where(speed > 0.0, rates / speed, np.inf)
        per_radian = np.where(twists[:, 2] != 0.0, rates / np.abs(twists[:, 2]), np.inf)
    m = len(trims)
    prices = (getattr(cost, "switch", 0.0), getattr(cost, "direction_change", 0.0))
    arrays = LatticeArrays(
        library=library_arrays(
            four_columns(twists), rates, identities(automaton), trims=trims
        )._replace(
            words=_words(moving, twists),
            free_words=np.array(
                [(i, j, m) for i, j in itertools.permutations(moving.tolist(), 2)]
                or [(int(i), int(i), m) for i in moving],
                dtype=np.int64,
            ).reshape(-1, 3),
            switch=float(prices[0]),
            direction_change=float(prices[1]),
            min_coast=float(min_coast),
        ),
        speeds=np.append(fastest_points(body, twists), 0.0),
        quanta=quanta,
        moves=moves_of(twists, quanta),
    )
    best = float(per_radian.min())
    number_of = np.full(len(automaton), NO_TRIM)
    number_of[trims] = np.arange(m)
    return LatticeLibrary(
        arrays=arrays,
        trims=np.asarray(trims, dtype=np.int64),
        number_of=np.asarray(number_of, dtype=np.int64),
        radius=radius,
        per_metre=float(per_metre.min()) if np.isfinite(per_metre.min()) else 0.0,
        per_turn=2.0 * math.pi * best if math.isfinite(best) else 0.0,
        rest=library.rest,
        rest_rate=library.rest_rate if pads else 0.0,
        mirrored=_mirrored(twists, rates),
    )


def moves_of(twists: Array, durations: Array) -> Array:
    """Poses (m, k, 3) reached from the identity by twists (m, 3) after durations (m, k) [s]."""
    return SE2.exp(durations[..., None] * twists[:, None, :]).pose


def _words(moving: IntArray, twists: Array) -> IntArray:
    """Words of three trims whose neighbours differ; of fewer where there are fewer trims.

    Where no trim turns, three times are more than a place asks for, and the times of a triple are
    not determined: two trims that lead to different sides are enough. They are followed by none.
    """
    every = moving.tolist()
    if len(every) > 1 and not twists[:, 2].any():
        return np.array(
            [(i, j, NO_TRIM) for i, j in itertools.permutations(every, 2)], dtype=np.int64
        )
    words = [(i, j, k) for i, j, k in itertools.product(every, repeat=3) if i != j and j != k] or [
        (i, i, i) for i in every
    ]
    return np.array(words, dtype=np.int64).reshape(-1, 3)


def _length_scale(twists: Array, half_width: float, reach: float) -> float:
    """Radius of the tightest turn that drives; a few widths of the body where there is none.

    Where the vehicle can turn on the spot, gentle turns need not set the scale.
    """
    speed = np.hypot(twists[:, 0], twists[:, 1])
    turns = (np.abs(twists[:, 2]) > 0.0) & (speed > 0.0)
    body = 4.0 * half_width or 4.0 * reach
    if not turns.any():
        return body or 1.0
    radius = max(float((speed[turns] / np.abs(twists[turns, 2])).min()), 0.5 * body)
    spins = bool(((speed == 0.0) & (twists[:, 2] != 0.0)).any())
    return min(radius, 2.0 * body) if spins and body else radius


def _most_useful(twists: Array, rates: Array) -> IntArray:
    """All trims of a small library; of a large one straight, sharp and middling turns, and spins.

    For each kind the cheapest for the way or the turn it makes, and the fastest.
    """
    n = len(twists)
    if n <= MOST_TRIMS:
        return np.arange(n)
    speed = np.hypot(twists[:, 0], twists[:, 1])
    turn = twists[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        curvature = np.where(speed > 0.0, turn / speed, 0.0)
    drives = speed > 0.0
    sharpest = float(np.abs(curvature[drives]).max()) if drives.any() else 0.0
    kinds = []
    for gear in (1.0, -1.0):
        going = drives & (np.sign(twists[:, 0]) == gear)
        kinds += [going & (curvature == 0.0)]
        for side in (1.0, -1.0):
            turning = going & (np.sign(curvature) == side)
            gentle = turning & (np.abs(curvature) <= 0.3 * min(sharpest, 4.0))
            kinds += [turning & ~gentle, gentle]
    for side in (1.0, -1.0):
        kinds.append(~drives & (np.sign(turn) == side))
        kinds.append((twists[:, 0] == 0.0) & (np.sign(twists[:, 1]) == side) & (turn == 0.0))
    chosen: list[int] = []
    amount = np.where(drives, speed, np.abs(turn))
    for kind in kinds:
        members = np.flatnonzero(kind)
        if not members.size:
            continue
        price = rates[members] / amount[members]
        order = np.lexsort((-amount[members], np.round(price, 9)))
        chosen.append(int(members[order[0]]))
    fastest = int(np.argmax(np.where(turn == 0.0, speed, -1.0)))
    chosen.append(fastest)
    return np.array(sorted(set(chosen)), dtype=np.int64)


def _mirrored(twists: Array, rates: Array) -> bool:
    """Whether the library and its prices are their own mirror image."""
    rows = np.column_stack([twists, rates])
    image = rows * np.array([1.0, -1.0, -1.0, 1.0])
    order = np.lexsort(np.round(rows, 9).T)
    return bool(np.allclose(rows[order], image[np.lexsort(np.round(image + 0.0, 9).T)]))

"""The trims of a problem as the lattice uses them: edges, triples for steering, sizes."""

from __future__ import annotations

import functools
import itertools
import math

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.collision import Shape
from maneuver_automaton.collision.body import body_of
from maneuver_automaton.costs import StageCost
from maneuver_automaton.problem import Problem
from maneuver_automaton.search.lattice_arrays import (
    CELL,
    LatticeLibrary,
    edge_durations_of,
    lattice_arrays,
    length_scale,
    no_edges,
    tightest_turn,
)
from maneuver_automaton.search.maneuver_motion import Part
from maneuver_automaton.words.library import (
    NO_TRIM,
    STRAIGHT,
    four_columns,
    library_arrays,
    moving_trims,
)
from maneuver_automaton.words.transitions import identities

MOST_TRIMS = 10  # of a larger library the most useful ones


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
    spins = bool((~twists[:, :2].any(axis=1) & (twists[:, 2] != 0.0)).any())
    radius = length_scale(twists, body, wide=not spins)
    if waits and library.rest is not None:
        trims = np.append(trims, library.rest)
        twists = np.vstack([twists, np.zeros(3)])
        rates = np.append(rates, 0.0 if pads else library.rest_rate)
    speed = np.hypot(twists[:, 0], twists[:, 1])
    moving = np.flatnonzero(twists.any(axis=1))
    edge_durations = edge_durations_of(four_columns(twists), radius, waits=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        per_metre = np.where(speed > 0.0, rates / speed, np.inf)
        per_radian = np.where(twists[:, 2] != 0.0, rates / np.abs(twists[:, 2]), np.inf)
    m = len(trims)
    words = _words(moving, twists)
    numbered = library_arrays(four_columns(twists), rates, identities(automaton), trims=trims)
    numbered = numbered._replace(
        words=words,
        n_few=len(words),
        free_words=np.array(
            [(i, j, m) for i, j in itertools.permutations(moving.tolist(), 2)]
            or [(int(i), int(i), m) for i in moving],
            dtype=np.int64,
        ).reshape(-1, 3),
        switch=float(getattr(cost, "switch", 0.0)),
        direction_change=float(getattr(cost, "direction_change", 0.0)),
        min_coast=float(min_coast),
    )
    part = Part(shapes=footprint, trim_poses=np.zeros((m, 3)), course_poses=())
    edges, motion = no_edges()
    arrays = lattice_arrays(
        numbered,
        (part,),
        edges,
        motion,
        edge_durations=np.maximum(edge_durations, min_coast),
        via_edge=np.full((1, 1), -1),
    )
    best = float(per_radian.min())
    number_of = np.full(len(automaton), NO_TRIM)
    number_of[trims] = np.arange(m)
    return LatticeLibrary(
        arrays=arrays,
        trims=np.asarray(trims, dtype=np.int64),
        number_of=np.asarray(number_of, dtype=np.int64),
        edge_maneuver=edges.maneuver,
        radius=radius,
        cell=CELL * radius,
        turns=tightest_turn(twists) / radius or 1.0,
        per_metre=float(per_metre.min()) if np.isfinite(per_metre.min()) else 0.0,
        per_climb=0.0,
        per_turn=2.0 * math.pi * best if math.isfinite(best) else 0.0,
        lag=np.zeros((1, 1)),
        worst_error=0.0,
        spans=np.zeros((0, 2), dtype=np.int64),
        rest=library.rest,
        rest_rate=library.rest_rate if pads else 0.0,
        mirrored=_mirrored(twists, rates),
    )


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

"""Trims and words that a search of the lattice uses, with their costs."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.costs import StageCost, terms_of
from maneuver_automaton.problem import Problem
from maneuver_automaton.search.word_setup import maneuver_prices
from maneuver_automaton.words.library import (
    NO_TRIM,
    STRAIGHT,
    Library,
    LibraryArrays,
    four_columns,
    identities,
    library_arrays,
    library_of,
    moving_trims,
    with_words,
)

MOST_TRIMS = 10  # moving; of a larger library a few stand for all where the lattice is searched
MOST_SAVING = 16  # the same where switches are saved: chattering between a few is no substitute
TURN = 4.0  # length scales that a full turn is taken for, whose radius the speed decides
WORDS_AN_EXPANSION = 150.0  # words of a connection that take as long as an expansion
MOST_INTERVAL = 400.0  # expansions between two connections that are tried


class PricedTrims(NamedTuple):
    """Trims with their prices and words, and how they are switched."""

    library: Library
    wide: bool  # whether the vehicle turns by driving circles only, however wide
    per_turn: float | None  # cost of the cheapest full turn; None: it takes length scales
    rest: int | None  # index in the automaton of the cheapest rest, if it pads a fixed time
    rest_rate: float  # taken off all rates, since rest pads a fixed time
    interval: tuple[float, float]  # least expansions, for each goal, and most, between connections


class Chosen(NamedTuple):
    """Trims of a large library that a search uses, by their indices in the automaton."""

    words: tuple[int, ...]  # that words of connections are made of
    others: tuple[int, ...] = ()  # that a known word has beside them


class Times(NamedTuple):
    """What a problem asks of the times of trims, as far as the trims taken depend on it."""

    fixed: bool  # in all: rest pads it
    waits: bool  # rest is a trim like any other, since obstacles move
    min_coast: float  # [s]
    limited: bool  # in all: the fastest trims of a large library are taken
    saving: bool  # one trim is worth more than two that do the same by turns: more are taken


def trims_at_will(
    automaton: Automaton, cost: StageCost, times: Times, choice: Chosen | None
) -> PricedTrims:
    """The most useful trims in the plane of a vehicle that switches at will between all.

    A `choice` says which are taken instead.
    """
    known = moving_trims(automaton, cost)
    pads = times.fixed and known.rest is not None
    rates = known.rates - (known.rest_rate if pads else 0.0)
    if choice is not None:
        chosen = np.flatnonzero(np.isin(known.trims, choice.words + choice.others))
    elif len(known.trims) <= (MOST_SAVING if times.saving else MOST_TRIMS):
        chosen = np.arange(len(known.trims))
    else:
        paid = np.ones(len(rates)) if times.limited else rates
        chosen = coarse_trims(known.twists, paid, directions=DENSE if times.saving else DIRECTIONS)
    trims = known.trims[chosen]
    twists, rates = known.twists[chosen, :3], rates[chosen]
    twists[np.abs(twists[:, 2]) < STRAIGHT, 2] = 0.0
    spins = bool((~twists[:, :2].any(axis=1) & (twists[:, 2] != 0.0)).any())
    if times.waits and known.rest is not None:
        trims = np.append(trims, known.rest)
        twists = np.vstack([twists, np.zeros(3)])
        rates = np.append(rates, 0.0 if pads else known.rest_rate)
    moving, m = np.flatnonzero(twists.any(axis=1)), len(trims)
    if choice is not None:
        moving = moving[np.isin(trims[moving], choice.words)]
    words = _words(moving, twists)
    pairs = [(i, j, m) for i, j in itertools.permutations(moving.tolist(), 2)]
    pairs = pairs or [(int(i), int(i), m) for i in moving]
    arrays = library_arrays(four_columns(twists), rates, identities(automaton), trims=trims)
    with np.errstate(divide="ignore", invalid="ignore"):
        per_radian = np.where(twists[:, 2] != 0.0, rates / np.abs(twists[:, 2]), np.inf)
    best = float(per_radian.min(initial=math.inf))
    return PricedTrims(
        library=Library(
            automaton=automaton,
            trims=np.asarray(trims, dtype=np.int64),
            transitions=identities(automaton),
            maneuver_costs=np.zeros(0),
            arrays=with_words(
                _with_prices(arrays, cost)._replace(min_coast=times.min_coast),
                words,
                len(words),
                np.array(pairs, dtype=np.int64).reshape(-1, 3),
            ),
        ),
        wide=not spins,
        per_turn=2.0 * math.pi * best if math.isfinite(best) else 0.0,
        rest=known.rest,
        rest_rate=known.rest_rate if pads else 0.0,
        interval=(0.0, math.inf),
    )


def switched_in_plane(automaton: Automaton) -> bool:
    """Whether trims are combined at will, and move the vehicle in a plane."""
    return automaton.is_kinematic and automaton.model.group.dof == 3


def stands_for_more(problem: Problem) -> bool:
    """Whether a few trims stand for all where trims are switched at will in the plane."""
    automaton = problem.automaton
    letters = moving_trims(automaton, problem.cost).trims if switched_in_plane(automaton) else ()
    return len(letters) > MOST_TRIMS


def trims_of(library: Library, cost: StageCost) -> PricedTrims:
    """All trims of an automaton, whatever leads from one to the other.

    Where maneuvers do, each has the price of the switch to it and of those within it; a switch to a
    coast, and a change of direction between two maneuvers, are left to whoever compares plans.
    """
    rest = None
    if library.automaton.is_kinematic:
        rest = library.automaton.rest
        library = replace(library, arrays=_with_prices(library.arrays, cost))
    return PricedTrims(
        library=library,
        wide=False,
        per_turn=None,
        rest=rest,
        rest_rate=0.0,
        interval=(library.arrays.tried.n_few / WORDS_AN_EXPANSION, MOST_INTERVAL),
    )


def _with_prices(arrays: LibraryArrays, cost: StageCost) -> LibraryArrays:
    """The arrays with the prices of a switch and of a change of direction."""
    terms = terms_of(cost)
    return arrays._replace(
        switch=terms.switch if terms else 0.0,
        direction_change=terms.direction_change if terms else 0.0,
    )


def priced_library(automaton: Automaton, cost: StageCost) -> Library:
    """All trims and maneuvers of an automaton, priced by a cost: a maneuver with its switches."""
    rates = cost.rates(automaton.controls, automaton.body_velocities)
    return library_of(automaton, rates=rates, maneuver_costs=maneuver_prices(automaton, cost))


def is_mirrored(twists: Array, rates: Array) -> bool:
    """Whether trims and their prices are their own mirror image."""
    rows = np.column_stack([twists, rates])
    image = rows * np.array([1.0, -1.0, -1.0, 1.0])
    order = np.lexsort(np.round(rows, 9).T)
    return bool(np.allclose(rows[order], image[np.lexsort(np.round(image + 0.0, 9).T)]))


def _words(moving: IntArray, twists: Array) -> IntArray:
    """Words of three trims whose neighbours differ; of two where none turns, which are enough."""
    # Two trims along one path are no neighbours: one of them does what both do.
    every = moving.tolist()
    if len(every) > 1 and not twists[:, 2].any():
        return np.array(
            [(i, j, NO_TRIM) for i, j in itertools.permutations(every, 2)], dtype=np.int64
        )
    across = np.linalg.norm(np.cross(twists[:, None], twists), axis=-1)
    apart = across > STRAIGHT * np.multiply.outer(*[np.linalg.norm(twists, axis=1)] * 2)
    words = [
        (i, j, k) for i, j, k in itertools.product(every, repeat=3) if apart[i, j] and apart[j, k]
    ] or [(i, i, i) for i in every]
    return np.array(words, dtype=np.int64).reshape(-1, 3)


DIRECTIONS = 8  # straight, on the spot, and between the two, with both signs
DENSE = 16  # and between these, where the nearest trim stands for a direction
NEAR = 0.03  # [rad] from a direction, within which the cheapest trim stands for it
COVERED = 0.8  # share of what the farthest trim reaches in a direction that a few have to reach
CORNER, MOST_CORNERS = 0.9, 20  # the same in the own direction of each trim, and while so few
LOOKS = 720  # directions in which the trims that pay are looked for
SAME_PATH = 1e-12  # of the cosine between two twists that lead along one path
PACES, STEPS = 8, 128  # prices of time that double, and how many are tried on either side
PAYS = 1e-6  # relative price above the least one that counts as the least


def coarse_trims(twists: Array, rates: Array, *, directions: int = DIRECTIONS) -> IntArray:
    """Rows of the few trims that reach far: straight, sharpest and on the spot, each at its best.

    In the plane of speed and turn rate, each divided by its greatest, some directions are taken;
    for each the trim that is the cheapest for what it covers, of equal ones the nearest to the
    direction, then the fastest; where nothing turns on the spot, the sharpest turns; last what gets
    far for its cost, aside as well, where none of these does, in its own direction too. Rates (m,)
    are costs per second.
    """
    within = NEAR if directions == DIRECTIONS else math.pi / directions
    ahead = np.abs(twists[:, 1]) <= np.abs(twists[:, 0])
    along = np.flatnonzero(ahead) if ahead.any() else np.arange(len(twists))
    chosen: list[int] = []
    plane = _plane(twists[along])
    angles, sizes = np.arctan2(plane[:, 1], plane[:, 0]), np.hypot(*plane.T)
    for angle in np.arange(directions) * (2.0 * math.pi / directions):
        off = np.abs(np.remainder(angles - angle + math.pi, 2.0 * math.pi) - math.pi)
        off[sizes == 0.0] = math.inf
        near = np.flatnonzero(off <= min(max(float(off.min()), NEAR), within))
        covered = plane @ np.array([math.cos(angle), math.sin(angle)])
        chosen += _cheapest(along, near, rates[along], covered, off)
    drives = (plane[:, 0] != 0.0) & (plane[:, 1] != 0.0)
    if not ((plane[:, 0] == 0.0) & (plane[:, 1] != 0.0)).any() and drives.any():
        sharp = np.where(drives, np.abs(plane[:, 1]) / np.abs(plane[:, 0]).clip(min=1e-300), 0.0)
        for gear, side in itertools.product((1.0, -1.0), repeat=2):
            turning = drives & (plane[:, 0] * gear > 0.0) & (plane[:, 1] * gear * side > 0.0)
            most = float(sharp[turning].max(initial=0.0))
            sharpest = np.flatnonzero(turning & (sharp >= most * (1.0 - 1e-9)))
            chosen += _cheapest(along, sharpest, rates[along], np.abs(plane[:, 0]), -sizes)
    reach = twists[:, :3] / np.abs(twists[:, :3]).max(axis=0).clip(min=1e-300)
    reach /= rates[:, None].clip(min=1e-300)
    for direction in sorted(itertools.product((-1.0, 0.0, 1.0), repeat=3), key=np.count_nonzero):
        covered = reach @ np.array(direction)
        if covered[chosen].max(initial=0.0) < COVERED * covered.max():
            farthest = covered >= covered.max() * (1.0 - 1e-9)
            sizes = np.where(farthest, np.abs(reach).sum(axis=1), math.inf)
            chosen += np.flatnonzero(sizes <= sizes.min() * (1.0 + 1e-9)).tolist()
    reach /= np.abs(reach).max()
    sizes = np.sum(reach * reach, axis=1)
    while len(set(chosen)) < MOST_CORNERS:
        spare = (reach[chosen] @ reach.T).max(axis=0) - CORNER * sizes
        if spare.min() >= 0.0:
            break
        chosen.append(int(spare.argmin()))
    return np.array(sorted(set(chosen)), dtype=np.int64)


def paying_trims(twists: Array, rates: Array) -> IntArray:
    """Rows of the trims that some prices make pay where no other trim would pay more.

    A trim of twist x and rate r pays at the momentum p where ``r + <p, x> < 0``, so where
    ``<p, x / r> < -1``. If it does, a corner of the convex hull of all ``x / r`` pays, too: only
    trims on the hull need be priced. They are found by looking in many directions, so that of many
    corners next to each other some may be left out. A trim that costs nothing always counts.

    Source: support functions; Boyd, Vandenberghe (2004), *Convex Optimization*, Sec. 2.5.2.
    """
    if twists[:, 1].any() or twists[:, 3:].any() or not (rates > 0.0).all():
        return np.arange(len(twists))
    reach = _plane(twists) / rates[:, None]
    angles = np.arange(LOOKS) * (2.0 * math.pi / LOOKS)
    seen = reach @ np.stack([np.cos(angles), np.sin(angles)])
    least = seen.max(axis=0)
    pays = (seen >= least - PAYS * np.abs(least)).any(axis=1)
    return np.flatnonzero(pays)


def _plane(twists: Array) -> Array:
    """Speed and turn rate (m, 2), each divided by the greatest."""
    plane = twists[:, [0, 2]]
    return np.asarray(plane / np.abs(plane).max(axis=0, initial=0.0).clip(min=1e-300))


def _cheapest(
    along: IntArray, members: IntArray, rates: Array, covered: Array, off: Array
) -> list[int]:
    """The cheapest of some trims for what it covers, then the least `off`, then the fastest."""
    if not members.size:
        return []
    with np.errstate(divide="ignore"):
        price = np.round(rates[members] / covered[members], 9)
    order = np.lexsort((-covered[members], np.round(off[members], 9), price))
    return [int(along[members[order[0]]])]


def paced_trims(
    twists: Array, rates: Array, word: IntArray, durations: Array, most_time: float
) -> tuple[IntArray, IntArray]:
    """Rows of the few trims at the two paces that suit a word which may last so long.

    Time gets a price. The costlier it is, the faster are the `coarse_trims`; so there is a least
    one at which the word, driven by those of its own directions, ends in time. The trims for the
    step below, and those for it: between the two paces words fill the time. `word` (n,) are the
    rows of the trims of a word that ends in time.
    """
    plane = _plane(twists)
    sizes = np.hypot(*plane.T)
    covered = sizes[word] * durations
    scale = float(rates.max())

    def chosen(step: int) -> IntArray:
        return coarse_trims(twists, rates + scale * 2.0 ** (step / PACES))

    def lasts(rows: IntArray) -> float:
        return float(covered @ (1.0 / sizes[nearest_trims(twists, word, rows)]))

    slow, fast = -STEPS, STEPS
    if lasts(chosen(slow)) <= most_time:
        return chosen(slow), chosen(slow)
    while fast - slow > 1:
        middle = (slow + fast) // 2
        late = lasts(chosen(middle)) > most_time
        slow, fast = (middle, fast) if late else (slow, middle)
    return chosen(slow), chosen(fast)


def nearest_trims(twists: Array, word: IntArray, rows: IntArray) -> IntArray:
    """For each trim (n,) of a word the one of `rows` that leads in the most similar direction."""
    plane = _plane(twists)
    angles = np.arctan2(plane[:, 1], plane[:, 0])
    off = angles[word][:, None] - angles[rows]
    off = np.abs(np.remainder(off + math.pi, 2.0 * math.pi) - math.pi)
    return np.asarray(rows[off.argmin(axis=1)], dtype=np.int64)


def at_two_paces(
    twists: Array,
    word: IntArray,
    durations: Array,
    paces: tuple[IntArray, IntArray],
    most_time: float,
) -> list[tuple[int, float]] | None:
    """A word driven along its path at a slow and a fast pace so that it lasts so long at most.

    Slow ahead as long as the time allows, then fast. Rows of trims and how long they last [s]; None
    where no trim of a pace leads along the path of one of the word, or the fast ones are too slow.
    `word` (n,) and the two `paces` (k,), the slow one first, are rows of trims.
    """
    size = np.linalg.norm(twists, axis=1)
    slow, fast = (nearest_trims(twists, word, rows) for rows in paces)
    for rows in (slow, fast):
        along = (twists[rows] * twists[word]).sum(axis=1)
        if (along < size[rows] * size[word] * (1.0 - SAME_PATH)).any():
            return None
    slowly, quickly = (durations * size[word] / size[rows] for rows in (slow, fast))
    spare = most_time - float(quickly.sum())
    if spare < 0.0:
        return None
    driven: list[tuple[int, float]] = []
    for k in range(len(word)):
        later = float(slowly[k] - quickly[k])
        share = 1.0 if later <= spare else spare / later
        spare = max(spare - share * later, 0.0)
        steps = ((slow[k], share * slowly[k]), (fast[k], (1.0 - share) * quickly[k]))
        driven += [(int(row), float(t)) for row, t in steps if t > 0.0]
    return driven

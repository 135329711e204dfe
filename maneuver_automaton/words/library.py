"""The library of a search: trims with their prices, the transitions between them, and the words.

Everything here is the same for every start, goal and map: symmetry makes it reusable. Trims of one
class switch at will, so what leads from trim to trim depends on their classes alone: a kinematic
vehicle has one class, whose only transition is the identity, however many trims it has.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, IntArray, as_array
from maneuver_automaton._kept import kept_by_first
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.costs import StageCost

SWITCH = -1  # the maneuver of a switch at will: the identity
HOP = 1e-9  # of the costliest maneuver: of equally cheap chains the one with the fewest maneuvers


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Transitions:
    """The cheapest chain of maneuvers between any two of C classes of trims."""

    class_of: IntArray  # (m,) of the automaton's trims
    displacement: Array  # (C, C, 4) a planar one has no height
    cost: Array  # (C, C) of the maneuvers, inf where no chain leads
    time: Array  # (C, C) [s]
    first: IntArray  # (C, C) first maneuver of the chain, -1 where there is none
    sources: IntArray  # (M,) trim before each maneuver
    targets: IntArray  # (M,) and after it

    def chain(self, source: int, target: int) -> tuple[tuple[int, int], ...]:
        """What leads from trim to trim: each (maneuver, trim it leads to), SWITCH for a switch."""
        links: list[tuple[int, int]] = []
        while self.class_of[source] != self.class_of[target]:
            maneuver = int(self.first[self.class_of[source], self.class_of[target]])
            if maneuver < 0:
                raise ValueError(f"no maneuvers lead from trim {source} to trim {target}")
            if self.sources[maneuver] != source:
                links.append((SWITCH, int(self.sources[maneuver])))
            source = int(self.targets[maneuver])
            links.append((maneuver, source))
        if source != target:
            links.append((SWITCH, target))
        return tuple(links)


def transitions_of(automaton: Automaton, prices: Array) -> Transitions:
    """The transitions of an automaton whose maneuvers cost `prices` (M,)."""
    sources = np.array([automaton.index_of(one.source) for one in automaton.maneuvers], dtype=int)
    targets = np.array([automaton.index_of(one.target) for one in automaton.maneuvers], dtype=int)
    class_of = automaton.trim_classes
    n = int(class_of.max()) + 1
    first = _firsts(n, class_of[sources], class_of[targets], prices)
    gained, lasting = np.zeros((len(prices), 4)), np.zeros(len(prices))
    for k, maneuver in enumerate(automaton.maneuvers):
        gained[k, : maneuver.displacement.size] = maneuver.displacement
        lasting[k] = maneuver.duration
    cost, time, displacement = np.full((n, n), np.inf), np.zeros((n, n)), np.zeros((n, n, 4))
    np.fill_diagonal(cost, 0.0)
    # A chain is its first maneuver and the chain from there on, which is how it is followed: of
    # equally cheap chains that lead elsewhere, both are the same one. Short chains come first.
    rows, columns = np.nonzero(first >= 0)
    while rows.size:
        begin = first[rows, columns]
        middle = class_of[targets[begin]]
        known = np.isfinite(cost[middle, columns])
        i, j, k, via = rows[known], columns[known], begin[known], middle[known]
        cost[i, j] = prices[k] + cost[via, j]
        time[i, j] = lasting[k] + time[via, j]
        # Displacements (n, 4), each of `after` done in the frame of `before`.
        before = gained[k]
        after = displacement[via, j]
        c, s = np.cos(before[:, 2]), np.sin(before[:, 2])
        done = before + after
        done[:, 0] = before[:, 0] + c * after[:, 0] - s * after[:, 1]
        done[:, 1] = before[:, 1] + s * after[:, 0] + c * after[:, 1]
        displacement[i, j] = done
        rows, columns = rows[~known], columns[~known]
    return Transitions(
        class_of=class_of,
        displacement=displacement,
        cost=cost,
        time=time,
        first=first,
        sources=np.asarray(sources, dtype=np.int64),
        targets=np.asarray(targets, dtype=np.int64),
    )


@kept_by_first
def identities(automaton: Automaton) -> Transitions:
    """The transitions of a vehicle that switches at will between all trims of an automaton."""
    none = np.zeros(0, dtype=np.int64)
    return Transitions(
        class_of=np.zeros(len(automaton), dtype=np.int64),
        displacement=np.zeros((1, 1, 4)),
        cost=np.zeros((1, 1)),
        time=np.zeros((1, 1)),
        first=np.full((1, 1), SWITCH, dtype=np.int64),
        sources=none,
        targets=none,
    )


def _firsts(n: int, sources: IntArray, targets: IntArray, prices: Array) -> IntArray:
    """First maneuver (n, n) of the cheapest chain from class to class; -1 for none."""
    best = np.full((n, n), -1)
    if not prices.size:
        return best
    from scipy.sparse import csr_array  # takes longer than a plan without maneuvers
    from scipy.sparse.csgraph import dijkstra

    weights = prices + HOP * max(float(prices.max()), 1.0)
    leads = np.flatnonzero(sources != targets)
    # Between two classes the cheapest maneuver, the first of equals.
    order = leads[np.lexsort((leads, weights[leads], targets[leads], sources[leads]))]
    new = np.ones(order.size, dtype=bool)
    new[1:] = (np.diff(sources[order]) != 0) | (np.diff(targets[order]) != 0)
    direct = order[new]
    graph = csr_array((weights[direct], (sources[direct], targets[direct])), shape=(n, n))
    edge = np.full((n, n), -1)
    edge[sources[direct], targets[direct]] = direct
    # Against the edges, from each class: a predecessor there is the next class along the edges.
    _, after = dijkstra(graph.T.tocsr(), return_predecessors=True)
    rows, columns = np.nonzero(after.T >= 0)
    best[rows, columns] = edge[rows, after.T[rows, columns]]
    return best


NO_TRIM = -1
FULL_TURN = 2.0 * np.pi
MOST_TRIMS = 24  # of a larger library those that differ most
FEW_TRIMS = 14  # of these, for words that are tried often
STRAIGHT = 1e-12  # [rad/s] turn rates below it are none
SHORTEST = 1e-9  # [s] coasting times below it are none
TOLERANCE = 1e-10  # of the steering function, relative
NO_WORDS: IntArray = np.zeros((0, 3), dtype=np.int64)
MET = 1e-9  # [m, rad] by which a word with fewer times than the goal has coordinates may miss it


class TransitionArrays(NamedTuple):
    """The transitions between C classes of trims; of one class, the identity."""

    displacement: Array  # (C, C, 4)
    cost: Array  # (C, C) inf where there is none
    time: Array  # (C, C) [s] it lasts
    length: Array  # (C, C) [m] between its ends, in the plane


class WordTable(NamedTuple):
    """The words that are tried where two poses are to be connected."""

    words: IntArray  # (K, 5) three trims, NO_TRIM for none, path, ways; those of few trims first
    n_few: int  # how many these are
    free_words: IntArray  # (F, 5) that end with the turn of a free heading
    climbs: IntArray  # (c,) trims that only climb or sink, then such that drive straight with it
    n_upright: int  # how many only climb or sink


class Rounding(NamedTuple):
    """What counts as nothing."""

    shortest: float  # [s] coasting times below it
    tolerance: float  # of the steering function, relative
    met: float  # [m, rad] by which a goal may be missed


class LibraryArrays(NamedTuple):
    """A library for kernels: m trims in C classes; row m is the turn in place of a free heading.

    A vehicle that switches trims at will has one class, and its transition is the identity.
    """

    twists: Array  # (m + 1, 4) planar trims do not climb
    rates: Array  # (m + 1,) cost per second
    periods: Array  # (m + 1,) [s] of a full turn, inf for a straight
    longest: Array  # (m + 1,) [s] that a trim may last
    gears: IntArray  # (m + 1,) sign of the forward speed
    class_of: IntArray  # (m + 1,)
    per_metre: Array  # (m + 1,) least cost per metre in the plane, inf for none
    n_trims: int  # m
    transitions: TransitionArrays
    tried: WordTable
    switch: float  # price of a switch of trims
    direction_change: float  # price of a change between forward and reverse
    min_coast: float  # [s] that a trim lasts at least
    rounding: Rounding


class Scratch(NamedTuple):
    """Candidates of one steering call."""

    costs: Array  # (n,)
    durations: Array  # (n,) [s] transitions included
    rows: IntArray  # (n,) which word
    climbs: IntArray  # (n,) the climbing trim at its end, NO_TRIM for none
    times: Array  # (n, 4) [s] of up to three trims and the climb
    branches: Array  # (2, 3) [s] of three trims, on both branches
    solved: Array  # (P, 2, 3, 2) [s] the same of each path, were a trim driven either way


@dataclass(frozen=True, eq=False, kw_only=True)
class Library:
    """Trims of an automaton prepared for a search, with their prices."""

    automaton: Automaton
    trims: IntArray  # (m,) their indices in the automaton
    transitions: Transitions
    maneuver_costs: Array  # (M,) of the automaton's maneuvers
    arrays: LibraryArrays

    @functools.cached_property
    def number_of(self) -> IntArray:
        """Number of each trim of the automaton among `trims`, NO_TRIM for those left out."""
        numbers = np.full(len(self.automaton), NO_TRIM)
        numbers[self.trims] = np.arange(len(self.trims))
        return numbers

    def chain(self, source: int, target: int) -> tuple[tuple[int, int], ...]:
        """What leads from trim to trim of the automaton; see `Transitions.chain`."""
        if not np.isfinite(self.transitions.cost[self.class_pair(source, target)]):
            names = self.automaton.trim_names
            raise ValueError(f"no maneuvers lead from {names[source]!r} to {names[target]!r}")
        return self.transitions.chain(source, target)

    def class_pair(self, source: ArrayLike, target: ArrayLike) -> tuple[IntArray, IntArray]:
        """Classes of trims of the automaton, to look up transitions by."""
        classes = self.transitions.class_of
        return classes[np.asarray(source)], classes[np.asarray(target)]

    def displacements(self, trims: Sequence[int]) -> Array:
        """Displacement (n - 1, 4) of the transition after each trim but the last."""
        return np.asarray(self.transitions.displacement[self.class_pair(trims[:-1], trims[1:])])

    def scratch(self) -> Scratch:
        """Room for the candidates of one steering call."""
        return scratch_of(self.arrays)


def scratch_of(arrays: LibraryArrays) -> Scratch:
    """Room for the candidates of one steering call: two for each word, with each climb."""
    every = arrays.tried.words, arrays.tried.free_words
    n = 2 * max(1, *map(len, every)) * (1 + len(arrays.tried.climbs))
    return Scratch(
        costs=np.empty(n),
        durations=np.empty(n),
        rows=np.empty(n, dtype=np.int64),
        climbs=np.empty(n, dtype=np.int64),
        times=np.empty((n, 4)),
        branches=np.empty((2, 3)),
        solved=np.empty((1 + max(rows[:, 3].max(initial=0) for rows in every), 2, 3, 2)),
    )


def library_of(
    automaton: Automaton,
    *,
    rates: ArrayLike | None = None,
    maneuver_costs: ArrayLike | None = None,
    trims: Sequence[int] | None = None,
) -> Library:
    """All trims of an automaton, the transitions between them, and the words that are tried.

    `rates`: cost per second of each trim; 1 if omitted, so that cost is time. `maneuver_costs`:
    cost of each maneuver; its duration if omitted. `trims`: those that words are made of; if
    omitted, of a large library the few that differ most.
    """
    m = len(automaton)
    per_second = _costs("rates", np.ones(m) if rates is None else rates, m)
    durations = np.array([maneuver.duration for maneuver in automaton.maneuvers])
    prices = _costs(
        "maneuver_costs", durations if maneuver_costs is None else maneuver_costs, durations.size
    )
    twists = four_columns(automaton.body_velocities)
    transitions = transitions_of(automaton, prices)
    moving = np.flatnonzero(twists[:, :3].any(axis=1))
    chosen = moving[most_different(twists[moving], MOST_TRIMS)].tolist() if trims is None else trims
    words, n_few = words_of([int(k) for k in chosen], transitions, twists)
    longest = np.array([trim.max_duration for trim in automaton.trims])
    arrays = library_arrays(twists, per_second, transitions, longest=longest)
    return Library(
        automaton=automaton,
        trims=np.arange(m),
        transitions=transitions,
        maneuver_costs=prices,
        arrays=with_words(arrays, words, n_few),
    )


def library_arrays(
    twists: Array,
    rates: Array,
    transitions: Transitions,
    *,
    longest: Array | None = None,
    trims: IntArray | None = None,
) -> LibraryArrays:
    """Arrays of trims with twists (m, 4) and rates (m,), as yet without words and prices.

    `trims` (m,) are their indices in the automaton, by default all of them.
    """
    m = len(rates)
    rows = np.vstack([twists, [0.0, 0.0, 1.0, 0.0]])
    rows[np.abs(rows[:, 2]) < STRAIGHT, 2] = 0.0
    per_second = np.append(rates, 0.0)
    numbers = np.arange(m) if trims is None else trims
    speed = np.hypot(rows[:, 0], rows[:, 1])
    rising = rows[:m, 3] != 0.0
    upright = np.flatnonzero(~rows[:m, :3].any(axis=1) & rising)
    sloping = np.flatnonzero(rows[:m, :2].any(axis=1) & (rows[:m, 2] == 0.0) & rising)
    with np.errstate(divide="ignore", invalid="ignore"):
        periods = np.where(rows[:, 2] != 0.0, FULL_TURN / np.abs(rows[:, 2]), np.inf)
        per_metre = np.where(speed > 0.0, per_second / speed, np.inf)
    displacement = transitions.displacement
    return LibraryArrays(
        twists=rows,
        rates=per_second,
        periods=periods,
        longest=np.append(np.full(m, np.inf) if longest is None else longest, np.inf),
        gears=np.append(np.sign(rows[:m, 0]), 0).astype(np.int64),
        class_of=np.append(transitions.class_of[numbers], 0).astype(np.int64),
        per_metre=per_metre,
        n_trims=m,
        transitions=TransitionArrays(
            displacement=displacement,
            cost=transitions.cost,
            time=transitions.time,
            length=np.hypot(displacement[..., 0], displacement[..., 1]),
        ),
        tried=WordTable(
            words=np.zeros((0, 5), dtype=np.int64),
            n_few=0,
            free_words=np.zeros((0, 5), dtype=np.int64),
            climbs=np.concatenate([upright, sloping]).astype(np.int64),
            n_upright=len(upright),
        ),
        switch=0.0,
        direction_change=0.0,
        min_coast=0.0,
        rounding=Rounding(SHORTEST, TOLERANCE, MET),
    )


def with_words(
    arrays: LibraryArrays, words: IntArray, n_few: int, free_words: IntArray = NO_WORDS
) -> LibraryArrays:
    """The arrays with the words that are tried, (K, 3) and (F, 3), the first `n_few` often.

    Words of three trims are of one path if these differ in nothing but the way in which they are
    driven. The ways are bits: of each trim, 1 to turn right or to drive back; and whether the
    branches are those of the path in turn, as they are where one straight is driven back.
    """
    every = np.concatenate([words, free_words])
    twists = arrays.twists[every, :3]
    v_x, v_y, turn = np.moveaxis(twists, -1, 0)
    straight = turn == 0.0
    back = (turn < 0.0) | (straight & ((v_x < 0.0) | ((v_x == 0.0) & (v_y < 0.0))))
    in_turn = (straight.sum(axis=1) == 1) & (straight & back).any(axis=1)
    ways = np.column_stack([back, in_turn]) @ (1 << np.arange(4))
    path = np.zeros(len(every), dtype=np.int64)
    full = every[:, 2] != NO_TRIM
    ahead = twists[full] * np.where(back[full], -1.0, 1.0)[..., None] + 0.0  # no zero has a sign
    path[full] = np.unique(ahead.reshape(-1, 9), axis=0, return_inverse=True)[1].ravel()
    rows, n = np.column_stack([every, path, ways]), len(words)
    tried = arrays.tried._replace(words=rows[:n], n_few=n_few, free_words=rows[n:])
    return arrays._replace(tried=tried)


@dataclass(frozen=True, eq=False, kw_only=True)
class MovingTrims:
    """The trims of an automaton that move, of equal twists only the cheapest, and its rest."""

    trims: IntArray  # (M,) their indices in the automaton
    twists: Array  # (M, 4)
    rates: Array  # (M,)
    periods: Array  # (M,) [s] time of a full turn, inf for straights
    of: int  # how many trims the automaton has
    rest: int | None  # index of the cheapest rest
    rest_rate: float
    climbs: bool
    speeds: Array  # (M,) [m/s] climb included
    turn_rates: Array  # (M,) [rad/s] without sign


@kept_by_first
def moving_trims(automaton: Automaton, cost: StageCost) -> MovingTrims:
    """Moving trims of an automaton with what they cost, of equal twists only the cheapest."""
    twists = four_columns(automaton.body_velocities)
    rates = cost.rates(automaton.controls, automaton.body_velocities)
    still = ~twists.any(axis=1)
    groups = automaton.twist_groups
    cheapest = np.ones(len(automaton), dtype=bool)
    if (groups != np.arange(len(automaton))).any():
        order = np.lexsort((rates, groups))
        cheapest[:] = False
        cheapest[order[np.append(True, np.diff(groups[order]) != 0)]] = True
    moving = np.flatnonzero(cheapest & ~still)
    resting = np.flatnonzero(cheapest & still)
    with np.errstate(divide="ignore"):
        periods = np.where(twists[:, 2] != 0.0, FULL_TURN / np.abs(twists[:, 2]), np.inf)
    found = MovingTrims(
        trims=moving.astype(np.int64),
        twists=twists[moving],
        rates=rates[moving],
        periods=periods[moving],
        of=len(automaton),
        rest=int(resting[0]) if resting.size else None,
        rest_rate=float(rates[resting[0]]) if resting.size else 0.0,
        climbs=bool(twists[:, 3].any()),
        speeds=np.linalg.norm(twists[moving][:, [0, 1, 3]], axis=1),
        turn_rates=np.abs(twists[moving][:, 2]),
    )
    for one in vars(found).values():
        if isinstance(one, np.ndarray):
            one.setflags(write=False)
    return found


def words_of(trims: list[int], transitions: Transitions, twists: Array) -> tuple[IntArray, int]:
    """Words of none to three of these trims, neighbours different, that transitions allow.

    Those of the first few trims come first; how many they are.
    """
    classes = transitions.class_of[list(trims)]
    joined = np.isfinite(transitions.cost)[np.ix_(classes, classes)]
    joined &= ~np.eye(len(trims), dtype=np.bool_)
    if transitions.cost.size == 1:  # of parallel twists each follows the path of the other
        joined &= np.cross(twists[trims, None, :3], twists[trims, :3]).any(axis=-1)
    # Words as places in the list of trims; the last place, -1, holds no trim.
    one, none = np.arange(len(trims)), np.full((joined.size * len(trims), 1), -1)
    pairs = np.argwhere(joined)
    first, third = np.nonzero(joined[pairs[:, 1]])
    places = np.concatenate(
        [
            np.full((1, 3), -1),
            np.column_stack([one, none[: one.size], none[: one.size]]),
            np.column_stack([pairs, none[: len(pairs)]]),
            np.column_stack([pairs[first], third]),
        ]
    )
    words = np.append(np.array(trims, dtype=np.int64), NO_TRIM)[places]
    size = (places >= 0).sum(axis=1)
    last = words[np.arange(len(words)), np.maximum(size, 1) - 1]
    few = (places < FEW_TRIMS).all(axis=1)
    order = np.lexsort((words[:, 1], last, words[:, 0], size, ~few))
    return words[order], int(few.sum())


def most_different(twists: Array, n: int) -> IntArray:
    """Rows of twists (m, 4), at most n, far from rest and from each other.

    One after the other the farthest from all before, straight and forward ones first of equals.
    """
    size = np.abs(twists).max(axis=0, initial=0.0)
    rows = twists / np.where(size > 0.0, size, 1.0)
    nearest = np.linalg.norm(rows, axis=1)
    zeros = np.count_nonzero(rows == 0.0, axis=1)
    chosen: list[int] = []
    for _ in range(min(n, len(twists))):
        k = int(np.lexsort((-rows[:, 0], -zeros, -np.round(nearest, 9)))[0])
        chosen.append(k)
        nearest = np.minimum(nearest, np.linalg.norm(rows - rows[k], axis=1))
    return np.array(chosen, dtype=np.int64)


def four_columns(rows: Array) -> Array:
    """Planar components (n, 3) with a height of zero; (n, 4) as they are, in a new array."""
    wide = np.zeros((len(rows), 4))
    wide[:, : rows.shape[1]] = rows
    return wide


def _costs(name: str, value: ArrayLike, n: int) -> Array:
    costs = np.array(as_array(name, value))
    if costs.shape != (n,):
        raise ValueError(f"{name}: got shape {costs.shape}, need ({n},)")
    if not (costs >= 0.0).all():
        raise ValueError(f"{name}: must not be negative, got {costs.min()}")
    return costs

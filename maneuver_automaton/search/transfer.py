"""Transfers: the steering function of a maneuver automaton, from a pose and trim to another.

Between any two trims stands the cheapest chain of maneuvers, through trims that last no time where
no maneuver leads directly: a *transition* of fixed displacement, like a maneuver.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, IntArray, as_array
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.search import _kernels_transfer as kernels

MOST_TRIMS = 24  # of a larger library those that differ most
FEW_TRIMS = 14  # of these, for transfers that are tried often
STRAIGHT = 1e-12  # [rad/s] turn rates below it are none
SHORTEST = 1e-9  # [s] coasting times below it are none
TOLERANCE = 1e-10  # of the steering function, relative
MET = 1e-9  # [m, rad] by which a word with fewer times than the goal has coordinates may miss it


class TransferArrays(NamedTuple):
    """What the kernels see of m trims."""

    twists: Array  # (m, 4) planar trims with a height of zero
    rates: Array  # (m,) cost per second
    periods: Array  # (m,) [s] of a full turn
    longest: Array  # (m,) [s] that a trim may last
    shift: Array  # (m, m, 4) displacement of the transition between two trims
    cost: Array  # (m, m) of that transition, inf where there is none
    time: Array  # (m, m) [s] it lasts
    length: Array  # (m, m) [m] between the ends of that transition, in the plane
    per_metre: Array  # (m,) least cost per metre in the plane, inf for none
    words: IntArray  # (K, 3) trims in order, -1 for none; those of few trims first
    n_few: int  # how many these are
    climbs: IntArray  # (C,) trims that only climb or sink, then such that drive straight with it
    n_upright: int  # how many only climb or sink
    tolerance: float
    shortest: float  # [s]
    met: float  # [m, rad]


class TransferScratch(NamedTuple):
    """Candidates of one transfer."""

    costs: Array
    durations: Array  # [s] maneuvers included
    rows: IntArray  # which word
    climbs: IntArray  # the vertical trim at its end, -1 for none
    times: Array  # (n, 4) [s] of up to three trims and the climb
    branches: Array  # (2, 3)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class TransferLibrary:
    """An automaton prepared for transfers, with its prices."""

    automaton: Automaton
    arrays: TransferArrays
    via: IntArray  # (m, m) first maneuver of the transition, -1 for a switch at will or none
    next_trim: IntArray  # (m, m) trim it leads to
    maneuver_costs: Array  # (M,) of the automaton's maneuvers

    def chain(self, source: int, target: int) -> tuple[tuple[int, int], ...]:
        """The transition between two trims: each (maneuver, trim it leads to), -1 for a switch."""
        links = []
        while source != target:
            following = int(self.next_trim[source, target])
            if following < 0:
                raise ValueError(
                    f"no maneuvers lead from {self.automaton.trim_names[source]!r} to "
                    f"{self.automaton.trim_names[target]!r}"
                )
            links.append((int(self.via[source, target]), following))
            source = following
        return tuple(links)

    def scratch(self) -> TransferScratch:
        """Room for the candidates of one transfer."""
        n = 2 * len(self.arrays.words) * (1 + len(self.arrays.climbs))
        return TransferScratch(
            costs=np.empty(n),
            durations=np.empty(n),
            rows=np.empty(n, dtype=np.int64),
            climbs=np.empty(n, dtype=np.int64),
            times=np.empty((n, 4)),
            branches=np.empty((2, 3)),
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Transfer:
    """One word that leads exactly from one pose and trim to another."""

    trims: tuple[int, ...]  # up to three, and a climb
    durations: Array  # (n,) [s] of these trims
    cost: float
    duration: float  # [s] maneuvers included


def transfer_library(
    automaton: Automaton,
    *,
    rates: ArrayLike | None = None,
    maneuver_costs: ArrayLike | None = None,
    most_trims: int = MOST_TRIMS,
    trims: Sequence[int] | None = None,
) -> TransferLibrary:
    """Transitions between all trims, and the words that are tried.

    Parameters
    ----------
    automaton : Automaton
    rates : (m,) array_like, optional
        Cost per second of each trim; 1 if omitted, so that cost is time.
    maneuver_costs : (M,) array_like, optional
        Cost of each maneuver; its duration if omitted.
    most_trims : int
        Trims that words are made of; of a larger library those that differ most.
    trims : sequence of int, optional
        The trims that words are made of, instead.

    Raises
    ------
    ValueError
        If an array has the wrong length or a cost is negative.

    Examples
    --------
    >>> from maneuver_automaton.models import Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1, 0), "left": (1, 1)})
    >>> transfer_library(robot).arrays.cost.tolist()
    [[0.0, 0.0], [0.0, 0.0]]
    """
    m = len(automaton)
    per_second = _costs("rates", np.ones(m) if rates is None else rates, m)
    durations = np.array([maneuver.duration for maneuver in automaton.maneuvers])
    prices = _costs(
        "maneuver_costs", durations if maneuver_costs is None else maneuver_costs, durations.size
    )
    twists = np.zeros((m, 4))
    twists[:, : automaton.model.group.dof] = automaton.body_velocities
    twists[np.abs(twists[:, 2]) < STRAIGHT, 2] = 0.0
    via, following = _cheapest_chains(automaton, prices)
    shift, cost, time = _transitions(automaton, prices, via, following)
    rising = twists[:, 3] != 0.0
    upright = np.flatnonzero(~twists[:, :3].any(axis=1) & rising)
    sloping = np.flatnonzero(twists[:, :2].any(axis=1) & (twists[:, 2] == 0.0) & rising)
    moving = np.flatnonzero(twists[:, :3].any(axis=1))
    chosen = (
        moving[_most_different(twists[moving], most_trims)].tolist() if trims is None else trims
    )
    words, n_few = _words([int(k) for k in chosen], cost)
    with np.errstate(divide="ignore", invalid="ignore"):
        speed = np.hypot(twists[:, 0], twists[:, 1])
        per_metre = np.where(speed > 0.0, per_second / speed, np.inf)
        periods = np.where(twists[:, 2] != 0.0, 2.0 * np.pi / np.abs(twists[:, 2]), np.inf)
    arrays = TransferArrays(
        twists=twists,
        rates=per_second,
        periods=periods,
        longest=np.array([trim.max_duration for trim in automaton.trims]),
        shift=shift,
        cost=cost,
        time=time,
        length=np.hypot(shift[..., 0], shift[..., 1]),
        per_metre=per_metre,
        words=words,
        n_few=n_few,
        climbs=np.concatenate([upright, sloping]).astype(np.int64),
        n_upright=len(upright),
        tolerance=TOLERANCE,
        shortest=SHORTEST,
        met=MET,
    )
    return TransferLibrary(
        automaton=automaton,
        arrays=arrays,
        via=via,
        next_trim=following,
        maneuver_costs=prices,
    )


def transfers(
    library: TransferLibrary,
    start: ArrayLike,
    goal: ArrayLike,
    *,
    start_trim: int,
    goal_trim: int,
    ceiling: float = math.inf,
) -> list[Transfer]:
    """Words of up to three trims that lead exactly from start to goal, cheapest first.

    Words of fewer trims are listed where they fit exactly. In SE(2) x R one more trim makes up for
    the altitude, before the goal's trim: a vertical one, or after words of level trims a straight
    one that climbs.

    Parameters
    ----------
    library : TransferLibrary
    start, goal : (3,) or (4,) array_like
        Poses [m, m, rad(, m)]; headings count modulo a full turn.
    start_trim, goal_trim : int
        Trims before the first maneuver and after the last.
    ceiling : float
        Words that cost as much or more are left out.

    Examples
    --------
    >>> from maneuver_automaton.models import Unicycle
    >>> robot = Automaton.of_controls(
    ...     Unicycle(), {"rest": (0, 0), "ahead": (1, 0), "left": (1, 1), "right": (1, -1)}
    ... )
    >>> rows = transfers(transfer_library(robot), [0, 0, 0], [4, 2, 0], start_trim=0, goal_trim=0)
    >>> rows[0].trims, rows[0].durations.round(4).tolist()
    ((2, 1, 3), [0.5236, 3.4641, 0.5236])
    """
    dof = library.automaton.model.group.dof
    begin, end = _pose("start", start, dof), _pose("goal", goal, dof)
    scratch, arrays = library.scratch(), library.arrays
    n = kernels.transfer_batch(
        arrays,
        len(arrays.words),
        begin[None],
        start_trim,
        end[None],
        goal_trim,
        float(ceiling),
        scratch,
    )
    found = []
    for k in np.argsort(scratch.costs[:n], kind="stable"):
        word = arrays.words[scratch.rows[k]]
        trims, times = word[word >= 0], scratch.times[k, :3][word >= 0]
        if scratch.climbs[k] >= 0:
            trims = np.append(trims, scratch.climbs[k])
            times = np.append(times, scratch.times[k, 3])
        found.append(
            Transfer(
                trims=tuple(trims.tolist()),
                durations=np.array(times),
                cost=float(scratch.costs[k]),
                duration=float(scratch.durations[k]),
            )
        )
    return found


def _cheapest_chains(automaton: Automaton, prices: Array) -> tuple[IntArray, IntArray]:
    """First maneuver and first trim (m, m) on the cheapest way between trims; -1 for none.

    Of equally cheap ways the one with the fewest maneuvers.
    """
    m = len(automaton)
    classes = automaton.trim_classes
    hop = 1e-9 * float(prices.max(initial=1.0))
    value = np.where(classes[:, None] == classes[None], hop, np.inf)
    via = np.full((m, m), -1, dtype=np.int64)
    following = np.where(np.isfinite(value), np.arange(m)[None], -1)
    for k, maneuver in enumerate(automaton.maneuvers):
        i, j = automaton.index_of(maneuver.source), automaton.index_of(maneuver.target)
        if i != j and prices[k] + hop < value[i, j]:
            value[i, j], via[i, j], following[i, j] = prices[k] + hop, k, j
    np.fill_diagonal(value, 0.0)
    for k in range(m):
        through = value[:, k, None] + value[None, k, :]
        better = through < value * (1.0 - 1e-12)
        value = np.where(better, through, value)
        via = np.where(better, via[:, k, None], via)
        following = np.where(better, following[:, k, None], following)
    return via, np.asarray(following, dtype=np.int64)


def _transitions(
    automaton: Automaton, prices: Array, via: IntArray, following: IntArray
) -> tuple[Array, Array, Array]:
    """Displacement (m, m, 4), cost (m, m) and time (m, m) of every chain."""
    m, dof = len(automaton), automaton.model.group.dof
    shift, time = np.zeros((m, m, 4)), np.zeros((m, m))
    cost = np.full((m, m), np.inf)
    np.fill_diagonal(cost, 0.0)
    gained = np.zeros((len(prices) + 1, 4))  # the last row belongs to switches at will
    lasting = np.zeros(len(prices) + 1)
    for k, maneuver in enumerate(automaton.maneuvers):
        gained[k, :dof], lasting[k] = maneuver.displacement, maneuver.duration
    priced = np.append(prices, 0.0)
    rows, columns = np.nonzero((following >= 0) & ~np.eye(m, dtype=np.bool_))
    while rows.size:
        steps = following[rows, columns]
        known = np.isfinite(cost[steps, columns])
        i, j, k = rows[known], columns[known], steps[known]
        first = via[i, j]
        turn = gained[first, 2]
        c, s = np.cos(turn), np.sin(turn)
        rest = shift[k, j]
        shift[i, j] = gained[first] + rest
        shift[i, j, 0] = gained[first, 0] + c * rest[:, 0] - s * rest[:, 1]
        shift[i, j, 1] = gained[first, 1] + s * rest[:, 0] + c * rest[:, 1]
        time[i, j] = lasting[first] + time[k, j]
        cost[i, j] = priced[first] + cost[k, j]
        rows, columns = rows[~known], columns[~known]
    return shift, cost, time


def _words(trims: list[int], cost: Array) -> tuple[IntArray, int]:
    """Words of none to three of these trims, neighbours different, that transitions allow.

    Those of the first few trims come first; how many they are.
    """
    none = kernels.NONE
    words = [(none, none, none), *((a, none, none) for a in trims)]
    pairs = [(a, b) for a, b in itertools.permutations(trims, 2) if np.isfinite(cost[a, b])]
    words += [(a, b, none) for a, b in pairs]
    words += [(a, b, c) for a, b in pairs for c in trims if b != c and np.isfinite(cost[b, c])]
    few = {none, *trims[:FEW_TRIMS]}

    def order(word: tuple[int, int, int]) -> tuple[bool, int, int, int, int]:
        last = next((trim for trim in reversed(word) if trim != none), none)
        return not few.issuperset(word), 3 - word.count(none), word[0], last, word[1]

    words.sort(key=order)
    n_few = sum(few.issuperset(word) for word in words)
    return np.array(words, dtype=np.int64).reshape(-1, 3), n_few


def _most_different(twists: Array, n: int) -> IntArray:
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


def _costs(name: str, value: ArrayLike, n: int) -> Array:
    costs = np.array(as_array(name, value))
    if costs.shape != (n,):
        raise ValueError(f"{name}: got shape {costs.shape}, need ({n},)")
    if not (costs >= 0.0).all():
        raise ValueError(f"{name}: must not be negative, got {costs.min()}")
    return costs


def _pose(name: str, value: ArrayLike, dof: int) -> Array:
    pose = as_array(name, value, last=dof)
    if pose.shape != (dof,):
        raise ValueError(f"{name}: got shape {pose.shape}, need ({dof},)")
    return np.append(pose, np.zeros(4 - dof))

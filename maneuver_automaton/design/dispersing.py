"""Fewer maneuvers that still end near all others: small libraries for vehicles with inertia."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton._arrays import Array, IntArray, check_range, wrapped
from maneuver_automaton._brief import brief
from maneuver_automaton.automaton import Automaton

HEADING = 2  # its place in a pose


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class DispersedLibrary:
    """A library with fewer maneuvers, and how far an end of those left out is from one kept [m]."""

    automaton: Automaton
    maneuvers: int  # of the whole library
    dispersion: float  # [m]
    at_least: float  # [m] no choice of as many maneuvers has less: proven
    farthest: str  # the maneuver whose end is so far from all that are kept, from the same trim
    by_size: tuple[tuple[int, float], ...]  # numbers of maneuvers, and their dispersion

    __repr__ = brief


def disperse_library(
    library: Automaton, *, most: int, metres_per_radian: float | None = None
) -> DispersedLibrary:
    """At most `most` maneuvers of a library, their ends spread as evenly as those of all.

    From every trim, the maneuvers of the library end in states: a displacement, and the reduced
    state of the trim they lead to. The *dispersion* of a choice is the largest distance from such
    an end to the nearest end of a chosen maneuver from the same trim. First come the quickest
    maneuvers from rest to every trim and back, so that all stays connected; then, one after the
    other, the maneuver whose end is farthest from all chosen ones. To choose the farthest gives at
    most twice the least dispersion, were it not for those that come first; `at_least` says what no
    choice of as many falls below.

    Distances are ``d^2 = |dx|^2 + (L dh)^2 + sum (S dz_i / range_i)^2``: L as `metres_per_radian`
    says, S the largest displacement of a maneuver, and a reduced state z_i over its range in the
    library.

    Source: Jarin-Lipschitz, Paulos, Bjorkman, Kumar (2021), *Dispersion-minimizing motion
    primitives for search-based motion planning*, arXiv 2103.14603; Gonzalez (1985), *Clustering to
    minimize the maximum intercluster distance*, for the factor of two.

    Parameters
    ----------
    library : Automaton
        All maneuvers there are, as `build_library` makes them.
    most : int
        Maneuvers that are left.
    metres_per_radian : float, optional
        What a radian of heading counts for [m]; by default half a turn counts S.

    Raises
    ------
    ValueError
        If the library has no maneuvers, or as many cannot keep it connected.

    Examples
    --------
    >>> from maneuver_automaton.automaton.library import load_stock_library
    >>> car = load_stock_library("second_order_car")
    >>> fewer = disperse_library(car, most=200)
    >>> len(car.maneuvers), len(fewer.automaton.maneuvers)
    (438, 200)
    >>> fewer.at_least < fewer.dispersion < 2.0
    True
    """
    if not library.maneuvers:
        raise ValueError(
            "disperse: the library has no maneuvers, whose ends could be spread; a kinematic "
            "vehicle has design_library"
        )
    check_range("disperse: metres_per_radian", metres_per_radian)
    sources, targets = library.maneuver_classes.T
    apart = _distances(library, sources, metres_per_radian)
    # The maneuvers of the quickest ways from rest to all trims, and of those back.
    root = int(library.trim_classes[library.rest or 0])
    durations = np.array([maneuver.duration for maneuver in library.maneuvers])
    there = _quickest_ways(root, sources, targets, durations)
    back = _quickest_ways(root, targets, sources, durations)
    first = np.union1d(there, back)
    if most < max(len(first), 1):
        raise ValueError(
            f"disperse: {most} maneuvers cannot lead from rest to every trim and back, need at "
            f"least {max(len(first), 1)}"
        )
    order, reach = _farthest_first(apart, first, most)
    chosen = np.sort(order)
    nearest = apart[:, chosen].min(axis=1)
    size = len(chosen)
    _, one_each = np.unique(sources, return_index=True)
    _, bounds = _farthest_first(apart, one_each, size)
    return DispersedLibrary(
        automaton=replace(library, maneuvers=tuple(library.maneuvers[k] for k in chosen)),
        maneuvers=len(library.maneuvers),
        dispersion=float(nearest.max()),
        at_least=0.5 * float(bounds[-1]) if size < len(library.maneuvers) else 0.0,
        farthest=library.maneuvers[int(nearest.argmax())].name,
        by_size=tuple(
            (len(first) + k, float(value)) for k, value in enumerate(reach) if np.isfinite(value)
        ),
    )


def _distances(library: Automaton, sources: IntArray, metres_per_radian: float | None) -> Array:
    """Distances (n, n) of the ends of maneuvers [m], inf between those from different trims."""
    moved = np.array([maneuver.displacement for maneuver in library.maneuvers])
    states = np.array([trim.reduced_state for trim in library.trims])
    places = np.delete(moved, HEADING, axis=1)
    scale = float(np.linalg.norm(places, axis=1).max()) or 1.0
    length = scale / math.pi if metres_per_radian is None else metres_per_radian
    spread = np.ptp(states, axis=0)
    weights = np.where(spread > 0.0, scale / np.where(spread > 0.0, spread, 1.0), 0.0)
    ends = states[[library.index_of(m.target) for m in library.maneuvers]] * weights
    rows = np.concatenate([places, ends], axis=1)
    turn = wrapped(moved[:, None, HEADING] - moved[None, :, HEADING])
    squares = ((rows[:, None] - rows[None]) ** 2).sum(axis=2) + (length * turn) ** 2
    return np.where(sources[:, None] == sources[None], np.sqrt(squares), np.inf)


def _quickest_ways(root: int, sources: IntArray, targets: IntArray, durations: Array) -> IntArray:
    """The last maneuver of the quickest way to each class that can be reached.

    Source: Bellman (1958), *On a routing problem*.
    """
    value = np.full(int(max(sources.max(), targets.max(), root)) + 1, np.inf)
    value[root] = 0.0
    last = np.full(len(value), -1)
    changed = True
    while changed:
        changed = False
        for k in np.lexsort((np.arange(len(durations)), durations)):
            reached = value[sources[k]] + max(durations[k], 1e-9)
            if reached < value[targets[k]]:
                value[targets[k]], last[targets[k]], changed = reached, k, True
    return np.asarray(last[last >= 0], dtype=np.int64)


def _farthest_first(apart: Array, first: IntArray, most: int) -> tuple[IntArray, Array]:
    """At most `most` rows of distances (n, n), `first` and then the farthest; and what is left."""
    chosen = [int(k) for k in first]
    nearest = apart[:, chosen].min(axis=1, initial=np.inf)
    left = [float(nearest.max())]
    while len(chosen) < most and left[-1] > 0.0:
        chosen.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, apart[:, chosen[-1]])
        left.append(float(nearest.max()))
    return np.array(chosen, dtype=np.int64), np.array(left)

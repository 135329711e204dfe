"""A greatest time as a condition that insertion can price."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from maneuver_automaton.search.library_arrays import LibraryArrays

UNUSED = -1  # stands in `trims` for what is no trim of the automaton


def within_time(library: LibraryArrays, limit: float) -> LibraryArrays:
    """The library with a column for unused time, so that a word may last at most `limit` [s].

    The inequality becomes the equality "coasting times and unused time add up to `limit`". Unused
    time has no twist and no cost; its reduced cost is the price of time, which must be at least 0.
    The library must not have a condition on the time already.
    """
    at = library.n_priced
    weights = np.append(np.ones(at + 1), np.zeros(library.tail))
    return replace(
        library,
        trims=np.insert(library.trims, at, UNUSED),
        twists=np.insert(library.twists, at, 0.0, axis=0),
        rates=np.insert(library.rates, at, 0.0),
        rows=np.vstack([np.insert(library.rows, at, 0.0, axis=1), weights]),
        targets=np.append(library.targets, limit),
        rest=at,
        n_priced=at + 1,
    )

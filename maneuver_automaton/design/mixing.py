"""What it costs to replace a motion by others, in turns: the factor for words of any length.

A vehicle that switches at will between trims for shorter and shorter times follows, in the limit,
any twist that their twists mix to. So what a small library loses is a question about twists alone,
and the answer holds for every start and every goal.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from maneuver_automaton._arrays import Array, IntArray

AT_ONCE = 1_000_000  # numbers of shares that are held in memory
ZERO = 1e-12  # relative, of shares and determinants


def mixing_costs(twists: Array, rates: Array, wanted: Array) -> Array:
    """Least cost per second (n,) at which trims with `twists` (m, d) follow those `wanted` (n, d).

    ``min of sum rates_i share_i`` over shares of at least zero with ``sum share_i twist_i`` as
    wanted; inf where there are none. A linear program has an optimum at a basic solution, and there
    are few: all are looked at.

    Source: Warga (1962), *Relaxed variational problems*, for mixtures as limits of motions.

    Examples
    --------
    >>> turns = np.array([[1.0, 0.0, 0.5], [1.0, 0.0, -0.5]])
    >>> mixing_costs(turns, np.ones(2), np.array([[2.0, 0.0, 0.0], [0.0, 0.0, 1.0]])).tolist()
    [2.0, inf]
    """
    axes = principal_axes(np.concatenate([twists, wanted]))
    columns, asked = twists @ axes, wanted @ axes
    rank = axes.shape[1]
    least = np.where(np.abs(asked).max(axis=1, initial=0.0) == 0.0, 0.0, np.inf)
    bases = np.array(list(combinations(range(len(columns)), rank)), dtype=np.int64).reshape(
        -1, rank
    )
    for rows in np.array_split(bases, 1 + bases.size * len(asked) // AT_ONCE):
        matrices = columns[rows].swapaxes(1, 2)  # (k, rank, rank)
        sizes = np.linalg.norm(matrices, axis=1, keepdims=True)
        sound = sizes.all(axis=(1, 2))
        sound[sound] = np.abs(np.linalg.det(matrices[sound] / sizes[sound])) > ZERO
        if not sound.any():
            continue
        shares = np.linalg.solve(matrices[sound], asked.T)  # (k, rank, n)
        scale = ZERO * np.abs(shares).max(axis=1, keepdims=True)
        costs = np.einsum("krn,kr->kn", shares, rates[rows[sound]])
        held = (shares >= -scale).all(axis=1)
        least = np.minimum(least, np.where(held, costs, np.inf).min(axis=0))
    return least


def mixing_factors(twists: Array, rates: Array, chosen: IntArray) -> Array:
    """By how much each trim (m,) gets costlier where those `chosen` replace it; at least 1."""
    costs = mixing_costs(twists[chosen], rates[chosen], twists)
    return np.asarray(np.maximum(costs / rates, 1.0))


def principal_axes(twists: Array) -> Array:
    """Axes (d, r) of the directions in which twists (m, d) point, scaled to their sizes."""
    size = np.abs(twists).max(axis=0, initial=0.0)
    moving = np.flatnonzero(size > 0.0)
    scaled = twists[:, moving] / size[moving]
    _, values, rows = np.linalg.svd(scaled, full_matrices=False)
    held = values > 1e-9 * values.max(initial=0.0)
    if held.sum() == moving.size:  # no direction is missing: the components themselves
        rows, held = np.eye(moving.size), np.ones(moving.size, dtype=np.bool_)
    axes = np.zeros((twists.shape[1], int(held.sum())))
    axes[moving] = rows[held].T / size[moving][:, None]
    return axes

"""The best libraries of each size: which trims lose least where they replace all candidates."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray

BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Choice:
    """Some of the candidates, and by how much others get costlier where these replace them."""

    chosen: IntArray  # (k,) in the order of the candidates
    factor: float


def best_choices(twists: Array, rates: Array, *, most: int) -> Iterator[Choice]:
    """Choices of more and more candidates with `twists` (m, d), each with a smaller factor.

    The fastest straights ahead and back always belong to it: without them a vehicle would have to
    turn left and right in turns, for ever, to go straight on. Where candidates come in mirror
    images, so do those chosen. Of vehicles with two components of the twist, such as cars and
    unicycles, every choice is the best of its size; of others it is found by adding the candidate
    that is worst off, and taking out what has become idle.
    """
    plane = principal_axes(twists)
    if plane.shape[1] != 2:
        yield from _added_one_by_one(twists, rates, most)
        return
    for chosen in sorted(_planar(twists, rates, plane, most), key=len):
        yield Choice(chosen=chosen, factor=_factor(twists, rates, chosen))


def frontier(points: Array) -> IntArray:
    """Which points (m, 2), seen from the origin, no mixture of others reaches or passes beyond.

    Of several in one direction the outermost counts.
    """
    angles = np.arctan2(points[:, 1], points[:, 0])
    order = np.lexsort((-np.hypot(*points.T), np.round(angles, 12)))
    first = np.append(True, np.diff(np.round(angles[order], 12)) > 0.0)
    kept = np.sort(order[first])
    while True:
        chain = kept[np.argsort(angles[kept], kind="stable")]
        n = len(chain)
        before, after = points[np.roll(chain, 1)], points[np.roll(chain, -1)]
        gauge = _gauge(before, after, points[chain])
        inside = gauge < 1.0 - ZERO
        if n < 3 or not inside.any():
            return kept
        # neighbours hold each other up: take out what is inside, but of two neighbours only one
        take = inside & ~np.roll(inside, 1)
        if not take.any():
            take[np.flatnonzero(inside)[0]] = True
        kept = np.sort(chain[~take])


def _planar(twists: Array, rates: Array, plane: Array, most: int) -> Iterator[IntArray]:
    """The best choice of each size, for twists in a plane."""
    points = (twists / rates[:, None]) @ plane
    straight = _straights(twists, rates)
    outer = np.union1d(frontier(points), straight)
    base = points[straight[0]] if straight.size else points[outer[0]]
    points = points @ np.array([[base[0], -base[1]], [base[1], base[0]]])  # it lies on the x axis
    angles = _angles(points[outer])
    ring = outer[np.argsort(angles, kind="stable")]
    rising = np.sort(angles)
    gaps = np.append(np.diff(rising), 2.0 * np.pi - rising[-1] + rising[0])
    wide = int(gaps.argmax())
    is_open = gaps[wide] > np.pi - 1e-9 and len(ring) > 2  # its edges cannot be mixed from others
    images = _mirror_images(twists, rates)
    if images is not None and (straight.size == 2 or (is_open and straight.size)):
        yield from _mirrored(points, ring, images, np.isin(ring, straight), most)
    elif is_open:
        chain = np.roll(ring, -wide - 1)
        lost = _losses(points, chain, np.isin(chain, straight))
        for row in _best_chains(lost, most):
            yield np.sort(chain[row])
    else:
        yield from _closed(points, ring, np.isin(ring, straight), most)


def _closed(points: Array, ring: IntArray, forced: BoolArray, most: int) -> Iterator[IntArray]:
    """The best choices from a ring of candidates: from each of them, or from one that is forced."""
    best: dict[int, tuple[float, IntArray]] = {}
    for first in range(1 if forced[0] else len(ring)):
        chain, fixed = (np.append(np.roll(row, -first), row[first]) for row in (ring, forced))
        lost = _losses(points, chain, fixed)
        for row in _best_chains(lost, most + 1):
            worst = float(lost[row[:-1], row[1:]].max())
            size = len(row) - 1
            if worst < best.get(size, (np.inf, row))[0]:
                best[size] = worst, np.sort(chain[row[:-1]])
    for size in sorted(best):
        yield best[size][1]


def _mirrored(
    points: Array, ring: IntArray, images: IntArray, forced: BoolArray, most: int
) -> Iterator[IntArray]:
    """The same for trims in mirrored pairs: one half is chosen, the other half follows."""
    half = _angles(points[ring]) <= np.pi + 1e-9
    chain, fixed = ring[half], forced[half]
    lost = _losses(points, chain, fixed)
    for row in _best_chains(lost, len(chain)):
        chosen = np.union1d(chain[row], images[chain[row]])
        if len(chosen) > most:
            return
        yield chosen


def _angles(points: Array) -> Array:
    angles = np.mod(np.arctan2(points[:, 1], points[:, 0]), 2.0 * np.pi)
    return np.where(angles > 2.0 * np.pi - 1e-12, 0.0, angles)


def _best_chains(lost: Array, most: int) -> Iterator[IntArray]:
    """Of ways (k,) from the first to the last of n places, by rising k, the least worst step."""
    n = len(lost)
    if n == 1:
        yield np.zeros(1, dtype=np.int64)
        return
    value = lost[0].copy()
    came: list[IntArray] = [np.zeros(n, dtype=np.int64)]
    least = np.inf
    for size in range(2, min(most, n) + 1):
        if size > 2:
            through = np.maximum(value[:, None], lost)
            came.append(through.argmin(axis=0))
            value = through.min(axis=0)
        if value[-1] < least - ZERO:
            least = float(value[-1])
            way = [n - 1]
            for step in reversed(came):
                way.append(int(step[way[-1]]))
            yield np.array(way[::-1])


def _losses(points: Array, chain: IntArray, forced: BoolArray) -> Array:
    """Factor (n, n) of those between two places of a chain of rising angles; inf backwards."""
    n = len(chain)
    lost = np.full((n, n), np.inf)
    for i in range(n - 1):
        for k in range(i + 1, n):
            between = chain[i + 1 : k]
            if between.size == 0:
                lost[i, k] = 1.0
                continue
            if forced[i + 1 : k].any():
                break
            first, last = (np.tile(points[chain[p]], (between.size, 1)) for p in (i, k))
            lost[i, k] = max(1.0, float(_gauge(first, last, points[between]).max()))
    return lost


def _gauge(first: Array, last: Array, points: Array) -> Array:
    """Sum of the shares (n,) with which points are mixtures of `first` and `last`; inf if none."""
    area = first[:, 0] * last[:, 1] - first[:, 1] * last[:, 0]
    sound = area > ZERO * np.hypot(*first.T) * np.hypot(*last.T)
    divisor = np.where(sound, area, 1.0)
    one = (points[:, 0] * last[:, 1] - points[:, 1] * last[:, 0]) / divisor
    two = (first[:, 0] * points[:, 1] - first[:, 1] * points[:, 0]) / divisor
    sound &= (one >= -ZERO) & (two >= -ZERO)
    return np.where(sound, one + two, np.inf)


def _straights(twists: Array, rates: Array) -> IntArray:
    """The cheapest per metre of the trims that go straight ahead, and of those that go back."""
    on_line = ~twists[:, 1:].any(axis=1)
    chosen = []
    for sign in (1.0, -1.0):
        along = np.flatnonzero(on_line & (sign * twists[:, 0] > 0.0))
        if along.size:
            chosen.append(int(along[(rates[along] / np.abs(twists[along, 0])).argmin()]))
    return np.array(chosen, dtype=np.int64)


def _mirror_images(twists: Array, rates: Array) -> IntArray | None:
    """The mirror image of each candidate; None if one has none."""
    mirror = np.ones(twists.shape[1])
    mirror[1:3] = -1.0
    size = np.abs(twists).max(axis=0, initial=0.0)
    rows = np.column_stack([twists / np.where(size > 0.0, size, 1.0), rates / rates.max()])
    others = rows * np.append(mirror, 1.0)
    apart = np.abs(rows[None, :, :] - others[:, None, :]).max(axis=2)
    nearest = apart.argmin(axis=1)
    if apart[np.arange(len(rows)), nearest].max() > 1e-9:
        return None
    return np.asarray(nearest, dtype=np.int64)


def _added_one_by_one(twists: Array, rates: Array, most: int) -> Iterator[Choice]:
    """Choices that grow by the candidate that is worst off, handed over without what is idle."""
    images = _mirror_images(twists, rates)
    straight = _straights(twists, rates)
    places = (twists / rates[:, None]) @ principal_axes(twists)
    chosen = straight if straight.size else np.array([0])
    least = np.inf
    while True:
        factors = mixing_factors(twists, rates, chosen)
        if factors.max() < least:
            least = float(factors.max())
            fewer = _without_idle(twists, rates, chosen, straight)
            if len(fewer) > most:
                return
            yield Choice(chosen=fewer, factor=least)
        lacking = np.flatnonzero(np.isinf(factors))
        if lacking.size:  # the candidate farthest out of what cannot be followed at all
            apart = np.linalg.norm(places[lacking][:, None] - places[chosen], axis=2).min(axis=1)
            worst = int(lacking[apart.argmax()])
        else:
            worst = int(factors.argmax())
        if factors[worst] <= 1.0 + ZERO or len(chosen) > 2 * most:
            return
        chosen = np.union1d(chosen, [worst] if images is None else [worst, images[worst]])


def _without_idle(twists: Array, rates: Array, chosen: IntArray, straight: IntArray) -> IntArray:
    """Without those that can be left out at no loss."""
    factor = _factor(twists, rates, chosen)
    for one in chosen[~np.isin(chosen, straight)]:
        fewer = chosen[chosen != one]
        if _factor(twists, rates, fewer) <= factor * (1.0 + ZERO):
            chosen = fewer
    return chosen


def _factor(twists: Array, rates: Array, chosen: IntArray) -> float:
    return float(mixing_factors(twists, rates, chosen).max())


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

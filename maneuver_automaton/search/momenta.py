"""What the momentum of a word of four trims leaves open, tabulated for every start and goal.

Where the times of a word are free and locally optimal there is a momentum, the multipliers of its
end: seen from the body, ``p_x v + p_h w`` is the price of a second in every trim. At a switch that
tells p_x and p_h. No motion changes the length of (p_x, p_y). So this length and three signs of p_y
tell how long the two trims between last, and how the first and the last one lie to each other. Here
it runs through cells, from its least value to infinity, with bounds of all that follows.

Source: Pontryagin et al. (1962), *The Mathematical Theory of Optimal Processes*, Ch. I.
"""

from __future__ import annotations

import itertools

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._kept import kept_by_first
from maneuver_automaton.search._kernels_problem import Momenta
from maneuver_automaton.words.library import FULL_TURN, MovingTrims

CELLS = 16
MOST = 6  # trims of a library whose words are tabulated
WIDE = 1e-6  # relative, by which all is widened: solutions are off by less
FAR = 1e12  # in place of infinity
NONE = Momenta(np.zeros((0, 2), dtype=np.int64), np.zeros((0, CELLS, 7)))


@kept_by_first
def momenta_of(library: MovingTrims) -> Momenta:
    """The table of a library; none where trims move aside or are many, or one costs nothing."""
    n, (v, aside, w, _), rates = len(library.trims), library.twists.T, library.rates
    if not 0 < n <= MOST or aside.any() or not (rates > 0.0).all():
        return NONE
    words = np.array(list(itertools.product(range(n), repeat=4)), dtype=np.int64).T
    one, other = words[:-1], words[1:]
    det, size = v[one] * w[other] - v[other] * w[one], np.hypot(v, w)
    known = (np.abs(det) > WIDE * size[one] * size[other]).all(axis=0)
    det[:, ~known] = 1.0
    ahead = (rates[one] * w[other] - rates[other] * w[one]) / det  # p_x and p_h at switches
    turning = (v[one] * rates[other] - v[other] * rates[one]) / det
    fall, goes, least = turning[:-1] - turning[1:], w[words] == 0.0, np.abs(ahead).max(axis=0)
    # Where p_h does not fall along a straight p_y is 0: at p_x, the least length, for any time.
    loose, slight = goes[1:3] & (fall == 0.0), np.abs(fall) <= WIDE * rates.max()
    known &= ~(goes[1:3] & slight & ~loose).any(axis=0) & (least > 1.0 / FAR)
    known &= ~(goes[0] & goes[3])  # between straights a heading has to be met: it rules out none
    signs = np.array(list(itertools.product((1.0, -1.0), repeat=3))).T
    fits = np.tile(known[:, None], 8)
    for k in range(2):  # p_y has one sign along a straight, and p_h falls by v p_y
        same, falls = signs[k] == signs[k + 1], np.outer(fall[k] * v[words[1 + k]], signs[k]) > 0.0
        free = np.outer(np.abs(ahead[k]) >= least * (1.0 - WIDE), signs[k] > 0.0)
        fits &= ~goes[1 + k, :, None] | (same & np.where(loose[k, :, None], free, falls))
    number, sign = np.nonzero(fits)
    fall[loose] = np.inf
    cells = _cells(library, words[:, number], signs[:, sign], ahead[:, number], fall[:, number])
    rows = np.stack([np.searchsorted(number, range(n**4), side=s) for s in ("left", "right")], -1)
    rows[~known] = 1, 0
    return Momenta(rows, cells)


def _cells(library: MovingTrims, words: IntArray, signs: Array, ahead: Array, fall: Array) -> Array:
    """Bounds (rows, CELLS, 7): of what has to be met, the least cost, and of the outer trims."""
    # Where p_h falls by inf, the length is the least one, and a straight runs through cells.
    v, _, w, _ = library.twists.T
    edges, loose = np.linspace(0.0, np.pi / 2.0, CELLS + 1), np.isinf(fall)[..., None]
    shares = np.where(loose.any(axis=0), 1.0, np.sin(edges))
    shares = np.stack([shares[:, :-1] * (1.0 - WIDE), shares[:, 1:] * (1.0 + WIDE)])
    inverse = shares / np.abs(ahead).max(axis=0)[:, None]
    ways = np.stack([np.tan(edges[:-1]), np.append(np.tan(edges[1:-1]), FAR)])[:, None]
    fall = np.where(loose[..., 0], 0.0, fall)
    wide = np.array([-WIDE, WIDE])[:, None, None]
    # The direction of the momentum, seen from the body, at the three switches.
    cosines = [(_scaled(inverse, one) + wide).clip(-1.0, 1.0) for one in ahead]
    sizes = [np.sqrt(1.0 - _times(one, one)[::-1].clip(0.0)) for one in cosines]
    sines = [_scaled(*one) for one in zip(sizes, signs, strict=True)]
    angles = [_scaled(np.arccos(c[::-1]), s) for c, s in zip(cosines, signs, strict=True)]
    # From the centre of the first trim to that of the last one, along the momentum and across; a
    # straight has its end, or its beginning, for a centre.
    centre = np.divide(v, w, out=np.zeros_like(v), where=w != 0.0)[words]
    along, across, cost = np.zeros_like(inverse), np.zeros_like(inverse), np.zeros_like(inverse[0])
    for sine, cosine, arm in zip(sines, cosines, centre[1:] - centre[:-1], strict=True):
        along, across = along + _scaled(sine, arm), across + _scaled(cosine, arm)
    for k, trim in enumerate(words[1:3]):
        goes = (w[trim] == 0.0)[:, None]
        way = np.abs(fall[k, :, None]) * inverse / sizes[k][::-1].clip(min=1.0 / FAR)
        way = np.where(loose[k], ways, way)
        least, most = _scaled(angles[k] - angles[k + 1][::-1], np.sign(w[trim]))
        turn = np.where(most // FULL_TURN > least // FULL_TURN, 0.0, least % FULL_TURN)
        pace = np.where(goes, np.abs(v[trim, None]), np.abs(w[trim, None]))
        cost += library.rates[trim, None] * np.where(goes, way[0], turn) / pace
        along = along + np.where(goes, _times(_scaled(way, np.sign(v[trim])), cosines[k]), 0.0)
        across = across - np.where(goes, _scaled(inverse, fall[k])[::-1], 0.0)
    # Between two turns the distance of their centres has to be met, and its direction tells the
    # turns; after a straight, or before one, how far aside of it a centre lies.
    before, after = (w[words[[0, 3]]] == 0.0)[..., None]
    sine, cosine = np.where(after, sines[2], sines[0]), np.where(after, cosines[2], cosines[0])
    aside = _times(along, sine) + _times(across, cosine)
    rest = _times(across, sine) - _times(along, cosine)[::-1]
    direction, turned = _direction(along, across), angles[2] - angles[0][::-1]
    first = np.where(after, turned, -(direction + angles[0])[::-1])
    last = np.where(before, turned, direction + angles[2])
    first, last = np.where(before, rest, first) + wide, np.where(after, rest, last) + wide
    square = _times(along, along).clip(0.0) + _times(across, across).clip(0.0)
    met = np.where(before | after, aside, square)
    met += wide * (1.0 + np.abs(met))
    return np.stack([*met, cost * (1.0 - WIDE), *first, *last], axis=-1)


def _scaled(bounds: Array, factor: Array) -> Array:
    """Bounds (2, rows, cells) of a factor (rows,) times what lies within bounds."""
    return np.sort(bounds * factor[:, None], axis=0)


def _times(one: Array, other: Array) -> Array:
    """Bounds of a product."""
    products = np.stack([*one * other, *one * other[::-1]])
    return np.stack([products.min(axis=0), products.max(axis=0)])


def _direction(along: Array, across: Array) -> Array:
    """Bounds of the direction of a vector."""
    corners = np.stack([x + 1j * y for x in along for y in across])
    middle = corners.mean(axis=0)
    off = np.angle(corners * middle.conj())
    around = (along[0] * along[1] <= 0.0) & (across[0] * across[1] <= 0.0)
    off = np.where(around, [[[-np.pi]], [[np.pi]]], np.stack([off.min(axis=0), off.max(axis=0)]))
    direction: Array = np.angle(middle) + off
    return direction

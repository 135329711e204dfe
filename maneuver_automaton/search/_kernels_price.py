"""The price of every trim of a library at every moment of a plan: its reduced cost.

The multipliers of the switching-time problem are the price (p_x, p_y, p_turn) of the end pose. A
trim j that is inserted for an instant at the pose (x, y, heading) moves the end by its twist, so
it saves unless ``rate_j + price of time + p_turn(t) w_j + a(t) v_j + b(t) u_j >= 0``. Along a
trim the momentum (a, b, p_turn) moves by the coadjoint action: sines along an arc, straight lines
along a straight. That is Pontryagin's condition over the whole library and all times.
"""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import inner_kernel, kernel
from maneuver_automaton.groups._kernels import coast, compose
from maneuver_automaton.words._kernels_times import (
    TimesProblem,
    columns_of,
    end_and_columns,
    jacobian,
    multipliers,
)

SLACK = 1e-12  # relative, of prices


@inner_kernel
def price_of_row(rows: Array, p: Array, trim: int) -> float:
    """What the linear conditions add to the rate of a trim."""
    value = 0.0
    for r in range(rows.shape[0]):
        value += p[3 + r] * rows[r, trim]
    return value


@inner_kernel
def least_at_ends(
    base: Array, across: Array, a: float, b: float, turn: float, late: float, bounds: Array
) -> float:
    """Fill `bounds` with the price of every trim along a straight; the least of them."""
    for j in range(base.size):
        level = base[j] + across[0, j] * a + across[1, j] * b
        early_value = level + across[2, j] * turn
        late_value = level + across[2, j] * late
        bounds[j] = early_value if early_value < late_value else late_value
    least = np.inf
    for j in range(base.size):
        if bounds[j] < least:
            least = bounds[j]
    return least


@inner_kernel
def least_on_arc(
    base: Array,
    across: Array,
    a: float,
    b: float,
    centre: float,
    twist: tuple[float, float, float],
    angle: float,
    bounds: Array,
) -> float:
    """Fill `bounds` with lower bounds of all prices along an arc of `angle`; least at an end."""
    # The best price does not exceed what is returned. Inside the arc a price, a sine, has its least
    # only where it falls at the begin and rises at the end, or where the arc is longer than half a
    # turn. `SLACK` is for rounding, which decides differently where the least lies next to an end.
    cos_end, sin_end = math.cos(angle), math.sin(angle)
    sign = 1.0 if angle > 0.0 else -1.0
    long = abs(angle) > 3.0
    ends = np.empty(base.size)
    for j in range(base.size):
        ratio = across[2, j] / twist[2]
        along = across[0, j] - ratio * twist[0]
        aside = across[1, j] - ratio * twist[1]
        level = base[j] + across[2, j] * centre
        cosine = along * a + aside * b
        sine = along * b - aside * a
        begin = level + cosine
        end = level + cosine * cos_end + sine * sin_end
        rising = sine * cos_end - cosine * sin_end
        size = math.sqrt(cosine * cosine + sine * sine)
        least = begin if begin < end else end
        inside = long | ((sign * sine < 0.0) & (sign * rising > 0.0))
        ends[j] = least
        least = level - size if inside else least
        bounds[j] = least - SLACK * (abs(level) + size)
    attained = np.inf
    for j in range(base.size):
        if ends[j] < attained:
            attained = ends[j]
    return attained


@inner_kernel
def price_positions(
    library: TimesProblem, n_priced: int, word: IntArray, times: Array, n: int, p: Array
) -> tuple[int, Array, IntArray, Array]:
    """Smallest reduced cost of all trims within each of the first `n` trims of a word."""
    # Returns the position of the least, and for each position the reduced cost, its trim and the
    # time within the trim that it interrupts. A turn on the spot that follows does not move the
    # end's position. `n_priced` are the first trims of the library, those that can be inserted.
    twists = library.twists
    values = np.empty(max(n, 1))
    trims = np.empty(max(n, 1), dtype=np.int64)
    moments = np.empty(max(n, 1))
    some = columns_of(library, word, n).twists
    columns = np.empty((n, 3))
    end_x, end_y, _ = end_and_columns(some, times[:n], columns)
    least_position = 0
    base = np.empty(n_priced)
    across = np.empty((3, n_priced))  # v, u and turn rate of all trims
    for j in range(n_priced):
        base[j] = library.rates[j] + price_of_row(library.rows, p, j)
        for k in range(3):
            across[k, j] = twists[j, k]
    # Most trims of a large library are far from being the least anywhere. A first pass, without
    # branches so that the processor takes several trims at once, bounds the price of each from
    # below in `bounds`, and `attained` is the price that one of them has: what is above is no
    # candidate for the second pass, which decides.
    bounds = np.empty(n_priced)
    x, y, heading = 0.0, 0.0, 0.0
    for i in range(max(n, 1)):
        c, s = math.cos(heading), math.sin(heading)
        a = p[0] * c + p[1] * s
        b = p[1] * c - p[0] * s
        turn = p[2] - p[0] * (end_y - y) + p[1] * (end_x - x)
        v_i, u_i, w_i, time = 0.0, 0.0, 0.0, 0.0
        best, best_trim, best_time = np.inf, -1, 0.0
        if n > 0:
            v_i, u_i, w_i, time = some[i, 0], some[i, 1], some[i, 2], times[i]
        if w_i == 0.0:
            # a and b stay, the momentum of turning runs linearly: an end is the least
            slope = u_i * a - v_i * b
            late = turn + slope * time
            attained = least_at_ends(base, across, a, b, turn, late, bounds)
            for j in range(n_priced):
                if bounds[j] > attained:
                    continue
                level = base[j] + twists[j, 0] * a + twists[j, 1] * b
                early_value = level + twists[j, 2] * turn
                late_value = level + twists[j, 2] * late
                if early_value < best:
                    best, best_trim, best_time = early_value, j, 0.0
                if late_value < best:
                    best, best_trim, best_time = late_value, j, time
        else:
            angle = w_i * time
            cos_end, sin_end = math.cos(angle), math.sin(angle)
            centre = turn + (a * v_i + b * u_i) / w_i
            attained = least_on_arc(base, across, a, b, centre, (v_i, u_i, w_i), angle, bounds)
            for j in range(n_priced):
                if bounds[j] > attained:
                    continue
                ratio = twists[j, 2] / w_i
                along = twists[j, 0] - ratio * v_i
                aside = twists[j, 1] - ratio * u_i
                level = base[j] + twists[j, 2] * centre
                cosine = along * a + aside * b
                sine = along * b - aside * a
                if level - abs(cosine) - abs(sine) >= best:
                    continue
                if level + cosine < best:
                    best, best_trim, best_time = level + cosine, j, 0.0
                value = level + cosine * cos_end + sine * sin_end
                if value < best:
                    best, best_trim, best_time = value, j, time
                least = level - math.hypot(cosine, sine)
                if least < best:
                    where = math.atan2(-sine, -cosine) / w_i
                    period = 2.0 * math.pi / abs(w_i)
                    where -= period * math.floor(where / period)
                    if where < time:
                        best, best_trim, best_time = least, j, where
        values[i], trims[i], moments[i] = best, best_trim, best_time
        if best < values[least_position]:
            least_position = i
        if n > 0:
            dx, dy, dh = coast(v_i, u_i, w_i, time)
            x, y, heading = compose(x, y, heading, dx, dy, dh)
    return least_position, values, trims, moments


@inner_kernel
def word_multipliers(library: TimesProblem, word: IntArray, times: Array, n: int) -> Array:
    """Multipliers that best explain a word's times as optimal."""
    some = columns_of(library, word, n)
    columns = np.empty((n, 3))
    end_and_columns(some.twists, times[:n], columns)
    return multipliers(jacobian(columns, some.rows), some.rates)


@kernel
def price_word(
    library: TimesProblem,
    n_priced: int,
    word: IntArray,
    times: Array,
    first: int,
    last: int,
    p: Array,
) -> tuple[float, int, int, float]:
    """Smallest reduced cost of all trims at any time of a stretch: (value, trim, position, time).

    The stretch reaches from the trim at position `first` of the word to the one before `last`.
    """
    _, values, trims, moments = price_positions(library, n_priced, word, times, word.size, p)
    k = first
    for i in range(first, last):
        if values[i] < values[k]:
            k = i
    return values[k], trims[k], k, moments[k]


@kernel
def multipliers_of_word(library: TimesProblem, word: IntArray, times: Array) -> Array:
    """Multipliers (3 + m,) of a plan."""
    return word_multipliers(library, word, times, word.size)

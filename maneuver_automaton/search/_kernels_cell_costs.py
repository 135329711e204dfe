"""Lower bounds of what a word costs while one of its times lies within a cell.

A word with one free time t is solved for its other three in closed form, which depends on where the
goal is seen from: a vector d, and a heading. While t runs through a cell, d stays within a disc and
the heading within an interval, and so does every angle of the closed form. A bound of each of the
three times follows, and of the cost. It holds for every t of the cell, on both branches, across
their ends and across the jump of a turn from none to a full one. So a cell whose bound is above the
upper bound has no solution that counts, and a word all of whose cells are such need not be scanned.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import IntArray
from maneuver_automaton._compile import bare_inner_kernel, inner_kernel
from maneuver_automaton.search._kernels_cell_turns import (
    TINY,
    Four,
    Three,
    after_straight,
    before_straight,
    on_line_and_circle,
    straight_between,
    three_turns,
)
from maneuver_automaton.search._kernels_problem import WordProblem
from maneuver_automaton.words._kernels_steering import phase, unit

Ways = tuple[complex, complex, complex]

# The position of the free trim among the triple, and the goal's heading; the free trim; the
# turn rates and velocities of the triple; at_1, at_2; d without the free trim, and its centre
# and arm where that turns; the price of the free trim and of the triple; phases and lengths of
# at_1 and at_2.
ClosedForm = tuple[
    tuple[int, float], tuple[complex, float], Three, Ways, tuple[complex, complex], Ways, Four, Four
]

COARSE = 2  # stretches of all cells of a word, which are looked at first
PARTS = 8  # of a cell, for which bounds are computed in the end


@inner_kernel
def mark_cheap_cells(known: ClosedForm, reach: float, most: float, live: NDArray[np.bool_]) -> bool:
    """Fill `live` (2, nodes): cells of the free time where a branch may cost less than `most`."""
    # They part [0, reach] evenly; `most` is without what the word costs besides coasting. Many are
    # looked at together, and apart only where some may be cheap: in the end in parts, because
    # bounds get close as cells get small, and a bound takes less than a node of the scan. False if
    # none is live.
    live[:] = False
    found = False
    parts = PARTS * live.shape[1]
    stack = np.empty((40, 2), dtype=np.int64)
    top = 0
    for k in range(COARSE - 1, -1, -1):
        stack[top, 0], stack[top, 1] = k * parts // COARSE, (k + 1) * parts // COARSE
        top += 1
    while top > 0:
        top -= 1
        low, high = stack[top, 0], stack[top, 1]
        cell = low // PARTS
        alone = cell == (high - 1) // PARTS
        if low == high or (alone and live[0, cell] and live[1, cell]):
            continue
        later, earlier = least_costs(known, reach * low / parts, reach * high / parts)
        one, other = not later > most, not earlier > most  # also where a bound is not a number
        if alone:
            one, other = one and not live[0, cell], other and not live[1, cell]
        if not (one or other):
            continue
        if high == low + 1:
            live[0, cell] = live[0, cell] or one
            live[1, cell] = live[1, cell] or other
            found = True
            continue
        middle = (low + high) // 2
        stack[top, 0], stack[top, 1] = middle, high
        stack[top + 1, 0], stack[top + 1, 1] = low, middle
        top += 2
    return found


@bare_inner_kernel
def has_bounds(problem: WordProblem, word: IntArray, triple: IntArray, q: int) -> bool:
    """Whether bounds are known for a word whose time at `q` is free."""
    # Not where two straights are solved for, or the free trim comes last, or turns between those
    # that are solved for, or where coasting pays.
    straights = 0
    for s in range(3):
        trim = word[triple[s]]
        if problem.library.rates[trim] < 0.0:
            return False
        straights += problem.library.twists[trim, 2] == 0.0
    turns_between = q > triple[0] and problem.library.twists[word[q], 2] != 0.0
    return not (
        straights > 1 or q > triple[2] or turns_between or problem.library.rates[word[q]] < 0.0
    )


@bare_inner_kernel
def closed_form(problem: WordProblem, word: IntArray, triple: IntArray, q: int) -> ClosedForm:
    """What the closed form of a word has for every time at `q`."""
    twists = problem.library.twists
    free, a, b, c = word[q], word[triple[0]], word[triple[1]], word[triple[2]]
    v_q, w_q = complex(twists[free, 0], twists[free, 1]), twists[free, 2]
    v_a, w_a = complex(twists[a, 0], twists[a, 1]), twists[a, 2]
    v_b, w_b = complex(twists[b, 0], twists[b, 1]), twists[b, 2]
    v_c, w_c = complex(twists[c, 0], twists[c, 1]), twists[c, 2]
    r_a = -1j * v_a / w_a if w_a != 0.0 else 0j
    r_b = -1j * v_b / w_b if w_b != 0.0 else 0j
    r_c = -1j * v_c / w_c if w_c != 0.0 else 0j
    d = (
        complex(problem.library.goal[0], problem.library.goal[1])
        + r_a
        - r_c * unit(problem.library.goal[2])
    )
    centre, arm = d, 0j
    if q < triple[0] and w_q != 0.0:
        r_q = -1j * v_q / w_q
        centre, arm = d - r_a + r_q, r_a - r_q
    place = 0
    while place < 3 and q > triple[place]:
        place += 1
    return (
        (place, problem.library.goal[2]),
        (v_q, w_q),
        (w_a, w_b, w_c),
        (v_a, v_b, v_c),
        (r_a - r_b, r_b - r_c),
        (d, centre, arm),
        (
            problem.library.rates[free],
            problem.library.rates[a],
            problem.library.rates[b],
            problem.library.rates[c],
        ),
        (phase(r_a - r_b), phase(r_b - r_c), abs(r_a - r_b), abs(r_b - r_c)),
    )


@bare_inner_kernel
def least_costs(known: ClosedForm, low: float, high: float) -> tuple[float, float]:
    """Lower bounds of what coasting costs in a word whose free time is from `low` to `high`."""
    # For both branches of the closed form, as in `steer`: three turns are ``at_1 e^{i h_1} + at_2
    # e^{i h_2} = d``, the headings after the first two unknown; a straight brings its time instead.
    (place, heading), (v_q, w_q), turn_rates, velocities, (at_1, at_2), ways, rates, polar = known
    phase_1, phase_2, one, two = polar
    v_a, v_b, v_c = velocities
    w_a, w_b, w_c = turn_rates
    d, centre, arm = ways
    half = 0.5 * (high - low)
    time = low + half
    # `d` in the frame of the start. A leading trim turns about its centre: the place and the frame
    # from which the others start run along circles, so that d does, too.
    turned, spread = 0.0, 0.0  # by the leading trim, and by how much more or less in the cell
    if place == 0 and w_q != 0.0:
        turned, spread = w_q * time, abs(w_q) * half
        d = centre + arm * unit(turned)
        around, within = abs(arm) * spread, abs(centre) * spread
    else:
        around = within = abs(v_q) * half
        # A straight between others is pushed to the end of the word: how much longer or shorter
        # it is moves the end that far in whatever direction.
        if place == 0:
            d -= v_q * time
        elif place == 1:
            at_1 += v_q * time
            phase_1, one = phase(at_1), abs(at_1)
        else:
            at_2 += v_q * time
            phase_2, two = phase(at_2), abs(at_2)
    size = abs(d) + one + two + abs(centre)
    around += TINY * size  # radius of the disc about d in the frame of the start,
    within += TINY * size  # and in the frame from which the three are steered
    prices = rates[1], rates[2], rates[3]
    begun = rates[0] * low * (1.0 - TINY)
    if w_a != 0.0 and w_b != 0.0 and w_c != 0.0:
        if min(one, two) <= TINY * size:
            return begun, begun
        later, earlier = three_turns(
            (phase_1, phase_2, one, two), d, around, spread, turned, heading, turn_rates, prices
        )
        return begun + later, begun + earlier
    if w_b == 0.0:
        later, earlier = straight_between(
            at_1 + at_2, v_b, d, around, spread, turned, heading, (w_a, w_c), prices
        )
        return begun + later, begun + earlier
    if w_a == 0.0:  # the place from which the two turns lead to the goal lies on a line
        spans = on_line_and_circle(d * unit(-turned) - at_1, v_a, two, within)
        ahead = phase(v_a) - phase_2
        left = heading - turned - ahead
        return (
            begun + after_straight(spans[0], ahead, left, spread, (w_b, w_c), prices),
            begun + after_straight(spans[1], ahead, left, spread, (w_b, w_c), prices),
        )
    # the same from the goal back
    spans = on_line_and_circle(d * unit(-heading) - at_2, v_c, one, around)
    ahead = phase(v_c) - phase_1
    left = heading - turned + ahead
    return (
        begun + before_straight(spans[0], ahead, left, spread, (w_a, w_b), prices),
        begun + before_straight(spans[1], ahead, left, spread, (w_a, w_b), prices),
    )

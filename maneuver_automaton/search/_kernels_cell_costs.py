"""Lower bounds of what a word costs while one of its times lies within a cell.

A word with one free time t is solved for its other three in closed form, which depends on where the
goal is seen from: a vector d, and a heading. While t runs through a cell, d stays within a disc and
the heading within an interval, and so does every angle of the closed form. A bound of each of the
three times follows, and of the cost. It holds for every t of the cell, on both branches, across
their ends and across the jump of a turn from none to a full one. So a cell whose bound is above the
upper bound has no solution that counts, and a word all of whose cells are such need not be scanned.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import bare_inner_kernel
from maneuver_automaton.search._kernels_cell_turns import (
    TINY,
    UNKNOWN,
    ClosedForm,
    beside_straight,
    on_line_and_circle,
    straight_between,
    three_turns,
)
from maneuver_automaton.search._kernels_problem import WordProblem
from maneuver_automaton.words._kernels_steering import length, phase, radius_of, unit


@bare_inner_kernel
def mark_cheap_cells(known: ClosedForm, reach: float, most: float, live: NDArray[np.bool_]) -> bool:
    """Fill `live` (2, nodes): cells of the free time where a branch may cost less than `most`."""
    # They part [0, reach] evenly; `most` is without what the word costs besides coasting. Many are
    # looked at together, and halved where some may be cheap. False if none is live.
    live[:] = False
    found, stack, cells = False, known.stretches, live.shape[1]
    stack[0, 0], stack[0, 1], stack[1, 0], stack[1, 1] = cells // 2, cells, 0, cells // 2
    top = 2
    while top > 0:
        top -= 1
        low, high = stack[top, 0], stack[top, 1]
        later, earlier = least_costs(known, reach * low / cells, reach * high / cells)
        if later > most and earlier > most:  # neither where a bound is not a number
            continue
        if high == low + 1:
            live[0, low], live[1, low] = not later > most, not earlier > most
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
def closed_form(
    problem: WordProblem, word: IntArray, triple: IntArray, q: int, stretches: IntArray
) -> ClosedForm:
    """What the closed form of a word has for every time at `q`."""
    twists, rates, goal = problem.library.twists, problem.library.rates, problem.library.goal
    free, a, b, c = word[q], word[triple[0]], word[triple[1]], word[triple[2]]
    v_q, w_q = complex(twists[free, 0], twists[free, 1]), twists[free, 2]
    r_a, r_b, r_c = radius(twists[a]), radius(twists[b]), radius(twists[c])
    at_1, at_2, facing = r_a - r_b, r_b - r_c, unit(goal[2])
    d = complex(goal[0], goal[1]) + r_a - r_c * facing
    place = 0
    while place < 3 and q > triple[place]:
        place += 1
    centre, arm, r_q = d, 0j, radius(twists[free])
    if w_q != 0.0 and place == 0:
        centre, arm = d - r_a + r_q, r_a - r_q
    elif w_q != 0.0 and place == 1:
        centre, arm = r_a - r_q, r_q - r_b
    elif w_q != 0.0 and place == 2:
        centre, arm = r_b - r_q, r_q - r_c
    elif w_q != 0.0:
        centre, arm = d + (r_c - r_q) * facing, (r_q - r_c) * facing
    left, right, straight = UNKNOWN, UNKNOWN, 0j
    for i in range(4):
        rate, turn_rate = rates[word[i]], twists[word[i], 2]
        if turn_rate > 0.0:
            left = min(left, rate / turn_rate)
        elif turn_rate < 0.0:
            right = min(right, -rate / turn_rate)
        elif i != q:
            straight = complex(twists[word[i], 0], twists[word[i], 1])
    return ClosedForm(
        place,
        (v_q, w_q, length(v_q), rates[free]),
        (np.sign(twists[a, 2]), np.sign(twists[b, 2]), np.sign(twists[c, 2])),
        (price(problem, a), price(problem, b), price(problem, c)),
        (straight, phase(straight), length(straight)),
        (left, right),
        (at_1, at_2),
        (phase(at_1), phase(at_2), length(at_1), length(at_2)),
        (d, centre, arm),
        (length(centre), length(arm)),
        (goal[2], facing),
        stretches,
    )


@bare_inner_kernel
def price(problem: WordProblem, trim: int) -> float:
    """Of a radian of a turn, of a second of a straight."""
    rate: float = problem.library.rates[trim]
    turn_rate = abs(problem.library.twists[trim, 2])
    return rate / turn_rate if turn_rate > 0.0 else rate


@bare_inner_kernel
def radius(twist: Array) -> complex:
    """From the centre of a turn to the pose; 0 for a straight."""
    return radius_of(complex(twist[0], twist[1]), twist[2])


@bare_inner_kernel
def margin(known: ClosedForm, time: float) -> float:
    """How far from their ends both branches of the closed form are, below 0 where there is none."""
    (_, w_q, _, _), (a, b, c), (at_1, at_2) = known.free, known.sides, known.at
    (d, centre, arm), (velocity, _, speed), place = known.ways, known.straight, known.place
    step, turn, facing = known.free[0] * time, unit(w_q * time), known.goal[1]
    if w_q != 0.0:
        moved = centre + arm * (turn if place < 3 else turn.conjugate())
    else:
        moved = (d - step, at_1 + step, at_2 + step, d - step * facing)[place]
    d = moved if place % 3 == 0 else d
    at_1, at_2 = moved if place == 1 else at_1, moved if place == 2 else at_2
    if a != 0.0 and b != 0.0 and c != 0.0:
        one, two = length(at_1), length(at_2)
        return min(length(d) - abs(one - two), one + two - length(d))
    if abs(a) + abs(b) + abs(c) < 2.0:
        return math.inf  # two straights are always met
    same = 1.0 + 0j
    if b == 0.0:
        point, radius = at_1 * (turn.conjugate() if place == 1 else same) + at_2, length(d)
    elif a == 0.0:
        point, radius = d * (turn.conjugate() if place == 0 else same) - at_1, length(at_2)
    else:
        point = d * facing.conjugate() * (turn if place == 3 else same)
        point, radius = point - at_2 * (turn.conjugate() if place == 2 else same), length(at_1)
    return radius * speed - abs((point * velocity.conjugate()).imag)


@bare_inner_kernel
def least_costs(known: ClosedForm, low: float, high: float) -> tuple[float, float]:
    """Lower bounds of what coasting costs in a word whose free time is from `low` to `high`."""
    # For both branches of the closed form, as in `steer`: three turns are ``at_1 e^{i h_1} + at_2
    # e^{i h_2} = d``, the headings after the first two unknown; a straight brings its time instead.
    (v_q, w_q, speed, rate), (a, b, c), (at_1, at_2) = known.free, known.sides, known.at
    (phase_1, phase_2, one, two), (d, centre, arm) = known.polar, known.ways
    far, wide = known.sizes
    heading, facing = known.goal
    half = 0.5 * (high - low)
    time = low + half
    # `d` in the frame of the start. A leading trim turns about its centre: the place and the frame
    # from which the others start run along circles, so that d does, too. By how much it turns, as a
    # number as well, and by how much more or less in the cell.
    turned, turn, spread = 0.0, 1.0 + 0j, 0.0
    if known.place == 0 and w_q != 0.0:
        turned, spread = w_q * time, abs(w_q) * half
        turn = unit(turned)
        d = centre + arm * turn
        around, within = wide * spread, far * spread
    else:
        around = within = speed * half
        # A straight between others is pushed to the end of the word: how much longer or shorter
        # it is moves the end that far in whatever direction.
        if known.place == 0:
            d -= v_q * time
        elif known.place == 1:
            at_1 += v_q * time
            phase_1, one = phase(at_1), length(at_1)
        else:
            at_2 += v_q * time
            phase_2, two = phase(at_2), length(at_2)
    size = length(d) + one + two + far
    around += TINY * size  # radius of the disc about d in the frame of the start,
    within += TINY * size  # and in the frame from which the three are steered
    begun, rest = rate * low * (1.0 - TINY), heading - w_q * low
    if a != 0.0 and b != 0.0 and c != 0.0:
        if min(one, two) <= TINY * size:
            return begun, begun
        polar = phase_1, phase_2, one, two
        later, earlier = three_turns(known, polar, d, (around, turned, spread), rest)
    elif b == 0.0:
        later, earlier = straight_between(known, at_1 + at_2, d, (around, turned, spread), rest)
    else:
        # The place from which the two turns lead to the goal lies on a line, where the straight is
        # the first; where it is the last, the same from the goal back.
        ahead = known.straight[1] - (phase_2 if a == 0.0 else phase_1)
        if a == 0.0:
            spans = on_line_and_circle(known, d * turn.conjugate() - at_1, two, within)
            left = ahead - (heading - turned)
        else:
            spans = on_line_and_circle(known, d * facing.conjugate() - at_2, one, around)
            left = ahead + (heading - turned)
        later = beside_straight(known, spans[0], ahead, left, spread, rest)
        earlier = beside_straight(known, spans[1], ahead, left, spread, rest)
    return begun + later, begun + earlier

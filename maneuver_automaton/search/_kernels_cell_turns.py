"""Lower bounds of what three trims cost, where the closed form of their times has intervals.

Which intervals, `_kernels_cell_costs` says: the goal is seen from within a disc, and at a heading
within an interval. Every angle may be off by ROUNDING and every length by a share TINY, by which
the intervals are widened: so the bounds hold as they are computed, too.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from maneuver_automaton._arrays import IntArray
from maneuver_automaton._compile import bare_inner_kernel
from maneuver_automaton.words._kernels_steering import length, phase

Three = tuple[float, float, float]

Four = tuple[float, float, float, float]

ROUNDING = 1e-7  # [rad] by which an angle may be off: arc cosines lose half of the digits
TINY = 1e-9  # relative, of lengths and costs
FULL = 2.0 * math.pi
PER_RADIAN = 1.0 / FULL
UNKNOWN = 1e300  # price of what no trim does: finite, as none of it is to cost nothing


class ClosedForm(NamedTuple):
    """What the closed form of a word has for every time of its free trim."""

    place: int  # of the free trim among the triple
    free: tuple[complex, float, float, float]  # its velocity, turn rate, speed and price
    sides: Three  # of the triple: 1 where a trim turns to the left, -1 to the right, 0 for straight
    prices: Three  # of a radian of its turns, and of a second of its straight
    straight: tuple[complex, float, float]  # velocity, direction and speed of the one solved for
    radian: tuple[float, float]  # least prices of a radian to the left and to the right
    at: tuple[complex, complex]  # at_1 and at_2,
    polar: Four  # their phases and their lengths
    ways: tuple[complex, complex, complex]  # d without the free trim; its centre and its arm,
    sizes: tuple[float, float]  # and how long these are, where the free trim turns
    goal: tuple[float, complex]  # its heading, also as a number
    stretches: IntArray  # (40, 2) of cells that are looked at next


@bare_inner_kernel
def beside_straight(
    known: ClosedForm, span: Four, ahead: float, left: float, spread: float, rest: float
) -> float:
    """Lower bound for two turns after a straight, or before it: a line meets a circle in `span`."""
    # Seen from the straight: the same turns as a word and as its way back, to the other side.
    first, last, angle, other = span
    if last < 0.0:
        return math.inf
    a, b, c = known.sides
    near = least_turn(ahead + angle, ahead + other, b if a == 0.0 else -b)
    far = least_turn(left + angle - spread, left + other + spread, a - c)
    straight = max(first, 0.0)
    times = (straight, near, far) if a == 0.0 else (far, near, straight)
    return least_cost(known, times, rest)


@bare_inner_kernel
def least_turn(low: float, high: float, side: float) -> float:
    """Least angle of a turn to one side by some angle from `low` to `high`, whole turns aside."""
    if side < 0.0:
        low, high = -high, -low
    low, high = low - ROUNDING, high + ROUNDING
    turns = math.floor(low * PER_RADIAN)
    if high >= FULL * (turns + 1.0):  # a whole number of turns is among them
        return 0.0
    return low - FULL * turns


@bare_inner_kernel
def least_cost(known: ClosedForm, least: Three, rest: float) -> float:
    """Lower bound where turns and times of the triple are `least`, and all turns make up `rest`."""
    cost = 0.0
    for s in range(3):
        cost += known.prices[s] * least[s]
        rest -= known.sides[s] * least[s]
    # What these turns do not make of it is turned at the best price, to the left or to the right.
    left = rest - FULL * math.floor(rest * PER_RADIAN)
    price_left, price_right = known.radian
    return cost + min(
        price_left * max(left - ROUNDING, 0.0), price_right * max(FULL - left - ROUNDING, 0.0)
    )


@bare_inner_kernel
def arc(cosine: float) -> float:
    """The arc cosine of what rounding may have made larger than 1."""
    return math.acos(min(1.0, max(-1.0, cosine)))


@bare_inner_kernel
def corner(one: float, other: float, d: float) -> float:
    """Angle between the sides `one` and `d` of a triangle, whose third side is `other`."""
    return arc((one * one + d * d - other * other) / (2.0 * one * d))


@bare_inner_kernel
def widest_corner(one: float, other: float, low: float, high: float) -> float:
    """Largest angle between the side `one` and one from `low` to `high`, but for the two ends."""
    # Its cosine ``(one / d + d / one - other^2 / (d one)) / 2`` has its only least value, if any,
    # where ``d^2 = one^2 - other^2``; its largest one is at an end. 0 if that is not between.
    square = (one - other) * (one + other)
    return arc(math.sqrt(square) / one) if low * low < square < high * high else 0.0


@bare_inner_kernel
def three_turns(
    known: ClosedForm, polar: Four, d: complex, within: Three, rest: float
) -> tuple[float, float]:
    """Lower bounds of three turns: ``at_1 e^{i h_1} + at_2 e^{i h_2}`` in a disc about `d`."""
    # `polar` has the phases and the lengths of at_1 and at_2; `within` the disc's radius, the angle
    # by which the leading trim turns, and by how much more or less.
    around, turned, spread = within
    a, b, c = known.sides
    phase_1, phase_2, one, two = polar
    way, aim = length(d), phase(d)
    low = max(way - around, abs(one - two), TINY * (one + two))
    high = min(way + around, one + two)
    if low > high:  # the circles do not meet
        return math.inf, math.inf
    off = math.asin(around / way) if around < way else math.pi
    # the corners of the triangle with the sides one, two, d: at d's begin, and at its end
    begin_low, begin_high = corner(one, two, low), corner(one, two, high)
    end_low, end_high = corner(two, one, low), corner(two, one, high)
    nearest_1, nearest_2 = min(begin_low, begin_high), min(end_low, end_high)
    farthest_1 = max(begin_low, begin_high, widest_corner(one, two, low, high))
    farthest_2 = max(end_low, end_high, widest_corner(two, one, low, high))
    # between at_1 e^{i h_1} and at_2 e^{i h_2}: the longer d, the narrower
    widest, narrowest = begin_low + end_low, begin_high + end_high
    first, middle = aim - turned - phase_1, phase_1 - phase_2
    last, wide = known.goal[0] - aim + phase_2, off + spread
    bounds = (math.inf, math.inf)
    for _ in range(2):
        # the angle of at_1 e^{i h_1} is that of d plus a corner on one branch, minus on the other
        times = (
            least_turn(first + nearest_1 - wide, first + farthest_1 + wide, a),
            least_turn(middle - widest, middle - narrowest, b),
            least_turn(last + nearest_2 - off, last + farthest_2 + off, c),
        )
        bounds = bounds[1], least_cost(known, times, rest)
        nearest_1, farthest_1 = -farthest_1, -nearest_1
        nearest_2, farthest_2 = -farthest_2, -nearest_2
        widest, narrowest = -narrowest, -widest
    return bounds


@bare_inner_kernel
def straight_between(
    known: ClosedForm, still: complex, d: complex, within: Three, rest: float
) -> tuple[float, float]:
    """Lower bounds of turn, straight, turn: ``(still + velocity t) e^{i h}`` in a disc at `d`."""
    # Along the straight the vector is (along, aside), of which only the first changes.
    (velocity, ahead, speed), (around, turned, spread) = known.straight, within
    a, _, c = known.sides
    if not speed > 0.0:
        return 0.0, 0.0
    begin = (still * velocity.conjugate()).real / speed
    aside = (still * velocity.conjugate()).imag / speed
    way = length(d)
    low, high = max(way - around, 0.0), way + around
    if high < abs(aside):
        return math.inf, math.inf
    nearest = math.sqrt(max(0.0, (low - aside) * (low + aside)))
    farthest = math.sqrt(max(0.0, (high - aside) * (high + aside)))
    aim = phase(d)
    first, last = aim - turned - ahead, known.goal[0] - aim + ahead
    off = math.asin(around / way) if around < way else math.pi
    if abs(aside) <= around and nearest <= around:  # the vector may vanish: it has any direction
        off = math.pi
    one, other = math.atan2(aside, nearest), math.atan2(aside, farthest)
    one, other = min(one, other), max(one, other)
    straight = math.copysign(math.pi, aside)  # the way back is as far from it as the way ahead
    bounds = (math.inf, math.inf)
    for least, most in ((nearest, farthest), (-farthest, -nearest)):
        cost = math.inf
        if most - begin >= -TINY * (speed + high):
            turn = least_turn(first - other - off - spread, first - one + off + spread, a)
            last_turn = least_turn(last + one - off, last + other + off, c)
            cost = least_cost(known, (turn, max(0.0, (least - begin) / speed), last_turn), rest)
        bounds = bounds[1], cost
        one, other = straight - other, straight - one
    return bounds


@bare_inner_kernel
def on_line_and_circle(
    known: ClosedForm, point: complex, radius: float, within: float
) -> tuple[Four, Four]:
    """Where ``point - velocity t`` has the length `radius`, the point being in a disc."""
    # Later and earlier: the times from and to, and the angles to the velocity; below zero for none.
    velocity, _, speed = known.straight
    if not speed > 0.0 or not radius > TINY * within:
        return (0.0, math.inf, 0.0, 7.0), (0.0, math.inf, 0.0, 7.0)
    along = (point * velocity.conjugate()).real / speed
    aside = (point * velocity.conjugate()).imag / speed
    low, high = max(aside - within, -radius), min(aside + within, radius)
    if low > high:
        return (-1.0, -1.0, 0.0, 0.0), (-1.0, -1.0, 0.0, 0.0)
    far = max(abs(low), abs(high))
    near = 0.0 if low <= 0.0 <= high else min(abs(low), abs(high))
    least = math.sqrt(max(0.0, (radius - far) * (radius + far)))
    most = math.sqrt(max(0.0, (radius - near) * (radius + near)))
    one, other = math.asin(max(-1.0, low / radius)), math.asin(min(1.0, high / radius))
    return (
        (
            (along - within + least) / speed,
            (along + within + most) / speed,
            math.pi - other,
            math.pi - one,
        ),
        ((along - within - most) / speed, (along + within - least) / speed, one, other),
    )

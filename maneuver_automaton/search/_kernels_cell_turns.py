"""Lower bounds of what three trims cost, where the closed form of their times has intervals.

Which intervals, `_kernels_cell_costs` says: the goal is seen from within a disc, and at a heading
within an interval. Every angle may be off by ROUNDING and every length by a share TINY, by which
the intervals are widened: so the bounds hold as they are computed, too.
"""

from __future__ import annotations

import math

from maneuver_automaton._compile import bare_inner_kernel
from maneuver_automaton.words._kernels_steering import phase

Three = tuple[float, float, float]

Four = tuple[float, float, float, float]

ROUNDING = 1e-7  # [rad] by which an angle may be off: arc cosines lose half of the digits
TINY = 1e-9  # relative, of lengths and costs


@bare_inner_kernel
def after_straight(
    span: Four,
    ahead: float,
    left: float,
    spread: float,
    turn_rates: tuple[float, float],
    prices: Three,
) -> float:
    """Lower bound for straight, turn, turn, where a line and a circle meet within `span`."""
    first, last, angle, other = span
    if last < 0.0:
        return math.inf
    cost = prices[0] * max(first, 0.0)
    cost += prices[1] * least_turn(ahead + angle, ahead + other, turn_rates[0])
    return cost + prices[2] * least_turn(
        left - other - spread, left - angle + spread, turn_rates[1]
    )


@bare_inner_kernel
def before_straight(
    span: Four,
    ahead: float,
    left: float,
    spread: float,
    turn_rates: tuple[float, float],
    prices: Three,
) -> float:
    """Lower bound for turn, turn, straight, where a line and a circle meet within `span`."""
    first, last, angle, other = span
    if last < 0.0:
        return math.inf
    cost = prices[2] * max(first, 0.0)
    cost += prices[0] * least_turn(left + angle - spread, left + other + spread, turn_rates[0])
    return cost + prices[1] * least_turn(-ahead - other, -ahead - angle, turn_rates[1])


@bare_inner_kernel
def least_turn(low: float, high: float, turn_rate: float) -> float:
    """Least time in which a turn by some angle from `low` to `high` is made, whole turns aside."""
    full = 2.0 * math.pi
    if turn_rate < 0.0:
        low, high = -high, -low
    low, high = low - ROUNDING, high + ROUNDING
    turns = math.floor(low / full)
    if high >= full * (turns + 1.0):  # a whole number of turns is among them
        return 0.0
    return (low - full * turns) / abs(turn_rate)


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
    polar: Four,
    d: complex,
    around: float,
    spread: float,
    turned: float,
    heading: float,
    turn_rates: Three,
    prices: Three,
) -> tuple[float, float]:
    """Lower bounds of three turns: ``at_1 e^{i h_1} + at_2 e^{i h_2}`` in a disc about `d`."""
    # `polar` has the phases and the lengths of at_1 and at_2.
    phase_1, phase_2, one, two = polar
    way, aim = abs(d), phase(d)
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
    last, wide = heading - aim + phase_2, off + spread
    # the angle of at_1 e^{i h_1} is that of d plus a corner on one branch, minus on the other
    plus = prices[0] * least_turn(
        first + nearest_1 - wide, first + farthest_1 + wide, turn_rates[0]
    )
    plus += prices[1] * least_turn(middle - widest, middle - narrowest, turn_rates[1])
    plus += prices[2] * least_turn(last + nearest_2 - off, last + farthest_2 + off, turn_rates[2])
    minus = prices[0] * least_turn(
        first - farthest_1 - wide, first - nearest_1 + wide, turn_rates[0]
    )
    minus += prices[1] * least_turn(middle + narrowest, middle + widest, turn_rates[1])
    minus += prices[2] * least_turn(last - farthest_2 - off, last - nearest_2 + off, turn_rates[2])
    return plus, minus


@bare_inner_kernel
def straight_between(
    still: complex,
    velocity: complex,
    d: complex,
    around: float,
    spread: float,
    turned: float,
    heading: float,
    turn_rates: tuple[float, float],
    prices: Three,
) -> tuple[float, float]:
    """Lower bounds of turn, straight, turn: ``(still + velocity t) e^{i h}`` in a disc at `d`."""
    # Along the straight the vector is (along, aside), of which only the first changes.
    speed = abs(velocity)
    if not speed > 0.0:
        return 0.0, 0.0
    begin = (still * velocity.conjugate()).real / speed
    aside = (still * velocity.conjugate()).imag / speed
    way = abs(d)
    low, high = max(way - around, 0.0), way + around
    if high < abs(aside):
        return math.inf, math.inf
    nearest = math.sqrt(max(0.0, (low - aside) * (low + aside)))
    farthest = math.sqrt(max(0.0, (high - aside) * (high + aside)))
    aim, ahead = phase(d), phase(velocity)
    first, last = aim - turned - ahead, heading - aim + ahead
    off = math.asin(around / way) if around < way else math.pi
    if abs(aside) <= around and nearest <= around:  # the vector may vanish: it has any direction
        off = math.pi
    one, other = math.atan2(aside, nearest), math.atan2(aside, farthest)
    one, other = min(one, other), max(one, other)
    straight = math.copysign(math.pi, aside)  # the way back is as far from it as the way ahead
    later, earlier = math.inf, math.inf
    if farthest - begin >= -TINY * (speed + high):
        later = prices[1] * max(0.0, (nearest - begin) / speed)
        later += prices[0] * least_turn(
            first - other - off - spread, first - one + off + spread, turn_rates[0]
        )
        later += prices[2] * least_turn(last + one - off, last + other + off, turn_rates[1])
    if -nearest - begin >= -TINY * (speed + high):
        earlier = prices[1] * max(0.0, (-farthest - begin) / speed)
        one, other = straight - other, straight - one
        earlier += prices[0] * least_turn(
            first - other - off - spread, first - one + off + spread, turn_rates[0]
        )
        earlier += prices[2] * least_turn(last + one - off, last + other + off, turn_rates[1])
    return later, earlier


@bare_inner_kernel
def on_line_and_circle(
    point: complex, velocity: complex, radius: float, within: float
) -> tuple[Four, Four]:
    """Where ``point - velocity t`` has the length `radius`, the point being in a disc."""
    # Later and earlier: the times from and to, and the angles to the velocity; below zero for none.
    speed = abs(velocity)
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

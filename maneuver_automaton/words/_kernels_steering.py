"""The steering function: one, two or three coasting times in closed form.

Planar motions are complex numbers: a trim is ``(velocity, turn rate)``, a displacement
``(position, heading)``.
"""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import bare_inner_kernel, inner_kernel, kernel
from maneuver_automaton.groups._kernels import nearest_turn

MISSED = 1e-6  # share of all lengths by which a word surely misses: rounding is far below it


@inner_kernel
def unit(angle: float) -> complex:
    """Complex number of length one."""
    return complex(math.cos(angle), math.sin(angle))


@inner_kernel
def length(z: complex) -> float:
    """Length of a complex number that is neither huge nor tiny, where `abs` takes no chances."""
    return math.sqrt(z.real * z.real + z.imag * z.imag)


@inner_kernel
def size_of(z: complex) -> float:
    """Sum of both parts of a complex number without their signs: not below its length."""
    return abs(z.real) + abs(z.imag)


@inner_kernel
def radius_of(velocity: complex, turn_rate: float) -> complex:
    """From the centre of a turn to the pose, in the frame of the pose; 0 for a straight."""
    if turn_rate == 0.0:
        return 0j
    return complex(velocity.imag / turn_rate, -velocity.real / turn_rate)


@inner_kernel
def phase(z: complex) -> float:
    """Angle of a complex number."""
    return math.atan2(z.imag, z.real)


@inner_kernel
def turn_time(angle: float, turn_rate: float) -> float:
    """Time in [0, one turn) that turns by `angle` modulo a full turn."""
    full = 2.0 * math.pi
    angle = math.copysign(1.0, turn_rate) * angle
    angle -= full * math.floor(angle / full)
    return angle / abs(turn_rate)


@inner_kernel
def two_circles(
    a: complex, b: complex, d: complex, tolerance: float
) -> tuple[float, float, float, float]:
    """Angles (alpha+, beta+, alpha-, beta-): ``a e^{i alpha} + b e^{i beta} = d``; NaN if none."""
    length_a, length_b, length_d = length(a), length(b), length(d)
    scale = length_a + length_b + length_d
    nothing = (math.nan, math.nan, math.nan, math.nan)
    if min(length_a, length_b, length_d) <= tolerance * scale:
        return nothing
    # Heron's formula for the half angle at the origin, its tangent the root of `below` over
    # `above`: each factor is a sum or one difference, so it stays exact where the circles touch.
    below = (length_b - length_d + length_a) * (length_b + length_d - length_a)
    above = (length_d + length_a - length_b) * (length_d + length_a + length_b)
    # By so much two circles may miss each other and still count as touching.
    slack = -tolerance * scale * scale
    if below < slack or above < slack:
        return nothing
    half = math.atan2(math.sqrt(max(below, 0.0)), math.sqrt(max(above, 0.0)))
    middle = phase(d) - phase(a)
    plus, minus = middle + 2.0 * half, middle - 2.0 * half
    turn_b = phase(b)
    beta_plus = phase(d - a * unit(plus)) - turn_b
    beta_minus = phase(d - a * unit(minus)) - turn_b
    return plus, beta_plus, minus, beta_minus


@inner_kernel
def line_and_circle(
    point: complex, velocity: complex, radius: float, tolerance: float
) -> tuple[float, float]:
    """Times (later, earlier) at which ``|point - velocity t| = radius``; NaN if never."""
    # The foot of the perpendicular on the line, then half the chord on either side of it.
    speed = length(velocity)
    along = (point * velocity.conjugate()).real / speed
    aside = (point * velocity.conjugate()).imag / speed
    scale = length(point) + radius
    # A product, not a difference of squares: exact where the line touches the circle.
    square = (radius - aside) * (radius + aside)
    if square < -tolerance * scale * scale:
        return math.nan, math.nan
    reach = math.sqrt(max(square, 0.0))
    return (along + reach) / speed, (along - reach) / speed


@inner_kernel
def two_lines(
    point: complex, first: complex, second: complex, tolerance: float
) -> tuple[float, float]:
    """Times (s, t) with ``first s + second t = point``; NaN if the two are parallel."""
    area = (first.conjugate() * second).imag
    if abs(area) <= tolerance * length(first) * length(second):
        return math.nan, math.nan
    return (point.conjugate() * second).imag / area, (first.conjugate() * point).imag / area


@inner_kernel
def straight_time(goal: complex, velocity: complex) -> float:
    """Time after which a straight trim is nearest to the place `goal`."""
    return (goal * velocity.conjugate()).real / (velocity * velocity.conjugate()).real


@bare_inner_kernel
def steer_one(
    trim: tuple[complex, float], goal: tuple[complex, float, complex], out: Array
) -> None:
    """Fill `out` (3,) with the time of one trim that may meet `goal`; NaN if none can."""
    v, w = trim
    z, heading, _ = goal
    out[0], out[1], out[2] = math.nan, 0.0, 0.0
    if w != 0.0:
        out[0] = turn_time(heading, w)
    elif abs(v) > 0.0:
        out[0] = straight_time(z, v)


@bare_inner_kernel
def steer_two(
    a: tuple[complex, float],
    step: tuple[complex, float],
    b: tuple[complex, float],
    goal: tuple[complex, float, complex],
    tolerance: float,
    out: Array,
) -> None:
    """Fill `out` (3,) with times of two trims that may meet `goal`; NaN if none can."""
    # Two times are one fewer than the goal has coordinates: most words of two miss it by far, which
    # a length or a product shows before any angle is taken.
    v_a, w_a = a
    d, e = step
    v_b, w_b = b
    z, heading, facing = goal
    out[0], out[1], out[2] = math.nan, math.nan, 0.0
    r_a, r_b = radius_of(v_a, w_a), radius_of(v_b, w_b)
    turned = unit(e) if e != 0.0 else 1.0 + 0j
    sizes = size_of(z) + size_of(r_a) + size_of(r_b) + size_of(d) + size_of(v_a) + size_of(v_b)
    far = MISSED * (1.0 + sizes)
    if w_a != 0.0 and w_b != 0.0:
        arm, aim = r_a + d - r_b * turned, z + r_a - r_b * facing
        # The difference of two squares, so that no root is taken of those that miss.
        gap = aim.real * aim.real + aim.imag * aim.imag - arm.real * arm.real - arm.imag * arm.imag
        if abs(gap) > far * (size_of(aim) + size_of(arm)):
            return
        if length(arm) > tolerance * (length(r_a) + length(r_b) + length(d)):
            angle = phase(aim) - phase(arm)
            out[0] = turn_time(angle, w_a)
            out[1] = turn_time(heading - e - angle, w_b)
    elif w_a != 0.0 and length(v_b) > 0.0:
        angle = heading - e
        after = unit(angle) if e != 0.0 else facing
        left, along = z - r_a * (after - 1.0) - d * after, v_b * facing
        if abs((left * along.conjugate()).imag) <= far * size_of(v_b):
            out[0] = turn_time(angle, w_a)
            out[1] = straight_time(left, along)
    elif w_b != 0.0 and length(v_a) > 0.0:
        left = z - d - r_b * (facing - turned)
        if abs((left * v_a.conjugate()).imag) <= far * size_of(v_a):
            out[0] = straight_time(left, v_a)
            out[1] = turn_time(heading - e, w_b)
    elif w_a == 0.0 and w_b == 0.0 and length(v_a) > 0.0 and length(v_b) > 0.0:
        out[0], out[1] = two_lines(z - d, v_a, v_b * facing, tolerance)


@bare_inner_kernel
def extents(
    word: tuple[tuple[complex, float], tuple[complex, float], tuple[complex, float]],
    steps: tuple[tuple[complex, float], tuple[complex, float]],
    goal: tuple[complex, float, complex],
    limits: tuple[float, float, float],
    out: Array,
) -> None:
    """Fill `out` (2, 3) with the angles of turns and the times of straights, NaN where none.

    As `steer`, but that turns count by their circles, whichever way and how fast they are driven,
    and a straight beside two turns lasts no longer than the third of the `limits`.
    """
    (v_a, w_a), (v_b, w_b), (v_c, w_c) = word
    (d_1, e_1), (d_2, e_2) = steps
    z, heading, turn_3 = goal
    tolerance, least, most = limits
    for row in range(2):
        for k in range(3):
            out[row, k] = math.nan
    turn_1 = unit(e_1) if e_1 != 0.0 else 1.0 + 0j
    # A turn by the angle h, of radius r as a vector, moves the pose by ``r (e^{i h} - 1)``.
    r_a, r_b, r_c = radius_of(v_a, w_a), radius_of(v_b, w_b), radius_of(v_c, w_c)
    # The end of the word, with the centres collected: ``at_1 e^{i h_1} + at_2 e^{i h_2}`` plus what
    # straights add is `d`, h_1 and h_2 the headings after the first trim and after the second one.
    # A known heading turns its term into a known point, which leaves two circles, a line and a
    # circle, or two lines.
    d = z + r_a - r_c * turn_3
    at_1 = r_a + d_1 - r_b * turn_1  # multiplies e^{i heading after a}
    turn_2 = unit(e_2) if e_2 != 0.0 else 1.0 + 0j
    at_2 = r_b + d_2 - r_c * turn_2  # multiplies e^{i heading after b}
    before_c = heading - e_2
    facing = unit(before_c) if e_2 != 0.0 else turn_3
    # By which trims turn: with three turns both headings are unknown; each straight keeps a heading
    # and brings its time as the unknown instead.
    if w_a != 0.0 and w_b != 0.0 and w_c != 0.0:
        plus_1, plus_2, minus_1, minus_2 = two_circles(at_1, at_2, d, tolerance)
        for row in range(2):
            h_1, h_2 = (plus_1, plus_2) if row == 0 else (minus_1, minus_2)
            out[row, 0], out[row, 1], out[row, 2] = h_1, h_2 - h_1 - e_1, before_c - h_2
    elif w_a != 0.0 and w_c != 0.0:  # turn, straight, turn
        # Both headings are one and the same but for `e_1`: its rotation keeps lengths, so the
        # length of what it turns has to be that of `d`, and that gives the time of the straight.
        still = at_1 + at_2 * turn_1
        along = v_b * turn_1
        if length(along) > 0.0 and length(d) > tolerance * (length(still) + length(d)):
            later, earlier = line_and_circle(-still, along, length(d), tolerance)
            for row in range(2):
                time = later if row == 0 else earlier
                if least <= time <= most:
                    angle = phase(d) - phase(still + along * time)
                    out[row, 0], out[row, 1], out[row, 2] = angle, time, before_c - angle - e_1
    elif w_b != 0.0 and w_c != 0.0:  # straight, turn, turn
        point = d - at_1
        if length(v_a) > 0.0 and length(at_2) > tolerance * (length(point) + length(at_2)):
            later, earlier = line_and_circle(point, v_a, length(at_2), tolerance)
            for row in range(2):
                time = later if row == 0 else earlier
                if least <= time <= most:
                    angle = phase(point - v_a * time) - phase(at_2)
                    out[row, 0], out[row, 1], out[row, 2] = time, angle - e_1, before_c - angle
    elif w_a != 0.0 and w_b != 0.0:  # turn, turn, straight
        point = d - at_2 * facing
        along = v_c * turn_3
        if length(v_c) > 0.0 and length(at_1) > tolerance * (length(point) + length(at_1)):
            later, earlier = line_and_circle(point, along, length(at_1), tolerance)
            for row in range(2):
                time = later if row == 0 else earlier
                if least <= time <= most:
                    angle = phase(point - along * time) - phase(at_1)
                    out[row, 0], out[row, 1], out[row, 2] = angle, before_c - angle - e_1, time
    elif w_b != 0.0:  # straight, turn, straight
        point = d - at_1 - at_2 * facing
        if length(v_a) > 0.0 and length(v_c) > 0.0:
            first, last = two_lines(point, v_a, v_c * turn_3, tolerance)
            out[0, 0], out[0, 1], out[0, 2] = first, before_c - e_1, last
    elif w_c != 0.0:  # straight, straight, turn
        point = d - at_1 - at_2 * turn_1
        if length(v_a) > 0.0 and length(v_b) > 0.0:
            first, second = two_lines(point, v_a, v_b * turn_1, tolerance)
            out[0, 0], out[0, 1], out[0, 2] = first, second, before_c - e_1
    elif w_a != 0.0:  # turn, straight, straight
        angle = before_c - e_1
        point = d - at_1 * unit(angle) - at_2 * facing
        if length(v_b) > 0.0 and length(v_c) > 0.0:
            second, last = two_lines(point, v_b * facing, v_c * turn_3, tolerance)
            out[0, 0], out[0, 1], out[0, 2] = angle, second, last


@bare_inner_kernel
def steer(
    word: tuple[tuple[complex, float], tuple[complex, float], tuple[complex, float]],
    steps: tuple[tuple[complex, float], tuple[complex, float]],
    goal: tuple[complex, float, complex],
    limits: tuple[float, float],
    out: Array,
) -> None:
    """Fill `out` (2, 3) with the coasting times that carry the identity to `goal`, NaN where none.

    `word` are the three trims, `steps` the displacements between them, `goal` the place, the
    heading, and the heading as a number of length one: many words lead to one goal, and the sine
    costs as much as the rest of some of them. `limits` are the tolerance and the least time.

    Row 0 and row 1 are two branches, each continuous in all arguments. Turning times lie in
    [0, one turn); straight times may be negative, which the caller rejects. Between two turns, or
    beside them, one below the least counts as none at all. A branch has all its times or none.
    """
    extents(word, steps, goal, (*limits, math.inf), out)
    for row in range(2):
        for n in range(3):
            _, turn_rate = word[n]
            if math.isnan(out[row, 1]):
                out[row, n] = math.nan
            elif turn_rate != 0.0:
                out[row, n] = turn_time(out[row, n], turn_rate)


@kernel
def steer_batch(
    twists: Array, triples: IntArray, displacements: Array, goals: Array, tolerance: float
) -> Array:
    """Both branches (k, 2, 3) of `steer` for k rows; displacements are (k, 2, 3), goals (k, 3)."""
    k = triples.shape[0]
    times = np.empty((k, 2, 3))
    for row in range(k):
        i, j, l = triples[row, 0], triples[row, 1], triples[row, 2]  # noqa: E741
        first, second = displacements[row, 0], displacements[row, 1]
        trims = (
            (complex(twists[i, 0], twists[i, 1]), twists[i, 2]),
            (complex(twists[j, 0], twists[j, 1]), twists[j, 2]),
            (complex(twists[l, 0], twists[l, 1]), twists[l, 2]),
        )
        steps = (complex(first[0], first[1]), first[2]), (complex(second[0], second[1]), second[2])
        goal = (complex(goals[row, 0], goals[row, 1]), goals[row, 2], unit(goals[row, 2]))
        steer(trims, steps, goal, (tolerance, -math.inf), times[row])
    return times


@kernel
def pairs_ending(way: complex, heading: float, twists: Array, within: float) -> IntArray:
    """Pairs (n, 2) of trims, a first and a last one, that may end within [m, rad] of a pose.

    It is a `way` off and turned by its `heading`. Two turns miss it by how far their centres are
    from where they must be, a turn and a straight by how far that passes, two straights by heading.
    """
    count, n, last = len(twists), 0, unit(heading)
    arms = np.zeros(count, dtype=np.complex128)  # from the centres of turns
    velocities, found = np.empty_like(arms), np.empty((count * count, 2), dtype=np.int64)
    for i in range(count):
        velocities[i] = complex(twists[i, 0], twists[i, 1])
        if twists[i, 2] != 0.0:
            arms[i] = complex(twists[i, 1], -twists[i, 0]) / twists[i, 2]
    for i in range(count):
        for j in range(count):
            turns, far = twists[i, 2] != 0.0, way + arms[i] - arms[j] * last
            if turns and twists[j, 2] != 0.0:
                off = abs(abs(far) - abs(arms[i] - arms[j]))
            elif turns or twists[j, 2] != 0.0:
                left = far - arms[i] * last if turns else far + arms[j]
                along = velocities[j] * last if turns else velocities[i]
                speed = abs(along)
                off = abs((left * along.conjugate()).imag) / speed if speed > 0.0 else math.inf
            else:
                off = abs(nearest_turn(heading))
            if off <= within:
                found[n, 0], found[n, 1] = i, j
                n += 1
    return found[:n]

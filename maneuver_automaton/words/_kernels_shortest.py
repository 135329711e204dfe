"""The shortest path of a car that drives as well backwards as forwards, on circles of radius 1.

By symmetry a goal is looked at in one eighth of all poses, where nine words are left of 46. Whether
all parts of a word are positive is seen without an angle, from the signs of products. Which of two
such words is shorter was found on 7 million goals and holds on all of them; `tests/words` compares.
"""

from __future__ import annotations

import cmath
import math

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import bare_inner_kernel, bare_shared_kernel, kernel
from maneuver_automaton.groups._kernels import nearest_turn

QUARTER = 0.5 * math.pi
NEARLY = 1e-14  # [rad] by which a part may be shorter than zero, for rounding
# Words, and of their parts the turns, 1 to the left and -1 to the right, and the gears. A turn next
# to one beside a straight is a quarter; both U last as long.
LSL, LSR, C_CC, C_C_C, C_CSC, C_CSC_ALIKE, C_CSC_C, C_CUCU_C, CCU_CUC = range(9)
PARTS = (
    ((1, 0, 1, 0, 0), (1, 1, 1, 1, 1)),
    ((1, 0, -1, 0, 0), (1, 1, 1, 1, 1)),
    ((-1, 1, -1, 0, 0), (-1, 1, 1, 1, 1)),
    ((1, -1, 1, 0, 0), (1, -1, 1, 1, 1)),
    ((-1, 1, 0, -1, 0), (-1, 1, 1, 1, 1)),
    ((-1, 1, 0, 1, 0), (-1, 1, 1, 1, 1)),
    ((-1, 1, 0, -1, 1), (-1, 1, 1, 1, -1)),
    ((-1, 1, -1, 1, 0), (-1, 1, 1, -1, 1)),
    ((1, -1, 1, -1, 0), (-1, -1, 1, 1, 1)),
)


@bare_shared_kernel
def shortest(x: float, y: float, heading: float) -> tuple[float, int, int, float, float, float]:
    """Length of the shortest path to a pose, its word, how it is turned, and its parts.

    The parts are the first, the one that is left, and the last; `turned` has a bit for each
    symmetry: 1 mirrored, 2 driven in the other gear on the other side, 4 from the end.

    Source: Reeds, Shepp (1990), *Optimal paths for a car that goes both forwards and backwards*;
    symmetries of Souères, Laumond (1996), *Shortest paths synthesis for a car-like robot*.
    """
    turn = nearest_turn(heading)
    turned = 0
    if turn < 0.0:
        y, turn, turned = -y, -turn, 1
    # Seen halfway between both headings, where start and goal head for -turn / 2 and turn / 2, all
    # other symmetries are changes of signs. The circles' centres are c and s off the ends.
    half = 0.5 * turn
    c, s = math.cos(half), math.sin(half)
    a, b = c * x + s * y, c * y - s * x
    if a < 0.0:
        turned |= 2
    if (a < 0.0) != (b < 0.0):
        turned |= 4
    a, b = abs(a), abs(b)
    back = complex(c, -s)  # turns an angle back by half
    # Between the centres of two left circles, of two right ones, from right to left, and back.
    alike, right = complex(a - 2.0 * s, b), complex(a + 2.0 * s, b)
    apart, near = complex(a, b + 2.0 * c), complex(a, b - 2.0 * c)
    # A word whose parts are all positive is no longer than those that follow, but for the last
    # three that turn only: the first two exclude each other, and the shorter counts.
    # C|C|C is as long as the turn, the least for any path.
    far = alike.real * alike.real + b * b
    if alike.real <= 0.0 and far <= 16.0 * s * s:
        bend = complex(math.sqrt(1.0 - 0.0625 * far), 0.25 * math.sqrt(far))
        if (complex(-alike.real, b) * bend * back).imag <= 0.0:
            h, psi = cmath.phase(bend), math.atan2(b, abs(alike.real))
            return turn, C_C_C, turned, half - h - psi, 2.0 * h, half - h + psi
    far = a * a + apart.imag * apart.imag
    slack = NEARLY * far
    if far >= 4.0 and (apart * back).imag <= slack and (apart * back.conjugate()).real <= slack:
        gamma, straight = cmath.phase(apart), math.sqrt(far) - 2.0
        t, v = gamma - QUARTER + half, half - gamma
        return straight + turn, C_CSC_ALIKE, turned, t, straight, v
    if far >= 20.0:
        root = math.sqrt(far - 4.0)
        z = apart * complex(root, 2.0)
        if (z * back).real <= slack:
            gamma = cmath.phase(z)
            t, v = gamma - QUARTER + half, gamma - QUARTER - half
            return 2.0 * gamma + root - 4.0, C_CSC_C, turned, t, root - 4.0, v
    wide = right.real * right.real + b * b
    if wide >= 8.0:
        root = math.sqrt(wide - 4.0)
        z = right * complex(root, 2.0)
        slack = NEARLY * wide
        if (z * back).imag >= -slack and (z * back.conjugate()).real <= slack:
            beta = cmath.phase(z)
            t, v = beta - QUARTER + half, beta - half
            return 2.0 * beta + root - 2.0, C_CSC, turned, t, root - 2.0, v
    best, word, t, u, v = math.inf, LSL, 0.0, 0.0, 0.0
    if 4.0 <= far <= 20.0:
        cos_u = 0.0625 * (20.0 - far)
        sin_u = math.sqrt(1.0 - cos_u * cos_u)
        z = apart * complex(sin_u, cos_u - 2.0)
        if (z * back).imag >= -NEARLY:
            gamma, u = cmath.phase(z), math.acos(cos_u)
            best, word, t, v = 2.0 * (gamma + u), C_CUCU_C, gamma + half, gamma - half
    if word == LSL and wide <= 16.0:
        bend = complex(math.sqrt(1.0 - 0.0625 * wide), 0.25 * math.sqrt(wide))
        z = right * bend
        before = right * (bend * back).conjugate()
        if (z * back).imag >= -NEARLY and before.imag >= -NEARLY:
            h, beta = cmath.phase(bend), cmath.phase(right)
            best, word, t, u, v = 2.0 * (beta + h), C_CC, beta + half - h, 2.0 * h, beta + h - half
    if near.imag <= 0.0:
        gap = math.sqrt(a * a + near.imag * near.imag)
        if gap <= 2.0:
            cos_u = 0.25 * (2.0 + gap)
            w, eta = math.acos(cos_u), math.atan2(a, -near.imag)
            if eta <= w - half + NEARLY and 4.0 * w - turn < best:
                best, word, u = 4.0 * w - turn, CCU_CUC, w
                t, v = w - half - eta, w - half + eta
    if best < math.inf:
        return best, word, turned, t, u, v
    if b * c <= alike.real * s:
        u, phi = math.sqrt(alike.real * alike.real + b * b), cmath.phase(alike)
        return u + turn, LSL, turned, half + phi, u, half - phi
    u = math.sqrt(max(a * a + near.imag * near.imag - 4.0, 0.0))
    phi = cmath.phase(near * complex(u, 2.0))
    return u + 2.0 * phi, LSR, turned, phi + half, u, phi - half


@bare_inner_kernel
def least_cost(
    radius: float,
    per_metre: float,
    start: tuple[float, float, float, float],
    goal: tuple[float, float, float, float],
    upper_bound: float,
) -> float:
    """No path between two poses costs less, if all its turns have `radius` at least.

    The straight line's price where that is 0, or where the line costs the upper bound already.
    """
    d_x, d_y, turn = goal[0] - start[0], goal[1] - start[1], goal[2] - start[2]
    line = math.hypot(d_x, d_y) * per_metre
    if radius == 0.0 or line >= upper_bound:
        return line
    c, s = math.cos(start[2]) / radius, math.sin(start[2]) / radius
    return shortest(c * d_x + s * d_y, c * d_y - s * d_x, turn)[0] * radius * per_metre


@kernel
def shortest_batch(goals: Array, turns: IntArray, parts: Array) -> None:
    """Fill turns (n, 5) and parts (n, 5), negative backwards, of the paths to goals (n, 3)."""
    for k in range(goals.shape[0]):
        _, word, turned, t, u, v = shortest(goals[k, 0], goals[k, 1], goals[k, 2])
        n = 5 if word == C_CSC_C else 4 if word >= C_CSC else 3
        for j in range(5):
            part = 0.0
            if j < n:
                quarter = C_CSC <= word <= C_CSC_C and (j == 1 or j == 3 == n - 2)
                part = QUARTER if quarter else t if j == 0 else v if j == n - 1 else u
            turn, part = PARTS[word][0][j], max(part, 0.0) * PARTS[word][1][j]
            at = n - 1 - j if turned & 4 and j < n else j
            if turned & 2:
                turn, part = -turn, -part
            turns[k, at], parts[k, at] = (-turn if turned & 1 else turn), part

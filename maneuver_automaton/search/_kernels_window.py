"""Whether a motion with a constant twist stays inside a window, a box in a frame of its own."""

from __future__ import annotations

import math

from maneuver_automaton._arrays import Array
from maneuver_automaton._compile import bare_inner_kernel
from maneuver_automaton.groups._kernels import coast, compose


@bare_inner_kernel
def inside_window(
    window: Array, x: float, y: float, heading: float, v_x: float, v_y: float, turn: float, t: float
) -> bool:
    """Whether a motion stays inside [low x, low y, high x, high y], seen from the bounds' frame.

    `window` (9,) is those four, the frame's (x, y, cos, sin) that take a pose of the world to it,
    and what the pose may be outside [m].
    """
    # a is the pose where the motion begins, seen from the frame, e the one where it ends. The box
    # [low, high] holds both, and grows by the extreme points of the arc between them.
    c, s = window[6], window[7]
    d_x, d_y = x - window[4], y - window[5]
    a_x, a_y = c * d_x - s * d_y, s * d_x + c * d_y
    # Most motions are too short to reach a side.
    reach = math.sqrt(v_x * v_x + v_y * v_y) * abs(t)
    if (
        a_x - reach > window[0]
        and a_y - reach > window[1]
        and a_x + reach < window[2]
        and a_y + reach < window[3]
    ):
        return True
    a_heading = heading + math.atan2(s, c)
    m_x, m_y, angle = coast(v_x, v_y, turn, t)
    e_x, e_y, _ = compose(a_x, a_y, a_heading, m_x, m_y, angle)
    low_x, high_x = min(a_x, e_x), max(a_x, e_x)
    low_y, high_y = min(a_y, e_y), max(a_y, e_y)
    if turn != 0.0:
        radius_x, radius_y = -v_y / turn, v_x / turn  # from the pose to the centre of the circle
        cos, sin = math.cos(a_heading), math.sin(a_heading)
        m_x = a_x + cos * radius_x - sin * radius_y
        m_y = a_y + sin * radius_x + cos * radius_y
        radius = math.sqrt(radius_x * radius_x + radius_y * radius_y)
        # (m_x, m_y) is the centre. The proof: along an axis an arc is extreme at its ends or at a
        # multiple of a quarter turn, and four of these in a row are all there are.
        begin = math.atan2(a_y - m_y, a_x - m_x)
        end = begin + angle
        first, last = min(begin, end), max(begin, end)
        quarter = 0.5 * math.pi
        k = math.ceil(first / quarter)
        while k * quarter <= last and k <= math.ceil(first / quarter) + 4:
            side = k % 4
            if side == 0:
                high_x = max(high_x, m_x + radius)
            elif side == 1:
                high_y = max(high_y, m_y + radius)
            elif side == 2:
                low_x = min(low_x, m_x - radius)
            else:
                low_y = min(low_y, m_y - radius)
            k += 1
    slack = window[8]
    return (
        low_x >= window[0] - slack
        and low_y >= window[1] - slack
        and high_x <= window[2] + slack
        and high_y <= window[3] + slack
    )

"""The same search for a moved problem, to the last bit, and the exact goal at its end.

Start and goal seen from each other are the same for a moved problem but for rounding, and rounding
decides where insertion has a choice among equals. So it searches for a goal with fewer digits, and
its times are corrected afterwards until the goal itself is met.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.groups import group_of
from maneuver_automaton.groups.chain import chained
from maneuver_automaton.search.library_arrays import LibraryArrays
from maneuver_automaton.search.setup import SearchSetup

DIGITS = 9  # of the goal that is searched for, after the point [m, rad]
UNUSUAL = 1.7  # keeps steps in the number of digits away from the sizes people choose
TINY = 1e-12  # [m, rad] below this start and goal are one
CORRECTIONS = 6  # at most
RANK = 1e-11  # singular values below this, relative, count as none
MET = 1e-9  # [m, rad, s] the largest condition that may be left violated


def with_fewer_digits(setup: SearchSetup) -> SearchSetup:
    """The setup with its goal rounded; as it is where start and goal would become one."""
    x, y, turn, z = setup.goal.tolist()
    size = max(abs(x), abs(y), abs(z), abs(math.remainder(turn, 2.0 * math.pi)), TINY)
    finer = max(0, math.ceil(-math.log10(UNUSUAL * size)))
    goal = setup.goal.round(DIGITS + finer) + 0.0  # no negative zeros
    rounded = replace(setup, goal=goal)
    return setup if rounded.start_is_goal else rounded


def corrected(library: LibraryArrays, word: IntArray, times: Array, goal: Array) -> Array | None:
    """Times (n,) near `times` with which the word ends at `goal`; None if there are none.

    The smallest change, by Gauss-Newton: the goal is less than 1e-9 away, and less for small ones.
    """
    twists, rows = library.twists[word], library.rows[:, word]
    best, least = times, math.inf
    now = times.copy()
    for _ in range(CORRECTIONS):
        gap, columns = _conditions(library, twists, rows, now, goal)
        worst = float(np.abs(gap).max())
        if worst < least:
            best, least = now, worst
        elif least < MET:
            break
        if worst < 1e-15:
            break
        now = now + np.linalg.lstsq(columns, gap, rcond=RANK)[0]
    if not least < MET or (best < -MET).any():
        return None
    return np.asarray(best.clip(min=0.0))


def _conditions(
    library: LibraryArrays, twists: Array, rows: Array, times: Array, goal: Array
) -> tuple[Array, Array]:
    """What is missing of each condition (3 + m,), and how it follows the times (3 + m, n)."""
    steps = group_of(4).exp(times[:, None] * twists).pose
    poses = chained(np.zeros(4), steps)
    after, end = poses[1:], poses[-1]
    c, s = np.cos(after[:, 2]), np.sin(after[:, 2])
    arm = end[:2] - after[:, :2]
    x = c * twists[:, 0] - s * twists[:, 1] - twists[:, 2] * arm[:, 1]
    y = s * twists[:, 0] + c * twists[:, 1] + twists[:, 2] * arm[:, 0]
    turn = math.remainder(float(goal[2] - end[2]), 2.0 * math.pi)
    targets = library.targets.copy()
    if len(targets) and library.climbs:
        targets[0] = goal[3]
    gap = np.concatenate([goal[:2] - end[:2], [turn], targets - rows @ times])
    return gap, np.vstack([x, y, twists[:, 2], rows])

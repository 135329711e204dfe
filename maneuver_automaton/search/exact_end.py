"""Goals rounded so that a moved problem has the same search, and words closed exactly after it.

Start and goal seen from each other are the same for a moved problem but for rounding, and rounding
decides where insertion has a choice among equals. So it searches for a goal with fewer digits, and
its times are corrected afterwards until the goal itself is met.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.search.library_arrays import LibraryArrays
from maneuver_automaton.search.setup import SearchSetup
from maneuver_automaton.words.closing import MET

DIGITS = 9  # of the goal that is searched for, after the point [m, rad]
UNUSUAL = 1.7  # keeps steps in the number of digits away from the sizes people choose
TINY = 1e-12  # [m, rad] below this start and goal are one


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

    The goal is less than 1e-9 away, and less for small ones.
    """
    from maneuver_automaton.search import _kernels_insertion as kernels

    targets = np.array(library.targets)
    if library.climbs:
        targets[0] = goal[3]
    best = np.array(times)
    missing = kernels.close_word(library.twists, np.array(goal), library.rows, targets, word, best)
    return best if missing < MET else None

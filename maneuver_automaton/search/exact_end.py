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
from maneuver_automaton.words.closing import MET, EndConditions, closest_times

DIGITS = 9  # of the goal that is searched for, after the point [m, rad]
UNUSUAL = 1.7  # keeps steps in the number of digits away from the sizes people choose
TINY = 1e-12  # [m, rad] below this start and goal are one
RANK = 1e-11  # singular values below this, relative, count as none


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

    The smallest change: the goal is less than 1e-9 away, and less for small ones.
    """
    others = slice(int(library.climbs), None)  # an end's altitude is a condition anyway
    conditions = EndConditions(
        start=np.zeros(4),
        twists=library.twists[word],
        goal=goal,
        rows=library.rows[others, word],
        targets=library.targets[others],
    )
    best, missing = closest_times(conditions, times, rank=RANK, at_least=-math.inf)
    if not missing < MET or (best < -MET).any():
        return None
    return np.asarray(best.clip(min=0.0))

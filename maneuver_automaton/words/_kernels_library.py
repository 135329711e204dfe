"""What a library says of its trims and the transitions between them: class, price, motion."""

from __future__ import annotations

import math

from maneuver_automaton._arrays import IntArray
from maneuver_automaton._compile import bare_inner_kernel, inner_kernel
from maneuver_automaton.words.library import LibraryArrays

NO_TRIM = -1


@bare_inner_kernel
def price_of_switch(lib: LibraryArrays, before: int, gear: int, trim: int) -> float:
    """Price of going on with `trim` after `before`, in `gear` the last that drove."""
    price = 0.0
    if before != NO_TRIM and before != trim:
        price += lib.switch
    if gear * lib.gears[trim] < 0:
        price += lib.direction_change
    return price


@bare_inner_kernel
def class_of(lib: LibraryArrays, trim: int) -> int:
    """Class of a trim; of none the first, to which a kinematic vehicle's trims belong."""
    return lib.class_of[trim] if trim >= 0 else 0


@bare_inner_kernel
def displacement_of(lib: LibraryArrays, before: int, after: int) -> tuple[float, float, float]:
    """Displacement (x, y, heading) of the transition between two trims."""
    a, b = class_of(lib, before), class_of(lib, after)
    return (
        lib.transitions.displacement[a, b, 0],
        lib.transitions.displacement[a, b, 1],
        lib.transitions.displacement[a, b, 2],
    )


@bare_inner_kernel
def rise_of(lib: LibraryArrays, before: int, after: int) -> float:
    """Altitude that the transition between two trims gains."""
    return lib.transitions.displacement[class_of(lib, before), class_of(lib, after), 3]


@bare_inner_kernel
def cost_between(lib: LibraryArrays, before: int, after: int) -> float:
    """Cost of the transition between two trims; inf where there is none."""
    return lib.transitions.cost[class_of(lib, before), class_of(lib, after)]


@bare_inner_kernel
def time_between(lib: LibraryArrays, before: int, after: int) -> float:
    """Duration of the transition between two trims."""
    return lib.transitions.time[class_of(lib, before), class_of(lib, after)]


@inner_kernel
def motion_of(lib: LibraryArrays, trim: int) -> tuple[complex, float]:
    """A trim as a planar velocity and a turn rate."""
    return complex(lib.twists[trim, 0], lib.twists[trim, 1]), lib.twists[trim, 2]


@inner_kernel
def step_of(lib: LibraryArrays, before: int, trim: int) -> tuple[complex, float]:
    """The transition between two trims as a planar displacement."""
    d_x, d_y, turn = displacement_of(lib, before, trim)
    return complex(d_x, d_y), turn


@inner_kernel
def distance_cost(lib: LibraryArrays, distance: float, a: int, b: int, c: int) -> float:
    """Least cost of coasting a distance by these trims: what transitions do not make of it."""
    left, price = distance, math.inf
    if a >= 0:
        price = lib.per_metre[a]
    if b >= 0:
        left -= lib.transitions.length[class_of(lib, a), class_of(lib, b)]
        price = min(price, lib.per_metre[b])
    if c >= 0:
        left -= lib.transitions.length[class_of(lib, b), class_of(lib, c)]
        price = min(price, lib.per_metre[c])
    return left * price if left > lib.rounding.met else 0.0


@inner_kernel
def is_level(lib: LibraryArrays, word: IntArray) -> bool:
    """Whether no trim of a word climbs."""
    level = True
    for n in range(3):
        level = level and (word[n] < 0 or lib.twists[word[n], 3] == 0.0)
    return level

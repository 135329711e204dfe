"""Walls and passages for tests of connectivity; the car is 4.7 m long and 1.9 m wide."""

import math

from maneuver_automaton import Automaton, Box, Car, Problem
from maneuver_automaton.problem import Bounds

CAR = Automaton.of_controls(
    Car(wheelbase=2.7, max_steering=0.58), {"ahead": (1, 0), "back": (-1, 0), "left": (1, 0.5)}
)
BODY = Box([4.7, 1.9], [1.35, 0.0])


def walled(boxes, start, goal, bounds, **more):
    """A problem among boxes (low x, low y, high x, high y), within bounds given so too."""
    obstacles = [Box([c - a, d - b], [0.5 * (a + c), 0.5 * (b + d)]) for a, b, c, d in boxes]
    a, b, c, d = bounds
    return Problem(
        CAR,
        start,
        goal,
        obstacles=obstacles,
        footprint=BODY,
        bounds=Bounds(x=(a, c), y=(b, d)),
        **more,
    )


def gap(width):
    """A wall with a gap: it needs 1.9 m."""
    walls = [(9.8, -7, 10.2, -0.5 * width), (9.8, 0.5 * width, 10.2, 7)]
    return walled(walls, [5, 3, 0], [15, -2, 1.0], (0, -7, 20, 7))


def bend(width):
    """A right angle in a corridor: it needs (4.7 + 2 1.9) / sqrt(8) = 3.005 m."""
    walls = [(-20, -1, 16, 0), (-20, width, 16 - width, 35), (16, -1, 17, 20)]
    return walled(walls, [0, 0.5 * width, 0], [16 - 0.5 * width, 14, math.pi / 2], (-3, 0, 16, 18))


def dead_end(width):
    """A corridor with one end, to be left turned: it needs hypot(4.7, 1.9) = 5.069 m."""
    walls = [(-1, -1, 30, 0), (-1, width, 30, width + 1), (-1, -1, 0, width + 1)]
    middle = 0.5 * width
    return walled(walls, [8, middle, 0], [8, middle, math.pi], (0, 0, 20, width))


def slot(length):
    """A parallel slot: it needs 4.7 m."""
    walls = [(-20, -1.2, -0.5 * length, 1.2), (0.5 * length, -1.2, 20, 1.2), (-20, -2, 20, -1.2)]
    return walled(walls, [-5, 3.5, 0], [-1.35, -0.1, 0], (-12, -3, 12, 7))

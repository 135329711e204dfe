"""Load or compile the kernels of the search over trims and maneuvers before the clock runs."""

from __future__ import annotations

import functools

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.collision import Box, Obstacle
from maneuver_automaton.models import SecondOrderUnicycle
from maneuver_automaton.primitives.bang_bang import connect_bang_bang
from maneuver_automaton.primitives.equilibrium import trims_of
from maneuver_automaton.problem import Problem
from maneuver_automaton.search.maneuver_lattice import plan_of, search_maneuvers
from maneuver_automaton.search.maneuver_problem import maneuver_problem_query


@functools.cache
def load_maneuver_search() -> None:
    """Have the kernels of the search over trims and maneuvers ready."""
    query = maneuver_problem_query(_smallest_problem(), (0,))
    found = search_maneuvers(query, max_expansions=2000)
    assert found.best is not None
    plan_of(query, found.best)


def _smallest_problem() -> Problem:
    robot = SecondOrderUnicycle(
        max_speed=1.0, max_turn_rate=1.0, max_acceleration=1.0, max_angular_acceleration=1.0
    )
    trims = trims_of(robot, {"speed": [0.0, 1.0], "turn_rate": [-1.0, 0.0, 1.0]}).trims
    automaton = Automaton(robot, trims, connect_bang_bang(robot, trims))
    wall = Obstacle(Box([0.2, 0.2], [3.0, 1.0]))
    body = Box([0.4, 0.2])
    return Problem(automaton, [0, 0, 0], [6, 0.5, 0], obstacles=(wall,), footprint=(body,))

"""Load or compile the kernels of the search over trims and maneuvers before the clock runs."""

from __future__ import annotations

import functools

import numpy as np

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.collision import Box, Obstacle
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import UserModel
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.search.maneuver_lattice import maneuver_words
from maneuver_automaton.search.maneuver_motion import parts_of
from maneuver_automaton.search.maneuver_query import maneuver_query
from maneuver_automaton.search.maneuver_shortcuts import word_is_free
from maneuver_automaton.words.library import library_of

EXPANSIONS = 20


@functools.cache
def load_maneuver_kernels() -> None:
    """Have every kernel of the search ready: a cart that starts and stops beside a wall."""
    cart = UserModel(
        name="cart",
        group=SE2,
        control_names=("push",),
        reduced_names=("speed",),
        velocity=lambda z, u: [z[0], 0.0, 0.1 * z[0]],
        dynamics=lambda z, u: [u[0]],
    )
    rest, ahead = (
        Trim(
            name=name,
            body_velocity=np.array([v, 0.0, 0.1 * v]),
            control=np.zeros(1),
            reduced_state=np.array([v]),
        )
        for name, v in (("rest", 0.0), ("ahead", 1.0))
    )
    start = SE2.exp([0.5, 0.0, 0.05]).pose
    maneuvers = tuple(
        Maneuver(name=f"{a}-{b}", source=a, target=b, displacement=start, duration=1.0)
        for a, b in (("rest", "ahead"), ("ahead", "rest"))
    )
    automaton = Automaton(cart, (rest, ahead), maneuvers)
    query = maneuver_query(
        library_of(automaton),
        parts_of(automaton, (Box([0.4, 0.2]),)),
        [0.0, 0.0, 0.0],
        SE2.exp([3.0, 0.0, 0.3]).pose,
        start_trim="rest",
        goal_trim="ahead",
        obstacles=(Obstacle(Box([1.0, 1.0], [0.0, 5.0])),),
    )
    for incumbent in maneuver_words(query, max_expansions=EXPANSIONS):
        if incumbent.word is not None:
            word_is_free(query, incumbent.word)

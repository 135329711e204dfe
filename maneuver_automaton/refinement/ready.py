"""Load or compile the kernels that improve plans before the clock runs."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.budget import UNLIMITED
from maneuver_automaton.collision import Box, Obstacle
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import UserModel
from maneuver_automaton.primitives import Maneuver, Trajectory, Trim
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.refinement.improve import Patience, improve
from maneuver_automaton.refinement.incumbent_words import incumbent_words
from maneuver_automaton.search.choose import smallest_lattice_query
from maneuver_automaton.search.lattice import first_plan
from maneuver_automaton.search.lattice_query import lattice_query
from maneuver_automaton.search.waiting import with_waits

EXPANSIONS = 20


@functools.cache
def load_lattice() -> None:
    """Have the kernels of the lattice ready, and those that improve its plans."""
    query = smallest_lattice_query()
    found = first_plan(query)
    if found.word is None:  # a signal ended the search: nothing more is planned
        return
    with_waits(query, found.word)
    improve(query, found.word, patience=Patience(attempts=1, passes=1))


@functools.cache
def load_maneuver_kernels() -> None:
    """Have the kernels of the search over maneuvers ready: a cart that starts beside a wall."""
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
    step = SE2.exp([0.5, 0.0, 0.05]).pose
    maneuvers = tuple(
        Maneuver(
            name=f"{a.name}-{b.name}",
            source=a.name,
            target=b.name,
            displacement=step,
            duration=1.0,
            course=Trajectory(
                time=np.array([0.0, 1.0]),
                pose=np.array([np.zeros(3), step]),
                reduced_state=np.array([a.reduced_state, b.reduced_state]),
                control=np.zeros((2, 1)),
            ),
        )
        for a, b in ((rest, ahead), (ahead, rest))
    )
    problem = Problem(
        Automaton(cart, (rest, ahead), maneuvers),
        np.zeros(3),
        (Goal(pose=SE2.exp([3.0, 0.0, 0.3]).pose, trim="ahead"),),
        start_trim="rest",
        obstacles=(Obstacle(Box([1.0, 1.0], [0.0, 5.0])),),
        footprint=(Box([0.4, 0.2]),),
    )
    query = lattice_query(problem, (0,))
    for _ in incumbent_words(query, budget=replace(UNLIMITED, expansions=EXPANSIONS)):
        pass

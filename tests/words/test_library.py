"""Transfers: closed-form times of words whose trims are joined by maneuvers."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maneuver_automaton._arrays import wrapped
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import Unicycle
from maneuver_automaton.words import steer
from maneuver_automaton.words.library import library_of
from tests.reference_words import candidates
from tests.search.automata import joined_end, linked

REST, AHEAD, LEFT, RIGHT = [0.0, 0, 0], [1.0, 0, 0], [1.0, 0, 1.0], [0.8, 0, -1.0]
SIDE, SPIN, BACK = [0.2, 0.7, 0], [0.0, 0, 1.3], [-0.5, 0, 0.2]
CAR = [REST, AHEAD, LEFT, RIGHT, SIDE, SPIN, BACK]
UNICYCLE = Automaton.of_controls(
    Unicycle(),
    {"rest": (0, 0), "ahead": (1, 0), "back": (-1, 0), "slowly": (-0.5, 0)}
    | {"left": (1, 1), "left back": (-1, -1), "right": (0.7, -1), "spin": (0, 1.3)},
)


def off(end, goal):
    difference = np.asarray(end) - goal
    difference[2] = wrapped(difference[2])
    return float(np.abs(difference).max())


def poses():
    return st.builds(
        lambda x, y, turn: np.array([x, y, turn]),
        st.floats(-4.0, 4.0),
        st.floats(-4.0, 4.0),
        st.floats(-7.0, 7.0),
    )


@given(goal=poses(), trims=st.tuples(st.integers(0, 6), st.integers(0, 6)))
@settings(max_examples=30)
def test_every_transfer_ends_at_the_goal_and_costs_its_time(goal, trims):
    automaton = linked(CAR)
    library = library_of(automaton)
    rows = candidates(library, [1.0, 2, 3], goal, start_trim=trims[0], goal_trim=trims[1])
    assert rows
    assert [row.cost for row in rows] == sorted(row.cost for row in rows)
    for row in rows:
        assert (row.durations >= 0.0).all()
        end = joined_end(automaton, library, [1.0, 2, 3], row.trims, row.durations, *trims)
        assert off(end, goal) < 1e-7  # tangent circles lose half the digits
        links = [trims[0], *row.trims, trims[1]]
        between = sum(float(library.transitions.time[a, b]) for a, b in itertools.pairwise(links))
        assert row.duration == pytest.approx(row.durations.sum() + between, abs=1e-9)
        assert row.cost == pytest.approx(row.duration, abs=1e-9)


def test_without_displacements_it_is_the_steering_of_a_kinematic_vehicle():
    library, twists = library_of(UNICYCLE), UNICYCLE.body_velocities
    goal = np.array([3.0, -1.0, 2.0])
    rows = candidates(library, np.zeros(3), goal, start_trim=0, goal_trim=0)
    for word in itertools.product(range(1, len(UNICYCLE)), repeat=3):
        if not all(np.cross(twists[a], twists[b]).any() for a, b in itertools.pairwise(word)):
            continue  # the one follows the path of the other
        known = steer(twists[list(word)], goal)
        mine = np.array([row.durations for row in rows if row.trims == word]).reshape(-1, 3)
        assert len(mine) == len(known)
        for times in known:
            assert np.abs(mine - times).max(axis=1).min() < 1e-9


@given(goal=poses(), by=poses())
@settings(max_examples=30)
def test_a_moved_problem_has_the_moved_answer(goal, by):
    library = library_of(linked(CAR))
    start = np.array([0.3, 0.2, 0.1])
    here = candidates(library, start, goal, start_trim=0, goal_trim=0)
    there = candidates(
        library, (SE2(by) @ SE2(start)).pose, (SE2(by) @ SE2(goal)).pose, start_trim=0, goal_trim=0
    )
    best, moved = here[0], there[0]
    assert moved.cost == pytest.approx(best.cost, abs=1e-6)


@given(goal=poses(), bound=st.floats(0.1, 12.0))
@settings(max_examples=30)
@pytest.mark.parametrize("automaton", [UNICYCLE, linked(CAR)], ids=["at will", "by maneuvers"])
def test_a_bound_leaves_out_what_costs_as_much_and_nothing_else(automaton, goal, bound):
    library = library_of(automaton)
    every = candidates(library, np.zeros(3), goal, start_trim=0, goal_trim=0)
    some = candidates(library, np.zeros(3), goal, start_trim=0, goal_trim=0, upper_bound=bound)
    wanted = [(one.trims, one.durations.tolist()) for one in every if one.cost < bound]
    assert [(one.trims, one.durations.tolist()) for one in some] == wanted

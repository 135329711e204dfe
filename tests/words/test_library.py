"""Transfers: closed-form times of words whose trims are joined by maneuvers."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from maneuver_automaton._arrays import wrapped
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import Unicycle
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.words import steer
from maneuver_automaton.words.library import library_of
from tests.reference_words import candidates
from tests.search.automata import joined_end, linked, model_of_kinds

REST, AHEAD, LEFT, RIGHT = [0.0, 0, 0], [1.0, 0, 0], [1.0, 0, 1.0], [0.8, 0, -1.0]
SIDE, SPIN, BACK = [0.2, 0.7, 0], [0.0, 0, 1.3], [-0.5, 0, 0.2]
CAR = [REST, AHEAD, LEFT, RIGHT, SIDE, SPIN, BACK]


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


def test_numeric_roots_are_found():
    automaton = linked(CAR)
    library = library_of(automaton)
    rng = np.random.default_rng(3)
    for _ in range(40):
        word = rng.permutation(6)[:3] + 1
        if (automaton.body_velocities[word, 2] == 0.0).all():
            continue
        turning = automaton.body_velocities[word, 2] != 0.0
        period = np.where(turning, library.arrays.periods[word], 4.0)
        times = rng.uniform(0.1, 0.9, 3) * period
        goal = joined_end(automaton, library, np.zeros(3), word, times, 0, 0)

        def miss(t, word=word, goal=goal):
            end = joined_end(automaton, library, np.zeros(3), word, t, 0, 0) - goal
            return [end[0], end[1], np.sin(0.5 * end[2])]

        root = least_squares(miss, times + 1e-3 * rng.normal(size=3), xtol=1e-15, ftol=1e-15)
        rows = candidates(library, np.zeros(3), goal, start_trim=0, goal_trim=0)
        mine = [row.durations for row in rows if row.trims == tuple(word)]
        assert mine
        assert np.abs(np.array(mine) - root.x).max(axis=1).min() < 1e-6


def test_without_displacements_it_is_the_steering_of_a_kinematic_vehicle():
    car = Automaton.of_controls(
        Unicycle(), {"rest": (0, 0), "ahead": (1, 0), "left": (1, 1), "right": (0.7, -1)}
    )
    library = library_of(car)
    goal = np.array([3.0, -1.0, 2.0])
    rows = candidates(library, np.zeros(3), goal, start_trim=0, goal_trim=0)
    for word in itertools.product((1, 2, 3), repeat=3):
        if word[0] == word[1] or word[1] == word[2]:
            continue
        known = steer(car.body_velocities[list(word)], goal)
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


@pytest.mark.parametrize("word", [(), (1,), (2,), (1, 2), (2, 1), (2, 3), (1, 4), (5, 1)])
def test_words_of_fewer_trims_are_found_where_they_fit(word):
    automaton = linked(CAR)
    library = library_of(automaton)
    times = np.array([0.7, 0.4])[: len(word)]
    start = np.array([5.0, -3.0, 1.0])
    goal = joined_end(automaton, library, start, word, times, 0, 6)
    rows = candidates(library, start, goal, start_trim=0, goal_trim=6)
    mine = [row.durations for row in rows if row.trims == word]
    assert len(mine) == 1
    assert np.abs(mine[0] - times).max(initial=0.0) < 1e-9
    aside = goal + np.array([1e-3, 2e-3, 3e-3])
    rows = candidates(library, start, aside, start_trim=0, goal_trim=6)
    assert word not in [row.trims for row in rows]


@pytest.mark.parametrize("height", [0.0, 1.7, -2.5])
def test_a_vertical_trim_makes_up_for_the_altitude(height):
    up, down = [0.0, 0, 0, 0.5], [0.0, 0, 0, -0.25]
    rising = [0.8, 0, 0.6, 0.1]
    twists = [[*REST, 0.0], [*AHEAD, 0.0], [*LEFT, 0.0], rising, up, down]
    automaton = linked(twists)
    library = library_of(automaton)
    goal = np.array([2.0, 3.0, 1.0, height])
    rows = candidates(library, np.zeros(4), goal, start_trim=0, goal_trim=0)
    assert rows
    assert all(row.trims[-1] in (4, 5) for row in rows)
    assert not any(trim in (4, 5) for row in rows for trim in row.trims[:-1])
    for row in rows:
        end = joined_end(automaton, library, np.zeros(4), row.trims, row.durations, 0, 0)
        assert off(end, goal) < 1e-7


def test_altitude_that_fits_needs_no_climb():
    automaton = linked([[*REST, 0.0], [*AHEAD, 0.0], [0.0, 0, 0, 0.5]])
    library = library_of(automaton)
    goal = joined_end(automaton, library, np.zeros(4), (1,), [2.0], 0, 0)
    rows = candidates(library, np.zeros(4), goal, start_trim=0, goal_trim=0)
    assert (1,) in [row.trims for row in rows]


def test_chains_of_maneuvers_are_transitions():
    names = ("rest", "slow", "fast")
    trims = tuple(
        Trim(name=name, body_velocity=[v, 0, 0.1 * v], control=[0, 0], reduced_state=[v])
        for name, v in zip(names, (0.0, 1.0, 2.0), strict=True)
    )
    maneuvers = tuple(
        Maneuver(name=f"{a}-{b}", source=a, target=b, displacement=[x, 0.1, 0.2], duration=t)
        for a, b, x, t in [("rest", "slow", 0.5, 1.0), ("slow", "fast", 1.5, 1.0),
                           ("rest", "fast", 9.0, 5.0), ("fast", "rest", 2.0, 2.0)]
    )  # fmt: skip
    library = library_of(Automaton(model_of_kinds(), trims, maneuvers))
    assert library.chain(0, 2) == ((0, 1), (1, 2))
    assert library.arrays.transitions.cost[0, 2] == 2.0
    first, second = (SE2(maneuvers[k].displacement) for k in (0, 1))
    assert np.allclose(library.displacements([0, 2])[0, :3], (first @ second).pose, atol=1e-15)
    assert np.isfinite(library.arrays.transitions.cost).all()
    costly = library_of(
        Automaton(model_of_kinds(), trims, maneuvers), maneuver_costs=[9.0, 9.0, 1.0, 1.0]
    )
    assert costly.chain(0, 2) == ((2, 2),)


def test_trims_without_a_way_between_them_are_named():
    trims = tuple(
        Trim(name=name, body_velocity=[v, 0, 0], control=[0, 0], reduced_state=[v])
        for name, v in (("rest", 0.0), ("fast", 2.0))
    )
    library = library_of(Automaton(model_of_kinds(), trims))
    assert candidates(library, [0, 0, 0], [1, 0, 0], start_trim=0, goal_trim=1) == []
    with pytest.raises(ValueError) as error:
        library.chain(0, 1)
    assert str(error.value) == "no maneuvers lead from 'rest' to 'fast'"


def test_wrong_prices_are_refused():
    automaton = linked(CAR)
    with pytest.raises(ValueError) as error:
        library_of(automaton, rates=[1.0])
    assert str(error.value) == "rates: got shape (1,), need (7,)"
    with pytest.raises(ValueError) as error:
        library_of(automaton, maneuver_costs=[-1.0] * 42)
    assert str(error.value) == "maneuver_costs: must not be negative, got -1.0"


def test_a_large_library_is_represented_by_trims_that_differ():
    grid = [[v, 0.0, w] for v in np.linspace(-1, 1, 7) for w in np.linspace(-1, 1, 7)]
    library = library_of(linked(grid), most_trims=12)
    used = np.unique(library.arrays.tried.words)
    assert used.size == 13  # and the one that stands for none
    chosen = library.arrays.twists[used[used >= 0]]
    for twist in ([1, 0, 1, 0], [1, 0, -1, 0], [1, 0, 0, 0], [-1, 0, 0, 0], [0, 0, 1, 0]):
        assert np.abs(chosen - twist).max(axis=1).min() < 1e-12

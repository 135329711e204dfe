"""Insertion: Reeds-Shepp and Dubins lengths, agreement with exhaustive search, certificates."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.costs import Cost
from maneuver_automaton.groups import SE2, SE2xR
from maneuver_automaton.models import Unicycle, UserModel
from maneuver_automaton.problem import Goal, Horizon, Problem, SearchSettings
from maneuver_automaton.search.certificate import certificate
from maneuver_automaton.search.choose import search_insertion
from maneuver_automaton.search.result import SearchStatus, plan_of
from maneuver_automaton.search.words import search_words
from tests import reference
from tests.inertia import unicycle_automaton
from tests.quickly import quick_are
from tests.search.cases import (
    DUBINS,
    INTERPRETED,
    REEDS_SHEPP,
    VECTORS,
    compiled_only,
    end_off_goal,
    names,
    parking,
    reference_word,
    robot,
    vectors,
)

INEXACT = 5  # the file's Dubins path of this pair ends 1e-4 beside its goal
STRIDE = 80 if INTERPRETED else 4
AXIS = np.linspace(-2.0, 2.0, 9)


def best(problem, **options):
    return search_insertion(problem, problem.goals[0], **options).solutions[0]


def shortest(controls, goal):
    return Problem(robot(controls), [0, 0, 0], goal)


def grid(axis=AXIS, **options):
    return Problem(
        Automaton.of_grid(Unicycle(), [axis, axis]), [0.0, 1.0, 0.0], [0, 0, 0], **options
    )


def assert_ends_at_the_goal(problem, solution):
    distance, angle = end_off_goal(problem, solution)
    assert distance < 1e-9
    assert angle < 1e-9


# Shortest paths, from six trims and no formula for them.


@pytest.mark.skipif(not VECTORS.exists(), reason="the data are not part of the package")
@pytest.mark.parametrize(
    ("controls", "curve"), [(REEDS_SHEPP, "reeds_shepp"), (DUBINS, "dubins")], ids=["rs", "dubins"]
)
def test_shortest_lengths(controls, curve):
    for vector in list(vectors())[::STRIDE]:
        problem = shortest(controls, vector.goal)
        solution = best(problem)
        above = solution.cost - getattr(vector, curve)
        assert above > -1e-8, vector
        assert above < 1e-6 or (vector.row, curve) == (INEXACT, "dubins"), vector
        assert_ends_at_the_goal(problem, solution)


@pytest.mark.skipif(not VECTORS.exists(), reason="the data are not part of the package")
@compiled_only
def test_shortest_paths_are_certified():
    for vector in list(vectors())[16::STRIDE]:
        problem = shortest(REEDS_SHEPP, vector.goal)
        solution = best(problem)
        assert certificate(problem, problem.goals[0], solution) > -1e-7


def test_reeds_shepp_by_hand():
    assert best(shortest(REEDS_SHEPP, [3.0, 0, 0])).cost == pytest.approx(3.0)
    assert best(shortest(REEDS_SHEPP, [-2.0, 0, 0])).cost == pytest.approx(2.0)
    turn = shortest(REEDS_SHEPP, [0, 0, np.pi])
    assert best(turn).cost == pytest.approx(np.pi)
    assert len(best(turn).trims) == 3


def test_dubins_by_hand():
    behind = shortest(DUBINS, [-1.0, 0, 0])
    assert best(behind).cost == pytest.approx(2.0 * np.pi + 1.0, abs=1e-6)
    aside = best(shortest(DUBINS, [0.0, 4.0, np.pi]))
    assert aside.cost == pytest.approx(np.pi + 2.0)


# Where exhaustive search is affordable.


@pytest.mark.parametrize(
    ("cost", "horizon", "least_equal"),
    [
        (Cost(effort=1.0, norm=0.5), {}, 15),
        (Cost(time=1.0), {"time": None}, 15),
        (Cost(effort=1.0, norm=0.5), {"time": None}, 11),
    ],
    ids=["fixed time", "minimum time", "effort"],
)
@compiled_only
def test_agrees_with_exhaustive_search(cost, horizon, least_equal):
    rng = np.random.default_rng(1)
    equal = 0
    for _ in range(15):
        problem = replace(parking(cost=cost, **horizon), start=rng.uniform(-2.0, 2.0, 3))
        exhaustive = search_words(problem, problem.goals[0]).solutions[0]
        inserted = best(problem)
        assert_ends_at_the_goal(problem, inserted)
        assert len(inserted.trims) <= 4
        assert inserted.cost > exhaustive.cost - 1e-9
        equal += inserted.cost < exhaustive.cost + 1e-8
    assert equal >= least_equal  # an upper bound elsewhere: insertion proves no global optimum


# Certificates.


def test_a_binding_number_of_trims_is_reported():
    problem = parking()
    solution = best(problem)
    assert len(solution.trims) == 4
    assert solution.certificate < -0.1
    reported = certificate(problem, problem.goals[0], solution)
    assert reported == pytest.approx(solution.certificate, abs=1e-6)
    assert best(parking(max_trims=None)).cost < solution.cost


@pytest.mark.parametrize("max_trims", [4, None])
@compiled_only
def test_the_certificate_is_the_smallest_reduced_cost(max_trims):
    problem = parking(max_trims=max_trims)
    solution = best(problem)
    word, times = reference_word(problem, solution)
    prices = reference.multipliers(word, times)
    library, rates = problem.automaton.body_velocities, problem.rates
    brute = reference.least_reduced_cost(library, rates, word, times, prices, samples=60)
    reported = certificate(problem, problem.goals[0], solution)
    assert brute > reported - 1e-6
    assert brute == pytest.approx(reported, abs=5e-3)  # samples are coarse


@pytest.mark.parametrize("second", [(1.0, 0, 0), (1.0, 0, -1.0)], ids=["straight", "turn"])
def test_where_multipliers_are_not_unique_the_best_are_taken(second):
    # two trims do not fix the three prices, and the first that come to hand show a gain of 0.17
    goal = SE2.exp([0.4, 0, 0.4]) @ SE2.exp(0.7 * np.array(second))
    problem = shortest(REEDS_SHEPP, goal.pose)
    solution = best(problem)
    assert solution.durations == pytest.approx([0.4, 0.7])
    assert certificate(problem, problem.goals[0], solution) > -1e-7


def test_a_solution_that_is_not_optimal_has_a_negative_certificate():
    problem = parking(max_trims=None)
    second = search_words(parking(), problem.goals[0], alternatives=1).solutions[1]
    assert certificate(problem, problem.goals[0], second) < -0.1


# Grids of trims.


def test_a_straight_ahead_goal_on_a_grid():
    # between the speeds 1 and 1.5 the average is 1.25: linear interpolation of the effort
    problem = replace(
        grid(cost=Cost(effort=1.0), horizon=Horizon(time=1.6)), start=np.array([-2.0, 0.0, 0.0])
    )
    solution = best(problem)
    assert solution.cost == pytest.approx(1.6 * 0.5 * (1.0 + 1.5**2), abs=1e-9)
    assert certificate(problem, problem.goals[0], solution) > -1e-9


@compiled_only
def test_finer_grids_are_no_dearer_with_few_trims():
    horizon = Horizon(time=8.0, max_trims=6)
    coarse, fine = (
        best(
            grid(
                np.linspace(-2.0, 2.0, n).round(9), cost=Cost(effort=1.0, norm=0.5), horizon=horizon
            )
        )
        for n in (21, 41)
    )
    assert fine.cost < coarse.cost + 1e-9


@compiled_only
def test_a_goal_on_an_arc_may_have_a_cheaper_word():
    goal = SE2.exp([1.5, 0, 1.5]).pose
    problem = Problem(
        Automaton.of_grid(Unicycle(), [AXIS, AXIS]), [0, 0, 0], goal, cost=Cost(effort=1.0),
        horizon=Horizon(time=8.0),
    )  # fmt: skip
    # half of the turn on the spot, straight along the chord, the other half: at half speed each
    chord = 2.0 * np.sin(0.75) / 0.5
    assert best(problem).cost == pytest.approx(0.25 * (3.0 + chord), abs=1e-6)


# Limits and corners.


def test_alternatives_are_different_words_by_rising_cost():
    problem = parking()
    result = search_insertion(problem, problem.goals[0], alternatives=3)
    words = [names(problem, s) for s in result.solutions]
    costs = [s.cost for s in result.solutions]
    assert len(set(words)) == len(words)
    assert costs == sorted(costs)
    assert not result.complete
    assert not result.exhaustive


@compiled_only
def test_free_heading():
    problem = parking(max_trims=None)
    problem = replace(problem, goals=(Goal(pose=[0, 0, 0], free_heading=True),))
    solution = best(problem)
    distance, _ = end_off_goal(problem, solution)
    assert distance < 1e-9
    assert solution.cost < best(parking(max_trims=None)).cost
    assert certificate(problem, problem.goals[0], solution) > -1e-7


def test_a_goal_out_of_reach():
    ahead = Problem(robot({"ahead": (1.0, 0.0), "fast": (2.0, 0.0)}), [0, 0, 0], [1.0, 1.0, 0])
    result = search_insertion(ahead, ahead.goals[0])
    assert result.status is SearchStatus.EXHAUSTED
    assert result.solutions == ()


# Every vehicle.

VEHICLES = {
    "at will": lambda: parking(max_trims=None),
    "maneuvers": lambda: Problem(unicycle_automaton(), [0.0, 0.0, 0.0], [5.0, 1.0, 1.0]),
}


@compiled_only
@pytest.mark.parametrize("name", VEHICLES)
def test_what_costs_as_much_as_a_known_plan_is_left_out(name):
    problem = VEHICLES[name]()
    cost = best(problem).cost
    for upper_bound, found in ((cost * (1.0 + 1e-6), True), (cost, False)):
        result = search_insertion(problem, problem.goals[0], upper_bound=upper_bound)
        assert bool(result.solutions) == found
        assert (result.status is SearchStatus.FOUND) == found


@compiled_only
@pytest.mark.parametrize("name", VEHICLES)
def test_a_known_plan_is_improved(name):
    problem = VEHICLES[name]()
    costly = search_insertion(problem, problem.goals[0], alternatives=8).solutions[-1]
    known = plan_of(problem, costly)
    first = replace(problem, search=SearchSettings(max_expansions=1))
    found = search_insertion(first, first.goals[0], known=known).solutions
    assert found[0].cost <= costly.cost + 1e-9


@compiled_only
@pytest.mark.parametrize("name", VEHICLES)
def test_trims_last_as_long_as_they_have_to(name):
    problem = VEHICLES[name]()
    problem = replace(problem, horizon=Horizon(max_trims=4, min_coast=0.3))
    for solution in search_insertion(problem, problem.goals[0], alternatives=2).solutions:
        moving = problem.automaton.body_velocities[solution.trims].any(axis=1)
        coasted = solution.durations[moving & (solution.durations > 0.0)]
        assert (coasted >= 0.3 - 1e-9).all()


# Compiled and interpreted kernels.

CASES = """
import json, sys
import numpy as np
from maneuver_automaton.search.choose import search_insertion
from maneuver_automaton.search.words import search_words
from maneuver_automaton.words import solve_switching_times, steer
from tests.search.cases import *
answers = []
for problem in (parking(), parking(REVERSED_SPIN), parking(cost=Cost(time=1.0), time=None)):
    for solution in search_words(problem, problem.goals[0], alternatives=3).solutions:
        answers.append([solution.trims.tolist(), solution.durations.tolist(), solution.cost])
for problem in (parking(), parking(max_trims=None)):
    solution = search_insertion(problem, problem.goals[0], seeds=3).solutions[0]
    answers.append([solution.trims.tolist(), solution.durations.tolist(), solution.cost])
left, ahead, right = [1, 0, 1], [1, 0, 0], [1, 0, -1]
for triple in ([left, ahead, right], [left, right, left], [ahead, left, right]):
    answers.append([[], steer(triple, [2.5, 1.0, 0.3]).ravel().tolist(), 0.0])
solved = solve_switching_times([left, ahead, right, left], [1, 1, 1, 2], [2.5, 1.0, 0.3])
answers.append([[], solved.durations.tolist(), solved.cost])
json.dump(answers, sys.stdout)
"""


@pytest.mark.exhaustive
@pytest.mark.slow
@compiled_only
def test_interpreted_kernels_give_the_compiled_results():
    answers = {}
    for interpreted in ("0", "1"):
        done = subprocess.run(
            [sys.executable, "-W", "error", "-c", CASES],
            env=os.environ | {"NUMBA_DISABLE_JIT": interpreted},
            cwd=Path(__file__).parents[2],
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        answers[interpreted] = json.loads(done.stdout)
    assert len(answers["0"]) == len(answers["1"]) > 15
    for (word, times, cost), (again, later, price) in zip(answers["0"], answers["1"], strict=True):
        assert again == word
        assert later == pytest.approx(times, abs=1e-8)
        assert price == pytest.approx(cost, abs=1e-10)


@compiled_only
@pytest.mark.parametrize("most", [4, 6])
@pytest.mark.parametrize("start", [[0.0, 1.0, 0.0], [0.0, 0.5, 0.0], [-1.2, 0.7, 2.0]])
def test_a_moved_problem_has_the_moved_word_under_a_limit(start, most):
    """Mirrored words cost the same: which one is found must not hang on the last bit."""
    horizon = Horizon(time=8.0, max_trims=most)
    library = Automaton.of_grid(Unicycle(), [AXIS, AXIS])
    problem = Problem(library, start, [0.0, 0.0, 0.0], cost=Cost(effort=1.0), horizon=horizon)
    here = search_insertion(problem, problem.goals[0]).solutions[0]
    for by in ([3.0, -2.0, 0.7], [40.0, 7.0, -2.9]):
        moved = problem.moved(SE2(by))
        there = search_insertion(moved, moved.goals[0]).solutions[0]
        assert there.trims.tolist() == here.trims.tolist()
        assert there.cost == pytest.approx(here.cost, abs=1e-9)
        np.testing.assert_allclose(there.durations, here.durations, atol=1e-7)


@compiled_only
@pytest.mark.parametrize("size", quick_are([1.0, 1e-4], [1.0, 1e-4, 1e-7]))
def test_the_end_is_exact_however_near_the_goal(size):
    goal = np.array([0.3, 0.2, 0.5]) * size
    library = Automaton.of_grid(Unicycle(), [AXIS, AXIS])
    problem = Problem(library, [0, 0, 0], goal, cost=Cost(effort=1.0, time=1.0))
    found = search_insertion(problem, problem.goals[0]).solutions[0]
    twists = library.body_velocities[found.trims]
    np.testing.assert_allclose(reference.plain_end(twists, found.durations), goal, atol=1e-14)


@compiled_only
@pytest.mark.parametrize("time", [None, 9.0])
@pytest.mark.parametrize("free", [True, False])
def test_a_climb_begins_with_as_many_trims_as_it_has_conditions(free, time):
    """Place, altitude and heading are four; without rest, detours fill up a time that is fixed."""
    craft = {
        "ahead": (1, 0, 0, 0),
        "left": (1, 0, 1, 0),
        "right": (1, 0, -1, 0),
        "up": (0, 0, 0, 1),
    }
    model = UserModel(
        name="craft", group=SE2xR, control_names=tuple("abcd"), velocity=lambda _, u: np.asarray(u)
    )
    goal = Goal(pose=[3.0, 2.0, 1.0, 2.0], free_heading=free)
    horizon = Horizon(time=time)
    problem = Problem(Automaton.of_controls(model, craft), [0, 0, 0, 0], goal, horizon=horizon)
    plan = plan_of(problem, best(problem))
    assert plan.end[[0, 1, 3]] == pytest.approx([3.0, 2.0, 2.0], abs=1e-9)
    assert plan.duration == pytest.approx(time or plan.duration, abs=1e-9)

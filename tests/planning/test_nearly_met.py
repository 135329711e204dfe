"""Goals that the checks take for met, though an exact end is whole turns away, or nowhere."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest

import maneuver_automaton as ma

ROBOTS = {
    "dubins": {"ahead": (1, 0), "left": (1, 1), "right": (1, -1)},
    "left only": {"ahead": (1, 0), "left": (1, 1)},
    "both ways": {"ahead": (1, 0), "left": (1, 1), "right": (1, -1), "back": (-1, 0)},
    "spin": {"rest": (0, 0), "ahead": (1, 0), "spin": (0, 1)},
}

SIN, COS = math.sin(1.4), 1.0 - math.cos(1.4)  # where a turn of 1.4 rad ends


def robot(name):
    return ma.Automaton.of_controls(ma.Unicycle(), ROBOTS[name])


def near_misses(automaton, seed):
    """A start, a goal beside the end of a word of at most two trims, and that word's plan."""
    rng = random.Random(seed)
    far = rng.choice([0.0, 10.0, 5e6])  # the last is as coordinates of UTM are
    start = np.array([rng.uniform(-1, 1) * far, rng.uniform(-1, 1) * far, rng.uniform(-3, 3)])
    trims = [trim for trim in automaton.trims if not trim.is_rest]
    word = [rng.choice(trims) for _ in range(rng.choice([0, 0, 1, 2]))]
    lasting = [rng.choice([rng.uniform(0.3, 2.5), 10 ** rng.uniform(-9, -8)]) for _ in word]
    plan = ma.Plan(start, word, durations=lasting)
    size, way, turn = (
        10 ** rng.uniform(-12, -9.05),
        rng.uniform(-math.pi, math.pi),
        rng.choice([-1, 0, 1]),
    )
    off = [size * math.cos(way), size * math.sin(way), turn * 10 ** rng.uniform(-12, -9.05)]
    return start, plan.end + np.array(off), plan


@pytest.mark.parametrize("name", ROBOTS)
def test_what_passes_the_checks_is_found(name):
    automaton = robot(name)
    for seed in range(12):
        start, goal, known = near_misses(automaton, seed)
        problem = ma.Problem(automaton, start, goal)
        if ma.verify(problem, known).passed:
            result = ma.plan(problem)
            assert result.cost is not None, seed
            assert result.cost <= known.duration + 1e-6, seed
            assert ma.verify(problem, result.plan).passed, seed


@pytest.mark.parametrize(
    ("name", "goal", "cost"),
    [
        ("dubins", ma.Goal([5e-9, 4e-10, 0], free_heading=True), 5e-9),
        ("dubins", ma.Goal([2e-9, 9e-10, 0], free_heading=True), 2e-9),
        ("left only", ma.Goal([2, -7e-10, 0], free_heading=True), 2.0),  # beside one straight,
        ("left only", ma.Goal([SIN - 3e-10 * SIN, COS + 3e-10, 0], free_heading=True), 1.4),  # turn
        ("spin", ma.Goal([1.4e-6, 1.3e-10, 0], free_heading=True), 1.4e-6),
        ("dubins", [SIN, COS, 1.4 + 8.5e-10], 1.4),  # off in place, or in heading
        ("left only", [SIN + 3 * np.cos(1.4), COS + 3 * np.sin(1.4), 1.4 - 9e-10], 4.4),
    ],
)
def test_nor_does_a_goal_off_in_place_and_heading_cost_a_turn(name, goal, cost):
    assert ma.plan(ma.Problem(robot(name), [0, 0, 0], goal)).cost == pytest.approx(cost, abs=1e-8)


def test_a_moved_problem_has_the_moved_plan():
    problem = ma.Problem(robot("left only"), [0, 0, 0], [2.0, 4e-10, 0])
    moved = problem.moved(ma.SE2([3.0, -1.0, 2.0]))
    assert ma.plan(problem).plan.word == ma.plan(moved).plan.word == ("ahead",)


@pytest.mark.parametrize("time", [None, 3.0])
def test_a_vehicle_with_inertia_that_is_almost_there_stays(time):
    model = ma.SecondOrderUnicycle(
        max_speed=1, max_turn_rate=1, max_acceleration=1, max_angular_acceleration=1
    )
    trims = ma.trims_of(model, {"speed": [-1, 0, 1], "turn_rate": [0]}).trims
    library = ma.build_library(model, trims).automaton
    for off in (0.0, 5e-10):
        stated = ma.Problem(library, [0, 0, 0], [0, off, 0], horizon=ma.Horizon(time=time))
        result = ma.plan(stated)
        assert result.plan.duration == (time or 0.0)
        assert (result.plan.pose_at([0.0, 1.0, 2.0]) == 0.0).all()


def test_an_obstacle_in_the_way_counts_as_ever():
    wall = ma.Box([0.2, 0.2], [1.0, 0.0])
    problem = ma.Problem(
        robot("dubins"), [0, 0, 0], [2.0, 4e-10, 0], obstacles=wall, footprint=ma.Disc(0.1)
    )
    result = ma.plan(problem, time_limit=1.0)
    assert result.cost > 2.05
    assert result.audit.passed


def test_with_inertia_a_goal_a_few_nanometres_ahead_is_polished_to_a_moment():
    """Kinematic paths to it do not move: they are no guesses, and broke off the call."""
    library = ma.load_stock_library("second_order_unicycle")
    search = ma.SearchSettings(max_expansions=300)
    result = ma.plan(ma.Problem(library, [0, 0, 0], [4e-9, 0, 0], search=search), time_limit=60)
    assert result.plan is not None, result.reason
    assert result.cost < 0.1


def test_a_goal_that_no_word_is_found_to_end_at_may_be_met_all_the_same():
    """All words of two trims were searched, none was kept, and the first of none was asked for."""
    controls = {"ahead": (0.5, 0.0), "back": (-1.0, 0.0), "left": (1.0, 0.6)}
    car = ma.Automaton.of_controls(ma.Car(wheelbase=1.0, max_steering=0.8), controls)
    start = [0.11117368254380927, 0.004233956488228028, -6.207053778064691]
    goal = [0.6402014902193464, 0.1476574797471499, -5.829828934702276]
    result = ma.plan(ma.Problem(car, start, goal, horizon=ma.Horizon(max_trims=2)))
    assert result.plan is not None
    assert result.lower_bound <= result.cost

"""Libraries made to measure."""

from __future__ import annotations

import math

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton.design import reeds_shepp_length
from maneuver_automaton.planning import plan
from tests.search.cases import DUBINS, REEDS_SHEPP, robot

CAR = ma.Car(wheelbase=2.8, max_steering=0.6, max_speed=2.0)
STEERING = np.linspace(-0.6, 0.6, 13)
LEVELS = ma.Automaton.of_grid(CAR, [[-1.0, 1.0], STEERING])
TASKS = np.array([[[1.0, 2.0, 0.3], [3.0, 5.0, 1.0]], [[0.0, 0.0, 0.0], [-6.0, 1.0, 0.0]]])


def names(designed):
    return set(designed.automaton.trim_names)


def test_six_trims_are_enough_for_length():
    # Reeds, Shepp (1990): straight and full lock, in both gears, whatever lies between
    designed = ma.design_library(LEVELS)
    assert names(designed) == {f"speed {v}, steering {s}" for v in (-1, 1) for s in (-0.6, 0, 0.6)}
    assert (designed.factor, designed.any_length, designed.holds) == (1.0, 1.0, True)
    assert designed.candidates == 26
    assert designed.by_size == ((4, 3.0), (6, 1.0))


def test_three_are_enough_without_reverse():
    # Dubins (1957)
    forward = ma.Automaton.of_grid(CAR, [[0.5, 1.0], STEERING])
    designed = ma.design_library(forward, max_trims=3, radius=10.0)
    assert len(designed.automaton) == 3
    assert designed.factor == 1.0
    assert designed.words.boxes == 0


@pytest.mark.slow
def test_words_of_five_trims_lose_nothing_and_words_of_four_little():
    five = ma.design_library(LEVELS, max_trims=5, radius=15.0)
    assert five.factor == 1.0
    near = ma.design_library(LEVELS, max_trims=4, radius=10.0)
    assert near.factor == 1.0
    four = ma.design_library(LEVELS, max_trims=4, radius=12.5, tolerance=0.04)
    assert 1.0 < four.words.sampled <= four.factor <= 1.05
    assert four.holds
    assert four.words.turning_radius == pytest.approx(CAR.turning_radius)
    assert four.words.least == pytest.approx(0.5 * CAR.turning_radius)


@pytest.mark.exhaustive
@pytest.mark.slow
def test_what_does_not_hold_is_handed_over_all_the_same():
    designed = ma.design_library(LEVELS, max_trims=3, radius=8.0, tolerance=0.1)
    assert not designed.holds
    assert 1.44 < designed.words.sampled < designed.factor < 1.55
    few = ma.design_library(LEVELS, most=4, within=1.05)
    assert (len(few.automaton), few.factor, few.holds) == (4, 3.0, False)


def test_straights_alone_follow_no_turn():
    with pytest.raises(ValueError, match="no library of at most 2 trims follows all 26 candidates"):
        ma.design_library(LEVELS, most=2)


def test_twelve_trims_are_enough_where_the_cost_is_round():
    speeds = np.linspace(-2.0, 2.0, 41)
    robots = ma.Automaton.of_grid(ma.Unicycle(), [speeds, speeds])
    designed = ma.design_library(robots, cost=ma.Cost(effort=1.0, time=1.0), most=12)
    assert len(designed.automaton) == 12
    assert 1.03 < designed.factor < 1.05


def test_a_speed_for_every_curve():
    # time, the lateral acceleration limited: fast where straight, slow at full lock
    speeds = np.linspace(-10.0, 10.0, 21)
    car = ma.Car(wheelbase=2.8, max_steering=0.6)
    every = ma.Automaton.of_grid(car, [speeds, np.linspace(-0.6, 0.6, 25)])
    held = np.abs(every.body_velocities[:, 0] * every.body_velocities[:, 2]) <= 2.0
    slow = ma.Automaton(car, tuple(t for t, ok in zip(every.trims, held, strict=True) if ok))
    designed = ma.design_library(slow, cost=ma.Cost(time=1.0))
    assert len(designed.automaton) <= 14
    assert designed.holds
    assert {"speed 10, steering 0", "speed -10, steering 0"} <= names(designed)


def test_plans_of_a_designed_library_keep_the_factor():
    speeds = np.linspace(-1.0, 1.0, 9)
    cost = ma.Cost(effort=1.0, time=1.0)
    every = ma.Automaton.of_grid(ma.Unicycle(), [speeds, speeds])
    designed = ma.design_library(every, cost=cost, within=1.2)
    rng = np.random.default_rng(0)
    for goal in rng.uniform([-2.0, -2.0, -3.0], [2.0, 2.0, 3.0], size=(5, 3)):
        few = plan(ma.Problem(designed.automaton, [0, 0, 0], goal, cost=cost), time_limit=1.0)
        all_of_them = plan(ma.Problem(every, [0, 0, 0], goal, cost=cost), time_limit=1.0)
        assert few.cost <= 1.2 * all_of_them.cost * 1.02  # 2 %: words of a few switches


@pytest.mark.parametrize(("x", "y", "heading"), [(3.0, -2.0, 1.0), (1e3, 5.0, -3.0)])
def test_moved_tasks_have_the_same_library(x, y, heading):
    moved = (ma.SE2([x, y, heading]) @ ma.SE2(TASKS)).pose
    here = ma.design_library(LEVELS, max_trims=4, tasks=TASKS)
    there = ma.design_library(LEVELS, max_trims=4, tasks=moved)
    assert names(here) == names(there)
    assert here.words.radius == pytest.approx(math.hypot(6.0, 1.0))
    assert there.words.radius == pytest.approx(here.words.radius)
    assert there.factor == pytest.approx(here.factor, abs=1e-6)


def test_the_price_of_a_metre_changes_nothing():
    one, two = (ma.design_library(LEVELS, cost=ma.Cost(length=price)) for price in (1.0, 7.0))
    assert names(one) == names(two)
    assert two.factor == pytest.approx(one.factor)


def test_time_at_one_speed_is_length():
    box = ma.Automaton.of_grid(ma.Unicycle(), [np.linspace(-1, 1, 5), np.linspace(-2, 2, 5)])
    designed = ma.design_library(box, cost=ma.Cost(time=1.0), max_trims=4, radius=1.2)
    assert len(designed.automaton) == 6
    assert designed.words.turning_radius == 0.5
    assert designed.factor <= 1.05


def test_the_library_plans_as_the_proof_says():
    designed = ma.design_library(LEVELS, max_trims=5, radius=10.0)
    goal = np.array([1.0, 3.0, 0.5])
    problem = ma.Problem(designed.automaton, [0, 0, 0], goal, cost=ma.Cost(length=1.0))
    shortest = reeds_shepp_length(goal, radius=CAR.turning_radius)
    assert plan(problem, time_limit=1.0).cost == pytest.approx(float(shortest), rel=1e-6)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"within": 0.9}, "within must be at least 1, got 0.9"),
        ({"most": 0}, "most must be at least 1, got 0"),
        ({"max_trims": 2, "radius": 5.0}, "max_trims must be at least 3"),
        ({"max_trims": 4}, "radius: max_trims needs a radius of goals"),
        ({"max_trims": 4, "radius": -1.0}, "radius must be positive, got -1.0 m"),
        ({"max_trims": 4, "radius": 5.0, "least": 0.0}, "least must be positive, got 0.0 m"),
        ({"max_trims": 4, "tasks": [[0, 0, 0]]}, r"tasks have shape \(1, 3\), need \(n, 2, 3\)"),
        ({"cost": ma.Cost(length=1.0, switch=1.0)}, "prices of switch and direction_change"),
        ({"cost": ma.Cost(effort=1.0), "max_trims": 4, "radius": 5.0}, "has no closed form"),
    ],
)
def test_what_cannot_be_designed_is_said(options, message):
    with pytest.raises(ValueError, match=message):
        ma.design_library(LEVELS, **options)


def test_candidates_that_cannot_be_designed_with():
    with pytest.raises(ValueError, match="all candidates rest"):
        ma.design_library(robot({"rest": (0.0, 0.0)}))
    with pytest.raises(ValueError, match="'spin' moves and costs nothing"):
        ma.design_library(robot(REEDS_SHEPP | {"spin": (0.0, 1.0)}))
    with pytest.raises(ValueError, match="are joined by maneuvers"):
        ma.design_library(ma.load_stock_library("second_order_car"))
    every = ma.Automaton.of_grid(ma.Unicycle(), [np.linspace(-1.0, 1.0, 51)] * 2)
    with pytest.raises(ValueError, match="need at most 2000"):
        ma.design_library(every)


def test_a_library_that_is_minimal_stays():
    for controls in (REEDS_SHEPP, DUBINS):
        designed = ma.design_library(robot(controls))
        assert names(designed) == set(controls)
        assert designed.factor == 1.0

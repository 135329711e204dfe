"""Large libraries among obstacles: what all trims gain, and what is promised of such plans."""

from __future__ import annotations

import functools
import math
from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.collision import Box, Disc, Obstacle, Polygon
from maneuver_automaton.costs import Cost
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import Car, Unicycle
from maneuver_automaton.planning import PlanStatus, plan
from maneuver_automaton.problem import Bounds, Horizon, Problem, SearchSettings
from maneuver_automaton.search.lattice_trims import at_two_paces, coarse_trims
from maneuver_automaton.words.library import moving_trims
from tests.planning.test_among_obstacles import assert_moved
from tests.quickly import quick_are
from tests.search.cases import compiled_only
from tests.solids import check_plan

pytestmark = compiled_only
LIMIT = 60.0  # [s] a limit that a busy machine does not reach
SEARCH = SearchSettings(max_expansions=1500)
AXIS = np.round(np.linspace(-1.0, 1.0, 41), 12)
GRID = Automaton.of_grid(Unicycle(), [AXIS, AXIS])
CAR = Automaton.of_grid(Car(wheelbase=1.0, max_steering=0.6), [AXIS, 0.6 * AXIS])
BLOCKS = (
    Obstacle(Box([2.0, 0.4], [2.0, 0.6], 0.4)),
    Obstacle(Disc(0.5, [3.4, -0.9])),
    Obstacle(Polygon([[0.7, -2.8], [1.3, -2.8], [1.3, -0.8], [0.7, -0.8]])),
)
MIXED, TIME, EFFORT = Cost(time=1.0, effort=1.0), Cost(time=1.0), Cost(effort=1.0)
BASE = Problem(
    GRID, [0, 0, 0], [4.5, 1.0, 0.5], obstacles=BLOCKS, footprint=(Box([0.8, 0.5]),), search=SEARCH,
    cost=MIXED,
)  # fmt: skip
CASES = {
    "time": replace(BASE, cost=TIME),
    "mixed": BASE,
    "car": replace(BASE, automaton=CAR),
    "effort in a fixed time": replace(BASE, cost=EFFORT, horizon=Horizon(time=12.0)),
    "effort in a longest time": replace(BASE, cost=EFFORT, horizon=Horizon(max_time=12.0)),
    "switches cost": replace(BASE, cost=replace(MIXED, switch=0.2, direction_change=0.3)),
    "few trims": replace(BASE, horizon=Horizon(max_trims=6)),
    "least times": replace(BASE, horizon=Horizon(min_coast=0.3)),
    "any heading": replace(BASE, goals=(replace(BASE.goals[0], free_heading=True),)),
    "two parts": replace(BASE, footprint=(Box([0.8, 0.3]), Disc(0.25, [0.2, 0.0]))),
    "bounds": replace(BASE, bounds=Bounds(x=(-0.5, 5.0), y=(-0.5, 2.0)), margin=0.05),
}

QUICK = ("mixed", "any heading", "effort in a longest time")


@functools.cache
def planned(name):
    return plan(CASES[name], time_limit=LIMIT)


@pytest.mark.parametrize("name", quick_are(QUICK, CASES))
def test_a_plan_keeps_all_promises(name):
    """Clear of everything by shapely, in bounds, at the goal, of trims of the library, in time."""
    problem, result = CASES[name], planned(name)
    assert result.status is PlanStatus.FOUND, result.reason
    assert check_plan(problem, result.plan, result.goal_index).passes(problem, result.goal_index)
    assert result.audit.passed
    assert set(result.plan.word) <= set(problem.automaton.trim_names)
    assert result.cost == pytest.approx(problem.cost_of(result.plan), rel=1e-9)
    assert result.lower_bound <= result.cost
    horizon, lasting = problem.horizon, result.plan.durations[result.plan.durations > 0.0]
    if horizon.time is not None:
        assert result.plan.duration == pytest.approx(horizon.time, abs=1e-8)
    assert result.plan.duration <= (horizon.max_time or math.inf) * (1.0 + 1e-9)
    assert len(lasting) <= (horizon.max_trims or math.inf)
    assert lasting.min() >= horizon.min_coast - 1e-9


@pytest.mark.parametrize(
    "name",
    quick_are(["mixed"], ["mixed", "car", "switches cost"], exhaustive=True),
)
def test_all_trims_are_never_dearer_than_the_few_that_are_searched(name):
    """The searches are those of the few, expansion by expansion; the others only gain."""
    problem = CASES[name]
    known = moving_trims(problem.automaton, problem.cost)
    rows = known.trims[coarse_trims(known.twists, known.rates)]
    trims = tuple(problem.automaton.trims[k] for k in rows)
    few = plan(
        replace(problem, automaton=Automaton(problem.automaton.model, trims)), time_limit=LIMIT
    )
    assert planned(name).cost <= few.cost * (1.0 + 1e-9)


def test_trims_between_the_few_gain():
    """A turn as wide as the place allows costs less than sharp turns and straights."""
    known = moving_trims(GRID, MIXED)
    few = {GRID.trim_names[k] for k in known.trims[coarse_trims(known.twists, known.rates)]}
    assert not set(planned("mixed").plan.word) <= few


@pytest.mark.slow
def test_an_effort_is_spread_over_the_time_there_is():
    """By hand: the path of least time at its pace costs its square; to fill T is to go slower."""
    fast = planned("time")
    for name in ("effort in a fixed time", "effort in a longest time"):
        problem, result = CASES[name], planned(name)
        assert result.cost < 0.75 * problem.cost_of(fast.plan)
        assert result.plan.duration > 0.95 * 12.0


def test_a_moved_problem_has_the_moved_plan():
    assert assert_moved(CASES["mixed"], SE2([3.0, -2.0, 0.7]))


@pytest.mark.parametrize(
    ("durations", "most_time"), [([1.86, 2.22], 5.06), ([1.07, 0.54], 1.94)], ids=str
)
def test_a_word_fills_its_time_to_the_last_digit(durations, most_time):
    """Driving slows down, turning on the spot does not: what rounding leaves over is no time."""
    twists = np.array([[1.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.0, 1.0]])
    word, paces = np.array([0, 2]), (np.array([1, 2]), np.array([0, 2]))
    driven = at_two_paces(twists, word, np.array(durations), paces, most_time)
    assert sum(t for _, t in driven) == pytest.approx(most_time, rel=1e-12)
    assert {row for row, _ in driven} == {0, 1, 2}


def test_a_wide_turn_saves_a_switch_round_a_corner():
    """No three of the sharpest turns and straights get past the blocks, three wider ones do."""
    car = Car(wheelbase=1.0, max_steering=math.atan(1.0))
    every = {f"{k}": (1.0, math.atan(k / 6.0)) for k in range(-6, 7)}
    few = {name: every[name] for name in ("-6", "-2", "0", "1", "2", "5")}
    blocks = (
        Obstacle(Box([0.98, 1.66], [4.49, 1.79])),
        Obstacle(Box([1.26, 0.52], [5.75, 0.78])),
        Obstacle(Box([0.65, 0.66], [7.47, 3.58])),
    )
    less, more = (
        plan(
            Problem(Automaton.of_controls(car, controls), [0, 0, 0], [8.48, 2.83, 1.26],
                    obstacles=blocks, cost=Cost(time=1.0, switch=0.3), footprint=(Box([0.5, 0.3]),),
                    search=SearchSettings(max_expansions=200)),
            time_limit=LIMIT,
        )
        for controls in (few, every)
    )  # fmt: skip
    assert more.cost <= less.cost * (1.0 + 1e-9)


def test_of_many_trims_those_that_reach_farthest_in_their_own_direction_are_searched():
    """By hand: between ahead and a steep drift a shallow one gains a quarter on both by turns."""
    twists = np.array([[1.0, 0.0, 0.0], [0.36, 0.93, 0.0], [0.83, 0.56, 0.0], [0.6, 0.4, 0.0]])
    assert coarse_trims(twists, np.ones(4)).tolist() == [0, 1, 2]

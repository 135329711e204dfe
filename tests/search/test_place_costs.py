"""What places cost, in searches: the same as along the plan, and worth a detour."""

import math
from dataclasses import replace

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton.groups import SE2
from maneuver_automaton.search.lattice import forward_word, reversed_query
from maneuver_automaton.search.lattice_pass import with_cost
from maneuver_automaton.search.lattice_query import lattice_query
from maneuver_automaton.words.word import Word, plan_of, word_of_plan
from tests.search.cases import compiled_only

TURNS = {"ahead": (1, 0), "left": (1, 0.3), "right": (1, -0.3), "back": (-1, 0), "rest": (0, 0)}
CAR = ma.Automaton.of_controls(ma.Unicycle(), TURNS)
BODY = ma.Box([4.0, 2.0])
RNG = np.random.default_rng(3)
PILLARS = tuple(ma.Disc(0.4, RNG.uniform(-12, 12, 2)) for _ in range(12)) + tuple(
    ma.Box(RNG.uniform(0.5, 2.0, 2), RNG.uniform(-12, 12, 2), heading=1.0) for _ in range(12)
)


class Uphill:
    """A slope towards y, dearer upwards, in a vehicle's own words."""

    per = "metre"

    def rates(self, poses, velocities):
        climb = np.sin(poses[..., 2]) * np.sign(velocities[..., 0])
        return np.maximum(2.0 * climb, 0.0)


class Slow:
    """Time that costs more to the right."""

    per = "second"

    def rates(self, poses, velocities):
        return 0.5 + 0.3 * np.tanh(0.3 * poses[..., 0])


COSTS = {
    "clearance": ma.Clearance(3.0, 1.2),
    "seconds": ma.Clearance(2.0, 1.0, per="second"),
    "ground": ma.Ground.of_raster(
        np.add.outer(np.arange(9.0), np.arange(9.0)), resolution=5.0, origin=[-22, -22, 0]
    ),
    "uphill": Uphill(),
    "slow": Slow(),
}


def drawn(problem, seed):
    """A word of random trims from a random pose, its query, and its plan."""
    rng = np.random.default_rng(seed)
    trims = rng.permutation(np.arange(8) % 4)
    word = Word(trims=trims, durations=rng.uniform(0.5, 4.0, trims.size))
    start = np.array([*rng.uniform(-8, 8, 2), rng.uniform(-3, 3)])
    there = problem.starting_at(start, time=0.0)
    return lattice_query(there, [0]), word, plan_of(CAR, word, start)


@pytest.mark.parametrize("name", COSTS)
def test_a_word_costs_what_its_plan_does(name):
    problem = ma.Problem(
        CAR, [0, 0, 0], [9, 0, 0], obstacles=PILLARS, footprint=BODY, place_costs=COSTS[name]
    )
    for seed in range(4):
        query, word, plan = drawn(problem, seed)
        cost = problem.cost_of(plan)
        assert with_cost(word, query).cost == pytest.approx(cost, rel=3e-3)
        assert cost > problem.invariant_cost_of(plan)


@pytest.mark.parametrize("name", COSTS)
def test_a_word_in_reverse_costs_the_same(name):
    problem = ma.Problem(
        CAR, [0, 0, 0], [9, 0, 0], obstacles=PILLARS, footprint=BODY, place_costs=COSTS[name]
    )
    query, word, plan = drawn(problem, 7)
    there = problem.starting_at(plan.start, time=0.0, goals=ma.Goal(plan.end))
    query = lattice_query(there, [0])
    back = reversed_query(query)
    assert with_cost(forward_word(word), back).cost == pytest.approx(with_cost(word, query).cost)


def corridor(*costs):
    """A corridor 4 m wide, and a car 2 m wide that begins and ends off its middle."""
    walls = ma.Box([40, 1], [10, 2.5]), ma.Box([40, 1], [10, -2.5])
    return ma.Problem(
        CAR,
        [0, -0.7, 0],
        [20, -0.7, 0],
        obstacles=walls,
        footprint=BODY,
        place_costs=costs,
        search=ma.SearchSettings(max_expansions=400),
    )


@pytest.fixture(scope="module")
def through():
    """The plan through the corridor where it has a price to be near its walls."""
    return ma.plan(corridor(ma.Clearance(4.0, 1.5)), time_limit=600.0)


@compiled_only
def test_in_a_corridor_a_car_keeps_to_the_middle(through):
    plain, result = ma.plan(corridor()), through
    assert plain.plan.word == ("ahead",)
    times = np.linspace(0.0, result.plan.duration, 20001)
    poses = 0.5 * (result.plan.pose_at(times[1:]) + result.plan.pose_at(times[:-1]))
    middle = (poses[:, 0] > 6.0) & (poses[:, 0] < 14.0)
    assert np.abs(poses[middle, 1]).max() < 0.1
    # The corners of the body that are farthest to either side say how near the walls are.
    reach = 1.0 * np.abs(np.cos(poses[:, 2])) + 2.0 * np.abs(np.sin(poses[:, 2]))
    rates = 4.0 * np.maximum(1.0 - (2.0 - reach - np.abs(poses[:, 1])) / 1.5, 0.0) ** 2
    whole = result.plan.duration * (1.0 + float(rates.mean()))
    assert result.cost == pytest.approx(whole, rel=1e-3)
    assert result.audit.passed
    assert result.cost < result.problem.cost_of(plain.plan) - 1.0
    assert result.lower_bound <= result.cost


@pytest.mark.slow
@compiled_only
def test_dear_ground_in_the_open_is_worth_a_detour():
    lawn = ma.Ground(ma.Box([6.0, 8.0], [10.0, 1.0]), price=3.0)
    problem = ma.Problem(
        CAR,
        [0, 0, 0],
        [20, 0, 0],
        place_costs=lawn,
        search=ma.SearchSettings(max_expansions=100),
    )
    result = ma.plan(problem, time_limit=120.0)
    straight = ma.plan(ma.Problem(CAR, [0, 0, 0], [20, 0, 0])).plan
    assert problem.cost_of(straight) == pytest.approx(20.0 + 18.0, rel=1e-3)
    assert result.cost < 21.5
    assert problem.place_prices_of(result.plan)[0].price < 1.0
    # Best times lead along the edge, which the raster of the search blurs; its own word does not.
    first = ma.plan(replace(problem, search=replace(problem.search, improve=False)))
    seen = with_cost(word_of_plan(CAR, first.plan), lattice_query(problem, [0])).cost
    assert seen == pytest.approx(first.cost, rel=5e-3, abs=0.1)


@pytest.mark.slow
@compiled_only
def test_a_moved_problem_has_the_moved_plan(through):
    moved = ma.plan(through.problem.moved(SE2([30.0, -7.0, 2.0])), time_limit=600.0)
    assert moved.plan.word == through.plan.word
    assert moved.cost == pytest.approx(through.cost, rel=1e-6)
    assert math.isclose(moved.plan.duration, through.plan.duration, rel_tol=1e-5)

"""The best coasting times of a word, where places cost something."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import fsolve, minimize

import maneuver_automaton as ma
from maneuver_automaton.place_prices import TimedPrices
from maneuver_automaton.refinement.relaxed_end import with_relaxed_end
from tests.search.cases import compiled_only

TURNS = {"ahead": (1, 0), "left": (1, 0.5), "right": (1, -0.5)}
CAR = ma.Automaton.of_controls(ma.Unicycle(), TURNS)
PILLARS = (ma.Disc(0.5, [6.0, -0.5]), ma.Box([2.0, 1.0], [10.0, 3.5], heading=0.4))
WORD = [CAR[name] for name in ("left", "right", "ahead", "right", "left")]
BEGUN = ma.Plan([0.0, 0.0, 0.0], WORD, durations=[0.7, 0.7, 9.0, 0.5, 0.5])


class Dear:
    """A user's own: dear in the south, by the second."""

    per = "second"

    def rates(self, poses, velocities):
        return np.log1p(np.exp(1.0 - poses[..., 1]))


COSTS = {
    "clearance": ma.Clearance(4.0, 2.0),
    "raster": ma.Ground.of_raster(
        np.add.outer(np.arange(8.0)[::-1] ** 2, np.zeros(20)), resolution=1.0, origin=[-2, -4, 0]
    ),
    "own": Dear(),
    "hills": ma.Ground.of_elevation(
        3.0 * np.exp(-np.add.outer((np.arange(20) - 7) ** 2, (np.arange(40) - 19) ** 2) / 16.0),
        resolution=0.5, origin=[-2, -4, 0], price=6.0,
    ),
    "area": ma.Ground(ma.Box([3.0, 2.0], [7.0, 1.0], heading=0.3), price=2.0),
}  # fmt: skip


def problem(cost):
    return ma.Problem(
        CAR, [0, 0, 0], BEGUN.end, obstacles=PILLARS, footprint=ma.Box([2.0, 1.0]), place_costs=cost
    )


def optimum(here, begin):
    """The least cost of the word: two times are searched, and three follow from the end."""

    def cost(free):
        def off(rest):
            times = np.array([free[0], rest[0], rest[1], free[1], rest[2]])
            return ma.Plan([0, 0, 0], WORD, durations=np.abs(times)).end - here.goals[0].pose

        rest, _, found, _ = fsolve(off, begin[[1, 2, 4]], full_output=True)
        times = np.array([free[0], rest[0], rest[1], free[1], rest[2]])
        if found != 1 or (times < 0.0).any():
            return 1e3
        return here.cost_of(ma.Plan([0, 0, 0], WORD, durations=times))

    return minimize(cost, begin[[0, 3]], method="Nelder-Mead", options={"maxfev": 60}).fun


@pytest.mark.parametrize("name", ["raster", "own", "hills"])
def test_times_are_as_good_as_an_independent_optimum(name):
    here = problem(COSTS[name])
    better = with_relaxed_end(here, BEGUN, here.goals[0])
    assert better.end == pytest.approx(BEGUN.end, abs=1e-9)
    assert here.cost_of(better) < here.cost_of(BEGUN) - 0.01
    least = optimum(here, better.durations * (1.02, 1.0, 1.0, 0.98, 1.0))
    assert here.cost_of(better) <= least + 2e-3 * here.cost_of(BEGUN)


@pytest.mark.parametrize("name", COSTS)
def test_a_moved_word_has_the_same_times(name):
    here = problem(COSTS[name])
    by = ma.SE2([30.0, -17.0, 2.1])
    there = here.moved(by)
    one = with_relaxed_end(here, BEGUN, here.goals[0])
    other = with_relaxed_end(there, BEGUN.moved(by), there.goals[0])
    assert other.durations == pytest.approx(one.durations, abs=1e-6)
    assert there.cost_of(other) == pytest.approx(here.cost_of(one), rel=1e-8)


@pytest.mark.parametrize("name", COSTS)
def test_a_tolerance_is_used_and_kept(name):
    exact = problem(COSTS[name])
    here = replace(exact, goals=(ma.Goal(BEGUN.end, tolerance_m=0.8),))
    better = with_relaxed_end(here, BEGUN, here.goals[0])
    assert math.dist(better.end[:2], BEGUN.end[:2]) <= 0.8
    assert here.cost_of(better) < here.cost_of(with_relaxed_end(exact, BEGUN, exact.goals[0]))


@pytest.mark.parametrize("name", COSTS)
def test_slopes_are_differences(name):
    prices = TimedPrices(problem(COSTS[name]).bound_place_costs, BEGUN, CAR.model)
    price, slopes = prices.at(BEGUN.durations)
    whole = sum(one.price for one in problem(COSTS[name]).place_prices_of(BEGUN))
    assert price == pytest.approx(whole, rel=2e-3 if name != "area" else 2e-2)
    for k, step in enumerate(1e-4 * np.eye(5)):
        ahead, behind = (prices.at(BEGUN.durations + sign * step)[0] for sign in (1.0, -1.0))
        assert slopes[k] == pytest.approx((ahead - behind) / 2e-4, abs=1e-3 * np.abs(slopes).max())


@pytest.mark.slow
@compiled_only
def test_a_plan_has_the_best_of_its_times():
    here = problem(COSTS["clearance"])
    here = replace(here, search=replace(here.search, max_expansions=100))
    result = ma.plan(here, time_limit=60.0)
    assert result.audit.passed
    again = with_relaxed_end(here, result.plan, here.goals[0])
    assert again is None or here.cost_of(again) > result.cost * (1.0 - 2e-3)


@pytest.mark.slow
@compiled_only
def test_plans_with_maneuvers_have_slopes_too():
    here = ma.load_scenario("scenarios/robot_with_inertia.yaml").problem
    first = ma.SearchSettings(improve=False, polish=False)
    plan = ma.plan(replace(here, search=first), time_limit=60.0).plan
    assert any(plan.maneuvers)
    here = replace(here, place_costs=ma.Clearance(2.0, 6.0))
    prices = TimedPrices(here.bound_place_costs, plan, here.automaton.model)
    price, slopes = prices.at(plan.durations)
    assert price == pytest.approx(here.place_prices_of(plan)[0].price, rel=5e-3)
    for k, step in enumerate(1e-4 * np.eye(len(plan.durations))):
        ahead, now = (prices.at(plan.durations + part)[0] for part in (step, 0.0 * step))
        assert slopes[k] == pytest.approx((ahead - now) / 1e-4, abs=0.05 * np.abs(slopes).max())
    anew = TimedPrices(here.bound_place_costs, plan, here.automaton.model)  # knows no maneuver yet
    assert anew.at(1.1 * plan.durations)[0] == prices.at(1.1 * plan.durations)[0]

"""What places cost where no cell of the matrix is: on state lattices, in fleets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton import Box, Clearance, Disc, FleetProblem, Ground, SearchSettings, plan
from maneuver_automaton.fleet import plan_fleet
from tests.matrix.measuring import (
    SAMPLED,
    TIME_LIMIT,
    close,
    cost_of,
    found,
    obeys,
    price_of_places,
)
from tests.matrix.vehicles import VEHICLES, Vehicle
from tests.planning.test_on_state_lattice import with_reverse
from tests.search.cases import compiled_only

pytestmark = [compiled_only, pytest.mark.slow]
ON_LATTICE = Vehicle(
    name="on_lattice",
    library=with_reverse,
    footprint=(Box([0.5, 0.3], center=[0.1, 0.0]),),
    goal=(8.0, 0.0, 0.0),
    inertia=True,
    max_expansions=2000,
)


def priced(vehicle, problem, motion, stated):
    """What the places along a plan cost; its whole cost as it is seen is that stated."""
    places = price_of_places(vehicle, problem, motion)
    close(cost_of(problem.cost, motion) + places, stated, "cost", share=SAMPLED)
    return places


@pytest.mark.parametrize(
    "place",
    [Clearance(4.0, 1.5), Ground(Box([2.0, 1.5], [4.0, 0.0]), 5.0)],
    ids=["clearance", "ground"],
)
def test_on_a_state_lattice(place):
    vehicle = ON_LATTICE
    solids = () if isinstance(place, Ground) else (Disc(0.5, [4.0, -1.0]),)
    problem = vehicle.problem(obstacles=solids, place_costs=place)
    plain = plan(replace(problem, place_costs=()))
    result = plan(problem, time_limit=TIME_LIMIT)
    assert plain.cost == pytest.approx(8.0)
    assert result.audit.passed
    assert max(problem.goals[0].off(found(result).end)) <= 1e-9
    places = priced(vehicle, problem, result.plan, result.cost)
    assert places < 0.5 * price_of_places(vehicle, problem, found(plain))
    assert result.lower_bound <= result.cost < 8.0 + price_of_places(vehicle, problem, plain.plan)


class Marsh:
    """A user's own cost: dear in a strip across the way, in whatever direction it is crossed."""

    per = "metre"

    def rates(self, poses, velocities):
        x, y = poses[..., 0], poses[..., 1]
        return 20.0 * ((np.abs(x - 2.0) < 0.4) & (np.abs(y) < 1.0))


CELLS = Ground.of_raster(np.full((10, 4), 20.0), resolution=0.2, origin=[1.6, -1.0, 0.0])


@pytest.mark.parametrize("place", [Marsh(), CELLS], ids=["own", "raster"])
def test_the_way_round_what_is_dear(place):
    """Along the straight line the places cost 16; round them the way is 1 m longer."""
    vehicle = VEHICLES["unicycle"]
    search = SearchSettings(max_expansions=6000)
    problem = vehicle.problem(goals=[4.0, 0.0, 0.0], place_costs=place, search=search)
    result = plan(problem, time_limit=TIME_LIMIT)
    obeys(vehicle, problem, found(result))
    assert result.cost - cost_of(problem.cost, result.plan) < 0.1 * result.cost
    assert result.cost < 6.0


def test_each_of_a_fleet_pays_for_its_own_places():
    vehicle = VEHICLES["unicycle"]
    search = SearchSettings(max_expansions=600)
    lawn = Ground(Box([1.0, 1.6], [2.0, 0.0]), 6.0)
    one = vehicle.problem(goals=[4.0, 0.0, 0.0], place_costs=lawn, search=search)
    other = replace(
        one, start=np.array([2.0, 4.0, -np.pi / 2]), goals=[2.0, -4.0, -np.pi / 2], place_costs=()
    )
    result = plan_fleet(FleetProblem([one, other]), time_limit=10.0)
    assert set(result.plans) == set(result.problem.names), result.reasons
    prices = []
    for name, problem in zip(result.problem.names, (one, other), strict=True):
        answer = result.results[name]
        obeys(vehicle, problem, found(answer))
        prices.append(priced(vehicle, problem, answer.plan, answer.cost))
        assert answer.lower_bound <= answer.cost
    alone = plan(replace(one, place_costs=()))
    assert 0.0 < prices[0] <= price_of_places(vehicle, one, found(alone)) * (1.0 + SAMPLED)
    assert prices[1] == 0.0
    assert result.cost == pytest.approx(sum(answer.cost for answer in result.results.values()))

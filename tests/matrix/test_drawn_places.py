"""Scenes drawn at random, with what places cost: what holds for every vehicle in all of them."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton import Box, Clearance, Disc, Ground, SearchSettings, plan
from maneuver_automaton.groups import group_of
from tests.matrix import outside
from tests.matrix.measuring import (
    SAMPLED,
    TIME_LIMIT,
    close,
    cost_of,
    found,
    obeys,
    price_of_places,
)
from tests.matrix.scenes import midway
from tests.matrix.vehicles import VEHICLES
from tests.search.cases import compiled_only

SCENES = {  # how many of each vehicle
    "unicycle": 8,
    "car": 8,
    "boat": 6,
    "omni": 6,
    "stage": 6,
    "glider": 4,
    "four_wheel_steering_car": 4,
    "second_order_unicycle": 4,
    "second_order_car": 3,
    "car_with_trailer": 3,
    "hovercraft": 2,
    "user": 2,
}
BRIEF = {"unicycle"}  # slow; the others are exhaustive too
WORK = SearchSettings(max_expansions=600)


def drawn(vehicle, seed):
    """Its problem among discs and boxes, with a lawn; and what costs more near them and on it."""
    rng = np.random.default_rng(seed)
    solids, middle = [], midway(vehicle)[:2]
    while len(solids) < 3:
        center = middle + rng.uniform(-0.5, 0.5, 2) * vehicle.reach
        size = rng.uniform(0.3, 0.8) * vehicle.size
        ends = [np.linalg.norm(center - end) for end in (np.zeros(2), np.array(vehicle.goal[:2]))]
        if min(ends) > 3.0 * vehicle.size + size:
            turned = Box([size, 2.0 * size], center, heading=rng.uniform(0.0, 3.0))
            solids.append(Disc(size, center) if len(solids) < 2 else turned)
    per_second = vehicle.fastest
    lawn = Box(rng.uniform(0.1, 0.3, 2) * vehicle.reach, middle, heading=rng.uniform(0.0, 3.0))
    costs = (
        Clearance(rng.uniform(0.5, 4.0) / per_second, rng.uniform(1.0, 3.0) * vehicle.size),
        Ground(lawn, rng.uniform(0.5, 4.0) / per_second),
    )
    return vehicle.problem(obstacles=solids, search=WORK), costs


def _scenes():
    for name, count in SCENES.items():
        for seed in range(count):
            marks = [pytest.mark.slow, *([] if name in BRIEF else [pytest.mark.exhaustive])]
            yield pytest.param(name, seed, id=f"{name}-{seed}", marks=marks)


@compiled_only
@pytest.mark.parametrize(("name", "seed"), list(_scenes()))
def test_what_places_cost(name, seed):
    vehicle = VEHICLES[name]
    plain, costs = drawn(vehicle, seed)
    problem = vehicle.problem(obstacles=plain.obstacles, search=WORK, place_costs=costs)
    result, without = (plan(one, time_limit=TIME_LIMIT) for one in (problem, plain))
    motion, quick = found(result), found(without)
    obeys(vehicle, problem, motion)
    places = price_of_places(vehicle, problem, motion)
    close(cost_of(problem.cost, motion) + places, result.cost, "cost", share=SAMPLED)
    others = price_of_places(vehicle, problem, quick)
    assert result.cost <= (without.cost + others) * (1.0 + SAMPLED), "the quickest is cheaper"
    assert places <= others + SAMPLED * result.cost
    assert 0.0 <= result.lower_bound <= result.cost * (1.0 + 1e-9)
    _moved(vehicle, problem, result)


def _moved(vehicle, problem, result):
    """The moved problem has the moved plan: its places are moved too."""
    turn = 2.1 if vehicle.rotates else 0.0
    by = np.array([31.4, -12.3, turn, 5.0][: len(vehicle.goal)])
    there = plan(problem.moved(group_of(len(by))(by)), time_limit=TIME_LIMIT)
    one, other = found(result), found(there)
    assert other.word == one.word
    close(there.cost, result.cost, "cost of the moved plan", share=1e-5)
    times = np.linspace(0.0, min(one.duration, other.duration), 100)
    off = np.abs(outside.moved(one.pose_at(times), by) - other.pose_at(times)).max()
    assert off <= 1e-3 * vehicle.reach

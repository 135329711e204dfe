"""Published problems of several vehicles are solved, and no two bodies ever touch."""

from __future__ import annotations

import pytest

from benchmarks.fleets import DATA, least_distance
from maneuver_automaton.fleet import FleetStatus, plan_fleet
from maneuver_automaton.scenario import load_scenario
from tests.quickly import quick_are

pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="the given problems are not here")

SMALL = {  # the sum of arrivals that CL-CBS and db-CBS report, or what was found once
    "cl-cbs/map_50by50_obst0_agents5_ex0": 129.6,
    "cl-cbs/map_50by50_obst25_agents5_ex1": 120.4,
    "db-cbs/swap2_unicycle": 12.5,
    "db-cbs/swap3_unicycle": 20.0,
    "db-cbs/alcove_unicycle": 13.5,
}
LARGE = {
    "cl-cbs/map_50by50_obst25_agents20_ex8": 533.9,
    "db-cbs/window4_unicycle": 31.0,
}


def check(name, most):
    fleet = load_scenario(DATA / f"{name}.yaml").fleet
    result = plan_fleet(fleet, time_limit=60.0, max_rounds=4)
    assert result.status is FleetStatus.FOUND, result.reasons
    assert result.sum_s <= most
    assert least_distance(fleet, result) > 0.0
    assert result.lower_bound <= result.cost


@pytest.mark.parametrize(
    "name", quick_are([name for name in SMALL if "alcove" not in name], SMALL, exhaustive=True)
)
def test_few_vehicles(name):
    check(name, SMALL[name])

"""Two of every kind of vehicle, side by side past a pillar: planned, driven, and judged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton.fleet import (
    FleetProblem,
    FleetStatus,
    plan_fleet,
    simulate_fleet,
    verify_driven,
    verify_fleet,
)
from tests.matrix.scenes import beside, pillar
from tests.matrix.vehicles import VEHICLES
from tests.quickly import quick_are

QUICK = ("car", "dubins", "grid", "omni")
LONGEST = ("helicopter", "glider")  # in space
ROWS = [row for name in VEHICLES for row in quick_are(QUICK, [name], exhaustive=name in LONGEST)]


def two_of(name: str) -> FleetProblem:
    """One of a kind, and another one four lengths beside it; who moves at its goal leaves there."""
    vehicle = VEHICLES[name]
    problem = vehicle.problem(obstacles=[pillar(vehicle)])
    tolerance = {"tolerance_m": 0.3 * vehicle.size, "tolerance_rad": 0.3}
    aside = np.zeros(problem.start.size)
    aside[:2] = beside(vehicle, 4.0 * vehicle.size) - beside(vehicle, 0.0)
    rows = [
        replace(
            problem,
            start=problem.start + by,
            goals=tuple(replace(one, pose=one.pose + by, **tolerance) for one in problem.goals),
        )
        for by in (0.0 * aside, aside)
    ]
    last = problem.goals[0].trim
    leaves = last is not None and not problem.automaton[last].is_rest
    return FleetProblem(rows, margin=0.05 * vehicle.size, leaves=[leaves] * 2)


@pytest.mark.parametrize("name", ROWS)
def test_both_arrive(name):
    fleet = two_of(name)
    first = plan_fleet(fleet, time_limit=60.0, max_rounds=0)
    assert first.status is FleetStatus.FOUND
    assert verify_fleet(fleet, first.plans).passed
    log = simulate_fleet(fleet, step=0.5, steps=120, first=first, time_limit=60.0)
    assert log.reached
    assert [*log.violations] == []
    verdict = verify_driven(log)
    assert verdict.passed
    assert not verdict.defects
    assert verdict.distance_m >= fleet.margin - 1e-9
    assert verdict.clearance_m > 0.0

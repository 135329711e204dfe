"""Fleets in which someone stands at its goal: it is passed, or makes room and comes back."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import numpy as np
import pytest

from maneuver_automaton import Automaton, Omnidirectional
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision import Box, Disc
from maneuver_automaton.fleet import (
    FleetProblem,
    FleetStatus,
    plan_fleet,
    simulate_fleet,
    verify_fleet,
)
from maneuver_automaton.fleet.coordination import one_at_a_time
from maneuver_automaton.fleet.vehicle import vehicles_of
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Problem
from maneuver_automaton.scenario import load_scenario
from tests.fleet.robots import ROBOT, least_distance
from tests.inertia import unicycle_automaton
from tests.matrix.vehicles import VEHICLES
from tests.quickly import quick_are
from tests.scenes import reeds_shepp

FIELD = Path(__file__).parents[2] / "../shared/data/field"
BODY = Disc(0.3)
SIDES = {"n": (0, 1, 0), "s": (0, -1, 0), "e": (1, 0, 0), "w": (-1, 0, 0), "rest": (0, 0, 0)}
KINDS = {
    "at will": ROBOT,
    "inertia": unicycle_automaton(),
    "translations": Automaton.of_controls(Omnidirectional(), SIDES),
}


def fleet_of(kind, ends, walls=(), **more):
    problems = [Problem(KINDS[kind], a, b, footprint=BODY, obstacles=walls) for a, b in ends]
    return FleetProblem(problems, **more)


def bay(kind, idle, *, turned=0.0):
    """A corridor for one with a bay beside it; one drives through, one stands in it at its goal."""
    walls = [
        Box([10.0, 1.0], [4.0, -0.9]),
        Box([5.0, 1.0], [0.5, 0.9]),
        Box([5.0, 1.0], [6.5, 0.9]),
        Box([1.2, 1.0], [3.5, 1.9]),
        Box([1.0, 1.0], [-1.0, 0.0]),
        Box([1.0, 1.0], [9.0, 0.0]),
    ]
    here = [idle, 0.0, turned]
    return fleet_of(kind, [([0, 0, 0], [8, 0, 0]), (here, here)], walls, names=("driver", "idle"))


def is_good(fleet, result):
    return result.status is FleetStatus.FOUND and verify_fleet(fleet, result.plans).passed


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", quick_are([0, 1], range(3)))
def test_who_stands_in_the_way_on_open_floor_is_passed(kind, seed):
    rng = np.random.default_rng(seed)
    by = SE2([*rng.uniform(-9.0, 9.0, 2), rng.uniform(-3.0, 3.0)])
    places = [[2.0, 0.2 * rng.normal(), 1.0], [4.5, 0.2 * rng.normal(), -2.0]][: 1 + seed % 2]
    fleet = fleet_of(kind, [([0, 0, 0], [6.5, 0, 0]), *((one, one) for one in places)]).moved(by)
    # With inertia a round of improvement takes all the time there is.
    result = plan_fleet(fleet, time_limit=120.0, max_rounds=0 if kind == "inertia" else 6)
    assert is_good(fleet, result)
    assert result.plans["2"].duration == 0.0  # it is cheaper to be passed than to make room
    assert result.cost < 2.0 * result.alone_cost


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("idle", "turned"),
    [
        (2.2, 0.0),
        *(pytest.param(*one, marks=pytest.mark.slow) for one in ((3.5, 0), (4.8, math.pi))),
    ],
)
def test_who_stands_in_a_corridor_makes_room_in_the_bay(kind, idle, turned):
    fleet = bay(kind, idle, turned=turned)
    result = plan_fleet(fleet, time_limit=120.0, max_rounds=0)
    assert is_good(fleet, result)
    assert result.plans["idle"].end == pytest.approx([idle, 0.0, turned], abs=1e-9)


def test_a_loop_drives_what_makes_room():
    fleet = bay("at will", 2.2)
    first = plan_fleet(fleet, time_limit=120.0, max_rounds=0)
    log = simulate_fleet(fleet, step=0.5, steps=60, first=first)
    assert log.reached
    assert least_distance(log) > 0.0
    assert not list(log.violations)


def test_all_change_places_where_nobody_has_a_way():
    """Each goal is where another one stands: somebody drives aside first."""
    ends = [([2.0 * k, 0, 0], [2.0 * ((k + 1) % 3), 0, 0]) for k in range(3)]
    fleet = fleet_of("inertia", ends)
    result = plan_fleet(fleet, time_limit=120.0, max_rounds=0)
    assert is_good(fleet, result)


@pytest.mark.slow
def test_one_waits_in_a_bay_until_two_have_passed():
    """It drives aside to where it gets home from, not behind the goals of the others.

    A vehicle that never turns keeps its heading there.
    """
    walls = [
        Box([13.0, 1.0], [4.5, -1.12]),
        Box([5.5, 1.0], [0.72, 1.12]),
        Box([6.4, 1.0], [7.9, 1.12]),
        Box([1.4, 1.0], [4.1, 2.45]),
        Box([0.3, 1.2], [-2.35, 0.0]),
        Box([0.8, 1.2], [11.7, 0.0]),
    ]
    ends = [([0, 0, 0], [9, 0, 0]), ([9, 0, 0], [0, 0, 0]), ([-1, 0, 0], [7.9, 0, 0])]
    problems = [
        Problem(KINDS["translations"], a, b, footprint=Disc(0.39), obstacles=walls) for a, b in ends
    ]
    fleet = FleetProblem(problems)
    one = vehicles_of(fleet)[0]
    one.plan_alone(Budget.from_now(60.0))
    assert "bound" not in vars(one)  # no search asks for it: it is worked out for the answer
    aims = one.refuges(None, one.alone, (), 0.0)
    assert aims
    assert all(aim.pose[2] == 0.0 for aim in aims)
    assert is_good(fleet, plan_fleet(fleet, time_limit=120.0, max_rounds=0))


@pytest.mark.slow
def test_what_quick_searches_leave_is_improved_for_longer():
    """One plan past the other one, where it stands, costs 20.9; at once it is found at 21.5."""
    car = reeds_shepp(3.0)
    ends = [([14.75, 19.06, -2.04], [30.35, 25.85, 0.83]), ([24.79, 24.28, -0.32],) * 2]
    body, disc = Box([3.0, 2.0], [0.5, 0.0]), Disc(0.8, [18.4, 22.7])
    fleet = FleetProblem([Problem(car, a, b, footprint=body, obstacles=[disc]) for a, b in ends])
    result = plan_fleet(fleet, time_limit=120.0, max_rounds=10)
    assert is_good(fleet, result)
    assert result.cost < 21.0


@pytest.mark.parametrize(
    ("goal", "said"),
    [
        (4, "alone it would meet idle at 3.4 s near (3.4, 0)"),
        (20, "within 0 m of idle (which has no plan itself, and stands) at 3.556 s near"),
    ],
)
def test_reasons_name_when_and_where_they_meet(goal, said):
    walls = [Box([12.0, 1.0], [4.0, y]) for y in (-0.9, 0.9)]
    walls += [Box([1.0, 1.0], [x, 0.0]) for x in (-1.0, 9.0)]
    ends = [([0, 0, 0], [8, 0, 0]), ([4, 0, 0], [goal, 0, 0])]
    fleet = fleet_of("at will", ends, walls, names=("driver", "idle"))
    result = plan_fleet(fleet, time_limit=120.0, max_rounds=0, orders=1)
    assert result.status is not FleetStatus.FOUND
    assert said in result.reasons["driver"]


@pytest.mark.skipif(not FIELD.is_dir(), reason="needs ../shared/data/field")
@pytest.mark.parametrize(("name", "cost"), [("fleet-idle", 4.5), ("standing-vehicle", 8.2)])
def test_files_that_were_met(name, cost):
    result = plan_fleet(load_scenario(FIELD / f"{name}.yaml").fleet, time_limit=60.0, max_rounds=4)
    assert is_good(result.problem, result)
    assert result.cost < cost


def test_who_finds_no_room_goes_first_the_next_time():
    """Who drives home as soon as it can stands in the way of the last one."""
    robot = VEHICLES["unicycle"]
    walls = [
        Box([12.0, 0.2], [4.0, -0.5]),
        Box([7.0, 0.2], [1.35, 0.5]),
        Box([4.0, 0.2], [8.0, 0.5]),
        Box([1.5, 0.2], [5.4, 1.5]),
    ]
    turned = math.pi
    ends = [([0, 0, 0], [8, 0, 0]), ([8, 0, turned], [0, 0, turned]), ([-0.8, 0, 0], [8.8, 0, 0])]
    body = {"footprint": robot.footprint, "obstacles": walls}
    fleet = FleetProblem([Problem(robot.automaton, a, b, **body) for a, b in ends])
    tries = one_at_a_time(vehicles_of(fleet), lambda _: (1, 0, 2), 0.0, Budget.from_now(120.0))
    (unaided, _), (driven, _) = itertools.islice(tries, 2)
    assert not unaided
    assert verify_fleet(fleet, {fleet.names[k]: one.plan for k, one in driven.items()}).passed


@pytest.mark.parametrize("off", [4e-10, 3.6e-9])
def test_headings_of_few_digits_are_met_exactly(off):
    one = Problem(reeds_shepp(), [0.0, 0.0, 0.0], [20.0, 20.0 * off, off], footprint=BODY)
    two = Problem(reeds_shepp(), [5.0, 9.0, 0.0], [5.0, 9.0, 0.0], footprint=BODY)
    assert plan_fleet(FleetProblem([one, two]), max_rounds=0).status is FleetStatus.FOUND

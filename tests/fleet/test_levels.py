"""Heights between vehicles: who flies passes above or below another one, where both say so."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.collision import Box, Disc, Motion, Obstacle
from maneuver_automaton.collision.surroundings import parts_of
from maneuver_automaton.costs import Cost
from maneuver_automaton.fleet import (
    FleetProblem,
    FleetStatus,
    plan_fleet,
    simulate_fleet,
    verify_driven,
    verify_fleet,
)
from maneuver_automaton.fleet.courses import BANDS, FleetCourse, Levels
from maneuver_automaton.fleet.meetings import meetings
from maneuver_automaton.fleet.verdict import nearest
from maneuver_automaton.groups import SE2, SE2xR
from maneuver_automaton.models import UserModel
from maneuver_automaton.problem import Problem
from maneuver_automaton.scenario import load_scenario
from tests.fleet.fleets import car
from tests.matrix.vehicles import VEHICLES
from tests.quickly import draws
from tests.scenario.test_vehicles import SCENARIOS

DRONE = UserModel(
    name="drone",
    group=SE2xR,
    control_names=("speed", "turn_rate", "climb"),
    velocity=lambda z, u: [u[0], 0.0 * u[0], u[1], u[2]],
)
TRIMS = {
    "rest": (0, 0, 0),
    "on": (1, 0, 0),
    "left": (1, 1, 0),
    "right": (1, -1, 0),
    "up": (1, 0, 0.5),
    "down": (1, 0, -0.5),
}
TRUCK, ROTOR, TALL = Box([2.0, 1.0]), Disc(0.5), (0.0, 1.5)
REACH = (-0.3, 0.4)  # [m] of the drone about its altitude


def over_a_truck(altitude, *, height=TALL, margin=0.1, moved=None):
    """A drone at an altitude across the way of a truck, both there at the same time."""
    drone = Problem(
        Automaton.of_controls(DRONE, TRIMS),
        [0, -4, math.pi / 2, altitude],
        [0, 4, math.pi / 2, altitude],
        cost=Cost(time=1.0),
        footprint=ROTOR,
        body_height=REACH,
    )
    truck = Problem(
        car(), [-4, 0, 0], [4, 0, 0], cost=Cost(time=1.0), footprint=TRUCK, body_height=height
    )
    fleet = FleetProblem([truck, drone], names=["truck", "drone"], margin=margin)
    return fleet if moved is None else fleet.moved(moved)


def straight(fleet):
    """Both drive straight on, whatever happens."""
    plans = {}
    for name, problem in zip(fleet.names, fleet.problems, strict=True):
        on = problem.automaton["on"]
        plans[name] = Plan(problem.start, (on,), durations=[8.0])
    return plans


def least_in_space(fleet, plans):
    """Least distance of two upright bodies at short steps, by shapely and by their altitudes."""
    times = np.arange(0.0, 12.0, 0.01)
    rows = []
    for name, problem in zip(fleet.names, fleet.problems, strict=True):
        poses = plans[name].pose_at(np.minimum(times, plans[name].duration))
        (part,) = parts_of(problem.footprint)
        base = poses[:, 3] if poses.shape[1] > 3 else np.zeros(len(times))
        rows.append((part.at(poses[:, :3]), part.radius, np.add.outer(base, problem.body_height)))
    (one, r_one, z_one), (other, r_other, z_other) = rows
    aside = np.maximum(shapely.distance(one, other) - r_one - r_other, 0.0)
    above = np.maximum(np.maximum(z_one[:, 0] - z_other[:, 1], z_other[:, 0] - z_one[:, 1]), 0.0)
    return float(np.hypot(aside, above).min())


@given(
    st.lists(st.tuples(st.floats(0.1, 9.0), st.floats(-20.0, 20.0)), min_size=1, max_size=6),
    st.floats(0.0, 3.0),
)
def test_stages_hold_the_body_at_all_times(rows, high):
    time = np.cumsum([lasting for lasting, _ in rows])
    levels = Levels(time, [z for _, z in rows], (-0.5, high))
    bands = levels.bands
    assert bands[0].begin == -math.inf
    assert bands[-1].end == math.inf
    assert all(a.end == b.begin for a, b in itertools.pairwise(bands))
    for at in np.linspace(time[0] - 1.0, time[-1] + 1.0, 200):
        now = [one for one in bands if one.begin <= at <= one.end]
        assert now
        z = float(levels.at(at))
        assert all(one.low <= z - 0.5 and z + high <= one.high for one in now)
    spread = np.ptp(levels.altitude)
    most = max(spread / BANDS, high + 0.5)
    assert all(one.high - one.low <= most + high + 0.5 + 1e-3 for one in bands)


@pytest.mark.exhaustive
@pytest.mark.slow
def test_who_flies_high_enough_costs_as_alone():
    result = plan_fleet(over_a_truck(2.5), time_limit=30.0, max_rounds=0)
    assert result.status is FleetStatus.FOUND
    assert result.sum_s == pytest.approx(16.0)
    assert verify_fleet(result.problem, result.plans).passed
    assert least_in_space(result.problem, result.plans) > 0.1


@pytest.mark.slow
def test_who_flies_too_low_climbs_over():
    fleet = over_a_truck(1.5)
    assert not verify_fleet(fleet, straight(fleet)).passed
    result = plan_fleet(fleet, time_limit=30.0, max_rounds=0)
    assert result.status is FleetStatus.FOUND
    assert verify_fleet(fleet, result.plans).passed
    assert least_in_space(fleet, result.plans) > 0.1


@pytest.mark.slow
def test_nobody_assumes_that_a_body_is_flat():
    """A truck that says nothing of its height counts at all heights."""
    fleet = over_a_truck(2.5, height=(0.0, 0.0))
    assert not verify_fleet(fleet, straight(fleet)).passed
    result = plan_fleet(fleet, time_limit=30.0, max_rounds=0)
    assert result.status is FleetStatus.FOUND
    assert result.sum_s > 16.05
    assert verify_fleet(fleet, result.plans).passed
    tower = replace(fleet.problems[0], body_height=(-1e3, 1e3))
    tall = FleetProblem([tower, fleet.problems[1]], names=fleet.names)
    assert least_in_space(tall, result.plans) > 0.1


@settings(max_examples=draws(40))
@given(st.floats(0.1, 2.0), st.floats(1e-4, 0.05), st.floats(-3.0, 3.0), st.floats(-50.0, 50.0))
def test_what_keeps_the_margin_in_height_by_a_hair_passes(margin, more, turned, rise):
    by = SE2xR([5.0, -3.0, turned, rise])
    for beside, passes in ((more, True), (-more, False)):
        altitude = TALL[1] - REACH[0] + margin + beside
        fleet = over_a_truck(altitude, margin=margin, moved=by)
        verdict = verify_fleet(fleet, straight(fleet))
        assert verdict.passed is passes, verdict
        assert all(one.passed for one in verdict.verdicts.values())
        assert verdict.closest[0].distance_m <= margin + beside + 1e-6


def climbing(low, high):
    """A disc that goes ahead for ten seconds while it climbs between two heights."""
    way = Motion([0.0, 10.0], [[0, 0, 0], [10, 0, 0]], [[1.0, 0.0, 0.0]])
    return FleetCourse(((ROTOR,),), (way,), levels=Levels(way.time, [low, high], (0.0, 1.0)))


def test_who_climbs_is_met_at_the_height_of_the_other():
    rising = climbing(0.0, 20.0)
    for level, met in ((15.0, True), (25.0, False)):
        rows = meetings({0: rising, 1: climbing(level, level)}, keep=0.1)
        assert bool(rows) is met
        if met:
            assert 4.0 <= rows[0].time <= 6.95  # 13.9 m high, less a stage
            assert nearest(rising, climbing(level, level)).distance == 0.0
        else:
            assert nearest(rising, climbing(level, level)).distance == pytest.approx(4.0, abs=0.05)


@pytest.mark.exhaustive
@pytest.mark.slow
def test_a_moved_fleet_in_space_has_the_moved_plans():
    one = plan_fleet(over_a_truck(1.5), time_limit=30.0, max_rounds=0)
    for by in (SE2([30.0, -20.0, 2.0]), SE2xR([30.0, -20.0, 2.0, 50.0])):
        other = plan_fleet(over_a_truck(1.5, moved=by), time_limit=30.0, max_rounds=0)
        assert other.cost == pytest.approx(one.cost, rel=1e-6)
        for name, plan in one.plans.items():
            assert other.plans[name].word == plan.word
            assert other.plans[name].durations == pytest.approx(plan.durations, abs=1e-5)


@pytest.mark.exhaustive
@pytest.mark.slow
def test_the_helicopter_of_the_airfield_flies_as_if_it_were_alone():
    fleet = load_scenario(SCENARIOS / "fleets" / "airfield.yaml").fleet
    number = fleet.names.index("helicopter")
    single = FleetProblem([fleet.problems[number]], margin=fleet.margin)
    alone = plan_fleet(single, time_limit=60.0, max_rounds=0)
    together = plan_fleet(fleet, time_limit=60.0, max_rounds=0)
    assert together.status is FleetStatus.FOUND
    assert together.results["helicopter"].cost == alone.cost
    assert verify_fleet(fleet, together.plans).passed
    blind = [replace(one, body_height=(0.0, 0.0)) for one in fleet.problems[:number]]
    tall = FleetProblem([*blind, fleet.problems[number]], names=fleet.names, margin=fleet.margin)
    assert not verify_fleet(tall, together.plans).passed  # it is above somebody at some time


@pytest.mark.slow
def test_a_truck_drives_under_one_that_hovers():
    fleet = over_a_truck(2.5)
    hovers = replace(fleet.problems[1], start=np.array([0.0, 0.0, 0.0, 2.5]))
    drone = replace(hovers, goals=(replace(hovers.goals[0], pose=hovers.start),))
    below = FleetProblem([fleet.problems[0], drone], names=fleet.names, margin=0.1)
    result = plan_fleet(below, time_limit=30.0, max_rounds=0)
    assert result.status is FleetStatus.FOUND
    assert result.sum_s == pytest.approx(8.0)


@pytest.mark.parametrize("top", [-6.0, 40.0])
def test_in_closed_loop_one_flies_over_what_is_low_and_round_what_is_high(top):
    """Nobody else has anything to say of it: before, it counted at all heights and stayed."""
    problem = VEHICLES["helicopter"].problem(body_height=(-1.0, 1.0))
    middle = 0.5 * (problem.start + problem.goals[0].pose)[:2]
    house = Obstacle(Box([6.0, 6.0], middle), height=(-40.0, top))
    fleet = FleetProblem([replace(problem, obstacles=(house,))])
    first = plan_fleet(fleet, time_limit=20.0, max_rounds=0)
    log = simulate_fleet(fleet, step=0.5, steps=60, first=first, time_limit=20.0)
    assert log.reached
    assert [*log.violations] == []
    verdict = verify_driven(log)
    assert verdict.passed
    ring = shapely.Polygon(Box([6.0, 6.0], middle).corners)
    least, over = math.inf, False
    for piece in log.pieces_of("1").values():
        poses = piece.pose_at(piece.start_time + np.arange(0.0, piece.duration, 0.005))
        aside = shapely.distance(shapely.points(poses[:, :2]), ring) - 2.0  # a disc of 2 m
        above = np.maximum(poses[:, 3] - 1.0 - top, 0.0)
        least = min(least, np.hypot(np.maximum(aside, 0.0), above).min(initial=math.inf))
        over |= bool((aside < 0.0).any())
    assert verdict.clearance_m == pytest.approx(least, abs=0.02)
    assert over == (top < 0.0)

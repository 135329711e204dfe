"""Plans of fleets: nobody meets anybody, and a moved fleet has the moved plans."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision import Box, Disc, Motion, Obstacle
from maneuver_automaton.costs import Cost
from maneuver_automaton.fleet import FleetProblem, FleetStatus, plan_fleet, verify_fleet
from maneuver_automaton.fleet.coordination import Turns
from maneuver_automaton.fleet.meetings import meetings
from maneuver_automaton.fleet.result import FleetResult
from maneuver_automaton.fleet.vehicle import vehicles_of
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import Unicycle
from maneuver_automaton.problem import Bounds, Goal, Horizon, Problem
from maneuver_automaton.scenario import load_scenario
from tests.fleet import fleets
from tests.inertia import unicycle_automaton
from tests.scenario.test_vehicles import SCENARIOS


def test_cars_whose_ways_cross_let_each_other_pass():
    result = plan_fleet(fleets.crossing(), time_limit=5.0, max_rounds=10)
    assert result.status is FleetStatus.FOUND
    assert set(result.plans) == {"a", "b"}
    assert 16.0 < result.sum_s < 19.0  # alone each takes eight seconds
    assert result.lower_bound == pytest.approx(16.0)
    assert result.gap == pytest.approx(1.0 - 16.0 / result.cost)
    between, _ = fleets.least_distances(result)
    assert 0.0 < result.clearance_m <= between + 1e-6
    assert result.closest[0].pair == ("a", "b")


def test_with_little_time_who_drives_over_a_start_is_planned_behind_it():
    """Of two that are in the way of a car, the one that does not keeps its plan."""
    up = math.pi / 2
    fleet = fleets.fleet_of(
        [([0, 0, 0], [8, 0, 0]), ([0, -4, up], [0, 4, up]), ([1.8, -2, up], [1.8, 6, up])]
    )
    vehicles, little = vehicles_of(fleet), Budget(began=0.0, deadline=0.01, clock=lambda: 0.0)
    for one in vehicles:
        one.plan_alone(little, hurried=True)
    held = {k: vehicles[k].alone for k in (1, 2)}
    turns = Turns(vehicles, fleet.margin, little)
    found, given_up = turns._before_those_it_hits(0, held, hurried=True)
    assert given_up == [1]
    assert not meetings({0: found.course, 2: held[2].course}, keep=0.0)


def test_cars_on_a_circle_change_sides():
    result = plan_fleet(fleets.swap(5), time_limit=60.0, max_rounds=4)
    assert result.status is FleetStatus.FOUND
    between, _ = fleets.least_distances(result)
    assert 0.0 < result.clearance_m <= between + 1e-6


def test_bodies_keep_the_margin():
    fleet = fleets.crossing()
    wide = FleetProblem(fleet.problems, names=fleet.names, margin=0.5)
    result = plan_fleet(wide, time_limit=5.0, max_rounds=5)
    between, _ = fleets.least_distances(result)
    assert between >= 0.5
    assert result.clearance_m >= 0.5 - 1e-9


def test_a_moved_fleet_has_the_moved_plans():
    by = SE2([30.0, -20.0, 2.0])
    one = plan_fleet(fleets.swap(3), time_limit=30.0, max_rounds=6)
    other = plan_fleet(fleets.swap(3).moved(by), time_limit=30.0, max_rounds=6)
    assert other.cost == pytest.approx(one.cost, rel=1e-6)
    for name, plan in one.plans.items():
        assert other.plans[name].word == plan.word
        assert other.plans[name].durations == pytest.approx(plan.durations, abs=1e-5)


def test_the_same_seed_makes_the_same_plans():
    runs = [plan_fleet(fleets.swap(4), time_limit=60.0, max_rounds=8, seed=3) for _ in range(2)]
    for name, plan in runs[0].plans.items():
        assert runs[1].plans[name].word == plan.word
        assert runs[1].plans[name].durations.tolist() == plan.durations.tolist()


def test_who_arrives_stays_or_leaves():
    """One car ends where the other has to pass: it lets it pass first, or is gone."""
    wall = [Obstacle(Box([20.0, 1.0], center=[0.0, y])) for y in (-1.2, 1.2)]
    ends = [([-3, 0, 0], [0, 0, 0]), ([-6, 0, 0], [6, 0, 0])]
    room = {"footprint": (Box([1.0, 0.8]),), "bounds": Bounds(x=(-9.0, 9.0), y=(-2.0, 2.0))}
    stays = plan_fleet(fleets.fleet_of(ends, obstacles=wall, **room), time_limit=0.5)
    assert stays.status is not FleetStatus.FOUND
    assert "1" in " ".join(stays.reasons.values()) or "2" in stays.reasons
    leaving = fleets.fleet_of(ends, obstacles=wall, leaves=[True, False], **room)
    leaves = plan_fleet(leaving, time_limit=60.0, max_rounds=2)
    assert leaves.status is FleetStatus.FOUND


def test_a_goal_that_is_passed_later_is_taken_later():
    """The one that is near its goal waits until the other has driven across it."""
    ends = [([0, -2, math.pi / 2], [0, 0, math.pi / 2]), ([-8, 0, 0], [8, 0, 0])]
    wall = [Obstacle(Box([14.0, 1.0], center=[x, y])) for x in (-9.0, 9.0) for y in (-1.6, 1.6)]
    result = plan_fleet(
        fleets.fleet_of(ends, obstacles=wall, priority=[0.0, 1.0]), time_limit=10.0, max_rounds=5
    )
    assert result.status is FleetStatus.FOUND
    assert fleets.least_distances(result)[0] > 0.0


def test_who_is_enclosed_is_named_with_those_in_the_way():
    fleet = fleets.crossing()
    inside = [Obstacle(Box([0.2, 3.0], center=[x, -4.0])) for x in (-1.0, 1.0)]
    lids = [Obstacle(Box([2.2, 0.2], center=[0.0, y])) for y in (-5.6, -2.4)]
    closed = [
        fleet.problems[0],
        *fleets.fleet_of(
            [([0, -4, math.pi / 2], [0, 4, math.pi / 2])], obstacles=[*inside, *lids]
        ).problems,
    ]
    result = plan_fleet(FleetProblem(closed, names="ab"), time_limit=3.0, max_rounds=2)
    assert result.status is FleetStatus.PARTIAL
    assert list(result.plans) == ["a"]
    assert "alone" in result.reasons["b"]
    assert result.gap is None


def test_a_random_fleet_keeps_apart():
    result = plan_fleet(fleets.random_fleet(4, 2), time_limit=60.0, max_rounds=4)
    between, static = fleets.least_distances(result)
    assert between > 0.0
    assert static > 0.0
    assert result.status is FleetStatus.FOUND


def test_improvements_only_improve():
    result = plan_fleet(fleets.random_fleet(6, 11), time_limit=60.0, max_rounds=4)
    values = [value for _, value in result.improvements]
    assert values == sorted(values, reverse=True)
    assert result.cost == pytest.approx(values[-1])


@pytest.mark.parametrize("begin", [0.0, -100.0])
def test_the_last_arrival_may_be_what_counts(begin):
    fleet = fleets.swap(3)
    fleet = replace(fleet, problems=[replace(one, start_time=begin) for one in fleet.problems])
    result = plan_fleet(fleet, objective="last", time_limit=10.0, max_rounds=5)
    assert result.value == result.last_s
    assert begin < result.lower_bound <= result.last_s
    assert result.lower_bound == result.last_s or result.gap > 0.0
    at_0 = SimpleNamespace(status=result.status, value=0.0, lower_bound=-1.0)  # on that clock
    assert FleetResult.gap.fget(at_0) is None


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"names": ["a", "a"]}, "two vehicles have the name 'a'"),
        ({"names": ["a"]}, "got 1 names, need one for each of 2 vehicles"),
        ({"margin": -1.0}, "margin must be at least 0, got -1.0 m"),
    ],
)
def test_bad_fleets_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        FleetProblem(fleets.crossing().problems, **change)


def test_a_fleet_is_of_problems():
    with pytest.raises(ValueError, match=r"^fleet: got 'a', need a Problem for each vehicle$"):
        FleetProblem({"a": fleets.swap(2).problems[0]})


def test_times_of_vehicles_are_free():
    fixed = replace(fleets.crossing().problems[0], horizon=Horizon(time=20.0))
    with pytest.raises(ValueError, match="vehicle '1' has a fixed time"):
        FleetProblem([fixed])


def test_who_cannot_switch_at_will_stands_only_at_rest():
    """A robot with inertia neither stays where it arrives in motion, nor waits in motion."""
    robot = unicycle_automaton()
    on = next(trim.name for trim in robot.trims if trim.reduced_state.tolist() == [1.0, 0.0])
    still = Problem(robot, [0, 4, 0], [9, 4, 0])
    passing = replace(still, goals=Goal(pose=[9, 4, 0], trim=on))
    with pytest.raises(ValueError, match=f"'2' is to stay at its goal, where its trim '{on}'"):
        FleetProblem([still, passing])
    assert len(FleetProblem([still, passing], leaves=(False, True))) == 2
    moving = replace(still, start_trim=on)
    assert len(FleetProblem([still, moving])) == 2
    with pytest.raises(ValueError, match=f"'2' starts at 2 s in the trim '{on}', which moves"):
        FleetProblem([still, replace(moving, start_time=2.0)])


@pytest.mark.parametrize("leaves", [False, True])
def test_a_goal_that_is_covered_is_met_within_its_tolerance(leaves):
    """A crate stands where two robots shall go; only the second one has a tolerance."""
    robot = Automaton.of_controls(
        Unicycle(), {"rest": (0, 0), "on": (1, 0), "left": (0.8, 1), "right": (0.8, -1)}
    )
    around = {"obstacles": Disc(0.3, center=[4.2, 0.0]), "footprint": Disc(0.3)}
    loose = Goal(pose=[4, 0, 0], tolerance_m=0.6, tolerance_rad=0.5)
    one = Problem(robot, [0, 0, 0], loose, **around)
    other = Problem(robot, [3, -4, np.pi / 2], Goal(pose=[3, 4, np.pi / 2]), **around)
    fleet = FleetProblem([one, other], margin=0.1, leaves=(leaves, False))
    result = plan_fleet(fleet, time_limit=60.0, max_rounds=1)
    assert result.status is FleetStatus.FOUND
    assert verify_fleet(fleet, result.plans).passed
    assert np.hypot(*(result.plans["1"].end - loose.pose)[:2]) <= 0.6
    assert result.lower_bound <= result.cost
    exact = replace(one, goals=Goal(pose=[4, 0, 0]))
    refused = plan_fleet(FleetProblem([exact, other]), time_limit=60.0, max_rounds=0)
    assert "at the goal the vehicle touches obstacle 0" in refused.reasons["1"]


def test_bounds_hold_for_every_vehicle():
    bounds = Bounds(x=(-5.0, 5.0), y=(-5.0, 5.0))
    ends = [([-4, 0, 0], [4, 0, 0]), ([4, 0, math.pi], [-4, 0, math.pi])]
    result = plan_fleet(fleets.fleet_of(ends, bounds=bounds), time_limit=5.0, max_rounds=3)
    assert result.status is FleetStatus.FOUND
    for plan in result.plans.values():
        poses = plan.pose_at(np.linspace(0.0, plan.duration, 500))
        assert (np.abs(poses[:, :2]) <= 5.0 + 1e-9).all()


@pytest.mark.slow
def test_one_stands_aside_in_a_bay_until_the_other_has_passed():
    """A corridor for one, with a bay that is on nobody's way: searched for, not stumbled upon."""
    rows = [
        ([24.0, 1.0], [0.0, -1.2]),
        ([14.1, 1.0], [-4.95, 1.2]),
        ([8.1, 1.0], [7.95, 1.2]),
        ([2.2, 0.5], [3.0, 2.7]),
        *(([0.2, 2.0], [3.0 + side, 1.7]) for side in (-1.1, 1.1)),
        *(([0.5, 3.0], [side, 0.0]) for side in (-12.0, 12.0)),
    ]
    walls = [Obstacle(Box(size, center=center)) for size, center in rows]
    ends = [([-10, 0, 0], [10, 0, 0]), ([10, 0, math.pi], [-10, 0, math.pi])]
    fleet = fleets.fleet_of(ends, obstacles=walls, footprint=(Disc(0.4),))
    result = plan_fleet(fleet, time_limit=20.0, max_rounds=0)
    assert result.status is FleetStatus.FOUND
    between, static = fleets.least_distances(result)
    assert between > 0.0
    assert static > 0.0
    assert 40.0 < result.sum_s < 50.0


def test_who_has_arrived_is_passed_by_another_way():
    """The short way leads over the goal of a car that is there already: round it is another one."""
    ends = [([4, -3, math.pi / 2], [4, 0, math.pi / 2]), ([0, 0, 0], [8, 0, 0])]
    result = plan_fleet(fleets.fleet_of(ends, priority=[1.0, 0.0]), time_limit=5.0, max_rounds=0)
    assert result.status is FleetStatus.FOUND
    assert fleets.least_distances(result)[0] > 0.0


def test_vehicles_that_cannot_turn_drive_ahead():
    robot = Automaton.of_controls(Unicycle(), {"rest": (0, 0), "ahead": (1, 0)})
    body = Disc(0.3)
    pair = [
        Problem(robot, [0, y, 0], [3, y, 0], footprint=body, cost=Cost(time=1.0)) for y in (0, 2)
    ]
    result = plan_fleet(FleetProblem(pair), time_limit=2.0, max_rounds=1)
    assert result.status is FleetStatus.FOUND
    assert result.sum_s == pytest.approx(6.0)


def test_an_obstacle_of_its_own_may_pass_its_goal_later():
    """A plan alone is told to stay too, and its checks look at where it stays."""
    cart = Obstacle(Disc(0.4), motion=Motion([0.0, 12.0], [[4.0, -6.0, 0.0], [4.0, 6.0, 0.0]]))
    fleet = fleets.fleet_of([([0, 0, 0], [4, 0, 0])], obstacles=(cart,))
    result = plan_fleet(fleet, time_limit=60.0, max_rounds=0)
    assert result.status is FleetStatus.FOUND
    assert result.last_s > 6.0  # alone in the world it would be there after four seconds
    too_soon = plan_fleet(fleets.fleet_of([([0, 0, 0], [4, 0, 0])]), time_limit=60.0, max_rounds=0)
    assert not verify_fleet(fleet, too_soon.plans).passed
    assert verify_fleet(fleet, result.plans).passed


@pytest.mark.exhaustive
@pytest.mark.slow
def test_both_give_way_in_the_alcove():
    """One after another the second waits until the first has gone by: 26.9 s."""
    alcove = load_scenario(SCENARIOS / "fleets" / "alcove.yaml").fleet
    result = plan_fleet(alcove, time_limit=60.0, max_rounds=6)
    assert result.status is FleetStatus.FOUND
    assert result.sum_s < 23.5

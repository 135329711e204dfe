"""The closed loop of a fleet: laws, guarantees, and scenes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton import FleetHorizon, FleetProblem, simulate_fleet
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision import Disc
from maneuver_automaton.fleet import FleetGuarantee, FleetStatus, Swap, plan_fleet
from maneuver_automaton.fleet.agreement import _Agreement
from maneuver_automaton.fleet.guarantees import broken
from maneuver_automaton.fleet.meetings import gap_between
from maneuver_automaton.fleet.moment import Moment
from maneuver_automaton.fleet.vehicle import OwnPlan, vehicles_of
from maneuver_automaton.groups import SE2
from tests.fleet.robots import (
    at_rest,
    crossing,
    least_distance,
    problem_of,
    scattered,
    swapping,
    through_a_door,
)
from tests.quickly import quick_are

LONG_S = 60.0  # [s] for a step: no clock decides


def loop_of(fleet, **more):
    """A loop that begins at rest, so that it depends on no clock."""
    more = {"step": 0.5, "first": at_rest(fleet), "time_limit": LONG_S} | more
    return simulate_fleet(fleet, **more)


def assert_kept(log, *, margin=0.1):
    """Everybody arrived, every guarantee held, and nobody came nearer than the margin."""
    assert log.reached, log.reason
    assert [*log.violations] == []
    assert log.distance_m >= margin - 1e-9
    assert least_distance(log) >= margin - 1e-9


def test_two_that_cross():
    log = loop_of(crossing())
    assert_kept(log)
    assert {swap.names for _, swap in log.swaps} >= {("a",), ("b",)}
    assert sorted(log.arrived_s) == ["a", "b"]
    assert log.last_s < 8.0  # 6 m at 1 m/s, and one of them waits a moment
    assert min(step.gap_m for step in log.steps) >= 0.1


@pytest.mark.parametrize("scene", [swapping, through_a_door])
def test_scenes(scene):
    fleet = scene()
    first = plan_fleet(fleet, time_limit=20.0, max_rounds=0)
    assert first.status is FleetStatus.FOUND
    log = loop_of(fleet, first=first)
    assert_kept(log)
    assert log.sum_s <= first.sum_s + 1e-9


def test_swapping_from_rest_in_a_group():
    assert_kept(loop_of(swapping(), group_size=2))


@pytest.mark.parametrize("by", [(3.0, -2.0, 0.0), (1.0, 4.0, 2.1)])
def test_a_moved_fleet_has_the_moved_loop(by):
    pushes = {"a": ma.Disturbance(pushes={2: (0.1, 0.2, 0.3)})}
    fleet = crossing(tolerance=0.05)
    here = loop_of(fleet, disturbance=pushes)
    there = loop_of(fleet.moved(SE2(by)), disturbance=pushes)
    assert [step.number for step in here.steps] == [step.number for step in there.steps]
    for one, other in zip(here.steps, there.steps, strict=True):
        assert one.arrivals == pytest.approx(other.arrivals, abs=1e-6)
        assert [swap.names for swap in one.swaps] == [swap.names for swap in other.swaps]
        assert one.void == other.void
        for name, pose in one.poses.items():
            moved = (SE2(by) @ SE2(pose)).pose
            assert other.poses[name][:2] == pytest.approx(moved[:2], abs=1e-6)


@pytest.mark.parametrize("seed", quick_are(range(3), range(40), exhaustive=True))
def test_random_fleets_lose_no_plan(seed):
    n = 2 + seed % 7
    fleet = scattered(n, seed)
    first = plan_fleet(fleet, time_limit=20.0, max_rounds=0)
    if first.status is not FleetStatus.FOUND:
        first = at_rest(fleet)
    log = loop_of(fleet, first=first, group_size=1 + seed % 3, steps=80)
    assert [*log.violations] == []
    assert log.distance_m >= 0.1 - 1e-9
    assert least_distance(log) >= 0.1 - 1e-9
    for step in log.steps:
        assert set(step.plans) == set(fleet.names)  # nobody ever without a plan
    for one, other in zip(log.steps[:-1], log.steps[1:], strict=True):
        assert other.value <= one.value + 1e-9
    if first.status is FleetStatus.FOUND:
        assert log.reached
        assert log.sum_s <= first.sum_s + 1e-9 or any(len(s.names) > 1 for _, s in log.swaps)


def test_whoever_finds_nothing_holds_on():
    fleet = crossing()
    first = plan_fleet(fleet, time_limit=20.0, max_rounds=0)
    log = loop_of(fleet, first=first, time_limit=1e-9)
    assert_kept(log)
    assert [*log.swaps] == []
    assert log.sum_s == pytest.approx(first.sum_s, abs=1e-6)


def test_who_has_no_time_drives_on_beside_its_plan():
    fleet = crossing(tolerance=0.1)
    first = plan_fleet(fleet, time_limit=20.0, max_rounds=0)
    noise = ma.Disturbance(position_m=0.003, heading_rad=0.003)
    log = loop_of(fleet, first=first, time_limit=1e-9, disturbance=noise)
    assert log.reached
    assert [*log.violations] == []
    assert not any(step.void or step.swaps for step in log.steps)


def test_swaps_per_step_and_the_rotating_order():
    log = loop_of(scattered(4, 2), swaps_per_step=1)
    assert all(len(step.asked) <= 1 for step in log.steps)
    assert len({name for step in log.steps for name in step.asked}) == 4


def test_a_control_and_a_log_of_one_step():
    fleet = crossing()
    loop = FleetHorizon(fleet, step=0.5, first=at_rest(fleet), time_limit=LONG_S)
    step = loop.step({"a": [-3, 0, 0], "b": [0, -3, np.pi / 2]})
    assert step.time == 0.0
    assert step.control_of("a").tolist() == [1.0, 0.0]
    assert step.value == pytest.approx(sum(step.values.values()))
    assert math.isinf(step.swaps[0].gain)
    assert loop.step({"a": [-2.5, 0, 0], "b": step.plans["b"].pose_at(0.5)}).time == 0.5


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"step": 0.0}, "step must be positive, got 0.0 s"),
        ({"step": 1.0, "time_limit": -1.0}, "time_limit must be positive"),
        ({"step": 1.0, "margin": -1.0}, "margin must be at least 0"),
        ({"step": 1.0, "tube_m": 0.2}, "tube_m is 0.2 m, need at most half of the margin"),
        ({"step": 1.0, "group_size": 0}, "group_size must be at least 1, got 0"),
        ({"step": 1.0, "delay_steps": -1}, "delay_steps must be at least 0, got -1"),
    ],
)
def test_wrong_numbers(wrong, said):
    with pytest.raises(ValueError, match=said):
        FleetHorizon(crossing(), **wrong)


def test_wrong_states():
    loop = FleetHorizon(crossing(), step=0.5)
    with pytest.raises(ValueError, match="no vehicle is named 'c', there are a, b"):
        loop.step({"c": [0, 0, 0]})
    with pytest.raises(ValueError, match="state of 'a'"):
        loop.step({"a": [0, 0]})
    loop.step({"a": [-3, 0, 0]}, time=1.0)
    with pytest.raises(ValueError, match="before the last step, 1 s"):
        loop.step({"a": [-3, 0, 0]}, time=0.5)


def test_who_stands_too_near_is_not_let_in():
    ends = ([0, 0, 0], [3, 0, 0]), ([0.5, 0, 0], [3, 2, 0])
    fleet = FleetProblem([problem_of(*one) for one in ends], names=("a", "b"), margin=0.1)
    step = FleetHorizon(fleet, step=0.5).step({"a": [0, 0, 0], "b": [0.5, 0, 0]})
    assert step.refused == ("b",)
    assert [one.guarantee for one in step.violations] == [FleetGuarantee.HELD]


# -- the guarantees themselves: each is broken by hand


def found_on(vehicle, *, cost=2.0, start=(0.0, 0.0, 0.0), duration=2.0):
    """A robot's plan straight on."""
    trim = vehicle.problem.automaton["on"]
    plan = ma.Plan(start, (trim,), durations=[duration])
    return OwnPlan(plan, cost, 0, vehicle.course_of(plan))


def pair(gap=1.0):
    """A moment at which two robots hold plans side by side."""
    ends = [([0, 0, 0], [2, 0, 0]), ([0, 0.6 + gap, 0], [2, 0.6 + gap, 0])]
    fleet = FleetProblem([problem_of(*one) for one in ends], names=("a", "b"), margin=0.1)
    state = FleetHorizon(fleet, step=0.5).state
    state.agreement = _Agreement(fleet.names)
    for k, one in enumerate(state.vehicles):
        state.held[k] = found_on(one, start=one.problem.start)
    state.agreement.start(state.held)
    now = Moment(state, 0.0, {}, Budget.from_now(1.0))
    now.before = {k: (one.cost, one.arrival) for k, one in now.held.items()}
    now.off = dict.fromkeys(now.held, 0.0)
    return now


def courses_of(now):
    return {k: one.course for k, one in now.held.items()}


def broken_by(now):
    return [(one.guarantee, one.names) for one in broken(now, courses_of(now))]


def test_apart():
    for gap, expected in ((0.2, []), (0.09, [(FleetGuarantee.APART, ("a", "b"))])):
        assert broken_by(pair(gap)) == expected


def test_held():
    now = pair()
    now.off[0] = 0.06
    assert broken_by(now) == [(FleetGuarantee.HELD, ("a",))]


def test_value_and_arrival():
    now = pair()
    start = now.held[1].plan.start
    now.held[1] = found_on(now.vehicles[1], cost=3.0, start=start, duration=3.0)
    now.state.agreement.start(now.held)
    assert broken_by(now) == [
        (FleetGuarantee.DECREASE, ("b",)),
        (FleetGuarantee.ARRIVAL, ("b",)),
        (FleetGuarantee.DECREASE, ("a", "b")),
    ]


@pytest.mark.parametrize(("cost", "costlier"), [(1.0, []), (1.6, [("a", "b")])])
def test_the_sum_of_a_group_counts_one_that_rejoined_its_plan(cost, costlier):
    now = pair()
    now.disturbed, now.in_group = {0}, {0, 1}
    for k, new in enumerate((cost, 2.5)):
        now.held[k] = found_on(now.vehicles[k], cost=new, start=now.held[k].plan.start)
    now.state.agreement.start(now.held)
    assert broken_by(now) == [(FleetGuarantee.DECREASE, names) for names in costlier]


def test_still_is_free():
    now = pair()
    vehicle = now.vehicles[0]
    wall = ma.Obstacle(Disc(0.5, [2.0, 0.0]))
    vehicle.problem = replace(vehicle.problem, obstacles=(wall,))
    assert broken_by(now) == [(FleetGuarantee.STILL, ("a",))]


def test_commit_order():
    now = pair()
    numbers = {"before": 3.0, "after": 2.0}
    one = Swap(names=("a",), past=(("b", 0),), holds=(("a", 1),), order=0, **numbers)
    stale = Swap(names=("b",), past=(("a", 0),), holds=(("b", 1),), order=1, **numbers)
    fresh = replace(stale, past=(("a", 1),))
    now.swaps = [one, fresh]
    assert not broken_by(now)
    now.swaps = [one, stale]
    assert broken_by(now) == [(FleetGuarantee.ORDER, ("b",))]


def test_known():
    now = pair()
    now.held[0] = found_on(now.vehicles[0])
    assert broken_by(now) == [(FleetGuarantee.KNOWN, ("a",))]


@pytest.mark.parametrize("seed", quick_are([0], range(3), exhaustive=True))
def test_the_gap_of_a_step_is_that_which_is_measured_anew(seed):
    fleet = scattered(2 + 3 * seed, seed)
    steps = loop_of(fleet, steps=60).steps
    vehicles = dict(zip(fleet.names, vehicles_of(fleet), strict=True))
    start = fleet.problems[0].start
    for step in steps:
        courses = {
            one.number: one.course_of(step.plans[name]).after(step.time)
            for name, one in vehicles.items()
        }
        anew = gap_between(courses, keep=fleet.margin, frame=(start[0], start[1], 0.0))
        assert step.gap_m == anew.distance

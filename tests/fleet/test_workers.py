"""Workers of their own: the same loop, few bytes, and what becomes of those that die."""

from __future__ import annotations

import os
import signal

import numpy as np
import pytest

from maneuver_automaton import Disturbance, FleetProblem, Goal, Problem, simulate_fleet
from maneuver_automaton.collision import Disc
from maneuver_automaton.fleet import plan_fleet
from maneuver_automaton.fleet.held import rest_of_plan, resting
from maneuver_automaton.fleet.vehicle import OwnPlan, vehicles_of
from maneuver_automaton.fleet.workers import decoded, encoded
from tests.fleet.mortal import Mortal
from tests.fleet.robots import at_rest, crossing, least_distance, problem_of, scattered
from tests.inertia import unicycle_automaton
from tests.quickly import quick_are

NOISE = Disturbance(position_m=0.003, heading_rad=0.003)


def assert_same(one, other):
    """Two loops are the same, to the last bit."""
    assert len(one.steps) == len(other.steps)
    for a, b in zip(one.steps, other.steps, strict=True):
        assert a.values == b.values
        assert [swap.names for swap in a.swaps] == [swap.names for swap in b.swaps]
        assert all(np.array_equal(a.poses[name], b.poses[name]) for name in a.poses)
        assert a.gap_m == b.gap_m


def loop_of(fleet, **more):
    more = {"step": 0.5, "first": at_rest(fleet), "time_limit": 60.0, "steps": 80} | more
    return simulate_fleet(fleet, **more)


@pytest.mark.parametrize("at_once", quick_are([3], [1, 3]))
def test_who_answers_is_no_matter(at_once):
    fleet = scattered(5, 2)
    more = {"at_once": at_once, "swaps_per_step": 3, "disturbance": NOISE}
    workers = Mortal(fleet, {})
    there = loop_of(fleet, workers=workers, **more)
    assert_same(loop_of(fleet, **more), there)
    assert there.counts["questions"] == there.counts["asked"]


def test_who_is_silent_drives_what_it_holds():
    fleet = crossing(tolerance=0.1)
    first = plan_fleet(fleet, time_limit=20.0, max_rounds=0)
    log = loop_of(fleet, first=first, workers=Mortal(fleet, {0: 0.0}), disturbance=NOISE)
    assert log.reached
    assert [*log.violations] == []
    assert log.steps[-1].silent in {("a",), ()}
    assert least_distance(log) > 0.0


def test_who_is_silent_at_rest_stays():
    fleet = crossing(tolerance=0.1)
    log = loop_of(fleet, workers=Mortal(fleet, {0: 0.0}))
    assert set(log.arrived_s) == {"b"}
    assert log.steps[-1].silent == ("a",)
    assert [*log.violations] == []
    assert np.array_equal(log.steps[-1].poses["a"], fleet.problems[0].start)


def test_who_is_silent_stops_before_one_that_broke_down():
    fleet = crossing(tolerance=0.1)
    first = plan_fleet(fleet, time_limit=20.0, max_rounds=0)
    log = loop_of(fleet, first=first, workers=Mortal(fleet, {1: 0.5}), breaks_s={"a": 3.0})
    assert log.distance_m > 0.0
    assert least_distance(log) > 0.0
    assert all(set(step.plans) == {"a", "b"} for step in log.steps)


@pytest.mark.parametrize("dies", [{}, {0: 0.0}, {0: 0.0, 1: 0.0}])
def test_who_was_pushed_off_its_plan_goes_on_without_a_worker(dies):
    fleet = crossing(tolerance=0.1)
    first = plan_fleet(fleet, time_limit=20.0, max_rounds=0)
    pushes = {"a": Disturbance(pushes={2: (0.1, 0.2, 0.3)})}
    loop = loop_of(fleet, first=first, workers=Mortal(fleet, dies), disturbance=pushes)
    (void,) = [step.void for step in loop.steps if step.void]
    assert void == (("a", "b") if dies else ("a",))  # where a stops, b would hit it
    assert loop.reached
    assert {row.guarantee.value for _, row in loop.violations} == set()
    assert least_distance(loop) > 0.0


def test_who_waits_on_its_void_plan_goes_on_once_that_is_free():
    """Without a worker one stops where another one would hit it, and goes on behind that."""
    fleet = crossing(tolerance=0.1)
    first = plan_fleet(fleet, time_limit=20.0, max_rounds=0)
    pushes = {"a": Disturbance(pushes={2: (-0.6, 0.0, 0.0)})}
    workers = Mortal(fleet, {0: 0.0, 1: 0.0})
    loop = loop_of(fleet, first=first, workers=workers, disturbance=pushes)
    assert loop.reached
    assert least_distance(loop) > 0.0


@pytest.mark.parametrize("heavy", [False, True])
def test_a_plan_in_few_bytes(heavy):
    if heavy:
        end = Goal(pose=[3, 1, 0], tolerance_m=0.1, tolerance_rad=0.2)
        problem = Problem(unicycle_automaton(), [0, 0, 0], end, footprint=Disc(0.3))
    else:
        problem = problem_of([0, 0, 0], [5, 2, 1], tolerance=0.1)
    fleet = FleetProblem([problem])
    (vehicle,), (again,) = vehicles_of(fleet), vehicles_of(fleet)
    plan = plan_fleet(fleet, time_limit=20.0, max_rounds=0).plans["1"]
    found = OwnPlan(plan, 7.25, 0, vehicle.course_of(plan))
    said = encoded(vehicle, found)
    assert heavy or len(said) <= 200  # a motion that was polished is sent whole
    for one in (found, resting(vehicle, np.array([1.0, 2.0, 3.0]), 0.25)):
        same = decoded(again, encoded(vehicle, one))
        assert same.cost == one.cost
        assert same.plan.word == one.plan.word
        assert np.array_equal(same.plan.durations, one.plan.durations)
        for ours, theirs in zip(one.course.motions, same.course.motions, strict=True):
            assert np.array_equal(ours.time, theirs.time)
            assert np.array_equal(ours.pose, theirs.pose)
    cut = rest_of_plan(vehicle, found, 0.3)  # with inertia it begins within a maneuver
    rest = OwnPlan(cut, 1.0, 0, vehicle.course_of(cut))
    assert np.array_equal(decoded(again, encoded(vehicle, rest)).plan.end, cut.end)
    with pytest.raises(ValueError, match="a message is cut off"):
        decoded(again, encoded(vehicle, resting(vehicle, plan.start, 0.0))[:20])


@pytest.mark.slow
def test_on_dask():
    distributed = pytest.importorskip("distributed")
    from maneuver_automaton.fleet import DaskWorkers

    fleet = scattered(6, 3)
    more = {"at_once": 2, "disturbance": NOISE, "seed": 1}
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        there = loop_of(fleet, workers=DaskWorkers(fleet, client), **more)
        assert_same(loop_of(fleet, **more), there)
        counts = there.counts
        assert counts["worker_messages"] == 2 * counts["asked"]
        assert counts["worker_bytes"] / counts["worker_plans"] < 200

        pids = client.run(os.getpid)
        killed = pids[min(pids)]

        def kill(step):
            if step.number == 4:
                os.kill(killed, signal.SIGKILL)

        first = plan_fleet(fleet, time_limit=60.0, max_rounds=0)
        workers = DaskWorkers(fleet, client)
        log = loop_of(fleet, first=first, workers=workers, progress=kill, swaps_per_step=6, **more)
        assert log.reached
        assert [*log.violations] == []
        assert all(set(step.plans) == set(fleet.names) for step in log.steps)
        assert least_distance(log) > 0.0

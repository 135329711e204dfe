"""What a fleet drove, looked at again by shapely and the audit."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import Box, Disc
from maneuver_automaton.fleet import FleetProblem, simulate_fleet, verify_driven
from maneuver_automaton.fleet.driven import FINE
from maneuver_automaton.groups import SE2
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Problem
from maneuver_automaton.receding_horizon import Disturbance
from tests.fleet.robots import crossing, least_distance
from tests.inertia import unicycle_automaton

NOISE = Disturbance(position_m=0.003, heading_rad=0.003)


@pytest.fixture(scope="module")
def log():
    return simulate_fleet(crossing(tolerance=0.05), step=0.5, disturbance=NOISE)


def test_distances_are_those_of_slow_sampling(log):
    verdict = verify_driven(log)
    assert verdict.passed
    assert not verdict.collisions
    assert not verdict.defects
    slow = least_distance(log)  # at instants alone
    assert slow - 0.02 <= verdict.distance_m <= slow
    assert 0.0 < max(verdict.jumps_m.values()) < 0.05


@settings(max_examples=15)
@given(x=st.floats(-50, 50), y=st.floats(-50, 50), heading=st.floats(-3.1, 3.1))
def test_what_is_moved_is_as_far_apart(log, x, y, heading):
    by = SE2(np.array([x, y, heading]))
    moved = replace(
        log,
        problem=log.problem.moved(by),
        driven={
            name: tuple(replace(piece, start=(by @ SE2(piece.start)).pose) for piece in pieces)
            for name, pieces in log.driven.items()
        },
    )
    one, other = verify_driven(log), verify_driven(moved)
    assert other.distance_m == pytest.approx(one.distance_m, abs=2 * FINE)
    assert other.passed


def still(name, velocity):
    return Trim(name=name, body_velocity=velocity, control=velocity[::2])


def driven(log, **ways):
    """The log, if something else was driven in its first step alone."""
    first = replace(log.steps[0], plans={name: log.steps[0].plans[name] for name in ways})
    pieces = {name: (plan,) for name, plan in ways.items()}
    return replace(log, steps=(first,), step=2.0, driven=pieces, arrived_s={})


def test_by_hand(log):
    """Two discs of 0.3 m pass each other at 1 m between their lines, at 0.4 m at x = 1."""
    a, b = log.problem.names
    discs = [replace(one, footprint=(Disc(0.3),), obstacles=()) for one in log.problem.problems]
    fleet = FleetProblem(discs, names=[a, b], margin=0.1)
    on = still("on", [1.0, 0.0, 0.0])
    passing = driven(
        replace(log, problem=fleet),
        **{
            a: Plan([0, 0, 0], (on,), durations=[2.0]),
            b: Plan([2, 1, math.pi], (on,), durations=[2.0]),
        },
    )
    verdict = verify_driven(passing)
    assert verdict.closest[0].pair == (a, b)
    assert 0.4 - FINE <= verdict.distance_m <= 0.4
    assert verdict.closest[0].time_s == pytest.approx(1.0, abs=0.02)
    assert verdict.clearance_m == math.inf


def test_what_touches_between_samples_is_found(log):
    """Corners of two boxes that turn fast touch for less than a sample."""
    a, b = log.problem.names
    boxes = [replace(one, footprint=(Box([2.0, 0.1]),)) for one in log.problem.problems]
    fleet = FleetProblem(boxes, names=[a, b])
    spin, rest = still("spin", [0.0, 0.0, 40.0]), still("stand", [0.0, 0.0, 0.0])
    reach = math.hypot(1.0, 0.05)

    def turning(apart):
        return driven(
            replace(log, problem=fleet),
            **{
                a: Plan([0, 0, math.pi / 2 + 0.0123], (spin,), durations=[2.0]),
                b: Plan([1.0 + apart + reach, 0, 0], (rest,), durations=[2.0]),
            },
        )

    assert verify_driven(turning(-1e-3)).collisions
    free = verify_driven(turning(1e-3))
    assert not free.collisions
    assert free.distance_m == pytest.approx(1e-3, abs=2 * FINE)


def test_an_obstacle_that_is_hit(log):
    a, b = log.problem.names
    wall = (Box([0.2, 4.0], [1.0, 0.0]),)
    problems = [replace(one, obstacles=wall) for one in log.problem.problems]
    fleet = FleetProblem(problems, names=[a, b])
    on = still("on", [1.0, 0.0, 0.0])
    hit = driven(
        replace(log, problem=fleet),
        **{
            a: Plan([-1, 0, 0], (on,), durations=[2.0]),
            b: Plan([-1, 8, 0], (on,), durations=[2.0]),
        },
    )
    verdict = verify_driven(hit)
    assert not verdict.passed
    assert verdict.collisions[0].startswith(f"{a} touches an obstacle at ")


def test_who_drives_otherwise_than_its_model_is_told(log):
    a, b = log.problem.names
    drifts = still("drifts", [1.0, 0.5, 0.0])
    odd = driven(
        log,
        **{
            a: Plan(log.problem.problems[0].start, (drifts,), durations=[1.0]),
            b: Plan(log.problem.problems[1].start, (), durations=[]),
        },
    )
    verdict = verify_driven(odd)
    assert not verdict.passed
    assert list(verdict.defects) == [a]
    assert "off the model's equations" in verdict.defects[a]


@pytest.mark.parametrize("jumps", [True, False])
def test_whose_speed_jumps_is_told(log, jumps):
    """From rest a robot with inertia speeds up to 1 m/s, and then goes on with that, or slower."""
    a, b = log.problem.names
    robot = unicycle_automaton()
    heavy = Problem(robot, [0, 0, 0], [9, 0, 0], footprint=Disc(0.3))
    fleet = FleetProblem([heavy, log.problem.problems[1]], names=[a, b], margin=0.1)
    rest, on, slow = robot["rest"], robot["1, 0"], robot["-0.6, 0"]
    up = next(one for one in robot.maneuvers if (one.source, one.target) == ("rest", "1, 0"))
    first = Plan([0, 0, 0], (rest, on), durations=[0.0, 1.0], maneuvers=(up,))
    then = Plan(first.end, (slow if jumps else on,), durations=[2.0], start_time=2.0)
    away = [Plan([50, 0, 0], (), durations=[], start_time=time) for time in (0.0, 2.0)]
    steps = tuple(replace(log.steps[k], number=k, time=2.0 * k) for k in (0, 1))
    pieces = {a: (first, then), b: tuple(away)}
    verdict = verify_driven(
        replace(log, problem=fleet, steps=steps, step=2.0, driven=pieces, arrived_s={})
    )
    assert verdict.passed is not jumps
    if jumps:
        assert verdict.defects == {a: "at 2 s: its reduced state jumps from (1, 0) to (-0.6, 0)"}


@pytest.mark.parametrize("leaves", [True, False])
def test_who_has_left_is_hit_by_nobody(log, leaves):
    """One stops at (1, 0) after a second and is gone, or not; another one comes there at 2 s."""
    a, b = log.problem.names
    fleet = replace(log.problem, leaves=(leaves, False))
    on = still("on", [1.0, 0.0, 0.0])
    ways = {
        a: Plan([0, 0, 0], (on,), durations=[1.0]),
        b: Plan([1, 2.3, -math.pi / 2], (on,), durations=[2.0]),
    }
    verdict = verify_driven(
        replace(driven(replace(log, problem=fleet), **ways), arrived_s={a: 1.0})
    )
    assert bool(verdict.collisions) is not leaves
    if leaves:
        assert verdict.closest[0].time_s <= 1.0 + 0.005

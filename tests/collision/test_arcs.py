"""Obstacles that move on arcs, or are there for a while: everybody who looks sees the same."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from maneuver_automaton.audit.judge import closest_to
from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import Box, Disc, Motion, Obstacle
from maneuver_automaton.collision.advancement import clearances, free_times
from maneuver_automaton.collision.surroundings import parts_of, surroundings_of
from maneuver_automaton.collision.world import world_of
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import Unicycle
from maneuver_automaton.primitives import Trim

CAR = (Box([1.2, 0.6], center=[0.3, 0.0]),)
LONG = Box([1.6, 0.8], center=[-0.4, 0.1])
MARGIN = 1e-4

rates = st.tuples(st.floats(-2.0, 2.0), st.floats(-0.5, 0.5), st.floats(-1.5, 1.5))
runs = st.lists(st.tuples(rates, st.floats(0.2, 2.0)), min_size=1, max_size=4)


def arcs(start, parts, begin=0.0):
    """A motion that coasts with twists, each for a time."""
    poses = [np.asarray(start, dtype=float)]
    times = [begin]
    for twist, lasting in parts:
        step = SE2.exp(lasting * np.array(twist)).pose
        after = np.array((SE2(poses[-1]) @ SE2(step)).pose)
        after[2] = poses[-1][2] + step[2]
        poses.append(after)
        times.append(times[-1] + lasting)
    return Motion(times, poses, [twist for twist, _ in parts])


def dense(motion, n=4000):
    """Times, and poses along a motion, a little longer than it lasts."""
    times = np.linspace(motion.time[0] - 0.5, motion.time[-1] + 0.5, n)
    return times, motion.at(times)


def distances(footprint, poses, shape, others):
    """Distances by shapely of two bodies at poses (n, 3) each."""
    (one,), (other,) = parts_of(footprint), parts_of((shape,))
    return shapely.distance(one.at(poses), other.at(others)) - one.radius - other.radius


@given(runs, st.floats(-3.0, 3.0))
def test_a_motion_on_arcs_coasts_from_pose_to_pose(parts, heading):
    motion = arcs([1.0, -2.0, heading], parts, begin=2.0)
    (twist, lasting) = parts[0]
    middle = (SE2(motion.pose[0]) @ SE2.exp(0.5 * lasting * np.array(twist))).pose
    found = motion.at(2.0 + 0.5 * lasting)
    assert found[:2] == pytest.approx(middle[:2], abs=1e-12)
    assert math.remainder(found[2] - middle[2], math.tau) == pytest.approx(0.0, abs=1e-12)
    assert motion.at([0.0, 99.0]).tolist() == motion.pose[[0, -1]].tolist()
    by = SE2([3.0, 1.0, 2.0])
    moved = (by @ SE2(found)).pose
    assert motion.moved(by).at(2.0 + 0.5 * lasting)[:2] == pytest.approx(moved[:2], abs=1e-12)


def test_a_plan_is_a_motion():
    trims = tuple(
        Trim(name=str(k), body_velocity=twist, control=[0.0, 0.0])
        for k, twist in enumerate([[1.0, 0.0, 0.0], [1.0, 0.0, 0.7], [-1.0, 0.0, 0.3]])
    )
    plan = Plan([1.0, 2.0, 3.0], trims, durations=[1.0, 0.0, 2.0], start_time=4.0)
    motion = Motion.of_plan(plan)
    times = np.linspace(0.0, plan.duration, 50)
    assert motion.at(4.0 + times) == pytest.approx(plan.pose_at(4.0 + times), abs=1e-12)
    assert len(motion.time) == 3


def test_a_twist_leads_to_the_next_pose():
    with pytest.raises(ValueError, match="twist 1 leads 1 m and 0 rad beside pose 2"):
        Motion([0.0, 1.0], [[0, 0, 0], [2, 0, 0]], twist=[[1.0, 0, 0]])
    with pytest.raises(ValueError, match=r"got twists \(2, 3\), need one for all poses but the la"):
        Motion([0.0, 1.0], [[0, 0, 0], [2, 0, 0]], twist=[[1.0, 0, 0]] * 2)


@given(runs, rates, st.floats(0.5, 4.0), st.floats(-3.0, 3.0), st.booleans())
def test_what_is_proven_free_is_free(parts, twist, duration, heading, backwards):
    motion = arcs([2.5, 0.5, heading], parts)
    world = world_of((Obstacle(LONG, motion=motion),), CAR, (0.0, 0.0, 0.0))
    clock = duration if backwards else 0.0
    lasting = -duration if backwards else duration
    (free,) = free_times(
        world, np.zeros((1, 3)), twists=[twist], durations=[lasting], margin=MARGIN, times=clock
    )
    times = np.linspace(0.0, duration, 800)
    sign = -1.0 if backwards else 1.0
    here = SE2.exp(sign * times[:, None] * np.array(twist)).pose
    apart = distances(CAR, here, LONG, motion.at(clock + sign * times))
    assert (apart[times < free] > 0.0).all()
    late = np.flatnonzero(apart <= 0.0)  # the margin is that of poses looked at
    near = np.flatnonzero(apart <= 3.0 * MARGIN + 0.02)
    if not near.size:
        assert free == duration
    if late.size:
        assert free <= times[late[0]] + 1e-9


@given(runs, runs, st.floats(-3.0, 3.0))
def test_the_audit_sees_arcs(parts, own, heading):
    motion = arcs([2.5, 0.5, heading], parts)
    trims = tuple(
        Trim(name=str(k), body_velocity=[v, 0.0, w], control=[v, w])
        for k, ((v, _, w), _) in enumerate(own)
    )
    plan = Plan([0.0, 0.0, 0.0], trims, durations=[lasting for _, lasting in own])
    obstacles = (Obstacle(LONG, motion=motion),)
    times = np.linspace(0.0, plan.duration, 3000)
    apart = distances(CAR, plan.pose_at(times), LONG, motion.at(times))
    step = 5.0 * (times[1] - times[0])
    least = closest_to(plan, Unicycle(), obstacles, footprint=CAR)
    assert least.distance <= apart.min() + 1e-9
    assert least.distance >= 0.99 * (apart.min() - step) - 1e-3


@pytest.mark.parametrize("moves", [False, True])
def test_what_is_there_for_a_while_is_met_then(moves):
    motion = Motion([0.0, 1.0], [[0, 0, 0], [0, 0, 1]]) if moves else None
    door = (Obstacle(Disc(0.5, [0.0, 0.0]), motion=motion, present_s=(2.0, 3.0)),)
    world = world_of(door, CAR, (0.0, 0.0, 0.0))
    times = np.array([1.9, 2.0, 3.0, 3.1])
    near = clearances(world, np.zeros((4, 3)), times=times) <= 0.0
    assert near.tolist() == [False, True, True, False]
    around = surroundings_of(door, (0.0, 0.0))
    found = around.nearest(parts_of(CAR), np.zeros((4, 3)), times).distance
    assert (found <= 0.0).tolist() == near.tolist()
    for clock, lasting, free in ((0.0, 1.9, True), (0.0, 2.1, False), (3.1, 5.0, True)):
        still = Trim(name="rest", body_velocity=[0.0, 0.0, 0.0], control=[0.0, 0.0])
        plan = Plan([0, 0, 0], (still,), durations=[lasting], start_time=clock)
        assert (closest_to(plan, Unicycle(), door, footprint=CAR).distance > 0.0) == free
        (held,) = free_times(
            world,
            np.zeros((1, 3)),
            twists=np.zeros((1, 3)),
            durations=[lasting],
            margin=MARGIN,
            times=clock,
        )
        assert (held == lasting) == free


def test_a_time_that_ends_before_it_begins_is_refused():
    with pytest.raises(ValueError, match="present_s must be"):
        Obstacle(Disc(1.0), present_s=(2.0, 1.0))

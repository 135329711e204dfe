"""Faults that are planted: each is caught."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton.audit import audit_plan
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.collision import Box, Disc, Obstacle, Zone
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import CarWithTrailer, SecondOrderCar, Unicycle, UserModel
from maneuver_automaton.planning import checking
from maneuver_automaton.planning.checking import Condition, check_plan
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.primitives.driving import drive
from maneuver_automaton.problem import Goal, Problem
from tests.audit.test_guarantee import TRUCK, hauled, trailer_poses

CAR = SecondOrderCar(
    wheelbase=2.8, max_steering=0.6, max_speed=20.0, max_acceleration=2.0, max_steering_rate=0.5
)
STANDING = Trim(
    name="standing", body_velocity=np.zeros(3), control=np.zeros(2), reduced_state=np.zeros(2)
)


def driving(controls=((2.0, 0.1), (-2.0, -0.1)), durations=(5.0, 5.0)):
    """A car that drives some 50 m from rest to rest, its steering a little off straight."""
    course = drive(CAR, np.zeros(2), control=controls, durations=durations)
    return plan_of(course)


def plan_of(course, *, twice=False):
    hop = Maneuver(
        name="hop",
        source="standing",
        target="standing",
        displacement=course.pose[-1],
        duration=float(course.time[-1]),
        course=course,
    )
    n = 3 if twice else 2
    return Plan(np.zeros(3), (STANDING,) * n, durations=np.zeros(n), maneuvers=(hop,) * (n - 1))


def judged(plan, **changed):
    states = (np.zeros(2), np.zeros(2))
    return audit_plan(plan, Goal(pose=plan.end, **changed), CAR, states=states)


def test_what_is_right_passes():
    audit = judged(driving())
    assert audit.passed, audit.reason
    assert audit.max_dynamics_defect < 1e-11


@pytest.mark.parametrize("off", [[0, 0, 1e-6], [1e-6, 0, 0], [0, -1e-6, 0]])
@pytest.mark.parametrize("loose", [False, True])
def test_a_piece_that_begins_beside_the_end_of_the_one_before(off, loose):
    """Also where the goal is not asked for exactly, 100 m away."""
    course = driving().maneuvers[0].course
    pose = course.pose.copy()
    pose[pose.shape[0] // 2 :] += off
    plan = plan_of(replace(course, pose=pose), twice=True)
    tolerances = {"tolerance_m": 0.1, "tolerance_rad": 0.1} if loose else {}
    audit = judged(plan, **tolerances)
    assert not audit.passed
    assert audit.max_dynamics_defect > 0.9e-6


def test_a_reduced_state_that_jumps():
    course = driving().maneuvers[0].course
    states = course.reduced_state.copy()
    states[10:20] += 1e-5
    assert not judged(plan_of(replace(course, reduced_state=states))).passed


def test_a_control_beyond_its_limits():
    audit = judged(driving(((2.0 + 1e-6, 0.1), (-2.0 - 1e-6, -0.1))))
    assert audit.reason == "acceleration is 1e-06 beyond its limits [-2, 2]"


def test_a_trailer_that_the_planner_places_beside_its_place(monkeypatch):
    plan, controls, durations = hauled(2)
    poses = trailer_poses(plan, controls, durations)
    post = Obstacle(Disc(0.2, poses[4000, 3:5]), name="post")  # where the trailer's axle rolls
    trims = {trim.name: trim for trim in plan.trims}
    library = Automaton(TRUCK, tuple(trims.values()), plan.maneuvers)
    problem = Problem(
        library,
        plan.start,
        Goal(pose=plan.end, trim="after"),
        start_trim="before",
        parts={"trailer": (Disc(0.5),)},
        obstacles=[post],
    )
    right = checking.cutting.carried
    assert check_plan(problem, plan, problem.goals[0]).broken is Condition.COLLISION

    def beside(*arguments):
        there = right(*arguments)
        return replace(there, start=np.add(there.start, [0.0, 50.0, 0.0]))

    monkeypatch.setattr(checking.cutting, "carried", beside)
    found = check_plan(problem, plan, problem.goals[0])
    assert found.broken is Condition.AUDIT
    assert found.reason.startswith("the trailer: at ")
    assert found.reason.endswith("touches obstacle 'post'")


def test_a_zone_holds_for_what_is_carried():
    cart = UserModel(
        name="cart",
        group=SE2,
        control_names=("speed",),
        velocity=lambda z, u: [u[0], 0.0, 0.0],
        part_names=("cart",),
        part_poses=lambda z: np.broadcast_to([[-3.0, 0.0, 0.0]], (*np.shape(z)[:-1], 1, 3)),
    )
    ahead = Trim(name="ahead", body_velocity=[2.0, 0.0, 0.0], control=[2.0])
    plan = Plan(np.zeros(3), (ahead,), durations=[2.0])
    school = Zone(shape=Box([2.0, 2.0], [-2.5, 0.0]), max_speed=1.0, name="the school")

    def judged_with(parts):
        return audit_plan(plan, Goal(pose=plan.end), cart, parts=parts, zones=(school,))

    assert judged_with({}).passed
    audit = judged_with({"cart": (Disc(0.3),)})
    assert audit.reason == "at 0 s the vehicle moves as the school does not admit"


def test_an_integration_that_fails_is_no_plan():
    bursting = UserModel(
        name="bursting",
        group=SE2,
        control_names=("push",),
        reduced_names=("speed",),
        velocity=lambda z, u: [z[0], 0.0, 0.0],
        dynamics=lambda z, u: [1.0 + z[0] * z[0]],  # its speed is infinite after pi / 2
    )
    still = Trim(name="still", body_velocity=[0.0, 0.0, 0.0], control=[0.0], reduced_state=[0.0])
    plan = Plan(np.zeros(3), (still,), durations=[3.0])
    audit = audit_plan(plan, Goal(pose=plan.end), bursting)
    assert not audit.passed
    assert audit.reason.startswith("the plan is ")


def test_what_turns_without_end_is_not_driven_again():
    """Each radian is an element, and coasts of years would take hundreds of gigabytes."""
    spin = Trim(name="spin", body_velocity=[0.0, 0.0, -2.0], control=[0.0, -2.0])
    for lasting, passes in ((90.0, True), (1e5, False)):
        plan = Plan(np.zeros(3), (spin,), durations=[lasting])
        audit = audit_plan(plan, Goal(pose=plan.end), Unicycle())
        assert audit.passed is passes, audit.reason
    assert audit.reason == "it turns by 2e+05 rad, need at most 20000"


def test_a_trailer_that_is_pushed_far_is_followed():
    """Its angle is unstable: rounding grows by exp(80 / 3), which no integration bears."""
    steering = 0.1
    hitch = math.asin(3.0 * math.tan(steering) / 2.8)
    turn = -math.tan(steering) / 2.8
    back = Trim(name="back", body_velocity=[-1.0, 0.0, turn], control=[-1.0, steering],
                reduced_state=[hitch])  # fmt: skip
    plan = Plan(np.zeros(3), (back,), durations=[80.0])
    truck = CarWithTrailer(wheelbase=2.8, hitch_length=3.0, max_steering=0.6, max_speed=2.0)
    assert audit_plan(plan, Goal(pose=plan.end), truck).passed
    bent = replace(back, reduced_state=[hitch + 1e-6])
    assert not audit_plan(replace(plan, trims=(bent,)), Goal(pose=plan.end), truck).passed

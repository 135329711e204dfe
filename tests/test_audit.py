"""The audit: right plans pass, and nothing that is wrong slips through."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from maneuver_automaton.audit import audit_plan, terminal_error
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.groups import SE2, SE2xR
from maneuver_automaton.models import Car, Unicycle, UserModel
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Goal

ROBOT = Automaton.of_controls(
    Unicycle(),
    {
        "rest": (0.0, 0.0),
        "straight": (1.5, 0.0),
        "clockwise": (-0.25, -1.0),
        "anticlockwise": (-0.25, 1.0),
        "spin": (0.0, 1.0),
    },
)
CAR = Automaton.of_controls(
    Car(wheelbase=2.0, max_steering=0.6),
    {"left": (1.0, 0.6), "ahead": (1.0, 0.0), "back right": (-0.5, -0.4)},
)
GLIDER = Automaton.of_controls(
    UserModel(
        name="glider",
        group=SE2xR,
        control_names=("speed", "turn", "climb"),
        velocity=lambda z, u: [u[0], 0.1 * u[1], u[1], u[2]],
    ),
    {"up": (1.0, 0.5, 0.5), "down": (2.0, 0.0, -0.25), "right": (1.0, -1.0, 0.0)},
)


def plan_of(automaton, *pieces, start=None):
    trims = tuple(automaton[name] for name, _ in pieces)
    start = np.zeros(automaton.model.group.dof) if start is None else start
    return Plan(start, trims, durations=[time for _, time in pieces])


PARKING = plan_of(ROBOT, ("clockwise", 1.5), ("straight", 0.8), ("spin", 1.25), ("rest", 2.0))


@pytest.mark.parametrize("automaton", [ROBOT, CAR, GLIDER], ids=["unicycle", "car", "glider"])
@settings(max_examples=15)
@given(data=st.data())
def test_every_word_of_a_right_library_passes(automaton, data):
    pieces = st.lists(
        st.tuples(st.sampled_from(automaton.trim_names), st.just(0.0) | st.floats(1e-6, 8.0)),
        max_size=4,
    )
    start = arrays(np.float64, automaton.model.group.dof, elements=st.floats(-10.0, 10.0))
    plan = plan_of(automaton, *data.draw(pieces), start=data.draw(start))
    audit = audit_plan(plan, Goal(pose=plan.end), automaton.model)
    assert audit.passed, audit.reason
    assert audit.reason == ""
    assert audit.max_dynamics_defect < 1e-8
    assert audit.terminal_position_m < 1e-12
    assert audit.terminal_heading_rad == 0.0


def test_whole_turns_of_the_heading_do_not_count():
    plan = plan_of(ROBOT, ("spin", 9.0))
    turned = Goal(pose=plan.end - [0.0, 0.0, 2 * math.pi])
    assert audit_plan(plan, turned, ROBOT.model).passed


def lying(plan, k, body_velocity):
    """The plan with a trim that claims another twist than its control makes."""
    trims = list(plan.trims)
    trims[k] = replace(trims[k], body_velocity=body_velocity)
    return Plan(plan.start, trims, durations=plan.durations)


@pytest.mark.parametrize(
    "velocity", [[1.5, 0.0, 1e-4], [1.5, 1e-5, 0.0], [1.5 + 1e-5, 0.0, 0.0], [-1.5, 0.0, 0.0]]
)
def test_a_trim_that_lies_about_its_twist_is_caught(velocity):
    plan = lying(PARKING, 1, velocity)
    audit = audit_plan(plan, Goal(pose=plan.end), ROBOT.model)
    assert not audit.passed
    assert audit.terminal_position_m < 1e-12  # by its own account it ends at the goal
    assert audit.reason == (
        f"the plan is {audit.max_dynamics_defect:.3g} off the model's equations"
    )


def test_a_lie_that_ends_in_the_right_place_is_caught():
    # both semicircles end 2 m aside facing back, one of them was driven at twice the speed
    circle = Trim(name="circle", body_velocity=[math.pi, 0.0, math.pi], control=[1.0, 1.0])
    half = Plan([0.0, 0.0, 0.0], (circle,), durations=[1.0])
    audit = audit_plan(half, Goal(pose=[0.0, 2.0, math.pi]), Unicycle())
    assert not audit.passed
    assert audit.terminal_position_m < 1e-12
    # a whole circle in place of a rest: start and end are the same, the way is not
    loop = Trim(name="loop", body_velocity=[1.0, 0.0, 1.0], control=[0.0, 0.0])
    still = Plan([0.0, 0.0, 0.0], (loop,), durations=[2 * math.pi])
    audit = audit_plan(still, Goal(pose=[0.0, 0.0, 0.0]), Unicycle())
    assert not audit.passed
    assert audit.max_dynamics_defect > 1.0


def test_lies_that_cancel_are_caught():
    plan = lying(lying(PARKING, 1, [1.5, 0.1, 0.0]), 3, [0.0, 0.0, 0.0])
    plan = Plan(plan.start, (*plan.trims, ROBOT["rest"]), durations=[*plan.durations, 1.0])
    assert not audit_plan(plan, Goal(pose=plan.end), ROBOT.model).passed


def test_a_plan_of_another_vehicle_is_caught():
    plan = plan_of(CAR, ("left", 2.0))
    longer = Car(wheelbase=2.001, max_steering=0.6)
    assert audit_plan(plan, Goal(pose=plan.end), CAR.model).passed
    assert not audit_plan(plan, Goal(pose=plan.end), longer).passed


def test_a_reduced_state_that_does_not_stay_is_caught():
    boat = UserModel(
        name="boat",
        group=SE2,
        control_names=("push",),
        reduced_names=("speed",),
        velocity=lambda z, u: [z[0], 0.0, 0.0],
        dynamics=lambda z, u: [u[0] - z[0]],
    )

    def cruise(speed, push):
        trim = Trim(
            name="cruise", body_velocity=[speed, 0, 0], control=[push], reduced_state=[speed]
        )
        return Plan([0.0, 0.0, 0.0], (trim,), durations=[2.0])

    steady = cruise(1.5, 1.5)
    assert audit_plan(steady, Goal(pose=steady.end), boat).passed
    slowing = cruise(1.5, 1.4)
    assert not audit_plan(slowing, Goal(pose=slowing.end), boat).passed
    jump = Plan(
        steady.start, (*steady.trims, *cruise(2.0, 2.0).trims), durations=np.array([1.0, 1.0])
    )
    audit = audit_plan(jump, Goal(pose=jump.end), boat)
    assert not audit.passed
    assert audit.max_dynamics_defect >= 0.5 * (1 - 1e-9)  # the speed cannot jump


@pytest.mark.parametrize(
    ("off", "reason"),
    [
        ([0.003, 0.004, 0.0], "it ends 0.005 m from the goal"),
        ([0.0, 0.0, 0.01], "its last heading is 0.01 rad off"),
        ([0.0, 0.0, 2 * math.pi - 0.01], "its last heading is 0.01 rad off"),
        ([0.0, 2.0, 0.5], "it ends 2 m from the goal; its last heading is 0.5 rad off"),
        ([3e-9, 0.0, 0.0], "it ends 3e-09 m from the goal"),
    ],
)
def test_a_goal_that_is_missed(off, reason):
    audit = audit_plan(PARKING, Goal(pose=PARKING.end + off), ROBOT.model)
    assert not audit.passed
    assert audit.reason == reason


def test_height_is_part_of_the_distance():
    plan = plan_of(GLIDER, ("up", 2.0))
    assert audit_plan(plan, Goal(pose=plan.end), GLIDER.model).passed
    audit = audit_plan(plan, Goal(pose=plan.end + np.array([0.0, 0.0, 0.0, 0.25])), GLIDER.model)
    assert audit.reason == "it ends 0.25 m from the goal"


def test_a_free_heading_is_not_asked_for():
    end = PARKING.end + np.array([0.0, 0.0, 1.0])
    audit = audit_plan(PARKING, Goal(pose=end, free_heading=True), ROBOT.model)
    assert audit.passed
    assert audit.terminal_heading_rad == 0.0
    missed = Goal(pose=end + np.array([1.0, 0.0, 0.0]), free_heading=True)
    assert audit_plan(PARKING, missed, ROBOT.model).reason == "it ends 1 m from the goal"


def test_tolerances_are_respected():
    def goal(off_m, off_rad):
        end = PARKING.end + np.array([off_m, 0.0, off_rad])
        return Goal(pose=end, tolerance_m=0.1, tolerance_rad=0.2)

    assert audit_plan(PARKING, goal(0.1, -0.2), ROBOT.model).passed
    assert not audit_plan(PARKING, goal(0.11, 0.0), ROBOT.model).passed
    assert not audit_plan(PARKING, goal(0.0, 0.21), ROBOT.model).passed


@pytest.mark.parametrize("far", [1e6, 1e9, -1e9])
def test_far_from_the_origin_no_digit_is_lost(far):
    start = [far, -far - 3.0, 0.0]
    plan = plan_of(ROBOT, ("spin", math.pi / 2), ("straight", 2.0), start=start)
    audit = audit_plan(plan, Goal(pose=[far, -far, math.pi / 2]), ROBOT.model)
    assert audit.passed, audit.reason
    assert audit.terminal_position_m < 1e-12
    assert audit.terminal_heading_rad < 1e-12
    assert audit.max_dynamics_defect < 1e-8
    assert not audit_plan(plan, Goal(pose=[far + 1e-3, -far, math.pi / 2]), ROBOT.model).passed


@given(off=arrays(np.float64, 3, elements=st.floats(-3.0, 3.0)))
def test_the_terminal_error_is_a_distance_and_an_angle(off):
    end = np.array([1e9, -1e9, 50.0])
    error = terminal_error(Plan(end + off, (), durations=[]), Goal(pose=end))
    exact = (end + off) - end
    assert error.position_m == pytest.approx(math.hypot(exact[0], exact[1]), abs=1e-12)
    assert error.heading_rad == pytest.approx(abs(exact[2]), abs=1e-12)


def test_an_empty_plan_is_there_or_not():
    here = Plan([1.0, 2.0, 0.5], (), durations=[])
    assert audit_plan(here, Goal(pose=[1.0, 2.0, 0.5 - 2 * math.pi]), ROBOT.model).passed
    assert not audit_plan(here, Goal(pose=[1.0, 2.5, 0.5]), ROBOT.model).passed


@pytest.mark.parametrize("start_time", [-50.0, 1e4, 1.7e9])
def test_a_start_time_changes_nothing(start_time):
    later = replace(PARKING, start_time=start_time)
    audit = audit_plan(later, Goal(pose=PARKING.end), ROBOT.model)
    assert audit.passed, audit.reason
    assert audit.max_dynamics_defect < 1e-8

"""The audit: right plans pass, and nothing that is wrong slips through."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from maneuver_automaton.audit import audit_plan, closest_to, terminal_error
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.collision import Box, Disc, Motion, Obstacle, OccupancyMap, Polygon
from maneuver_automaton.groups import SE2, SE2xR
from maneuver_automaton.models import Car, Unicycle, UserModel
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Goal
from tests.search.cases import NAMED_TABLE_2, robot

ROBOT = robot(NAMED_TABLE_2)
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
    assert audit.terminal_heading_rad < 1e-12


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
    assert audit.terminal_position_m > 1e-6  # by its own account it ends at the goal
    assert audit.reason.startswith(
        f"the plan is {audit.max_dynamics_defect:.3g} off the model's equations; it ends "
    )


def test_a_lie_that_ends_in_the_right_place_is_caught():
    # both semicircles end 2 m aside facing back, one of them was driven at twice the speed
    circle = Trim(name="circle", body_velocity=[math.pi, 0.0, math.pi], control=[1.0, 1.0])
    half = Plan([0.0, 0.0, 0.0], (circle,), durations=[1.0])
    audit = audit_plan(half, Goal(pose=[0.0, 2.0, math.pi]), Unicycle())
    assert not audit.passed
    assert audit.terminal_position_m > 1.0
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


BODY = (Polygon([[-0.5, -0.4], [1.5, -0.4], [1.5, 0.4], [-0.5, 0.4]]),)
AHEAD = plan_of(CAR, ("ahead", 10.0))  # from (0, 0) to (10, 0), its front from 1.5 to 11.5
AROUND = plan_of(CAR, ("left", 2.0), ("ahead", 3.0), ("back right", 4.0))


def audited(plan, *obstacles, footprint=BODY, margin=0.0, automaton=CAR):
    goal = Goal(pose=plan.end)
    return audit_plan(
        plan, goal, automaton.model, footprint=footprint, obstacles=obstacles, margin=margin
    )


@pytest.mark.parametrize(
    ("obstacle", "clearance"),
    [
        (Obstacle(Box([1.0, 1.0], center=[5.0, 2.0])), 1.1),
        (Obstacle(Box([1.0, 1.0], center=[13.0, 0.0])), 1.0),  # in front of where it ends
        (Obstacle(Disc(0.5, center=[-2.0, 0.0])), 1.0),  # behind where it begins
        (Obstacle(Disc(1.0, center=[5.0, -3.0])), 1.6),
        (OccupancyMap([[1, 0], [0, 0]], resolution=0.5, origin=[4.0, 1.0, 0.0]), 0.6),
        (OccupancyMap([[1]], resolution=0.5, origin=[4.0, 1.0, math.pi / 2]), 0.6),
        (
            Obstacle(
                Polygon(
                    [[-9, -9], [19, -9], [19, 9], [-9, 9]], [[[-8, -2], [18, -2], [18, 3], [-8, 3]]]
                )
            ),
            1.6,
        ),
    ],
)
def test_the_least_clearance_by_hand(obstacle, clearance):
    audit = audited(AHEAD, obstacle)
    assert audit.passed, audit.reason
    assert clearance - max(1e-3, 0.01 * clearance) <= audit.min_clearance_m <= clearance + 1e-9
    assert not audited(AHEAD, obstacle, margin=clearance + 1e-2).passed
    assert audited(AHEAD, obstacle, margin=clearance - 1e-2).passed


@pytest.mark.parametrize(
    "obstacle",
    [
        Obstacle(Box([1.0, 1.0], center=[12.0, 0.0])),  # touched by the front, at the very end
        Obstacle(Box([1.0, 1.0], center=[-1.0, 0.0])),  # touched by the tail, at the start
        Obstacle(Box([1.0, 1.0], center=[5.0, 0.9])),  # touched by the side
        Obstacle(Disc(0.5, center=[5.0, 0.9])),
        Obstacle(Disc(1e-3, center=[5.0, 0.4])),
        Obstacle(Box([1e-6, 1e-6], center=[5.0, 0.0])),  # driven over
        Obstacle(Box([100.0, 100.0])),  # all inside it
        Obstacle(Box([1e-9, 3.0], center=[7.123, 0.0])),  # a thin wall
        OccupancyMap([[1]], resolution=0.05, origin=[4.0, 0.0, 1.0]),
        Obstacle(Disc(0.1), motion=Motion([4.0, 6.0], [[5.5, -6.0, 0.0], [5.5, 6.0, 0.0]])),
    ],
)
def test_what_is_hit_is_reported(obstacle):
    audit = audited(AHEAD, obstacle)
    assert not audit.passed
    assert audit.min_clearance_m <= 1e-9
    assert audit.reason.startswith("at ")
    assert " s the vehicle touches " in audit.reason


def test_the_reason_names_obstacle_and_time():
    crate = Obstacle(Box([1.0, 1.0], center=[12.0, 0.0]), name="crate")
    audit = audited(AHEAD, Obstacle(Disc(1.0, center=[0.0, 20.0])), crate)
    assert audit.reason == "at 10 s the vehicle touches obstacle 'crate'"
    later = replace(AHEAD, start_time=1000.0)
    assert audited(later, crate).reason == "at 1010 s the vehicle touches obstacle 'crate'"
    near = audited(AHEAD, Obstacle(Box([1.0, 1.0], center=[12.1, 0.0])), margin=0.2)
    assert near.reason.startswith("at 10 s the vehicle is 0.1 m from obstacle 0 (box near (11.6, ")
    assert near.reason.endswith("), closer than 0.2 m")


def test_moving_obstacles_count_at_their_time():
    def crossing(begin):
        poses = [[6.0, -5.0, 0.0], [6.0, 5.0, 0.0]]
        return Obstacle(Box([0.5, 0.5]), motion=Motion([begin, begin + 5.0], poses))

    assert not audited(AHEAD, crossing(3.0)).passed  # at (6, 0) after 5.5 s
    assert audited(AHEAD, crossing(9.0)).passed  # when it has passed
    assert audited(AHEAD, crossing(-2.0)).passed  # before it comes
    assert audited(AHEAD, crossing(1e6)).passed
    later = replace(AHEAD, start_time=7.0)
    assert not audited(later, crossing(10.0)).passed
    assert audited(later, crossing(3.0)).passed
    for aside, clearance in ((4.6, 0.199), (4.2, 0.0)):  # it points down when the car is there
        motion = Motion([0.0, 10.0], [[5.0, aside, 0.0], [5.0, aside, 9.0]])
        audit = audited(AHEAD, Obstacle(Box([8.0, 0.2]), motion=motion))
        assert audit.min_clearance_m == pytest.approx(clearance, abs=2e-3)


@pytest.mark.parametrize(
    "footprint",
    [
        pytest.param((), marks=pytest.mark.slow),
        pytest.param((Disc(0.5),), marks=pytest.mark.slow),
        (Polygon([[0, 0], [2, 0], [2, 0.5], [0.5, 0.5], [0.5, 2], [0, 2]]),),
    ],
)
def test_against_many_poses(footprint):
    from tests.collision.scenes import random_scene, slow_distance

    rng = np.random.default_rng(8)
    for _ in range(8):
        obstacles = tuple(o.moved(SE2([3.0, 1.0, 0.0])) for o in random_scene(rng, moving=1))
        audit = audited(AROUND, *obstacles, footprint=footprint)
        times = np.linspace(0.0, AROUND.duration, 250)
        least = min(
            slow_distance(footprint, obstacles, pose, time)
            for pose, time in zip(AROUND.pose_at(times), times, strict=True)
        )
        assert audit.min_clearance_m <= least + 1e-9
        assert audit.passed == (audit.min_clearance_m > 1e-9)


def test_a_graze_between_coarse_poses_is_seen():
    # the front corner swings over a post that no pose at a switching time touches
    plan = plan_of(CAR, ("left", 4.0))
    corner = SE2(plan.pose_at(np.array([1.2345]))).act([1.5, -0.4])[0]
    outward = SE2(plan.pose_at(np.array([1.2345]))).act([1.5, -0.4 - 1.0])[0] - corner
    inside = Obstacle(Box([1e-6, 1e-6], center=corner - 2e-3 * outward))
    assert not audited(plan, inside).passed


@pytest.mark.parametrize("far", [1e6, 1e9, -1e9])
def test_far_from_zero_obstacles_lose_no_digit(far):
    place = SE2([far, -far - 3.0, 0.5])
    post = Obstacle(Box([1.0, 1.0], center=[12.0 + 1e-6, 0.0]))
    free, hit = post.moved(place), Obstacle(Box([1.0, 1.0], center=[12.0, 0.0])).moved(place)
    plan = AHEAD.moved(place)
    # the places themselves are rounded there
    assert audited(plan, free, margin=0.0).min_clearance_m == pytest.approx(1e-6, abs=4e-7)
    assert audited(plan, hit).min_clearance_m < 4e-7


def test_a_moved_plan_has_the_same_clearance():
    rng = np.random.default_rng(11)
    from tests.collision.scenes import random_scene

    for _ in range(5):
        obstacles = random_scene(rng, moving=1)
        by = SE2([*rng.uniform(-50.0, 50.0, 2), rng.uniform(-5.0, 5.0)])
        one = audited(AROUND, *obstacles)
        other = audited(AROUND.moved(by), *(o.moved(by) for o in obstacles))
        assert one.min_clearance_m == pytest.approx(other.min_clearance_m, abs=1e-3, rel=0.01)
        assert one.passed == other.passed


def test_where_an_empty_plan_stands_counts():
    here = Plan([0.0, 0.0, 0.0], (), durations=[])
    wall = Obstacle(Box([1.0, 1.0], center=[2.5, 0.0]))
    assert audited(here, wall).min_clearance_m == pytest.approx(0.5)
    assert not audited(here, Obstacle(Box([1.0, 1.0], center=[2.0, 0.0]))).passed
    resting = plan_of(ROBOT, ("rest", 10.0))
    coming = Obstacle(Disc(0.5), motion=Motion([0.0, 10.0], [[9.0, 0.0, 0.0], [2.1, 0.0, 0.0]]))
    assert audited(resting, coming, automaton=ROBOT).min_clearance_m == pytest.approx(0.1, abs=1e-3)
    nearer = Obstacle(Disc(0.5), motion=Motion([0.0, 10.0], [[9.0, 0.0, 0.0], [1.9, 0.0, 0.0]]))
    assert not audited(resting, nearer, automaton=ROBOT).passed


@pytest.mark.parametrize(
    ("within", "time", "distance"),
    [
        ((-math.inf, math.inf), 7.0, 0.5),
        ((6.5, 6.9), 6.9, math.hypot(0.15, 1.5) - 1.0),
        ((-3.0, 6.0), 6.0, math.hypot(1.5, 1.5) - 1.0),
        ((8.0, 99.0), 8.0, math.hypot(1.5, 1.5) - 1.0),
        ((9.5, 99.0), 5.0, math.inf),
    ],
)
def test_only_the_time_that_is_asked_for_counts(within, time, distance):
    plan = Plan([0.0, 0.0, 0.0], (ROBOT["straight"],), durations=[4.0], start_time=5.0)
    post = (Obstacle(Disc(0.5, [3.0, 1.5])),)
    least = closest_to(plan, ROBOT.model, post, footprint=(Disc(0.5),), within=within)
    assert least.distance == pytest.approx(distance, abs=1e-3)
    assert least.time == pytest.approx(time, abs=0.05)


@pytest.mark.parametrize(("first", "since"), [(0.57, 1.97), (0.92, 1.99), (0.66, 1.64)])
def test_what_appears_in_the_body_is_hit_as_it_appears(first, since):
    """Here the stretch that begins then begins a rounding earlier."""
    trims = tuple(
        Trim(name=str(rate), body_velocity=[1.0, 0.0, rate], control=[1.0, rate])
        for rate in (0.0, 0.5)
    )
    plan = Plan([0.0, 0.0, 0.0], trims, durations=[first, 3.0])
    post = (Obstacle(Disc(0.5, plan.pose_at(since)[:2]), present_s=(since, 9.0)),)
    least = closest_to(plan, ROBOT.model, post, footprint=(Disc(0.3),))
    assert (least.distance, least.obstacle) == (0.0, 0)
    assert least.time == pytest.approx(since)


def test_all_that_is_wrong_is_said():
    crate = Obstacle(Box([1.0, 1.0], center=[5.0, 0.0]), name="crate")
    wrong = Goal(pose=np.add(AHEAD.end, [0.0, 1.0, 0.0]))
    audit = audit_plan(AHEAD, wrong, CAR.model, footprint=BODY, obstacles=(crate,))
    assert audit.reason.startswith("it ends 1 m from the goal; at ")
    assert audit.reason.endswith(" s the vehicle touches obstacle 'crate'")


@pytest.mark.parametrize("most", [1, 2])
def test_an_audit_may_be_given_up(most):
    """Once driven, and before each round of what bounds the clearance."""
    asked = []

    def ask():
        asked.append(0)
        if len(asked) == most:
            raise TimeoutError

    walls = (Obstacle(Box([1.0, 9.0], [6.0, 0.0])),)
    options = {"footprint": (Box([1.0, 0.5]),), "obstacles": walls, "ask": ask}
    with pytest.raises(TimeoutError):
        audit_plan(PARKING, Goal(pose=PARKING.end), ROBOT.model, **options)

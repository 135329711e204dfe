from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton.audit import audit_plan
from maneuver_automaton.collision import Box, Disc
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Bounds, Goal, Problem
from maneuver_automaton.receding_horizon import search_fail_safe
from tests.inertia import unicycle_automaton
from tests.matrix.vehicles import VEHICLES
from tests.receding_horizon.scenes import among, cannot_stop, crossing, moving_obstacle
from tests.scenes import moving_scene
from tests.solids import World, driven, outside

COMING = moving_obstacle([0.0, 12.0], [(-6.0, 0.0), (6.0, 0.0)])

LANE = Bounds(x=(-9.0, 6.5), y=(-0.4, 0.4))


def clearance(problem, plan) -> float:
    """Least distance [m] along a plan, by shapely."""
    world = World(problem)
    times, poses = driven(plan, world.origin, step_m=0.01, step_rad=0.02)
    return float(world.clearance(poses, times).min())


def test_where_standing_is_free_it_stands():
    found = search_fail_safe(among(crossing()), until=30.0)
    assert (found.complete, found.plan.word, found.plan.duration) == (True, ("rest",), 30.0)
    assert found.expansions == 0


@pytest.mark.parametrize("robot", [None, cannot_stop()])
@pytest.mark.parametrize("margin", [0.0, 0.2])
def test_it_goes_out_of_the_way(robot, margin):
    problem = among(COMING, robot=robot, margin=margin)
    found = search_fail_safe(problem, until=12.0)
    assert found.complete
    assert found.plan.duration == pytest.approx(12.0)
    assert clearance(problem, found.plan) >= margin


@pytest.mark.parametrize("seed", range(6))
def test_anywhere_and_at_any_time_in_a_moving_scene(seed):
    rng = np.random.default_rng(seed)
    problem = moving_scene(seed)
    world = World(problem)
    for _ in range(4):
        pose, time = np.array([*rng.uniform(1, 19, 2), rng.uniform(-3, 3)]), rng.uniform(0, 20)
        if world.clearance(pose[None] - np.append(world.origin, 0.0), np.array([time]))[0] < 0.1:
            continue
        here = replace(problem, start=pose, start_time=time)
        found = search_fail_safe(here, until=time + 30.0)
        assert found.complete
        assert found.free_until >= time + 30.0
        assert clearance(here, found.plan) > 0.0
        _, poses = driven(found.plan, np.zeros(2), step_m=0.05, step_rad=0.1)
        assert outside(here, poses[:, :2]).max() <= 1e-6


def test_the_best_there_is_where_nothing_is_free_for_long_enough():
    wall = Box([40.0, 1.0])
    squeezed = [
        moving_obstacle([0.0, 9.0], [(0.0, side * 4.0), (0.0, -side * 5.0)], wall)
        for side in (1, -1)
    ]
    found = search_fail_safe(among(*squeezed), until=9.0)
    assert not found.complete
    assert found.free_until == pytest.approx(3.2, abs=0.05)  # where it stands


def test_inside_bounds_there_may_be_none():
    assert not search_fail_safe(among(COMING, bounds=LANE), until=40.0).complete
    assert search_fail_safe(among(COMING), until=40.0).complete


def test_the_number_of_expansions_is_limited():
    found = search_fail_safe(among(COMING, bounds=LANE), until=40.0, max_expansions=3)
    assert found.expansions == 3


@pytest.mark.parametrize("most", [1, 3, 10, 30, 100])
@pytest.mark.parametrize("bounds", [LANE, Bounds(x=(-3.0, 3.0), y=(-3.0, 3.0))])
def test_what_cannot_stop_is_free_and_inside_for_as_long_as_is_said(bounds, most):
    problem = among(COMING, robot=cannot_stop(), bounds=bounds)
    assert_kept_as_said(problem, search_fail_safe(problem, until=40.0, max_expansions=most))


@pytest.mark.parametrize("inertia", [False, True])
def test_what_cannot_stop_circles_and_in_a_lane_goes_straight_on(inertia):
    states = ((1.0, 0.0), (0.8, 0.8), (0.8, -0.8))
    ends = {"start_trim": "1, 0", "goal_trim": "1, 0", "automaton": unicycle_automaton(states)}
    far = Disc(0.5, [20.0, 5.0])
    problem = with_inertia(far, **ends) if inertia else among(far, robot=cannot_stop())
    found = search_fail_safe(problem, until=15.0)
    _, poses = driven(found.plan, np.zeros(2), step_m=0.05, step_rad=0.1)
    assert found.complete
    assert np.hypot(*poses[:, :2].T).max() < 3.0
    lane = Bounds(x=(-9.0, 30.0), y=(-0.4, 0.4))
    assert search_fail_safe(replace(problem, bounds=lane), until=15.0).complete


def assert_kept_as_said(problem, found) -> None:
    """A motion that never stops lasts until it is said to be free, free of all, inside bounds."""
    assert found.plan.start_time + found.plan.duration == pytest.approx(found.free_until)
    if found.plan.trims:
        assert clearance(problem, found.plan) > 0.0
        _, poses = driven(found.plan, np.zeros(2), step_m=0.05, step_rad=0.1)
        assert outside(problem, poses[:, :2]).max() <= 1e-6


def test_a_moved_scene_has_the_moved_trajectory():
    move = SE2(np.array([30.0, -4.0, 2.0]))
    one, two = (search_fail_safe(p, until=12.0) for p in (among(COMING), among(COMING).moved(move)))
    assert one.plan.word == two.plan.word
    assert two.plan.durations == pytest.approx(one.plan.durations, abs=1e-6)


def with_inertia(*obstacles, automaton=None, **changed) -> Problem:
    """A robot of half a metre that needs a second to reach its speed, and as long to stop."""
    robot = automaton or unicycle_automaton()
    return Problem(
        robot,
        changed.pop("start", [0.0, 0.0, 0.0]),
        Goal(pose=[5.0, 0.0, 0.0], trim=changed.pop("goal_trim", None)),
        obstacles=obstacles,
        footprint=Box([0.5, 0.3]),
        **changed,
    )


def assert_audited(problem, plan) -> None:
    """The audit finds a plan free of all obstacles, with the problem's margin."""
    audit = audit_plan(
        plan,
        Goal(pose=plan.end),
        problem.automaton.model,
        footprint=problem.footprint,
        parts=problem.parts,
        obstacles=problem.obstacles,
        margin=problem.margin,
    )
    assert audit.passed, audit.reason


class TestWithInertia:
    @pytest.mark.parametrize("trim", [None, "1, 0", "0.8, 0.8", "-0.6, 0"])
    @pytest.mark.parametrize("margin", [0.0, 0.1])
    def test_it_goes_out_of_the_way_by_maneuvers(self, trim, margin):
        problem = with_inertia(COMING, start_trim=trim, margin=margin)
        found = search_fail_safe(problem, until=12.0)
        assert found.complete
        assert any(found.plan.maneuvers)
        assert found.plan.trims[0].name == (trim or "rest")
        assert found.plan.trims[-1].is_rest
        assert found.plan.duration >= 12.0 - 1e-9
        assert_audited(problem, found.plan)

    def test_where_nothing_moves_it_brakes(self):
        found = search_fail_safe(with_inertia(start_trim="1, 0"), until=3.0)
        assert found.complete
        assert found.plan.trims[-1].is_rest
        assert 0.0 < found.plan.end[0] < 2.0

    def test_before_a_wall_it_turns_off(self):
        """It needs half a metre to stop, there is less: a turn on the way leads past."""
        edge = Box([0.2, 2.0], [0.75, -1.12])
        found = search_fail_safe(with_inertia(edge, start_trim="1, 0"), until=10.0)
        assert found.complete
        assert found.plan.end[1] > 0.0

    def test_a_moved_scene_has_the_moved_trajectory(self):
        move = SE2(np.array([-20.0, 7.0, 2.5]))
        problem = with_inertia(COMING, start_trim="1, 0")
        one, two = (search_fail_safe(p, until=12.0) for p in (problem, problem.moved(move)))
        assert [m and m.name for m in one.plan.maneuvers] == [
            m and m.name for m in two.plan.maneuvers
        ]
        assert two.plan.durations == pytest.approx(one.plan.durations, abs=1e-6)
        assert (move @ SE2(one.plan.end)).pose[:2] == pytest.approx(two.plan.end[:2], abs=1e-6)

    def test_inside_bounds_there_may_be_none(self):
        problem = with_inertia(COMING, start_trim="1, 0", bounds=LANE)
        found = search_fail_safe(problem, until=40.0)
        assert not found.complete
        assert found.free_until > 1.0

    def test_one_that_cannot_rest_drives_on(self):
        states = ((1.0, 0.0), (0.8, 0.8), (0.8, -0.8))
        problem = with_inertia(
            COMING, automaton=unicycle_automaton(states), start_trim="1, 0", goal_trim="1, 0",
        )  # fmt: skip
        found = search_fail_safe(problem, until=12.0)
        assert found.complete
        assert found.plan.duration == pytest.approx(12.0)
        assert not any(trim.is_rest for trim in found.plan.trims)

    @pytest.mark.parametrize("most", [1, 3, 10, 30, 100])
    @pytest.mark.parametrize("half", [1.0, 2.0, 4.0])
    def test_one_that_cannot_rest_is_free_and_inside_for_as_long_as_is_said(self, half, most):
        states = ((1.0, 0.0), (0.8, 0.8), (0.8, -0.8))
        problem = with_inertia(
            COMING,
            automaton=unicycle_automaton(states),
            start_trim="1, 0",
            goal_trim="1, 0",
            bounds=Bounds(x=(-half, half), y=(-half, half)),
        )
        assert_kept_as_said(problem, search_fail_safe(problem, until=12.0, max_expansions=most))

    def test_with_a_trailer_both_parts_are_free(self):
        vehicle = VEHICLES["car_with_trailer"]
        coming = moving_obstacle([0.0, 40.0], [(-40.0, 0.0), (40.0, 0.0)], Disc(2.0))
        problem = vehicle.problem(obstacles=[coming])
        found = search_fail_safe(problem, until=40.0)
        assert found.complete
        assert_audited(problem, found.plan)

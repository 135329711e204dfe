"""What happens to a fleet in closed loop: noise, pushes, breakdowns, joining, leaving, delay."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.fleet_loops import driven
from maneuver_automaton import (
    Disturbance,
    FleetHorizon,
    FleetProblem,
    Goal,
    Problem,
    load_scenario,
    plan_fleet,
    simulate_fleet,
    verify_driven,
)
from maneuver_automaton.collision import Box, Disc
from maneuver_automaton.fleet import FleetGuarantee
from maneuver_automaton.formats.documents import write_document
from maneuver_automaton.formats.fleet_json import fleet_loop_to_dict, load_fleet_loop
from tests.fleet.robots import (
    at_rest,
    crossing,
    least_distance,
    problem_of,
    scattered,
    swapping,
    through_a_door,
)
from tests.inertia import unicycle_automaton
from tests.quickly import quick_are

NOISE = Disturbance(position_m=0.003, heading_rad=0.003)


def loop_of(fleet, **more):
    more = {"step": 0.5, "first": at_rest(fleet), "time_limit": 60.0} | more
    return simulate_fleet(fleet, **more)


def assert_free(log, least=0.0):
    """Every guarantee held, and no two bodies came nearer than that."""
    assert [*log.violations] == []
    assert log.distance_m > least
    assert least_distance(log) > least


@pytest.mark.parametrize(
    "scene", quick_are([crossing, swapping], [crossing, swapping, through_a_door])
)
def test_noise_within_the_tubes(scene):
    fleet = scene(tolerance=0.1) if scene is crossing else scene()
    log = loop_of(fleet, disturbance=NOISE, group_size=2, steps=80)
    assert_free(log)
    assert all(off <= 0.05 for step in log.steps for off in step.off_plan.values())


def test_beside_each_other_at_the_margin():
    """No plan that starts nearer can be proven: both drive back to the plans that they hold."""
    ends = ([0, 0, 0], [8, 0, 0]), ([0, 0.702, 0], [8, 0.702, 0])
    fleet = FleetProblem([problem_of(*one, tolerance=0.1) for one in ends], margin=0.1)
    log = loop_of(fleet, disturbance=NOISE, seed=1)
    assert log.reached
    assert_free(log)
    assert all(off <= 0.05 for step in log.steps for off in step.off_plan.values())
    assert not any(step.void for step in log.steps)


@pytest.mark.parametrize("seed", quick_are([1], range(1, 30), exhaustive=True))
def test_random_fleets_with_noise(seed):
    fleet = scattered(2 + seed % 7, seed)
    breaks = {"1": 2.0} if seed % 2 else {}
    log = loop_of(fleet, disturbance=NOISE, seed=seed, breaks_s=breaks, group_size=3, steps=80)
    assert_free(log)
    assert all(set(step.plans) == set(fleet.names) for step in log.steps)


def test_the_same_seed_has_the_same_loop():
    logs = [loop_of(crossing(tolerance=0.1), disturbance=NOISE, seed=n) for n in (3, 3, 4)]
    same, again, other = ([one.poses["a"].tolist() for one in log.steps] for log in logs)
    assert same == again
    assert same != other


def test_a_push_makes_the_plan_void():
    pushed = {"a": Disturbance(pushes={3: (0.0, 0.4, 0.5)})}
    log = loop_of(crossing(tolerance=0.1), disturbance=pushed)
    assert log.reached
    assert_free(log, 0.1 - 1e-9)
    assert [step.number for step in log.steps if step.void] == [4]


def test_a_push_onto_another_is_flagged():
    ends = ([0, 0, 0], [6, 0, 0]), ([0, 0.75, 0], [6, 0.75, 0])
    fleet = FleetProblem([problem_of(*one, tolerance=0.1) for one in ends], names="ab", margin=0.1)
    log = loop_of(fleet, disturbance={"a": Disturbance(pushes={2: (0.0, 0.1, 0.0)})}, steps=40)
    said = {violation.guarantee for _, violation in log.violations}
    assert FleetGuarantee.APART in said
    assert log.distance_m > 0.0


def test_a_breakdown():
    """One stops in the way of another, whose plan is void at once, and which goes around."""
    log = loop_of(crossing(tolerance=0.1), breaks_s={"a": 3.0}, disturbance=None)
    assert log.reached
    assert log.broken_down == ("a",)
    assert set(log.arrived_s) == {"b"}
    assert_free(log, 0.1 - 1e-9)
    before = log.steps[6].poses["a"]
    assert log.steps[-1].poses["a"] == pytest.approx(before)


@pytest.mark.slow
def test_who_cannot_stop_in_time_is_flagged():
    """A robot with inertia, whose way is blocked half a metre ahead."""
    heavy = Problem(
        unicycle_automaton(),
        [-4, 0, 0],
        Goal(pose=[4, 0, 0], tolerance_m=0.1, tolerance_rad=0.2),
        footprint=Disc(0.3),
    )
    light = problem_of([0, -3, np.pi / 2], [0, 3, np.pi / 2], tolerance=0.1)
    fleet = FleetProblem([heavy, light], names=("heavy", "light"), margin=0.05)
    said = set()
    for at in (2.5, 3.0):
        log = loop_of(fleet, breaks_s={"light": at}, time_limit=2.0, steps=30)
        said |= {one.guarantee for _, one in log.violations}
        hit = any(one.guarantee is FleetGuarantee.NO_COLLISION for _, one in log.violations)
        flagged = any(one.guarantee is FleetGuarantee.SAFETY for _, one in log.violations)
        assert flagged or not hit  # no collision comes unannounced
    assert said <= {
        FleetGuarantee.SAFETY,
        FleetGuarantee.APART,
        FleetGuarantee.NO_COLLISION,
        FleetGuarantee.HELD,
    }


def test_who_begins_in_motion_does_not_stand_at_once():
    """A robot with inertia, under way at its start: rest is no plan of it, which is said."""
    robot = unicycle_automaton()
    on = next(trim.name for trim in robot.trims if trim.reduced_state.tolist() == [1.0, 0.0])
    goal = Goal(pose=[4, 0, 0], tolerance_m=0.1, tolerance_rad=0.2)
    begun = Problem(robot, [-4, 0, 0], goal, footprint=Disc(0.3), start_trim=on)
    fleet = FleetProblem([begun, problem_of([0, 3, 0], [3, 3, 0], tolerance=0.1)], names="ab")
    log = loop_of(fleet, first=plan_fleet(fleet, time_limit=60.0, max_rounds=0), steps=30)
    assert log.reached
    assert [*log.violations] == []
    assert verify_driven(log).passed
    without = loop_of(fleet, steps=2)
    said = [one for _, one in without.violations if one.guarantee is FleetGuarantee.HELD]
    assert "it cannot stay where it begins" in str(said[0])
    assert "a" in without.steps[0].refused


def test_joining_and_leaving():
    fleet = crossing(tolerance=0.1, leaves=(True, False))
    log = loop_of(fleet, joins_s={"b": 2.0})
    assert log.reached
    assert_free(log, 0.1 - 1e-9)
    assert [("b" in step.plans) for step in log.steps[:5]] == [False] * 4 + [True]
    assert "a" not in log.steps[-1].plans


def test_who_joins_where_there_is_no_room_waits():
    ends = ([-2, 0, 0], [2, 0, 0]), ([0, 0, 0], [0, 3, np.pi / 2])
    fleet = FleetProblem([problem_of(*one, tolerance=0.1) for one in ends], names="ab", margin=0.1)
    log = loop_of(fleet, joins_s={"b": 1.5})
    assert log.reached
    assert_free(log, 0.1 - 1e-9)
    assert "b" in log.steps[3].refused


def test_answers_that_come_late():
    late = 2
    log = loop_of(crossing(tolerance=0.1), delay_steps=late)
    assert log.reached
    assert_free(log, 0.1 - 1e-9)
    assert min(number for number, _ in log.swaps) == late
    noisy = loop_of(crossing(tolerance=0.1), delay_steps=late, disturbance=NOISE)
    assert noisy.reached
    assert_free(noisy)


def test_vehicles_with_inertia():
    robot = unicycle_automaton()
    ends = ([-2, 0, 0], [2, 0, 0]), ([0, -2, np.pi / 2], [0, 2, np.pi / 2])
    problems = [
        Problem(
            robot,
            start,
            Goal(pose=goal, tolerance_m=0.1, tolerance_rad=0.2),
            footprint=Disc(0.3),
        )
        for start, goal in ends
    ]
    log = loop_of(FleetProblem(problems, names="ab", margin=0.1), steps=40, time_limit=10.0)
    assert log.reached
    assert_free(log, 0.1 - 1e-6)
    assert verify_driven(log).passed


def test_wrong_arguments():
    with pytest.raises(ValueError, match="steps must be at least 1, got 0"):
        loop_of(crossing(), steps=0)
    with pytest.raises(ValueError, match="breaks_s: no vehicle is named 'c'"):
        loop_of(crossing(), breaks_s={"c": 1.0})


def test_two_that_stand_too_near_part_again():
    """Pushed to within the margin of each other, they keep what they have until they part."""
    ends = ([0, 0, 0], [8, 0, 0]), ([0, 0.75, 0], [8, 0.75, 0])
    fleet = FleetProblem([problem_of(*one, tolerance=0.1) for one in ends], names="ab", margin=0.1)
    log = loop_of(fleet, disturbance={"a": Disturbance(pushes={2: (0.0, 0.12, 0.0)})}, steps=60)
    assert log.reached
    assert 0.0 < least_distance(log) < 0.1
    said = [number for number, _ in log.violations]
    assert said
    assert max(said) < 15  # flagged while they are too near, and not for ever


def test_who_is_pushed_to_an_obstacle_gets_away():
    wall = (Box([4.0, 0.4], [2.0, 0.6]),)
    fleet = FleetProblem(
        [problem_of([0, 0, 0], [5, 0, 0], tolerance=0.1, obstacles=wall, margin=0.05)], margin=0.1
    )
    log = loop_of(fleet, disturbance=Disturbance(pushes={2: (0.0, 0.08, 0.0)}), steps=40)
    assert log.reached
    assert {one.guarantee for _, one in log.violations} <= {FleetGuarantee.STILL}


def test_who_was_to_leave_but_has_no_plan_stays():
    """Nobody drives through one that is not gone yet."""
    ends = ([0, 0, 0], [0, 0, 3.1]), ([-2, 0, 0], [2, 0, 0])
    cage = [Box([0.1, 1.4], [x, 0]) for x in (-0.7, 0.7)] + [Box([1.5, 0.1], [0, 0.7])]
    caged = problem_of([0, 0, 0], [9, 0, 0], obstacles=[*cage, Box([1.5, 0.1], [0, -0.7])])
    fleet = FleetProblem(
        [caged, problem_of(*ends[1], tolerance=0.1)], names="ab", margin=0.1, leaves=(True, False)
    )
    log = loop_of(fleet, steps=30)
    assert set(log.arrived_s) == {"b"}
    assert least_distance(log) >= 0.1 - 1e-9
    assert [*log.violations] == []


@pytest.mark.exhaustive
@pytest.mark.slow
def test_an_emergency_that_is_not_acknowledged():
    """All messages of three steps are lost as one breaks down: nobody swaps, all is flagged."""

    def lost(message):
        return 6 <= message.step < 9

    for tries in range(3):
        log = loop_of(
            scattered(5, tries), breaks_s={"1": 3.0}, lost=lost, disturbance=NOISE, steps=80
        )
        said = {one.guarantee for _, one in log.violations}
        assert FleetGuarantee.KNOWN not in said
        assert not any(6 <= number < 9 for number, _ in log.swaps)
        hit = FleetGuarantee.NO_COLLISION in said
        assert FleetGuarantee.SAFETY in said or not hit


def test_another_goal_on_the_way():
    fleet = crossing(tolerance=0.1)
    loop = FleetHorizon(fleet, step=0.5, first=at_rest(fleet), time_limit=60.0)
    poses = {name: problem.start for name, problem in zip("ab", fleet.problems, strict=True)}
    turns = {4: ("a", [2.0, 2.0, 1.5]), 9: ("b", [-2.0, 2.0, 3.0])}
    for number in range(40):
        if number in turns:
            name, goal = turns[number]
            loop.assign(name, problem_of([0, 0, 0], goal, tolerance=0.1))
        step = loop.step(poses)
        assert step.violations == ()
        poses = {name: plan.pose_at(step.time + 0.5) for name, plan in step.plans.items()}
    assert set(step.arrived) == {"a", "b"}
    assert np.hypot(*(poses["a"][:2] - [2.0, 2.0])) <= 0.1
    with pytest.raises(ValueError, match="no vehicle is named 'c'"):
        loop.assign("c", fleet.problems[0])
    with pytest.raises(ValueError, match="its margin is 0 m"):
        loop.assign("a", problem_of([0, 0, 0], [1, 0, 0], margin=0.0))


@pytest.mark.exhaustive
@pytest.mark.slow
def test_who_lost_its_plan_finds_a_long_way_round():
    """Beside one that broke down, no way is found with few expansions."""
    row = driven(68, "breakdown", least=2, most=30)
    assert (row["arrived"], row["broken"], row["left_behind"]) == (8, 1, 0)
    assert row["least_m"] > 0.0
    assert row["defects"] == 0


def test_who_leaves_is_gone_for_all_at_the_same_time():
    """Beside its goal by what its tube allows it leaves as well: the others count on that."""
    file = Path(__file__).parents[2] / "scenarios" / "fleets" / "intersection.yaml"
    fleet = load_scenario(file).fleet
    assert all(fleet.leaves)
    upset = Disturbance(position_m=0.002, heading_rad=0.002, seed=1)
    first = plan_fleet(fleet, time_limit=60.0, max_rounds=0)  # a clock would say how near they pass
    log = simulate_fleet(fleet, step=0.5, steps=24, first=first, disturbance=upset)
    assert [*log.violations] == []
    assert log.distance_m > 0.9 * fleet.margin
    assert set(log.arrived_s) == set(fleet.names)


def test_who_has_inertia_drives_maneuvers_that_can_be_left():
    fleet = FleetProblem([Problem(unicycle_automaton(), [0, 0, 0], [3, 1, 0.5])], names=["a"])
    log = simulate_fleet(fleet, step=0.5, first_time_limit=20.0)
    assert log.reached
    known = {one.name for one in fleet.problems[0].automaton.maneuvers}
    for step in log.steps:
        assert all(one is None or one.name in known for one in step.plans["a"].maneuvers)


# -- going on after a break


def test_a_loop_that_was_broken_off_goes_on_where_it_was(tmp_path):
    """With the noise that it would have had, pushes included, also from a file."""
    after = 6
    upset = Disturbance(position_m=0.003, heading_rad=0.003, pushes={5: (0.05, 0.05, 0.1)})
    fleet = crossing(tolerance=0.1, leaves=(True, False))
    first = plan_fleet(fleet, time_limit=60.0, max_rounds=0)
    more = {"step": 0.5, "time_limit": 60.0, "disturbance": upset, "seed": 3}
    whole = simulate_fleet(fleet, first=first, **more)
    half = simulate_fleet(fleet, first=first, steps=after, **more)
    write_document(fleet_loop_to_dict(half, verify_driven(half)), tmp_path / "closed_loop.json")
    read = load_fleet_loop(tmp_path / "closed_loop.json", fleet)
    for log in (simulate_fleet(fleet, log=half, **more), simulate_fleet(fleet, log=read, **more)):
        assert [step.number for step in log.steps] == [*range(len(log.steps))]
        for name, pose in whole.steps[after].poses.items():
            assert log.steps[after].poses[name] == pytest.approx(pose, abs=1e-12)
        assert log.reached
        assert [*log.violations] == []
        assert log.cost == pytest.approx(whole.cost)
        assert least_distance(log) > 0.0


def test_who_broke_down_before_the_break_stays_there():
    fleet = crossing(tolerance=0.1)
    more = {"step": 0.5, "first": at_rest(fleet), "time_limit": 60.0}
    half = simulate_fleet(fleet, steps=6, breaks_s={"a": 1.0}, **more)
    log = simulate_fleet(fleet, log=half, **more)
    assert half.broken_down == log.broken_down == ("a",)
    assert set(log.arrived_s) == {"b"}
    assert np.array_equal(log.steps[-1].poses["a"], half.driven["a"][-1].end)


def test_a_log_of_another_loop_is_refused():
    fleet = crossing()
    log = simulate_fleet(fleet, step=0.5, steps=1, first=at_rest(fleet), time_limit=60.0)
    with pytest.raises(ValueError, match=r"step is 0.25 s, need that of the log to go on from"):
        simulate_fleet(fleet, step=0.25, log=log)
    with pytest.raises(ValueError, match="fleet horizon: log is one of a, b, need one of a"):
        FleetHorizon(fleet.only(["a"]), step=0.5, log=log)

"""Driving small scenes in closed loop: goals, traffic, and the law of moved problems."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

import maneuver_automaton as ma
from maneuver_automaton.collision import Box
from maneuver_automaton.groups import SE2
from maneuver_automaton.roads import (
    GoalRegion,
    Lanelet,
    RoadScene,
    RoadSettings,
    RoadStart,
    drive_road,
    drive_scene,
    judged,
    plan_road,
    road_planner,
)
from tests.formats.outside import DATA, needs_data
from tests.roads.files import (
    GOAL,
    LANES,
    car,
    commonroad,
    interval,
    parked,
    predicted,
    problem,
    scene_of,
    square,
)

QUICK = RoadSettings(width=40, narrow=20)
ANY = "<goalState>" + interval("time", 30, 32) + "</goalState>"


def driven(scene, **options):
    return drive_scene(road_planner(scene, settings=QUICK), **options)


def test_a_lane_is_changed_to_reach_the_goal(tmp_path):
    drive = driven(scene_of(tmp_path))
    assert drive.reached
    assert drive.status == "reached"
    assert drive.verdict.clean
    assert drive.verdict.clearance_m > 0.0
    assert drive.verdict.audit.max_dynamics_defect < 1e-8
    assert drive.driven.duration == pytest.approx(0.1 * len(drive.steps))


def test_what_was_driven_passes_the_states_of_all_steps(tmp_path):
    drive = driven(scene_of(tmp_path))
    times = np.array([step.time for step in drive.steps])
    states = np.array([step.state for step in drive.steps])
    poses = drive.planner.world(states[:, :3])
    np.testing.assert_allclose(drive.driven.pose_at(times), poses, atol=1e-4)
    begins = drive.driven.switching_times[:-1]
    np.testing.assert_allclose(
        drive.driven.switching_poses[:-1], poses[np.searchsorted(times, begins - 1e-6)], atol=1e-9
    )


def test_it_stops_behind_what_blocks_the_road(tmp_path):
    wall = parked(3, x=40.0, y=4.0, size=(2.0, 8.0))
    drive = driven(scene_of(tmp_path, *LANES, wall, problem(goal=ANY, speed=10.0)))
    assert drive.reached
    assert drive.verdict.clean
    assert drive.driven.end[0] < 39.0


def test_a_goal_out_of_reach_is_missed_without_a_collision(tmp_path):
    goal = GOAL.replace(interval("time", 20, 40), interval("time", 0, 5))
    drive = driven(scene_of(tmp_path, *LANES, problem(goal=goal)))
    assert (drive.reached, drive.status) == (False, "missed")
    assert drive.reason == (
        "no goal was reached until 0.5 s, when the last one is over; "
        "nearest to it at 0.5 s: 1.83 m away"
    )
    assert drive.verdict.clean


def test_a_car_at_rest_with_no_way_on_stands_and_says_so(tmp_path):
    behind = car(8, x=10.0, y=2.0, speed=8.0, steps=40)
    walls = [parked(3, x=33.6, y=2.0, size=(1.0, 4.0)), parked(4, x=30.0, y=4.6, size=(9.0, 0.5))]
    start = problem(goal=ANY, x=30.0, speed=0.0)
    drive = driven(scene_of(tmp_path, LANES[0], *walls, behind, start))
    assert drive.status == "touched"
    assert drive.reason == "collision with car 8; a goal was reached at 3 s"
    goal = GOAL.replace(interval("orientation", -0.2, 0.2), interval("orientation", 1.0, 1.2))
    start = problem(goal=goal, x=30.0, speed=0.0)
    drive = driven(scene_of(tmp_path, *LANES, *walls, behind, start))
    assert drive.status == "touched"
    assert drive.reason.startswith("collision with car 8; no goal was reached until 4 s, ")
    stood = [step for step in drive.steps if step.decision.stands]
    assert stood
    assert all(step.control.tolist() == [0.0, 0.0] for step in stood)
    assert "; no continuation was found from " in drive.reason
    assert len(drive.steps) == 40


@pytest.mark.slow
def test_a_goal_behind_the_start_is_reached_around_a_loop(tmp_path):
    halves = [np.linspace(a, a + np.pi, 33) for a in (-0.5 * np.pi, 0.5 * np.pi)]
    inner, outer = (
        [radius * np.stack([np.cos(a), np.sin(a)], axis=-1) for a in halves]
        for radius in (14.0, 18.0)
    )
    lanes = [Lanelet(k, inner[k], outer[k], successors=[1 - k]) for k in range(2)]
    goal = GoalRegion(places=(Box([4.0, 3.0], [-6.0, -15.0], -0.38),), time=(0.0, 25.0))
    scene = RoadScene(
        name="loop",
        lanelets=tuple(lanes),
        start=RoadStart(middle=np.array([2.0, -16.0, 0.1]), speed=6.0),
        goals=(goal,),
    )
    drive = driven(scene)
    assert drive.reached
    assert drive.verdict.clean
    turned = drive.driven.end[2] - drive.driven.start[2]
    assert turned > 1.7 * np.pi


def test_why_a_goal_was_missed(tmp_path):
    slow = GOAL.replace(
        interval("time", 20, 40), interval("velocity", 40, 45) + interval("time", 20, 40)
    )
    drive = driven(scene_of(tmp_path, *LANES, problem(goal=slow)))
    assert drive.reason.startswith(
        "no goal was reached until 4 s, when the last one is over; nearest"
    )
    assert drive.reason.endswith(" m/s too slow")
    drive = driven(scene_of(tmp_path), steps=3)
    assert drive.reason == "no goal was reached in 3 steps, until 0.3 s; its time begins at 2 s"
    early = GOAL.replace('ref="2"', 'ref="1"')
    drive = driven(scene_of(tmp_path, *LANES, problem(goal=early)), steps=3)
    assert drive.reason == (
        "no goal was reached in 3 steps, until 0.3 s; "
        "everything but the time was right at 0 s, need 2 s to 4 s"
    )


@pytest.mark.parametrize("step", [0.25, 0.04])
def test_goals_are_reached_when_the_clock_of_the_scene_ticks(tmp_path, step):
    goal = GOAL.replace(
        interval("time", 20, 40), interval("time", round(2 / step), round(3 / step))
    )
    other = car(7, x=35.0, y=2.0, speed=6.0, steps=40, step=step)
    drive = driven(scene_of(tmp_path, *LANES, other, problem(goal=goal), step=step))
    assert drive.reached
    assert drive.verdict.clean
    assert drive.planner.tick <= 0.1
    assert len(drive.steps) * step == pytest.approx(drive.driven.duration)
    for plan in (drive.driven, plan_road(drive.planner.scene).plan):
        changes = plan.primitive_durations.cumsum() / step
        np.testing.assert_allclose(changes, changes.round(), atol=1e-9)


def test_sets_of_occupancies_are_driven_around(tmp_path):
    sets = [
        ([square(30.0 + 0.6 * k, 1.5, 2.0 + 0.02 * k)], f"<time><exact>{k}</exact></time>")
        for k in range(1, 41)
    ]
    other = predicted(7, sets, x=30.0, y=1.5, speed=6.0)
    drive = driven(scene_of(tmp_path, *LANES, other, problem()))
    assert drive.reached
    assert drive.verdict.collisions == 0
    for k in range(1, len(drive.steps)):
        pose = drive.driven.pose_at(0.1 * k)
        body = shapely.Polygon(SE2(pose).act(drive.planner.vehicle.footprint.corners))
        x, y, size = 30.0 + 0.6 * k, 1.5, 1.0 + 0.01 * k
        assert body.distance(shapely.box(x - size, y - size, x + size, y + size)) > 0.0


def test_a_file_is_driven_from_python(tmp_path):
    file = tmp_path / "road.xml"
    file.write_text(commonroad())
    road = ma.load_scenario(file)
    assert road.name == road.scene.name == "TST_Lanes-1_1_T-1"
    drive = ma.drive_road(road.scene, road.vehicle)
    assert drive.reached
    result = ma.plan_road(road.scene, road.vehicle)
    assert result.plan is not None
    assert result.verdict.clean


def test_steps_are_counted(tmp_path):
    drive = driven(scene_of(tmp_path), steps=3)
    assert (len(drive.steps), drive.status) == (3, "steps_spent")


def test_a_goal_at_the_start_needs_no_step(tmp_path):
    goal = GOAL.replace('ref="2"', 'ref="1"').replace(
        interval("time", 20, 40), interval("time", 0, 40)
    )
    drive = driven(scene_of(tmp_path, *LANES, problem(goal=goal)))
    assert (drive.reached, len(drive.steps)) == (True, 0)


def test_every_plan_is_free_and_ends_at_rest_or_a_goal(tmp_path):
    drive = driven(scene_of(tmp_path))
    planner = drive.planner
    for step in drive.steps:
        assert step.decision.stops
        assert step.state.tolist() == step.decision.states[0].tolist()
        limits = planner.vehicle.model.control_limits
        assert (step.decision.controls >= limits[:, 0] - 1e-9).all()
        assert (step.decision.controls <= limits[:, 1] + 1e-9).all()


def test_a_moved_scene_has_the_moved_drive(tmp_path):
    scene = scene_of(tmp_path)
    by = SE2(np.array([320.0, -75.0, 2.4]))
    here, there = driven(scene), driven(scene.moved(by))
    assert [step.control.tolist() for step in here.steps] == [
        step.control.tolist() for step in there.steps
    ]
    moved = here.driven.moved(by).switching_poses
    difference = moved - there.driven.switching_poses
    difference[:, 2] = np.remainder(difference[:, 2] + np.pi, 2 * np.pi) - np.pi
    assert np.abs(difference).max() < 1e-7


FREE = "<goalState>" + interval("time", 15, 40) + "</goalState>"


@pytest.mark.parametrize(
    ("traffic", "start", "status", "said"),
    [
        ([car(7, x=36.0, y=2.5, speed=0.0, steps=45)], {}, "touched", "collision with car 7"),
        (
            [car(8, x=18.0, y=2.0, speed=9.0, steps=45), parked(3, x=36.0, y=4.0, size=(2, 8))],
            {"speed": 0.0},
            "touched",
            "collision with car 8",
        ),
    ],
)
def test_the_judge_decides_how_a_drive_ended(tmp_path, traffic, start, status, said):
    start = {"x": 30.0, "speed": 8.0} | start
    drive = driven(scene_of(tmp_path, *LANES, *traffic, problem(goal=FREE, **start)))
    assert (drive.reached, drive.status) == (False, status)
    assert drive.reason.startswith(said)
    assert drive.reason.endswith("; a goal was reached at 1.5 s")
    speeds = drive.driven.sample().reduced_state[:, 0]
    assert np.abs(np.diff([step.state[3] for step in drive.steps])).max() <= 0.8 + 1e-9
    assert speeds[0] == start["speed"]


@needs_data
@pytest.mark.parametrize(
    ("name", "status"),
    [
        ("hit-at-start", "touched"),
        ("negative-speed-at-start", "undrivable"),
        ("start-off-road", "off_road"),
    ],
)
def test_files_of_others_end_as_the_judge_says(name, status):
    scene = ma.load_scenario(DATA / "field" / "roads" / f"{name}.xml").scene
    assert driven(scene).status == status


def test_one_plan(tmp_path):
    result = plan_road(scene_of(tmp_path))
    assert result.plan is not None
    assert result.decision.reaches
    assert result.verdict.clean
    end = result.planner.vehicle.middle_of(result.plan.end)
    (goal,) = result.planner.scene.goals
    speed, time = result.plan.trims[-1].reduced_state[0], result.plan.duration
    assert goal.contains(end, speed=speed, time=time)


def test_a_plan_made_before_is_driven(tmp_path):
    result = plan_road(scene_of(tmp_path))
    drive = drive_scene(road_planner(result.planner.scene, settings=QUICK), first=result.decision)
    assert drive.reached
    assert drive.verdict.clean
    kept = [step for step in drive.steps if not step.replanned]
    assert kept[0].decision.controls[0].tolist() == result.decision.controls[0].tolist()


@pytest.mark.slow
def test_a_drive_takes_the_time_that_a_goal_leaves():
    lane = Lanelet(1, [[0, 2], [400, 2]], [[0, -2], [400, -2]])
    goal = GoalRegion(
        time=(0.0, 10.0), places=(Box((290.0, 4.0), center=(150.0, 0.0)),), speed=(0, 0)
    )
    start = RoadStart(middle=[10.0, 0.0, 0.0], speed=10.0)
    scene = RoadScene(name="lane", lanelets=(lane,), goals=(goal,), start=start)
    # Evenly braked for 10 s, it costs 0.05 (10 m/s)^2 / 10 s; within the 6 s of a step 0.83.
    assert plan_road(scene, settings=QUICK).cost < 0.56
    drive = drive_road(scene, settings=QUICK)
    assert drive.reached
    assert drive.cost < 0.55


def test_no_plan_says_why(tmp_path):
    goal = GOAL.replace(interval("time", 20, 40), interval("time", 0, 5))
    result = plan_road(scene_of(tmp_path, *LANES, problem(goal=goal)), time_limit=1e-6)
    assert result.plan is None
    assert result.reason == (
        "no goal is reached until 0.5 s by any of the words searched, 100 at a time; the one that "
        "leads furthest ends at 0.5 s; nearest to it at 0.5 s: 1.57 m away"
    )


def test_the_judge_sees_contacts_and_the_edge(tmp_path):
    blind = scene_of(tmp_path, *LANES, problem(goal=ANY, speed=10.0))
    drive = driven(blind)
    there = scene_of(tmp_path, *LANES, parked(3, x=30.0, y=2.0), problem(goal=ANY))
    verdict = judged(there, drive.planner.vehicle, drive.driven)
    assert not verdict.clean
    assert verdict.hit == ("parkedVehicle 3",)
    assert verdict.clearance_m == 0.0
    narrow = scene_of(
        tmp_path, LANES[1], car(7, x=90.0, y=6.0, speed=6.0, steps=40), problem(goal=ANY)
    )
    off = judged(narrow, drive.planner.vehicle, drive.driven)
    assert (off.off_road, off.edge_m) == (True, 0.0)


@pytest.mark.slow
@needs_data
def test_a_tight_junction_is_driven_with_the_steering_that_the_car_has():
    file = DATA / "commonroad" / "scenarios" / "DEU_Muc-11_1_T-1.xml"
    result = plan_road(ma.load_scenario(file).scene)
    assert result.plan is not None
    assert result.verdict.clean
    steering = np.abs(result.decision.states[:, 4]).max()
    assert 0.6 < steering <= result.planner.vehicle.model.max_steering


@needs_data
@pytest.mark.parametrize(
    "name",
    [
        "RUS_Bicycle-11_1_T-1",
        "USA_Peach-1_1_T-1",
        "ZAM_Urban-3_1",
    ],
)
def test_given_scenarios_are_driven_without_contact(name):
    from maneuver_automaton.formats.commonroad import read_commonroad

    file = DATA / "commonroad" / "scenarios" / f"{name}.xml"
    drive = drive_scene(road_planner(read_commonroad(file)[0].road))
    assert drive.reached
    assert drive.verdict.collisions == 0
    assert not drive.verdict.off_road

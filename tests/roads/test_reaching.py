"""Goals of speed, braking as a plan, late goals, causes told before any search, places to stand."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

import maneuver_automaton as ma
from maneuver_automaton.collision import Box, Motion, Obstacle
from maneuver_automaton.groups import SE2
from maneuver_automaton.roads import (
    GoalRegion,
    Lanelet,
    RoadDrive,
    RoadPlanner,
    RoadScene,
    RoadStart,
    RoadVehicle,
    drive_road,
    drive_scene,
    driving,
    judged,
    plan_road,
    road_planner,
)
from maneuver_automaton.roads.plans import plan_of_controls
from tests.formats.outside import DATA, needs_data
from tests.quickly import quick_are
from tests.roads.files import (
    LANES,
    car,
    interval,
    lanelet,
    parked,
    piece,
    problem,
    scene_of,
    square,
)

LIMIT = 300.0  # [s] that nobody waits for: searches end by themselves


def place(x, y, length, width=4.0):
    return (
        f"<position><rectangle><length>{length}</length><width>{width}</width>"
        f"<center><x>{x}</x><y>{y}</y></center></rectangle></position>"
    )


def goal(*parts, time=(0, 100)):
    return f"<goalState>{''.join(parts)}{interval('time', *time)}</goalState>"


def speed(low, high):
    return interval("velocity", low, high)


def ends(value, plan):
    """Middle, speed and time at the end of a plan of a result or a drive."""
    middle = value.planner.vehicle.middle_of(plan.end)
    return middle, plan.trims[-1].reduced_state[0], plan.start_time + plan.duration


@pytest.mark.parametrize(
    ("lanes", "begin", "where", "time"),
    [
        (LANES, 10.0, (105.0, 190.0), (0, 100)),
        (LANES[:1], 6.0, (36.0, 4.0), (0, 80)),
        (LANES[:1], 15.0, (70.0, 40.0), (70, 90)),
    ],
)
def test_it_stops_at_a_place_exactly(tmp_path, lanes, begin, where, time):
    x, length = where
    asked = goal(place(x, 2.0, length), speed(0, 0), time=time)
    drive = drive_road(scene_of(tmp_path, *lanes, problem(goal=asked, speed=begin)))
    assert drive.status == "reached"
    assert abs(drive.driven.trims[-1].reduced_state[0]) < 1e-9
    corner = drive.planner.horizon.goals.corner
    assert length - 1e-6 < np.ptp(corner[:, 0]) < length - 1e-9  # within it in any coordinates


@pytest.mark.parametrize(
    ("begin", "wanted", "time"),
    [
        (10.0, (0.0, 0.5), (30, 40)),
        (20.0, (3.1, 3.3), (0, 35)),
        (14.0, (7.31, 7.31), (0, 25)),
        (23.0, (31.2, 31.5), (0, 60)),
    ],
)
def test_a_speed_without_a_place_is_reached_on_two_lanes(tmp_path, begin, wanted, time):
    scene = scene_of(tmp_path, *LANES, problem(goal=goal(speed(*wanted), time=time), speed=begin))
    for value in (plan_road(scene, time_limit=LIMIT), drive_road(scene, time_limit=LIMIT)):
        plan = value.driven if isinstance(value, RoadDrive) else value.plan
        assert plan is not None
        middle, at, when = ends(value, plan)
        assert wanted[0] - 1e-9 <= at <= wanted[1] + 1e-9
        assert value.planner.scene.goals[0].contains(middle, speed=at, time=when)


@pytest.mark.parametrize(("begin", "spare", "end"), [(10.0, 0.55, "dead end"), (12.0, 0.3, "wall")])
def test_braking_before_the_end_of_the_road_is_a_plan(tmp_path, end, begin, spare):
    front = 10.0 + begin**2 / 16.0 + 2.254 + spare
    road = lanelet(1, 0.0, 4.0).replace("200.0", str(front)).replace("100.0", str(front / 2))
    parts = (road,) if end == "dead end" else (LANES[0], parked(3, x=front + 1, y=2, size=(2, 4)))
    scene = scene_of(tmp_path, *parts, problem(goal=goal(time=(50, 50)), speed=begin))
    result = plan_road(scene, time_limit=LIMIT)
    assert result.plan is not None
    assert result.verdict.clean
    assert result.plan.duration == pytest.approx(5.0)
    assert drive_road(scene).status == "reached"


def test_what_the_loop_drives_is_a_plan(tmp_path, monkeypatch):
    scene = scene_of(tmp_path)
    monkeypatch.setattr(driving, "WIDTHS", (0,))
    result, drive = plan_road(scene, time_limit=LIMIT), drive_scene(road_planner(scene))
    assert result.plan.duration == pytest.approx(drive.driven.duration)
    assert result.cost <= sum(step.applied_cost for step in drive.steps)
    late = scene_of(tmp_path, *LANES, problem(goal=goal(speed(35, 36), time=(10, 20))))
    reason = plan_road(late, time_limit=LIMIT).reason
    assert reason.startswith("; driven step by step until 2 s: missed, no goal was reached until 2")


@pytest.mark.parametrize(
    ("begin", "away", "wanted", "end"),
    [(0.0, 71.0, (0.0, 0.0), 93), (10.8, 143.0, (3.4, 3.6), 118), (7.4, 79.0, (2.8, 3.0), 70)],
)
def test_the_narrowest_search_speeds_up_and_brakes(tmp_path, monkeypatch, begin, away, wanted, end):
    monkeypatch.setattr(driving, "WIDTHS", driving.WIDTHS[:1])
    asked = goal(place(10.0 + away, 2.0, 3.0), speed(*wanted), time=(0, end))
    scene = scene_of(tmp_path, LANES[0], problem(goal=asked, speed=begin))
    assert plan_road(scene, time_limit=LIMIT).plan is not None


def test_late_goals_are_found(tmp_path):
    step, begin, end = 0.04, 31.2, 33.6
    asked = goal(place(190.0, 2.0, 16.0), time=(round(begin / step), round(end / step)))
    scene = scene_of(tmp_path, *LANES, problem(goal=asked, speed=10.0), step=step)
    result = plan_road(scene, time_limit=LIMIT)
    assert result.plan is not None
    assert begin - 1e-9 <= result.plan.duration <= end + 1e-9


@pytest.mark.parametrize(
    ("start", "asked", "status", "said"),
    [
        ({"y": 7.8}, goal(), "off_road", "off the road: a part of the body was outside"),
        ({"x": 33.0}, goal(), "touched", "collision with parkedVehicle 3 at the start"),
        ({"speed": 60.0}, goal(), "undrivable", "the model cannot drive it: speed is 9.2 beyond"),
        ({"speed": -3.0}, goal(), "undrivable", "the model cannot drive it: speed is 3 beyond"),
        (
            {},
            goal(place(150.0, 30.0, 8.0)),
            "missed",
            "no goal can be reached: it is off the road, 20.8 m from where the middle of the",
        ),
        (
            {},
            goal(speed(60, 70)),
            "missed",
            "no goal can be reached: it asks for 60 to 70 m/s, but the vehicle's speeds are 0 to",
        ),
        (
            {},
            goal(place(190.0, 2.0, 8.0), time=(0, 20)),
            "missed",
            "no goal can be reached: it is 176 m away, and until it is over one drives 41.2 m",
        ),
    ],
)
def test_causes_are_told_before_any_search(tmp_path, monkeypatch, start, asked, status, said):
    def never(*_args, **_options):
        raise AssertionError("nothing is to be searched")

    monkeypatch.setattr(RoadPlanner, "search", never)
    there = parked(3, x=36.0, y=2.0)
    scene = scene_of(tmp_path, *LANES, there, problem(goal=asked, **start))
    result, drive = plan_road(scene), drive_scene(road_planner(scene))
    assert result.plan is None
    assert result.reason.startswith(said)
    assert (drive.status, drive.reason, len(drive.steps)) == (status, result.reason, 0)


def test_a_goal_that_is_over_is_said(tmp_path):
    start = problem(goal=goal(time=(5, 9)), speed=5.0).replace(
        "<time><exact>0</exact></time>", "<time><exact>20</exact></time>"
    )
    result = plan_road(scene_of(tmp_path, *LANES, start))
    assert result.reason == (
        "no goal can be reached: its time is over at 0.9 s, before the start at 2 s"
    )


def crossing():
    """A road to the right, and cars that cross it 48 m ahead of the start for some seconds."""
    along = Lanelet(1, [[0, 2], [400, 2]], [[0, -2], [400, -2]])
    across = Lanelet(2, [[56, -90], [56, 90]], [[60, -90], [60, 90]])
    times = np.linspace(0.0, 12.0, 121)
    traffic = [
        Obstacle(
            Box([4.5, 1.8]),
            motion=Motion(times, [[58.0, y + 8.0 * time, np.pi / 2] for time in times]),
            name=f"car {k}",
        )
        for k, y in enumerate((-24.0, -40.0, -56.0, -72.0, -88.0))
    ]
    return RoadScene(
        name="crossing",
        lanelets=(along, across),
        start=RoadStart(middle=[10.0, 0.0, 0.0], speed=9.0),
        goals=(GoalRegion(places=(Box([60.0, 4.0], [150.0, 0.0]),), time=(0.0, 20.0)),),
        traffic=tuple(traffic),
    )


def test_it_waits_where_nobody_comes():
    scene = crossing()
    drive = drive_scene(road_planner(scene))
    assert drive.status == "reached"
    body = drive.planner.vehicle.footprint.corners
    for step in drive.steps[::6]:
        decision = step.decision
        if decision.reaches or not decision.stops:
            continue
        still = shapely.Polygon(SE2(drive.planner.world(decision.states[-1, :3])).act(body))
        begin = step.time + drive.planner.tick * len(decision.controls)
        for one in scene.traffic:
            for time in np.arange(begin, one.motion.time[-1], 0.4):
                assert not still.intersects(shapely.Polygon(one.at(time).corners))


@needs_data
@pytest.mark.parametrize(
    "name",
    quick_are(
        ["braking-is-a-plan", "slow-down-two-lanes"],
        ["stop-at-place", "slow-down-two-lanes", "braking-is-a-plan", "late-goal"],
    ),
)
def test_files_of_others_are_planned_and_driven(name):
    scene = ma.load_scenario(DATA / "field" / "roads" / f"{name}.xml").scene
    assert plan_road(scene, time_limit=LIMIT).plan is not None
    assert drive_road(scene, time_limit=LIMIT).status == "reached"


@needs_data
@pytest.mark.slow
def test_it_is_not_hit_where_it_stands():
    scene = ma.load_scenario(DATA / "commonroad" / "scenarios" / "CHN_Sha-7_1_T-1.xml").scene
    assert drive_scene(road_planner(scene)).status == "reached"


AHEAD = goal(place(150.0, 4.0, 20.0, 8.0), time=(0, 120))


def phantom(number, *sets):
    """Squares of 8 m at places (x, y), each from a step to a step."""
    occupied = "".join(
        f"<occupancy><shape>{square(x, y, 8)}</shape>{interval('time', *time)}</occupancy>"
        for x, y, *time in sets
    )
    name = f'<phantomObstacle id="{number}"><occupancySet>{occupied}</occupancySet>'
    return f"{name}</phantomObstacle>"


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        ((phantom(5, (80, 4, 0, 120)),), "phantom 5 leaves no way"),
        ((phantom(5, (80, 4, 0, 60), (84, 4, 60, 120)),), "phantom 5 leaves no way"),
        (
            (parked(3, x=80, y=2), phantom(5, (80, 8, 0, 130))),
            "parkedVehicle 3 and phantom 5 leave no way",
        ),
        ((phantom(5, (60, 4, 0, 120)), phantom(6, (90, 4, 0, 120))), "road users leave no way"),
    ],
)
def test_who_shuts_a_goal_off_is_told_before_any_search(tmp_path, monkeypatch, parts, said):
    monkeypatch.setattr(RoadPlanner, "search", None)
    scene = scene_of(tmp_path, *LANES, *parts, problem(goal=AHEAD))
    result, drive = plan_road(scene), drive_scene(road_planner(scene))
    assert result.reason == (
        f"no goal can be reached: {said} to it as wide as the vehicle until 12 s"
    )
    assert (drive.status, drive.reason, len(drive.steps)) == ("missed", result.reason, 0)


@pytest.mark.parametrize(
    "parts",
    [
        (phantom(5, (80, 10, 0, 120)),),  # a lane is left
        (phantom(5, (80, 4, 60, 120)),),  # comes late
    ],
)
def test_who_leaves_a_way_shuts_nothing_off(tmp_path, parts):
    scene = scene_of(tmp_path, *LANES, *parts, problem(goal=AHEAD))
    assert plan_road(scene, time_limit=LIMIT).plan is not None


@pytest.mark.parametrize(
    ("cut", "more"),
    [
        (10.0, ""),
        (4e-3, "; lanelets that are not stated to be neighbours are up to 0.01 m apart"),
    ],
)
def test_a_road_that_is_cut_is_told(tmp_path, cut, more):
    lanes = (piece(1, 0, 60), piece(2, 60 + cut, 200))
    scene = scene_of(tmp_path, *lanes, problem(goal=goal(place(150.0, 2.0, 20.0))))
    assert plan_road(scene).reason == (
        "no goal can be reached: no way to it is as wide as the vehicle, 1.61 m" + more
    )


def corner(radius, width=2.5):
    """A lane to the right, a quarter of a turn to the right about a center, and a lane down."""
    angles = np.linspace(np.pi / 2, 0.0, 12)
    arcs = [
        np.array([60.0, -r0]) + r * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        for r0 in (radius + 0.5 * width,)
        for r in (radius + width, radius)
    ]
    (left, right), low = arcs, -radius - 0.5 * width
    return (
        Lanelet(1, [[0, left[0, 1]], left[0]], [[0, right[0, 1]], right[0]], successors=[2]),
        Lanelet(2, left, right, successors=[3]),
        Lanelet(3, [left[-1], left[-1] - [0, 60]], [right[-1], right[-1] - [0, 60]]),
    ), Box([2.0, 20.0], [60.0 + radius + 0.5 * width, low - 30.0])


@pytest.mark.parametrize(("radius", "told"), [(2.0, True), (9.0, False)])
def test_a_turn_that_is_too_tight_is_named(radius, told):
    lanelets, there = corner(radius)
    scene = RoadScene(
        name="corner",
        lanelets=lanelets,
        start=RoadStart(middle=[10.0, 0.0, 0.0], speed=5.0),
        goals=(GoalRegion(places=(there,), time=(0.0, 20.0)),),
    )
    planner = road_planner(scene)
    front = planner.vehicle.ahead + 0.5 * planner.vehicle.length
    swept = np.hypot(radius + planner.vehicle.width, front) - radius  # on paper, about one center
    said = planner.hindrance
    assert (swept > 2.5) == told
    assert said.startswith("; the right turn on lanelet 2 leaves 2.") if told else said == ""
    result = plan_road(scene, time_limit=0.1 if told else LIMIT)
    assert result.reason.endswith(said) if told else result.plan is not None


def test_the_middle_of_who_turns_gets_further_than_the_rear_axle():
    car = RoadVehicle()
    turning = np.array([*car.rear_of([0.0, 0.0, 0.0]), 2.0, car.model.max_steering])
    way = plan_of_controls(car.model, turning, np.array([[8.0, 0.0]] * 2), tick=0.1)
    scene = RoadScene(
        name="turning",
        lanelets=(Lanelet(1, [[-60, 30], [60, 30]], [[-60, -30], [60, -30]]),),
        start=RoadStart(
            middle=[0, 0, 0],
            speed=2.0,
            turn_rate=car.model.body_velocity([2.0, turning[4]], [0.0, 0.0])[2],
        ),
        goals=(GoalRegion(places=Box([0.01, 0.01], car.middle_of(way.end)[:2]), time=(0.2, 0.2)),),
    )
    assert judged(scene, car, way).clean
    assert road_planner(scene).hopeless() is None


def test_who_is_wider_than_long_gets_near_the_end_of_a_road():
    cart = RoadVehicle(length=1.0, width=2.0, ahead=0.3)
    scene = RoadScene(
        name="wide",
        lanelets=(Lanelet(1, [[0, 2], [40, 2]], [[0, -2], [40, -2]]),),
        start=RoadStart(middle=[39.0, 0.0, 0.0], speed=1.0),
        goals=(GoalRegion(places=Box([0.1, 0.1], [39.3, 0.0]), time=(0.3, 0.3)),),
    )
    assert road_planner(scene, cart).hopeless() is None


def test_a_goal_behind_is_told(tmp_path):
    scene = scene_of(tmp_path, *LANES, problem(x=60.0, goal=goal(place(30.0, 2.0, 10.0))))
    assert road_planner(scene).hindrance == (
        "; the goal is 25 m behind the start, and no lanelets lead back to it"
    )


def test_whose_recorded_motion_hits_the_way_is_told(tmp_path):
    slow = car(8, x=20.0, y=2.0, speed=3.0, steps=40)
    asked = problem(x=10.0, goal=goal(place(60.0, 2.0, 10.0), time=(0, 40)))
    result = plan_road(scene_of(tmp_path, LANES[0], slow, asked), time_limit=0.0)
    said = "; without those who move a goal is reached at 3.8 s, on a way where car 8 hits it"
    assert result.reason.endswith(said)
    assert result.decision is not None
    assert result.decision.lasting == 40  # free until the goal is over, so a drive begins with it
    assert drive_scene(result.planner, first=result.decision).verdict.clean


@pytest.mark.parametrize(
    ("y", "beside"), [(0.825, ()), (2.0, (parked(3, x=10.0, y=3.805),))], ids=("edge", "car")
)
def test_who_starts_nearer_than_is_kept_drives_on(tmp_path, y, beside):
    asked = problem(x=10.0, y=y, goal=goal(place(60.0, 4.0, 10.0, 8.0), time=(0, 60)))
    planner = road_planner(scene_of(tmp_path, *LANES, *beside, asked))
    assert planner.search(planner.start_state, tick=0) is not None


def test_a_goal_at_the_start_that_is_over_at_once_is_met(tmp_path):
    asked = problem(goal=goal(place(10.0, 2.0, 4.0), time=(0, 0)))
    scene = scene_of(tmp_path, *LANES, phantom(5, (80, 4, 0, 120)), asked)
    assert road_planner(scene).hopeless() is None


WIDE = piece(2, 120, 145, y=(-8.0, 12.0))  # room to stand across


@pytest.mark.parametrize(
    ("asked", "more", "said"),
    [
        (goal(place(90.0, 2.0, 9.0), interval("orientation", 0.9, 2.2)), (), "at none of its"),
        (goal(place(90.0, 2.0, 9.0), interval("orientation", 0.5, 2.2)), (), None),
        (goal(place(130.0, 2.0, 9.0), interval("orientation", 0.9, 2.2)), (WIDE,), None),
        (goal(place(30.0, 2.0, 10.0)), (), "it is 25 m behind, and nowhere is there room"),
        (goal(place(30.0, 2.0, 10.0)), (WIDE,), None),
        (goal(place(55.0, 2.0, 10.0)), (), None),
    ],
)
def test_a_goal_across_or_behind_on_a_narrow_road_is_told(tmp_path, asked, more, said):
    lanes = (piece(1, 0, 120, '<successor ref="2"/>'), *more)
    scene = scene_of(tmp_path, *lanes, problem(x=60.0, goal=asked))
    why = road_planner(scene).hopeless()
    assert why is None if said is None else why[1].startswith(f"no goal can be reached: {said}")

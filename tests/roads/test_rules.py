"""Plans and loops obey limits, traffic lights and stop signs, for one vehicle and several."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from maneuver_automaton.cli import run
from maneuver_automaton.groups import SE2
from maneuver_automaton.recording.road_drives import joint_notes
from maneuver_automaton.roads import RoadVehicle, drive_road, drive_roads, plan_road, plan_roads
from maneuver_automaton.roads.lanelets import Lanelet, StopLine
from maneuver_automaton.roads.route import route_of
from maneuver_automaton.roads.rules import barriers
from tests.formats.outside import DATA, needs_data
from tests.quickly import quick_are
from tests.roads.files import commonroad, interval, light, piece, place, problem, scene_of, sign

FRONT = 0.5 * RoadVehicle().length  # [m] from its middle
LINE, END = 70.0, 75.0  # [m] the stop line, and the end of its lanelet
DRAWN = (
    f"<stopLine><point><x>{LINE}</x><y>4</y></point><point><x>{LINE}</x><y>0</y></point>"
    "<lineMarking>solid</lineMarking></stopLine>"
)
LIGHT, SIGN = '<trafficLightRef ref="8"/>', '<trafficSignRef ref="7"/>'
FIELD = DATA / "field" / "roads"


def road(ref, *parts, end=200, speed=14.0, drawn=DRAWN, x=10.0):
    """Parts of a file: a lane with a line at 70 m, and a goal at 120 to 140 m."""
    before = piece(1, 0, END, '<successor ref="2"/>' + drawn + ref)
    return (before, piece(2, END, 400), *parts, problem(goal=place(130.0, end), speed=speed, x=x))


def driven_of(result):
    """Times (n,), middles (n, 3) and speeds (n,) of a plan or a loop."""
    if hasattr(result, "steps"):
        states = np.array([one.state for one in result.steps])
    else:
        states = result.decision.states[: result.decision.lasting + 1]
    planner = result.planner
    middle = planner.vehicle.middle_of(planner.world(states[:, :3]))
    return planner.time_of(0) + planner.tick * np.arange(len(states)), middle, states[:, 3]


def over(x, line=LINE):
    """Whether a vehicle with its middle at x is on a line."""
    return (x + FRONT > line) & (x - FRONT < line)


BOTH = pytest.mark.parametrize("drive", [plan_road, drive_road])


@BOTH
@pytest.mark.parametrize(
    ("phases", "offset", "open_times"),
    [
        pytest.param(
            (("green", 35), ("yellow", 10), ("red", 55)),
            0,
            [(0.0, 3.5), (10.0, 13.5)],
            marks=[pytest.mark.slow, pytest.mark.exhaustive],
        ),
        pytest.param(
            (("green", 30), ("red", 60)),
            70,
            [(0.0, 1.0), (7.0, 10.0), (16.0, 19.0)],
            marks=pytest.mark.slow,
        ),
        ((("red", 50), ("redYellow", 20), ("green", 40)), -20, [(5.0, 9.0), (16.0, 20.0)]),
        ((("inactive", 10),), 0, [(0.0, 99.0)]),
    ],
)
def test_a_line_is_crossed_while_the_light_is_green(tmp_path, drive, phases, offset, open_times):
    result = drive(scene_of(tmp_path, *road(LIGHT, light(8, *phases, offset=offset))))
    times, middle, _ = driven_of(result)
    crossed = times[over(middle[:, 0])]
    assert crossed.size
    assert any(low <= crossed.min() and crossed.max() <= high for low, high in open_times)
    assert result.notes == ()
    assert result.planner.scene.traffic == ()  # nobody else sees what closes a line


@BOTH
def test_a_car_waits_at_a_light_that_stays_red(tmp_path, drive):
    scene = scene_of(tmp_path, *road(LIGHT, light(8, ("red", 1000))))
    result = drive(scene, time_limit=0.1)
    assert "the line of traffic light 8 is closed ahead of it" in result.reason
    if drive is drive_road:
        assert (result.status, result.verdict.collisions) == ("missed", 0)
        _, middle, speed = driven_of(result)
        assert LINE - 1.0 < middle[-1, 0] + FRONT < LINE
        assert abs(speed[-1]) < 1e-6


@BOTH
@pytest.mark.parametrize("end", quick_are([130], [130, 300]))
def test_a_car_stands_at_a_stop_sign_once(tmp_path, drive, end):
    result = drive(scene_of(tmp_path, *road(SIGN, sign(7, "206"), end=end)))
    _, middle, speed = driven_of(result)
    first = int(np.flatnonzero(over(middle[:, 0]))[0])
    near = LINE - middle[:first, 0] - FRONT < 3.5
    assert np.abs(speed[:first][near]).min() < 1e-9
    assert middle[-1, 0] > 118.0
    assert result.notes == ()


@BOTH
def test_what_the_start_made_unavoidable_is_noted(tmp_path, drive):
    red = scene_of(tmp_path, *road(LIGHT, light(8, ("red", 1000)), speed=35.0))
    assert any(
        note.startswith("traffic light 8: its line is closed at") for note in drive(red).notes
    )
    stop = scene_of(tmp_path, *road(SIGN, sign(7, "206"), x=60.0))
    on_it = scene_of(tmp_path, *road(SIGN, sign(7, "206"), x=69.0))  # and past it after a step
    for scene in (stop, replace(on_it, step=0.5)):
        said = "stop sign 7: its line is passed without a stop"
        assert any(said in note for note in drive(scene).notes)


@BOTH
def test_a_limit_holds_from_its_lanelet_on(tmp_path, drive):
    limit = '<trafficSignRef ref="7"/>'
    parts = (piece(1, 0, 75, '<successor ref="2"/>'), piece(2, 75, 400, limit))
    scene = scene_of(
        tmp_path, *parts, sign(7, "274", 8.0), problem(goal=place(130.0, 300), speed=14.0)
    )
    _, middle, speed = driven_of(drive(scene))
    assert speed[middle[:, 0] > 75.0].max() < 8.2
    assert speed[middle[:, 0] > 90.0].max() < 8.05


@pytest.mark.slow
def test_a_limit_that_the_goal_does_not_allow_is_told(tmp_path):
    one = piece(1, 0, 200, "<speedLimit>8</speedLimit>")
    scene = scene_of(tmp_path, one, problem(goal=place(130.0, 100), speed=8.0))
    found = plan_road(scene, time_limit=60.0)
    assert found.plan is not None
    (note,) = found.notes
    assert note.startswith("the limit of 8 m/s is exceeded by")


def test_a_light_is_for_those_who_drive_its_way(tmp_path):
    """Straight on is red, to the right is green: the route decides."""
    curve = (
        '<lanelet id="3"><leftBound><point><x>75</x><y>4</y></point>'
        "<point><x>85</x><y>0</y></point>"
        "<point><x>89</x><y>-40</y></point></leftBound><rightBound><point><x>75</x><y>0</y></point>"
        "<point><x>80</x><y>-4</y></point><point><x>85</x><y>-40</y></point></rightBound></lanelet>"
    )
    lights = light(8, ("red", 1000), more="<direction>straight</direction>")
    before = piece(1, 0, END, '<successor ref="2"/><successor ref="3"/>' + DRAWN + LIGHT)
    right = '<goalState><position><lanelet ref="3"/></position>' + interval("time", 0, 200)
    for goal, count in ((place(130.0, 200), 1), (right + "</goalState>", 0)):
        scene = scene_of(tmp_path, before, piece(2, END, 400), curve, lights, problem(goal=goal))
        (line,) = scene.stop_lines
        assert line.onward == (2,)
        route = route_of(scene).lanelets
        assert len(list(barriers(scene, RoadVehicle(), route, until=20.0))) == count


def test_a_closed_line_is_not_passed_on_the_wrong_side(tmp_path):
    ours = piece(
        1, 0, 75, '<successor ref="2"/><adjacentLeft ref="4" drivingDir="opposite"/>' + LIGHT
    )
    beyond = piece(2, 75, 400, '<adjacentLeft ref="4" drivingDir="opposite"/>')
    against = (
        '<lanelet id="4"><leftBound><point><x>400</x><y>4</y></point>'
        "<point><x>0</x><y>4</y></point></leftBound><rightBound><point><x>400</x><y>8</y></point><point><x>0</x><y>8</y></point>"
        "</rightBound></lanelet>"
    )
    parts = (ours, beyond, against, light(8, ("red", 1000)), problem(goal=place(130.0, 200)))
    drive = drive_road(scene_of(tmp_path, *parts), steps=90, time_limit=0.1)
    _, middle, _ = driven_of(drive)
    assert middle[:, 0].max() + FRONT < 75.0


def test_a_moved_scene_has_the_moved_drive(tmp_path):
    parts = road(LIGHT, light(8, ("red", 60), ("green", 1000)), end=150)
    scene, by = scene_of(tmp_path, *parts), SE2([300.0, -40.0, 2.0])
    here, there = plan_road(scene), plan_road(scene.moved(by))
    np.testing.assert_allclose(here.decision.states, there.decision.states, atol=1e-7)


@pytest.mark.parametrize(
    "move",
    [plan_roads, pytest.param(drive_roads, marks=[pytest.mark.slow, pytest.mark.exhaustive])],
)
def test_several_vehicles_obey_each_for_itself(tmp_path, move):
    lights = light(8, ("red", 40), ("green", 1000))
    first, second = (
        scene_of(tmp_path, *road(LIGHT, lights, x=x, speed=8.0, end=end))
        for x, end in ((40.0, 160), (15.0, 260))
    )
    found = move({"first": first, "second": second})
    assert len(found.plans) == 2
    for one in found.results.values():
        times, middle, _ = driven_of(one)
        assert times[over(middle[:, 0])].min() >= 4.0
    assert joint_notes(found) == []


def test_notes_are_in_the_terminal_and_in_the_documents(folder, capsys):
    parts = road(SIGN, sign(7, "306"), sign(6, "205"), end=120)
    Path("road.xml").write_text(commonroad(*parts))
    for command, file in (("plan", "plan.json"), ("mpc", "closed_loop.json")):
        assert run([command, "road.xml", "--no-plot"]) == 0
        said = " ".join(capsys.readouterr().out.split())
        notes = json.loads(Path("out", file).read_text())["notes"]
        assert notes[0] == "not obeyed: traffic signs 306"
        assert notes[1].startswith("give way (205)")
        assert said.count("not obeyed: traffic signs 306") == 1
        assert said.count("give way (205)") == 1


def test_phases_come_again_and_again():
    line = StopLine(
        name="light",
        line=[[0, 0], [0, 1]],
        lanelet=1,
        phases=((2.0, True), (1.0, True), (3.0, False)),
        offset=100.0,
    )
    assert line.closed(0.5, 12.0) == [(0.5, 1.0), (4.0, 7.0), (10.0, 12.0)]
    assert line.closed(5.0, 5.5) == [(5.0, 5.5)]
    with pytest.raises(ValueError, match="need two ends"):
        StopLine(name="light", line=[[0, 0], [0, 0]], lanelet=1)


def test_a_line_beside_a_lane_of_ours_leaves_that_open():
    """Two lanes in one direction, a light for one of them."""
    lanes = tuple(
        Lanelet(k, [[0, 4 * k + 4], [90, 4 * k + 4]], [[0, 4 * k], [90, 4 * k]], beside=[1 - k])
        for k in range(2)
    )
    line = StopLine(name="light", line=[[60, 4], [60, 0]], lanelet=0, phases=((9.0, True),))
    from maneuver_automaton.roads import GoalRegion, RoadScene, RoadStart

    scene = RoadScene(
        name="two lanes",
        lanelets=lanes,
        start=RoadStart(middle=[5.0, 2.0, 0.0], speed=10.0),
        goals=(GoalRegion(time=(1.0, 9.0)),),
        stop_lines=(line,),
    )
    (barrier,) = barriers(scene, RoadVehicle(), (0,), until=20.0)
    assert barrier.time == (0.0, 20.0)
    low, high = barrier.strip.corners.min(axis=0), barrier.strip.corners.max(axis=0)
    np.testing.assert_allclose([low, high], [[59.9, -0.3], [60.0, 4.0]], atol=1e-9)


@needs_data
@pytest.mark.exhaustive
@pytest.mark.slow
@pytest.mark.parametrize("command", ["plan", "mpc"])
def test_the_given_files(command, tmp_path):
    """A phantom, a red light and a sign that were driven past."""
    file = "plan.json" if command == "plan" else "closed_loop.json"

    def document(name):
        run([command, str(FIELD / name), "--no-plot", "--quiet", "--out", str(tmp_path)])
        return json.loads((tmp_path / file).read_text())

    phantom = document("phantom.xml")
    assert phantom["status"] in ("no_plan", "missed")
    light = document("red-light.xml")
    assert "traffic light 8" in light["reason"]
    slow = document("sign-b14.xml")
    states = slow["steps"] if command == "mpc" else slow["trajectory"]["reduced_state"]
    speeds = [one["reduced_state"][0] if command == "mpc" else one[0] for one in states]
    assert max(speeds[len(speeds) // 2 :]) < 8.05
    assert slow["notes"] == ["the limit of 8 m/s is exceeded by 6 m/s at 0 s"]
    if command == "mpc":
        assert light["steps"][-1]["pose"][0] + RoadVehicle().ahead + FRONT < 60.0
        assert phantom["collisions"] == 0


@BOTH
def test_no_limit_is_exceeded_to_be_in_time(tmp_path, drive):
    """A wide window whose end is near: who dawdles would have to hurry."""
    limit, speed, beside = 13.9, 5.0, 22.0
    lanes = (
        piece(1, 0, 70, f'<successor ref="2"/><speedLimit>{limit}</speedLimit>'),
        piece(2, 70, 400, "<speedLimit>6</speedLimit>"),
        piece(3, 0, 400, f"<speedLimit>{beside}</speedLimit>", y=(4.0, 8.0)),
    )
    end = int(10 * (60.0 / limit + 50.0 / 6.0 + 3.0))
    scene = scene_of(tmp_path, *lanes, problem(goal=place(130.0, end), speed=speed))
    result = drive(scene)
    assert result.notes == ()
    _, middle, speeds = driven_of(result)
    assert middle[-1, 0] > 118.0
    assert (speeds <= np.where(middle[:, 0] > 70.0, 6.0, limit) + 1e-6).all()


@BOTH
def test_a_start_beyond_the_limit_brakes_at_once(tmp_path, drive):
    lane = piece(1, 0, 200, "<speedLimit>8</speedLimit>")
    result = drive(scene_of(tmp_path, lane, problem(goal=place(130.0, 300), speed=14.0)))
    _, _, speeds = driven_of(result)
    beyond = int((speeds > 8.0).sum())
    assert beyond <= 18
    assert (np.diff(speeds[: beyond + 1]) <= -0.34).all()
    assert speeds[beyond:].max() <= 8.0 + 1e-6

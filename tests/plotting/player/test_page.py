"""The page of a player, and the numbers in it."""

import json
from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.automaton.cutting import carried
from maneuver_automaton.collision import Box, Disc, Motion, Obstacle, OccupancyMap
from maneuver_automaton.formats.plan_json import plan_of_document
from maneuver_automaton.groups import SE2, group_of
from maneuver_automaton.models import Unicycle
from maneuver_automaton.planning import PlanResult, PlanStatus
from maneuver_automaton.plotting import Player, player_of, player_of_file
from maneuver_automaton.plotting.colors import trim_colors, twist_color
from maneuver_automaton.plotting.player.numbers import (
    Local,
    clearance_entry,
    hex_color,
    motion_entry,
    obstacle_entries,
    part_entries,
)
from maneuver_automaton.plotting.track import track_of_plan
from maneuver_automaton.primitives import Maneuver, Trajectory
from maneuver_automaton.problem import Problem
from tests.plotting.cases import (
    ROBOT,
    document_of,
    flight_plan,
    parking_plan,
    plan_of,
    plan_of_trims,
    result_of,
    slalom_problem,
)
from tests.plotting.fleets import answer, crossing, fleet_of
from tests.plotting.loops import LOOPS


def posed(entry, origin, time):
    """What the browser computes: the arc at a time, its first pose, its twist."""
    k = int(np.searchsorted(entry["times"][1:-1], time, side="right"))
    group = group_of(len(entry["poses"][0]))
    since = np.clip(time - entry["times"][k], 0.0, entry["times"][k + 1] - entry["times"][k])
    pose = (group(entry["poses"][k]) @ group.exp(since * np.array(entry["twists"][k]))).pose
    return pose + np.append(origin, np.zeros(pose.size - 2))


def test_a_page_without_data_is_small_and_loads_nothing():
    page = Player({"title": ""}).html
    assert len(page.encode()) <= 200_000
    for address in ("http:", "https:", "//cdn", "@import", 'src="', "url("):
        assert address not in page


def test_no_name_ends_the_data():
    name = "</script><script>alert(1)</script>"
    page = Player({"title": name, "trims": [{"name": name}]}).html
    assert name not in page
    data = page.split('id="data">')[1].split("</script>")[0]
    assert json.loads(data)["trims"][0]["name"] == name


@pytest.mark.parametrize("plan", [parking_plan(), flight_plan()])
def test_arcs_lead_where_the_plan_does(plan):
    far = replace(plan, start=plan.start + np.append([4e6, -3e6], np.zeros(plan.start.size - 2)))
    content = player_of(far).content
    assert len(content["motions"][0]["twists"]) == len(far.trims)
    for time in np.linspace(0.0, far.duration, 23):
        pose = posed(content["motions"][0], content["origin"], time)
        np.testing.assert_allclose(pose, far.pose_at(time), rtol=0.0, atol=2e-9)


def test_arcs_of_a_maneuver_lead_where_its_course_does():
    time = np.linspace(0.0, 2.0, 21)
    course = Trajectory(
        time=time,
        pose=np.stack([time**2, 0.1 * time**3, 0.4 * time**2], axis=-1),
        reduced_state=time[:, None],
        control=np.ones((21, 1)),
    )
    swing = Maneuver.along(course, name="swing", source="rest", target="rest")
    plan = Plan.of_primitives(
        [1.0, 2.0, 0.3], [swing], durations=[2.0], trims={"rest": ROBOT["rest"]}
    )
    track = track_of_plan(plan)
    numbers = {name: k for k, name in enumerate(track.twists)}
    entry = motion_entry(track, Local(np.zeros(2)), numbers)
    for at in np.linspace(0.0, 2.0, 37):
        np.testing.assert_allclose(posed(entry, [0.0, 0.0], at), plan.pose_at(at), atol=1e-8)


@pytest.mark.parametrize("name", list(LOOPS))
def test_a_closed_loop_is_where_it_was_driven(name):
    loop = LOOPS[name]()
    content = player_of(loop).content
    assert content["ending"] == ("goal reached" if loop.reached else loop.reason)
    assert len(content.get("steps", [])) == len(loop.steps)
    for k, plan in enumerate(loop.driven):
        for time in loop.times[k] + np.array([0.0, 0.37, 0.71]) * (
            loop.times[k + 1] - loop.times[k]
        ):
            pose = posed(content["motions"][0], content["origin"], time)
            np.testing.assert_allclose(pose, plan.pose_at(time), atol=1e-7)
    last = np.array(content["motions"][0]["poses"][-1])
    np.testing.assert_allclose(last[:2] + content["origin"], loop.poses[-1][:2], atol=1e-8)


def test_colors_are_those_of_the_picture():
    plan = parking_plan()
    colors = trim_colors(track_of_plan(plan).twists)
    result = result_of(plan, others=[plan_of_trims(3)])
    shown = {one["name"]: one["color"] for one in player_of(result).content["trims"]}
    assert {name: shown[name] for name in colors} == {k: hex_color(c) for k, c in colors.items()}
    assert len(shown) == len(colors) + 3


def test_clearances_are_distances():
    times = np.array([0.0, 1.0, 2.0])
    poses = np.array([[0.0, 0, 0], [3.0, 0, 0], [3.0, 0, np.pi / 2]])
    robot = [(Box([2.0, 1.0]).corners, poses)]

    def apart(obstacle, **more):
        return clearance_entry(times, robot, [obstacle], **more)["v"]

    assert apart(Obstacle(Box([2.0, 2.0], [3.0, 5.0]))) == [pytest.approx(3.6401, abs=1e-4), 3.5, 3]
    assert apart(Obstacle(Disc(0.5, [3.0, -2.0]))) == pytest.approx([2.0, 1.0, 0.5], abs=1e-3)
    cells = OccupancyMap([[1]], resolution=1.0, origin=[6.0, -0.5, 0.0])
    assert apart(cells) == pytest.approx([5.0, 2.0, 2.5])
    crossing = Motion([0.0, 2.0], [[-3.0, 0.0, 0.0], [7.0, 0.0, 0.0]])
    there = Obstacle(Box([2.0, 2.0]), motion=crossing)
    assert apart(there) == pytest.approx([1.0, 0.0, 2.5])
    gone = replace(there, motion=Motion([0.0, 1.0], [[-3.0, 0, 0], [7.0, 0, 0]]))
    assert clearance_entry(times, robot, [gone], leave=True)["t"] == [0.0, 1.0]
    door = Obstacle(Box([2.0, 2.0], [3.0, 5.0]), present_s=(1.0, np.inf))
    assert clearance_entry(times, robot, [door])["t"] == [1.0, 2.0]
    assert clearance_entry(times, robot, [replace(door, present_s=(7.0, 9.0))]) is None
    assert obstacle_entries([door], Local(np.zeros(2)), leave=False)[0]["present"] == [1.0, None]
    tower = Obstacle(Box([2.0, 2.0], [3.0, 0.0]), height=(0.0, 3.0))
    heights = np.array([[7.0, 8.0], [7.0, 8.0], [-2.0, -1.0]])
    for one in (tower, replace(tower, present_s=(0.0, 9.0))):
        assert apart(one, heights=heights) == pytest.approx([np.hypot(1, 4), 4.0, 1.0], abs=1e-4)
    assert clearance_entry(times, robot, []) is None


def test_a_fleet_is_where_its_plans_are():
    result = crossing()
    content = player_of(result, title="Crossing").content
    assert content["title"] == "Crossing"
    assert dict(content["facts"])["plans"] == "2 of 3"
    names = [one["name"] for one in content["motions"]]
    assert names == ["there", "back", "stuck"]
    for name, plan in result.plans.items():
        motion = content["motions"][names.index(name)]
        for time in np.linspace(plan.start_time, plan.start_time + plan.duration, 9):
            pose = posed(motion, content["origin"], time)
            np.testing.assert_allclose(pose, plan.pose_at(time), rtol=0.0, atol=1e-8)
        trims = [content["trims"][k]["name"] for k in motion["trims"]]
        assert trims == [trim.name for trim in plan.trims]
    stuck = content["motions"][2]
    assert (stuck["twists"], stuck["reason"]) == ([], "walls enclose the start")
    assert (content["fleet"]["begin"], content["fleet"]["end"]) == (0.0, 5.5)
    assert min(content["fleet"]["distance"]["v"]) == pytest.approx(1.0, abs=1e-3)
    assert content["motions"][1]["leaves"]
    assert "http" not in result._repr_html_()


def test_vehicles_of_two_kinds_keep_the_colours_of_their_trims():
    other = Automaton.of_controls(Unicycle(), {"rest": (0, 0), "straight": (-1, 0)})
    back = Plan([0, 5, 0], (other["straight"],), durations=[1.0])
    problem = Problem(other, back.start, back.end)
    found = PlanResult(problem=problem, status=PlanStatus.FOUND, reason="", plan=back)
    ahead = plan_of(["straight"], [1.0])
    result = fleet_of([answer(ahead), found], names=["ahead", "back"])
    content = player_of(result).content
    colors = [content["trims"][one["trims"][0]]["color"] for one in content["motions"]]
    twists = [plan.trims[0].body_velocity for plan in (ahead, back)]
    assert colors == [hex_color(twist_color(twist)) for twist in twists]
    assert colors[0] != colors[1]


def test_a_carried_part_is_where_its_plan_is():
    from maneuver_automaton.models import CarWithTrailer

    truck = CarWithTrailer(wheelbase=2.5, hitch_length=3.0, max_steering=0.6, max_speed=3.0)
    car = Automaton.of_model(truck, {"speed": [1.0], "turn_rate": [0.0, 0.2]})
    trim = max(car.trims, key=lambda one: abs(one.body_velocity[2]))
    plan = Plan([1.0, 2.0, 0.3], (trim,), durations=[4.0])
    track = track_of_plan(plan)
    (towed,) = truck.part_names
    (entry,) = part_entries(track, truck, [towed])
    there = carried(plan, truck, towed)
    for at, frame in zip(entry["t"], entry["pose"], strict=True):
        pose = (SE2(plan.pose_at(at)) @ SE2(frame)).pose
        np.testing.assert_allclose(pose, there.pose_at(at), atol=1e-4)  # its digits


def test_a_file_is_played_with_its_numbers():
    plan = parking_plan()
    document = document_of(plan) | {
        "improvements": [[0.1, 12.0], [0.4, 9.75]],
        "bound": {"value": 9.0, "kind": "cells", "history": [[0.2, 8.0]]},
        "lower_bound": 9.0,
        "gap": 0.077,
    }
    content = player_of_file(document, plan, title="parking").content
    assert content["title"] == "parking"
    assert dict(content["facts"])["cost"] == "9.75 (proven: at least 9)"
    assert content["search"]["costs"] == [[0.1, 12.0], [0.4, 9.75]]
    assert content["search"]["bounds"] == [[0.2, 8.0]]


def test_a_long_motion_is_told_apart_on_the_bar():
    word = ["straight", "clockwise", "anticlockwise"]
    document = document_of(plan_of(word, [1.0, 0.8, 1.2]), rate=50.0)
    document["primitives"] = [
        {
            "kind": "maneuver",
            "name": "polished",
            "source": "rest",
            "target": "rest",
            "duration_s": 3.0,
        }
    ]
    content = player_of_file(document, plan_of_document(document), title="long").content
    assert [trim["name"] for trim in content["trims"]] == [
        "polished motion, ahead",
        "polished motion, back, turning right",
        "polished motion, back, turning left",
    ]


@pytest.mark.slow
def test_values_show_themselves():
    plan = parking_plan()
    result = replace(result_of(plan), problem=slalom_problem(plan))
    for value in (plan, result, LOOPS["parking"]()):
        assert value._repr_html_().startswith("<iframe srcdoc=")
        assert value._repr_png_()[1:4] == b"PNG"
    assert ROBOT._repr_png_()[1:4] == b"PNG"


def test_other_values_are_refused():
    with pytest.raises(TypeError) as error:
        player_of(3)
    assert str(error.value).startswith("recording: got int, need a Plan, PlanResult, ClosedLoop")


def test_without_a_plan_the_page_says_why():
    problem = Problem(ROBOT, [0, 0, 0], [1, 0, 0])
    result = PlanResult(problem=problem, status=PlanStatus.NO_PLAN, reason="too narrow")
    content = result.player().content
    assert content["facts"] == [("no plan", "no plan: too narrow")]
    assert content["motions"][0]["poses"] == [[0.0, 0.0, 0.0]]
    assert result._repr_png_()[1:4] == b"PNG"

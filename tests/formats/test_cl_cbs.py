"""Problems of CL-CBS and CSDO: agents, map, the car; which way headings turn; what is wrong."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.cl_cbs import read_cl_cbs
from maneuver_automaton.formats.text_source import read_text
from maneuver_automaton.formats.yaml_source import parse
from maneuver_automaton.planning.blocked import where_touched
from maneuver_automaton.scenario import load_scenario
from tests.formats.outside import DATA, message_of, needs_data

PROBLEM = """\
agents:
  - {name: agent0, start: [4, 6, 0], goal: [7, 25, 1.57]}
  - name: agent1
    start: [25, 3, 1.57]
    goal: [9, 3, -1.57]
map:
  dimensions: [50, 40]
  obstacles:
    - [36.75, 18.5]
    - [-1, -1]
    - [7.0, 26.5]
"""
BESIDE = """\
schema: 1
vehicle: {model: unicycle, footprint: {disc_m: 0.5}}
automaton:
  trims:
    - {name: rest, control: [0.0, 0.0]}
    - {name: ahead, control: [2.0, 0.0]}
    - {name: spin, control: [0.0, 1.0]}
cost: {length: 1.0}
margin_m: 0.1
fleet: {objective: last, orders: 2, time_limit_s: 3}
receding_horizon: {step_s: 1.0}
"""


def read(path):
    (case,) = read_cl_cbs(path, parse(read_text(path), name=str(path)))
    return case


@pytest.fixture
def path(tmp_path):
    file = tmp_path / "map_50by40_ex7.yaml"
    file.write_text(PROBLEM)
    return file


def test_what_a_file_states(path):
    case = read(path)
    assert (case.format, case.name) == ("CL-CBS", "map_50by40_ex7")
    assert [one.name for one in case.fleet] == ["agent0", "agent1"]
    assert case.fleet[0].start.tolist() == [4.0, 6.0, 0.0]
    assert case.fleet[1].goal.tolist() == [9.0, 3.0, 1.57]  # clockwise in the file
    assert (case.bounds.x, case.bounds.y) == ((0.0, 50.0), (0.0, 40.0))
    discs = [(one.shape.center.tolist(), one.shape.radius) for one in case.obstacles]
    assert discs == [([36.75, 18.5], 0.8), ([7.0, 26.5], 0.8)]  # [-1, -1] is none
    assert [one.name for one in case.obstacles] == ["obstacle 1", "obstacle 3"]


def test_the_car(path):
    scenario = load_scenario(path)
    one, two = scenario.fleet.problems
    assert one.automaton is two.automaton
    assert one.automaton.rest is not None
    twists = one.automaton.body_velocities
    turning = np.abs(twists[:, 2]) > 0.0
    radii = np.abs(twists[turning, 0] / twists[turning, 2])
    assert radii == pytest.approx(3.0, rel=1e-15)
    assert set(np.abs(twists[:, 0]).tolist()) == {0.0, 1.0}
    (body,) = one.footprint
    assert body.size.tolist() == [3.0, 2.0]
    assert body.center.tolist() == [0.5, 0.0]  # 2 m ahead of the rear axle, 1 m behind
    assert scenario.fleet.margin == 0.0


@given(st.floats(-50.0, 50.0), st.floats(0.0, 50.0), st.floats(-3.2, 3.2))
def test_a_step_of_the_planner_is_one_along_the_heading(tmp_path_factory, x, y, yaw):
    """The planner's step ahead is (cos(-yaw), sin(-yaw)): `environment.hpp`, getNeighbors."""
    file = tmp_path_factory.mktemp("one") / "one.yaml"
    file.write_text(PROBLEM.replace("[4, 6, 0]", f"[{x!r}, {y!r}, {yaw!r}]"))
    pose = read(file).fleet[0].start
    step = np.array([math.cos(-yaw), math.sin(-yaw)])
    assert pose[:2].tolist() == [x, y]
    np.testing.assert_allclose([math.cos(pose[2]), math.sin(pose[2])], step, atol=1e-15)


def test_a_scenario_beside_it(path):
    beside = path.with_name("car.yaml")
    beside.write_text(BESIDE)
    scenario = load_scenario(path, beside=beside)
    one = scenario.fleet.problems[1]
    assert one.automaton.trim_names == ("rest", "ahead", "spin")
    assert one.footprint[0].radius == 0.5
    assert one.start.tolist() == [25.0, 3.0, -1.57]
    assert scenario.settings.model_dump() == {
        "objective": "last", "between_m": None, "orders": 2, "time_limit_s": 3.0,
    }  # fmt: skip
    assert scenario.fleet.margin == 0.1  # that of the vehicles
    assert scenario.receding_horizon.step_s == 1.0


def test_a_scenario_beside_it_with_a_fixed_time(path):
    beside = path.with_name("car.yaml")
    beside.write_text(BESIDE + "horizon: {time_s: 9.0}\n")
    with pytest.raises(InvalidScenario, match="'agent0' has a fixed time, need a free final time"):
        load_scenario(path, beside=beside)
    beside.write_text(BESIDE.replace("orders: 2", "orders: 0"))
    with pytest.raises(InvalidScenario) as error:
        load_scenario(path, beside=beside)
    said = f"--with: {beside}:10: fleet.orders: got 0, need a whole number of at least 1"
    assert str(error.value) == said


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[4, 6, 0]", "[4, 6]", ":2: agents[0].start: got 2 numbers, need 3: [x, y, yaw]"),
        ("[4, 6, 0]", "[4, six, 0]", ":2: agents[0].start[1]: got 'six', need a finite number"),
        ("[4, 6, 0]", "[4, 6, 1e7]",
         ":2: agents[0].start[2]: got the yaw 1e+07, need at most 1e+06 rad"),
        ("    goal: [9, 3, -1.57]\n", "", ":3: agents[1].goal: is missing, need [x, y, yaw]"),
        ("name: agent1", "name: agent0",
         ":3: agents[1].name: got 'agent0', the name of agents[0] too, need another one"),
        ("name: agent1", "name: 7", ":3: agents[1].name: got 7, need a name"),
        ("[50, 40]", "[50, 0]", ":7: map.dimensions[1]: got 0, need a positive number"),
        ("[50, 40]", "50", ":7: map.dimensions: got 50, need [width, height]"),
        ("    - [36.75, 18.5]", "    - 36.75",
         ":9: map.obstacles[0]: got 36.75, need [x, y] or [x, y, r]"),
        ("[36.75, 18.5]", "[36.75]",
         ":9: map.obstacles[0]: got 1 numbers, need [x, y] or [x, y, r]"),
        ("[36.75, 18.5]", "[36.75, 18.5, 1, 2]",
         ":9: map.obstacles[0]: got 4 numbers, need [x, y] or [x, y, r]"),
        ("[36.75, 18.5]", "[36.75, 18.5, 0]",
         ":9: map.obstacles[0][2]: got 0, need a positive number"),
        ("[36.75, 18.5]", "[36.75, 18.5, wide]",
         ":9: map.obstacles[0][2]: got 'wide', need a finite number"),
        ("  dimensions: [50, 40]\n", "", ":6: map.dimensions: is missing, need [width, height]"),
    ],
)  # fmt: skip
def test_what_is_wrong(path, old, new, message):
    assert PROBLEM.count(old) == 1
    assert message_of(load_scenario, path, PROBLEM.replace(old, new)) == message


def test_files_that_state_no_problem(path):
    text = "agents: []\nmap: {dimensions: [5, 5], obstacles: []}\n"
    assert message_of(load_scenario, path, text) == ":1: agents: got no agent, need at least one"
    text = "statistics: {cost: 3}\nschedule: {agent0: []}\n"
    assert message_of(load_scenario, path, text) == (
        ":1: is a solution of CL-CBS, need the problem (agents, map)"
    )


def test_a_file_of_csdo(path):
    """Discs that state their radii, and yaw counter-clockwise: CSDO steps by (cos yaw, sin yaw)."""
    rows = PROBLEM[PROBLEM.index("    - [36.75") :]
    path.write_text(PROBLEM.replace(rows, "    - [36.75, 18.5, 0.50]\n    - [7.0, 26.5]\n"))
    case = read(path)
    discs = [(one.shape.center.tolist(), one.shape.radius) for one in case.obstacles]
    assert discs == [([36.75, 18.5], 0.5), ([7.0, 26.5], 0.8)]
    assert case.fleet[1].start.tolist() == [25.0, 3.0, 1.57]
    assert case.fleet[1].goal.tolist() == [9.0, 3.0, -1.57]
    path.write_text(PROBLEM.replace(rows, ""))
    case = read(path)
    assert case.obstacles == ()
    assert case.fleet[1].start.tolist() == [25.0, 3.0, 1.57]
    assert load_scenario(path).fleet.problems[1].footprint[0].size.tolist() == [3.0, 2.0]


@needs_data
@pytest.mark.parametrize("name", sorted(p.name for p in (DATA / "fleet/cl-cbs").glob("*.yaml")))
def test_the_given_files(name):
    path = DATA / "fleet/cl-cbs" / name
    document = parse(read_text(path), name=str(path)).value
    fleet = load_scenario(path).fleet
    assert fleet.names == tuple(agent["name"] for agent in document["agents"])
    centers = [one for one in document["map"]["obstacles"] if one != [-1, -1]]
    for agent, one in zip(document["agents"], fleet.problems, strict=True):
        assert [one.start[0], one.start[1], -one.start[2]] == agent["start"]
        assert len(one.obstacles) == len(centers)
        assert not where_touched(one, one.start, 0.0)  # all chosen here are free
        assert not where_touched(one, one.goals[0].pose, math.inf)

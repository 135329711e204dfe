"""Problems of dynobench: world, robot, model; and what is wrong with a file."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from maneuver_automaton.collision import Box
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.dynobench import BUILT_IN, READ, read_dynobench
from maneuver_automaton.formats.text_source import read_text
from maneuver_automaton.formats.yaml_source import parse
from maneuver_automaton.models import SecondOrderUnicycle
from maneuver_automaton.scenario import load_scenario
from tests.formats.outside import DATA, message_of, needs_data
from tests.scenario.files import SCENARIO

PROBLEM = """\
name: yard
environment:
  min: [0, -1.5]
  max: [6, 4]
  obstacles:
    - type: box
      center: [3, 1]
      size: [0.2, 3]
robots:
  - type: unicycle1_v0
    start: [1, 0, 0]  # x, y, theta
    goal: [5, 0, 1.5]
"""
MODEL = """\
dynamics: "unicycle1"
max_vel: 1.5
min_vel: -0.5
max_angular_vel: 2
min_angular_vel: -1
size: [.8, .4]
shape: "box"
dt: .1
"""


def read(path):
    (case,) = read_dynobench(path, parse(read_text(path), name=str(path)))
    return case


def problem(folder, text=PROBLEM):
    (folder / "envs" / "yard").mkdir(parents=True, exist_ok=True)
    path = folder / "envs" / "yard" / "yard.yaml"
    path.write_text(text)
    return path


def controls(case):
    return sorted(map(tuple, case.vehicle.automaton.controls.tolist()))


def test_what_a_file_states(tmp_path):
    case = read(problem(tmp_path))
    assert case.name == "yard"
    assert case.start.tolist() == [1.0, 0.0, 0.0]
    assert case.goal.tolist() == [5.0, 0.0, 1.5]
    assert (case.bounds.x, case.bounds.y) == ((0.0, 6.0), (-1.5, 4.0))
    (wall,) = case.obstacles
    assert isinstance(wall.shape, Box)
    assert (wall.shape.center.tolist(), wall.shape.size.tolist()) == ([3.0, 1.0], [0.2, 3.0])
    (body,) = case.footprint
    assert (body.size.tolist(), body.center.tolist()) == ([0.5, 0.25], [0.0, 0.0])


def test_the_built_in_model_has_its_extremes_and_rest(tmp_path):
    extremes = (-0.5, 0.0, 0.5)
    case = read(problem(tmp_path))
    assert controls(case) == sorted(itertools.product(extremes, extremes))
    assert case.vehicle.automaton.rest is not None


@pytest.mark.parametrize(("name", "least"), [("unicycle1_v1", -0.5), ("unicycle1_v2", -0.25)])
def test_one_that_cannot_stop(tmp_path, name, least):
    case = read(problem(tmp_path, PROBLEM.replace("unicycle1_v0", name)))
    assert controls(case) == sorted(itertools.product((0.25, 0.5), (least, 0.0, 0.5)))
    assert case.vehicle.limits.tolist() == [[0.25, 0.5], [least, 0.5]]
    assert case.vehicle.automaton.rest is None


def test_a_model_above_the_file_comes_first(tmp_path):
    (tmp_path / "models").mkdir()
    (tmp_path / "models" / "unicycle1_v0.yaml").write_text(MODEL)
    case = read(problem(tmp_path))
    assert controls(case) == sorted(itertools.product((-0.5, 0.0, 1.5), (-1.0, 0.0, 2.0)))
    assert case.footprint[0].size.tolist() == [0.8, 0.4]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("unicycle1_v0", "tank", ":10: robots[0].type: got 'tank', which is not built in, and "
         f"there is no models/tank.yaml above this file; need {READ}"),
        ("unicycle1_v0", "../x", ":10: robots[0].type: got '../x', which is not built in, and "
         f"there is no models/../x.yaml above this file; need {READ}"),
        ("unicycle1_v0", "7", ":10: robots[0].type: got 7, need the name of a model"),
        ("  - type: unicycle1_v0\n    start", "  - start",
         ":10: robots[0].type: is missing, need the name of a model"),
        ("start: [1, 0, 0]", "start: [1, 0]",
         ":11: robots[0].start: got 2 numbers, need 3: [x, y, heading]"),
        ("start: [1, 0, 0]", "start: [1, 0, .nan]",
         ":11: robots[0].start[2]: got nan, need a finite number of at most 1e+10 in size"),
        ("start: [1, 0, 0]", "start: [1, 0, true]",
         ":11: robots[0].start[2]: got true, need a finite number"),
        ("    start: [1, 0, 0]  # x, y, theta\n", "",
         ":10: robots[0].start: is missing, need [x, y, heading]"),
        ("max: [6, 4]", "max: [6, -4]",
         ":4: environment.max[1]: got -4, need more than min y, -1.5"),
        ("max: [6, 4]", "max: [6, 4, 2]",
         ":4: environment.max: got 3 numbers, need 2: [x, y]"),
        ("  min: [0, -1.5]\n", "", ":2: environment.min: is missing, need [x, y]"),
        ("type: box", "type: sphere",
         ":6: environment.obstacles[0].type: got 'sphere', need box"),
        ("size: [0.2, 3]", "size: [0.2, 0]",
         ":8: environment.obstacles[0].size: got [0.2, 0.0], need positive sizes"),
        ("center: [3, 1]", "centre: [3, 1]",
         ":6: environment.obstacles[0].center: is missing, need [x, y]"),
    ],
)  # fmt: skip
def test_what_is_wrong(tmp_path, old, new, message):
    assert PROBLEM.count(old) == 1
    assert message_of(read, problem(tmp_path), PROBLEM.replace(old, new)) == message


SECOND_ROBOT = "  - {type: car1_v0, start: [0, 0, 0, 0], goal: [1, 1, 1, 1]}\n"
THIRD_ROBOT = "  - {type: unicycle1_v0, start: [0, 3, 0], goal: [1, 3, 1]}\n"


def test_several_robots_are_a_fleet(tmp_path):
    case = read(problem(tmp_path, PROBLEM + SECOND_ROBOT + THIRD_ROBOT))
    assert (case.name, case.start, case.vehicle) == ("yard", None, None)
    one, two, three = case.fleet
    assert [robot.name for robot in case.fleet] == ["robot 1", "robot 2", "robot 3"]
    assert one.start.tolist() == [1.0, 0.0, 0.0]
    assert two.goal.tolist() == [1.0, 1.0, 1.0]
    assert one.vehicle is three.vehicle  # one library for both
    assert "trailer" in two.vehicle.parts
    assert all(robot.obstacles is case.obstacles for robot in case.fleet)
    scenario = load_scenario(problem(tmp_path, PROBLEM + SECOND_ROBOT + THIRD_ROBOT))
    assert scenario.fleet.names == ("robot 1", "robot 2", "robot 3")
    alone = load_scenario(problem(tmp_path, PROBLEM)).problem
    of_fleet = scenario.fleet.problems[0]
    assert of_fleet.start.tolist() == alone.start.tolist()
    assert of_fleet.automaton.controls.tolist() == alone.automaton.controls.tolist()
    assert of_fleet.automaton is scenario.fleet.problems[2].automaton


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (SECOND_ROBOT, "  - {type: tank, start: [0, 0, 0], goal: [1, 1, 1]}\n",
         ":13: robots[1].type: got 'tank', which is not built in, and there is no "
         f"models/tank.yaml above this file; need {READ}"),
        ("goal: [1, 1, 1, 1]", "goal: [1, 1, 1]", ":13: robots[1].goal: got 3 numbers, need 4: "
         "[x, y, heading, heading of the trailer]"),
        ("goal: [1, 1, 1, 1]", "goal: [1, 1, 1, 4]",
         ":13: robots[1].goal: got the hitch -3, need -0.785398 to 0.785398"),
        ("start: [0, 3, 0]", "start: [0, 3, 1e9]",
         ":14: robots[2].start[2]: got the heading 1e+09, need at most 1e+06 rad"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_one_of_several(tmp_path, old, new, message):
    text = PROBLEM + SECOND_ROBOT + THIRD_ROBOT
    assert text.count(old) == 1
    assert message_of(read, problem(tmp_path), text.replace(old, new)) == message


def test_no_robot(tmp_path):
    text = PROBLEM[: PROBLEM.index("robots:")] + "robots: []\n"
    assert (
        message_of(read, problem(tmp_path), text) == ":9: robots: got no robot, need at least one"
    )


def test_the_names_of_db_cbs(tmp_path):
    for name, same in (("unicycle_first_order_0", "unicycle1_v0"),):
        case, known = (
            read(problem(tmp_path, PROBLEM.replace("unicycle1_v0", n))) for n in (name, same)
        )
        assert controls(case) == controls(known)
        assert case.footprint[0].size.tolist() == known.footprint[0].size.tolist()
    disc = read(problem(tmp_path, PROBLEM.replace("unicycle1_v0", "unicycle_first_order_0_sphere")))
    assert disc.vehicle.limits.tolist() == [[-0.5, 0.5], [-2.0, 2.0]]
    assert (disc.footprint[0].radius, disc.footprint[0].center.tolist()) == (0.4, [0.0, 0.0])


@needs_data
@pytest.mark.parametrize("name", sorted(p.name for p in (DATA / "fleet/db-cbs").glob("*.yaml")))
def test_the_examples_of_db_cbs(name):
    path = DATA / "fleet/db-cbs" / name
    document = parse(read_text(path), name=str(path)).value
    fleet = load_scenario(path).fleet
    assert len(fleet) == len(document["robots"])
    assert len({id(one.automaton) for one in fleet.problems}) == len(
        {robot["type"] for robot in document["robots"]}
    )
    for robot, one in zip(document["robots"], fleet.problems, strict=True):
        assert one.start.tolist() == robot["start"][:3]
        assert one.goals[0].pose.tolist() == robot["goal"][:3]
        assert len(one.obstacles) == len(document["environment"]["obstacles"])
        assert one.bounds.x == (0.0, document["environment"]["max"][0])
        assert one.automaton.rest is not None


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("max_vel: 1.5\n", "", ":1: max_vel: is missing, need a finite number"),
        ("max_vel: 1.5", "max_vel: -1", ":2: max_vel: got -1, need more than min_vel, -0.5"),
        ("[.8, .4]", "[.8]", ":6: size: got 1 numbers, need 2: [length, width]"),
        ('"box"', "cone", ":7: shape: got 'cone', need box or sphere"),
        ('"box"', "sphere", ":1: radius: is missing, need a finite number"),
        (MODEL, "", ": is empty, need a model"),
    ],
)
def test_what_is_wrong_with_a_model(tmp_path, old, new, message):
    path = problem(tmp_path)
    (tmp_path / "models").mkdir()

    def read_problem(_):
        read(path)

    model = tmp_path / "models" / "unicycle1_v0.yaml"
    assert MODEL.count(old) == 1
    assert message_of(read_problem, model, MODEL.replace(old, new)) == message


SECOND = PROBLEM.replace("unicycle1_v0", "unicycle2_v0").replace(
    "start: [1, 0, 0]", "start: [1, 0, 0, 0.1, 0]"
).replace("goal: [5, 0, 1.5]", "goal: [5, 0, 1.5, 0, 0]")  # fmt: skip
TRAILER = PROBLEM.replace("unicycle1_v0", "car1_v0").replace(
    "start: [1, 0, 0]", "start: [1, 0, 0.2, 0.1]"
).replace("goal: [5, 0, 1.5]", "goal: [5, 0, 1.5, 1.5]")  # fmt: skip


def test_a_unicycle_with_inertia(tmp_path):
    case = read(problem(tmp_path, SECOND))
    model = case.vehicle.automaton.model
    assert model == SecondOrderUnicycle(
        max_speed=0.5, min_speed=-0.5, max_turn_rate=0.5, max_acceleration=0.25,
        max_angular_acceleration=0.25,
    )  # fmt: skip
    assert case.start.tolist() == [1.0, 0.0, 0.0]
    assert case.start_state.tolist() == [0.1, 0.0]
    assert case.goal_state.tolist() == [0.0, 0.0]
    scenario = load_scenario(problem(tmp_path, SECOND))
    assert scenario.problem.first_trim.reduced_state.tolist() == [0.1, 0.0]
    assert scenario.problem.last_trim(scenario.problem.goals[0]).is_rest
    assert len(scenario.problem.automaton) == 30  # a level of speed more, that of the start


def test_a_car_with_a_trailer(tmp_path):
    scenario = load_scenario(problem(tmp_path, TRAILER))
    problem_ = scenario.problem
    model = problem_.automaton.model
    assert (model.wheelbase, model.hitch_length, model.min_speed) == (0.25, 0.5, -0.1)
    assert model.max_hitch == pytest.approx(math.pi / 4)
    assert problem_.first_trim.is_rest
    assert problem_.first_trim.reduced_state[0] == pytest.approx(0.1)
    (trailer,) = problem_.parts["trailer"]
    assert trailer.size.tolist() == [0.3, 0.25]
    frame = problem_.start[:2] + _turned(model.part_poses(np.array([0.1]))[0, :2], 0.2)
    np.testing.assert_allclose(frame, [1 - 0.5 * math.cos(0.1), -0.5 * math.sin(0.1)])
    assert problem_.automaton.maneuvers


def _turned(vector, angle):
    c, s = math.cos(angle), math.sin(angle)
    return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]])


@pytest.mark.parametrize(
    ("text", "old", "new", "message"),
    [
        (SECOND, "0.1, 0]", "0.1]",
         ":11: robots[0].start: got 4 numbers, need 5: [x, y, heading, speed, turn rate]"),
        (SECOND, "0.1, 0]", "0.7, 0]", "start: got the speed 0.7, need -0.5 to 0.5"),
        (TRAILER, "0.2, 0.1]", "0.2, 2.1]",
         "start: got the hitch -1.9, need -0.785398 to 0.785398"),
    ],
)  # fmt: skip
def test_ends_that_cannot_be(tmp_path, text, old, new, message):
    assert text.count(old) == 1
    assert message_of(read, problem(tmp_path), text.replace(old, new)).endswith(message)


@pytest.mark.parametrize(
    ("dynamics", "old", "new", "message"),
    [
        ("unicycle2", "max_acc_abs: 1", "max_acc_abs: 0",
         ":7: max_acc_abs: got 0, need a positive number"),
        ("unicycle2", "min_angular_vel: -2", "min_angular_vel: -1",
         ":5: min_angular_vel: got -1, need -2, the opposite of max_angular_vel"),
        ("car_with_trailers", "num_trailers: 1", "num_trailers: 2",
         ":12: num_trailers: got 2, need 1"),
        ("car_with_trailers", "hitch_lengths: [1]", "hitch_lengths: [-1]",
         ":11: hitch_lengths[0]: got -1, need a positive number"),
        ("car_with_trailers", "max_steering_abs: 1", "max_steering_abs: 2",
         ":10: max_steering_abs: got 2, need less than pi / 2"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_model_of_second_order(tmp_path, dynamics, old, new, message):
    model = (
        f"dynamics: {dynamics}\nmax_vel: 1.5\nmin_vel: -0.5\nmax_angular_vel: 2\n"
        "min_angular_vel: -2\nsize: [.8, .4]\nmax_acc_abs: 1\nmax_angular_acc: 1\n"
        "shape: box\nmax_steering_abs: 1\nhitch_lengths: [1]\nnum_trailers: 1\nl: 0.5\n"
        "size_trailer: [.3, .4]\nshape_trailer: box\n"
    )
    second = SECOND if dynamics == "unicycle2" else TRAILER
    name = "unicycle2_v0" if dynamics == "unicycle2" else "car1_v0"
    path = problem(tmp_path, second)
    (tmp_path / "models").mkdir()
    assert model.count(old) == 1

    def read_problem(_):
        read(path)

    file = tmp_path / "models" / f"{name}.yaml"
    assert message_of(read_problem, file, model.replace(old, new)) == message


def test_a_scenario_beside_has_the_same_vehicle(tmp_path):
    path = problem(tmp_path, SECOND)
    beside = tmp_path / "beside.yaml"
    beside.write_text(SCENARIO)
    with pytest.raises(InvalidScenario, match="a second_order_unicycle, but the scenario of"):
        load_scenario(path, beside=beside)


@needs_data
def test_problems_of_dynobench():
    paths = sorted((DATA / "dynobench" / "envs").glob("*/*.yaml"))
    assert len(paths) == 24
    for path in paths:
        if path.parent.name.startswith(("unicycle", "car1")):
            case = read(path)
            assert case.vehicle.name == path.parent.name
            assert case.bounds.x[0] < case.start[0] < case.bounds.x[1]
            built_in = BUILT_IN[path.parent.name]
            assert tuple(case.footprint[0].size) == tuple(built_in["size"])
            continue
        with pytest.raises(InvalidScenario, match=r": robots\[0\].type: got ") as error:
            read(path)
        assert str(error.value).endswith(f"not in this version; need {READ}")


@needs_data
@pytest.mark.parametrize("name", sorted(BUILT_IN))
def test_built_in_models_are_those_of_dynobench(name):
    path = DATA / "dynobench" / "models" / f"{name}.yaml"
    stated = parse(read_text(path), name=str(path)).value
    for key, value in BUILT_IN[name].items():
        assert stated[key] == value

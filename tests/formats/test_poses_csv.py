"""Tables of poses as obstacles that move."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.cli import run
from maneuver_automaton.formats.poses_csv import NAMES, is_poses, read_poses
from maneuver_automaton.scenario import load_scenario
from tests.formats.outside import message_of
from tests.scenario.test_loading import BESIDE

TABLE = f"""{",".join(NAMES)}
car,0.0,-4.0,3.0,0.0,4.5,1.8
person,1.0,2.0,-5.0,1.5,0.5,0.5
car,2.0,4.0,3.0,0.0,4.5,1.8
person,5.0,2.0,5.0,1.5,0.5,0.5
"""


def test_rows_of_one_name_are_one_obstacle(tmp_path):
    (tmp_path / "traffic.csv").write_text(TABLE)
    (stated,) = read_poses(tmp_path / "traffic.csv")
    car, person = stated.obstacles
    assert (stated.name, car.shape.size.tolist()) == ("traffic", [4.5, 1.8])
    np.testing.assert_allclose(car.motion.at(0.5), [-2.0, 3.0, 0.0])
    np.testing.assert_allclose(person.motion.at([0.0, 3.0]), [[2, -5, 1.5], [2, 0, 1.5]])


def test_it_is_planned_among_with_a_scenario(tmp_path):
    (tmp_path / "traffic.csv").write_text(TABLE)
    (tmp_path / "beside.yaml").write_text(BESIDE)
    file, beside = str(tmp_path / "traffic.csv"), str(tmp_path / "beside.yaml")
    scenario = load_scenario(file, beside=beside)
    assert len(scenario.problem.obstacles) == 2
    argv = ["plan", file, "--with", beside, "--out", str(tmp_path / "out"), "--quiet", "--no-plot"]
    assert run(argv) == 0
    assert run(["convert", file, str(tmp_path / "x.yaml"), "--with", beside]) == 0
    again = load_scenario(tmp_path / "x.yaml").problem.obstacles
    np.testing.assert_allclose(again[0].motion.pose, scenario.problem.obstacles[0].motion.pose)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("car,2.0", "car,0.0"), ":4: time_s: got 0, need more than 0"),
        (("1.8\nperson,1.0", "2.0\nperson,1.0"), ":4: length_m, width_m: changed, need those"),
        (("4.5,1.8\nperson,5.0", "4.5\nperson,5.0"), ":4: got 6 columns, need 7: name, time_s, "),
        (("0.5,0.5\ncar", "0.5,0\ncar"), ":3: got 0.5 x 0 m, need positive sizes"),
        (("2.0,-5.0", "2.0,far"), ":3: y_m: got 'far', need a finite number"),
    ],
)
def test_what_is_wrong_is_told(tmp_path, change, message):
    assert message_of(read_poses, tmp_path / "x.csv", TABLE.replace(*change)).startswith(message)


def test_an_empty_table_is_told(tmp_path):
    said = message_of(read_poses, tmp_path / "x.csv", TABLE.split("\n")[0])
    assert said == ": holds no pose, need a row for each"


def test_what_is_none_is_not_recognised(tmp_path):
    (tmp_path / "x.csv").write_text("0, 1, 2")
    assert not is_poses(tmp_path / "x.csv")
    assert not is_poses(tmp_path / "nowhere.csv")

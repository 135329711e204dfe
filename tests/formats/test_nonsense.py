"""Numbers that no vehicle has, and files that are none, are refused in one line."""

from __future__ import annotations

import json
import os

import pytest

from maneuver_automaton.cli import run
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.sbpl_mprim import read_mprim
from maneuver_automaton.formats.text_source import read_text
from maneuver_automaton.formats.tpcap import read_tpcap
from maneuver_automaton.models import SecondOrderUnicycle
from maneuver_automaton.primitives.driving import drive
from maneuver_automaton.primitives.primitive import Trim
from tests.scenario.files import SCENARIO

MPRIM = """\
resolution_m: 0.1
numberofangles: 4
totalnumberofprimitives: 1
primID: 0
startangle_c: 0
endpose_c: 1 0 0
additionalactioncostmult: 1
intermediateposes: 3
0 0 0
{x} 0 0
0.1 0 0
"""


def said(capsys, *arguments: str) -> str:
    """What is said of a command that is refused."""
    assert run(list(arguments)) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    assert "internal error" not in line
    assert len(line) < 1000
    return line


def test_poses_far_from_the_way_of_a_primitive(tmp_path):
    path = tmp_path / "a.mprim"
    path.write_text(MPRIM.format(x=0.05))
    assert len(read_mprim(path).primitives) == 1
    path.write_text(MPRIM.format(x=1e7))
    with pytest.raises(InvalidScenario, match=r"got pose 1 of the 3 that end here 1e\+07 m"):
        read_mprim(path)


def test_a_heading_turned_too_often(tmp_path):
    path = tmp_path / "Case1.csv"
    path.write_text("0,0,1e7,5,5,0,0")
    with pytest.raises(InvalidScenario, match=r"value 3 \(theta0\): got 1e\+07, need at most"):
        read_tpcap(path)


def test_a_motion_of_too_many_samples():
    robot = SecondOrderUnicycle(
        max_speed=1.0, max_turn_rate=1.0, max_acceleration=1.0, max_angular_acceleration=1.0
    )
    with pytest.raises(ValueError, match=r"drive: a motion has 2e\+10 samples 0.05 m"):
        drive(robot, [1.0, 0.0], control=[[0.0, 0.0]], durations=[1e9])


def test_a_trim_is_named_by_a_text():
    with pytest.raises(ValueError, match="trim: got the name 7"):
        Trim(name=7, body_velocity=[1.0, 0.0, 0.0], control=[1.0, 0.0])  # type: ignore[arg-type]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names")
def test_pipes_and_devices_are_no_files(folder, capsys):
    for name in ("a.yaml", "a.csv", "a.json", "a.xml", "a.svg", "a.cfg"):
        os.mkfifo(name)
        assert "it is a pipe or a device, need a file" in said(capsys, "check", name)
        assert said(capsys, "automaton", "show", name)
    (folder / "z.yaml").symlink_to("/dev/zero")
    assert "a pipe or a device" in said(capsys, "plan", "z.yaml")
    assert "a pipe or a device" in said(capsys, "plot", "z.yaml")


@pytest.mark.parametrize(
    ("secret", "asked"),
    [("root:x:0:0:root:/root\n", "is no map"), ("password: hunter2\n", "is no map")],
)
def test_an_error_about_a_map_does_not_tell_what_a_file_holds(folder, capsys, secret, asked):
    (folder / "secret").write_text(secret)
    (folder / "x.yaml").write_text(SCENARIO + "obstacles: [{map: secret}]\n")
    line = said(capsys, "check", "x.yaml")
    assert asked in line
    assert not any(word in line for word in ("root", "hunter2", "password"))


def test_a_name_that_is_too_long(folder, capsys):
    (folder / "x.yaml").write_text(SCENARIO + f"obstacles: [{{map: {'x' * 5000}}}]\n")
    assert "File name too long" in said(capsys, "check", "x.yaml")
    assert "File name too long" in said(capsys, "plan", "y" * 5000)
    with pytest.raises(InvalidScenario, match="File name too long"):
        read_text(folder / ("z" * 300))


def test_a_library_with_numbers_of_forty_digits(folder, capsys):
    (folder / "x.yaml").write_text(SCENARIO)
    assert run(["automaton", "build", "x.yaml", "-o", "x.json", "--quiet"]) == 0
    document = json.loads((folder / "x.json").read_text())
    del document["hash"]
    for change in ({"name": 7}, {"name": 10**40}, {"control": [10**40, 0]}, {"control": 10**400}):
        bad = json.loads(json.dumps(document))
        bad["trims"][1].update(change)
        (folder / "y.json").write_text(json.dumps(bad))
        assert said(capsys, "automaton", "show", "y.json").startswith("y.json: ")

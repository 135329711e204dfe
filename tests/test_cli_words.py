"""What the commands say beside their tables: files written, JSON, what is hardly meant, hints."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from maneuver_automaton.cli.app import run

SCENARIO = """schema: 1
vehicle: {model: unicycle}
automaton:
  trims: [{name: rest, control: [0, 0]}, {name: on, control: [1, 0]}, {name: left, control: [1, 1]}]
start: {pose: [0, 0, 0]}
goal: {pose: [1, 0, 0]}
receding_horizon: {step_s: 0.5}
"""
FILES = {"x.yaml": SCENARIO}
pytestmark = pytest.mark.usefixtures("folder")


@pytest.mark.parametrize(("command", "file"), [("plan", "plan"), ("mpc", "closed_loop")])
def test_json_is_all_that_is_on_standard_output(capsys, command, file):
    assert run([command, "x.yaml", "--no-plot", "--json"]) == 0
    printed = capsys.readouterr()
    assert printed.out == Path(f"out/{file}.json").read_text()
    assert json.loads(printed.out)["cost"] == pytest.approx(1.0)
    assert "written to:" in printed.err
    assert run([command, "x.yaml", "--no-plot", "--json", "--quiet"]) == 0
    assert capsys.readouterr().err == ""


def test_json_without_a_plan_and_with_a_bad_file(capsys):
    obstacle = "obstacles: [{disc_m: {center: [1, 0], radius: 0.5}}]\n"
    Path("x.yaml").write_text(SCENARIO + obstacle)
    assert run(["plan", "x.yaml", "--no-plot", "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["status"] == "goal_blocked"
    for arguments in (["y.yaml"], ["."]):
        assert run(["plan", *arguments, "--json"]) == 2
        assert capsys.readouterr().out == ""


def test_what_was_written_is_said(capsys):
    run(["plan", "x.yaml", "--no-plot", "--quiet"])
    plan = str(Path("out/plan.json"))
    for command, file in (
        (["plot", plan], "out/plan.png"),
        (["plot", plan, "--html", "--out", "page.html"], "page.html"),
        (["export", plan, "--to", "csv"], "out/plan.csv"),
        (["export", plan, "--to", "geojson", "-o", "a.geojson"], "a.geojson"),
        (["convert", "x.yaml", "again.yaml"], "again.yaml"),
        (["convert", "x.yaml", "trims.json"], "trims.json"),
    ):
        assert run(command) == 0
        assert capsys.readouterr().out == f"wrote {Path(file)}\n"
        assert Path(file).is_file()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("start: {pose: [0, 0, 0]}", "start: {pose: [0, 0, 90]}",
         "x.yaml:5: start.pose[2]: 90 rad is more than a full turn and looks like degrees; "
         "90 degrees are 1.571 rad\n"),
        ("goal: {pose: [1, 0, 0]}", "goal: {pose: [1, 0, -7]}",
         "x.yaml:6: goal.pose[2]: -7 rad is more than a full turn and looks like degrees; "
         "-7 degrees are -0.1222 rad\n"),
        ("receding_horizon", "obstacles: [{box_m: {center: [5, 5], size: [1, 1], heading_rad: 45}}]"
         "\nreceding_horizon", "x.yaml:7: obstacles[0].box_m.heading_rad: 45 rad is more than a "
         "full turn and looks like degrees; 45 degrees are 0.7854 rad\n"),
        ("goal: {pose: [1, 0, 0]}", "goal: {pose: [1, 0, 6.2832]}", ""),
        ("goal: {pose: [1, 0, 0]}", "goal: {pose: [1, 0, 0], tolerance_rad: 10}",
         "x.yaml:6: goal.tolerance_rad: 10 rad is more than a full turn and looks like degrees; "
         "10 degrees are 0.1745 rad\n"),
    ],
)  # fmt: skip
def test_headings_that_look_like_degrees_are_remarked_on(capsys, old, new, said):
    Path("x.yaml").write_text(SCENARIO.replace(old, new, 1))
    assert run(["plan", "x.yaml", "--no-plot", "--quiet"]) == 0
    assert capsys.readouterr().err == said


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("differential", "unicycle"), ("diff_drive", "unicycle"),
        ("Differential-Drive", "unicycle"),
        ("omni", "omnidirectional"), ("ackermann", "car"), ("bicycle", "car"), ("dubins", "car"),
        ("reeds_shepp", "car"), ("tractor_trailer", "car_with_trailer"), ("unicycel", "unicycle"),
    ],
)  # fmt: skip
def test_other_names_of_models_are_understood_but_not_taken(capsys, name, meant):
    Path("x.yaml").write_text(SCENARIO.replace("model: unicycle", f"model: {name}"))
    assert run(["plan", "x.yaml"]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"x.yaml:2: vehicle.model: got '{name}', need one of unicycle, car, ")
    assert f"; did you mean '{meant}'?" in said


def test_a_model_of_ones_own_names_the_option(capsys):
    for name in ("boat", "own_trailer", "cart"):
        Path("x.yaml").write_text(SCENARIO.replace("model: unicycle", f"model: {name}"))
        assert run(["check", "x.yaml"]) == 2
        said = capsys.readouterr().err
        assert said.endswith("vehicle of your own needs --model MODULE:OBJECT\n")


def test_a_loop_whose_goal_is_blocked_says_so(capsys):
    Path("x.yaml").write_text(SCENARIO + "obstacles: [{disc_m: {center: [1, 0], radius: 0.5}}]\n")
    assert run(["mpc", "x.yaml", "--no-plot"]) == 1
    printed = capsys.readouterr()
    assert "nothing was driven" in printed.out
    assert "start is the goal" not in printed.out
    assert printed.err.startswith("x.yaml: no_plan: the goal is blocked: ")


def test_a_loop_of_one_vehicle_is_checked_in_its_world_and_no_scenario(capsys):
    run(["mpc", "x.yaml", "--no-plot", "--quiet"])
    assert run(["check", str(Path("out/closed_loop.json"))]) == 2
    assert "need --with" in capsys.readouterr().err
    assert run(["check", str(Path("out/closed_loop.json")), "--with", "x.yaml"]) == 0
    capsys.readouterr()
    assert run(["plan", str(Path("out/closed_loop.json"))]) == 2
    assert capsys.readouterr().err.endswith(":1: is a closed loop, need a scenario\n")

"""`plan` and `mpc` of CommonRoad scenarios: files, exit codes, one line for what is wrong."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from maneuver_automaton.cli import run
from tests.roads.files import GOAL, LANES, car, commonroad, interval, problem

QUICK = ["--no-plot", "--quiet"]
LATE = GOAL.replace(interval("time", 20, 40), interval("time", 0, 5))
FILES = {"road.xml": commonroad()}


def test_a_scenario_is_driven(folder, capsys):
    assert run(["mpc", "road.xml", "--no-plot"]) == 0
    document = json.loads(Path("out/closed_loop.json").read_text())
    assert document["reached"] is True
    assert (document["status"], document["collisions"]) == ("reached", 0)
    assert document["broken_guarantees"] == []
    first, *_, last = document["steps"]
    assert {"time_s", "pose", "value", "accumulated_cost", "control", "word", "plan"} <= set(first)
    assert sum(one["duration_s"] for one in first["plan"]) >= first["lasting_s"] - 1e-9
    assert last["control"] is None
    assert last["accumulated_cost"] == pytest.approx(document["cost"])
    assert "reached" in capsys.readouterr().out


def test_a_goal_that_is_missed_ends_with_one(folder, capsys):
    Path("late.xml").write_text(commonroad(*LANES, problem(goal=LATE)))
    assert run(["mpc", "late.xml", *QUICK]) == 1
    assert capsys.readouterr().err.endswith(
        "late.xml: missed: no goal was reached until 0.5 s, when the last one is over; "
        "nearest to it at 0.5 s: 1.83 m away\n"
    )
    assert run(["plan", "late.xml", "--time-limit", "0.001", *QUICK]) == 1
    document = json.loads(Path("out/plan.json").read_text())
    assert (document["status"], document["cost"], document["primitives"]) == ("no_plan", None, [])


def test_a_contact_ends_with_one_in_every_output(folder, capsys):
    """Also where the start made it unavoidable, and the goal is reached."""
    goal = "<goalState>" + interval("time", 15, 20) + "</goalState>"
    parts = *LANES, car(7, x=36.0, y=2.5, speed=0.0, steps=45), problem(goal=goal, x=30.0)
    Path("hit.xml").write_text(commonroad(*parts))
    said = "collision with car 7; a goal was reached at 1.5 s"
    assert run(["mpc", "hit.xml", "--no-plot", "--html"]) == 1
    document = json.loads(Path("out/closed_loop.json").read_text())
    assert (document["status"], document["reason"]) == ("touched", said)
    assert document["reached"] is False
    assert document["audit"]["passed"] is False
    assert document["broken_guarantees"] == [
        {"step": None, "guarantee": "no collision", "reason": "collision with car 7"}
    ]
    printed = capsys.readouterr()
    assert f"touched: {said}" in printed.out
    assert printed.err.endswith(f"hit.xml: touched: {said}\n")
    assert f'"ending":"{said}"' in Path("out/closed_loop.html").read_text().replace(": ", ":")
    away = problem(101, goal=goal, x=90.0)
    Path("two.xml").write_text(commonroad(*parts, away))
    assert run(["mpc", "two.xml", "--no-plot", "--html"]) == 1
    document = json.loads(Path("out/closed_loop.json").read_text())
    assert (document["status"], document["reason"]) == ("touched", f"100: {said}")
    assert (document["reached"], document["vehicles"]["101"]["status"]) == (False, "reached")
    assert capsys.readouterr().err.endswith(f"two.xml: touched: 100: {said}\n")


def test_one_of_several_problems(folder, capsys):
    Path("two.xml").write_text(commonroad(*LANES, problem(1, goal=LATE), problem(2)))
    assert run(["check", "two.xml"]) == 2
    assert "two.xml: holds 2 problems, need --case and a number, 0 to 1" in capsys.readouterr().err
    for command, written in (("plan", "plan.json"), ("mpc", "closed_loop.json")):
        assert run([command, "two.xml", "--case", "1", *QUICK]) == 0
        assert "kind" not in json.loads(Path("out", written).read_text())


def test_folders_hold_scenarios_and_other_xml(folder):
    Path("many").mkdir()
    Path("many/road.xml").write_text(commonroad())
    Path("many/primitives.xml").write_text("<Trajectories></Trajectories>")
    assert run(["plan", "many", *QUICK]) == 0
    assert Path("out/road/plan.json").is_file()

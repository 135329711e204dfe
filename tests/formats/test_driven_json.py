"""A closed loop drawn again from its file alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton.cli import run
from maneuver_automaton.formats.closed_loop_json import (
    closed_loop_to_dict,
    driven_document,
    load_closed_loop,
    save_closed_loop,
)
from maneuver_automaton.formats.plan_json import plan_of_document

SCENARIOS = Path(__file__).parents[2] / "scenarios"
ROBOT = ma.Automaton.of_controls(
    ma.Unicycle(), {"rest": (0.0, 0.0), "ahead": (1.0, 0.0), "left": (1.0, 1.0)}
)
GOAL = [2.0 + np.sin(1.0), 1.0 - np.cos(1.0), 1.0]
LOOP = ma.simulate(ma.Problem(ROBOT, [0, 0, 0], GOAL, horizon=ma.Horizon(max_trims=2)), step=0.5)


def test_the_drive_is_that_of_the_loop():
    document = driven_document(closed_loop_to_dict(LOOP))
    assert [(one["name"], one["duration_s"]) for one in document["primitives"]] == [
        ("ahead", pytest.approx(2.0)),
        ("left", pytest.approx(1.0)),
    ]
    times, poses = (np.array(document["trajectory"][key]) for key in ("time_s", "pose"))
    for time, pose in zip(times, poses, strict=True):
        piece = LOOP.driven[min(int(time / 0.5 + 1e-9), len(LOOP.driven) - 1)]
        np.testing.assert_allclose(pose, piece.pose_at(time), atol=1e-9)
    assert np.abs(np.diff(poses[:, 2])).max() <= 0.05 + 1e-12


def test_what_is_played_of_a_file_is_where_the_vehicle_was():
    plan = plan_of_document(driven_document(closed_loop_to_dict(LOOP)))
    for time, pose in zip(LOOP.times, LOOP.poses, strict=True):
        np.testing.assert_allclose(plan.pose_at(time), pose, atol=1e-9)


def test_a_loop_of_no_step_is_drawn(tmp_path):
    there = ma.simulate(ma.Problem(ROBOT, [0, 0, 0], [0, 0, 0]), step=0.5)
    save_closed_loop(there, tmp_path / "closed_loop.json")
    assert run(["plot", str(tmp_path / "closed_loop.json")]) == 0


def test_with_its_scenario_it_is_the_loop_that_it_was(tmp_path):
    save_closed_loop(LOOP, tmp_path / "closed_loop.json")
    loop = load_closed_loop(tmp_path / "closed_loop.json", LOOP.problem)
    assert closed_loop_to_dict(loop)["steps"] == closed_loop_to_dict(LOOP)["steps"]
    assert loop.inside == LOOP.inside
    for ours, theirs in zip(loop.driven, LOOP.driven, strict=True):
        np.testing.assert_array_equal(ours.end, theirs.end)


def test_another_scenario_is_told(tmp_path, capsys):
    save_closed_loop(LOOP, tmp_path / "a.json")
    argv = ["plot", str(tmp_path / "a.json"), "--with", str(SCENARIOS / "parking_loop.yaml")]
    assert run(argv) == 2
    assert capsys.readouterr().err == (
        f"{tmp_path / 'a.json'}: automaton_hash: this loop was planned with another library\n"
    )

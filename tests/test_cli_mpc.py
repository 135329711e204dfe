"""`maneuver-automaton mpc` against its contract: files, exit codes, one line for what is wrong."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from maneuver_automaton.cli import run
from tests.scenario.files import SCENARIO, but

LOOP = SCENARIO + "receding_horizon: {step_s: 0.5}\n"
NOISE = "disturbance: {position_m: 0.01, heading_rad: 0.01, seed: 1}"
SHAKEN = (
    but("pose: [1.0, 1.0, 0.0]", "pose: [1.0, 1.0, 0.0], tolerance_m: 0.2, tolerance_rad: 0.2")
    + f"receding_horizon: {{step_s: 0.5, steps: 40, {NOISE}}}\n"
)
CART = "{box_m: {center: [0, 0], size: [0.5, 20]}, motion: [[0, -3, 0, 0], [2, 9, 0, 0]]}"
HIT = LOOP.replace("model: unicycle", "model: unicycle, footprint: {rectangle_m: [0.4, 0.4]}") + (
    f"obstacles: [{CART}]\n"  # faster than the vehicle, and on both sides of it
)
CLEAR = HIT.replace("[[0, -3, 0, 0], [2, 9, 0, 0]]", "[[0, -5, 0, 0], [2, -4, 0, 0]]")
AHEAD_ONLY = LOOP.replace("    - {name: spin, control: [0.0, 1.0]}\n", "")
SEEDS = ["--seeds", "2"]
QUICK = ["--no-plot", "--quiet"]
FILES = {"x.yaml": LOOP}


def log(out: str = "out") -> dict[str, Any]:
    """The content of closed_loop.json."""
    return json.loads((Path(out) / "closed_loop.json").read_text())  # type: ignore[no-any-return]


def untimed(document: dict[str, Any]) -> dict[str, Any]:
    """What does not depend on how fast the machine is."""
    steps = [{k: v for k, v in step.items() if k != "solve_s"} for step in document["steps"]]
    return document | {"steps": steps}


def files(out: str = "out") -> list[str]:
    return sorted(path.name for path in Path(out).iterdir())


def test_it_drives_to_the_goal(folder, capsys):
    assert run(["mpc", "x.yaml"]) == 0
    assert files() == ["closed_loop.json", "closed_loop.png"]
    printed = capsys.readouterr()
    assert "reached" in printed.out
    assert "hold in every step" in printed.out
    assert "planned" in printed.out
    assert "kept" in printed.out
    assert "collisions" not in printed.out
    assert "broke" not in printed.err
    document = log()
    assert (document["status"], document["reached"]) == ("reached", True)
    assert document["steps"][-1]["pose"] == pytest.approx([1.0, 1.0, 6.283185307], abs=1e-8)
    assert document["cost"] == pytest.approx(document["steps"][0]["value"])
    assert document["audit"]["failed"] == 0
    assert document["audit"]["pieces"] == len(document["steps"]) - 1


def test_steps(folder, capsys):
    assert run(["mpc", "x.yaml", "--steps", "3", *QUICK]) == 1
    document = log()
    assert len(document["steps"]) == 4
    assert (document["status"], document["reached"]) == ("steps_spent", False)
    message = "x.yaml: steps_spent: the goal is not reached after 3 steps\n"
    assert capsys.readouterr().err == message
    first, last = document["steps"][0], document["steps"][-1]
    assert last["value"] + last["accumulated_cost"] == pytest.approx(first["value"])


def test_nothing_leads_there(folder, capsys):
    Path("x.yaml").write_text(AHEAD_ONLY)
    assert run(["mpc", "x.yaml", *QUICK]) == 1
    document = log()
    assert document["status"] == "no_plan"
    assert len(document["steps"]) == 1
    assert capsys.readouterr().err.startswith("x.yaml: no_plan: recursive feasibility: no plan")


def test_the_start_is_the_goal(folder, capsys):
    Path("x.yaml").write_text(LOOP.replace("[1.0, 1.0, 0.0]", "[0.0, 0.0, 0.0]"))
    assert run(["mpc", "x.yaml"]) == 0
    assert "nothing to do: the start is the goal" in capsys.readouterr().out
    assert len(log()["steps"]) == 1


class TestAmongObstacles:
    def test_what_is_hit_is_told(self, folder, capsys):
        Path("x.yaml").write_text(HIT)
        assert run(["mpc", "x.yaml", "--no-plot"]) == 1
        printed = capsys.readouterr()
        document = log()
        assert document["reached"] is True
        steps = {one["step"] for one in document["broken_guarantees"]
                 if one["guarantee"] == "no collision"}  # fmt: skip
        assert steps
        assert f"collisions:     in {len(steps)} step" in printed.out
        assert "least clearance:0 m" in printed.out.replace(": ", ":")
        assert "harmful" in printed.out
        assert all(f"step {k} broke a guarantee: no collision" in printed.err for k in steps)

    def test_what_is_kept_clear_of_is_told(self, folder, capsys):
        Path("x.yaml").write_text(CLEAR)
        assert run(["mpc", "x.yaml", "--no-plot"]) == 0
        printed = capsys.readouterr().out
        assert "collisions:     none" in printed
        assert f"least clearance:{log()['min_clearance_m']:.4g} m" in printed.replace(": ", ":")
        assert "harmful" not in printed

    @pytest.mark.slow
    def test_over_seeds_it_counts_as_much(self, folder, capsys):
        Path("x.yaml").write_text(HIT)
        assert run(["mpc", "x.yaml", *SEEDS, "--no-plot"]) == 1
        assert "broken: no collision" in capsys.readouterr().out


class TestSeed:
    def test_the_same_repeats_and_another_differs(self, folder, capsys):
        Path("x.yaml").write_text(SHAKEN)
        for name, seed in (("a", "3"), ("b", "3"), ("c", "4")):
            run(["mpc", "x.yaml", "--seed", seed, "--out", name, *QUICK])
        assert untimed(log("a")) == untimed(log("b"))
        assert log("a")["steps"][1]["pose"] != log("c")["steps"][1]["pose"]

    def test_what_noise_takes_is_not_called_broken(self, folder, capsys):
        Path("x.yaml").write_text(SHAKEN)
        run(["mpc", "x.yaml", "--no-plot"])
        printed, document = capsys.readouterr(), log()
        taken = document["disturbed"]
        assert {one["guarantee"] for one in taken} == {"value decrease"}
        assert all("noise raised the value by " in one["reason"] for one in taken)
        assert document["broken_guarantees"] == []
        assert "broke" not in printed.out + printed.err
        steps = len(document["steps"]) - 1
        assert (
            f"under noise:    it raised the value above the plan's in {len(taken)} of {steps - 1} "
            "steps; recursive feasibility held\n"
        ) in printed.out
        assert f"hold in 1 of {steps} steps, those that nothing disturbed\n" in printed.out


class TestStatistics:
    def test_over_seeds(self, folder, capsys):
        Path("x.yaml").write_text(SHAKEN)
        code = run(["mpc", "x.yaml", "--seeds", "3", "--seed", "5"])
        assert files() == ["statistics.json"]
        document = json.loads(Path("out/statistics.json").read_text())
        assert [row["seed"] for row in document["loops"]] == [5, 6, 7]
        assert code == (0 if document["reached"] == 1.0 else 1)
        assert "loops:" in capsys.readouterr().out


class TestResume:
    def test_it_goes_on_as_if_it_had_not_stopped(self, folder):
        Path("x.yaml").write_text(SHAKEN)
        code = run(["mpc", "x.yaml", "--out", "whole", *QUICK])
        run(["mpc", "x.yaml", "--out", "half", "--steps", "4", *QUICK])
        resume = ["--resume", "half/closed_loop.json"]
        assert run(["mpc", "x.yaml", "--out", "rest", "--steps", "36", *resume, *QUICK]) == code
        whole, half, rest = (untimed(log(name)) for name in ("whole", "half", "rest"))
        assert half["steps"][:4] == whole["steps"][:4]
        for one, other in zip(rest["steps"], whole["steps"][4:], strict=True):
            assert one == other
        assert rest["cost"] == whole["cost"]

    def test_from_a_log_towards_a_goal_that_is_not_there(self, folder, capsys):
        run(["mpc", "x.yaml", "--steps", "2", *QUICK])
        capsys.readouterr()
        text = Path("out/closed_loop.json").read_text().replace('"goal": 0', '"goal": 7')
        Path("old.json").write_text(text)
        assert run(["mpc", "x.yaml", "--resume", "old.json", *QUICK]) == 2
        assert capsys.readouterr().err == (
            "x.yaml: receding_horizon: the last step leads to goal 7, need one of the 1, counted "
            "from 0\n"
        )


class TestFolder:
    def test_one_bad_file_does_not_stop_the_others(self, folder, capsys):
        Path("many").mkdir()
        Path("many/a.yaml").write_text("schema: 1\n")
        Path("many/b.yaml").write_text(AHEAD_ONLY)
        Path("many/c.yaml").write_text(LOOP)
        assert run(["mpc", "many", *QUICK]) == 2
        assert log("out/c")["reached"] is True
        lines = capsys.readouterr().err.splitlines()
        assert lines[0].startswith(f"{Path('many/a.yaml')}:1: ")
        assert "no_plan" in lines[1]


def test_a_tiny_budget_still_arrives(folder):
    assert run(["mpc", "x.yaml", "--time-limit", "1e-9", *QUICK]) == 0
    kinds = {one["guarantee"] for one in log()["broken_guarantees"]}
    assert kinds <= {"time budget"}

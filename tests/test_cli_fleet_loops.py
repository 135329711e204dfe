"""`mpc` of several vehicles, and `plot` and `check` of what it writes."""

from __future__ import annotations

import contextlib
import io
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from maneuver_automaton.cli import fleets, run
from maneuver_automaton.fleet import plan_fleet, simulate_fleet
from maneuver_automaton.formats.fleet_json import load_fleet_loop
from maneuver_automaton.groups import SE2
from maneuver_automaton.receding_horizon import Disturbance
from maneuver_automaton.scenario import load_scenario
from tests.test_cli_fleets import FLEET, SCENARIOS

NEAR = "tolerance_m: 0.05, tolerance_rad: 0.05}"
LOOP = (
    FLEET.replace("goal: {pose: [4, 0, 0]}", "goal: {pose: [4, 0, 0], " + NEAR)
    .replace("goal: {pose: [0.0, 2.0, 1.5]}", "goal: {pose: [0.0, 2.0, 1.5], " + NEAR)
    .replace("time_limit_s: 1}", "time_limit_s: 60}")
    + "receding_horizon: {step_s: 0.5, disturbance: {position_m: 0.003, seed: 3}}\n"
)
FILES = {"x.yaml": LOOP}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with a fleet and its loop, and what was printed on both streams."""
    made, out, err = tmp_path_factory.mktemp("made"), io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(made)
        Path("x.yaml").write_text(LOOP)
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            assert run(["mpc", "x.yaml"]) == 0
    return made, out.getvalue(), err.getvalue()


@pytest.fixture
def driven(folder, made):
    """The document of a loop, and its files in the current folder."""
    shutil.copytree(made[0] / "out", "out")
    return document()


def document(out="out"):
    return json.loads((Path(out) / "closed_loop.json").read_text(encoding="utf-8"))


def poses(log):
    return {name: [one.start for one in log.driven[name]] for name in log.problem.names}


def assert_same_poses(one, other):
    for name, found in poses(one).items():
        np.testing.assert_array_equal(found, poses(other)[name])


class TestMpc:
    def test_files_and_table(self, driven, made):
        _, out, err = made
        assert err == ""
        found = driven
        assert (found["kind"], found["status"], found["reached"]) == ("fleet", "reached", True)
        assert found["source"] == {"file": "../x.yaml", "with": None, "case": None}
        assert found["clearance_m"]["between"] > 0.0
        assert Path("out/closed_loop.png").stat().st_size > 10_000
        assert not Path("out/closed_loop.gif").exists()
        for said in (
            "A crossing",
            "guarantees:     hold in every step",
            "collisions:     none",
            "goals:          reached",
            "sum:",
            "last arrival:",
        ):
            assert said in out

    @pytest.mark.exhaustive
    @pytest.mark.slow
    def test_the_loop_is_that_of_the_library(self, driven, monkeypatch):
        """Bit for bit, from the same first plans: these go by the clock."""
        scenario = load_scenario("x.yaml")
        first = plan_fleet(scenario.fleet, time_limit=20.0, max_rounds=2)
        monkeypatch.setattr(fleets, "plan_fleet", lambda *_, **__: first)
        assert run(["mpc", "x.yaml", "--quiet", "--no-plot", "--time-limit", "20"]) == 0
        written = load_fleet_loop("out/closed_loop.json", scenario.fleet)
        log = simulate_fleet(
            scenario.fleet,
            step=0.5,
            steps=100,
            disturbance=Disturbance(position_m=0.003),
            seed=3,
            first=first,
            time_limit=20.0,
        )
        assert_same_poses(written, log)
        assert document()["cost"] == log.cost
        assert [one.names for _, one in written.swaps] == [one.names for _, one in log.swaps]

    def test_a_broken_guarantee_is_no_success(self, driven, capsys):
        """One is pushed onto the other."""
        east, north = (driven["vehicles"][name]["steps"][5] for name in ("east", "north"))
        here, there = SE2(np.array(north["vehicle_pose"])), SE2(np.array(east["vehicle_pose"]))
        push = (here.inverse() @ there).pose.tolist()
        onto = f"{{disturbance: {{pushes: [{{after_step: 4, by: {push}}}]}}}}"
        Path("x.yaml").write_text(
            LOOP.replace("name: north,", f"name: north, receding_horizon: {onto},")
        )
        assert run(["mpc", "x.yaml", "--quiet", "--no-plot", "--steps", "6"]) == 1
        printed = capsys.readouterr().err
        assert "broke a guarantee: " in printed
        assert "east and north touch at " in printed

    def test_it_goes_on_from_its_file(self, folder, capsys):
        quietly = ["--quiet", "--no-plot"]
        assert run(["mpc", "x.yaml", *quietly, "--out", "half", "--steps", "4"]) == 1
        resume = ["--resume", "half/closed_loop.json", "--out", "rest"]
        assert run(["mpc", "x.yaml", *quietly, *resume]) == 0
        half, rest = document("half"), document("rest")
        assert rest["reached"]
        assert len(rest["steps"]) > len(half["steps"]) == 5
        for name, one in half["vehicles"].items():
            whole = rest["vehicles"][name]["steps"]
            poses = [step["pose"] for step in one["steps"][:4]]  # before its last noise
            assert [step["pose"] for step in whole[:4]] == poses
        assert run(["check", "rest/closed_loop.json"]) == 0
        capsys.readouterr()
        assert run(["mpc", "x.yaml", "--resume", "nowhere.json"]) == 2
        assert capsys.readouterr().err == "nowhere.json: no such file\n"


@pytest.mark.parametrize(
    "file",
    [
        pytest.param(one, marks=[] if one.stem == "alcove" else pytest.mark.slow)
        for one in SCENARIOS
        if "receding_horizon:" in one.read_text()
    ],
    ids=lambda f: f.stem,
)
def test_every_scenario_with_a_loop(file, folder):
    text = re.sub(r"(fleet: .*time_limit_s: )[0-9.]+", r"\g<1>1.0", file.read_text())
    Path("y.yaml").write_text(text)
    assert run(["mpc", "y.yaml", "--quiet", "--no-plot", "--time-limit", "1"]) == 0
    assert run(["check", "out/closed_loop.json"]) == 0


class TestCheck:
    def test_a_falsified_log_is_caught(self, driven, capsys):
        """One vehicle is shifted onto the other for a step."""
        east, north = (driven["vehicles"][name]["steps"] for name in ("east", "north"))
        for step in east[8:10]:
            step["vehicle_pose"] = next(
                one["vehicle_pose"] for one in north if one["time_s"] == step["time_s"]
            )
        Path("out/closed_loop.json").write_text(json.dumps(driven))
        assert run(["check", "out/closed_loop.json"]) == 1
        rows = [row for row in capsys.readouterr().out.splitlines() if " NO " in row]
        assert any(row.split("NO")[0].strip() == "east and north: apart" for row in rows)

    @pytest.mark.parametrize(
        ("change", "said"),
        [
            (lambda east: east.update(cost=east["cost"] - 1.0), "but the file says"),
            (lambda east: east["steps"][0].update(vehicle_pose=[-3.9, 0, 0]), "beside its start"),
            (
                lambda east: east["steps"][-1].update(vehicle_pose=[3.0, 0.5, 0]),
                "the file says so, but it is elsewhere",
            ),
        ],
    )
    def test_other_claims_that_do_not_hold(self, driven, capsys, change, said):
        change(driven["vehicles"]["east"])
        Path("out/closed_loop.json").write_text(json.dumps(driven))
        assert run(["check", "out/closed_loop.json"]) == 1
        rows = [row for row in capsys.readouterr().out.splitlines() if " NO " in row]
        assert any(said in row for row in rows)

    def test_less_than_the_file_says(self, driven, capsys):
        driven["clearance_m"]["between"] += 0.5
        Path("out/closed_loop.json").write_text(json.dumps(driven))
        assert run(["check", "out/closed_loop.json"]) == 1
        assert "least distance: as the file says" in capsys.readouterr().out

    def test_an_obstacle_that_was_hit(self, driven, capsys):
        Path("x.yaml").write_text(LOOP.replace("center: [0.0, 3.0]", "center: [2.0, 0.0]"))
        assert run(["check", "out/closed_loop.json"]) == 1
        assert "an obstacle is hit" in capsys.readouterr().out

    def test_the_file_it_was_driven_from(self, driven, capsys):
        Path("x.yaml").rename("y.yaml")
        assert run(["check", "out/closed_loop.json"]) == 2
        said = "out/closed_loop.json: source: there is no x.yaml, need --with and that file\n"
        assert capsys.readouterr().err == said
        assert run(["check", "out/closed_loop.json", "--with", "y.yaml"]) == 0

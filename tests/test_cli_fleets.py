"""Files of several vehicles on the command line: plan, check, convert; plan.json and back."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from maneuver_automaton import fleet
from maneuver_automaton.cli import run
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.fleet import FleetProblem, plan_fleet, verify_fleet
from maneuver_automaton.formats.fleet_json import fleet_to_dict, load_fleet, save_fleet
from maneuver_automaton.formats.plan_json import (
    load_plan,
    load_plans,
    plan_to_dict,
    read_plan_document,
)
from maneuver_automaton.scenario import load_scenario
from tests.fleet.fleets import crossing, least_distances
from tests.formats.outside import DATA, needs_data
from tests.formats.test_cl_cbs import PROBLEM
from tests.quickly import quick_are
from tests.scenario.files import SCENARIO

SCENARIOS = sorted((Path(__file__).parents[1] / "scenarios/fleets").glob("*.yaml"))
FLEET = """\
schema: 1
name: A crossing
vehicle: {model: unicycle, footprint: {disc_m: 0.4}}
automaton:
  trims:
    - {name: rest, control: [0.0, 0.0]}
    - {name: ahead, control: [1.0, 0.0]}
    - {name: left, control: [1.0, 1.0]}
    - {name: right, control: [1.0, -1.0]}
obstacles: [{disc_m: {center: [0.0, 3.0], radius: 0.5}}]
vehicles:
  - {name: east, start: {pose: [-4, 0, 0]}, goal: {pose: [4, 0, 0]}}
  - {name: north, start: {pose: [0, -4, 1.5]}, goal: {pose: [0.0, 2.0, 1.5]}}
fleet: {between_m: 0.1, time_limit_s: 1}
"""
QUICK = ("--no-plot", "--time-limit", "60")  # they end by themselves
KEYS = [
    "schema", "version", "kind", "name", "status", "reason", "notes", "objective", "cost",
    "alone_cost", "sum_s", "last_s", "lower_bound", "gap", "clearance_m", "closest", "order",
    "improvements", "timing_s", "counts", "vehicles",
]  # fmt: skip
FILES = {"x.yaml": FLEET}


def document(out="out"):
    return json.loads((Path(out) / "plan.json").read_text(encoding="utf-8"))


class TestPlan:
    def test_files_and_table(self, folder, capsys):
        assert run(["plan", "x.yaml", *QUICK]) == 0
        printed = capsys.readouterr()
        assert printed.err == ""
        found = document()
        assert (found["schema"], found["kind"], found["status"]) == (1, "fleet", "found")
        assert [*found] == [*KEYS, "source"]
        assert found["source"] == {"file": "../x.yaml", "with": None, "case": None}
        assert list(found["vehicles"]) == ["east", "north"]
        east = found["vehicles"]["east"]
        assert east["audit"]["passed"] is True
        arrivals = [one["duration_s"] for one in found["vehicles"].values()]
        assert found["sum_s"] == pytest.approx(sum(arrivals), rel=1e-12)
        assert found["last_s"] == max(arrivals)
        assert found["clearance_m"]["between"] >= 0.1
        assert found["clearance_m"]["to_obstacles"] > 0.0
        assert found["closest"][0]["pair"] == ["east", "north"]
        assert found["lower_bound"] <= found["cost"]
        assert found["timing_s"]["load"] > 0.0
        row = next(line for line in printed.out.splitlines() if line.split()[:1] == ["east"])
        assert row.split()[1:3] == ["found", f"{east['cost']:.6g}"]
        for said in (
            "plans:          2 of 2",
            "sum:",
            "last arrival:",
            "(proven",
            "nearest:",
        ):
            assert said in printed.out

    def test_who_has_no_plan_is_told(self, folder, capsys):
        Path("x.yaml").write_text(FLEET.replace("[0.0, 2.0, 1.5]", "[0.0, 3.0, 1.5]"))
        assert run(["plan", "x.yaml", *QUICK]) == 1
        found, printed = document(), capsys.readouterr()
        assert found["status"] == "partial"
        assert printed.err.startswith("x.yaml: partial: north: ")
        assert "obstacle 'obstacle 1'" in printed.err
        assert printed.err.count("\n") == 1
        assert found["vehicles"]["north"]["primitives"] == []
        assert found["vehicles"]["north"]["cost"] is None
        assert found["gap"] is None
        assert list(load_plans("out/plan.json")) == ["east"]

    def test_interrupted_before_there_was_a_plan(self, folder, capsys, monkeypatch):
        from maneuver_automaton import _interrupts
        from maneuver_automaton.cli import fleets
        from maneuver_automaton.cli.inputs import Options, Parts
        from maneuver_automaton.cli.jobs import Job

        def at_once(*_, **__):
            raise KeyboardInterrupt

        monkeypatch.setattr(fleets, "plan_fleet", at_once)
        job = Job(command="plan", path=Path("x.yaml"), parts=Parts(), options=Options())
        with pytest.raises(KeyboardInterrupt):  # in somebody else's program
            job.done(folder)
        with monkeypatch.context() as meanwhile:
            meanwhile.setattr(fleets, "stopped", lambda: True)
            outcome = job.done(folder)
        said = "interrupted before there was a plan"
        why = f"interrupted before all had a plan: east: {said}; north: {said}"
        assert outcome.complaints == (f"no_plan: {why}",)
        assert document(".")["vehicles"]["north"]["status"] == "out_of_budget"
        assert not _interrupts.stopped()

    def test_pictures(self, folder):
        assert run(["plan", "x.yaml", "--quiet", "--time-limit", "60", "--html"]) == 0
        names = sorted(path.name for path in Path("out").iterdir())
        assert names == ["plan.html", "plan.json", "plan.png"]

    def test_a_folder_of_both_kinds(self, folder, capsys):
        Path("many").mkdir()
        Path("many/fleet.yaml").write_text(FLEET)
        Path("many/one.yaml").write_text(SCENARIO)
        Path("many/cars.yaml").write_text(PROBLEM)
        Path("many/solution.yaml").write_text("statistics: {}\nschedule: {}\n")
        Path("many/wrong.yaml").write_text(FLEET.replace("name: north", "name: east"))
        assert run(["plan", "many", *QUICK]) == 2
        printed = capsys.readouterr()
        assert printed.err.splitlines() == [
            f"{Path('many/cars.yaml')}: {document('out/cars')['status']}: "
            f"{document('out/cars')['reason']}",
            f"{Path('many/wrong.yaml')}:13: vehicles[1].name: got 'east', the name of vehicles[0] "
            "too, need another one",
        ]
        assert "solution" not in printed.out
        assert document("out/fleet")["kind"] == "fleet"
        assert "kind" not in document("out/one")

    @needs_data
    def test_other_formats(self, folder):
        """Planned, proven again from the file, and looked at by shapely at short steps."""
        path = DATA / "fleet" / "cl-cbs/map_50by50_obst25_agents5_ex1.yaml"
        assert run(["plan", str(path), "--no-plot", "--quiet", "--time-limit", "60"]) == 0
        assert document()["status"] == "found"
        assert run(["check", "out/plan.json"]) == 0
        read = load_fleet("out/plan.json", load_scenario(path).fleet)
        between, to_obstacles = least_distances(read)
        assert between > 0.0
        assert to_obstacles > 0.0
        assert between >= read.clearance_m - 1e-9


class TestCheck:
    def test_it_says_who_begins_or_ends_where_nobody_can_be(self, folder, capsys):
        text = FLEET.replace("[0.0, 2.0, 1.5]", "[0.0, 3.0, 1.5]").replace(
            "[-4, 0, 0]", "[0, -3.5, 0]"
        )
        Path("x.yaml").write_text(text + "bounds_m: {x: [-9, 9], y: [-3.8, 9]}\n")
        assert run(["check", "x.yaml"]) == 1
        rows = [row for row in capsys.readouterr().out.splitlines() if " NO " in row]
        assert [row.split("NO")[0].strip() for row in rows] == [
            "north: start: inside the bounds",
            "north: goal: keeps clear of obstacles",
            "starts: are apart",
        ]
        assert "east and north are 0 m apart, need more than 0.1 m" in rows[2]

    def test_plans_are_proven_again(self, folder, capsys):
        assert run(["plan", "x.yaml", "--quiet", *QUICK]) == 0
        assert run(["check", "out/plan.json"]) == 0
        printed = capsys.readouterr().out
        for said in (
            "east: plan",
            "north: plan",
            "every pair: apart",
            "nearest are east and north",
        ):
            assert said in printed
        Path("moved").mkdir()
        Path("out/plan.json").rename("moved/plan.json")
        Path("x.yaml").rename("y.yaml")
        assert run(["check", "moved/plan.json"]) == 2
        said = "moved/plan.json: source: there is no x.yaml, need --with and that file\n"
        assert capsys.readouterr().err == said
        assert run(["check", "moved/plan.json", "--with", "y.yaml"]) == 0

    def test_what_does_not_hold_is_told(self, folder, capsys):
        assert run(["plan", "x.yaml", "--quiet", *QUICK]) == 0
        found = document()
        found["vehicles"]["east"]["cost"] -= 1.0
        Path("out/plan.json").write_text(json.dumps(found))
        Path("x.yaml").write_text(FLEET.replace("between_m: 0.1", "between_m: 3"))
        assert run(["check", "out/plan.json"]) == 1
        rows = [row for row in capsys.readouterr().out.splitlines() if " NO " in row]
        assert "but the file says" in rows[0]
        assert rows[1].split("NO")[0].strip() == "east and north: apart"
        Path("x.yaml").write_text(FLEET.replace("center: [0.0, 3.0]", "center: [0.0, 0.0]"))
        assert run(["check", "out/plan.json"]) == 1
        assert "is hit" in capsys.readouterr().out
        Path("x.yaml").write_text(FLEET.replace("name: east", "name: west"))
        assert run(["check", "out/plan.json"]) == 2
        said = "out/plan.json: plans: there is no vehicle 'east', need some of west, north\n"
        assert capsys.readouterr().err == said

    def test_the_plan_of_one_vehicle(self, folder, capsys):
        Path("one.yaml").write_text(SCENARIO)
        assert run(["plan", "one.yaml", "--quiet", "--no-plot"]) == 0
        assert run(["check", "out/plan.json", "--with", "one.yaml"]) == 0
        assert "cost " in capsys.readouterr().out
        Path("one.yaml").write_text(SCENARIO.replace("[1.0, 1.0, 0.0]", "[1.0, 2.0, 0.0]"))
        assert run(["check", "out/plan.json", "--with", "one.yaml"]) == 1
        assert run(["check", "out/plan.json", "--with", "x.yaml"]) == 2
        said = "x.yaml: states several vehicles, which only plan, mpc, check and convert know\n"
        assert capsys.readouterr().err == said


class TestConvert:
    def test_to_a_scenario_and_again(self, folder):
        Path("cars.yaml").write_text(PROBLEM)
        assert run(["convert", "cars.yaml", "a.yaml"]) == 0
        assert run(["convert", "a.yaml", "b.yaml"]) == 0
        assert Path("a.yaml").read_text() == Path("b.yaml").read_text()
        one, two = (load_scenario(name).fleet for name in ("cars.yaml", "a.yaml"))
        assert one.names == two.names
        for a, b in zip(one.problems, two.problems, strict=True):
            assert a.start.tolist() == b.start.tolist()
            assert a.automaton.controls.tolist() == b.automaton.controls.tolist()


@pytest.fixture(scope="module")
def result():
    return plan_fleet(crossing(), time_limit=20.0, max_rounds=3)


class TestFile:
    def test_a_plan_is_that_of_one_vehicle(self, result):
        found = fleet_to_dict(result, name="two")
        assert [*found] == KEYS
        for name, one in result.results.items():
            assert found["vehicles"][name] == plan_to_dict(one, name=name)

    def test_there_and_back(self, result, tmp_path):
        path = tmp_path / "plan.json"
        save_fleet(result, path, name="two")
        plans = load_plans(path)
        assert list(plans) == ["a", "b"]
        times = np.linspace(0.0, result.last_s, 40)
        for name, plan in result.plans.items():
            read = plans[name]
            assert read.word == plan.word
            assert read.durations.tolist() == plan.durations.tolist()
            within = times[times <= plan.duration]
            np.testing.assert_allclose(read.pose_at(within), plan.pose_at(within), atol=1e-9)
            assert load_plan(path, vehicle=name).word == plan.word
        assert verify_fleet(result.problem, plans).passed
        again = load_fleet(path, result.problem)
        assert (again.status, again.closest, again.order) == (
            result.status, result.closest, result.order
        )  # fmt: skip
        assert (again.sum_s, again.value, again.gap) == (result.sum_s, result.value, result.gap)

    def test_which_vehicle(self, result, tmp_path):
        path = tmp_path / "plan.json"
        save_fleet(result, path)
        with pytest.raises(InvalidScenario, match=r"several vehicles \(a, b\), need that of one"):
            load_plan(path)
        with pytest.raises(InvalidScenario, match=r"several vehicles"):
            read_plan_document(path)
        with pytest.raises(InvalidScenario, match=r"holds no vehicle 'c', but a, b"):
            load_plan(path, vehicle="c")
        with pytest.raises(InvalidScenario, match=r"vehicles: got a, b, need c, d"):
            load_fleet(path, replace(result.problem, names=("c", "d")))

    def test_verify_needs_vehicles_of_the_fleet(self, result):
        with pytest.raises(ValueError, match=r"plans: there is no vehicle 'c', need some of a, b"):
            verify_fleet(result.problem, {"c": result.plans["a"]})

    def test_verify_finds_who_is_hit(self, result):
        """Both alone meet in the middle."""
        fleet = result.problem
        alone = [
            plan_fleet(FleetProblem([one]), time_limit=20.0, max_rounds=0).plans["1"]
            for one in fleet.problems
        ]
        verdict = verify_fleet(fleet, dict(zip(fleet.names, alone, strict=True)))
        assert not verdict.passed
        assert all(one.passed for one in verdict.verdicts.values())
        assert verdict.too_near[0].pair == ("a", "b")
        one_alone = verify_fleet(fleet, {"a": alone[0]})
        assert not one_alone.passed  # b has none


@pytest.mark.parametrize(
    "path",
    quick_are([one for one in SCENARIOS if one.stem not in ("alcove", "forklift_yard")], SCENARIOS),
    ids=lambda path: path.stem,
)
def test_every_scenario_plans(path):
    """Each vehicle alone, then all: found, proven apart, each at its goal."""
    assert path.read_text(encoding="utf-8").startswith("# ")
    scenario = load_scenario(path)
    result = plan_fleet(
        scenario.fleet,
        time_limit=120.0,
        objective=scenario.settings.objective,
        orders=scenario.settings.orders,
        max_rounds=0,
    )
    assert result.status is fleet.FleetStatus.FOUND, result.reasons
    assert result.clearance_m >= scenario.fleet.margin - 1e-9
    for name, problem in zip(scenario.fleet.names, scenario.fleet.problems, strict=True):
        one = result.results[name]
        assert one.audit.passed
        off, turned = problem.goals[one.goal_index].off(one.plan.end)
        assert off <= 1e-8
        assert turned <= 1e-8
        assert one.plan.start_time == problem.start_time


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_every_scenario_goes_to_yaml_and_back(path, tmp_path):
    assert run(["convert", str(path), str(tmp_path / "a.yaml")]) == 0
    assert run(["convert", str(tmp_path / "a.yaml"), str(tmp_path / "b.yaml")]) == 0
    assert (tmp_path / "a.yaml").read_text() == (tmp_path / "b.yaml").read_text()


@pytest.mark.slow
def test_a_fleet_is_planned_on_dask(folder):
    pytest.importorskip("distributed")
    assert run(["plan", "x.yaml", "--quiet", "--no-plot", "--out", "one"]) == 0
    assert run(["plan", "x.yaml", "--quiet", "--no-plot", "--dask", "local", "--out", "two"]) == 0
    one, two = (json.loads(Path(name, "plan.json").read_text()) for name in ("one", "two"))
    assert two["status"] == "found"
    assert two["vehicles"].keys() == one["vehicles"].keys()

"""The command line against its contract: files, exit codes, one line for what is wrong."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest

from maneuver_automaton import planning
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.library import automaton_hash, load_library, save_library
from maneuver_automaton.cli import check_command, run
from maneuver_automaton.cli.terminal import COMPILING
from maneuver_automaton.formats.plan_json import load_plan
from maneuver_automaton.models import rollout
from maneuver_automaton.planning import PlanResult, PlanStatus
from maneuver_automaton.problem import Bounds, Horizon, Problem
from maneuver_automaton.scenario import load_scenario
from tests import translations as vehicles
from tests.scenario.files import SCENARIO, automaton, but

SCENARIOS = Path(__file__).parents[1] / "scenarios"
AMONG = """schema: 1
vehicle: {model: unicycle, footprint: {disc_m: 0.2}}
automaton: {preset: reeds_shepp}
start: {pose: [0.0, 0.0, 0.0]}
goal: {pose: [2.0, 0.0, 0.0]}
margin_m: 0.1
obstacles:
  - {box_m: {center: [1.0, 0.2], size: [0.2, 0.5]}}
"""
AHEAD_ONLY = but("    - {name: spin, control: [0.0, 1.0]}\n", "")
FILES = {"x.yaml": SCENARIO}


def result_file(out: str = "out") -> dict[str, object]:
    """The content of plan.json."""
    return json.loads((Path(out) / "plan.json").read_text())  # type: ignore[no-any-return]


def test_plan_writes_files_and_prints_tables(folder, capsys):
    assert run(["plan", "x.yaml"]) == 0
    assert sorted(path.name for path in Path("out").iterdir()) == ["plan.json", "plan.png"]
    printed = capsys.readouterr().out
    document = result_file()
    for primitive in document["primitives"]:
        assert primitive["name"] in printed
    assert f"{document['cost']:.9g}" in printed
    assert "terminal error" in printed
    assert set(document["timing_s"]) >= {
        "load",
        "automaton",
        "search",
        "first_plan",
        "refine",
        "audit",
    }
    assert document["timing_s"]["load"] > 0.0
    assert document["status"] == "found"
    assert document["reason"] == ""
    assert document["audit"]["passed"] is True
    assert document["terminal_error"]["position_m"] <= 1e-9
    assert document["alternatives"] == []


def test_the_plan_leads_to_the_goal_by_an_ode_solver(folder):
    assert run(["plan", "x.yaml", "--no-plot", "--quiet"]) == 0
    problem = load_scenario("x.yaml").problem
    state = np.array(problem.start)
    document = result_file()
    for primitive in document["primitives"]:
        times = [0.0, primitive["duration_s"]]
        state = rollout(problem.automaton.model, state, control=primitive["control"], times=times)[
            -1
        ]
    assert np.abs(state[:2] - problem.goals[0].pose[:2]).max() <= 1e-7
    assert abs(np.sin((state[2] - problem.goals[0].pose[2]) / 2)) <= 1e-7
    assert load_plan("out/plan.json").word == tuple(p["name"] for p in document["primitives"])
    total = sum(primitive["duration_s"] for primitive in document["primitives"])
    assert total == pytest.approx(document["duration_s"], rel=1e-12)


def test_quiet_prints_nothing(folder, capsys):
    assert run(["plan", "x.yaml", "--quiet", "--no-plot", "--out", "here"]) == 0
    printed = capsys.readouterr()
    assert (printed.out, printed.err) == ("", "")
    assert [path.name for path in Path("here").iterdir()] == ["plan.json"]


@pytest.mark.slow
def test_alternatives_are_listed_and_drawn(folder, capsys):
    assert run(["plan", str(SCENARIOS / "parking.yaml"), "--alternatives", "3"]) == 0
    assert "Alternatives" in capsys.readouterr().out
    alternatives = result_file()["alternatives"]
    assert 1 <= len(alternatives) <= 3
    assert set(alternatives[0]) == {
        "cost",
        "duration_s",
        "word",
        "primitives",
        "terminal_error",
    }
    costs = [result_file()["cost"], *(one["cost"] for one in alternatives)]
    assert costs == sorted(costs)
    assert Path("out/alternatives.png").exists()
    assert run(["plan", "x.yaml", "--quiet"]) == 0
    assert not Path("out/alternatives.png").exists()  # that of the earlier plan is gone


@pytest.mark.parametrize(
    ("text", "status"),
    [
        (SCENARIO + "bounds_m: {x: [1, 5]}\n", "start_blocked"),
        (SCENARIO + "bounds_m: {y: [-1, 0.5]}\n", "goal_blocked"),
        (AHEAD_ONLY, "unreachable"),
        (but("time_s: free, max_trims: 4", "time_s: 0.001"), "unreachable"),
    ],
)
def test_no_plan_is_one_line_and_exit_code_1(folder, capsys, text, status):
    Path("x.yaml").write_text(text)
    assert run(["plan", "x.yaml", "--no-plot", "--quiet"]) == 1
    document = result_file()
    printed = capsys.readouterr()
    assert document["status"] == status
    assert document["reason"]
    assert printed.err == f"x.yaml: {status}: {document['reason']}\n"
    assert printed.out == ""
    assert document["cost"] is None
    assert document["primitives"] == []


def test_start_equal_to_goal_is_an_empty_word(folder):
    Path("x.yaml").write_text(but("[1.0, 1.0, 0.0]", f"[0.0, 0.0, {2 * np.pi}]"))
    assert run(["plan", "x.yaml"]) == 0
    document = result_file()
    assert document["duration_s"] == 0.0
    assert document["cost"] == 0.0
    assert document["primitives"] == []
    assert len(document["trajectory"]["pose"]) == 1
    assert load_plan("out/plan.json").duration == 0.0


@pytest.mark.exhaustive
@pytest.mark.slow
def test_a_flight_among_heights_is_drawn_in_space_too(folder):
    assert run(["plan", str(SCENARIOS / "helicopter_city.yaml"), "--time-limit", "12"]) == 0
    assert result_file()["audit"]["passed"] is True
    assert result_file()["clearance_m"] >= 1.5 - 1e-3
    names = [path.name for path in Path("out").iterdir()]
    assert sorted(names) == ["plan.json", "plan.png", "plan_3d.png"]


@pytest.mark.exhaustive
@pytest.mark.slow
def test_obstacles_are_told_of(folder, capsys):
    Path("x.yaml").write_text(AMONG)
    assert run(["plan", "x.yaml", "--time-limit", "1", "--animate"]) == 0
    assert sorted(path.name for path in Path("out").iterdir()) == [
        "plan.gif",
        "plan.json",
        "plan.png",
    ]
    document = result_file()
    printed = capsys.readouterr().out
    assert document["clearance_m"] >= 0.1 - 1e-9
    assert f"{document['clearance_m']:.3g} m to the nearest obstacle, 0.1 m asked for" in printed
    assert f"(proven: at least {document['lower_bound']:.9g})" in printed
    assert f"expansions {document['counts']['expansions']}, " in printed
    assert "rejected by FCL 0, rejected by audit 0" in printed
    assert "first plan" in printed
    assert "turning points:" in printed


def test_the_shifted_example_has_the_same_plan(folder):
    for name in ("example10", "example10_shifted"):
        assert run(["plan", str(SCENARIOS / f"{name}.yaml"), "--out", name, "--no-plot"]) == 0
    one, two = result_file("example10"), result_file("example10_shifted")
    assert [p["name"] for p in one["primitives"]] == ["slow"]
    for key in ("primitives", "cost", "duration_s"):
        assert one[key] == two[key]


class TestFolder:
    def test_table_and_exit_code_0(self, folder, capsys):
        Path("many").mkdir()
        Path("many/a.yaml").write_text(SCENARIO)
        Path("many/b.yml").write_text(SCENARIO)
        Path("many/notes.txt").write_text("nothing to plan")
        assert run(["plan", "many", "--no-plot"]) == 0
        printed = capsys.readouterr().out
        assert "a.yaml" in printed
        assert "b.yml" in printed
        assert "notes" not in printed
        assert sorted(path.name for path in Path("out").iterdir()) == ["a", "b"]
        assert result_file("out/a")["status"] == "found"

    def test_some_without_a_plan(self, folder, capsys):
        Path("many").mkdir()
        Path("many/a.yaml").write_text(SCENARIO)
        Path("many/b.yaml").write_text(AHEAD_ONLY)
        assert run(["plan", "many", "--no-plot", "--quiet"]) == 1
        reason = result_file("out/b")["reason"]
        printed = capsys.readouterr()
        assert printed.err == f"{Path('many/b.yaml')}: unreachable: {reason}\n"
        assert printed.out == ""

    def test_some_bad(self, folder, capsys):
        Path("many").mkdir()
        Path("many/a.yaml").write_text("schema: 2\n")
        Path("many/b.yaml").write_text(AHEAD_ONLY)
        Path("many/c.yaml").write_text(SCENARIO)
        assert run(["plan", "many", "--no-plot", "--jobs", "2"]) == 2
        printed = capsys.readouterr()
        message = (
            f"{Path('many/a.yaml')}:1: schema: got 2, need 1, the schema that this version reads"
        )
        assert message in printed.err.splitlines()
        assert "bad input" in printed.out
        assert result_file("out/c")["status"] == "found"
        assert not Path("out/a").exists()


class TestAutomaton:
    def test_build_show_draw(self, folder, capsys):
        assert run(["automaton", "build", "x.yaml"]) == 0
        library = load_library("out/library.json")
        assert automaton_hash(library) == automaton_hash(load_scenario("x.yaml").problem.automaton)
        assert automaton_hash(library) in capsys.readouterr().out
        assert run(["automaton", "show", "out/library.json"]) == 0
        printed = capsys.readouterr().out
        assert all(name in printed for name in ("rest", "ahead", "spin"))
        assert "every pose can be reached" in printed
        assert run(["automaton", "draw", "out/library.json", "--out", "trims.png"]) == 0
        assert Path("trims.png").stat().st_size > 1000

    def test_a_scenario_plans_with_its_library(self, folder):
        assert run(["automaton", "build", "x.yaml", "--out", "robot.json"]) == 0
        Path("y.yaml").write_text(automaton("file: robot.json"))
        for name in ("x", "y"):
            assert run(["plan", f"{name}.yaml", "--out", name, "--no-plot", "--quiet"]) == 0
        assert result_file("x")["automaton_hash"] == result_file("y")["automaton_hash"]
        assert result_file("x")["primitives"] == result_file("y")["primitives"]

    def test_a_long_library_is_cut(self, folder, capsys):
        assert run(["automaton", "show", str(SCENARIOS / "grid_1681.yaml")]) == 0
        printed = capsys.readouterr().out
        assert "and 1481 more" in printed


class TestCheck:
    @pytest.mark.slow
    @pytest.mark.parametrize(
        "text", [AHEAD_ONLY, SCENARIO + "bounds_m: {x: [0.5, 5]}\n"], ids=["ahead", "bounds"]
    )
    def test_something_does_not(self, folder, capsys, text):
        Path("x.yaml").write_text(text)
        assert run(["check", "x.yaml"]) == 1
        assert "NO" in capsys.readouterr().out

    @pytest.mark.slow
    def test_it_says_what_is_known_of_a_goal_without_a_plan(self, folder, capsys):
        """A narrow slot, and no time to look for a plan: nothing is proven either way."""
        Path("x.yaml").write_text(
            SCENARIO.replace("time_limit_s: 5.0", "time_limit_s: 1e-6")
            + "obstacles: [{box_m: {center: [0.5, 0.5], size: [0.2, 0.2]}}]\n"
        )
        assert run(["check", "x.yaml"]) == 0
        printed = " ".join(capsys.readouterr().out.split())
        assert "every pose can be reached in free space, by words of any length" in printed
        assert "not known: no plan within 1e-06 s" in printed
        assert "which does not prove that there is none" in printed

    @pytest.mark.slow
    def test_a_library_of_1681_trims(self, folder):
        assert run(["check", str(SCENARIOS / "grid_1681.yaml")]) == 0


def test_convert_lists_the_trims(folder):
    assert run(["convert", str(SCENARIOS / "parking_min_time.yaml"), "new/y.yaml"]) == 0
    assert "{name: spin, control: [0.0, 1.0]}" in Path("new/y.yaml").read_text()
    assert len(load_scenario("new/y.yaml").problem.automaton) == 5


def test_a_page_on_demand(folder, capsys):
    assert run(["plan", "x.yaml", "--quiet", "--html", "--no-plot"]) == 0
    assert sorted(path.name for path in Path("out").iterdir()) == ["plan.html", "plan.json"]
    page = Path("out/plan.html").read_text()
    assert run(["plot", "out/plan.json", "--html", "--out", "a.html"]) == 0
    assert Path("a.html").read_text().startswith("<!doctype html>")
    assert run(["plot", "out/plan.json", "--html", "--animate"]) == 2
    assert capsys.readouterr().err == (
        "--html: writes a page, and --animate an animation; need one of them\n"
    )
    Path("x.yaml").write_text(AHEAD_ONLY)
    assert run(["plan", "x.yaml", "--quiet", "--html", "--no-plot"]) == 1
    assert Path("out/plan.html").read_text() != page  # start and goal, and why there is no plan


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--out", "a.jpg"], "a.jpg: is no picture that this version draws, need an ending of "
         ".png, .pdf, .svg"),
        (["--out", "a.png", "--animate"], "a.png: is no animation that this version draws, need "
         "an ending of .gif"),
        (["--out", "a.png", "--html"], "a.png: is no page that this version draws, need an ending "
         "of .html"),
    ],
)  # fmt: skip
def test_a_picture_has_an_ending_of_one(folder, capsys, options, message):
    run(["plan", "x.yaml", "--no-plot", "--quiet"])
    assert run(["plot", "out/plan.json", *options]) == 2
    assert capsys.readouterr().err == f"{message}\n"


def test_schema_is_json(capsys):
    assert run(["schema"]) == 0
    assert json.loads(capsys.readouterr().out)["title"] == "ScenarioFile"


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch) -> None:
    """A planner that runs out of time."""

    def plan(problem: object, *, time_limit: float, alternatives: int, **more: Any) -> PlanResult:
        assert (time_limit, alternatives) == (0.25, 2)
        assert more == {"gap": None, "watch": None, "on_better": None, "leave": False}
        return PlanResult(
            problem=problem,  # type: ignore[arg-type]
            status=PlanStatus.OUT_OF_BUDGET,
            reason="no plan within 0.25 s",
        )

    monkeypatch.setattr(planning, "plan", plan)


@pytest.mark.usefixtures("stand_in")
def test_options_reach_the_planner(folder, capsys):
    arguments = ["plan", "x.yaml", "--time-limit", "0.25", "--alternatives", "2", "--quiet"]
    assert run(arguments) == 1
    assert capsys.readouterr().err == "x.yaml: out_of_budget: no plan within 0.25 s\n"


@pytest.mark.slow
def test_compiling_is_announced(folder, capsys, monkeypatch):
    plan = planning.plan

    def plan_compiling(*args: Any, **kwargs: Any) -> PlanResult:
        for k in range(2):
            numba.njit(lambda x: x + k)(1.0)  # noqa: B023
        return plan(*args, **kwargs)

    run(["plan", "x.yaml", "--no-plot", "--quiet"])  # the kernels are ready now
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(planning, "plan", plan_compiling)
    for command in (["plan", "x.yaml", "--no-plot"], ["check", "x.yaml"]):
        assert run(command) == 0
        assert capsys.readouterr().err == f"{COMPILING}\n"
    assert run(["plan", "x.yaml", "--no-plot", "--quiet"]) == 0
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("raised", "code", "printed"),
    [
        (KeyboardInterrupt(), 130, ""),
        (
            ZeroDivisionError("division\nby zero"),
            2,
            "internal error: ZeroDivisionError: division by zero; this is a bug of the program, "
            "MANEUVER_AUTOMATON_DEBUG=1 shows where\n",
        ),
    ],
)
def test_no_traceback_reaches_a_user(folder, capsys, monkeypatch, raised, code, printed):
    def plan(*args: object, **kwargs: object) -> None:
        raise raised

    monkeypatch.setattr(planning, "plan", plan)
    assert run(["plan", "x.yaml", "--quiet"]) == code
    assert capsys.readouterr().err == printed


def test_a_wrong_value_of_the_package_itself_does_not_read_as_bad_input(
    folder, capsys, monkeypatch
):
    def plan(*args: object, **kwargs: object) -> None:
        Horizon(max_trims=0)

    monkeypatch.setattr(planning, "plan", plan)
    assert run(["plan", "x.yaml", "--quiet"]) == 2
    assert capsys.readouterr().err.startswith("internal error: ValueError: ")


def test_details_of_a_bug_on_demand(folder, capsys, monkeypatch):
    def plan(*args: object, **kwargs: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(planning, "plan", plan)
    monkeypatch.setenv("MANEUVER_AUTOMATON_DEBUG", "1")
    assert run(["plan", "x.yaml", "--quiet"]) == 2
    assert "Traceback" in capsys.readouterr().err


def test_whoever_stops_reading_gets_no_traceback(folder):
    command = f"{sys.executable} -m maneuver_automaton schema | head -c 10"
    root = str(Path(__file__).parents[1])
    done = subprocess.run(
        command,
        shell=True,
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PYTHONPATH": root},
    )
    assert done.stderr == ""


def test_a_library_in_the_place_of_a_scenario(folder, capsys):
    save_library(load_scenario("x.yaml").problem.automaton, "robot.json")
    assert run(["plan", "robot.json"]) == 2
    assert capsys.readouterr().err == "robot.json:1: is a library of trims, need a scenario\n"


def test_a_plan_in_the_place_of_a_scenario(folder, capsys):
    run(["plan", "x.yaml", "--no-plot", "--quiet"])
    assert run(["check", "out/plan.json"]) == 2
    message = (
        f"{Path('out/plan.json')}: is a plan, which does not state its problem; need --with FILE, "
        "the scenario that it was planned from\n"
    )
    assert capsys.readouterr().err == message
    assert run(["plan", "out/plan.json"]) == 2
    assert capsys.readouterr().err == f"{Path('out/plan.json')}:1: is a plan, need a scenario\n"


def test_check_reports_the_symmetry_that_a_boat_in_a_current_has():
    library = Automaton.of_model(
        vehicles.boat(), {"heading": [0.0, np.pi / 2, np.pi], "speed": [1.0]}
    )
    problem = Problem(library, [0, 0, 0], [3, 1], bounds=Bounds(x=(-5.0, 9.0)))
    found = {finding.what: finding for finding in check_command._symmetry(problem)}
    assert found["symmetry: vector field"].holds
    assert found["symmetry: vector field"].words == "invariant under translation"
    assert found["symmetry: flow"].holds
    assert found["symmetry: bounds"].holds is None
    assert check_command._trims(library).holds

"""The commands on files of other formats: options, folders, conversions; no plan is searched."""

from __future__ import annotations

from pathlib import Path

import pytest

from maneuver_automaton import planning
from maneuver_automaton.cli import run
from maneuver_automaton.formats.movingai import load_movingai_map
from maneuver_automaton.formats.nav2_map import load_nav2_map
from maneuver_automaton.planning import PlanResult, PlanStatus
from maneuver_automaton.scenario import load_scenario
from tests.formats import test_dynobench, test_movingai, test_sbpl_cfg, test_tpcap
from tests.formats.outside import DATA, needs_data
from tests.scenario.files import SCENARIO
from tests.scenario.test_loading import BESIDE

NAV2 = (
    "image: nav.pgm\nresolution: 0.5\norigin: [1, 2, 0]\nnegate: 0\n"
    "occupied_thresh: 0.65\nfree_thresh: 0.25\n"
)


PIXELS = b"P5 4 2 255\n" + bytes([254] * 7 + [0])
FILES = {  # one with files of all kinds
    "many/a.yaml": SCENARIO,
    "many/b.yaml": SCENARIO + "obstacles: [{map: used.yaml}]\n",
    "many/used.pgm": PIXELS,
    "many/used.yaml": NAV2.replace("nav.pgm", "used.pgm"),
    "many/nav.pgm": PIXELS,
    "many/nav.yaml": NAV2,
    "many/Case0.csv": test_tpcap.CASE,
    "many/results.csv": "planner,case\nours,1\n",
    "many/yard.yaml": test_dynobench.PROBLEM,
    "many/unicycle1_v0.yaml": test_dynobench.MODEL,
    "many/solution.yaml": "states: [[0, 0, 0]]\nactions: []\n",
    "many/flat.cfg": test_sbpl_cfg.NAV2D,
    "many/setup.cfg": "[metadata]\nname = x\n",
    "many/room.map": test_movingai.MAP,
    "many/room.map.scen": test_movingai.SCEN,
    "many/hall.map": test_movingai.MAP,
    "many/picture.svg": "<svg/>",
    "many/prims.mprim": "resolution_m: 0.1\n",
    "many/notes.txt": "nothing to plan",
    "many/.hidden.yaml": "nonsense",
    "beside.yaml": BESIDE,
}


@pytest.fixture
def asked(monkeypatch):
    """Problems that a planner is asked for; it finds none."""
    problems = []

    def plan(problem, **options):
        problems.append(problem)
        return PlanResult(problem=problem, status=PlanStatus.NO_PLAN, reason="not tried")

    monkeypatch.setattr(planning, "plan", plan)
    return problems


def quietly(*arguments):
    return run([*map(str, arguments), "--no-plot", "--quiet"])


def test_plan_with_and_case(folder, asked, capsys):
    assert quietly("plan", "many/room.map.scen", "--with", "beside.yaml", "--case", "1") == 1
    (problem,) = asked
    assert problem.start[:2].tolist() == [2.5, 0.5]
    assert problem.margin == 0.05
    assert len(problem.obstacles) == 1
    name = Path("many/room.map.scen")
    assert capsys.readouterr().err == f"{name}: no_plan: not tried\n"


@pytest.mark.parametrize("command", ["plan", "mpc", "check"])
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["many/nav.yaml"], "states no vehicle, start or goal (Nav2 map); need --with and a "
         "scenario that does"),
        (["many/room.map.scen", "--with", "beside.yaml"],
         "holds 2 problems, need --case and a number, 0 to 1"),
        (["many/Case0.csv", "--case", "3"],
         "--case: got 3, but {} holds one problem, need 0 or no case"),
        (["many/yard.yaml", "--with", "many/nav.yaml"],
         "--with: {}:1: the key 'schema' is missing: no scenario, need schema: 1"),
    ],
)  # fmt: skip
def test_what_is_missing_is_one_line(folder, capsys, command, arguments, message):
    assert run([command, *arguments]) == 2
    said = capsys.readouterr().err
    file = Path(arguments[-1 if "{}:1" in message else 0])
    assert said in (f"{file}: {message}\n", message.format(file) + "\n")


@pytest.mark.slow
def test_check_looks_at_the_same_problem(folder, asked, capsys):
    assert run(["check", "many/Case0.csv"]) in (0, 1)
    (problem,) = asked
    assert len(problem.obstacles) == 2
    assert "goal: can be reached" in capsys.readouterr().out


def test_mpc_takes_its_loop_from_beside(folder, capsys, monkeypatch):
    from maneuver_automaton.cli import single

    seen = []

    def simulate(problem, **options):
        seen.append((problem, options["step"]))
        raise ValueError("not tried")

    monkeypatch.setattr(single.receding_horizon, "simulate", simulate)
    assert quietly("mpc", "many/Case0.csv", "--with", "beside.yaml") == 2
    ((problem, step),) = seen
    assert step == 0.5
    assert problem.start.tolist() == [1.0, 2.0, 0.5]
    capsys.readouterr()
    assert quietly("mpc", "many/Case0.csv") == 2
    assert "receding_horizon: missing" in capsys.readouterr().err


class TestFolder:
    def test_plans_what_states_a_problem(self, folder, asked, capsys):
        assert run(["plan", "many", "--with", "beside.yaml", "--case", "1", "--no-plot"]) == 1
        printed = capsys.readouterr()
        names = ["Case0", "a", "b", "flat", "hall", "nav", "room.map", "yard"]
        assert sorted(path.name for path in Path("out").iterdir()) == names
        assert len(asked) == len(names)
        assert printed.err.count("no_plan: not tried") == len(names)
        for name in ("setup", "solution", "results", "used", "picture", "notes", "prims"):
            assert name not in printed.out
        starts = [problem.start[:2].tolist() for problem in asked]
        assert [2.5, 0.5] in starts  # case 1 of the queries

    def test_without_a_scenario_beside_it_some_are_bad(self, folder, asked, capsys):
        assert quietly("plan", "many") == 2
        said = capsys.readouterr().err
        assert "nav.yaml: states no vehicle, start or goal (Nav2 map)" in said
        assert "room.map.scen: holds 2 problems" in said
        assert len(asked) == 4  # a, b, Case0, yard

    def test_the_scenario_beside_is_no_problem_of_its_own(self, folder, asked):
        Path("few").mkdir()
        Path("few/Case0.csv").write_text(test_tpcap.CASE)
        Path("few/beside.yaml").write_text(BESIDE)
        assert quietly("plan", "few", "--with", "few/beside.yaml") == 1
        assert [path.name for path in Path("out").iterdir()] == ["Case0"]

    def test_a_malformed_file_is_told(self, folder, asked, capsys):
        Path("few").mkdir()
        Path("few/Case0.csv").write_text("1,2")
        Path("few/bad.yaml").write_text("a: [")
        Path("few/q.scen").write_text("version 1\n")
        assert quietly("plan", "few") == 2
        said = capsys.readouterr().err
        for name in ("Case0.csv: got 2 numbers", "bad.yaml:2: not valid", "q.scen: holds no query"):
            assert name in said

    @needs_data
    @pytest.mark.parametrize(
        ("name", "n"),
        [
            ("tpcap", 10),
            ("nav2-maps", 4),
            ("movingai", 2),
            ("sbpl/env_examples/nav3d", 2),
            ("dynobench/envs/unicycle1_v0", 3),
            ("car-scenarios", 24),
        ],
    )
    def test_folders_of_benchmarks(self, folder, asked, name, n):
        beside = ["--with", "beside.yaml"] if name.split("/")[0] not in ("dynobench",) else []
        assert quietly("plan", DATA / name, *beside, "--case", "0") == 1
        assert len(asked) == n
        assert all(problem.obstacles for problem in asked)


class TestConvert:
    @pytest.mark.parametrize("name", ["Case0.csv", "yard.yaml", "flat.cfg", "hall.map", "nav.yaml"])
    def test_any_problem_becomes_a_scenario(self, folder, name):
        assert run(["convert", f"many/{name}", "new/x.yaml", "--with", "beside.yaml"]) == 0
        one = load_scenario(Path("many") / name, beside="beside.yaml")
        two = load_scenario("new/x.yaml")
        assert two.problem.start.tolist() == one.problem.start.tolist()
        assert two.footprint == one.footprint
        assert two.problem.bounds == two.problem.bounds
        for a, b in zip(one.problem.obstacles, two.problem.obstacles, strict=True):
            if hasattr(a, "blocked"):
                assert a.blocked.tolist() == b.blocked.tolist()
                assert (a.resolution, a.origin.tolist()) == (b.resolution, b.origin.tolist())
            else:
                assert a.shape.corners.tolist() == b.shape.corners.tolist()
        written = sorted(path.name for path in Path("new").iterdir())
        extra = ["x_map.pgm", "x_map.yaml"] if name in ("flat.cfg", "hall.map") else []
        assert written == ["x.yaml", *extra]

    def test_one_of_several_problems(self, folder):
        options = ["--with", "beside.yaml", "--case", "1"]
        assert run(["convert", "many/room.map.scen", "x.yaml", *options]) == 0
        assert load_scenario("x.yaml").problem.start[:2].tolist() == [2.5, 0.5]

    @pytest.mark.parametrize("name", ["hall.map", "flat.cfg", "nav.yaml"])
    def test_a_map_alone_becomes_a_nav2_map(self, folder, name):
        assert run(["convert", f"many/{name}", "new/grid.yaml"]) == 0
        assert sorted(path.name for path in Path("new").iterdir()) == ["grid.pgm", "grid.yaml"]
        cells = load_nav2_map(Path("new/grid.yaml"))
        assert cells.blocked.any()
        assert not cells.blocked.all()

    @pytest.mark.parametrize("name", ["hall.map", "flat.cfg", "nav.yaml", "b.yaml"])
    def test_a_map_becomes_one_of_movingai_and_comes_back(self, folder, name):
        assert run(["convert", f"many/{name}", "new/grid.map"]) == 0
        cells = load_movingai_map(Path("new/grid.map"))
        assert run(["convert", "new/grid.map", "new/grid.yaml"]) == 0
        assert load_nav2_map(Path("new/grid.yaml")).blocked.tolist() == cells.blocked.tolist()

    @pytest.mark.parametrize(
        ("arguments", "message"),
        [
            (["many/room.map.scen", "x.yaml", "--case", "1"],
             "states no vehicle (MovingAI); need --with and a scenario that does"),
            (["many/room.map.scen", "x.yaml"],
             "holds 2 problems, need --case and a number, 0 to 1"),
            (["many/a.yaml", "x.map"], "states no occupancy map, or several; need one"),
            (["many/nowhere.map", "x.yaml"], "no such file"),
        ],
    )  # fmt: skip
    def test_what_cannot_be_converted(self, folder, capsys, arguments, message):
        assert run(["convert", *arguments]) == 2
        assert capsys.readouterr().err == f"{Path(arguments[0])}: {message}\n"
        assert not Path(arguments[1]).exists()

    def test_where_nothing_can_be_written(self, folder, capsys):
        Path("file").write_text("")
        assert run(["convert", "many/hall.map", "file/grid.yaml"]) == 2
        assert "cannot be written" in capsys.readouterr().err


def test_options_are_told(capsys):
    for command in ("plan", "mpc", "check", "convert"):
        assert run([command, "--help"]) == 0
        printed = capsys.readouterr().out
        assert "--with" in printed
        assert "--case" in printed

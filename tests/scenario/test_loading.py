"""Files of other formats as scenarios: what they state, what comes from beside, which case."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from maneuver_automaton.automaton.library import automaton_hash
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.models import Car, Unicycle
from maneuver_automaton.scenario import load_scenario, scenario_of_text, to_yaml
from maneuver_automaton.scenario.scenario import TPCAP
from tests.formats import test_dynobench, test_movingai, test_sbpl_cfg, test_tpcap
from tests.formats.outside import DATA, needs_data
from tests.scenario.test_scenario import assert_same

SCENARIOS = Path(__file__).parents[2] / "scenarios"
BESIDE = """\
schema: 1
name: Beside
vehicle: {model: unicycle, footprint: {disc_m: 0.2}}
automaton:
  trims:
    - {name: rest, control: [0.0, 0.0]}
    - {name: ahead, control: [0.5, 0.0]}
    - {name: spin, control: [0.0, 0.25]}
start: {pose: [0.5, 0.5, 0.0], trim: rest, time_s: 2.0}
goal:
  - {pose: [1.5, 0.5, 0.0], trim: rest, tolerance_m: 0.1, tolerance_rad: 0.2}
  - {pose: [2.5, 0.5, 0.0]}
cost: {effort: 2.0}
horizon: {max_time_s: 99.0}
bounds_m: {x: [-100, 100], y: [-100, 100]}
margin_m: 0.05
obstacles: [{disc_m: {center: [9, 9], radius: 1}}]
search: {method: lattice, time_limit_s: 3.0, weight: 1.5}
receding_horizon: {step_s: 0.5}
"""


FILES = {  # one file of each format
    "beside.yaml": BESIDE,
    "worlds/notes": "",
    "Case0.csv": test_tpcap.CASE,
    "yard.yaml": test_dynobench.PROBLEM,
    "room.cfg": test_sbpl_cfg.NAV3D,
    "flat.env": test_sbpl_cfg.NAV2D,
    "room.map": test_movingai.MAP,
    "room.map.scen": test_movingai.SCEN,
    "nav.pgm": b"P5 4 4 255\n" + bytes([254] * 15 + [0]),
    "nav.yaml": "image: nav.pgm\nresolution: 0.5\norigin: [1, 2, 0]\nnegate: 0\n"
    "occupied_thresh: 0.65\nfree_thresh: 0.25\n",
}


STATED = [
    ("Case0.csv", None),
    ("yard.yaml", None),
    ("room.cfg", None),
    ("flat.env", None),
    ("room.map.scen", 1),
]
MAPS = ["room.map", "nav.yaml", "nav.yaml"]


@pytest.mark.parametrize(("name", "case"), STATED)
def test_what_the_file_states_wins(folder, name, case):
    scenario = load_scenario(name, beside="beside.yaml", case=case)
    problem = scenario.problem
    assert problem.start[:2].tolist() != [0.5, 0.5] or name == "flat.env"
    (goal,) = problem.goals
    assert goal.pose[:2].tolist() != [1.5, 0.5]
    assert all(getattr(o, "name", "") != "" for o in problem.obstacles)
    assert len(problem.obstacles) <= 2
    stated = name == "yard.yaml"
    assert (scenario.footprint == ({"disc_m": 0.2},)) == (not stated)
    if name == "Case0.csv":
        assert problem.bounds.x == (-100.0, 100.0)
    else:
        assert problem.bounds.x != (-100.0, 100.0)


@pytest.mark.parametrize(("name", "case"), STATED + [(name, None) for name in MAPS])
def test_the_rest_comes_from_beside(folder, name, case):
    scenario = load_scenario(name, beside="beside.yaml", case=case)
    problem = scenario.problem
    assert problem.automaton.trim_names == ("rest", "ahead", "spin")
    assert problem.cost.effort == 2.0
    assert problem.horizon.max_time == 99.0
    assert (problem.start_trim, problem.start_time) == ("rest", 2.0)
    assert (problem.goals[0].trim, problem.goals[0].tolerance_m) == ("rest", 0.1)
    assert problem.margin == 0.05
    assert (problem.search.method, problem.search.weight) == ("lattice", 1.5)
    assert scenario.time_limit_s == 3.0
    assert scenario.receding_horizon.step_s == 0.5
    assert scenario.path == Path(name)
    assert set(scenario.timing_s) == {"load", "automaton"}


def test_start_and_goals_of_a_map_are_those_beside(folder):
    problem = load_scenario("nav.yaml", beside="beside.yaml").problem
    assert problem.start.tolist() == [0.5, 0.5, 0.0]
    assert [goal.pose.tolist()[0] for goal in problem.goals] == [1.5, 2.5]
    assert (problem.bounds.x, problem.bounds.y) == ((1.0, 3.0), (2.0, 4.0))


@pytest.mark.parametrize(("name", "case"), STATED)
def test_a_scenario_beside_needs_no_start_and_goal_where_the_file_states_them(folder, name, case):
    lines = [
        line
        for line in BESIDE.splitlines()
        if not line.startswith(("start:", "goal:", "  - {pose"))
    ]
    Path("bare.yaml").write_text("\n".join(lines) + "\n")
    problem = load_scenario(name, beside="bare.yaml", case=case).problem
    whole = load_scenario(name, beside="beside.yaml", case=case).problem
    np.testing.assert_array_equal(problem.start, whole.start)
    np.testing.assert_array_equal(problem.goals[0].pose, whole.goals[0].pose)
    assert problem.cost == whole.cost or problem.cost.effort == whole.cost.effort


def test_a_map_needs_start_and_goal_beside(folder):
    text = BESIDE[: BESIDE.index("start:")]
    Path("bare.yaml").write_text(text)
    with pytest.raises(InvalidScenario, match=r"--with: bare\.yaml:1: the key 'start' is missing"):
        load_scenario("nav.yaml", beside="bare.yaml")


@pytest.mark.parametrize(("name", "free"), [("room.map.scen", True), ("flat.env", True),
                                            ("Case0.csv", False), ("room.cfg", False)])  # fmt: skip
def test_a_free_heading_is_for_files_that_state_none(folder, name, free):
    text = BESIDE.replace("tolerance_rad: 0.2}", "heading: free}")
    Path("beside.yaml").write_text(text)
    case = 0 if name.endswith("scen") else None
    (goal,) = load_scenario(name, beside="beside.yaml", case=case).problem.goals
    assert goal.free_heading == free


def test_tpcap_alone_is_the_car_of_the_competition(folder):
    scenario = load_scenario("Case0.csv")
    problem = scenario.problem
    assert problem.automaton.model == Car(wheelbase=2.8, max_steering=0.75)
    assert sorted(map(tuple, problem.automaton.controls.tolist())) == [
        (v, s) for v in (-1.0, 1.0) for s in (-0.75, 0.0, 0.75)
    ]
    (body,) = problem.footprint
    np.testing.assert_allclose(body.corners.min(axis=0), [-0.929, -0.971], atol=1e-12)
    np.testing.assert_allclose(body.corners.max(axis=0), [2.8 + 0.96, 0.971], atol=1e-12)
    assert (problem.cost.length, problem.cost.time) == (1.0, 0.0)
    assert problem.goals[0].pose.tolist() == [-3.0, 4.0, -7.5]
    assert scenario.name == "Case0"


def test_the_scenario_of_tpcap_is_what_tpcap_alone_means(folder):
    file, own = load_scenario(SCENARIOS / "tpcap.yaml"), scenario_of_text(TPCAP, name="x")
    assert automaton_hash(file.problem.automaton) == automaton_hash(own.problem.automaton)
    assert file.footprint == own.footprint
    assert file.problem.rates.tolist() == own.problem.rates.tolist()
    alone = load_scenario("Case0.csv")
    assert to_yaml(load_scenario("Case0.csv", beside=SCENARIOS / "tpcap.yaml")) == to_yaml(alone)


def test_dynobench_alone_is_its_own_model(folder):
    problem = load_scenario("yard.yaml").problem
    assert problem.automaton.model == Unicycle(max_speed=0.5, max_turn_rate=0.5)
    assert len(problem.automaton) == 9
    assert (problem.cost.time, problem.cost.length) == (1.0, 0.0)
    assert problem.horizon.time is None
    assert problem.goals[0].tolerance_m == 0.0


def test_trims_beside_are_for_the_vehicle_of_the_file(folder):
    problem = load_scenario("yard.yaml", beside="beside.yaml").problem
    assert problem.automaton.model == Unicycle(max_speed=0.5, max_turn_rate=0.5)
    assert problem.footprint[0].size.tolist() == [0.5, 0.25]


@pytest.mark.parametrize(
    ("old", "new", "robot", "message"),
    [
        ("[0.5, 0.0]", "[0.6, 0.0]", "unicycle1_v0", "yard.yaml: its vehicle is unicycle1_v0, but "
         "trim 'ahead' of the scenario of --with has speed 0.6, need -0.5 to 0.5"),
        ("name: Beside", "name: Beside", "unicycle1_v2", "yard.yaml: its vehicle is unicycle1_v2, "
         "but trim 'rest' of the scenario of --with has speed 0, need 0.25 to 0.5"),
        ("model: unicycle", "model: car, wheelbase_m: 2", "unicycle1_v0", "yard.yaml: its vehicle "
         "is unicycle1_v0, a unicycle, but the scenario of --with has a car; need the same"),
    ],
)  # fmt: skip
def test_trims_that_the_vehicle_of_the_file_cannot_drive(folder, old, new, robot, message):
    Path("beside.yaml").write_text(BESIDE.replace(old, new))
    Path("yard.yaml").write_text(test_dynobench.PROBLEM.replace("unicycle1_v0", robot))
    with pytest.raises(InvalidScenario) as error:
        load_scenario("yard.yaml", beside="beside.yaml")
    assert str(error.value) == message


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("nav.yaml", {}, "nav.yaml: states no vehicle, start or goal (Nav2 map); need --with and "
         "a scenario that does"),
        ("room.map", {}, "room.map: states no vehicle, start or goal (MovingAI map); need --with "
         "and a scenario that does"),
        ("room.cfg", {}, "room.cfg: states no vehicle (SBPL); need --with and a scenario that "
         "does"),
        ("room.map.scen", {},
         "room.map.scen: holds 2 problems, need --case and a number, 0 to 1"),
        ("room.map.scen", {"case": 2},
         "--case: got 2, but room.map.scen holds 2 problems, need 0 to 1"),
        ("room.map.scen", {"case": -1},
         "--case: got -1, but room.map.scen holds 2 problems, need 0 to 1"),
        ("Case0.csv", {"case": 1},
         "--case: got 1, but Case0.csv holds one problem, need 0 or no case"),
        ("beside.yaml", {"case": 1},
         "--case: got 1, but beside.yaml holds one problem, need 0 or no case"),
        ("beside.yaml", {"beside": "beside.yaml"}, "--with: serves formats that state a part of a "
         "problem, but beside.yaml is a scenario, which states all of it"),
        ("Case0.csv", {"beside": "nowhere.yaml"}, "--with: nowhere.yaml: no such file"),
        ("Case0.csv", {"beside": "nav.yaml"},
         "--with: nav.yaml:1: the key 'schema' is missing: no scenario, need schema: 1"),
        ("nav.pgm", {}, "nav.pgm: is the image of a map, need the YAML file that states its "
         "resolution"),
        ("x.xml", {}, "x.xml: no such file"),
        ("nowhere.csv", {}, "nowhere.csv: no such file"),
        ("nowhere.scen", {}, "nowhere.scen: no such file"),
        ("nowhere.svg", {}, "nowhere.svg: no such file"),
        ("nowhere.png", {}, "nowhere.png: no such file"),
        ("worlds", {}, "worlds: is a folder, need a file"),
    ],
)  # fmt: skip
def test_what_is_missing(folder, name, options, message):
    with pytest.raises(InvalidScenario) as error:
        load_scenario(name, **options)
    assert str(error.value) == message


def test_a_model_is_no_problem(folder):
    Path("model.yaml").write_text(test_dynobench.MODEL)
    with pytest.raises(InvalidScenario) as error:
        load_scenario("model.yaml")
    assert str(error.value) == (
        "model.yaml:1: is a model or a solution of dynobench, need the problem "
        "(environment, robots)"
    )


@pytest.mark.parametrize("name", ["Case0.csv", "room.cfg", "flat.env", "yard.yaml", "nav.yaml"])
def test_case_0_of_a_file_with_one_problem(folder, name):
    assert load_scenario(name, beside="beside.yaml", case=0).problem.start.size == 3


def test_a_map_stays_a_reference_when_it_is_the_file(folder):
    scenario = load_scenario("nav.yaml", beside="beside.yaml")
    text = to_yaml(scenario)
    assert "  - {map: nav.yaml}\n" in text.replace('"', "")
    Path("again.yaml").write_text(text)
    again = load_scenario("again.yaml")
    assert to_yaml(again) == text


@needs_data
@pytest.mark.parametrize("name", ["tpcap/Case18.csv",
                                  "dynobench/envs/unicycle1_v0/bugtrap_0.yaml",
                                  "dynobench/envs/unicycle1_v2/wall_0.yaml"])  # fmt: skip
def test_problems_go_to_yaml_and_back(name):
    scenario = load_scenario(DATA / name)
    assert_same(scenario_of_text(to_yaml(scenario), name="x"), scenario)

"""What a scenario file means: defaults, grids, presets, libraries; and the way back."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.library import automaton_hash, save_library
from maneuver_automaton.collision import OccupancyMap
from maneuver_automaton.costs import Cost
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.models import Car, Unicycle
from maneuver_automaton.problem import Bounds, Goal, Horizon, Problem, SearchSettings
from maneuver_automaton.scenario import Scenario, json_schema, scenario_of_text, to_yaml
from tests.scenario.files import SCENARIO, automaton, but, grid

SCENARIOS = sorted((Path(__file__).parents[2] / "scenarios").glob("*.yaml"))
MINIMAL = """\
schema: 1
vehicle: {model: unicycle}
automaton: {preset: table2}
start: {pose: [0, 1, 0]}
goal: {pose: [0, 0, 0]}
"""
BARE = SCENARIO[: SCENARIO.index("cost:")]


def read(text: str) -> Scenario:
    return scenario_of_text(text, name="x.yaml")


def test_what_is_left_out():
    scenario = read(MINIMAL)
    problem = scenario.problem
    assert scenario.name == "x.yaml"
    assert scenario.time_limit_s == 5.0
    assert scenario.footprint == ()
    assert problem.margin == 0.0
    assert problem.obstacles == ()
    assert problem.footprint == ()
    assert isinstance(problem.cost, Cost)
    assert problem.cost.time == 1.0
    assert not any(getattr(problem.cost, name) for name in ("effort", "norm", "length", "switch"))
    assert problem.horizon.time is None
    assert problem.horizon.max_trims is None
    assert problem.horizon.max_time is None
    assert problem.horizon.min_coast == 0.0
    assert asdict(problem.bounds) == asdict(Bounds())
    assert asdict(problem.search) == asdict(SearchSettings())
    assert problem.start_trim is None
    assert problem.start_time == 0.0
    goal = problem.goals[0]
    assert (goal.trim, goal.free_heading, goal.tolerance_m, goal.tolerance_rad) == (
        None,
        False,
        0.0,
        0.0,
    )


def test_what_is_stated():
    problem = read(
        BARE.replace("[0.0, 0.0, 0.0]}", "[0.0, 0.0, 0.0], trim: spin, time_s: 2.5}").replace(
            "goal: {pose: [1.0, 1.0, 0.0]}",
            "goal:\n"
            "  - {pose: [1, 1, 0], trim: ahead}\n"
            "  - {pose: [2, 2, 0], heading: free, tolerance_m: 0.1, tolerance_rad: 0.2}",
        )
        + "cost: {norm: 2, norm_order: inf, effort: 1, effort_matrix: [[2, 0], [0, 1]]}\n"
        + "horizon: {time_s: 8, max_trims: 4, min_coast_s: 0.5}\n"
        + "bounds_m: {x: [-5, 5]}\n"
        + "search: {method: words, max_expansions: 9, time_limit_s: 1}\n"
    ).problem
    assert problem.start_trim == "spin"
    assert problem.start_time == 2.5
    assert problem.goals[0].trim == "ahead"
    assert problem.goals[1].free_heading
    assert problem.goals[1].tolerance_m == 0.1
    assert problem.goals[1].tolerance_rad == 0.2
    assert isinstance(problem.cost, Cost)
    assert problem.cost.norm_order == math.inf
    assert problem.cost.effort_matrix is not None
    assert problem.cost.effort_matrix.tolist() == [[2.0, 0.0], [0.0, 1.0]]
    assert asdict(problem.horizon) == asdict(Horizon(time=8.0, max_trims=4, min_coast=0.5))
    assert asdict(problem.bounds) == asdict(Bounds(x=(-5.0, 5.0)))
    assert asdict(problem.search) == asdict(SearchSettings(method="words", max_expansions=9))


@pytest.mark.parametrize("order", ["1", "2", "inf", "1.0", ".inf"])
def test_norm_orders(order):
    cost = read(but("effort: 1.0", f"norm: 1.0, norm_order: {order}")).problem.cost
    assert isinstance(cost, Cost)
    assert cost.norm_order == float(order.removeprefix("."))


def test_a_car_with_a_footprint_of_two_shapes():
    scenario = read(
        but(
            "{model: unicycle}",
            "{model: car, wheelbase_m: 2.5, max_steering_rad: 0.5, max_speed_m_s: 3,\n"
            "  footprint: [{rectangle_m: [4, 2], reference_m: [-1, 0]}, {disc_m: 1}]}",
        ).replace("control: [0.0, 1.0]", "control: [1.0, 0.4]")
    )
    assert scenario.problem.automaton.model == Car(wheelbase=2.5, max_steering=0.5, max_speed=3.0)
    assert scenario.footprint == (
        {"rectangle_m": (4.0, 2.0), "reference_m": (-1.0, 0.0)},
        {"disc_m": 1.0},
    )


def test_a_grid_holds_the_numbers_one_would_write():
    axis = "{min: -2, max: 2, step: 0.1}"
    library = read(grid(f"[{axis}, {axis}]")).problem.automaton
    assert len(library) == 1681
    assert sorted(set(library.controls[:, 0].tolist())) == [k / 10 for k in range(-20, 21)]
    assert library.rest is not None


@pytest.mark.parametrize(
    ("axis", "values"),
    [
        ("{min: 0, max: 1, count: 3}", [0.0, 0.5, 1.0]),
        ("{min: 0, max: 0.9, count: 4}", [0.0, 0.3, 0.6, 0.9]),
        ("{min: 0, max: 0.3, step: 0.1}", [0.0, 0.1, 0.2, 0.3]),
        ("{min: 0, max: 1, step: 0.3}", [0.0, 0.3, 0.6, 0.9]),
        ("{min: 2, max: 2, step: 1}", [2.0]),
        ("{min: 2, max: 2, count: 1}", [2.0]),
        ("{min: 1e-6, max: 3e-6, step: 1e-6}", [1e-6, 2e-6, 3e-6]),
    ],
)
def test_values_of_an_axis(axis, values):
    library = read(grid(f"[{axis}, {{min: 0, max: 0, count: 1}}]")).problem.automaton
    assert library.controls[:, 0].tolist() == values


@pytest.mark.parametrize(("preset", "n"), [("table2", 5), ("dubins", 3), ("reeds_shepp", 6)])
def test_presets_of_the_unicycle(preset, n):
    library = read(automaton(f"preset: {preset}")).problem.automaton
    assert len(library) == n
    if preset != "table2":
        assert set(np.abs(library.body_velocities[:, 0])) == {1.0}
        assert set(np.abs(library.body_velocities[:, 2])) == {0.0, 1.0}


def test_reeds_shepp_of_a_car_has_the_tightest_circles():
    text = automaton("preset: reeds_shepp").replace(
        "{model: unicycle}", "{model: car, wheelbase_m: 2.0, max_steering_rad: 0.5}"
    )
    library = read(text).problem.automaton
    radius = 2.0 / math.tan(0.5)
    turn = library.body_velocities[:, 2]
    assert np.sort(turn) * radius == pytest.approx([-1.0, -1.0, 0.0, 0.0, 1.0, 1.0])
    assert library["reverse left"].body_velocity[2] < 0.0 < library["left"].body_velocity[2]


def test_a_library_file_is_found_beside_the_scenario(tmp_path):
    robot = Automaton.of_controls(Unicycle(), {"ahead": (1.0, 0.0), "spin": (0.0, 1.0)})
    save_library(robot, tmp_path / "robot.json")
    (tmp_path / "x.yaml").write_text(automaton("file: robot.json"))
    from maneuver_automaton.scenario import load_scenario

    assert automaton_hash(load_scenario(tmp_path / "x.yaml").problem.automaton) == automaton_hash(
        robot
    )


def test_a_library_of_another_vehicle(folder):
    save_library(Automaton.of_controls(Car(wheelbase=2.0), {"ahead": (1.0, 0.0)}), "car.json")
    with pytest.raises(InvalidScenario) as error:
        read(automaton("file: car.json"))
    assert str(error.value) == (
        "x.yaml:5: automaton.file: got a library for {model: 'car', wheelbase_m: 2.0}, but the "
        "vehicle is {model: 'unicycle'}"
    )


def test_a_library_that_was_changed(folder):
    robot = Automaton.of_controls(Unicycle(), {"ahead": (1.0, 0.0)})
    save_library(robot, "robot.json")
    path = Path("robot.json")
    path.write_text(path.read_text().replace('"ahead"', '"forward"'))
    with pytest.raises(InvalidScenario) as error:
        read(automaton("file: robot.json"))
    changed = Automaton.of_controls(Unicycle(), {"forward": (1.0, 0.0)})
    assert str(error.value) == (
        f"x.yaml:5: automaton.file: robot.json: hash: got {automaton_hash(robot)!r}, but the "
        f"content has {automaton_hash(changed)!r}: the file was changed after it was written; to "
        'accept it as it is, delete the line "hash"'
    )


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_shipped_scenarios_go_to_yaml_and_back(path, tmp_path):
    from maneuver_automaton.scenario import load_scenario

    assert path.read_text().startswith("# ")
    scenario = load_scenario(path)
    again = tmp_path / "again.yaml"
    again.write_text(to_yaml(scenario, folder=tmp_path))
    assert_same(load_scenario(again), scenario)


def assert_same(a: Scenario, b: Scenario) -> None:
    """Everything a file states agrees to the last bit."""
    root = Path("/")
    assert to_yaml(a, folder=root) == to_yaml(b, folder=root)
    one, two = a.problem, b.problem
    assert (a.name, a.time_limit_s, one.margin) == (b.name, b.time_limit_s, two.margin)
    assert a.footprint == b.footprint
    assert [solid(x) for x in one.obstacles] == [solid(x) for x in two.obstacles]
    assert automaton_hash(one.automaton) == automaton_hash(two.automaton)
    assert one.start.tolist() == two.start.tolist()
    assert (one.start_trim, one.start_time) == (two.start_trim, two.start_time)
    assert [goal.pose.tolist() for goal in one.goals] == [goal.pose.tolist() for goal in two.goals]
    assert one.rates.tolist() == two.rates.tolist()
    for part in ("horizon", "bounds", "search"):
        assert asdict(getattr(one, part)) == asdict(getattr(two, part))


def solid(obstacle: Any) -> Any:
    """The numbers of an obstacle, as lists."""
    if isinstance(obstacle, OccupancyMap):
        return obstacle.blocked.tolist(), obstacle.resolution, obstacle.origin.tolist()
    shape = obstacle.shape
    fields = {name: getattr(shape, name) for name in type(shape).__dataclass_fields__}
    motion = obstacle.motion and (obstacle.motion.time.tolist(), obstacle.motion.pose.tolist())
    return type(shape), str(fields), obstacle.height, motion


positive = st.floats(1e-3, 1e3)
number = st.floats(-1e6, 1e6)
poses = st.tuples(number, number, number)


@st.composite
def scenarios(draw: st.DrawFn) -> Scenario:
    names = draw(st.lists(st.text(min_size=1).filter(str.strip), min_size=1, unique=True))
    driven = st.tuples(st.floats(-1e3, 1e3), st.floats(-1.0, 1.0)).filter(  # within the limits
        lambda control: all(abs(one) > 1e-99 for one in control if one)
    )
    controls = {name: draw(driven) for name in names}
    robot = Automaton.of_controls(Unicycle(), controls)
    goals = tuple(
        Goal(
            pose=np.array(pose),
            trim=draw(st.none() | st.sampled_from(names)),
            free_heading=draw(st.booleans()),
            tolerance_m=draw(st.floats(0.0, 1.0)),
        )
        for pose in draw(st.lists(poses, min_size=1, max_size=3))
    )
    fixed = draw(st.booleans())
    return Scenario(
        name=draw(st.text()),
        problem=Problem(
            robot,
            np.array(draw(poses)),
            goals,
            cost=Cost(
                effort=draw(positive),
                switch=draw(st.floats(0.0, 1.0)),
                norm_order=draw(st.sampled_from([1.0, 2.0, math.inf])),
            ),
            horizon=Horizon(
                time=draw(positive) if fixed else None,
                max_time=None if fixed else draw(st.none() | positive),
                max_trims=draw(st.none() | st.integers(1, 9)),
            ),
            start_trim=draw(st.none() | st.sampled_from(names)),
            start_time=draw(number),
            bounds=Bounds(y=draw(st.none() | st.just((-1.5, 1e7)))),
            search=SearchSettings(
                method="lattice", cell=draw(st.none() | positive), headings=8, weight=1.5
            ),
            margin=draw(st.floats(0.0, 1.0)),
        ),
        time_limit_s=draw(positive),
    )


@given(scenarios())
def test_any_scenario_goes_to_yaml_and_back(scenario):
    assert_same(read(to_yaml(scenario)), scenario)


def test_what_a_file_cannot_state():
    class Free:
        def rates(self, controls, body_velocities):
            return np.ones(len(controls))

        def switching(self, body_velocities):
            return 0.0

    robot = Automaton.of_controls(Unicycle(), {"ahead": (1.0, 0.0)})
    problem = Problem(robot, [0, 0, 0], [1, 0, 0], cost=Free())
    missing = r"^cost: a scenario file can state the terms .* need its method terms\(\), which"
    with pytest.raises(ValueError, match=missing):
        to_yaml(Scenario(name="x", problem=problem))


def test_the_json_schema_knows_every_key():
    schema = json_schema()
    assert [kind["required"] for kind in schema["oneOf"]] == [
        ["schema", "vehicle", "automaton", "start", "goal"],
        ["schema", "vehicles"],
    ]
    assert "null" not in str(schema)
    assert schema["$defs"]["HorizonPart"]["properties"].keys() == {
        "time_s",
        "max_trims",
        "min_coast_s",
        "max_time_s",
        "stay",
    }

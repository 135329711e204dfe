"""Scenarios of several vehicles: what an entry leaves out stands at the top; there and back."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maneuver_automaton.cli import run
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.fleet import FleetProblem
from maneuver_automaton.formats.yaml_source import parse
from maneuver_automaton.models import Car, Unicycle
from maneuver_automaton.scenario import (
    FleetScenario,
    load_scenario,
    scenario_of_text,
    to_yaml,
)
from maneuver_automaton.scenario.fleet import FleetPart, fleet_of_document
from tests.formats.outside import message_of
from tests.formats.test_cl_cbs import PROBLEM
from tests.quickly import draws
from tests.scenario.test_scenario import assert_same, scenarios

FLEET = """\
schema: 1
name: Two carts and a tug
vehicle: {model: unicycle, footprint: {rectangle_m: [0.8, 0.6]}}
automaton:
  trims:
    - {name: rest, control: [0.0, 0.0]}
    - {name: ahead, control: [1.0, 0.0]}
    - {name: left, control: [0.8, 0.8]}
    - {name: right, control: [0.8, -0.8]}
cost: {time: 1.0, length: 0.1}
bounds_m: {x: [-20.0, 20.0]}
margin_m: 0.05
obstacles:
  - {box_m: {center: [4.0, 3.0], size: [3.0, 1.0]}}
vehicles:
  - {name: a, start: {pose: [0, 0, 0]}, goal: {pose: [9, 0, 0]}}
  - {name: b, start: {pose: [9, 1, 3.0]}, goal: {pose: [0, 1, 3.0]}, priority: 1, start_time_s: 2}
  - name: tug
    vehicle: {model: car, wheelbase_m: 1.0, max_steering_rad: 0.5}
    automaton: {preset: reeds_shepp}
    start: {pose: [4, -4, 0]}
    goal: [{pose: [8, -4, 0]}, {pose: [8, -5, 0]}]
    bounds_m: {}
    obstacles: []
    leaves: true
fleet: {objective: last, between_m: 0.1, orders: 4, time_limit_s: 7}
receding_horizon: {step_s: 0.5}
"""
ALONE = """\
schema: 1
name: a
vehicle: {model: unicycle, footprint: {rectangle_m: [0.8, 0.6]}}
automaton:
  trims:
    - {name: rest, control: [0.0, 0.0]}
    - {name: ahead, control: [1.0, 0.0]}
    - {name: left, control: [0.8, 0.8]}
    - {name: right, control: [0.8, -0.8]}
cost: {time: 1.0, length: 0.1}
bounds_m: {x: [-20.0, 20.0]}
margin_m: 0.05
obstacles:
  - {box_m: {center: [4.0, 3.0], size: [3.0, 1.0]}}
start: {pose: [0, 0, 0]}
goal: {pose: [9, 0, 0]}
"""
TOP = (
    "schema, name, vehicle, automaton, cost, horizon, bounds_m, margin_m, obstacles, zones, "
    "search, vehicles, fleet, receding_horizon"
)
ENTRY = (
    "name, priority, leaves, start_time_s, vehicle, automaton, start, goal, cost, horizon, "
    "bounds_m, margin_m, obstacles, zones, search, receding_horizon"
)


def read(text: str) -> FleetScenario:
    return fleet_of_document(parse(text, name="fleet"), path=None, begin=0.0)


def but(old: str, new: str) -> str:
    assert FLEET.count(old) == 1, old
    return FLEET.replace(old, new)


def test_what_a_file_states():
    scenario = read(FLEET)
    fleet = scenario.fleet
    assert (scenario.name, fleet.names) == ("Two carts and a tug", ("a", "b", "tug"))
    assert (fleet.margin, fleet.leaves) == (0.1, (False, False, True))
    assert fleet.priority == (0.0, 1.0, 0.0)
    assert [one.start_time for one in fleet.problems] == [0.0, 2.0, 0.0]
    assert scenario.settings == FleetPart(
        objective="last", between_m=0.1, orders=4, time_limit_s=7.0
    )
    assert scenario.time_limit_s == 7.0
    assert scenario.receding_horizon.step_s == 0.5


def test_an_entry_has_what_stands_at_the_top():
    a, b, tug = read(FLEET).fleet.problems
    assert a.automaton is b.automaton  # whatever is equal is made once
    assert a.obstacles is b.obstacles
    assert a.footprint[0] is b.footprint[0]
    assert a.cost is b.cost
    assert isinstance(a.automaton.model, Unicycle)
    assert isinstance(tug.automaton.model, Car)
    assert (tug.obstacles, tug.footprint, tug.bounds.are_open) == ((), (), True)
    assert (tug.margin, len(tug.goals)) == (0.05, 2)
    assert asdict(tug.cost) == asdict(a.cost)


def test_a_vehicle_is_that_of_a_file_of_its_own():
    assert_same(read(FLEET).vehicles[0], scenario_of_text(ALONE, name="a"))


def test_what_is_left_out():
    text = but("name: a, ", "").replace(FLEET[FLEET.index("fleet:") :], "")
    scenario = read(text.replace("name: Two carts and a tug\n", ""))
    assert scenario.name == "fleet"
    assert scenario.fleet.names == ("1", "b", "tug")
    assert scenario.fleet.margin == 0.05  # the greatest margin of a vehicle
    assert scenario.settings == FleetPart()
    assert scenario.receding_horizon is None


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("goal: {pose: [9, 0, 0]}", "gaol: {}", ":16: vehicles[0].gaol: unknown key; did you mean "
         f"'goal'? Known keys: {ENTRY}"),
        (", goal: {pose: [9, 0, 0]}", "", ":16: vehicles[0]: the key 'goal' is missing, need goal: "
         "a mapping {pose, ...}, or a list of these"),
        ("name: b", "name: a",
         ":17: vehicles[1].name: got 'a', the name of vehicles[0] too, need another one"),
        ("name: b", "name: '3'", None),
        ("start_time_s: 2", "start_time_s: x",
         ":17: vehicles[1].start_time_s: got 'x', need a finite number"),
        ("start: {pose: [9, 1, 3.0]}", "start: {pose: [9, 1, 3.0], time_s: 1}",
         ":17: vehicles[1].start_time_s: the start has a time_s too, need one of them"),
        ("priority: 1", "priority: high",
         ":17: vehicles[1].priority: got 'high', need a finite number"),
        ("leaves: true", "leaves: 1", ":25: vehicles[2].leaves: got 1, need true or false"),
        ("{model: car, ", "{model: cat, ", ":19: vehicles[2].vehicle.model: got 'cat', need one of "
         "unicycle, car, second_order_unicycle, second_order_car, accelerating_car, "
         "car_with_trailer, single_track, "
         "hovercraft, helicopter, lattice_body, omnidirectional, rear_steered_car, "
         "four_wheel_steering_car, articulated_vehicle, tractor_with_trailers; did you mean "
         "'car'? A vehicle of your own needs --model MODULE:OBJECT"),
        ("preset: reeds_shepp", "preset: table2", ":20: vehicles[2].automaton.preset: got "
         "'table2', which is for the unicycle, not the car"),
        ("pose: [4, -4, 0]", "pose: [4, -4, 0, 1]",
         ":21: vehicles[2].start.pose: got 4 numbers, need 3: [x, y, heading]"),
        ("{pose: [8, -5, 0]}", "{pose: [8, -5, 0], trim: lft}", ":22: vehicles[2].goal[1].trim: no "
         "trim 'lft' among left, straight, right, reverse left, reverse straight, reverse right; "
         "did you mean 'left'?"),
        ("control: [0.8, 0.8]", "control: [0.8]",
         ":8: automaton.trims[2].control: got [0.8], need a list of 2 numbers (speed, turn_rate)"),
        ("length: 0.1", "lngth: 0.1", ":10: cost.lngth: unknown key; did you mean 'length'? Known "
         "keys: effort, norm, time, effort_matrix, norm_order, length, switch, "
         "direction_change, clearance, ground"),
        ("margin_m: 0.05", "horizon: {time_s: 5.0}",
         ":12: horizon.time_s: got 5, need free: vehicles that give way arrive later"),
        ("leaves: true", "horizon: {time_s: 5.0}",
         ":25: vehicles[2].horizon.time_s: got 5, need free: vehicles that give way arrive later"),
        ("margin_m: 0.05", "start: {pose: [0, 0, 0]}",
         ":12: start: stands beside vehicles, need it in each of them instead"),
        ("between_m: 0.1", "between_m: -1",
         ":26: fleet.between_m: got -1, need a finite number of at least 0"),
        ("objective: last", "objective: best",
         ":26: fleet.objective: got 'best', need sum or last"),
        ("orders: 4", "order: 4", ":26: fleet.order: unknown key; did you mean 'orders'? Known "
         "keys: objective, between_m, orders, time_limit_s"),
        ("vehicles:", "vehicle_s:",
         f":15: vehicle_s: unknown key; did you mean 'vehicles'? Known keys: {TOP}"),
        (FLEET[FLEET.index("vehicles:"):FLEET.index("fleet:")], "vehicles: []\n",
         ":15: vehicles: got [], need a list of at least one vehicle"),
        (FLEET[FLEET.index("vehicles:"):FLEET.index("fleet:")], "",
         ":1: the key 'vehicles' is missing, need vehicles: a list of {name, start, goal, ...}"),
        ("vehicle: {model: unicycle, footprint: {rectangle_m: [0.8, 0.6]}}\n", "",
         ":15: vehicles[0]: the key 'vehicle' is missing here and at the top, need vehicle: a "
         "mapping {model, ...}"),
        ("size: [3.0, 1.0]", "size: [3.0, 0.0]",
         ":14: obstacles[0].box_m.size[1]: got 0.0, need a positive number"),
        ("schema: 1", "schema: 2", ":1: schema: got 2, need 1, the schema that this version reads"),
    ],
)  # fmt: skip
def test_what_is_wrong(tmp_path, old, new, message):
    path, text = tmp_path / "x.yaml", but(old, new)
    if message is None:
        path.write_text(text)
        load_scenario(path)
    else:
        assert message_of(load_scenario, path, text) == message


def test_the_number_of_another_one_is_no_name():
    text = but("name: a, ", "").replace("name: b", "name: '1'")
    with pytest.raises(InvalidScenario, match=r"vehicles\[1\].name: got '1', the name of vehicles"):
        read(text)


def test_a_plan_is_no_scenario(tmp_path):
    text = '{"schema": 1, "kind": "fleet", "status": "found", "vehicles": {}}'
    said = message_of(load_scenario, tmp_path / "plan.yaml", text)
    assert said == ":1: is plans of a fleet, need a scenario"


def assert_same_fleet(a: FleetScenario, b: FleetScenario) -> None:
    """Everything a file states agrees to the last bit."""
    assert to_yaml(a, folder=Path("/")) == to_yaml(b, folder=Path("/"))
    assert (a.name, a.fleet.names, a.fleet.margin) == (b.name, b.fleet.names, b.fleet.margin)
    assert (a.fleet.leaves, a.fleet.priority) == (b.fleet.leaves, b.fleet.priority)
    for key in ("objective", "orders", "time_limit_s"):
        assert getattr(a.settings, key) == getattr(b.settings, key)
    for one, two in zip(a.vehicles, b.vehicles, strict=True):
        assert_same(one, two)


def test_to_yaml_and_back():
    scenario = read(FLEET)
    assert_same_fleet(read(to_yaml(scenario)), scenario)


@settings(max_examples=draws(40))
@given(
    st.lists(
        scenarios().filter(lambda one: one.problem.horizon.time is None), min_size=1, max_size=4
    ),
    st.data(),
)
def test_any_fleet_goes_to_yaml_and_back(alone, data):
    n = len(alone)
    names = data.draw(
        st.lists(st.text(min_size=1).filter(str.strip), min_size=n, max_size=n, unique=True)
    )
    numbers = st.floats(-1e6, 1e6)
    settings = FleetPart(
        objective=data.draw(st.sampled_from(["sum", "last"])),
        orders=data.draw(st.integers(1, 99)),
        time_limit_s=data.draw(st.floats(1e-3, 1e3)),
    )
    fleet = FleetProblem(
        [one.problem for one in alone],
        names=names,
        margin=data.draw(st.floats(0.0, 9.0)),
        leaves=data.draw(st.lists(st.booleans(), min_size=n, max_size=n)),
        priority=data.draw(st.lists(numbers, min_size=n, max_size=n)),
    )
    vehicles = tuple(replace(one, name=name) for one, name in zip(alone, names, strict=True))
    scenario = FleetScenario(name="any", fleet=fleet, vehicles=vehicles, settings=settings)
    assert_same_fleet(read(to_yaml(scenario)), scenario)


def test_a_map_is_read_once(tmp_path):
    (tmp_path / "nav.pgm").write_bytes(b"P5 4 4 255\n" + bytes([254] * 15 + [0]))
    (tmp_path / "nav.yaml").write_text(
        "image: nav.pgm\nresolution: 0.5\norigin: [1, 2, 0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.25\n"
    )
    (tmp_path / "x.yaml").write_text(
        but("{box_m: {center: [4.0, 3.0], size: [3.0, 1.0]}}", "{map: nav.yaml}")
    )
    scenario = load_scenario(tmp_path / "x.yaml")
    (file,) = scenario.maps
    a, b, _ = scenario.fleet.problems
    assert a.obstacles[0] is b.obstacles[0] is file.map
    text = to_yaml(scenario, folder=tmp_path)
    (tmp_path / "again.yaml").write_text(text)
    assert to_yaml(load_scenario(tmp_path / "again.yaml"), folder=tmp_path) == text


def test_the_schema_takes_one_or_several(capsys):
    jsonschema = pytest.importorskip("jsonschema")
    assert run(["schema"]) == 0
    schema = json.loads(capsys.readouterr().out)
    check = jsonschema.Draft202012Validator(schema)
    one, several = parse(ALONE, name="x").value, parse(FLEET, name="x").value
    assert check.is_valid(one)
    assert check.is_valid(several)
    assert not check.is_valid(several | {"start": one["start"], "goal": one["goal"]})
    assert not check.is_valid(one | {"fleet": {}})
    assert not check.is_valid(several | {"fleat": {}})


LOOP = "receding_horizon: {step_s: 0.5}"


def refused(text):
    """What is said of a file that cannot be used."""
    with pytest.raises(InvalidScenario) as error:
        read(text)
    return str(error.value)


@pytest.mark.parametrize(
    ("loop", "message"),
    [
        ("stay: true", "stay: got true, need no such key: who has arrived stays at its goal, or "
         "leaves"),
        ("retimed: false", "retimed: got false, need no such key: vehicles of a fleet drive at the "
         "pace that others know of"),
        ("tube_m: 0.06", "tube_m: got 0.06, need at most 0.05, half of between_m: two bodies may "
         "both be beside their plans"),
        ("group_size: 2, delay_steps: 1", "group_size: got 2, need 1 where answers are late "
         "(delay_steps): those of several would have to come at once"),
        ("delay_steps: -1", "delay_steps: got -1, need a whole number of at least 0"),
        ("disturbance: {delay_steps: 1}", "disturbance.delay_steps: got 1, need no such key: "
         "answers of a fleet are late by delay_steps of receding_horizon"),
        ("disturbance: {twist_scale: [1, 1, 1, 1]}", "disturbance: twist_scale: got shape (4,), "
         "need 3 components last"),
        ("steps_s: 3", "steps_s: unknown key; did you mean 'step_s'? Known keys: step_s, steps, "
         "time_limit_s, margin, tube_m, swaps_per_step, group_size, delay_steps, disturbance"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_loop(loop, message):
    said = refused(but(LOOP, LOOP.replace("0.5", f"0.5, {loop}")))
    assert said == f"fleet:27: receding_horizon.{message}"


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("{joins_s: soon}", ".joins_s: got 'soon', need a finite number"),
        ("{breaks: 1}", ".breaks: unknown key; did you mean 'breaks_s'? Known keys: joins_s, "
         "breaks_s, disturbance"),
        ("{disturbance: {pushes: [{after_step: 1, by: [1, 1, 1, 1]}]}}", ".disturbance: push after "
         "step 1: got shape (4,), need 3 components last"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_the_loop_of_a_vehicle(entry, message):
    text = but("priority: 1", f"priority: 1, receding_horizon: {entry}")
    said = refused(text)
    assert said == f"fleet:17: vehicles[1].receding_horizon{message}"


def test_a_vehicle_needs_the_loop_of_all():
    text = but("priority: 1", "priority: 1, receding_horizon: {joins_s: 2}").replace(LOOP, "")
    assert refused(text) == (
        "fleet:17: vehicles[1].receding_horizon: stands alone, need receding_horizon: "
        "{step_s: ...} at the top"
    )


def test_a_maneuver_is_driven_as_its_model_says():
    folder = Path(__file__).parents[2] / "scenarios/fleets"
    text = (folder / "airfield.yaml").read_text()
    text = text.split("receding_horizon:")[0]
    own = "receding_horizon: {disturbance: {twist_scale: [1.1, 1.0, 1.0, 1.0]}}"
    text = text.replace("name: helicopter\n", f"name: helicopter\n    {own}\n")
    text += "receding_horizon: {step_s: 1.0}\n"
    with pytest.raises(InvalidScenario, match="need no such key for a vehicle with inertia"):
        fleet_of_document(parse(text, name="x"), path=folder / "x.yaml", begin=0.0)


def test_a_loop_there_and_back():
    text = but(LOOP, LOOP.replace("0.5", "0.5, steps: 7, tube_m: 0.02, disturbance: {seed: 4}"))
    own = "{joins_s: 2, breaks_s: 9, disturbance: {position_m: 0.1, seed: 5}}"
    scenario = read(text.replace("priority: 1", f"priority: 1, receding_horizon: {own}"))
    assert scenario.joins_s == {"b": 2.0}
    assert scenario.breaks_s == {"b": 9.0}
    found = scenario.disturbances
    assert (found["a"].position_m, found["b"].position_m) == (0.0, 0.1)
    assert (found["a"].seed, found["b"].seed) == (0, 5)  # the top's is that of the loop
    again = read(to_yaml(scenario))
    assert again.receding_horizon == scenario.receding_horizon
    assert again.loops == scenario.loops


def test_the_schema_knows_two_kinds_of_loops(capsys):
    jsonschema = pytest.importorskip("jsonschema")
    assert run(["schema"]) == 0
    check = jsonschema.Draft202012Validator(json.loads(capsys.readouterr().out))
    one, several = parse(ALONE, name="x").value, parse(FLEET, name="x").value
    of_one, of_several = {"step_s": 1, "stay": True}, {"step_s": 1, "tube_m": 0.01}
    assert check.is_valid(one | {"receding_horizon": of_one})
    assert check.is_valid(several | {"receding_horizon": of_several})
    assert not check.is_valid(one | {"receding_horizon": of_several})
    assert not check.is_valid(several | {"receding_horizon": of_one})


def test_a_scenario_beside_states_the_loop(tmp_path):
    """For a format that states several vehicles, and nothing of a loop."""
    (tmp_path / "cars.yaml").write_text(PROBLEM)
    beside = ALONE.split("start:")[0] + "fleet: {between_m: 0.2}\n"
    (tmp_path / "with.yaml").write_text(beside + "receding_horizon: {step_s: 0.5, tube_m: 0.1}\n")
    scenario = load_scenario(tmp_path / "cars.yaml", beside=tmp_path / "with.yaml")
    assert isinstance(scenario, FleetScenario)
    assert scenario.receding_horizon.tube_m == 0.1

"""Scenarios of vehicles with a reduced state: models, trims, maneuvers, bodies, and back."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

from maneuver_automaton.automaton.library import automaton_hash, load_stock_library, save_library
from maneuver_automaton.cli import run
from maneuver_automaton.collision import Box
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.models import (
    CarWithTrailer,
    SecondOrderCar,
    SecondOrderUnicycle,
    SingleTrack,
)
from maneuver_automaton.models.kinds import KINDS
from maneuver_automaton.scenario import json_schema, load_scenario, scenario_of_text, to_yaml
from maneuver_automaton.scenario.automata import preset_automaton
from maneuver_automaton.scenario.parts import keys_of
from maneuver_automaton.scenario.vehicles import MODELS, described, part_of
from tests import inertia

CAR = (
    "{model: second_order_car, wheelbase_m: 2.8, max_steering_rad: 0.75, max_speed_m_s: 2.5, "
    "max_acceleration_m_s2: 1.0, max_steering_rate_rad_s: 0.5}"
)
ROBOT = (
    "{model: second_order_unicycle, max_speed_m_s: 0.5, max_turn_rate_rad_s: 0.5, "
    "max_acceleration_m_s2: 0.25, max_angular_acceleration_rad_s2: 0.25}"
)
TRUCK = (
    "{model: car_with_trailer, wheelbase_m: 0.25, hitch_length_m: 0.5, max_steering_rad: 1.0, "
    "max_speed_m_s: 0.5, max_hitch_rad: 0.785, footprint: {rectangle_m: [0.5, 0.25]}, "
    "trailer: {rectangle_m: [0.3, 0.25], reference_m: [0.05, 0.0]}}"
)
HOVERCRAFT = (
    "{model: hovercraft, mass_kg: 2.0, inertia_kg_m2: 0.1, drag_n_s_m: 1.0, "
    "lateral_drag_n_s_m: 3.0, turn_drag_n_m_s: 0.1, max_force_n: 4.0, max_torque_n_m: 0.2, "
    "min_force_n: -1.0}"
)
HELICOPTER = (
    "{model: helicopter, max_speed_m_s: 10.0, max_lateral_speed_m_s: 3.0, max_climb_m_s: 3.0, "
    "max_turn_rate_rad_s: 1.0, max_tilt_rad: 0.6, max_tilt_rate_rad_s: 1.5, "
    "max_climb_acceleration_m_s2: 3.0, max_angular_acceleration_rad_s2: 2.0, drag_per_s: 0.1}"
)
RESTS = "{trims: [{name: rest, state: [%s]}]}"


def text(vehicle: str, automaton: str, *, dof: int = 3) -> str:
    zeros = ", ".join(["0.0"] * dof)
    return (
        f"schema: 1\nname: inertia\nvehicle: {vehicle}\nautomaton: {automaton}\n"
        f"start: {{pose: [{zeros}]}}\ngoal: {{pose: [{zeros}]}}\n"
    )


def read(vehicle: str, automaton: str, **more: int):
    return scenario_of_text(text(vehicle, automaton, **more), name="x.yaml")


@pytest.mark.parametrize(
    ("vehicle", "automaton", "model"),
    [
        (CAR, RESTS % "0, 0", inertia.CAR),
        (ROBOT, RESTS % "0, 0", inertia.ROBOT),
        (
            TRUCK,
            RESTS % "0",
            CarWithTrailer(
                wheelbase=0.25, hitch_length=0.5, max_steering=1.0, max_speed=0.5, max_hitch=0.785
            ),
        ),
        ("{model: single_track}", "{trims: [{name: a, state: [20, 0, 0, 0]}]}", SingleTrack()),
        (
            "{model: single_track, friction: 0.8, max_turn_rate_rad_s: 1.0}",
            "{trims: [{name: a, state: [20, 0, 0, 0]}]}",
            SingleTrack(friction=0.8, max_turn_rate=1.0),
        ),
        (HOVERCRAFT, RESTS % "0, 0, 0", dataclasses.replace(inertia.HOVERCRAFT, min_force=-1.0)),
        (HELICOPTER, RESTS % "0, 0, 0, 0, 0, 0", inertia.HELICOPTER),
    ],
)
def test_every_model_is_read_and_written(vehicle, automaton, model):
    scenario = read(vehicle, automaton, dof=model.group.dof)
    if model.name == "single_track":
        scenario = scenario_of_text(
            text(vehicle, automaton).replace("0.0]}", "0.0], trim: a}"), name="x.yaml"
        )
    assert scenario.problem.automaton.model == model
    again = scenario_of_text(to_yaml(scenario), name="y.yaml")
    assert again.problem.automaton.model == model
    assert automaton_hash(again.problem.automaton) == automaton_hash(scenario.problem.automaton)
    assert again.problem.parts.keys() == scenario.problem.parts.keys()


@pytest.mark.parametrize("name", MODELS)
def test_every_parameter_has_a_key_with_its_unit(name):
    part = part_of(name)
    fields = {field.name for field in dataclasses.fields(KINDS[name])}
    keys = keys_of(part, KINDS[name])
    assert keys.keys() == fields
    bodies = {"model", "footprint", "footprint_height_m", *KINDS[name].part_names}
    assert set(keys.values()) == part.model_fields.keys() - bodies


def test_the_body_of_the_trailer_is_a_part():
    problem = read(TRUCK, "{trims: [{name: rest, control: [0, 0]}]}").problem
    assert [len(body) for body in (problem.footprint, problem.parts["trailer"])] == [1, 1]
    box = problem.parts["trailer"][0]
    assert isinstance(box, Box)
    assert (box.size.tolist(), box.center.tolist()) == ([0.3, 0.25], [-0.05, 0.0])


def test_what_a_trim_leaves_out_is_solved_for():
    automaton = read(
        TRUCK, "{trims: [{name: left, control: [0.5, 0.2]}, {name: rest, control: [0, 0]}]}"
    ).problem.automaton
    (hitch,) = automaton["left"].reduced_state
    assert np.sin(hitch) == pytest.approx(0.5 * np.tan(0.2) / 0.25)
    drifting = read(
        HOVERCRAFT, "{trims: [{name: rest, state: [0, 0, 0]}, {name: ahead, state: [2, 0, 0]}]}"
    ).problem.automaton
    assert drifting["ahead"].control.tolist() == [2.0, 0.0]
    assert drifting.maneuvers == ()


def test_listed_trims_of_limited_rates_are_joined():
    trims = "trims: [{name: rest, state: [0, 0]}, {name: ahead, state: [1, 0]}, "
    trims += "{name: fast, state: [2, 0]}]"
    automaton = read(CAR, f"{{{trims}}}").problem.automaton
    assert [(m.source, m.target) for m in automaton.maneuvers] == [
        ("rest", "ahead"), ("ahead", "rest"), ("ahead", "fast"), ("fast", "ahead"),
    ]  # fmt: skip
    every = read(CAR, f"{{{trims}, maneuvers: {{pairs: all, strokes_m: [1]}}}}").problem.automaton
    assert len(every.maneuvers) == 7


def test_a_grid_of_forty_trims():
    grid = "{grid: {speed_m_s: {min: -2.5, max: 2.5, count: 9}, "
    grid += "steering_rad: {min: -0.75, max: 0.75, count: 5}}, maneuvers: {late: true}}"
    automaton = read(CAR, grid).problem.automaton
    assert len(automaton) == 45
    assert len(automaton.maneuvers) >= 300
    assert automaton.trims[automaton.rest].name == "speed 0, steering 0"
    assert "speed 0.625, steering -0.375" in automaton.trim_names


def test_points_out_of_reach_can_be_left_out():
    grid = "{grid: {speed_m_s: {min: 5, max: 35, count: 4}, "
    grid += "turn_rate_rad_s: {min: -0.3, max: 0.3, count: 3}, "
    grid += "max_lateral_acceleration_m_s2: 5.0, leave_out: true}}"
    whole = text("{model: single_track}", grid)
    whole = whole.replace("0.0]}", "0.0], trim: 'speed 15, turn_rate 0'}")
    automaton = scenario_of_text(whole, name="x.yaml").problem.automaton
    assert len(automaton) == 8  # at 25 and 35 m/s straight ahead only


def test_a_helix_is_in_the_grid():
    grid = "{grid: {speed_m_s: {min: 0, max: 5, count: 2}, "
    grid += (
        "turn_rate_rad_s: {min: 0, max: 0.5, count: 2}, climb_m_s: {min: -1, max: 1, count: 3}}}"
    )
    automaton = read(HELICOPTER, grid, dof=4).problem.automaton
    helix = automaton["speed 5, turn_rate 0.5, climb 1"]
    assert helix.body_velocity.tolist() == [5.0, 0.0, 0.5, 1.0]


@pytest.mark.parametrize("name", ["parking", "road"])
@pytest.mark.parametrize("model", [inertia.CAR, inertia.ROBOT], ids=lambda model: model.name)
def test_presets_for_vehicles_with_inertia(name, model):
    from maneuver_automaton.automaton.validation import validate

    automaton = preset_automaton(name, model)
    report = validate(automaton)
    assert report.connected
    assert report.controllable
    assert automaton.rest is not None
    speeds = automaton.body_velocities[:, 0]
    assert speeds.max() == pytest.approx(0.5 if model is inertia.ROBOT else 2.5)
    assert (speeds.min() < 0.0) == (name == "parking")
    lateral = np.abs(automaton.body_velocities[:, 0] * automaton.body_velocities[:, 2])
    assert name == "parking" or lateral.max() <= 4.0 + 1e-12


def test_libraries_of_the_package_are_presets():
    library = read(CAR, "{preset: second_order_car}").problem.automaton
    assert automaton_hash(library) == automaton_hash(load_stock_library("second_order_car"))


def test_presets_keep_to_a_vehicle_that_does_not_reverse():
    forward = SecondOrderUnicycle(
        max_speed=1.0,
        max_turn_rate=1.0,
        max_acceleration=1.0,
        max_angular_acceleration=1.0,
        min_speed=0.0,
    )
    parking = preset_automaton("parking", forward)
    assert parking.body_velocities[:, 0].min() == 0.0
    fast = SecondOrderCar(
        wheelbase=2.8,
        max_steering=0.75,
        max_speed=30.0,
        max_acceleration=3.0,
        max_steering_rate=0.5,
    )
    road = preset_automaton("road", fast)
    lateral = np.abs(road.body_velocities[:, 0] * road.body_velocities[:, 2])
    assert lateral.max() == pytest.approx(4.0)


def test_a_library_with_maneuvers_serves_and_is_written_as_a_file(tmp_path):
    library = preset_automaton("parking", inertia.CAR)
    save_library(library, tmp_path / "libraries" / "car.json")
    path = tmp_path / "scenario.yaml"
    path.write_text(text(CAR, "{file: libraries/car.json}"))
    scenario = load_scenario(path)
    assert automaton_hash(scenario.problem.automaton) == automaton_hash(library)
    elsewhere = tmp_path / "a" / "b"
    elsewhere.mkdir(parents=True)
    written = to_yaml(scenario, folder=elsewhere)
    assert 'file: "../../libraries/car.json"' in written
    (elsewhere / "copy.yaml").write_text(written)
    again = load_scenario(elsewhere / "copy.yaml")
    assert automaton_hash(again.problem.automaton) == automaton_hash(library)


def test_a_library_of_another_vehicle_is_refused(tmp_path):
    save_library(preset_automaton("parking", inertia.CAR), tmp_path / "car.json")
    path = tmp_path / "scenario.yaml"
    path.write_text(text(CAR.replace("2.5", "2.0"), "{file: car.json}"))
    with pytest.raises(InvalidScenario) as error:
        load_scenario(path)
    assert str(error.value) == (
        f"{path}:4: automaton.file: got a library for {{max_speed_m_s: 2.5}}, but the vehicle has "
        "{max_speed_m_s: 2.0}"
    )


@pytest.mark.parametrize(
    "automaton",
    [
        "{preset: road}",
        "{grid: {speed_m_s: {min: 0.0, max: 1.0, count: 2}, steering_rad: "
        "{min: 0.0, max: 0.0, count: 1}}, maneuvers: {pairs: all, strokes_m: [0.5]}}",
        "{trims: [{name: rest, state: [0.0, 0.0]}, {name: ahead, state: [1.0, 0.0]}], "
        "maneuvers: {late: true}}",
    ],
)
def test_automata_are_written_as_they_were_stated(automaton):
    scenario = read(CAR, automaton)
    again = scenario_of_text(to_yaml(scenario), name="y.yaml")
    assert automaton_hash(again.problem.automaton) == automaton_hash(scenario.problem.automaton)
    assert again.stated == scenario.stated


def test_models_are_described_with_their_units():
    assert described(inertia.ROBOT) == {
        "model": "second_order_unicycle",
        "max_speed_m_s": 0.5,
        "max_turn_rate_rad_s": 0.5,
        "max_acceleration_m_s2": 0.25,
        "max_angular_acceleration_rad_s2": 0.25,
    }


def test_the_json_schema_knows_every_model():
    schema = json.dumps(json_schema())
    for model in MODELS:
        assert f'"const": "{model}"' in schema
    assert '"strokes_m"' in schema


def test_the_command_line_builds_and_shows(folder, capsys):
    (folder / "car.yaml").write_text(text(CAR, "{preset: parking}"))
    assert run(["automaton", "build", "car.yaml", "--out", "car.json"]) == 0
    assert "35 trims, 242 maneuvers" in capsys.readouterr().out
    assert run(["automaton", "show", "car.json"]) == 0
    assert "every pose can be reached" in capsys.readouterr().out

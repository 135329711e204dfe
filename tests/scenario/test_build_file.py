"""Build files: what they ask for, and what is said where they cannot be used."""

from __future__ import annotations

import pytest

from maneuver_automaton.automaton.courses import inputs_of
from maneuver_automaton.automaton.library import load_library
from maneuver_automaton.cli import run
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.models import Car
from maneuver_automaton.scenario import load_scenario
from maneuver_automaton.scenario.build_file import (
    build,
    build_file_of_text,
    is_build_file,
    load_build_file,
)

CAR = """\
schema: 1
library: slow cars
vehicle: {model: car, wheelbase_m: 2.5, max_steering_rad: 0.6, max_speed_m_s: 2.0}
trims: {speed: [-1, 0, 2], turn_rate: [-0.5, 0, 0.5]}
"""


def test_trims_that_there_are_and_that_there_are_not():
    asked = build_file_of_text(CAR, name="cars.yaml")
    assert asked.model == Car(wheelbase=2.5, max_steering=0.6, max_speed=2.0)
    assert len(asked.trims) == 5
    assert [point.name for point in asked.missing][:2] == [
        "speed -1, turn_rate -0.5",
        "speed -1, turn_rate 0.5",
    ]
    assert asked.pairs() == []


def test_from_the_command_line(folder, capsys):
    (folder / "cars.yaml").write_text(CAR)
    assert run(["automaton", "build", "cars.yaml", "-o", "cars.json", "--jobs", "2"]) == 0
    said = capsys.readouterr()
    assert said.out.startswith("cars.json: 5 trims, 0 maneuvers, hash ")
    assert said.err.splitlines()[0] == (
        "cars.yaml: no trim at speed -1, turn_rate -0.5: "
        "steering would be 0.8961, 0.2961 beyond its limit 0.6000"
    )
    assert load_library("cars.json").name == "slow cars"
    assert run(["automaton", "build", "cars.yaml", "-o", "quiet.json", "--quiet"]) == 0
    assert capsys.readouterr().out == ""


CRAFT = """\
schema: 1
library: craft
model: {kind: hovercraft, mass: 2, inertia: 0.1, drag: 1, lateral_drag: 3, turn_drag: 0.1,
        max_force: 4, max_torque: 0.2}
trims: {speed: [0, 1.5], turn_rate: [0, 0.5]}
maneuvers: {pairs: 1, intervals: 10}
"""


def test_maneuvers_by_optimal_control(folder, capsys):
    (folder / "craft.yaml").write_text(CRAFT)
    assert run(["automaton", "build", "craft.yaml", "-o", "craft.json"]) == 0
    counts, solved = capsys.readouterr().out.splitlines()
    library = load_library("craft.json")
    assert counts.startswith(f"craft.json: 4 trims, {len(library.maneuvers)} maneuvers, hash ")
    assert solved.startswith(f"  {len(library.maneuvers)} solved, 0 from the journal")
    assert max(inputs_of(one.course)[0].size for one in library.maneuvers) == 10


def test_maneuvers_at_once(tmp_path):
    asked = build_file_of_text(
        "{schema: 1, library: cars, model: {kind: second_order_car, wheelbase: 2.8, "
        "max_steering: 0.7, max_speed: 2.0, max_acceleration: 1.0, max_steering_rate: 0.5}, "
        "trims: {speed: [-1, 0, 2], steering: [-0.7, 0, 0.7]}, "
        "maneuvers: {pairs: neighbours, strokes_m: [0.5, -0.5]}}",
        name="cars.yaml",
    )
    automaton, solved = build(asked, tmp_path / "cars.json")
    assert solved is None
    assert (len(automaton), len(automaton.maneuvers)) == (9, 46)
    assert automaton.name == load_library(tmp_path / "cars.json").name == "cars"


def test_the_model_of_a_library_file_is_checked():
    with pytest.raises(InvalidScenario) as error:
        build_file_of_text(CRAFT.replace("mass: 2, ", ""), name="x.yaml")
    assert str(error.value) == "x.yaml:3: model: the key 'mass' is missing"
    with pytest.raises(InvalidScenario) as error:
        build_file_of_text(CRAFT + "vehicle: {model: unicycle}\n", name="x.yaml")
    assert str(error.value) == (
        "x.yaml:1: got vehicle and model, need exactly one of vehicle, model"
    )


def test_a_build_file_is_no_scenario(tmp_path):
    path = tmp_path / "cars.yaml"
    path.write_text(CAR)
    assert is_build_file(path)
    with pytest.raises(InvalidScenario) as error:
        load_scenario(path)
    assert str(error.value) == f"{path}:1: is a build file, need a scenario"
    path.write_text("schema: 1\nvehicle: {}\n")
    assert not is_build_file(path)
    assert not is_build_file(tmp_path / "cars.json")
    with pytest.raises(InvalidScenario) as error:
        load_build_file(path)
    assert str(error.value) == (
        f"{path}:1: the key 'library' is missing, need library: what the library is called"
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            ("trims: {speed: [-1, 0, 2], turn_rate: [-0.5, 0, 0.5]}", "trims: [1]"),
            "x.yaml:4: trims: got [1], need a mapping of names to lists of values, such as "
            "{speed: [0, 1], ...}",
        ),
        (
            ("speed: [-1, 0, 2]", "speed: [-1, -1, 2]"),
            "x.yaml:4: trims.speed: got [-1, -1, 2], need a list of numbers, each of them once",
        ),
        (
            ("speed: [-1, 0, 2]", f"speed: {[k / 1000 for k in range(1000)]}"),
            "x.yaml:4: trims: got 3000 trims, need at most 2000",
        ),
        (
            ("turn_rate", "yaw_rate"),
            "x.yaml:4: trims: grid: the car has no 'yaw_rate', need speed, steering, "
            "lateral_speed, turn_rate",
        ),
        (
            ("speed: [-1, 0, 2]", "speed: [5]"),
            "x.yaml:4: trims: the car has none of these trims: speed would be 5.0000, 3 beyond "
            "its limit 2.0000",
        ),
        (
            ("schema: 1", "schema: 1\nmaneuvers: {pairs: some}"),
            "x.yaml:2: maneuvers.pairs: got 'some', need all, neighbours, or a whole number of "
            "the nearest trims",
        ),
        (
            ("schema: 1", "schema: 1\nmaneuvers: {strokes_m: [1.0]}"),
            "x.yaml:2: maneuvers.strokes_m: is for vehicles whose control is the rate of the "
            "reduced state, at no price of effort, not for this car",
        ),
        (
            ("schema: 1", "schema: 1\nmaneuvers: {time: 0}"),
            "x.yaml:2: maneuvers: objective: got no price of time nor of effort, need one of them",
        ),
        (
            ("schema: 1", "schema: 1\nmaneuvers: {keep_sign: [thrust]}"),
            "x.yaml:2: maneuvers.keep_sign: the car has no control 'thrust', need some of speed, "
            "steering",
        ),
    ],
)
def test_what_is_wrong_is_said(change, message):
    with pytest.raises(InvalidScenario) as error:
        build_file_of_text(CAR.replace(*change), name="x.yaml")
    assert str(error.value) == message

"""--model: a vehicle of the user's own on the command line, and what is wrong with one."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from maneuver_automaton.cli import run
from maneuver_automaton.cli.inputs import user_model

MODULE = """
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import Car, UserModel

SKATE = UserModel(
    name="skate", group=SE2, control_names=("push", "turn"), reduced_names=("speed",),
    velocity=lambda z, u: [z[0], 0.0, u[1]], dynamics=lambda z, u: [u[0]],
    control_limits=[[-1.0, 1.0], [-1.0, 1.0]], reduced_limits=[[0.0, 2.0]],
)
BOAT = UserModel(
    name="boat", group=SE2, control_names=("speed", "rudder"),
    velocity=lambda z, u: [u[0], 0.1 * u[0] * u[1], u[0] * u[1]], control_limits=[-1.0, 1.0],
)
CAR = Car(wheelbase=2.0)
NUMBER = 3


def make():
    return BOAT


def needs(mass):
    return BOAT


def fails():
    raise OSError("no water")
"""
TRIMS = [("rest", 0.0, 0.0), ("ahead", 1.0, 0.0), ("left", 1.0, 1.0), ("right", 1.0, -1.0)]
LIBRARY = {
    "format": "maneuver-automaton library",
    "schema": 1,
    "name": "skates",
    "model": {"kind": "skate", "controls": ["push", "turn"], "reduced": ["speed"]},
    "trims": [
        {"name": n, "control": [0.0, w], "body_velocity": [v, 0.0, w], "reduced_state": [v]}
        for n, v, w in TRIMS
    ],
    "maneuvers": [
        {"name": name, "source": a, "target": b, "displacement": [0.5, 0.0, 0.0],
         "duration": 1.0, "control": [[push, 0.0]]}
        for name, a, b, push in (("go", "rest", "ahead", 1.0), ("stop", "ahead", "rest", -1.0))
    ],
}  # fmt: skip
SKATE = """\
schema: 1
vehicle: {model: skate, footprint: {rectangle_m: [0.4, 0.2]}}
automaton: {file: skates.json}
start: {pose: [0, 0, 0]}
goal: {pose: [6, 1, 0]}
obstacles: [{disc_m: {center: [3, 0.5], radius: 0.4}}]
search: {time_limit_s: 20.0, max_expansions: 2000}
"""
BOAT = """\
schema: 1
vehicle: {model: boat, footprint: {rectangle_m: [0.4, 0.2]}}
automaton:
  trims:
    - {name: ahead, control: [1, 0]}
    - {name: left, control: [1, 1]}
    - {name: right, control: [1, -1]}
start: {pose: [0, 0, 0]}
goal: {pose: [4, 1, 0]}
obstacles: [{box_m: {center: [2, 0.3], size: [0.8, 0.8]}}]
search: {time_limit_s: 20.0, max_expansions: 500}
receding_horizon: {step_s: 1.0}
"""
FLEET = """\
schema: 1
vehicle: {model: boat, footprint: {disc_m: 0.3}}
automaton:
  trims:
    - {name: rest, control: [0.0, 0.0]}
    - {name: ahead, control: [1.0, 0.0]}
    - {name: left, control: [1.0, 1.0]}
    - {name: right, control: [1.0, -1.0]}
vehicles:
  - {name: boat, start: {pose: [0, 0, 0]}, goal: {pose: [6, 0, 0]}}
  - name: robot
    vehicle: {model: unicycle, footprint: {disc_m: 0.3}}
    automaton: {preset: reeds_shepp}
    start: {pose: [3, -3, 1.57]}
    goal: {pose: [3, 3, 1.57]}
"""
QUIET = ["--no-plot", "--quiet"]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    Path("test_boats.py").write_text(MODULE)
    Path("test_broken.py").write_text("1 / 0")
    Path("test_lacking.py").write_text("import test_nowhere")
    Path("skates.json").write_text(json.dumps(LIBRARY))
    Path("skate.yaml").write_text(SKATE)
    Path("boat.yaml").write_text(BOAT)
    yield tmp_path
    user_model.cache_clear()
    for name in ("test_boats", "test_broken", "test_lacking"):
        sys.modules.pop(name, None)


def document(folder="out", name="plan"):
    return json.loads((Path(folder) / f"{name}.json").read_text())


def test_one_of_several_vehicles_may_be_a_users(folder, capsys):
    Path("fleet.yaml").write_text(FLEET)
    assert (
        run(["plan", "fleet.yaml", "--model", "test_boats:BOAT", "--time-limit", "1", *QUIET]) == 0
    )
    vehicles = document()["vehicles"]
    assert [one["vehicle"]["model"] for one in vehicles.values()] == ["boat", "unicycle"]
    assert run(["check", "out/plan.json", "--model", "test_boats:BOAT"]) == 0
    capsys.readouterr()
    Path("fleet.yaml").write_text(FLEET.replace("model: unicycle", "model: unicylce"))
    assert run(["plan", "fleet.yaml", "--model", "test_boats:BOAT", *QUIET]) == 2
    assert capsys.readouterr().err.startswith(
        "fleet.yaml:12: vehicles[1].vehicle.model: got 'unicylce', need 'boat', the model that is "
        "given, or one of unicycle, car, "
    )
    assert run(["plan", "fleet.yaml", *QUIET]) == 2
    assert capsys.readouterr().err.startswith(
        "fleet.yaml:2: vehicle.model: got 'boat', need one of unicycle, car, "
    )


def test_a_library_of_a_users_model_is_planned_with(folder):
    assert run(["plan", "skate.yaml", "--model", "test_boats:SKATE", *QUIET]) == 0
    found = document()
    assert found["status"] == "found"
    assert found["audit"]["passed"] is True
    assert found["clearance_m"] > 0.0
    assert found["terminal_error"]["position_m"] < 1e-9


@pytest.mark.parametrize("name", ["BOAT", "make"])
def test_a_kinematic_model_plans_and_closes_the_loop(folder, name):
    model = ["--model", f"test_boats:{name}"]
    assert run(["plan", "boat.yaml", *model, *QUIET]) == 0
    assert document()["audit"]["passed"] is True
    assert run(["mpc", "boat.yaml", "--steps", "1", *model, *QUIET]) == 1
    assert document(name="closed_loop")["steps"][0]["word"]


@pytest.mark.exhaustive
@pytest.mark.slow
def test_the_other_commands_take_it_too(folder, capsys):
    model = ["--model", "test_boats:SKATE"]
    assert run(["check", "skate.yaml", *model]) == 0
    assert "a plan exists" in capsys.readouterr().out
    assert run(["automaton", "show", "skates.json", *model]) == 0
    assert "skate, 4 trims, 2 maneuvers" in capsys.readouterr().out
    assert run(["automaton", "draw", "skate.yaml", *model]) == 0
    assert Path("out/automaton.png").stat().st_size > 1000


def test_a_folder_is_planned_with_it(folder):
    Path("boats").mkdir()
    Path("boat.yaml").rename("boats/boat.yaml")
    assert run(["plan", "boats", "--model", "test_boats:BOAT", "--quiet", "--no-plot"]) == 0
    assert document("out/boat")["status"] == "found"


@pytest.mark.parametrize(
    ("model", "said"),
    [
        ("test_boats", "--model: got 'test_boats', need MODULE:OBJECT, such as boats:BOAT"),
        (":BOAT", "--model: got ':BOAT', need MODULE:OBJECT, such as boats:BOAT"),
        ("test_nowhere:BOAT", "--model: there is no module 'test_nowhere' in "),
        ("test_boats.deep:BOAT", "--model: there is no module 'test_boats.deep' in "),
        ("test_broken:BOAT", "--model: the module 'test_broken' cannot be imported: "
         "ZeroDivisionError: division by zero"),
        ("test_lacking:BOAT", "--model: the module 'test_lacking' cannot be imported: "
         "ModuleNotFoundError: No module named 'test_nowhere'"),
        ("test_boats:BOTA", "--model: the module 'test_boats' has no 'BOTA'; did you mean 'BOAT'?"),
        ("test_boats:NUMBER", "--model: test_boats:NUMBER: int is no model: it has no name, "),
        ("test_boats:needs", "--model: test_boats:needs does not fit: it cannot be called without "
         "parameters (missing a required argument: 'mass')"),
        ("test_boats:fails", "--model: test_boats:fails raises OSError: no water"),
        ("test_boats:CAR", "--model: test_boats:CAR is called 'car', as a model of the package is"),
        ("test_boats:SKATE", "boat.yaml:2: vehicle.model: got 'boat', need 'skate', the model "
         "that is given"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_one_line(folder, capsys, model, said):
    assert run(["plan", "boat.yaml", "--model", model, *QUIET]) == 2
    error = capsys.readouterr().err
    assert error.startswith(said)
    assert error.count("\n") == 1


def test_a_library_of_another_model_is_refused(folder, capsys):
    assert run(["automaton", "show", "skates.json", "--model", "test_boats:BOAT"]) == 2
    assert "but the model given is {'kind': 'boat'" in capsys.readouterr().err
    text = SKATE.replace("model: skate", "model: boat")
    Path("skate.yaml").write_text(text)
    assert run(["plan", "skate.yaml", "--model", "test_boats:BOAT", *QUIET]) == 2
    assert "skate.yaml:3: automaton.file: " in capsys.readouterr().err


def test_without_it_the_model_is_unknown(folder, capsys):
    assert run(["plan", "boat.yaml", *QUIET]) == 2
    assert "vehicle.model: got 'boat', need one of unicycle" in capsys.readouterr().err
    assert run(["automaton", "show", "skates.json"]) == 2
    assert "or by --model MODULE:OBJECT" in capsys.readouterr().err

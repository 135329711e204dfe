"""Libraries as files: exact, versioned, and guarded by a hash."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.library import automaton_hash, load_library, save_library
from maneuver_automaton.errors import InvalidLibrary
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import (
    Car,
    SingleTrack,
    Unicycle,
    UserModel,
)
from maneuver_automaton.primitives import Maneuver, Trim, drive
from tests import inertia

KINDS = (
    "unicycle, car, second_order_unicycle, second_order_car, car_with_trailer, single_track, "
    "hovercraft, helicopter, accelerating_car, lattice_body, omnidirectional, "
    "rear_steered_car, four_wheel_steering_car, articulated_vehicle, tractor_with_trailers"
)
ROBOT = Automaton.of_controls(Unicycle(max_speed=2.0), {"ahead": (1.5, 0.0), "spin": (0.0, 1.0)})


@pytest.fixture
def path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A library in the current folder."""
    monkeypatch.chdir(tmp_path)
    save_library(ROBOT, "robot.json")
    return Path("robot.json")


def edit(path: Path, **changes: object) -> None:
    """Change keys of a library; None removes one. The hash goes too."""
    document = json.loads(path.read_text()) | {"hash": None} | changes
    path.write_text(json.dumps({k: v for k, v in document.items() if v is not None}))


@given(
    controls=st.dictionaries(
        st.text(min_size=1).filter(str.strip),
        st.tuples(st.floats(-2.0, 2.0), st.floats(-9.0, 9.0)).filter(
            lambda control: all(abs(one) > 1e-99 for one in control if one)
        ),
        min_size=1,
    )
)
def test_reads_back_to_the_last_bit(tmp_path_factory, controls):
    robot = Automaton.of_controls(Unicycle(max_speed=2.0), controls)
    path = tmp_path_factory.getbasetemp() / "library.json"
    save_library(robot, path)
    read = load_library(path)
    assert read.trim_names == robot.trim_names
    assert np.array_equal(read.controls, robot.controls)
    assert np.array_equal(read.body_velocities, robot.body_velocities)
    assert read.model == robot.model
    assert automaton_hash(read) == automaton_hash(robot)


def test_maneuvers_and_limits_of_trims_are_kept(path):
    trims = (
        Trim(name="a", body_velocity=[1.0, 0.0, 0.0], control=[1.0, 0.0], max_duration=3.0),
        Trim(name="b", body_velocity=[0.0, 0.0, 1.0], control=[0.0, 1.0]),
    )
    hop = Maneuver(name="hop", source="a", target="b", displacement=[0.1, 0.0, 0.2], duration=0.3)
    save_library(Automaton(Unicycle(), trims, (hop,), name="hops"), path)
    read = load_library(path)
    assert read.name == "hops"
    assert read["a"].max_duration == 3.0
    assert read.maneuvers[0].displacement.tolist() == [0.1, 0.0, 0.2]
    assert read.maneuvers[0].duration == 0.3


def test_a_car_is_kept(path):
    car = Automaton.of_controls(Car(wheelbase=2.8, max_steering=0.6), {"left": (1.0, 0.6)})
    save_library(car, path)
    assert load_library(path).model == car.model


def test_name_and_comment_do_not_count(path):
    document = json.loads(path.read_text())
    path.write_text(json.dumps(document | {"name": "another", "comment": "made by hand"}))
    assert automaton_hash(load_library(path)) == automaton_hash(ROBOT)


def test_the_hash_sees_a_change(path):
    path.write_text(path.read_text().replace("1.5", "1.25"))
    changed = Automaton.of_controls(
        Unicycle(max_speed=2.0), {"ahead": (1.25, 0.0), "spin": (0.0, 1.0)}
    )
    with pytest.raises(InvalidLibrary) as error:
        load_library(path)
    assert str(error.value) == (
        f"robot.json: hash: got {automaton_hash(ROBOT)!r}, but the content has "
        f"{automaton_hash(changed)!r}: the file was changed after it was written; to accept it as "
        'it is, delete the line "hash"'
    )
    edit(path)
    assert automaton_hash(load_library(path)) == automaton_hash(changed)


def test_hashes_differ_by_model_and_control():
    others = [
        Automaton.of_controls(Unicycle(), {"ahead": (1.5, 0.0), "spin": (0.0, 1.0)}),
        Automaton.of_controls(Unicycle(max_speed=2.0), {"ahead": (1.5, 0.0), "spin": (0.0, 2.0)}),
    ]
    assert len({automaton_hash(one) for one in (ROBOT, *others)}) == 3


BOAT = UserModel(
    name="boat", group=SE2, control_names=("push",), velocity=lambda z, u: [u[0], 0.0, 0.0]
)


def test_the_file_of_a_users_own_model_is_read_with_the_model(path):
    library = Automaton.of_controls(BOAT, {"ahead": [1.0]})
    save_library(library, path)
    assert automaton_hash(load_library(path, model=BOAT)) == automaton_hash(library)
    with pytest.raises(InvalidLibrary) as error:
        load_library(path)
    assert str(error.value) == (
        f"robot.json: model: got the kind 'boat', need one of {KINDS}; a model of your own has "
        "to be given: to load_library, or by --model MODULE:OBJECT"
    )
    with pytest.raises(
        InvalidLibrary, match=r"model: got .*'boat'.*, but the model given is .*uni"
    ):
        load_library(path, model=Unicycle())


MODELS = {
    "unicycle": (ROBOT.model, {"speed": [1.0], "turn_rate": [0.0]}),
    "robot": (inertia.ROBOT, {"speed": [0.0, 0.5], "turn_rate": [0.0, 0.5]}),
    "car": (inertia.CAR, {"speed": [0.0, 2.5], "steering": [0.0, 0.75]}),
    "trailer": (inertia.TRAILER, {"speed": [-0.5, 0.5], "steering": [0.0, 0.3]}),
    "single track": (SingleTrack(max_turn_rate=1.0), {"speed": [5.0, 20.0], "turn_rate": [0.2]}),
    "hovercraft": (
        inertia.HOVERCRAFT,
        {"speed": [0.0, 1.0], "turn_rate": [0.0]},
    ),
    "helicopter": (
        inertia.HELICOPTER,
        {"speed": [0.0, 5.0], "turn_rate": [0.0, 0.5], "climb": [-1.0, 1.0]},
    ),
}


@pytest.mark.parametrize("name", MODELS)
def test_every_model_is_kept_with_its_maneuvers(path, name):
    model, grid = MODELS[name]
    library = Automaton.of_model(model, grid, late=True)
    save_library(library, path)
    read = load_library(path)
    assert read.model == model
    assert automaton_hash(read) == automaton_hash(library)
    for old, new in zip(library.trims, read.trims, strict=True):
        np.testing.assert_array_equal(old.reduced_state, new.reduced_state)
    for old, new in zip(library.maneuvers, read.maneuvers, strict=True):
        np.testing.assert_array_equal(old.displacement, new.displacement)
        np.testing.assert_allclose(old.course.time, new.course.time, atol=1e-14)
        np.testing.assert_allclose(old.course.pose, new.course.pose, atol=1e-13)
        np.testing.assert_array_equal(old.course.control + 0.0, new.course.control)


def edited(path: Path, **changes: object) -> None:
    """Change keys of the first maneuver; the hash goes."""
    document = json.loads(path.read_text())
    del document["hash"]
    document["maneuvers"][0] |= changes
    path.write_text(json.dumps(document))


@pytest.fixture
def start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A library of one maneuver, from rest to 1 m/s in a second, in the current folder."""
    monkeypatch.chdir(tmp_path)
    grid = {"speed": [0.0, 1.0], "steering": [0.0]}
    library = Automaton.of_model(inertia.CAR, grid)
    save_library(replace(library, maneuvers=library.maneuvers[:1]), "car.json")
    return Path("car.json")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"displacement": [0.6, 0.0, 0.0]},
         "maneuver 'speed 0, steering 0 to speed 1, steering 0': its course must run from the "
         "identity and time 0 to its displacement and duration, got a difference of 0.1"),
        ({"duration": 1.5}, "its course must run from the identity and time 0"),
        ({"control": [[2.0, 0.0]]}, "acceleration = 2 is outside the limits [-1, 1]"),
        ({"control": [[0.5, 0.0]], "displacement": [0.25, 0.0, 0.0]},
         "maneuver 'speed 0, steering 0 to speed 1, steering 0': ends at the reduced state "
         "(0.5, 0), but trim 'speed 1, steering 0' has (1, 0)"),
        ({"control": [[1.0, 0.0], [-1.0, 0.0]], "until": [3.0, 5.0],
          "displacement": [8.5, 0.0, 0.0], "duration": 5.0},
         "is outside the limits [-2.5, 2.5]"),
    ],
)  # fmt: skip
def test_a_file_cannot_lie_about_its_maneuvers(start, changes, message):
    edited(start, **changes)
    with pytest.raises(InvalidLibrary) as error:
        load_library(start)
    assert message in str(error.value)
    assert str(error.value).startswith("car.json: maneuver")


def test_a_file_cannot_lie_about_its_trims(start):
    document = json.loads(start.read_text())
    del document["hash"]
    document["trims"][1] |= {"control": [0.5, 0.0]}
    start.write_text(json.dumps(document))
    with pytest.raises(InvalidLibrary) as error:
        load_library(start)
    assert str(error.value) == (
        "car.json: trims[1] 'speed 1, steering 0': is no trim, its speed changes by 0.5 per second"
    )
    document["trims"][1] |= {"control": [0.0, 0.0], "reduced_state": [4.0, 0.0]}
    start.write_text(json.dumps(document))
    with pytest.raises(InvalidLibrary, match=r"speed = 4 is outside the limits \[-2\.5, 2\.5\] of"):
        load_library(start)


def test_odd_durations_read_back_to_the_same_hash(path):
    sled = UserModel(
        name="sled",
        group=SE2,
        control_names=("push", "spin"),
        reduced_names=("speed", "turn_rate"),
        velocity=lambda z, u: [z[0], 0.2 * z[1], z[1]],
        dynamics=lambda z, u: [u[0] - z[0], u[1] - z[1]],
    )
    rng = np.random.default_rng(3)
    controls, durations = rng.uniform(-1.0, 1.0, (30, 2)), rng.uniform(0.01, 0.2, 30)
    course = drive(sled, [0.0, 0.0], control=controls, durations=durations)
    end = course.reduced_state[-1]
    source, target = (
        Trim(name=name, body_velocity=sled.velocity(z, z), control=z, reduced_state=z)
        for name, z in (("rest", np.zeros(2)), ("there", end))
    )
    wild = Maneuver(
        name="wild",
        source="rest",
        target="there",
        displacement=course.pose[-1],
        duration=float(course.time[-1]),
        course=course,
    )
    library = Automaton(sled, (source, target), (wild,))
    save_library(library, path)
    again = load_library(path, model=sled)
    assert automaton_hash(again) == automaton_hash(library)
    save_library(again, path)
    assert automaton_hash(load_library(path, model=sled)) == automaton_hash(library)
    np.testing.assert_allclose(again.maneuvers[0].course.pose, course.pose, atol=1e-13)


AHEAD = {"name": "ahead", "control": [1.5, 0.0], "body_velocity": [1.5, 0.0, 0.0]}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"format": "something"},
            ': is not a library, need an object with "format": "maneuver-automaton library"',
        ),
        ({"schema": 2}, ": schema: got 2, need 1"),
        ({"colour": "red"}, ": library: unknown key 'colour', need format, schema, name, comment, "
                            "hash, model, trims, maneuvers"),
        ({"trims": None}, ": library: the key 'trims' is missing"),
        ({"trims": []}, ": automaton: got no trim, need at least one"),
        ({"trims": {}}, ": trims: got {}, need a list"),
        ({"trims": [5]}, ": trims[0]: got 5, need an object"),
        ({"trims": [AHEAD | {"control": "abc"}]},
         ": trims[0]: control: got 'abc', need a list of numbers"),
        ({"trims": [AHEAD | {"control": [True, 0.0]}]},
         ": trims[0]: control: got True, need a number"),
        ({"trims": [AHEAD | {"control": [1.5]}]},
         ": trim 'ahead': got twist (3,) and control (1,), need (3,) and (2,) for the unicycle"),
        ({"trims": [AHEAD, AHEAD]}, ": trim 'ahead': the name is used twice"),
        ({"trims": [AHEAD | {"body_velocity": [1.0, 0.0, 0.0]}]},
         ": trims[0] 'ahead': got the body velocity [1.0, 0.0, 0.0], but the unicycle moves with "
         "[1.5, 0.0, 0.0] under this control"),
        ({"trims": [AHEAD | {"control": [3.0, 0.0], "body_velocity": [3.0, 0.0, 0.0]}]},
         ": trims[0] 'ahead': speed = 3 is outside the limits [-2, 2] of the unicycle"),
        ({"trims": [AHEAD | {"max_duration": -1}]},
         ": trim 'ahead': max_duration must be positive, got -1.0 s"),
        ({"model": {"kind": "tank"}}, ": model: got the kind 'tank', need one of " + KINDS +
         "; a model of your own has to be given: to load_library, or by --model MODULE:OBJECT"),
        ({"model": {"kind": "car"}}, ": model: the key 'wheelbase' is missing"),
        ({"model": {"kind": "car", "wheelbase": -1}},
         ": car: wheelbase must be positive, got -1.0"),
        ({"maneuvers": [{"name": "m", "source": "ahead", "target": "spinn",
                         "displacement": [0, 0, 0], "duration": 0}]},
         ": no trim 'spinn' among ahead, spin; did you mean 'spin'?"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said(path, changes, message):
    edit(path, **changes)
    with pytest.raises(InvalidLibrary) as error:
        load_library(path)
    assert str(error.value) == f"robot.json{message}"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"{", ":1: not valid JSON: Expecting property name enclosed in double quotes"),
        (b"\xff\xfe\x00", ": is not a text file in UTF-8"),
        (b'{"a": 1, "a": 2}', ": not valid JSON: the key 'a' stands twice"),
        (b"[1]", ': is not a library, need an object with "format": "maneuver-automaton library"'),
    ],
)
def test_files_that_are_no_library(path, content, message):
    path.write_bytes(content)
    with pytest.raises(InvalidLibrary) as error:
        load_library(path)
    assert str(error.value) == f"robot.json{message}"


def test_deep_nonsense(path):
    path.write_text("[" * 100_000)
    with pytest.raises(InvalidLibrary, match=r"^robot\.json: not valid JSON: "):
        load_library(path)


def test_no_file(tmp_path):
    with pytest.raises(InvalidLibrary) as error:
        load_library(tmp_path / "nowhere.json")
    assert str(error.value) == f"{tmp_path / 'nowhere.json'}: no such file"

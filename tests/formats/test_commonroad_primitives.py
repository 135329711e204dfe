"""Motion primitives of CommonRoad: to automata and back, what holds, and what is wrong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.library import load_library, save_library
from maneuver_automaton.automaton.validation import validate
from maneuver_automaton.errors import InvalidLibrary
from maneuver_automaton.formats.commonroad_primitives import (
    VEHICLES,
    RoadPrimitives,
    automaton_of_commonroad_primitives,
    commonroad_primitives_of_automaton,
    commonroad_primitives_text,
    deviation_of,
    read_commonroad_primitives,
    save_commonroad_primitives,
    vehicle_of,
)
from maneuver_automaton.models import SecondOrderCar, Unicycle
from maneuver_automaton.primitives import Maneuver
from maneuver_automaton.primitives.connecting import maneuver_defect
from tests.formats.outside import DATA, message_of, needs_data

CAR = SecondOrderCar(
    wheelbase=2.0, max_steering=0.6, max_speed=2.0, max_acceleration=1.0, max_steering_rate=0.5
)


def state(tag, x, velocity, step, *, y=0.0):
    return (
        f"<{tag}><x>{x}</x><y>{y}</y><steering_angle>0.0</steering_angle><velocity>{velocity}"
        f"</velocity><orientation>0.0</orientation><time_step>{step}</time_step></{tag}>\n"
    )


XML = (
    '<?xml version="1.0" ?>\n<MotionPrimitiveFile>\n<VehicleType>BMW_320i</VehicleType>\n'
    '<Trajectories>\n<Trajectory>\n<Duration unit="deci-second">2</Duration>\n'
    + state("Initial", 0, 2.0, 0)
    + state("Final", 0.6, 4.0, 2)
    + "<Path>\n"
    + state("State", 0.25, 3.0, 1)
    + "</Path>\n</Trajectory>\n</Trajectories>\n</MotionPrimitiveFile>\n"
)


def library():
    """Trims of a car, and maneuvers that last whole tenths of a second."""
    grid = {"speed": [0.0, 1.0, 2.0], "steering": [-0.5, 0.0, 0.5]}
    return Automaton.of_model(CAR, grid)


def assert_same(one, other, *, atol):
    for a, b in zip(one.maneuvers, other.maneuvers, strict=True):
        np.testing.assert_allclose(a.displacement, b.displacement, atol=atol)
        assert a.duration == pytest.approx(b.duration, abs=1e-12)
        np.testing.assert_allclose(
            one[a.source].reduced_state, other[b.source].reduced_state, atol=1e-12
        )
        np.testing.assert_allclose(
            one[a.target].reduced_state, other[b.target].reduced_state, atol=1e-12
        )


def test_a_primitive_is_a_maneuver_between_states(tmp_path):
    path = tmp_path / "a.xml"
    path.write_text(XML)
    file = read_commonroad_primitives(path)
    automaton = automaton_of_commonroad_primitives(file)
    assert automaton.trim_names == ("speed 2, steering 0", "speed 4, steering 0")
    (one,) = automaton.maneuvers
    assert one.duration == pytest.approx(0.2)
    np.testing.assert_allclose(one.displacement, [0.6, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(one.course.control[0], [10.0, 0.0], atol=1e-9)
    position, said = deviation_of(file, automaton)
    assert ", 0 primitives are" in said
    assert "(primitive 1)" in said
    assert position < 1e-12


@pytest.mark.parametrize("seconds", ["0.2", "0.25"])
def test_a_duration_may_be_in_seconds(tmp_path, seconds):
    path = tmp_path / "a.xml"
    path.write_text(XML.replace('"deci-second">2<', f'"second">{seconds}<'))
    file = read_commonroad_primitives(path)
    assert file.steps() == (pytest.approx(float(seconds) / 2),)
    (one,) = automaton_of_commonroad_primitives(file).maneuvers
    assert one.duration == pytest.approx(float(seconds))
    np.testing.assert_allclose(one.course.control[0], [2.0 / float(seconds), 0.0], atol=1e-9)
    save_commonroad_primitives(file, tmp_path / "b.xml")
    assert f'<Duration unit="second">{seconds}</Duration>' in (tmp_path / "b.xml").read_text()
    again = read_commonroad_primitives(tmp_path / "b.xml")
    assert again.primitives[0].seconds == file.primitives[0].seconds


def test_what_does_not_hold_is_named(tmp_path):
    path = tmp_path / "a.xml"
    path.write_text(XML.replace("<x>0.25</x>", "<x>0.26</x>"))
    file = read_commonroad_primitives(path)
    position, said = deviation_of(file, automaton_of_commonroad_primitives(file))
    assert position == pytest.approx(0.01)
    assert ", 1 primitive is more than 1e-05 m or rad off their states; at most 0.01 m" in said


def test_a_primitive_that_was_cut_keeps_the_step_of_whole_ones(tmp_path):
    cut = XML.split("<Trajectories>\n")[1].split("</Trajectories>")[0]
    cut = cut.split("<Path>")[0] + "<Path/>\n</Trajectory>\n"
    cut = cut.replace("<x>0.6</x>", "<x>0.25</x>").replace("4.0</velocity>", "3.0</velocity>")
    cut = cut.replace("<time_step>2</time_step>", "<time_step>1</time_step>")
    path = tmp_path / "a.xml"
    path.write_text(XML.replace("</Trajectories>", cut + "</Trajectories>"))
    file = read_commonroad_primitives(path)
    assert file.steps() == (0.1, 0.1)
    automaton = automaton_of_commonroad_primitives(file)
    assert [round(one.duration, 12) for one in automaton.maneuvers] == [0.2, 0.1]
    assert ", 0 primitives are" in deviation_of(file, automaton)[1]


def test_our_own_library_there_and_back(tmp_path):
    automaton = library()
    file = commonroad_primitives_of_automaton(automaton)
    assert file.vehicle is None
    save_commonroad_primitives(file, tmp_path / "a.xml")
    assert "<Start>" in (tmp_path / "a.xml").read_text()
    again = read_commonroad_primitives(tmp_path / "a.xml")
    assert vehicle_of(again).wheelbase == pytest.approx(2.0, rel=1e-9)
    assert_same(automaton_of_commonroad_primitives(again, vehicle=CAR), automaton, atol=1e-9)
    assert deviation_of(again, automaton_of_commonroad_primitives(again))[0] < 1e-9


def test_a_known_vehicle_is_named(tmp_path):
    automaton = Automaton.of_model(
        VEHICLES["BMW_320i"], {"speed": [0.0, 2.3], "steering": [-0.2, 0.0, 0.2]}
    )
    file = commonroad_primitives_of_automaton(automaton)
    assert file.vehicle == "BMW_320i"
    save_commonroad_primitives(file, tmp_path / "a.xml")
    again = automaton_of_commonroad_primitives(read_commonroad_primitives(tmp_path / "a.xml"))
    assert again.model == automaton.model
    assert_same(again, automaton, atol=1e-9)


def test_what_the_format_cannot_state():
    automaton = library()
    with pytest.raises(InvalidLibrary, match="got an automaton of the unicycle"):
        commonroad_primitives_of_automaton(Automaton.of_controls(Unicycle(), {"go": (1, 0)}))
    with pytest.raises(InvalidLibrary, match="has no maneuver; a file of CommonRoad"):
        commonroad_primitives_of_automaton(replace(automaton, maneuvers=()))
    unknown = Maneuver(
        name="jump", source=automaton.trim_names[0], target=automaton.trim_names[1],
        displacement=[1.0, 0.0, 0.0], duration=1.0,
    )  # fmt: skip
    with pytest.raises(InvalidLibrary, match="'jump': has no course"):
        commonroad_primitives_of_automaton(replace(automaton, maneuvers=(unknown,)))
    odd = Automaton.of_model(CAR, {"speed": [0.0, 0.123], "steering": [0.0]})
    with pytest.raises(InvalidLibrary, match=r"lasts 0.123 s, but .* whole tenths of a second"):
        commonroad_primitives_of_automaton(odd)


def test_a_wheelbase_that_nothing_tells(tmp_path):
    path = tmp_path / "a.xml"
    path.write_text(XML.replace("BMW_320i", "TANK"))
    with pytest.raises(InvalidLibrary, match="vehicle: TANK; no primitive turns"):
        automaton_of_commonroad_primitives(read_commonroad_primitives(path))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("<Duration unit=\"deci-second\">2", "<Duration unit=\"minute\">2",
         ":6: Duration: unit: got 'minute', need deci-second or second"),
        ("<Duration unit=\"deci-second\">2", "<Duration unit=\"second\">0",
         ":6: Duration: got 0, need a positive number of seconds"),
        (">2</Duration>", ">2.5</Duration>",
         ":6: Duration: got 2.5, need a whole number of at least 1"),
        (">2</Duration>", ">long</Duration>",
         ":6: Duration: got 'long', need a finite number"),
        ("<Initial><x>0</x>", "<Initial><x>1</x>",
         ":7: x: got 1, need 0: a primitive begins at the origin"),
        ("<x>0.25</x>", "", ":10: State: the element x is missing"),
        ("<velocity>3.0", "<velocity>1e7",
         ":10: velocity: got 1e+07 m/s, need at most 5000 m/s in size"),
        ("<x>0</x><y>0.0</y><steering_angle>0.0", "<x>0</x><y>0.0</y><steering_angle>3",
         ":7: steering_angle: got 3 rad, need at most 1.5 rad in size"),
        ("<time_step>1</time_step>", "<time_step>3</time_step>",
         ":10: time_step: got 3, need 1"),
        ("<VehicleType>BMW_320i</VehicleType>", "<VehicleType/>",
         ":3: VehicleType: is empty, need the name of a vehicle"),
        ("</Trajectories>\n", "", ":13: not valid XML: mismatched tag"),
    ],
)  # fmt: skip
def test_what_is_wrong(tmp_path, old, new, message):
    assert XML.count(old) == 1
    said = message_of(read_commonroad_primitives, tmp_path / "a.xml", XML.replace(old, new))
    assert said == message


def test_files_without_primitives(tmp_path):
    path = tmp_path / "a.xml"
    said = message_of(read_commonroad_primitives, path, "<Trajectories/>")
    assert said == ":1: Trajectories: holds no Trajectory, need at least one"
    said = message_of(read_commonroad_primitives, path, "<commonRoad/>")
    assert said.startswith(":1: commonRoad: need MotionPrimitiveFile or Trajectories")


@needs_data
@pytest.mark.parametrize(
    ("name", "trims", "maneuvers", "beyond", "position"),
    [("V_0.0", 77, 224, 13, 1.3e-3), ("V_9.0", 3, 7, 0, 2e-7)],
)
def test_files_of_commonroad(tmp_path, name, trims, maneuvers, beyond, position):
    (path,) = (DATA / "commonroad" / "primitives").glob(f"{name}*.xml")
    file = read_commonroad_primitives(path)
    assert commonroad_primitives_text(file) == path.read_text()
    automaton = automaton_of_commonroad_primitives(file)
    assert (len(automaton), len(automaton.maneuvers)) == (trims, maneuvers)
    assert automaton.model.wheelbase == 2.5789128
    furthest, said = deviation_of(file, automaton)
    assert f", {beyond} primitive" in said
    assert furthest < position
    for one in automaton.maneuvers[::20]:
        ends = {"source": automaton[one.source], "target": automaton[one.target]}
        assert maneuver_defect(automaton.model, one, **ends) < 1e-9
    written = commonroad_primitives_of_automaton(automaton)
    assert_same(automaton_of_commonroad_primitives(written), automaton, atol=1e-12)
    unnamed = vehicle_of(RoadPrimitives(primitives=file.primitives))
    assert unnamed.wheelbase == pytest.approx(2.5789128, rel=1e-5)
    assert validate(automaton).unused == ()
    save_library(automaton, tmp_path / "a.json")
    assert_same(load_library(tmp_path / "a.json"), automaton, atol=1e-9)

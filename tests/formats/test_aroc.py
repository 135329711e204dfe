"""Exports of AROC: folders of primitives whose steering is an input."""

from __future__ import annotations

import math
import zipfile

import numpy as np
import pytest

from maneuver_automaton.automaton.library import load_library, save_library
from maneuver_automaton.errors import InvalidLibrary, InvalidScenario
from maneuver_automaton.formats.aroc import (
    automaton_of_aroc,
    deviation_of,
    export_at,
    read_aroc,
    wheelbase_of,
)
from maneuver_automaton.formats.libraries import read_primitives
from maneuver_automaton.models import AcceleratingCar
from maneuver_automaton.planning import plan
from maneuver_automaton.primitives.connecting import maneuver_defect
from maneuver_automaton.primitives.driving import drive
from maneuver_automaton.scenario import load_scenario
from tests.quickly import quick_are
from tests.search.cases import compiled_only

CAR = AcceleratingCar(wheelbase=2.5, max_steering=0.5, max_speed=12.0, max_acceleration=4.0)


def primitive(speed, inputs, successors, *, points=((0, 0), (1, 0), (1, 1))):
    """The text of a file: half a second of each input, at fine steps."""
    parts = 40
    control = np.repeat(np.array(inputs, dtype=float), parts, axis=0)
    spans = np.full(len(control), 0.5 / parts)
    course = drive(CAR, [speed], control=control, durations=spans, max_step_m=9, max_step_rad=9)
    assert course.time.size == spans.size + 1
    states = "".join(
        f"<state><time>{t!r}</time><x>{x!r}</x><y>{y!r}</y><velocity>{v!r}</velocity>"
        f"<orientation>{heading!r}</orientation></state>\n"
        for t, (x, y, heading), (v,) in zip(
            course.time.tolist(), course.pose.tolist(), course.reduced_state.tolist(), strict=True
        )
    )
    given = "".join(
        f"<input><acceleration>{a}</acceleration><steer>{s}</steer></input>\n" for a, s in inputs
    )
    corners = "".join(
        f'<point><value dimension="1">{x}</value><value dimension="2">{y}</value></point>'
        for x, y in points
    )
    follow = "".join(f"<id>{k}</id>" for k in successors)
    return (
        f"<primitive>\n<successors>{follow}</successors>\n<trajectory>\n<states>\n{states}"
        f"</states>\n<inputs>\n{given}</inputs>\n</trajectory>\n<occupancySet><occupancy><time>"
        "<intervalStart>0</intervalStart><intervalEnd>0.5</intervalEnd></time>"
        f"<set>{corners}</set></occupancy></occupancySet>\n</primitive>\n"
    )


@pytest.fixture
def export(tmp_path):
    folder = tmp_path / "automaton"
    (folder / "primitives").mkdir(parents=True)
    texts = {
        "go.xml": primitive(10.0, [(2.0, 0.1), (2.0, -0.1)], [3]),
        "left.xml": primitive(10.0, [(0.0, 0.2)], [1, 2]),
        "slow.xml": primitive(12.0, [(-4.0, 0.0)], [1]),
    }
    for name, text in texts.items():
        (folder / "primitives" / name).write_text(text)
    names = "".join(f"<primitive>{name}</primitive>\n" for name in texts)
    (folder / "automaton.xml").write_text(f"<automaton>\n{names}</automaton>\n")
    return folder


def test_speeds_are_trims_and_primitives_maneuvers(export, tmp_path):
    assert export_at(export) == export_at(export / "automaton.xml") == export_at(tmp_path) == export
    assert export_at(export / "primitives") is None
    primitives = read_aroc(export)
    assert wheelbase_of(primitives) == pytest.approx(2.5, rel=1e-4)
    automaton = automaton_of_aroc(primitives, model=CAR)
    assert automaton.trim_names == ("speed 10", "speed 12")
    joined = [(one.name, one.source, one.target) for one in automaton.maneuvers]
    assert joined == [
        ("go", "speed 10", "speed 12"),
        ("left", "speed 10", "speed 10"),
        ("slow", "speed 12", "speed 10"),
    ]
    position, said = deviation_of(primitives, automaton)
    assert position < 1e-9
    assert "1 pair may follow each other" in said  # left may follow slow
    for one in automaton.maneuvers:
        ends = {"source": automaton[one.source], "target": automaton[one.target]}
        assert maneuver_defect(automaton.model, one, **ends) < 1e-9
    fitted = automaton_of_aroc(primitives)
    assert deviation_of(primitives, fitted)[0] < 1e-3
    save_library(automaton, tmp_path / "a.json")
    loaded = load_library(tmp_path / "a.json")
    np.testing.assert_array_equal(
        loaded.maneuvers[0].displacement, automaton.maneuvers[0].displacement
    )


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("automaton.xml", "go.xml", "gone.xml", "gone.xml: no such file"),
        ("automaton.xml", "go.xml", "../go.xml",
         ":2: primitive: got '../go.xml', need the name of a file in primitives"),
        ("primitives/go.xml", "<id>3</id>", "<id>4</id>",
         ":2: id: got 4, need the number of a primitive, 1 to 3"),
        ("primitives/go.xml", "<time>0.0</time>", "<time>1.0</time>",
         ":6: time: got 0.0125, need more than 1, that of the state before"),
        ("primitives/go.xml", "<steer>0.1</steer>", "",
         ": input: the element steer is missing"),
    ],
)  # fmt: skip
def test_what_is_wrong(export, file, old, new, message):
    text = (export / file).read_text()
    assert old in text
    (export / file).write_text(text.replace(old, new, 1))
    with pytest.raises(InvalidScenario) as error:
        read_aroc(export)
    assert str(error.value).endswith(message)
    assert "\n" not in str(error.value)


def test_inputs_that_do_not_fit_the_states(export):
    path = export / "primitives" / "left.xml"
    one = "<input><acceleration>0.0</acceleration><steer>0.2</steer></input>\n"
    path.write_text(path.read_text().replace(one, 3 * one))
    with pytest.raises(InvalidScenario, match="got 3 inputs for 41 states"):
        read_aroc(export)


def test_a_successor_at_another_speed(export):
    path = export / "primitives" / "go.xml"
    path.write_text(path.read_text().replace("<id>3</id>", "<id>2</id>"))
    with pytest.raises(InvalidLibrary, match=r"go.xml: ends at 12 m/s, .* left.xml begins at 10"):
        automaton_of_aroc(read_aroc(export))


def test_a_car_that_never_turns(export):
    for name in ("go", "left"):
        path = export / "primitives" / f"{name}.xml"
        path.write_text(primitive(10.0, [(2.0 if name == "go" else 0.0, 0.0)] * 2, []))
    with pytest.raises(InvalidLibrary, match="nothing tells the wheelbase"):
        automaton_of_aroc(read_aroc(export))


def test_the_accelerating_car():
    assert CAR.reduced_dynamics(np.array([3.0]), np.array([2.0, 0.1])).tolist() == [2.0]
    twist = CAR.body_velocity(np.array([[5.0]]), np.array([0.0, math.atan(0.5)]))
    np.testing.assert_allclose(twist, [[5.0, 0.0, 1.0]])
    assert CAR.reduced_limits.tolist() == [[-12.0, 12.0]]
    assert CAR.control_limits.tolist() == [[-4.0, 4.0], [-0.5, 0.5]]


def zipped(export, target, *, within=""):
    with zipfile.ZipFile(target, "w") as archive:
        for file in (export / "automaton.xml", *sorted((export / "primitives").iterdir())):
            archive.write(file, within + str(file.relative_to(export)))
    return target


@pytest.mark.parametrize("within", ["", "export/"])
def test_an_archive_is_read_as_its_folder(export, tmp_path, within):
    packed = read_aroc(zipped(export, tmp_path / "a.zip", within=within))
    for one, other in zip(packed, read_aroc(export), strict=True):
        assert (one.name, one.successors) == (other.name, other.successors)
        np.testing.assert_array_equal(one.states, other.states)


def test_a_broken_archive_is_told_by_its_name(export, tmp_path):
    path = zipped(export, tmp_path / "a.zip")
    path.write_bytes(path.read_bytes()[:-30])
    with pytest.raises(InvalidScenario, match=r"a\.zip: cannot be read as a zip archive"):
        read_primitives(path)
    (export / "primitives" / "go.xml").write_text("<primitive>")
    with pytest.raises(InvalidScenario, match=r"b\.zip/primitives/go\.xml:1: not valid XML"):
        read_primitives(zipped(export, tmp_path / "b.zip"))


@compiled_only
@pytest.mark.parametrize("y", quick_are([3.5], [3.5, -1.0], exhaustive=True))
def test_the_car_of_a_file_changes_lanes(export, tmp_path, y):
    """By maneuvers that lead from a speed to itself, at 10 m/s: 12.28 s straight ahead."""
    text = (export / "primitives" / "left.xml").read_text()
    right = primitive(10.0, [(0.0, -0.2)], [1, 2])
    (export / "primitives" / "right.xml").write_text(right)
    (export / "primitives" / "left.xml").write_text(text)
    listed = (export / "automaton.xml").read_text()
    longer = listed.replace("</automaton>", "<primitive>right.xml</primitive>\n</automaton>")
    (export / "automaton.xml").write_text(longer)
    zipped(export, tmp_path / "car.zip")
    file = tmp_path / "lane.yaml"
    file.write_text(
        "schema: 1\nvehicle: {model: accelerating_car, wheelbase_m: 2.5, max_steering_rad: 0.5,\n"
        "  max_speed_m_s: 12, min_speed_m_s: 0, max_acceleration_m_s2: 4}\n"
        "automaton: {file: car.zip}\nstart: {pose: [0, 0, 0], trim: speed 10}\n"
        f"goal: {{pose: [122.8, {y}, 0], trim: speed 10}}\n"
        "search: {polish: false, max_expansions: 500}\n"
    )
    problem = load_scenario(file).problem
    result = plan(problem, time_limit=60.0)
    assert 12.28 < result.cost < 12.4
    assert result.audit.passed
    np.testing.assert_allclose(result.plan.end, [122.8, y, 0.0], atol=1e-9)
    file.write_text(file.read_text().replace("max_steering_rad: 0.5", "max_steering_rad: 0.1"))
    with pytest.raises(InvalidScenario, match=r"steering angle of -?0[.]2, but the vehicle"):
        load_scenario(file)

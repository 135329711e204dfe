"""Obstacles and bodies of scenario files as shapes, and back."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maneuver_automaton.collision import (
    Box,
    Disc,
    Motion,
    Obstacle,
    OccupancyMap,
    Polygon,
)
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.nav2_map import save_nav2_map
from maneuver_automaton.groups import SE2
from maneuver_automaton.scenario import Scenario, load_scenario, scenario_of_text, to_yaml
from tests.formats.outside import DATA, needs_data
from tests.scenario.files import SCENARIO, but
from tests.scenario.test_scenario import assert_same

WORLD = """\
obstacles:
  - {polygon_m: [[1, 1], [5, 1], [5, 5], [1, 5]], holes_m: [[[2, 2], [3, 2], [3, 3]]]}
  - {disc_m: {center: [3, 0], radius: 0.5}}
  - {box_m: {center: [0, 4], size: [10, 1], heading_rad: 0.1}, height_m: [0, 3]}
  - {disc_m: {center: [0, 0], radius: 0.3}, motion: [[0, 1, 2, 0], [2.5, 3, 2, 1]]}
"""


def read(text):
    return scenario_of_text(text, name="x.yaml")


def solids(text=WORLD):
    return read(SCENARIO + text).problem.obstacles


def test_shapes_of_obstacles():
    wall, pillar, bar, walker = solids()
    assert isinstance(wall.shape, Polygon)
    assert wall.shape.corners.tolist() == [[1, 1], [5, 1], [5, 5], [1, 5]]
    assert [hole.tolist() for hole in wall.shape.holes] == [[[2, 2], [3, 2], [3, 3]]]
    assert isinstance(pillar.shape, Disc)
    assert (pillar.shape.center.tolist(), pillar.shape.radius) == ([3, 0], 0.5)
    assert isinstance(bar.shape, Box)
    assert (bar.shape.center.tolist(), bar.shape.size.tolist()) == ([0, 4], [10, 1])
    assert bar.shape.heading == 0.1
    assert bar.height == (0.0, 3.0)
    assert walker.motion.time.tolist() == [0.0, 2.5]
    assert walker.at(1.25).center.tolist() == [2.0, 2.0]
    assert (wall.motion, wall.height) == (None, None)


def test_names_of_obstacles():
    assert [o.name for o in solids()] == [f"obstacle {k}" for k in (1, 2, 3, 4)]


def test_a_ring_may_be_closed_and_stutter():
    (wall,) = solids("obstacles: [{polygon_m: [[0, 0], [1, 0], [1, 0], [0, 1], [0, 0]]}]\n")
    assert wall.shape.corners.tolist() == [[0, 0], [1, 0], [0, 1]]


def test_margin_and_search_reach_the_problem():
    problem = read(
        but("time_limit_s: 5.0", "method: lattice, cell_m: 0.5, headings: 36, weight: 1.5")
        + "margin_m: 0.25\n"
    ).problem
    assert problem.margin == 0.25
    search = problem.search
    assert (search.method, search.cell, search.headings, search.weight) == ("lattice", 0.5, 36, 1.5)


@pytest.mark.parametrize(
    ("text", "corners"),
    [
        ("{rectangle_m: [4, 2]}", [[-2, -1], [2, -1], [2, 1], [-2, 1]]),
        ("{rectangle_m: [4, 2], reference_m: [-1, 0]}", [[-1, -1], [3, -1], [3, 1], [-1, 1]]),
        ("{rectangle_m: [4, 2], reference_m: [1, 0.5]}",
         [[-3, -1.5], [1, -1.5], [1, 0.5], [-3, 0.5]]),
        ("{polygon_m: [[0, 0], [3, 0], [0, 1]]}", [[0, 0], [3, 0], [0, 1]]),
    ],
)  # fmt: skip
def test_a_body_is_where_plotting_draws_it(text, corners):
    from maneuver_automaton.plotting.track import footprint_polygons

    scenario = read(but("{model: unicycle}", f"{{model: unicycle, footprint: {text}}}"))
    (body,) = scenario.problem.footprint
    assert body.corners.tolist() == corners
    (drawn,) = footprint_polygons(scenario.problem.footprint)
    assert drawn.tolist() == corners


def test_a_body_of_discs():
    text = "{model: unicycle, footprint: [{disc_m: 0.5}, {rectangle_m: [1, 1]}]}"
    scenario = read(but("{model: unicycle}", text))
    disc, box = scenario.problem.footprint
    assert (disc.radius, disc.center.tolist()) == (0.5, [0.0, 0.0])
    assert isinstance(box, Box)
    assert scenario.footprint == ({"disc_m": 0.5}, {"rectangle_m": (1.0, 1.0)})


def test_a_world_goes_to_yaml_and_back():
    scenario = read(SCENARIO + WORLD + "margin_m: 0.1\n")
    assert_same(read(to_yaml(scenario)), scenario)


number = st.floats(-1e6, 1e6)
positive = st.floats(1e-3, 1e3)
points = st.tuples(number, number)


def triangles():
    """Corners that are never on one line."""
    return st.tuples(points, positive, positive).map(
        lambda t: [t[0], (t[0][0] + t[1], t[0][1]), (t[0][0], t[0][1] + t[2])]
    )


def motions():
    steps = st.lists(positive, min_size=0, max_size=3)
    return st.builds(
        lambda begin, more, pose: Motion(
            np.cumsum([begin, *more]), [[pose[0] + k, *pose[1:]] for k in range(len(more) + 1)]
        ),
        st.floats(-1e3, 1e3),
        steps,
        st.tuples(number, number, number),
    )


shapes = (
    st.builds(Polygon, triangles())
    | st.builds(Disc, positive, points)
    | st.builds(Box, st.tuples(positive, positive), points, number)
)
obstacles = st.builds(
    Obstacle,
    shapes,
    height=st.none() | st.tuples(st.floats(-9.0, 0.0), st.floats(1.0, 9.0)),
    motion=st.none() | motions(),
)
bodies = (
    st.builds(Polygon, triangles())
    | st.builds(Disc, positive)
    | st.builds(Box, st.tuples(positive, positive), points)
)


@given(st.lists(obstacles, max_size=4), st.lists(bodies, max_size=3), st.floats(0.0, 10.0))
def test_any_world_goes_to_yaml_and_back(world, body, margin):
    scenario = read(SCENARIO)
    problem = replace(scenario.problem, obstacles=world, footprint=body, margin=margin)
    scenario = replace(scenario, problem=problem)
    assert_same(read(to_yaml(scenario)), scenario)


def test_a_turned_body_is_written_as_its_corners():
    scenario = read(SCENARIO)
    body = Box([2.0, 1.0], heading=math.pi / 3)
    scenario = replace(scenario, problem=replace(scenario.problem, footprint=body))
    (again,) = read(to_yaml(scenario)).problem.footprint
    assert again.corners.tolist() == body.corners.tolist()


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (Disc(1.0, [1.0, 0.0]), "footprint: a scenario file can state a disc around the pose only"),
        (
            Polygon([[0, 0], [9, 0], [0, 9]], [[[1, 1], [2, 1], [1, 2]]]),
            "footprint: a scenario file cannot state the holes of a body",
        ),
    ],
)
def test_bodies_that_a_file_cannot_state(body, message):
    scenario = read(SCENARIO)
    with pytest.raises(ValueError) as error:
        to_yaml(replace(scenario, problem=replace(scenario.problem, footprint=body)))
    assert str(error.value) == message


class TestMap:
    @pytest.fixture
    def folder(self, tmp_path, monkeypatch):
        """The current folder, with a map in maps/ and a scenario in cases/ that names it."""
        monkeypatch.chdir(tmp_path)
        Path("cases").mkdir()
        cells = OccupancyMap([[1, 0], [0, 0]], resolution=0.5, origin=[1.0, 2.0, 0.3])
        save_nav2_map(cells, Path("maps/room.yaml"))
        text = SCENARIO + "obstacles:\n  - {map: ../maps/room.yaml}\n"
        Path("cases/x.yaml").write_text(text)
        return tmp_path

    def test_is_found_beside_the_file(self, folder):
        (cells,) = load_scenario("cases/x.yaml").problem.obstacles
        assert isinstance(cells, OccupancyMap)
        assert cells.blocked.tolist() == [[True, False], [False, False]]
        assert cells.origin.tolist() == [1.0, 2.0, 0.3]
        assert cells.name == "room.yaml"

    def test_unknown_cells(self, folder):
        Path("maps/room.pgm").write_bytes(b"P5 2 2 255\n" + bytes([150, 254, 0, 254]))
        path = Path("cases/x.yaml")
        (strict,) = load_scenario(path).problem.obstacles
        assert strict.blocked.tolist() == [[True, False], [True, False]]
        path.write_text(path.read_text().replace("room.yaml}", "room.yaml, unknown: free}"))
        scenario = load_scenario(path)
        (lenient,) = scenario.problem.obstacles
        assert lenient.blocked.tolist() == [[True, False], [False, False]]
        assert '{map: "../maps/room.yaml", unknown: free}' in to_yaml(scenario)

    @pytest.mark.parametrize(
        ("target", "reference"),
        [
            (None, "../maps/room.yaml"),
            ("cases", "../maps/room.yaml"),
            ("maps", "room.yaml"),
            (".", "maps/room.yaml"),
            ("a/b", "../../maps/room.yaml"),
        ],
    )
    def test_stays_a_reference(self, folder, target, reference):
        scenario = load_scenario("cases/x.yaml")
        text = to_yaml(scenario, folder=None if target is None else Path(target))
        assert f"  - {{map: {reference}}}\n" in text.replace('"', "")
        place = Path(target or "cases")
        place.mkdir(parents=True, exist_ok=True)
        (place / "y.yaml").write_text(text)
        (cells,) = load_scenario(place / "y.yaml").problem.obstacles
        assert cells.blocked.tolist() == scenario.problem.obstacles[0].blocked.tolist()

    def test_that_moved_has_no_file(self, folder):
        scenario = load_scenario("cases/x.yaml")
        moved = replace(scenario, problem=scenario.problem.moved(SE2([1.0, 0.0, 0.0])))
        with pytest.raises(ValueError) as error:
            to_yaml(moved)
        assert str(error.value) == (
            "obstacles: a scenario file states a map by its file, and 'room.yaml' has none; "
            "write one with save_nav2_map"
        )

    def test_that_is_malformed_names_both_files(self, folder):
        Path("maps/room.pgm").write_bytes(b"P5 2 2 255\n123")
        with pytest.raises(InvalidScenario) as error:
            load_scenario("cases/x.yaml")
        image = Path("cases/../maps/room.pgm")
        assert str(error.value) == (
            f"{Path('cases/x.yaml')}:15: obstacles[0].map: {image.with_suffix('.yaml')}:1: image: "
            f"{image}: got 3 bytes of pixels, need 4: the file is cut off"
        )

    def test_of_a_path_with_a_nul(self, folder):
        Path("cases/x.yaml").write_text(SCENARIO + 'obstacles: [{map: "a\\0b"}]\n')
        with pytest.raises(InvalidScenario, match=r"obstacles\[0\]\.map: .*cannot be read"):
            load_scenario("cases/x.yaml")


@needs_data
@pytest.mark.parametrize("name", ["S1-0", "S3-5", "S4-9", "S5-0"])
def test_car_scenarios(name):
    path = DATA / "car-scenarios" / f"{name}.yaml"
    scenario: Scenario = load_scenario(path)
    assert scenario.problem.obstacles
    assert scenario.problem.footprint[0].corners.tolist()[0] == [-0.95, -0.95]
    assert_same(read(to_yaml(scenario)), scenario)


COMES_AND_GOES = """\
obstacles:
  - {disc_m: {center: [3, 1], radius: 0.5}, present_s: [2, 3]}
  - box_m: {center: [0, 0], size: [1, 0.5]}
    motion: [[0, 0, 0, 0], [2, 2, 0, 0], [3, 2.8414709848078967, 0.4596976941318602, 1]]
    twists: [[1, 0, 0], [1, 0, 1]]
    present_s: [0, 9]
"""


def test_what_moves_on_arcs_and_comes_and_goes_is_written_and_read():
    scenario = read(SCENARIO + COMES_AND_GOES)
    door, tug = scenario.problem.obstacles
    assert door.present_s == (2.0, 3.0)
    assert tug.present_s == (0.0, 9.0)
    there = [2.0 + math.sin(0.5), 1.0 - math.cos(0.5), 0.5]
    assert tug.motion.at(2.5) == pytest.approx(there)
    assert_same(read(to_yaml(scenario)), scenario)

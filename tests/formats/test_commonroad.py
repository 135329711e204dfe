"""Scenarios of CommonRoad: lanelets, recorded traffic, goals; and what is wrong with a file."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maneuver_automaton.collision import Box, Disc, Polygon
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.commonroad import is_commonroad, read_commonroad
from tests.formats.outside import DATA, needs_data
from tests.roads.files import (
    GOAL,
    LANES,
    car,
    commonroad,
    interval,
    lanelet,
    parked,
    predicted,
    problem,
    square,
    state,
)

SCENARIOS = DATA / "commonroad" / "scenarios"


def assert_close(found, expected):
    assert_allclose(found, expected, rtol=0.0, atol=1e-9)


def read(folder, text=None):
    file = folder / "road.xml"
    file.write_text(commonroad() if text is None else text)
    return read_commonroad(file)


def test_what_a_file_states(tmp_path):
    (statement,) = read(tmp_path)
    scene = statement.road
    assert (statement.format, scene.name) == ("CommonRoad", "TST_Lanes-1_1_T-1")
    right, left = scene.lanelets
    assert (right.number, right.beside, right.speed_limit) == (1, (2,), None)
    assert (left.number, left.beside, left.speed_limit) == (2, (1,), 20.0)
    assert_close(right.center, [[0.0, 2.0], [100.0, 2.0], [200.0, 2.0]])
    assert scene.start.middle.tolist() == [10.0, 2.0, 0.0]
    assert (scene.start.speed, scene.start.turn_rate, scene.start.time) == (12.0, 0.0, 0.0)


def test_recorded_traffic_is_there_while_it_was_recorded(tmp_path):
    (statement,) = read(tmp_path)
    (other,) = statement.road.traffic
    assert other.name == "car 7"
    assert other.shape.size.tolist() == [4.5, 1.8]
    assert_close(other.motion.time[[0, -1]], [0.0, 4.0])
    assert_close(other.at(2.05).center, [35.0 + 6.0 * 2.05, 2.0])
    assert statement.road.present(4.0)
    assert not statement.road.present(4.1)


def test_the_goal_of_a_file(tmp_path):
    (statement,) = read(tmp_path)
    (goal,) = statement.road.goals
    assert goal.lanelets == (2,)
    assert_close(goal.time, [2.0, 4.0])
    assert goal.contains([50.0, 5.0, 0.1], speed=3.0, time=2.0)
    assert not goal.contains([50.0, 3.9, 0.1], speed=3.0, time=2.0)
    assert not goal.contains([50.0, 5.0, 0.3], speed=3.0, time=2.0)
    assert not goal.contains([50.0, 5.0, 0.1], speed=3.0, time=4.1)


def test_shapes_and_older_and_newer_elements(tmp_path):
    shapes = {
        "circle": "<circle><radius>0.5</radius></circle>",
        "polygon": "<polygon>"
        + "".join(f"<point><x>{x}</x><y>{y}</y></point>" for x, y in ((0, 0), (2, 0), (0, 1)))
        + "</polygon>",
    }
    others = "".join(
        f'<staticObstacle id="{k}"><type>pillar</type><shape>{shape}</shape>'
        f"{state('initialState', x=50.0, y=7.0, heading=math.pi / 2)}</staticObstacle>"
        for k, shape in enumerate(shapes.values(), start=1)
    )
    goal = (
        "<goalRegion><state><position><rectangle><length>10</length><width>3</width>"
        "<orientation>0.1</orientation><center><x>60</x><y>2</y></center></rectangle></position>"
        + interval("velocity", 5, 8)
        + interval("time", 0, 50)
        + "</state></goalRegion>"
    )
    (statement,) = read(tmp_path, commonroad(*LANES, others, problem(goal=goal)))
    round_one, cornered = (one.shape for one in statement.road.traffic)
    assert isinstance(round_one, Disc)
    assert_close(round_one.center, [50.0, 7.0])
    assert isinstance(cornered, Polygon)
    assert_close(cornered.corners, [[50.0, 7.0], [50.0, 9.0], [49.0, 7.0]])
    (goal_region,) = statement.road.goals
    assert isinstance(goal_region.places[0], Box)
    assert (goal_region.speed, goal_region.heading) == ((5.0, 8.0), None)


def test_times_are_steps(tmp_path):
    parts = (*LANES, car(7, x=35.0, y=2.0, speed=6.0, steps=8, step=0.25), problem())
    (statement,) = read(tmp_path, commonroad(*parts, step=0.25))
    assert_close(statement.road.traffic[0].motion.time[-1], 2.0)
    assert_close(statement.road.goals[0].time, [5.0, 10.0])


def test_the_time_step_is_that_of_the_file(tmp_path):
    (statement,) = read(tmp_path, commonroad(*LANES, problem(), step=0.25))
    assert statement.road.step == 0.25


def test_neighbours_in_the_opposite_direction(tmp_path):
    here = lanelet(1, 0.0, 4.0, '<adjacentLeft ref="2" drivingDir="opposite"/>')
    (statement,) = read(tmp_path, commonroad(here, LANES[1], problem()))
    assert [one.against for one in statement.road.lanelets] == [(2,), ()]
    assert [one.beside for one in statement.road.lanelets] == [(), (1,)]


def test_sets_of_occupancies_are_there_around_their_instants(tmp_path):
    sets = [
        ([square(40.0, 2.0, 4.0), square(44.0, 2.0, 2.0)], "<time><exact>2</exact></time>"),
        ([square(50.0, 2.0, 4.0)], interval("time", 4, 6)),
    ]
    (statement,) = read(tmp_path, commonroad(*LANES, predicted(7, sets, x=35.0, y=2.0), problem()))
    road = statement.road
    assert {one.name for one in road.traffic} == {"car 7"}

    def places(time):
        return sorted(one.at(time).corners.mean(axis=0)[0] for one in road.present(time))

    found = {time: places(time) for time in (0.05, 0.15, 0.2, 0.25, 0.35, 0.5, 0.7)}
    assert found[0.05] == [35.0]
    assert found[0.15] == found[0.2] == found[0.25] == [40.0, 44.0]
    assert (found[0.35], found[0.5], found[0.7]) == ([], [50.0], [])


def test_a_set_of_no_time_is_told(tmp_path):
    wrong = predicted(7, [([square(40.0, 2.0, 4.0)], interval("time", 4, 4))], x=35.0, y=2.0)
    with pytest.raises(InvalidScenario) as caught:
        read(tmp_path, commonroad(*LANES, wrong, problem()))
    assert "time: got the interval [4, 4], need a begin before its end" in str(caught.value)


def test_every_planning_problem_is_a_case(tmp_path):
    found = read(tmp_path, commonroad(*LANES, problem(1), problem(2, speed=5.0)))
    assert [one.name for one in found] == ["TST_Lanes-1_1_T-1 case 0", "TST_Lanes-1_1_T-1 case 1"]
    assert [one.road.start.speed for one in found] == [12.0, 5.0]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("commonRoad ", "roads ", "not valid XML: mismatched tag"),
        ('timeStepSize="0.1"', "", "2: commonRoad: the attribute 'timeStepSize' is missing"),
        (
            'timeStepSize="0.1"',
            'timeStepSize="-1"',
            "2: commonRoad: timeStepSize: got '-1', need a positive number",
        ),
        (
            'ref="2"/></position>',
            'ref="9"/></position>',
            "6: lanelet: ref: got 9, but no lanelet of the file has this id",
        ),
        ("<x>0.0</x>", "<x>far</x>", "3: x: got 'far', need a finite number"),
        (
            '<lanelet id="2">',
            '<lanelet id="1">',
            "4: lanelet: id: got 1, which another lanelet has",
        ),
        ("<length>4.5</length>", "", "5: rectangle: the element length is missing"),
        (
            "<time><exact>2</exact></time>",
            "<time><exact>1</exact></time>",
            "5: obstacle: motion: times must rise",
        ),
        ("goalState", "goal", "6: planningProblem: the element goalState is missing"),
        ("<velocity><exact>12.0</exact></velocity>", "", "6: initialState: the element velocity"),
        (
            "planningProblem",
            "problem",
            "2: commonRoad: holds no planningProblem, need at least one",
        ),
    ],
)
def test_a_bad_file_is_told_with_its_line(tmp_path, old, new, said):
    with pytest.raises(InvalidScenario) as caught:
        read(tmp_path, commonroad().replace(old, new))
    assert said in str(caught.value)
    assert str(caught.value).startswith(f"{tmp_path / 'road.xml'}:")


def test_other_xml_is_no_scenario(tmp_path):
    file = tmp_path / "primitives.xml"
    file.write_text("<Trajectories></Trajectories>")
    assert not is_commonroad(file)
    with pytest.raises(InvalidScenario) as caught:
        read_commonroad(file)
    assert str(caught.value) == (
        f"{file}:1: Trajectories: is no scenario of CommonRoad, need the element commonRoad"
    )


def test_a_document_type_is_refused(tmp_path):
    text = commonroad().replace("<commonRoad", "<!DOCTYPE x><commonRoad", 1)
    with pytest.raises(InvalidScenario) as caught:
        read(tmp_path, text)
    assert "has a document type" in str(caught.value)


def test_static_obstacles_stand_where_they_began(tmp_path):
    (statement,) = read(tmp_path, commonroad(*LANES, parked(3, x=80.0, y=2.0), problem()))
    (one,) = statement.road.traffic
    assert one.motion is None
    assert one.shape.center.tolist() == [80.0, 2.0]
    assert statement.road.present(1e6)


@pytest.mark.slow
@needs_data
def test_the_given_scenarios_are_read():
    found = {file.stem: read_commonroad(file)[0].road for file in SCENARIOS.glob("*.xml")}
    assert len(found) >= 11
    assert any("lanelet 31598" in said for said in found["ZAM_Tutorial-1_1_T-1"].notes)
    assert [len(found["DEU_Ffb-1_6_T-1"].lanelets), len(found["DEU_Gar-1_1_T-1"].traffic)] == [
        20,
        4,
    ]
    assert found["ZAM_Urban-2_1"].goals[0].places is None
    assert_close(found["ZAM_Urban-2_1"].goals[0].time, [4.75, 5.0])


@needs_data
@pytest.mark.parametrize("name", ["DEU_Ffb-1_6_T-1", "USA_Peach-1_1_T-1", "ZAM_Merge-1_1_T-1"])
def test_the_reference_reader_sees_the_same(name):
    reader = pytest.importorskip("commonroad.common.file_reader")
    scenario, problems = reader.CommonRoadFileReader(str(SCENARIOS / f"{name}.xml")).open()
    scene = read_commonroad(SCENARIOS / f"{name}.xml")[0].road
    theirs = {one.lanelet_id: one for one in scenario.lanelet_network.lanelets}
    assert theirs.keys() == {one.number for one in scene.lanelets}
    for one in scene.lanelets:
        other = theirs[one.number]
        assert_close(one.left, other.left_vertices)
        assert_close(one.right, other.right_vertices)
        assert sorted(one.successors) == sorted(other.successor)
    for one in scene.traffic:
        other = scenario.obstacle_by_id(int(one.name.split()[-1]))
        for k in range(1, len(one.motion.time)):
            seen = other.state_at_time(k)
            pose = one.motion.at(k * scenario.dt)
            assert_close(pose[:2], seen.position)
            assert abs(math.remainder(pose[2] - seen.orientation, 2 * np.pi)) < 1e-9
    (given,) = problems.planning_problem_dict.values()
    assert_close(scene.start.middle[:2], given.initial_state.position)
    stated = given.goal.state_list[0].time_step
    assert_close(scene.goals[0].time, [stated.start * scenario.dt, stated.end * scenario.dt])


@needs_data
@pytest.mark.parametrize(
    "name", ["DEU_Ffb-1_6_T-1", "DEU_Muc-2_1_T-1", "USA_US101-32_1_T-1", "CHN_Sha-4_2_T-1"]
)
def test_the_official_checker_sees_the_same_road(name):
    reader = pytest.importorskip("commonroad.common.file_reader")
    construction = pytest.importorskip("commonroad_dc.boundary.construction")
    import shapely

    from maneuver_automaton.roads import drivable_area

    scenario, _ = reader.CommonRoadFileReader(str(SCENARIOS / f"{name}.xml")).open()
    built = construction.construct(scenario, ["section_triangles", "triangulation"])
    beyond, road = (
        shapely.union_all([shapely.Polygon(one.vertices()) for one in built[key].unpack()])
        for key in ("triangulation", "section_triangles")
    )
    area = drivable_area(read_commonroad(SCENARIOS / f"{name}.xml")[0].road.lanelets)
    # What rounding left is closed, up to 20 micrometres wide.
    allowed = 1e-4 + 2e-5 * shapely.length(shapely.boundary(area))
    assert shapely.intersection(area, beyond).area < allowed
    assert shapely.symmetric_difference(area, road).area < allowed


def test_goals_without_a_time_are_told(tmp_path):
    with pytest.raises(InvalidScenario) as caught:
        read(tmp_path, commonroad().replace(GOAL, "<goalState></goalState>"))
    assert "goalState: the element time is missing" in str(caught.value)

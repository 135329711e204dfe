"""Signs, lights, uncertain road users and versions of CommonRoad: nothing is dropped in silence."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from maneuver_automaton.collision import Box, Disc, Polygon
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.commonroad import is_commonroad, n_problems, read_commonroad
from maneuver_automaton.groups import SE2
from maneuver_automaton.roads import plan_road
from maneuver_automaton.scenario import load_scenario
from tests.quickly import quick_are
from tests.roads.files import (
    LANES,
    commonroad,
    interval,
    light,
    piece,
    problem,
    sign,
    square,
    state,
)

ANY = "<goalState>" + interval("time", 20, 40) + "</goalState>"
REF = '<trafficSignRef ref="7"/>'
BODY = "<shape><rectangle><length>4.5</length><width>1.8</width></rectangle></shape>"


def read(folder, *parts, **changes):
    text = commonroad(*parts)
    for old, new in changes.items():
        text = text.replace(*new) if old else text
    file = folder / "road.xml"
    file.write_text(text)
    return read_commonroad(file)[0].road


def refused(folder, *parts, **changes):
    with pytest.raises(InvalidScenario) as caught:
        read(folder, *parts, **changes)
    return str(caught.value)


@pytest.mark.parametrize(
    "name",
    # As commonroad-io 2026.1 lists MAX_SPEED of Germany, China and Italy, USA and Puerto Rico,
    # Spain, Russia, Argentina, Belgium, France, Greece (rho, and P), Croatia; zones of Germany.
    [
        "274",
        "R2-1",
        "r301",
        "3.24",
        "R15",
        "C43",
        "B14",
        "\u03a1-32",
        "P-32",
        "B31",
        "274.1",
        "R301",
    ],
)
def test_limits_of_every_country_are_limits_in_metres_per_second(tmp_path, name):
    scene = read(tmp_path, piece(1, 0, 99, REF), sign(7, name, 8.5), problem(goal=ANY))
    assert [one.speed_limit for one in scene.lanelets] == [8.5]
    assert scene.notes == ()


@pytest.mark.parametrize(
    ("value", "limit"),
    [("50kmh", 50 / 3.6), ("25 mph", 25 * 0.44704), ("30 km/h", 30 / 3.6), ("8.5 m/s", 8.5)],
)
def test_a_unit_after_the_number_is_that_of_the_limit(tmp_path, value, limit):
    scene = read(tmp_path, piece(1, 0, 99, REF), sign(7, "274", value), problem(goal=ANY))
    assert [one.speed_limit for one in scene.lanelets] == [pytest.approx(limit, rel=1e-12)]


@pytest.mark.parametrize("value", ["-1.0", "0", "zone", "50 furlongs"])
def test_a_limit_that_is_no_speed_is_named(tmp_path, value):
    scene = read(tmp_path, piece(1, 0, 99, REF), sign(7, "274.1", value), problem(goal=ANY))
    assert [one.speed_limit for one in scene.lanelets] == [None]
    assert scene.notes == ("not obeyed: traffic signs 274.1",)


def test_a_stop_line_without_a_length_is_at_the_end(tmp_path):
    point = "<point><x>90</x><y>2</y></point>"
    lane = piece(1, 0, 99, f"<stopLine>{point}{point}{REF}</stopLine>")
    scene = read(tmp_path, lane, sign(7, "206"), problem(goal=ANY))
    assert [one.line.tolist() for one in scene.stop_lines] == [[[99.0, 4.0], [99.0, 0.0]]]
    assert scene.notes == ("the stop line of lanelet 1 has no length: it is at its end",)


@pytest.mark.parametrize("name", ["206", "R1-1", "R1-3", "r2"])
def test_stop_signs_of_every_country_stop_at_the_line(tmp_path, name):
    scene = read(tmp_path, piece(1, 0, 99, REF), sign(7, name), problem(goal=ANY))
    (line,) = scene.stop_lines
    assert (line.name, line.lanelet, line.phases) == ("stop sign 7", 1, ())
    assert line.line.tolist() == [[99.0, 4.0], [99.0, 0.0]]
    assert scene.notes == ()


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        ((sign(7, "205"),), "give way (205): nobody is touched, and no more is kept"),
        ((sign(7, "R1-2"),), "give way (R1-2): nobody is touched, and no more is kept"),
        ((sign(7, "r1"),), "give way (r1): nobody is touched, and no more is kept"),
        (
            (sign(7, "306"), sign(8, "306"), sign(9, "275", 5)),
            "not obeyed: traffic signs 275, 306 (2 times)",
        ),
        ((sign(7, "274"),), "not obeyed: traffic signs 274"),
        ((light(8),), "not obeyed: traffic light 8 states no cycle"),
        (("<area/>", "<area/>"), "not read: the elements area (2 times)"),
        (
            ('<phantomObstacle id="5"/>',),
            "phantom 5 states no set of occupancies, and is nowhere",
        ),
        (
            (
                f'<dynamicObstacle id="5"><type>car</type>{BODY}'
                f"{state('initialState', x=70, y=2, speed=3)}</dynamicObstacle>",
            ),
            "car 5 moves, but states no trajectory: it is taken to stay",
        ),
    ],
)
def test_what_is_not_obeyed_is_named_once(tmp_path, parts, said):
    assert read(tmp_path, *LANES, *parts, problem()).notes == (said,)


def test_lanelets_for_others_and_solid_lines_are_named(tmp_path):
    lane = piece(1, 0, 99, "<laneletType>sidewalk</laneletType>")
    lane = lane.replace("</leftBound>", "<lineMarking>solid</lineMarking></leftBound>")
    assert read(tmp_path, lane, problem(goal=ANY)).notes == (
        "not obeyed: lanelets of the type sidewalk are driven on as any other",
        "not obeyed: solid lines between lanes of one direction are crossed",
    )


def test_a_light_in_a_row_of_lanelets_is_at_the_last(tmp_path):
    ref = '<trafficLightRef ref="8"/>'
    parts = (piece(1, 0, 50, '<successor ref="2"/>' + ref), piece(2, 50, 99, ref))
    lights = light(8, ("red", 30), ("yellow", 10), ("green", 20), offset=5)
    (line,) = read(tmp_path, *parts, lights, problem(goal=ANY)).stop_lines
    assert (line.lanelet, line.offset) == (2, 0.5)
    assert line.phases == ((3.0, True), (1.0, True), (2.0, False))


def test_a_light_that_is_on_holds_instead_of_a_stop_sign(tmp_path):
    lane = piece(1, 0, 99, REF + '<trafficLightRef ref="8"/>')
    for lit, names in (("red", ["traffic light 8"]), ("inactive", ["stop sign 7"])):
        scene = read(tmp_path, lane, sign(7, "206"), light(8, (lit, 9)), problem(goal=ANY))
        assert [one.name for one in scene.stop_lines] == names
        assert bool(scene.notes) == (lit == "red")


@pytest.mark.parametrize(
    ("switched", "said"),
    [
        (light(8, ("blue", 9)), "color: got 'blue', need one of red"),
        (light(8, ("red", 0)), "duration: got 0, need a positive number of steps"),
        (light(8, ("red", 9), more="<direction>up</direction>"), "direction: got 'up', need one"),
    ],
)
def test_a_bad_light_is_told(tmp_path, switched, said):
    lane = piece(1, 0, 99, '<trafficLightRef ref="8"/>')
    assert said in refused(tmp_path, lane, switched, problem(goal=ANY))


def test_turns_are_those_of_the_intersection(tmp_path):
    """What it calls left is left, though it leads straight on."""
    parts = (
        piece(1, 0, 50, '<successor ref="2"/><trafficLightRef ref="8"/>'),
        piece(2, 50, 99),
        light(8, ("red", 9), more="<direction>left</direction>"),
        problem(goal=ANY),
    )
    (line,) = read(tmp_path, *parts).stop_lines
    assert line.onward == ()
    crossing = (
        '<intersection id="3"><incoming id="4"><incomingLanelet ref="1"/>'
        '<successorsLeft ref="2"/></incoming></intersection>'
    )
    (line,) = read(tmp_path, *parts, crossing).stop_lines
    assert line.onward == (2,)


def test_phantoms_and_the_environment_are_obstacles(tmp_path):
    occupied = f"<occupancy><shape>{square(40, 2, 4)}</shape>{interval('time', 0, 50)}</occupancy>"
    scene = read(
        tmp_path,
        *LANES,
        f'<phantomObstacle id="5"><occupancySet>{occupied}</occupancySet></phantomObstacle>',
        f'<environmentObstacle id="6"><type>building</type><shape>{square(60, 9, 2)}</shape>'
        "</environmentObstacle>",
        problem(),
    )
    phantom, building = scene.traffic
    assert (phantom.name, building.name) == ("phantom 5", "building 6")
    np.testing.assert_allclose(phantom.motion.time, [0.0, 5.0], atol=1e-3)
    assert building.motion is None
    np.testing.assert_allclose(building.shape.corners.mean(axis=0), [60.0, 9.0])


def uncertain(rng, k):
    """A state of random sets: its text, and a function that draws poses of it."""
    x, y = 30.0 + 3.0 * k, 2.0 + rng.normal()
    kind, size = rng.integers(3), rng.uniform(0.1, 2.0, 2)
    turn, low = rng.uniform(-3.0, 3.0, 2)
    spread = rng.choice([0.0, rng.uniform(0.01, 7.0)])
    if kind == 0:
        place = f"<point><x>{x}</x><y>{y}</y></point>"
    elif kind == 1:
        place = (
            f"<rectangle><length>{size[0]}</length><width>{size[1]}</width><orientation>{turn}"
            f"</orientation><center><x>{x}</x><y>{y}</y></center></rectangle>"
        )
    else:
        place = f"<circle><radius>{size[0]}</radius><center><x>{x}</x><y>{y}</y></center></circle>"
    later = int(rng.integers(2))
    times = (
        interval("time", 10 * k, 10 * k + 4) if later else f"<time><exact>{10 * k}</exact></time>"
    )
    headed = bool(rng.integers(2))
    heading = interval("orientation", low, low + spread) if headed else ""

    def draw():
        share = rng.uniform(-0.5, 0.5, 2)
        if kind == 1:
            offset = SE2([0.0, 0.0, turn]).act(share * size)
        else:
            angle = rng.uniform(0.0, 2.0 * math.pi)
            offset = (kind == 2) * size[0] * np.array([math.cos(angle), math.sin(angle)])
        turned = low + rng.uniform() * min(spread, 2.0 * math.pi) if headed else 7.0 * share[0]
        return np.array([x + offset[0], y + offset[1], turned]), k + 0.4 * later * rng.uniform()

    tag = "state" if k else "initialState"
    return f"<{tag}><position>{place}</position>{heading}{times}</{tag}>", draw


@pytest.mark.parametrize("seed", quick_are([0, 1], range(6)))
def test_whoever_is_uncertain_is_everywhere_that_he_may_be(tmp_path, seed):
    rng = np.random.default_rng(seed)
    states = [uncertain(rng, k) for k in range(4)]
    shape = rng.choice([BODY, "<shape><circle><radius>0.4</radius></circle></shape>"])
    texts = [text for text, _ in states]
    recorded = f"<trajectory>{''.join(texts[1:])}</trajectory>"
    other = f'<dynamicObstacle id="5"><type>car</type>{shape}{texts[0]}{recorded}</dynamicObstacle>'
    scene = read(tmp_path, *LANES, other, problem())
    body = Box([4.5, 1.8]) if "rectangle" in shape else Disc(0.4)
    for _ in range(40):
        k = int(rng.integers(3))
        (here, begin), (there, end) = states[k][1](), states[k + 1][1]()
        share = rng.uniform()
        pose, time = (
            here + share * np.array([*(there - here)[:2], 0.0]),
            begin + share * (end - begin),
        )
        # It turns somehow in between, so at the ends alone the heading is known.
        pose, time = (
            (pose, time)
            if isinstance(body, Disc)
            else ((here, begin) if share < 0.5 else (there, end))
        )
        placed = body.moved(SE2(pose))
        covered = shapely.union_all([_area(one.at(time)) for one in scene.present(time)])
        assert shapely.covers(shapely.buffer(covered, 1e-6), _area(placed))


def _area(shape):
    if isinstance(shape, Disc):
        return shapely.Point(shape.center).buffer(shape.radius)
    return shapely.Polygon(shape.corners)


def test_sets_that_are_points_are_read_as_before(tmp_path):
    """Whoever is round needs no heading; velocities along the axes of the map state one."""
    texts = "".join(
        f"<state><position><point><x>{30 + k}</x><y>2</y></point></position>"
        f"<velocity><exact>3</exact></velocity><velocityY><exact>3</exact></velocityY>"
        f"<time><exact>{k}</exact></time></state>"
        for k in (1, 2)
    )
    first = (
        texts[: texts.index("</state>")]
        .replace("<state>", "<initialState>")
        .replace("<exact>1</exact></time>", "<exact>0</exact></time>")
    )
    other = (
        f'<dynamicObstacle id="5"><type>car</type>{BODY}{first}</initialState>'
        f"<trajectory>{texts}</trajectory></dynamicObstacle>"
    )
    scene = read(tmp_path, *LANES, other, problem())
    (car,) = scene.traffic
    np.testing.assert_allclose(car.motion.pose[:, 2], math.pi / 4)
    assert scene.notes == ()
    scene = read(
        tmp_path, *LANES, other.replace("<velocityY><exact>3</exact></velocityY>", ""), problem()
    )
    assert all(isinstance(one.shape, Polygon) for one in scene.traffic)
    assert scene.notes == ("car 5 has uncertain states: it is kept clear of wherever it may be",)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "<point><x>10.0</x><y>2.0</y></point></position>",
            "<circle><radius>1</radius></circle></position>",
            "position: is uncertain, need the element point: a plan begins at one state",
        ),
        (
            "<velocity><exact>12.0</exact></velocity>",
            interval("velocity", 11, 13),
            "velocity: is uncertain, need the element exact: a plan begins at one state",
        ),
        (
            "<orientation><exact>0.0</exact></orientation><velocity>",
            "<velocity>",
            "initialState: the element orientation is missing",
        ),
    ],
)
def test_a_problem_begins_at_one_state(tmp_path, old, new, said):
    assert said in refused(tmp_path, *LANES, problem(), change=(old, new))


@pytest.mark.parametrize("version", ["2017a", "2018a", "2018b", "2020a"])
def test_versions_are_read(tmp_path, version):
    scene = read(tmp_path, *LANES, problem(), change=("2018b", version))
    assert scene.benchmark.version == version


def test_other_versions_and_protobuf_are_refused_by_name(tmp_path):
    said = refused(tmp_path, *LANES, problem(), change=("2018b", "2016a"))
    assert "commonRoadVersion: got '2016a', need one of 2017a, 2018a, 2018b, 2020a" in said
    (tmp_path / "road.pb").write_bytes(b"\x08\x01")
    with pytest.raises(InvalidScenario, match=r"road\.pb: is a scenario of CommonRoad as protobuf"):
        load_scenario(tmp_path / "road.pb")


def test_problems_are_counted_by_elements(tmp_path):
    comment = '<!-- <planningProblem id="1"> ' + 5000 * "-=" + " -->"
    text = commonroad(*LANES, comment, problem(1), problem(2))
    file = tmp_path / "road.xml"
    file.write_text(
        text.replace("<commonRoad", comment + "<commonRoad").replace(
            '<planningProblem id="2"', '<planningProblem\n id="2"'
        )
    )
    assert is_commonroad(file)
    assert n_problems(file) == len(read_commonroad(file)) == 2
    file.write_text(file.read_text().replace('<?xml version="1.0"?>', ""), encoding="utf-16")
    assert is_commonroad(file)
    assert n_problems(file) == 2
    file.write_text("<other><!-- <commonRoad --></other>")
    assert not is_commonroad(file)
    file.write_text("no XML")
    assert (is_commonroad(file), n_problems(file)) == (False, 0)


CROSSING = """<intersection id="50"><incoming id="51"><incomingLanelet ref="1"/>
<successorsLeft ref="96"/><isLeftOf ref="51"/></incoming></intersection>"""


def test_what_a_file_refers_to_and_lacks_is_told_once(tmp_path):
    lost = """<predecessor ref="91"/><successor ref="92"/><successor ref="92"/>
    <adjacentLeft ref="93" drivingDir="same"/><trafficLightRef ref="94"/>
    <stopLine><trafficSignRef ref="95"/></stopLine>"""
    goal = ANY.replace("<time>", '<position><lanelet ref="1"/><lanelet ref="97"/></position><time>')
    road = read(tmp_path, piece(1, 0.0, 200.0, lost), CROSSING, problem(goal=goal))
    assert road.notes == (
        "not followed, since the file holds nothing of this id: adjacentLeft 93, lanelet 97, "
        "predecessor 91, successor 92 (2 times), successorsLeft 96, trafficLightRef 94, "
        "trafficSignRef 95",
    )
    assert road.goals[0].lanelets == (1,)
    assert plan_road(road, time_limit=60.0).plan is not None


def test_an_old_goal_on_a_lanelet_that_the_file_lacks_is_any_place(tmp_path):
    goal = ANY.replace("<time>", '<position><lanelet ref="97"/></position><time>')
    old = goal.replace("goalState>", "state>")
    road = read(tmp_path, *LANES, problem(goal=f"<goalRegion>{old}</goalRegion>"))
    assert road.notes == (
        "not followed, since the file holds nothing of this id: lanelet 97",
        "goal 1: any place counts, since the file lacks its lanelets",
    )
    assert road.goals[0].places is None
    with pytest.raises(InvalidScenario, match="ref: got 97, but no lanelet of the file"):
        read(tmp_path, *LANES, problem(goal=goal))

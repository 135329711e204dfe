"""Plans for vehicles that translations alone move, measured from outside."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.collision import Box, Disc, Motion, Obstacle, OccupancyMap
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import Omnidirectional
from maneuver_automaton.planning import plan
from maneuver_automaton.problem import Goal, Problem, SearchSettings
from tests import translations as vehicles
from tests.search.cases import compiled_only

pytestmark = compiled_only
STAGE = vehicles.stage()
AXES = {"rest": (0, 0), "right": (1, 0), "left": (-1, 0), "up": (0, 1), "down": (0, -1)}
BODY = Box([0.5, 0.3])
SEARCH = SearchSettings(max_expansions=2000)


def test_a_stage_takes_the_shortest_way_along_its_axes():
    """By hand: the sum of both ways at 1 m/s; by a trim between the axes, less."""
    result = plan(Problem(Automaton.of_controls(STAGE, AXES), [0, 0], [3, 1]), time_limit=20.0)
    assert result.cost == pytest.approx(4.0, abs=1e-9)
    np.testing.assert_allclose(result.plan.end, [3.0, 1.0, 0.0], atol=1e-9)
    slanted = Automaton.of_controls(STAGE, AXES | {"slant": (0.6, 0.6)})
    result = plan(Problem(slanted, [0, 0], [3, 1]), time_limit=20.0)
    assert result.cost == pytest.approx(1.0 / 0.6 + 2.0, abs=1e-9)


def test_a_stage_goes_around_what_is_in_its_way():
    """Every two-trim way meets the wall: it is passed above or below, at 1 m/s along the axes."""
    wall = Box([0.4, 3.0], [1.5, 0.5])
    problem = Problem(
        Automaton.of_controls(STAGE, AXES),
        [0, 0],
        [3, 0],
        obstacles=[wall],
        footprint=[BODY],
        search=SEARCH,
    )
    result = plan(problem, time_limit=20.0)
    least = 3.0 + 2 * (1.0 + 0.15)  # down by what the wall and half of the body reach, and up
    assert least <= result.cost <= least * 1.02
    poses = result.plan.sample(max_step_m=0.005).pose
    solid = shapely.Polygon(wall.corners)
    assert min(shapely.Polygon(BODY.corners + p[:2]).distance(solid) for p in poses) > 0.0
    assert not poses[:, 2].any()


def test_a_boat_heads_up_against_the_current_to_go_across():
    """The current carries it along x as fast as it can go back: it crosses at 90 degrees to it."""
    boat = vehicles.boat(current=0.5, turn_rate=1.0)
    headings = np.pi / 3 * np.arange(6)
    library = Automaton.of_model(boat, {"heading": headings, "speed": [1.0]})
    across = headings[2]
    problem = Problem(library, [0, 0, across], [0, 5, across], search=SEARCH)
    result = plan(problem, time_limit=20.0)
    assert result.cost == pytest.approx(5.0 / np.sin(across), abs=1e-9)
    course = result.plan.sample()
    np.testing.assert_allclose(course.pose[:, 0], 0.0, atol=1e-9)
    np.testing.assert_allclose(course.pose[:, 2], across, atol=1e-12)
    assert result.audit.passed


def crossing(**goal):
    """Across a current that carries the boat along x, from heading to heading."""
    library = Automaton.of_model(
        vehicles.boat(), {"heading": np.pi / 4 * np.arange(8), "speed": [1.0, 0.5]}
    )
    start = "heading 0, speed 1"
    return Problem(
        library, [0, 0, 0], Goal(pose=[6, 2, np.pi / 4], **goal), search=SEARCH, start_trim=start
    )


@pytest.mark.exhaustive
@pytest.mark.slow
def test_a_boat_is_polished_though_its_heading_is_in_its_pose_and_in_its_state():
    """What the last pose says already is not asked of the last state too, or no solver ends."""
    facing = plan(crossing(), time_limit=30.0)
    assert facing.cost < 4.961
    assert facing.audit.passed
    anyhow = plan(crossing(free_heading=True), time_limit=30.0)  # by the heading of its best word
    assert anyhow.cost <= facing.cost * (1.0 + 1e-6)


def _heading_kept(directions: int) -> Automaton:
    """A platform of three freedoms whose library has no trim that turns."""
    angles = np.arange(directions) * (2.0 * np.pi / directions)
    controls = {f"{k}": (np.cos(a), np.sin(a), 0.0) for k, a in enumerate(angles)}
    return Automaton.of_controls(Omnidirectional(), controls)


@pytest.mark.parametrize(
    ("directions", "least", "moved"),
    [(3, 4.0 + 2 * 1.85 * np.sqrt(3.0), (20.0, -7.0, 2.0)), (4, 7.7, (0.0, 0.0, 0.0))],
)
def test_a_library_that_keeps_its_heading_goes_around_a_wall(directions, least, moved):
    """By hand: 1.85 m up and down along the axes, and back by half of what two of three lead."""
    frame = SE2(moved)
    wall = Box([0.2, 3.0], (frame @ SE2([2.0, 0.0, 0.0])).pose[:2], heading=moved[2])
    goal = Goal(pose=(frame @ SE2([4.0, 0.0, 0.0])).pose)
    library = _heading_kept(directions)
    problem = Problem(library, moved, goal, obstacles=wall, footprint=Disc(0.35), search=SEARCH)
    result = plan(problem, time_limit=20.0)
    assert least <= result.cost <= 1.003 * least
    poses = result.plan.sample(max_step_m=0.005).pose
    solid = shapely.Polygon(wall.corners)
    assert min(shapely.Point(pose[:2]).distance(solid) for pose in poses) > 0.35
    beside = replace(problem, goals=(replace(goal, tolerance_m=0.3),))
    assert plan(beside, time_limit=20.0).cost < result.cost


def test_a_library_that_keeps_its_heading_goes_around_maps_and_carts():
    """The wall as cells of a map, and a cart that comes along it."""
    cells = np.zeros((40, 50), dtype=bool)
    cells[5:35, 19:21] = True
    world = OccupancyMap(cells, resolution=0.1, origin=[0.0, -2.0, 0.0])
    cart = Obstacle(Disc(0.4), motion=Motion([0, 6], [[4.0, -3.0, 0], [4.0, 3.0, 0]]))
    problem = Problem(
        _heading_kept(8),
        [0, 0, 0],
        [4, 0, 0],
        obstacles=[world, cart],
        footprint=Disc(0.3),
        search=SEARCH,
    )
    result = plan(problem, time_limit=20.0)
    assert result.audit.passed
    assert result.cost >= 4.0

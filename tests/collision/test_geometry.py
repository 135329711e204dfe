"""Obstacles, bodies and zones from geometry of shapely, and from lists of points."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

import maneuver_automaton as ma
from maneuver_automaton.collision import Zone, as_footprint, as_obstacles
from maneuver_automaton.collision.outline import outlines
from maneuver_automaton.roads import GoalRegion

ROBOT = ma.Automaton.of_controls(ma.Unicycle(), {"ahead": (1.0, 0.0), "turn": (1.0, 1.0)})
COURT = shapely.box(0, 0, 9, 9).difference(shapely.Point(4, 4).buffer(2))
ISLAND = shapely.Polygon([(20, 0), (22, 0), (21, 1), (22, 2), (20, 2)])
BOTH = shapely.MultiPolygon([COURT, ISLAND])


def area_of(shapes):
    return shapely.union_all([part for shape in shapes for part in outlines(shape)])


@pytest.mark.parametrize(
    "geometry", [COURT, ISLAND, BOTH, shapely.GeometryCollection([BOTH, shapely.box(30, 0, 31, 1)])]
)
def test_geometry_of_shapely_covers_what_it_covered(geometry):
    obstacles = as_obstacles(geometry)
    same = area_of(one.shape for one in obstacles).symmetric_difference(shapely.union_all(geometry))
    assert same.area == 0.0
    assert len(obstacles) == len(
        [part for part in shapely.get_parts(shapely.get_parts(geometry)) if part.area > 0]
    )


def test_a_hole_of_a_geometry_is_free():
    world = ma.Planner(ROBOT, obstacles=BOTH, cost=ma.Cost(time=1.0))
    assert world.plan([4, 4, 0], [5, 4, 0]).plan is not None
    assert world.plan([4, 4, 0], [8.5, 4, 0]).status is ma.PlanStatus.GOAL_BLOCKED


CORNERS = [(0, 0), (2, 0), (2, 1)]


@pytest.mark.parametrize(
    "points",
    [CORNERS, [list(p) for p in CORNERS], np.array(CORNERS), [np.array(p) for p in CORNERS],
     tuple(CORNERS)],
)  # fmt: skip
def test_points_in_any_list_are_one_polygon(points):
    for shapes in (as_footprint(points), [one.shape for one in as_obstacles(points)]):
        assert [shape.corners.tolist() for shape in shapes] == [np.array(CORNERS, float).tolist()]


def test_lists_of_points_are_polygons_beside_other_shapes():
    obstacles = as_obstacles([CORNERS, ma.Disc(1.0), shapely.box(0, 0, 1, 1), np.array(CORNERS)])
    assert [type(one.shape).__name__ for one in obstacles] == ["Polygon", "Disc"] + 2 * ["Polygon"]
    stacked = as_obstacles(np.array([CORNERS, CORNERS]))
    assert [one.shape.corners.shape for one in stacked] == [(3, 2), (3, 2)]
    assert as_obstacles([]) == as_obstacles([[]]) == as_footprint(()) == ()


def test_wherever_a_shape_is_taken_geometry_will_do():
    assert len(ma.Polygon(COURT).holes) == 1
    assert ma.Obstacle(ISLAND, name="island").shape.corners.shape == (5, 2)
    assert ma.Obstacle(CORNERS).shape.corners.shape == (3, 2)
    assert Zone(shape=ISLAND, max_speed=1.0).shape.corners.shape == (5, 2)
    body = shapely.box(-0.2, -0.1, 0.3, 0.1)
    problem = ma.Problem(
        ROBOT, [0, 0, 0], [1, 0, 0], footprint=body, obstacles=[ISLAND, ma.Obstacle(ma.Disc(1.0))],
        zones=[Zone(shape=CORNERS, max_speed=1.0)],
    )  # fmt: skip
    assert problem.footprint[0].corners.min(axis=0).tolist() == [-0.2, -0.1]
    truck = ma.CarWithTrailer(wheelbase=2.0, hitch_length=3.0, max_speed=1.0, max_steering=0.5)
    straight = ma.Automaton(truck, ma.trims_of(truck, {"speed": [0.0, 1.0]}).trims)
    problem = ma.Problem(straight, [0, 0, 0], [1, 0, 0], parts={"trailer": body})
    assert problem.parts["trailer"][0].corners.shape == (4, 2)


def test_goals_on_roads_are_places_of_any_kind():
    goal = GoalRegion(places=[shapely.box(0, 0, 2, 1), CORNERS], time=(0.0, 1.0))
    assert goal.contains([1.5, 0.9, 0.0], speed=0.0, time=0.5)
    assert not goal.contains([3.0, 0.5, 0.0], speed=0.0, time=0.5)
    assert GoalRegion(places=shapely.box(0, 0, 2, 1)).contains([1.0, 0.5, 0.0], speed=0.0, time=0.0)


def test_heights_of_points_are_left_out():
    assert ma.Polygon(shapely.Polygon([(0, 0, 7), (1, 0, 7), (1, 1, 7)])).corners.shape == (3, 2)


KNOT = shapely.Polygon([(0, 0), (2, 2), (2, 0), (0, 2)])


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (shapely.Polygon(), "obstacles: got an empty Polygon of shapely, need one with an area"),
        (KNOT, "obstacles: got an invalid Polygon of shapely (Self-intersection[1 1]), need a "
         "valid one, such as shapely.make_valid gives"),
        (shapely.LineString([(0, 0), (1, 1)]), "obstacles: got a LineString of shapely, which has "
         "no area; need a Polygon, such as geometry.buffer(radius) gives"),
        ([[0, 0], [1, 0]], "obstacles: corners: got shape (2, 2), need (n, 2) with n >= 3"),
        ([1.0, 2.0], "obstacles: corners: got shape (2,), need (n, 2) with n >= 3"),
        (np.zeros((4, 3)), "obstacles: corners: got shape (4, 3), need (n, 2) with n >= 3"),
        ([[0, 0], [1, 0], [1, np.nan]], "obstacles: corners: got nan, need finite numbers"),
    ],
)  # fmt: skip
def test_geometry_without_an_area_is_refused(value, said):
    with pytest.raises(ValueError) as error:
        as_obstacles(value)
    assert str(error.value) == said
    with pytest.raises(ValueError) as error:
        as_footprint(value)
    assert str(error.value) == said.replace("obstacles", "footprint")


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: ma.Polygon(BOTH), "polygon: got a MultiPolygon of 2 polygons, need one; give each "
         "of geometry.geoms by itself"),
        (lambda: ma.Polygon(COURT, [CORNERS]),
         "polygon: got holes beside geometry of shapely, which has its own"),
        (lambda: ma.Obstacle(BOTH), "obstacle: got 2 shapes, need one; give each by itself"),
        (lambda: Zone(shape=BOTH, max_speed=1.0),
         "zone: got 2 shapes, need one; give each by itself"),
        (lambda: Zone(shape=3, max_speed=1.0), "zone: got 3, need Polygon, Disc or Box, geometry "
         "of shapely, or corners (n, 2)"),
    ],
)  # fmt: skip
def test_one_shape_is_no_several(make, said):
    with pytest.raises(ValueError) as error:
        make()
    assert str(error.value) == said

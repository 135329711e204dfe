from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from maneuver_automaton.groups import SE2
from maneuver_automaton.plotting.footprint import footprint_polygons, placed
from maneuver_automaton.plotting.swept import swept_region
from maneuver_automaton.plotting.track import track_of_document, track_of_plan
from tests.plotting.cases import document_of, parking_plan, plan_of

CAR = footprint_polygons({"rectangle_m": [0.9, 0.5], "reference_m": [-0.2, 0.0]})
ANGLE = [np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 0.2], [0.2, 0.2], [0.2, 2.0], [0.0, 2.0]])]


def area_of(plan, body):
    return sum(part.area for part in swept_region(track_of_plan(plan), body))


def test_straight_ahead_it_is_body_and_way():
    assert area_of(plan_of(["straight"], [2.0]), CAR) == pytest.approx(0.5 * (0.9 + 3.0))


def test_a_disc_that_spins_sweeps_itself():
    (disc,) = footprint_polygons({"disc_m": 0.3})
    area = area_of(plan_of(["spin"], [3.0]), [disc])
    assert shapely.Polygon(disc).area <= area <= math.pi * 0.3**2


def test_a_full_turn_sweeps_a_disc_to_the_furthest_corner():
    reach = math.hypot(0.65, 0.25)
    area = area_of(plan_of(["spin"], [2 * math.pi]), CAR)
    assert area == pytest.approx(math.pi * reach**2, rel=1e-3)


def test_a_concave_body_leaves_its_corner_free():
    region = swept_region(track_of_plan(plan_of(["straight"], [0.1], start=(0, 0, 0))), ANGLE)
    assert not shapely.union_all(region).contains(shapely.Point(1.0, 1.0))
    assert sum(part.area for part in region) == pytest.approx(0.2 * 1.8 + 0.2 * 2.15 + 0.15 * 1.8)


@pytest.mark.parametrize("body", [CAR, ANGLE])
def test_every_pose_on_the_way_is_covered(body):
    plan = parking_plan()
    whole = shapely.union_all(swept_region(track_of_plan(plan), body))
    along = placed(body, plan.pose_at(np.linspace(0.0, plan.duration, 200)))
    off = shapely.difference([shapely.Polygon(outline) for outline in along], whole)
    assert shapely.area(off).max() < 1e-3


def test_a_file_sweeps_what_its_plan_sweeps():
    plan = parking_plan()
    there = track_of_document(document_of(plan))
    areas = [
        shapely.union_all(swept_region(track, CAR)).area for track in (there, track_of_plan(plan))
    ]
    assert areas[0] == pytest.approx(areas[1], rel=1e-3)


def test_a_moved_plan_sweeps_a_moved_region():
    plan, move = parking_plan(), SE2([3.0, -2.0, 1.1])
    here = shapely.union_all(swept_region(track_of_plan(plan), CAR))
    there = shapely.union_all(swept_region(track_of_plan(plan.moved(move)), CAR))
    expected = shapely.transform(here, move.act)
    assert shapely.symmetric_difference(expected, there).area < 1e-9


def test_without_motion_it_is_the_body():
    assert area_of(plan_of([], []), CAR) == pytest.approx(0.45)

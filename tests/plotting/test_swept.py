from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shapely

from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.cutting import carried
from maneuver_automaton.collision import Box
from maneuver_automaton.planning import PlanResult, PlanStatus
from maneuver_automaton.plotting.cast import cast_of
from maneuver_automaton.plotting.paths import swept_area
from maneuver_automaton.plotting.track import (
    Track,
    TrackPiece,
    footprint_polygons,
    placed,
    swept_region,
    track_of_plan,
)
from maneuver_automaton.recording import recording_of
from maneuver_automaton.scenario import load_scenario
from tests.plotting.cases import parking_plan

CAR = footprint_polygons([Box([0.9, 0.5], [0.2, 0.0])])
ANGLE = [np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 0.2], [0.2, 0.2], [0.2, 2.0], [0.0, 2.0]])]


@pytest.mark.parametrize("body", [CAR, ANGLE])
def test_every_pose_on_the_way_is_covered(body):
    plan = parking_plan()
    whole = shapely.union_all(swept_region(track_of_plan(plan), body))
    along = placed(body, plan.pose_at(np.linspace(0.0, plan.duration, 200)))
    off = shapely.difference([shapely.Polygon(outline) for outline in along], whole)
    assert shapely.area(off).max() < 1e-3


NEAR_M = 0.01
SCENARIOS = Path(__file__).parents[2] / "scenarios"


def off(region, bodies):
    """How far corners of `bodies` (n, 2) lie outside a region [m]."""
    return max(shapely.distance(shapely.points(corners), region).max() for corners in bodies)


def test_a_lane_change_that_turns_by_nothing_in_all_is_swept_where_it_goes():
    time = np.linspace(0.0, 4.0, 81)
    ahead, aside = 15.0 * time, 3.5 * 0.5 * (1.0 - np.cos(np.pi * time / 4.0))
    heading = np.arctan2(np.gradient(aside), np.gradient(ahead))
    heading[[0, -1]] = 0.0
    pose, nothing = np.stack([ahead, aside, heading], axis=-1), np.zeros((81, 0))
    twist = np.array([15.0, 0.0, 0.0])
    piece = TrackPiece(name="m", twist=twist, time=time, pose=pose, control=nothing, state=nothing)
    region = shapely.union_all(swept_region(Track(pose[0], (piece,)), CAR))
    assert off(region, placed(CAR, pose)) < NEAR_M


def test_what_is_carried_is_swept_as_well():
    problem = load_scenario(SCENARIOS / "trailer.yaml").problem
    trims = problem.automaton.trims
    turn = max(trims, key=lambda trim: trim.body_velocity[0] * abs(trim.body_velocity[2]))
    plan = Plan(problem.start, (turn,), durations=[3.0])
    result = PlanResult(problem=problem, status=PlanStatus.FOUND, reason="", plan=plan)
    (actor,) = cast_of(recording_of(result)).actors
    (path,) = swept_area(actor).get_paths()
    rings = [shapely.Polygon(ring) for ring in path.to_polygons(closed_only=False)]
    region = shapely.union_all(rings)
    trailer = carried(plan, problem.automaton.model, "trailer")
    times = np.linspace(0.0, 3.0, 50)
    for moved, shapes in ((plan, problem.footprint), (trailer, problem.parts["trailer"])):
        assert off(region, placed(footprint_polygons(shapes), moved.pose_at(times))) < NEAR_M

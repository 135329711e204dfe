"""The proof that a tick is free, against shapely at many poses; the motion, against an ODE."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from maneuver_automaton.collision import Box, Disc, Motion, Obstacle, Polygon
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import rollout
from maneuver_automaton.roads import (
    GoalRegion,
    Lanelet,
    RoadScene,
    RoadStart,
    RoadVehicle,
    _kernels_motion,
    drivable_area,
)
from maneuver_automaton.roads.clearing import clearing_of
from tests.quickly import draws

TICK = 0.1
OFF_EDGE, OFF_TRAFFIC = 0.03, 0.05
VEHICLE = RoadVehicle()
BEND = [[0, 0], [20, 0], [40, 6], [55, 20], [60, 40]]
LEFT, RIGHT = (np.array(shapely.LineString(BEND).offset_curve(side).coords) for side in (3.0, -3.0))
LANE = Lanelet(1, LEFT, RIGHT)
OTHER = Obstacle(
    Box([4.0, 1.8]),
    motion=Motion([0.0, 1.0, 2.0], [[25.0, 1.0, 0.1], [33.0, 3.0, 0.4], [40.0, 7.0, 0.8]]),
    name="car",
)
SCENE = RoadScene(
    name="bend",
    lanelets=(LANE,),
    start=RoadStart(middle=np.array([5.0, 0.0, 0.0]), speed=10.0),
    goals=(GoalRegion(time=(1.0, 2.0)),),
    traffic=(OTHER, Obstacle(Disc(0.4, [12.0, 2.0]), name="post")),
)
AREA = drivable_area(SCENE.lanelets)


def clearing():
    return clearing_of(
        SCENE,
        VEHICLE,
        tick=TICK,
        last_tick=60,
        off_edge=OFF_EDGE,
        off_traffic=OFF_TRAFFIC,
    )


def states_of(x, y, heading, speed, steering, controls):
    state = np.array([x, y, heading, speed, steering])
    return _kernels_motion.driven(VEHICLE.model.wheelbase, TICK, state, np.array(controls))


def slow_clearance(states, control, tick):
    """Least distance to anybody, and to the edge (negative outside), within one tick."""
    clearances, edges = [], []
    for share in np.linspace(0.0, 1.0, 11):
        state = states
        if share > 0.0:
            state = rollout(VEHICLE.model, states, control=control, times=[0.0, share * TICK])[-1]
        body = shapely.Polygon(SE2(state[:3]).act(VEHICLE.footprint.corners))
        for one in SCENE.present((tick + share) * TICK):
            shape = one.at((tick + share) * TICK)
            other = (
                shapely.Point(shape.center).buffer(shape.radius)
                if isinstance(shape, Disc)
                else shapely.Polygon(shape.corners)
            )
            clearances.append(body.distance(other))
        inside = AREA.covers(body)
        edges.append(AREA.boundary.distance(body) if inside else -1.0)
    return min(clearances, default=np.inf), min(edges)


drives = st.tuples(
    st.floats(2.0, 45.0),
    st.floats(-3.0, 12.0),
    st.floats(-0.5, 1.2),
    st.floats(0.0, 20.0),
    st.floats(-0.2, 0.2),
    st.floats(-8.0, 4.0),
    st.floats(-0.4, 0.4),
    st.integers(0, 22),
)


CLEARING = clearing()


@pytest.mark.exhaustive
@pytest.mark.slow
@settings(max_examples=draws(150))
@given(drive=drives)
def test_what_is_proven_free_is_free_and_what_is_not_is_near_something(drive):
    x, y, heading, speed, steering, acceleration, rate, tick = drive
    acceleration = max(acceleration, -speed / TICK)
    control = np.array([acceleration, rate])
    states = states_of(x, y, heading, speed, steering, [control])
    clearance, edge = slow_clearance(states[0], control, tick)
    if edge < 0.0 and slow_clearance(states[0], np.zeros(2), tick)[1] < 0.0:
        return  # begins outside, which is never asked
    if _kernels_motion.free_ticks(CLEARING, states, tick):
        assert clearance > 0.0
        assert edge > 0.0
    else:
        assert clearance < 0.8 or edge < 0.25


def test_who_is_gone_is_not_hit():
    states = states_of(36.0, 4.0, 0.4, 0.0, 0.0, [[0.0, 0.0]])
    assert slow_clearance(states[0], np.zeros(2), 20)[0] < 0.05
    assert _kernels_motion.free_ticks(CLEARING, states, 18) == 0
    assert _kernels_motion.free_ticks(CLEARING, states, 20) == 0
    assert _kernels_motion.free_ticks(CLEARING, states, 21) == 1


@pytest.mark.parametrize("control", [(-8.0, 0.4), (2.0, -0.4), (0.0, 0.0)])
def test_motion_of_a_tick_is_that_of_the_model(control):
    begin = np.array([1.0, 2.0, 0.3, 12.0, 0.1])
    states = _kernels_motion.driven(VEHICLE.model.wheelbase, TICK, begin, np.array([control] * 5))
    exact = rollout(VEHICLE.model, begin, control=control, times=[0.0, 0.5], rtol=1e-12)[-1]
    np.testing.assert_allclose(states[-1], exact, atol=1e-6)


@pytest.mark.parametrize(
    "shape",
    [
        Disc(0.5, [9.0, 0.0]),
        Box([2.0, 1.0], [9.0, 0.0], 0.4),
        Polygon([[8, 0], [9, -1], [9, 1]]),
        Polygon([[8, -1], [9, -1], [9, 1], [8, 1], [8.8, 0]]),
    ],
)
@pytest.mark.parametrize("off_traffic", [0.05, 0.4])
@pytest.mark.parametrize("moves", [False, True])
def test_obstacles_are_kept_away_from_as_far_as_said(shape, off_traffic, moves):
    motion = Motion([0.0, 0.5], np.zeros((2, 3))) if moves else None
    scene = replace(SCENE, traffic=(Obstacle(shape, motion=motion, name="one"),))
    found = clearing_of(
        scene, VEHICLE, tick=TICK, last_tick=5, off_edge=0.03, off_traffic=off_traffic
    )
    assert len(found.world.moving.speed) == moves
    outline = shapely.Polygon(shape.corners) if not isinstance(shape, Disc) else (
        shapely.Point(shape.center).buffer(shape.radius, quad_segs=64)
    )  # fmt: skip
    for x in np.linspace(1.0, 6.0, 51):
        states = np.array([[x, 0.0, 0.0, 0.0, 0.0]] * 2)
        body = shapely.Polygon(SE2(states[0, :3]).act(VEHICLE.footprint.corners))
        apart = body.distance(outline)
        free = _kernels_motion.free_ticks(found, states, 0)
        assert free == (apart > off_traffic) or abs(apart - off_traffic) < 0.02
        assert _kernels_motion.free_ticks(found, states, 6) == 1 or not moves


def land_of(*lanelets, last_tick=60):
    scene = replace(SCENE, lanelets=lanelets, traffic=())
    return clearing_of(
        scene, VEHICLE, tick=TICK, last_tick=last_tick, off_edge=0.03, off_traffic=0.05
    ).world


def test_the_land_is_as_large_as_the_road_in_use():
    here = land_of(LANE)
    far = Lanelet(2, LEFT + 20_000.0, RIGHT + 20_000.0)
    assert len(land_of(LANE, far).solids.plates) == len(here.solids.plates)
    assert land_of(LANE, far).field.distance.shape == here.field.distance.shape


def test_a_wide_area_has_land_along_its_edge_only():
    legs = [
        Lanelet(3, [[0, 3], [700, 3]], [[0, 0], [700, 0]]),
        Lanelet(4, [[0, 0], [0, 700]], [[3, 0], [3, 700]]),
    ]
    plates = land_of(*legs, last_tick=400).solids.plates
    area = (plates[:, 2] - plates[:, 0]) * (plates[:, 3] - plates[:, 1])
    assert area.sum() < 4.0 * 1400.0 * 6.0  # two strips along two legs, and their overlap

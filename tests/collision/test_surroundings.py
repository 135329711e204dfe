"""Distances by shapely, batch by batch, against one pair after the other."""

from __future__ import annotations

import math

import numpy as np
import pytest

from maneuver_automaton.collision import Box, Disc, Motion, Obstacle, OccupancyMap
from maneuver_automaton.collision.surroundings import fastest_point, parts_of, surroundings_of
from tests.collision.scenes import CAR, FOOTPRINTS, random_pose, random_scene, slow_distance


@pytest.mark.parametrize("name", FOOTPRINTS)
def test_against_every_pair(name):
    rng = np.random.default_rng(len(name))
    footprint = FOOTPRINTS[name]
    for _ in range(12):
        obstacles = random_scene(rng, moving=rng.integers(3))
        poses = np.array([random_pose(rng) for _ in range(12)])
        times = rng.uniform(-2.0, 6.0, 12)
        around = surroundings_of(obstacles, (0.0, 0.0))
        found = around.nearest(parts_of(footprint), poses, times)
        for k in range(12):
            truth = slow_distance(footprint, obstacles, poses[k], times[k])
            assert found.distance[k] == pytest.approx(truth, abs=1e-9)
            nearest = (obstacles[found.owner[k]],)
            assert slow_distance(footprint, nearest, poses[k], times[k]) <= truth + 1e-9


def test_without_obstacles_all_is_far():
    for obstacles in ((), (OccupancyMap(np.zeros((3, 3)), resolution=1.0),)):
        found = surroundings_of(obstacles, (0.0, 0.0)).nearest(
            parts_of((CAR,)), np.zeros((2, 3)), np.zeros(2)
        )
        assert found.distance.tolist() == [math.inf, math.inf]
        assert found.owner.tolist() == [-1, -1]


def test_speeds_by_hand():
    motion = Motion([0.0, 2.0, 3.0], [[0, 0, 0], [6, 8, 0], [6, 8, 1.5]])
    around = surroundings_of((Obstacle(Disc(1.0, center=[1.0, 0.0]), motion=motion),), (0.0, 0.0))
    assert around.speed == 5.0
    assert surroundings_of((Obstacle(Disc(1.0)),), (0.0, 0.0)).speed == 0.0
    body = parts_of((Box([2.0, 2.0]), Disc(0.5, center=[3.0, 0.0])))
    speeds = fastest_point(body, np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -2.0]]))
    assert speeds.tolist() == [1.0, 7.0]


def test_the_same_obstacles_are_prepared_once():
    scene = (Obstacle(Disc(1.0)),)
    assert surroundings_of(scene, (0.0, 0.0)) is surroundings_of(scene, (0.0, 0.0))

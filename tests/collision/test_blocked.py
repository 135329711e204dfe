"""The sentence that says what is touched."""

from __future__ import annotations

import pytest

from maneuver_automaton.collision import Box, Disc, Motion, Obstacle, OccupancyMap, Polygon
from maneuver_automaton.collision.blocked import touched

UNIT = (Box([2.0, 2.0]),)
SCENE = (
    Obstacle(Polygon([[5, -1], [7, -1], [7, 1], [5, 1]])),
    Obstacle(Disc(1.0, center=[0.0, 9.0]), name="pillar"),
    OccupancyMap([[0, 1], [0, 0]], resolution=0.5, origin=[-9.0, 0.0, 0.0], name="depot"),
    OccupancyMap([[1]], resolution=0.5, origin=[-9.0, 5.0, 0.0]),
    Obstacle(Disc(0.5), motion=Motion([0.0, 10.0], [[0.0, -20.0, 0.0], [0.0, -10.0, 0.0]])),
)


@pytest.mark.parametrize(
    ("pose", "sentence"),
    [
        ([4.0, 0.0, 0.0], "the vehicle touches obstacle 0 (polygon near (5, 0))"),
        ([0.0, 7.0, 0.0], "the vehicle touches obstacle 'pillar'"),
        ([-7.0, 1.4, 0.0], "the vehicle touches map depot, cell at (-8, 0.45)"),
        ([-9.0, 4.0, 0.0], "the vehicle touches map, cell at (-8.75, 5)"),
        ([0.0, -13.5, 0.0], "the vehicle touches obstacle 4 (disc near (0, -15))"),
        ([0.0, 0.0, 0.0], ""),
        ([-10.5, 0.0, 0.0], ""),
    ],
)
def test_sentences(pose, sentence):
    found = touched(UNIT, SCENE, pose, time=5.0)
    assert found.split(" near")[0].split(" at")[0] == sentence.split(" near")[0].split(" at")[0]


def test_the_place_is_named():
    assert touched((), SCENE, [5.0, 0.25, 0.0]) == (
        "the vehicle touches obstacle 0 (polygon near (5, 0.25))"
    )
    assert touched((), SCENE, [-8.25, 0.25, 0.0]) == (
        "the vehicle touches map depot, cell at (-8.25, 0.25)"
    )


def test_a_margin_is_told_from_contact():
    assert touched(UNIT, SCENE, [3.5, 0.0, 0.0], margin=0.5) == ""
    assert touched(UNIT, SCENE, [3.75, 0.0, 0.0], margin=0.5).startswith(
        "the vehicle is 0.25 m from obstacle 0 (polygon near (5, "
    )


def test_far_from_zero_no_digit_is_lost():
    far = 1e9
    scene = (Obstacle(Box([2.0, 2.0], center=[far, -far])),)
    origin = (far, -far)
    assert touched((), scene, [far + 1.0, -far, 0.0], origin=origin) == (
        "the vehicle touches obstacle 0 (box near (1000000001, -1000000000))"
    )
    assert touched((), scene, [far + 1.0 + 1e-6, -far, 0.0], origin=origin) == ""


def test_without_obstacles_nothing_is_touched():
    assert touched(UNIT, (), [0.0, 0.0, 0.0]) == ""


def test_a_pose_must_be_finite():
    with pytest.raises(ValueError) as error:
        touched(UNIT, SCENE, [float("nan"), 0.0, 0.0])
    assert str(error.value) == "pose: got nan, need finite numbers"

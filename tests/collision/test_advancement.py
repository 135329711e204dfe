"""A motion reported free is free: dense samples by shapely never come nearer than promised."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maneuver_automaton.collision import Box, Disc, Motion, Obstacle
from maneuver_automaton.collision.advancement import clearances, free_times
from maneuver_automaton.collision.body import fastest_points
from maneuver_automaton.groups import SE2
from tests.collision import scenes
from tests.quickly import draws, quick_are
from tests.reference_collision import (
    driven,
    free_times_and_clearances,
    moved,
    shapely_world,
    world_around,
)

ROUNDED = 1e-8  # [m] coordinates are rounded to 1e-9
TWISTS = np.array(
    [
        *scenes.TWISTS,
        (-0.7, 0.0, 0.0),
        (0.0, 1.0, 0.0),  # sideways
        (0.3, -0.8, 0.6),
        (0.0, 0.0, -2.0),
        (0.0, 0.0, 0.0),  # waits
        (1.0, 0.2, 1e-3),
        (1.5, 0.0, 3.0),
    ]
)


def sampled(exact, pose, twist, duration, clock, fastest, *, step=0.04):
    """Times, exact clearances, and by how much these can change from sample to sample."""
    n = 2 + min(int(abs(duration) * fastest / step), 400)
    since = np.linspace(0.0, duration, n)
    distances = exact.clearance(driven(pose, twist, since), clock + since)
    return np.abs(since), np.maximum(distances, 0.0), fastest * abs(duration) / (n - 1)


def assert_bracketed(free, samples, *, keep, margin, short=1.0):
    """Free as long as it is safe, and not given up before something is near.

    It may be given up `short` times as early as need be.
    """
    since, exact, slack = samples
    safe = exact[since <= free]
    assert (safe >= keep - ROUNDED).all(), f"{keep - safe.min():.3g} m too near"
    if free < since[-1]:  # a pose within keep + margin was looked at
        at = np.searchsorted(since, free)
        assert exact[max(at - 1, 0) : at + 1].min() <= short * (keep + margin) + slack + ROUNDED


def motions(rng, n):
    poses = np.array([scenes.random_pose(rng) for _ in range(n)])
    twists = TWISTS[rng.integers(len(TWISTS), size=n)]
    return poses, twists, rng.uniform(-6.0, 6.0, n)


def check_random(name, *, seed, moving, keep, margin, worlds=5, n=24, short=1.0):
    rng = np.random.default_rng([seed, *name.encode()])
    footprint = scenes.FOOTPRINTS[name]
    begun = 0
    for _ in range(worlds):
        obstacles = scenes.random_scene(rng, moving=moving)
        world = world_around(footprint, obstacles, keep=keep)
        exact = shapely_world(footprint, obstacles)
        poses, twists, durations = motions(rng, n)
        clocks = rng.uniform(-1.0, 8.0, n)
        free, last = free_times_and_clearances(
            world, world.into(poses), twists, durations, margin=margin, keep=keep, times=clocks
        ).T
        assert ((free >= 0.0) & (free <= np.abs(durations))).all()
        signed = np.copysign(free, durations)
        at_end = np.maximum(exact.clearance(ends(poses, twists, signed), clocks + signed), 0.0)
        whole = free == np.abs(durations)
        assert (last[whole] <= at_end[whole] - keep + ROUNDED).all(), (
            "the last clearance is no bound"
        )
        assert (last[~whole] <= margin).all()
        assert (at_end[free == 0.0] <= short * (keep + margin) + ROUNDED).all()
        fastest = fastest_points(world.body, twists) + world.arrays.moving.speed.max(initial=0.0)
        for k in np.flatnonzero(free > 0.0):
            begun += 1
            samples = sampled(exact, poses[k], twists[k], durations[k], clocks[k], fastest[k])
            assert_bracketed(free[k], samples, keep=keep, margin=margin, short=short)
    assert begun > 0.2 * worlds * n


def ends(poses, twists, times):
    """Poses (n, 3) after each its own time."""
    return (SE2(poses) @ SE2.exp(times[:, None] * twists)).pose


@pytest.mark.parametrize("name", quick_are(["disc", "truck"], scenes.FOOTPRINTS))
def test_free_motions_are_free(name):
    check_random(name, seed=1, moving=0, keep=0.0, margin=0.005)


@pytest.mark.parametrize("name", quick_are(["angle", "truck", "point"], scenes.FOOTPRINTS))
def test_free_motions_are_free_of_what_moves(name):
    check_random(name, seed=2, moving=2, keep=0.0, margin=0.005)


@pytest.mark.parametrize("name", ["car", "disc"])
def test_a_distance_is_kept_and_no_more(name):
    for moving in (0, 1, 2):
        check_random(name, seed=3, moving=moving, keep=0.3, margin=0.002)


def test_by_hand_a_distance_is_kept_between_two_corners():
    # corner to corner along a diagonal: 0.27 m apart, 0.2 m are to be kept
    obstacle, body = [Obstacle(Box([2.0, 2.0], [3.0, 3.0]))], (Box([2.0, 2.0]),)
    world = world_around(body, obstacle, keep=0.2)
    place = 1.0 - 0.27 / math.sqrt(2.0)
    pose = world.into(np.array([[place, place, 0.0]]))
    away = {"twists": [[-1.0, 0.0, 0.0]], "durations": [1.0], "margin": 0.001, "keep": 0.2}
    assert free_times(world, pose, **away).tolist() == [1.0]


def test_a_distance_is_kept_between_faces():
    world = world_around((Box([2.0, 2.0]),), [Obstacle(Box([2.0, 2.0], [4.0, 0.0]))], keep=0.2)
    start = world.into(np.array([[0.0, 0.0, 0.0]]))
    ahead = {"twists": [[0.5, 0.0, 0.0]], "durations": [9.0], "margin": 0.001, "keep": 0.2}
    assert free_times(world, start, **ahead) == pytest.approx(3.6, abs=0.003)


@pytest.mark.parametrize("name", ["car", "truck", "disc"])
@pytest.mark.parametrize("moving", [0, 2])
def test_driven_in_two_parts_it_is_as_free_as_in_one(name, moving):
    rng = np.random.default_rng([4, moving, *name.encode()])
    footprint, margin = scenes.FOOTPRINTS[name], 1e-3
    for _ in range(6):
        obstacles = scenes.random_scene(rng, moving=moving)
        world, exact = world_around(footprint, obstacles), shapely_world(footprint, obstacles)
        poses, twists, durations = motions(rng, 20)
        clocks = rng.uniform(-1.0, 8.0, 20)
        shared = {"twists": twists, "margin": margin}
        whole = free_times(world, world.into(poses), durations=durations, times=clocks, **shared)
        first = rng.uniform(0.0, 1.0, 20) * durations
        begun = free_times(world, world.into(poses), durations=first, times=clocks, **shared)
        after = world.into(ends(poses, twists, first))
        gone_on = free_times(
            world, after, durations=durations - first, times=clocks + first, **shared
        )
        parts = np.where(begun < np.abs(first), begun, np.abs(first) + gone_on)
        fastest = fastest_points(world.body, twists) + world.arrays.moving.speed.max(initial=0.0)
        for k in np.flatnonzero(np.abs(parts - whole) > 2e-3):
            samples = sampled(exact, poses[k], twists[k], durations[k], clocks[k], fastest[k])
            for free in (parts[k], whole[k]):  # it grazes something: both answers are right
                assert_bracketed(free, samples, keep=0.0, margin=margin)


@pytest.mark.parametrize("name", ["car", "truck", "disc"])
def test_moved_worlds_give_the_same_answer(name):
    rng = np.random.default_rng([5, *name.encode()])
    footprint = scenes.FOOTPRINTS[name]
    compared = differing = 0
    for _ in range(6):
        obstacles = scenes.random_scene(rng, moving=int(rng.integers(0, 3)))
        by = SE2([*rng.uniform(-40.0, 40.0, 2), rng.uniform(-9.0, 9.0)])
        poses, twists, durations = motions(rng, 30)
        shared = {"twists": twists, "durations": durations, "margin": 0.005, "times": 1.0}
        frames = [(obstacles, poses), (moved(obstacles, by), (by @ SE2(poses)).pose)]
        worlds = [world_around(footprint, seen) for seen, _ in frames]
        here, there = (
            free_times(world, world.into(seen), **shared)
            for world, (_, seen) in zip(worlds, frames, strict=True)
        )
        exact = shapely_world(footprint, obstacles)
        moving = worlds[0].arrays.moving.speed.max(initial=0.0)
        fastest = fastest_points(worlds[0].body, twists) + moving
        differs = np.flatnonzero(np.abs(here - there) > 1e-6)
        compared += len(poses)
        differing += len(differs)
        for k in differs:  # it grazes something: both answers are right
            samples = sampled(exact, poses[k], twists[k], durations[k], 1.0, fastest[k])
            for free in (here[k], there[k]):
                assert_bracketed(free, samples, keep=0.0, margin=0.005)
    assert differing <= 0.02 * compared


@given(
    speed=st.floats(0.05, 5.0),
    ahead=st.floats(0.1, 5.0),
    margin=st.floats(1e-6, 0.05),
    backwards=st.booleans(),
)
@settings(max_examples=draws(60))
def test_by_hand_towards_a_wall(speed, ahead, margin, backwards):
    wall = [Obstacle(Box([1.0, 40.0], [0.5 + ahead + 1.0, 0.0]))]
    world = world_around((Box([2.0, 1.0]),), wall)
    sign = -1.0 if backwards else 1.0
    (free,) = free_times(
        world, world.into(np.zeros((1, 3))), twists=[[sign * speed, 0.0, 0.0]],
        durations=[sign * 200.0], margin=margin,
    )  # fmt: skip
    assert (ahead - margin) / speed - 1e-6 <= free <= ahead / speed + 1e-6


def test_by_hand_what_moves_is_met_in_time():
    # the vehicle stands; a disc of 0.5 m comes from 10 m at 2 m/s: it touches at 4.25 s
    coming = [Obstacle(Disc(0.5), motion=Motion([0.0, 10.0], [[10, 0, 0], [-10, 0, 0]]))]
    world = world_around((Box([2.0, 2.0]),), coming)
    pose = world.into(np.zeros((1, 3)))
    waiting = {"twists": [[0.0, 0.0, 0.0]], "margin": 1e-3}
    assert free_times(world, pose, durations=[9.0], **waiting) == pytest.approx(4.25, abs=1e-3)
    assert free_times(world, pose, durations=[4.2], **waiting).tolist() == [4.2]
    later = free_times(world, pose, durations=[9.0], times=3.0, **waiting)
    assert later == pytest.approx(1.25, abs=1e-3)
    gone = free_times(world, pose, durations=[9.0], times=5.9, **waiting)
    assert gone.tolist() == [9.0]
    back = free_times(world, pose, durations=[-9.0], times=9.0, **waiting)
    assert back == pytest.approx(9.0 - 5.75, abs=1e-3)


STANDING = Obstacle(Disc(0.5), motion=Motion([0.0], [[3.0, 0.0, 0.0]]))


@pytest.mark.parametrize(
    ("present", "clock", "duration", "free"),
    [
        ((-math.inf, math.inf), 0.0, 4.0, 1.5),
        ((0.0, 1.2), 0.0, 4.0, 4.0),  # gone before it is reached
        ((2.0, 5.0), 0.0, 4.0, 2.0),  # appears where the vehicle is
        ((2.0, 5.0), 0.0, 1.9, 1.9),
        ((6.0, 7.0), 0.0, 6.5, 6.5),  # appears behind it
        ((2.0, 5.0), -3.0, 9.0, 9.0),  # of a world that is dated later
        ((-2.5, 9.0), 0.0, -9.0, 9.0),  # driven backwards, away from it
        ((-4.0, -2.0), 0.0, -9.0, 2.0),  # backwards into what was there
        ((-9.0, -5.0), 0.0, -9.0, 9.0),
    ],
)
def test_by_hand_what_is_not_there_is_not_met(present, clock, duration, free):
    # Backwards the vehicle, heading the other way, comes to the same places at negative times.
    ahead = 1.0 if duration > 0.0 or present[0] == -2.5 else -1.0
    world = world_around((Box([2.0, 2.0]),), [STANDING], present=(present,))
    (got,) = free_times(
        world, world.into(np.zeros((1, 3))), twists=[[ahead, 0.0, 0.0]],
        durations=[duration], margin=1e-3, times=clock,
    )  # fmt: skip
    assert got == pytest.approx(free, abs=2e-3)


@pytest.mark.parametrize("name", quick_are(["disc"], ["disc", "car", "truck"], exhaustive=True))
def test_free_motions_are_free_of_what_is_there(name):
    rng = np.random.default_rng([6, *name.encode()])
    footprint, met = scenes.FOOTPRINTS[name], 0
    for _ in range(6):
        moving = [scenes.random_moving_obstacle(rng) for _ in range(4)]
        windows = tuple((a, a + rng.uniform(0.2, 3.0)) for a in rng.uniform(-2.0, 6.0, 4))
        world = world_around(footprint, moving, present=windows)
        alone = [shapely_world(footprint, [one]) for one in moving]
        poses, twists, durations = motions(rng, 30)
        clocks = rng.uniform(-1.0, 6.0, 30)
        free = free_times(world, world.into(poses), twists=twists, durations=durations,
                          margin=0.005, times=clocks)  # fmt: skip
        fastest = fastest_points(world.body, twists)
        for k in range(30):
            since = np.linspace(0.0, durations[k], 200)
            times, places = clocks[k] + since, driven(poses[k], twists[k], since)
            measured = np.array(
                [
                    np.where((a <= times) & (times <= b), one.clearance(places, times), np.inf)
                    for one, (a, b) in zip(alone, windows, strict=True)
                ]
            ).min(axis=0)
            assert free[k] == 0.0 or (measured[np.abs(since) <= free[k]] > 0.0).all()
            if free[k] < abs(durations[k]):
                met += 1
                fast = fastest[k] + world.arrays.moving.speed.max()
                slack = fast * abs(durations[k]) / 199
                at = np.searchsorted(np.abs(since), free[k])
                # One that is there for a moment between two samples is not seen by them.
                seen = measured[max(at - 1, 0) : at + 2].min()
                assert seen <= 0.005 + slack or np.isinf(seen)
    assert met > 10


def test_what_appears_on_the_way_is_there_from_then_on():
    world = world_around((Disc(1.0),), [STANDING], present=((1.0, 2.0),))
    times = [0.99, 1.0, 2.0, 2.01]
    measured = clearances(world, world.into(np.zeros((4, 3))), times=times)
    assert measured.tolist() == pytest.approx([math.inf, 1.5, 1.5, math.inf])


def test_a_spin_in_place_is_free_for_ever_where_its_circle_is():
    ring = [Obstacle(Disc(0.2, [2.5 * math.cos(a), 2.5 * math.sin(a)])) for a in range(6)]
    world = world_around((Box([4.0, 2.0]),), ring)  # its circle: 2.236 m, the pillars' 2.3 m
    spin = {"twists": [[0.0, 0.0, 1.0]], "margin": 0.01}
    assert free_times(world, world.into(np.zeros((1, 3))), durations=[50.0], **spin) == 50.0
    (tight,) = free_times(world, world.into(np.array([[0.15, 0.0, 0.0]])), durations=[50.0], **spin)
    assert tight < 7.0


@pytest.mark.parametrize("turn", [5.6e-17, -1e-14, 1e-9, 1e-4])
def test_hardly_turning_is_driving_straight(turn):
    obstacles = [Obstacle(Box([1.0, 4.0], [5.0, 0.0], 0.3)), Obstacle(Disc(0.7, [3.0, 3.0]))]
    footprint = (Box([2.0, 1.0]),)
    world, exact = world_around(footprint, obstacles), shapely_world(footprint, obstacles)
    poses = np.array([[-1.0, y, h] for y in np.linspace(-4.0, 4.0, 15) for h in (0.0, 0.2, -0.3)])
    free = free_times(world, world.into(poses), twists=[[1.0, 0.0, turn]] * len(poses),
                      durations=[9.0] * len(poses), margin=0.005)  # fmt: skip
    assert 5 < (free < 9.0).sum() < len(poses)
    for pose, one in zip(poses, free, strict=True):
        samples = sampled(exact, pose, np.array([1.0, 0.0, turn]), 9.0, 0.0, 1.001)
        assert_bracketed(one, samples, keep=0.0, margin=0.005)


def test_no_obstacle_no_limit():
    world = world_around((Disc(1.0),), [])
    assert free_times(
        world, [[0, 0, 0]], twists=[[1, 0, 0.5]], durations=[1e4], margin=0.1
    ).tolist() == [1e4]


def test_the_margin_is_positive():
    world = world_around((Disc(1.0),), [])
    with pytest.raises(ValueError) as caught:
        free_times(world, [[0, 0, 0]], twists=[[1, 0, 0]], durations=[1.0], margin=0.0)
    assert str(caught.value) == "margin must be positive, got 0.0 m"


def test_what_cannot_be_kept_here_is_not_promised():
    # a world is made for a distance; a pose with less than that is never called free
    world = world_around((Disc(0.5),), [Obstacle(Box([1.0, 9.0], [3.0, 0.0]))], keep=0.4)
    poses = world.into(np.column_stack([np.linspace(0.0, 2.0, 21), np.zeros((21, 2))]))
    free = free_times(world, poses, twists=[[0.0, 0.0, 0.0]] * 21, durations=[1.0] * 21,
                      margin=1e-3, keep=0.4)  # fmt: skip
    assert np.array_equal(free > 0.0, clearances(world, poses) > 0.401)

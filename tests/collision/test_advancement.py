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
from tests.reference_collision import (
    driven,
    free_times_and_gaps,
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


def sampled(footprint, obstacles, pose, twist, duration, clock, world, *, step=0.02):
    """Times, exact clearances, and by how much these can change from sample to sample."""
    fast = float(fastest_points(world.body, np.array([twist]))[0])
    fastest = fast + float(world.arrays.movers.speed.max(initial=0.0))
    n = 2 + min(int(abs(duration) * fastest / step), 1500)
    since = np.linspace(0.0, duration, n)
    exact = shapely_world(footprint, obstacles).clearance(driven(pose, twist, since), clock + since)
    return np.abs(since), np.maximum(exact, 0.0), fastest * abs(duration) / (n - 1)


def assert_bracketed(free, samples, *, keep, margin):
    """Free as long as it is safe, and not given up before something is near."""
    since, exact, slack = samples
    safe = exact[since <= free]
    assert (safe >= keep - ROUNDED).all(), f"{keep - safe.min():.3g} m too near"
    if free < since[-1]:  # a pose within keep + margin was looked at
        at = np.searchsorted(since, free)
        assert exact[max(at - 1, 0) : at + 1].min() <= keep + margin + slack + ROUNDED


def motions(rng, n):
    poses = np.array([scenes.random_pose(rng) for _ in range(n)])
    twists = TWISTS[rng.integers(len(TWISTS), size=n)]
    return poses, twists, rng.uniform(-6.0, 6.0, n)


def check_random(name, *, seed, movers, keep, margin, worlds=8, n=40):
    rng = np.random.default_rng([seed, *name.encode()])
    footprint = scenes.FOOTPRINTS[name]
    ends = 0
    for _ in range(worlds):
        obstacles = scenes.random_scene(rng, movers=movers)
        world = world_around(footprint, obstacles, keep=keep)
        poses, twists, durations = motions(rng, n)
        clocks = rng.uniform(-1.0, 8.0, n)
        out = free_times_and_gaps(
            world, world.into(poses), twists, durations, margin=margin, keep=keep, times=clocks
        )
        at_end = driven_each(poses, twists, np.sign(durations) * out[:, 0])
        exact = np.maximum(
            shapely_world(footprint, obstacles).clearance(
                at_end, clocks + np.sign(durations) * out[:, 0]
            ),
            0.0,
        )
        assert (out[:, 1] <= exact - keep + ROUNDED).all(), "the bound of the last gap is none"
        assert (out[:, 0] <= np.abs(durations)).all()
        for k in range(n):
            ends += out[k, 0] > 0.0
            if not out[k, 0] > 0.0:
                assert exact[k] <= keep + margin + ROUNDED
                continue
            samples = sampled(
                footprint, obstacles, poses[k], twists[k], durations[k], clocks[k], world
            )
            assert_bracketed(out[k, 0], samples, keep=keep, margin=margin)
    assert ends > 0.2 * worlds * n


def driven_each(poses, twists, times):
    return (SE2(poses) @ SE2.exp(times[:, None] * twists)).pose


@pytest.mark.parametrize("name", scenes.FOOTPRINTS)
def test_free_motions_are_free(name):
    check_random(name, seed=1, movers=0, keep=0.0, margin=0.005)


@pytest.mark.parametrize("name", scenes.FOOTPRINTS)
def test_free_motions_are_free_of_what_moves(name):
    check_random(name, seed=2, movers=2, keep=0.0, margin=0.005)


@pytest.mark.xfail(
    strict=True, reason="to sharp corners a distance to keep is kept along normals, not as it is"
)
@pytest.mark.parametrize("name", ["car", "point"])
@pytest.mark.parametrize("movers", [0, 1])
def test_a_distance_is_kept_and_no_more(name, movers):
    check_random(name, seed=3, movers=movers, keep=0.3, margin=0.002, worlds=4)

"""Slabs of time hold all that moves in them, and pass over nothing that a motion meets."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton.collision import Box, Disc, Motion, Obstacle
from maneuver_automaton.collision.layers import layer_arrays
from maneuver_automaton.collision.world import FEW_MOVING, NO_SLABS
from tests.collision import scenes
from tests.reference_collision import free_times_and_clearances, world_around

TWISTS = np.array([*scenes.TWISTS, (0.0, 0.0, 0.0), (1.0, 0.2, 1e-3), (1.5, 0.0, 3.0)])


def without_slabs(world):
    """The slow twin: the same world, with every obstacle followed by itself."""
    moving = world.arrays.moving._replace(slabs=NO_SLABS)
    return replace(world, arrays=world.arrays._replace(moving=moving))


def motions(rng, n):
    """Poses, twists, signed durations and clocks of motions, short and long ones."""
    poses = np.column_stack([rng.uniform(-15.0, 15.0, (n, 2)), rng.uniform(-7.0, 7.0, n)])
    durations = rng.uniform(-6.0, 6.0, n) * rng.choice([0.1, 1.0], n)
    return poses, TWISTS[rng.integers(len(TWISTS), size=n)], durations, rng.uniform(-4.0, 10.0, n)


@pytest.mark.parametrize(("name", "keep"), [("car", 0.0), ("truck", 0.3), ("point", 0.0)])
def test_with_slabs_a_motion_is_proven_free_for_as_long_to_the_last_bit(name, keep):
    rng = np.random.default_rng([7, *name.encode()])
    looked_up = met = 0
    for _ in range(6):
        world = world_around(scenes.FOOTPRINTS[name], scenes.random_traffic(rng, 12), keep=keep)
        assert world.arrays.moving.slabs.leaves > 0
        poses, twists, durations, clocks = motions(rng, 60)
        more = {"margin": 0.005, "keep": keep, "times": clocks}
        seen = world.into(poses)
        found = free_times_and_clearances(world, seen, twists, durations, **more)
        slow = free_times_and_clearances(without_slabs(world), seen, twists, durations, **more)
        assert found[:, 0].tolist() == slow[:, 0].tolist()
        blocked = found[:, 0] < np.abs(durations)
        assert found[blocked, 1].tolist() == slow[blocked, 1].tolist()
        met += blocked.sum()
        looked_up += (found[:, 1] != slow[:, 1]).sum()
    assert met > 20
    assert looked_up > 20


def test_obstacles_that_only_come_and_go_are_passed_over_by_their_places():
    rows = [
        Obstacle(Disc(0.5), motion=Motion([0.0], [[3.0 * k, 0.0, 0.0]]), present_s=(k, math.inf))
        for k in range(6)
    ]
    world = world_around((Disc(0.5),), rows)
    free = free_times_and_clearances(
        world, [[0.0, -4.0, math.pi / 2]] * 2, [[1.0, 0.0, 0.0]] * 2, [9.0, 2.9], margin=1e-3
    )
    assert free[:, 0] == pytest.approx([3.0, 2.9], abs=2e-3)


def test_every_layer_has_the_slabs_of_its_own_obstacles():
    rng = np.random.default_rng(11)
    traffic = [scenes.random_traffic(rng, n) for n in (5, FEW_MOVING - 1, 7)]
    worlds = [world_around((Box([1.0, 0.5]),), some) for some in traffic]
    arrays = layer_arrays(worlds, low=np.arange(3.0), high=np.arange(1.0, 4.0), plane=worlds[0])
    for k, world in enumerate(worlds):
        own, slabs = world.arrays.moving.slabs, arrays.moving.slabs
        begin, width = arrays.sizes[k, 8:]
        leaves, first = arrays.counts[k, 2:]
        assert (begin, width, leaves) == (own.begin, own.width, own.leaves)
        assert slabs.box[first : first + len(own.box)].tolist() == own.box.tolist()

"""Slabs of time hold all that moves in them, and pass over nothing that a motion meets."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton.collision import Box, Disc, Motion, Obstacle
from maneuver_automaton.collision.layers import layer_arrays
from maneuver_automaton.collision.world import FEW_MOVING, NO_SLABS
from maneuver_automaton.groups import SE2
from tests.collision import scenes
from tests.reference_collision import free_times_and_clearances, shapely_world, world_around

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


@pytest.mark.parametrize("name", scenes.FOOTPRINTS)
@pytest.mark.parametrize("keep", [0.0, 0.3])
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


@pytest.mark.parametrize("name", ["car", "disc"])
def test_the_last_clearance_stays_a_bound(name):
    rng = np.random.default_rng([8, *name.encode()])
    footprint = scenes.FOOTPRINTS[name]
    for _ in range(4):
        traffic = [replace(one, present_s=None) for one in scenes.random_traffic(rng, 10)]
        world, exact = world_around(footprint, traffic), shapely_world(footprint, traffic)
        poses, twists, durations, clocks = motions(rng, 40)
        free, last = free_times_and_clearances(
            world, world.into(poses), twists, durations, margin=0.005, times=clocks
        ).T
        whole = free == np.abs(durations)
        ends = (SE2(poses) @ SE2.exp(durations[:, None] * twists)).pose
        at_end = exact.clearance(ends, clocks + durations)
        assert whole.sum() > 10
        assert (last[whole] <= at_end[whole] + 1e-8).all()
        assert (last[whole] > 0.005).all()


@pytest.mark.parametrize("seed", range(6))
def test_a_box_holds_its_obstacle_for_as_long_as_it_is_there(seed):
    traffic = scenes.random_traffic(np.random.default_rng([9, seed]), 9)
    world = world_around((Disc(0.3),), traffic)
    moving = world.arrays.moving
    slabs, n = moving.slabs, len(traffic)
    box = slabs.box.reshape(-1, n, 4)
    assert len(box) == 2 * slabs.leaves
    times = np.linspace(slabs.begin - 2.0, slabs.begin + slabs.leaves * slabs.width + 2.0, 2000)
    leaf = np.clip((times - slabs.begin) // slabs.width, 0, slabs.leaves - 1).astype(int)
    for m, one in enumerate(traffic):
        begin, end = one.presence
        there = (begin <= times) & (times <= end)
        middles = np.asarray(SE2(world.into(one.motion.at(times))).act(moving.middle[m]))
        k = slabs.leaves + leaf
        while k.max() > 0:
            inside = (middles - moving.reach[m] >= box[k, m, :2] - 1e-8).all(axis=1)
            inside &= (middles + moving.reach[m] <= box[k, m, 2:] + 1e-8).all(axis=1)
            assert inside[there].all()
            k = k // 2


def crossing(x, *, present=None):
    """A disc of 0.5 m that drives 10 m ahead from (x, 0) within 10 s."""
    motion = Motion([0.0, 10.0], [[x, 0.0, 0.0], [x + 10.0, 0.0, 0.0]])
    return Obstacle(Disc(0.5), motion=motion, present_s=present)


def test_by_hand_boxes_of_slabs():
    # 10 m in all, 1 m of size, two sizes a slab at least: 8 slabs of 1.25 s
    slabs = world_around((Disc(0.5),), [crossing(0.0)] * FEW_MOVING).arrays.moving.slabs
    assert (slabs.begin, slabs.width, slabs.leaves) == (0.0, 1.25, 8)
    box = slabs.box.reshape(16, FEW_MOVING, 4)
    assert box[8, 0] == pytest.approx([-0.5, -0.5, 1.75, 0.5], abs=1e-5)
    assert box[15, 3] == pytest.approx([8.25, -0.5, 10.5, 0.5], abs=1e-5)
    assert box[3, 1] == pytest.approx([4.5, -0.5, 10.5, 0.5], abs=1e-5)
    assert box[1, 2] == pytest.approx([-0.5, -0.5, 10.5, 0.5], abs=1e-5)


def test_by_hand_what_is_not_there_has_no_box():
    movers = [crossing(0.0, present=(2.5, 5.0))] * FEW_MOVING
    box = world_around((Disc(0.5),), movers).arrays.moving.slabs.box.reshape(16, FEW_MOVING, 4)
    assert np.isinf(box[[8, 15], 0]).all()
    assert box[11, 0] == pytest.approx([3.25, -0.5, 5.5, 0.5], abs=1e-5)


def test_few_obstacles_are_followed_one_by_one():
    few = world_around((Disc(0.5),), [crossing(0.0)] * (FEW_MOVING - 1))
    assert few.arrays.moving.slabs.leaves == 0


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

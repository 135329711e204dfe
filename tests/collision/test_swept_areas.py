"""The polygons of a motion hold all that the body covers, and part it from solids soundly."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maneuver_automaton._compile import inner_kernel, kernel
from maneuver_automaton.collision._kernels_clearance import field_look
from maneuver_automaton.collision._kernels_swept import FREE, UNKNOWN, not_parted, overlaps
from maneuver_automaton.collision.advancement import swept_areas
from maneuver_automaton.collision.arrays import Place
from maneuver_automaton.collision.body import body_of, fastest_points
from maneuver_automaton.groups import SE2
from tests.collision import scenes
from tests.quickly import draws
from tests.reference_collision import (
    driven,
    free_times_and_clearances,
    shapely_world,
    world_around,
)

ROUNDED = 1e-8  # [m]
AROUND = np.stack([f(np.linspace(0.0, 2.0 * np.pi, 64)) for f in (np.cos, np.sin)])  # directions
TWIST = st.tuples(
    st.floats(-1.5, 1.5) | st.just(0.0),
    st.floats(-1.0, 1.0) | st.just(0.0),
    st.floats(-1.0, 1.0) | st.floats(-1e-7, 1e-7) | st.just(0.0),
)


def polygons(body, swept, motion):
    """Of a motion, one for each piece of the body, its rounding included."""
    n = len(body.first) - 1
    firsts = swept.first[motion * n : (motion + 1) * n + 1]
    return [
        (swept.edges[a:b], radius)
        for a, b, radius in zip(firsts[:-1], firsts[1:], body.radius, strict=True)
    ]


@pytest.mark.parametrize("name", scenes.FOOTPRINTS)
@settings(max_examples=draws(25))
@given(twist=TWIST, duration=st.floats(-3.0, 3.0))
def test_no_pose_along_a_motion_stands_out(name, twist, duration):
    body = body_of(scenes.FOOTPRINTS[name])
    swept = swept_areas(body, np.array([twist]), np.array([[duration]]))
    middle, reach = swept.places[0, :2], swept.places[0, 2]
    assert math.isinf(reach) == (abs(twist[2] * duration) > 0.5 * math.pi)
    if math.isinf(reach):
        return
    for pose in driven(np.zeros(3), twist, np.linspace(0.0, duration, 41)):
        for b, (edges, radius) in enumerate(polygons(body, swept, 0)):
            corners = SE2(pose).act(body.edges[body.first[b] : body.first[b + 1], :2])
            heights = corners @ edges[:, 2:4].T - edges[:, 4]
            assert heights.max() <= ROUNDED  # every half plane holds every corner
            farthest = (edges[:, :2] @ AROUND).max(axis=0)
            assert ((corners @ AROUND).max(axis=0) <= farthest + ROUNDED).all()
            assert np.hypot(*(corners - middle).T).max() + radius <= reach + ROUNDED


@inner_kernel
def place_of(pose):
    return Place(pose[0], pose[1], math.cos(pose[2]), math.sin(pose[2]))


@kernel
def parted(world, body, swept, poses, enough, ends, reach, out):
    """`not_parted` of every pose and motion, what the field says of the end, and of both ends."""
    for k in range(poses.shape[0]):
        begins, _ = field_look(world.field, body, place_of(poses[k]))
        for motion in range(swept.places.shape[0]):
            p = not_parted(world, body, swept, motion, place_of(poses[k]), enough)
            out[k, motion, 0] = p
            end = place_of(ends[k, motion])
            if p >= 0 and overlaps(world, body, end, p):
                out[k, motion, 1] = 1
            bound, hits = field_look(world.field, body, end)
            if hits:
                out[k, motion, 1] = 2
            if begins + bound > reach[motion] + 2.0 * enough:
                out[k, motion, 2] = 1


@pytest.mark.parametrize(("name", "keep"), [("truck", 0.1), ("point", 0.0)])
def test_what_it_calls_free_or_blocked_the_proof_along_the_motion_does_too(name, keep):
    rng = np.random.default_rng([9, *name.encode()])
    footprint, margin = scenes.FOOTPRINTS[name], 0.005
    twists = np.array(scenes.TWISTS)
    durations = np.full((len(twists), 2), [0.3, -1.8]) * rng.uniform(0.3, 1.0, (len(twists), 1))
    verdicts = np.zeros(5, dtype=int)
    for _ in range(4):
        obstacles = scenes.random_scene(rng, moving=0)
        world = world_around(footprint, obstacles, keep=keep)
        exact = shapely_world(footprint, obstacles)
        swept = swept_areas(world.body, twists, durations)
        poses = np.array([scenes.random_pose(rng) for _ in range(40)])
        seen = world.into(poses)
        steps = SE2.exp(durations.reshape(-1, 1) * np.repeat(twists, 2, axis=0))
        ends = np.array([(SE2(pose) @ steps).pose for pose in seen])
        met = np.zeros((len(poses), 2 * len(twists), 3), dtype=np.int64)
        reach = (fastest_points(world.body, twists)[:, None] * np.abs(durations)).ravel()
        parted(world.arrays, world.body, swept, seen, keep + margin, ends, reach, met)
        for motion in range(2 * len(twists)):
            twist, t = twists[motion // 2], durations[motion // 2, motion % 2]
            every = np.repeat(twist[None], len(poses), axis=0)
            free, _ = free_times_and_clearances(
                world, seen, every, np.full(len(poses), t), margin=margin, keep=keep, times=0.0
            ).T
            called = met[:, motion, 0]
            assert (free[called == FREE] == abs(t)).all()
            ends_in_it = met[:, motion, 1]
            assert (free[ends_in_it > 0] < abs(t)).all()
            from_both = met[:, motion, 2] > 0
            assert (free[from_both] == abs(t)).all()
            for pose in poses[called == FREE]:
                since = np.linspace(0.0, t, 9)
                apart = exact.clearance(driven(pose, twist, since), since)
                assert apart.min() >= keep + margin - 1e-8
            verdicts += [(called == one).sum() for one in (FREE, UNKNOWN)] + [
                (called >= 0).sum(), (ends_in_it == 2).sum(), from_both.sum()
            ]  # fmt: skip
    assert verdicts[0] > 0
    assert (verdicts[2:] > 0).all() or name == "point"

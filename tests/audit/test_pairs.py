"""Which edges are looked at: those left out change nothing, however many there are."""

from __future__ import annotations

import math

import numpy as np
import pytest

from maneuver_automaton.audit import closest_to, outlines
from maneuver_automaton.audit._kernels_edges import distances
from maneuver_automaton.audit.judge import audit_plan
from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import Box, Disc, Motion, Obstacle, Polygon
from maneuver_automaton.groups import SE2xR
from maneuver_automaton.models import UserModel
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Goal
from tests.audit.test_guarantee import ANY
from tests.collision.scenes import (
    FOOTPRINTS,
    random_pose,
    random_scene,
    random_traffic,
    slow_distance,
)
from tests.quickly import quick_are

FLYER = UserModel(
    name="flyer",
    group=SE2xR,
    control_names=("ahead", "turn", "climb"),
    velocity=lambda z, u: [u[0], 0.0, u[1], u[2]],
)


def random_plan(rng, n):
    """Straight, spinning, standing, and of no length."""
    twists = rng.uniform(-1.0, 1.0, (n, 3)) * [2.0, 1.0, 1.5] * (rng.random((n, 3)) < 0.7)
    trims = [Trim(name=f"t{k}", body_velocity=one, control=one) for k, one in enumerate(twists)]
    durations = rng.uniform(0.0, 3.0, n) * (rng.random(n) < 0.8)
    return Plan(random_pose(rng), trims, durations=durations)


@pytest.mark.parametrize("seed", quick_are(range(10), range(100)))
def test_among_many_movers_the_nearest_counts(seed):
    """Those that never come as near as another one are left out: each by itself tells the same."""
    rng = np.random.default_rng([23, seed])
    body = list(FOOTPRINTS.values())[seed % len(FOOTPRINTS)]
    plan, movers = random_plan(rng, 4), random_traffic(rng, 12)
    one = closest_to(plan, ANY, movers, footprint=body)
    own = [closest_to(plan, ANY, (mover,), footprint=body).measured for mover in movers]
    if math.isinf(min(own)):
        assert math.isinf(one.distance)
        return
    sharp = max(1e-3, 0.011 * min(own))
    assert one.measured == pytest.approx(min(own), abs=sharp)
    assert min(own) - 2.0 * sharp <= one.distance <= one.measured


def test_what_is_far_is_found():
    ahead = Trim(name="ahead", body_velocity=[1.0, 0.0, 0.0], control=[1.0, 0.0, 0.0])
    plan = Plan([0.0, 0.0, 0.0], (ahead,), durations=[2.0])
    for far in (1.0, 1e3, 1e6):
        post = (Obstacle(Disc(0.5, center=[0.0, far])),)
        least = closest_to(plan, ANY, post, footprint=(Disc(0.25),))
        assert least.distance == pytest.approx(far - 0.75, rel=1e-9)


@pytest.mark.parametrize("twist", [(0.0, 0.0, 0.0), (0.0, 0.0, 1.0)])
def test_standing_and_spinning_by_hand(twist):
    trim = Trim(name="here", body_velocity=twist, control=twist)
    bar, post = (Box([4.0, 0.2]),), (Obstacle(Box([0.2, 0.2], center=[0.0, 2.5])),)
    for duration in (0.0, 2.0):
        plan = Plan([0.0, 0.0, 0.0], (trim,), durations=[duration])
        least = closest_to(plan, ANY, post, footprint=bar)
        swings = twist[2] * duration > 0.0
        truth = 2.4 - np.hypot(2.0, 0.1) if swings else 2.3
        assert truth - max(1e-3, 0.011 * truth) <= least.distance <= truth + 1e-9


@pytest.mark.parametrize("moving", [False, True])
def test_a_flight_inside_what_has_no_top_is_refused(moving):
    """Its walls are met nowhere: it begins inside, and never leaves."""
    climb = Trim(name="climb", body_velocity=[1.0, 0, 0, 0.5], control=[1.0, 0.0, 0.5])
    plan = Plan([0.0, 0.0, 0.0, 5.0], (climb,), durations=[2.0])
    block = Polygon([[-50, -50], [50, -50], [50, 50], [-50, 50]])
    motion = Motion([0.0, 9.0], [[0, 0, 0], [1, 0, 0.1]]) if moving else None
    audit = audit_plan(
        plan,
        Goal(pose=plan.end),
        FLYER,
        footprint=(Box([1.0, 1.0]),),
        obstacles=(Obstacle(block, motion=motion),),
        body_height=(-0.5, 0.5),
    )
    assert not audit.passed
    assert audit.min_clearance_m == 0.0
    over = Obstacle(block, motion=motion, height=(0.0, 3.0))
    assert audit_plan(
        plan,
        Goal(pose=plan.end),
        FLYER,
        footprint=(Box([1.0, 1.0]),),
        obstacles=(over,),
        body_height=(-0.5, 0.5),
    ).passed


def test_many_edges_of_what_is_flown_over_count():
    """A polygon of hundreds of corners, its edges far away, right under the body."""
    angles = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
    disc = Polygon(40.0 * np.stack([np.cos(angles), np.sin(angles)], axis=1))
    level = Trim(name="level", body_velocity=[1.0, 0, 0, 0], control=[1.0, 0.0, 0.0])
    plan = Plan([0.0, 0.0, 0.0, 5.0], (level,), durations=[2.0])
    found = audit_plan(
        plan,
        Goal(pose=plan.end),
        FLYER,
        footprint=(Box([1.0, 1.0]),),
        obstacles=(Obstacle(disc, height=(0.0, 4.0)),),
        body_height=(-0.5, 0.5),
    )
    assert found.min_clearance_m == pytest.approx(0.5, abs=5e-3)
    assert found.passed


@pytest.mark.parametrize("seed", range(10))
def test_distances_to_edges_are_those_of_shapely(seed):
    rng = np.random.default_rng([24, seed])
    body = list(FOOTPRINTS.values())[seed % len(FOOTPRINTS)]
    obstacles, within = random_scene(rng), float(rng.uniform(0.5, 3.0))
    poses = np.array([random_pose(rng) for _ in range(40)])
    around = outlines.surroundings_around(obstacles, (0.0, 0.0))
    still = poses[:, None], np.arange(len(poses)), np.zeros(len(poses)), 0j
    edges = (-math.inf, math.inf), around.outline, around.heights, around.index
    found = distances(outlines.body_outline(body), *still, *edges, within)
    for pose, one in zip(poses, found, strict=True):
        slow = slow_distance(body, obstacles, pose)
        if slow > 0.0:  # inside an obstacle, edges may be far
            assert one == pytest.approx(min(slow, within), abs=1e-9)

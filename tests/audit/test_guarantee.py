"""The clearance is guaranteed: no instant has less, by programs that share nothing with it."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from maneuver_automaton.audit import audit_plan
from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import Box, Disc, Motion, Obstacle
from maneuver_automaton.groups import SE2, SE2xR
from maneuver_automaton.models import CarWithTrailer, UserModel
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.primitives.driving import drive
from maneuver_automaton.problem import Goal
from tests.collision.scenes import FOOTPRINTS, random_pose, random_scene, slow_distance
from tests.quickly import quick_are

ANY = UserModel(
    name="any",
    group=SE2,
    control_names=("ahead", "aside", "turn"),
    velocity=lambda z, u: [u[0], u[1], u[2]],
)
FLYER = UserModel(
    name="flyer",
    group=SE2xR,
    control_names=("ahead", "turn", "climb"),
    velocity=lambda z, u: [u[0], 0.0, u[1], u[2]],
)
TRUCK = CarWithTrailer(wheelbase=2.8, hitch_length=3.0, max_steering=0.6, max_speed=2.0)


def sharp(found: float, truth: float) -> bool:
    """Never more than the true one, and at most 1 mm or 1 % less."""
    return truth - max(1e-3, 0.011 * truth) <= found <= truth + 1e-9


def least(distance, times):
    """The least distance at times, and between those about the least ones."""
    values = np.array([distance(time) for time in times])
    found = float(values.min())
    for k in np.argsort(values)[:3]:
        low, high = times[max(k - 1, 0)], times[min(k + 1, len(times) - 1)]
        for _ in range(5):
            finer = np.linspace(low, high, 9)
            values_there = [distance(time) for time in finer]
            best = int(np.argmin(values_there))
            found = min(found, values_there[best])
            low, high = finer[max(best - 1, 0)], finer[min(best + 1, 8)]
    return found


@pytest.mark.parametrize("seed", quick_are(range(5), range(24)))
def test_no_instant_has_less_clearance(seed):
    rng = np.random.default_rng([11, seed])
    n = rng.integers(1, 5)
    twists = rng.uniform(-1.0, 1.0, (n, 3)) * [2.0, 1.0, 1.5] * (rng.random((n, 3)) < 0.7)
    trims = [Trim(name=f"t{k}", body_velocity=one, control=one) for k, one in enumerate(twists)]
    clock = rng.uniform(-1.0, 2.0)
    plan = Plan(random_pose(rng), trims, durations=rng.uniform(0.0, 3.0, n), start_time=clock)
    obstacles = random_scene(rng, moving=seed % 3)
    body = list(FOOTPRINTS.values())[seed % len(FOOTPRINTS)]
    audit = audit_plan(plan, Goal(pose=plan.end), ANY, footprint=body, obstacles=obstacles)
    truth = least(
        lambda time: slow_distance(body, obstacles, plan.pose_at(time), time),
        clock + np.linspace(0.0, plan.duration, 80),
    )
    if math.isfinite(truth):
        assert sharp(audit.min_clearance_m, truth)
        assert audit.passed == (audit.min_clearance_m > 0.0)


@pytest.mark.parametrize("seed", quick_are(range(2), range(12)))
def test_heights_part_what_the_plane_does_not(seed):
    rng = np.random.default_rng([12, seed])
    controls = rng.uniform([0.5, -1.0, -1.0], [2.0, 1.0, 1.0], (3, 3))
    trims = [
        Trim(name=f"t{k}", body_velocity=[u[0], 0.0, u[1], u[2]], control=u)
        for k, u in enumerate(controls)
    ]
    plan = Plan([0.0, 0.0, 0.0, 5.0], trims, durations=rng.uniform(0.5, 3.0, 3))
    houses = tuple(
        Obstacle(Box(rng.uniform(0.3, 6.0, 2), rng.uniform(-4.0, 4.0, 2), rng.uniform(0.0, 3.0)),
                 height=(0.0, rng.uniform(1.0, 5.5)))
        for _ in range(5)
    )  # fmt: skip
    drone = Obstacle(
        Disc(0.4), height=(3.0, 3.5), motion=Motion([0.0, 4.0], [[-4, 3, 0], [4, -2, 2]])
    )
    body, height, every = (Box([3.0, 0.5]),), (-0.2, 0.3), (*houses, drone)

    def distance(time):
        pose, apart = plan.pose_at(time), []
        for one in every:
            over = max(one.height[0] - pose[3] - height[1], pose[3] + height[0] - one.height[1], 0)
            apart.append(math.hypot(slow_distance(body, (one,), pose[:3], time), over))
        return min(apart)

    audit = audit_plan(
        plan, Goal(pose=plan.end), FLYER, footprint=body, obstacles=every, body_height=height
    )
    truth = least(distance, np.linspace(0.0, plan.duration, 100))
    assert sharp(audit.min_clearance_m, truth)


def hauled(seed):
    """A truck that hauls its trailer under controls by a seed: plan, controls and durations."""
    rng = np.random.default_rng([13, seed])
    controls = rng.uniform([-1.5, -0.5], [1.5, 0.5], (4, 2))
    durations = rng.uniform(0.5, 2.0, 4)
    course = drive(TRUCK, [0.1], control=controls, durations=durations)
    ends = [course.reduced_state[k] for k in (0, -1)]
    rests = [
        Trim(name=name, body_velocity=np.zeros(3), control=np.zeros(2), reduced_state=state)
        for name, state in zip(("before", "after"), ends, strict=True)
    ]
    haul = Maneuver(name="haul", source="before", target="after", displacement=course.pose[-1],
                    duration=float(course.time[-1]), course=course)  # fmt: skip
    start = [*rng.uniform(-20.0, 20.0, 2), rng.uniform(-3.0, 3.0)]
    plan = Plan(start, rests, durations=[0.0, 0.0], maneuvers=(haul,))
    return plan, controls, durations


def trailer_poses(plan, controls, durations):
    """Poses of truck and trailer every 1e-4 of the way, each axle by its own rolling (midpoints).

    The trailer's axle rolls along its heading; it is not placed by the angle at the hitch.
    """
    x, y, heading = plan.start.tolist()
    tail = heading - 0.1
    back = [x - 3.0 * math.cos(tail), y - 3.0 * math.sin(tail)]
    poses = [(x, y, heading, *back, tail)]
    for (speed, steering), duration in zip(controls.tolist(), durations.tolist(), strict=True):
        n = math.ceil(1e4 * duration / durations.sum())
        h, turn = duration / n, speed * math.tan(steering) / 2.8
        for _ in range(n):
            middle = heading + 0.5 * h * turn
            half = tail + 0.5 * h * speed * math.sin(heading - tail) / 3.0
            x, y = x + h * speed * math.cos(middle), y + h * speed * math.sin(middle)
            pull = speed * math.cos(middle - half)
            back = [back[0] + h * pull * math.cos(half), back[1] + h * pull * math.sin(half)]
            heading, tail = heading + h * turn, tail + h * speed * math.sin(middle - half) / 3.0
            poses.append((x, y, heading, *back, tail))
    return np.array(poses)


@pytest.mark.parametrize("seed", range(3))
def test_a_trailer_is_where_it_rolls(seed):
    plan, controls, durations = hauled(seed)
    poses = trailer_poses(plan, controls, durations)
    rng = np.random.default_rng([14, seed])
    posts = rng.uniform(poses[:, 3:5].min(axis=0) - 3.0, poses[:, 3:5].max(axis=0) + 3.0, (5, 2))
    corners = np.array([[-0.8, -0.9], [2.0, -0.9], [2.0, 0.9], [-0.8, 0.9]])
    swept = []
    for frame in (poses[:, :3], poses[:, 3:]):
        cosine, sine = np.cos(frame[:, 2, None]), np.sin(frame[:, 2, None])
        x = frame[:, 0, None] + cosine * corners[:, 0] - sine * corners[:, 1]
        y = frame[:, 1, None] + sine * corners[:, 0] + cosine * corners[:, 1]
        swept.append(shapely.polygons(np.stack([x, y], axis=-1)))
    truth = float(shapely.distance(np.concatenate(swept)[:, None], shapely.points(posts)).min())
    body = (Box([2.8, 1.8], [0.6, 0.0]),)
    audit = audit_plan(
        plan,
        Goal(pose=plan.end),
        TRUCK,
        footprint=body,
        parts={"trailer": body},
        obstacles=tuple(Obstacle(Disc(0.1, post)) for post in posts),
    )
    assert (
        audit.min_clearance_m == 0.0
        if truth < 0.1
        else sharp(audit.min_clearance_m, truth - 0.1 + 1e-7)
    )

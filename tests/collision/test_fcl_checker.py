"""FCL, the authority: nothing that collides is free, and little that is free collides."""

from __future__ import annotations

import math
import threading

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from maneuver_automaton.collision import Box, Disc, Motion, Obstacle, OccupancyMap, Polygon
from maneuver_automaton.collision.fcl_checker import Course, FclChecker
from maneuver_automaton.groups import SE2
from tests.collision.scenes import (
    CAR,
    FOOTPRINTS,
    FRAME,
    TWISTS,
    random_pose,
    random_scene,
    slow_distance,
)
from tests.quickly import quick_are

PROVEN = 1e-3
UNIT = (Box([2.0, 2.0]),)


def poses_of(start, twist, duration, n):
    times = np.linspace(0.0, duration, n)
    return times, (SE2(start) @ SE2.exp(np.multiply.outer(times, twist))).pose


def motion_hit(checker, start, twist, duration):
    """Which obstacle a single motion hits."""
    hit = checker.motions_hit([start], [twist], [duration])
    return None if hit is None else hit[1]


def course_hit(checker, start, poses, **more):
    """Which obstacle a single course hits."""
    hit = checker.courses_hit([Course(np.asarray(start), poses)], **more)
    return None if hit is None else hit[1]


def judge(footprint, obstacles, start, twist, duration, n):
    """Least distance of samples, and how much less it can be between them."""
    _, poses = poses_of(start, twist, duration, n)
    least = min(slow_distance(footprint, obstacles, pose) for pose in poses)
    return least, (2.0 + 3.0 * abs(twist[2])) * duration / (n - 1)


def test_without_obstacles_all_is_free():
    checker = FclChecker(UNIT, ())
    assert checker.pose_hit([0.0, 0.0, 0.0]) is None
    assert motion_hit(checker, [0.0, 0.0, 0.0], [1.0, 0.0, 1.0], 1e3) is None


@pytest.mark.parametrize("name", FOOTPRINTS)
def test_poses_against_shapely(name):
    rng = np.random.default_rng(len(name))
    footprint, hits = FOOTPRINTS[name], 0
    for _ in range(12):
        obstacles = random_scene(rng)
        checker = FclChecker(footprint, obstacles)
        for _ in range(25):
            pose = random_pose(rng)
            hit = checker.pose_hit(pose)
            if hit is None:
                assert slow_distance(footprint, obstacles, pose) > 0.0
            else:
                hits += 1
                assert slow_distance(footprint, (obstacles[hit],), pose) <= 0.5 * PROVEN
    assert hits > 3


@pytest.mark.parametrize("name", quick_are(["disc"], FOOTPRINTS))
def test_motions_against_shapely(name):
    rng = np.random.default_rng(100 + len(name))
    footprint, counts = FOOTPRINTS[name], [0, 0]
    for _ in range(20):
        obstacles = random_scene(rng)
        margin = float(rng.choice([0.0, 0.3]))
        checker = FclChecker(footprint, obstacles, margin=margin)
        for _ in range(5):
            start, twist = random_pose(rng), TWISTS[rng.integers(len(TWISTS))]
            duration = float(rng.choice([1e-3, 0.7, 4.0, 9.0]))
            if checker.pose_hit(start) is not None:
                continue
            hit = motion_hit(checker, start, twist, duration)
            if hit is None:
                least, _ = judge(footprint, obstacles, start, twist, duration, 60)
                assert least > margin
            else:
                touched = (obstacles[hit],)
                least, slack = judge(footprint, touched, start, twist, duration, 300)
                assert least <= margin + PROVEN + slack
            counts[hit is None] += 1
    assert min(counts) >= 4


@settings(max_examples=25)
@given(
    seed=st.integers(0, 10**6),
    by=st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-7, 7)),
)
def test_a_moved_scene_gives_the_same_answers(seed, by):
    rng, moved = np.random.default_rng(seed), SE2(np.array(by))
    obstacles = random_scene(rng)
    there = tuple(obstacle.moved(moved) for obstacle in obstacles)
    origin = tuple(rng.uniform(-60.0, 60.0, 2))
    one, other = FclChecker((CAR,), obstacles), FclChecker((CAR,), there, origin=origin)
    for _ in range(4):
        start, twist = random_pose(rng), TWISTS[rng.integers(len(TWISTS))]
        goal = (moved @ SE2(start)).pose
        if slow_distance((CAR,), obstacles, start) > PROVEN:
            assert (one.pose_hit(start) is None) == (other.pose_hit(goal) is None)
            here = motion_hit(one, start, twist, 1.0)
            assert (here is None) == (motion_hit(other, goal, twist, 1.0) is None)


@pytest.mark.parametrize("far", [1e6, -1e9, 1e9])
def test_far_from_zero_no_digit_is_lost(far):
    place = np.array([far, -far - 3.0])
    wall = (
        Obstacle(Polygon(np.array([[5.0, -2.0], [5.5, -2.0], [5.5, 2.0], [5.0, 2.0]]) + place)),
    )
    checker = FclChecker((CAR,), wall, origin=tuple(place))
    start = np.array([*place, 0.0])
    assert motion_hit(checker, start, [1.0, 0.0, 0.0], 1.25 - 1e-6) is None
    assert motion_hit(checker, start, [1.0, 0.0, 0.0], 1.25 + 1e-6) == 0


def test_touching_is_hitting_by_hand():
    square = (Obstacle(Box([2.0, 2.0], center=[4.0, 0.0])),)
    checker = FclChecker(UNIT, square)
    assert checker.pose_hit([2.0, 0.0, 0.0]) == 0  # side to side
    assert checker.pose_hit([2.0, 2.0, 0.0]) == 0  # corner to corner
    assert checker.pose_hit([2.0 - 1e-9, 0.0, 0.0]) is None
    assert motion_hit(checker, [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 2.0) == 0
    assert motion_hit(checker, [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 2.0 - 1e-9) is None
    assert motion_hit(checker, [0.0, 2.0, 0.0], [1.0, 0.0, 0.0], 9.0) == 0  # along its side
    assert motion_hit(checker, [0.0, 2.0 + 1e-9, 0.0], [1.0, 0.0, 0.0], 9.0) is None


def test_inside_by_hand():
    big, small = (Obstacle(Box([20.0, 20.0])),), (Obstacle(Box([0.1, 0.1], center=[0.5, 0.5])),)
    assert FclChecker(UNIT, big).pose_hit([1.0, 2.0, 0.3]) == 0
    assert FclChecker(UNIT, small).pose_hit([0.2, 0.3, 0.0]) == 0
    assert motion_hit(FclChecker(UNIT, big), [1.0, 2.0, 0.3], [0.5, 0.0, 0.2], 1.0) == 0
    ring = (Obstacle(FRAME),)
    assert FclChecker((Disc(1.5),), ring).pose_hit([0.0, 0.0, 0.0]) is None
    assert FclChecker((FRAME,), (Obstacle(Disc(1.5)),)).pose_hit([0.0, 0.0, 1.0]) is None
    assert (
        motion_hit(FclChecker((Disc(1.5),), ring), [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 0.05) is None
    )
    assert motion_hit(FclChecker((Disc(1.5),), ring), [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 0.11) == 0


@pytest.mark.parametrize("width", [0.1, 1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize("heading", [0.0, 0.3, math.pi / 4])
def test_thin_walls_are_seen(width, heading):
    wall = (Obstacle(Box([4.0, width], heading=heading)),)
    across = np.array([-math.sin(heading), math.cos(heading)])
    for footprint in ((Disc(0.1),), (Box([0.2, 0.2]),), ()):
        checker = FclChecker(footprint, wall)
        start = [*(-across), heading + math.pi / 2]
        assert motion_hit(checker, start, [1.0, 0.0, 0.0], 2.0) == 0
        assert motion_hit(checker, start, [1.0, 0.0, 0.3], 2.0) == 0
        assert motion_hit(checker, start, [1.0, 0.0, 0.0], 0.5) is None


def test_a_point_on_an_edge_is_contact():
    scene = (Obstacle(Box([2.0, 2.0])), Obstacle(Disc(1.0, center=[5.0, 0.0])))
    checker = FclChecker((), scene)
    assert checker.pose_hit([1.0, 0.3, 0.0]) == 0
    assert checker.pose_hit([-1.0, -1.0, 2.0]) == 0
    assert checker.pose_hit([1.0 + 3e-9, 0.3, 0.0]) is None
    assert checker.pose_hit([4.0, 0.0, 0.0]) == 1
    assert motion_hit(checker, [-3.0, 1.0, 0.0], [1.0, 0.0, 0.0], 3.0) == 0
    assert motion_hit(checker, [-3.0, 1.001, 0.0], [1.0, 0.0, 0.0], 6.0) is None
    assert motion_hit(checker, [0.0, -3.0, 0.0], [1.0, 0.0, 0.5], 20.0) == 0  # a circle of 2 m
    assert motion_hit(checker, [0.0, -4.5, 0.0], [4.5, 0.0, 1.0], 20.0) == 1


@pytest.mark.parametrize("turns", [1, -3, 1000])
def test_whole_turns_of_the_heading_do_not_count(turns):
    rng = np.random.default_rng(5)
    checker = FclChecker((CAR,), random_scene(rng))
    for _ in range(30):
        pose = random_pose(rng)
        turned = np.add(pose, [0.0, 0.0, 2.0 * math.pi * turns])
        assert checker.pose_hit(pose) == checker.pose_hit(turned)
        twist = TWISTS[rng.integers(len(TWISTS))]
        free = motion_hit(checker, pose, twist, 2.0) is None
        assert (motion_hit(checker, turned, twist, 2.0) is None) == free


def test_a_narrow_miss_is_refined():
    # around (0, 4.093) the far front corner runs on a circle; a post stands just outside it
    radius = math.hypot(3.75, 4.093 + 0.95)
    for distance, hit in ((1.5e-3, None), (-1e-6, 0)):
        angle = -0.2
        place = (radius + distance) * np.array([math.cos(angle), math.sin(angle)]) + [0.0, 4.093]
        post = (Obstacle(Box([1e-6, 1e-6], center=place)),)
        twist = [1.0, 0.0, 1.0 / 4.093]
        checker = FclChecker((CAR,), post)
        assert motion_hit(checker, [0.0, 0.0, 0.0], twist, 4.0) == hit
        assert motion_hit(checker, [0.0, 0.0, 0.0], twist, 1e9) == hit
    rough = FclChecker((CAR,), post, proven=0.5)
    assert motion_hit(rough, [0.0, 0.0, 0.0], twist, 4.0) == 0
    wide = FclChecker((CAR,), post, margin=0.1)
    assert motion_hit(wide, [0.0, 0.0, 0.0], twist, 4.0) == 0


def test_the_margin_is_kept_round_corners():
    post = (Obstacle(Box([1e-6, 1e-6], center=[2.0, 2.0])),)
    checker = FclChecker(UNIT, post, margin=math.sqrt(2.0) - 0.01)
    assert checker.pose_hit([0.0, 0.0, 0.0]) is None
    checker = FclChecker(UNIT, post, margin=math.sqrt(2.0) + 0.01)
    assert checker.pose_hit([0.0, 0.0, 0.0]) == 0


def test_the_index_is_that_of_the_obstacle_touched():
    scene = (
        Obstacle(Disc(0.5, center=[0.0, 9.0])),
        OccupancyMap(np.zeros((2, 2)), resolution=1.0),
        Obstacle(FRAME.moved(SE2([20.0, 0.0, 0.0]))),
        OccupancyMap([[0, 1], [1, 0]], resolution=1.0, origin=[-20.0, 0.0, 0.5]),
        Obstacle(Disc(1.0, center=[0.0, -9.0])),
    )
    checker = FclChecker(UNIT, scene)
    places = [(0.0, 9.0, 0), (20.0, 1.8, 2), (-20.0, 1.0, 3), (0.0, -9.5, 4), (0.0, 0.0, None)]
    for x, y, index in places:
        assert checker.pose_hit([x, y, 0.1]) == index
        assert motion_hit(checker, [x, y, 0.1], [0.01, 0.0, 0.1], 1.0) == index


@pytest.mark.parametrize("name", FOOTPRINTS)
def test_what_is_laid_out_as_motions_come_near_answers_as_all_of_a_map(name):
    rng = np.random.default_rng(3)
    hits = 0
    for _ in range(12):
        obstacles = random_scene(rng)
        one, whole = (FclChecker(FOOTPRINTS[name], obstacles) for _ in range(2))
        whole.lay_all()
        for _ in range(3):  # each comes near to others
            starts = [random_pose(rng) for _ in range(3)]
            motions = starts, rng.normal(size=(3, 3)) * [[1.0], [1.0], [0.0]], [2.0, 0.0, 1.0]
            hit = one.motions_hit(*motions)
            assert hit == whole.motions_hit(*motions)
            hits += hit is not None
    assert 0 < hits < 36


def test_what_moves_does_not_count():
    motion = Motion([0.0, 1.0], [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    checker = FclChecker(UNIT, (Obstacle(Disc(1.0), motion=motion),))
    assert checker.pose_hit([0.0, 0.0, 0.0]) is None
    assert motion_hit(checker, [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 1.0) is None


@pytest.mark.parametrize(
    "corners",
    [
        [[0, 0], [0, 0], [2, 0], [2, 0], [2, 2], [0, 2], [0, 2], [0, 0]],  # repeated
        [[0, 0], [1, 0], [2, 0], [2, 1], [2, 2], [0, 2]],  # on one line
        [[0, 0], [0, 2], [2, 2], [2, 0]],  # clockwise
        [[0, 0], [2, 0], [5, 0], [2, 0], [2, 2], [0, 2]],  # a spike without width
        [[0, 0], [2, 0], [2, 2], [0, 2], [0, 0], [2, 0], [2, 2], [0, 2]],  # twice around
        [[0, 0], [2, 0], [0.5, 1.5], [0.5, 0.5], [2, 2], [0, 2]],  # crosses itself
    ],
)
def test_careless_polygons_lose_nothing_solid(corners):

    checker = FclChecker((), (Obstacle(Polygon(corners)),))
    careful = shapely.make_valid(shapely.Polygon(corners))
    rng = np.random.default_rng(1)
    for x, y in rng.uniform(-0.5, 2.5, (60, 2)):
        if careful.contains(shapely.Point(x, y)):
            assert checker.pose_hit([x, y, 0.0]) == 0
    assert checker.pose_hit([0.25, 0.1, 0.0]) == 0
    assert checker.pose_hit([-0.25, 0.1, 0.0]) is None
    body = FclChecker((Polygon(corners),), (Obstacle(Box([1e-3, 1e-3])),))
    assert body.pose_hit([-0.25, -0.1, 0.0]) == 0
    assert body.pose_hit([0.25, 0.1, 0.0]) is None


def test_what_is_no_polygon_is_refused():
    line = Polygon([[0, 0], [1, 1], [2, 2], [1, 1]])
    message = "polygon: got 4 corners around no area, near (0, 0); need corners that are not all on"
    for parts in (((line,), ()), ((), (Obstacle(line),))):
        with pytest.raises(ValueError) as error:
            FclChecker(*parts)
        assert str(error.value).startswith(message)


def test_wrong_numbers_are_refused():
    checker = FclChecker(UNIT, (Obstacle(Disc(1.0)),))
    for call, message in [
        (lambda: checker.pose_hit([0.0, math.nan, 0.0]), "pose: got nan, need finite numbers"),
        (lambda: checker.pose_hit([0.0, 0.0]), "pose: got shape (2,), need 3 components last"),
        (
            lambda: motion_hit(checker, [0, 0, 0], [math.inf, 0, 0], 1.0),
            "body_velocities: got inf, need finite numbers",
        ),
        (
            lambda: motion_hit(checker, [0, 0, 0], [1, 0, 0], -1.0),
            "durations: got -1.0 s, need at least 0",
        ),
        (
            lambda: FclChecker((), (), margin=-0.1),
            "margin must be at least 0, got -0.1 m",
        ),
        (lambda: FclChecker((), (), proven=0.0), "proven must be positive, got 0.0 m"),
    ]:
        with pytest.raises(ValueError) as error:
            call()
        assert str(error.value) == message


def test_threads_do_not_disturb_each_other():
    rng = np.random.default_rng(9)
    checker = FclChecker((CAR,), random_scene(rng))
    poses = [random_pose(rng) for _ in range(150)]
    expected = [checker.pose_hit(pose) for pose in poses]
    answers: list[list[int | None]] = []

    def ask():
        answers.append([checker.pose_hit(pose) for pose in poses])

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert answers == [expected] * 4


@pytest.mark.parametrize("seed", quick_are(range(4), range(20)))
def test_a_course_of_one_coast_is_that_coast(seed):
    """Cut into samples of any length, also where they turn by radians."""
    rng = np.random.default_rng([500, seed])
    obstacles, answers = random_scene(rng), set()
    checker = FclChecker((CAR,), obstacles)
    for _ in range(12):
        start, twist = random_pose(rng), np.array(TWISTS[rng.integers(len(TWISTS))])
        times = np.append(0.0, np.sort(rng.uniform(0.0, 2.0, rng.choice([1, 4, 60]))))
        poses = SE2.exp(times[:, None] * twist).pose
        hit = motion_hit(checker, start, twist, times[-1])
        found = course_hit(checker, start, poses)
        if (hit is None) != (found is None):  # then it is a matter of what counts as proven
            least, slack = judge((CAR,), obstacles, start, twist, times[-1], 300)
            assert least <= PROVEN + slack
        answers.add(found is None)
    assert answers

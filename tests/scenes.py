"""Problems with obstacles, each made from a few numbers or from a seed.

The car is that of the car scenarios: 4.7 m by 1.9 m, its pose that of the rear axle, 0.95 m before
the rear end, six Reeds-Shepp trims at 1 m/s on circles of 4.093 m, so that cost = time = length.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Iterator

import numpy as np

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.collision import (
    Box,
    Disc,
    Motion,
    Obstacle,
    OccupancyMap,
    Polygon,
    Shape,
)
from maneuver_automaton.models import Unicycle
from maneuver_automaton.problem import Bounds, Goal, Problem
from tests.solids import World, clearance_at

CAR_LENGTH, CAR_WIDTH, CAR_REAR = 4.7, 1.9, 0.95  # [m]
CAR_BODY = Box([CAR_LENGTH, CAR_WIDTH], [CAR_LENGTH / 2 - CAR_REAR, 0.0])
CAR_RADIUS = 2.8 / math.tan(0.6)  # [m]

SLOTS = (5.9, 5.7, 5.5, 5.3, 5.2)  # [m] length
BAYS = ((2.4, 6.0), (2.1, 6.0), (2.2, 4.6), (2.1, 4.3))  # [m] width, aisle
CORRIDORS = (4.1, 3.9, 3.7)  # [m] width


@functools.cache
def reeds_shepp(radius: float = CAR_RADIUS) -> Automaton:
    """Six trims at 1 m/s, straight and on circles of `radius` [m]."""
    turn = 1.0 / radius
    controls = {
        name + sign: (speed, turning)
        for sign, speed in (("+", 1.0), ("-", -1.0))
        for name, turning in (("L", turn), ("S", 0.0), ("R", -turn))
    }
    return Automaton.of_controls(Unicycle(), controls)


@functools.cache
def dubins(radius: float) -> Automaton:
    """The three forward trims at 1 m/s."""
    turn = 1.0 / radius
    return Automaton.of_controls(
        Unicycle(), {"left": (1.0, turn), "straight": (1.0, 0.0), "right": (1.0, -turn)}
    )


@functools.cache
def differential_robot(speed: float = 0.5, turn_rate: float = 1.0) -> Automaton:
    """Ahead, back, spins on the spot, one arc to either side, and rest."""
    return Automaton.of_controls(
        Unicycle(),
        {
            "rest": (0.0, 0.0),
            "ahead": (speed, 0.0),
            "back": (-speed, 0.0),
            "spin left": (0.0, turn_rate),
            "spin right": (0.0, -turn_rate),
            "left": (speed, turn_rate),
            "right": (speed, -turn_rate),
        },
    )


def parallel_slot(length: float) -> Problem:
    """Into a slot of `length` [m] between two parked cars; S1 of the car scenarios at 6.5 m."""
    goal = [(length - CAR_LENGTH) / 2 + CAR_REAR, 1.25, 0.0]
    obstacles = [
        *walls(-12.0, 22.0, 0.0, 7.5),
        _block(-CAR_LENGTH, 0.0, 0.3, 2.2),
        _block(length, length + CAR_LENGTH, 0.3, 2.2),
    ]
    return _car_problem([8.0, 3.95, 0.0], goal, obstacles)


def bay(width: float, aisle: float) -> Problem:
    """Backwards into a bay, `width` [m] between the neighbours; S2 at 2.6 m and 6 m."""
    ends = (-2.1, width + 2.1)
    obstacles = [
        *walls(-14.0, 16.0, -5.0, aisle),
        _block(-CAR_WIDTH, 0.0, -4.8, -0.1),
        _block(width, width + CAR_WIDTH, -4.8, -0.1),
        _block(-14.0, ends[0], -5.0, 0.0),
        _block(ends[1], 16.0, -5.0, 0.0),
    ]
    return _car_problem([-8.0, aisle / 2, 0.0], [width / 2, -3.85, math.pi / 2], obstacles)


def corridor(width: float) -> Problem:
    """Along a corridor of `width` [m] with four right angles; S6 at 4.5 m."""
    obstacles = [
        *walls(0.0, 60.0, 0.0, 20.0),
        _block(0.0, 20.0 - width, width, 20.0),
        _block(20.0, 40.0 - width, 0.0, 20.0 - width),
        _block(40.0, 60.0, width, 20.0),
    ]
    return _car_problem([2.0, width / 2, 0.0], [54.0, width / 2, 0.0], obstacles)


def room_queries(
    n: int = 40, *, boxes: int = 35, side: float = 30.0, seed: int = 35
) -> list[Problem]:
    """Queries in one room full of boxes: start and goal clear by 0.3 m and 8 m apart."""
    rng = np.random.default_rng(seed)
    clutter = _boxes(rng, boxes, side, sizes=(0.5, 2.0))
    return list(itertools.islice(_free_pairs(rng, clutter, side, apart=8.0), n))


def field_query(side: float, apart: float, *, seed: int, density: float = 0.01) -> Problem:
    """A query of `apart` [m], as the crow flies, in the middle of a square field of boxes.

    `density` is the number of boxes per square metre, of 1 to 3 m.
    """
    rng = np.random.default_rng([seed, round(side), round(apart)])
    clutter = _boxes(rng, round(density * side * side), side, sizes=(1.0, 3.0))
    problem = _car_problem([0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [*walls(0, side, 0, side), *clutter])
    world = World(problem)
    while True:
        along = rng.uniform(0.0, 2 * math.pi)
        half = 0.5 * apart * np.array([math.cos(along), math.sin(along)])
        shift = rng.uniform(-0.5, 0.5, 2) * max(0.0, side - apart - 12.0) * 0.2
        ends = [side / 2 + shift - half, side / 2 + shift + half]
        poses = np.array([[*end, rng.uniform(-math.pi, math.pi)] for end in ends])
        if world.clearance(poses).min() > 0.3:
            return _car_problem(poses[0], poses[1], problem.obstacles)


def no_way_in(side: float = 100.0, *, density: float = 0.01, seed: int = 1) -> Problem:
    """A slot too short to enter in a large field: all that time allows is searched.

    `density` is the number of boxes per square metre, of 1 to 3 m.
    """
    rng = np.random.default_rng(seed)
    length = CAR_LENGTH + 0.02
    center = side / 2
    clutter = [
        box
        for box in _boxes(rng, round(density * side * side), side, sizes=(1.0, 3.0))
        if np.abs(box.center - center).max() > 14.0
    ]
    corner = center - length / 2
    obstacles = [
        *walls(0.0, side, 0.0, side),
        *clutter,
        _block(corner - CAR_LENGTH, corner, center, center + 2.0),
        _block(corner + length, corner + length + CAR_LENGTH, center, center + 2.0),
        _block(corner - 4.0, corner + length + 4.0, center - 0.6, center - 0.01),
    ]
    goal = [corner + 0.01 + CAR_REAR, center + CAR_WIDTH / 2, 0.0]
    return _car_problem([center, center + 5.0, 0.0], goal, obstacles)


def random_scene(seed: int) -> Problem:
    """Any vehicle, body, clutter and goal; every tenth seed is a degenerate case.

    Start and goal may be anywhere: free, touching, inside obstacles, outside the bounds.
    """
    rng = np.random.default_rng([2000, seed])
    if seed % 10 == 9:
        kinds = _degenerate_scenes()
        return kinds[(seed // 10) % len(kinds)](rng)
    side = rng.uniform(12.0, 30.0)
    automaton, bodies = _random_vehicle(rng)
    obstacles = [_random_obstacle(rng, side) for _ in range(rng.integers(1, 25))]
    if rng.random() < 0.2:
        obstacles.append(_random_map(rng, side))
    return Problem(
        automaton,
        _random_pose(rng, side),
        _random_goals(rng, side),
        obstacles=obstacles,
        footprint=bodies,
        margin=float(rng.choice([0.0, 0.0, 0.05, 0.2])),
        bounds=_random_bounds(rng, side),
    )


def moving_scene(seed: int, *, moving: int = 12, side: float = 20.0) -> Problem:
    """A robot, a disc of 0.3 m, crosses a square area that others cross too, for 60 s at most.

    Discs and boxes, straight at one speed, on a broken line, or to and fro; up to four boxes stand
    still. The start is clear by 0.3 m at time 0, the goal at the far side.
    """
    rng = np.random.default_rng([12, seed])
    robot = Disc(0.3)
    still = _boxes(rng, int(rng.integers(0, 5)), side, sizes=(0.5, 2.0))
    bounds = Bounds(x=(0.0, side), y=(0.0, side))
    automaton = differential_robot(speed=1.0, turn_rate=1.5)
    while True:
        start = [
            rng.uniform(1.0, 3.0),
            rng.uniform(1.0, side - 1.0),
            rng.uniform(-math.pi, math.pi),
        ]
        goal = [rng.uniform(side - 3.0, side - 1.0), rng.uniform(1.0, side - 1.0), 0.0]
        traffic = [_moving_obstacle(rng, side) for _ in range(moving)]
        problem = Problem(
            automaton,
            start,
            Goal(pose=goal, free_heading=True),
            obstacles=[*still, *traffic],
            footprint=robot,
            bounds=bounds,
        )
        at_goal = World(Problem(automaton, start, goal, obstacles=still, footprint=robot))
        relative = np.array(goal)[None] - np.append(at_goal.origin, 0.0)
        if clearance_at(problem, start) > 0.3 and at_goal.clearance(relative)[0] > 0.3:
            return problem


def walls(left: float, right: float, low: float, high: float) -> list[Polygon]:
    """Four walls, 0.5 m thick, around a rectangle [m]."""
    return [
        _block(left - 0.5, right + 0.5, low - 0.5, low),
        _block(left - 0.5, right + 0.5, high, high + 0.5),
        _block(left - 0.5, left, low, high),
        _block(right, right + 0.5, low, high),
    ]


def _block(left: float, right: float, low: float, high: float) -> Polygon:
    return Polygon([[left, low], [right, low], [right, high], [left, high]])


def _car_problem(start: object, goal: object, obstacles: object) -> Problem:
    return Problem(reeds_shepp(), start, goal, obstacles=obstacles, footprint=CAR_BODY)


def _boxes(
    rng: np.random.Generator, n: int, side: float, *, sizes: tuple[float, float]
) -> list[Box]:
    return [
        Box(rng.uniform(*sizes, 2), rng.uniform(0.0, side, 2), float(rng.uniform(0.0, math.pi)))
        for _ in range(n)
    ]


def _free_pairs(
    rng: np.random.Generator, clutter: list[Box], side: float, *, apart: float
) -> Iterator[Problem]:
    obstacles = [*walls(0.0, side, 0.0, side), *clutter]
    world = World(_car_problem([0.0, 0.0, 0.0], [0.0, 0.0, 0.0], obstacles))
    while True:
        poses = np.array([_random_pose(rng, side) for _ in range(2)])
        far = np.hypot(*(poses[1] - poses[0])[:2]) >= apart
        if far and world.clearance(poses).min() > 0.3:
            yield _car_problem(poses[0], poses[1], obstacles)


def _random_pose(rng: np.random.Generator, side: float) -> np.ndarray:
    return np.array([*rng.uniform(0.0, side, 2), rng.uniform(-math.pi, math.pi)])


def _random_vehicle(rng: np.random.Generator) -> tuple[Automaton, list[Shape]]:
    kind = rng.integers(4)
    automaton = (
        reeds_shepp() if kind == 0
        else reeds_shepp(1.5) if kind == 1
        else dubins(1.0) if kind == 2
        else differential_robot()
    )  # fmt: skip
    return automaton, _random_body(rng, 1.0 if kind == 0 else 0.3)


def _random_body(rng: np.random.Generator, scale: float) -> list[Shape]:
    """A rectangle, a disc, an L, a tractor with an implement, or a point."""
    bodies: tuple[list[Shape], ...] = (
        [Box(scale * np.array([4.7, 1.9]), scale * np.array([1.4, 0.0]))],
        [Disc(scale)],
        [Polygon(scale * np.array([[-1, -1], [3, -1], [3, 0], [0, 0], [0, 2], [-1, 2]]))],
        [Box(scale * np.array([2.0, 1.0])), Disc(0.6 * scale, scale * np.array([1.5, 0.2]))],
        [],
    )
    return bodies[rng.integers(len(bodies))]


def _random_obstacle(rng: np.random.Generator, side: float) -> Shape:
    """Boxes, discs, and polygons: convex, concave, or with a hole."""
    center = rng.uniform(0.0, side, 2)
    kind = rng.integers(5)
    if kind == 0:
        return Box(rng.uniform(0.3, 4.0, 2), center, float(rng.uniform(0.0, math.pi)))
    if kind == 1:
        return Disc(float(rng.uniform(0.1, 2.0)), center)
    angles = np.sort(rng.uniform(0.0, 2 * math.pi, rng.integers(3, 12)))
    angles = np.linspace(0.0, 2 * math.pi, len(angles), endpoint=False) + 0.3 * np.sin(angles)
    ray = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    radius = rng.uniform(0.5, 2.5)
    if kind == 2:
        return Polygon(center + radius * ray)
    lengths = rng.uniform(0.3, 1.0, (len(angles), 1)) * radius
    if kind == 3:
        return Polygon(center + lengths * ray)
    big = 3.0 * lengths
    return Polygon(center + big * ray, [center + 0.7 * big * ray])


def _random_map(rng: np.random.Generator, side: float) -> OccupancyMap:
    cells = rng.random((int(rng.integers(3, 60)), int(rng.integers(3, 60)))) < 0.05
    return OccupancyMap(cells, resolution=side / 60.0, origin=_random_pose(rng, side / 2))


def _random_goals(rng: np.random.Generator, side: float) -> list[Goal]:
    n = int(rng.choice([1, 1, 1, 2, 4]))
    free = bool(rng.random() < 0.25)
    return [Goal(pose=_random_pose(rng, side), free_heading=free) for _ in range(n)]


def _random_bounds(rng: np.random.Generator, side: float) -> Bounds:
    if rng.random() < 0.6:
        return Bounds()
    return Bounds(x=(0.0, side), y=(0.05 * side, 0.95 * side))


def _degenerate_scenes() -> tuple[Callable[[np.random.Generator], Problem], ...]:
    return (
        _no_obstacle,
        _start_is_goal,
        _all_contained,
        _slivers,
        _far_away,
        _touching_start,
        _touching_goal,
        _in_a_hole,
        _goal_walled_in,
    )


def _no_obstacle(rng: np.random.Generator) -> Problem:
    poses = [_random_pose(rng, 20.0) for _ in range(2)]
    return Problem(reeds_shepp(), *poses, footprint=CAR_BODY)


def _start_is_goal(rng: np.random.Generator) -> Problem:
    pose = _random_pose(rng, 20.0)
    obstacles = _boxes(rng, 5, 20.0, sizes=(0.5, 2.0))
    return Problem(reeds_shepp(), pose, pose, obstacles=obstacles, footprint=CAR_BODY)


def _all_contained(rng: np.random.Generator) -> Problem:
    poses = [_random_pose(rng, 20.0) for _ in range(2)]
    everything = Box([200.0, 200.0], [10.0, 10.0], 0.3)
    return Problem(reeds_shepp(), *poses, obstacles=everything, footprint=CAR_BODY)


def _slivers(rng: np.random.Generator) -> Problem:
    """Needles of a millimetre to a tenth of a micrometre."""
    needles = [
        Box(
            [rng.uniform(0.5, 6.0), 10.0 ** rng.uniform(-7.0, -3.0)],
            rng.uniform(0.0, 20.0, 2),
            float(rng.uniform(0.0, math.pi)),
        )
        for _ in range(12)
    ]
    poses = [_random_pose(rng, 20.0) for _ in range(2)]
    return Problem(reeds_shepp(), *poses, obstacles=needles, footprint=CAR_BODY)


def _far_away(rng: np.random.Generator) -> Problem:
    far = np.array([1e9, -1e9])
    clutter = [
        Obstacle(Box(box.size, box.center + far, box.heading))
        for box in _boxes(rng, 8, 20.0, sizes=(0.5, 2.0))
    ]
    poses = [_random_pose(rng, 20.0) + np.append(far, 0.0) for _ in range(2)]
    return Problem(reeds_shepp(), *poses, obstacles=clutter, footprint=CAR_BODY)


def _touching_start(rng: np.random.Generator) -> Problem:
    """The body's front lies exactly on a wall."""
    wall = _block(2.0, 3.0, -4.0, 4.0)
    goal = [-float(rng.integers(5, 15)), float(rng.integers(-3, 4)), 0.0]
    return Problem(differential_robot(), [1.0, 0.0, 0.0], goal, obstacles=wall,
                   footprint=Box([2.0, 1.0]))  # fmt: skip


def _touching_goal(rng: np.random.Generator) -> Problem:
    scene = _touching_start(rng)
    return Problem(scene.automaton, scene.goals[0].pose, scene.start, obstacles=scene.obstacles,
                   footprint=scene.footprint)  # fmt: skip


def _in_a_hole(rng: np.random.Generator) -> Problem:
    """Start and goal in the hole of one polygon: free, and no way out is needed."""
    ring = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    court = Polygon(30.0 * ring, [12.0 * ring])
    poses = [np.array([*rng.uniform(-7.0, 7.0, 2), rng.uniform(-math.pi, math.pi)]) for _ in "ab"]
    return Problem(reeds_shepp(), *poses, obstacles=court, footprint=CAR_BODY)


def _goal_walled_in(rng: np.random.Generator) -> Problem:
    """The goal in a closed court, the start outside."""
    ring = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    court = Polygon(9.0 * ring, [8.0 * ring])
    start = [20.0, float(rng.uniform(-9.0, 9.0)), float(rng.uniform(-math.pi, math.pi))]
    goal = [0.0, 0.0, float(rng.uniform(-math.pi, math.pi))]
    return Problem(reeds_shepp(), start, goal, obstacles=court, footprint=CAR_BODY)


def _moving_obstacle(rng: np.random.Generator, side: float) -> Obstacle:
    """Crosses the area, there and then gone, or goes to and fro for a minute."""
    shape: Shape = Disc(float(rng.uniform(0.2, 0.7)))
    if rng.random() < 0.5:
        shape = Box([rng.uniform(0.4, 3.0), rng.uniform(0.4, 1.2)])
    speed, depart = rng.uniform(0.3, 1.2), rng.uniform(0.0, 10.0)
    kind = rng.integers(3)
    if kind == 2:
        stops = np.tile(rng.uniform(2.0, side - 2.0, (2, 2)), (8, 1))
        depart = 0.0
    else:
        stops = np.array([_on_the_rim(rng, side, turn) for turn in rng.permutation(4)[:2]])
        if kind == 1:
            stops = np.insert(stops, 1, rng.uniform(0.3 * side, 0.7 * side, 2), axis=0)
    ways = np.maximum(np.hypot(*np.diff(stops, axis=0).T), 0.5)
    times = depart + np.concatenate([[0.0], np.cumsum(ways / speed)])
    headings = np.full(len(stops), rng.uniform(-math.pi, math.pi))
    return Obstacle(shape, motion=Motion(times, np.column_stack([stops, headings])))


def _on_the_rim(rng: np.random.Generator, side: float, turn: int) -> np.ndarray:
    """A place 2 m outside the area, on one of its four sides."""
    along, across = rng.uniform(2.0, side - 2.0), -2.0 if turn < 2 else side + 2.0
    return np.array([along, across] if turn % 2 else [across, along])

"""Random fleets whose vehicles are of several kinds: robots, cars, with inertia, with trailers."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence

import numpy as np
import shapely

import maneuver_automaton as ma
from maneuver_automaton.automaton.library import load_stock_library
from maneuver_automaton.collision import Shape
from maneuver_automaton.fleet import FleetProblem
from tests.fleet.robots import ROBOT
from tests.inertia import unicycle_automaton

KEPT = 0.05  # [m] from obstacles: as much as a tube, half of the fleet's margin
MARGIN = 0.1  # [m]
APART = 0.3  # [m] of any two at their starts, and at their goals
TRIES = 20_000

Ends = tuple[list[float], list[float]]
Kind = Callable[[list[float], list[float], Sequence[Shape]], ma.Problem]


def _goal(pose: list[float], metres: float, radians: float) -> ma.Goal:
    return ma.Goal(pose=pose, tolerance_m=metres, tolerance_rad=radians)


DISC, CART, CAR = ma.Disc(0.3), ma.Box([0.8, 0.5], [0.1, 0.0]), ma.Box([0.9, 0.5], [0.25, 0.0])
LONG, TRAILER = ma.Box([4.0, 1.8], [1.2, 0.0]), ma.Box([3.2, 1.7], [0.2, 0.0])


def disc(start: list[float], goal: list[float], around: Sequence[Shape]) -> ma.Problem:
    """A round robot that turns on the spot."""
    return ma.Problem(
        ROBOT, start, _goal(goal, 0.1, 0.1), footprint=DISC, margin=KEPT, obstacles=around
    )


def cart(start: list[float], goal: list[float], around: Sequence[Shape]) -> ma.Problem:
    """A robot that is longer than wide."""
    return ma.Problem(
        ROBOT, start, _goal(goal, 0.1, 0.1), footprint=CART, margin=KEPT, obstacles=around
    )


@functools.cache
def small_car() -> ma.Automaton:
    """Turns with a radius of 0.8 m."""
    ways = {"on": 1.0, "back": -0.6}
    turns = {"": 0.0, " left": 1.0, " right": -1.0}
    steering = math.atan(0.6 / 0.8)
    trims = {a + b: (v, s * steering) for a, v in ways.items() for b, s in turns.items()}
    return ma.Automaton.of_controls(ma.Car(wheelbase=0.6), {"rest": (0, 0), **trims})


def car(start: list[float], goal: list[float], around: Sequence[Shape]) -> ma.Problem:
    """A small car, which cannot turn on the spot."""
    return ma.Problem(
        small_car(), start, _goal(goal, 0.15, 0.15), footprint=CAR, margin=KEPT, obstacles=around
    )


def heavy(start: list[float], goal: list[float], around: Sequence[Shape]) -> ma.Problem:
    """A robot with inertia: it speeds up and brakes."""
    return ma.Problem(
        unicycle_automaton(),
        start,
        _goal(goal, 0.15, 0.25),
        footprint=DISC,
        margin=KEPT,
        obstacles=around,
    )


@functools.cache
def full_car() -> ma.Automaton:
    """Of four metres."""
    trims = {"rest": (0, 0), "on": (2, 0), "left": (2, 0.5), "right": (2, -0.5)}
    back = {"back": (-1, 0), "back left": (-1, 0.5), "back right": (-1, -0.5)}
    return ma.Automaton.of_controls(ma.Car(wheelbase=2.5), trims | back)


def big_car(start: list[float], goal: list[float], around: Sequence[Shape]) -> ma.Problem:
    """A car of four metres."""
    return ma.Problem(
        full_car(), start, _goal(goal, 0.3, 0.2), footprint=LONG, margin=KEPT, obstacles=around
    )


def truck(start: list[float], goal: list[float], around: Sequence[Shape]) -> ma.Problem:
    """A car with a trailer."""
    return ma.Problem(
        load_stock_library("car_with_trailer"),
        start,
        _goal(goal, 0.4, 0.3),
        footprint=LONG,
        parts={"trailer": TRAILER},
        margin=KEPT,
        obstacles=around,
    )


def mixed_fleet(seed: int, *, least: int = 2, most: int = 30) -> FleetProblem:
    """A fleet at random; of twenty seeds one has inertia among them, and one drives full-size."""
    rng = np.random.default_rng([seed, 3])
    n = int(rng.integers(least, most + 1))
    scene = seed % 20
    if scene == 4:
        n = max(least, n // 3)
        trucks = min(n, int(rng.integers(1, 4)))
        kinds: list[Kind] = [*[truck] * trucks, *[big_car] * (n - trucks)]
        return _scattered(kinds, rng, size=12.0 + 12.0 * math.sqrt(n))
    light: list[Kind] = [disc, cart, car]
    kinds = [light[int(k)] for k in rng.integers(0, 3, n)]
    if scene == 3:
        kinds[: min(n, 5)] = [heavy] * min(n, 5)
    return _scattered(kinds, rng, size=math.sqrt(9.0 * n + 4.0))


def _scattered(kinds: Sequence[Kind], rng: np.random.Generator, *, size: float) -> FleetProblem:
    """Vehicles from random places to random places, with a box in the middle of the square."""
    box = ma.Box([0.1 * size] * 2, [0.5 * size] * 2)
    wall = shapely.box(*[0.45 * size] * 2, *[0.55 * size] * 2)

    def poses() -> list[list[float]]:
        chosen, taken = [], [wall]
        for kind in kinds:
            for _ in range(TRIES):
                pose = [*rng.uniform(0.0, size, 2), rng.uniform(-3.0, 3.0)]
                room = _outline(kind, pose)
                if all(room.distance(one) > APART for one in taken):
                    break
            else:
                raise ValueError(f"no room for {len(kinds)} vehicles on {size:.1f} m")
            chosen.append(pose)
            taken.append(room)
        return chosen

    ends = zip(kinds, poses(), poses(), strict=True)
    return FleetProblem([kind(a, b, (box,)) for kind, a, b in ends], margin=MARGIN)


def _outline(kind: Kind, pose: list[float]) -> shapely.Geometry:
    """The room of a vehicle at rest, straightened."""
    lengths = {cart: (-0.3, 0.5, 0.5), car: (-0.2, 0.7, 0.5), big_car: (-0.8, 3.2, 1.8)}
    lengths[truck] = (-4.5, 3.2, 1.8)
    back, front, width = lengths.get(kind, (0.0, 0.0, 0.0))
    if not width:
        return shapely.Point(pose[:2]).buffer(0.3)
    x, y, heading = pose
    along, aside = np.array([math.cos(heading), math.sin(heading)]), width / 2
    left = np.array([-math.sin(heading), math.cos(heading)])
    corners = [(back, -aside), (front, -aside), (front, aside), (back, aside)]
    return shapely.Polygon([np.array([x, y]) + a * along + b * left for a, b in corners])

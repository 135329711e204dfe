"""Features of what is kept clear of: obstacles, zones and bounds, with every part of the body."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from maneuver_automaton.collision import (
    AnyObstacle,
    Box,
    Disc,
    Obstacle,
    OccupancyMap,
    Polygon,
    Shape,
    Zone,
)
from maneuver_automaton.planning import PlanResult
from maneuver_automaton.problem import Bounds
from tests.matrix import outside
from tests.matrix.measuring import SAMPLED, SLOW, around, asked, fine, found, found_cost, no_dearer
from tests.matrix.outside import Bodies
from tests.matrix.rows import PACKAGE, Engine, changed, feature, with_goals, without
from tests.matrix.scenes import (
    base,
    beside,
    crossing,
    heading_midway,
    left,
    midway,
    passing,
    pillar,
    slow_speed,
)
from tests.matrix.vehicles import Vehicle


def _around_them(vehicle: Vehicle, engine: Engine, *obstacles: AnyObstacle | Shape) -> PlanResult:
    result = asked(vehicle, engine, obstacles=list(obstacles))
    assert result.cost >= base(vehicle).cost * (1.0 - 1e-2)
    return result


@feature(without("obstacles"), says="clearance")
def discs(vehicle: Vehicle, engine: Engine) -> None:
    _around_them(vehicle, engine, pillar(vehicle))


@feature(without("obstacles"), says="clearance")
def polygons(vehicle: Vehicle, engine: Engine) -> None:
    """A concave polygon: an L whose corner stands in the way."""
    corner = np.array([[-1, -1], [1, -1], [1, -0.2], [-0.2, -0.2], [-0.2, 1], [-1, 1]], float)
    _around_them(vehicle, engine, Polygon(0.7 * vehicle.size * corner + midway(vehicle)[:2]))


@feature(without("obstacles"), says="clearance")
def occupancy_map(vehicle: Vehicle, engine: Engine) -> None:
    cells = np.zeros((9, 9), dtype=bool)
    cells[3:6, 3:6] = True
    cells[0, 8] = True
    size = 0.4 * vehicle.size
    origin = np.append(midway(vehicle)[:2] - 4.5 * size, 0.0)
    _around_them(vehicle, engine, OccupancyMap(cells, resolution=size, origin=origin))


@feature(without("obstacles"), says="clearance")
def moving_obstacles(vehicle: Vehicle, engine: Engine) -> None:
    _around_them(vehicle, engine, crossing(vehicle))


@feature(without("margin"), says="clearance")
def margin(vehicle: Vehicle, engine: Engine) -> None:
    """A disc beside the way is passed at the distance asked for."""
    disc = Disc(0.5 * vehicle.size, beside(vehicle, 2.0 * vehicle.size))
    course = fine(vehicle, found(base(vehicle)))
    bodies = around(vehicle, course, vehicle.footprint)
    clear = float(outside.clearances(course, bodies, (Obstacle(disc),)).min())
    assert clear > 0.0
    _ = asked(vehicle, engine, obstacles=[disc], margin=clear + 0.3 * vehicle.size)


@feature(without("zones"), says="m/s in a zone")
def zones(vehicle: Vehicle, engine: Engine) -> None:
    """A small zone in the way is entered slowly or not at all."""
    zone = Zone(
        shape=Box([1.5 * vehicle.size] * 2, midway(vehicle)[:2]), max_speed=slow_speed(vehicle)
    )
    result = asked(vehicle, engine, zones=[zone])
    assert result.cost >= base(vehicle).cost * (1.0 - 1e-2)


@feature(
    without("zones"),
    on="grid",
    applies=lambda vehicle: vehicle.slow is not None,
    says="m/s in a zone",
)
def zones_crossed(vehicle: Vehicle, engine: Engine) -> None:
    """A zone without a way around is crossed: slowly in it, and only there."""
    width = 1.5 * vehicle.size
    strip = Box([width, 20.0 * vehicle.reach], midway(vehicle)[:2], heading_midway(vehicle))
    slow = slow_speed(vehicle)
    result = asked(vehicle, engine, zones=[Zone(shape=strip, max_speed=slow)])
    free, inside = found(base(vehicle)).duration, width + 2.0 * vehicle.size
    ideal = free + inside * (1.0 / slow - 1.0 / vehicle.fastest)
    throughout = free * vehicle.fastest / slow
    share = 0.6 if _goes_on_slowly(vehicle, slow) else 1.0
    if throughout > ideal:
        known = ideal + share * (throughout - ideal)
        no_dearer(result, known, "to be slow in the zone, or all the way,", share=SAMPLED)


def _goes_on_slowly(vehicle: Vehicle, slow: float) -> bool:
    """Whether a trim drives ahead so slowly: a zone is then crossed in it, and left at full speed.

    A vehicle whose slow trims only drive back would have to turn round twice.
    """
    velocities = vehicle.automaton.body_velocities
    slowly = np.linalg.norm(velocities[:, :2], axis=1) <= slow
    return bool((slowly & (velocities[:, 0] > SLOW)).any())


@feature(without("bounds"), says="it leaves the bounds")
def bounds(vehicle: Vehicle, engine: Engine) -> None:
    """The side on which it would pass a pillar is closed by a bound."""
    pose = np.array(vehicle.goal)
    pose[1:3] = 0.0
    goal = vehicle.target(pose=pose)
    disc = Disc(0.8 * vehicle.size, 0.5 * pose[:2])
    open_to_all = asked(vehicle, PACKAGE, goals=goal, obstacles=[disc])
    y = fine(vehicle, open_to_all.plan).pose[:, 1]
    limit = 0.5 * float(y[np.argmax(np.abs(y))])
    closed = Bounds(y=(-10.0 * vehicle.reach, limit) if limit > 0 else (limit, 10 * vehicle.reach))
    result = asked(vehicle, engine, goals=goal, obstacles=[disc], bounds=closed)
    no_dearer(result, 1.5 * open_to_all.cost, "half as much again as the other side")


def _arm(vehicle: Vehicle) -> Disc:
    """Something that sticks out to the left, beyond the footprint."""
    return Disc(0.25 * vehicle.size, [0.0, 1.6 * vehicle.size])


@feature(
    changed(lambda problem: replace(problem, footprint=problem.footprint[:1])), says="clearance"
)
def several_parts(vehicle: Vehicle, engine: Engine) -> None:
    """Only what sticks out of the body would touch the disc."""
    disc = Disc(0.2 * vehicle.size, beside(vehicle, 1.6 * vehicle.size))
    whole = (*vehicle.footprint, _arm(vehicle))
    result = asked(vehicle, engine, obstacles=[disc], footprint=whole)
    assert result.cost >= base(vehicle).cost * (1.0 - 1e-2)


@feature(
    without(parts={}),
    on="car_with_trailer",
    applies=lambda vehicle: bool(vehicle.parts),
    says="clearance",
)
def carried_parts(vehicle: Vehicle, engine: Engine) -> None:
    """What is carried cuts the corner: a disc where only the trailer would touch it."""
    pose = np.array(vehicle.goal)
    pose[:3] = 0.5 * vehicle.reach, 0.5 * vehicle.reach, 0.5 * math.pi
    goal = vehicle.target(pose=pose)
    motion = asked(vehicle, PACKAGE, goals=goal).plan
    assert motion is not None
    course = fine(vehicle, motion)
    own = outside.bodies(course, vehicle.footprint)
    everything = around(vehicle, course, vehicle.footprint)
    spots = [
        spot
        for share in (0.3, 0.4, 0.5, 0.6, 0.7, 0.8)
        for side in (1.0, -1.0)
        for spot in _just_beside(vehicle, motion.pose_at(share * motion.duration), own, side)
        if outside.clearances(course, everything, (Obstacle(spot),)).min() == 0.0
    ]
    assert spots, "no part that is carried leaves the track of the body"
    _ = asked(vehicle, engine, goals=goal, obstacles=[spots[len(spots) // 2]])


def _just_beside(vehicle: Vehicle, pose: np.ndarray, bodies: Bodies, side: float) -> Iterator[Disc]:
    """A small disc beside a pose which all bodies of a course just miss, if there is one."""
    for offset in np.linspace(0.1, 2.0, 96) * vehicle.size:
        disc = Disc(0.05 * vehicle.size, pose[:2] + side * offset * left(float(pose[2])))
        if float(bodies.clearance(*outside.solid(disc)).min()) > 0.005 * vehicle.size:
            yield disc
            return


@feature(
    with_goals(lambda goal: replace(goal, free_heading=False)),
    says="a heading that does not matter",
    applies=lambda vehicle: vehicle.has_heading,
)
def free_heading_among_obstacles(vehicle: Vehicle, engine: Engine) -> None:
    """With any heading it is no costlier than with the one that suits, and ends with another."""
    pose = np.array(vehicle.goal)
    pose[2] += 2.5  # a heading to which to turn would be costly
    goal = vehicle.target(pose=pose, free_heading=True)
    result = asked(vehicle, engine, goals=goal, obstacles=[pillar(vehicle)])
    _, turn = outside.off_goal(result.plan.end, goal)
    assert turn > 1e-6, "it turns to a heading that does not matter"
    no_dearer(result, found_cost(passing(vehicle)), "the plan with a heading", share=1e-2)

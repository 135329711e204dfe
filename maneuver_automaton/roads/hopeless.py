"""What lets every drive from a start fail, told before any search: each answer is a proof.

The start itself, a goal's time, speed and distance, road users who shut a goal off, a place where
the body fits at no heading of the goal, and a goal behind. What is not proven is searched for.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._kept import RECENT
from maneuver_automaton._lazy import shapely
from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import Disc, Shape
from maneuver_automaton.collision.outline import united
from maneuver_automaton.groups import SE2
from maneuver_automaton.roads.lanelets import SEAM, drivable_area
from maneuver_automaton.roads.rules import judged
from maneuver_automaton.roads.scene import (
    EXACT,
    GoalRegion,
    RoadScene,
    geometry_of,
    outlines_of,
)
from maneuver_automaton.roads.vehicle import RoadVehicle

TOUCHES, FAR = 1e-3, 1e5  # [m] what is nearer is not apart, and what is further is not looked at
WIDER = 1.01  # than a circle: shapely draws it as a polygon inside
MOST_NAMES = 20  # of road users who are looked at one by one
MOST_BOXES = 30_000  # of poses: beyond, no proof is looked for
PROVEN = 1e-6  # [m] by which the road is taken to be larger for a proof
Wall: TypeAlias = tuple[Any, float, float]  # a shapely geometry, from when and until when [s]


def hopeless(scene: RoadScene, vehicle: RoadVehicle, there: Plan) -> tuple[str, str] | None:
    """Status and words of what lets every drive fail, as the start and the goals show; else None.

    `there` is the start, a plan of no duration.
    """
    causes = [(one, f"{said} at the start") for one, said in judged(scene, vehicle, there).faults]
    speed, (low, high) = scene.start.speed, vehicle.model.reduced_limits[0].tolist()
    if (beyond := max(low - speed, speed - high)) > EXACT:
        said = f"speed is {beyond:.3g} beyond its limits [{low:g}, {high:g}] at the start"
        causes.append(("undrivable", f"the model cannot drive it: {said}"))
    if causes:
        return causes[0][0], "; ".join(said for _, said in causes)
    least = min(vehicle.length, vehicle.width)  # across: a body may be wider than it is long
    road = shapely.buffer(RECENT.once(drivable_area, scene.lanelets), -0.5 * least)
    why = [_never_reached(goal, scene, vehicle, road) for goal in scene.goals]
    if "" in why:
        shut = _shut_off(scene, vehicle, road, least)
        why = [said or behind for said, behind in zip(why, shut, strict=True)]
    said = "; ".join(dict.fromkeys(why))
    return None if "" in why else ("missed", f"no goal can be reached: {said}")


def kept_at_start(scene: RoadScene, vehicle: RoadVehicle) -> tuple[float, float]:
    """Distances [m] of the body at the start: to the edge of the road, to the nearest road user."""
    size = 0.5 * np.array([vehicle.length, vehicle.width])
    body, now = _bodies(scene.start.middle[None], size), scene.start.time
    there = [
        one.shape if one.motion is None else one.at(now)
        for one, begin, end in [(one, *one.lasts(fleeting=True)) for one in scene.traffic]
        if begin <= now <= end
    ]
    edge = shapely.boundary(RECENT.once(drivable_area, scene.lanelets))
    traffic = float(_away(there, body)[0]) if there else np.inf
    return float(shapely.distance(edge, body)[0]), traffic


def _never_reached(goal: GoalRegion, scene: RoadScene, vehicle: RoadVehicle, road: Any) -> str:
    """Why a goal cannot be reached, whatever is driven; empty if that cannot be seen."""
    # The middle of the body stays on the `road`, which is by half of its width, or length, smaller.
    model, start = vehicle.model, scene.start
    lasts = goal.time[1] - start.time
    if lasts < -EXACT:
        return f"its time is over at {goal.time[1]:.6g} s, before the start at {start.time:.6g} s"
    low, high = goal.speed or (0.0, 0.0)
    slowest, top = model.reduced_limits[0].tolist()
    if low > top + EXACT or high < slowest - EXACT:
        return (
            f"it asks for {low:.6g} to {high:.6g} m/s, but the vehicle's speeds are"
            f" {slowest:.6g} to {top:.6g} m/s"
        )
    if (off := goal.away_from(road)) > 0.0:
        return f"it is off the road, {off:.3g} m from where the middle of the vehicle may be"
    away = goal.away_from(shapely.Point(start.middle[:2]))
    fastest = min(abs(start.speed) + 0.5 * model.max_acceleration * lasts, max(top, -slowest))
    if away > (most := _reach(vehicle, fastest * lasts)):
        return f"it is {away:.3g} m away, and until it is over one drives {most:.3g} m at most"
    if slowest >= 0.0 and (behind := _behind(goal, start.middle, road, vehicle, most)):
        return behind
    if goal.places is not None and goal.heading is not None:
        area = RECENT.once(drivable_area, scene.lanelets)
        if not _may_fit(goal.places, goal.heading, shapely.buffer(area, PROVEN), vehicle):
            return "at none of its headings is the road there wide enough for the body"
    return ""


def _reach(vehicle: RoadVehicle, way: float) -> float:
    """How far the middle of a vehicle gets at most while its rear axle drives a way [m]."""
    # Turning into a direction, and backwards out of it, it gains by its place and loses by arcs.
    tightest, ahead = vehicle.model.turning_radius, vehicle.ahead
    gained = 4.0 * abs(ahead - tightest * math.atan(ahead / tightest))
    return way + min((math.hypot(1.0, ahead / tightest) - 1.0) * way, gained)


def _behind(goal: GoalRegion, middle: Array, road: Any, vehicle: RoadVehicle, most: float) -> str:
    """Why who drives `most` forwards [m] never gets back to a goal; empty if that is not seen."""
    # Before its heading is across that of the start, its rear axle has moved aside by its least
    # radius, and ahead of that is its front. Without it, the rear axle is never behind where it
    # was.
    back = max(vehicle.ahead, 0.0)
    corners = np.array([[-back, -FAR], [FAR, -FAR], [FAR, FAR], [-back, FAR]])
    away = goal.away_from(shapely.Polygon(SE2(middle).act(corners)))
    if away <= 0.0 or vehicle.length < vehicle.width:
        return ""
    here = shapely.Point(middle[:2])
    around = shapely.buffer(here, WIDER * (min(most, FAR) + 2.0 * vehicle.length))
    parts = shapely.get_parts(shapely.intersection(road, around))
    places = shapely.get_coordinates(parts[shapely.distance(parts, here) <= TOUCHES])
    aside = SE2(middle).inverse().act(places)[:, 1]
    tightest = vehicle.model.turning_radius
    if np.ptp(aside) >= tightest + vehicle.ahead + 0.5 * (vehicle.length - vehicle.width):
        return ""
    return f"it is {away + back:.3g} m behind, and nowhere is there room to turn around"


def _may_fit(
    places: Sequence[Shape], headings: tuple[float, float], road: Any, vehicle: RoadVehicle
) -> bool:
    """Whether the body may be on the road with its middle in a place, at one of the headings."""
    # Boxes of poses are halved until the middle of one is such a pose, or until what all poses of a
    # box have in common of the body is not on the road, in each of them.
    shapely.prepare(road)
    size = 0.5 * np.array([vehicle.length, vehicle.width])
    corners = np.concatenate(outlines_of(places))
    low = np.append(corners.min(axis=0), headings[0])
    high = np.append(corners.max(axis=0), headings[1])
    poses, half = 0.5 * (low + high)[None], 0.5 * (high - low)
    while 0 < len(poses) <= MOST_BOXES:
        away = _away(places, shapely.points(poses[:, :2]))
        if shapely.covers(road, _bodies(poses[away <= 0.0], size)).any():
            return True
        # No point of the body is further from where it is at the middle of the box.
        moved = float(np.hypot(*half[:2]) + np.hypot(*size) * half[2])
        if moved < PROVEN:
            return True
        kept = away <= moved
        if moved < size.min():
            kept &= shapely.covers(road, _bodies(poses, size - moved))
        axis = int(np.argmax(half * [1.0, 1.0, np.hypot(*size)]))
        half[axis] *= 0.5
        step = half * (np.arange(3) == axis)
        poses = np.concatenate([poses[kept] - step, poses[kept] + step])
    return len(poses) > 0


def _away(places: Sequence[Shape], points: Any) -> Array:
    """Distances of shapely geometries (n,) to the nearest of some places."""
    apart = [
        shapely.distance(geometry_of(one), points) - (one.radius if isinstance(one, Disc) else 0.0)
        for one in places
    ]
    return np.asarray(np.min(apart, axis=0))


def _bodies(middles: Array, size: Array) -> Any:
    """Rectangles at poses (n, 3); half their length and width (2,)."""
    corners = size * np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    return shapely.polygons(np.asarray(SE2(middles[:, None]).act(corners)))


def _shut_off(scene: RoadScene, vehicle: RoadVehicle, road: Any, least: float) -> list[str]:
    """Who keeps the middle of a vehicle from each goal, in words; empty where nobody does."""
    walls: dict[str, list[Wall]] = {}
    for one in scene.traffic:
        if one.motion is None or not np.ptp(one.motion.pose, axis=0).any():
            begin, end = one.lasts(fleeting=True)
            place = one.shape if one.motion is None else one.at(begin)
            radius = place.radius if isinstance(place, Disc) else 0.0
            grown = shapely.buffer(geometry_of(place), radius + 0.5 * least)
            walls.setdefault(one.name, []).append((grown, begin, end))
    met, alone = _met(scene, vehicle, road, walls), dict[str, list[bool]]()
    if all(met):
        return ["" for _ in met]
    empty, whole = _met(scene, vehicle, road, {}), [False for _ in met]
    if not all(empty):
        grown = shapely.buffer(RECENT.once(drivable_area, scene.lanelets), 0.5 * SEAM)
        whole = _met(scene, vehicle, shapely.buffer(grown, -0.5 * (SEAM + least)), {})
    if any(empty):
        alone = {
            name: _met(scene, vehicle, road, {k: v for k, v in walls.items() if k != name})
            for name in list(walls)[:MOST_NAMES]
        }
    said = []
    for k, goal in enumerate(scene.goals):
        names = [name for name, free in alone.items() if free[k]]
        who = f"{' and '.join(names) or 'road users'} leave{'s' if len(names) == 1 else ''}"
        closed = f"{who} no way to it as wide as the vehicle until {goal.time[1]:.6g} s"
        narrow = f"no way to it is as wide as the vehicle, {least:.3g} m"
        if whole[k]:
            narrow += f"; lanelets that are not stated to be neighbours are up to {SEAM:g} m apart"
        said.append("" if met[k] else closed if empty[k] else narrow)
    return said


def _met(
    scene: RoadScene, vehicle: RoadVehicle, road: Any, walls: Mapping[str, Sequence[Wall]]
) -> list[bool]:
    """Whether the middle of a vehicle can get to each goal, past walls that stand for a time."""
    # From one time at which a wall comes or goes to the next, it stays in a connected part of what
    # they leave of the road, and gets no further than the top speed allows.
    begin, last = scene.start.time, scene.last_time
    every = [one for some in walls.values() for one in some]
    times = sorted({begin, *(t for _, *ends in every for t in ends if begin < t < last)})
    top = float(np.abs(vehicle.model.reduced_limits[0]).max())
    places, met = shapely.Point(scene.start.middle[:2]), [False for _ in scene.goals]
    for low, high in itertools.pairwise([*times, last]):
        most = min(_reach(vehicle, top * (high - low)), FAR)
        around = shapely.buffer(places, TOUCHES + WIDER * most)
        left = shapely.intersection(road, around)
        there = [wall for wall, since, until in every if since <= low and high <= until]
        parts = shapely.get_parts(shapely.difference(left, united(there)) if there else left)
        places = united(parts[shapely.distance(parts, places) <= TOUCHES])
        if places.is_empty:
            break
        for k, goal in enumerate(scene.goals):
            in_time = low <= goal.time[1] and goal.time[0] <= high
            met[k] = met[k] or (in_time and goal.away_from(places) <= TOUCHES)
    return met

"""A scene for the kernels, laid out once: route, goals, obstacles, weights, room, what to clear."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._kept import RECENT
from maneuver_automaton._lazy import shapely
from maneuver_automaton.collision import Disc, Obstacle, Shape
from maneuver_automaton.collision.outline import outlines, united
from maneuver_automaton.collision.world import world_of
from maneuver_automaton.roads.arrays import (
    BeamArrays,
    CarArrays,
    Clearing,
    GoalArrays,
    RouteArrays,
    StaticObstacles,
    Weights,
)
from maneuver_automaton.roads.lanelets import drivable_area, obstacles_in
from maneuver_automaton.roads.plans import RoadSettings
from maneuver_automaton.roads.route import (
    ASIDE,
    COLUMNS,
    GAINING,
    SLOWING,
    SPACING,
    Route,
    extent_on,
)
from maneuver_automaton.roads.rules import Barrier
from maneuver_automaton.roads.scene import (
    EXACT,
    TIME_TOLERANCE,
    GoalRegion,
    RoadScene,
    outlines_of,
)
from maneuver_automaton.roads.vehicle import RoadLibrary, RoadVehicle

STRIPS = 17  # along the route, side by side
LONGEST = 60.0  # [s] that is looked ahead from its begin on to a goal without a last time
SIMPLER = 0.005  # [m] by which the edge of the road may be drawn more simply
INSIDE = 1e-8  # [m] by which a plan ends within its place, so that it does in any coordinates
STRIP = 6.0  # [m] of land along the edge: more than the car is wide or moves in a tick


def route_arrays(route: Route) -> RouteArrays:
    """The route for the kernels, no line closed."""
    speed = np.array(route.limit[:, COLUMNS])
    for k in range(1, len(speed)):
        speed[k] = min(speed[k], math.sqrt(speed[k - 1] ** 2 + 2.0 * GAINING * SPACING))
    return RouteArrays(
        point=np.array(route.points),
        heading=np.array(route.heading),
        direction=np.stack([np.cos(route.heading), np.sin(route.heading)], axis=-1),
        limit=np.array(route.limit),
        time=np.cumsum(SPACING / speed),
        closed=np.zeros((0, 3)),
        slowing=SLOWING,
        spacing=SPACING,
        aside=ASIDE,
    )


def closed_lines(
    closed: Sequence[Barrier], route: Route, vehicle: RoadVehicle, begin: float, keep: float
) -> Array:
    """`RouteArrays.closed` of what closes lines, where it `keep`s a distance [m] from them."""
    rows = list[tuple[float, float, float]]()
    for one in closed:
        low, _, right, left = extent_on((one.strip.corners,), route).tolist()
        if right <= 0.0 <= left:
            opens = one.time[1] - begin if one.stop_line.phases else math.inf
            rows.append((low - 0.5 * vehicle.length - keep, one.time[0] - begin, opens))
    return np.array(sorted(rows, key=lambda row: row[1])).reshape(-1, 3)


def goal_arrays(scene: RoadScene, route: Route, *, tick: float) -> GoalArrays:
    """Goals for the kernels; times as ticks [s] from the start of the scene."""
    rings = [[_within(ring) for ring in outlines_of(goal.places or ())] for goal in scene.goals]
    step, every = scene.step, round(scene.step / tick)
    flat = [ring for group in rings for ring in group]
    start = scene.start.time
    ticks, headings, speeds = [], [], []
    for goal in scene.goals:
        begin, end = goal.time[0] - start, goal.time[1] - start
        end = end if math.isfinite(end) else max(begin, 0.0) + LONGEST
        first, last = max(math.ceil(begin / step - 1e-6), 0), math.floor(end / step + 1e-6)
        ticks.append((every * first, every * last))
        low, high = goal.heading or (0.0, 2.0 * math.pi)
        headings.append((low - EXACT, min(high - low + 2.0 * EXACT, 2.0 * math.pi)))
        low, high = goal.speed or (-math.inf, math.inf)
        speeds.append((low - EXACT, high + EXACT))
    return GoalArrays(
        corner=np.concatenate(flat) if flat else np.zeros((0, 2)),
        ring=np.cumsum([0, *(len(ring) for ring in flat)]).astype(np.int64),
        place=np.cumsum([0, *(len(group) for group in rings)]).astype(np.int64),
        anywhere=np.array([goal.places is None for goal in scene.goals]),
        heading=np.array(headings),
        speed=np.array(speeds),
        tick=np.array(ticks, dtype=np.int64),
        every=every,
        extent=np.array(route.extents),
        turned=np.array(
            [_turned(goal, at, route) for goal, at in zip(scene.goals, route.extents, strict=True)]
        ),
    )


def _within(ring: Array) -> Array:
    """The corners (n, 2) of what is inside a ring, off its edge; the ring if that is no polygon."""
    inner = shapely.buffer(shapely.Polygon(ring), -INSIDE, join_style="mitre")
    same = inner.geom_type == "Polygon" and len(inner.exterior.coords) == len(ring) + 1
    return np.asarray(inner.exterior.coords)[:-1] if same else ring


def static_obstacles(scene: RoadScene, route: Route, vehicle: RoadVehicle) -> StaticObstacles:
    """Static obstacles on the route, grown by the vehicle's half length and half width."""
    area = RECENT.once(drivable_area, scene.lanelets)
    grown = 0.5 * np.array([-vehicle.length, vehicle.length, -vehicle.width, vehicle.width])
    extents, passable = [], []
    for one in scene.traffic:
        if one.motion is not None:
            continue
        extent = extent_on(outlines_of((one.shape,)), route)
        middle = min(max(round(0.5 * (extent[0] + extent[1]) / SPACING), 0), len(route.points) - 1)
        aside = np.array([-np.sin(route.heading[middle]), np.cos(route.heading[middle])])
        extents.append(extent + grown)
        beside = [
            shapely.Point(route.points[middle] + offset * aside).buffer(0.5 * vehicle.width)
            for offset in extents[-1][2:]
        ]
        passable.append([bool(area.covers(place)) for place in beside])
    return StaticObstacles(
        extent=np.array(extents).reshape(-1, 4),
        passable=np.array(passable, dtype=bool).reshape(-1, 2),
    )


def _turned(goal: GoalRegion, extent: Array, route: Route) -> tuple[float, float]:
    """Headings of a goal, seen from the route's direction in the middle of the goal."""
    if goal.heading is None or not np.isfinite(extent).all():
        return -math.inf, math.inf
    low, high = goal.heading
    middle = round(0.5 * (extent[0] + extent[1]) / SPACING)
    ahead = float(route.heading[min(max(middle, 0), len(route.heading) - 1)])
    center = math.remainder(0.5 * (low + high) - ahead, 2.0 * math.pi)
    return center - 0.5 * (high - low), center + 0.5 * (high - low)


def weights_of(scene: RoadScene, vehicle: RoadVehicle) -> Weights:
    """Weights of the cost per second; without a place to go the drive keeps its speed."""
    placed = any(goal.places is not None for goal in scene.goals)
    least = min(goal.speed[0] if goal.speed is not None else 0.0 for goal in scene.goals)
    wanted = least if least > scene.start.speed else 0.0  # where the engine gives less than it can
    return Weights(
        offset=0.05,
        turned=1.0,
        hurry=10.0,
        pace=0.02,
        progress=math.nan if placed else scene.start.speed,
        ahead=0.05,
        aside=0.05,
        lateral=vehicle.lateral,
        braking=vehicle.model.max_acceleration,
        gain=vehicle.engine * vehicle.power_speed / max(wanted, vehicle.power_speed),
    )


def beam_arrays(settings: RoadSettings, library: RoadLibrary) -> BeamArrays:
    """Room for the nodes of one search."""
    limits = library.limits
    levels = round(settings.horizon_s / limits.tick) // limits.ticks + 1
    most = int(np.diff(library.maneuvers.first).max())  # of a node; at first, one for every trim
    children = max(settings.width * most, library.trims.speed.size)
    nodes = 3 + settings.width * levels + children
    return BeamArrays(
        pose=np.empty((nodes, 4)),
        links=np.empty((nodes, 4), dtype=np.int64),
        kept=np.empty((levels, settings.width), dtype=np.int64),
        counts=np.zeros(levels, dtype=np.int64),
        strips=np.zeros(STRIPS, dtype=np.int64),
        cells=np.empty(1 << (64 * settings.width).bit_length(), dtype=np.int64),
        heap_key=np.empty(children),
        heap_node=np.empty(children, dtype=np.int64),
        reached=np.zeros((2, 3)),
        state=np.zeros(5, dtype=np.int64),
    )


def clearing_of(
    scene: RoadScene,
    vehicle: RoadVehicle,
    *,
    tick: float,
    last_tick: int,
    off_edge: float,
    off_traffic: float,
) -> Clearing:
    """Land, traffic and body for the kernels."""
    # Where the vehicle can be until the end, and nothing of a map beyond.
    far = vehicle.model.max_speed * tick * last_tick + vehicle.length
    # A world keeps one distance to all, so static obstacles are grown by what they need besides.
    more = max(off_traffic - off_edge, 0.0)
    still = [
        grown for one in scene.traffic if one.motion is None for grown in _grown(one.shape, more)
    ]
    moving = [one for one in scene.traffic if one.motion is not None]
    present = [one.lasts(fleeting=True) for one in moving]
    world = world_of(
        (*land_around(scene, far=far), *still, *moving),
        (vehicle.footprint,),
        (0.0, 0.0, 0.0),
        keep=off_edge,
        present=tuple((a - TIME_TOLERANCE, b + TIME_TOLERANCE) for a, b in present),
    )
    return Clearing(
        car=CarArrays(
            half_length=0.5 * vehicle.length,
            half_width=0.5 * vehicle.width,
            ahead=vehicle.ahead,
            wheelbase=vehicle.model.wheelbase,
            braking=vehicle.model.max_acceleration,
        ),
        body=world.body,
        world=world.arrays,
        off_static=off_edge,
        off_traffic=off_traffic,
        margin=SIMPLER,
        start=scene.start.time,
        tick=tick,
    )


def land_around(scene: RoadScene, *, far: float) -> tuple[Obstacle, ...]:
    """A strip of land along the edge of the road as obstacles, to `far` [m] from the start."""
    low, high = scene.start.middle[:2] - far, scene.start.middle[:2] + far
    around = shapely.box(*low, *high)
    rings = [(one, one.ring) for one in scene.lanelets]
    near = tuple(
        one
        for one, ring in rings
        if (ring.min(axis=0) <= high).all() and (ring.max(axis=0) >= low).all()
    )
    road = shapely.simplify(shapely.intersection(RECENT.once(drivable_area, near), around), SIMPLER)
    return obstacles_in(shapely.difference(shapely.buffer(road, STRIP, join_style="mitre"), road))


def _grown(shape: Shape, by: float) -> tuple[Obstacle, ...]:
    """Static obstacles that hold all within a distance [m] of a shape."""
    if isinstance(shape, Disc):
        return (Obstacle(Disc(shape.radius + by, shape.center)),)
    outline = united(outlines(shape))
    # Corners become four chords of a quarter circle each, which is that much too small in between.
    return obstacles_in(shapely.buffer(outline, by / math.cos(math.pi / 16.0), quad_segs=4))

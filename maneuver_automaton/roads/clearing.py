"""What a drive has to stay clear of, laid out once for the kernels: a world, and traffic."""

from __future__ import annotations

import math
from typing import Any

from maneuver_automaton.collision import Disc, Obstacle, Shape
from maneuver_automaton.collision.outline import outlines
from maneuver_automaton.collision.world import world_of
from maneuver_automaton.roads.arrays import CarArrays, Clearing
from maneuver_automaton.roads.land import obstacles_in
from maneuver_automaton.roads.lanelets import Lanelet, drivable_area
from maneuver_automaton.roads.scene import TIME_TOLERANCE, RoadScene, presence_of
from maneuver_automaton.roads.vehicle import RoadVehicle

SIMPLER = 0.005  # [m] by which the edge of the road may be drawn more simply
STRIP = 6.0  # [m] of land along the edge: more than the car is wide or moves in a tick


def clearing_of(
    scene: RoadScene,
    vehicle: RoadVehicle,
    *,
    tick: float,
    last_tick: int,
    off_edge: float,
    off_traffic: float,
) -> Clearing:
    """Land, traffic and body for the kernels.

    Parameters
    ----------
    scene, vehicle
    tick : float
        [s]; tick 0 is the start of the scene.
    last_tick : int
        Until it the vehicle may drive.
    off_edge, off_traffic : float
        Distances kept from the edge of the road and from all other road users [m].
    """
    # Where the vehicle can be until the end, and nothing of a map beyond.
    far = vehicle.model.max_speed * tick * last_tick + vehicle.length
    # A world keeps one distance to all, so static obstacles are grown by what they need besides.
    more = max(off_traffic - off_edge, 0.0)
    still = [
        grown for one in scene.traffic if one.motion is None for grown in _grown(one.shape, more)
    ]
    moving = [one for one in scene.traffic if one.motion is not None]
    present = [presence_of(one) for one in moving]
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
    """Land beside the road as static obstacles, no further than `far` [m] from the start.

    A strip along the edge is enough: a body that starts on the road has to cross it.
    """
    import shapely

    x, y = scene.start.middle[:2].tolist()
    around = shapely.box(x - far, y - far, x + far, y + far)
    near = [lanelet for lanelet in scene.lanelets if _meets(lanelet, around)]
    road = shapely.simplify(shapely.intersection(drivable_area(near), around), SIMPLER)
    strip = shapely.difference(shapely.buffer(road, STRIP, join_style="mitre"), road)
    return obstacles_in(strip)


def _grown(shape: Shape, by: float) -> tuple[Obstacle, ...]:
    """Static obstacles that hold all within a distance [m] of a shape."""
    import shapely

    if isinstance(shape, Disc):
        return (Obstacle(Disc(shape.radius + by, shape.center)),)
    outline = shapely.union_all(outlines(shape))
    # Corners become four chords of a quarter circle each, which is that much too small in between.
    return obstacles_in(shapely.buffer(outline, by / math.cos(math.pi / 16.0), quad_segs=4))


def _meets(lanelet: Lanelet, box: Any) -> bool:
    low_x, low_y, high_x, high_y = box.bounds
    low, high = lanelet.ring.min(axis=0), lanelet.ring.max(axis=0)
    return bool(low[0] <= high_x and low_x <= high[0] and low[1] <= high_y and low_y <= high[1])

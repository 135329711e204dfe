"""Rules of the road: what closes a stop line, and which rules a drive broke.

For the search a closed line is an obstacle across the lane, there as long as it is closed. Nobody
else sees it: neither the judge, who measures distances to road users, nor a picture.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._brief import brief
from maneuver_automaton.collision import Motion, Obstacle, Polygon
from maneuver_automaton.collision.outline import united
from maneuver_automaton.groups import SE2
from maneuver_automaton.roads.lanelets import Lanelet, StopLine, drivable_area
from maneuver_automaton.roads.plans import AT_REST
from maneuver_automaton.roads.scene import RoadScene, RoadStart
from maneuver_automaton.roads.vehicle import RoadVehicle

AT_LINE = 3.0  # [m] from the body to a line: who stands there has stopped at it
DEEP = 0.1  # [m] of what closes a line, before it
GAPS = 0.3  # [m] between a lane, the line across it, and the lanes against it
ACROSS = 30.0  # [m] to either side, in which a line goes on over lanes against it
FASTER = 0.05  # [m/s] above a limit that is worth a word


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Barrier:
    """What closes a stop line once."""

    stop_line: StopLine
    strip: Polygon  # before the line
    time: tuple[float, float]  # [s]

    __repr__ = brief

    @property
    def obstacle(self) -> Obstacle:
        """What the search sees."""
        there = Motion(self.time, np.zeros((2, 3)))
        return Obstacle(self.strip, motion=there, name=self.stop_line.name)

    def from_body(self, vehicle: RoadVehicle, rear: Array) -> tuple[float, bool]:
        """Distance to a vehicle's body [m], and whether the barrier is ahead of it."""
        import shapely

        corners, body = self.strip.corners, vehicle.footprint.moved(SE2(rear)).corners
        forward = np.array([math.cos(rear[2]), math.sin(rear[2])])
        ahead = float((corners.mean(axis=0) - body.mean(axis=0)) @ forward) > 0.0
        return float(shapely.distance(shapely.Polygon(corners), shapely.Polygon(body))), ahead

    def opens_for(self, vehicle: RoadVehicle, rear: Array, speed: float) -> bool:
        """Whether it closes the line of a stop sign, and the vehicle stands before that."""
        if self.stop_line.phases or abs(speed) > AT_REST:
            return False
        away, ahead = self.from_body(vehicle, rear)
        return ahead and away <= AT_LINE

    def comes_too_late(self, vehicle: RoadVehicle, start: RoadStart, keep: float) -> bool:
        """Whether a vehicle can neither stop `keep` [m] before it, nor be elsewhere, any more."""
        away, ahead = self.from_body(vehicle, vehicle.rear_of(start.middle))
        braking, room = vehicle.model.max_acceleration, max(away - keep, 0.0)
        if away > 0.0 and (not ahead or 0.5 * start.speed**2 <= braking * room):
            return False
        begin, end = (time - start.time for time in self.time)
        at_rest_before = start.speed - math.sqrt(max(start.speed**2 - 2.0 * braking * room, 0.0))
        gone = (away + vehicle.length) / start.speed if start.speed > 0.0 else math.inf
        return at_rest_before < braking * end and begin <= gone


def barriers(
    scene: RoadScene, vehicle: RoadVehicle, route: Sequence[int], *, until: float
) -> Iterator[Barrier]:
    """What closes stop lines on a route of lanelets, from a scene's start to a time [s]."""
    lanelets = {one.number: one for one in scene.lanelets}
    following = dict(itertools.pairwise(route))
    ours = _side_by_side(lanelets, route)
    for one in scene.stop_lines:
        onward = following.get(one.lanelet)
        elsewhere = not (one.onward is None or onward is None or onward in one.onward)
        if one.lanelet not in ours or elsewhere:
            continue
        strip = _across(one, lanelets, ours)
        for time in one.closed(scene.start.time, until):
            yield Barrier(stop_line=one, strip=strip, time=time)


def _side_by_side(lanelets: dict[int, Lanelet], numbers: Sequence[int]) -> set[int]:
    """Lanelets and all that run beside them in the same direction."""
    found, left = set[int](), [k for k in numbers if k in lanelets]
    while left:
        found.add(number := left.pop())
        left += [k for k in lanelets[number].beside if k in lanelets and k not in found]
    return found


def _across(stop_line: StopLine, lanelets: dict[int, Lanelet], ours: set[int]) -> Polygon:
    """A thin strip before a line, across its lane and the lanes against it, but no other of `ours`.

    It is not to be passed on the wrong side of the road either.
    """
    import shapely

    own = lanelets[stop_line.lanelet]
    against = _side_by_side(lanelets, own.against) - ours
    area = shapely.buffer(
        drivable_area([own, *(lanelets[k] for k in against)]), GAPS, join_style="mitre"
    )
    others = drivable_area([lanelets[k] for k in ours - {stop_line.lanelet}])
    area = united([shapely.difference(area, others), drivable_area([own])])
    ends, center = stop_line.line, own.center
    middle = ends.mean(axis=0)
    along = (ends[1] - ends[0]) / np.hypot(*(ends[1] - ends[0]))
    nearest = int(np.argmin(np.hypot(*(center[:-1] - middle).T)))
    back = np.array([-along[1], along[0]])
    back *= -math.copysign(DEEP, float(back @ (center[nearest + 1] - center[nearest])))
    far = np.array([ends[0] - ACROSS * along, ends[1] + ACROSS * along])
    strip = shapely.intersection(area, shapely.Polygon([*far, *(far[::-1] + back)]))
    parts = [one for one in shapely.get_parts(strip) if one.geom_type == "Polygon"]
    if not parts:  # the line is drawn beside its lane
        return Polygon(np.array([*ends, *(ends[::-1] + back)]))
    there = min(parts, key=lambda one: float(shapely.distance(one, shapely.Point(middle))))
    return Polygon(shapely.get_coordinates(there.exterior)[:-1])


def broken_rules(
    scene: RoadScene, vehicle: RoadVehicle, route: Sequence[int], states: Array, times: Array
) -> tuple[str, ...]:
    """Limits of speed and closed stop lines that states (n, 5) at times (n,) do not keep."""
    said = []
    for barrier in barriers(scene, vehicle, route, until=float(times[-1])):
        one, (begin, end) = barrier.stop_line, barrier.time
        for time, state in zip(times.tolist(), states, strict=True):
            if barrier.opens_for(vehicle, state[:3], float(state[3])):
                break
            if begin < time < end and barrier.from_body(vehicle, state[:3])[0] <= 0.0:
                why = "closed" if one.phases else "passed without a stop"
                said.append(f"{one.name}: its line is {why} at {time:.4g} s, where it is crossed")
                break
    return (
        *said,
        *_too_fast(scene.lanelets, vehicle.middle_of(states[:, :3]), states[:, 3], times),
    )


def _too_fast(
    lanelets: Sequence[Lanelet], middle: Array, speed: Array, times: Array
) -> Iterator[str]:
    """Where a limit is exceeded most, if one is; of lanelets that overlap the greatest holds."""
    import shapely

    places = shapely.points(middle[:, :2])
    allowed = np.full(len(times), -math.inf)
    for one in lanelets:
        limit = math.inf if one.speed_limit is None else one.speed_limit
        inside = shapely.intersects(drivable_area([one]), places)
        allowed[inside] = np.maximum(allowed[inside], limit)
    over = np.where(np.isfinite(allowed), speed - allowed, 0.0)
    if over.max() > FASTER:
        worst = int(over.argmax())
        yield (
            f"the limit of {allowed[worst]:.4g} m/s is exceeded by {over[worst]:.2g} m/s at "
            f"{times[worst]:.4g} s"
        )

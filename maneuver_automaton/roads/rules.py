"""What a drive on the road is judged by: stop lines, limits of speed, traffic, the road, its goal.

For the search a closed line is an obstacle across the lane, there as long as it is closed. Nobody
else sees it: neither the judge, who measures distances to road users, nor a picture. The judge uses
nothing of the planner: the equations are integrated once more, and the body is held against all
other road users while they are there, and against the land beside the road.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._brief import brief
from maneuver_automaton._kept import RECENT
from maneuver_automaton._lazy import shapely
from maneuver_automaton.audit import Audit, audit_plan, closest_to
from maneuver_automaton.audit.clearance import Least
from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import Motion, Obstacle, Polygon
from maneuver_automaton.collision.blocked import too_close
from maneuver_automaton.collision.outline import united
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Goal
from maneuver_automaton.roads.lanelets import Lanelet, StopLine, drivable_area, obstacles_in
from maneuver_automaton.roads.plans import AT_REST
from maneuver_automaton.roads.scene import EXACT, GoalRegion, RoadScene, RoadStart
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
    """A thin strip before a line, across its lane and those against it, no other of `ours`."""
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
    said, corners = [], np.asarray(vehicle.footprint.corners)
    bodies = shapely.polygons(np.asarray(SE2(states[:, None, :3]).act(corners)))
    for barrier in barriers(scene, vehicle, route, until=float(times[-1])):
        one, (begin, end) = barrier.stop_line, barrier.time
        closed = (begin < times) & (times < end)
        crossed = closed & shapely.intersects(bodies, shapely.Polygon(barrier.strip.corners))
        first = int(crossed.argmax())
        if not crossed.any() or any(
            barrier.opens_for(vehicle, state[:3], float(state[3])) for state in states[:first]
        ):
            continue
        why = "closed" if one.phases else "passed without a stop"
        said.append(f"{one.name}: its line is {why} at {times[first]:.4g} s, where it is crossed")
    return (
        *said,
        *_too_fast(scene.lanelets, vehicle.middle_of(states[:, :3]), states[:, 3], times),
    )


def _too_fast(
    lanelets: Sequence[Lanelet], middle: Array, speed: Array, times: Array
) -> Iterator[str]:
    """Where a limit is exceeded most, if one is; of lanelets that overlap the greatest holds."""
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


BESIDE = 30.0  # [m] from the path: the edge of the road is not looked for further away
PIECE = 1e-11  # [m, rad] of rounding that each piece of a motion adds to its end
PER_RADIAN, PER_SPEED = 5.0, 1.0  # [m/rad], [s]: what counts as one metre when samples are compared


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadVerdict:
    """Findings along a drive."""

    audit: Audit  # of the vehicle's equations and limits
    hit: tuple[str, ...]  # road users that the body touches
    clearance_m: float  # least distance to any of them; inf without any
    edge_m: float  # least distance of the body to the edge of the road, 0 outside

    __repr__ = brief

    @property
    def collisions(self) -> int:
        """How many road users were touched."""
        return len(self.hit)

    @property
    def off_road(self) -> bool:
        """Whether a part of the body was outside the lanelets."""
        return self.edge_m <= too_close(0.0)

    @property
    def faults(self) -> tuple[tuple[str, str], ...]:
        """Status and words of each: touched | off_road | undrivable, in this order."""
        found = [("touched", f"collision with {name}") for name in self.hit]
        if self.off_road:
            found.append(("off_road", "off the road: a part of the body was outside the lanelets"))
        if not self.audit.passed:
            found.append(("undrivable", f"the model cannot drive it: {self.audit.reason}"))
        return tuple(found)

    @property
    def clean(self) -> bool:
        """Whether no road user was touched, the road not left, and the model obeyed."""
        return not self.faults


def judged(scene: RoadScene, vehicle: RoadVehicle, plan: Plan) -> RoadVerdict:
    """The verdict on a plan in the coordinates and on the clock of the scene."""
    model, body = vehicle.model, (vehicle.footprint,)
    clearance, hit = math.inf, set()
    for one in scene.traffic:
        distance = nearest_to(plan, vehicle, one).distance
        clearance = min(clearance, distance)
        if distance <= too_close(0.0):
            hit.add(one.name)
    rounding = PIECE * len(plan.trims)
    return RoadVerdict(
        audit=audit_plan(
            plan, Goal(pose=plan.end, tolerance_m=rounding, tolerance_rad=rounding), model
        ),
        hit=tuple(sorted(hit)),
        clearance_m=clearance,
        edge_m=closest_to(plan, model, land_beside(scene.lanelets, plan), footprint=body).distance,
    )


def nearest_to(plan: Plan, vehicle: RoadVehicle, one: Obstacle, *, enough: float = 0.0) -> Least:
    """The least clearance of a plan to a road user, which counts only while it is there."""
    body, there = (vehicle.footprint,), one.lasts(fleeting=True)
    return closest_to(plan, vehicle.model, (one,), footprint=body, within=there, enough=enough)


def land_beside(lanelets: Sequence[Lanelet], plan: Plan) -> tuple[Obstacle, ...]:
    """Land beside the road as static obstacles, within `BESIDE` [m] of a plan's path.

    Examples
    --------
    >>> lane = Lanelet(1, [[-99, 2], [99, 2]], [[-99, -2], [99, -2]])
    >>> there = Plan([0.0, 0.0, 0.0], (), durations=[])
    >>> pieces = land_beside([lane], there)
    >>> min(abs(float(y)) for one in pieces for y in one.shape.corners[:, 1])
    2.0
    """
    places = plan.sample().pose[:, :2]
    path = shapely.LineString(places) if len(places) > 1 else shapely.Point(places[0])
    near = shapely.buffer(path, BESIDE)
    return obstacles_in(shapely.difference(near, RECENT.once(drivable_area, tuple(lanelets))))


def nearest_miss(
    goals: Sequence[GoalRegion], vehicle: RoadVehicle, times: Array, states: Array
) -> str:
    """Where and how a motion came nearest to a goal, in words without a full stop.

    Examples
    --------
    >>> import numpy as np
    >>> goal = GoalRegion(speed=(5.0, 8.0), time=(1.0, 2.0))
    >>> states = np.array([[0.0, 0.0, 0.0, 3.0, 0.0], [3.0, 0.0, 0.0, 4.0, 0.0]])
    >>> nearest_miss([goal], RoadVehicle(), np.array([0.0, 1.0]), states)
    'nearest to it at 1 s: 1 m/s too slow'
    """
    middles = vehicle.middle_of(states[:, :3])
    best: tuple[float, str] = (math.inf, "")
    for goal in goals:
        within = (times >= goal.time[0] - EXACT) & (times <= goal.time[1] + EXACT)
        met: list[float] = []
        for k, time in enumerate(times.tolist()):
            away, turned, faster = goal.off_by(middles[k], speed=float(states[k, 3]))
            badness = away + PER_RADIAN * turned + PER_SPEED * abs(faster)
            if badness <= 0.0:
                met.append(time)
            elif within[k] and badness < best[0]:
                best = badness, f"nearest to it at {time:.6g} s: {_off_by(away, turned, faster)}"
        if met:
            window = f"{goal.time[0]:.6g} s to {goal.time[1]:.6g} s"
            best = 0.0, f"everything but the time was right at {met[0]:.6g} s, need {window}"
    if best[1]:
        return best[1]
    return f"its time begins at {min(goal.time[0] for goal in goals):.6g} s"


def _off_by(away: float, turned: float, faster: float) -> str:
    parts = []
    if away > 0.0:
        parts.append(f"{away:.3g} m away")
    if turned > 0.0:
        parts.append(f"heading {turned:.3g} rad off")
    if faster:
        parts.append(f"{abs(faster):.3g} m/s too {'fast' if faster > 0.0 else 'slow'}")
    return ", ".join(parts)

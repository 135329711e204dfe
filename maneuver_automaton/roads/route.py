"""The route through the lanelets to a goal: the line to follow, and where the goal lies on it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from maneuver_automaton._arrays import Array, wrapped
from maneuver_automaton._lazy import shapely
from maneuver_automaton.roads.lanelets import ROUNDED, Lanelet, along, drivable_area
from maneuver_automaton.roads.scene import GoalRegion, RoadScene, outlines_of
from maneuver_automaton.roads.vehicle import RoadVehicle

SPACING = 1.0  # [m] of the points of the line
LONGEST = 1e5  # [m] of a route, and of the outline of a goal
BEFORE, BEYOND = 60.0, 300.0  # [m] the line goes on straight before its first point, after its last
LANE_CHANGE = 10.0  # [m] that a lane change counts when routes are compared
ASIDE, COLUMNS = 0.5, 24  # [m] between offsets at which limits are known, how many to either side
# [m/s^2] before a lower limit; of whoever is beyond a limit, more; and after a lower limit. The
# difference of the first two is what keeps a limit in sight from being out of reach.
BRAKING, SLOWING, GAINING = 3.0, 3.5, 3.0
AROUND = 3  # points before and after one, between which a turn is measured
TURNING = 0.3  # [rad] between them
SHARE = 0.3  # of the smaller of two areas, common to a lanelet and a goal in it


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Route:
    """A line to follow; stations count along it."""

    lanelets: tuple[int, ...]  # numbers, in order
    points: Array  # (n, 2) equally spaced [m]
    heading: Array  # (n,) direction of travel, not wrapped [rad]
    # [m/s] at offsets `ASIDE` apart, from right to left: the limit there, and no more than what
    # braking to those ahead leaves; inf where there is none.
    limit: Array  # (n, 2 `COLUMNS` + 1)
    extents: Array  # (goals, 4) least and greatest station, least and greatest offset of each


def route_of(scene: RoadScene) -> Route:
    """The cheapest route through the lanelets from the start to a goal.

    Where lanes are changed, the line is that of the lane that is changed to, so that the offset
    from the line falls to zero. Without a goal that is a place, the route goes straight on.

    Examples
    --------
    >>> from maneuver_automaton.roads import RoadStart
    >>> lane = Lanelet(1, [[0, 2], [90, 2]], [[0, -2], [90, -2]])
    >>> scene = RoadScene(name="lane", lanelets=(lane,), goals=(GoalRegion(time=(1.0, 2.0)),),
    ...                   start=RoadStart(middle=[5.0, 0.0, 0.0], speed=10.0))
    >>> route_of(scene).lanelets
    (1,)
    """
    lanelets = {lanelet.number: lanelet for lanelet in scene.lanelets}
    sources = lanelets_at(scene.lanelets, scene.start.middle)
    targets = [k for goal in scene.goals for k in lanelets_of_goal(scene.lanelets, goal)]
    path = _path(lanelets, sources, targets)
    line, limits = _line([lanelets[k] for k in path], lanelets)
    points, heading, own = _spaced(line, limits)
    limit = _limits_around(scene.lanelets, points, heading, own)
    # A route that returns to where it starts passes a goal there at its end.
    here = int(np.argmin(np.hypot(*(points - scene.start.middle[:2]).T)))
    extents = np.full((len(scene.goals), 4), [-np.inf, np.inf, -np.inf, np.inf])
    for extent, goal in zip(extents, scene.goals, strict=True):
        if goal.places is not None:
            extent[:] = _extent(outlines_of(goal.places), points[here:], heading[here:])
            extent += [SPACING * here, SPACING * here, 0.0, 0.0]
    return Route(lanelets=tuple(path), points=points, heading=heading, limit=limit, extents=extents)


def hindrance(route: Route, scene: RoadScene, vehicle: RoadVehicle) -> str:
    """What may keep a vehicle from following a route, as the end of a sentence; it proves nothing.

    A goal that lanelets do not lead to, or that is behind the start; else the turn that leaves less
    room than the body sweeps where it turns on and on about the same center.
    """
    places = [goal for goal in scene.goals if goal.places is not None]
    targets = {k for goal in places for k in lanelets_of_goal(scene.lanelets, goal)}
    if targets and targets.isdisjoint(route.lanelets):
        return "; no lanelets lead from the start to a goal"
    here = int(np.argmin(np.hypot(*(route.points - scene.start.middle[:2]).T)))
    behind = SPACING * here - float(route.extents[:, 1].max())
    if behind > 0.0:
        return f"; the goal is {behind:.3g} m behind the start, and no lanelets lead back to it"
    last = min(float(route.extents[:, 0].min()) / SPACING, len(route.points) - 1.0 - AROUND)
    lacking, said = 0.0, ""
    for k in range(max(here, AROUND), int(max(last, 0.0)) + 1):
        turn = float(route.heading[k + AROUND] - route.heading[k - AROUND])
        if abs(turn) < TURNING or (free := _across(route, scene, k)) is None:
            continue
        radius = 2.0 * AROUND * SPACING / abs(turn)
        inner, outer = free if turn > 0.0 else free[::-1]
        tightest = vehicle.model.turning_radius
        inside = max(radius - inner, tightest - 0.5 * vehicle.width)
        front = vehicle.ahead + 0.5 * vehicle.length
        swept, room = math.hypot(inside + vehicle.width, front) - inside, radius + outer - inside
        if swept - room > lacking:
            lacking = swept - room
            number = lanelets_at(scene.lanelets, np.append(route.points[k], route.heading[k]))
            on = next((one for one in number if one in route.lanelets), number[0])
            said = (
                f"; the {'left' if turn > 0.0 else 'right'} turn on lanelet {on} leaves"
                f" {room:.3g} m, where a vehicle that turns about {inside:.3g} m"
                f" sweeps {swept:.3g} m"
            )
    return said


def _across(route: Route, scene: RoadScene, k: int) -> tuple[float, float] | None:
    """How far the road goes on to the left and to the right of a point of a route [m]."""
    point, aside = route.points[k], np.array([-np.sin(route.heading[k]), np.cos(route.heading[k])])
    reach = ASIDE * COLUMNS * aside
    line = shapely.LineString([point - reach, point + reach])
    near = [one for one in scene.lanelets if shapely.LinearRing(one.ring).distance(line) <= 0.0]
    for part in shapely.get_parts(shapely.intersection(line, drivable_area(near))) if near else ():
        if shapely.distance(part, shapely.Point(point)) <= ROUNDED:
            offsets = (shapely.get_coordinates(part) - point) @ aside
            return float(offsets.max()), float(-offsets.min())
    return None


def lanelets_at(lanelets: Sequence[Lanelet], middle: Array) -> list[int]:
    """Numbers of the lanelets around a pose (3,) with its direction; else of the nearest."""
    place = shapely.Point(middle[:2])
    forward = np.array([np.cos(middle[2]), np.sin(middle[2])])
    off = {}
    for lanelet in lanelets:
        center = lanelet.center
        steps = np.diff(center, axis=0)
        nearest = int(np.argmin(np.hypot(*(center[:-1] + 0.5 * steps - middle[:2]).T)))
        turned = float(steps[nearest] @ forward) < 0.0
        away = shapely.distance(shapely.make_valid(shapely.Polygon(lanelet.ring)), place)
        off[lanelet.number] = (turned, float(away))
    best = min(off.values())
    return [number for number, value in off.items() if value == best]


def lanelets_of_goal(lanelets: Sequence[Lanelet], goal: GoalRegion) -> list[int]:
    """Numbers of the lanelets that a goal covers, or that cover it, by a good part."""
    if goal.lanelets:
        return list(goal.lanelets)
    found = []
    for place in outlines_of(goal.places or ()):
        region = shapely.make_valid(shapely.Polygon(place))
        for lanelet in lanelets:
            piece = shapely.make_valid(shapely.Polygon(lanelet.ring))
            if shapely.intersection(piece, region).area > SHARE * min(piece.area, region.area):
                found.append(lanelet.number)
    return found


def _path(lanelets: dict[int, Lanelet], sources: list[int], targets: list[int]) -> list[int]:
    """Numbers of the lanelets of the line: those that are left by a lane change are left out."""
    import networkx

    graph: networkx.DiGraph[int] = networkx.DiGraph()  # a lane change costs a constant
    graph.add_nodes_from(lanelets)
    for lanelet in lanelets.values():
        for number in lanelets.keys() & lanelet.successors:
            graph.add_edge(lanelet.number, number, cost=lanelet.length, beside=False)
        for number in lanelets.keys() & lanelet.beside:
            graph.add_edge(lanelet.number, number, cost=LANE_CHANGE, beside=True)
    best: tuple[float, list[int]] | None = None
    for source in sources:
        costs, paths = networkx.single_source_dijkstra(graph, source, weight="cost")
        assert isinstance(costs, dict)  # without a target
        assert isinstance(paths, dict)
        for target in targets:
            if target in costs and (best is None or costs[target] < best[0]):
                best = (float(costs[target]), list(paths[target]))
    path = [sources[0]] if best is None else best[1]
    kept = [
        number
        for number, after in zip(path, [*path[1:], None], strict=True)
        if after is None or not graph.edges[number, after]["beside"]
    ]
    return [*kept, *_straight_on(lanelets, kept[-1], known=set(kept))]


def _straight_on(lanelets: dict[int, Lanelet], number: int, *, known: set[int]) -> list[int]:
    """Successors that turn least, as far as the line may be needed."""
    more: list[int] = []
    left = BEYOND
    while left > 0.0:
        ahead = np.arctan2(*np.diff(lanelets[number].center, axis=0)[-1][::-1])
        after = [k for k in lanelets[number].successors if k in lanelets and k not in known]
        if not after:
            break

        steps = [lanelets[k].center[-1] - lanelets[k].center[-2] for k in after]
        turns = [abs(float(wrapped(np.arctan2(*step[::-1]) - ahead))) for step in steps]
        number = after[int(np.argmin(turns))]
        known.add(number)
        more.append(number)
        left -= lanelets[number].length
    return more


def _line(path: list[Lanelet], lanelets: dict[int, Lanelet]) -> tuple[Array, Array]:
    """Middle of the lanelets of a path (n, 2), and the speed limit (n,) there."""
    points, limits = [], []
    for lanelet in path:
        center = lanelet.center
        limit = np.inf if lanelet.speed_limit is None else lanelet.speed_limit
        points.append(center)
        limits.append(np.full(len(center), limit))
    line, limit_at = np.concatenate(points), np.concatenate(limits)
    new = np.append(True, np.hypot(*np.diff(line, axis=0).T) > 1e-6)
    return line[new], limit_at[new]


def _spaced(line: Array, limits: Array) -> tuple[Array, Array, Array]:
    """The line with equal spacing, longer at both ends, its headings and limits."""
    first, last = line[0] - line[1], line[-1] - line[-2]
    longer = np.concatenate(
        [
            [line[0] + BEFORE * first / np.hypot(*first)],
            line,
            [line[-1] + BEYOND * last / np.hypot(*last)],
        ]
    )
    station = along(longer)
    if not station[-1] <= LONGEST:
        raise ValueError(
            f"route: is {station[-1]:.3g} m long along its lanelets, need at most {LONGEST:g} m"
        )
    at = SPACING * np.arange(int(station[-1] / SPACING) + 1)
    points = np.stack([np.interp(at, station, longer[:, k]) for k in range(2)], axis=-1)
    steps = np.gradient(points, axis=0)
    heading = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    return points, heading, limits[np.searchsorted(station[1:-1], at).clip(0, len(limits) - 1)]


def _limits_around(lanelets: Sequence[Lanelet], points: Array, heading: Array, own: Array) -> Array:
    """`Route.limit`: of lanelets that overlap the greatest holds."""
    offsets = ASIDE * np.arange(-COLUMNS, COLUMNS + 1)
    limit = np.full((len(points), len(offsets)), -np.inf)
    if all(one.speed_limit is None for one in lanelets):
        return np.full_like(limit, np.inf)
    aside = np.stack([-np.sin(heading), np.cos(heading)], axis=-1)
    places = points[:, None] + offsets[:, None] * aside[:, None]
    tree = shapely.STRtree(shapely.points(places.reshape(-1, 2)))
    for one in lanelets:
        piece = shapely.make_valid(shapely.Polygon(one.ring))
        inside = np.unravel_index(tree.query(piece, predicate="intersects"), limit.shape)
        allowed = np.inf if one.speed_limit is None else one.speed_limit
        limit[inside] = np.maximum(limit[inside], allowed)
    limit = np.where(np.isfinite(limit) | (limit > 0.0), limit, own[:, None])
    for axis in range(2):  # a point stands for what is around it
        padded = np.pad(limit, [(1, 1) if k == axis else (0, 0) for k in range(2)], mode="edge")
        limit = np.lib.stride_tricks.sliding_window_view(padded, 3, axis=axis).min(axis=-1)
    limit = np.array(limit)
    for k in range(len(limit) - 2, -1, -1):  # so fast that braking keeps the limits ahead
        limit[k] = np.minimum(limit[k], np.sqrt(limit[k + 1] ** 2 + 2.0 * BRAKING * SPACING))
    return limit


def extent_on(rings: Sequence[Array], route: Route) -> Array:
    """Least and greatest station of rings (n, 2), and least and greatest offset [m]."""
    return _extent(rings, route.points, route.heading)


def _extent(rings: Sequence[Array], points: Array, heading: Array) -> Array:
    if (around := sum(shapely.LinearRing(ring).length for ring in rings)) > LONGEST:
        raise ValueError(f"goal: its outline is {around:.3g} m long, need at most {LONGEST:g} m")
    corners = np.concatenate(
        [
            np.asarray(shapely.segmentize(shapely.LinearRing(ring), 2.0 * SPACING).coords)
            for ring in rings
        ]
    )
    nearest = np.argmin(np.hypot(*np.moveaxis(corners[:, None] - points[None], -1, 0)), axis=1)
    apart = corners - points[nearest]
    c, s = np.cos(heading[nearest]), np.sin(heading[nearest])
    stations = SPACING * nearest + c * apart[:, 0] + s * apart[:, 1]
    offsets = c * apart[:, 1] - s * apart[:, 0]
    return np.array([stations.min(), stations.max(), offsets.min(), offsets.max()])

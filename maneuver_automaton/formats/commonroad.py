"""Scenarios of CommonRoad (XML, versions 2017a to 2020a): roads, traffic, problems.

Lanelets, obstacles with their recorded trajectories or sets of occupancies, and planning problems,
each with an initial state and a goal: a region, a lanelet, intervals of heading, speed and time.
Times are counted in steps of `timeStepSize`; positions are those of the middle of a vehicle. Road
users whose states are uncertain keep all places that they may be in.

The file is read here and not by commonroad-io: release 2026.1 of that library reads the goals of
2017a as goals without any condition, and silently; it needs protobuf 3 and eight more packages;
its classes change from year to year, and its messages name no line.

Source: Althoff, Koschi, Manzinger (2017), *CommonRoad: Composable Benchmarks for Motion Planning on
Roads*, IEEE Intelligent Vehicles Symposium, and the documentation of its XML format.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._lazy import shapely
from maneuver_automaton.collision import Box, Disc, Motion, Obstacle, Polygon, Shape
from maneuver_automaton.formats.commonroad_rules import (
    SIGN,
    limits_of,
    not_obeyed,
    point_of,
    refs,
    signs_of,
    stop_lines,
)
from maneuver_automaton.formats.documents import errors_at
from maneuver_automaton.formats.statement import Statement, simple_polygon
from maneuver_automaton.formats.text_source import Element, read_xml, root_tag, tags_below_root
from maneuver_automaton.groups import SE2
from maneuver_automaton.roads import GoalRegion, Lanelet, RoadBenchmark, RoadScene, RoadStart
from maneuver_automaton.roads.scene import outlines_of

FORMAT = "CommonRoad"
MOST_BYTES = 50_000_000
ROOT = "commonRoad"
STEP, VERSION = "timeStepSize", "commonRoadVersion"
VERSIONS = ("2017a", "2018a", "2018b", "2020a")
ROAD_USERS = {
    "obstacle": "obstacle",
    "staticObstacle": "obstacle",
    "dynamicObstacle": "obstacle",
    "environmentObstacle": "environment",
    "phantomObstacle": "phantom",
}
EXACT = ("orientation", "velocity", "velocityY", "yawRate", "time")
TURN = 0.05  # [rad] between the headings of an interval that are looked at
OPEN = 1e-3  # share of a step by which sets of occupancies are shorter at both ends


def is_commonroad(path: Path) -> bool:
    """Whether the root of an XML file is that of a scenario of CommonRoad."""
    return root_tag(path) == ROOT


def n_problems(path: Path) -> int:
    """How many planning problems a file states, as far as it is valid XML."""
    return tags_below_root(path)["planningProblem"]


def read_commonroad(path: Path) -> tuple[Statement, ...]:
    """One problem of driving on roads for every planning problem of a file."""
    root = read_xml(path, what="a scenario of CommonRoad", most=MOST_BYTES)
    if root.tag != ROOT:
        raise root.error(f"is no scenario of CommonRoad, need the element {ROOT}")
    version = root.attributes.get(VERSION, "").strip()
    if version and version not in VERSIONS:
        raise root.error(f"{VERSION}: got {version!r}, need one of {', '.join(VERSIONS)}")
    step = float(root.attribute(STEP))
    if not 0.0 < step < math.inf:
        raise root.error(f"{STEP}: got {root.attributes[STEP]!r}, need a positive number")
    lanelets = _lanelets(root)
    notes = list(not_obeyed(root))
    traffic = tuple(_traffic(root, step, lanelets, notes))
    lines = tuple(stop_lines(root, lanelets, step, notes))
    problems = list(root.all("planningProblem"))
    if not problems:
        raise root.error("holds no planningProblem, need at least one")
    name = root.attributes.get("benchmarkID") or path.stem
    scenes = [
        RoadScene(
            name=name if len(problems) == 1 else f"{name} case {k}",
            lanelets=tuple(lanelets.values()),
            start=_start(problem.need("initialState"), step),
            goals=tuple(_goals(problem, lanelets, step, notes)),
            traffic=traffic,
            step=step,
            source=", ".join(
                root.attributes[key] for key in ("author", "source") if root.attributes.get(key)
            ),
            benchmark=RoadBenchmark(
                scenario=name, version=root.attributes.get(VERSION, ""), problem=problem.whole("id")
            )
            if "id" in problem.attributes
            else None,
            stop_lines=lines,
            notes=tuple(dict.fromkeys(notes)),
        )
        for k, problem in enumerate(problems)
    ]
    return tuple(Statement(format=FORMAT, name=scene.name, road=scene) for scene in scenes)


def _lanelets(root: Element) -> dict[int, Lanelet]:
    signs = signs_of(root)
    lanelets: dict[int, Lanelet] = {}
    for element in root.all("lanelet"):
        number = element.whole("id")
        if number in lanelets:
            raise element.error(f"id: got {number}, which another lanelet has")
        sides = (element.get("adjacentLeft"), element.get("adjacentRight"))
        beside = [one for one in sides if one is not None]
        stated = element.get("speedLimit")
        allowed = [limit for k in refs(element, SIGN) for limit in limits_of(signs.get(k, []))]
        if stated is not None and stated.text.strip().lower() != "inf":
            allowed.append(stated.number())
        with errors_at(element.at):
            lanelets[number] = Lanelet(
                number,
                _points(element.need("leftBound")),
                _points(element.need("rightBound")),
                successors=list(refs(element, "successor")),
                beside=[one.whole("ref") for one in beside if _runs(one, "same")],
                against=[one.whole("ref") for one in beside if _runs(one, "opposite")],
                speed_limit=min(allowed, default=None),
            )
    if not lanelets:
        raise root.error("holds no lanelet, need at least one")
    return lanelets


def _runs(neighbour: Element, direction: str) -> bool:
    return neighbour.attributes.get("drivingDir") == direction


def _points(element: Element) -> Array:
    points = [point_of(one) for one in element.all("point")]
    if len(points) < 2:
        raise element.error(f"got {len(points)} points, need at least 2")
    return np.array(points)


def _traffic(
    root: Element, step: float, lanelets: Mapping[int, Lanelet], notes: list[str]
) -> Iterator[Obstacle]:
    for element in root.children:
        if element.tag not in ROAD_USERS:
            continue
        kind = _text(element.get("type"), ROAD_USERS[element.tag])
        name = f"{kind} {element.attributes.get('id', '')}".strip()
        recorded, predicted = element.get("trajectory"), element.get("occupancySet")
        if element.get("probabilityDistribution") is not None:
            notes.append(f"not read: the probability distribution of {name}")
        if element.tag == "phantomObstacle":
            if predicted is None:
                notes.append(f"{name} states no set of occupancies, and is nowhere")
            else:
                yield from _occupancies(predicted, step, name)
            continue
        shapes = list(_shapes(element.need("shape")))
        if element.tag == "environmentObstacle":
            yield from (Obstacle(shape, name=name) for shape in shapes)
            continue
        states = [element.need("initialState")]
        if recorded is not None:
            states += recorded.all("state")
        elif predicted is None and _moves(element, states[0]):
            notes.append(f"{name} moves, but states no trajectory: it is taken to stay")
        poses = [pose for one in states if (pose := _exact_pose(one, shapes)) is not None]
        if len(poses) < len(states):
            notes.append(f"{name} has uncertain states: it is kept clear of wherever it may be")
        times = step * np.array([_interval(one.need("time")) for one in states])
        with errors_at(element.at):
            if len(states) == 1:
                for shape in _shapes_at(states[0], shapes, lanelets):
                    if predicted is None:
                        yield Obstacle(shape, name=name)
                    else:
                        yield _there(shape, (times[0][0], times[0][1] + step), step, name)
            elif len(poses) == len(states):
                rows = np.array(poses)
                rows[:, 2] = np.unwrap(rows[:, 2])
                motion = Motion(times[:, 0], rows)
                yield from (Obstacle(shape, motion=motion, name=name) for shape in shapes)
            else:
                sets = [_shapes_at(one, shapes, lanelets) for one in states]
                for k, (here, there) in enumerate(itertools.pairwise(sets)):
                    between = _convex(np.concatenate([_corners(one) for one in here + there]))
                    lasting = Motion([times[k, 0], times[k + 1, 1]], np.zeros((2, 3)))
                    yield Obstacle(between, motion=lasting, name=name)
        if predicted is not None and recorded is None:
            yield from _occupancies(predicted, step, name)


def _moves(element: Element, state: Element) -> bool:
    """Whether somebody is said to be dynamic, and not to stand."""
    dynamic = element.tag == "dynamicObstacle" or _text(element.get("role"), "") == "dynamic"
    speed = state.get("velocity")
    return dynamic and (speed is None or _interval(speed) != (0.0, 0.0))


def _exact_pose(state: Element, shapes: Sequence[Shape]) -> tuple[float, float, float] | None:
    """The pose of a state at one time; None if it is uncertain."""
    (begin, end), (low, high) = _interval(state.need("time")), _headings(state, shapes)
    point = state.need("position").get("point")
    return None if point is None or begin != end or low != high else (*point_of(point), low)


def _headings(state: Element, shapes: Sequence[Shape]) -> tuple[float, float]:
    """Least and greatest heading of a state [rad]; where none is stated, any that matters."""
    if (stated := state.get("orientation")) is not None:
        low, high = _interval(stated)
        turn = high - low if low <= high else (high - low) % (2.0 * math.pi)
        return low, low + min(turn, 2.0 * math.pi)
    ahead, aside = state.get("velocity", "exact"), state.get("velocityY", "exact")
    if ahead is not None and aside is not None and (ahead.number() or aside.number()):
        heading = math.atan2(aside.number(), ahead.number())
        return heading, heading
    round_ones = all(isinstance(one, Disc) and not one.center.any() for one in shapes)
    return 0.0, 0.0 if round_ones else 2.0 * math.pi


def _shapes_at(
    state: Element, shapes: Sequence[Shape], lanelets: Mapping[int, Lanelet]
) -> list[Shape]:
    """Shapes where a state has them; of an uncertain one, a shape that holds them everywhere."""
    if (pose := _exact_pose(state, shapes)) is not None:
        return [shape.moved(SE2(np.array(pose))) for shape in shapes]
    low, high = _headings(state, shapes)
    headings = np.linspace(low, high, math.ceil((high - low) / TURN) + 1)
    corners = np.concatenate([_corners(one) for one in shapes])
    poses = np.stack([0.0 * headings, 0.0 * headings, headings], axis=-1)
    turned = np.asarray(SE2(poses[:, None]).act(corners)).reshape(-1, 2)
    # Between two headings a corner leaves the chord by no more than this.
    sagitta = np.hypot(*corners.T).max() * (1.0 - math.cos(0.5 * TURN))
    position = state.need("position")
    point = position.get("point")
    places = (
        np.array([point_of(point)])
        if point is not None
        else np.concatenate([_corners(one) for one in _places(position, lanelets)])
    )
    return [_convex((places[:, None] + turned).reshape(-1, 2), sagitta)]


def _corners(shape: Shape) -> Array:
    """Corners (n, 2) whose convex hull holds a shape."""
    if isinstance(shape, Disc):
        return shape.center + outlines_of((Disc(shape.radius),))[0] / math.cos(math.pi / 64)
    return np.asarray(shape.corners)


def _convex(points: Array, grown: float = 0.0) -> Polygon:
    hull = shapely.convex_hull(shapely.MultiPoint(points))
    outline = shapely.buffer(hull, grown, join_style="mitre") if grown else hull
    return Polygon(shapely.get_coordinates(outline.exterior)[:-1])


def _occupancies(predicted: Element, step: float, name: str) -> Iterator[Obstacle]:
    """Predicted occupancies of a road user, set by set, as obstacles."""
    for element in predicted.all("occupancy"):
        time = element.need("time")
        begin, end = _interval(time)
        if time.get("exact") is not None:
            begin, end = begin - 1.0, end + 1.0
        if not begin < end:
            raise time.error(f"got the interval [{begin:g}, {end:g}], need a begin before its end")
        for shape in _shapes(element.need("shape")):
            yield _there(shape, (step * begin, step * end), step, name)


def _there(shape: Shape, time: tuple[float, float], step: float, name: str) -> Obstacle:
    """An obstacle in one place between two times, which themselves do not belong to it."""
    times = [time[0] + OPEN * step, time[1] - OPEN * step]
    return Obstacle(shape, motion=Motion(times, np.zeros((2, 3))), name=name)


def _text(element: Element | None, otherwise: str) -> str:
    return otherwise if element is None else element.text.strip() or otherwise


def _shapes(element: Element) -> Iterator[Shape]:
    found = False
    for part in element.children:
        if part.tag not in ("rectangle", "circle", "polygon"):
            continue
        found = True
        middle = part.get("center")
        center = (0.0, 0.0) if middle is None else point_of(middle)
        turn = part.get("orientation")
        with errors_at(part.at):
            if part.tag == "rectangle":
                size = [part.need("length").number(), part.need("width").number()]
                yield Box(size, center, 0.0 if turn is None else turn.number())
            elif part.tag == "circle":
                yield Disc(part.need("radius").number(), center)
            else:
                yield simple_polygon([point_of(one) for one in part.all("point")])
    if not found:
        raise element.error("holds no rectangle, circle or polygon, need one")


def _start(state: Element, step: float) -> RoadStart:
    """The state that a plan begins at, which has to be exact, as the schema of the format says."""
    for tag, exact in (("position", "point"), *((tag, "exact") for tag in EXACT)):
        if (one := state.get(tag)) is not None and one.get(exact) is None and one.children:
            raise one.error(f"is uncertain, need the element {exact}: a plan begins at one state")
    speed, aside = state.need("velocity", "exact").number(), state.get("velocityY", "exact")
    (heading, _), headed = _headings(state, ()), state.get("orientation", "exact")
    if headed is None:
        if aside is None:
            state.need("orientation")
        speed = math.hypot(speed, 0.0 if aside is None else aside.number())
    turn_rate = state.get("yawRate", "exact")
    return RoadStart(
        middle=np.array([*point_of(state.need("position", "point")), heading]),
        speed=speed,
        turn_rate=0.0 if turn_rate is None else turn_rate.number(),
        time=step * state.need("time", "exact").number(),
    )


def _goals(
    problem: Element, lanelets: Mapping[int, Lanelet], step: float, notes: list[str]
) -> Iterator[GoalRegion]:
    regions = [
        one
        for element in problem.all("goalRegion")
        for one in (element.all("state") if element.get("state") else (element,))
    ]
    states = [*regions, *problem.all("goalState")]
    if not states:
        raise problem.error("the element goalState is missing")
    for k, state in enumerate(states):
        begin, end = _interval(state.need("time"))
        position, heading, speed = (
            state.get(tag) for tag in ("position", "orientation", "velocity")
        )
        places = () if position is None else position.children
        known = [one for one in places if one.tag != "lanelet" or one.whole("ref") in lanelets]
        if position is not None and known:  # another place is enough
            position = replace(position, children=known)
        elif position is not None and k < len(regions):  # commonroad-io reads no goalRegion
            position = None
            notes.append(f"goal {k + 1}: any place counts, since the file lacks its lanelets")
        with errors_at(state.at):
            yield GoalRegion(
                places=None if position is None else tuple(_places(position, lanelets)),
                heading=None if heading is None else _interval(heading),
                speed=None if speed is None else _interval(speed),
                time=(step * begin, step * end),
                lanelets=() if position is None else tuple(refs(position, "lanelet")),
            )


def _places(position: Element, lanelets: Mapping[int, Lanelet]) -> Iterator[Shape]:
    for one in position.all("lanelet"):
        number = one.whole("ref")
        if number not in lanelets:
            raise one.error(f"ref: got {number}, but no lanelet of the file has this id")
        with errors_at(one.at):
            yield simple_polygon(lanelets[number].ring)
    if (middle := position.get("point")) is not None:
        raise middle.error("is not read as a goal, need a shape or a lanelet")
    if any(one.tag != "lanelet" for one in position.children):
        yield from _shapes(position)


def _interval(element: Element) -> tuple[float, float]:
    exact = element.get("exact")
    if exact is not None:
        return exact.number(), exact.number()
    return element.need("intervalStart").number(), element.need("intervalEnd").number()

"""Scenarios of CommonRoad (XML, versions 2017a, 2018b and 2020a): roads, traffic, problems.

Lanelets, obstacles with their recorded trajectories or sets of occupancies, and planning problems,
each with an initial state and a goal: a region, a lanelet, intervals of heading, speed and time.
Times are counted in steps of `timeStepSize`; positions are those of the middle of a vehicle.

The file is read here and not by commonroad-io: release 2026.1 of that library reads the goals of
2017a as goals without any condition, and silently; it needs protobuf 3 and eight more packages;
its classes change from year to year, and its messages name no line.

Source: Althoff, Koschi, Manzinger (2017), *CommonRoad: Composable Benchmarks for Motion Planning on
Roads*, IEEE Intelligent Vehicles Symposium, and the documentation of its XML format.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._files import open_input
from maneuver_automaton.collision import Box, Disc, Motion, Obstacle, Shape
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.polygons import simple_polygon
from maneuver_automaton.formats.statement import Statement
from maneuver_automaton.formats.xml_source import Element, read_xml
from maneuver_automaton.groups import SE2
from maneuver_automaton.roads import GoalRegion, Lanelet, RoadBenchmark, RoadScene, RoadStart
from maneuver_automaton.roads.scene import unwrapped

FORMAT = "CommonRoad"
MOST_BYTES = 50_000_000
STEP = "timeStepSize"
OPEN = 1e-3  # share of a step by which sets of occupancies are shorter at both ends


def is_commonroad(path: Path) -> bool:
    """Whether an XML file begins like a scenario of CommonRoad."""
    with open_input(path) as stream:
        return b"<commonRoad" in stream.read(4000)


def n_problems(path: Path) -> int:
    """How many planning problems a file states, by its text alone."""
    with open_input(path) as stream:
        return stream.read(MOST_BYTES).count(b"<planningProblem ")


def read_commonroad(path: Path) -> tuple[Statement, ...]:
    """One problem of driving on roads for every planning problem of a file.

    Raises
    ------
    InvalidScenario
        If the file is no scenario of CommonRoad, holds no planning problem, or an element is
        missing or holds what it may not.
    """
    root = read_xml(path, what="a scenario of CommonRoad", most=MOST_BYTES)
    if root.tag != "commonRoad":
        raise root.error("is no scenario of CommonRoad, need the element commonRoad")
    step = float(root.attribute(STEP))
    if not 0.0 < step < math.inf:
        raise root.error(f"{STEP}: got {root.attributes[STEP]!r}, need a positive number")
    lanelets = _lanelets(root)
    traffic = tuple(_traffic(root, step))
    problems = list(root.all("planningProblem"))
    if not problems:
        raise root.error("holds no planningProblem, need at least one")
    name = root.attributes.get("benchmarkID") or path.stem
    scenes = [
        RoadScene(
            name=name if len(problems) == 1 else f"{name} case {k}",
            lanelets=tuple(lanelets.values()),
            start=_start(problem.need("initialState"), step),
            goals=tuple(_goals(problem, lanelets, step)),
            traffic=traffic,
            step=step,
            source=", ".join(
                root.attributes[key] for key in ("author", "source") if root.attributes.get(key)
            ),
            benchmark=_benchmark(root, problem, name),
        )
        for k, problem in enumerate(problems)
    ]
    return tuple(Statement(format=FORMAT, name=scene.name, road=scene) for scene in scenes)


def _benchmark(root: Element, problem: Element, name: str) -> RoadBenchmark | None:
    """What names a problem in solutions; none where it has no id."""
    if "id" not in problem.attributes:
        return None
    version = root.attributes.get("commonRoadVersion", "")
    return RoadBenchmark(scenario=name, version=version, problem=problem.whole("id"))


def _lanelets(root: Element) -> dict[int, Lanelet]:
    limits = _signs(root)
    lanelets: dict[int, Lanelet] = {}
    for element in root.all("lanelet"):
        number = element.whole("id")
        if number in lanelets:
            raise element.error(f"id: got {number}, which another lanelet has")
        sides = (element.get("adjacentLeft"), element.get("adjacentRight"))
        beside = [one for one in sides if one is not None]
        stated = element.get("speedLimit")
        allowed = [limits[k] for k in _refs(element, "trafficSignRef") if k in limits]
        if stated is not None and stated.text.strip().lower() != "inf":
            allowed.append(stated.number())
        try:
            lanelets[number] = Lanelet(
                number,
                _points(element.need("leftBound")),
                _points(element.need("rightBound")),
                successors=list(_refs(element, "successor")),
                beside=[one.whole("ref") for one in beside if _runs(one, "same")],
                against=[one.whole("ref") for one in beside if _runs(one, "opposite")],
                speed_limit=min(allowed, default=None),
            )
        except ValueError as error:
            raise _at(element, error) from error
    if not lanelets:
        raise root.error("holds no lanelet, need at least one")
    return lanelets


def _runs(neighbour: Element, direction: str) -> bool:
    return neighbour.attributes.get("drivingDir") == direction


def _signs(root: Element) -> dict[int, float]:
    """Speed limits of version 2020a: traffic signs with a number [m/s]."""
    limits: dict[int, float] = {}
    for sign in root.all("trafficSign"):
        for part in sign.all("trafficSignElement"):
            named, value = part.get("trafficSignID"), part.get("additionalValue")
            if named is not None and value is not None and named.text.strip() in ("274", "R2-1"):
                limits[sign.whole("id")] = value.number()
    return limits


def _refs(element: Element, tag: str) -> Iterator[int]:
    return (one.whole("ref") for one in element.all(tag))


def _points(element: Element) -> Array:
    points = [_point(one) for one in element.all("point")]
    if len(points) < 2:
        raise element.error(f"got {len(points)} points, need at least 2")
    return np.array(points)


def _point(element: Element) -> tuple[float, float]:
    return element.need("x").number(), element.need("y").number()


def _traffic(root: Element, step: float) -> Iterator[Obstacle]:
    for element in root.children:
        if element.tag not in ("obstacle", "staticObstacle", "dynamicObstacle"):
            continue
        name = (
            f"{_text(element.get('type'), 'obstacle')} {element.attributes.get('id', '')}".strip()
        )
        shapes = list(_shapes(element.need("shape")))
        states = [element.need("initialState")]
        if (recorded := element.get("trajectory")) is not None:
            states += recorded.all("state")
        elif (predicted := element.get("occupancySet")) is not None:
            begin, pose = _time(states[0], step), SE2(np.array(_pose(states[0])))
            for shape in shapes:
                yield _there(shape.moved(pose), (begin, begin + step), step, name)
            yield from _occupancies(predicted, step, name)
            continue
        poses, times = (
            np.array([_pose(one) for one in states]),
            [_time(one, step) for one in states],
        )
        poses[:, 2] = unwrapped(poses[:, 2].tolist())
        for shape in shapes:
            if len(states) == 1:
                yield Obstacle(shape.moved(SE2(poses[0])), name=name)
                continue
            try:
                yield Obstacle(shape, motion=Motion(times, poses), name=name)
            except ValueError as error:
                raise _at(element, error) from error


def _occupancies(predicted: Element, step: float, name: str) -> Iterator[Obstacle]:
    """Predicted occupancies of a road user, set by set, as obstacles.

    A set of an interval holds there. A set of one instant holds from the instant before to the one
    after, so that a road user between two instants is in one of their sets.
    """
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
    """Rectangles, circles and polygons."""
    found = False
    for part in element.children:
        if part.tag not in ("rectangle", "circle", "polygon"):
            continue
        found = True
        middle = part.get("center")
        center = (0.0, 0.0) if middle is None else _point(middle)
        turn = part.get("orientation")
        try:
            if part.tag == "rectangle":
                size = [part.need("length").number(), part.need("width").number()]
                yield Box(size, center, 0.0 if turn is None else turn.number())
            elif part.tag == "circle":
                yield Disc(part.need("radius").number(), center)
            else:
                yield simple_polygon([_point(one) for one in part.all("point")])
        except ValueError as error:
            raise _at(part, error) from error
    if not found:
        raise element.error("holds no rectangle, circle or polygon, need one")


def _start(state: Element, step: float) -> RoadStart:
    turn_rate = state.get("yawRate", "exact")
    return RoadStart(
        middle=np.array(_pose(state)),
        speed=_exact(state, "velocity"),
        turn_rate=0.0 if turn_rate is None else turn_rate.number(),
        time=_time(state, step),
    )


def _pose(state: Element) -> tuple[float, float, float]:
    return (*_point(state.need("position", "point")), _exact(state, "orientation"))


def _time(state: Element, step: float) -> float:
    """Time of a state [s]."""
    return step * _exact(state, "time")


def _exact(state: Element, tag: str) -> float:
    return state.need(tag, "exact").number()


def _goals(problem: Element, lanelets: Mapping[int, Lanelet], step: float) -> Iterator[GoalRegion]:
    """The goals of a problem, one of which is to be reached.

    Versions differ: goalState is a goal itself; goalRegion holds one or more states.
    """
    states = [
        one
        for element in problem.all("goalRegion")
        for one in (element.all("state") if element.get("state") else (element,))
    ]
    states += problem.all("goalState")
    if not states:
        raise problem.error("the element goalState is missing")
    for state in states:
        begin, end = _interval(state.need("time"))
        position, heading, speed = (
            state.get(tag) for tag in ("position", "orientation", "velocity")
        )
        try:
            yield GoalRegion(
                places=None if position is None else tuple(_places(position, lanelets)),
                heading=None if heading is None else _interval(heading),
                speed=None if speed is None else _interval(speed),
                time=(step * begin, step * end),
                lanelets=() if position is None else tuple(_refs(position, "lanelet")),
            )
        except ValueError as error:
            raise _at(state, error) from error


def _places(position: Element, lanelets: Mapping[int, Lanelet]) -> Iterator[Shape]:
    for one in position.all("lanelet"):
        number = one.whole("ref")
        if number not in lanelets:
            raise one.error(f"ref: got {number}, but no lanelet of the file has this id")
        try:
            yield simple_polygon(lanelets[number].ring)
        except ValueError as error:
            raise _at(one, error) from error
    if (middle := position.get("point")) is not None:
        raise middle.error("is not read as a goal, need a shape or a lanelet")
    if any(one.tag != "lanelet" for one in position.children):
        yield from _shapes(position)


def _interval(element: Element) -> tuple[float, float]:
    exact = element.get("exact")
    if exact is not None:
        return exact.number(), exact.number()
    return element.need("intervalStart").number(), element.need("intervalEnd").number()


def _at(element: Element, error: ValueError) -> InvalidScenario:
    return error if isinstance(error, InvalidScenario) else element.error(str(error))

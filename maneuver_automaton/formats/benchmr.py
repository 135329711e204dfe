"""Worlds of Bench-MR: an SVG drawing, every path of it one obstacle.

In the drawing y points down; here ``X = x + t_x`` and ``Y = -(y + t_y)``, in metres, with the
translations of the groups around the path. As in Bench-MR, an obstacle is the convex hull of its
path, and the bounds are the box around all obstacles. A file `queries.csv` beside the drawing, or
one folder above, states start, goal and robot of every world; the robot's outline is an SVG of that
name, its centroid at the pose.

Source: Heiden et al. (2021), *Bench-MR: A Motion Planning Benchmark for Wheeled Mobile Robots*,
RA-L 6(3), and its files.

Image worlds are pictures whose dark pixels, of a shade below one half, are blocked, a pixel a cell
of 1 m; their lower left corner is the origin.
"""

from __future__ import annotations

import glob
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._files import open_input
from maneuver_automaton.collision import Obstacle, OccupancyMap, Polygon
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.cells import read_grey_image, world_of
from maneuver_automaton.formats.statement import Statement
from maneuver_automaton.formats.text_source import MAX_BYTES, finite, table_of
from maneuver_automaton.formats.xml_source import read_xml
from maneuver_automaton.problem import Bounds

QUERIES = "queries.csv"
COLUMNS = ("world", "robot", "x0_m", "y0_m", "yaw0_rad", "x1_m", "y1_m", "yaw1_rad")


@dataclass(frozen=True, slots=True, eq=False)
class Query:
    """One row of the table of queries."""

    world: str
    robot: str
    start: Array  # (3,) [m, m, rad]
    goal: Array  # (3,) [m, m, rad]


def read_benchmr(path: Path) -> tuple[Statement, ...]:
    """The problems on a world, one for every query; without any, its obstacles alone."""
    world = _world(path)
    table = _queries_beside(path)
    queries = [] if table is None else [q for q in read_queries(table) if q.world == path.stem]
    if len(queries) > 1:
        return tuple(_asked(world, query, path, case=k) for k, query in enumerate(queries))
    return (_asked(world, queries[0], path),) if queries else (world,)


def read_benchmr_queries(path: Path) -> tuple[Statement, ...]:
    """One problem for every row of a table of queries; worlds are beside it or a folder below."""
    statements, worlds = [], {}
    for case, query in enumerate(read_queries(path)):
        name = f"{query.world}.svg"
        places = [path.parent / name, *sorted(path.parent.glob(f"*/{glob.escape(name)}"))]
        file = next((place for place in places if place.is_file()), None)
        if file is None:
            raise InvalidScenario(f"{path}: world: got {query.world!r}, but there is no {name}")
        if file not in worlds:
            worlds[file] = _world(file)
        statements.append(_asked(worlds[file], query, file, case=case))
    if not statements:
        raise InvalidScenario(f"{path}: holds no query, need at least one")
    return tuple(statements)


def _world(path: Path) -> Statement:
    hulls = [_hull(path, drawn) for drawn in read_svg_paths(path)]
    obstacles = tuple(Obstacle(one, name=f"obstacle {k + 1}") for k, one in enumerate(hulls))
    corners = np.concatenate([one.corners for one in hulls])
    (left, low), (right, high) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    bounds = Bounds(x=(left, right), y=(low, high))
    return Statement(format="Bench-MR", name=path.stem, obstacles=obstacles, bounds=bounds)


def _asked(world: Statement, query: Query, path: Path, *, case: int | None = None) -> Statement:
    """The world with one query on it."""
    return replace(
        world,
        name=world.name if case is None else f"{world.name} case {case}",
        start=query.start,
        goal=query.goal,
        footprint=(outline(path.with_name(f"{query.robot}.svg")),),
    )


def n_queries(path: Path) -> int:
    """How often a table of queries names this drawing as a world; robots and pictures: never."""
    table = _queries_beside(path)
    return 0 if table is None else sum(q.world == path.stem for q in read_queries(table))


def is_queries(path: Path) -> bool:
    """Whether a file begins like a table of queries."""
    try:
        with open_input(path) as stream:
            return stream.read(80).removeprefix(b"\xef\xbb\xbf").startswith(b"world,robot")
    except (OSError, ValueError):
        return False


def outline(path: Path) -> Polygon:
    """The body of a robot, its centroid at the pose and x ahead.

    Raises
    ------
    InvalidScenario
        If the drawing does not hold exactly one polygon.
    """
    drawn = read_svg_paths(path)
    if len(drawn) != 1:
        raise InvalidScenario(f"{path}: got {len(drawn)} paths, need one, the robot's outline")
    corners = _hull(path, drawn[0]).corners
    import shapely

    centroid = shapely.Polygon(corners).centroid
    return Polygon(corners - np.array([centroid.x, centroid.y]))


def _queries_beside(path: Path) -> Path | None:
    """The table of queries of a world, if there is one."""
    for folder in (path.absolute().parent, path.absolute().parent.parent):
        if (folder / QUERIES).is_file():
            return folder / QUERIES
    return None


def read_queries(path: Path) -> tuple[Query, ...]:
    """The rows of a table of queries."""
    queries = []
    for at, row in table_of(path, COLUMNS, what="a table of queries"):
        numbers = np.array([finite(row[name], at=f"{at}: {name}") for name in COLUMNS[2:]])
        robot = row["robot"]
        if not robot or robot != Path(robot).name:
            raise InvalidScenario(f"{at}: robot: got {robot!r}, need the name of a drawing")
        queries.append(Query(row["world"], robot, numbers[:3], numbers[3:]))
    return tuple(queries)


def _hull(path: Path, drawn: DrawnPath) -> Polygon:
    """Convex hull of a path, y upwards."""
    import shapely

    hull = shapely.MultiPoint(drawn.points * np.array([1.0, -1.0])).convex_hull
    if hull.geom_type != "Polygon" or not hull.area > 0.0:
        raise InvalidScenario(
            f"{path}:{drawn.line}: the path encloses no area, need a polygon of at least 3 corners"
        )
    return Polygon(np.asarray(hull.exterior.coords)[:-1])


DARK = 0.5


def read_benchmr_image(path: Path) -> tuple[Statement, ...]:
    """A world with one map, and bounds around it; the rest is left to others."""
    dark = read_grey_image(path).shade < DARK
    cells = OccupancyMap(dark[::-1], resolution=1.0, name=path.name)
    return (world_of(cells, path, "Bench-MR image"),)


_TOKEN = re.compile(r"\s*,?\s*(?:([A-Za-z])|([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?))")
_TRANSLATE = re.compile(r"\s*translate\s*\(\s*([^\s,()]+)\s*(?:[\s,]\s*([^\s,()]+)\s*)?\)\s*")
PER_POINT = {"m": 2, "l": 2, "h": 1, "v": 1}  # numbers that a command takes again and again


@dataclass(frozen=True, slots=True, eq=False)
class DrawnPath:
    """Where a pen goes."""

    points: Array  # (n, 2), y downwards as in the drawing, translations added
    line: int


def read_svg_paths(path: Path) -> tuple[DrawnPath, ...]:
    """The paths of a drawing, in their order."""
    drawn: list[DrawnPath] = []
    left = [(read_xml(path, what="a drawing", most=MAX_BYTES), np.zeros(2))]
    while left:
        element, shift = left.pop()
        at, name = f"{path}:{element.line}", element.tag.rpartition(":")[2]
        if name == "defs":  # not drawn
            continue
        if "transform" in element.attributes:
            text = element.attributes["transform"]
            if (match := _TRANSLATE.fullmatch(text)) is None:
                said = f"got {text[:60]!r}, need translate(x, y)"
                raise InvalidScenario(f"{at}: transform: {said}")
            shift = shift + [finite(word or "0", at=f"{at}: transform") for word in match.groups()]
        if name == "path":
            points = _points(element.attributes.get("d", ""), at)
            drawn.append(DrawnPath(points + shift, element.line))
        left += [(child, shift) for child in reversed(element.children)]
    if not drawn:
        raise InvalidScenario(f"{path}: holds no path, need at least one")
    return tuple(drawn)


def _points(text: str, at: str) -> Array:
    """Where the pen of a path goes, (n, 2)."""
    tokens = _tokens(text.strip(), at)
    points: list[Array] = []
    pen, begin, command = np.zeros(2), np.zeros(2), ""
    k = 0
    while k < len(tokens):
        if tokens[k].isalpha():
            command, k = tokens[k], k + 1
            if command in "zZ":
                pen = begin
                continue
        n = PER_POINT.get(command.lower(), 0)
        if not n or (not points and command not in "mM"):
            need = "m, l, h, v or z" if points else "m first"
            raise InvalidScenario(f"{at}: d: got the command {command!r}, need {need}")
        words = [word for word in tokens[k : k + n] if not word.isalpha()]
        if len(words) < n:
            raise InvalidScenario(f"{at}: d: the command {command!r} misses a number")
        pen = _moved(pen, command, [finite(word, at=f"{at}: d") for word in words])
        points.append(pen)
        k += n
        if command in "mM":  # more numbers are lines
            begin, command = pen, "l" if command == "m" else "L"
    return np.array(points).reshape(-1, 2)


def _tokens(text: str, at: str) -> list[str]:
    """Letters and numbers of a path."""
    tokens, place = [], 0
    while place < len(text):
        match = _TOKEN.match(text, place)
        if match is None:
            raise InvalidScenario(f"{at}: d: got {text[place : place + 20]!r}, need a number")
        tokens.append(match.group(1) or match.group(2))
        place = match.end()
    return tokens


def _moved(pen: Array, command: str, numbers: list[float]) -> Array:
    """Where the pen is after one command."""
    axes = {"h": [0], "v": [1]}.get(command.lower(), [0, 1])
    after = pen.copy()
    after[axes] = np.array(numbers) + (pen[axes] if command.islower() else 0.0)
    return after

"""Problems of the benchmarks in ``../shared/data``, read here line by line.

A second reader, independent of the package's own.
"""

from __future__ import annotations

import csv
import json
import math
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.collision import Box, OccupancyMap, Polygon, Shape
from maneuver_automaton.models import Car, Unicycle
from maneuver_automaton.problem import Bounds, Goal, Problem
from tests.scenes import reeds_shepp
from tests.solids import World

DATA = Path(__file__).parents[1] / "../shared/data"
TPCAP_CAR = Car(wheelbase=2.8, max_steering=0.75)
TPCAP_REAR, TPCAP_FRONT, TPCAP_WIDTH = 0.929, 2.8 + 0.96, 1.942  # [m] from the rear axle
TPCAP_BODY = Box([TPCAP_REAR + TPCAP_FRONT, TPCAP_WIDTH], [(TPCAP_FRONT - TPCAP_REAR) / 2, 0.0])
POSE = (("x", "m"), ("y", "m"), ("yaw", "rad"))
BENCH_MR_RADIUS = MOVINGAI_RADIUS = 4.0  # [m], cells of 1 m


def present(folder: str) -> bool:
    """Whether a folder of the data is there; a sentence is printed if not."""
    if (DATA / folder).exists():
        return True
    print(f"nothing to measure: ../shared/data/{folder} is not there")
    return False


def table(path: str) -> list[dict[str, str]]:
    """Rows of a CSV file of the data."""
    with (DATA / path).open(newline="") as lines:
        return list(csv.DictReader(lines))


def car_scenarios(only: str = "") -> dict[str, Problem]:
    """The queries S1-0 to S6-0, or those whose name begins with `only`."""
    library: dict[str, Automaton] = {}
    problems = {}
    for path in sorted((DATA / "car-scenarios").glob(f"{only}*.yaml")):
        given = json.loads(path.read_text())
        trims = json.dumps(given["automaton"]["trims"])
        if trims not in library:
            controls = {trim["name"]: trim["control"] for trim in given["automaton"]["trims"]}
            library[trims] = Automaton.of_controls(Unicycle(), controls)
        problems[path.stem] = Problem(
            library[trims],
            given["start"]["pose"],
            given["goal"]["pose"],
            obstacles=[Polygon(one["polygon_m"]) for one in given["obstacles"]],
            footprint=Polygon(given["vehicle"]["footprint"]["polygon_m"]),
        )
    return problems


def car_references() -> dict[str, dict[str, float]]:
    """Known lengths and times of the car scenarios, by query."""
    rows = table("car-scenarios/reference.csv")
    return {
        row["query"]: {name: float(value) for name, value in row.items() if name != "query"}
        for row in rows
    }


def tpcap() -> dict[int, Problem]:
    """The parking cases by number, for the kinematic car; cost = length, at 1 m/s."""
    speeds = {"+": 1.0, "-": -1.0}
    turns = {"L": 0.75, "S": 0.0, "R": -0.75}
    automaton = Automaton.of_controls(
        TPCAP_CAR, {t + s: (speeds[s], turns[t]) for s in speeds for t in turns}
    )
    problems = {}
    for path in (DATA / "tpcap").glob("Case*.csv"):
        values = [float(word) for word in path.read_text().replace("\n", ",").split(",") if word]
        m = int(values[6])
        counts = [int(n) for n in values[7 : 7 + m]]
        corners = np.array(values[7 + m :]).reshape(-1, 2)
        rings = np.split(corners, np.cumsum(counts)[:-1])
        problems[int(path.stem.removeprefix("Case"))] = Problem(
            automaton,
            values[:3],
            values[3:6],
            obstacles=[Polygon(ring) for ring in rings],
            footprint=TPCAP_BODY,
        )
    return dict(sorted(problems.items()))


def nav2_map(name: str, *, unknown_blocked: bool) -> OccupancyMap:
    """An occupancy map by name, its unknown cells blocked or free."""
    settings = yaml.safe_load((DATA / "nav2-maps" / f"{name}.yaml").read_text())
    pixels = _pgm(DATA / "nav2-maps" / settings["image"]).astype(float)
    occupied = pixels / 255.0 if settings["negate"] else 1.0 - pixels / 255.0
    blocked = occupied >= settings["occupied_thresh"]
    if unknown_blocked:
        blocked = occupied > settings["free_thresh"]
    return OccupancyMap(
        blocked[::-1], resolution=settings["resolution"], origin=settings["origin"], name=name
    )


def _pgm(path: Path) -> np.ndarray:
    """Pixels (rows, columns) of a binary PGM of 8 bits."""
    data = path.read_bytes()
    header = re.match(rb"P5\s+(?:#[^\n]*\n\s*)*(\d+)\s+(?:#[^\n]*\n\s*)*(\d+)\s+255\s", data)
    if header is None:
        raise ValueError(f"{path.name}: no binary PGM of 8 bits")
    width, height = int(header[1]), int(header[2])
    return np.frombuffer(data, np.uint8, width * height, header.end()).reshape(height, width)


@dataclass(frozen=True, slots=True)
class GridQuery:
    """A query of a MovingAI scenario: places [m], and the length on the grid."""

    start: tuple[float, float]
    goal: tuple[float, float]
    grid_length: float


def movingai_map(name: str) -> OccupancyMap:
    """A street map, one cell 1 m, row 0 of the file at the top, with a border of blocked cells."""
    lines = (DATA / "movingai" / f"{name}.map").read_text().split("\n")
    height, width = int(lines[1].split()[1]), int(lines[2].split()[1])
    rows = lines[4 : 4 + height]
    free = np.array([[mark in ".G" for mark in row[:width]] for row in rows])
    blocked = np.pad(~free, 1, constant_values=True)
    return OccupancyMap(blocked[::-1], resolution=1.0, origin=[-1.0, -1.0, 0.0], name=name)


def movingai_longest(name: str, n: int) -> list[GridQuery]:
    """The `n` longest queries of a street map, longest first; places are centers of cells."""
    queries = []
    for line in (DATA / "movingai" / f"{name}.map.scen").read_text().splitlines()[1:]:
        fields = line.split("\t")
        height = int(fields[3])
        x0, y0, x1, y1 = (int(value) for value in fields[4:8])
        start, goal = ((x + 0.5, height - y - 0.5) for x, y in ((x0, y0), (x1, y1)))
        queries.append(GridQuery(start, goal, float(fields[8])))
    return sorted(queries, key=lambda query: -query.grid_length)[:n]


def bench_mr() -> dict[str, Problem]:
    """The polygon worlds by name, their obstacles made convex, with the given query each."""
    problems = {}
    for row in table("bench-mr/queries.csv"):
        obstacles = [_hull(ring) for ring in _svg_rings(row["world"])]
        outline = _hull(next(_svg_rings(row["robot"])))
        corners = np.concatenate([polygon.corners for polygon in obstacles])
        low, high = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
        ends = [[float(row[f"{name}{k}_{unit}"]) for name, unit in POSE] for k in range(2)]
        problems[row["world"]] = Problem(
            reeds_shepp(BENCH_MR_RADIUS),
            ends[0],
            ends[1],
            obstacles=obstacles,
            footprint=Polygon(outline.corners - _centroid(outline.corners)),
            bounds=Bounds(x=(low[0], high[0]), y=(low[1], high[1])),
        )
    return problems


def _svg_rings(name: str) -> Iterator[np.ndarray]:
    """Corners (n, 2) [m] of every path of a drawing, y upwards."""
    root = ElementTree.parse(DATA / "bench-mr" / "polygon_mazes" / f"{name}.svg").getroot()
    space = "{http://www.w3.org/2000/svg}"
    for group in root.iter(f"{space}g"):
        words = re.findall(r"[-\d.e]+", group.get("transform", "translate(0,0)").split("(")[1])
        shift = np.array([float(word) for word in words])
        for path in group.iter(f"{space}path"):
            yield (_path_points(path.get("d", "")) + shift) * [1.0, -1.0]


def _path_points(drawing: str) -> np.ndarray:
    """Corners of a path of the commands m, l, h, v, z and their capitals."""
    points = [np.zeros(2)]
    for command, numbers in re.findall(r"([mlhvzMLHVZ])([^mlhvzMLHVZ]*)", drawing):
        values = [float(w) for w in re.findall(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?", numbers)]
        axes = {"h": [0], "v": [1]}.get(command.lower(), [0, 1])
        for step in np.array(values).reshape(-1, len(axes)):
            point = points[-1].copy() if command.islower() else np.where(
                np.isin([0, 1], axes), 0.0, points[-1]
            )  # fmt: skip
            point[axes] += step
            points.append(point)
    return np.array(points[1:])


def _hull(points: np.ndarray) -> Polygon:
    """Convex hull of points, counter-clockwise."""
    order = sorted({(float(x), float(y)) for x, y in points})
    chains = []
    for sequence in (order, order[::-1]):
        chain: list[tuple[float, float]] = []
        for point in sequence:
            while len(chain) > 1 and _turn(chain[-2], chain[-1], point) <= 0.0:
                chain.pop()
            chain.append(point)
        chains.append(chain[:-1])
    return Polygon(chains[0] + chains[1])


def _turn(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _centroid(corners: np.ndarray) -> np.ndarray:
    after = np.roll(corners, -1, axis=0)
    cross = corners[:, 0] * after[:, 1] - after[:, 0] * corners[:, 1]
    return ((corners + after) * cross[:, None]).sum(axis=0) / (3.0 * cross.sum())


FIRST_ORDER = (
    "unicycle1_v0/bugtrap_0",
    "unicycle1_v0/bugtrap_double",
    "unicycle1_v0/parallelpark_0",
    "unicycle1_v2/wall_0",
)


def dynobench(name: str) -> Problem:
    """A problem of a first-order unicycle: controls at the limits, and rest where it can stop."""
    given = yaml.safe_load((DATA / "dynobench" / "envs" / f"{name}.yaml").read_text())
    robot, world = given["robots"][0], given["environment"]
    model = yaml.safe_load((DATA / "dynobench" / "models" / f"{robot['type']}.yaml").read_text())
    speeds = _limits(model["min_vel"], model["max_vel"])
    turns = _limits(model["min_angular_vel"], model["max_angular_vel"])
    obstacles: list[Shape] = [Box(one["size"], one["center"]) for one in world["obstacles"]]
    low, high = world["min"], world["max"]
    return Problem(
        Automaton.of_grid(Unicycle(), [speeds, turns]),
        robot["start"],
        Goal(pose=robot["goal"]),
        obstacles=obstacles,
        footprint=Box(model["size"]),
        bounds=Bounds(x=(low[0], high[0]), y=(low[1], high[1])),
    )


def _limits(low: float, high: float) -> list[float]:
    """Both limits, and 0 between them."""
    return sorted({low, 0.0, high}) if low < 0.0 < high else [low, high]


def free_poses(
    problem: Problem, n: int, *, low: np.ndarray, high: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Random poses (n, 3) in a rectangle at which the body is free."""
    world = World(problem)
    found: list[np.ndarray] = []
    while len(found) < n:
        poses = np.column_stack(
            [rng.uniform(low, high, (4 * n, 2)), rng.uniform(-math.pi, math.pi, 4 * n)]
        )
        clear = world.clearance(poses - np.append(world.origin, 0.0)) > 0.0
        found += list(poses[clear])
    return np.array(found[:n])

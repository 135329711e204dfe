"""Scenes with a free way that is known by construction: no proof may say that there is none.

    python -m benchmarks.free_ways [--scenes 5000] [--first 0] [--plans 0] [--vehicle car]

A vehicle of the matrix, or a lattice body, drives a random word of its library; its body is drawn:
convex, concave, of several parts, thin against the whole, around its pose or far from it. What
stands around is what the body leaves over: discs, boxes and polygons grown until they nearly touch
it, all the plane beside it as polygons or as a map, obstacles above and below, some that move or
come and go. Then every statement that nothing is possible is asked for: start or goal blocked,
enclosed, separated, too long; and lower bounds are held against what the word costs. With `--plans`
the first of the scenes are planned, too. Every scene follows from its number.
"""

from __future__ import annotations

import argparse
import collections
import functools
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely

from maneuver_automaton import Automaton, Box, Disc, Obstacle, OccupancyMap, Plan, Polygon, Problem
from maneuver_automaton.automaton.cutting import carried
from maneuver_automaton.bounds import separation
from maneuver_automaton.collision import Motion, Shape, as_footprint
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import LatticeBody
from maneuver_automaton.planning import plan
from maneuver_automaton.planning.blocked import blocked_ends, goals_left
from maneuver_automaton.planning.proving import known_bound
from maneuver_automaton.problem import Bounds, Goal, Horizon, SearchSettings
from maneuver_automaton.scenario.automata import preset_automaton
from maneuver_automaton.search.lattice import _enclosed, distance_grids
from maneuver_automaton.search.lattice_library import lattice_library
from maneuver_automaton.search.lattice_query import lattice_query
from maneuver_automaton.search.limits import why_impossible
from tests.matrix.vehicles import VEHICLES, Vehicle

TOGETHER = 10  # scenes of one vehicle and one body
BOUNDED = 7  # one of so many scenes is asked for a lower bound
TOLD = 50  # scenes between two lines of progress
SAMPLES = 120  # poses along a word
MOST_BOXES = 3_000  # of a proof
BLOCKING = ("unreachable", "start_blocked", "goal_blocked")


def _lattice() -> Automaton:
    body = LatticeBody(resolution=0.1, turning_radius=0.5)
    return preset_automaton("lattice_diff", body)


ALL = (
    *VEHICLES.values(),
    Vehicle(
        name="lattice",
        library=_lattice,
        footprint=(Box([0.5, 0.3]),),
        goal=(4.0, 1.0, 0.0),
        inertia=True,
        rotates=False,
    ),
)


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A problem, and a word that solves it."""

    number: int
    vehicle: str
    body: str
    problem: Problem
    known: Plan


def drawn(seed: int, vehicles: tuple[Vehicle, ...] = ALL) -> Scene:
    """The scene of a number."""
    group = np.random.default_rng([1, seed // TOGETHER])
    vehicle = vehicles[int(group.integers(len(vehicles)))]
    kind, footprint, parts, height = _body(group, vehicle)
    rng = np.random.default_rng([2, seed])
    known = _word(rng, vehicle)
    margin = float(rng.choice([0.0, 0.0, 0.01, 0.1]) * vehicle.size)
    samples = _samples(known, vehicle, footprint, parts)
    obstacles = list(_obstacles(rng, known, samples, margin, height))
    goals, last = _goals(rng, known, vehicle), known.trims[-1].name
    horizon = Horizon()
    if rng.random() < 0.15:
        horizon = Horizon(max_time=known.duration * (1.0 + 1e-6) + 1e-6)
    problem = Problem(
        vehicle.automaton,
        known.start,
        goals,
        footprint=footprint,
        parts=parts,
        obstacles=obstacles,
        margin=margin,
        body_height=height,
        bounds=_bounds(rng, known, samples),
        horizon=horizon,
        start_trim=known.trims[0].name if vehicle.inertia else None,
        search=SearchSettings(max_expansions=300),
    )
    assert vehicle.inertia or last
    return Scene(number=seed, vehicle=vehicle.name, body=kind, problem=problem, known=known)


def _body(
    rng: np.random.Generator, vehicle: Vehicle
) -> tuple[str, tuple[Shape, ...], dict[str, tuple[Shape, ...]], tuple[float, float]]:
    """A kind of body, the body, the bodies of what is carried, and the heights of all [m]."""
    kind = str(rng.choice(sorted(BODIES)))
    shapes = _made(rng, kind, vehicle.size)
    parts = {}
    for name, usual in vehicle.parts.items():
        if rng.random() < 0.5:
            usual = _made(rng, str(rng.choice(sorted(BODIES))), 0.8 * vehicle.size)
        parts[name] = usual
    height = (0.0, 0.0)
    if vehicle.flies and rng.random() < 0.7:
        height = (-float(rng.uniform(0.0, 2.0)), float(rng.uniform(0.0, 2.0)))
    return kind, shapes, parts, height


def _made(rng: np.random.Generator, kind: str, size: float) -> tuple[Shape, ...]:
    offset = np.zeros(3)
    if rng.random() < 0.5:
        offset = np.array([*rng.uniform(-1.0, 1.0, 2), rng.uniform(-math.pi, math.pi)])
    shapes = [shape.moved(SE2(offset)) for shape in BODIES[kind](rng)]
    return as_footprint([_scaled(shape, size) for shape in shapes])


def _scaled(shape: Shape, size: float) -> Shape:
    if isinstance(shape, Disc):
        return Disc(size * shape.radius, size * shape.center)
    if isinstance(shape, Box):
        return Box(size * shape.size, size * shape.center, heading=shape.heading)
    return Polygon(size * shape.corners, tuple(size * hole for hole in shape.holes))


def _star(rng: np.random.Generator) -> list[Shape]:
    n = int(rng.integers(5, 12))
    angles = np.arange(n) * math.tau / n
    radii = rng.uniform(0.15, 1.0, n)
    return [Polygon(np.column_stack([radii * np.cos(angles), radii * np.sin(angles)]))]


def _round(rng: np.random.Generator) -> list[Shape]:
    """A frame around a post."""
    wide, thick = rng.uniform(0.5, 1.0), rng.uniform(0.03, 0.3)
    hole = shapely.box(thick - wide, thick - 1.0, wide - thick, 1.0 - thick)
    return [Polygon(shapely.box(-wide, -1.0, wide, 1.0).difference(hole))]


def _fork(rng: np.random.Generator) -> list[Shape]:
    thick, wide = rng.uniform(0.05, 0.2), rng.uniform(0.3, 0.6)
    return [
        Box([1.0, 2.0 * wide], [-0.6, 0.0]),
        Box([1.2, thick], [0.4, wide - thick]),
        Box([1.2, thick], [0.4, thick - wide]),
    ]


U = np.array([
    [-0.6, -0.5], [1, -0.5], [1, -0.3], [-0.2, -0.3],
    [-0.2, 0.3], [1, 0.3], [1, 0.5], [-0.6, 0.5],
])  # fmt: skip
BODIES: dict[str, Any] = {
    "box": lambda rng: [Box(rng.uniform(0.2, 1.0, 2))],
    "disc": lambda rng: [Disc(rng.uniform(0.2, 0.8), rng.uniform(-0.4, 0.4, 2))],
    "beside": lambda rng: [Box(rng.uniform(0.2, 0.8, 2), [rng.uniform(0.5, 3.0), 0.0])],
    "on rim": lambda rng: [Box([1.0, rng.uniform(0.3, 0.8)], [0.5, 0.0])],
    "U": lambda rng: [Polygon(U * rng.uniform(0.7, 1.0, 2))],
    "frame": _round,
    "gantry": lambda rng: [Box([1.0, 0.15], [0.0, s * rng.uniform(0.5, 0.9)]) for s in (1, -1)],
    "fork": _fork,
    "antenna": lambda rng: [
        Box([0.9, 0.6]),
        Box([rng.uniform(0.2, 0.9), 0.02], [0.6, 0.25]),
    ],
    "mirrors": lambda rng: [Box([1.0, 0.6]), *(Box([0.05, 0.1], [0.2, 0.35 * s]) for s in (1, -1))],
    "tray": lambda rng: [Disc(0.7), Box([1.0, 0.1])],
    "sensor": lambda rng: [Box([1.0, 0.7]), Disc(0.03, rng.uniform(-0.3, 0.3, 2))],
    "mast": lambda rng: [Disc(0.02), Box([0.5, 0.4], [0.9, 0.0])],
    "star": _star,
    "pieces": lambda rng: [
        Box(rng.uniform(0.05, 0.5, 2), rng.uniform(-1.0, 1.0, 2)) for _ in range(3)
    ],
    "point": lambda rng: [],
}


def _word(rng: np.random.Generator, vehicle: Vehicle) -> Plan:
    """A random word of the library, some lengths of the body long, from a random place."""
    automaton = vehicle.automaton
    start = np.zeros(len(vehicle.goal))
    start[:2] = rng.uniform(-1.0, 1.0, 2) * rng.choice([0.0, 10.0, 1e4])
    if vehicle.rotates:
        start[2] = rng.choice([0.0, rng.uniform(-math.pi, math.pi)])
    if start.size > 3:
        start[3] = rng.uniform(-50.0, 50.0)
    first = 0 if automaton.rest is None else automaton.rest
    if vehicle.name == "stage":
        first = 1
    at, trims, maneuvers, durations = int(first), [], [], []
    if vehicle.rotates is False and automaton.translated is not None:
        start[2] = automaton.translated.heading(automaton.trims[at].reduced_state)
    length = float(rng.uniform(2.0, 6.0)) * vehicle.size
    classes = automaton.trim_classes
    for _ in range(int(rng.integers(1, 6))):
        trim = automaton.trims[at]
        speed = float(np.abs(trim.body_velocity[:3]) @ [1.0, 1.0, vehicle.size])
        most = min(length / (2.0 * speed) if speed > 0.0 else 0.5, trim.max_duration)
        trims.append(trim)
        durations.append(float(rng.uniform(0.2, 1.0) * most))
        ways: list[tuple[int, Any]] = [
            (automaton.index_of(one.target), one) for one in _leaving(automaton).get(trim.name, ())
        ]
        mates = [k for k in np.flatnonzero(classes == classes[at]).tolist() if k != at]
        if mates and (not ways or rng.random() < 0.3):
            ways = [(k, None) for k in mates]
        if not ways:
            break
        at, maneuver = ways[int(rng.integers(len(ways)))]
        maneuvers.append(maneuver)
    word = Plan(
        start,
        trims,
        durations=durations,
        maneuvers=maneuvers[: len(trims) - 1] if any(maneuvers[: len(trims) - 1]) else (),
    )
    moved = float(np.abs(word.end - word.start)[:2].sum())
    return word if moved > 0.1 * vehicle.size else _word(rng, vehicle)


@functools.cache
def _leaving(automaton: Automaton) -> dict[str, list[Any]]:
    leaving = collections.defaultdict(list)
    for maneuver in automaton.maneuvers:
        leaving[maneuver.source].append(maneuver)
    return leaving


@dataclass(frozen=True, kw_only=True)
class _Swept:
    """What a body covers along a word."""

    times: np.ndarray
    poses: np.ndarray
    bodies: np.ndarray  # one geometry for each time
    area: Any
    between: float  # [m] by which any point may be elsewhere between two times
    size: float
    middle: np.ndarray  # (n, 2) of the body


def _samples(
    known: Plan, vehicle: Vehicle, footprint: tuple[Shape, ...], parts: dict[str, tuple[Shape, ...]]
) -> _Swept:
    times = np.linspace(0.0, known.duration, SAMPLES)
    motions = [(known, footprint)]
    motions += [(carried(known, vehicle.automaton.model, name), one) for name, one in parts.items()]
    bodies, between, size = [], 0.0, 0.0
    for motion, shapes in motions:
        own = shapely.union_all([_outline(shape) for shape in shapes] or [shapely.Point(0, 0)])
        arm = float(np.hypot(*shapely.get_coordinates(own).T).max())
        poses = motion.pose_at(times)
        steps = np.hypot(*np.diff(poses[:, :2], axis=0).T)
        between = max(between, float((steps + arm * np.abs(np.diff(poses[:, 2]))).max()))
        size = max(size, arm)
        corners = SE2(poses[:, None, :3]).act(shapely.get_coordinates(own))
        copies = np.repeat(np.array([own]), len(poses))
        bodies.append(shapely.set_coordinates(copies, np.asarray(corners).reshape(-1, 2)))
    whole = shapely.union_all(np.array(bodies), axis=0)
    return _Swept(
        times=times,
        poses=known.pose_at(times),
        bodies=whole,
        area=shapely.union_all(whole),
        between=between,
        size=max(size, 0.2 * vehicle.size),
        middle=shapely.get_coordinates(shapely.centroid(whole)),
    )


def _outline(shape: Shape) -> Any:
    """A polygon around a shape."""
    if isinstance(shape, Disc):
        return shapely.Point(shape.center).buffer(
            shape.radius / math.cos(math.pi / 64), quad_segs=16
        )
    return shapely.Polygon(shape.corners, getattr(shape, "holes", ()))


def _obstacles(
    rng: np.random.Generator, known: Plan, swept: _Swept, margin: float, height: tuple[float, float]
) -> Iterator[Obstacle | OccupancyMap]:
    """What may stand around a word."""
    clear = margin + swept.between + 1e-6
    kind = rng.random()
    lower, upper = shapely.bounds(swept.area).reshape(2, 2)
    pad = swept.size * float(rng.choice([0.3, 2.0]))
    if kind < 0.2:
        wall = shapely.box(*(lower - pad), *(upper + pad)).difference(swept.area.buffer(clear))
        for one in shapely.get_parts(wall):
            if one.area > 1e-4 * swept.size**2:
                yield Obstacle(Polygon(one))
    elif kind < 0.45:
        yield _map(rng, swept, clear, lower - pad, upper + pad)
    for _ in range(int(rng.integers(1 if kind > 0.45 else 0, 9))):
        shape = _nestled(rng, swept, clear)
        if shape is None:
            continue
        tall = None
        if known.start.size > 3 and rng.random() < 0.5:
            low, high = np.sort(swept.poses[0, 3] + rng.uniform(-20.0, 20.0, 2)).tolist()
            tall = (low, high + 0.1)
        yield Obstacle(shape, height=tall)
    if known.start.size > 3:
        yield from _above_and_below(rng, swept, margin, height)
    if rng.random() < 0.25:
        yield from _moving(rng, known, swept, clear)


def _nestled(rng: np.random.Generator, swept: _Swept, clear: float) -> Shape | None:
    """A shape as large as there is room for it; None if there is none."""
    k = int(rng.integers(SAMPLES))
    choice = rng.random()
    if choice < 0.35:  # where the pose goes by
        place = swept.poses[k, :2] + rng.normal(0.0, 0.05, 2) * swept.size
    elif choice < 0.8:
        place = swept.middle[k] + rng.uniform(-1.2, 1.2, 2) * swept.size
    else:
        place = swept.middle[k] + rng.uniform(-4.0, 4.0, 2) * swept.size
    room = float(swept.area.distance(shapely.Point(place))) - clear
    if room <= 1e-3 * swept.size:
        return None
    if rng.random() < 0.4:
        return Disc(min(room, 10.0 * swept.size) * float(rng.choice([1.0, 0.3])), place)
    long, heading = rng.uniform(0.2, 5.0), rng.uniform(-math.pi, math.pi)
    least, most = 0.0, 10.0 * swept.size
    for _ in range(8):
        wide = 0.5 * (least + most)
        box = Box([long * wide, wide], place, heading=heading)
        free = swept.area.distance(shapely.Polygon(box.corners)) > clear
        least, most = (wide, most) if free else (least, wide)
    if least == 0.0:
        return None
    box = Box([long * least, least], place, heading=heading)
    return Polygon(box.corners[:3]) if rng.random() < 0.3 else box


def _map(
    rng: np.random.Generator, swept: _Swept, clear: float, low: np.ndarray, high: np.ndarray
) -> OccupancyMap:
    """All cells that the body leaves over, or most of them; some are not known, and count."""
    cell = max(float(rng.uniform(0.03, 0.3)) * swept.size, float((high - low).max()) / 150.0)
    heading = float(rng.choice([0.0, rng.uniform(-0.5, 0.5)]))
    origin = np.array([*low, heading])
    columns, rows = np.ceil((high - low) / cell).astype(int) + 1
    j, i = np.mgrid[:rows, :columns]
    corners = cell * (
        np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) + np.stack([i, j], -1)[..., None, :]
    )
    squares = shapely.polygons(np.asarray(SE2(origin).act(corners.reshape(-1, 4, 2))))
    around = swept.area.buffer(clear)
    shapely.prepare(around)
    free = shapely.intersects(around, squares).reshape(rows, columns)
    # As in ROS: 0 is free, 100 is occupied, and -1 is not known.
    data = rng.choice([100, -1, 0], p=[0.7, 0.2, 0.1], size=(rows, columns))
    if rng.random() < 0.5:
        data = np.full((rows, columns), 100)
    return OccupancyMap(np.where(free, 0, data) != 0, resolution=cell, origin=origin)


def _above_and_below(
    rng: np.random.Generator, swept: _Swept, margin: float, height: tuple[float, float]
) -> Iterator[Obstacle]:
    lowest = float(swept.poses[:, 3].min()) + height[0] - margin - 1e-3
    highest = float(swept.poses[:, 3].max()) + height[1] + margin + 1e-3
    count = int(rng.choice([0, 2, 40], p=[0.4, 0.4, 0.2]))
    for _ in range(count):
        k, thick = int(rng.integers(SAMPLES)), float(rng.uniform(0.01, 30.0))
        away = float(rng.choice([0.0, rng.uniform(0.0, 5.0)])) + 0.01 * swept.size
        under = (lowest - away - thick, lowest - away)
        pair = under if rng.random() < 0.5 else (highest + away, highest + away + thick)
        shape = Disc(float(rng.uniform(0.2, 3.0)) * swept.size, swept.poses[k, :2])
        yield Obstacle(shape, height=pair)


def _moving(
    rng: np.random.Generator, known: Plan, swept: _Swept, clear: float
) -> Iterator[Obstacle]:
    """Some that come and go beside the word in time, and some that cross it."""
    end = known.duration
    here = Disc(0.3 * swept.size, swept.middle[0])
    there = Disc(0.3 * swept.size, swept.middle[-1])
    yield Obstacle(here, present_s=(-9.0, -1.0))
    yield Obstacle(there, present_s=(end + 0.1, end + 5.0))
    way = np.zeros((2, 3))
    way[:, :2] = swept.middle[[0, -1]] + rng.uniform(-3.0, 3.0, (2, 2)) * swept.size
    crossing = Motion([0.0, max(end, 1e-3)], way)
    radius = 0.2 * swept.size
    at = crossing.at(swept.times)[:, :2]
    apart = shapely.distance(swept.bodies, shapely.points(at)) - radius
    step = float(np.hypot(*np.diff(at, axis=0).T).max())
    if apart.min() > clear + step:
        yield Obstacle(Disc(radius), motion=crossing)


def _goals(rng: np.random.Generator, known: Plan, vehicle: Vehicle) -> list[Goal]:
    """The end of the word, exactly or within a tolerance, and goals elsewhere."""
    end = np.array(known.end)
    trim = known.trims[-1].name if vehicle.inertia else None
    kind = rng.random()
    goal = Goal(end, trim=trim)
    if kind < 0.2 and vehicle.rotates:
        end[2] += rng.uniform(-math.pi, math.pi)
        goal = Goal(end, trim=trim, free_heading=True)
    elif kind < 0.5:
        far = float(rng.choice([0.1, 1.0])) * vehicle.size
        turned = float(rng.uniform(0.0, 1.0)) if vehicle.rotates else 0.0
        angle, share = rng.uniform(-math.pi, math.pi), float(rng.uniform(0.0, 0.999))
        end[:2] += share * far * np.array([math.cos(angle), math.sin(angle)])
        if vehicle.rotates:
            end[2] += 0.999 * turned * rng.uniform(-1.0, 1.0)
        goal = Goal(end, trim=trim, tolerance_m=far, tolerance_rad=turned)
    goals = [goal]
    if rng.random() < 0.2:
        elsewhere = np.array(known.end)
        elsewhere[:2] += rng.uniform(-2.0, 2.0, 2) * vehicle.size
        goals.append(replace(goal, pose=elsewhere, tolerance_m=0.0, tolerance_rad=0.0))
    return [goals[k] for k in rng.permutation(len(goals))]


def _bounds(rng: np.random.Generator, known: Plan, swept: _Swept) -> Bounds:
    """None, or as narrow as the word admits."""
    low, high = swept.poses.min(axis=0), swept.poses.max(axis=0)
    pad = swept.between + float(rng.choice([1e-6, 0.5])) * swept.size
    pairs = {name: (float(low[k] - pad), float(high[k] + pad)) for k, name in ((0, "x"), (1, "y"))}
    if known.start.size > 3:
        pairs["z"] = (float(low[3] - 0.1), float(high[3] + 0.1))
    return Bounds(**{name: pair for name, pair in pairs.items() if rng.random() < 0.4})


def wrong(scene: Scene) -> list[str]:
    """What is said of a scene although it is not so."""
    problem, known = scene.problem, scene.known
    said = []
    exact = replace(problem, goals=_met(problem, known))
    for one in (exact, problem) if not _tolerant(problem) else (exact,):
        blocked = blocked_ends(one)
        if blocked is not None:
            said.append(f"{blocked.status.value}: {blocked.reason}")
    if said:
        return said
    asked = exact if _tolerant(problem) else problem
    query = lattice_query(asked, goals_left(asked), library=_lattice_library(scene))
    if proof := _enclosed(query, distance_grids(query)):
        said.append(f"enclosed: {proof}")
    proven = separation(problem, most_boxes=MOST_BOXES) if problem.obstacles else None
    if proven is not None:
        said.append(f"separated: {proven.reason}")
    if problem.automaton.is_kinematic and (reason := why_impossible(problem)):
        said.append(f"impossible: {reason}")
    cost = problem.cost_of(known)
    free = replace(problem, horizon=Horizon())
    if (
        scene.number % BOUNDED == 0
        and (bound := known_bound(free).value) > cost * (1.0 + 1e-6) + 1e-6
    ):
        said.append(f"bound: {bound:.6g} of {cost:.6g}")
    return said


@functools.lru_cache(maxsize=2)
def _library_of(vehicle: str, footprint: tuple[Shape, ...], parts: tuple[Any, ...]) -> Any:
    own = {one.name: one for one in ALL}[vehicle]
    return lattice_library(own.problem(footprint=footprint, parts=dict(parts)), (0,))


def _lattice_library(scene: Scene) -> Any:
    """Any library of the vehicle with its body: what encloses it depends on the body alone."""
    problem = scene.problem
    return _library_of(scene.vehicle, problem.footprint, tuple(sorted(problem.parts.items())))


def _tolerant(problem: Problem) -> bool:
    return any(goal.tolerance_m or goal.tolerance_rad for goal in problem.goals)


def _met(problem: Problem, known: Plan) -> tuple[Goal, ...]:
    """The goals, the one that the word meets at its end."""
    return tuple(
        replace(goal, pose=known.end, tolerance_m=0.0, tolerance_rad=0.0)
        if goal.tolerance_m or goal.tolerance_rad
        else goal
        for goal in problem.goals
    )


def planned(scene: Scene) -> str:
    """The status of a plan, and why, if it says that there is none."""
    result = plan(scene.problem, time_limit=60.0)
    status = str(result.status.value)
    return f"{status}: {result.reason}" if status in BLOCKING else status


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])  # type: ignore[union-attr]
    parser.add_argument("--scenes", type=int, default=5000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--plans", type=int, default=0, help="scenes that are planned too")
    parser.add_argument("--vehicle", help="this one alone")
    chosen = parser.parse_args()
    vehicles = tuple(one for one in ALL if chosen.vehicle in (None, one.name))
    counts: collections.Counter[str] = collections.Counter()
    began = time.process_time()
    for k in range(chosen.first, chosen.first + chosen.scenes):
        scene = drawn(k, vehicles)
        said = wrong(scene)
        if k - chosen.first < chosen.plans:
            status = planned(scene)
            counts[f"planned: {status.partition(':')[0]}"] += 1
            said += [status] if status.startswith(BLOCKING) else []
        counts["wrong" if said else "right"] += 1
        for one in said:
            print(f"{k} {scene.vehicle} {scene.body}: {one}", flush=True)
        if (k + 1) % TOLD == 0:
            print(f"{dict(counts)} up to {k}", flush=True)
    spent = time.process_time() - began
    print(f"{dict(counts)}, {1e3 * spent / max(chosen.scenes, 1):.0f} ms each")


if __name__ == "__main__":
    main()

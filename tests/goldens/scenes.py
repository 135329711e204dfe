"""Small problems whose answers are kept as data: what is planned for them must not get worse.

Every problem has `max_expansions`, and the time limit is so generous that the clock decides
nothing for a kinematic vehicle. The first of each family are planned in the default run, the
others with `-m slow`.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import maneuver_automaton as ma
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.collision import (
    Box,
    Disc,
    Motion,
    Obstacle,
    OccupancyMap,
    Polygon,
    Zone,
)
from maneuver_automaton.costs import Cost
from maneuver_automaton.groups import SE2, SE2xR
from maneuver_automaton.models import Car, Unicycle, UserModel
from maneuver_automaton.problem import Bounds, Goal, Horizon, Problem, SearchSettings
from tests import scenes
from tests.search.cases import REVERSED_SPIN, SLOW_AND_FAST, TABLE_2, robot

SCENARIOS = Path(__file__).parents[2] / "scenarios"
EXPANSIONS = 3000
MORE_EXPANSIONS = 40_000
NEED_MORE = {"narrow_corridor", "parallel_parking"}
UNHURRIED = 600.0  # [s] so that the clock decides nothing

LETTER_L = Polygon([[-0.3, -0.3], [0.9, -0.3], [0.9, 0.0], [0.0, 0.0], [0.0, 0.6], [-0.3, 0.6]])
FORKLIFT = (
    Box([1.4, 0.9], [-0.2, 0.0]),
    Box([1.0, 0.12], [1.0, 0.25]),
    Box([1.0, 0.12], [1.0, -0.25]),
)
SMALL_BOX = Box([0.7, 0.5])


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A problem of a name, made when it is asked for."""

    name: str
    make: Callable[[], Problem]
    quick: bool = False  # in the default run
    time_limit: float = UNHURRIED  # [s]

    @property
    def problem(self) -> Problem:
        """The problem, its work limited by a number of expansions."""
        problem = self.make()
        if problem.search.max_expansions is not None:
            return problem
        return replace(problem, search=replace(problem.search, max_expansions=EXPANSIONS))


def numbered(
    family: str, makers: Iterable[Callable[[], Problem]], *, quick: int, **more: float
) -> Iterator[Scene]:
    """Scenes of one family, the first `quick` of them in the default run."""
    for number, make in enumerate(makers):
        yield Scene(f"{family}/{number}", make, quick=number < quick, **more)


@functools.cache
def differential() -> Automaton:
    """Ahead, back, spins, arcs and rest, at 1 m/s and 1.5 rad/s."""
    return scenes.differential_robot(1.0, 1.5)


@functools.cache
def grid(count: int = 41, most: float = 2.0) -> Automaton:
    """Speeds and turn rates from -2 to 2: 1,681 trims if there are 41 of each."""
    axis = np.linspace(-most, most, count)
    return Automaton.of_grid(Unicycle(), [axis, axis])


@functools.cache
def platform() -> Automaton:
    """A holonomic platform: eight directions, two spins, and rest."""
    model = UserModel(
        name="platform",
        group=SE2,
        control_names=("ahead", "aside", "turn"),
        velocity=lambda z, u: [u[0], u[1], u[2]],
    )
    angles = np.arange(8) * math.pi / 4
    controls = {f"{k}": (math.cos(a), math.sin(a), 0.0) for k, a in enumerate(angles)}
    turns = {"spin left": (0.0, 0.0, 1.0), "spin right": (0.0, 0.0, -1.0)}
    return robot({"rest": (0.0, 0.0, 0.0)} | controls | turns, model)


@functools.cache
def boat() -> Automaton:
    """A boat without inertia that slips outwards in turns."""
    model = UserModel(
        name="boat",
        group=SE2,
        control_names=("speed", "turn"),
        velocity=lambda z, u: [u[0], -0.3 * u[0] * u[1], u[1]],
    )
    controls = {
        "ahead": (1.0, 0.0),
        "left": (0.8, 0.5),
        "right": (0.8, -0.5),
        "astern": (-0.4, 0.0),
        "stop": (0.0, 0.0),
    }
    return robot(controls, model)


@functools.cache
def glider() -> Automaton:
    """Glides in SE(2) x R: straight and turning, sinking all the while, and one climb."""
    model = UserModel(
        name="glider",
        group=SE2xR,
        control_names=("speed", "turn", "climb"),
        velocity=lambda z, u: [u[0], 0.0, u[1], u[2]],
    )
    controls = {
        "glide": (10.0, 0.0, -0.5),
        "left": (9.0, 0.3, -0.8),
        "right": (9.0, -0.3, -0.8),
        "thermal": (8.0, 0.4, 1.5),
        "dive": (14.0, 0.0, -2.5),
    }
    return robot(controls, model)


@functools.cache
def steering_car() -> Automaton:
    """A car with five steering angles in both directions."""
    car = Car(wheelbase=2.5, max_steering=0.6)
    angles = (-0.6, -0.3, 0.0, 0.3, 0.6)
    controls = {
        f"{speed:+g} {angle:+g}": (speed, angle) for speed in (1.0, -1.0) for angle in angles
    }
    return robot(controls | {"rest": (0.0, 0.0)}, car)


def pose(seed: Sequence[int], reach: float, dof: int = 3) -> np.ndarray:
    """A pose within `reach` [m] of the origin, by a seed."""
    rng = np.random.default_rng(seed)
    place = rng.uniform(-reach, reach, 2)
    heading = rng.uniform(-math.pi, math.pi)
    return np.array([*place, heading, *rng.uniform(-0.2 * reach, 0.2 * reach, dof - 3)])


def free(automaton: Automaton, seed: int, reach: float, **changed) -> Problem:
    """From the origin to a pose by a seed, nothing in the way."""
    dof = automaton.model.group.dof
    goal = changed.pop("goal", None)
    if goal is None:
        goal = pose([7, seed], reach, dof)
    return Problem(automaton, np.zeros(dof), goal, **changed)


def boxes(seed: int, count: int, side: float, *, clear: Sequence[Sequence[float]]) -> list[Box]:
    """Boxes by a seed in a square around the origin that leave 1.5 m around some places."""
    rng = np.random.default_rng([31, seed])
    kept: list[Box] = []
    while len(kept) < count:
        box = Box(
            rng.uniform(0.4, 2.0, 2), rng.uniform(-side, side, 2), float(rng.uniform(0, math.pi))
        )
        reach = 1.5 + float(np.hypot(*box.size)) / 2
        if all(np.hypot(*(box.center - np.array(place[:2]))) > reach for place in clear):
            kept.append(box)
    return kept


def among(seed: int, *, automaton: Automaton | None = None, count: int = 14, **changed) -> Problem:
    """A small robot across 12 m of boxes; what is changed replaces what would be."""
    start, goal = np.array([-6.0, 0.0, 0.0]), np.array([6.0, 0.5 * (seed % 5 - 2), 0.7 * seed])
    own = {"footprint": SMALL_BOX, "goal": goal, "more": ()} | changed
    goal, more = own.pop("goal"), own.pop("more")
    goals = goal if isinstance(goal, list) else [goal]
    ends = [one.pose if isinstance(one, Goal) else one for one in goals]
    obstacles = [*boxes(seed, count, 6.0, clear=[start, *ends]), *more]
    return Problem(automaton or differential(), start, goal, obstacles=obstacles, **own)


def crossing(seed: int, **changed) -> Problem:
    """Two things cross the way ahead, one goes to and fro on it."""
    rng = np.random.default_rng([5, seed])
    lanes = [-2.0, 1.5]
    cross = [
        Obstacle(
            Disc(0.5),
            motion=Motion([0.0, 12.0], [[x, -6.0 + d, 0.0], [x + 0.5, 6.0 + d, 0.0]]),
        )
        for x, d in zip(lanes, rng.uniform(-2.0, 2.0, 2), strict=True)
    ]
    legs = np.array([[4.0, 2.0 * (-1.0) ** k, 0.3 * k] for k in range(8)])
    legs[:, 1] += rng.uniform(-0.5, 0.5)
    to_and_fro = Obstacle(Box([0.6, 0.4]), motion=Motion(3.0 * np.arange(8), legs))
    settings = {"footprint": Disc(0.3)} | changed
    goal = settings.pop("goal", [7.0, 0.5, 0.0])
    automaton = settings.pop("automaton", differential())
    more = settings.pop("more", ())
    return Problem(
        automaton, [-6.0, 0.0, 0.0], goal, obstacles=[*cross, to_and_fro, *more], **settings
    )


def depot(seed: int, **changed) -> Problem:
    """Shelves on an occupancy map of 0.25 m cells."""
    rng = np.random.default_rng([9, seed])
    cells = np.zeros((48, 64), dtype=bool)
    for column in range(10, 60, 10):
        cells[4:44, column : column + 2] = True
        gap = int(rng.integers(6, 36))
        cells[gap : gap + 8, column : column + 2] = False
    settings = {"footprint": SMALL_BOX} | changed
    world = OccupancyMap(cells, resolution=0.25, origin=[-1.0, -6.0, 0.0])
    goal = settings.pop("goal", [14.4, float(rng.uniform(-4, 4)), 1.57])
    return Problem(differential(), [0.0, 0.0, 0.0], goal, obstacles=[world], **settings)


def strip(seed: int, **zone) -> Problem:
    """A zone across the way, a box beside it."""
    over = Zone(shape=Box([2.0, 40.0], [0.5 * seed, 0.0]), **zone)
    obstacles = [Box([0.5, 2.0], [-2.0, 0.4])] if seed % 2 else []
    return Problem(
        robot(SLOW_AND_FAST),
        [-4.0, 0.0, 0.0],
        [4.0, 0.5 * seed, 0.0],
        zones=[over],
        obstacles=obstacles,
        footprint=Box([0.4, 0.4]),
    )


def scenario(path: Path) -> Problem:
    """The problem of a scenario file, with as much work as it needs for a plan."""
    problem = ma.load_scenario(path).problem
    if path.stem not in NEED_MORE:
        return problem
    return replace(problem, search=replace(problem.search, max_expansions=MORE_EXPANSIONS))


def kinematic() -> Iterator[Scene]:
    """Scenes of vehicles that switch at will between their trims."""
    yield from _in_free_space()
    yield from _with_limits_in_free_space()
    yield from _in_tight_places()
    yield from _among_obstacles()
    yield from _random()
    for path in sorted(SCENARIOS.glob("*.yaml")):
        if path.stem not in WITH_INERTIA:
            yield Scene(
                f"scenario/{path.stem}",
                functools.partial(scenario, path),
                quick=path.stem in ("parking", "table1", "several_goals", "crossing_traffic"),
            )


WITH_INERTIA = {
    "helicopter_city",
    "hovercraft",
    "lane_change",
    "off_the_library",
    "robot_with_inertia",
    "tpcap_full",
    "trailer",
    "tugger_train",
    "two_trailers",
    "wheel_loader",
    "yard_loop",
}


def _in_free_space() -> Iterator[Scene]:
    of = functools.partial
    effort, mixed = Cost(effort=1.0), Cost(effort=1.0, norm=0.5)
    eight, four = Horizon(time=8.0), Horizon(time=8.0, max_trims=4)
    table, spun = robot(TABLE_2), robot(REVERSED_SPIN)
    yield from numbered(
        "table2/fixed",
        [of(free, table, k, 1.5, cost=effort if k % 2 else mixed, horizon=four) for k in range(6)]
        + [of(free, spun, k, 1.5, cost=mixed, horizon=eight) for k in range(4)],
        quick=2,
    )
    yield from numbered(
        "table2/free", [of(free, table, k, 3.0, cost=mixed) for k in range(4)], quick=1
    )
    shepp = scenes.reeds_shepp(1.0)
    yield from numbered("reeds_shepp", [of(free, shepp, k, 4.0) for k in range(8)], quick=2)
    yield from numbered("dubins", [of(free, scenes.dubins(1.0), k, 5.0) for k in range(6)], quick=1)
    yield from numbered(
        "car", [of(free, steering_car(), k, 8.0, cost=Cost(length=1.0)) for k in range(4)], quick=1
    )
    yield from numbered(
        "grid_1681",
        [of(free, grid(), k, 1.5, cost=effort, horizon=Horizon(time=2.0)) for k in range(3)]
        + [of(free, grid(), k, 1.5, cost=Cost(effort=0.2, time=1.0)) for k in range(3, 5)],
        quick=1,
    )
    yield from numbered("glider", [of(free, glider(), k, 120.0) for k in range(6)], quick=1)
    yield from numbered("platform", [of(free, platform(), k, 4.0) for k in range(5)], quick=1)
    yield from numbered("boat", [of(free, boat(), k, 8.0) for k in range(3)], quick=1)


def _with_limits_in_free_space() -> Iterator[Scene]:
    of = functools.partial
    rover, shepp, table = differential(), scenes.reeds_shepp(1.0), robot(TABLE_2)
    yield from numbered(
        "max_trims",
        [of(free, shepp, k, 3.0, horizon=Horizon(max_trims=3 + k % 3)) for k in range(4)],
        quick=1,
    )
    yield from numbered(
        "min_coast",
        [
            of(free, rover, k, 3.0, horizon=Horizon(max_trims=4, min_coast=0.2 * (k + 1)))
            for k in range(3)
        ],
        quick=0,
    )
    yield from numbered(
        "max_time",
        [
            of(free, rover, k, 3.0, cost=Cost(effort=1.0), horizon=Horizon(max_time=7.0 + k))
            for k in range(3)
        ],
        quick=1,
    )
    yield from numbered(
        "prices",
        [
            of(free, shepp, 0, 4.0, cost=Cost(time=1.0, switch=0.5)),
            of(free, shepp, 1, 4.0, cost=Cost(time=1.0, direction_change=2.0)),
            of(free, shepp, 2, 4.0, cost=Cost(length=1.0, switch=0.2, direction_change=1.0)),
            of(free, shepp, 3, 4.0, cost=Cost(time=1.0, switch=24.0)),
            of(free, table, 4, 2.0, cost=Cost(effort=1.0, switch=3.0), horizon=Horizon(time=8.0)),
            of(free, rover, 5, 4.0, cost=Cost(norm=1.0, norm_order=1.0, time=0.2)),
            of(
                free,
                rover,
                6,
                4.0,
                cost=Cost(effort=1.0, effort_matrix=[[2.0, 0.3], [0.3, 0.5]]),  # type: ignore[arg-type]
                horizon=Horizon(time=9.0),
            ),
        ],
        quick=2,
    )
    yield from numbered(
        "goals",
        [
            of(
                free, shepp, 0, 4.0, goal=[Goal(pose=pose([70, j], 5.0)) for j in range(3)]
            ),
            of(free, shepp, 1, 4.0, goal=Goal(pose=[2.0, 3.0, 0.0], free_heading=True)),
            of(free, rover, 2, 4.0, goal=Goal(pose=[-2.0, 1.0, 0.0], free_heading=True)),
            of(
                free, scenes.dubins(1.0), 3, 4.0,
                goal=Goal(pose=[-3.0, 0.5, 0.0], free_heading=True),
            ),
            of(
                free, rover, 4, 4.0,
                goal=[Goal(pose=pose([71, j], 4.0), free_heading=bool(j)) for j in range(2)],
            ),
            of(free, rover, 5, 4.0, goal=Goal(pose=[2.0, 1.0, 0.5], tolerance_m=0.1)),
            of(free, rover, 6, 4.0, goal=[0.0, 0.0, 0.0]),
            of(free, rover, 7, 4.0, goal=[0.0, 0.0, 4.0 * math.pi]),
        ],
        quick=2,
    )  # fmt: skip
    yield from numbered(
        "bounds",
        [of(free, shepp, k, 3.0, bounds=Bounds(x=(-4.0, 4.0), y=(-3.5, 3.5))) for k in range(3)]
        + [of(free, shepp, 3, 3.0, goal=[9.0, 0.0, 0.0], bounds=Bounds(x=(-4.0, 4.0)))],
        quick=1,
    )
    yield from numbered(
        "methods",
        [
            of(free, shepp, k, 5.0, search=SearchSettings(method=method))
            for k in range(2)
            for method in ("lattice", "insertion")
        ]
        + [of(free, shepp, 0, 5.0, search=SearchSettings(method="words"),
              horizon=Horizon(max_trims=4))],
        quick=0,
    )  # fmt: skip


def _in_tight_places() -> Iterator[Scene]:
    of = functools.partial
    yield from numbered(
        "slot", [of(scenes.parallel_slot, length) for length in scenes.SLOTS], quick=0
    )
    yield from numbered("bay", [of(scenes.bay, *sizes) for sizes in scenes.BAYS], quick=1)
    yield from numbered(
        "corridor", [of(scenes.corridor, wide) for wide in scenes.CORRIDORS], quick=1
    )
    yield from numbered("room", [of(_query, k) for k in range(8)], quick=1)
    yield from numbered(
        "field", [of(scenes.field_query, 40.0, 25.0, seed=seed) for seed in range(3)], quick=1
    )


@functools.cache
def _queries() -> list[Problem]:
    return scenes.room_queries(8)


def _query(number: int) -> Problem:
    return _queries()[number]


def _among_obstacles() -> Iterator[Scene]:
    of = functools.partial
    arounds = [
        of(among, 0, footprint=Disc(0.35)),
        of(among, 1, footprint=FORKLIFT),
        of(among, 2, footprint=LETTER_L),
        of(among, 3, footprint=()),
        of(among, 4, margin=0.15),
        of(among, 5, automaton=scenes.reeds_shepp(1.0)),
        of(among, 6, automaton=scenes.dubins(0.8), count=9),
        of(among, 7, automaton=robot(TABLE_2)),
        of(among, 8, automaton=platform()),
        of(among, 9, automaton=boat(), count=8),
        of(among, 10, automaton=grid(7, 1.0)),
        of(among, 11, automaton=steering_car(), count=6, footprint=Box([1.5, 0.8])),
        of(among, 12, more=[Disc(0.7, [0.0, 1.5]), Polygon([[1, -3], [3, -3], [2, -1]])]),
        of(among, 13, footprint=FORKLIFT, automaton=scenes.reeds_shepp(0.8)),
    ]
    yield from numbered("obstacles", arounds, quick=1)
    effort = Cost(effort=1.0)
    limited = [
        of(among, 20, horizon=Horizon(max_trims=9)),
        of(among, 21, horizon=Horizon(min_coast=0.15)),
        of(among, 22, horizon=Horizon(max_time=25.0), cost=effort),
        of(among, 23, horizon=Horizon(time=30.0), cost=effort),
        of(among, 24, horizon=Horizon(time=24.0), cost=Cost(effort=1.0, norm=0.5)),
        of(among, 25, bounds=Bounds(x=(-7.0, 7.0), y=(-2.5, 2.5))),
        of(among, 26, cost=Cost(time=1.0, switch=0.4)),
        of(among, 27, cost=Cost(time=1.0, direction_change=2.0), automaton=scenes.reeds_shepp(1.0)),
        of(among, 28, cost=Cost(length=1.0, time=0.1)),
        of(among, 29, cost=Cost(norm=1.0)),
        of(among, 30, cost=Cost(time=1.0, switch=24.0)),
        of(among, 31, horizon=Horizon(max_time=9.0)),
        of(among, 32, horizon=Horizon(max_trims=2)),
    ]
    yield from numbered("limits", limited, quick=2)
    goals = [
        of(among, 40, goal=Goal(pose=[6.0, 1.0, 0.0], free_heading=True)),
        of(among, 41, goal=Goal(pose=[5.0, -2.0, 0.0], free_heading=True),
           automaton=scenes.reeds_shepp(1.0)),
        of(among, 42, goal=[Goal(pose=[6.0, 3.0 * j, 1.0 * j]) for j in (-1, 0, 1)]),
        of(among, 43, goal=[Goal(pose=[6.0, 3.0, 0.0], free_heading=True), Goal(pose=[5, -3, 2])]),
        of(among, 44, goal=Goal(pose=[6.0, 0.0, 0.0], tolerance_m=0.2, tolerance_rad=0.2)),
        of(among, 45, goal=Goal(pose=[6.0, 0.0, 0.0], trim="ahead")),
    ]  # fmt: skip
    yield from numbered("goals among obstacles", goals, quick=1)
    yield from numbered(
        "moving",
        [
            *(of(scenes.moving_scene, seed) for seed in range(6)),
            *(of(crossing, seed) for seed in range(3)),
            of(crossing, 3, start_time=4.0),
            of(crossing, 4, automaton=scenes.dubins(0.8)),
            of(crossing, 5, more=boxes(5, 6, 5.0, clear=[[-6, 0], [7, 0.5]])),
            of(crossing, 6, goal=Goal(pose=[7.0, 0.0, 0.0], free_heading=True)),
            of(crossing, 7, cost=Cost(length=1.0, time=0.1, switch=0.05)),
            of(crossing, 8, horizon=Horizon(max_time=40.0), footprint=SMALL_BOX),
            of(crossing, 9, horizon=Horizon(time=30.0), cost=effort),
        ],
        quick=2,
    )
    yield from numbered(
        "map",
        [
            *(of(depot, seed) for seed in range(4)),
            of(depot, 4, margin=0.05, footprint=Disc(0.3)),
        ],
        quick=1,
    )
    zones = [
        of(strip, 0, max_speed=0.5),
        of(strip, 1, max_speed=0.5),
        of(strip, 2, reverse=False),
        of(strip, 3, max_lateral_acceleration=0.5),
        of(strip, 4, trims=("slow", "rest")),
    ]
    yield from numbered("zones", zones, quick=1)


def _random() -> Iterator[Scene]:
    """Any vehicle, body and clutter; a few whose start or goal is blocked, and odd ones."""
    seeds = (0, 1, 2, 3, 5, 6, 9, 19, 29, 39, 49, 59, 69, 79, 89, *RANDOM_FREE)
    for seed in seeds:
        yield Scene(
            f"random/{seed}",
            functools.partial(scenes.random_scene, seed),
            quick=seed in (2, 3, 19),
        )


RANDOM_FREE = (13, 14, 20, 21, 22, 23, 25, 26, 27, 30, 31, 34, 36, 37, 40)


@functools.cache
def all_kinematic() -> dict[str, Scene]:
    """The kinematic scenes by their names."""
    return {scene.name: scene for scene in kinematic()}

"""Problems of vehicles with inertia: the clock decides what is found, so costs alone are kept.

Polishing goes by the clock, hence what is kept is the cheapest of several runs.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.library import load_stock_library
from maneuver_automaton.collision import Box, Disc, Motion, Obstacle, Zone
from maneuver_automaton.costs import Cost
from maneuver_automaton.problem import Bounds, Goal, Horizon, Problem, SearchSettings
from tests.goldens.scenes import SCENARIOS, WITH_INERTIA, Scene, pose, scenario
from tests.inertia import CAR, car_automaton, resting, unicycle_automaton
from tests.search.automata import inertial_unicycle, truck_with_trailer

EXPANSIONS = 20_000
MORE_EXPANSIONS = 100_000  # of the scenario that finds nothing with fewer
LIMIT = 30.0  # [s] searches and polishing mostly end by themselves, long before it
LONGER = {"scenario/helicopter_city": 15.0}

stock = functools.cache(load_stock_library)
SIZES = {  # [m] how far a vehicle is sent, and its body
    "second_order_unicycle": (3.0, Box([0.5, 0.25])),
    "second_order_car": (14.0, Box([4.689, 1.942], [1.4155, 0.0])),
    "car_with_trailer": (14.0, Box([4.2, 1.8], [0.9, 0.0])),
    "hovercraft": (8.0, Box([1.2, 0.8])),
    "single_track": (70.0, Box([4.5, 1.6])),
    "helicopter": (50.0, Disc(2.5)),
}
ENDS = {"single_track": "speed 20, turn_rate 0", "helicopter": "speed 0, turn_rate 0, climb 0"}


def sent(name: str, seed: int, *, blocked: bool = False, **changed) -> Problem:
    """A vehicle of a stock library to a pose by a seed, past a box if `blocked`."""
    library = stock(name)
    size, body = SIZES[name]
    dof, trim = library.model.group.dof, ENDS.get(name)
    rng = np.random.default_rng([3, seed])
    aside = 0.05 if name == "single_track" else 0.4
    ahead = [rng.uniform(0.8, 1.2), rng.uniform(-aside, aside), rng.uniform(-1.0, 1.0)]
    goal = np.array([ahead[0] * size, ahead[1] * size, ahead[2] if trim is None else 0.0])
    start = np.zeros(dof)
    if dof == 4:
        start[3], goal = 10.0, np.append(goal, 14.0)
    obstacles = []
    if blocked:
        wide = 0.12 if name == "single_track" else 0.3
        obstacles = [Box([0.1 * size, wide * size], [0.5 * size, 0.1 * wide * size])]
    settings = {"obstacles": obstacles, "footprint": body} | changed
    aim = settings.pop("goal", Goal(pose=goal, trim=trim))
    return Problem(library, start, aim, start_trim=trim, **settings)


def robot(seed: int, *, automaton: Automaton | None = None, **changed) -> Problem:
    """The second-order unicycle of the tests, 4 to 6 m ahead."""
    goal = changed.pop("goal", None)
    if goal is None:
        goal = np.add(pose([21, seed], 2.0), [5.0, 0.0, 0.0])
    return Problem(automaton or unicycle_automaton(), [0.0, 0.0, 0.0], goal, **changed)


def slot() -> Problem:
    """The slot of TPCAP for a car that stops and steers."""
    slot = (
        Box([4.689, 1.942], [-5.0, 0.0]),
        Box([4.689, 1.942], [8.0, 0.0]),
        Box([20.0, 0.4], [1.5, -1.5]),
    )
    body = Box([4.689, 1.942], [1.4155, 0.0])
    return Problem(resting(CAR), [-1.0, 3.0, 0], [0, 0, 0], obstacles=slot, footprint=body)


def _inertia() -> Iterator[Scene]:
    of = functools.partial
    for name in SIZES:
        for seed in range(2):
            yield _scene(f"{name}/free/{seed}", of(sent, name, seed))
        for seed in range(2):
            yield _scene(f"{name}/box/{seed}", of(sent, name, seed, blocked=True))
    effort = Cost(time=1.0, effort=0.3)
    crossing = Obstacle(Disc(0.4), motion=Motion([0.0, 8.0], [[2.5, -3.0, 0.0], [2.5, 3.0, 0.0]]))
    beside = [Box([0.5, 1.5], [2.5, 0.5])]
    yield from (
        _scene(f"robot/{name}", make, name == "moving")
        for name, make in {
            "time": of(robot, 0),
            "effort": of(robot, 1, cost=effort),
            "length": of(robot, 2, cost=Cost(length=1.0, time=0.1)),
            "switch": of(robot, 3, cost=Cost(time=1.0, switch=0.5)),
            "max_time": of(robot, 4, horizon=Horizon(max_time=30.0)),
            "time fixed": of(robot, 5, horizon=Horizon(time=20.0)),
            "max_trims": of(robot, 6, horizon=Horizon(max_trims=4)),
            "goals": of(robot, 7, goal=[Goal(pose=pose([22, k], 4.0)) for k in range(3)]),
            "heading free": of(robot, 8, goal=Goal(pose=[3.0, 2.0, 0.0], free_heading=True)),
            "moving trims": of(
                robot, 9, goal=Goal(pose=[8.0, 1.5, 0.0], trim="1, 0"), start_trim="1, 0"
            ),
            "box": of(robot, 10, obstacles=beside, footprint=Box([0.4, 0.3])),
            "bounds": of(robot, 11, bounds=Bounds(y=(-2.5, 2.5)), obstacles=beside),
            "moving": of(robot, 12, obstacles=[crossing], footprint=Disc(0.3)),
            "zone": of(robot, 13, zones=[Zone(shape=Box([1.0, 20.0], [2.5, 0.0]), max_speed=0.9)]),
            "grid": of(robot, 14, automaton=inertial_unicycle()),
            "margin": of(robot, 15, obstacles=beside, footprint=Disc(0.2), margin=0.2),
        }.items()
    )
    yield _scene("car/free", of(robot, 16, automaton=car_automaton(), goal=[9.0, 4.0, 1.0]))
    yield _scene(
        "car/moving trims",
        of(
            robot,
            17,
            automaton=car_automaton(),
            goal=Goal(pose=[15.0, 3.0, 0.0], trim="2, 0"),
            start_trim="2, 0",
        ),
    )
    yield _scene("truck/free", of(_truck, [4.0, 1.0, 0.6]))
    yield _scene("truck/box", of(_truck, [4.0, 0.5, 0.0], obstacles=[Box([0.3, 0.8], [2.0, 0.0])]))
    yield _scene("slot", slot)
    for path in sorted(SCENARIOS.glob("*.yaml")):
        if path.stem in WITH_INERTIA:
            yield _scene(f"scenario/{path.stem}", of(scenario, path))


def _truck(goal, **changed) -> Problem:
    return Problem(
        truck_with_trailer(),
        [0.0, 0.0, 0.0],
        Goal(pose=goal, trim="0 at 0.00"),
        start_trim="0 at 0.00",
        footprint=Box([0.3, 0.2]),
        parts={"trailer": Box([0.3, 0.2])},
        **changed,
    )


def _scene(name: str, make, quick: bool = False) -> Scene:
    def limited() -> Problem:
        problem = make()
        most = MORE_EXPANSIONS if name == "scenario/helicopter_city" else EXPANSIONS
        search: SearchSettings = replace(problem.search, max_expansions=most)
        return replace(problem, search=search)

    return Scene(name, limited, quick=quick, time_limit=LONGER.get(name, LIMIT))


@functools.cache
def all_with_inertia() -> dict[str, Scene]:
    """The scenes of vehicles with inertia by their names."""
    return {scene.name: scene for scene in _inertia()}

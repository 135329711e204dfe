"""Closed loops whose steps are kept as data: value of every step, guarantees, the goal reached."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import maneuver_automaton as ma
from maneuver_automaton.collision import Box, Disc, Zone
from maneuver_automaton.costs import Cost
from maneuver_automaton.problem import Goal, Horizon, Problem, SearchSettings
from maneuver_automaton.receding_horizon import ClosedLoop, Disturbance, simulate
from tests.goldens.inertia import sent
from tests.goldens.scenes import SCENARIOS, glider, grid, platform, strip
from tests.inertia import car_automaton, unicycle_automaton
from tests.receding_horizon.loops import NEAR, parking_loop, straight
from tests.receding_horizon.scenes import among, crossing, door, moving_obstacle, on_the_goal
from tests.scenes import reeds_shepp

WORK = SearchSettings(max_expansions=800)
NOISE = Disturbance(position_m=0.02, heading_rad=0.02, seed=1)
BLURRED = Disturbance(measured_position_m=0.01, measured_heading_rad=0.01, seed=2)
LITTLE = Disturbance(position_m=0.004, heading_rad=0.004, seed=0)
LIMIT, LONG = 4.0, 10.0  # [s] for one step of a loop with inertia
FREE_GOAL = Goal(pose=[6.0, 0.0, 0.0], free_heading=True, tolerance_m=0.1, tolerance_rad=0.1)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Loop:
    """A closed loop of a name."""

    name: str
    make: Callable[[], Problem]
    step: float = 1.0  # [s]
    time_limit: float = 60.0  # [s] for one step, so that the clock decides nothing
    steps: int = 30
    options: Mapping[str, Any] = field(default_factory=dict)
    quick: bool = False
    inertia: bool = False

    def run(self) -> ClosedLoop:
        """The loop, driven to its end; with inertia, as when it was recorded, by the clock alone.

        What `max_expansions` counts has become more since then: words with maneuvers count, too.
        """
        problem = self.make()
        if not self.inertia:
            problem = replace(problem, search=replace(WORK, method=problem.search.method))
        return simulate(
            problem, step=self.step, steps=self.steps, time_limit=self.time_limit, **self.options
        )


def _kinematic() -> Iterator[Loop]:
    of = functools.partial
    noise, late = {"disturbance": NOISE}, {"disturbance": replace(NOISE, delay=1)}
    pushed = {"disturbance": Disturbance(pushes={2: (0.1, 0.05, 0.2)})}
    slow = {"disturbance": Disturbance(twist_scale=(0.95, 1.0, 1.02))}
    seen = {"disturbance": BLURRED}
    box = Box([0.5, 2.0], [3.0, 0.4])
    yield Loop(name="parking", make=parking_loop, quick=True)
    yield Loop(name="parking, half steps", make=parking_loop, step=0.5)
    yield Loop(name="parking, free time", make=of(parking_loop, horizon=Horizon(max_trims=4)))
    yield Loop(name="parking, noise", make=of(parking_loop, goal=NEAR), options=noise, quick=True)
    yield Loop(name="parking, staying", make=of(parking_loop, goal=NEAR), steps=14,
               options=noise | {"stay": True})  # fmt: skip
    yield Loop(name="parking, delay", make=of(parking_loop, goal=NEAR), options=late)
    yield Loop(name="parking, pushed", make=of(parking_loop, goal=NEAR), options=pushed)
    yield Loop(name="parking, slower", make=of(parking_loop, goal=NEAR), options=slow)
    yield Loop(name="parking, blurred", make=of(parking_loop, goal=NEAR), options=seen)
    yield Loop(name="straight", make=of(straight, 2.0), step=0.5, quick=True)
    yield Loop(name="straight, retimed", make=of(straight, 2.0), options={"retimed": True},
               step=0.5)  # fmt: skip
    one_second = Horizon(time=1.0)
    for steps, quick in ((4, True), (10, False)):
        yield Loop(
            name=f"grid of 1681, {steps} steps",
            make=of(_over_grid, one_second),
            step=0.1,
            steps=steps,
            quick=quick,
        )
    yield Loop(name="grid of 1681, free time", make=of(_over_grid, Horizon()), step=0.25, steps=8)
    yield Loop(name="reeds and shepp", make=of(_over, reeds_shepp, [3.0, 2.0, 1.0]), step=1.0)
    yield Loop(name="platform", make=of(_over, platform, [2.0, -1.0, 0.5]), step=0.5)
    yield Loop(
        name="glider",
        make=lambda: Problem(glider(), [0, 0, 0, 0], [120.0, 20.0, 0.0, -5.0]),
        step=2.0,
        steps=10,
    )
    yield Loop(name="box", make=of(among, box), step=0.5, quick=True)
    yield Loop(name="box, noise", make=of(among, box, goal=FREE_GOAL), options=noise, step=0.5)
    yield Loop(name="box, one heading", make=of(among, box, goal=Goal(pose=[6.0, 0, 0])), step=0.5)
    yield Loop(name="crossing", make=lambda: among(crossing()), step=0.5, quick=True)
    yield Loop(name="crossing, noise", make=lambda: among(crossing(), goal=FREE_GOAL),
               options=noise, step=0.5)  # fmt: skip
    yield Loop(name="crossing, unseen", make=lambda: among(crossing()), step=0.5,
               options={"obstacles": _unseen})  # fmt: skip
    yield Loop(name="on the goal", make=lambda: among(on_the_goal(5.0)), step=0.5)
    yield Loop(name="door", make=lambda: among(*door(4.0)), step=0.5)
    yield Loop(
        name="overtaken",
        make=lambda: among(moving_obstacle([0.0, 8.0], [(-3.0, 0.2), (5.0, 0.2)])),
        step=0.5,
    )
    yield Loop(name="cost of effort", make=lambda: among(box, cost=Cost(time=1.0, effort=0.5)),
               step=0.5)  # fmt: skip


def _with_inertia() -> Iterator[Loop]:
    of = functools.partial
    noise = {"disturbance": LITTLE}
    near = Goal(pose=[3.0, 1.0, 1.0], tolerance_m=0.06, tolerance_rad=0.06)
    posed = functools.partial(Problem, unicycle_automaton(), [0.0, 0.0, 0.0])
    loops = [
        Loop(name="robot", make=of(posed, [3.0, 1.0, 1.0]), step=0.5, quick=True),
        Loop(name="robot, noise", make=of(posed, near), step=0.25, options=noise, steps=60),
        Loop(
            name="robot, mixed cost",
            make=of(posed, [3.0, 1.0, 1.0], cost=Cost(time=1.0, length=0.5, effort=0.1)),
            step=0.5,
        ),
        Loop(
            name="robot, max_time",
            make=of(posed, [3.0, 2.0, 0.0], horizon=Horizon(max_time=12.0)),
            step=0.5,
        ),
        Loop(
            name="robot, box",
            make=of(posed, [5.0, 0.0, 0.0], obstacles=[Box([0.5, 1.5], [2.5, 0.4])],
                    footprint=Disc(0.2)),
            step=0.5,
        ),
        Loop(
            name="robot, zone",
            make=of(posed, [5.0, 0.0, 0.0],
                    zones=[Zone(shape=Box([1.0, 20.0], [2.5, 0.0]), max_speed=0.9)]),
            step=1.0,
        ),
        Loop(
            name="car",
            make=lambda: Problem(car_automaton(), [0, 0, 0], [7.0, 2.0, 0.5]),
            step=0.5,
        ),
        Loop(name="hovercraft", make=of(sent, "hovercraft", 0), step=1.0),
        Loop(name="helicopter", make=of(sent, "helicopter", 0), step=2.0),
        Loop(name="lane change", make=of(_scenario, "lane_change"), step=0.5, steps=4),
        Loop(name="kinematic in a zone", make=of(strip, 0, max_speed=0.5), step=1.0),
    ]  # fmt: skip
    for loop in loops:
        limit = LONG if loop.name in ("hovercraft", "helicopter") else LIMIT
        yield replace(loop, name=f"inertia/{loop.name}", inertia=True, time_limit=limit)


def _over_grid(horizon: Horizon) -> Problem:
    cost = Cost(effort=1.0) if horizon.time else Cost(effort=0.5, time=1.0)
    return Problem(grid(), [-2.0, 0.3, 0.2], [0.0, 0.0, 0.0], cost=cost, horizon=horizon)


def _over(library, goal) -> Problem:
    return Problem(library(), [0.0, 0.0, 0.0], goal)


def _scenario(name: str) -> Problem:
    return ma.load_scenario(SCENARIOS / f"{name}.yaml").problem


def _unseen(number: int):
    """Nothing is seen for two steps, then what crosses."""
    return [] if number < 2 else [crossing()]


@functools.cache
def all_loops() -> dict[str, Loop]:
    """The loops by their names."""
    return {loop.name: loop for loop in (*_kinematic(), *_with_inertia())}

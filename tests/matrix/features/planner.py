"""Features of a planner that is made once and asked often."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from maneuver_automaton.collision import Box, Obstacle, Zone
from maneuver_automaton.planning import Planner
from tests.matrix.measuring import TIME_LIMIT, found, found_cost, no_dearer, obeys
from tests.matrix.rows import Engine, feature, without
from tests.matrix.scenes import base, midway, pillar, slow_speed
from tests.matrix.vehicles import Vehicle


@feature(without("obstacles"), says="clearance")
def planner(vehicle: Vehicle, engine: Engine) -> None:
    """Used again, for other ends and another map, it gives the plans of `plan`."""
    common: dict[str, Any] = {"footprint": vehicle.footprint, "search": vehicle.problem().search}
    if vehicle.end_trim:
        common["start_trim"] = vehicle.end_trim
    ready = engine.planner(vehicle.automaton, obstacles=[pillar(vehicle)], **common)
    start = np.zeros(len(vehicle.goal))
    blocked = vehicle.problem(parts={}, obstacles=[pillar(vehicle)])
    first = ready.plan(start, vehicle.target(), time_limit=TIME_LIMIT)
    obeys(replace(vehicle, parts={}), blocked, found(first))
    clear = ready.with_obstacles([]).plan(start, vehicle.target(), time_limit=TIME_LIMIT)
    no_dearer(clear, base(vehicle).cost, "the same plan without a planner", share=1e-2)
    again = ready.plan(start, vehicle.target(), time_limit=TIME_LIMIT)
    no_dearer(again, found_cost(first), "the first answer", share=1e-2)


def _short_of_words(
    automaton: Any, *, obstacles: Any, footprint: Any, search: Any, **_: Any
) -> Any:
    """A planner to which zones, parts, start trims and heights mean nothing."""
    return Planner(automaton, obstacles=obstacles, footprint=footprint, search=search)


@feature(Engine(planner=_short_of_words), on="car", says="m/s in a zone")
def planner_with_all(vehicle: Vehicle, engine: Engine) -> None:
    """It takes parts, zones, a start trim and the height of the body."""
    zone = Zone(
        shape=Box([1.5 * vehicle.size] * 2, midway(vehicle)[:2]), max_speed=slow_speed(vehicle)
    )
    bridge = Obstacle(pillar(vehicle), height=(1e3, 1e3 + 1.0))
    changes: dict[str, Any] = {"zones": [zone], "obstacles": [bridge], "body_height": (0.0, 1.0)}
    ready = engine.planner(
        vehicle.automaton,
        footprint=vehicle.footprint,
        search=vehicle.problem().search,
        parts=vehicle.parts,
        start_trim=vehicle.end_trim,
        **changes,
    )
    result = ready.plan(np.zeros(len(vehicle.goal)), vehicle.target(), time_limit=TIME_LIMIT)
    obeys(vehicle, vehicle.problem(**changes), found(result))

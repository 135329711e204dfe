"""Problems of dynobench: a YAML file with a world of boxes, and robots that name their models.

`environment.min` and `max` bound the position of a robot, whose body may stick out. The model is
`TYPE.yaml` in a folder `models` above the file, or built in; see `dynobench_models`. Several robots
are a fleet: each has a problem of its own, and they keep apart.

Source: Ortiz-Haro et al. (2023), *iDb-A-star: Iterative Search and Optimization for Optimal
Kinodynamic Motion Planning*, arXiv 2311.03553, and the files of its benchmark. With several robots:
Moldagalieva et al. (2024), *db-CBS: Discontinuity-Bounded Conflict-Based Search for Multi-Robot
Kinodynamic Motion Planning*, arXiv 2309.16445, and its examples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeAlias

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._limits import MOST_HEADING
from maneuver_automaton.collision import Box, Obstacle
from maneuver_automaton.formats.dynobench_models import (
    StatedModel,
    dynobench_model,
    pose_and_state,
)
from maneuver_automaton.formats.statement import StatedVehicle, Statement
from maneuver_automaton.formats.yaml_source import Document, Where, shown
from maneuver_automaton.formats.yaml_values import numbers_at, sizes_at, value_at
from maneuver_automaton.problem import Bounds


def is_dynobench(document: Document) -> bool:
    """Whether a YAML file is a problem of dynobench."""
    value = document.value
    return isinstance(value, dict) and "robots" in value and "schema" not in value


def belongs_to_dynobench(document: Document) -> bool:
    """Whether a YAML file is a model or a solution of dynobench, which states no problem."""
    keys = document.value.keys() if isinstance(document.value, dict) else set()
    return "schema" not in keys and ("dynamics" in keys or {"states", "actions"} <= keys)


def read_dynobench(path: Path, document: Document) -> tuple[Statement, ...]:
    """The problem of a file, its vehicle included; or its fleet, if it has several robots.

    Raises
    ------
    InvalidScenario
        If a key is missing or holds what it may not, or a model is none that is read.
    """
    robots = value_at(document, ("robots",), list, "a list of robots")
    if not robots:
        raise document.error(("robots",), "got no robot, need at least one")
    models = [dynobench_model(path, document, robot=k) for k in range(len(robots))]
    low = numbers_at(document, ("environment", "min"), 2, "[x, y]")
    high = numbers_at(document, ("environment", "max"), 2, "[x, y]")
    for k, name in enumerate("xy"):
        if not low[k] < high[k]:
            raise document.error(
                ("environment", "max", k), f"got {high[k]:g}, need more than min {name}, {low[k]:g}"
            )
    boxes = value_at(document, ("environment", "obstacles"), list, "a list of boxes")
    ends = [_ends(document, k, model) for k, model in enumerate(models)]
    vehicles = _vehicles(models, ends)
    for k, vehicle in enumerate(vehicles):
        for what, (_, state) in ends[k].items():
            _check_state(document, k, what, state, vehicle)
    name = document.value.get("name")
    world = Statement(
        format="dynobench",
        name=name if isinstance(name, str) and name.strip() else path.stem,
        obstacles=tuple(_obstacle(document, k) for k in range(len(boxes))),
        bounds=Bounds(x=(low[0], high[0]), y=(low[1], high[1])),
    )
    alone = [_with_robot(world, vehicle, its) for vehicle, its in zip(vehicles, ends, strict=True)]
    if len(alone) == 1:
        return (alone[0],)
    names = [f"robot {k + 1}" for k in range(len(alone))]
    fleet = (replace(one, name=name) for one, name in zip(alone, names, strict=True))
    return (replace(world, fleet=tuple(fleet)),)


Ends: TypeAlias = dict[str, tuple[Array, Array]]
"""Pose and reduced state of start and goal."""


def _with_robot(world: Statement, vehicle: StatedVehicle, ends: Ends) -> Statement:
    """The problem of one robot alone."""
    (start, start_state), (goal, goal_state) = ends.values()
    return replace(
        world,
        start=start,
        goal=goal,
        start_state=start_state,
        goal_state=goal_state,
        footprint=vehicle.footprint,
        vehicle=vehicle,
    )


def _vehicles(models: Sequence[StatedModel], ends: Sequence[Ends]) -> list[StatedVehicle]:
    """The vehicle of every robot: one value for all of a model with trims at the same states."""
    made: dict[tuple[str, bytes], StatedVehicle] = {}
    vehicles = []
    for model, its in zip(models, ends, strict=True):
        states = [state for _, state in its.values()]
        key = (model.name, np.unique(np.array(states) + 0.0, axis=0).tobytes())
        if key not in made:
            made[key] = model.vehicle(states)
        vehicles.append(made[key])
    return vehicles


def _ends(document: Document, robot: int, model: StatedModel) -> Ends:
    return {what: _end(document, robot, what, model) for what in ("start", "goal")}


def _end(document: Document, robot: int, what: str, model: StatedModel) -> tuple[Array, Array]:
    """Pose and reduced state of the start or the goal."""
    need, where = model.ends, ("robots", robot, what)
    numbers = numbers_at(document, where, need.count(",") + 1, need)
    if abs(numbers[2]) > MOST_HEADING:
        raise document.error(
            (*where, 2), f"got the heading {numbers[2]:g}, need at most {MOST_HEADING:g} rad"
        )
    return pose_and_state(model.dynamics, numbers)


def _check_state(
    document: Document, robot: int, what: str, state: Array, vehicle: StatedVehicle
) -> None:
    """The reduced state of the start or the goal is within the limits."""
    model = vehicle.automaton.model
    rows = zip(model.reduced_names, state.tolist(), model.reduced_limits.tolist(), strict=True)
    for name, value, (low, high) in rows:
        if not low <= value <= high:
            raise document.error(
                ("robots", robot, what), f"got the {name} {value:g}, need {low:g} to {high:g}"
            )


def _obstacle(document: Document, k: int) -> Obstacle:
    where: Where = ("environment", "obstacles", k)
    kind = value_at(document, (*where, "type"), str, "box")
    if kind != "box":
        raise document.error((*where, "type"), f"got {shown(kind)}, need box")
    center = numbers_at(document, (*where, "center"), 2, "[x, y]")
    size = sizes_at(document, (*where, "size"))
    return Obstacle(Box(size, center), name=f"obstacle {k + 1}")

"""Problems of dynobench: a YAML file with a world of boxes, and a robot that names its model.

`environment.min` and `max` bound the position of the robot, whose body may stick out. The model is
`TYPE.yaml` in a folder `models` above the file, or built in; see `dynobench_models`.

Source: Ortiz-Haro et al. (2023), *iDb-A-star: Iterative Search and Optimization for Optimal
Kinodynamic Motion Planning*, arXiv 2311.03553, and the files of its benchmark.
"""

from __future__ import annotations

from pathlib import Path

from maneuver_automaton._arrays import Array
from maneuver_automaton._ceilings import MOST_HEADING
from maneuver_automaton.collision import Box, Obstacle
from maneuver_automaton.formats.dynobench_models import (
    StatedModel,
    dynobench_model,
    numbers_at,
    pose_and_state,
    sizes_at,
    value_at,
)
from maneuver_automaton.formats.statement import StatedVehicle, Statement
from maneuver_automaton.formats.yaml_source import Document, Where, shown
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
    """The problem of a file, its vehicle included.

    Raises
    ------
    InvalidScenario
        If a key is missing or holds what it may not, or the model is none that is read.
    """
    robots = value_at(document, ("robots",), list, "a list of one robot")
    if len(robots) != 1:
        raise document.error(("robots",), f"got {len(robots)} robots, need one")
    model = dynobench_model(path, document)
    low = numbers_at(document, ("environment", "min"), 2, "[x, y]")
    high = numbers_at(document, ("environment", "max"), 2, "[x, y]")
    for k, name in enumerate("xy"):
        if not low[k] < high[k]:
            raise document.error(
                ("environment", "max", k), f"got {high[k]:g}, need more than min {name}, {low[k]:g}"
            )
    boxes = value_at(document, ("environment", "obstacles"), list, "a list of boxes")
    ends = {what: _end(document, what, model) for what in ("start", "goal")}
    vehicle = model.vehicle([state for _, state in ends.values()])
    for what, (_, state) in ends.items():
        _check_state(document, what, state, vehicle)
    (start, start_state), (goal, goal_state) = ends.values()
    name = document.value.get("name")
    return (
        Statement(
            format="dynobench",
            name=name if isinstance(name, str) and name.strip() else path.stem,
            obstacles=tuple(_obstacle(document, k) for k in range(len(boxes))),
            start=start,
            goal=goal,
            start_state=start_state,
            goal_state=goal_state,
            bounds=Bounds(x=(low[0], high[0]), y=(low[1], high[1])),
            footprint=vehicle.footprint,
            vehicle=vehicle,
        ),
    )


def _end(document: Document, what: str, model: StatedModel) -> tuple[Array, Array]:
    """Pose and reduced state of the start or the goal."""
    need = model.ends
    numbers = numbers_at(document, ("robots", 0, what), need.count(",") + 1, need)
    if abs(numbers[2]) > MOST_HEADING:
        raise document.error(
            ("robots", 0, what, 2),
            f"got the heading {numbers[2]:g}, need at most {MOST_HEADING:g} rad",
        )
    return pose_and_state(model.dynamics, numbers)


def _check_state(document: Document, what: str, state: Array, vehicle: StatedVehicle) -> None:
    """The reduced state of the start or the goal is within the limits."""
    model = vehicle.automaton.model
    rows = zip(model.reduced_names, state.tolist(), model.reduced_limits.tolist(), strict=True)
    for name, value, (low, high) in rows:
        if not low <= value <= high:
            raise document.error(
                ("robots", 0, what), f"got the {name} {value:g}, need {low:g} to {high:g}"
            )


def _obstacle(document: Document, k: int) -> Obstacle:
    where: Where = ("environment", "obstacles", k)
    kind = value_at(document, (*where, "type"), str, "box")
    if kind != "box":
        raise document.error((*where, "type"), f"got {shown(kind)}, need box")
    center = numbers_at(document, (*where, "center"), 2, "[x, y]")
    size = sizes_at(document, (*where, "size"))
    return Obstacle(Box(size, center), name=f"obstacle {k + 1}")

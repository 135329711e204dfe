"""Problems of dynobench: a YAML file with a world of boxes, and robots that name their models.

`environment.min` and `max` bound the position of a robot, whose body may stick out. The model is
`TYPE.yaml` in a folder `models` above the file, or built in: a unicycle of first or second order, a
car with one trailer. dynobench steps such a model with a fixed `dt`; here time is continuous and
motion exact. Several robots are a fleet: each has a problem of its own, and they keep apart.

Source: Ortiz-Haro et al. (2023), *iDb-A-star: Iterative Search and Optimization for Optimal
Kinodynamic Motion Planning*, arXiv 2311.03553, and the files of its benchmark. With several robots:
Moldagalieva et al. (2024), *db-CBS: Discontinuity-Bounded Conflict-Based Search for Multi-Robot
Kinodynamic Motion Planning*, arXiv 2309.16445, and its examples.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from maneuver_automaton._arrays import Array, wrapped
from maneuver_automaton._limits import MOST_HEADING
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.collision import Box, Disc, Obstacle
from maneuver_automaton.formats.statement import StatedVehicle, Statement
from maneuver_automaton.formats.text_source import read_text
from maneuver_automaton.formats.yaml_source import (
    Document,
    Where,
    number_at,
    numbers_at,
    parse,
    positive_at,
    shown,
    sizes_at,
    value_at,
)
from maneuver_automaton.models import CarWithTrailer, SecondOrderUnicycle, Unicycle
from maneuver_automaton.primitives.turning import connect_hitches, hitch_trims
from maneuver_automaton.problem import Bounds

_BODY = {"size": [0.5, 0.25], "shape": "box"}
_FIRST = {
    "dynamics": "unicycle1", "max_vel": 0.5, "min_vel": -0.5, "max_angular_vel": 0.5,
    "min_angular_vel": -0.5, **_BODY,
}  # fmt: skip
_SECOND = {"dynamics": "unicycle2", "max_acc_abs": 0.25, "max_angular_acc": 0.25}
BUILT_IN: Mapping[str, Mapping[str, Any]] = {
    "unicycle1_v0": _FIRST,
    "unicycle1_v1": _FIRST | {"min_vel": 0.25},
    "unicycle1_v2": _FIRST | {"min_vel": 0.25, "min_angular_vel": -0.25},
    "unicycle2_v0": _FIRST | _SECOND,
    "car1_v0": {
        "dynamics": "car_with_trailers",
        "num_trailers": 1,
        "l": 0.25,
        "hitch_lengths": [0.5],
        "max_vel": 0.5,
        "min_vel": -0.1,
        "max_steering_abs": 1.047198,
        **_BODY,
        "shape_trailer": "box",
        "size_trailer": [0.3, 0.25],
    },
}
_DB_CBS: Mapping[str, Mapping[str, Any]] = {  # the names of its robots, by src/robots.cpp
    "unicycle_first_order_0": BUILT_IN["unicycle1_v0"],
    "unicycle_first_order_0_sphere": _FIRST
    | {"max_angular_vel": 2.0, "min_angular_vel": -2.0, "shape": "sphere", "radius": 0.4},
    "unicycle_second_order_0": BUILT_IN["unicycle2_v0"],
    "car_first_order_with_1_trailers_0": BUILT_IN["car1_v0"],
}
_KNOWN: Mapping[str, Mapping[str, Any]] = {**BUILT_IN, **_DB_CBS}
READ = f"a unicycle or a car with one trailer such as {', '.join(_KNOWN)}"
MAX_HITCH = math.pi / 4.0  # [rad] of dynobench's car; its files do not state it
HITCHES = 7  # angles of the hitch, to both sides, that have trims
NEXT_TO = 1e-9  # [m/s, rad/s, rad] between a level and a state that is stated
LEVELS = 5  # speeds, and turn rates, that have trims
STATES: Mapping[str, str] = {  # what a start or goal holds
    "unicycle1": "[x, y, heading]",
    "unicycle2": "[x, y, heading, speed, turn rate]",
    "car_with_trailers": "[x, y, heading, heading of the trailer]",
}


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class StatedModel:
    """A model that a problem names."""

    name: str
    dynamics: str
    document: Document

    def vehicle(self, states: Sequence[Array]) -> StatedVehicle:
        """The vehicle, with trims at the reduced `states` of start and goal; or InvalidScenario."""
        return _MAKERS[self.dynamics](self.name, self.document, states)


def dynobench_model(path: Path, document: Document, *, robot: int = 0) -> StatedModel:
    """The model of a robot of a problem, by its number."""
    where: Where = ("robots", robot, "type")
    name = value_at(document, where, str, "the name of a model")
    is_name = name == Path(name).name and "\0" not in name
    above = [folder / "models" / f"{name}.yaml" for folder in path.absolute().parents if is_name]
    file = next((one for one in above if one.is_file()), None)
    if file is not None:
        model = parse(read_text(file, what="a model"), name=str(file), what="a model")
    elif name in _KNOWN:
        model = Document(name=f"the built-in model {name}", value=_KNOWN[name], lines={})
    else:
        raise document.error(
            where,
            f"got {shown(name)}, which is not built in, and there is no "
            f"{Path('models') / f'{name}.yaml'} above this file; need {READ}",
        )
    dynamics = model.value.get("dynamics") if isinstance(model.value, dict) else None
    if not isinstance(dynamics, str) or dynamics not in _MAKERS:
        raise document.error(
            where,
            f"got {shown(name)}, whose dynamics are {shown(dynamics)} ({file}), not in this "
            f"version; need {READ}",
        )
    return StatedModel(name=name, dynamics=dynamics, document=model)


def _first_order(name: str, model: Document, states: Sequence[Array]) -> StatedVehicle:
    """A unicycle with every combination of its extreme controls, and zero where it is between."""
    speeds, turns = _limits(model, "min_vel", "max_vel"), _limits(model, *_TURN_KEYS)
    body = Unicycle(max_speed=max(map(abs, speeds)), max_turn_rate=max(map(abs, turns)))
    axes = [[low, *([0.0] if low < 0.0 < high else []), high] for low, high in (speeds, turns)]
    return StatedVehicle(
        name=name,
        automaton=Automaton.of_grid(body, axes),
        limits=np.array([speeds, turns]),
        footprint=(_body(model, "size", "shape"),),
    )


def _second_order(name: str, model: Document, states: Sequence[Array]) -> StatedVehicle:
    """A unicycle with inertia: a grid of speeds and turn rates, all joined."""
    low, high = _limits(model, "min_vel", "max_vel")
    least, most = _limits(model, *_TURN_KEYS)
    if least != -most:
        raise model.error(
            ("min_angular_vel",), f"got {least:g}, need {-most:g}, the opposite of max_angular_vel"
        )
    body = SecondOrderUnicycle(
        max_speed=positive_at(model, ("max_vel",)),
        min_speed=low,
        max_turn_rate=most,
        max_acceleration=positive_at(model, ("max_acc_abs",)),
        max_angular_acceleration=positive_at(model, ("max_angular_acc",)),
    )
    stated = np.array(states).reshape(-1, 2)
    speeds = _with(np.append(np.linspace(low, high, LEVELS), 0.0), stated[:, 0])
    turns = _with(np.linspace(least, most, LEVELS), stated[:, 1])
    return StatedVehicle(
        name=name,
        automaton=Automaton.of_model(body, {"speed": speeds, "turn_rate": turns}, pairs="all"),
        limits=body.control_limits,
        footprint=(_body(model, "size", "shape"),),
    )


def _with_trailer(name: str, model: Document, states: Sequence[Array]) -> StatedVehicle:
    """A car with a trailer: trims at several angles of the hitch, joined at full steering."""
    trailers = value_at(model, ("num_trailers",), int, "1")
    if trailers != 1:
        raise model.error(("num_trailers",), f"got {trailers}, need 1")
    numbers_at(model, ("hitch_lengths",), 1, "[length of the hitch]")
    steering = positive_at(model, ("max_steering_abs",))
    if not steering < math.pi / 2.0:
        raise model.error(("max_steering_abs",), f"got {steering:g}, need less than pi / 2")
    low, _ = _limits(model, "min_vel", "max_vel")
    car = CarWithTrailer(
        wheelbase=positive_at(model, ("l",)),
        hitch_length=positive_at(model, ("hitch_lengths", 0)),
        max_steering=steering,
        max_speed=positive_at(model, ("max_vel",)),
        min_speed=low,
        max_hitch=MAX_HITCH,
    )
    hitches = _with(np.linspace(-MAX_HITCH, MAX_HITCH, HITCHES), np.array(states).ravel())
    trims = hitch_trims(car, hitches.tolist())
    return StatedVehicle(
        name=name,
        automaton=Automaton(car, trims, connect_hitches(car, trims)),
        limits=car.control_limits,
        footprint=(_body(model, "size", "shape"),),
        parts={"trailer": (_body(model, "size_trailer", "shape_trailer"),)},
    )


_TURN_KEYS = ("min_angular_vel", "max_angular_vel")
_MAKERS: Mapping[str, Callable[[str, Document, Sequence[Array]], StatedVehicle]] = {
    "unicycle1": _first_order,
    "unicycle2": _second_order,
    "car_with_trailers": _with_trailer,
}


def _with(levels: Array, values: Array) -> Array:
    """Levels and the values among them, rising; a value next to a level takes its place."""
    within = values[(values >= levels.min()) & (values <= levels.max())]
    kept = levels[(np.abs(levels[:, None] - within) > NEXT_TO).all(axis=1)]
    return np.unique(np.concatenate([kept, within])) + 0.0


def _limits(model: Document, least: str, most: str) -> tuple[float, float]:
    low, high = (number_at(model, (key,)) for key in (least, most))
    if not low < high:
        raise model.error((most,), f"got {high:g}, need more than {least}, {low:g}")
    return low, high


def _body(model: Document, size: str, shape: str) -> Box | Disc:
    kind = value_at(model, (shape,), str, "box or sphere")
    if kind == "sphere":
        return Disc(positive_at(model, ("radius",)))
    if kind != "box":
        raise model.error((shape,), f"got {shown(kind)}, need box or sphere")
    return Box(sizes_at(model, (size,)))


def read_dynobench(path: Path, document: Document) -> tuple[Statement, ...]:
    """The problem of a file, its vehicle included; or its fleet, if it has several robots."""
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
    ends = [
        {what: _end(document, k, what, model) for what in ("start", "goal")}
        for k, model in enumerate(models)
    ]
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


def _end(document: Document, robot: int, what: str, model: StatedModel) -> tuple[Array, Array]:
    need, where = STATES[model.dynamics], ("robots", robot, what)
    numbers = numbers_at(document, where, need.count(",") + 1, need)
    if abs(numbers[2]) > MOST_HEADING:
        raise document.error(
            (*where, 2), f"got the heading {numbers[2]:g}, need at most {MOST_HEADING:g} rad"
        )
    pose, rest = np.array(numbers[:3]), np.array(numbers[3:])
    return pose, wrapped(pose[2] - rest) if model.dynamics == "car_with_trailers" else rest


def _check_state(
    document: Document, robot: int, what: str, state: Array, vehicle: StatedVehicle
) -> None:
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
    return Obstacle(Box(sizes_at(document, (*where, "size")), center), name=f"obstacle {k + 1}")

"""Problems of dynobench: a YAML file with a world of boxes, and a robot that names its model.

`environment.min` and `max` bound the position of the robot, whose body may stick out. The model is
`TYPE.yaml` in a folder `models` above the file, or built in. This version reads first-order
unicycles: speed and turn rate between limits, a body that is a box centred on the pose. dynobench
steps such a model with a fixed `dt`; here time is continuous and motion exact.

Source: Ortiz-Haro et al. (2023), *iDb-A-star: Iterative Search and Optimization for Optimal
Kinodynamic Motion Planning*, arXiv 2311.03553, and the files of its benchmark.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.collision import Box, Obstacle
from maneuver_automaton.formats.statement import StatedVehicle, Statement
from maneuver_automaton.formats.text_source import FARTHEST, read_text
from maneuver_automaton.formats.yaml_source import Document, Where, parse, shown
from maneuver_automaton.models import Unicycle
from maneuver_automaton.problem import Bounds

DYNAMICS = "unicycle1"
LIMITS = (("min_vel", "max_vel"), ("min_angular_vel", "max_angular_vel"))
BUILT_IN: Mapping[str, tuple[float, float, float, float]] = {  # limits of speed, of turn rate
    "unicycle1_v0": (-0.5, 0.5, -0.5, 0.5),
    "unicycle1_v1": (0.25, 0.5, -0.5, 0.5),
    "unicycle1_v2": (0.25, 0.5, -0.25, 0.5),
}
BUILT_IN_SIZE = (0.5, 0.25)  # [m]
READ = f"first-order unicycles such as {', '.join(BUILT_IN)}"


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
    robots = _value(document, ("robots",), list, "a list of one robot")
    if len(robots) != 1:
        raise document.error(("robots",), f"got {len(robots)} robots, need one")
    vehicle = _vehicle(path, document)
    low = _numbers(document, ("environment", "min"), 2, "[x, y]")
    high = _numbers(document, ("environment", "max"), 2, "[x, y]")
    for k, name in enumerate("xy"):
        if not low[k] < high[k]:
            raise document.error(
                ("environment", "max", k), f"got {high[k]:g}, need more than min {name}, {low[k]:g}"
            )
    boxes = _value(document, ("environment", "obstacles"), list, "a list of boxes")
    start = _numbers(document, ("robots", 0, "start"), 3, "[x, y, heading]")
    goal = _numbers(document, ("robots", 0, "goal"), 3, "[x, y, heading]")
    name = document.value.get("name")
    return (
        Statement(
            format="dynobench",
            name=name if isinstance(name, str) and name.strip() else path.stem,
            obstacles=tuple(_obstacle(document, k) for k in range(len(boxes))),
            start=np.array(start),
            goal=np.array(goal),
            bounds=Bounds(x=(low[0], high[0]), y=(low[1], high[1])),
            footprint=vehicle.footprint,
            vehicle=vehicle,
        ),
    )


def _obstacle(document: Document, k: int) -> Obstacle:
    where: Where = ("environment", "obstacles", k)
    kind = _value(document, (*where, "type"), str, "box")
    if kind != "box":
        raise document.error((*where, "type"), f"got {shown(kind)}, need box")
    center = _numbers(document, (*where, "center"), 2, "[x, y]")
    size = _sizes(document, (*where, "size"))
    return Obstacle(Box(size, center), name=f"obstacle {k + 1}")


def _vehicle(path: Path, document: Document) -> StatedVehicle:
    where: Where = ("robots", 0, "type")
    name = _value(document, where, str, "the name of a model")
    file = _model_file(path, name)
    if file is None:
        if name not in BUILT_IN:
            raise document.error(
                where,
                f"got {shown(name)}, which is not built in, and there is no "
                f"{Path('models') / f'{name}.yaml'} above this file; need {READ}",
            )
        least_v, most_v, least_w, most_w = BUILT_IN[name]
        limits = ((least_v, most_v), (least_w, most_w))
        return _stated(name, limits, BUILT_IN_SIZE)
    model = parse(read_text(file, what="a model"), name=str(file), what="a model")
    dynamics = model.value.get("dynamics") if isinstance(model.value, dict) else None
    if dynamics != DYNAMICS:
        raise document.error(
            where,
            f"got {shown(name)}, whose dynamics are {shown(dynamics)} ({file}), not in this "
            f"version; need {READ}",
        )
    shape = _value(model, ("shape",), str, "box")
    if shape != "box":
        raise model.error(("shape",), f"got {shown(shape)}, need box")
    return _stated(name, tuple(_limits(model, *keys) for keys in LIMITS), _sizes(model, ("size",)))


def _model_file(path: Path, name: str) -> Path | None:
    """The nearest file of a model above a problem."""
    if name != Path(name).name or "\0" in name:
        return None
    for folder in path.absolute().parents:
        if (file := folder / "models" / f"{name}.yaml").is_file():
            return file
    return None


def _limits(model: Document, least: str, most: str) -> tuple[float, float]:
    low, high = (_number(model, (key,)) for key in (least, most))
    if not low < high:
        raise model.error((most,), f"got {high:g}, need more than {least}, {low:g}")
    return low, high


def _stated(
    name: str, limits: tuple[tuple[float, float], ...], size: tuple[float, ...]
) -> StatedVehicle:
    """The vehicle with every combination of its extreme controls, and zero where it is between."""
    model = Unicycle(max_speed=max(map(abs, limits[0])), max_turn_rate=max(map(abs, limits[1])))
    axes = [[low, *([0.0] if low < 0.0 < high else []), high] for low, high in limits]
    return StatedVehicle(
        name=name,
        automaton=Automaton.of_grid(model, axes),
        limits=np.array(limits),
        footprint=(Box(size),),
    )


def _value(document: Document, where: Where, kind: Any, need: str) -> Any:
    """The value at a place, of a kind."""
    value = document.value
    for step in where:
        held = range(len(value)) if isinstance(value, list) else value
        if not isinstance(held, range | dict) or step not in held:
            raise document.error(where, f"is missing, need {need}")
        value = value[step]
    if not isinstance(value, kind) or isinstance(value, bool):
        raise document.error(where, f"got {shown(value)}, need {need}")
    return value


def _number(document: Document, where: Where) -> float:
    value = _value(document, where, int | float, "a finite number")
    if not abs(value) <= FARTHEST:
        raise document.error(
            where, f"got {shown(value)}, need a finite number of at most {FARTHEST:g} in size"
        )
    return float(value)


def _numbers(document: Document, where: Where, n: int, need: str) -> tuple[float, ...]:
    values = _value(document, where, list, need)
    if len(values) != n:
        raise document.error(where, f"got {len(values)} numbers, need {n}: {need}")
    return tuple(_number(document, (*where, k)) for k in range(n))


def _sizes(document: Document, where: Where) -> tuple[float, ...]:
    sizes = _numbers(document, where, 2, "[length, width]")
    if not all(size > 0.0 for size in sizes):
        raise document.error(where, f"got {shown(list(sizes))}, need positive sizes")
    return sizes

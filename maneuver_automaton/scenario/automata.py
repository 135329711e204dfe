"""The automaton of a scenario file: listed, gridded, from a file or by name."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from decimal import Decimal
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.library import load_library, load_stock_library, stock_libraries
from maneuver_automaton.formats import lattice, libraries
from maneuver_automaton.formats.yaml_source import Document, Where, shown
from maneuver_automaton.models import (
    Car,
    FourWheelSteeringCar,
    LatticeBody,
    Model,
    RearSteeredCar,
    SecondOrderCar,
    SecondOrderUnicycle,
    Unicycle,
)
from maneuver_automaton.models.kinds import is_of_a_kind
from maneuver_automaton.models.speeds import lateral_limit, pace_within
from maneuver_automaton.primitives import Trim, trims_of
from maneuver_automaton.primitives.closed_form import (
    has_limited_rates,
    may_drive,
    quickest_maneuvers,
)
from maneuver_automaton.scenario.parts import at
from maneuver_automaton.scenario.schema import (
    AutomatonPart,
    Axis,
    GridPart,
    ManeuversPart,
    NamedTrim,
)
from maneuver_automaton.scenario.vehicles import AT_REST, described

MAX_GRID_TRIMS = 100_000
MAX_STEADY_TRIMS = 2_000  # of a grid that has to be solved for
AXES = {  # of the grid of a vehicle with a reduced state
    "speed_m_s": "speed",
    "lateral_speed_m_s": "lateral_speed",
    "turn_rate_rad_s": "turn_rate",
    "climb_m_s": "climb",
    "steering_rad": "steering",
}
LATERAL = "max_lateral_acceleration_m_s2"  # by which the vehicle of a library may differ
WHERE: Where = ("automaton",)


def automaton_of(
    document: Document, part: AutomatonPart, model: Model, *, folder: Path
) -> Automaton:
    """The automaton that a file asks for; the paths in it are relative to `folder`."""
    if part.maneuvers is not None and not has_limited_rates(model):
        raise document.error(
            (*WHERE, "maneuvers"),
            f"is for vehicles whose control is the rate of the reduced state, not for the "
            f"{model.name}; maneuvers of others come from a library file, or there are none",
        )
    if part.file is not None:
        path = folder / part.file
        with at(document, (*WHERE, "file")):
            if (read := libraries.read_primitives(path, model)) is not None:
                return _fitting(read.automaton, model)
            if is_of_a_kind(model):
                return _fitting(load_library(path), model)
            return load_library(path, model=model)
    if part.preset is not None:
        with at(document, (*WHERE, "preset")):
            if part.preset in stock_libraries():
                return _fitting(load_stock_library(part.preset), model)
            return preset_automaton(part.preset, model)
    if part.trims is not None:
        _check_names(document, part.trims)
        if not model.reduced_names:
            return _of_controls(document, part.trims, model)
        trims = tuple(_steady(document, k, one, model) for k, one in enumerate(part.trims))
        if not has_limited_rates(model):
            return Automaton(model, trims)
        with at(document, (*WHERE, "maneuvers")):
            joined = quickest_maneuvers(model, trims, **_joining(part.maneuvers))
        return Automaton(model, trims, joined)
    assert part.grid is not None
    if model.reduced_names:
        return _grid(document, part.grid, model, part.maneuvers)
    return _grid_of_controls(document, part.grid, model)


def _joining(part: ManeuversPart | None) -> dict[str, Any]:
    """How trims are joined, as `quickest_maneuvers` and `Automaton.of_model` take it."""
    part = part or ManeuversPart()
    return {
        "pairs": part.pairs,
        "late": part.late,
        "strokes": part.strokes_m,
        "turns": part.turns_rad,
    }


def _of_controls(document: Document, trims: tuple[NamedTrim, ...], model: Model) -> Automaton:
    controls: dict[str, Any] = {}
    for k, trim in enumerate(trims):
        where = (*WHERE, "trims", k)
        if trim.state is not None:
            raise document.error(
                (*where, "state"), f"the {model.name} has no reduced state, need no such key"
            )
        if trim.control is None:
            raise document.error(where, f"the key 'control' is missing, need {_need(model)}")
        controls[trim.name] = trim.control
        with at(document, (*where, "control")):
            Automaton.of_controls(model, {trim.name: trim.control})
    return Automaton.of_controls(model, controls)


def _check_names(document: Document, trims: tuple[NamedTrim, ...]) -> None:
    names = [trim.name for trim in trims]
    for k, name in enumerate(names):
        if name in names[:k]:
            first = document.line_of((*WHERE, "trims", names.index(name)))
            raise document.error(
                (*WHERE, "trims", k, "name"),
                f"got {name!r}, the name of another trim in line {first}; need a new name",
            )


def _need(model: Model) -> str:
    names = f"control: [{', '.join(model.control_names)}]"
    return (f"state: [{', '.join(model.reduced_names)}] or " if model.reduced_names else "") + names


def _steady(document: Document, k: int, part: NamedTrim, model: Model) -> Trim:
    """The trim with a reduced state, a control, or both; the rest is solved for."""
    where = (*WHERE, "trims", k)
    if part.state is None and part.control is None:
        raise document.error(where, f"needs {_need(model)}")
    given = dict(zip(model.reduced_names, part.state or (), strict=False))
    given |= dict(zip(model.control_names, part.control or (), strict=False))
    found = trims_of(model, {name: [value] for name, value in given.items()})
    if found.missing:
        key = "state" if part.state is not None else "control"
        reason = found.missing[0].reason
        raise document.error((*where, key), f"is no trim of the {model.name}: {reason}")
    (trim,) = found.trims
    return replace(trim, name=part.name)


def _grid(
    document: Document, grid: GridPart, model: Model, part: ManeuversPart | None
) -> Automaton:
    where: Where = (*WHERE, "grid")
    if grid.control is not None:
        raise document.error(
            (*where, "control"),
            f"is for vehicles without a reduced state; the {model.name} needs axes such as "
            f"{', '.join(AXES)}",
        )
    axes = {key: axis for key in AXES if (axis := getattr(grid, key)) is not None}
    values = _axes(document, {(*where, key): axis for key, axis in axes.items()})
    if not axes:
        raise document.error(where, f"got no axis, need some of {', '.join(AXES)}")
    count = math.prod(len(one) for one in values)
    if count > MAX_STEADY_TRIMS:
        raise document.error(where, f"got {count:g} trims, need at most {MAX_STEADY_TRIMS}")
    points = {AXES[key]: one for key, one in zip(axes, values, strict=True)}
    with at(document, where):
        return Automaton.of_model(
            model,
            points,
            **_joining(part),
            max_lateral_acceleration=grid.max_lateral_acceleration_m_s2,
            leave_out=grid.leave_out,
        )


def _grid_of_controls(document: Document, grid: GridPart, model: Model) -> Automaton:
    where: Where = (*WHERE, "grid", "control")
    for key in grid.model_fields_set - {"control"}:
        raise document.error(
            (*where[:2], key),
            f"is for vehicles with a reduced state; the {model.name} needs control, a list with "
            "one axis per control",
        )
    names = model.control_names
    if grid.control is None:
        raise document.error(where[:2], "the key 'control' is missing, need one axis per control")
    if len(grid.control) != len(names):
        raise document.error(
            where, f"got {len(grid.control)} axes, need {len(names)} ({', '.join(names)})"
        )
    axes = {(*where, k): axis for k, axis in enumerate(grid.control)}
    for place, axis in axes.items():
        _check_axis(document, place, axis)
    count = math.prod(_n_values(axis) for axis in axes.values())
    if count > MAX_GRID_TRIMS:
        raise document.error(where, f"got {count:g} trims, need at most {MAX_GRID_TRIMS}")
    with at(document, where):
        return Automaton.of_grid(model, _axes(document, axes))


def _axes(document: Document, axes: Mapping[Where, Axis]) -> list[list[float]]:
    for place, axis in axes.items():
        _check_axis(document, place, axis)
        if _n_values(axis) > MAX_GRID_TRIMS:
            raise document.error(
                place, f"got {_n_values(axis):g} values, need at most {MAX_GRID_TRIMS}"
            )
    return [_values(axis) for axis in axes.values()]


def _check_axis(document: Document, where: Where, axis: Axis) -> None:
    if axis.min > axis.max:
        raise document.error(where, f"got min {axis.min:g} above max {axis.max:g}, need min <= max")
    if axis.count == 1 and axis.min < axis.max:
        raise document.error((*where, "count"), "got 1 for two different ends, need at least 2")


def _n_values(axis: Axis) -> int:
    if axis.count is not None:
        return axis.count
    assert axis.step is not None
    return int(min((axis.max - axis.min) / axis.step * (1.0 + 1e-12) + 1e-9, 1e12)) + 1


def _values(axis: Axis) -> list[float]:
    """The values of an axis, computed in decimals: 0.3 is 0.3 and the middle is 0."""
    n, low = _n_values(axis), Decimal(repr(axis.min))
    if axis.step is not None:
        step = Decimal(repr(axis.step))
    else:
        step = (Decimal(repr(axis.max)) - low) / max(n - 1, 1)
    return [float(low + k * step) for k in range(n)]


def _fitting(automaton: Automaton, model: Model) -> Automaton:
    """The automaton of a library, if it is one of this vehicle."""
    if not is_of_a_kind(model):
        raise ValueError(
            f"got a library for {automaton.model.name}, but the vehicle is {model.name}"
        )
    has, needs = described(automaton.model), described(model)
    if has["model"] != needs["model"]:
        raise ValueError(f"got a library for {shown(has)}, but the vehicle is {shown(needs)}")
    keys = [key for key in dict.fromkeys((*has, *needs)) if has.get(key) != needs.get(key)]
    if keys == [LATERAL] and lateral_limit(model) < lateral_limit(automaton.model):
        return automaton.within_lateral(model)
    if keys == [AT_REST]:
        kept = tuple(one for one in automaton.maneuvers if may_drive(model, one))
        return replace(automaton, model=model, maneuvers=kept)
    if keys:
        one, other = ({key: what.get(key) for key in keys} for what in (has, needs))
        raise ValueError(f"got a library for {shown(one)}, but the vehicle has {shown(other)}")
    return automaton


Controls = Mapping[str, tuple[float, ...]]

TABLE_2: Controls = {
    "rest": (0.0, 0.0),
    "straight": (1.5, 0.0),
    "clockwise": (-0.25, -1.0),
    "anticlockwise": (-0.25, 1.0),
    "spin": (0.0, 1.0),
}
SLOW_TO_FAST = (0.0, 0.2, 0.5, 1.0)  # speeds for parking, over the greatest one
PACES = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)  # speeds for the road, over the greatest one
SHARPNESS = (-1.0, -0.5, 0.0, 0.5, 1.0)  # turns, over the sharpest one
STROKES_S = (0.5, 1.0, 1.5)  # lengths of strokes, as time to speed up and as long to brake
COMFORTABLE = 4.0  # [m/s^2] greatest lateral acceleration on the road


def preset_automaton(name: str, model: Model) -> Automaton:
    """The library of a preset.

    `table2` is the paper's Table 2, for the unicycle. `dubins` (3 trims) and `reeds_shepp` (6)
    drive at 1 m/s, or at the greatest speed where that is less, on the tightest circles; those
    of a unicycle turn at 1 rad/s, or at the greatest turn rate. Left and right are as the front
    wheels point, in reverse too.

    `parking` and `road` are for the second-order unicycle and car. For parking, 0, 20, 50 and
    100 % of the speed both ways, straight, half and full turns, maneuvers between neighbours, and
    short strokes from every rest; what exceeds the lateral acceleration of the car is left out, and
    kinematic cars turn more slowly. For the road, rest and five speeds ahead, turns as sharp as a
    lateral acceleration of 4 m/s^2 allows, maneuvers between neighbours, early and late. The
    libraries that come with the package have names of their own; see `load_stock_library`.

    `crab` is for the four-wheel-steering car, at 1 m/s or slower: straight, aside at half and all
    of its steering, and turns about points near its middle, no faster than 1 rad/s, both ways.

    `lattice_ackermann` and `lattice_diff` are lattice primitives of a least turning radius, the
    second with turns on the spot; see `lattice_of_arcs`.

    Source: the paper, Table 2; LaValle (2006), *Planning Algorithms*, Sec. 15.3.1 and 15.3.2.
    """
    if name not in PRESETS:
        raise ValueError(f"got {name!r}, need one of {', '.join((*PRESETS, *stock_libraries()))}")
    preset = PRESETS[name]
    if not isinstance(model, preset.models):
        raise ValueError(f"got {name!r}, which is for {preset.what}, not the {model.name}")
    made = preset.make(model)
    return made if isinstance(made, Automaton) else Automaton.of_controls(model, made)


def _lattice(model: LatticeBody, *, spins: bool) -> Automaton:
    if model.turning_radius is None:
        raise ValueError("needs the least radius of its arcs, state vehicle.turning_radius_m")
    made = lattice.lattice_of_arcs(
        resolution=model.resolution, turning_radius=model.turning_radius, spins=spins
    )
    return lattice.automaton_of_lattice(made)


def _crab(car: FourWheelSteeringCar) -> Controls:
    """Straight, aside and turning, each ahead and back, and how the wheels stand for it."""
    fastest, most = min(1.0, car.max_speed or 1.0), car.max_steering
    modes = {"straight": (0.0, 0.0)}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for name, angle in (("", most), ("half ", 0.5 * most)):
            modes[f"{name}aside to the {side}"] = (sign * angle, sign * angle)
            modes[f"{name}turn to the {side}"] = (sign * angle, -sign * angle)
    controls: dict[str, tuple[float, ...]] = {}
    for name, wheels in modes.items():
        turn = abs(float(car.velocity((), (1.0, *wheels))[2]))
        speed = min(fastest, 1.0 / turn) if turn else fastest
        controls |= {name: (speed, *wheels), f"reverse {name}": (-speed, *wheels)}
    return controls


def _on_circles(vehicle: Unicycle | Car | RearSteeredCar, *, reverses: bool) -> Controls:
    speed = min(1.0, vehicle.max_speed or 1.0)
    back = _turns(vehicle, -speed).items() if reverses else ()
    return _turns(vehicle, speed) | {f"reverse {word}": control for word, control in back}


def _turns(vehicle: Unicycle | Car | RearSteeredCar, speed: float) -> dict[str, tuple[float, ...]]:
    """Left, straight and right at a speed, as tight as the vehicle can."""
    if isinstance(vehicle, Unicycle):
        rate = min(1.0, vehicle.max_turn_rate or 1.0)
        left = rate if speed > 0.0 else -rate
    elif vehicle.max_steering is None:
        raise ValueError("needs the tightest circle of the car, state vehicle.max_steering_rad")
    else:
        left = vehicle.max_steering
        if isinstance(vehicle, RearSteeredCar):
            left = -left  # the wheels behind the pose point to the other side
    pace = pace_within(vehicle, vehicle.body_velocity(np.zeros(0), np.array([speed, left])))
    slow = speed * min(1.0, pace)  # only a car has such a limit: its wheels stay as they are
    return {"left": (slow, left), "straight": (speed, 0.0), "right": (slow, -left)}


def _parking(model: SecondOrderUnicycle | SecondOrderCar) -> Automaton:
    (least, greatest), (_, sharpest) = model.reduced_limits
    low, high = model.control_limits[0]
    reverse = [share * least for share in reversed(SLOW_TO_FAST[1:]) if least < 0.0]
    speeds = [*reverse, *(share * greatest for share in SLOW_TO_FAST)]
    ahead = [float(high * t * t) for t in STROKES_S]
    back = [float(low * t * t) for t in STROKES_S if least < 0.0]
    turn = model.reduced_names[1]
    return Automaton.of_model(
        model,
        {"speed": speeds, turn: [share * sharpest for share in SHARPNESS]},
        strokes=[*ahead, *back],
        turns=(-math.pi / 4, math.pi / 4) if turn == "turn_rate" else (),
    )


def _road(model: SecondOrderUnicycle | SecondOrderCar) -> Automaton:
    """Turns differ from speed to speed, so neighbours are those on the grid of shares."""
    greatest, sharpest = model.reduced_limits[:, 1]
    states = []
    for pace in PACES:
        speed = pace * greatest
        if isinstance(model, SecondOrderCar):
            across = min(COMFORTABLE, lateral_limit(model))
            most = math.atan2(across * model.wheelbase, speed * speed)
        else:
            most = COMFORTABLE / speed if speed > 0.0 else math.inf
        states.append([(speed, share * min(most, sharpest)) for share in SHARPNESS])
    trims = tuple(_trim(model, state) for row in states for state in row)
    places = list(product(range(len(PACES)), range(len(SHARPNESS))))
    near = [
        (i, j)
        for i, a in enumerate(places)
        for j, b in enumerate(places)
        if i != j and max(abs(a[0] - b[0]), abs(a[1] - b[1])) == 1
    ]
    return Automaton(model, trims, quickest_maneuvers(model, trims, pairs=near, late=True))


def _trim(model: SecondOrderUnicycle | SecondOrderCar, state: tuple[float, float]) -> Trim:
    control, reduced = np.zeros(2), np.array(state)
    names = zip(model.reduced_names, state, strict=True)
    return Trim(
        name=", ".join(f"{what} {value:.4g}" for what, value in names),
        body_velocity=model.body_velocity(reduced, control),
        control=control,
        reduced_state=reduced,
    )


class Preset(NamedTuple):
    """A library by name: the vehicles that it is for, in words too, and what makes it of one."""

    models: tuple[type[Any], ...]
    what: str
    make: Callable[[Any], Automaton | Controls]


AT_WILL = (Unicycle, Car, RearSteeredCar), "vehicles without inertia"
WITH_SPEED = (SecondOrderUnicycle, SecondOrderCar), "second_order_unicycle and second_order_car"
ON_LATTICE = (LatticeBody,), "a lattice_body"
PRESETS: Mapping[str, Preset] = {
    "table2": Preset((Unicycle,), "the unicycle", lambda _: TABLE_2),
    "reeds_shepp": Preset(*AT_WILL, functools.partial(_on_circles, reverses=True)),
    "dubins": Preset(*AT_WILL, functools.partial(_on_circles, reverses=False)),
    "parking": Preset(*WITH_SPEED, _parking),
    "road": Preset(*WITH_SPEED, _road),
    "lattice_ackermann": Preset(*ON_LATTICE, functools.partial(_lattice, spins=False)),
    "lattice_diff": Preset(*ON_LATTICE, functools.partial(_lattice, spins=True)),
    "crab": Preset((FourWheelSteeringCar,), "a four_wheel_steering_car", _crab),
}

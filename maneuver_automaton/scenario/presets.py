"""Libraries that have a name."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import product

import numpy as np

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.library import stock_libraries
from maneuver_automaton.models import Car, Model, SecondOrderCar, SecondOrderUnicycle, Unicycle
from maneuver_automaton.models.speeds import lateral_limit, pace_within
from maneuver_automaton.primitives import Trim
from maneuver_automaton.primitives.closed_form import quickest_maneuvers

Controls = Mapping[str, tuple[float, float]]

KINEMATIC = ("table2", "reeds_shepp", "dubins")
INERTIAL = ("parking", "road")
LATTICES = {"lattice_ackermann": False, "lattice_diff": True}  # whether they turn on the spot
PRESETS = (*KINEMATIC, *INERTIAL, *LATTICES)
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
    of a unicycle turn at 1 rad/s, or at the greatest turn rate. Left and right are as the wheels
    point, in reverse too.

    `parking` and `road` are for the second-order unicycle and car. For parking, 0, 20, 50 and
    100 % of the speed both ways, straight, half and full turns, maneuvers between neighbours, and
    short strokes from every rest; what exceeds the lateral acceleration of the car is left out, and
    kinematic cars turn more slowly. For the road, rest and five speeds ahead, turns as sharp as a
    lateral acceleration of 4 m/s^2 allows, maneuvers between neighbours, early and late. The
    libraries that come with the package have names of their own; see `load_stock_library`.

    `lattice_ackermann` and `lattice_diff` are lattice primitives of a least turning radius, the
    second with turns on the spot; see `lattice_of_arcs`.

    Source: the paper, Table 2; LaValle (2006), *Planning Algorithms*, Sec. 15.3.1 and 15.3.2.

    Raises
    ------
    ValueError
        If there is no such preset, or it does not suit the vehicle.

    Examples
    --------
    >>> preset_automaton("dubins", Unicycle()).controls.tolist()
    [[1.0, 1.0], [1.0, 0.0], [1.0, -1.0]]
    >>> car = SecondOrderCar(wheelbase=2.8, max_steering=0.75, max_speed=2.5, max_acceleration=1.0,
    ...                      max_steering_rate=0.5)
    >>> parking = preset_automaton("parking", car)
    >>> len(parking), len(parking.maneuvers)
    (35, 242)
    """
    if name not in PRESETS:
        known = (*PRESETS, *stock_libraries())
        raise ValueError(f"got {name!r}, need one of {', '.join(known)}")
    if name in KINEMATIC:
        if not isinstance(model, Unicycle | Car):
            raise ValueError(
                f"got {name!r}, which is for vehicles without inertia, not the {model.name}"
            )
        return Automaton.of_controls(model, _controls(name, model))
    if name in LATTICES:
        return _lattice(name, model)
    if not isinstance(model, SecondOrderUnicycle | SecondOrderCar):
        need = "second_order_unicycle and second_order_car"
        raise ValueError(f"got {name!r}, which is for {need}, not the {model.name}")
    return _parking(model) if name == "parking" else _road(model)


def _lattice(name: str, model: Model) -> Automaton:
    from maneuver_automaton.formats.lattice import automaton_of_lattice, lattice_of_arcs
    from maneuver_automaton.models.robots import LatticeBody

    if not isinstance(model, LatticeBody):
        raise ValueError(f"got {name!r}, which is for a lattice_body, not the {model.name}")
    if model.turning_radius is None:
        raise ValueError("needs the least radius of its arcs, state vehicle.turning_radius_m")
    lattice = lattice_of_arcs(
        resolution=model.resolution, turning_radius=model.turning_radius, spins=LATTICES[name]
    )
    return automaton_of_lattice(lattice)


def _controls(name: str, vehicle: Unicycle | Car) -> Controls:
    if name == "table2":
        if not isinstance(vehicle, Unicycle):
            raise ValueError(f"got 'table2', which is for the unicycle, not the {vehicle.name}")
        return TABLE_2
    speed = min(1.0, vehicle.max_speed or 1.0)
    ahead = _turns(vehicle, speed)
    if name == "dubins":
        return ahead
    return ahead | {f"reverse {word}": c for word, c in _turns(vehicle, -speed).items()}


def _turns(vehicle: Unicycle | Car, speed: float) -> dict[str, tuple[float, float]]:
    """Left, straight and right at a speed, as tight as the vehicle can."""
    if isinstance(vehicle, Unicycle):
        rate = min(1.0, vehicle.max_turn_rate or 1.0)
        left = rate if speed > 0.0 else -rate
    elif vehicle.max_steering is None:
        raise ValueError("needs the tightest circle of the car, state vehicle.max_steering_rad")
    else:
        left = vehicle.max_steering
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

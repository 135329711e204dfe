"""Libraries of trims that have a name."""

from __future__ import annotations

from collections.abc import Mapping

from maneuver_automaton.models import Car, Unicycle

Controls = Mapping[str, tuple[float, float]]

PRESETS = ("table2", "reeds_shepp", "dubins")
TABLE_2: Controls = {
    "rest": (0.0, 0.0),
    "straight": (1.5, 0.0),
    "clockwise": (-0.25, -1.0),
    "anticlockwise": (-0.25, 1.0),
    "spin": (0.0, 1.0),
}


def preset_controls(name: str, vehicle: Unicycle | Car) -> Controls:
    """Controls of the trims of a preset, by name of the trim.

    `table2` is the paper's Table 2, for the unicycle. `dubins` (3 trims) and `reeds_shepp` (6)
    drive at 1 m/s, or at the greatest speed where that is less, on the tightest circles; those
    of a unicycle turn at 1 rad/s, or at the greatest turn rate. Left and right are as the wheels
    point, in reverse too.

    Source: the paper, Table 2; LaValle (2006), *Planning Algorithms*, Sec. 15.3.1 and 15.3.2.

    Raises
    ------
    ValueError
        If there is no such preset, or it does not suit the vehicle.

    Examples
    --------
    >>> preset_controls("dubins", Unicycle())
    {'left': (1.0, 1.0), 'straight': (1.0, 0.0), 'right': (1.0, -1.0)}
    >>> preset_controls("reeds_shepp", Unicycle())["reverse left"]
    (-1.0, -1.0)
    """
    if name not in PRESETS:
        raise ValueError(f"got {name!r}, need one of {', '.join(PRESETS)}")
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
    return {"left": (speed, left), "straight": (speed, 0.0), "right": (speed, -left)}

"""The vehicle of a scenario file as a model, and back."""

from __future__ import annotations

from typing import Any

from maneuver_automaton.models import Car, Model, Unicycle
from maneuver_automaton.scenario.schema import MODELS, CarPart, UnicyclePart


def unicycle_of(part: UnicyclePart) -> Unicycle:
    """The model that a file describes."""
    return Unicycle(max_speed=part.max_speed_m_s, max_turn_rate=part.max_turn_rate_rad_s)


def car_of(part: CarPart) -> Car:
    """The model that a file describes."""
    return Car(
        wheelbase=part.wheelbase_m,
        max_steering=part.max_steering_rad,
        max_speed=part.max_speed_m_s,
    )


def model_of(part: UnicyclePart | CarPart) -> Unicycle | Car:
    """The model that a file describes."""
    return unicycle_of(part) if isinstance(part, UnicyclePart) else car_of(part)


def described(model: Model) -> dict[str, Any]:
    """What a scenario file says of a model; limits that it does not have are left out.

    Raises
    ------
    ValueError
        If scenario files do not know the model.

    Examples
    --------
    >>> described(Car(wheelbase=2.5))
    {'model': 'car', 'wheelbase_m': 2.5}
    """
    if isinstance(model, Unicycle):
        keys = {
            "max_speed_m_s": model.max_speed,
            "max_turn_rate_rad_s": model.max_turn_rate,
        }
    elif isinstance(model, Car):
        keys = {
            "wheelbase_m": model.wheelbase,
            "max_steering_rad": model.max_steering,
            "max_speed_m_s": model.max_speed,
        }
    else:
        raise ValueError(f"vehicle: a file cannot state {model.name!r}, only {', '.join(MODELS)}")
    return {"model": model.name} | {k: float(v) for k, v in keys.items() if v is not None}

"""The vehicles that files can state, by name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from maneuver_automaton.models import axles, cars, dynamic, robots
from maneuver_automaton.models.model import Model

KINDS: Mapping[str, Any] = {
    kind.name: kind
    for kind in (
        robots.Unicycle,
        cars.Car,
        robots.SecondOrderUnicycle,
        cars.SecondOrderCar,
        cars.CarWithTrailer,
        dynamic.SingleTrack,
        dynamic.Hovercraft,
        dynamic.Helicopter,
        cars.AcceleratingCar,
        robots.LatticeBody,
        robots.Omnidirectional,
        axles.RearSteeredCar,
        axles.FourWheelSteeringCar,
        axles.ArticulatedVehicle,
        cars.TractorWithTrailers,
    )
}


def is_of_a_kind(model: Model) -> bool:
    """Whether a model is one of `KINDS`: not a user's own, even by one of their names."""
    return model.name in KINDS and isinstance(model, KINDS[model.name])

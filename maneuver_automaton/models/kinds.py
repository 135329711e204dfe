"""The vehicles that files can state, by name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from maneuver_automaton.models.axles import (
    ArticulatedVehicle,
    FourWheelSteeringCar,
    RearSteeredCar,
)
from maneuver_automaton.models.cars import (
    AcceleratingCar,
    Car,
    CarWithTrailer,
    SecondOrderCar,
    TractorWithTrailers,
)
from maneuver_automaton.models.dynamic import Helicopter, Hovercraft, SingleTrack
from maneuver_automaton.models.model import Model
from maneuver_automaton.models.robots import (
    LatticeBody,
    Omnidirectional,
    SecondOrderUnicycle,
    Unicycle,
)

KINDS: Mapping[str, Any] = {
    kind.name: kind
    for kind in (
        Unicycle,
        Car,
        SecondOrderUnicycle,
        SecondOrderCar,
        CarWithTrailer,
        SingleTrack,
        Hovercraft,
        Helicopter,
        AcceleratingCar,
        LatticeBody,
        Omnidirectional,
        RearSteeredCar,
        FourWheelSteeringCar,
        ArticulatedVehicle,
        TractorWithTrailers,
    )
}


def is_of_a_kind(model: Model) -> bool:
    """Whether a model is one of `KINDS`: not a user's own, even by one of their names."""
    return model.name in KINDS and isinstance(model, KINDS[model.name])

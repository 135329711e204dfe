"""The vehicles that files can state, by name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from maneuver_automaton.models.accelerating_car import AcceleratingCar
from maneuver_automaton.models.car import Car
from maneuver_automaton.models.car_with_trailer import CarWithTrailer
from maneuver_automaton.models.helicopter import Helicopter
from maneuver_automaton.models.hovercraft import Hovercraft
from maneuver_automaton.models.lattice_body import LatticeBody
from maneuver_automaton.models.model import Model
from maneuver_automaton.models.omnidirectional import Omnidirectional
from maneuver_automaton.models.second_order_car import SecondOrderCar
from maneuver_automaton.models.second_order_unicycle import SecondOrderUnicycle
from maneuver_automaton.models.single_track import SingleTrack
from maneuver_automaton.models.unicycle import Unicycle

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
    )
}


def is_of_a_kind(model: Model) -> bool:
    """Whether a model is one of `KINDS`: not a user's own, even by one of their names.

    Examples
    --------
    >>> is_of_a_kind(Unicycle(max_speed=2.0))
    True
    """
    return model.name in KINDS and isinstance(model, KINDS[model.name])

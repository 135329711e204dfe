"""The vehicle of a scenario file as a model, and back."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

from maneuver_automaton.models import Model
from maneuver_automaton.models.kinds import KINDS, is_of_a_kind
from maneuver_automaton.scenario.checks import Part
from maneuver_automaton.scenario.vehicle_parts import (
    MODELS,
    PARTS,
    CarWithTrailerPart,
    Footprint,
    OwnPart,
)

UNITS = (
    "m",
    "rad",
    "m_s",
    "rad_s",
    "m_s2",
    "rad_s2",
    "per_s",
    "per_rad",
    "kg",
    "kg_m2",
    "n",
    "n_m",
    "n_s_m",
    "n_m_s",
)


def _keys(part: type[Part], kind: Any) -> dict[str, str]:
    """Key of the file by parameter of the model: the same, with its unit."""
    keys = {}
    for field in dataclasses.fields(kind):
        names = (field.name, *(f"{field.name}_{unit}" for unit in UNITS))
        (keys[field.name],) = (name for name in names if name in part.model_fields)
    return keys


KEYS = {name: _keys(part, KINDS[name]) for name, part in zip(MODELS, PARTS, strict=True)}


def model_of(part: Any, *, own: Model | None = None) -> Model:
    """The model that a file describes, by its `VehiclePart`; `own` where it names a user's."""
    if isinstance(part, OwnPart):
        assert own is not None  # a file that names another is refused when it is read
        return own
    given = {name: getattr(part, key) for name, key in KEYS[part.model].items()}
    model: Model = KINDS[part.model](**{k: v for k, v in given.items() if v is not None})
    return model


def carried_of(part: Any) -> Mapping[str, Footprint]:
    """Bodies of what a vehicle carries, as the file states them."""
    if isinstance(part, CarWithTrailerPart) and part.trailer is not None:
        return {"trailer": part.trailer}
    if isinstance(part, OwnPart):
        return part.parts or {}
    return {}


def is_known(model: Model) -> bool:
    """Whether scenario files can state a model; a user's own they can only name."""
    return model.name in KEYS and is_of_a_kind(model)


def described(model: Model) -> dict[str, Any]:
    """What a scenario file says of a model; limits that it does not have are left out.

    Raises
    ------
    ValueError
        If scenario files do not know the model.

    Examples
    --------
    >>> from maneuver_automaton.models import Car
    >>> described(Car(wheelbase=2.5))
    {'model': 'car', 'wheelbase_m': 2.5}
    """
    if not is_known(model):
        raise ValueError(f"vehicle: a file cannot state {model.name!r}, only {', '.join(MODELS)}")
    values = {key: getattr(model, name) for name, key in KEYS[model.name].items()}
    return {"model": model.name} | {k: float(v) for k, v in values.items() if v is not None}

"""Vehicles in library files: what kind, and its parameters."""

from __future__ import annotations

import dataclasses
from typing import Any

from maneuver_automaton.automaton._library_values import check_keys, number_of
from maneuver_automaton.errors import InvalidLibrary
from maneuver_automaton.models import Model, in_world
from maneuver_automaton.models.kinds import KINDS, is_of_a_kind


def model_entry(model: Model) -> dict[str, Any]:
    """The model as a file states it: its parameters; of a user's own model, its names."""
    if not is_of_a_kind(model):
        names = {"controls": model.control_names, "reduced": model.reduced_names}
        return {"kind": model.name, **{key: list(value) for key, value in names.items()}}
    parameters = [field.name for field in dataclasses.fields(KINDS[model.name])]
    values = {name: getattr(model, name) for name in parameters}
    return {"kind": model.name} | {k: float(v) for k, v in values.items() if v is not None}


def model_of(entry: Any, *, own: Model | None) -> Model:
    """The model that a file states; `own` where it is a user's."""
    kind = entry.get("kind") if isinstance(entry, dict) else entry
    if not isinstance(kind, str) or not isinstance(entry, dict):
        raise InvalidLibrary(f"model: got the kind {kind!r}, need one of {', '.join(KINDS)}")
    if own is not None:
        own = in_world(own)
        stated = model_entry(own)
        if entry != stated:
            raise InvalidLibrary(
                f"model: got {entry!r:.200}, but the model given is {stated!r:.200}"
            )
        return own
    if kind not in KINDS:
        raise InvalidLibrary(
            f"model: got the kind {kind!r}, need one of {', '.join(KINDS)}; "
            "a model of your own has to be given: to load_library, or by --model MODULE:OBJECT"
        )
    fields = dataclasses.fields(KINDS[kind])
    known = tuple(field.name for field in fields)
    needed = tuple(field.name for field in fields if field.default is dataclasses.MISSING)
    check_keys("model", entry, known=("kind", *known), needed=needed)
    model: Model = KINDS[kind](
        **{k: number_of(f"model: {k}", v) for k, v in entry.items() if k != "kind"}
    )
    return model

"""Automata as files: JSON that can be read and edited, with a hash of what it says.

Numbers are written so that they read back to the last bit. The hash covers everything but
`name`, `comment` and itself; a file without `hash` is taken as it is. Some come with the package:
built once, so that planning with them needs no solver.
"""

from __future__ import annotations

import dataclasses
import difflib
import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

import numpy as np

from maneuver_automaton._files import open_input, write_text_atomically
from maneuver_automaton.automaton.automaton import Automaton
from maneuver_automaton.automaton.courses import (
    Inputs,
    check_keys,
    driven,
    is_reproduced,
    listed,
    maneuver_entry,
    maneuver_of,
    number_of,
    numbers_of,
    rows_of,
    samples_entry,
    text_of,
)
from maneuver_automaton.errors import InvalidLibrary
from maneuver_automaton.models import Model, in_world
from maneuver_automaton.models.kinds import KINDS, is_of_a_kind
from maneuver_automaton.primitives import Trim

AT_REST, NEVER = "steering_at_rest", "forbidden"  # a parameter, and how its infinity is written


def model_entry(model: Model) -> dict[str, Any]:
    """The model as a file states it: its parameters; of a user's own model, its names."""
    if not is_of_a_kind(model):
        names = {"controls": model.control_names, "reduced": model.reduced_names}
        return {"kind": model.name, **{key: list(value) for key, value in names.items()}}
    parameters = [field.name for field in dataclasses.fields(KINDS[model.name])]
    values = {name: getattr(model, name) for name in parameters}
    if not values.get(AT_REST):  # what says nothing new keeps its hash
        values.pop(AT_REST, None)
    entry = {k: float(v) for k, v in values.items() if v is not None}
    never = {k: NEVER for k, v in entry.items() if v == math.inf}
    return {"kind": model.name} | entry | never


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
        **{
            k: math.inf if (k, v) == (AT_REST, NEVER) else number_of(f"model: {k}", v)
            for k, v in entry.items()
            if k != "kind"
        }
    )
    return model


FORMAT = "maneuver-automaton library"
SCHEMA = 1
UNHASHED = ("name", "comment", "hash")
CONSISTENT = 1e-9  # [m/s, rad/s] between a stored twist and the model's, per unit of speed
STEADY = 1e-8  # rates of the reduced state of a trim, in its units per second


def automaton_hash(automaton: Automaton) -> str:
    """SHA-256, 64 hexadecimal digits, of model, trims and maneuvers; the name does not count.

    Of a maneuver's course the inputs count; its samples follow from them.
    """
    return _hash_of(_content(automaton, [None] * len(automaton.maneuvers)))


def save_library(automaton: Automaton, path: Path | str) -> None:
    """Write an automaton to the file `path`, in one step.

    Of a maneuver's course the inputs are written, along which it is driven again when it is read;
    where they do not lead along it, its samples. Of a user's own model the names are written, so
    that `load_library` can tell that it is given the right one.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    content = _content(automaton, [None] * len(automaton.maneuvers))
    digest = _hash_of(content)
    states = {trim.name: trim.reduced_state for trim in automaton.trims}
    held = is_reproduced(automaton.model, states, automaton.maneuvers)
    for entry, maneuver, flag in zip(content["maneuvers"], automaton.maneuvers, held, strict=True):
        if maneuver.course is not None and not flag:
            entry["samples"] = samples_entry(maneuver.course)
    head = {
        "format": FORMAT,
        "schema": SCHEMA,
        "name": automaton.name,
        "hash": digest,
        "model": content["model"],
    }
    lines = [f"  {json.dumps(key)}: {_json(value)}" for key, value in head.items()]
    for key in ("trims", "maneuvers"):
        rows = ",\n".join(f"    {_json(row)}" for row in content[key])
        lines.append(f'  "{key}": [\n{rows}\n  ]' if rows else f'  "{key}": []')
    write_text_atomically(Path(path), "{\n" + ",\n".join(lines) + "\n}\n")


def load_library(path: Path | str, *, model: Model | None = None) -> Automaton:
    """The automaton of a library file; what it says is held against the model.

    Parameters
    ----------
    path : Path or str
        The file.
    model : Model, optional
        The vehicle of the library; needed if it is a user's own.

    Raises
    ------
    InvalidLibrary
        If the file cannot be read, says something that cannot be, was changed after its hash was
        written, or is for another model.
    """
    path = Path(path)
    document = _read(path)
    try:
        return _automaton_of(document, model)
    except (ValueError, LookupError) as error:
        raise InvalidLibrary(f"{path}: {error}") from error


def _read(path: Path) -> Any:
    try:
        with open_input(path) as stream:
            text = stream.read().decode("utf-8-sig")
    except FileNotFoundError as error:
        raise InvalidLibrary(f"{path}: no such file") from error
    except IsADirectoryError as error:
        raise InvalidLibrary(f"{path}: is a folder, need a library file") from error
    except UnicodeDecodeError as error:
        raise InvalidLibrary(f"{path}: is not a text file in UTF-8") from error
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InvalidLibrary(f"{path}: cannot be read: {reason}") from error
    try:
        return json.loads(text, object_pairs_hook=_unique)
    except json.JSONDecodeError as error:
        raise InvalidLibrary(f"{path}:{error.lineno}: not valid JSON: {error.msg}") from error
    except (RecursionError, ValueError) as error:
        raise InvalidLibrary(f"{path}: not valid JSON: {error}") from error


def _automaton_of(document: Any, own: Model | None) -> Automaton:
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise InvalidLibrary(f'is not a library, need an object with "format": "{FORMAT}"')
    if document.get("schema") != SCHEMA or isinstance(document["schema"], bool):
        raise InvalidLibrary(f"schema: got {document.get('schema')!r}, need {SCHEMA}")
    known = ("format", "schema", *UNHASHED, "model", "trims", "maneuvers")
    check_keys("library", document, known=known, needed=("model", "trims"))
    model = model_of(document["model"], own=own)
    trims = tuple(_trim(k, row) for k, row in enumerate(rows_of(document, "trims")))
    entries = enumerate(rows_of(document, "maneuvers"))
    stated = [maneuver_of(k, entry, model) for k, entry in entries]
    inputs = [one for _, one in stated]
    name = text_of("name", document.get("name", ""))
    automaton = Automaton(model, trims, tuple(maneuver for maneuver, _ in stated), name=name)
    stated_hash, actual = document.get("hash"), _hash_of(_content(automaton, inputs))
    if stated_hash is not None and stated_hash != actual:
        raise InvalidLibrary(
            f"hash: got {stated_hash!r}, but the content has {actual!r}: the file was changed "
            'after it was written; to accept it as it is, delete the line "hash"'
        )
    _check_limits(automaton)
    _check_trims(automaton)
    return replace(automaton, maneuvers=driven(automaton, inputs))


def _check_limits(automaton: Automaton) -> None:
    model = automaton.model
    names = (*model.control_names, *model.reduced_names)
    low, high = np.concatenate([model.control_limits, model.reduced_limits]).T
    states = np.array([trim.reduced_state for trim in automaton.trims])
    values = np.concatenate([automaton.controls, states], axis=1)
    slack = 1e-12 * np.maximum(1.0, np.abs(values))
    outside = (values < low - slack) | (values > high + slack)
    if outside.any():
        k, i = np.argwhere(outside)[0]
        raise InvalidLibrary(
            f"trims[{k}] {automaton.trim_names[k]!r}: {names[i]} = {values[k, i]:.6g} is outside "
            f"the limits [{low[i]:.6g}, {high[i]:.6g}] of the {model.name}"
        )


def _check_trims(automaton: Automaton) -> None:
    states = np.array([trim.reduced_state for trim in automaton.trims])
    expected = automaton.model.body_velocity(states, automaton.controls)
    scale = np.maximum(1.0, np.abs(expected).max(axis=1))
    wrong = np.abs(expected - automaton.body_velocities).max(axis=1) > CONSISTENT * scale
    if wrong.any():
        k = int(np.flatnonzero(wrong)[0])
        trim = automaton.trims[k]
        raise InvalidLibrary(
            f"trims[{k}] {trim.name!r}: got the body velocity {trim.body_velocity.tolist()}, but "
            f"the {automaton.model.name} moves with {expected[k].tolist()} under this control"
        )
    rates = np.abs(automaton.model.reduced_dynamics(states, automaton.controls))
    if (rates > STEADY).any():
        k, i = np.argwhere(rates > STEADY)[0]
        raise InvalidLibrary(
            f"trims[{k}] {automaton.trim_names[k]!r}: is no trim, its "
            f"{automaton.model.reduced_names[i]} changes by {rates[k, i]:.4g} per second"
        )


def _content(automaton: Automaton, inputs: Sequence[Inputs | None]) -> dict[str, Any]:
    """Content of the file of an automaton; inputs of maneuvers whose course is not driven yet."""
    return {
        "model": model_entry(automaton.model),
        "trims": [_trim_entry(trim) for trim in automaton.trims],
        "maneuvers": [
            maneuver_entry(maneuver, one)
            for maneuver, one in zip(automaton.maneuvers, inputs, strict=True)
        ],
    }


def _hash_of(content: Mapping[str, Any]) -> str:
    return hash_of({"schema": SCHEMA, **content})


def hash_of(content: Any) -> str:
    """SHA-256, 64 hexadecimal digits, of values as JSON has them."""
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def _json(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def _trim_entry(trim: Trim) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "name": trim.name,
        "control": listed(trim.control),
        "body_velocity": listed(trim.body_velocity),
    }
    if trim.reduced_state.size:
        entry["reduced_state"] = listed(trim.reduced_state)
    if math.isfinite(trim.max_duration):
        entry["max_duration"] = float(trim.max_duration)
    return entry


def _trim(k: int, entry: Any) -> Trim:
    known = ("name", "control", "body_velocity", "reduced_state", "max_duration", "comment")
    label = f"trims[{k}]"
    check_keys(label, entry, known=known, needed=known[:3])
    return Trim(
        name=text_of(f"{label}: name", entry["name"]),
        control=numbers_of(f"{label}: control", entry["control"]),
        body_velocity=numbers_of(f"{label}: body_velocity", entry["body_velocity"]),
        reduced_state=numbers_of(f"{label}: reduced_state", entry.get("reduced_state", [])),
        max_duration=number_of(f"{label}: max_duration", entry["max_duration"])
        if "max_duration" in entry
        else math.inf,
    )


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    entry: dict[str, Any] = {}
    for key, value in pairs:
        if key in entry:
            raise ValueError(f"the key {key!r} stands twice")
        entry[key] = value
    return entry


def stock_libraries() -> tuple[str, ...]:
    """Names of the libraries that come with the package, in order."""
    names = (entry.name for entry in _folder().iterdir())
    return tuple(sorted(name.removesuffix(".json") for name in names if name.endswith(".json")))


def load_stock_library(name: str) -> Automaton:
    """The automaton of a library that comes with the package.

    Beside each library lies the build file it is made of, with the vehicle's parameters.

    Raises
    ------
    InvalidLibrary
        If there is none of that name.

    Examples
    --------
    >>> car = load_stock_library("second_order_car")
    >>> len(car) >= 40, len(car.maneuvers) >= 300
    (True, True)
    """
    known = stock_libraries()
    if name not in known:
        near = difflib.get_close_matches(name, known, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise InvalidLibrary(f"no stock library {name!r} among {', '.join(known)}{hint}")
    with resources.as_file(_folder() / f"{name}.json") as path:
        return load_library(path)


def _folder() -> Traversable:
    return resources.files("maneuver_automaton") / "libraries"

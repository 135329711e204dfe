"""Automata as files: JSON that can be read and edited, with a hash of what it says.

Numbers are written so that they read back to the last bit. The hash covers everything but
`name`, `comment` and itself; a file without `hash` is taken as it is.
"""

from __future__ import annotations

import hashlib
import inspect
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._files import write_text_atomically
from maneuver_automaton.automaton.automaton import Automaton
from maneuver_automaton.automaton.courses import (
    SAMPLED,
    driven_courses,
    even_times,
    inputs_entry,
    is_reproduced,
    samples_entry,
)
from maneuver_automaton.errors import InvalidLibrary
from maneuver_automaton.models import (
    AcceleratingCar,
    Car,
    CarWithTrailer,
    Helicopter,
    Hovercraft,
    LatticeBody,
    Model,
    SecondOrderCar,
    SecondOrderUnicycle,
    SingleTrack,
    Unicycle,
)
from maneuver_automaton.primitives import Maneuver, Trajectory, Trim

FORMAT = "maneuver-automaton library"
SCHEMA = 1
UNHASHED = ("name", "comment", "hash")
CONSISTENT = 1e-9  # [m/s, rad/s] between a stored twist and the model's, per unit of speed

_KINDS: Mapping[str, Callable[..., Model]] = {
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
    )
}


def automaton_hash(automaton: Automaton) -> str:
    """SHA-256, 64 hexadecimal digits, of model, trims and maneuvers; the name does not count.

    Of a maneuver's course the inputs count; its samples follow from them.

    Examples
    --------
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1.0, 0.0)})
    >>> renamed = Automaton(robot.model, robot.trims, name="the same")
    >>> automaton_hash(robot) == automaton_hash(renamed)
    True
    """
    return _hash(_content(automaton))


def save_library(automaton: Automaton, path: Path | str) -> None:
    """Write an automaton to the file `path`, in one step.

    Raises
    ------
    InvalidLibrary
        If a file cannot state the model.
    OSError
        If the file cannot be written.
    """
    check_stated(automaton.model)
    content = _content(automaton)
    states = {trim.name: trim.reduced_state for trim in automaton.trims}
    held = is_reproduced(automaton.model, states, automaton.maneuvers)
    for entry, maneuver, flag in zip(content["maneuvers"], automaton.maneuvers, held, strict=True):
        if maneuver.course is not None and not flag:
            entry["samples"] = samples_entry(maneuver.course, _numbers)
    head = {
        "format": FORMAT,
        "schema": SCHEMA,
        "name": automaton.name,
        "hash": automaton_hash(automaton),
        "model": content["model"],
    }
    lines = [f"  {json.dumps(key)}: {_json(value)}" for key, value in head.items()]
    for key in ("trims", "maneuvers"):
        rows = ",\n".join(f"    {_json(row)}" for row in content[key])
        lines.append(f'  "{key}": [\n{rows}\n  ]' if rows else f'  "{key}": []')
    write_text_atomically(Path(path), "{\n" + ",\n".join(lines) + "\n}\n")


def check_stated(model: Model) -> None:
    """Whether a file can state the model; raises InvalidLibrary if it cannot."""
    if model.name not in _KINDS:
        raise InvalidLibrary(f"model: a file cannot state {model.name!r}, only {', '.join(_KINDS)}")


def load_library(path: Path | str) -> Automaton:
    """The automaton of a library file.

    Raises
    ------
    InvalidLibrary
        If the file cannot be read, says something that cannot be, or was changed after its hash
        was written.
    """
    path = Path(path)
    document = _read(path)
    try:
        return _automaton_of(document)
    except InvalidLibrary as error:
        raise InvalidLibrary(f"{path}: {error}") from error
    except (ValueError, LookupError) as error:
        raise InvalidLibrary(f"{path}: {error}") from error


def _read(path: Path) -> Any:
    if path.is_dir():
        raise InvalidLibrary(f"{path}: is a folder, need a library file")
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError as error:
        raise InvalidLibrary(f"{path}: no such file") from error
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


def _automaton_of(document: Any) -> Automaton:
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise InvalidLibrary(f'is not a library, need an object with "format": "{FORMAT}"')
    if document.get("schema") != SCHEMA or isinstance(document["schema"], bool):
        raise InvalidLibrary(f"schema: got {document.get('schema')!r}, need {SCHEMA}")
    known = ("format", "schema", *UNHASHED, "model", "trims", "maneuvers")
    _check_keys("library", document, known=known, needed=("model", "trims"))
    content = {
        "model": document["model"],
        "trims": _rows(document, "trims"),
        "maneuvers": _rows(document, "maneuvers"),
    }
    model = _model(content["model"])
    trims = tuple(_trim(k, row) for k, row in enumerate(content["trims"]))
    automaton = Automaton(
        model,
        trims,
        _maneuvers(model, trims, content["maneuvers"]),
        name=_text("name", document.get("name", "")),
    )
    _check_hash(document.get("hash"), automaton)
    _check_limits(automaton)
    _check_twists(automaton)
    return automaton


def _check_hash(stated: Any, automaton: Automaton) -> None:
    if stated is None:
        return
    actual = automaton_hash(automaton)
    if stated != actual:
        raise InvalidLibrary(
            f"hash: got {stated!r}, but the content has {actual!r}: the file was changed after it "
            'was written; to accept it as it is, delete the line "hash"'
        )


def _check_limits(automaton: Automaton) -> None:
    """Every control is within the limits of the model."""
    low, high = np.moveaxis(automaton.model.control_limits, -1, 0)
    slack = 1e-12 * np.maximum(1.0, np.abs(automaton.controls))
    outside = (automaton.controls < low - slack) | (automaton.controls > high + slack)
    if outside.any():
        k, i = np.argwhere(outside)[0]
        raise InvalidLibrary(
            f"trims[{k}] {automaton.trim_names[k]!r}: {automaton.model.control_names[i]} = "
            f"{automaton.controls[k, i]:.6g} is outside the limits [{low[i]:.6g}, {high[i]:.6g}] "
            f"of the {automaton.model.name}"
        )


def _check_twists(automaton: Automaton) -> None:
    """Every stored twist is what the model says of the reduced state and control."""
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


def _content(automaton: Automaton) -> dict[str, Any]:
    return {
        "model": _model_entry(automaton.model),
        "trims": [_trim_entry(trim) for trim in automaton.trims],
        "maneuvers": [_maneuver_entry(maneuver) for maneuver in automaton.maneuvers],
    }


def _hash(content: Mapping[str, Any]) -> str:
    text = json.dumps(
        {"schema": SCHEMA, **content}, sort_keys=True, separators=(",", ":"), allow_nan=False
    )
    return hashlib.sha256(text.encode()).hexdigest()


def _json(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def _model_entry(model: Model) -> dict[str, Any]:
    if model.name not in _KINDS:
        names = {"controls": model.control_names, "reduced": model.reduced_names}
        return {"kind": model.name, **{key: list(value) for key, value in names.items()}}
    values = {name: getattr(model, name) for name in inspect.signature(type(model)).parameters}
    return {"kind": model.name} | {k: float(v) for k, v in values.items() if v is not None}


def _trim_entry(trim: Trim) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "name": trim.name,
        "control": _numbers(trim.control),
        "body_velocity": _numbers(trim.body_velocity),
    }
    if trim.reduced_state.size:
        entry["reduced_state"] = _numbers(trim.reduced_state)
    if math.isfinite(trim.max_duration):
        entry["max_duration"] = float(trim.max_duration)
    return entry


def _maneuver_entry(maneuver: Maneuver) -> dict[str, Any]:
    entry = {
        "name": maneuver.name,
        "source": maneuver.source,
        "target": maneuver.target,
        "displacement": _numbers(maneuver.displacement),
        "duration": float(maneuver.duration),
    }
    return entry | ({} if maneuver.course is None else inputs_entry(maneuver.course, _numbers))


def _numbers(array: Any) -> list[float]:
    return [value + 0.0 for value in array.tolist()]  # -0.0 is 0.0


def _model(entry: Any) -> Model:
    kind = entry.get("kind") if isinstance(entry, dict) else entry
    if not isinstance(kind, str) or kind not in _KINDS or not isinstance(entry, dict):
        raise InvalidLibrary(f"model: got the kind {kind!r}, need one of {', '.join(_KINDS)}")
    parameters = inspect.signature(_KINDS[kind]).parameters
    needed = [name for name, one in parameters.items() if one.default is one.empty]
    _check_keys("model", entry, known=("kind", *parameters), needed=needed)
    return _KINDS[kind](**{k: _number(f"model: {k}", v) for k, v in entry.items() if k != "kind"})


def _trim(k: int, entry: Any) -> Trim:
    known = ("name", "control", "body_velocity", "reduced_state", "max_duration", "comment")
    label = f"trims[{k}]"
    _check_keys(label, entry, known=known, needed=known[:3])
    return Trim(
        name=_text(f"{label}: name", entry["name"]),
        control=_list(f"{label}: control", entry["control"]),
        body_velocity=_list(f"{label}: body_velocity", entry["body_velocity"]),
        reduced_state=_list(f"{label}: reduced_state", entry.get("reduced_state", [])),
        max_duration=_number(f"{label}: max_duration", entry["max_duration"])
        if "max_duration" in entry
        else math.inf,
    )


def _maneuvers(model: Model, trims: Sequence[Trim], rows: Sequence[Any]) -> tuple[Maneuver, ...]:
    """The maneuvers of a file; those that state their inputs are driven, all at once."""
    found = [_maneuver(k, row) for k, row in enumerate(rows)]
    states = {trim.name: trim.reduced_state for trim in trims}
    courses: dict[int, Trajectory] = {}
    inputs = {}
    for k, (row, maneuver) in enumerate(zip(rows, found, strict=True)):
        if "samples" in row:
            courses[k] = _samples(f"maneuvers[{k}]", row["samples"])
        elif "control" in row and maneuver.source in states:
            inputs[k] = _inputs(f"maneuvers[{k}]", row, model, maneuver.duration)
    starts = [states[found[k].source] for k in inputs]
    courses |= dict(zip(inputs, driven_courses(model, starts, list(inputs.values())), strict=True))
    return tuple(
        replace(maneuver, course=courses[k]) if k in courses else maneuver
        for k, maneuver in enumerate(found)
    )


def _maneuver(k: int, entry: Any) -> Maneuver:
    needed = ("name", "source", "target", "displacement", "duration")
    label = f"maneuvers[{k}]"
    _check_keys(
        label, entry, known=(*needed, "control", "until", "samples", "comment"), needed=needed
    )
    return Maneuver(
        name=_text(f"{label}: name", entry["name"]),
        source=_text(f"{label}: source", entry["source"]),
        target=_text(f"{label}: target", entry["target"]),
        displacement=_list(f"{label}: displacement", entry["displacement"]),
        duration=_number(f"{label}: duration", entry["duration"]),
    )


def _inputs(label: str, entry: Any, model: Model, duration: float) -> tuple[Array, Array]:
    """Until when each control of a maneuver holds, and the controls."""
    control = _table(f"{label}: control", entry["control"], width=len(model.control_names))
    if "until" not in entry:
        return even_times(duration, len(control)), control
    until: Array = _list(f"{label}: until", entry["until"])
    if until.shape != (len(control),) or not (np.diff(until, prepend=0.0) > 0.0).all():
        raise InvalidLibrary(
            f"{label}: until: got {until.tolist()!r:.60}, need {len(control)} rising times, one "
            "for each control"
        )
    if until[-1] != duration:
        raise InvalidLibrary(
            f"{label}: until: ends with {until[-1]} s, need the duration {duration} s"
        )
    return until, control


def _samples(label: str, entry: Any) -> Trajectory:
    label = f"{label}: samples"
    _check_keys(label, entry, known=SAMPLED, needed=SAMPLED)
    time = _list(f"{label}: time", entry["time"])
    rows = {name: _table(f"{label}: {name}", entry[name]) for name in SAMPLED[1:]}
    for name, table in rows.items():
        if len(table) != time.size or not time.size:
            raise InvalidLibrary(
                f"{label}: {name}: got {len(table)} rows, need one for each of {time.size} times, "
                "and at least one"
            )
    return Trajectory(time=time, **rows)


def _table(label: str, value: Any, *, width: int | None = None) -> Array:
    """Rows (n, width) of numbers."""
    if not isinstance(value, list) or not value:
        raise InvalidLibrary(f"{label}: got {value!r:.60}, need a list of rows of numbers")
    rows = [_list(f"{label}[{k}]", row) for k, row in enumerate(value)]
    width = rows[0].size if width is None else width
    for k, row in enumerate(rows):
        if row.size != width:
            raise InvalidLibrary(f"{label}[{k}]: got {row.size} numbers, need {width}")
    return np.array(rows, dtype=np.float64).reshape(len(rows), width)


def _rows(document: Mapping[str, Any], key: str) -> list[Any]:
    rows = document.get(key, [])
    if not isinstance(rows, list):
        raise InvalidLibrary(f"{key}: got {rows!r:.60}, need a list")
    return rows


def _check_keys(label: str, entry: Any, *, known: Sequence[str], needed: Sequence[str]) -> None:
    if not isinstance(entry, dict):
        raise InvalidLibrary(f"{label}: got {entry!r:.60}, need an object")
    for key in entry:
        if key not in known:
            raise InvalidLibrary(f"{label}: unknown key {key!r}, need {', '.join(known)}")
    for key in needed:
        if key not in entry:
            raise InvalidLibrary(f"{label}: the key {key!r} is missing")


def _text(label: str, value: Any) -> str:
    if not isinstance(value, str):
        raise InvalidLibrary(f"{label}: got {value!r:.60}, need a text")
    return value


def _number(label: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InvalidLibrary(f"{label}: got {value!r:.60}, need a number")
    huge = isinstance(value, int) and abs(value) > 2**63
    if huge or not math.isfinite(value):
        raise InvalidLibrary(f"{label}: got {value!r:.60}, need a finite number")
    return float(value)


def _list(label: str, value: Any) -> Any:
    if not isinstance(value, list):
        raise InvalidLibrary(f"{label}: got {value!r:.60}, need a list of numbers")
    return np.array([_number(label, number) for number in value], dtype=np.float64)


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    entry: dict[str, Any] = {}
    for key, value in pairs:
        if key in entry:
            raise ValueError(f"the key {key!r} stands twice")
        entry[key] = value
    return entry

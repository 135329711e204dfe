"""Result files, each kind stated once: one reader, one writer, one error.

What a kind of file holds is a TypedDict beside what writes it; pydantic checks files against it
when they are read, and makes its JSON Schema. Those who write need neither: what they return are
plain values. Strict JSON; numbers read back to the last bit, and what is infinite is null.
"""

from __future__ import annotations

import contextlib
import functools
import importlib
import json
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Final, NotRequired, TypeVar, cast

from pydantic import TypeAdapter, ValidationError
from typing_extensions import TypedDict

from maneuver_automaton._files import open_input, relative, write_text_atomically
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.library import automaton_hash
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.entries import Flag, Known, Number, Whole, entry, says
from maneuver_automaton.formats.yaml_source import shown, spelled
from maneuver_automaton.models import Model

SCHEMA = 1
FLEET: Final = "fleet"  # the kind of a file of several vehicles
KINDS = {  # of documents: where it is stated, its file, and keys without which it is none
    "plan": ("plan_json.PlanDocument", ("status", "primitives", "trajectory")),
    "loop": ("closed_loop_json.LoopDocument", ("reached", "steps", "step_s")),
    "statistics": ("closed_loop_json.StatisticsDocument", ("loops",)),
    "fleet": ("fleet_json.FleetDocument", ("status", "vehicles")),
    "fleet-loop": ("fleet_json.FleetLoopDocument", ("status", "vehicles", "steps")),
    "road-plan": ("road_json.RoadPlanDocument", ("status", "primitives", "trajectory")),
    "drive": ("road_json.DriveDocument", ("reached", "steps", "step_s")),
    "road-fleet": ("road_json.RoadFleetDocument", ("status", "vehicles")),
    "road-fleet-drive": ("road_json.RoadFleetDriveDocument", ("status", "vehicles")),
}
A_LINE_EACH = (
    *("primitives", "stop", "alternatives", "steps", "broken_guarantees", "closest", "loops"),
)
# Keys that stand first in what is written, in this order.
HEAD = ("schema", "version", "kind", "name", "vehicle", "automaton_hash", "status", "reason")

T = TypeVar("T")


class ModelEntry(TypedDict):
    """The vehicle by name, and what the columns of a trajectory are."""

    model: str
    reduced_state: list[str]
    control: list[str]


class BrokenEntry(TypedDict):
    """A guarantee that did not hold, and why."""

    step: NotRequired[Annotated[Whole | None, says("its number, where it is not that of the row")]]
    guarantee: str
    reason: str


class ClosestEntry(TypedDict):
    """Two vehicles, and where they are nearest to each other."""

    pair: tuple[str, str]
    time_s: Annotated[Number, says("on the clock of all")]
    distance_m: Number


class ClearanceEntry(TypedDict):
    """What is kept at least; null where there is nothing to keep clear of."""

    between: Annotated[Known, says("any two vehicles")]
    to_obstacles: Known


SourceEntry = TypedDict(  # what a result was made from, as seen from its file
    "SourceEntry", {"file": str, "with": NotRequired[str | None], "case": NotRequired[Whole | None]}
)


class DocumentHead(TypedDict):
    """What every result file has."""

    schema: Annotated[Whole, says("1")]
    version: NotRequired[Annotated[str, says("of the package that wrote it")]]
    name: NotRequired[Annotated[str, says("of the scenario, which heads pictures")]]
    reason: NotRequired[Annotated[str, says("why it did not end well; else empty")]]
    notes: NotRequired[Annotated[list[str], says("what was left out, and why")]]
    source: NotRequired[SourceEntry]
    interrupted: NotRequired[Annotated[Flag, says("only where a signal came before the end")]]


def vehicle_entry(model: Model) -> ModelEntry:
    """The vehicle by name, and what the columns of a trajectory are."""
    return {
        "model": model.name,
        "reduced_state": list(model.reduced_names),
        "control": list(model.control_names),
    }


# -- reading


def read_document(path: Path | str, *kinds: str) -> dict[str, Any]:
    """The content of a result file of one of these kinds, by their names in `KINDS`, or of any."""
    file = file_of(kinds[0]) if kinds else "plan.json"
    value = parsed(path, file)
    kind = kind_of(value) or "plan"
    if kinds and kind not in kinds:
        if isinstance(value, dict) and {"schema", *KINDS[kind][1]} <= value.keys():
            whose = "several vehicles" if "fleet" in kinds[0] else "one vehicle"
            raise InvalidScenario(f"{path}: is no {file} of {whose}")
        kind = kinds[0]
    return checked(kind, value, path)


def parsed(path: Path | str, file: str = "plan.json") -> Any:
    """The value of a strict JSON file; raises InvalidScenario."""
    try:
        with open_input(Path(path)) as stream:
            text = stream.read().decode("utf-8")
        return json.loads(text, parse_constant=_refuse_constant)
    except FileNotFoundError as error:
        raise InvalidScenario(f"{path}: no such file") from error
    except IsADirectoryError as error:
        raise InvalidScenario(f"{path}: is a folder, need a {file}") from error
    except OSError as error:
        raise InvalidScenario(f"{path}: cannot be read: {error.strerror}") from error
    except json.JSONDecodeError as error:
        raise InvalidScenario(f"{path}:{error.lineno}: not valid JSON: {error.msg}") from error
    except (ValueError, RecursionError) as error:
        raise InvalidScenario(f"{path}: not valid JSON: {error}") from error


def _refuse_constant(word: str) -> float:
    raise ValueError(f"{word} is no JSON")


def kind_of(value: Any) -> str:
    """The kind of document that the value of a file states; empty if it states none."""
    keys = value.keys() if isinstance(value, dict) else set()
    if "loops" in keys:
        return "statistics"
    if "kind" in keys and value["kind"] == FLEET:
        several = {"steps": "fleet-loop", "reached": "road-fleet-drive", "alone_cost": "fleet"}
        return next((kind for key, kind in several.items() if key in keys), "road-fleet")
    if {"reached", "steps"} <= keys:
        steps = value["steps"]
        first = steps[0] if isinstance(steps, list) and steps else None
        return "drive" if isinstance(first, dict) and "reduced_state" in first else "loop"
    if not {"primitives", "trajectory"} & keys:
        return ""
    return "road-plan" if "stop" in keys else "plan"


def file_of(kind: str) -> str:
    """The name of the file that a kind of document is written to."""
    if kind == "statistics":
        return "statistics.json"
    return "closed_loop.json" if "loop" in kind or "drive" in kind else "plan.json"


@functools.cache
def adapter_of(kind: str) -> TypeAdapter[Any]:
    """What checks a kind of document, and knows its JSON Schema."""
    module, _, name = KINDS[kind][0].partition(".")
    return TypeAdapter(getattr(importlib.import_module(f"{__package__}.{module}"), name))


def schema_of(kind: str) -> dict[str, Any]:
    """The JSON Schema of a kind of document, by its name in `KINDS`."""
    return adapter_of(kind).json_schema()


def checked(kind: str, value: Any, path: Path | str) -> dict[str, Any]:
    """The value of a file if it is a document of this kind; `path` is its place, for messages."""
    needed = ("schema", *KINDS[kind][1])
    if not isinstance(value, dict) or any(key not in value for key in needed):
        raise InvalidScenario(
            f"{path}: is no {file_of(kind)}, need an object with {', '.join(needed)}"
        )
    if value["schema"] != SCHEMA:
        raise InvalidScenario(f"{path}: schema: got {value['schema']!r}, need {SCHEMA}")
    check_value(adapter_of(kind), value, path)
    return value


def check_value(adapter: TypeAdapter[Any], value: Any, path: Path | str) -> None:
    """Refuse a value of a JSON file that is not as stated; raises InvalidScenario: the first."""
    try:
        adapter.validate_python(value)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where, words = first["loc"], first["msg"]
        if first["type"] == "missing":
            words = f"is missing, need {_needed(adapter.json_schema(), where)}"
        else:
            need = NEED.get(first["type"]) or words.partition(" should be ")[2]
            words = f"got {shown(first['input'])}, need {need}"
        raise misstated(path, where, words) from error


def misstated(path: Path | str, where: tuple[str | int, ...], said: str) -> InvalidScenario:
    """The error of a field of a file: raise it."""
    steps = (step for step in where if isinstance(step, int) or step[:1] != "<")  # tags of unions
    label = spelled(tuple(steps))
    return InvalidScenario(f"{path}: {label + ': ' if label else ''}{said}")


@contextlib.contextmanager
def errors_at(place: object) -> Iterator[None]:
    """Name the file, or a place in it, where its values make no plan."""
    try:
        yield
    except InvalidScenario:
        raise
    except (ValueError, KeyError, TypeError, IndexError, OverflowError, AttributeError) as error:
        said = f"misses the key {error}" if isinstance(error, KeyError) else str(error)
        raise InvalidScenario(f"{place}: {said}") from error


_MEANT = {  # kinds of complaint of pydantic, and types of JSON Schema
    "a finite number": "float_type finite_number number",
    "a whole number": "int_type integer",
    "a text": "string_type string",
    "true or false": "bool_type boolean",
    "a list": "list_type tuple_type array",
    "an object": "dict_type object",
    "at least one entry": "too_short",
    "a positive number": "greater_than",
}
NEED = {kind: need for need, kinds in _MEANT.items() for kind in kinds.split()}


def _needed(schema: Mapping[str, Any], where: tuple[str | int, ...]) -> str:
    """What a key that is missing may hold, by the schema."""
    options: list[Any] = [schema]
    for step in where:
        inside: list[Any] = []
        for one in options:
            part = schema["$defs"][one["$ref"].rpartition("/")[2]] if "$ref" in one else one
            found = part.get("items") if isinstance(step, int) else None
            if isinstance(step, str):
                found = part.get("properties", {}).get(step) or part.get("additionalProperties")
                found = part if step[:1] == "<" else found
            if found:
                inside += found.get("oneOf") or found.get("anyOf") or [found]
        options = inside
    kinds = [NEED[one["type"]] for one in options if one.get("type") in NEED]
    return " or ".join(dict.fromkeys(kinds)) or "an object"


# -- writing


def document_of(form: type[T], value: Any, /, **given: Any) -> T:
    """What a file says of a value, by the keys of its kind; see `entry`."""
    version = sys.modules["maneuver_automaton"].__version__
    said = entry(form, value, schema=SCHEMA, version=version, **given)
    assert isinstance(said, dict)
    return cast("T", {key: said[key] for key in (*HEAD, "notes", *said) if key in said})


def library_entries(automaton: Automaton) -> dict[str, Any]:
    """The keys that name a vehicle and its library."""
    return {"vehicle": vehicle_entry(automaton.model), "automaton_hash": automaton_hash(automaton)}


def write_document(
    document: Mapping[str, Any],
    path: Path | str,
    *,
    source: Mapping[str, Any] | None = None,
    interrupted: bool = False,
) -> None:
    """Write a document in one step: strict JSON, long lists entry by entry.

    The key `source` names the files that it was made from, as seen from it. Where a signal came
    before the work was done, the key `interrupted` says so.
    """
    said = dict(document)
    if source is not None:
        said["source"] = {
            key: relative(value, Path(path).parent) if isinstance(value, Path) else value
            for key, value in source.items()
        }
    if interrupted:
        said["interrupted"] = True
    write_text_atomically(Path(path), _object(said, "") + "\n")


def _object(document: Mapping[str, Any], left: str, *, of_objects: bool = False) -> str:
    """An object, a key a line, `left` of which that many spaces stand; or one `of_objects`."""
    inside = left + "  "
    rows = (
        f"{inside}{json.dumps(key, ensure_ascii=False)}: "
        + (_object(value, inside) if of_objects else _json(key, value, inside))
        for key, value in document.items()
    )
    return "{\n" + ",\n".join(rows) + f"\n{left}}}"


def _json(key: str, value: Any, left: str) -> str:
    """A value of the file in one line, but lists of objects one object a line, and vehicles."""
    if key in A_LINE_EACH and value and isinstance(value, list):
        rows = ",\n".join(f"{left}  {_json('', row, '')}" for row in value)
        return f"[\n{rows}\n{left}]"
    if key in ("trajectory", "vehicles"):
        return _object(value, left, of_objects=key == "vehicles")
    return json.dumps(value, ensure_ascii=False, allow_nan=False)

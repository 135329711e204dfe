"""From the text of a scenario file to its values, or to one message that says what is wrong."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from maneuver_automaton.formats.yaml_source import Document, Where, shown
from maneuver_automaton.models import Model
from maneuver_automaton.models.kinds import KINDS
from maneuver_automaton.scenario.schema import ScenarioFile

File = TypeVar("File", bound=BaseModel)
OTHER_KINDS: Mapping[str, set[str]] = {  # and what only they have
    "a library of trims": {"format", "trims"},
    "a plan": {"status", "primitives"},
    "a closed loop": {"status", "step_s", "steps"},
    "plans of a fleet": {"status", "kind", "vehicles"},
    "a build file": {"library", "trims"},
}


def values_of(document: Document, *, own: Model | None = None) -> ScenarioFile:
    """The values of a scenario file; its vehicle is `own` where that is given.

    Raises
    ------
    InvalidScenario
        If a key is unknown or missing, or holds what it may not: the first one in the file.
    """
    check_schema(document)
    return checked(document, ScenarioFile, own=own)


def checked(
    document: Document, kind: type[File], *, own: Model | None = None, several: bool = False
) -> File:
    """The values of a file of this kind; of `several` vehicles `own` may be the model of some.

    Raises
    ------
    InvalidScenario
        If a key is unknown or missing, or holds what it may not: the first one in the file.
    """
    try:
        context = {"one_is": own and own.name} if several else _context(document.value, own)
        return kind.model_validate(document.value, context=context)
    except ValidationError as error:
        found = [_message(document, item) for item in error.errors(include_url=False)]
        where, what = min(found, key=lambda item: document.line_of(item[0]))
        raise document.error(where, what) from error


def check_schema(document: Document) -> None:
    """A file of another kind or schema is told before its keys are; raises InvalidScenario."""
    if not isinstance(document.value, dict):
        return
    for kind, keys in OTHER_KINDS.items():
        if keys <= document.value.keys():
            raise document.error((), f"is {kind}, need a scenario")
    if "schema" not in document.value:
        raise document.error((), "the key 'schema' is missing: no scenario, need schema: 1")
    schema = document.value["schema"]
    if schema != 1 or not isinstance(schema, int) or isinstance(schema, bool):
        what = "need 1, the schema that this version reads"
        raise document.error(("schema",), f"got {shown(schema)}, {what}")


def _context(value: Any, own: Model | None) -> dict[str, Any]:
    if own is not None:
        names = {"control_names": own.control_names, "reduced_names": own.reduced_names}
        return {"own": own.name, **names}
    vehicle = value.get("vehicle") if isinstance(value, dict) else None
    model = vehicle.get("model") if isinstance(vehicle, dict) else None
    kind = KINDS.get(model) if isinstance(model, str) else None
    if kind is None:
        return {}
    return {"control_names": kind.control_names, "reduced_names": kind.reduced_names}


def _message(document: Document, item: Any) -> tuple[Where, str]:
    """Place and words of one complaint of pydantic."""
    where = _place(item["loc"])
    kind, context = item["type"], item.get("ctx", {})
    if kind == "unknown_key":
        what = f"unknown key; did you mean {context['near']!r}? Known keys: {context['known']}"
        return (*where, context["key"]), what
    if kind == "missing_key":
        key = context["key"]
        return where, f"the key {key!r} is missing, need {key}: {context['what']}"
    if kind == "at_key":
        value = _value_at(document.value, where)[context["key"]]
        return (*where, context["key"]), f"got {shown(value)}, need {context['need']}"
    if kind == "one_of":
        return where, f"got {context['given']}, need exactly one of {context['known']}"
    if kind == "alone":
        return (*where, context["key"]), f"goes with {context['partners']} only"
    if kind == "need":
        return where, f"got {shown(item['input'])}, need {context['need']}"
    return where, f"got {shown(item['input'])}: {item['msg']}"


def _place(loc: tuple[str | int, ...]) -> Where:
    """The steps of `loc` that exist in the file: the tags of unions, <...>, do not."""
    return tuple(step for step in loc if isinstance(step, int) or not step.startswith("<"))


def _value_at(value: Any, where: Where) -> Any:
    for step in where:
        value = value[step]
    return value

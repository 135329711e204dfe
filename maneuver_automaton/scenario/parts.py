"""A part of a file as a value, and back: strict numbers, known keys, one message of what is wrong.

A key is called as the parameter of what is made of it, with the unit behind: `made` and `stated`
go both ways by that rule.
"""

from __future__ import annotations

import contextlib
import dataclasses
import difflib
from collections.abc import Callable, Iterator, Mapping
from typing import Annotated, Any, ClassVar, TypeVar

import numpy as np
from annotated_types import Ge, Gt
from pydantic import (
    AfterValidator,
    AllowInfNan,
    BaseModel,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    Strict,
    ValidationError,
    model_validator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from maneuver_automaton._limits import FARTHEST
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.yaml_source import Document, Where, shown

Kind = TypeVar("Kind")
File = TypeVar("File", bound=BaseModel)
UNITS = (
    *("m", "rad", "s", "m_s", "rad_s", "m_s2", "rad_s2", "per_s", "per_rad", "steps"),
    *("kg", "kg_m2", "n", "n_m", "n_s_m", "n_m_s"),
)


def need(text: str) -> PydanticCustomError:
    """The error of a value that is not what the file needs there: raise it."""
    return PydanticCustomError("need", "need {need}", {"need": text})


def refusal(text: str, *, key: str | None = None) -> PydanticCustomError:
    """The error of a mapping, or of what stands at a key of it, in full: raise it."""
    return PydanticCustomError("refusal", "{text}", {"text": text, "key": key})


class Need:
    """Annotation: whatever is wrong with the value, say that it has to be `text`."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.schema: CoreSchema | None = None  # the same wherever the type is, and made once

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        self.schema = self.schema or core_schema.custom_error_schema(
            handler(source),
            custom_error_type="need",
            custom_error_message="need {need}",
            custom_error_context={"need": self.text},
        )
        return self.schema


class Several:
    """Annotation: a list of `at_least` to `at_most` items, described by `text`."""

    def __init__(self, text: str, *, at_least: int = 0, at_most: int | None = None) -> None:
        self.text = text
        self.at_least = at_least
        self.at_most = at_most

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.no_info_before_validator_function(self._checked, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        limits = {"minItems": self.at_least or None, "maxItems": self.at_most}
        return handler(schema) | {key: n for key, n in limits.items() if n is not None}

    def _checked(self, value: Any) -> Any:
        long = self.at_most is not None and isinstance(value, list) and len(value) > self.at_most
        if not isinstance(value, list) or len(value) < self.at_least or long:
            raise need(self.text)
        return value


def exactly(count: int, text: str) -> Several:
    """Annotation: a list of so many items, described by `text`."""
    return Several(text, at_least=count, at_most=count)


def holding(holds: Callable[[Any], bool], text: str) -> AfterValidator:
    """Annotation: a value of which a condition `holds`; of any other, it has to be `text`."""

    def checked(value: Any) -> Any:
        if not holds(value):
            raise need(text)
        return value

    return AfterValidator(checked)


_Small = holding(
    lambda value: not abs(value) > FARTHEST, f"a number of at most {FARTHEST:g} in size"
)
Number = Annotated[float, Strict(), AllowInfNan(False), Need("a finite number"), _Small]
Positive = Annotated[float, Strict(), AllowInfNan(False), Gt(0), Need("a positive number"), _Small]
NotNegative = Annotated[
    float, Strict(), AllowInfNan(False), Ge(0), Need("a finite number of at least 0"), _Small
]
Count = Annotated[int, Strict(), Ge(1), Need("a whole number of at least 1")]
Whole = Annotated[int, Strict(), Ge(0), Need("a whole number of at least 0")]
Truth = Annotated[bool, Strict(), Need("true or false")]
Text = Annotated[str, Strict(), Need("a text")]
Name = Annotated[str, Strict(), Field(pattern=r"\S"), Need("a name, a text that is not empty")]
Point = Annotated[tuple[Number, Number], exactly(2, "a point [x, y], two numbers")]
Pose2D = Annotated[
    tuple[Number, Number, Number], exactly(3, "a pose [x, y, heading], three numbers")
]
Polygon = Annotated[tuple[Point, ...], Several("a list of at least 3 points [x, y]", at_least=3)]
Polygons = Annotated[tuple[Polygon, ...], Several("a list of polygons")]
Size = Annotated[tuple[Positive, Positive], exactly(2, "[length, width], two positive numbers")]
Interval = Annotated[
    tuple[Number, Number],
    exactly(2, "an interval [low, high], two numbers"),
    holding(lambda ends: ends[0] < ends[1], "an interval [low, high] with low < high"),
]


class FilePart(BaseModel):
    """A mapping of a file: its keys are those of the class, no others."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)

    one_of: ClassVar[tuple[str, ...]] = ()  # exactly one of these keys
    goes_with: ClassVar[Mapping[str, tuple[str, ...]]] = {}  # a key, and those it needs one of
    instead: ClassVar[Mapping[str, str]] = {}  # keys of other parts, and what is needed here

    @model_validator(mode="before")
    @classmethod
    def _check_keys(cls, value: Any) -> Any:
        keys = {field.alias or name: field for name, field in cls.model_fields.items()}
        if not isinstance(value, dict):
            raise need(f"a mapping with the keys {', '.join(keys)}")
        for key in value:
            if key in cls.instead:
                raise refusal(f"got {shown(value[key])}, need {cls.instead[key]}", key=key)
            if key not in keys:
                near = difflib.get_close_matches(key, keys, n=1, cutoff=0.0)[0]
                known = ", ".join(keys)
                raise refusal(f"unknown key; did you mean {near!r}? Known keys: {known}", key=key)
        for key, field in keys.items():
            if key in value and value[key] is None:
                what = field.description if field.is_required() else "a value, or no such key"
                raise refusal(f"got nothing, need {what or 'a value'}", key=key)
            if field.is_required() and key not in value:
                raise missing(key, field.description or "")
        given = [key for key in cls.one_of if key in value]
        if cls.one_of and len(given) != 1:
            known = ", ".join(cls.one_of)
            raise refusal(f"got {' and '.join(given) or 'none'}, need exactly one of {known}")
        for key, partners in cls.goes_with.items():
            if key in value and not any(partner in value for partner in partners):
                raise refusal(f"goes with {' or '.join(partners)} only", key=key)
        return value


def optional(text: str) -> Any:
    """A key that may be left out, and what it holds."""
    return Field(None, description=text)


def missing(key: str, what: str) -> PydanticCustomError:
    """The error of a mapping without a key that it needs: raise it."""
    return refusal(f"the key {key!r} is missing, need {key}: {what}")


def one_or_many(value: Any) -> str:
    """Tag of a value that is one, or a list of them."""
    return "<many>" if isinstance(value, list) else "<one>"


def checked(document: Document, kind: type[File], context: Mapping[str, Any] | None = None) -> File:
    """The values of a file of this kind; validators are told the `context`."""
    try:
        return kind.model_validate(document.value, context=dict(context or {}))
    except ValidationError as error:
        found = [_complaint(item) for item in error.errors(include_url=False)]
        where, what = min(found, key=lambda item: document.line_of(item[0]))
        raise document.error(where, what) from error


def _complaint(item: Any) -> tuple[Where, str]:
    """Place and words of one error of pydantic; the tags of unions, <...>, are no places."""
    where: Where = tuple(
        step for step in item["loc"] if isinstance(step, int) or not step.startswith("<")
    )
    context = item.get("ctx", {})
    if item["type"] == "refusal":
        key = context["key"]
        return (where if key is None else (*where, key)), context["text"]
    what = f", need {context['need']}" if item["type"] == "need" else f": {item['msg']}"
    return where, f"got {shown(item['input'])}{what}"


@contextlib.contextmanager
def at(document: Document, where: Where, *, about: str = "", files: bool = False) -> Iterator[None]:
    """Give what a constructor refuses the file, line and field it comes from.

    What the constructor says it is `about` is left out; of `files` that are named there it is said
    which of them is wrong.
    """
    try:
        yield
    except InvalidScenario as error:
        if not files:
            raise
        raise document.error(where, str(error)) from error
    except (ValueError, LookupError) as error:
        said = str(error)
        for step in (*where, *([about] if about else [])):
            said = said.removeprefix(f"{step}: ").removeprefix(f"{step} ")
        raise document.error(where, said) from error


def keys_of(part: type[BaseModel], kind: Any) -> Mapping[str, str]:
    """The key of a part by the parameter of what is made of it: the same, or with its unit."""
    return {
        field.name: key
        for field in dataclasses.fields(kind)
        for key in (field.name, *(f"{field.name}_{unit}" for unit in UNITS))
        if key in part.model_fields
    }


def made(kind: type[Kind], part: BaseModel, **instead: Any) -> Kind:
    """The value that a part states; what the part leaves out is as the value has it by itself."""
    stated = {name: getattr(part, key) for name, key in keys_of(type(part), kind).items()}
    return kind(**({k: v for k, v in stated.items() if v is not None} | instead))


def stated(part: type[BaseModel], value: Any, **instead: Any) -> dict[str, Any]:
    """What a part says of a value, key by key: nothing of what is as if left out."""
    said = {key: getattr(value, name) for name, key in keys_of(part, type(value)).items()} | instead
    plain = {key: one.tolist() if isinstance(one, np.ndarray) else one for key, one in said.items()}
    return {
        key: plain[key]
        for key, field in part.model_fields.items()
        if plain.get(key) is not None and plain[key] != field.default
    }

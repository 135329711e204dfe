"""Building blocks of the scenario schema: strict numbers, errors that say what would be right."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar

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
    model_validator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from maneuver_automaton._limits import FARTHEST


def need(text: str) -> PydanticCustomError:
    """The error of a value that is not what the file needs there: raise it."""
    return PydanticCustomError("need", "need {need}", {"need": text})


class Need:
    """Annotation: whatever is wrong with the value, say that it has to be `text`."""

    def __init__(self, text: str) -> None:
        self.text = text

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.custom_error_schema(
            handler(source),
            custom_error_type="need",
            custom_error_message="need {need}",
            custom_error_context={"need": self.text},
        )


class Several:
    """Annotation: a list of `at_least` to `at_most` items, described by `text`."""

    def __init__(self, text: str, *, at_least: int, at_most: int | None = None) -> None:
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


def _within_limits(value: float) -> float:
    if abs(value) > FARTHEST:
        raise need(f"a number of at most {FARTHEST:g} in size")
    return value


_Small = AfterValidator(_within_limits)
Number = Annotated[float, Strict(), AllowInfNan(False), Need("a finite number"), _Small]
Positive = Annotated[float, Strict(), AllowInfNan(False), Gt(0), Need("a positive number"), _Small]
NotNegative = Annotated[
    float, Strict(), AllowInfNan(False), Ge(0), Need("a finite number of at least 0"), _Small
]
Count = Annotated[int, Strict(), Ge(1), Need("a whole number of at least 1")]
Text = Annotated[str, Strict(), Need("a text")]
Name = Annotated[str, Strict(), Field(pattern=r"\S"), Need("a name, a text that is not empty")]
Point = Annotated[
    tuple[Number, Number], Several("a point [x, y], two numbers", at_least=2, at_most=2)
]
Polygon = Annotated[tuple[Point, ...], Several("a list of at least 3 points [x, y]", at_least=3)]


def _rising(value: tuple[float, float]) -> tuple[float, float]:
    if not value[0] < value[1]:
        raise need("an interval [low, high] with low < high")
    return value


Interval = Annotated[
    tuple[Number, Number],
    Several("an interval [low, high], two numbers", at_least=2, at_most=2),
    AfterValidator(_rising),
]


class Part(BaseModel):
    """A mapping of the scenario file: its keys are those of the class, no others."""

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
                raise PydanticCustomError("at_key", "", {"key": key, "need": cls.instead[key]})
            if key not in keys:
                raise PydanticCustomError(
                    "unknown_key",
                    "unknown key {key}",
                    {"key": key, "near": nearest(key, list(keys)), "known": ", ".join(keys)},
                )
        for key, field in keys.items():
            if key in value and value[key] is None:
                what = field.description if field.is_required() else "a value, or no such key"
                raise PydanticCustomError("at_key", "", {"key": key, "need": what or "a value"})
            if field.is_required() and key not in value:
                raise PydanticCustomError(
                    "missing_key",
                    "misses the key {key}",
                    {"key": key, "what": field.description or ""},
                )
        given = [key for key in cls.one_of if key in value]
        if cls.one_of and len(given) != 1:
            raise PydanticCustomError(
                "one_of",
                "got {given}, need exactly one of {known}",
                {"given": " and ".join(given) or "none", "known": ", ".join(cls.one_of)},
            )
        for key, partners in cls.goes_with.items():
            if key in value and not any(partner in value for partner in partners):
                raise PydanticCustomError(
                    "alone",
                    "{key} needs {partners}",
                    {"key": key, "partners": " or ".join(partners)},
                )
        return value


def one_or_many(value: Any) -> str:
    """Tag of a value that is one, or a list of them."""
    return "<many>" if isinstance(value, list) else "<one>"


def nearest(word: str, known: list[str]) -> str:
    """The known word that looks most like `word`."""
    return difflib.get_close_matches(word, known, n=1, cutoff=0.0)[0]

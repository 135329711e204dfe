"""Entries of result files: a table of keys, each with its type and meaning, that serves both ways.

An entry is a TypedDict. A key states the attribute of its name, of its name less the unit at its
end (`time_s`: `time`), or that which `of` names. `entry` makes one of a value, and `made` the value
of one; pydantic checks files against the same table, and its JSON Schema and docs come from it.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Mapping
from enum import Enum
from types import UnionType
from typing import (
    Annotated,
    Any,
    NamedTuple,
    NotRequired,
    TypeVar,
    Union,
    cast,
    get_args,
    get_origin,
    get_type_hints,
)

import numpy as np
from pydantic import AllowInfNan, Field, Strict
from typing_extensions import is_typeddict

T = TypeVar("T")


def says(text: str) -> Any:
    """What a key means, for the JSON Schema."""
    return Field(description=text)


class of(NamedTuple):  # noqa: N801, it stands in annotations, as `says` does
    """The attribute that a key states, where its name does not say it."""

    attribute: str


Number = Annotated[float, Strict(), AllowInfNan(False)]
Known = Number | None  # null where there is none, or no limit
Whole = Annotated[int, Strict()]
Flag = Annotated[bool, Strict()]
Positive = Annotated[float, Strict(), AllowInfNan(False), Field(gt=0.0)]
Numbers = list[Number]
Pairs = list[tuple[Number, Number]]


def number(value: float | None) -> float | None:
    """A number for strict JSON; None where there is none, or no limit."""
    return None if value is None or math.isinf(value) else float(value)


def or_inf(value: float | None) -> float:
    """A number of a file, where null is no limit."""
    return math.inf if value is None else float(value)


class Key(NamedTuple):
    """A key of an entry."""

    name: str
    hint: Any  # its type
    needed: bool
    attributes: tuple[str, ...]  # which it may state; the first that there is counts


@functools.cache
def keys_of(form: Any) -> tuple[Key, ...]:
    """The keys of an entry, in order.

    Examples
    --------
    >>> from typing_extensions import TypedDict
    >>> Row = TypedDict("Row", {"time_s": Number, "goal": Annotated[Whole, of("goal_index")]})
    >>> [(key.name, key.attributes) for key in keys_of(Row)]
    [('time_s', ('time_s', 'time')), ('goal', ('goal_index',))]
    """
    keys = []
    for name, hint in get_type_hints(form, include_extras=True).items():
        needed = get_origin(hint) is not NotRequired
        within = hint if needed else get_args(hint)[0]
        named = tuple(one.attribute for one in get_args(within)[1:] if isinstance(one, of))
        keys.append(Key(name, hint, needed, named or (name, name.rpartition("_")[0] or name)))
    return tuple(keys)


def entry(form: type[T], value: Any, /, **given: Any) -> T:
    """What a value says, key by key; `given` are those that it does not have itself.

    What is infinite is None, as is everything about a value of None. Keys that a file may lack are
    left out where the value has no such attribute, or is None.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from typing_extensions import TypedDict
    >>> Row = TypedDict("Row", {"time_s": Known, "name": str, "more": NotRequired[str]})
    >>> entry(Row, SimpleNamespace(time=np.inf), name="a")
    {'time_s': None, 'name': 'a'}
    """
    row = {}
    for key in keys_of(cast("Any", form)):
        if key.name in given:
            row[key.name] = _stated(given[key.name], key.hint)
        elif value is None:
            row |= {key.name: None} if key.needed else {}
        elif (its := [one for one in key.attributes if hasattr(value, one)]) or key.needed:
            row[key.name] = _stated(getattr(value, its[0] if its else key.name), key.hint)
    return cast("T", row)


def made(kind: type[T], row: Mapping[str, Any], form: Any, /, **given: Any) -> T:
    """The value that an entry states, of a class whose other fields are `given`.

    Examples
    --------
    >>> from typing_extensions import TypedDict
    >>> Place = NamedTuple("Place", [("time", float), ("at", tuple[float, ...]), ("name", str)])
    >>> Row = TypedDict("Row", {"time_s": Known, "at": Numbers})
    >>> made(Place, {"time_s": None, "at": [1, 2]}, Row, name="a")
    Place(time=inf, at=(1.0, 2.0), name='a')
    """
    types = _types_of(cast("Any", kind))
    for key in keys_of(form):
        field = next((one for one in key.attributes if one in types), None)
        if field is not None and field not in given and key.name in row:
            given[field] = _meant(row[key.name], types[field], key.hint)
    return kind(**given)


_types_of = functools.cache(get_type_hints)


def _options(hint: Any) -> Iterator[Any]:
    """The types that a hint is of, less what is said about them."""
    if get_origin(hint) in (Annotated, NotRequired):
        yield from _options(get_args(hint)[0])
    elif get_origin(hint) in (Union, UnionType):
        for one in get_args(hint):
            yield from _options(one)
    else:
        yield hint


@functools.cache
def _bare(hint: Any) -> Any:
    """The type of a hint that may be None too."""
    return next(one for one in _options(hint) if one is not type(None))


def _stated(value: Any, hint: Any) -> Any:
    if value is None:
        return None
    bare = _bare(hint)
    origin, inner = get_origin(bare), get_args(bare)
    if is_typeddict(bare):
        return value if isinstance(value, dict) else entry(bare, value)
    if bare is float:
        return number(value)
    if isinstance(value, Enum):
        return value.value
    if origin is dict:
        return {key: _stated(one, inner[1]) for key, one in dict(value).items()}
    if isinstance(value, np.ndarray) and np.isfinite(value).all():
        return value.tolist()
    if origin is list:
        rows = value.tolist() if isinstance(value, np.ndarray) else value
        return [_stated(one, inner[0]) for one in rows]
    if origin is tuple:
        return tuple(_stated(one, its) for one, its in zip(value, inner, strict=True))
    return bare(value) if bare in (int, bool, str) else value


def _meant(value: Any, kind: Any, hint: Any) -> Any:
    """What an entry's value is in the field of a class."""
    bare, options = _bare(kind), list(_options(kind))
    if value is None:
        return None if type(None) in options else math.inf
    origin, inner = get_origin(bare), get_args(bare)
    its = get_args(_bare(hint))
    if is_typeddict(_bare(hint)):
        return made(bare, value, _bare(hint))
    if origin is np.ndarray:
        return np.array(value, dtype=np.float64)
    if origin is tuple:
        types = inner[:1] if inner[1:] == (...,) else inner
        rows, hints = value, its
        if isinstance(value, dict):  # of names to numbers: pairs
            rows, hints = value.items(), (tuple.__class_getitem__(its),)
        return tuple(
            _meant(one, types[k % len(types)], hints[k % len(hints)]) for k, one in enumerate(rows)
        )
    if bare is float or (isinstance(bare, type) and issubclass(bare, Enum)):
        return bare(value)
    return value

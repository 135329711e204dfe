"""Array aliases, and how every value takes the numbers that it is given."""

from __future__ import annotations

import functools
import math
import reprlib
from collections.abc import Callable, Sequence
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
OWN = {"float": float, "int": int, "bool": bool}
REAL = "biuf"  # kinds of NumPy's types that are real numbers
FEW = 32  # numbers that are looked at faster one by one


def as_array(
    name: str, value: ArrayLike, *, last: int | Sequence[int] | None = None, infinite: bool = False
) -> Array:
    """`value` as finite float64 with `last` components in its last axis; `name` is for messages.

    Real numbers of any type, no text and no dates, and of any shape where `last` is None; elements
    of a group are their poses. The array is in the order of C, and `value` itself if it is one.
    `infinite`: times may be so.
    """
    try:
        known = np.asarray(value)
        if known.dtype.kind == "O":
            read = [one.pose if hasattr(one, "inverse") else _float(one) for one in known.flat]
            known = np.array(read).reshape(known.shape + np.shape(read)[1:])
        if known.dtype.kind not in REAL:
            raise TypeError
        array = np.asarray(known, dtype=np.float64, order="C")
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"{name}: got {reprlib.repr(value)}, need numbers") from error
    if last is not None:
        admitted = (last,) if isinstance(last, int) else tuple(last)
        if array.ndim == 0 or array.shape[-1] not in admitted:
            need = " or ".join(str(n) for n in admitted)
            raise ValueError(f"{name}: got shape {array.shape}, need {need} components last")
    held = array[~np.isinf(array)] if infinite else array
    few = held.size <= FEW
    if not (all(map(math.isfinite, held.ravel().tolist())) if few else np.isfinite(held).all()):
        raise ValueError(f"{name}: got {held[~np.isfinite(held)].flat[0]}, need finite numbers")
    return array


def freeze(instance: Any, name: str, *, last: int | Sequence[int] | None = None) -> None:
    """Replace the field `name` of a frozen dataclass by a checked, read-only copy."""
    array = np.array(as_array(name, getattr(instance, name), last=last))
    array.setflags(write=False)
    object.__setattr__(instance, name, array)


def plain_numbers(instance: Any) -> None:
    """Replace the numbers in the fields of a frozen dataclass by Python's own.

    Kernels are compiled for float64 and int64: for float32, or an integer where a float is stated,
    they would be compiled anew, and round otherwise. Fields that state arrays are for `freeze`.
    """
    for name, kind, may_be_none in _numbers_of(instance.__class__):
        value = getattr(instance, name)
        if not (value.__class__ is OWN.get(kind) or (value is None and may_be_none)):
            what = f"{instance.__class__.__name__}: {name}"
            object.__setattr__(instance, name, _read(what, value, kind))


@functools.cache
def _numbers_of(kind: type) -> tuple[tuple[str, str, bool], ...]:
    """The fields of a dataclass that are numbers, of which kind, and whether they may be None."""
    stated = ((one.name, *str(one.type).partition(" | None")[:2]) for one in fields(kind))
    return tuple((name, kind, bool(none)) for name, kind, none in stated if kind in NUMBERS)


def _read(what: str, value: Any, kind: str) -> Any:
    convert, need = NUMBERS[kind]
    try:
        return convert(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"{what}: got {reprlib.repr(value)}, need {need}") from error


def _float(value: Any) -> float:
    if isinstance(value, float) and not isinstance(value, np.generic):
        return value  # perhaps of a kind of its own, which says more than the number
    known = np.asarray(value)
    if known.ndim or known.dtype.kind not in (*REAL, "O") or isinstance(value, str | bytes):
        raise TypeError
    return float(value)


def _int(value: Any) -> int:
    _float(value)
    number = int(value)
    if number != value:
        raise ValueError
    return number


def as_number(name: str, value: Any) -> float:
    """A number that is handed in, as Python's own, whatever type it is written in."""
    return float(value if value.__class__ is float else _read(name, value, "float"))


def as_whole(name: str, value: Any) -> int:
    """A whole number that is handed in, as `as_number` reads numbers."""
    return int(value if value.__class__ is int else _read(name, value, "int"))


NUMBERS: dict[str, tuple[Callable[[Any], Any], str]] = {
    "float": (_float, "a number"),
    "int": (_int, "a whole number"),
    "bool": (lambda value: bool((0, 1).index(_int(value))), "True or False"),
    "tuple[float, float]": (lambda values: tuple(map(_float, values)), "two numbers"),
    "tuple[float, ...]": (lambda values: tuple(map(_float, values)), "numbers"),
}


def check_range(
    what: str,
    value: float | None,
    *,
    least: float | None = None,
    unit: str = "",
    infinite: bool = False,
) -> None:
    """Raise a ValueError if a number is not positive, or not at least `least`; None is no number.

    `infinite`: it may be so.
    """
    inside = value is None or (value > 0.0 if least is None else value >= least)
    if not inside or (value == math.inf and not infinite):
        need = "finite" if inside else "positive" if least is None else f"at least {least:g}"
        raise ValueError(f"{what} must be {need}, got {value}{unit and ' ' + unit}")


def check_fields(
    about: str,
    instance: Any,
    *names: str,
    least: float | None = None,
    unit: str = "",
    infinite: bool = False,
) -> None:
    """Raise a ValueError if one of these fields is out of its range; see `check_range`."""
    for name in names:
        what, value = f"{about}: {name}", getattr(instance, name)
        check_range(what, value, least=least, unit=unit, infinite=infinite)


def wrapped(angle: ArrayLike) -> Array:
    """Angles [rad] modulo a full turn, in [-pi, pi]."""
    return np.asarray(np.remainder(np.asarray(angle) + np.pi, 2 * np.pi) - np.pi, dtype=np.float64)


def vector_text(vector: Array) -> str:
    """Numbers in a row, with 4 significant digits."""
    if vector.ndim > 1:
        return ", then ".join(vector_text(row) for row in vector)
    return f"({', '.join(f'{value:.4g}' for value in vector)})"

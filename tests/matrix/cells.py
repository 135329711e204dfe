"""Cells of the matrix: a vehicle and a feature, tried within a time, and what came of it."""

from __future__ import annotations

import signal
import time
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from tests.matrix.features import FEATURES
from tests.matrix.measuring import Costlier, Nothing
from tests.matrix.rows import Feature
from tests.matrix.vehicles import VEHICLES, Vehicle

WORKS, NOTHING, IGNORED, ERROR, REFUSED, COSTLIER, SENSELESS = (".", "F", "I", "E", "R", "p", "-")
SECONDS = 60  # of one cell, at most


class TooLong(Exception):
    """A cell took more than its time."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What came of one cell."""

    feature: str
    vehicle: str
    sign: str
    reason: str  # empty if it works
    seconds: float


def makes_sense(feature: Feature, vehicle: Vehicle) -> bool:
    """Whether a cell exists."""
    return feature.applies(vehicle)


def cells(
    features: Sequence[str] = tuple(FEATURES), vehicles: Sequence[str] = tuple(VEHICLES)
) -> Iterator[tuple[str, str]]:
    """Names of feature and vehicle of every cell that makes sense, vehicle by vehicle."""
    for vehicle in vehicles:
        for feature in features:
            if makes_sense(FEATURES[feature], VEHICLES[vehicle]):
                yield feature, vehicle


def tried(feature: str, vehicle: str, *, seconds: int = SECONDS) -> Outcome:
    """What comes of a cell; nothing that it raises gets out."""
    began = time.monotonic()
    sign, reason = WORKS, ""
    try:
        with _at_most(seconds):
            FEATURES[feature](VEHICLES[vehicle])
        if told := FEATURES[feature].refused(VEHICLES[vehicle]):
            sign, reason = REFUSED, told
    except Exception as error:  # noqa: BLE001  # whatever it is, it is this cell's alone
        sign, reason = sign_of(error), _line(error)
    return Outcome(
        feature=feature, vehicle=vehicle, sign=sign, reason=reason, seconds=time.monotonic() - began
    )


def sign_of(error: Exception) -> str:
    """What kind of fault an exception is."""
    kinds: tuple[tuple[type[Exception], str], ...] = (
        (Costlier, COSTLIER),
        (Nothing, NOTHING),
        (TooLong, NOTHING),
        (AssertionError, IGNORED),
        (ValueError, REFUSED),
        (TypeError, REFUSED),
    )
    return next((sign for kind, sign in kinds if isinstance(error, kind)), ERROR)


def _line(error: Exception) -> str:
    first = (str(error).splitlines() or [""])[0]
    where = traceback.extract_tb(error.__traceback__)[-1]
    place = "" if isinstance(error, AssertionError) else f" ({where.name})"
    return f"{type(error).__name__}: {first}{place}"[:300]


@contextmanager
def _at_most(seconds: int) -> Iterator[None]:
    def late(*_: object) -> None:
        raise TooLong(f"more than {seconds} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)

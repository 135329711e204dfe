"""Which values of a test are tried in the default run; the others are tried with `-m slow`."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Any

import pytest
from hypothesis import settings

FEW, MANY = 15, 50  # numbers that Hypothesis draws for a law, in the default run and with -m slow


def quick_are(
    quick: Collection[Any], values: Iterable[Any], *, exhaustive: bool = False
) -> list[Any]:
    """The values as parameters of a test, all but `quick` of them marked as slow, or exhaustive."""
    slow = [pytest.mark.slow, *([pytest.mark.exhaustive] if exhaustive else [])]
    return [pytest.param(one, marks=() if one in quick else slow) for one in values]


def draws(many: int) -> int:
    """How many numbers Hypothesis draws for a test: a quarter of `many` in the default run."""
    return many if settings.default.max_examples == MANY else many // 4

"""Pictures, films and pages show what they showed: texts, legends, artists, and where they are."""

from __future__ import annotations

import pytest

from tests.goldens.measured import kept
from tests.goldens.pictures import CASES, DIGITS
from tests.search.cases import compiled_only

ONE_DIGIT = 1.5 * 10.0**-DIGITS  # two machines may round a number differently


def differences(before, now, at=""):
    """Where two records differ, and what they hold there."""
    if isinstance(before, dict) and isinstance(now, dict):
        keys = list(dict.fromkeys([*before, *now]))
        return [
            row
            for key in keys
            for row in differences(before.get(key), now.get(key), f"{at}.{key}" if at else key)
        ]
    if isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        pairs = enumerate(zip(before, now, strict=True))
        return [row for k, (one, other) in pairs for row in differences(one, other, f"{at}[{k}]")]
    numbers = isinstance(before, int | float) and isinstance(now, int | float)
    if numbers and abs(now - before) <= ONE_DIGIT + 1e-6 * abs(before):
        return []
    return [] if before == now else [f"{at}: {now!r}, was {before!r}"]


def test_every_case_is_kept_and_no_other():
    assert list(kept("pictures")) == list(CASES)


@compiled_only
@pytest.mark.parametrize("name", CASES)
def test_what_is_shown_is_the_same(name):
    assert differences(kept("pictures")[name], CASES[name]()) == []

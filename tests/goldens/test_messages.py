"""Bad inputs get the messages and exit codes that they got before, to the letter."""

from __future__ import annotations

import pytest

from tests.goldens.measured import kept
from tests.goldens.messages import cases

CASES = cases()


def test_every_case_is_kept_and_no_other():
    assert list(kept("messages")) == list(CASES)


@pytest.mark.parametrize("name", CASES)
def test_the_message_is_the_same(name):
    assert CASES[name]() == kept("messages")[name]

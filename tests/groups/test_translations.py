"""The factory of translation groups."""

from __future__ import annotations

import pytest

from maneuver_automaton.groups import translations


def test_one_class_for_each_dimension():
    assert translations(2) is translations(2)
    assert translations(2) is not translations(3)
    assert translations(3).coordinates == ("x", "y", "z")
    assert translations(4).coordinates == ("x1", "x2", "x3", "x4")


def test_there_is_no_space_without_dimension():
    with pytest.raises(ValueError, match="translations: got n = 0, need at least 1"):
        translations(0)

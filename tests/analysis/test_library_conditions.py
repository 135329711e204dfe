"""Which libraries reach every pose."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.analysis import check_library

REST, AHEAD, LEFT, RIGHT, ARC = (
    [0.0, 0.0, 0.0],
    [1.5, 0.0, 0.0],
    [0.0, 0.0, 1.0],
    [0.0, 0.0, -2.0],
    [1.0, 0.0, 1.0],
)


def test_all_conditions_hold():
    report = check_library([ARC, REST, AHEAD, LEFT, RIGHT], max_trims=3)
    assert report.holds
    assert report.missing == ()
    assert str(report) == "library reaches every pose by turn, move, turn"


@pytest.mark.parametrize(
    ("twists", "max_trims", "message"),
    [
        ([AHEAD, LEFT], None, r"no rest, with body velocity \(0, 0, 0\)"),
        ([REST, LEFT, ARC], None, r"no forward straight, with body velocity \(v > 0, 0, 0\)"),
        ([REST, LEFT, [-1.0, 0.0, 0.0]], None, "no forward straight"),
        ([REST, LEFT, [1.0, 0.5, 0.0]], None, "no forward straight"),
        ([REST, AHEAD, ARC], None, "no spin"),
        ([REST, AHEAD, LEFT], 2, "words of at most 2 trims, need 3"),
        (np.zeros((0, 3)), 1, "at most 1 trims.*no rest.*no forward straight.*no spin"),
    ],
)
def test_what_is_missing_is_named(twists, max_trims, message):
    report = check_library(twists, max_trims=max_trims)
    assert not report.holds
    with pytest.raises(ValueError, match=message):
        raise ValueError(report)


def test_an_unfit_library_is_refused():
    with pytest.raises(ValueError, match=r"body_velocities: got shape \(3,\), need \(m, 3\)"):
        check_library([1.0, 0.0, 0.0])

"""Rows of what is to be exported, whatever it is, and tables of them."""

from __future__ import annotations

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton.recording import recording_to_write
from tests.exports.cases import VALUES, assert_close, ends


def driver(value):
    """The one that drives."""
    (mover,) = recording_to_write(value).movers
    return mover


@pytest.mark.parametrize("name", list(VALUES))
@pytest.mark.parametrize("step", [None, 0.3])
def test_rows_lead_from_the_first_pose_to_the_last(name, step):
    value = VALUES[name]()
    driven = driver(value)
    rows = driven.rows(step=step)
    first, last = ends(value)
    assert_close(rows.pose[0], first)
    assert_close(rows.pose[-1], last)
    assert (np.diff(rows.time) > 0.0).all()
    assert_close(rows.time[[0, -1]], [driven.start_time, driven.start_time + driven.duration])
    if step is not None:
        assert_close(rows.time[:-1], driven.start_time + step * np.arange(len(rows.time) - 1))


def test_what_is_no_plan_is_told():
    problem = VALUES["among obstacles"]().problem
    empty = ma.PlanResult(problem=problem, status=ma.PlanStatus.NO_PLAN, reason="none at all")
    with pytest.raises(ValueError) as error:
        recording_to_write(empty)
    assert str(error.value) == "the result has no plan to write: none at all"
    with pytest.raises(TypeError) as wrong:
        recording_to_write(3)
    assert str(wrong.value).startswith("recording: got int, need a Plan, PlanResult")

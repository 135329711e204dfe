"""Work in pieces: the same results, here or in processes."""

from __future__ import annotations

import importlib.util

import pytest

from maneuver_automaton._parallel import in_parallel


@pytest.mark.parametrize("jobs", [1, 2])
def test_results_come_in_order_or_as_they_are_done(jobs):
    pieces = list(range(-4, 5))
    assert list(in_parallel(abs, pieces, jobs=jobs)) == [abs(piece) for piece in pieces]
    done = in_parallel(abs, pieces, jobs=jobs, order="as done")
    assert sorted(done) == sorted(abs(piece) for piece in pieces)


def test_nothing_to_do():
    assert list(in_parallel(abs, [], jobs=2)) == []


def test_no_jobs():
    with pytest.raises(ValueError) as error:
        in_parallel(abs, [1], jobs=0)
    assert str(error.value) == "jobs must be at least 1, got 0"


@pytest.mark.skipif(importlib.util.find_spec("distributed") is not None, reason="Dask is installed")
def test_without_dask():
    with pytest.raises(ValueError) as error:
        list(in_parallel(abs, [1], scheduler="local"))
    assert str(error.value) == (
        "scheduler: got 'local', but Dask is not installed; need `pip install distributed`"
    )

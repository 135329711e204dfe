"""What searches share is made once, and kept by whoever holds it."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from maneuver_automaton.search import prepared
from maneuver_automaton.search.prepared import Prepared


@pytest.fixture
def made(monkeypatch):
    """A list of what was made, by callers that remember two values of each kind."""
    monkeypatch.setattr(prepared, "MOST", 2)
    monkeypatch.setattr(prepared, "RECENT", Prepared())
    return []


def maker(made):
    def make(number, *, sign=1):
        made.append(sign * number)
        return [sign * number]

    return make


def test_each_keeps_its_own(made):
    make = maker(made)
    holders = [Prepared() for _ in range(5)]
    first = [one.once(make, k) for k, one in enumerate(holders)]
    assert [one.once(make, k) for k, one in enumerate(holders)] == first
    assert made == [0, 1, 2, 3, 4]


def test_what_was_made_last_is_shared(made):
    make = maker(made)
    assert Prepared().once(make, 1) is Prepared().once(make, 1)
    assert prepared.RECENT.once(make, 1, sign=-1) == [-1]
    assert made == [1, -1]


def test_the_oldest_is_forgotten(made):
    make = maker(made)
    holder = Prepared()
    for number in (1, 2, 3, 1):
        holder.once(make, number)
    assert made == [1, 2, 3, 1]


def test_memory_in_use_is_nobody_elses():
    prepared = Prepared()
    arrays = [prepared.room(n, kind) for n in (10, 1000, 10) for kind in (np.float64, np.int64)]
    for one, other in itertools.combinations(arrays, 2):
        assert not np.shares_memory(one, other)
    kept = arrays.pop()
    del arrays, one, other
    again = [prepared.room(5, np.float64) for _ in range(9)]
    assert not any(np.shares_memory(kept, one) for one in again)

"""Results are kept with the value they are worked out from."""

from __future__ import annotations

import gc
import itertools
import pickle
import weakref
from typing import Any

import numpy as np
import pytest

from maneuver_automaton import Automaton, Unicycle
from maneuver_automaton._kept import Prepared, kept_by_first
from maneuver_automaton.costs import Cost
from maneuver_automaton.words.library import moving_trims


class Owner:
    """A value that something is worked out from."""


@pytest.fixture
def worked():
    """What was worked out, and the function that does."""
    done: list[tuple[Any, ...]] = []

    @kept_by_first
    def work(owner, number, *, sign=1):
        done.append((owner, sign * number))
        return [sign * number]

    return done, work


def test_many_owners_in_turn_do_not_evict_each_other(worked):
    done, work = worked
    owners = [Owner() for _ in range(50)]
    first = [work(owner, 1) for owner in owners]
    assert all(work(owner, 1) is one for owner, one in zip(owners, first, strict=True))
    assert len(done) == 50


@pytest.mark.slow
def test_results_go_with_their_owner(worked):
    done, work = worked
    owner = Owner()
    gone = weakref.ref(owner)
    work(owner, 1)
    done.clear()
    del owner
    gc.collect()
    assert gone() is None


def test_a_library_of_another_process_works_them_out_again():
    robot = Automaton.of_controls(Unicycle(), {"ahead": (1.0, 0.0), "spin": (0.0, 1.0)})
    cost = Cost(time=1.0)
    here = moving_trims(robot, cost)
    there = pickle.loads(pickle.dumps(robot))
    assert moving_trims(robot, cost) is here
    assert moving_trims(there, cost) is not here
    assert moving_trims(there, cost).rates.tolist() == here.rates.tolist()


# -- what searches share, kept by whoever holds it


def test_memory_in_use_is_nobody_elses():
    prepared = Prepared()
    arrays = [prepared.room(n, kind) for n in (10, 1000, 10) for kind in (np.float64, np.int64)]
    for one, other in itertools.combinations(arrays, 2):
        assert not np.shares_memory(one, other)
    kept = arrays.pop()
    del arrays, one, other
    again = [prepared.room(5, np.float64) for _ in range(9)]
    assert not any(np.shares_memory(kept, one) for one in again)

"""Results are kept with the value they are worked out from."""

from __future__ import annotations

import gc
import pickle
import weakref
from typing import Any

import pytest

from maneuver_automaton import Automaton, Unicycle, _kept
from maneuver_automaton._kept import kept_by_first
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


def test_each_argument_has_a_result_of_its_own(worked):
    _, work = worked
    owner = Owner()
    assert work(owner, 1) is not work(owner, 2)
    assert work(owner, 2, sign=-1) == [-2]


def test_the_oldest_result_is_forgotten(worked, monkeypatch):
    done, work = worked
    monkeypatch.setattr(_kept, "MOST", 2)
    owner = Owner()
    for number in (1, 2, 3, 1):
        work(owner, number)
    assert [number for _, number in done] == [1, 2, 3, 1]


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

"""Plans, closed loops and libraries written by an earlier version load, and mean the same."""

from __future__ import annotations

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton.errors import InvalidScenario
from tests.goldens.measured import EQUAL, kept, share_dearer
from tests.goldens.written import (
    FILES,
    LIBRARIES,
    LOOPS,
    PLANS,
    SHORT,
    of_library,
    of_plan,
    resumed,
)
from tests.search.cases import compiled_only

FOUND = [name for name in PLANS if kept("files")[name]["status"] == "found"]
SHARE = 1e-3  # by which the rest of a loop with inertia may be dearer: its steps go by the clock


def test_every_file_is_kept_and_no_other():
    assert sorted(path.stem for path in FILES.iterdir()) == sorted([*PLANS, *LOOPS, *LIBRARIES])
    assert list(kept("files")) == [*PLANS, *LOOPS, *LIBRARIES]


@pytest.mark.parametrize("name", FOUND)
def test_a_plan_loads(name):
    before, now = kept("files")[name], of_plan(ma.load_plan(FILES / f"{name}.json"))
    assert now["primitives"] == before["primitives"]
    np.testing.assert_allclose(now["durations"], before["durations"], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(now["poses"], before["poses"], atol=1e-8)


def test_a_file_without_a_plan_says_so():
    with pytest.raises(InvalidScenario, match=r"holds no plan, its status is 'goal_blocked'$"):
        ma.load_plan(FILES / "plan_none.json")


@compiled_only
@pytest.mark.parametrize("name", LOOPS)
def test_a_loop_that_was_stopped_goes_on(name):
    before, rest = kept("files")[name], resumed(name)
    assert rest.reached
    assert len(rest.steps) + SHORT <= before["steps"]
    most = SHARE if name == "loop_maneuvers" else EQUAL
    assert share_dearer(rest.cost, before["cost"]) <= most


@pytest.mark.parametrize("name", LIBRARIES)
def test_a_library_loads(name):
    path = FILES / f"{name}.json"
    model = LIBRARIES[name]().model
    own = isinstance(model, ma.UserModel)
    library = ma.load_library(path, model=model if own else None)
    assert of_library(library) == kept("files")[name]

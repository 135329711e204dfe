"""Closed loops: the values of their steps, or a cheaper loop; no other guarantee is broken."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.goldens.loops import all_loops
from tests.goldens.measured import (
    EQUAL,
    LONGER,
    dearer,
    driven,
    kept,
    record_of_loop,
    share_dearer,
)
from tests.quickly import quick_are
from tests.search.cases import compiled_only

LOOPS = all_loops()
QUICK = [name for name, loop in LOOPS.items() if loop.quick]
WITH_INERTIA = [name for name, loop in LOOPS.items() if loop.inertia]
KINEMATIC = [name for name in LOOPS if name not in WITH_INERTIA]
SHARE = 1e-3  # by which a loop with inertia may be dearer than the cheapest of five


def test_every_loop_is_kept_and_no_other():
    assert list(kept("loops")) == list(LOOPS)


def against(name, before, now, *, share: float) -> str:
    """What is wrong with a later loop, empty if nothing."""
    if (now["status"], now["reached"]) != (before["status"], before["reached"]):
        return f"{name}: {now['status']}, was {before['status']}"
    more = set(now["guarantees"]) - set(before["guarantees"])
    if more:
        return f"{name}: broke {', '.join(sorted(more))}"
    if now["steps"] > before["steps"]:
        return f"{name}: {now['steps']} steps, were {before['steps']}"
    most = share + dearer().get(f"loop/{name}", {"share": 0.0})["share"]
    risen = share_dearer(now["cost"], before["cost"])
    if risen > most:
        return f"{name}: cost {now['cost']} is {risen:.3g} dearer than {before['cost']}"
    return ""


@compiled_only
@pytest.mark.parametrize("name", quick_are(QUICK, KINEMATIC))
def test_a_loop_is_the_same_or_cheaper(name):
    before, now = kept("loops")[name], driven(name)
    problem = against(name, before, now, share=EQUAL)
    assert not problem, problem
    same_cost = abs(share_dearer(now["cost"], before["cost"])) <= EQUAL
    if same_cost and f"loop/{name}" not in dearer():
        scale = EQUAL * max(1.0, *before["values"])
        assert now["values"] == pytest.approx(before["values"], rel=EQUAL, abs=scale)


@compiled_only
@pytest.mark.parametrize("name", quick_are(QUICK, WITH_INERTIA, exhaustive=True))
def test_a_loop_with_inertia_is_not_much_dearer(name):
    before, problem = kept("loops")[name], ""
    for longer in LONGER:
        loop = replace(LOOPS[name], time_limit=longer * LOOPS[name].time_limit)
        problem = against(name, before, record_of_loop(loop.run()), share=SHARE)
        if not problem:
            return
    pytest.fail(problem)

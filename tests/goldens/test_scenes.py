"""Kinematic vehicles: the word and the cost that were planned once, or a cheaper plan."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.automaton import Plan
from tests.goldens.inertia import all_with_inertia
from tests.goldens.loops import all_loops
from tests.goldens.measured import (
    EQUAL,
    against_kept,
    dearer,
    kept,
    planned,
    record_of,
)
from tests.goldens.scenes import all_kinematic
from tests.quickly import quick_are
from tests.search.cases import compiled_only

SCENES = all_kinematic()
QUICK = [name for name, scene in SCENES.items() if scene.quick]
LONGEST = "obstacles/11"  # 17 s
MOST = 1e-3  # share by which a plan may be dearer where a reason is given
EXACT = 1e-6  # [m or rad] durations are kept to 13 digits


def test_every_scene_is_kept_and_no_other():
    assert list(kept("scenes")) == list(SCENES)


@compiled_only
@pytest.mark.parametrize(
    "name",
    [row for name in SCENES for row in quick_are(QUICK, [name], exhaustive=name == LONGEST)],
)
def test_the_plan_is_the_same_or_cheaper(name):
    problem = against_kept(name, kept("scenes")[name], record_of(planned(name)))
    assert not problem, problem


def risen(names) -> float:
    """By how much the sum of the costs of some scenes has risen, as a share."""
    before = {name: kept("scenes")[name].get("cost") for name in names}
    now = {name: planned(name).cost for name in names}
    both = [name for name in names if before[name] is not None and now[name] is not None]
    old = sum(before[name] for name in both)
    return (sum(now[name] for name in both) - old) / old


@compiled_only
def test_the_sum_of_the_quick_ones_does_not_rise():
    assert risen([name for name in QUICK if name not in dearer()]) <= EQUAL


@compiled_only
@pytest.mark.exhaustive
@pytest.mark.slow
def test_the_sum_of_all_but_those_with_a_reason_does_not_rise():
    assert risen([name for name in SCENES if name not in dearer()]) <= EQUAL


@pytest.mark.parametrize("name", [name for name, one in kept("scenes").items() if "cost" in one])
def test_what_is_kept_is_a_plan_of_its_scene(name):
    """Word and durations lead from the start to the goal at the cost that is kept."""
    one, problem = kept("scenes")[name], SCENES[name].problem
    trims = tuple(problem.automaton[trim] for trim in one["word"])
    plan = Plan(problem.start, trims, durations=one["durations"], start_time=problem.start_time)
    assert problem.cost_of(plan) == pytest.approx(one["cost"], rel=1e-9, abs=1e-12)
    scale = max(1.0, float(np.abs(problem.start[:2]).max()))
    goal = problem.goals[one["goal"]]
    off_m, off_rad = goal.off(plan.end)
    assert off_m - goal.tolerance_m < EXACT * scale
    assert off_rad - goal.tolerance_rad < EXACT * scale


def test_what_may_be_dearer_says_why():
    known = {*SCENES, *all_with_inertia(), *(f"loop/{name}" for name in all_loops())}
    for name, entry in dearer().items():
        assert name in known, name
        assert set(entry) == {"reason", "share"}, name
        assert entry["reason"], name
        assert 0.0 <= entry["share"] <= MOST, name


BEFORE = {"status": "found", "cost": 2.0, "goal": 0, "word": ["a"], "durations": [2.0]}
LOST = {"status": "no_plan"}


@pytest.mark.parametrize(
    ("before", "now", "passes"),
    [
        (BEFORE, BEFORE, True),
        (BEFORE, BEFORE | {"cost": 2.0 + 1e-9}, True),
        (BEFORE, BEFORE | {"cost": 2.0 + 1e-8}, False),
        (BEFORE, BEFORE | {"word": ["b"]}, False),
        (BEFORE, BEFORE | {"cost": 1.9, "word": ["b"]}, True),
        (BEFORE, LOST, False),
        (LOST, BEFORE, True),
        (LOST, {"status": "unreachable"}, False),
        ({"status": "unreachable"}, BEFORE, False),
    ],
)
def test_what_counts_as_the_same_or_cheaper(before, now, passes):
    assert (not against_kept("none of the scenes", before, now)) is passes

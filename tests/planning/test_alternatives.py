"""Alternatives are other motions, free and exact too, and cost more and more."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.same_motion import same_motion
from maneuver_automaton.collision import Box, Zone
from maneuver_automaton.costs import Cost
from maneuver_automaton.planning import plan
from maneuver_automaton.problem import Problem, SearchSettings
from tests.planning.test_within_tolerance import STONE, VEHICLES
from tests.quickly import quick_are
from tests.solids import check_plan

LIMIT = 60.0  # [s] a limit that a busy machine does not reach
SHORTER = 8.0  # [s] improvement takes as long as it may; a plan is there at once


def furthest(one: Plan, other: Plan) -> float:
    """Greatest difference of two plans at equal shares of their times [m, rad]."""
    shares = np.linspace(0.0, 1.0, 400)
    off = one.pose_at(shares * one.duration) - other.pose_at(shares * other.duration)
    return float(np.abs(off).max())


def assert_they_differ(result, n):
    assert len(result.alternatives) == n
    costs = [result.cost, *(one.cost for one in result.alternatives)]
    assert costs == sorted(costs)
    plans = [result.plan, *(one.plan for one in result.alternatives)]
    for k, one in enumerate(plans):
        assert min((furthest(one, other) for other in plans[:k]), default=1.0) > 0.03
        slow = check_plan(result.problem, one, 0)
        assert slow.passes(result.problem, 0), slow
        assert max(slow.terminal_m, slow.terminal_rad) < 1e-8


@pytest.mark.parametrize("name", VEHICLES)
def test_alternatives_in_free_space_differ(name):
    problem = Problem(VEHICLES[name], [0, 0, 0], [4.5, 1, 0.5], cost=Cost(time=1.0))
    assert_they_differ(plan(problem, time_limit=LIMIT, alternatives=3), 3)


@pytest.mark.parametrize("name", quick_are(list(VEHICLES)[:1], VEHICLES))
def test_alternatives_among_obstacles_pass_them_otherwise(name):
    problem = Problem(
        VEHICLES[name],
        [0, 0, 0],
        [4.5, 1, 0.5],
        obstacles=[STONE],
        footprint=Box([0.4, 0.3]),
        search=SearchSettings(max_expansions=20_000),
    )
    result = plan(problem, time_limit=SHORTER, alternatives=2)
    assert_they_differ(result, 2)
    sides = {side_of(one) for one in (result.plan, *(a.plan for a in result.alternatives))}
    assert sides == {True, False}  # one plan passes the stone on its other side


def side_of(one: Plan) -> bool:
    """Whether a plan passes the stone on its left."""
    poses = one.pose_at(np.linspace(0.0, one.duration, 500))
    at = int(np.argmin(np.abs(poses[:, 0] - 2.2)))
    return bool(poses[at, 1] > 0.5)


def test_alternatives_keep_to_the_zones():
    slow = Zone(shape=Box([2.0, 0.6], [2.2, 0.5]), trims=("spin", "acw"))
    problem = Problem(VEHICLES["unicycle"], [0, 0, 0], [4.5, 1, 0.5], zones=(slow,))
    problem = replace(problem, search=SearchSettings(max_expansions=2000))
    result = plan(problem, time_limit=SHORTER, alternatives=2)
    assert result.alternatives
    for one in (result.plan, *(a.plan for a in result.alternatives)):
        poses = one.pose_at(np.linspace(0.0, one.duration, 500))
        inside = (np.abs(poses[:, 0] - 2.2) < 0.99) & (np.abs(poses[:, 1] - 0.5) < 0.29)
        assert not inside.any()  # no trim that is admitted there drives through


def test_one_motion_has_many_words():
    ahead, left = VEHICLES["dubins"]["straight"], VEHICLES["dubins"]["left"]
    once = Plan([0, 0, 0], (ahead,), durations=[2.0])
    twice = Plan([0, 0, 0], (ahead, left, ahead), durations=[1.0, 4e-7, 1.0])
    turned = Plan([0, 0, 0], (ahead, left, ahead), durations=[0.5, 1.0, 0.5])
    assert same_motion(once, twice)
    assert not same_motion(once, turned)
    assert not same_motion(once, Plan([0, 0, 0], (ahead,), durations=[1.9]))
    tiny = [Plan([0, 0, 0], (ahead,), durations=[t]) for t in (1e-4, 2e-4)]
    assert not same_motion(*tiny)  # tolerances follow the length of the way

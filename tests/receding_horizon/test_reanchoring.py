from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maneuver_automaton.automaton import Plan
from maneuver_automaton.problem import Goal, Horizon
from maneuver_automaton.receding_horizon.rest_of_plan import (
    missed,
    quickest,
    reanchored,
    rejoining,
    same_word,
)
from tests.receding_horizon.loops import parking_loop
from tests.search.cases import TABLE_2, without_rest

BEST = ("cw", "straight", "spin", "rest")
FEW = settings(max_examples=15)
OFF = st.tuples(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1), st.floats(-0.1, 0.1))


def planned(problem) -> Plan:
    """The best plan of the parking loop, its times rounded and solved again."""
    by_name = {trim.name: trim for trim in problem.automaton.trims}
    times = [1.369438406, 0.8164965809, 1.369438406, 4.4446266071]
    plan = Plan(problem.start, tuple(by_name[name] for name in BEST), durations=times)
    solved = same_word(problem, plan, problem.goals[0], pad=by_name["rest"])
    assert solved is not None
    return solved


@given(off=OFF)
@FEW
def test_the_same_word_meets_the_goal_from_elsewhere(off):
    problem = parking_loop()
    plan = planned(problem)
    here = replace(problem, start=problem.start + np.array(off))
    solved = same_word(here, plan, problem.goals[0], pad=problem.automaton.trims[0])
    assert solved is not None
    assert missed(solved, problem.goals[0]) <= 1e-9
    assert solved.duration == pytest.approx(8.0, abs=1e-9)
    assert solved.word == BEST


@given(off=OFF, fixed=st.booleans(), after=st.integers(0, 3))
@FEW
def test_every_plan_ends_at_the_goal_in_time(off, fixed, after):
    problem = parking_loop()
    plan = planned(problem)
    horizon = problem.horizon if fixed else Horizon(max_trims=4)
    tail = Plan(plan.switching_poses[after], plan.trims[after:], durations=plan.durations[after:])
    here = replace(problem, start=tail.start + np.array(off), horizon=horizon)
    pad = problem.automaton.trims[0] if fixed else None
    found = list(reanchored(here, tail, problem.goals[0], pad=pad))
    assert found
    for one in found:
        assert one.start.tolist() == here.start.tolist()
        assert missed(one, problem.goals[0]) <= 1e-9
        if fixed:
            assert one.duration == pytest.approx(8.0, abs=1e-8)


def test_a_word_that_does_not_span_gives_way_to_a_detour():
    # straight, then spin: two times for three conditions
    problem = parking_loop()
    plan = planned(problem)
    tail = Plan(plan.switching_poses[1], plan.trims[1:], durations=plan.durations[1:])
    here = replace(problem, start=tail.start + np.array([0.1, 0.2, 0.3]))
    assert same_word(here, tail, problem.goals[0], pad=problem.automaton.trims[0]) is None
    assert all(
        missed(one, problem.goals[0]) <= 1e-9
        for one in reanchored(here, tail, problem.goals[0], pad=problem.automaton.trims[0])
    )


def test_a_plan_to_another_goal_is_not_rejoined():
    problem = parking_loop()
    plan = planned(problem)
    other = Goal(pose=[1.0, 1.0, 0.5])
    here = replace(problem, goals=(other,))
    found = list(rejoining(here, plan, other, pad=problem.automaton.trims[0]))
    assert found
    assert all(missed(one, other) <= 1e-9 for one in found)


def test_a_plan_that_takes_too_long_is_none():
    problem = parking_loop(horizon=Horizon(max_time=3.0))
    plan = planned(parking_loop())
    assert same_word(problem, plan, problem.goals[0], pad=None) is None
    assert list(reanchored(problem, plan, problem.goals[0], pad=None)) == []


def test_without_rest_nothing_pads():
    problem = parking_loop(without_rest(TABLE_2), horizon=Horizon(time=50.0))
    nothing = Plan(problem.start, (), durations=[])
    assert list(rejoining(problem, nothing, problem.goals[0], pad=None)) == []


def test_an_empty_plan_leads_to_the_goal_by_steering():
    problem = parking_loop(horizon=Horizon())
    nothing = Plan(problem.start, (), durations=[])
    assert same_word(problem, nothing, problem.goals[0], pad=None) is None
    (found,) = reanchored(problem, nothing, problem.goals[0], pad=None)
    assert missed(found, problem.goals[0]) <= 1e-9


def test_a_free_heading_is_solved_and_rejoined():
    problem = parking_loop(horizon=Horizon())
    goal = Goal(pose=[0.0, 0.0, 0.0], free_heading=True)
    here = replace(problem, goals=(goal,), start=[0.1, 1.1, 0.2])
    plan = planned(parking_loop())
    solved = same_word(here, plan, goal, pad=None)
    assert solved is not None
    assert solved.duration < plan.duration  # rest costs nothing, and does not last for ever
    found = list(reanchored(here, plan, goal, pad=None))
    assert len(found) > 1
    assert all(missed(one, goal) <= 1e-9 for one in found)


def test_least_time_keeps_the_number_of_trims():
    hurry = quickest(parking_loop())
    assert hurry.horizon.max_trims == 4
    assert hurry.horizon.time is None
    assert hurry.rates.tolist() == [1.0] * 5


@pytest.mark.parametrize(
    ("pose", "free", "expected"),
    [
        ((3.0, 4.0, 0.0), False, 5.0),
        ((0.1, 0.0, -6.0 * math.pi + 0.5), False, 0.5),
        ((0.1, 0.0, 2.0), True, 0.1),
        ((0.0, 0.0, 0.2, 2.0), False, 2.0),
    ],
)
def test_how_far_a_plan_misses_its_goal(pose, free, expected):
    goal = Goal(pose=np.zeros(len(pose)), free_heading=free)
    stays = Plan(pose, (), durations=[])
    assert missed(stays, goal) == pytest.approx(expected, abs=1e-12)

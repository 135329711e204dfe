"""What holds of every closed loop, whatever the library, the cost and the way to go."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maneuver_automaton.costs import Cost
from maneuver_automaton.groups import SE2, SE2xR, group_of
from maneuver_automaton.problem import Goal, Horizon, Problem
from maneuver_automaton.receding_horizon import Disturbance, promises, simulate
from tests.compare import assert_same_motion
from tests.receding_horizon.loops import off_goal, totals
from tests.search.cases import (
    REEDS_SHEPP,
    REVERSED_SPIN,
    TABLE_2,
    helicopter,
    robot,
    without_rest,
)

LIBRARIES = {
    "table 2": robot(TABLE_2),
    "reversed spin": robot(REVERSED_SPIN),
    "reeds-shepp": robot(REEDS_SHEPP),
    "no rest": robot(without_rest(TABLE_2)),
    "straights and spins": robot(
        {
            "rest": (0.0, 0.0),
            "ahead": (1.0, 0.0),
            "back": (-0.5, 0.0),
            "left": (0.0, 1.0),
            "right": (0.0, -0.7),
        }
    ),
}
COSTS = [
    Cost(effort=1.0),
    Cost(effort=1.0, norm=0.5),
    Cost(time=1.0),
    Cost(effort=0.5, time=0.5),
    Cost(length=1.0, time=0.2, switch=0.2, direction_change=0.5),
]
POSES = st.tuples(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5), st.floats(-3.0, 3.0))
STEPS = st.sampled_from([0.7, 1.0, 2.3])
FEW = settings(max_examples=8)


@st.composite
def problems(draw) -> Problem:
    library = LIBRARIES[draw(st.sampled_from(sorted(LIBRARIES)))]
    start, goal = draw(POSES), draw(POSES)
    cost = draw(st.sampled_from(COSTS))
    rests = not library.body_velocities.any(axis=1).all()
    fixed = rests and cost.time == 0.0 and draw(st.booleans())
    horizon = Horizon(time=20.0, max_trims=4) if fixed else Horizon(max_trims=3)
    free = not (fixed or cost.switch) and draw(st.booleans())
    return Problem(library, start, Goal(pose=goal, free_heading=free), cost=cost, horizon=horizon)


@given(problem=problems(), step=STEPS)
@FEW
def test_undisturbed_it_arrives_and_what_is_promised_is_kept(problem, step):
    loop = simulate(problem, step=step, steps=150)
    assert loop.reached
    assert list(loop.violations) == []
    total = totals(loop)
    assert (total[1:] <= total[:-1] + 1e-8 * (1.0 + total[:-1])).all()
    assert loop.cost <= (loop.steps[0].value if loop.steps else 0.0) * (1.0 + 1e-9) + 1e-9
    assert all(audit.passed for audit in loop.audits)
    for one in loop.steps:
        assert one.lower_bound <= one.value * (1.0 + 1e-9)
        assert off_goal(loop, one) <= 1e-8
        if problem.horizon.time is not None:
            assert one.plan.duration == pytest.approx(problem.horizon.time, abs=1e-8)
    bound = promises(problem, step=step).most_steps(loop.steps[0].value) if loop.steps else None
    assert bound is None or len(loop.steps) <= bound


@given(problem=problems(), step=STEPS, by=POSES)
@FEW
def test_a_moved_problem_has_the_moved_closed_loop(problem, step, by):
    # one search a step: where plans tie, rounding may choose either, so values are compared there
    move = SE2(np.array(by))
    one, two = (simulate(p, step=step, steps=6) for p in (problem, problem.moved(move)))
    assert len(one.steps) == len(two.steps)
    assert two.reached == one.reached
    for a, b in zip(one.steps, two.steps, strict=True):
        if a.plan.word != b.plan.word:
            assert b.value == pytest.approx(a.value, abs=1e-9)
            return
        assert b.value == pytest.approx(a.value, abs=1e-9)
        assert b.accumulated_cost == pytest.approx(a.accumulated_cost, abs=1e-9)
        assert_same_motion(move @ SE2(a.pose), SE2(b.pose), atol=1e-7, modulo_turn=True)
    assert_same_motion(move @ SE2(one.poses), SE2(two.poses), atol=1e-7, modulo_turn=True)


@pytest.mark.parametrize("by", [(3.0, -2.0, 0.7), (0.0, 0.0, math.pi), (-100.0, 40.0, -9.0)])
@pytest.mark.parametrize("controls", [TABLE_2, REVERSED_SPIN])
def test_parking_elsewhere_is_parking(controls, by):
    problem = Problem(
        robot(controls),
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0],
        cost=Cost(effort=1.0),
        horizon=Horizon(time=8.0, max_trims=4),
    )
    move = SE2(np.array(by))
    one, two = (simulate(p, step=1.0) for p in (problem, problem.moved(move)))
    assert [step.plan.word for step in one.steps] == [step.plan.word for step in two.steps]
    assert [step.value for step in one.steps] == pytest.approx(
        [step.value for step in two.steps], abs=1e-9
    )
    assert [step.replanned for step in one.steps] == [step.replanned for step in two.steps]
    assert_same_motion(move @ SE2(one.poses), SE2(two.poses), atol=1e-9, modulo_turn=True)


@pytest.mark.slow
@given(
    to=st.tuples(
        st.floats(3.0, 6.0), st.floats(-6.0, 6.0), st.floats(-2.0, 2.0), st.floats(-2.0, 2.0)
    )
)
@settings(max_examples=3)
def test_a_helicopter_moved_has_the_loop_moved(to):
    problem = Problem(helicopter(), [0.0] * 4, to, cost=Cost(time=1.0))
    move = SE2xR(np.array([7.0, -5.0, 2.0, 30.0]))
    one, two = (simulate(p, step=2.0, steps=30) for p in (problem, problem.moved(move)))
    for loop in (one, two):
        assert loop.reached
        assert list(loop.violations) == []
        assert all(audit.passed for audit in loop.audits)
    assert one.steps[0].value == pytest.approx(two.steps[0].value, abs=1e-9)


@given(problem=problems(), seed=st.integers(0, 99))
@settings(max_examples=8)
def test_disturbed_every_plan_still_ends_at_the_goal_from_where_it_is(problem, seed):
    upset = Disturbance(position_m=0.03, heading_rad=0.03, pushes={1: (0.3, -0.2, 0.5)}, seed=seed)
    loop = simulate(problem, step=1.0, steps=5, disturbance=upset)
    for one, pose in zip(loop.steps, loop.poses, strict=False):
        assert one.pose.tolist() == pose.tolist()
        assert one.plan.start.tolist() == pose.tolist()
        assert off_goal(loop, one) <= 1e-8
    assert all(audit.passed for audit in loop.audits)


@given(problem=problems(), step=STEPS)
@settings(max_examples=8)
def test_time_begins_when_the_problem_does(problem, step):
    one = simulate(problem, step=step, steps=3)
    two = simulate(replace(problem, start_time=100.0), step=step, steps=3)
    assert two.times - 100.0 == pytest.approx(one.times)
    assert group_of(3)(two.poses).pose == pytest.approx(one.poses)

"""Controls between those of a library: no solver finds cheaper ones, and plans stay exact."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.audit import audit_plan
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.costs import Cost
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import Car, Unicycle
from maneuver_automaton.problem import Goal, Horizon, Problem
from maneuver_automaton.refinement.retiming import effort_report, retime
from maneuver_automaton.refinement.shooting import least_effort

ROBOT = Automaton.of_controls(
    Unicycle(),
    {"ahead": (1.0, 0.0), "back": (-1.0, 0.0), "left": (1.0, 1.0), "right": (1.0, -1.0),
     "spin": (0.0, 1.0), "rest": (0.0, 0.0)},
)  # fmt: skip


def random_plan(rng, n=5):
    trims = tuple(ROBOT.trims[k] for k in rng.integers(len(ROBOT.trims), size=n))
    start = np.append(rng.uniform(-5.0, 5.0, 2), rng.uniform(-3.0, 3.0))
    return Plan(start, trims, durations=rng.uniform(0.2, 2.0, n))


def effort(plan):
    return effort_report(plan).cost


@pytest.mark.parametrize("seed", range(12))
def test_it_ends_where_the_other_plan_does_and_costs_less(seed):
    plan = random_plan(np.random.default_rng(seed))
    better = least_effort(plan, Unicycle())
    assert np.abs(better.end - plan.end).max() <= 1e-12
    assert better.duration == pytest.approx(plan.duration, abs=1e-12)
    assert effort(better) <= effort(plan)
    fine = least_effort(plan, Unicycle(), pieces=64)
    assert effort(fine) <= 1.001 * effort(retime(plan, Unicycle()).after)
    goal = Goal(pose=plan.end)
    assert audit_plan(better, goal, Unicycle()).passed


@pytest.mark.parametrize("seed", range(4))
def test_a_moved_plan_is_driven_with_the_same_controls(seed):
    rng = np.random.default_rng([2, seed])
    plan = random_plan(rng)
    by = SE2(np.append(rng.uniform(-50.0, 50.0, 2), rng.uniform(-3.0, 3.0)))
    moved = Plan((by @ SE2(plan.start)).pose, plan.trims, durations=plan.durations)
    one, other = (least_effort(each, Unicycle()) for each in (plan, moved))
    controls = [np.array([trim.control for trim in each.trims]) for each in (one, other)]
    np.testing.assert_allclose(controls[0], controls[1], atol=1e-5)
    assert effort(one) == pytest.approx(effort(other), rel=1e-9)


def test_a_detour_becomes_a_straight_line():
    left, right = ROBOT["left"], ROBOT["right"]
    plan = Plan([0.0, 0.0, 0.0], (left, right, right, left), durations=[0.5] * 4)
    better = least_effort(plan, Unicycle(), pieces=4)
    speed = plan.end[0] / 2.0
    assert effort(better) == pytest.approx(2.0 * speed**2, rel=1e-9)


def test_limits_are_kept():
    plan = random_plan(np.random.default_rng(5))
    free = least_effort(plan, Unicycle())
    most = np.abs([trim.control for trim in free.trims]).max(axis=0)
    limits = 0.97 * np.stack([-most, most], axis=-1)
    tight = least_effort(plan, Unicycle(), limits=limits)
    if tight is not plan:
        controls = np.array([trim.control for trim in tight.trims])
        assert (np.abs(controls) <= limits[:, 1] + 1e-12).all()
    assert effort(free) <= effort(tight) <= effort(plan)


def test_weights_of_the_effort_count():
    plan = random_plan(np.random.default_rng(6))
    costly = Cost(effort=2.0, time=1.0, effort_matrix=[[1.0, 0.0], [0.0, 25.0]])
    problem = Problem(ROBOT, plan.start, plan.end, cost=costly, horizon=Horizon(time=plan.duration))
    assert problem.cost_of(least_effort(plan, Unicycle(), cost=costly)) < problem.cost_of(
        least_effort(plan, Unicycle())
    )


def test_what_does_not_last_is_left_alone():
    plan = Plan([0.0, 0.0, 0.0], (), durations=[])
    assert least_effort(plan, Unicycle()) is plan


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"pieces": 1}, "pieces must be at least 2, got 1"),
        ({"cost": Cost(time=1.0)}, r"the terms\(\) of the cost have to be effort, and at most"),
        ({"cost": Cost(effort=1.0, switch=1.0)}, "and at most time beside it"),
        ({"limits": [[-1.0, 1.0]]}, "limits: got shape"),
    ],
)
def test_what_it_refuses(options, said):
    with pytest.raises(ValueError, match=f"least effort: .*{said}"):
        least_effort(random_plan(np.random.default_rng(0)), Unicycle(), **options)


def test_a_car_that_steers_is_refused():
    car = Car(wheelbase=2.0)
    trims = Automaton.of_controls(car, {"left": (1.0, 0.3)}).trims
    plan = Plan([0.0, 0.0, 0.0], trims, durations=[1.0])
    with pytest.raises(ValueError, match=r"least effort: the body velocity .* is not linear"):
        least_effort(plan, car)

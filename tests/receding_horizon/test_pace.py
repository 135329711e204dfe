from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton.audit import audit_plan
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.models import Unicycle
from maneuver_automaton.planning import plan
from maneuver_automaton.problem import Horizon
from maneuver_automaton.receding_horizon import Guarantee, promises, simulate
from maneuver_automaton.receding_horizon.candidates import (
    at_best_pace,
    between_trims,
    is_uniform,
)
from tests.receding_horizon.loops import EFFORT, off_goal, parking_loop, straight, totals


def test_in_closed_loop_the_value_falls_by_the_square_of_the_way():
    problem = parking_loop()
    loop = simulate(problem, step=0.5, steps=30, retimed=True)
    assert list(loop.violations) == []
    promised = promises(problem, step=0.5)
    for now, after in itertools.pairwise(loop.steps):
        least = promised.effort_decrease(now.pose, problem.goals[0])
        assert now.value - after.value >= least - 1e-12
        assert is_uniform(now.plan, EFFORT)
        assert now.plan.duration == pytest.approx(8.0)
        assert off_goal(loop, now) <= 1e-9
    assert (totals(loop)[1:-1] <= totals(loop)[:-2] + 1e-9).all()
    assert all(audit.passed for audit in loop.audits)
    # asymptotically, not in finite time: the paper's Theorem 17
    assert loop.steps_bound is None
    assert not loop.reached
    assert loop.steps[-1].value < 0.1 * loop.steps[0].value


def test_a_straight_by_hand():
    # x' = -x / T at every step: after n steps of delta, x0 (1 - delta / T)^n, and V = x^2 / T
    loop = simulate(straight(2.0), step=1.0, steps=5, retimed=True)
    ways = 2.0 * 0.75 ** np.arange(6)
    assert -loop.poses[:, 0] == pytest.approx(ways, rel=1e-9)
    assert [step.value for step in loop.steps] == pytest.approx(ways[:-1] ** 2 / 4.0, rel=1e-9)
    assert not any(step.violations for step in loop.steps)
    assert {one.guarantee for _, one in loop.violations} <= {Guarantee.EFFORT}


# --- controls between those of the library ---


def coarse(start=(0.5, 1.0, 0.3)):
    """A grid of 25 controls, in which the best ones fall between its points."""
    speeds = (-1.0, -0.5, 0.0, 0.5, 1.0)
    controls = {f"{v}, {w}": (v, w) for v in speeds for w in speeds}
    grid = Automaton.of_controls(Unicycle(), controls)
    return replace(parking_loop(), automaton=grid, start=np.array(start), horizon=Horizon(time=8.0))


def test_controls_between_those_of_a_grid_cost_less():
    problem = coarse()
    found = plan(problem).plan
    better = between_trims(problem, found, 24)
    assert problem.cost_of(better) < 0.97 * problem.cost_of(at_best_pace(problem, found))
    assert audit_plan(better, problem.goals[0], Unicycle()).passed
    controls = np.array([trim.control for trim in better.trims])
    assert np.abs(controls).max() <= 1.0  # the range of the grid


def test_in_closed_loop_all_guarantees_hold_between_trims_too():
    problem = coarse()
    loop = simulate(problem, step=0.5, steps=12, pieces=16)
    plain = simulate(problem, step=0.5, steps=12)
    assert list(loop.violations) == []
    assert loop.steps[0].value < 0.97 * plain.steps[0].value
    for step in loop.steps:
        assert off_goal(loop, step) <= 1e-9
        assert step.plan.duration == pytest.approx(8.0)
    assert (totals(loop)[1:] <= totals(loop)[:-1] + 1e-9).all()
    assert all(audit.passed for audit in loop.audits)


@pytest.mark.parametrize(
    ("options", "horizon", "said"),
    [
        ({"pieces": 1}, {"time": 8.0}, "pieces must be at least 2, or 0 for none, got 1"),
        ({"pieces": -3}, {"time": 8.0}, "pieces must be at least 2, or 0 for none, got -3"),
        ({"pieces": 8}, {}, "plans with pieces need a fixed horizon"),
        ({"pieces": 8}, {"time": 8.0, "max_trims": 4}, "need retimed and max_trims left out"),
        ({"pieces": 8, "retimed": True}, {"time": 8.0}, "need retimed and max_trims left out"),
    ],
)
def test_what_pieces_do_not_go_with(options, horizon, said):
    problem = replace(coarse(), horizon=Horizon(**horizon))
    with pytest.raises(ValueError, match=said):
        simulate(problem, step=0.5, steps=1, **options)

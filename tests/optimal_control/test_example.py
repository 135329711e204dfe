"""The paper's Example 22, and the same by a method that shares nothing with it."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.models import Unicycle
from maneuver_automaton.optimal_control import (
    Guess,
    SolveStatus,
    solve_uniform_effort_example,
)
from maneuver_automaton.optimal_control.uniform_effort import END, START, example_problem
from tests.optimal_control import pontryagin
from tests.reference_dynamics import dynamics_defect

PRINTED = 0.5141


@pytest.fixture(scope="module")
def examples():
    return {n: solve_uniform_effort_example(n) for n in (50, 200, 1000)}


@pytest.fixture(scope="module")
def shot():
    return pontryagin.extremal()


def test_the_printed_cost(examples):
    for example in examples.values():
        assert example.solution.status is SolveStatus.SOLVED
        assert example.cost == pytest.approx(PRINTED, abs=1e-4)
        assert example.solution.worst_defect < 1e-9
        assert example.solution.worst_violation == 0.0


def test_the_effort_is_uniform_but_for_the_ends(examples):
    spreads = {n: 100.0 * example.spread for n, example in examples.items()}
    assert spreads[50] == pytest.approx(19.0, abs=0.5)
    assert spreads[200] == pytest.approx(4.3, abs=0.1)
    assert spreads[1000] == pytest.approx(0.84, abs=0.02)
    inner = [example.inner_spread for example in examples.values()]
    assert inner[0] < 0.01
    assert inner[1] < inner[0] / 10.0  # falls with the square of the step
    assert inner[2] < inner[1] / 20.0


def test_the_effort_grows_in_a_straight_line_and_the_cost_does_not(examples):
    example = examples[1000]
    time = example.solution.time

    def bend(values):
        return np.abs(values - values[-1] * time / time[-1]).max() / values[-1]

    assert bend(example.accumulated_effort) < 1e-4
    assert bend(example.accumulated_cost) > 0.01
    assert example.accumulated_cost[-1] == example.cost


def test_the_smoothing_of_the_norm_does_not_matter(examples):
    for example in examples.values():
        assert 0.0 <= example.smoothing_error < 1e-9
    assert np.linalg.norm(examples[50].solution.control, axis=1).min() > 0.03


def test_shooting_by_pontryagins_conditions_agrees(examples, shot):
    times = examples[1000].solution.time
    states, _ = pontryagin.motion(shot, times=times)
    assert states[-1, 3] == pytest.approx(examples[1000].cost, abs=2e-7)
    np.testing.assert_allclose(states[:, :3], examples[1000].solution.state, atol=1e-4)
    controls = pontryagin.controls_along(shot, times)
    effort = np.einsum("ni,ij,nj->n", controls, pontryagin.MATRIX, controls)
    assert np.ptp(effort) / effort.mean() < 1e-6  # Prop. 15 without a grid


def test_the_other_rule_agrees(shot):
    example = solve_uniform_effort_example(200, rule="rk4")
    exact = pontryagin.motion(shot)[0][-1, 3]
    assert exact < example.cost < exact + 5e-5  # constant controls can only be costlier
    assert example.spread < 1e-3  # and the ends are not spoilt


def test_wild_guesses_lead_to_the_same_optimum(examples):
    rng = np.random.default_rng(5)
    share = np.linspace(0.0, 1.0, 7)
    for _ in range(4):
        state = np.outer(1.0 - share, START) + np.outer(share, END)
        state[1:-1] += rng.normal(size=(5, 3)) * [1.0, 1.0, 4.0]
        guess = Guess(state=state, control=rng.normal(size=(5, 2)) * 0.1, duration=50.0)
        again = solve_uniform_effort_example(50, guess=guess)
        assert again.cost == pytest.approx(examples[50].cost, abs=1e-8)


@pytest.mark.parametrize("rule", ["trapezoidal", "rk4"])
@pytest.mark.parametrize("nodes", [20, 33, 50, 80])
def test_every_grid_is_solved(nodes, rule):
    # with the sharp norm alone, 50 nodes with rk4 end in a cycle across its kink
    example = solve_uniform_effort_example(nodes, rule=rule)
    assert example.solution.status is SolveStatus.SOLVED
    assert example.solution.iterations < 40
    assert example.cost == pytest.approx(PRINTED, abs=2e-3)


def test_its_dynamics_are_those_of_the_unicycle():
    rng = np.random.default_rng(1)
    worst = dynamics_defect(
        example_problem(),
        Unicycle(),
        states=rng.normal(size=(20, 3)),
        controls=rng.normal(size=(20, 2)),
    )
    assert worst < 1e-15


def test_too_few_nodes_are_refused():
    with pytest.raises(ValueError) as error:
        solve_uniform_effort_example(4)
    assert str(error.value) == "uniform effort example: n_nodes must be at least 5, got 4"

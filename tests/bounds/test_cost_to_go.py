"""What was proven for one start holds for others."""

import math
from dataclasses import replace

import numpy as np
import pytest

import maneuver_automaton as ma
from maneuver_automaton.bounds import cell_proofs
from tests.bounds.test_cell_bound import WALL, among


def functions_of(problem, *, incumbent=math.inf, work=2_000_000):
    """Functions of all levels that some work proves."""
    found = cell_proofs(problem, incumbent=lambda: incumbent, ends=lambda done: done > work)
    return [proof.function for proof in found if proof.function is not None]


@pytest.mark.slow
def test_a_function_bounds_the_plans_from_other_starts():
    problem = among((), goal=(6.0, 3.0, 0.9))
    function = functions_of(problem)[0]
    rng = np.random.default_rng(5)
    shares = []
    for start in np.column_stack([rng.uniform(-4, 12, (30, 2)), rng.uniform(-3, 3, 30)]):
        shortest = ma.plan(replace(problem, start=start)).cost
        shares.append(function.anywhere(start) / shortest)
    assert max(shares) <= 1.0 + 1e-9
    assert np.median(shares) > 0.4
    assert function.anywhere(np.array([1e3, 0.0, 0.0])) == 0.0  # no cell is known there


@pytest.mark.slow
def test_a_function_of_a_tube_bounds_the_rest_of_a_plan():
    problem = among(WALL)
    result = ma.plan(problem, time_limit=1.0)
    functions = functions_of(problem, incumbent=result.cost, work=20_000_000)
    assert len(functions) > 1
    assert functions[-1].anywhere(problem.start + 0.1) == 0.0  # for poses on the way alone
    gained = []
    for time in np.linspace(0.0, 0.95, 12) * result.plan.duration:
        pose, driven = result.plan.pose_at(time), float(time)  # at 1 m/s
        for function in functions:
            bound = function.after(pose, driven)
            assert function.least - driven <= bound <= result.cost - driven + 1e-9
            gained.append(bound - (function.least - driven))
    assert max(gained) > 0.1


def test_a_plan_that_leaves_the_cells_has_to_come_back():
    problem = replace(among((), goal=(0.0, 0.0, 0.0)), start=[6.0, 3.0, 0.9])
    function = functions_of(problem)[0]  # its frame is the world's
    edge = (function.cells.low[0] + function.cells.active.shape[0]) * function.cells.size
    value = np.full_like(function.value, 1e3)  # no limit by what stays in the cells
    beyond = replace(function, value=value, at_goal=0.0).anywhere(np.array([edge - 0.1, 0.0, 0.0]))
    assert 0.0 < beyond <= 0.1 + edge + 1e-9

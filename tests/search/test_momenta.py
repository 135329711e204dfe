"""Words of four trims that the table of momenta leaves out are none of those asked for."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton._kernel_list import expect_many_calls
from maneuver_automaton.costs import Cost
from maneuver_automaton.problem import Horizon, Problem
from maneuver_automaton.search.momenta import NONE, momenta_of
from maneuver_automaton.words.library import moving_trims
from tests.search.cases import TABLE_2, compiled_only, robot
from tests.search.test_words import assert_same_solutions, search

COST = Cost(effort=1.0, time=1.0)


@compiled_only
@pytest.mark.parametrize("seed", range(8))
def test_nothing_asked_for_is_left_out(seed):
    expect_many_calls()
    rng = np.random.default_rng(seed)
    controls = {"on": (1.5, 0.0), "left": (-0.25, 1.0), "right": (-0.25, -1.0), "spin": (0.0, 1.0)}
    if seed % 2:  # straights both ways, and turns of any radius
        controls = {"on": (1.0, 0.0), "back": (-rng.uniform(0.5, 1.0), 0.0)}
        controls |= {name: tuple(rng.uniform(-1.0, 1.0, 2)) for name in "ab"}
    for goal in rng.uniform(-2.0, 2.0, (4, 3)):
        problem = Problem(robot(controls), [0, 0, 0], goal, cost=COST, horizon=Horizon(max_trims=4))
        complete = search(problem, alternatives=None)  # for which no table is looked at
        least = complete.solutions[: 2 + seed]
        pruned = search(problem, alternatives=len(least) - 1)
        assert_same_solutions(pruned, type(pruned)(status=pruned.status, solutions=least))


def test_only_small_libraries_have_a_table():
    assert momenta_of(moving_trims(robot(TABLE_2), COST)).rows.shape == (4**4, 2)
    many = {f"turn {k}": (1.0, 0.1 * k) for k in range(7)}
    assert momenta_of(moving_trims(robot(many), COST)) is NONE

"""Words of four trims that the table of momenta leaves out are none of those asked for."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from maneuver_automaton._kernel_list import expect_many_calls
from maneuver_automaton.costs import Cost
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Horizon, Problem
from maneuver_automaton.search._kernels_scan_costs import may_be_optimal
from maneuver_automaton.search.momenta import NONE, momenta_of
from maneuver_automaton.search.setup import search_setup
from maneuver_automaton.search.word_scan import Extent, scan_of
from maneuver_automaton.words.library import moving_trims
from tests.search.cases import INTERPRETED, TABLE_2, compiled_only, robot
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


def stationary_words(twists, rates, rng):
    """Words of four trims, with times for which there is a momentum: by the adjoint alone."""
    for word in rng.integers(0, len(rates), (400, 4)):
        pair, times = twists[word[:2]][:, [0, 2]], rng.uniform(0.1, 3.0, 4)
        if abs(np.linalg.det(pair)) < 1e-9:
            continue
        momentum = np.insert(np.linalg.solve(pair, rates[word[:2]]), 1, rng.normal())
        for k in (1, 2):  # the next switch comes when the next trim costs what it is worth

            def carried(time, momentum=momentum, trim=word[k]):
                return momentum @ SE2.exp(np.multiply.outer(time, twists[trim])).adjoint()

            def lack(time, carried=carried, trim=word[k + 1]):
                return carried(time) @ twists[trim] - rates[trim]

            durations = np.linspace(0.01, 6.0, 600)
            signs = np.signbit(lack(durations))
            switches = np.flatnonzero(signs[1:] != signs[:-1])
            if not switches.size:
                break
            first = rng.choice(switches)
            times[k] = brentq(lack, *durations[first : first + 2], xtol=1e-13)
            momentum = carried(times[k])
        else:
            yield word, times


@pytest.mark.skipif(not INTERPRETED, reason="only kernels call the kernel that is looked at")
def test_no_word_that_has_a_momentum_is_left_out():
    expect_many_calls()
    task = Problem(robot(TABLE_2), [0, 0, 0], [1, 1, 1], cost=COST, horizon=Horizon(max_trims=4))
    setup = search_setup(task, task.goals[0])
    scan = scan_of(task, setup, Extent(most=4, alternatives=0))
    twists, rates = setup.library.twists[:, :3], setup.library.rates
    kept = []
    for word, times in stationary_words(twists, rates, np.random.default_rng(1)):
        end = SE2.exp(times[0] * twists[word[0]])
        for k in range(1, 4):
            end = end @ SE2.exp(times[k] * twists[word[k]])
        scan.goal[:3] = end.pose
        number = np.ravel_multi_index(word, 4 * (len(rates),))
        cost = float(times @ rates[word])
        problem = scan.modes[0].kernel_problem[0]
        kept.append(may_be_optimal(problem, word, number, cost + 1e-6))
    assert len(kept) > 40
    assert all(kept)


def test_only_small_libraries_have_a_table():
    assert momenta_of(moving_trims(robot(TABLE_2), COST)).rows.shape == (4**4, 2)
    many = {f"turn {k}": (1.0, 0.1 * k) for k in range(7)}
    assert momenta_of(moving_trims(robot(many), COST)) is NONE

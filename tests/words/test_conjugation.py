"""Coasting times of words with maneuvers: against SLSQP on the word as it is, and by laws."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from maneuver_automaton._arrays import wrapped
from maneuver_automaton.groups import SE2, group_of
from maneuver_automaton.groups.se2 import chained
from maneuver_automaton.words import TimesStatus, solve_switching_times
from maneuver_automaton.words.closing import closed_at, conjugated


def joined(twists, displacements, times, start=None):
    """End of a word, group element after group element."""
    dof = len(twists[0])
    group = group_of(dof)
    pose = group(np.zeros(dof) if start is None else start)
    for k, (twist, time) in enumerate(zip(twists, times, strict=True)):
        pose = pose @ group.exp(time * np.asarray(twist))
        if k < len(displacements):
            pose = pose @ group(displacements[k])
    return pose.pose


def off(end, goal):
    gap = np.asarray(end) - goal
    gap[2] = wrapped(gap[2])
    return gap


def words(n_words, *, seed, dof=3, sizes=(3, 7)):
    rng = np.random.default_rng(seed)
    for _ in range(n_words):
        n = int(rng.integers(*sizes))
        twists = np.zeros((n, dof))
        twists[:, 0] = rng.choice([-1.0, -0.5, 0.5, 1.0, 1.5], n)
        twists[:, 2] = rng.choice([-1.0, 0.0, 0.0, 0.5, 1.0], n)
        if dof == 4:
            twists[:, 3] = rng.uniform(-0.5, 0.5, n)
        displacements = rng.uniform(-0.5, 0.5, (n - 1, dof))
        times = rng.uniform(0.2, 2.0, n)
        yield twists, 1.0 + rng.uniform(0.0, 1.0, n), displacements, times


@given(seed=st.integers(0, 10_000), dof=st.sampled_from([3, 4]))
def test_a_word_with_maneuvers_is_a_word_of_conjugated_twists(seed, dof):
    ((twists, _, displacements, times),) = words(1, seed=seed, dof=dof)
    seen, product = conjugated(twists, displacements)
    group = group_of(dof)
    inner = chained(np.zeros(dof), group.exp(times[:, None] * seen).pose)[-1]
    end = (group(inner) @ group(product)).pose
    assert np.abs(off(end, joined(twists, displacements, times))).max() < 1e-12


def test_agrees_with_slsqp_on_the_word_as_it_is():
    costlier = 0
    for twists, rates, displacements, planted in words(40, seed=2):
        goal = joined(twists, displacements, planted)
        solved = solve_switching_times(
            twists, rates, goal, displacements=displacements, guesses=[planted]
        )
        assert solved.status is not TimesStatus.FAILED
        end = joined(twists, displacements, solved.durations)
        assert np.abs(off(end, goal)).max() < 1e-9
        reference = minimize(
            lambda t, rates=rates: rates @ t,
            planted,
            jac=lambda _, rates=rates: rates,
            bounds=[(0.0, None)] * len(rates),
            constraints={
                "type": "eq",
                "fun": lambda t, w=twists, d=displacements, goal=goal: off(joined(w, d, t), goal),
            },
            method="SLSQP",
            options={"maxiter": 300, "ftol": 1e-12},
        )
        met = np.abs(off(joined(twists, displacements, reference.x), goal)).max() < 1e-7
        costlier += reference.success and met and solved.cost > reference.fun + 1e-6
    assert costlier <= 4  # both are local


@pytest.mark.parametrize("dof", [3, 4])
def test_a_fixed_total_and_least_times_are_met(dof):
    for twists, rates, displacements, planted in words(20, seed=3, dof=dof, sizes=(6, 8)):
        goal = joined(twists, displacements, planted)
        least = 0.5 * planted
        solved = solve_switching_times(
            twists,
            rates,
            goal,
            displacements=displacements,
            total=float(planted.sum()),
            least=least,
            guesses=[planted],
        )
        assert solved.status is not TimesStatus.FAILED
        assert solved.durations.sum() == pytest.approx(planted.sum(), abs=1e-9)
        assert (solved.durations >= least).all()
        assert solved.cost <= rates @ planted + 1e-9
        end = joined(twists, displacements, solved.durations)
        assert np.abs(off(end, goal)).max() < 1e-9


@given(seed=st.integers(0, 10_000), x=st.floats(-1e3, 1e3), turn=st.floats(-7.0, 7.0))
@settings(max_examples=30)
def test_a_moved_word_is_closed_by_the_same_times(seed, x, turn):
    ((twists, _, displacements, planted),) = words(1, seed=seed)
    goal = joined(twists, displacements, planted)
    near = planted + 1e-4 * np.random.default_rng(seed).normal(size=planted.size)
    here = closed_at(np.zeros(3), twists, near, goal, displacements=displacements)
    by = SE2([x, 2.0, turn])
    there = closed_at(by.pose, twists, near, (by @ SE2(goal)).pose, displacements=displacements)
    assert np.abs(here - there).max() < 1e-8
    if not np.array_equal(here, near):
        assert np.abs(off(joined(twists, displacements, here), goal)).max() < 1e-9

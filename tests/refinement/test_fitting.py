"""Plans that are made to keep to the horizon: least coasting times, a fixed and a greatest time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.budget import UNLIMITED, Budget
from maneuver_automaton.models import Car
from maneuver_automaton.problem import Goal, Horizon, Problem
from maneuver_automaton.refinement.fitting import (
    COSTLIER,
    SHORT,
    broken_condition,
    fitted_plans,
    with_lasting_coasts,
)
from maneuver_automaton.search.choose import search_insertion
from maneuver_automaton.search.result import plan_of
from tests.inertia import unicycle_automaton


def test_trims_that_are_too_short_are_prolonged_or_left_out():
    pose, robot = [4.0, 1.5, 0.7], unicycle_automaton()
    free = Problem(robot, [0.0, 0.0, 0.0], pose)
    found = search_insertion(free, free.goals[0], budget=UNLIMITED, alternatives=6)
    mended = 0
    for plan in (plan_of(free, word) for word in found.solutions):
        least = 1.05 * float(plan.durations[plan.durations > 0.0].min())
        problem = Problem(robot, [0.0, 0.0, 0.0], pose, horizon=Horizon(min_coast=least))
        assert f"less than {least:g} s" in broken_condition(problem, plan)
        fitted = list(fitted_plans(problem, plan, problem.goals[0]))
        mended += bool(fitted)
        for one in fitted:
            lasting = zip(one.trims, one.durations.tolist(), strict=True)
            moving = [time for trim, time in lasting if not trim.is_rest]
            assert all(time == 0.0 or time >= least * (1.0 - 1e-12) for time in moving)
            assert max(problem.goals[0].off(one.end)) < 1e-9
    assert mended >= 4


def test_a_fixed_time_is_met_without_a_rest():
    """Two seconds more than it takes are coasted, and it still ends at the goal."""
    goal = Goal(pose=[4.0, 1.5, 0.7], trim="1, 0")
    known = Problem(unicycle_automaton(), [0, 0, 0], goal, start_trim="1, 0")
    found = search_insertion(known, goal, budget=Budget.from_now(60.0), alternatives=5)
    plans = [plan_of(known, word) for word in found.solutions]
    total = max(one.duration for one in plans) + 0.1
    problem = Problem(
        unicycle_automaton(), [0, 0, 0], goal, start_trim="1, 0", horizon=Horizon(time=total)
    )
    fitted = [one for plan in plans for one in fitted_plans(problem, plan, goal)]
    assert fitted
    for one in fitted:
        assert one.duration == pytest.approx(total, abs=1e-9)
        assert max(goal.off(one.end)) < 1e-9


def test_one_trim_at_rest_is_padded():
    robot = unicycle_automaton()
    problem = Problem(robot, [0, 0, 0], [0, 0, 0], horizon=Horizon(time=3.0))
    rest = robot.trims[robot.rest]
    (fitted,) = fitted_plans(problem, Plan([0, 0, 0], (rest,), durations=[0.0]), problem.goals[0])
    np.testing.assert_allclose(fitted.durations, [3.0])


SHUTTLE = Automaton.of_controls(
    Car(wheelbase=0.5, max_steering=0.6),
    {f"{v} {s}": (v, s) for v in (1, -1) for s in (-0.6, -0.3, 0.0, 0.3, 0.6)} | {"rest": (0, 0)},
)


def word_of(rng, *, short, move=(0.0, 0.0, 0.0), rest=0.0):
    """A word of eight random trims from a pose, one of which is short, and a rest at its end."""
    names = [name for name in SHUTTLE.trim_names if name != "rest"]
    numbers = [int(rng.integers(len(names)))]
    while len(numbers) < 8:
        numbers += [k for k in [int(rng.integers(len(names)))] if k != numbers[-1]]
    times = rng.uniform(0.3, 2.0, 8)
    times[rng.integers(8)] = short
    trims = [SHUTTLE.trims[SHUTTLE.trim_names.index(names[k])] for k in numbers]
    rests = [SHUTTLE.trims[-1]] if rest else []
    return Plan(move, (*trims, *rests), durations=[*times, *([rest] if rest else [])])


@pytest.mark.parametrize("rest", [0.0, 3.0])
@pytest.mark.parametrize("short", [3.7e-5, 4e-3])
@pytest.mark.parametrize("seed", range(5))
def test_a_trim_of_less_than_a_control_period_is_left_out_or_lasts(seed, short, rest):
    plans = []
    for move in ((0.0, 0.0, 0.0), (1e3, -20.0, 2.0)):
        plan = word_of(np.random.default_rng(seed), short=short, move=move, rest=rest)
        horizon = Horizon(time=plan.duration if rest else None)
        problem = Problem(SHUTTLE, plan.start, plan.end, horizon=horizon)
        better = with_lasting_coasts(problem, plan, problem.goals[0], is_free=lambda _plan: True)
        assert not any(0.0 < time < SHORT for time in better.durations.tolist())
        assert max(problem.goals[0].off(better.end)) < 1e-9
        assert problem.cost_of(better) <= problem.cost_of(plan) * (1.0 + COSTLIER)
        assert not broken_condition(problem, better)
        plans.append(better)
    assert plans[0].word == plans[1].word
    assert plans[0].durations == pytest.approx(plans[1].durations, abs=1e-9)


def test_a_short_trim_stays_where_it_is_asked_for_needed_or_dear():
    plan = word_of(np.random.default_rng(0), short=1e-3)
    for horizon, is_free in (
        (Horizon(min_coast=0.0), lambda _plan: True),
        (Horizon(), lambda _plan: False),
    ):
        problem = Problem(SHUTTLE, plan.start, plan.end, horizon=horizon)
        assert with_lasting_coasts(problem, plan, problem.goals[0], is_free=is_free) is plan
    brief = Plan([0, 0, 0], SHUTTLE.trims[:1], durations=[0.01])  # nothing else leads there
    problem = Problem(SHUTTLE, brief.start, brief.end)
    assert with_lasting_coasts(problem, brief, problem.goals[0], is_free=bool) is brief


def test_between_maneuvers_a_short_trim_lasts_no_time_or_longer():
    robot, start = unicycle_automaton(), [0.0, 0.0, 0.0]
    free = Problem(robot, start, [4.0, 1.5, 0.7])
    words = search_insertion(free, free.goals[0], budget=UNLIMITED, alternatives=6).solutions
    changed = 0
    for plan in (plan_of(free, word) for word in words):
        times = plan.durations.copy()
        times[1 + int(times[1:-1].argmin())] = 5e-3
        brief = replace(plan, durations=times)
        problem = Problem(robot, start, brief.end)
        better = with_lasting_coasts(problem, brief, problem.goals[0], is_free=lambda _plan: True)
        assert better.maneuvers == brief.maneuvers
        assert max(problem.goals[0].off(better.end)) < 1e-9
        changed += not any(0.0 < time < SHORT for time in better.durations.tolist())
    assert changed >= 4

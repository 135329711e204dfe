"""Incumbents: no plan that breaks a condition of the problem is kept, and no motion twice."""

from __future__ import annotations

import functools
import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from maneuver_automaton import planning
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.automaton.same_motion import Likeness
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision import Box, Zone
from maneuver_automaton.models import Unicycle
from maneuver_automaton.planning.blocked import blocked_ends
from maneuver_automaton.planning.checking import Condition, what_is_hit
from maneuver_automaton.planning.incumbents import Candidate, Incumbents
from maneuver_automaton.planning.result import LowerBound, PlanStatus, Workspace
from maneuver_automaton.problem import Bounds, Goal, Horizon, Problem, SearchSettings
from maneuver_automaton.refinement.fitting import COSTLIER, SHORT, with_lasting_coasts

ROBOT = Automaton.of_controls(
    Unicycle(),
    {"rest": (0, 0), "ahead": (1, 0), "slow": (0.5, 0), "left": (0, 1), "right": (0, -1)},
)
FREE = Problem(ROBOT, [0, 0, 0], [4, 0, 0], footprint=Box([0.4, 0.4]))
WALL = Box([1.0, 1.0], [2.0, 0.0])


def driven(*trims, durations):
    return Plan([0, 0, 0], tuple(ROBOT[name] for name in trims), durations=durations)


AHEAD = driven("ahead", durations=[4.0])
SLOWLY = driven("slow", durations=[8.0])
TURNING = driven("left", "right", "ahead", durations=[0.5, 0.5, 4.0])


TURNED = driven("ahead", "left", durations=[4.0, 1.0])
BROKEN = {  # a problem, a plan that breaks a condition of it and has no times that would do, which
    "horizon": (replace(FREE, horizon=Horizon(max_time=5.0)), SLOWLY, Condition.WORD),
    "trims": (
        replace(FREE, goals=Goal(pose=[4, 0, 1]), horizon=Horizon(max_trims=1)),
        TURNED,
        Condition.WORD,
    ),
    "bounds": (replace(FREE, bounds=Bounds(x=(-1.0, 3.0))), AHEAD, Condition.BOUNDS),
    "obstacle": (replace(FREE, obstacles=(WALL,)), AHEAD, Condition.COLLISION),
    "zone": (
        replace(FREE, zones=(Zone(shape=WALL, trims=["rest"]),)),
        AHEAD,
        Condition.COLLISION,
    ),
    "goal": (replace(FREE, goals=Goal(pose=[4, 0, 1])), AHEAD, Condition.AUDIT),
}


def incumbents(problem, *, seconds=600.0, **more):
    return Incumbents(problem, Budget.from_now(seconds), Workspace(problem.obstacles), **more)


@pytest.mark.parametrize("name", BROKEN)
def test_what_breaks_a_condition_is_refused(name):
    problem, plan, condition = BROKEN[name]
    found = incumbents(problem)
    assert not found.offer(plan, 0)
    assert not found.plans
    assert [broken for broken, _ in found.refusals] == [condition]
    assert found.why_refused != ""
    assert found.rejected == (condition is not Condition.WORD)
    mendable = condition is Condition.WORD or problem.zones  # by polishing
    assert found.misfits == ([(plan, 0)] if mendable else [])
    answer = found.none(PlanStatus.NO_PLAN, found.why_refused)
    assert answer.plan is None
    assert "first_plan" not in answer.timing_s


def test_one_of_the_same_word_is_kept_if_it_meets_the_horizon():
    problem = replace(FREE, horizon=Horizon(time=9.0))
    found = incumbents(problem)
    assert found.offer(driven("ahead", "rest", durations=[4.0, 0.0]), 0)
    assert found.plans[0].plan.durations.tolist() == [4.0, 5.0]


def test_plans_are_kept_by_cost_each_motion_once():
    found = incumbents(FREE, alternatives=1)
    for plan in (SLOWLY, TURNING, AHEAD, driven("ahead", "left", durations=[4.0, 1e-10])):
        assert found.offer(plan, 0)
    assert [one.plan for one in found.plans] == [AHEAD, TURNING, SLOWLY]
    assert found.cost == 4.0
    assert [cost for _, cost in found.improvements] == [8.0, 5.0, 4.0]
    answer = found.found(bound=LowerBound(value=1.0, kind="distance"))
    assert (answer.plan, answer.cost, answer.gap) == (AHEAD, 4.0, 0.75)
    assert [one.plan for one in answer.alternatives] == [TURNING]
    assert answer.timing_s["first_plan"] == answer.timing_s["search"] == found.improvements[0][0]


def test_candidates_are_checked_in_turn_until_there_are_enough():
    made = []

    def make(plan):
        made.append(plan)
        return plan

    candidates = [
        Candidate(FREE.cost_of(plan), 0, functools.partial(make, plan))
        for plan in (AHEAD, AHEAD, TURNING, SLOWLY)
    ]
    found = incumbents(FREE, alternatives=1)
    found.offer_in_turn(candidates)
    assert made == [AHEAD, AHEAD, TURNING]
    assert len(found.plans) == 2


def test_what_is_not_proven_free_may_hit_something_without_a_word():
    found = incumbents(replace(FREE, obstacles=(WALL,)))
    assert not found.offer(AHEAD, 0, proven=False)
    assert not found.refusals


def test_what_a_search_has_noted_is_an_improvement_once():
    found = incumbents(FREE)
    found.note(9.0, at=0.5)
    found.note(9.5)
    found.note(4.0, at=1.5)
    assert found.offer(AHEAD, 0)  # its end closed, it costs what the search said
    assert found.improvements == [(0.5, 9.0), (1.5, 4.0)]


def test_a_short_trim_is_left_out_before_a_plan_is_checked() -> None:
    found = incumbents(FREE)
    assert found.offer(driven("ahead", "slow", durations=[3.9995, 0.001]), 0)
    assert found.plans[0].plan.durations.tolist() == [4.0]
    stated = incumbents(replace(FREE, horizon=Horizon(min_coast=0.0)))
    assert stated.offer(driven("ahead", "slow", durations=[3.9995, 0.001]), 0)
    assert stated.plans[0].plan.durations.tolist() == [3.9995, 0.001]


FAST = Automaton.of_controls(Unicycle(), {"ahead": (1, 0), "fast": (1.04, 0)})
DASH = Plan([0, 0, 0], FAST.trims, durations=[3.9896, 0.01])  # costs 3.9996, and mended 4.0


def offered_late(found: Incumbents, plan: Plan) -> None:
    """Offer a plan when there is no time to leave out its short trims."""
    found.longest_check, before = math.inf, found.longest_check
    assert found.offer(plan, 0)
    found.longest_check = before


@pytest.mark.parametrize("shown", [False, True])
def test_a_plan_without_short_trims_goes_before_a_cheaper_one_of_its_motion(shown) -> None:
    """But not before what was shown: that is never followed by what costs more."""
    costs: list[float] = []

    def show(make) -> None:
        costs.append(make(bound=LowerBound(value=1.0, kind="distance")).cost)

    problem = replace(FREE, automaton=FAST)
    found = incumbents(problem, alternatives=1)
    if shown:
        found.budget = replace(found.budget, shows=show)
    offered_late(found, DASH)
    assert [one.plan for one in found.plans] == [DASH]
    assert found.offer(replace(DASH), 0)
    answer = found.found(bound=LowerBound(value=1.0, kind="distance"))
    times = [3.9896, 0.01] if shown else [4.0]
    assert answer.plan.durations.tolist() == times
    assert answer.cost == problem.cost_of(answer.plan) == pytest.approx(sum(times), rel=1e-12)
    assert answer.gap == (answer.cost - 1.0) / answer.cost
    assert costs == ([answer.cost] if shown else [])
    after = [cost for _, cost in answer.improvements]
    assert after[-1] == answer.cost
    assert all(b <= a for a, b in itertools.pairwise(after))
    offered_late(found, Plan([0, 0, 0], FAST.trims, durations=[3.48, 0.5]))  # cheaper, of no short
    assert found.found(bound=LowerBound(value=1.0, kind="distance")).cost == pytest.approx(3.98)
    assert all(b < a for a, b in itertools.pairwise(costs))


def test_alternatives_cost_no_less_than_the_plan() -> None:
    found = incumbents(replace(FREE, automaton=FAST), alternatives=3)
    found.likeness = Likeness(per_metre=0.0, heading=0.0)
    offered_late(found, Plan([0, 0, 0], FAST.trims, durations=[4.0, 0.0]))
    offered_late(found, DASH)
    answer = found.found(bound=LowerBound(value=1.0, kind="distance"))
    assert answer.cost == 4.0
    assert answer.alternatives == ()


def room(seed: int) -> Problem:
    """A robot among boxes, by a search that counts its work."""
    rng = np.random.default_rng(seed)
    boxes = [Box(rng.uniform(0.3, 2.0, 2), rng.uniform(-2.0, 12.0, 2)) for _ in range(14)]
    backing = Automaton.of_controls(
        Unicycle(), {"ahead": (1, 0), "back": (-1, 0), "left": (1, 1), "right": (1, -1)}
    )
    while True:
        ends = rng.uniform([0, 0, -3], [10, 10, 3], (2, 3))
        problem = Problem(
            backing,
            ends[0],
            ends[1],
            obstacles=boxes,
            footprint=Box([0.6, 0.4]),
            search=SearchSettings(max_expansions=1000),
        )
        if blocked_ends(problem) is None:
            return problem


@pytest.mark.parametrize(
    "seed", [*range(3), *(pytest.param(k, marks=pytest.mark.slow) for k in range(3, 30))]
)
def test_plans_among_obstacles_have_no_short_trims(seed: int) -> None:
    problem = room(seed)
    exact = replace(problem, horizon=Horizon(min_coast=0.0))
    result, before = (planning.plan(one, time_limit=600.0) for one in (problem, exact))
    assert result.plan is not None
    assert before.cost is not None
    assert result.cost is not None
    assert result.cost <= before.cost * (1.0 + COSTLIER)
    if any(0.0 < time < SHORT for time in result.plan.durations.tolist()):
        # Without it the plan is dear, or misses the goal, or hits something.
        goal = problem.goals[0]
        other = with_lasting_coasts(problem, result.plan, goal, is_free=lambda _plan: True)
        assert other is result.plan or what_is_hit(problem, other, goal)


def test_a_short_trim_that_nothing_takes_the_place_of_gets_one_beside_it() -> None:
    """8 ms to the left at the end: no plan of two trims ends there, one of four does."""
    result = planning.plan(room(28), time_limit=600.0)
    assert result.plan is not None
    assert result.plan.word == ("right", "ahead", "right", "left")
    assert result.plan.durations.min() >= SHORT * (1.0 - 1e-9)
    assert result.cost == pytest.approx(9.3630916, rel=1e-6)  # that of three trims

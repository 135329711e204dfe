"""Incumbents: no plan that breaks a condition of the problem is kept, and no motion twice."""

from __future__ import annotations

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
from maneuver_automaton.planning.incumbents import Incumbents
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


FAST = Automaton.of_controls(Unicycle(), {"ahead": (1, 0), "fast": (1.04, 0)})
DASH = Plan([0, 0, 0], FAST.trims, durations=[3.9896, 0.01])  # costs 3.9996, and mended 4.0


def offered_late(found: Incumbents, plan: Plan) -> None:
    """Offer a plan when there is no time to leave out its short trims."""
    found.longest_check, before = math.inf, found.longest_check
    assert found.offer(plan, 0)
    found.longest_check = before


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


def test_where_the_heading_is_free_a_moment_of_another_trim_is_left_out():
    axis = np.linspace(-2.0, 2.0, 41)
    robot = Automaton.of_grid(Unicycle(), [axis, axis])
    there = Goal(pose=[4.2120714700905015, 0.9503587277779516, 0.0], free_heading=True)
    about = Goal(pose=[3.86, 2.04, 0.54], tolerance_m=0.2, tolerance_rad=0.4)
    problem = Problem(robot, [0, 0, 0], [there, about], horizon=Horizon(max_trims=3))
    result = planning.plan(problem)
    assert result.plan is not None
    assert result.plan.durations.min() >= SHORT

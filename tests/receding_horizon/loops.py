"""Closed loops and steps that several tests of this room need."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.costs import Cost
from maneuver_automaton.problem import Goal, Horizon, Problem
from maneuver_automaton.receding_horizon import ClosedLoop, Origin, Step
from tests.search.cases import TABLE_2, robot

SCENARIOS = Path(__file__).parents[2] / "scenarios"
EFFORT = Cost(effort=1.0)
AHEAD = {"rest": (0.0, 0.0), "ahead": (1.0, 0.0)}
SPIN_TOO = AHEAD | {"spin": (0.0, 1.0)}
NEAR = Goal(pose=[0.0, 0.0, 0.0], tolerance_m=0.15, tolerance_rad=0.15)


def parking_loop(
    controls=None, *, start=(0.0, 1.0, 0.0), goal=(0.0, 0.0, 0.0), **changed
) -> Problem:
    """Section 5.3 of the paper: effort, eight seconds, at most four trims."""
    settings = {"cost": EFFORT, "horizon": Horizon(time=8.0, max_trims=4)} | changed
    return Problem(robot(controls or TABLE_2), start, goal, **settings)


def straight(metres=2.0, *, controls=None, **changed) -> Problem:
    """So far ahead to the origin, in four seconds."""
    settings = {"cost": EFFORT, "horizon": Horizon(time=4.0)} | changed
    return Problem(robot(controls or AHEAD), [-metres, 0.0, 0.0], [0.0, 0.0, 0.0], **settings)


def totals(loop: ClosedLoop) -> Array:
    """What every step had spent, and what it still planned to spend."""
    return np.array([*(step.accumulated_cost + step.value for step in loop.steps), loop.cost])


def off_goal(loop: ClosedLoop, step: Step) -> float:
    """How far the plan of a step ends from its goal [m or rad]."""
    return max(loop.problem.goals[step.goal_index].off(step.plan.end))


def made_up(problem: Problem, **changed) -> Step:
    """A step that never was: ahead for a second, in a loop that closes every half second."""
    values = {
        "time": 0.0,
        "plan": Plan(problem.start, (problem.automaton.trims[1],), durations=[1.0]),
        "goal_index": 0,
        "value": 1.0,
        "applied": 0.5,
        "applied_cost": 0.5,
        "accumulated_cost": 0.0,
        "origin": Origin.FIRST,
        "replanned": False,
        "shifted_value": 1.0,
        "off_plan": 0.0,
        "bound": partial(float, 0.0),
        "exhaustive": False,
        "solve_s": 0.0,
        "number": 0,
    }
    return Step(**(values | changed))


def assert_same_steps(a: Step, b: Step) -> None:
    """Fail unless two steps are the same to the last bit, but for the time they took."""
    for name in (
        "time",
        "goal_index",
        "value",
        "applied",
        "applied_cost",
        "accumulated_cost",
        "origin",
        "replanned",
        "shifted_value",
        "off_plan",
        "lower_bound",
        "exhaustive",
        "number",
        "arrived",
    ):
        assert getattr(a, name) == getattr(b, name), f"step {a.number}: {name}"
    assert a.pose.tolist() == b.pose.tolist()
    assert a.plan.word == b.plan.word
    assert a.plan.durations.tolist() == b.plan.durations.tolist()
    for one, other in zip(a.plan.trims, b.plan.trims, strict=True):
        assert one.control.tolist() == other.control.tolist()
        assert one.body_velocity.tolist() == other.body_velocity.tolist()

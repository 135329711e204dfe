"""The kinematic vehicle behind one with inertia, and the problem it has to solve."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.costs import Cost
from maneuver_automaton.models import Model
from maneuver_automaton.models.speeds import pace_within
from maneuver_automaton.problem import Horizon, Problem
from maneuver_automaton.refinement.stop_and_steer import StopsAndSteers

SWITCH_SHARE = 0.5  # of the time to change from limit to limit, as the price of a switch


def follows_paths(model: Model) -> bool:
    """Whether a vehicle can follow the paths of a kinematic one by stopping at its switches."""
    return hasattr(model, "kinematic") and hasattr(model, "state_along")


def kinematic_problem(
    problem: Problem, *, switch: float = SWITCH_SHARE, direction_change: float = 0.0
) -> Problem:
    """The problem of the kinematic vehicle at its greatest speeds between the same obstacles.

    Its cost is time; `switch` and `direction_change` are prices in units of the time that the
    vehicle with inertia takes to change its reduced state from one limit to the other.

    Examples
    --------
    >>> from maneuver_automaton.models import SecondOrderUnicycle
    >>> from maneuver_automaton.primitives import Trim
    >>> robot = SecondOrderUnicycle(max_speed=1.0, max_turn_rate=0.5, max_acceleration=1.0,
    ...                             max_angular_acceleration=1.0)
    >>> rest = Trim(name="rest", body_velocity=[0, 0, 0], control=[0, 0], reduced_state=[0, 0])
    >>> simpler = kinematic_problem(Problem(Automaton(robot, (rest,)), [0, 0, 0], [1, 1, 0]))
    >>> simpler.automaton.controls.tolist()[0]
    [1.0, 0.5]
    """
    model = problem.automaton.model
    automaton = extreme_automaton(model)  # type: ignore[arg-type]
    slowest = float(np.max(np.ptp(model.reduced_limits, axis=1) / model.control_limits[:, 1]))
    cost = Cost(time=1.0, switch=switch * slowest, direction_change=direction_change * slowest)
    return simpler_problem(problem, automaton, cost=cost)


def simpler_problem(problem: Problem, automaton: Automaton, *, cost: Cost) -> Problem:
    """The way of a kinematic vehicle between the same obstacles, from start to goals."""
    return Problem(
        automaton,
        problem.start,
        tuple(replace(goal, trim=None) for goal in problem.goals),
        cost=cost,
        horizon=Horizon(),
        start_time=problem.start_time,
        bounds=problem.bounds,
        search=replace(problem.search, method="lattice"),
        obstacles=problem.obstacles,
        footprint=problem.footprint,
        margin=problem.margin,
    )


def extreme_automaton(model: StopsAndSteers) -> Automaton:
    """Trims of the kinematic vehicle at the limits of the reduced state, and between at zero."""
    axes = [_levels(low, high) for low, high in model.reduced_limits]
    kinematic = model.kinematic
    states = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
    twists = model.body_velocity(states, np.zeros((len(states), len(model.control_names))))
    moving = [(model.state_along(t, min(1.0, pace_within(model, t))), t) for t in twists if t.any()]
    names = kinematic.control_names
    controls = {
        ", ".join(f"{what} {v:.4g}" for what, v in zip(names, state + 0.0, strict=True)): state
        for state, _ in moving
    }
    return Automaton.of_controls(kinematic, controls)


def _levels(low: float, high: float) -> Array:
    """The limits in falling order, and zero if it lies between."""
    inner = [0.0] if low < 0.0 < high else []
    return np.array([high, *inner, low])

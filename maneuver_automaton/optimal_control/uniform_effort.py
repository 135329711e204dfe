"""The paper's example of uniform control effort: a mobile robot drives to the origin in 50 s."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array, check_range
from maneuver_automaton.groups import SE2
from maneuver_automaton.models.vehicle import Components
from maneuver_automaton.optimal_control.ipopt import SolverSettings
from maneuver_automaton.optimal_control.problem import (
    Guess,
    OptimalControlProblem,
    Rule,
    RunningCost,
    TimeGrid,
    moving_frame,
)
from maneuver_automaton.optimal_control.transcription import OptimalControlSolution, solve

START, END, DURATION_S = (0.1, 1.0, 0.8), (0.0, 0.0, 0.0), 50.0
NORM_WEIGHT = 0.1
END_NODES = 2  # at each end, which the trapezoidal rule spoils
SMOOTHING = 1e-6  # of the norm, which has a kink at zero; least |u| of the optimum: 3e-2
SOFT = 1e-2  # of the first solve, whose optimum is the guess of the next

# controls that are not zero, where the norm has its kink
EVEN_PACE = Guess(
    state=np.array([START, END]), control=np.array([[-0.02, -0.016]]), duration=DURATION_S
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class UniformEffortExample:
    """The solved example; the cost is that of the problem as it stands, without smoothing."""

    solution: OptimalControlSolution
    cost: float  # J
    smoothing_error: float  # what the smoothing of the norm adds to J
    effort: Array  # (n,) |u|_R^2 where there is a control; (n - 1,) with "rk4"
    spread: float  # (greatest - least) / mean of the effort, at all nodes
    inner_spread: float  # the same without two nodes at each end

    @property
    def accumulated_cost(self) -> Array:
        """x4 (n,): the cost up to each node."""
        return self.solution.integrals["cost"]

    @property
    def accumulated_effort(self) -> Array:
        """x5 (n,): the quadratic effort up to each node; a straight line in the limit."""
        return self.solution.integrals["effort"]


def example_problem(*, smoothing: float = SMOOTHING) -> OptimalControlProblem:
    """The problem of the example, with the norm in its cost made smooth at zero.

    ``sqrt(u1^2 + u2^2 + smoothing^2)`` is at most `smoothing` above the norm.

    Source: the paper, Example 22.
    """
    return OptimalControlProblem(
        state_names=SE2.coordinates,
        control_names=("speed", "turn_rate"),
        dynamics=moving_frame(SE2, velocity=lambda z, u: [u[0], 0.0, u[1]]),
        start=START,
        end=END,
        duration=(DURATION_S, DURATION_S),
        stage_cost=_stage_cost(smoothing),
        integrals={"cost": _stage_cost(0.0), "effort": quadratic_effort},
    )


def solve_uniform_effort_example(
    n_nodes: int = 50,
    *,
    rule: Rule = "trapezoidal",
    guess: Guess | None = None,
    settings: SolverSettings | None = None,
) -> UniformEffortExample:
    """Solve the example on `n_nodes` equidistant nodes: with a soft norm first, then a sharp one.

    From far away Newton's method may jump to and fro across the kink of the norm for ever; the
    optimum itself stays clear of it.

    The optimum has uniform quadratic effort. On a grid the trapezoidal rule gives the controls of
    the two nodes at each end too much or too little weight, so that they stray from it; the more
    nodes, the less.

    Source: the paper, Prop. 15 and Example 22.

    Parameters
    ----------
    n_nodes : int
        Nodes in time; enough for some to be inside.
    rule : "trapezoidal" or "rk4"
        The paper's rule, or the more accurate one.
    guess : Guess, optional
        Where to begin; a straight line at an even pace if left out.
    settings : SolverSettings, optional
        When to stop.

    Raises
    ------
    MissingExtra
        If CasADi is not installed.
    ValueError
        If there are too few nodes.

    Examples
    --------
    >>> found = solve_uniform_effort_example(50)
    >>> round(found.cost, 4), found.inner_spread < 0.01
    (0.5141, True)
    """
    grid = TimeGrid(n_nodes=n_nodes, rule=rule)
    least = 2 * END_NODES + 1 + n_nodes - grid.n_controls
    check_range("uniform effort example: n_nodes", n_nodes, least=least)
    guess = EVEN_PACE if guess is None else guess
    soft = solve(example_problem(smoothing=SOFT), grid, guess=guess, settings=settings)
    sharp = solve(example_problem(), grid, guess=soft.as_guess, settings=settings)
    solution = replace(
        sharp,
        iterations=soft.iterations + sharp.iterations,
        build_s=soft.build_s + sharp.build_s,
        solve_s=soft.solve_s + sharp.solve_s,
    )
    effort = np.asarray(quadratic_effort((), list(solution.control.T)), dtype=np.float64)
    cost = float(solution.integrals["cost"][-1])
    return UniformEffortExample(
        solution=solution,
        cost=cost,
        smoothing_error=solution.cost - cost,
        effort=effort,
        spread=relative_spread(effort),
        inner_spread=relative_spread(effort[END_NODES:-END_NODES]),
    )


def quadratic_effort(x: Components, u: Components) -> Any:
    """``4 u1^2 + u2^2 - 3 u1 u2``: the quadratic part of the stage cost.

    Examples
    --------
    >>> quadratic_effort((), (1.0, 2.0))
    2.0
    """
    return 4.0 * u[0] ** 2 + u[1] ** 2 - 3.0 * u[0] * u[1]


def relative_spread(values: Sequence[float] | Array) -> float:
    """Greatest less least over mean.

    Examples
    --------
    >>> relative_spread([1.0, 2.0, 3.0])
    1.0
    """
    return float(np.ptp(values) / np.mean(values))


def _stage_cost(smoothing: float) -> RunningCost:
    def stage_cost(x: Components, u: Components) -> Any:
        return quadratic_effort(x, u) + NORM_WEIGHT * np.sqrt(u[0] ** 2 + u[1] ** 2 + smoothing**2)

    return stage_cost

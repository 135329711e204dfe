"""What a solver found, and what it is worth: everything is computed again in NumPy."""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.optimal_control.problem import (
    Grid,
    Guess,
    OptimalControlProblem,
    limits_of,
)
from maneuver_automaton.optimal_control.rules import increments


class SolveStatus(enum.Enum):
    """How a solve ended; SOLVED only if the numbers hold when they are computed again."""

    SOLVED = "solved"  # a local optimum: nothing better nearby
    INFEASIBLE = "infeasible"  # nothing feasible near the guess, as far as the solver can see
    OUT_OF_BUDGET = "out_of_budget"  # iterations or time
    FAILED = "failed"  # the solver gave up, or its numbers do not hold


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class OptimalControlSolution:
    """States and controls on the grid, whatever the status; the numbers say how good they are."""

    status: SolveStatus
    reason: str  # the solver's own word, or what did not hold
    time: Array  # (n,) [s]
    state: Array  # (n, n_x)
    control: Array  # (n, n_u) at the nodes; (n - 1, n_u) between them with "rk4"
    cost: float
    integrals: Mapping[str, Array]  # (n,) each: of the problem's integrals, from zero
    iterations: int
    build_s: float  # [s] to set the problem up, derivatives included
    solve_s: float  # [s] in the solver
    worst_defect: float  # greatest difference between a step of the rule and the next node
    worst_violation: float  # greatest excess over start, end and limits

    @property
    def duration(self) -> float:
        """Final time [s]."""
        return float(self.time[-1])

    @property
    def as_guess(self) -> Guess:
        """Guess for another grid, or another problem with the same state and control."""
        return Guess(state=self.state, control=self.control, duration=self.duration)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Evaluation:
    """A candidate, computed in floating-point numbers by NumPy: see `evaluate`."""

    cost: float
    integrals: Mapping[str, Array]
    worst_defect: float
    worst_violation: float


def evaluate(
    problem: OptimalControlProblem, grid: Grid, *, state: Array, control: Array, duration: float
) -> Evaluation:
    """Cost, defects and violations of states (n, n_x) and controls (m, n_u) on a grid.

    Nothing of the solver is used: the functions of the problem are called on arrays.

    Examples
    --------
    >>> cart = OptimalControlProblem(
    ...     state_names=("x",), control_names=("u",), dynamics=lambda x, u: [u[0]],
    ...     start=(0.0,), end=(1.0,), duration=(1.0, 1.0), stage_cost=lambda x, u: u[0] ** 2)
    >>> found = evaluate(cart, Grid(n_nodes=2), state=np.array([[0.0], [1.0]]),
    ...                  control=np.ones((2, 1)), duration=1.0)
    >>> found.cost, found.worst_defect, found.worst_violation
    (1.0, 0.0, 0.0)
    """
    integrands = [problem.stage_cost or _nothing, *problem.integrals.values()]
    n_states = problem.n_states

    def field(x: Array, u: Array) -> Array:
        count = x.shape[1]
        xs, us = list(x), list(u)
        rates = [*problem.dynamics(xs, us), *(integrand(xs, us) for integrand in integrands)]
        rows = [np.broadcast_to(row, (count,)) for row in rates]
        return np.array(rows, dtype=np.float64)

    added = increments(
        grid.rule, field, state=state.T, control=control.T, step=duration / (grid.n_nodes - 1)
    )
    defects = state[:-1].T + added[:n_states] - state[1:].T
    sums = np.concatenate([np.zeros((len(integrands), 1)), added[n_states:].cumsum(axis=1)], axis=1)
    terminal = 0.0 if problem.terminal_cost is None else problem.terminal_cost(list(state[-1]))
    return Evaluation(
        cost=float(sums[0, -1]) + float(terminal),
        integrals=dict(zip(problem.integrals, sums[1:], strict=True)),
        worst_defect=_largest(np.abs(defects)),
        worst_violation=_violation(problem, state, control, duration),
    )


def _nothing(x: Sequence[Any], u: Sequence[Any]) -> float:
    return 0.0


def _violation(
    problem: OptimalControlProblem, state: Array, control: Array, duration: float
) -> float:
    ends = [
        abs(value - wanted)
        for row, values in ((state[0], problem.start), (state[-1], problem.end))
        for value, wanted in zip(row.tolist(), values, strict=True)
        if wanted is not None
    ]
    excesses = [
        np.maximum(low - rows, rows - high)
        for rows, (low, high) in (
            (state, limits_of(problem.state_limits, problem.n_states).T),
            (control, limits_of(problem.control_limits, problem.n_controls).T),
        )
    ]
    late = max(problem.duration[0] - duration, duration - problem.duration[1])
    return float(max(0.0, late, *ends, *(_largest(excess) for excess in excesses)))


def _largest(values: Array) -> float:
    """Greatest value; infinite if one is no number."""
    worst = float(values.max(initial=0.0))
    return worst if math.isfinite(worst) else math.inf

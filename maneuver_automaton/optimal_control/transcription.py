"""Direct transcription: states and controls at nodes, solved all at once by IPOPT."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.optimal_control.ipopt import (
    SolverSettings,
    SolveStatus,
    answered,
    ipopt_options,
    load_casadi,
    numpy_on_symbols,
)
from maneuver_automaton.optimal_control.problem import (
    Guess,
    OptimalControlProblem,
    TimeGrid,
    increments,
    limits_of,
    resampled,
    straight_guess,
)


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


def evaluate(
    problem: OptimalControlProblem, grid: TimeGrid, *, state: Array, control: Array, duration: float
) -> tuple[float, dict[str, Array], float, float]:
    """Cost, integrals, worst defect and violation of states (n, n_x) and controls (m, n_u).

    Nothing of the solver is used: the functions of the problem are called on arrays.
    """
    integrands = [problem.stage_cost or (lambda x, u: 0.0), *problem.integrals.values()]
    n_states = problem.n_states

    def field(x: Array, u: Array) -> Array:
        count = x.shape[1]
        xs, us = list(x), list(u)
        rates = [*problem.dynamics(xs, us), *(integrand(xs, us) for integrand in integrands)]
        return np.array([np.broadcast_to(row, (count,)) for row in rates], dtype=np.float64)

    inputs = np.repeat(control, grid.held, axis=0).T
    step = duration / (grid.n_nodes - 1)
    added = increments(grid.rule, field, state=state.T, control=inputs, step=step)
    defects = state[:-1].T + added[:n_states] - state[1:].T
    sums = np.concatenate([np.zeros((len(integrands), 1)), added[n_states:].cumsum(axis=1)], axis=1)
    terminal = 0.0 if problem.terminal_cost is None else problem.terminal_cost(list(state[-1]))
    return (
        float(sums[0, -1]) + float(terminal),
        dict(zip(problem.integrals, sums[1:], strict=True)),
        _largest(np.abs(defects)),
        _violation(problem, state, control, duration),
    )


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


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Transcription:
    """An optimal control problem as a nonlinear program, in symbols.

    Variables are the states, then the controls, both node by node, then the duration. What has
    more to ask, say clearance of obstacles, adds rows to `constraints` and to `limits`.
    """

    problem: OptimalControlProblem
    grid: TimeGrid
    state: Any  # (n_x, n) symbols
    control: Any  # (n_u, n) symbols, or (n_u, n - 1)
    duration: Any  # one symbol [s]
    objective: Any  # expression
    inputs: Any  # the controls from node to node: (n_u, n - 1) if one holds for several steps
    constraints: Any  # (m,) expressions; first of all the defects
    limits: Array  # (m, 2) of the constraints
    bounds: Array  # (variables, 2)

    @property
    def variables(self) -> Any:
        """All variables in one column."""
        casadi = load_casadi()
        return casadi.vertcat(casadi.vec(self.state), casadi.vec(self.control), self.duration)


def transcribe(problem: OptimalControlProblem, grid: TimeGrid) -> Transcription:
    """Write a problem down on a grid, in symbols, without a loop over the nodes.

    Source: Betts (2010), *Practical Methods for Optimal Control*, Ch. 4.

    Raises
    ------
    MissingExtra
        If CasADi is not installed.
    ValueError
        If the dynamics return another number of rates than there are states.
    """
    casadi = load_casadi()
    n_states, n = problem.n_states, grid.n_nodes
    state = casadi.SX.sym("x", n_states, n)
    control = casadi.SX.sym("u", problem.n_controls, grid.n_controls)
    duration = casadi.SX.sym("T")

    def field(x: Any, u: Any) -> Any:
        xs, us = casadi.vertsplit(x), casadi.vertsplit(u)
        rates = list(problem.dynamics(xs, us))
        if len(rates) != n_states:
            raise ValueError(
                f"optimal control: the dynamics return {len(rates)} rates, need {n_states} "
                f"({', '.join(problem.state_names)})"
            )
        running = [] if problem.stage_cost is None else [problem.stage_cost(xs, us)]
        rows = [casadi.SX(rate) for rate in [*rates, *running]]  # a number is one for all nodes
        count = x.shape[1]
        return casadi.vertcat(
            *(row if row.shape == (1, count) else casadi.repmat(row, 1, count) for row in rows)
        )

    with numpy_on_symbols(casadi):
        step, inputs = duration / (n - 1), control
        if grid.held > 1:
            inputs = casadi.kron(control, casadi.DM.ones(1, grid.held))
        added = increments(grid.rule, field, state=state, control=inputs, step=step)
        objective = casadi.SX(0.0)
        if problem.stage_cost is not None:
            objective += casadi.sum2(added[n_states:, :])
        if problem.terminal_cost is not None:
            objective += problem.terminal_cost(casadi.vertsplit(state[:, n - 1]))
    return Transcription(
        problem=problem,
        grid=grid,
        state=state,
        control=control,
        duration=duration,
        objective=objective,
        inputs=inputs,
        constraints=casadi.vec(state[:, : n - 1] + added[:n_states, :] - state[:, 1:]),
        limits=np.zeros((n_states * (n - 1), 2)),
        bounds=bounds_of(problem, grid),
    )


def solve(
    problem: OptimalControlProblem,
    grid: TimeGrid,
    *,
    guess: Guess | None = None,
    settings: SolverSettings | None = None,
) -> OptimalControlSolution:
    """A local optimum near a guess, with defects and violations computed again in NumPy.

    Parameters
    ----------
    problem : OptimalControlProblem
        What to solve.
    grid : TimeGrid
        Nodes and rule.
    guess : Guess, optional
        Where to begin; `straight_guess` if left out.
    settings : SolverSettings, optional
        When to stop; the defaults if left out.

    Returns
    -------
    OptimalControlSolution
        SOLVED only if the solver says so *and* the numbers hold.

    Raises
    ------
    MissingExtra
        If CasADi is not installed.
    ValueError
        If problem and guess do not fit together.

    Examples
    --------
    >>> cart = OptimalControlProblem(
    ...     state_names=("position", "speed"), control_names=("push",),
    ...     dynamics=lambda x, u: [x[1], u[0]], stage_cost=lambda x, u: 1.0,
    ...     start=(0.0, 0.0), end=(1.0, 0.0), duration=(0.1, 10.0), control_limits=[[-1.0, 1.0]])
    >>> found = solve(cart, TimeGrid(n_nodes=41, rule="rk4"))
    >>> found.status.value, round(found.duration, 6)  # full ahead, full back: 2 sqrt(1)
    ('solved', 2.0)
    """
    began = time.perf_counter()
    casadi = load_casadi()
    settings = settings or SolverSettings()
    guess = guess or straight_guess(problem)
    _check_guess(problem, guess)
    program = transcribe(problem, grid)
    functions = {"x": program.variables, "f": program.objective, "g": program.constraints}
    solver = casadi.nlpsol("solver", "ipopt", functions, ipopt_options(settings))
    states, controls = (
        resampled(rows, count).ravel()
        for rows, count in ((guess.state, grid.n_nodes), (guess.control, grid.n_controls))
    )
    first = np.concatenate([states, controls, [guess.duration]])
    built = time.perf_counter()
    answer = solver(
        x0=np.clip(first, *program.bounds.T),
        lbx=program.bounds[:, 0],
        ubx=program.bounds[:, 1],
        lbg=program.limits[:, 0],
        ubg=program.limits[:, 1],
    )
    solved = time.perf_counter()
    values, status, reason, iterations = answered(solver, answer)
    state, control, duration = unpacked(problem, grid, values)
    cost, integrals, defect, violation = evaluate(
        problem, grid, state=state, control=control, duration=duration
    )
    if status is SolveStatus.SOLVED and not max(defect, violation) <= settings.admitted_defect:
        status = SolveStatus.FAILED
        reason = (
            f"{reason}, but the numbers do not hold: defect {defect:.3g}, violation "
            f"{violation:.3g}, admitted {settings.admitted_defect:.3g}"
        )
    return OptimalControlSolution(
        status=status,
        reason=reason,
        time=np.linspace(0.0, duration, grid.n_nodes),
        state=state,
        control=control,
        cost=cost,
        integrals=integrals,
        iterations=iterations,
        build_s=built - began,
        solve_s=solved - built,
        worst_defect=defect,
        worst_violation=violation,
    )


def unpacked(
    problem: OptimalControlProblem, grid: TimeGrid, values: Array
) -> tuple[Array, Array, float]:
    """States (n, n_x), controls (m, n_u) and duration from the values of all variables."""
    split = grid.n_nodes * problem.n_states
    state = values[:split].reshape(grid.n_nodes, problem.n_states)
    return state, values[split:-1].reshape(grid.n_controls, problem.n_controls), float(values[-1])


def bounds_of(problem: OptimalControlProblem, grid: TimeGrid) -> Array:
    """Limits (variables, 2) of all variables; fixed ones have both alike."""
    limits = limits_of(problem.state_limits, problem.n_states)
    states = np.tile(limits, (grid.n_nodes, 1, 1))
    for row, values in ((0, problem.start), (-1, problem.end)):
        for k, value in enumerate(values):
            if value is not None:
                states[row, k] = value
    limits = limits_of(problem.control_limits, problem.n_controls)
    controls = np.tile(limits, (grid.n_controls, 1))
    return np.concatenate([states.reshape(-1, 2), controls, np.array([problem.duration])])


def _check_guess(problem: OptimalControlProblem, guess: Guess) -> None:
    for what, rows, names in (
        ("state", guess.state, problem.state_names),
        ("control", guess.control, problem.control_names),
    ):
        if rows.shape[1] != len(names):
            raise ValueError(
                f"guess: {what} has {rows.shape[1]} columns, need {len(names)} ({', '.join(names)})"
            )

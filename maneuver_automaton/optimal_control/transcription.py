"""Direct transcription: states and controls at nodes, solved all at once by IPOPT.

Monotone barrier, small at the start: a large one pushes the iterate away from its guess, and with
it out of the sequence of moves that the guess stands for.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.optimal_control._casadi import load_casadi, numpy_on_symbols
from maneuver_automaton.optimal_control.problem import (
    Grid,
    Guess,
    OptimalControlProblem,
    limits_of,
    resampled,
    straight_guess,
)
from maneuver_automaton.optimal_control.rules import increments
from maneuver_automaton.optimal_control.solution import (
    OptimalControlSolution,
    SolveStatus,
    evaluate,
)

MU_INIT = 1e-3  # first barrier parameter
STATUS = {
    "Solve_Succeeded": SolveStatus.SOLVED,
    "Solved_To_Acceptable_Level": SolveStatus.SOLVED,
    "Infeasible_Problem_Detected": SolveStatus.INFEASIBLE,
    "Maximum_Iterations_Exceeded": SolveStatus.OUT_OF_BUDGET,
    "Maximum_CpuTime_Exceeded": SolveStatus.OUT_OF_BUDGET,
    "Maximum_WallTime_Exceeded": SolveStatus.OUT_OF_BUDGET,
    "User_Requested_Stop": SolveStatus.OUT_OF_BUDGET,  # by what is asked between iterations
}


@dataclass(frozen=True, slots=True, kw_only=True)
class SolverSettings:
    """When the solver stops, and what is believed of its answer."""

    tolerance: float = 1e-9  # of the scaled optimality conditions [-]
    max_iterations: int = 300
    max_seconds: float | None = None  # [s]
    admitted_defect: float = 1e-7  # of defects and violations, computed again, in their units

    def __post_init__(self) -> None:
        for name in ("tolerance", "max_iterations", "admitted_defect"):
            if not getattr(self, name) > 0:
                raise ValueError(f"solver: {name} must be positive, got {getattr(self, name)}")
        if self.max_seconds is not None and not self.max_seconds > 0.0:
            raise ValueError(f"solver: max_seconds must be positive, got {self.max_seconds} s")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Transcription:
    """An optimal control problem as a nonlinear program, in symbols.

    Variables are the states, then the controls, both node by node, then the duration. What has
    more to ask, say clearance of obstacles, adds rows to `constraints` and to `limits`.
    """

    problem: OptimalControlProblem
    grid: Grid
    state: Any  # (n_x, n) symbols
    control: Any  # (n_u, n) symbols, or (n_u, n - 1)
    duration: Any  # one symbol [s]
    objective: Any  # expression
    constraints: Any  # (m,) expressions; first of all the defects
    limits: Array  # (m, 2) of the constraints
    bounds: Array  # (variables, 2)


def transcribe(problem: OptimalControlProblem, grid: Grid) -> Transcription:
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
        return casadi.vertcat(*(_row(casadi, rate, x.shape[1]) for rate in [*rates, *running]))

    with numpy_on_symbols(casadi):
        step = duration / (n - 1)
        added = increments(grid.rule, field, state=state, control=control, step=step)
        objective = casadi.SX(0.0)
        if problem.stage_cost is not None:
            objective += casadi.sum2(added[n_states:, :])
        if problem.terminal_cost is not None:
            objective += problem.terminal_cost(casadi.vertsplit(state[:, n - 1]))
    defects = casadi.vec(state[:, : n - 1] + added[:n_states, :] - state[:, 1:])
    return Transcription(
        problem=problem,
        grid=grid,
        state=state,
        control=control,
        duration=duration,
        objective=objective,
        constraints=defects,
        limits=np.zeros((n_states * (n - 1), 2)),
        bounds=bounds_of(problem, grid),
    )


def solve(
    problem: OptimalControlProblem,
    grid: Grid,
    *,
    guess: Guess | None = None,
    settings: SolverSettings | None = None,
) -> OptimalControlSolution:
    """A local optimum near a guess, with defects and violations computed again in NumPy.

    Parameters
    ----------
    problem : OptimalControlProblem
        What to solve.
    grid : Grid
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
    >>> found = solve(cart, Grid(n_nodes=41, rule="rk4"))
    >>> found.status.value, round(found.duration, 6)  # full ahead, full back: 2 sqrt(1)
    ('solved', 2.0)
    """
    began = time.perf_counter()
    casadi = load_casadi()
    settings = settings or SolverSettings()
    guess = guess or straight_guess(problem)
    _check_guess(problem, guess)
    program = transcribe(problem, grid)
    parts = (casadi.vec(program.state), casadi.vec(program.control), program.duration)
    functions = {"x": casadi.vertcat(*parts), "f": program.objective, "g": program.constraints}
    solver = casadi.nlpsol("solver", "ipopt", functions, ipopt_options(settings))
    first = np.concatenate(
        [
            resampled(guess.state, grid.n_nodes).ravel(),
            resampled(guess.control, grid.n_controls).ravel(),
            [guess.duration],
        ]
    )
    built = time.perf_counter()
    answer = solver(
        x0=np.clip(first, *program.bounds.T),
        lbx=program.bounds[:, 0],
        ubx=program.bounds[:, 1],
        lbg=program.limits[:, 0],
        ubg=program.limits[:, 1],
    )
    solved = time.perf_counter()
    return _solution(
        program,
        settings,
        np.asarray(answer["x"].full(), dtype=np.float64).ravel(),
        stats=solver.stats(),
        seconds=(built - began, solved - built),
    )


def _row(casadi: Any, value: Any, count: int) -> Any:
    """A row of symbols (1, count), from one or from a number."""
    row = casadi.SX(value)
    return row if row.shape == (1, count) else casadi.repmat(row, 1, count)


def ipopt_options(settings: SolverSettings) -> dict[str, Any]:
    """Options of IPOPT."""
    options: dict[str, Any] = {
        "print_time": False,
        "error_on_fail": False,
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",  # no banner
        "ipopt.mu_strategy": "monotone",
        "ipopt.mu_init": MU_INIT,
        "ipopt.tol": settings.tolerance,
        "ipopt.constr_viol_tol": settings.tolerance,
        "ipopt.acceptable_tol": 1e3 * settings.tolerance,
        "ipopt.max_iter": settings.max_iterations,
        "ipopt.bound_relax_factor": 0.0,  # limits are limits
    }
    if settings.max_seconds is not None:
        options["ipopt.max_wall_time"] = settings.max_seconds
    return options


def bounds_of(problem: OptimalControlProblem, grid: Grid) -> Array:
    """Limits (variables, 2) of all variables; fixed ones have both alike."""
    limits = limits_of(problem.state_limits, problem.n_states)
    states = np.tile(limits, (grid.n_nodes, 1, 1))
    for row, values in ((0, problem.start), (-1, problem.end)):
        for k, value in enumerate(values):
            if value is not None:
                states[row, k] = value
    controls = np.tile(
        limits_of(problem.control_limits, problem.n_controls), (grid.n_controls, 1, 1)
    )
    return np.concatenate(
        [states.reshape(-1, 2), controls.reshape(-1, 2), np.array([problem.duration])]
    )


def _check_guess(problem: OptimalControlProblem, guess: Guess) -> None:
    widths: Sequence[tuple[str, Array, tuple[str, ...]]] = (
        ("state", guess.state, problem.state_names),
        ("control", guess.control, problem.control_names),
    )
    for what, rows, names in widths:
        if rows.shape[1] != len(names):
            raise ValueError(
                f"guess: {what} has {rows.shape[1]} columns, need {len(names)} ({', '.join(names)})"
            )


def _solution(
    program: Transcription,
    settings: SolverSettings,
    values: Array,
    *,
    stats: Mapping[str, Any],
    seconds: tuple[float, float],
) -> OptimalControlSolution:
    problem, grid = program.problem, program.grid
    n_x, n_u = problem.n_states, problem.n_controls
    states, controls, (duration,) = np.split(
        values, [grid.n_nodes * n_x, grid.n_nodes * n_x + grid.n_controls * n_u]
    )
    state, control = states.reshape(grid.n_nodes, n_x), controls.reshape(grid.n_controls, n_u)
    duration = float(duration)
    checked = evaluate(problem, grid, state=state, control=control, duration=duration)
    reason = str(stats["return_status"])
    status = STATUS.get(reason, SolveStatus.FAILED)
    worst = max(checked.worst_defect, checked.worst_violation)
    if status is SolveStatus.SOLVED and not worst <= settings.admitted_defect:
        status = SolveStatus.FAILED
        reason = (
            f"{reason}, but the numbers do not hold: defect {checked.worst_defect:.3g}, violation "
            f"{checked.worst_violation:.3g}, admitted {settings.admitted_defect:.3g}"
        )
    return OptimalControlSolution(
        status=status,
        reason=reason,
        time=np.linspace(0.0, duration, grid.n_nodes),
        state=state,
        control=control,
        cost=checked.cost,
        integrals=checked.integrals,
        iterations=int(stats["iter_count"]),
        build_s=seconds[0],
        solve_s=seconds[1],
        worst_defect=checked.worst_defect,
        worst_violation=checked.worst_violation,
    )

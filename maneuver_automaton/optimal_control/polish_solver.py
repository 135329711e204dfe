"""The program of polishing with its lines, built for IPOPT and solved from a point."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.budget import Budget
from maneuver_automaton.optimal_control.polish_program import Program
from maneuver_automaton.optimal_control.polish_values import Answer, Point, PolishSettings
from maneuver_automaton.optimal_control.separation import Lines, Pairs, line_rows
from maneuver_automaton.optimal_control.solution import SolveStatus
from maneuver_automaton.optimal_control.stopping import asked_between_iterations
from maneuver_automaton.optimal_control.transcription import STATUS

WARM = {"ipopt.mu_init": 1e-5}
NODE_S = 2.5e-5  # [s] for each node of an expression, to differentiate it: measured, generous


class Solver(NamedTuple):
    """The program with lines for some pairs, built."""

    function: Any
    warm: Callable[[], Any]  # the same with a smaller barrier, for another solve from nearby
    budget: Budget  # that every iteration asks
    bounds: Array  # (variables, 2)
    limits: Array  # (rows, 2)
    fixed: bool


def solver_of(
    program: Program, pairs: Pairs, *, fixed: bool, price: float, budget: Budget
) -> Solver | float:
    """The program with lines for some pairs; where no time is left to build it, what it takes [s].

    Parameters
    ----------
    program : Program
    pairs : Pairs
    fixed : bool
        Whether the lines stand still.
    price : float
        Of being inside obstacles, per metre and interval; infinite: it must not be.
    budget : Budget
        Every iteration asks it: a solve ends with what it has once the time is over.
    """
    casadi, written, scene = program.casadi, program.written, program.scene
    variables = [casadi.vec(written.state), casadi.vec(written.control), written.duration]
    bounds = [written.bounds]
    rows = [written.constraints, program.zero, program.below]
    equations = written.constraints.shape[0] + program.zero.shape[0]
    count = len(pairs.interval)
    given = casadi.SX.sym("given", 4, count)  # margin, anchor, angle
    objective = program.objective
    if count:
        angle, offset = casadi.SX.sym("angle", 1, count), casadi.SX.sym("offset", 1, count)
        if fixed:
            angle, offset = given[3, :], casadi.SX.zeros(1, count)
        else:
            variables += [angle.T, offset.T]
            bounds.append(np.tile([-np.inf, np.inf], (2 * count, 1)))
        margin = given[0, :]
        if math.isfinite(price):
            inside = casadi.SX.sym("inside", 1, program.n_intervals)
            variables.append(inside.T)
            bounds.append(np.tile([0.0, np.inf], (program.n_intervals, 1)))
            objective += price * casadi.sum2(inside)
            margin -= inside[:, pairs.interval.tolist()]
        rows.append(
            line_rows(casadi, program.paths, scene.both, pairs, anchor=given[1:3, :],
                      lines=(angle, offset), margin=margin, pieces_too=not fixed)
        )  # fmt: skip
    constraints = casadi.vertcat(*rows)
    limits = np.zeros((constraints.shape[0], 2))
    limits[equations:, 0] = -np.inf
    functions = {
        "x": casadi.vertcat(*variables),
        "p": casadi.vec(given),
        "f": objective,
        "g": constraints,
    }
    most = program.settings.fixed_iterations if fixed else program.settings.max_iterations
    given_names = [functions["x"], functions["p"]], [objective, constraints]
    takes = NODE_S * casadi.Function("size", *given_names).n_nodes()
    if takes > budget.left:
        return float(takes)
    options = _options(program.settings, most)
    asked = asked_between_iterations(
        budget, n_variables=functions["x"].numel(), n_rows=constraints.numel(), n_given=4 * count
    )
    options["iteration_callback"] = asked
    solver = casadi.nlpsol("solver", "ipopt", functions, options)

    @functools.cache
    def warm() -> Any:
        return casadi.nlpsol("again", "ipopt", functions, options | WARM | _derivatives(solver))

    return Solver(solver, warm, budget, np.vstack(bounds), limits, fixed)


def _derivatives(solver: Any) -> dict[str, Any]:
    """Derivatives that one solver has and another can use."""
    names = {"grad_f": "nlp_grad_f", "jac_g": "nlp_jac_g", "hess_lag": "nlp_hess_l"}
    return {option: solver.get_function(name) for option, name in names.items()}


def solve_from(
    solver: Solver,
    program: Program,
    point: Point,
    lines: Lines,
    margins: Array,
    *,
    again: bool,
    trust: float,
) -> tuple[Point, Lines, Answer]:
    """The solver's answer from a point and lines with their margins, places within `trust` [m]."""
    state, control, duration = program.values(point)
    first = [state.ravel(), control.ravel(), np.array([duration])]
    if not solver.fixed:
        first += [lines.angle, np.zeros(lines.angle.size)]
    first.append(np.zeros(len(solver.bounds) - sum(map(len, first))))  # how deep inside
    given = np.column_stack([margins, lines.anchor, lines.angle])
    began = solver.budget.elapsed
    bounds = solver.bounds.copy()
    if math.isfinite(trust):
        n_x = state.shape[1]
        for axis in (0, 1):
            # nodes but for the ends
            inner = slice(n_x + axis, n_x * program.n_intervals + axis, n_x)
            bounds[inner] = state[1:-1, axis, None] + np.array([-trust, trust])
    function = solver.warm() if again else solver.function
    answer = function(
        x0=np.clip(np.concatenate(first), *bounds.T),
        p=given.ravel(),
        lbx=bounds[:, 0],
        ubx=bounds[:, 1],
        lbg=solver.limits[:, 0],
        ubg=solver.limits[:, 1],
    )
    solving = solver.budget.elapsed - began
    stats = function.stats()
    values = np.asarray(answer["x"].full(), dtype=np.float64).ravel()
    if not solver.fixed:
        both = values[program.size :][: 2 * lines.angle.size]
        angle, offset = both.reshape(2, -1)
        lines = Lines(angle, lines.anchor).shifted(offset)
    reason = str(stats["return_status"])
    return (
        _point_of(program, values),
        lines,
        Answer(
            status=STATUS.get(reason, SolveStatus.FAILED),
            reason=reason,
            objective=float(answer["f"]),
            iterations=int(stats["iter_count"]),
            seconds=solving,
        ),
    )


def _point_of(program: Program, values: Array) -> Point:
    problem, n = program.written.problem, program.n_intervals + 1
    n_x, n_u = problem.n_states, problem.n_controls
    state = values[: n * n_x].reshape(n, n_x)
    control = values[n * n_x : n * n_x + (n - 1) * n_u].reshape(n - 1, n_u)
    duration = float(values[n * n_x + (n - 1) * n_u])
    durations = np.full(n - 1, duration / (n - 1))
    if program.paced:
        return Point(state, control[:, :-1], durations * control[:, -1])
    return Point(state, control, durations)


def _options(settings: PolishSettings, most: int) -> dict[str, Any]:
    return {
        "print_time": False,
        "error_on_fail": False,
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",  # no banner
        "ipopt.mu_strategy": "monotone",
        "ipopt.mu_init": settings.mu_init,
        "ipopt.tol": settings.tolerance,
        "ipopt.constr_viol_tol": settings.violation,
        "ipopt.acceptable_tol": settings.acceptable,
        "ipopt.acceptable_iter": settings.acceptable_iterations,
        "ipopt.max_iter": most,
    }

"""How this room reaches CasADi and its solvers: imported when used, stopped when time is over.

Between two iterations a solve asks its budget. What it has then counts: the best iterate that
breaks no condition is kept.
"""

from __future__ import annotations

import contextlib
import enum
import functools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from maneuver_automaton._arrays import Array, check_fields
from maneuver_automaton.budget import Budget
from maneuver_automaton.errors import MissingExtra


class SolveStatus(enum.Enum):
    """How a solve ended; SOLVED only if the numbers hold when they are computed again."""

    SOLVED = "solved"  # a local optimum: nothing better nearby
    INFEASIBLE = "infeasible"  # nothing feasible near the guess, as far as the solver can see
    OUT_OF_BUDGET = "out_of_budget"  # iterations or time
    FAILED = "failed"  # the solver gave up, or its numbers do not hold


# A large first barrier pushes the iterate away from the moves that its guess stands for, if any.
NEAR = {"ipopt.mu_init": 1e-3}
FAR = {  # of guesses that stand for none: the barrier falls in few and loose steps
    "ipopt.mu_init": 0.1,
    "ipopt.mu_linear_decrease_factor": 0.1,
    "ipopt.barrier_tol_factor": 50.0,
}

QUIET: dict[str, Any] = {
    "print_time": False,
    "error_on_fail": False,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",  # no banner
    "ipopt.mu_strategy": "monotone",
    "ipopt.bound_relax_factor": 0.0,  # limits are limits
    "ipopt.min_refinement_steps": 0,  # of the linear solver: none unless residuals ask for one
}


STATUS = {
    "Solve_Succeeded": SolveStatus.SOLVED,
    "Solved_To_Acceptable_Level": SolveStatus.SOLVED,
    "Infeasible_Problem_Detected": SolveStatus.INFEASIBLE,
    "Maximum_Iterations_Exceeded": SolveStatus.OUT_OF_BUDGET,
    "Maximum_CpuTime_Exceeded": SolveStatus.OUT_OF_BUDGET,
    "Maximum_WallTime_Exceeded": SolveStatus.OUT_OF_BUDGET,
    "User_Requested_Stop": SolveStatus.OUT_OF_BUDGET,  # by what is asked between iterations
}


def answered(solver: Any, answer: Any) -> tuple[Array, SolveStatus, str, int]:
    """Values of all variables, the status, the solver's own word for it, and iterations."""
    stats = solver.stats()
    reason = str(stats["return_status"])
    values = np.asarray(answer["x"].full(), dtype=np.float64).ravel()
    return values, STATUS.get(reason, SolveStatus.FAILED), reason, int(stats["iter_count"])


@dataclass(frozen=True, slots=True, kw_only=True)
class SolverSettings:
    """When the solver stops, how it begins, and what is believed of its answer."""

    tolerance: float = 1e-9  # of the scaled optimality conditions [-]
    max_iterations: int = 300
    admitted_defect: float = 1e-7  # of defects and violations, computed again, in their units
    far: bool = False  # whether guesses may be far from the solution

    def __post_init__(self) -> None:
        check_fields("solver", self, "tolerance", "max_iterations", "admitted_defect")


def ipopt_options(settings: SolverSettings) -> dict[str, Any]:
    """Options of IPOPT."""
    stops = {
        "ipopt.tol": settings.tolerance,
        "ipopt.constr_viol_tol": settings.tolerance,
        "ipopt.acceptable_tol": 1e3 * settings.tolerance,
        "ipopt.max_iter": settings.max_iterations,
    }
    return QUIET | (FAR if settings.far else NEAR) | stops


@functools.cache
def why_no_casadi() -> str:
    """Why optimal control cannot be used: what the import of CasADi says; empty if it works."""
    try:
        load_casadi()
    except MissingExtra as error:
        return str(error)
    return ""


def load_casadi() -> Any:
    """The module `casadi`; raises MissingExtra (an ImportError) if it cannot be imported."""
    try:
        import casadi
    except Exception as error:  # whatever a broken installation raises
        raise MissingExtra(
            f"optimal control needs CasADi, which cannot be imported ({error}): pip install casadi"
        ) from error
    return casadi


@contextlib.contextmanager
def numpy_on_symbols(casadi: Any) -> Iterator[None]:
    """Let ``np.cos(symbol)`` return a symbol, as CasADi before 3.8 did without a remark.

    From 3.8 on this is a mode of the whole process, so it is put back afterwards.
    """
    options = casadi.GlobalOptions
    if not hasattr(options, "setNumpyMode"):
        yield
        return
    before = options.getNumpyMode()
    options.setNumpyMode(-1)
    try:
        yield
    finally:
        options.setNumpyMode(before)


VIOLATION = 1e-6  # of a condition, that closing and audit take for none


class Watcher(Protocol):
    """Looks at every iterate of a solve; itself the callback that ``casadi.nlpsol`` wants."""

    budget: Budget
    best: Array | None  # the variables with the least objective that break no condition
    least: float  # their objective

    def forget(self) -> None:
        """Begin with another solve."""
        ...


def watcher_of(budget: Budget, limits: Array, *, n_variables: int, n_given: int) -> Watcher:
    """A watcher that ends a solve once the time of a budget is over; `limits` (rows, 2).

    The solver then returns its last iterate, with the status of a stop that the user asked for.
    """
    rows = len(limits)
    sizes = {"x": n_variables, "lam_x": n_variables, "g": rows, "lam_g": rows, "f": 1}
    watcher: Watcher = _watching()(budget, limits, sizes | {"lam_p": n_given})
    return watcher


@functools.cache
def _watching() -> type[Any]:
    """The class of such callbacks; CasADi wants one derived from its own."""
    casadi = load_casadi()

    class Watching(casadi.Callback):  # type: ignore[misc,name-defined]
        """Takes what the solver has at an iteration, and answers 1 to stop it."""

        def __init__(self, budget: Budget, limits: Array, sizes: dict[str, int]) -> None:
            super().__init__()
            self.budget = budget
            self.low, self.high = limits.T
            self.sizes = sizes
            self.forget()
            self.construct("watching", {})

        def forget(self) -> None:
            self.best: Array | None = None
            self.least = math.inf

        def get_n_in(self) -> int:
            return int(casadi.nlpsol_n_out())

        def get_n_out(self) -> int:
            return 1

        def get_sparsity_in(self, number: int) -> Any:
            return casadi.Sparsity.dense(self.sizes[casadi.nlpsol_out(number)], 1)

        def has_eval_buffer(self) -> bool:
            return True  # the numbers as they are: copies would cost more than the look at them

        def eval_buffer(self, given: Any, answer: Any) -> int:
            x, f, g = (np.frombuffer(given[k]) for k in range(3))
            if f[0] < self.least:
                worst = max((g - self.high).max(initial=0.0), (self.low - g).max(initial=0.0))
                if worst <= VIOLATION:
                    self.best, self.least = x.copy(), float(f[0])
            np.frombuffer(answer[0])[0] = float(self.budget.is_over)
            return 0

    return Watching

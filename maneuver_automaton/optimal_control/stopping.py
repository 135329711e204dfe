"""Solves that can be stopped: between two iterations the solver asks a budget."""

from __future__ import annotations

import functools
from typing import Any

from maneuver_automaton.budget import Budget
from maneuver_automaton.optimal_control._casadi import load_casadi


def asked_between_iterations(budget: Budget, *, n_variables: int, n_rows: int, n_given: int) -> Any:
    """A callback for ``casadi.nlpsol`` that ends a solve once the time of a budget is over.

    The solver then returns its last iterate, with the status of a stop that the user asked for.
    """
    sizes = {"x": n_variables, "lam_x": n_variables, "g": n_rows, "lam_g": n_rows, "f": 1}
    return _asking()(budget, sizes | {"lam_p": n_given})


@functools.cache
def _asking() -> type[Any]:
    """The class of such callbacks; CasADi wants one derived from its own."""
    casadi = load_casadi()

    class Asking(casadi.Callback):  # type: ignore[misc,name-defined]
        """Takes what the solver has at an iteration, and answers 1 to stop it."""

        def __init__(self, budget: Budget, sizes: dict[str, int]) -> None:
            super().__init__()
            self.budget = budget
            self.sizes = sizes
            self.construct("asking", {})

        def get_n_in(self) -> int:
            return int(casadi.nlpsol_n_out())

        def get_n_out(self) -> int:
            return 1

        def get_sparsity_in(self, number: int) -> Any:
            return casadi.Sparsity.dense(self.sizes[casadi.nlpsol_out(number)], 1)

        def eval(self, arg: Any) -> list[float]:
            return [float(self.budget.is_over)]

    return Asking

"""Solves that can be stopped: between two iterations the solver asks a budget.

What it has then counts: the best iterate that breaks no condition is kept.
"""

from __future__ import annotations

import functools
import math
from typing import Any, Protocol

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.budget import Budget
from maneuver_automaton.optimal_control._casadi import load_casadi

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

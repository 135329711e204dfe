"""From node to node: the two rules, for numbers and for symbols alike."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from maneuver_automaton.optimal_control.problem import Rule

Field = Callable[[Any, Any], Any]
"""Rates (m, n) of states (n_x, n) under controls (n_u, n), matrices of numbers or of symbols.

The first n_x rates are those of the state; the others are integrands that ride along."""


def increments(rule: Rule, field: Field, *, state: Any, control: Any, step: Any) -> Any:
    """What each rate adds up to over each interval (m, n - 1), with `step` [s] between nodes.

    Source: Betts (2010), *Practical Methods for Optimal Control*, Sec. 3.4 (trapezoidal), Sec. 3.5
    (Runge-Kutta).

    Parameters
    ----------
    rule : "trapezoidal" or "rk4"
        Controls at the n nodes (n_u, n), or constant over the n - 1 intervals (n_u, n - 1).
    field : callable
        The rates.
    state : (n_x, n) matrix
        States at the nodes.
    control : matrix
        See `rule`.
    step : number or symbol
        Time between nodes [s].

    Examples
    --------
    >>> import numpy as np
    >>> field = lambda x, u: np.stack([u[0], x[0] ** 2])  # x' = u, and x^2 rides along
    >>> x, u = np.array([[0.0, 1.0, 2.0]]), np.ones((1, 3))
    >>> increments("trapezoidal", field, state=x, control=u, step=1.0).tolist()
    [[1.0, 1.0], [0.5, 2.5]]
    >>> increments("rk4", field, state=x, control=u[:, :2], step=1.0).round(3).tolist()
    [[1.0, 1.0], [0.333, 2.333]]
    """
    return _RULES[rule](field, state, control, step)


def _trapezoidal(field: Field, state: Any, control: Any, step: Any) -> Any:
    rates = field(state, control)
    return (step / 2.0) * (rates[:, :-1] + rates[:, 1:])


def _rk4(field: Field, state: Any, control: Any, step: Any) -> Any:
    n_states, begin = state.shape[0], state[:, :-1]
    k_1 = field(begin, control)
    k_2 = field(begin + (step / 2.0) * k_1[:n_states, :], control)
    k_3 = field(begin + (step / 2.0) * k_2[:n_states, :], control)
    k_4 = field(begin + step * k_3[:n_states, :], control)
    return (step / 6.0) * (k_1 + 2.0 * k_2 + 2.0 * k_3 + k_4)


_RULES: Mapping[Rule, Callable[[Field, Any, Any, Any], Any]] = {
    "trapezoidal": _trapezoidal,
    "rk4": _rk4,
}

"""Shifted optimal control problems: all that is tied to a place moves along.

A fixed start, a fixed goal, walls and costs with references are not invariant. When all of them
are moved by the same group element, the controls that solved the problem solve it still.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, freeze
from maneuver_automaton.groups import LieGroup
from maneuver_automaton.models import moved_rates, moved_state

StateControlFunction = Callable[[Array, Array], ArrayLike]
"""A function of one state (n_x,), pose first, and one control (n_u,): one or more numbers."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class QuadraticCost:
    """``(x - x_ref)' Q (x - x_ref) + (u - u_ref)' R (u - u_ref)``.

    Headings are compared as they are, not modulo a turn.

    Source: the paper, Sec. 3.2.

    Examples
    --------
    >>> cost = QuadraticCost(state_weight=np.diag([1.0, 5.0, 0.1]), control_weight=np.eye(2),
    ...                      state_reference=[1.0, 0.0, 0.0], control_reference=[0.0, 0.0])
    >>> cost(np.array([1.0, 2.0, 0.0]), np.array([1.0, 0.0]))
    21.0
    """

    state_weight: Array  # Q (n_x, n_x)
    control_weight: Array  # R (n_u, n_u)
    state_reference: Array  # (n_x,)
    control_reference: Array  # (n_u,)

    def __post_init__(self) -> None:
        for kind in ("state", "control"):
            freeze(self, f"{kind}_reference")
            freeze(self, f"{kind}_weight")
            n = getattr(self, f"{kind}_reference").size
            shape = getattr(self, f"{kind}_weight").shape
            if shape != (n, n):
                raise ValueError(
                    f"quadratic cost: {kind}_weight has shape {shape}, need ({n}, {n}) as "
                    f"{kind}_reference has {n} components"
                )

    def __call__(self, state: Array, control: Array) -> float:
        """Cost per second of one state (n_x,) and one control (n_u,)."""
        x, u = state - self.state_reference, control - self.control_reference
        return float(x @ self.state_weight @ x + u @ self.control_weight @ u)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ControlProblem:
    """Drive from `start` to `goal` under constraints ``g(x, u) <= 0``, at least cost."""

    start: Array  # (n_x,) pose, then reduced state
    goal: Array  # (n_x,)
    stage_cost: StateControlFunction | None = None  # None: feasibility is all that counts
    constraints: tuple[StateControlFunction, ...] = ()

    def __post_init__(self) -> None:
        freeze(self, "start")
        freeze(self, "goal", last=self.start.size)


def shifted_problem(problem: ControlProblem, by: LieGroup) -> ControlProblem:
    """Problem moved by a group element: solved by the same controls, at the same cost.

    Source: the paper, Sec. 3.2 and Example 10.

    Examples
    --------
    Driving straight ahead for T seconds solves the first problem, and the shifted one.

    >>> from maneuver_automaton.groups import SE2
    >>> T = 4.0
    >>> ahead = SE2.exp(T * np.array([1 / T, 0.0, 0.0]))
    >>> problem = ControlProblem(start=[-1.0, 0.0, 0.0], goal=[0.0, 0.0, 0.0])
    >>> bool(np.all((SE2(problem.start) @ ahead).pose == problem.goal))
    True
    >>> shifted = shifted_problem(problem, SE2([1.0, 1.0, 0.0]))
    >>> shifted.start.tolist(), shifted.goal.tolist()
    ([0.0, 1.0, 0.0], [1.0, 1.0, 0.0])
    >>> bool(np.all((SE2(shifted.start) @ ahead).pose == shifted.goal))
    True

    With only the start shifted it does not: that is a parallel parking problem.

    >>> bool(np.all((SE2(shifted.start) @ ahead).pose == problem.goal))
    False
    """
    return ControlProblem(
        start=moved_state(by, problem.start),
        goal=moved_state(by, problem.goal),
        stage_cost=None if problem.stage_cost is None else shifted_function(problem.stage_cost, by),
        constraints=tuple(shifted_function(g, by) for g in problem.constraints),
    )


def shifted_function(function: StateControlFunction, by: LieGroup) -> StateControlFunction:
    """Stage cost or constraint moved by a group element: ``l'(Psi_g x, u) == l(x, u)``.

    Source: the paper, Sec. 3.2.

    Examples
    --------
    >>> from maneuver_automaton.groups import SE2
    >>> wall = shifted_function(lambda x, u: x[0] - 3.0, SE2([10.0, 0.0, 0.0]))  # x <= 3 m
    >>> float(wall(np.array([12.0, 0.0, 0.0]), np.zeros(2)))
    -1.0
    """
    back = by.inverse()
    return lambda state, control: function(moved_state(back, state), control)


def shifted_boundary_condition(
    boundary_condition: Callable[[Array, Array], ArrayLike], by: LieGroup
) -> Callable[[Array, Array], ArrayLike]:
    """``r'`` with ``r'(Psi_g x_0, Psi_g x_T) == r(x_0, x_T)``.

    Source: the paper, Sec. 3.2.

    Examples
    --------
    >>> from maneuver_automaton.groups import SE2
    >>> start_at_origin = lambda first, last: first
    >>> shifted = shifted_boundary_condition(start_at_origin, SE2([1.0, 2.0, 0.0]))
    >>> shifted(np.array([1.0, 2.0, 0.0]), np.zeros(3)).tolist()
    [0.0, 0.0, 0.0]
    """
    back = by.inverse()
    return lambda first, last: boundary_condition(moved_state(back, first), moved_state(back, last))


def shifted_cost(cost: QuadraticCost, by: LieGroup) -> QuadraticCost:
    """Quadratic cost with ``l'(Psi_g x, u) == l(x, u)``: weights turned, reference moved.

    The group acts on coordinates by ``x -> D x + b`` with D orthogonal, so ``Q' = D Q D'``.

    Source: the paper, Sec. 3.2.

    Examples
    --------
    >>> from maneuver_automaton.groups import SE2
    >>> cost = QuadraticCost(state_weight=np.diag([1.0, 5.0, 0.1]), control_weight=np.eye(2),
    ...                      state_reference=[1.0, 0.0, 0.0], control_reference=[0.0, 0.0])
    >>> turned = shifted_cost(cost, SE2([0.0, 0.0, np.pi / 2]))
    >>> np.diag(turned.state_weight).round(3).tolist(), turned.state_reference.round(3).tolist()
    ([5.0, 1.0, 0.1], [0.0, 1.0, 1.571])
    """
    axes = np.eye(cost.state_reference.size)
    turn = moved_rates(by, np.zeros(len(axes)), rates=axes).T  # column i: where axis i points
    return QuadraticCost(
        state_weight=turn @ cost.state_weight @ turn.T,
        control_weight=cost.control_weight,
        state_reference=moved_state(by, cost.state_reference),
        control_reference=cost.control_reference,
    )

"""Costs of plans: a rate for every trim, and a price for every switch."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from maneuver_automaton._arrays import Array, as_array, check_fields, plain_numbers
from maneuver_automaton._brief import brief

NORM_ORDERS = (1.0, 2.0, math.inf)


class StageCost(Protocol):
    """A cost that the symmetry leaves alone: it sees controls and body velocities, not poses.

    A value that can be hashed: what follows from it is computed once. A cost that is a sum of the
    terms of `Cost` may say so in a method ``terms(self) -> Cost``. Switches are then counted as the
    search goes on, vehicles with inertia are polished at this price and not in time alone, and
    bounds hold for them too.
    """

    def __hash__(self) -> int: ...

    def rates(self, controls: Array, body_velocities: Array) -> Array:
        """Cost per second (m,) of trims with `controls` (m, n_u), `body_velocities` (m, dof)."""
        ...

    def switching(self, body_velocities: Array) -> float:
        """Cost of the switches of a word whose trims have `body_velocities` (n, dof)."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """Prices of effort, norm of the control and time per second, of length and of switches.

    Source: ``effort |u|_R^2 + norm |||u||| + time``, the paper, Sec. 3.3; all others are ours.

    Examples
    --------
    >>> cost = Cost(effort=1.0, norm=0.5)
    >>> cost.rates(np.array([[1.5, 0.0]]), np.array([[1.5, 0.0, 0.0]])).tolist()
    [3.0]
    """

    effort: float = 0.0  # c1
    norm: float = 0.0  # c2
    time: float = 0.0  # c3 [1/s]
    effort_matrix: Array | None = field(default=None, compare=False)  # R (n_u, n_u), None: identity
    norm_order: float = field(default=2.0, hash=False)  # 1, 2 or inf; hashes are asked for often
    length: float = field(default=0.0, hash=False)  # [1/m]
    switch: float = field(default=0.0, hash=False)  # per switch of trims
    direction_change: float = field(default=0.0, hash=False)  # per change of forward and reverse
    _matrix: bytes = field(default=b"", init=False, repr=False, hash=False)  # R, for equality

    __repr__ = brief

    def __post_init__(self) -> None:
        plain_numbers(self)
        check_fields("cost", self, *WEIGHTS, least=0)
        if not any(getattr(self, name) for name in WEIGHTS):
            raise ValueError(f"cost: {', '.join(WEIGHTS)} are all zero, need at least one positive")
        if self.norm_order not in NORM_ORDERS:
            raise ValueError(f"cost: norm_order must be 1, 2 or inf, got {self.norm_order}")
        if self.effort_matrix is not None:
            weight = _positive_definite(self.effort_matrix)
            object.__setattr__(self, "effort_matrix", weight)
            object.__setattr__(self, "_matrix", weight.tobytes())

    def terms(self) -> Cost:
        """The weights that it is the sum of: itself."""
        return self

    def rates(self, controls: Array, body_velocities: Array) -> Array:
        """Cost per second (m,) of trims with `controls` (m, n_u), `body_velocities` (m, dof)."""
        n_controls = controls.shape[-1]
        weight = np.eye(n_controls) if self.effort_matrix is None else self.effort_matrix
        if weight.shape != (n_controls, n_controls):
            raise ValueError(
                f"cost: effort_matrix has shape {weight.shape}, "
                f"need ({n_controls}, {n_controls}) for {n_controls} controls"
            )
        effort = np.einsum("...i,ij,...j->...", controls, weight, controls)
        norm = np.linalg.norm(controls, ord=self.norm_order, axis=-1)
        along = [0, 1, *range(3, body_velocities.shape[-1])]
        driven = np.linalg.norm(body_velocities[..., along], axis=-1)
        return np.asarray(
            self.effort * effort + self.norm * norm + self.time + self.length * driven,
            dtype=np.float64,
        )

    def switching(self, body_velocities: Array) -> float:
        """Cost of the switches of a word whose trims have `body_velocities` (n, dof).

        Rest counts as a trim; a direction change is a change of sign of the forward speed
        between trims that drive.
        """
        if not prices_switches(self) or len(body_velocities) < 2:
            return 0.0
        signs = np.sign(body_velocities[:, 0])
        driving = signs[signs != 0.0]
        changes = int(np.count_nonzero(driving[1:] != driving[:-1]))
        return self.switch * (len(body_velocities) - 1) + self.direction_change * changes


def terms_of(cost: StageCost) -> Cost | None:
    """The weights that a cost is the sum of; None if it does not say that it is one."""
    terms: Callable[[], Cost] | None = getattr(cost, "terms", None)
    return None if terms is None else terms()


def without_switches(cost: Cost) -> Cost:
    """The cost without prices of switches; the time in seconds, if nothing else has a price."""
    driven = any((cost.time, cost.effort, cost.norm, cost.length))
    return replace(cost, time=cost.time if driven else 1.0, switch=0.0, direction_change=0.0)


def check_cost(cost: StageCost) -> None:
    """Refuse what cannot be a cost."""
    what = type(cost).__name__
    if type(cost).__hash__ is None:
        raise ValueError(
            f"cost: {what} has no hash; need a value that does not change, such as a frozen "
            "dataclass"
        )
    for name in ("rates", "switching"):
        if not callable(getattr(cost, name, None)):
            raise ValueError(f"cost: {what} has no method {name}, need rates and switching")


def prices_switches(cost: StageCost) -> bool:
    """Whether a switch of trims costs something by itself, or may: a user's own cost may."""
    terms = terms_of(cost)
    return terms is None or terms.switch > 0.0 or terms.direction_change > 0.0


WEIGHTS = ("effort", "norm", "time", "length", "switch", "direction_change")


def _positive_definite(matrix: Array) -> Array:
    weight = np.array(as_array("cost: effort_matrix", matrix))
    if weight.ndim != 2 or weight.shape[0] != weight.shape[1]:
        raise ValueError(f"cost: effort_matrix has shape {weight.shape}, need a square matrix")
    if not np.allclose(weight, weight.T, rtol=0.0, atol=1e-12 * np.abs(weight).max()):
        raise ValueError("cost: effort_matrix is not symmetric")
    smallest = float(np.linalg.eigvalsh(weight)[0])
    if not smallest > 0.0:
        raise ValueError(
            "cost: effort_matrix must be positive definite, "
            f"its smallest eigenvalue is {smallest:.3g}"
        )
    weight.setflags(write=False)
    return weight

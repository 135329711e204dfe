"""Control effort of a plan: whether it is uniform, as it is in every optimal one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.costs import Cost


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class EffortReport:
    """Quadratic effort ``|u|_R^2`` of every trim of a plan, and the effort if it were uniform."""

    efforts: Array  # (n,) of each trim; rest has none
    durations: Array  # (n,) [s]
    mean: float  # over time
    spread: float  # (greatest - least) / mean, over the trims that last
    uniform: bool
    cost: float  # integral of the effort
    uniform_cost: float  # least integral on the same path in the same time, without limits

    @property
    def saving(self) -> float:
        """Saving of a uniform effort, of the integral."""
        return self.cost - self.uniform_cost


def effort_report(
    plan: Plan, effort_matrix: ArrayLike | None = None, *, tolerance: float = 1e-9
) -> EffortReport:
    """Quadratic effort of the trims of a plan: whether it is uniform, and how far from it.

    A plan of a driftless vehicle that is not uniform is not optimal for its path.

    Source: the paper, Prop. 15.

    Parameters
    ----------
    plan : Plan
        Any plan; trims of no duration do not count.
    effort_matrix : (n_u, n_u) array, optional
        R, symmetric and positive definite; the identity if left out.
    tolerance : float
        Greatest spread that counts as uniform [-].

    Returns
    -------
    EffortReport
        ``uniform_cost`` holds for a vehicle that `retime` accepts.

    Raises
    ------
    ValueError
        If the matrix does not fit.

    Examples
    --------
    >>> from maneuver_automaton.primitives import Trim
    >>> slow = Trim(name="slow", body_velocity=[1.0, 0.0, 0.0], control=[1.0, 0.0])
    >>> fast = Trim(name="fast", body_velocity=[3.0, 0.0, 0.0], control=[3.0, 0.0])
    >>> report = effort_report(Plan([0.0, 0.0, 0.0], (slow, fast), durations=[1.0, 1.0]))
    >>> report.uniform, report.cost, report.uniform_cost  # 4 m in 2 s: 2 m/s throughout
    (False, 10.0, 8.0)
    """
    efforts = cost_rates(plan, Cost(effort=1.0, effort_matrix=_matrix(effort_matrix)))
    lasting = efforts[plan.durations > 0.0]
    cost, duration = float(efforts @ plan.durations), plan.duration
    mean = cost / duration if duration > 0.0 else 0.0
    spread = float(np.ptp(lasting)) / mean if mean > 0.0 else 0.0
    moving = moving_trims(plan)
    length = float(np.sqrt(efforts[moving]) @ plan.durations[moving])
    return EffortReport(
        efforts=efforts,
        durations=plan.durations,
        mean=mean,
        spread=spread,
        uniform=spread <= tolerance,
        cost=cost,
        uniform_cost=length * length / duration if duration > 0.0 else 0.0,
    )


def effort_threshold(limits: ArrayLike, effort_matrix: ArrayLike | None = None) -> float:
    """r*: the greatest r for which all controls with ``|u|_R^2 <= r`` are within the limits.

    An optimal control has uniform effort or, wherever it has not, an effort of at least r*.

    Source: the paper, Cor. 19; the ellipsoid ``|u|_R^2 <= r`` is ``sqrt(r (R^-1)_jj)`` wide.

    Examples
    --------
    >>> effort_threshold([[-2.0, 2.0], [-1.0, 3.0]])
    1.0
    """
    box = np.asarray(limits, dtype=np.float64)
    matrix = _matrix(effort_matrix)
    widths = np.ones(len(box)) if matrix is None else np.diag(np.linalg.inv(matrix))
    nearest = np.maximum(np.minimum(-box[:, 0], box[:, 1]), 0.0)
    return float(np.min(nearest * nearest / widths, initial=np.inf))


def moving_trims(plan: Plan) -> np.ndarray[tuple[int, ...], np.dtype[np.bool]]:
    """Which trims (n,) change the pose; the others are rests, or last no time."""
    still = np.array([trim.is_rest for trim in plan.trims], dtype=np.bool)
    return np.asarray(~still & (plan.durations > 0.0))


def cost_rates(plan: Plan, cost: Cost) -> Array:
    """Cost per second (n,) of each trim of a plan."""
    if not plan.trims:
        return np.zeros(0)
    controls = np.array([trim.control for trim in plan.trims])
    return cost.rates(controls, np.array([trim.body_velocity for trim in plan.trims]))


def _matrix(effort_matrix: ArrayLike | None) -> Array | None:
    return None if effort_matrix is None else np.asarray(effort_matrix, dtype=np.float64)

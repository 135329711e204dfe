"""Retiming: a path at its best pace, which makes the control effort uniform.

A driftless vehicle runs the same path at another pace if its control is scaled: ``a u`` for
``tau / a`` instead of ``u`` for ``tau``. The quadratic effort of a given total time is then least
where it is the same at every instant, and the other terms of the cost do not change.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, vector_text
from maneuver_automaton.automaton import Plan
from maneuver_automaton.costs import Cost, StageCost, terms_of
from maneuver_automaton.models import Model
from maneuver_automaton.models.vehicle import limits_of
from maneuver_automaton.primitives import Trim


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


def cost_rates(plan: Plan, cost: StageCost) -> Array:
    """Cost per second (n,) of each trim of a plan."""
    if not plan.trims:
        return np.zeros(0)
    controls = np.array([trim.control for trim in plan.trims])
    return cost.rates(controls, np.array([trim.body_velocity for trim in plan.trims]))


def _matrix(effort_matrix: ArrayLike | None) -> Array | None:
    return None if effort_matrix is None else np.asarray(effort_matrix, dtype=np.float64)


HALF = 0.5  # pace at which a model is first asked whether it keeps to the path
TWIST_TOLERANCE = 1e-9  # relative difference of twists that counts as none
UNCHANGED = 1e-12  # relative difference of a pace from 1 that counts as none


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Retiming:
    """A plan, the same path at the best pace in the same time, and the saving."""

    before: Plan
    after: Plan  # without the rests of the plan before
    paces: Array  # (n,) factor of the control of each trim left
    at_limit: tuple[bool, ...]  # which of them a limit keeps from going faster
    cost_before: float
    cost_after: float

    @property
    def saving(self) -> float:
        """Cost before less cost after."""
        return self.cost_before - self.cost_after


def retime(
    plan: Plan, model: Model, *, cost: StageCost | None = None, limits: ArrayLike | None = None
) -> Retiming:
    """A plan retimed along its path: the same total time, at the pace that costs least.

    Each trim is scaled by one factor, its time by the inverse. Without limits every trim gets the
    same effort c; trims that a limit would keep below c run at their limit, and the others share
    the rest of the time: ``tau_i = max(least_i, length_i / c)``, with c such that the times add
    up to the total. Rests leave the plan, and their time is used.

    The effort of a scaled control is the effort scaled twice only if the *whole* control scales
    along the path. So a car with control [speed, steering] is accepted on straights only: its
    steering must not scale, and its best timing does not have a uniform effort.

    Source: the paper, Prop. 15, Cor. 19; the exact levels: water filling, Boyd, Vandenberghe
    (2004), *Convex Optimization*, Sec. 5.5.3.

    Parameters
    ----------
    plan : Plan
        The path; its total time is kept.
    model : Model
        The vehicle that drives it, asked whether its body velocity scales with its control.
    cost : StageCost, optional
        The cost to lower; its `terms` have to count the effort. The squared norm of the control if
        left out.
    limits : (n_u, 2) array, optional
        Least and greatest control; the model's own if left out.

    Returns
    -------
    Retiming
        Both plans and costs.

    Raises
    ------
    ValueError
        If the vehicle is no driftless one on this path, if the effort does not count, or if the
        limits are too narrow for the path and the time.

    Examples
    --------
    >>> from maneuver_automaton.automaton import Automaton
    >>> from maneuver_automaton.models import Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1, 0), "spin": (0, 1), "rest": (0, 0)})
    >>> plan = Plan([0.0, 0.0, 0.0], robot.trims, durations=[2.0, 1.0, 3.0])
    >>> better = retime(plan, Unicycle())
    >>> better.after.durations.tolist(), better.cost_before, better.cost_after
    ([4.0, 2.0], 3.0, 1.5)
    >>> better.after.word
    ('ahead x0.5', 'spin x0.5')
    """
    cost = Cost(effort=1.0) if cost is None else cost
    terms = terms_of(cost)
    if terms is None or not terms.effort > 0.0:
        raise ValueError("retime: the cost has no effort, need one whose terms() have effort > 0")
    box = control_box(model, limits)
    moving = np.flatnonzero(moving_trims(plan))
    trims, durations = [plan.trims[k] for k in moving], plan.durations[moving]
    driftless(trims, model)
    _check_scaling(trims, model, paces=np.full(len(trims), HALF))
    quadratic = Cost(effort=1.0, effort_matrix=terms.effort_matrix)
    lengths = np.sqrt(cost_rates(plan, quadratic)[moving]) * durations
    fastest = np.array([_fastest(trim, box, model) for trim in trims])
    least = durations / fastest
    times = shared_time(lengths, least=least, total=plan.duration)
    at_limit = times <= least
    paces = np.where(at_limit, fastest, durations / times)
    _check_scaling(trims, model, paces=paces)
    after = Plan(
        plan.start,
        tuple(_scaled(trim, pace, box) for trim, pace in zip(trims, paces.tolist(), strict=True)),
        durations=times,
        start_time=plan.start_time,
    )
    after = after if trims else plan
    return Retiming(
        before=plan,
        after=after,
        paces=paces,
        at_limit=tuple(at_limit.tolist()),
        cost_before=_cost(plan, cost),
        cost_after=_cost(after, cost),
    )


def shared_time(lengths: Array, *, least: Array, total: float) -> Array:
    """Times (n,) that add up to `total` [s] and make ``sum lengths^2 / times`` least.

    None is shorter than its `least`. With the level c at which the times
    ``max(least, lengths / c)`` add up to the total, the sum is convex and these times meet its
    optimality conditions. There are n + 1 candidates for c, one for each number of times that
    are at their least, in the order in which they leave it.

    Source: Boyd, Vandenberghe (2004), *Convex Optimization*, Sec. 5.5.3.
    """
    if not lengths.size:
        return np.zeros(0)
    needed = float(least.sum())
    if needed > total * (1.0 + 1e-12) or (needed >= total and not least.all()):
        raise ValueError(
            f"retime: the path takes at least {needed:.6g} s within the limits on the controls, "
            f"the plan lasts {total:.6g} s; need wider limits or a longer plan"
        )
    with np.errstate(divide="ignore"):
        order = np.argsort(lengths / least)  # efforts at the limit, the tightest first
    for stuck in range(lengths.size):
        free = order[stuck:]
        level = lengths[free].sum() / (total - least[order[:stuck]].sum())
        if lengths[free[0]] >= level * least[free[0]]:
            return np.asarray(np.maximum(least, lengths / level))
    return least.copy()


def control_box(model: Model, limits: ArrayLike | None, *, asks: str = "retime") -> Array:
    """Least and greatest controls (n_u, 2), around zero; ValueError if they are not."""
    names, box = model.control_names, model.control_limits if limits is None else limits
    box = limits_of(f"{asks}: limits", box, names=names)
    for name, (low, high) in zip(names, box, strict=True):
        if not low <= 0.0 <= high:
            raise ValueError(
                f"{asks}: limits: {name} needs least <= 0 <= greatest, got ({low:.6g}, {high:.6g})"
            )
    return box


def driftless(trims: Sequence[Trim], model: Model, *, asks: str = "retime") -> None:
    """Refuse a model that is not driftless, or that these are no trims of."""
    if model.reduced_names:
        raise ValueError(
            f"{asks}: the {model.name} has the reduced state {', '.join(model.reduced_names)}, "
            "so it cannot change its pace at will; need a driftless vehicle"
        )
    for trim in trims:
        twist = model.body_velocity(np.zeros(0), trim.control)
        if not _same_twist(twist, trim.body_velocity):
            raise ValueError(
                f"{asks}: trim {trim.name!r} moves with {vector_text(trim.body_velocity)}, but at "
                f"its control the {model.name} moves with {vector_text(twist)}; need the vehicle "
                "of the plan"
            )


def _check_scaling(trims: Sequence[Trim], model: Model, *, paces: Array) -> None:
    """Refuse a model that leaves the path when the control is scaled."""
    for trim, pace in zip(trims, paces.tolist(), strict=True):
        twist = model.body_velocity(np.zeros(0), pace * trim.control)
        if not _same_twist(twist, pace * trim.body_velocity):
            raise ValueError(
                f"retime: at {pace:.4g} times the control of trim {trim.name!r} the {model.name} "
                f"moves with {vector_text(twist)}, not {vector_text(pace * trim.body_velocity)}, "
                "so it leaves the path; need a vehicle whose body velocity scales with its control"
            )


def _same_twist(a: Array, b: Array) -> bool:
    """Whether two twists are equal to within rounding."""
    return bool(np.abs(a - b).max() <= TWIST_TOLERANCE * np.abs(b).max())


def _fastest(trim: Trim, box: Array, model: Model) -> float:
    """Greatest pace of a trim within the limits (n_u, 2); infinite if there are none."""
    limit = np.where(trim.control > 0.0, box[:, 1], box[:, 0])
    driven = trim.control != 0.0
    paces = limit[driven] / trim.control[driven]
    if paces.min() <= 0.0:
        name = np.array(model.control_names)[driven][int(np.argmin(paces))]
        raise ValueError(
            f"retime: trim {trim.name!r} needs {name}, whose limit is 0; need a wider one"
        )
    return float(paces.min())


def _scaled(trim: Trim, pace: float, box: Array) -> Trim:
    """A trim scaled to another pace along its path, with a name that tells it."""
    if abs(pace - 1.0) <= UNCHANGED:
        return trim
    return Trim(
        name=f"{trim.name} x{pace:.4g}",
        body_velocity=pace * trim.body_velocity,
        control=np.clip(pace * trim.control, box[:, 0], box[:, 1]),
        max_duration=trim.max_duration / pace,
    )


def _cost(plan: Plan, cost: StageCost) -> float:
    twists = np.array([trim.body_velocity for trim in plan.trims])
    return float(cost_rates(plan, cost) @ plan.durations) + cost.switching(twists)

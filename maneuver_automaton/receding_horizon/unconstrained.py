"""A fixed horizon without terminal constraint or cost: sequences of trims, one per interval.

The goal attracts by the stage cost alone. Sequences are searched by a beam and then improved one or
two trims at a time.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import (
    Array,
    IntArray,
    as_array,
    check_fields,
    check_range,
    freeze,
    plain_numbers,
    wrapped,
)
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.errors import InvalidAutomaton
from maneuver_automaton.groups import SE2
from maneuver_automaton.receding_horizon import _kernels_unconstrained as kernels

MIXED_POSE_ORDERS = (4.0, 2.0, 4.0)
NAMES = ("pose_weights", "control_weights", "pose_orders", "control_orders")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MixedOrderCost:
    """``q1 |x|^a1 + q2 |y|^a2 + q3 |heading|^a3 + sum r_i |u_i|^b_i``, of poses seen from the goal.

    A small offset y to the side is reached by speeds and headings of the size of its square root.
    With orders 4, 2, 4 and controls of order 4 all terms shrink alike, so that driving pays however
    small the offset is; with order 2 throughout it does not.

    Source: Worthmann, Mehrez, Zanon, Mann, Gosine, Diehl (2016), *Model predictive control of
    nonholonomic mobile robots without stabilizing constraints and costs*; why squares fail: Müller,
    Worthmann (2017), *Quadratic costs do not always work in MPC*.

    Parameters
    ----------
    pose_weights : (3,) array
        Positive weights of x, y and heading.
    control_weights : (n_u,) array
        Positive weights of the controls.
    pose_orders : (3,) array
        Exponents of x, y and heading, at least 1.
    control_orders : (n_u,) array, optional
        Exponents of the controls, at least 1; 4 for all if omitted.

    Examples
    --------
    >>> cost = MixedOrderCost(pose_weights=[1.0, 5.0, 0.1], control_weights=[0.5, 0.05])
    >>> cost.rates([0.0, 2.0, 0.0], [1.0, 0.0]).tolist()
    20.5
    """

    pose_weights: Array
    control_weights: Array
    pose_orders: Array = field(default_factory=lambda: np.array(MIXED_POSE_ORDERS))
    control_orders: Array = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        if np.size(self.control_orders) == 0:
            object.__setattr__(self, "control_orders", np.full(np.shape(self.control_weights), 4.0))
        for name in NAMES:
            freeze(self, name, last=3 if name.startswith("pose") else None)
            values = getattr(self, name)
            least = 0.0 if name.endswith("weights") else 1.0
            good = values > 0.0 if name.endswith("weights") else values >= 1.0
            if values.ndim != 1 or not good.all():
                need = "positive" if least == 0.0 else "at least 1"
                raise ValueError(f"mixed-order cost: {name} must be {need}, got {values.tolist()}")
        if self.control_orders.shape != self.control_weights.shape:
            raise ValueError(
                f"mixed-order cost: got {self.control_orders.size} control_orders for "
                f"{self.control_weights.size} control_weights, need one each"
            )

    @classmethod
    def quadratic(cls, pose_weights: ArrayLike, control_weights: ArrayLike) -> MixedOrderCost:
        """The usual cost: order 2 throughout.

        Examples
        --------
        >>> MixedOrderCost.quadratic([1, 1, 1], [1, 1]).rates([0, 0, 0], [0.5, 0]).tolist()
        0.25
        """
        weights = as_array("mixed-order cost: control_weights", control_weights)
        return cls(
            pose_weights=as_array("mixed-order cost: pose_weights", pose_weights),
            control_weights=weights,
            pose_orders=np.full(3, 2.0),
            control_orders=np.full(weights.shape, 2.0),
        )

    def pose_rates(self, poses: ArrayLike) -> Array:
        """Cost per second (...,) of being at poses (..., 3) seen from the goal [m, m, rad]."""
        return _weighted(as_array("poses", poses, last=3), self.pose_weights, self.pose_orders)

    def control_rates(self, controls: ArrayLike) -> Array:
        """Cost per second (...,) of controls (..., n_u)."""
        rows = as_array("controls", controls, last=self.control_weights.size)
        return _weighted(rows, self.control_weights, self.control_orders)

    def rates(self, poses: ArrayLike, controls: ArrayLike) -> Array:
        """Cost per second (...,) at poses (..., 3) from the goal, under controls (..., n_u)."""
        return self.pose_rates(poses) + self.control_rates(controls)


def _weighted(values: Array, weights: Array, orders: Array) -> Array:
    """Sum of ``weight |value| ** order`` over the last axis; squares are multiplied out."""
    total = np.zeros(values.shape[:-1])
    for k in range(weights.size):
        column = values[..., k]
        if orders[k] in (2.0, 4.0):
            square = column * column
            total = total + weights[k] * (square if orders[k] == 2.0 else square * square)
        else:
            total = total + weights[k] * np.abs(column) ** orders[k]
    return total


NODES = 5  # of the Gauss-Legendre rule on an interval: exact for polynomials of degree 9
SIMILAR = 9  # trims of most similar twist that a change of two intervals tries
GAIN = 1e-12  # smallest relative gain that changes a sequence


@dataclass(frozen=True, slots=True, kw_only=True)
class FixedHorizon:
    """A horizon of equal intervals with one trim each; the first `applied` of them are driven.

    Examples
    --------
    >>> FixedHorizon(interval=0.5, intervals=8).time
    4.0
    """

    interval: float  # [s]
    intervals: int
    applied: int = 1

    def __post_init__(self) -> None:
        plain_numbers(self)
        check_fields("fixed horizon", self, "interval", unit="s")
        if not 1 <= self.applied <= self.intervals:
            raise ValueError(
                "fixed horizon: applied must be at least 1 and at most the number of intervals, "
                f"got {self.applied} of {self.intervals}"
            )

    @property
    def time(self) -> float:
        """How far it looks ahead [s]."""
        return self.interval * self.intervals


@dataclass(frozen=True, slots=True, kw_only=True)
class HorizonSearch:
    """How hard to search: the defaults found the proven best in most cases that were measured."""

    width: int = 64  # partial sequences kept by the beam
    growth: float = 2.0  # [s] a pose is expected to cost its rate at most this long
    same: float = 1e-3  # [m, rad] partial sequences that end this close count as one

    def __post_init__(self) -> None:
        plain_numbers(self)
        check_fields("horizon search", self, "width", least=1)
        check_fields("horizon search", self, "growth", "same", least=0)


@dataclass(frozen=True, eq=False)
class UnconstrainedProblem:
    """Stay cheap for the time of a horizon, with costs seen from the goal; nothing has to be met.

    Moved together, start and goal leave the problem as it is. The heading is taken modulo a full
    turn where a horizon begins, and counted on from there.

    Source: Worthmann et al. (2016), *Model predictive control of nonholonomic mobile robots without
    stabilizing constraints and costs*; the paper, Sec. 4.4.

    Raises
    ------
    InvalidAutomaton
        If the automaton is not planar and kinematic, or a trim may not last for the horizon.
    ValueError
        If the cost has not one weight per control, or the goal is no planar pose.

    Examples
    --------
    >>> from maneuver_automaton.models import Unicycle
    >>> robot = Automaton.of_grid(Unicycle(), [[-1, 0, 1], [-1, 0, 1]])
    >>> cost = MixedOrderCost(pose_weights=[1, 1, 0.1], control_weights=[1, 0.1])
    >>> horizon = FixedHorizon(interval=0.5, intervals=4)
    >>> UnconstrainedProblem(robot, [2, 0, 0], cost=cost, horizon=horizon).seen([2, 1, 0]).tolist()
    [0.0, 1.0, 0.0]
    """

    automaton: Automaton
    goal: Array  # (3,) [m, m, rad]
    cost: MixedOrderCost = field(kw_only=True)
    horizon: FixedHorizon = field(kw_only=True)

    if TYPE_CHECKING:  # any numbers will do for the goal

        def __init__(
            self,
            automaton: Automaton,
            goal: ArrayLike,
            *,
            cost: MixedOrderCost,
            horizon: FixedHorizon,
        ) -> None: ...

    def __post_init__(self) -> None:
        freeze(self, "goal", last=3)
        if self.goal.ndim != 1:
            raise ValueError(f"goal: got shape {self.goal.shape}, need one pose (3,)")
        model = self.automaton.model
        if model.group is not SE2 or model.reduced_names:
            raise InvalidAutomaton(
                f"unconstrained horizon: the {model.name} is no planar kinematic vehicle, whose "
                "trims follow each other freely"
            )
        if self.cost.control_weights.size != len(model.control_names):
            raise ValueError(
                f"mixed-order cost: got {self.cost.control_weights.size} control_weights, need "
                f"{len(model.control_names)} ({', '.join(model.control_names)})"
            )
        for trim in self.automaton.trims:
            if trim.max_duration < self.horizon.time:
                raise InvalidAutomaton(
                    f"trim {trim.name!r}: max_duration is {trim.max_duration:.6g} s, need at least "
                    f"the horizon of {self.horizon.time:.6g} s"
                )

    def seen(self, poses: ArrayLike) -> Array:
        """Poses (..., 3) of the world seen from the goal, headings in [-pi, pi]."""
        there = (SE2(self.goal).inverse() @ SE2(as_array("pose", poses, last=3))).pose
        return np.concatenate([there[..., :2], wrapped(there[..., 2:])], axis=-1)

    @cached_property
    def tables(self) -> kernels.IntervalTables:
        """Displacements and costs of an interval of each trim, for the kernels."""
        points, weights = np.polynomial.legendre.leggauss(NODES)
        step, twists = self.horizon.interval, self.automaton.body_velocities
        times = 0.5 * step * (points + 1.0)
        size = np.abs(twists).max(axis=0)
        scaled = twists / np.where(size > 0.0, size, 1.0)
        gaps = np.linalg.norm(scaled[:, None] - scaled, axis=-1)
        return kernels.IntervalTables(
            places=np.array(SE2.exp(times[:, None] * twists[:, None]).pose),
            ends=np.array(SE2.exp(step * twists).pose),
            weights=0.5 * step * weights,
            effort=step * self.cost.control_rates(self.automaton.controls),
            pose_weights=np.array(self.cost.pose_weights),
            pose_orders=np.array(self.cost.pose_orders),
            near=np.ascontiguousarray(np.argsort(gaps, axis=1, kind="stable")[:, :SIMILAR]),
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class HorizonPlan:
    """A sequence of trims on the horizon, its cost, and its poses."""

    trims: IntArray  # (n,) indices, one per interval
    poses: Array  # (n + 1, 3) seen from the goal [m, m, rad]
    costs: Array  # (n,) of each interval

    @property
    def value(self) -> float:
        """Cost of the whole horizon."""
        return float(self.costs.sum())


def search_horizon(
    problem: UnconstrainedProblem,
    pose: ArrayLike,
    *,
    warm: ArrayLike | None = None,
    search: HorizonSearch | None = None,
) -> HorizonPlan:
    """A cheap sequence of trims from a `pose` (3,) of the world: one step of the controller.

    The best sequence of a beam search and the `warm` one (n,), if given, are improved one or two
    trims at a time until nothing gains; the cheaper result is returned, the warm one in a tie.

    Raises
    ------
    ValueError
        If the pose is not one planar pose, or `warm` has another length or names no trim.

    Examples
    --------
    >>> from maneuver_automaton.models import Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"rest": (0, 0), "ahead": (1, 0)})
    >>> cost = MixedOrderCost(pose_weights=[1, 1, 1], control_weights=[0.1, 1])
    >>> horizon = FixedHorizon(interval=0.5, intervals=4)
    >>> problem = UnconstrainedProblem(robot, [1, 0, 0], cost=cost, horizon=horizon)
    >>> search_horizon(problem, [0, 0, 0]).trims.tolist()
    [1, 1, 0, 0]
    """
    effort, tables = search or HorizonSearch(), problem.tables
    row = as_array("pose", pose, last=3)
    if row.ndim != 1:
        raise ValueError(f"pose: got shape {row.shape}, need one pose (3,)")
    seen, n = problem.seen(row), problem.horizon.intervals
    words, costs = kernels.beam(tables, seen, n, effort.width, effort.growth, effort.same)
    guesses = [words[0]] if warm is None else [_sequence(problem, warm, count=n), words[0]]
    plans = []
    for guess in guesses:
        kernels.improve(tables, seen, guess, GAIN * costs[0])
        plans.append(_plan(problem, seen, guess))
    return min(plans, key=lambda plan: plan.value)


def _plan(problem: UnconstrainedProblem, seen: Array, sequence: IntArray) -> HorizonPlan:
    poses, costs = np.empty((sequence.size + 1, 3)), np.empty(sequence.size)
    kernels.roll_out(problem.tables, seen, sequence, poses, costs)
    for array in (sequence, poses, costs):
        array.setflags(write=False)
    return HorizonPlan(trims=sequence, poses=poses, costs=costs)


def _sequence(problem: UnconstrainedProblem, trims: ArrayLike, *, count: int) -> IntArray:
    """A writable copy of a sequence of trims, checked."""
    rows = np.array(trims, dtype=np.int64)
    if rows.shape != (count,):
        raise ValueError(
            f"sequence: got shape {rows.shape}, need ({count},), a trim for each interval"
        )
    for row in rows:
        if not 0 <= row < len(problem.automaton):
            raise ValueError(
                f"sequence: got trim {row}, need an index from 0 to {len(problem.automaton) - 1}"
            )
    return rows


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class UnconstrainedLoop:
    """The closed loop: k steps, and the horizon's value before and after each."""

    poses: Array  # (k + 1, 3) of the world [m, m, rad]
    trims: IntArray  # (k, applied) indices, one per interval
    stage_costs: Array  # (k,) of the driven pieces
    values: Array  # (k + 1,) of the horizon at each pose
    settled: bool  # whether standing still is the best sequence at the last pose

    @property
    def cost(self) -> float:
        """Cost of the whole loop."""
        return float(self.stage_costs.sum())


def simulate_unconstrained(
    problem: UnconstrainedProblem,
    start: ArrayLike,
    *,
    steps: int,
    search: HorizonSearch | None = None,
) -> UnconstrainedLoop:
    """The closed loop from a `start` (3,) of the world, for `steps` steps or until it settles.

    Each search begins with the sequence before it, shifted by the driven piece and filled up with
    the trim whose control is cheapest. It settles where standing still is the best sequence found:
    from there on every step would be the same.

    Examples
    --------
    >>> from maneuver_automaton.automaton import Automaton
    >>> from maneuver_automaton.models import Unicycle
    >>> from maneuver_automaton.receding_horizon.unconstrained import MixedOrderCost
    >>> from maneuver_automaton.receding_horizon.unconstrained import FixedHorizon
    >>> robot = Automaton.of_controls(Unicycle(), {"rest": (0, 0), "ahead": (1, 0)})
    >>> cost = MixedOrderCost(pose_weights=[1, 1, 1], control_weights=[0.1, 1])
    >>> horizon = FixedHorizon(interval=0.5, intervals=4)
    >>> problem = UnconstrainedProblem(robot, [1, 0, 0], cost=cost, horizon=horizon)
    >>> loop = simulate_unconstrained(problem, [0, 0, 0], steps=9)
    >>> loop.settled, loop.poses[:, 0].tolist()
    (True, [0.0, 0.5, 1.0])
    """
    check_range("steps", steps, least=1)
    applied, twists = problem.horizon.applied, problem.automaton.body_velocities
    drive = SE2.exp(problem.horizon.interval * twists)
    pose = SE2(as_array("start", start, last=3))
    plan = search_horizon(problem, pose.pose, search=search)
    poses, values = [pose.pose], [plan.value]
    trims: list[IntArray] = []
    costs: list[float] = []
    while len(trims) < steps and not _stands_still(plan, twists):
        for trim in plan.trims[:applied]:
            pose = pose @ SE2(drive.pose[trim])
        trims.append(plan.trims[:applied])
        costs.append(float(plan.costs[:applied].sum()))
        plan = search_horizon(problem, pose.pose, warm=shifted(problem, plan), search=search)
        poses.append(pose.pose)
        values.append(plan.value)
    return UnconstrainedLoop(
        poses=np.array(poses),
        trims=np.array(trims, dtype=np.int64).reshape(-1, applied),
        stage_costs=np.array(costs),
        values=np.array(values),
        settled=_stands_still(plan, twists),
    )


def shifted(problem: UnconstrainedProblem, plan: HorizonPlan) -> IntArray:
    """The rest of a sequence after its applied intervals, filled up with the cheapest trim (n,)."""
    applied = problem.horizon.applied
    cheapest = np.argmin(problem.cost.control_rates(problem.automaton.controls))  # rest, if any
    return np.concatenate([plan.trims[applied:], np.full(applied, cheapest, dtype=np.int64)])


def _stands_still(plan: HorizonPlan, twists: Array) -> bool:
    return not twists[plan.trims].any()

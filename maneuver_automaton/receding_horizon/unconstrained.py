"""A fixed horizon without terminal constraint or cost: sequences of trims, one per interval.

The goal attracts by the stage cost alone. Sequences are searched by a beam and then improved one or
two trims at a time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, IntArray, as_array, freeze, plain_numbers, wrapped
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.errors import InvalidAutomaton
from maneuver_automaton.groups import SE2
from maneuver_automaton.receding_horizon.mixed_order_cost import MixedOrderCost

if TYPE_CHECKING:
    from maneuver_automaton.receding_horizon._kernels_unconstrained import IntervalTables

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
        if not (math.isfinite(self.interval) and self.interval > 0.0):
            raise ValueError(f"fixed horizon: interval must be positive, got {self.interval} s")
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
        if self.width < 1:
            raise ValueError(f"horizon search: width must be at least 1, got {self.width}")
        for name in ("growth", "same"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"horizon search: {name} must be at least 0, got {value}")


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

    @property
    def least_trim(self) -> int:
        """Index of the trim whose control costs least: rest, where there is one."""
        return int(np.argmin(self.cost.control_rates(self.automaton.controls)))

    @cached_property
    def tables(self) -> IntervalTables:
        """Displacements and costs of an interval of each trim, for the kernels."""
        from maneuver_automaton.receding_horizon._kernels_unconstrained import IntervalTables

        points, weights = np.polynomial.legendre.leggauss(NODES)
        step, twists = self.horizon.interval, self.automaton.body_velocities
        times = 0.5 * step * (points + 1.0)
        size = np.abs(twists).max(axis=0)
        scaled = twists / np.where(size > 0.0, size, 1.0)
        gaps = np.linalg.norm(scaled[:, None] - scaled, axis=-1)
        return IntervalTables(
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
    from maneuver_automaton.receding_horizon import _kernels_unconstrained as kernels

    effort, tables = search or HorizonSearch(), problem.tables
    seen, n = problem.seen(_one_pose(pose)), problem.horizon.intervals
    words, costs = kernels.beam(tables, seen, n, effort.width, effort.growth, effort.same)
    guesses = [words[0]] if warm is None else [_sequence(problem, warm, count=n), words[0]]
    plans = []
    for guess in guesses:
        kernels.improve(tables, seen, guess, GAIN * costs[0])
        plans.append(_plan(problem, seen, guess))
    return min(plans, key=lambda plan: plan.value)


def _plan(problem: UnconstrainedProblem, seen: Array, sequence: IntArray) -> HorizonPlan:
    from maneuver_automaton.receding_horizon import _kernels_unconstrained as kernels

    poses, costs = np.empty((sequence.size + 1, 3)), np.empty(sequence.size)
    kernels.roll_out(problem.tables, seen, sequence, poses, costs)
    for array in (sequence, poses, costs):
        array.setflags(write=False)
    return HorizonPlan(trims=sequence, poses=poses, costs=costs)


def _one_pose(pose: ArrayLike) -> Array:
    row = as_array("pose", pose, last=3)
    if row.ndim != 1:
        raise ValueError(f"pose: got shape {row.shape}, need one pose (3,)")
    return row


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

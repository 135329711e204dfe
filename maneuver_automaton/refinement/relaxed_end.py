"""The best coasting times of a word, by its whole cost; within a tolerance it may end anywhere."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.cutting import NOTHING
from maneuver_automaton.budget import UNLIMITED, Budget
from maneuver_automaton.groups import group_of
from maneuver_automaton.optimal_control.scene import settled
from maneuver_automaton.place_prices import TimedPrices
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.refinement.fitting import without_nothing
from maneuver_automaton.words.closing import EndConditions, conjugated

INSIDE = 1e-7  # share of a tolerance that is left to rounding
ITERATIONS = 100
ACCURACY = 1e-12  # of the cost, relative to itself
ROUGHLY = 1e-6  # the same where places cost something, whose price is not that smooth
SLOPES = 7  # decimals of a slope by differences, in which a moved problem has the same
STEADY = 5  # iterations of costs that differ by less are the last
NEARLY = 1e-3  # [m, rad, s] by which times may miss their conditions, to be closed at last
CLOSING_STEPS = 4
RANK = 1e-9  # singular values below this, relative, count as none


def with_relaxed_end(
    problem: Problem,
    plan: Plan,
    goal: Goal,
    *,
    share: float = 1.0,
    first: int = 0,
    budget: Budget = UNLIMITED,
) -> Plan | None:
    """A plan's word with the cheapest coasting times that end within the tolerance of a goal.

    `problem`: its cost and horizon hold; obstacles, bounds and zones are not looked at. `plan`: a
    plan that ends within the tolerance; maneuvers stay as they are. `share`: of the tolerance that
    may be used. `first`: first trim whose time may change: the motion before it stays, and stays
    collision-free. `budget`: none is found once its time is over. None where no cheaper
    times were found.
    """
    if not plan.trims:
        return None
    times = _best_times(_Relaxation(problem, plan, goal, share, first), budget)
    if times is None:
        return None
    relaxed = without_nothing(replace(plan, durations=times))
    return relaxed if problem.cost_of(relaxed) < problem.cost_of(plan) else None


class _OutOfTime(Exception):
    """A solver that cannot be told to stop is left so."""


@dataclass(frozen=True, eq=False)
class _Relaxation:
    """A word, and where it may end."""

    problem: Problem
    plan: Plan
    goal: Goal
    share: float
    first: int

    @property
    def far(self) -> float:
        """Distance from the goal that is admitted [m]."""
        return self.goal.tolerance_m * self.share * (1.0 - INSIDE)

    @property
    def turned(self) -> float:
        """Heading off the goal's that is admitted [rad]."""
        return self.goal.tolerance_rad * self.share * (1.0 - INSIDE)

    @property
    def total(self) -> float | None:
        """Sum of the coasting times [s], if it is fixed."""
        fixed = self.problem.horizon.time
        return None if fixed is None else fixed - self._under_way

    @property
    def most(self) -> float | None:
        """Greatest sum of the coasting times [s]."""
        most = self.problem.horizon.max_time
        return None if most is None else most - self._under_way

    @property
    def _under_way(self) -> float:
        return sum(one.duration for one in self.plan.maneuvers if one)

    @cached_property
    def _ending(self) -> EndConditions:
        """Conditions of the times to end at the goal, seen from there as a moved problem is."""
        plan, group = self.plan, group_of(self.plan.start.size)
        goal, start = np.array(self.goal.pose), np.array(plan.start)
        places = [0, 1, *range(3, start.size)]
        start[places] -= goal[places]  # places first, so that no digit is lost
        goal[places] = 0.0
        start = (group(goal).inverse() @ group(start)).pose
        twists = np.array([trim.body_velocity for trim in plan.trims])
        if any(plan.maneuvers):
            steps = [one.displacement if one else np.zeros(start.size) for one in plan.maneuvers]
            twists, product = conjugated(twists, np.array(steps))
            twists = twists @ group(product).inverse().adjoint().T
            start = (group(start) @ group(product)).pose
        return EndConditions(start=start, twists=twists, goal=np.zeros(start.size))

    def off(self, times: Array) -> tuple[Array, Array]:
        """Last pose (dof,) seen from the goal; how it follows the times (dof, n)."""
        missing, columns = self._ending.missing(times)
        return -missing, columns

    def exact(self, times: Array) -> tuple[Array, Array]:
        """Equality constraints (m,), which must be 0, and their derivatives by the times (m, n)."""
        end, columns = self.off(times)
        rows = [] if self.far else [0, 1, *range(3, end.size)]
        if not (self.turned or self.goal.free_heading):
            rows.append(2)
        values, jacobian = end[rows], columns[rows]
        if self.total is not None:
            values = np.append(values, times.sum() - self.total)
            jacobian = np.vstack([jacobian, np.ones(times.size)])
        return values, jacobian

    def room(self, times: Array) -> tuple[Array, Array]:
        """Inequality constraints (m,), at least 0, and their derivatives by the times (m, n)."""
        end, columns = self.off(times)
        values, rows = [], []
        if self.far:
            places = [0, 1, *range(3, end.size)]
            square = self.far * self.far
            values.append(1.0 - float(end[places] @ end[places]) / square)
            rows.append(-2.0 * end[places] @ columns[places] / square)
        if self.turned and not self.goal.free_heading:
            values += [1.0 - end[2] / self.turned, 1.0 + end[2] / self.turned]
            rows += [-columns[2] / self.turned, columns[2] / self.turned]
        if self.most is not None:
            values.append(self.most - float(times.sum()))
            rows.append(-np.ones(times.size))
        return np.array(values), np.array(rows).reshape(len(values), times.size)

    def conditions(self, begin: Array) -> list[dict[str, Any]]:
        """Both kinds of constraints as SciPy takes them, without equalities that others imply."""
        rows = _independent(self.exact(begin)[1][:, self.first :])
        asked = [("eq", self.exact, rows), ("ineq", self.room, np.arange(len(self.room(begin)[0])))]
        return [
            {
                "type": kind,
                "fun": lambda t, of=of, kept=kept: settled(of(t)[0][kept]),
                "jac": lambda t, of=of, kept=kept: settled(of(t)[1][kept]),
            }
            for kind, of, kept in asked
            if kept.size
        ]


def _best_times(task: _Relaxation, budget: Budget) -> Array | None:
    """The cheapest times; None if the solver found none that keep the conditions."""
    from scipy.optimize import Bounds, minimize

    plan, horizon = task.plan, task.problem.horizon
    rates = task.problem.rates_of(plan)
    scale = max(float(np.abs(rates).max()), 1e-300)
    moving = np.array([not trim.is_rest for trim in plan.trims])
    least = np.where(moving & (plan.durations > 0.0), horizon.min_coast, 0.0)
    longest = np.array([trim.max_duration for trim in plan.trims])
    if horizon.min_coast > 0.0:  # trims that are not in the word stay out of it
        longest = np.where(moving & (plan.durations == 0.0), 0.0, longest)
    least[: task.first] = longest[: task.first] = plan.durations[: task.first]
    begin = np.clip(plan.durations, least, longest)

    costs = task.problem.bound_place_costs
    places = TimedPrices(costs, plan, task.problem.automaton.model) if costs else None
    known, best = list[float](), (math.inf, begin)
    valued = dict[bytes, tuple[float, Array]]()  # each iteration is told where it was last asked

    def cost(times: Array) -> tuple[float, Array]:
        if places is None:
            return float(rates @ times) / scale, rates / scale
        if (at := times.tobytes()) not in valued:
            price, slopes = places.at(times)
            value = settled((rates @ times + price) / scale)
            valued[at] = float(value), np.round((rates + slopes) / scale, SLOPES)
        return valued[at]

    roughly = ROUGHLY * cost(begin)[0] if costs else ACCURACY

    def ask(times: Array) -> None:
        nonlocal best
        if budget.is_over:
            raise _OutOfTime
        if places:  # at a kink it goes from side to side until its last iteration
            known.append(cost(times)[0])
            off = max(
                np.abs(task.exact(times)[0]).max(initial=0.0), -task.room(times)[0].min(initial=0.0)
            )
            if off <= NEARLY and known[-1] < best[0]:
                best = known[-1], times.copy()
            if len(known) >= STEADY and np.ptp(known[-STEADY:]) < roughly:
                raise StopIteration

    try:
        solved = minimize(  # type: ignore[call-overload]  # its stubs want one-dimensional types
            cost,
            begin,
            jac=True,
            method="SLSQP",
            bounds=Bounds(least, longest),
            constraints=task.conditions(begin),
            callback=ask,
            options={"maxiter": ITERATIONS, "ftol": roughly},
        )
        found = solved.x if solved.success or not costs else best[1]
    except StopIteration:
        found = best[1]
    except _OutOfTime:
        return None
    times = np.clip(np.where(found > NOTHING, found, least), least, longest)
    return _closed(task, times) if np.isfinite(times).all() else None


def _independent(jacobian: Array) -> IntArray:
    """Rows of a matrix (m, n) that span all of them: a straight word cannot change its heading."""
    from scipy.linalg import qr

    if not jacobian.size:
        return np.zeros(0, dtype=np.int64)
    _, r, order = qr(jacobian.T, mode="economic", pivoting=True)
    sizes = np.abs(np.diag(r))
    return np.sort(order[: sizes.size][sizes > RANK * max(1.0, float(sizes[0]))]).astype(np.int64)


def _closed(task: _Relaxation, times: Array) -> Array | None:
    """Times near `times` that meet all constraints but for rounding; None where none are found."""
    used = (times > 0.0) & (np.arange(times.size) >= task.first)
    for _ in range(CLOSING_STEPS):
        (values, jacobian), (room, slopes) = task.exact(times), task.room(times)
        beyond = room < -INSIDE
        values, jacobian = np.append(values, room[beyond]), np.vstack([jacobian, slopes[beyond]])
        if not values.size or not used.any():
            break
        times = times.copy()
        times[used] -= np.linalg.lstsq(jacobian[:, used], values, rcond=RANK)[0]
    fine = times.min(initial=0.0) >= 0.0 and task.room(times)[0].min(initial=0.0) >= -INSIDE
    return times if fine else None

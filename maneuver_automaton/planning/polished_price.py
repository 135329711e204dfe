"""The cost that polishing minimises: that of a problem as far as a solver can be told, or time.

Whatever it finds is priced once more by the problem itself, so a stand-in costs no honesty.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.costs import Cost, StageCost, terms_of, without_switches
from maneuver_automaton.groups import group_of
from maneuver_automaton.models.vehicle import Components
from maneuver_automaton.optimal_control.problem import RunningCost
from maneuver_automaton.optimal_control.scene import LEAST_DURATION, MOST_DURATION, PlacesAt
from maneuver_automaton.places import PER, rates_along, scale_of, smoothed
from maneuver_automaton.problem import Problem

EARLY = 1e-6  # share of a longest time by which a motion ends before it: closing may add some
SMOOTHING = 1e-6  # [m^2/s^2] under the root of a speed: with less, solvers stall where it is 0
HURRY = 0.01  # of the greatest price of a second, where metres alone have a price
ROUND = 0.03  # of the greatest control, within which a norm is smooth: solvers stall at its tip


@dataclass(frozen=True, slots=True, eq=False)
class PolishedPrice:
    """Cost of a motion per second, without prices per piece, since it is one piece.

    Of a user's own cost nothing is known but numbers: the time stands in for it.
    """

    problem: Problem
    cost: Cost
    waiting: float  # per second of the rest that fills a fixed time

    def of(self, plan: Plan) -> float:
        """Cost of a plan at this price."""
        if self.cost is terms_of(self.problem.cost):
            return self.problem.cost_of(plan)
        return replace(self.problem, cost=self.cost).cost_of(plan)

    def unit(self, known: Plan | None) -> float:
        """The price of time or, where it has none, what a `known` plan costs per second; else 1."""
        if self.cost.time > self.waiting:
            return self.cost.time
        value = self.of(known) / known.duration - self.waiting if known else 1.0
        return float(f"{value:.9g}")  # as a moved problem has it

    def places(self, known: Plan | None) -> PlacesAt | None:
        """What places cost in the same unit, seen from the start; None if they cost nothing."""
        costs, unit = self.problem.bound_place_costs, self.unit(known)
        if not (costs and unit > 0.0):
            return None
        model, start = self.problem.automaton.model, self.problem.start
        group, smooth = group_of(start.size), [smoothed(one) for one in costs]

        def at(poses: Array, states: Array, controls: Array) -> Array:
            world = np.asarray((group(start) @ group(poses)).pose)
            twists, rates = model.body_velocity(states, controls), np.zeros((len(poses), 2))
            for one in smooth:
                rates[:, PER.index(one.per)] += rates_along(one, world, twists, states) / unit
            return rates

        return PlacesAt(at, min(map(scale_of, costs)))

    def stage_cost(self, known: Plan | None) -> RunningCost | None:
        """Cost per second beside 1 for the time; None if there is none.

        Its unit is that of `unit`.
        """
        cost, model = self.cost, self.problem.automaton.model
        unit = self.unit(known)
        fixed = (cost.time - self.waiting) / unit - 1.0 if unit > 0.0 else 0.0
        if not unit > 0.0 or (fixed == cost.effort == cost.norm == cost.length == 0.0):
            return None
        effort, norm, length = cost.effort / unit, cost.norm / unit, cost.length / unit
        count = len(model.control_names)
        weight = np.eye(count) if cost.effort_matrix is None else cost.effort_matrix
        greatest = np.abs(model.control_limits).max(axis=1)
        rounded = ROUND * np.where(np.isfinite(greatest), greatest, 1.0)

        def price(z: Components, u: Components) -> Any:
            spent: Any = fixed
            if effort:
                spent += effort * sum(
                    float(weight[i, j]) * u[i] * u[j] for i in range(count) for j in range(count)
                )
            if norm:
                spent += norm * _norm(u, cost.norm_order, rounded)
            if length:
                v_x, v_y, _, *climb = model.velocity(z, u)
                square = v_x * v_x + v_y * v_y + sum(v * v for v in climb) + SMOOTHING
                spent += length * np.sqrt(square)
            return spent

        return price


def polished_price(problem: Problem) -> PolishedPrice:
    """The price at which plans of a problem are polished."""
    cost = terms_of(problem.cost)
    if cost is None:
        return PolishedPrice(problem, Cost(time=1.0), 0.0)
    rest = problem.automaton.rest
    pads = problem.horizon.time is not None and rest is not None and rests_at_an_end(problem)
    waiting = float(problem.rates[rest]) if pads and rest is not None else 0.0
    limit = problem.horizon.time or problem.horizon.max_time
    if limit is None and prices_metres_alone(cost):
        # lengths are the same at any pace: a little for the time tells the solver which
        cost = replace(cost, time=HURRY * float(problem.rates.max()))
    return PolishedPrice(problem, without_switches(cost), waiting)


def prices_metres_alone(cost: StageCost) -> bool:
    """Whether a cost prices the length of a motion, and neither its time nor its controls."""
    terms = terms_of(cost)
    others = () if terms is None else (terms.time, terms.effort, terms.norm)
    return terms is not None and terms.length > 0.0 and not any(others)


def admitted_durations(problem: Problem) -> tuple[float, float]:
    """Least and greatest duration [s] of a polished motion: rest may fill a fixed time."""
    longest = problem.horizon.time or problem.horizon.max_time
    if longest is None:
        return LEAST_DURATION, MOST_DURATION
    if problem.horizon.time is not None and not rests_at_an_end(problem):
        return longest, longest
    longest *= 1.0 - EARLY
    return min(LEAST_DURATION, longest), longest


def rests_at_an_end(problem: Problem) -> bool:
    """Whether the vehicle may rest before or after its motion."""
    return problem.first_trim.is_rest or all(
        problem.last_trim(goal).is_rest for goal in problem.goals
    )


def _norm(u: Components, order: float, rounded: Array) -> Any:
    """A smooth norm of controls; that of order 2 stands in for the greatest component."""
    squares = [u[i] * u[i] for i in range(len(rounded))]
    if order == 1.0:
        return sum(np.sqrt(one + by * by) for one, by in zip(squares, rounded, strict=True))
    return np.sqrt(sum(squares) + float(np.min(rounded)) ** 2)

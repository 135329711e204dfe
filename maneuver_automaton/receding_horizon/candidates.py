"""Plans that a step may apply, and the costs by which they are compared."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.cutting import first_times, last_times
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.receding_horizon.log import Origin, first_part
from maneuver_automaton.receding_horizon.pace import at_best_pace, base_name
from maneuver_automaton.receding_horizon.settings import EXACT, Settings
from maneuver_automaton.receding_horizon.shifting import (
    costliest_first,
    merged,
    moving_pieces,
    rest_of,
)
from maneuver_automaton.search.limits import outside, stays_inside
from maneuver_automaton.search.result import TIE


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Candidate:
    """A plan that may be applied."""

    plan: Plan
    cost: float
    goal_index: int
    origin: Origin


def preference(
    one: Candidate, problem: Problem, step: float
) -> tuple[float, bool, int, tuple[str, ...]]:
    """Order of plans that cost the same, the first one to be applied for a `step` [s].

    Greatest cost on [0, delta) first, then the known word, then fewer trims, then by name.

    Source: the paper, Sec. 5.1.
    """
    known = one.origin is not Origin.SEARCHED
    at_first = _cost_of_first(problem, one.plan, step)
    return -float(f"{at_first:.9g}"), not known, len(one.plan.trims), one.plan.word


def candidate(
    here: Problem, settings: Settings, plan: Plan, *, goal_index: int, origin: Origin
) -> Candidate:
    """A plan at its best pace, if that is asked for, and in the order that costs most at first.

    The order stays where another one drives elsewhere among obstacles, or where there
    are maneuvers.
    """
    if settings.retimed:
        plan = at_best_pace(here, plan)
    cost = here.cost_of(plan)
    fixed = bool(here.obstacles or here.zones or any(plan.maneuvers))
    ordered = plan if fixed else costliest_first(plan, here.rates_of(plan))
    if ordered is not plan:
        costlier = here.cost_of(ordered)
        if costlier <= cost + TIE * (1.0 + abs(cost)) and allowed(here, ordered):
            plan, cost = ordered, costlier
    return Candidate(plan=plan, cost=cost, goal_index=goal_index, origin=origin)


def allowed(here: Problem, plan: Plan) -> bool:
    """Whether a plan stays inside the bounds, unless the vehicle is outside of them already."""
    return bool(outside(here.start, here.bounds)) or stays_inside(plan, here.bounds)


def bounded(problem: Problem) -> bool:
    """Whether a problem bounds the places its vehicle may go to."""
    return any(getattr(problem.bounds, name) is not None for name in ("x", "y", "z"))


def cost_until(problem: Problem, plan: Plan, until: float) -> float:
    """Cost of the first `until` seconds of a plan, the switches in them included."""
    # The cost does not depend on where the rest begins, and to find out where takes longer.
    if any(plan.maneuvers):
        return problem.cost_of(plan) - problem.cost_of(rest_of(plan, until, start=plan.start))
    left = last_times(plan.durations.tolist(), until)
    trims, times = merged(plan.trims[len(plan.trims) - len(left) :], left)
    return problem.cost_of(plan) - problem.cost_of_trims(trims, np.array(times))


def _cost_of_first(problem: Problem, plan: Plan, until: float) -> float:
    """Cost of the first `until` seconds of a plan."""
    if plan.maneuvers or not plan.trims:
        return problem.cost_of(first_part(plan, until))
    times = first_times(plan.durations.tolist(), until)
    return problem.cost_of_trims(plan.trims[: len(times)], np.array(times))


def is_rest_of(plan: Plan, rest: Plan | None) -> bool:
    """Whether the word of `plan` is the rest of the last one, with or without a rest to pad it."""
    return rest is not None and _moving(plan) == _moving(rest)


def within(pose: Array, goal: Goal) -> bool:
    """Whether a pose is a goal, to within its tolerances (1e-9 where they are 0)."""
    distance, turn = goal.off(pose)
    return distance <= goal.tolerance_m + EXACT and turn <= goal.tolerance_rad + EXACT


def _moving(plan: Plan) -> list[str]:
    return [base_name(piece.name) for piece in moving_pieces(plan)]

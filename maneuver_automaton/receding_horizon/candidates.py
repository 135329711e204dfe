"""Plans that a step may apply, the costs by which they are compared, and their best pace."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.automaton.cutting import first_times, last_times
from maneuver_automaton.budget import Budget
from maneuver_automaton.costs import StageCost, terms_of
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Goal, Horizon, Problem
from maneuver_automaton.receding_horizon.log import Decision, Origin, first_part
from maneuver_automaton.receding_horizon.rest_of_plan import (
    costliest_first,
    merged,
    moving_pieces,
    rest_of,
)
from maneuver_automaton.receding_horizon.settings import EXACT, Settings
from maneuver_automaton.refinement.retiming import effort_report, retime
from maneuver_automaton.refinement.shooting import least_effort
from maneuver_automaton.search.choose import search_goal
from maneuver_automaton.search.limits import outside, stays_inside
from maneuver_automaton.search.result import TIE, plan_of

PACE = re.compile(r"( x[-+.e0-9]+)+$")
UNIFORM = 1e-9  # relative spread of an effort that counts as uniform


def at_best_pace(problem: Problem, plan: Plan) -> Plan:
    """A plan retimed to uniform effort in the same time, as far as limits allow.

    Source: the paper, Prop. 15 and Cor. 19.
    """
    moving = [bool(trim.body_velocity.any()) for trim in plan.trims]
    cost = terms_of(problem.cost)
    if not any(moving) or cost is None:
        return plan
    better = retime(plan, problem.automaton.model, cost=cost)
    if not better.saving > 0.0:
        return plan
    trims = tuple(_named(problem.automaton, trim) for trim in better.after.trims)
    return replace(better.after, trims=trims)


def between_trims(problem: Problem, plan: Plan, pieces: int) -> Plan:
    """A plan with controls between those of the library, in the same time, where it costs less."""
    cost = terms_of(problem.cost)
    if not any(trim.body_velocity.any() for trim in plan.trims) or cost is None:
        return plan
    model = problem.automaton.model
    known = np.array([trim.control for trim in problem.automaton.trims])
    most = np.asarray(model.control_limits, dtype=np.float64)
    limits = np.stack(
        [np.maximum(known.min(axis=0), most[:, 0]), np.minimum(known.max(axis=0), most[:, 1])],
        axis=-1,
    )
    return least_effort(plan, model, cost=cost, limits=limits, pieces=pieces)


def base_name(name: str) -> str:
    """Name of the trim of the library that a trim at another pace comes from."""
    return PACE.sub("", name) if " x" in name else name


def _named(automaton: Automaton, trim: Trim) -> Trim:
    """The trim, named after the one of the library and how much faster it is."""
    base = base_name(trim.name)
    own = automaton.trims[automaton.index_of(base)].body_velocity
    pace = float(trim.body_velocity @ own) / float(own @ own)
    return replace(trim, name=base if pace == 1.0 else f"{base} x{pace:.6g}")


def is_uniform(plan: Plan, cost: StageCost) -> bool:
    """Whether a plan has the same quadratic effort all along."""
    terms = terms_of(cost)
    if terms is None or not plan.trims:
        return False
    report = effort_report(plan, terms.effort_matrix)
    return bool(report.spread <= UNIFORM) and bool(np.isfinite(report.mean))


@dataclass(slots=True, eq=False, kw_only=True)
class StepPlan:
    """A plan that may be applied."""

    plan: Plan
    cost: float
    goal_index: int
    origin: Origin
    shifted_value: float | None = None  # cost of the rest of the last plan
    arrived: bool = False
    decision: Decision | None = None  # None: told by the plan
    free_until: float | None = None  # [s]


def preference(
    one: StepPlan, problem: Problem, step: float
) -> tuple[float, bool, int, tuple[str, ...]]:
    """Order of plans that cost the same, the first one to be applied for a `step` [s].

    Greatest cost on [0, delta) first, then the known word, then fewer trims, then by name.

    Source: the paper, Sec. 5.1.
    """
    known = one.origin is not Origin.SEARCHED
    plan = one.plan
    if plan.maneuvers or not plan.trims or problem.place_costs:
        at_first = problem.cost_of(first_part(plan, step))
    else:
        times = first_times(plan.durations.tolist(), step)
        at_first = problem.cost_of_trims(plan.trims[: len(times)], np.array(times))
    return -float(f"{at_first:.9g}"), not known, len(plan.trims), plan.word


def candidate(
    here: Problem, settings: Settings, plan: Plan, *, goal_index: int, origin: Origin
) -> StepPlan:
    """A plan at its best pace, if that is asked for, and in the order that costs most at first.

    The order stays where another one drives elsewhere among obstacles or past what is on the way,
    or where there are maneuvers.
    """
    if settings.retimed:
        paced = at_best_pace(here, plan)
        if not here.place_costs or here.cost_of(paced) <= here.cost_of(plan):
            plan = paced
    cost = here.cost_of(plan)
    fixed = bool(here.obstacles or here.zones or here.via or any(plan.maneuvers))
    ordered = plan if fixed else costliest_first(plan, here)
    if ordered is not plan:
        costlier = here.cost_of(ordered)
        if costlier <= cost + TIE * (1.0 + abs(cost)) and allowed(here, ordered):
            plan, cost = ordered, costlier
    return StepPlan(plan=plan, cost=cost, goal_index=goal_index, origin=origin)


def allowed(here: Problem, plan: Plan) -> bool:
    """Whether a plan stays inside the bounds, unless the vehicle is outside of them already."""
    return stays_inside(plan, here.bounds) or bool(outside(here.start, here.bounds))


def bounded(problem: Problem) -> bool:
    """Whether places count: a problem bounds where its vehicle may go to, or prices it."""
    return bool(problem.place_costs) or not problem.bounds.are_open


def cost_until(problem: Problem, plan: Plan, until: float, *, whole: float | None = None) -> float:
    """Cost of a plan's first `until` seconds, with their switches; `whole`: its own, if known."""
    if problem.place_costs:
        places = sum(one.price for one in problem.place_prices_of(first_part(plan, until)))
        return places + cost_until(replace(problem, place_costs=()), plan, until)
    # The cost does not depend on where the rest begins, and to find out where takes longer.
    if any(plan.maneuvers):
        return problem.cost_of(plan) - problem.cost_of(rest_of(plan, until, start=plan.start))
    left = last_times(plan.durations.tolist(), until)
    trims, times = merged(plan.trims[len(plan.trims) - len(left) :], left)
    whole = problem.cost_of(plan) if whole is None else whole
    return whole - problem.cost_of_trims(trims, np.array(times))


def is_rest_of(plan: Plan, rest: Plan | None) -> bool:
    """Whether the word of `plan` is the rest of the last one, with or without a rest to pad it."""
    if rest is None or plan is rest:
        return plan is rest
    one, other = list(moving_pieces(plan)), list(moving_pieces(rest))
    return one == other or [base_name(a.name) for a in one] == [base_name(b.name) for b in other]


def within(pose: Array, goal: Goal) -> bool:
    """Whether a pose is a goal, to within its tolerances (1e-9 where they are 0)."""
    distance, turn = goal.off(pose)
    return distance <= goal.tolerance_m + EXACT and turn <= goal.tolerance_rad + EXACT


MOST_STEPS = 4  # that a plan within the goal's set may take
ALTERNATIVES = 1  # costlier plans, of which one may stay in the set
MOST_USED = 0.5  # share of the tolerance that a plan of several steps may use up at the next step
FINE = 0.01  # [m, rad] between the poses that are looked at


def holding(here: Problem, settings: Settings, goal_index: int) -> StepPlan | None:
    """A plan to the middle of a goal's set within a step or a few.

    The cheapest that stays in the set all along and does not linger at its edge, otherwise one that
    is inside whenever the loop closes; None if there is neither, or trims are not switched at will.
    """
    if here.has_inertia:
        return None
    goal = here.goals[goal_index]
    middle = replace(goal, tolerance_m=0.0, tolerance_rad=0.0)
    second: StepPlan | None = None
    for steps in range(1, MOST_STEPS + 1):
        limit = steps * settings.step
        fixed = settings.pad_of(here) is not None
        near = replace(
            here,
            goals=(middle,),
            horizon=Horizon(time=limit) if fixed else Horizon(max_time=limit),
            search=replace(here.search, method="insertion"),
        )
        results = search_goal(
            near, middle, alternatives=ALTERNATIVES, budget=Budget.from_now(settings.time_limit)
        )
        found = [
            candidate(
                near,
                settings,
                plan_of(near, solution),
                goal_index=goal_index,
                origin=Origin.SEARCHED,
            )
            for result in results
            for solution in result.solutions
        ]
        for one in sorted(found, key=lambda candidate: candidate.cost):
            plan, begin = one.plan, one.plan.start_time
            away, turn = goal.off(plan.pose_at(begin + settings.step))
            used = away / max(goal.tolerance_m, EXACT), turn / max(goal.tolerance_rad, EXACT)
            if steps == 1 or max(used) <= MOST_USED:  # of the tolerance, 1 at the edge of the set
                samples = plan.sample(max_step_m=FINE, max_step_rad=FINE)
                if all(within(pose, goal) for pose in samples.pose):
                    return one
            closings = settings.step * np.arange(1, math.ceil(plan.duration / settings.step) + 1)
            poses = plan.pose_at(begin + closings)
            if second is None and all(within(pose, goal) for pose in poses):
                second = one
    return second

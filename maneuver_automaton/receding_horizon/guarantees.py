"""Guarantees of the paper for the closed loop, checked while it runs."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.costs import Cost, terms_of
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.receding_horizon.log import Guarantee, Step, Violation
from maneuver_automaton.receding_horizon.settings import switches_at_will
from maneuver_automaton.search.limits import rest_rate

ACCURACY = 1e-9  # relative, of values


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Promises:
    """The constants of the paper's bounds for one problem, per second beyond the cost of rest."""

    least_rate: float  # min l over the trims that move; 0 if there is none
    rest_rate: float  # cost of a second of rest where it pads a fixed time, else 0
    time_rate: float  # c3, with a free final time
    effort: float  # c1 lambda_min(R), or less where speeds are no controls; 0 if time is free
    horizon: float | None  # T [s], None if free
    step: float  # delta [s]
    switch: float = 0.0  # cost of the switch to the rest that fills a fixed time
    steady: bool = True  # whether it costs least_rate or more at every moment to move

    def most_steps(self, value: float) -> int | None:
        """The paper's bound on the number of steps from a state of that value; None if none.

        V(x0) / (delta min l) for finite control sets, V(x0) / (delta c3) for penalised time: the
        smaller one. With a fixed time the cost of rest is taken off first.

        Source: the paper, Sec. 4.2 and 4.3.
        """
        if self.horizon is not None:
            value -= self.rest_rate * self.horizon
        rate = max(self.least_rate, self.time_rate)
        if not (rate > 0.0 and math.isfinite(value)):
            return None
        return math.ceil(max(value, 0.0) / (self.step * rate) * (1.0 - ACCURACY))

    def effort_bound(self, pose: Array, goal: Goal) -> float:
        """lambda_R c1 |x|^2 / T: no plan costs less, at whatever pace its trims are driven.

        Source: the paper, Appendix.
        """
        if self.horizon is None:
            return 0.0
        distance, turn = goal.off(pose)
        return self.effort * (distance**2 + turn**2) / self.horizon

    def effort_decrease(self, pose: Array, goal: Goal) -> float:
        """lambda_R c1 delta |x|^2 / T^2: the decrease of the value by continuous controls.

        Source: the paper, Theorem 17.
        """
        return self.effort_bound(pose, goal) * self.step / (self.horizon or math.inf)


def promises(problem: Problem, *, step: float) -> Promises:
    """The constants of a problem whose loop closes every `step` seconds.

    Along a maneuver a vehicle may stand nearly still, and a zone may slow it down, so that no least
    rate is promised then.

    Examples
    --------
    >>> from maneuver_automaton.automaton import Automaton
    >>> from maneuver_automaton.models import Unicycle
    >>> from maneuver_automaton.problem import Horizon
    >>> robot = Automaton.of_controls(Unicycle(), {"rest": (0, 0), "slow": (0.5, 0), "on": (1, 0)})
    >>> cost = Cost(effort=1.0)
    >>> problem = Problem(robot, [-2, 0, 0], [0, 0, 0], cost=cost, horizon=Horizon(time=4.0))
    >>> promises(problem, step=0.1).most_steps(1.0)
    40
    """
    moving = problem.automaton.body_velocities.any(axis=1)
    rates = problem.rates
    rest = rest_rate(problem) or 0.0
    steady = switches_at_will(problem) and not problem.zones
    least = float(rates[moving].min()) - rest if steady and moving.any() else 0.0
    cost = terms_of(problem.cost)
    fixed = problem.horizon.time is not None
    effort = 0.0
    if fixed and cost:
        effort = _least_effort(problem, cost)
    return Promises(
        least_rate=max(least, 0.0),
        rest_rate=rest,
        time_rate=cost.time if cost and not fixed else 0.0,
        effort=effort,
        horizon=problem.horizon.time,
        step=step,
        switch=cost.switch if cost and fixed else 0.0,
        steady=steady,
    )


def _least_effort(problem: Problem, cost: Cost) -> float:
    """c1 lambda_min(R), the paper's constant for the unicycle, whose controls are its speeds.

    For other vehicles at most the effort of a trim of the library per (m/s)^2 + (rad/s)^2.
    """
    weight = cost.effort_matrix
    smallest = 1.0 if weight is None else float(np.linalg.eigvalsh(weight)[0])
    squares = (problem.automaton.body_velocities**2).sum(axis=1)
    moving = squares > 0.0
    if not (cost.effort > 0.0 and moving.any()):
        return 0.0
    effort = Cost(effort=cost.effort, effort_matrix=weight)
    rates = effort.rates(problem.automaton.controls, problem.automaton.body_velocities)
    return min(cost.effort * smallest, float((rates[moving] / squares[moving]).min()))


def broken(
    promised: Promises,
    goal: Goal,
    last: Step,
    now: Step,
    *,
    most_steps: int | None,
    uniform: bool,
    moved: bool = False,
) -> Iterator[Violation]:
    """What the step from `last` to `now` does not keep of the guarantees, each with the reason.

    The paper gives them to the undisturbed loop; the caller knows whether something disturbed it.

    `uniform`: the controls are continuous and the effort is uniform, so that the paper's decrease
    by the effort is promised too. `moved`: obstacles move, or were seen anew.
    """
    off = now.off_plan or 0.0
    why = "obstacles moved" if moved else "the plan was followed"
    if off > 0.0:
        why = f"the state was measured {off:.3g} off the plan"
    tolerance = ACCURACY * (1.0 + abs(last.value))
    free = " and safely" if moved else ""
    if now.shifted_value is None:
        yield Violation(
            guarantee=Guarantee.FEASIBILITY,
            reason=f"the rest of the last plan does not lead to the goal in time{free}; {why}",
        )
    padding = promised.rest_rate * last.applied
    if last.plan.trims and not last.plan.trims[-1].is_rest:  # rest is a new switch
        padding += promised.switch
    allowed = last.value - last.applied_cost + padding
    if now.value > allowed + tolerance and not (now.arrived or last.arrived):
        said = f"the value is {now.value:.9g}, need at most {allowed:.9g}; {why}"
        if off > 0.0:
            rise = now.value - allowed
            said = f"noise raised the value by {rise:.3g} above {allowed:.9g}; {why}"
        yield Violation(guarantee=Guarantee.DECREASE, reason=said)
    elif uniform and off == 0.0:
        least = promised.effort_decrease(last.pose, goal)
        if last.value - now.value < least - tolerance:
            yield Violation(
                guarantee=Guarantee.EFFORT,
                reason=f"the value fell by {last.value - now.value:.9g}, need {least:.9g}",
            )
    if (
        most_steps is not None
        and now.number >= most_steps
        and off == 0.0
        and not (now.arrived or last.arrived)
    ):
        yield Violation(
            guarantee=Guarantee.STEPS,
            reason=f"step {now.number} is not the goal, need it within {most_steps}",
        )


def too_cheap(promised: Promises, now: Step) -> Iterator[Violation]:
    """Whether the piece applied costs less than the cheapest motion, without arriving."""
    moves = promised.step - ACCURACY
    needed = (promised.least_rate + promised.rest_rate) * promised.step
    resting = now.plan.trims and now.plan.trims[0].is_rest
    cheap = now.applied_cost < needed - ACCURACY * (1.0 + needed)
    if resting or (cheap and _time_moving(now) > moves):
        yield Violation(
            guarantee=Guarantee.LEAST_COST,
            reason=f"the step costs {now.applied_cost:.9g}, need at least {needed:.9g}: it rests "
            "before the goal",
        )


def _time_moving(step: Step) -> float:
    moving = [not trim.is_rest for trim in step.plan.trims]
    return float(step.plan.durations[moving].sum()) if moving else 0.0

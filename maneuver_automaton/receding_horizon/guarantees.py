"""What the paper guarantees of a closed loop, and what is proven of it on the way."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._kernel_list import load_kernels
from maneuver_automaton.bounds import CostToGo
from maneuver_automaton.budget import Budget, Watch
from maneuver_automaton.costs import Cost, prices_switches, terms_of
from maneuver_automaton.planning.proving import Proving, in_costs
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.receding_horizon.log import Guarantee, Step, Violation
from maneuver_automaton.search.limits import rest_rate

ACCURACY = 1e-9  # relative, of values
PRICED = 1e-3  # the same where places are priced, by quadrature


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
    accuracy: float = ACCURACY  # relative, of values
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

    Along a maneuver a vehicle may stand nearly still, it may stay on its way, and a zone may slow
    it down, so that no least rate is promised then.

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
    stays = any(one.stay_s for one in problem.via)
    steady = not problem.has_inertia and not problem.zones and not stays
    least = float(rates[moving].min()) - rest if steady and moving.any() else 0.0
    cost = terms_of(problem.cost)
    fixed = problem.horizon.time is not None
    return Promises(
        least_rate=max(least, 0.0),
        rest_rate=rest,
        time_rate=cost.time if cost and not fixed else 0.0,
        effort=_least_effort(problem, cost) if fixed and cost else 0.0,
        horizon=problem.horizon.time,
        step=step,
        switch=cost.switch if cost and fixed else 0.0,
        accuracy=PRICED if problem.place_costs else ACCURACY,
        steady=steady,
    )


def _least_effort(problem: Problem, cost: Cost) -> float:
    """c1 lambda_min(R), the paper's constant for the unicycle, whose controls are its speeds."""
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
    tolerance = promised.accuracy * (1.0 + abs(last.value))
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
    needed = (promised.least_rate + promised.rest_rate) * promised.step
    resting = now.plan.trims and now.plan.trims[0].is_rest
    cheap = now.applied_cost < needed - ACCURACY * (1.0 + needed)
    moving = [not trim.is_rest for trim in now.plan.trims] if cheap else []
    if resting or (cheap and float(now.plan.durations[moving].sum()) > promised.step - ACCURACY):
        yield Violation(
            guarantee=Guarantee.LEAST_COST,
            reason=f"the step costs {now.applied_cost:.9g}, need at least {needed:.9g}: it rests "
            "before the goal",
        )


@dataclass(slots=True, eq=False)
class LoopBounds:
    """Functions that were proven on the way, and what has been driven since.

    The way driven and any plan from here make one plan from where a function was proven: if it is
    cheaper than the plan known then, it stays in the function's cells.
    """

    gap: float  # share of the value that is small enough
    whole: CostToGo | None = None  # serves poses beside the way, too
    finest: CostToGo | None = None  # serves poses on the way from where it was proven
    since: float = 0.0  # cost accumulated there
    least: float = 0.0  # cost of any plan from where that much was accumulated ...
    at: float = 0.0

    @classmethod
    def ready(cls, gap: float) -> LoopBounds:
        """Bounds of a loop that begins, with all that is to be compiled."""
        load_kernels("cells")
        return cls(gap)

    def forget(self) -> None:
        """Other obstacles are seen: nothing holds any more."""
        self.whole = self.finest = None
        self.least = 0.0

    def leave(self) -> None:
        """The vehicle is off the plan: how it came here is not known."""
        self.finest = None
        self.least = 0.0

    def known(self, here: Problem, accumulated: float) -> float:
        """The best bound from here, after some cost of the whole loop; 0 if none is known."""
        pose = here.start[:3]
        driven = accumulated - self.since
        beside = 0.0 if self.whole is None else self.whole.anywhere(pose)
        best = max(beside, 0.0 if self.finest is None else self.finest.after(pose, driven))
        proven = in_costs(here, best) if best > 0.0 else 0.0
        return max(proven, self.least - (accumulated - self.at))

    def prove(self, here: Problem, value: float, accumulated: float, budget: Budget) -> float:
        """A better bound than that known, in the time that is left of a step."""
        known = self.known(here, accumulated)
        if value == math.inf or value - known <= self.gap * value or budget.is_over:
            return known
        proving = Proving(here, budget, Watch(gap=self.gap, cost=value, bound=known))
        proving.run()
        for function in proving.functions:
            if function.whole:
                self.whole = function
            if not function.priced:  # what a change between two steps costs is not counted
                self.finest, self.since = function, accumulated
        best = max(known, proving.bound(value).value)
        if not prices_switches(here.cost) and here.horizon.time is None:  # for steps on the way
            self.least, self.at = best, accumulated
        return best

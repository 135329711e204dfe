"""One step of the closed loop: shift the last plan, look for a better one, apply the beginning."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Goal, Horizon, Problem
from maneuver_automaton.receding_horizon.guarantees import broken, promises, too_cheap
from maneuver_automaton.receding_horizon.log import (
    Guarantee,
    Origin,
    Step,
    Violation,
    first_part,
)
from maneuver_automaton.receding_horizon.pace import at_best_pace, base_name, is_uniform
from maneuver_automaton.receding_horizon.reanchoring import (
    distance,
    missed,
    quickest,
    reanchored,
    rejoining,
    same_word,
)
from maneuver_automaton.receding_horizon.shifting import costliest_first, merged, rest_of
from maneuver_automaton.search.choose import load_search, search_goal
from maneuver_automaton.search.inside import outside, stays_inside
from maneuver_automaton.search.limits import closed_bound
from maneuver_automaton.search.ready import load_times_kernels
from maneuver_automaton.search.result import SearchStatus, Solution
from maneuver_automaton.search.words import TIE

SECOND_OPINION = 0.02  # [s] for short words beside insertion
MOST_HOLDING = 4  # steps that a plan within the goal's set may take
HOLDING = 1  # dearer plans, of which one may stay in the set
PACES = 5  # dearer plans, which may be cheaper at another pace
EXACT = 1e-9  # [m, rad] a pose this close to a goal is the goal; to a plan, on it


class RecedingHorizon:
    """Model predictive control with trims: plan to the goal, apply the beginning, plan again.

    Every step shifts the last plan, which always leads to the goal, looks for a cheaper one, and
    checks what the paper proves of the loop; what is broken stands in the log with the reason.

    Source: the paper, Algorithm 14, Theorem 17, Sec. 4.2 and 4.3.

    Parameters
    ----------
    problem : Problem
        Its start is the first state, its horizon fixed (then a rest must be in the library) or
        free.
    step : float
        delta [s]: the loop closes every so often.
    margin : float
        A new word must be cheaper than the rest of the last one by more than this. At 0 the
        cheapest plan is applied; of plans that cost the same, the one that costs most at first.
    time_limit : float
        [s] per step for the search; what is best by then is applied.
    last : Step, optional
        To go on from: the last step of a log.
    first : Plan, optional
        What the first step applies, instead of searching: a plan from there to the goal.
    retimed : bool
        Drive every plan at the pace that makes its effort uniform: the controls are then
        continuous, multiples of those of the library. Needs a fixed horizon, a cost with effort,
        and a vehicle whose body velocity scales with its control.
    hold : bool
        Within the goal's tolerance, correct what is left within a few steps, along plans that stay
        within it if there are such; otherwise rest.

    Raises
    ------
    ValueError
        If a number is out of range, or a fixed horizon has no rest to be prolonged by.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Cost, Horizon, Problem, Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"rest": (0, 0), "ahead": (1, 0), "spin": (0, 1)})
    >>> problem = Problem(
    ...     robot,
    ...     [-1, 0, 0],
    ...     [0, 0, 0],
    ...     cost=Cost(effort=1.0),
    ...     horizon=Horizon(time=2.0, max_trims=4),
    ... )
    >>> controller = RecedingHorizon(problem, step=0.5)
    >>> control, log = controller.step([-1, 0, 0])
    >>> control.tolist(), log.value, log.plan.word
    ([1.0, 0.0], 1.0, ('ahead', 'rest'))
    >>> control, log = controller.step([-0.5, 0, 0])
    >>> control.tolist(), log.value, log.replanned, log.violations
    ([1.0, 0.0], 0.5, False, ())
    """

    def __init__(
        self,
        problem: Problem,
        *,
        step: float,
        margin: float = 0.0,
        time_limit: float = 5.0,
        last: Step | None = None,
        first: Plan | None = None,
        hold: bool = False,
        retimed: bool = False,
    ) -> None:
        for name, value in (("step", step), ("time_limit", time_limit)):
            if not value > 0.0:
                raise ValueError(f"receding horizon: {name} must be positive, got {value} s")
        if not margin >= 0.0:
            raise ValueError(f"receding horizon: margin must be at least 0, got {margin}")
        self._pad = _pad(problem)
        horizon = problem.horizon.time
        if horizon is not None:
            if self._pad is None:
                raise ValueError(
                    "receding horizon: a fixed time needs a rest trim, which prolongs the last "
                    "plan; the library has none"
                )
            if step > horizon * (1.0 + EXACT):
                raise ValueError(
                    f"receding horizon: step is {step:g} s, need at most the horizon, {horizon:g} s"
                )
        if retimed and (horizon is None or not getattr(problem.cost, "effort", 0.0) > 0.0):
            raise ValueError(
                "receding horizon: retimed plans need a fixed horizon and a cost with effort"
            )
        self.problem = problem
        self.step_s = step
        self.margin = margin
        self.time_limit = time_limit
        self.hold = hold
        self.retimed = retimed
        self.last = last
        self.first = first
        self.promises = promises(problem, step=step)
        self.most_steps: int | None = None
        if last is not None and not retimed:  # the bound counts from the first step
            bound = self.promises.most_steps(last.value)
            self.most_steps = None if bound is None else bound + last.number
        load_search(problem)
        load_times_kernels()

    def step(
        self, measured_state: ArrayLike, *, elapsed: float | None = None
    ) -> tuple[Array | None, Step]:
        """Decide what to do from `measured_state`.

        Parameters
        ----------
        measured_state : (dof,) array_like
            Pose [m, m, rad(, m)].
        elapsed : float, optional
            [s] since the last step; if omitted, what was to be applied of its plan.

        Returns
        -------
        control : (n_u,) array or None
            What holds from now on; None if the goal is reached and the library has no rest.
        log : Step
            The whole plan, its value, how it came about, and the guarantees that were broken.

        Raises
        ------
        ValueError
            If the state is no pose, or the time negative.

        Notes
        -----
        Where no plan leads to the goal, in whatever time, the log says so: its value is infinite,
        and the vehicle rests.
        """
        dof = self.problem.automaton.model.group.dof
        pose = np.array(as_array("measured_state", measured_state, last=dof))
        if pose.shape != (dof,):
            raise ValueError(f"measured_state: got shape {pose.shape}, need ({dof},)")
        began = time.monotonic()
        last = self.last
        passed = 0.0 if last is None else (last.applied if elapsed is None else elapsed)
        if not 0.0 <= passed < math.inf:
            raise ValueError(f"elapsed must be at least 0, got {passed} s")
        if last is not None and passed != last.applied:
            last = self._cut(last, passed)
        at = self.problem.start_time if last is None else last.time + passed
        here = replace(self.problem, start=pose, start_time=at)
        chosen = _Decision(self, here, last, passed, began).chosen()
        now = self._logged(chosen, here, last, began)
        self.last = now
        control = now.control
        if control is None and self._pad is not None:
            control = self._pad.control
        return control, now

    @property
    def pad(self) -> Trim | None:
        """The cheapest rest of the library."""
        return self._pad

    def _cut(self, last: Step, passed: float) -> Step:
        """The last step as it was driven, for `passed` seconds; one cut short is not counted."""
        if passed < last.applied and self.most_steps is not None:
            self.most_steps += 1
        return replace(
            last, applied=passed, applied_cost=_cost_until(self.problem, last.plan, passed)
        )

    def _logged(self, chosen: _Chosen, here: Problem, last: Step | None, began: float) -> Step:
        plan, goal = chosen.plan, here.goals[chosen.goal_index]
        applied = min(self.step_s, plan.duration) if plan.trims else self.step_s
        now = Step(
            time=here.start_time,
            pose=here.start,
            plan=plan,
            goal_index=chosen.goal_index,
            value=chosen.value,
            applied=applied,
            applied_cost=_cost_until(here, plan, applied),
            accumulated_cost=0.0 if last is None else last.accumulated_cost + last.applied_cost,
            origin=chosen.origin,
            replanned=last is not None and not _is_rest_of(plan, chosen.rest),
            shifted_value=chosen.shifted_value,
            off_plan=chosen.off_plan,
            lower_bound=min(chosen.value, max(chosen.bound, closed_bound(here, goal))),
            exhaustive=chosen.exhaustive,
            solve_s=time.monotonic() - began,
            number=0 if last is None else last.number + 1,
            arrived=chosen.arrived,
        )
        if (last is None or now.off_plan) and not self.retimed:  # from here on, undisturbed
            bound = self.promises.most_steps(now.value)
            self.most_steps = None if bound is None else bound + now.number
        found = list(chosen.violations)
        if last is not None and math.isfinite(now.value):
            found += broken(
                self.promises,
                goal,
                last,
                now,
                most_steps=None if self.retimed else self.most_steps,
                uniform=self.retimed and is_uniform(now.plan, here.cost),
            )
        if not (now.arrived or self.retimed) and math.isfinite(now.value):
            found += too_cheap(self.promises, now)
        return replace(now, violations=tuple(found))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Chosen:
    """What a step came to."""

    plan: Plan
    goal_index: int
    value: float
    origin: Origin
    rest: Plan | None  # of the last plan
    shifted_value: float | None
    off_plan: float | None
    bound: float
    exhaustive: bool
    arrived: bool
    violations: tuple[Violation, ...]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Candidate:
    """A plan that may be applied."""

    plan: Plan
    cost: float
    goal_index: int
    origin: Origin
    at_first: float  # what it costs until the next step


class _Decision:
    """One step under way."""

    def __init__(
        self,
        loop: RecedingHorizon,
        here: Problem,
        last: Step | None,
        passed: float,
        began: float,
    ) -> None:
        self.loop = loop
        self.here = here
        self.last = last
        self.began = began
        self.violations: list[Violation] = []
        self.exhaustive = False
        self.bound = -math.inf
        self.off_plan: float | None = None
        self.rest: Plan | None = None
        self.planned: Plan | None = None  # the same from where the last plan had said
        if last is not None:
            goal = Goal(pose=last.plan.pose_at(last.time + passed))
            off = distance(here.start, goal)
            self.off_plan = 0.0 if off <= EXACT * (1.0 + float(np.abs(here.start).max())) else off
            pad = None if here.horizon.time is None else loop.pad
            self.rest = rest_of(last.plan, passed, start=here.start, pad=pad)
            self.planned = rest_of(last.plan, passed, pad=pad)

    def chosen(self) -> _Chosen:
        """The plan to apply."""
        arrived = self._arrived()
        if arrived is not None:
            return arrived
        inside = self._goal_within(self.here.start) if self.loop.hold else None
        if inside is not None:
            return self._holding(inside) or self._resting(inside)
        if self.last is None and self.loop.first is not None:
            return self._given(self.loop.first)
        kept = self._kept()
        searched = self._searched(None if kept is None else kept.plan)
        best = self._best(kept, searched) or self._late()
        if best is None:
            return self._helpless()
        return self._as_chosen(best, None if kept is None else kept.cost)

    def _given(self, first: Plan) -> _Chosen:
        """The plan that the first step was told to apply."""
        here = self.here
        plan = self._filled(replace(first, start=here.start, start_time=here.start_time))
        for index, goal in enumerate(here.goals):
            if missed(plan, goal) <= EXACT * (1.0 + float(np.abs(here.start).max())):
                return self._as_chosen(self._candidate(plan, index, Origin.FIRST), None)
        raise ValueError(
            f"receding horizon: first ends at {plan.end.round(9).tolist()}, need a plan that ends "
            "at the goal"
        )

    def _filled(self, plan: Plan) -> Plan:
        """A plan that takes no longer than it may, with rest for what is left of a fixed time."""
        horizon = self.here.horizon
        limit = horizon.time if horizon.time is not None else horizon.max_time
        if limit is not None and plan.duration > limit * (1.0 + EXACT):
            raise ValueError(
                f"receding horizon: first takes {plan.duration:g} s, need at most {limit:g} s"
            )
        return self._padded(plan)

    def _padded(self, plan: Plan) -> Plan:
        """The plan, then rest for what is left of a fixed time."""
        horizon, pad = self.here.horizon, self.loop.pad
        if horizon.time is None or pad is None:
            return plan
        left = max(0.0, horizon.time - plan.duration)
        word, times = merged((*plan.trims, pad), [*plan.durations.tolist(), left])
        return replace(plan, trims=word, durations=np.array(times))

    def _holding(self, index: int) -> _Chosen | None:
        """In a goal's set: a plan to its middle within a step or a few, so as to stay in it.

        The cheapest that stays in the set all along, otherwise one that is inside whenever the
        loop closes; None if there is neither.
        """
        here, goal = self.here, self.here.goals[index]
        middle = replace(goal, tolerance_m=0.0, tolerance_rad=0.0)
        second: _Candidate | None = None
        for steps in range(1, MOST_HOLDING + 1):
            limit = steps * self.loop.step_s
            pads = here.horizon.time is not None and self.loop.pad is not None
            soon = Horizon(time=limit) if pads else Horizon(max_time=limit)
            near = replace(
                here,
                goals=(middle,),
                horizon=soon,
                search=replace(here.search, method="insertion"),
            )
            found = [
                self._candidate(_as_plan(near, solution), index, Origin.SEARCHED)
                for result in search_goal(
                    near, middle, alternatives=HOLDING, time_limit=self.loop.time_limit
                )
                for solution in result.solutions
            ]
            for one in sorted(found, key=lambda candidate: candidate.cost):
                if self._stays_within(one.plan, index):
                    return self._held(one)
                if second is None and self._inside_at_steps(one.plan, index):
                    second = one
        return None if second is None else self._held(second)

    def _held(self, one: _Candidate) -> _Chosen:
        chosen = self._as_chosen(one, one.cost)
        return replace(chosen, arrived=True, violations=())

    def _inside_at_steps(self, plan: Plan, index: int) -> bool:
        goal, step = self.here.goals[index], self.loop.step_s
        times = plan.start_time + step * np.arange(1, math.ceil(plan.duration / step) + 1)
        return all(within(pose, goal) for pose in plan.pose_at(times))

    def _as_chosen(self, best: _Candidate, shifted_value: float | None) -> _Chosen:
        return _Chosen(
            plan=best.plan,
            goal_index=best.goal_index,
            value=best.cost,
            origin=best.origin,
            rest=self.rest,
            shifted_value=shifted_value,
            off_plan=self.off_plan,
            bound=best.cost if self.exhaustive else self.bound,
            exhaustive=self.exhaustive,
            arrived=False,
            violations=tuple(self.violations),
        )

    def _arrived(self) -> _Chosen | None:
        """At a goal there is nothing to do but to rest."""
        for index, goal in enumerate(self.here.goals):
            if distance(self.here.start, goal) <= EXACT:
                return self._resting(index)
        return None

    def _resting(self, index: int) -> _Chosen:
        here, pad = self.here, self.loop.pad
        total = here.horizon.time
        at = here.start_time
        if total is not None and pad is not None:
            plan = Plan(here.start, (pad,), durations=[total], start_time=at)
        elif pad is not None and distance(here.start, here.goals[index]) > EXACT:
            plan = Plan(here.start, (pad,), durations=[self.loop.step_s], start_time=at)
        else:
            plan = Plan(here.start, (), durations=[], start_time=at)
        value = here.cost_of(plan)
        shifted = None if self.rest is None else min(value, here.cost_of(self.rest))
        return _Chosen(
            plan=plan,
            goal_index=index,
            value=value,
            origin=Origin.FIRST if self.last is None else Origin.SHIFTED,
            rest=plan if self.rest is None else self.rest,
            shifted_value=shifted,
            off_plan=self.off_plan,
            bound=value,
            exhaustive=True,
            arrived=True,
            violations=(),
        )

    def _kept(self) -> _Candidate | None:
        """The rest of the last plan from here: as it is, or made to meet the goal again."""
        if self.rest is None or self.planned is None or self.last is None:
            return None
        here, index = self.here, self.last.goal_index
        goal = here.goals[index]
        pad = None if here.horizon.time is None else self.loop.pad
        plans: list[tuple[Plan, Origin]] = []
        if self.off_plan == 0.0 and missed(self.rest, goal) <= EXACT:
            plans.append((self.rest, Origin.SHIFTED))
            solved = same_word(here, self.rest, goal, pad=pad) if self.loop.margin else None
            if solved is not None:
                plans.append((solved, Origin.REANCHORED))
        else:
            around = reanchored(here, self.planned, goal, pad=pad)
            first = next(around, None)
            if first is not None:
                plans.append((first, Origin.REANCHORED))
                same = [trim.name for trim in first.trims] == [t.name for t in self.rest.trims]
                if not same or here.cost_of(first) > self.last.value:  # a detour: look further
                    plans += [(plan, Origin.REANCHORED) for plan in around]
        candidates = [
            self._candidate(plan, index, origin) for plan, origin in plans if self._allowed(plan)
        ]
        return min(candidates, key=lambda one: one.cost, default=None)

    def _searched(self, known: Plan | None) -> list[_Candidate]:
        """What a search from here finds."""
        here = self.here
        found: list[_Candidate] = []
        self.exhaustive = True
        bounded = any(getattr(here.bounds, name) is not None for name in ("x", "y", "z"))
        alternatives = None if bounded else PACES if self.loop.retimed else 0
        for index, goal in enumerate(here.goals):
            left = self.began + self.loop.time_limit - time.monotonic()
            to_known = known if self.last is None or index == self.last.goal_index else None
            if left <= 0.0 and (known is not None or found):
                self.exhaustive = False
                self._over_budget()
                break
            results = search_goal(
                here,
                goal,
                alternatives=alternatives,
                time_limit=max(left, 1e-6),
                known=None if self.loop.retimed else to_known,
                ties=True,
                second_opinion=SECOND_OPINION,
            )
            proven = any(one.exhaustive for one in results)
            self.exhaustive = self.exhaustive and proven and not (self.loop.retimed or bounded)
            if any(one.status is SearchStatus.OUT_OF_BUDGET for one in results):
                self._over_budget()
            for result in results:
                for solution in result.solutions:
                    plan = _as_plan(here, solution)
                    if self._allowed(plan):
                        found.append(self._candidate(plan, index, Origin.SEARCHED))
        return found

    def _over_budget(self) -> None:
        if any(one.guarantee is Guarantee.BUDGET for one in self.violations):
            return
        limit = self.loop.time_limit
        self.violations.append(
            Violation(
                guarantee=Guarantee.BUDGET,
                reason=f"the search was cut short after {limit:g} s; the best plan so far is kept",
            )
        )

    def _best(self, kept: _Candidate | None, found: Iterable[_Candidate]) -> _Candidate | None:
        """The cheapest; of equal ones, what costs most at first; of these, the known word."""
        everything = [*found] if kept is None else [kept, *found]
        if not everything:
            return None
        least = min(one.cost for one in everything)
        if kept is not None and least >= kept.cost - self.loop.margin and self.loop.margin > 0.0:
            return kept
        tied = [one for one in everything if one.cost <= least + TIE * (1.0 + abs(least))]
        return min(tied, key=_preference)

    def _candidate(self, plan: Plan, index: int, origin: Origin) -> _Candidate:
        here = self.here
        if self.loop.retimed:
            plan = at_best_pace(here, plan)
        cost = here.cost_of(plan)
        ordered = costliest_first(plan, here.rates_of(plan))
        if ordered is not plan:
            dearer = here.cost_of(ordered)
            if dearer <= cost + TIE * (1.0 + abs(cost)) and self._allowed(ordered):
                plan, cost = ordered, dearer
        piece = first_part(plan, self.loop.step_s)
        return _Candidate(
            plan=plan,
            cost=cost,
            goal_index=index,
            origin=origin,
            at_first=float(here.rates_of(piece) @ piece.durations),
        )

    def _allowed(self, plan: Plan) -> bool:
        bounds = self.here.bounds
        return bool(outside(self.here.start, bounds)) or stays_inside(plan, bounds)

    def _helpless(self) -> _Chosen:
        """Nothing leads to the goal: rest, and say so."""
        here, pad = self.here, self.loop.pad
        trims = () if pad is None else (pad,)
        lasting = [self.loop.step_s] * len(trims)
        rest = Plan(here.start, trims, durations=lasting, start_time=here.start_time)
        self.violations.append(
            Violation(
                guarantee=Guarantee.FEASIBILITY,
                reason=f"no plan leads from {here.start.tolist()} to the goal, in whatever time",
            )
        )
        nowhere = _Candidate(
            plan=rest, cost=math.inf, goal_index=0, origin=Origin.SEARCHED, at_first=0.0
        )
        return self._as_chosen(nowhere, None)

    def _late(self) -> _Candidate | None:
        """No plan arrives in time: the quickest there is, flagged; None if there is none."""
        here = self.here
        hurry = quickest(here)
        found: list[_Candidate] = []
        for index, goal in enumerate(here.goals):
            nothing = Plan(here.start, (), durations=[], start_time=here.start_time)
            plans = list(rejoining(hurry, self.planned or nothing, goal, pad=None))
            for result in search_goal(hurry, goal, alternatives=0, time_limit=self.loop.time_limit):
                plans += [_as_plan(here, solution) for solution in result.solutions]
            found += [
                self._candidate(self._padded(plan), index, Origin.SEARCHED)
                for plan in plans
                if self._allowed(plan)
            ]
        if not found:
            return None
        best = min(found, key=lambda one: one.plan.duration)
        limit = here.horizon.time or here.horizon.max_time
        self.exhaustive = False
        if limit is not None and best.plan.duration > limit:
            self.violations.append(
                Violation(
                    guarantee=Guarantee.HORIZON,
                    reason=f"the least time to the goal is {best.plan.duration:.6g} s, "
                    f"need at most {limit:g} s; the quickest plan is applied",
                )
            )
        return best

    def _goal_within(self, pose: Array) -> int | None:
        for index, goal in enumerate(self.here.goals):
            if within(pose, goal):
                return index
        return None

    def _stays_within(self, plan: Plan, index: int) -> bool:
        samples = plan.sample(max_step_m=0.01, max_step_rad=0.01)
        goal = self.here.goals[index]
        return all(within(pose, goal) for pose in samples.pose)


def within(pose: Array, goal: Goal) -> bool:
    """Whether a pose is a goal, to within its tolerances (1e-9 where they are 0)."""
    places = [0, 1, *range(3, pose.size)]
    way = float(np.linalg.norm(pose[places] - goal.pose[places]))
    turn = abs(math.remainder(float(pose[2] - goal.pose[2]), 2.0 * math.pi))
    heading = goal.free_heading or turn <= goal.tolerance_rad + EXACT
    return way <= goal.tolerance_m + EXACT and heading


def _as_plan(problem: Problem, solution: Solution) -> Plan:
    trims = problem.automaton.trims
    return Plan(
        problem.start,
        tuple(trims[k] for k in solution.word),
        durations=solution.durations,
        start_time=problem.start_time,
    )


def _preference(one: _Candidate) -> tuple[float, bool, int, tuple[str, ...]]:
    """Greatest cost on [0, delta) first, then the known word, then fewer trims, then by name."""
    known = one.origin is not Origin.SEARCHED
    return -float(f"{one.at_first:.9g}"), not known, len(one.plan.trims), one.plan.word


def _is_rest_of(plan: Plan, rest: Plan | None) -> bool:
    """Whether the word of `plan` is the rest of the last one, with or without a rest to pad it."""
    if rest is None:
        return False
    return _moving(plan) == _moving(rest)


def _moving(plan: Plan) -> list[str]:
    return [base_name(trim.name) for trim in plan.trims if trim.body_velocity.any()]


def _pad(problem: Problem) -> Trim | None:
    """The cheapest rest of the library."""
    still = np.flatnonzero(~problem.automaton.body_velocities.any(axis=1))
    if not still.size:
        return None
    return problem.automaton.trims[int(still[np.argmin(problem.rates[still])])]


def _twists(plan: Plan) -> Array:
    dof = plan.start.size
    return np.array([trim.body_velocity for trim in plan.trims]).reshape(-1, dof)


def _cost_until(problem: Problem, plan: Plan, until: float) -> float:
    """What the first `until` seconds of a plan cost, the switches in them included."""
    piece = first_part(plan, until)
    left = rest_of(plan, until, start=plan.start)
    switches = problem.cost.switching(_twists(plan)) - problem.cost.switching(_twists(left))
    return float(problem.rates_of(piece) @ piece.durations) + switches

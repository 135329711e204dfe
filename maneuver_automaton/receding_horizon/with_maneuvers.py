"""The closed loop of a vehicle with inertia: what has begun is finished, the rest may change.

Its state is a pose and a reduced state. The pose is measured; the reduced state is on the plan, and
while a maneuver is under way there is nothing to decide: its end is driven whatever is found. So a
step replans from where the maneuver under way will end, and the guarantees hold from step to step.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.cutting import (
    NOTHING,
    committed,
    head_of,
    joined,
    tail_of,
    with_samples_at,
)
from maneuver_automaton.collision import AnyObstacle, Shape, as_obstacles
from maneuver_automaton.costs import Cost
from maneuver_automaton.planning import plan as planned
from maneuver_automaton.planning.blocked import why_goal_blocked
from maneuver_automaton.planning.checking import what_is_hit
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.problem import Goal, Horizon, Problem
from maneuver_automaton.receding_horizon.candidates import within
from maneuver_automaton.receding_horizon.guarantees import broken, promises
from maneuver_automaton.receding_horizon.log import Deed, Guarantee, Origin, Step, Violation
from maneuver_automaton.receding_horizon.reanchoring import distance, missed
from maneuver_automaton.receding_horizon.settings import EXACT
from maneuver_automaton.refinement.fitting import fitted_plans
from maneuver_automaton.search.alternatives import TIE
from maneuver_automaton.search.inside import outside, stays_inside
from maneuver_automaton.search.maneuver_lattice import maneuver_words, plan_of
from maneuver_automaton.search.maneuver_problem import maneuver_problem_query, priced_transfers
from maneuver_automaton.search.maneuver_ready import load_maneuver_kernels
from maneuver_automaton.search.maneuver_search import search_words_with_maneuvers
from maneuver_automaton.search.maneuver_words import load_maneuver_words
from maneuver_automaton.search.result import plan_of as plan_of_word
from maneuver_automaton.words import TimesStatus, solve_switching_times

FIRST_SHARE = 0.5  # of a step's time limit, for the words of the first step
EASED = 0.5  # share of a goal's tolerance that may be given up before the end
DETOUR = 0.1  # share of its cost that a plan which ends within the goal's tolerance may rise by
STAND = 2.0  # [s] that the goal must stay free after arrival, where obstacles move
OTHERS = 3  # dearer words that are tried where the cheapest ones are not free


class ManeuverHorizon:
    """Model predictive control with trims and maneuvers.

    Every step shifts the last plan, which always leads to the goal, and looks for a cheaper one
    from the end of the maneuver under way on. Off the plan, the last word gets new times from where
    the vehicle was measured; its maneuvers stay.

    Where obstacles move, or others are seen than before, the last plan is checked against where
    they are predicted now, and another one is searched if it hits. Where none is found, the vehicle
    brakes as soon as it is free to, and waits.

    Source: the paper, Algorithm 14, for the automaton of Sec. 3.3.

    Parameters
    ----------
    problem : Problem
        From a trim to a trim, rest if none is named. A fixed time that ends at rest is prolonged by
        it; one that ends in motion is what is left of it at every step.
    step : float
        delta [s]: the loop closes every so often.
    margin : float
        A new word must be cheaper than the rest of the last one by more than this.
    time_limit : float
        [s] per step for the search.
    last : Step, optional
        To go on from: the last step of a log.
    first : Plan, optional
        What the first step applies, instead of searching: a plan from there to the goal.

    Raises
    ------
    ValueError
        If a number is out of range.
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
    ) -> None:
        for name, value in (("step", step), ("time_limit", time_limit)):
            if not value > 0.0:
                raise ValueError(f"receding horizon: {name} must be positive, got {value} s")
        if not margin >= 0.0:
            raise ValueError(f"receding horizon: margin must be at least 0, got {margin}")
        problem = with_trims_at_ends(problem)
        self.problem = problem
        self.delta = step
        self.margin = margin
        self.time_limit = time_limit
        self.first = first
        self.last = last
        self.reactive = problem.moves  # obstacles are not where they were at the last step
        # a fixed time that ends in motion cannot be prolonged: it ends then [s]
        total, ends_at_rest = (
            problem.horizon.time,
            all(problem.last_trim(goal).is_rest for goal in problem.goals),
        )
        self.arrival = None if total is None or ends_at_rest else problem.start_time + total
        # along a maneuver the vehicle may stand nearly still, so no trim's rate is promised
        self.promises = replace(promises(problem, step=step), least_rate=0.0)
        self.most_steps: int | None = None
        if last is not None:
            bound = self.promises.most_steps(last.value)
            self.most_steps = None if bound is None else bound + last.number
        load_maneuver_words()
        if problem.obstacles or problem.zones:
            load_maneuver_kernels()

    def step(
        self,
        measured_state: ArrayLike,
        *,
        elapsed: float | None = None,
        obstacles: Sequence[AnyObstacle | Shape] | None = None,
    ) -> tuple[Array | None, Step]:
        """Decide what to do from a measured pose (dof,); see `RecedingHorizon.step`.

        Raises
        ------
        ValueError
            If the state is no pose, or the time negative.
        """
        changed = obstacles is not None and as_obstacles(obstacles) != self.problem.obstacles
        if obstacles is not None:
            self.problem = replace(self.problem, obstacles=as_obstacles(obstacles))
        self.reactive = self.reactive or self.problem.moves or obstacles is not None
        dof = self.problem.automaton.model.group.dof
        pose = np.array(as_array("measured_state", measured_state, last=dof))
        if pose.shape != (dof,):
            raise ValueError(f"measured_state: got shape {pose.shape}, need ({dof},)")
        began = time.monotonic()
        last = self.last
        passed = 0.0 if last is None else (last.applied if elapsed is None else elapsed)
        if not 0.0 <= passed < math.inf:
            raise ValueError(f"elapsed must be at least 0, got {passed} s")
        if last is not None:
            last = self._cut(last, passed)
        at = self.problem.start_time if last is None else last.time + passed
        here = replace(self.problem, start=pose, start_time=at, horizon=self._horizon(at))
        decision = _Decision(self, here, last, passed, began)
        now = self._logged(decision, here, last, began, changed=changed)
        self.last = now
        return now.control, now

    def _horizon(self, at: float) -> Horizon:
        """The horizon of a step at a time [s] of the world's clock."""
        horizon = self.problem.horizon
        if self.arrival is None:
            return horizon
        return replace(horizon, time=max(self.arrival - at, NOTHING))

    def _cut(self, last: Step, passed: float) -> Step:
        """The last step as it was driven, for `passed` seconds; one cut short is not counted."""
        if passed < last.applied and self.most_steps is not None:
            self.most_steps += 1
        plan = with_samples_at(last.plan, [last.time + passed], self.problem.automaton.model)
        if passed == last.applied:
            return replace(last, plan=plan)
        spent = self.problem.cost_of(plan) - self.problem.cost_of(tail_of(plan, passed))
        return replace(last, plan=plan, applied=passed, applied_cost=spent)

    def _logged(
        self, decision: _Decision, here: Problem, last: Step | None, began: float, *, changed: bool
    ) -> Step:
        chosen = decision.chosen()
        instants = here.start_time + self.delta * np.arange(
            1, 2 + chosen.plan.duration / self.delta
        )
        plan = with_samples_at(chosen.plan, instants, here.automaton.model)
        value = here.cost_of(plan)
        applied = min(self.delta, plan.duration) if plan.duration > NOTHING else self.delta
        kept = chosen.origin is not Origin.SEARCHED
        leads = chosen.deed.leads
        now = Step(
            time=here.start_time,
            pose=here.start,
            plan=plan,
            goal_index=chosen.goal_index,
            value=value,
            applied=applied,
            applied_cost=value - here.cost_of(tail_of(plan, applied)),
            accumulated_cost=0.0 if last is None else last.accumulated_cost + last.applied_cost,
            origin=chosen.origin,
            replanned=last is not None and not kept,
            shifted_value=chosen.shifted_value,
            off_plan=decision.off_plan,
            lower_bound=0.0,
            exhaustive=False,
            solve_s=time.monotonic() - began,
            number=0 if last is None else last.number + 1,
            arrived=chosen.arrived,
            deed=chosen.deed,
        )
        if last is None or now.off_plan:  # from here on, undisturbed
            most = self.promises.most_steps(now.value) if leads and not self.reactive else None
            self.most_steps = None if most is None else most + now.number
        found = list(chosen.violations)
        if last is not None and leads and last.deed.leads:
            found += broken(
                self.promises,
                here.goals[chosen.goal_index],
                last,
                now,
                most_steps=self.most_steps,
                uniform=False,
                moved=here.moves or changed,
            )
        return replace(now, violations=tuple(found))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Chosen:
    """What a step came to."""

    plan: Plan
    goal_index: int
    origin: Origin
    deed: Deed
    shifted_value: float | None = None
    arrived: bool = False
    violations: tuple[Violation, ...] = ()


class _Decision:
    """One step under way."""

    def __init__(
        self, loop: ManeuverHorizon, here: Problem, last: Step | None, passed: float, began: float
    ) -> None:
        self.loop = loop
        self.here = here
        self.last = last
        self.deadline = began + loop.time_limit
        self.off_plan: float | None = None
        self.rest: Plan | None = None
        self.busy = 0.0  # [s] until the maneuver under way ends
        if last is not None:
            off = distance(here.start, Goal(pose=last.plan.pose_at(last.time + passed)))
            self.off_plan = 0.0 if off <= EXACT * (1.0 + float(np.abs(here.start).max())) else off
            self.rest = self._padded(tail_of(last.plan, passed, start=here.start))
            self.busy = committed(last.plan, passed)

    def chosen(self) -> _Chosen:
        """The plan to apply."""
        if self.last is None or self.rest is None:
            return self._first()
        index = self.last.goal_index
        if not moves_on(self.rest) and within(self.here.start, self.here.goals[index]):
            return _Chosen(
                plan=self.rest,
                goal_index=index,
                origin=Origin.SHIFTED,
                deed=Deed.KEPT,
                shifted_value=self.here.cost_of(self.rest),
                arrived=True,
            )
        kept = self._kept(index)
        bar = math.inf if kept is None else self.here.cost_of(kept[0])
        known = None if math.isinf(bar) else bar
        found = self._searched(bar - self.loop.margin - TIE * (1.0 + abs(known or 0.0)))
        if found is None and kept is None:
            found = self._on_lattice()
        if found is not None:
            plan, goal_index = found
            return _Chosen(
                plan=plan,
                goal_index=goal_index,
                origin=Origin.SEARCHED,
                deed=Deed.REPLANNED,
                shifted_value=known,
            )
        if kept is not None:
            return _Chosen(
                plan=kept[0],
                goal_index=index,
                origin=kept[1],
                deed=Deed.KEPT,
                shifted_value=known,
            )
        return self._helpless(self.rest, index)

    def _first(self) -> _Chosen:
        """The plan of the first step."""
        here, given = self.here, self.loop.first
        if given is not None:
            plan = replace(given, start=here.start, start_time=here.start_time)
            for index, goal in enumerate(here.goals):
                if missed(plan, goal) <= EXACT * (1.0 + float(np.abs(here.start).max())):
                    return self._as_first(plan, index)
            raise ValueError(
                f"receding horizon: first ends at {plan.end.round(9).tolist()}, need a plan that "
                "ends at the goal"
            )
        found = self._searched(math.inf) if not here.obstacles else None
        if found is None and self.loop.reactive:
            found = self._on_lattice()
        if found is None:
            left = max(self.deadline - time.monotonic(), 1e-3)
            result = planned(here, time_limit=left)
            late = result.plan is not None and self._is_late(result.plan)
            if result.plan is None or result.goal_index is None or late:
                why = "it takes too long" if late else result.reason
                return self._helpless(self._standing(here.first_trim), 0, reason=f": {why}")
            found = result.plan, result.goal_index
        return self._as_first(self._padded(found[0]), found[1])

    def _as_first(self, plan: Plan, index: int) -> _Chosen:
        return _Chosen(plan=plan, goal_index=index, origin=Origin.FIRST, deed=Deed.PLANNED)

    def _helpless(self, rest: Plan, index: int, reason: str = "") -> _Chosen:
        """Nothing leads to the goal: the last plan is driven to its end, or braked if that hits."""
        off = self.off_plan or 0.0
        flags = [
            Violation(
                guarantee=Guarantee.FEASIBILITY,
                reason=f"no word was found to the goal from {off:.3g} off the plan{reason}",
            )
        ]
        if self.loop.reactive:
            rest, hit = self._failsafe(rest)
            if hit:
                flags.append(Violation(guarantee=Guarantee.SAFETY, reason=hit))
        harmful = len(flags) > 1
        stands = Deed.APPROACHED if moves_on(rest) else Deed.STOPPED
        return _Chosen(
            plan=rest,
            goal_index=index,
            origin=Origin.SHIFTED,
            deed=Deed.HARMFUL if harmful else stands,
            violations=tuple(flags),
        )

    def _failsafe(self, rest: Plan) -> tuple[Plan, str]:
        """A motion that is not to the goal, and what it hits: the last plan, or braking soon."""
        goal = self.here.goals[0]
        hits: list[tuple[Plan, str]] = []
        for plan in (self._braking(rest), rest):
            if plan is None:
                continue
            hit = what_is_hit(self.here, self._stood(plan), goal)
            if not hit:
                return plan, ""
            hits.append((plan, hit))
        return hits[0]

    def _braking(self, rest: Plan) -> Plan | None:
        """What is under way, then the quickest maneuvers to rest; None if there are none."""
        automaton, done = self.here.automaton, head_of(rest, self.busy)
        begin = done.trims[-1]
        if begin.is_rest:
            still = self._standing(begin, at=done)
            return still if not self.busy else joined(done, still)
        if automaton.rest is None or begin.name not in automaton.trim_names:
            return None
        library = priced_transfers(automaton, Cost(time=1.0))
        source = automaton.index_of(begin.name)
        if not math.isfinite(library.transitions.cost[library.class_pair(source, automaton.rest)]):
            return None
        links = library.chain(source, automaton.rest)
        stop = Plan(
            done.end if self.busy else rest.start,
            (begin, *(automaton.trims[target] for _, target in links)),
            durations=[0.0] * len(links) + [self.loop.delta],
            maneuvers=tuple(automaton.maneuvers[k] if k >= 0 else None for k, _ in links),
            start_time=self.here.start_time + self.busy,
        )
        return joined(done, stop) if self.busy else stop

    def _standing(self, trim: Trim, *, at: Plan | None = None) -> Plan:
        """A step in a trim at rest, where a plan ends or where the vehicle is."""
        start = self.here.start if at is None else at.end
        lasting = self.loop.delta if self.loop.reactive else 0.0
        begin = self.here.start_time + (0.0 if at is None else self.busy)
        return Plan(start, (trim,), durations=[lasting], start_time=begin)

    def _stood(self, plan: Plan) -> Plan:
        """The plan with a while of rest at its end, where obstacles may come."""
        if not (self.loop.reactive and plan.trims and plan.trims[-1].is_rest):
            return plan
        durations = np.array(plan.durations)
        durations[-1] += STAND
        return replace(plan, durations=durations)

    def _on_lattice(self) -> tuple[Plan, int] | None:
        """A plan from the end of the maneuver under way that the lattice finds in what is left."""
        done = None if self.rest is None else head_of(self.rest, self.busy)
        begin = self.here.first_trim if done is None else done.trims[-1]
        if begin.name not in self.here.automaton.trim_names:
            return None
        problem = self._from_there(done, begin.name)
        if problem is None or not problem.automaton.maneuvers:
            return None
        goals = tuple(
            k for k, one in enumerate(problem.goals) if not why_goal_blocked(problem, one)
        )
        if not goals:
            return None
        query = maneuver_problem_query(problem, goals)
        best: tuple[Plan, int] | None = None
        cost = math.inf
        most = problem.search.max_expansions
        for heard in maneuver_words(query, deadline=self.deadline, max_expansions=most):
            if heard.word is None:
                continue
            owner = query.owner(heard.word)
            goal = problem.goals[owner]
            for plan in fitted_plans(problem, plan_of(query, heard.word), goal):
                whole = plan if done is None or not self.busy else joined(done, plan)
                if self.here.cost_of(whole) < cost and self._is_free(whole, goal):
                    best, cost = (whole, owner), self.here.cost_of(whole)
                    break
        return best

    def _kept(self, index: int) -> tuple[Plan, Origin] | None:
        """The rest of the last plan: as it is, or with times that meet the goal from here."""
        goal, rest = self.here.goals[index], self.rest
        if rest is None:
            return None
        if self.off_plan == 0.0 and missed(rest, goal) <= EXACT * _size(rest):
            if self.loop.reactive and not self._is_free(rest, goal):
                return None
            return rest, Origin.SHIFTED
        most = (1.0 + DETOUR) * self.here.cost_of(rest)
        found: list[Plan] = []
        for target in _targets(goal, rest.end):
            again = same_maneuvers(self.here, rest, target, under_way=self.busy > 0.0)
            if again is not None and self._is_free(again, goal):
                if self.here.cost_of(again) <= most:
                    return again, Origin.REANCHORED
                found.append(again)
        if within(rest.end, goal) and self._is_free(rest, goal):
            return rest, Origin.SHIFTED
        best = min(found, key=self.here.cost_of, default=None)
        return None if best is None else (best, Origin.REANCHORED)

    def _searched(self, bar: float) -> tuple[Plan, int] | None:
        """The cheapest plan from the end of the maneuver under way, if it costs less than `bar`."""
        here = self.here
        done = None if self.rest is None else head_of(self.rest, self.busy)
        begin = here.first_trim if done is None else done.trims[-1]
        if begin.name not in here.automaton.trim_names:
            return None  # a plan with trims of its own is driven to its end
        from_there = self._from_there(done, begin.name)
        if from_there is None:
            return None
        driven = here.cost_of(done) if done is not None and self.busy else 0.0
        best: tuple[Plan, int] | None = None
        guarded = bool(here.obstacles or here.zones) or _bounded(here)
        for index, goal in enumerate(here.goals):
            left = self.deadline - time.monotonic()
            if left <= 0.0:
                break
            share = FIRST_SHARE if self.last is None else 1.0
            found = search_words_with_maneuvers(
                from_there,
                goal,
                time_limit=share * left,
                alternatives=OTHERS if guarded else 0,
                ceiling=bar - driven,
            )
            for plan in (plan_of_word(from_there, word) for word in found.solutions):
                whole = plan if done is None or not self.busy else joined(done, plan)
                cost = here.cost_of(whole)
                if cost < bar and self._is_free(whole, goal):
                    best, bar = (whole, index), cost
        return best

    def _from_there(self, done: Plan | None, trim: str) -> Problem | None:
        """The problem from the end of what is driven in any case; None if no time is left."""
        here, horizon = self.here, self.here.horizon
        if done is None or not self.busy:
            return replace(here, start_trim=trim)
        total = None if horizon.time is None else horizon.time - self.busy
        longest = None if horizon.max_time is None else horizon.max_time - self.busy
        if any(left is not None and left <= NOTHING for left in (total, longest)):
            return None
        return replace(
            here,
            start=done.end,
            start_time=here.start_time + self.busy,
            start_trim=trim,
            horizon=replace(horizon, time=total, max_time=longest),
        )

    def _is_free(self, plan: Plan, goal: Goal) -> bool:
        """Whether a plan keeps clear of obstacles, and inside the bounds if it starts there."""
        if not (outside(plan.start, self.here.bounds) or stays_inside(plan, self.here.bounds)):
            return False
        return not what_is_hit(self.here, self._stood(plan), goal)

    def _is_late(self, plan: Plan) -> bool:
        """Whether a plan takes longer than it may."""
        limit = self.here.horizon.time or self.here.horizon.max_time
        return limit is not None and plan.duration > limit * (1.0 + EXACT)

    def _padded(self, plan: Plan) -> Plan:
        """The plan, then rest for what is left of a fixed time."""
        total = self.here.horizon.time
        if total is None or not plan.trims[-1].is_rest:
            return plan
        durations = np.array(plan.durations)
        durations[-1] += max(0.0, total - plan.duration)
        return replace(plan, durations=durations)


def with_trims_at_ends(problem: Problem) -> Problem:
    """The problem with a trim at its start and goals, where a kinematic vehicle has no rest.

    Which one it is makes no difference: it lasts no time, and is left at will.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1, 0), "left": (1, 1)})
    >>> with_trims_at_ends(Problem(robot, [0, 0, 0], [1, 0, 0])).start_trim
    'ahead'
    """
    automaton = problem.automaton
    if automaton.rest is not None or not automaton.is_kinematic:
        return problem
    name = automaton.trim_names[0]
    return replace(
        problem,
        start_trim=problem.start_trim or name,
        goals=tuple(replace(goal, trim=goal.trim or name) for goal in problem.goals),
    )


def same_maneuvers(here: Problem, plan: Plan, goal: Goal, *, under_way: bool) -> Plan | None:
    """The word of `plan` with the best times that lead from where it starts to the goal.

    Parameters
    ----------
    here : Problem
        Its horizon counts from the start of `plan`.
    plan : Plan
        Starts where the vehicle was measured, and misses the goal.
    goal : Goal
    under_way : bool
        Whether it begins within a maneuver: the trim before that is over.

    Returns
    -------
    Plan or None
        None if no times lead to the goal, or in time.
    """
    group = here.automaton.model.group
    still = np.zeros(plan.start.size)
    steps = [still if one is None else one.displacement for one in plan.maneuvers]
    steps = steps or [still] * (len(plan.trims) - 1)
    lasting = sum(one.duration for one in plan.maneuvers if one)
    longest = np.array([trim.max_duration for trim in plan.trims])
    if math.isfinite(longest[0]):
        longest[0] = plan.durations[0]  # how long it has lasted already is not known
    if under_way:
        longest[0] = 0.0
    horizon = here.horizon
    total = None if horizon.time is None else horizon.time - lasting
    if total is not None and total < 0.0:
        return None
    solved = solve_switching_times(
        np.array([trim.body_velocity for trim in plan.trims]),
        here.rates_of(plan),
        (group(plan.start).inverse() @ group(goal.pose)).pose,
        displacements=np.array(steps).reshape(-1, plan.start.size),  # none beside one trim
        total=total,
        free_heading=goal.free_heading,
        longest=longest,
        guesses=[plan.durations],
        restarts=2,
    )
    if solved.status is TimesStatus.FAILED:
        return None
    again = replace(plan, durations=solved.durations)
    limit = horizon.max_time
    if limit is not None and again.duration > limit * (1.0 + EXACT):
        return None
    return again if missed(again, goal) <= EXACT * _size(again) else None


def _targets(goal: Goal, end: Array) -> list[Goal]:
    """The goal itself, then what is within its tolerance and nearest to where a plan ends."""
    if not (goal.tolerance_m or goal.tolerance_rad):
        return [goal]
    places = [0, 1, *range(3, end.size)]
    off = end - goal.pose
    off[2] = 0.0 if goal.free_heading else math.remainder(float(off[2]), 2.0 * math.pi)
    way, turn = float(np.linalg.norm(off[places])), abs(float(off[2]))
    pose = np.array(goal.pose)
    pose[places] += off[places] * min(1.0, EASED * goal.tolerance_m / max(way, EXACT))
    pose[2] += off[2] * min(1.0, EASED * goal.tolerance_rad / max(turn, EXACT))
    return [goal, replace(goal, pose=pose)]


def moves_on(plan: Plan) -> bool:
    """Whether a plan is more than to stand still."""
    return any(
        isinstance(piece, Maneuver) or (duration > NOTHING and not piece.is_rest)
        for piece, duration in zip(plan.primitives, plan.primitive_durations, strict=True)
    )


def _size(plan: Plan) -> float:
    return 1.0 + float(np.abs(plan.start).max())


def _bounded(problem: Problem) -> bool:
    return any(getattr(problem.bounds, name) is not None for name in ("x", "y", "z"))

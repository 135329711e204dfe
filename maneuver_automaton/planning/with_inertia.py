"""Plans of vehicles with inertia: a plan that stops and steers at once, then better ones."""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from maneuver_automaton.automaton import Plan
from maneuver_automaton.costs import Cost
from maneuver_automaton.planning.among_obstacles import library_table
from maneuver_automaton.planning.blocked import why_goal_blocked
from maneuver_automaton.planning.bounds import lattice_bound
from maneuver_automaton.planning.checking import check_plan, load_checking, load_checks
from maneuver_automaton.planning.polishing import (
    Aimed,
    guess_along,
    guess_of_plan,
    guesses_along_paths,
    load_polishing,
    polish_plans,
    why_not_polished,
)
from maneuver_automaton.planning.result import Accepted, PlanResult, PlanStatus, found_plans
from maneuver_automaton.planning.tracking import Tracked, track
from maneuver_automaton.problem import Problem
from maneuver_automaton.refinement.improve import Patience
from maneuver_automaton.refinement.kinematic_paths import follows_paths, kinematic_problem
from maneuver_automaton.refinement.ready import load_lattice
from maneuver_automaton.refinement.stop_and_steer import stop_and_steer
from maneuver_automaton.search import SearchStatus
from maneuver_automaton.search.lattice_query import lattice_query
from maneuver_automaton.search.maneuver_lattice import maneuver_words, plan_of
from maneuver_automaton.search.maneuver_problem import maneuver_problem_query
from maneuver_automaton.search.maneuver_ready import load_maneuver_kernels
from maneuver_automaton.search.maneuver_search import search_words_with_maneuvers
from maneuver_automaton.search.maneuver_words import load_maneuver_words

LATE = 1e-12  # relative, by which a plan may exceed a limit of time
FIRST_SHARE = 0.8  # of the time limit, for a first path
IMPROVED_SHARE = 0.2  # of what is left, for a path that is faster to follow
MANEUVER_SHARE = 0.2  # of what is left, for words of maneuvers where there is a plan already
ONLY_MANEUVERS_SHARE = 0.4  # of what is left, where there is none; the rest is for polishing
AT_ONCE = Patience(attempts=0, passes=0)


def plan_with_inertia(
    problem: Problem, *, began: float, time_limit: float, alternatives: int
) -> PlanResult:
    """The cheapest plan found for a vehicle with inertia; every one that is kept was audited.

    The time limit [s] counts from `began`, as `time.monotonic` does.
    """
    heard = _Heard(problem, began, began + time_limit)
    for plan, goal_index in _candidates(heard):
        heard.hear(plan, goal_index)
        if time.monotonic() >= heard.deadline:
            break
    _polish(heard)
    heard.searched = heard.searched or time.monotonic()
    timing = {
        "search": heard.searched - began,
        "first_plan": heard.improvements[0][0] if heard.improvements else math.nan,
        "refine": max(time.monotonic() - heard.searched, 0.0),
        "audit": heard.checking,
    }
    if not heard.accepted:
        status, reason = heard.why_none(time_limit)
        timing.pop("first_plan")
        return PlanResult(
            problem=problem, status=status, reason=reason, timing_s=timing, counts=heard.counts
        )
    return found_plans(
        problem,
        heard.accepted[: alternatives + 1],
        bound=_lower_bound(problem),
        timing_s=timing,
        counts=heard.counts,
        improvements=tuple(heard.improvements),
    )


@dataclass(slots=True, eq=False)
class _Heard:
    """Plans that were found and passed every check, cheapest first."""

    problem: Problem
    began: float
    deadline: float
    searched: float = 0.0
    accepted: list[Accepted] = field(default_factory=list)
    improvements: list[tuple[float, float]] = field(default_factory=list)
    counts: dict[str, int] = field(
        default_factory=lambda: {"expansions": 0, "collision_queries": 0, "rejected": 0}
    )
    checking: float = 0.0
    refused: str = ""
    reason: str = ""
    enclosed: str = ""  # why no plan can exist
    paths: list[Aimed] = field(default_factory=list)  # guesses along kinematic plans

    @property
    def left(self) -> float:
        """Time that is left [s]."""
        return self.deadline - time.monotonic()

    def count(self, found: Tracked) -> Tracked:
        """Add up what a search for a path took."""
        self.counts["expansions"] += found.expansions
        self.counts["collision_queries"] += found.queries
        return found

    def hear(self, plan: Plan, goal_index: int) -> bool:
        """Keep a plan if it passes the checks, and say so."""
        begin = time.monotonic()
        plan, against = _fitted(self.problem, plan)
        if against:
            self.refused = self.refused or against
            return False
        checked = check_plan(self.problem, plan, self.problem.goals[goal_index])
        now = time.monotonic()
        self.checking += now - begin
        if checked.audit is None or not checked.passed:
            self.counts["rejected"] += 1
            self.refused = self.refused or checked.reason
            return False
        cost = self.problem.cost_of(plan)
        best = self.accepted[0].cost if self.accepted else math.inf
        self.accepted.append(
            Accepted(plan=plan, goal_index=goal_index, cost=cost, audit=checked.audit)
        )
        self.accepted.sort(key=lambda one: one.cost)
        if cost < best:
            self.improvements.append((now - self.began, cost))
        if not self.searched:
            self.searched = now
        return True

    def why_none(self, time_limit: float) -> tuple[PlanStatus, str]:
        if self.enclosed:
            return PlanStatus.UNREACHABLE, self.enclosed
        if self.refused:
            return PlanStatus.NO_PLAN, f"every plan found was refused: {self.refused}"
        return PlanStatus.OUT_OF_BUDGET, f"no plan within {time_limit:g} s{self.reason}"


def _fitted(problem: Problem, plan: Plan) -> tuple[Plan, str]:
    """The plan with a rest that fills a fixed time, and which limit of the horizon it breaks."""
    horizon = problem.horizon
    limit = horizon.max_time if horizon.time is None else horizon.time
    if limit is not None and plan.duration > limit * (1.0 + LATE):
        return plan, f"it takes {plan.duration:.6g} s, {limit:g} s are left"
    if horizon.time is not None and plan.duration < horizon.time:
        if not plan.trims[-1].is_rest:
            return (
                plan,
                f"it takes {plan.duration:.6g} s and ends in motion, {horizon.time:g} s are asked",
            )
        padded = plan.durations.copy()
        padded[-1] += horizon.time - plan.duration
        plan = replace(plan, durations=padded)
    if plan.duration == 0.0:
        return Plan(plan.start, (), durations=[], start_time=plan.start_time), ""
    lasting = [
        (trim, time) for trim, time in zip(plan.trims, plan.durations, strict=True) if time > 0.0
    ]
    if horizon.max_trims is not None and len(lasting) > horizon.max_trims:
        return plan, f"it has {len(lasting)} trims, {horizon.max_trims} are admitted"
    if any(time < horizon.min_coast for trim, time in lasting if not trim.is_rest):
        return plan, f"a trim lasts less than {horizon.min_coast:g} s"
    return plan, ""


def _candidates(heard: _Heard) -> Iterator[tuple[Plan, int]]:
    """Plans as they are found, and the goals they reach."""
    problem = heard.problem
    load_checks(problem)
    along = follows_paths(problem.automaton.model) and _rests(problem)
    if along:
        yield from _along_paths(heard)
    if problem.automaton.maneuvers:
        share = MANEUVER_SHARE if heard.accepted else ONLY_MANEUVERS_SHARE
        yield from _over_maneuvers(heard, 1.0 if why_not_polished(problem) else share)
        if not heard.accepted:
            yield from _over_maneuvers(heard, 1.0)
        if not problem.obstacles:
            yield from _by_words(heard)


def _polish(heard: _Heard) -> None:
    """Polish kinematic plans of different gears, and what has been found; keep what is cheaper."""
    problem = heard.problem
    if not heard.accepted or heard.left <= 0.0 or why_not_polished(problem):
        return
    if not heard.accepted[0].plan.duration > 0.0:
        return  # it is there already
    aimed = [Aimed(guess_of_plan(heard.accepted[0].plan), heard.accepted[0].goal_index)]
    if _rests(problem):
        along = list(guesses_along_paths(problem, time_limit=heard.left))
        aimed = along or [*heard.paths, *aimed]
    for goal_index in dict.fromkeys(one.goal_index for one in aimed):
        if heard.left <= 0.0:
            return
        try:
            found = polish_plans(
                problem,
                [one.guess for one in aimed if one.goal_index == goal_index],
                goal_index,
                time_limit=heard.left,
                accepts=functools.partial(heard.hear, goal_index=goal_index),
            )
        except RuntimeError:  # the solver gave up on a number; the plan in hand stays
            heard.counts["solver_errors"] = heard.counts.get("solver_errors", 0) + 1
            continue
        heard.counts["polished"] = heard.counts.get("polished", 0) + len(found.attempts)


def _over_maneuvers(heard: _Heard, share: float) -> Iterator[tuple[Plan, int]]:
    """Words of trims and maneuvers, the cheapest first, in a share of the time that is left."""
    problem = heard.problem
    goals = tuple(k for k, goal in enumerate(problem.goals) if not why_goal_blocked(problem, goal))
    query = maneuver_problem_query(problem, goals)
    most = problem.search.max_expansions
    until = time.monotonic() + share * heard.left
    before = heard.counts["expansions"]
    for found in maneuver_words(query, deadline=until, max_expansions=most):
        heard.counts["expansions"] = before + found.expansions
        if found.word is not None:
            yield plan_of(query, found.word), goals[found.word.goal]
        elif found.status is SearchStatus.EXHAUSTED and not heard.accepted:
            heard.reason = "; none over trims and maneuvers at any resolution tried"


def _by_words(heard: _Heard) -> Iterator[tuple[Plan, int]]:
    """Words of trims and maneuvers where nothing is in the way: short ones, then insertion."""
    problem = heard.problem
    for index, goal in enumerate(problem.goals):
        best = heard.accepted[0].cost if heard.accepted else math.inf
        left = MANEUVER_SHARE * heard.left
        found = search_words_with_maneuvers(problem, goal, time_limit=left, ceiling=best)
        for plan in found.plans:
            yield plan, index


def _along_paths(heard: _Heard) -> Iterator[tuple[Plan, int]]:
    """Stop and steer along a first path, then along one that is fast to follow so."""
    problem = heard.problem
    free = kinematic_problem(problem, switch=0.0)
    first = heard.count(track(free, time_limit=FIRST_SHARE * heard.left, patience=AT_ONCE))
    if first.plan is None or first.goal_index is None:
        heard.enclosed = first.reason if first.enclosed else ""
        heard.reason = f" ({first.reason})" if first.reason else ""
        return
    yield _stopping(problem, first.plan, first.goal_index), first.goal_index
    if first.plan.duration > 0.0:
        heard.paths.append(guess_along(problem, first.plan))
    left = IMPROVED_SHARE * heard.left
    better = heard.count(track(kinematic_problem(problem), time_limit=left, known=first.plan))
    if better.plan is not None and better.goal_index is not None:
        yield _stopping(problem, better.plan, better.goal_index), better.goal_index


def _stopping(problem: Problem, path: Plan, goal_index: int) -> Plan:
    return stop_and_steer(
        problem.automaton.model,  # type: ignore[arg-type]
        path,
        first=problem.first_trim,
        last=problem.last_trim(problem.goals[goal_index]),
    )


def load_inertia(problem: Problem) -> None:
    """Compile or load what `plan_with_inertia` needs, before the clock runs."""
    load_lattice()
    load_checking()
    if follows_paths(problem.automaton.model) and _rests(problem):
        library_table(kinematic_problem(problem, switch=0.0))
        if not why_not_polished(problem):
            load_polishing(problem)
    if problem.automaton.maneuvers:
        load_maneuver_kernels()
        if not problem.obstacles:
            load_maneuver_words()


def _rests(problem: Problem) -> bool:
    """Whether the vehicle starts and ends at rest."""
    return problem.first_trim.is_rest and all(
        problem.last_trim(goal).is_rest for goal in problem.goals
    )


def _lower_bound(problem: Problem) -> float:
    """No plan is cheaper: the shortest way, driven from rest to rest at the limits.

    A way that the kinematic vehicle needs B seconds for at full speed v takes ``B + v / a`` with
    the acceleration a, or ``2 sqrt(B v / a)`` where v is not reached.
    """
    model, cost = problem.automaton.model, problem.cost
    if not (follows_paths(model) and _rests(problem) and isinstance(cost, Cost)):
        return 0.0
    simpler = kinematic_problem(problem, switch=0.0)
    least = lattice_bound(lattice_query(simpler, tuple(range(len(problem.goals)))))
    fastest = float(np.abs(model.reduced_limits[0]).max())
    ramp = fastest / float(model.control_limits[0, 1])
    duration = least + ramp if least >= ramp else 2.0 * math.sqrt(least * ramp)
    return cost.time * duration + cost.length * least * fastest

"""Plans from words alone: every word, or insertion; obstacles only sort out what hits them."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

from maneuver_automaton.audit import Audit
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.same_motion import is_new
from maneuver_automaton.planning.checking import check_plan
from maneuver_automaton.planning.result import Accepted, PlanResult, PlanStatus, found_plans
from maneuver_automaton.problem import Horizon, Problem
from maneuver_automaton.search import SearchStatus
from maneuver_automaton.search.certificate import certificate
from maneuver_automaton.search.choose import search_goal
from maneuver_automaton.search.inside import outside
from maneuver_automaton.search.limits import closed_bound, why_impossible
from maneuver_automaton.search.result import plan_of
from maneuver_automaton.words.word import Word

SPARE = 2  # solutions for every alternative, as some may be one motion


def plan_by_words(
    problem: Problem, *, began: float, time_limit: float, alternatives: int
) -> PlanResult:
    """The cheapest word, by exhaustive search or insertion, that stays free and inside.

    The time limit [s] counts from `began`, as `time.monotonic` does.
    """
    found = _search_goals(problem, alternatives, began, began + time_limit)
    searched = time.monotonic()
    chosen = _audited(problem, found.candidates, alternatives)
    audited = time.monotonic()
    timing = {
        "search": searched - began,
        "first_plan": found.first_plan,
        "refine": 0.0,
        "audit": audited - searched,
    }
    counts = dict(found.counts) | {"rejected_by_audit": chosen.rejected}
    if problem.obstacles:
        counts["words_that_hit"] = chosen.hit
    if not chosen.plans:
        del timing["first_plan"]
        status, reason = _why_none(problem, found, chosen, time_limit)
        return PlanResult(
            problem=problem, status=status, reason=reason, timing_s=timing, counts=counts
        )
    best = chosen.plans[0]
    exact = not any(goal.tolerance_m or goal.tolerance_rad for goal in problem.goals)
    free = found.candidates[0].cost if found.proven and exact else None
    goal = problem.goals[best.goal_index]
    return found_plans(
        problem,
        [_accepted(candidate) for candidate in chosen.plans],
        bound=_lower_bound(problem, free),
        certificate=certificate(problem, goal, best.solution),
        timing_s=timing,
        counts=counts,
    )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Candidate:
    """A solution as a plan."""

    goal_index: int
    solution: Word
    plan: Plan
    audit: Audit | None = None

    @property
    def cost(self) -> float:
        return self.solution.cost


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Found:
    """What the searches for all goals came to."""

    candidates: list[_Candidate]
    counts: dict[str, int]
    first_plan: float
    exhausted: bool  # no search was cut short
    proven: bool  # every admitted word was searched


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Chosen:
    """What bounds and audit left."""

    plans: list[_Candidate]
    outside: int
    hit: int  # an obstacle
    broken: int  # conditions on the word and its times
    rejected: int
    complaint: str


def _search_goals(problem: Problem, alternatives: int, began: float, deadline: float) -> _Found:
    """Search for every goal that is inside the bounds; all candidates, cheapest first."""
    sorted_out = not problem.bounds.are_open or bool(problem.obstacles or problem.zones)
    counts: dict[str, int] = {}
    candidates: list[_Candidate] = []
    exhausted = proven = True
    first_plan = math.nan
    for index, goal in enumerate(problem.goals):
        if outside(goal.pose, problem.bounds):
            continue
        left = max(deadline - time.monotonic(), 1e-3)
        asked = None if sorted_out else SPARE * alternatives
        results = search_goal(problem, goal, alternatives=asked, time_limit=left)
        if math.isnan(first_plan) and any(result.solutions for result in results):
            first_plan = time.monotonic() - began
        proven = proven and any(result.exhaustive for result in results)
        for result in results:
            exhausted = exhausted and result.status is not SearchStatus.OUT_OF_BUDGET
            for name, value in result.counts.items():
                counts[name] = counts.get(name, 0) + value
            candidates += [
                _Candidate(goal_index=index, solution=solution, plan=plan_of(problem, solution))
                for solution in result.solutions
            ]
    order = sorted(candidates, key=_order)
    return _Found(
        candidates=order,
        counts=counts,
        first_plan=first_plan if math.isfinite(first_plan) else time.monotonic() - began,
        exhausted=exhausted,
        proven=proven,
    )


def _order(candidate: _Candidate) -> tuple[float, int, tuple[int, ...]]:
    word = candidate.solution.trims
    return float(f"{candidate.cost:.9g}"), len(word), tuple(word.tolist())


def _audited(problem: Problem, candidates: Sequence[_Candidate], alternatives: int) -> _Chosen:
    """The cheapest candidates that stay inside the bounds, are free, and pass the audit."""
    plans: list[_Candidate] = []
    outside = hit = broken = rejected = 0
    complaint = ""
    for candidate in candidates:
        if len(plans) > alternatives:
            break
        if not is_new(candidate.plan, (other.plan for other in plans)):
            continue
        checked = check_plan(problem, candidate.plan, problem.goals[candidate.goal_index])
        if checked.passed:
            plans.append(replace(candidate, audit=checked.audit))
        elif not checked.admitted:
            broken += 1
        elif not checked.inside:
            outside += 1
        elif not checked.free:
            hit += 1
        else:
            rejected += 1
            complaint = complaint or checked.reason
    return _Chosen(
        plans=plans,
        outside=outside,
        hit=hit,
        broken=broken,
        rejected=rejected,
        complaint=complaint,
    )


def _why_none(
    problem: Problem, found: _Found, chosen: _Chosen, time_limit: float
) -> tuple[PlanStatus, str]:
    if chosen.rejected:
        return PlanStatus.NO_PLAN, (
            f"the audit rejected {chosen.rejected} plans: {chosen.complaint}; "
            "do the trims belong to the model?"
        )
    if not found.exhausted:
        return PlanStatus.OUT_OF_BUDGET, (
            f"no plan within {time_limit:g} s and the expansions allowed"
        )
    if chosen.outside and not chosen.hit:
        return PlanStatus.NO_PLAN, (f"all {chosen.outside} plans found leave the bounds")
    if chosen.hit:
        return PlanStatus.NO_PLAN, (
            f"all {chosen.outside + chosen.hit} words found hit an obstacle or leave the bounds; "
            "the method lattice knows the obstacles"
        )
    impossible = why_impossible(problem)
    if impossible:
        return PlanStatus.UNREACHABLE, impossible
    if any(goal.tolerance_m or goal.tolerance_rad for goal in problem.goals):
        return PlanStatus.NO_PLAN, "no word was found to end within the tolerance of the goal"
    too_short = _least_time(problem)
    if too_short is not None:
        return too_short
    limit = problem.horizon.max_trims
    if found.proven and limit is not None:
        return PlanStatus.UNREACHABLE, (
            f"no word of at most {limit} trims of this library ends at the goal"
        )
    return PlanStatus.NO_PLAN, "no word of this library was found to end at the goal"


def _least_time(problem: Problem) -> tuple[PlanStatus, str] | None:
    """Verdict where the time is what stands in the way: the least time to any goal is named."""
    from maneuver_automaton.costs import Cost

    limit = problem.horizon.time or problem.horizon.max_time
    if limit is None:
        return None
    hurry = replace(
        problem, cost=Cost(time=1.0), horizon=Horizon(max_trims=problem.horizon.max_trims)
    )
    quickest: list[float] = []
    proven = True
    for goal in problem.goals:
        results = search_goal(hurry, goal, alternatives=0, time_limit=5.0)
        # Only a search over all admitted words is a proof: a certificate is but necessary.
        proven = proven and any(result.exhaustive for result in results)
        quickest += [one.duration for result in results for one in result.solutions]
    least = min(quickest, default=0.0)
    if least <= limit:
        return None
    return (PlanStatus.UNREACHABLE if proven else PlanStatus.NO_PLAN), (
        f"the goal cannot be reached in {limit:g} s: the least time found is {least:.6g} s"
    )


def _lower_bound(problem: Problem, free: float | None) -> float:
    """No admitted plan is cheaper: the optimum `free` of bounds if proven, or a closed bound."""
    if free is not None:
        return free
    return min(closed_bound(problem, goal) for goal in problem.goals)


def _accepted(candidate: _Candidate) -> Accepted:
    assert candidate.audit is not None
    return Accepted(
        plan=candidate.plan,
        goal_index=candidate.goal_index,
        cost=candidate.cost,
        audit=candidate.audit,
    )

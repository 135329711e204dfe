"""Plans among obstacles: first the lattice's, then better ones, then the checks."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field, replace

import numpy as np

from maneuver_automaton.audit import terminal_error
from maneuver_automaton.automaton import Plan
from maneuver_automaton.planning.blocked import why_goal_blocked
from maneuver_automaton.planning.bounds import lattice_bound
from maneuver_automaton.planning.checking import Checked, check_plan, load_checks
from maneuver_automaton.planning.result import Alternative, PlanResult, PlanStatus
from maneuver_automaton.problem import Problem, moves
from maneuver_automaton.refinement.improve import Improved, Patience, improve
from maneuver_automaton.refinement.ready import load_lattice
from maneuver_automaton.search.cost_to_go import NO_TABLE, CostTable, cost_to_go_table
from maneuver_automaton.search.lattice import FirstPlan, first_plan
from maneuver_automaton.search.lattice_pass import Word, with_cost
from maneuver_automaton.search.lattice_query import LatticeQuery, lattice_query
from maneuver_automaton.search.limits import why_impossible
from maneuver_automaton.search.waiting import with_waits
from maneuver_automaton.switching_times.closing import closed_at

BRIEF = Patience(attempts=1000, passes=3)  # of the way among what stands still
MOST_WAYS = 4  # that are tried with rests
QUICK = 1500  # expansions in space and time before a way with rests is tried
REJECTED = 8  # plans in a row that the checks may refuse before it is given up


@dataclass(slots=True, eq=False)
class _Progress:
    """What was found so far, the cheapest last."""

    query: LatticeQuery
    began: float
    words: list[Word] = field(default_factory=list)
    improvements: list[tuple[float, float]] = field(default_factory=list)

    def heard(self, word: Word) -> None:
        """A better word was found."""
        self.words.append(word)
        self.improvements.append((time.monotonic() - self.began, word.cost + self.query.padding))


def plan_on_lattice(problem: Problem, *, time_limit: float, alternatives: int) -> PlanResult:
    """The cheapest free plan found within the time."""
    impossible = why_impossible(problem)
    if impossible:
        return PlanResult(problem=problem, status=PlanStatus.UNREACHABLE, reason=impossible)
    load_lattice()
    table = library_table(problem)
    began = time.monotonic()
    deadline = began + time_limit
    goals = tuple(k for k, goal in enumerate(problem.goals) if not why_goal_blocked(problem, goal))
    query = lattice_query(problem, goals)
    progress = _Progress(query, began)
    first = _first(query, table, deadline, progress)
    found = time.monotonic()
    if not progress.words:
        timing = _timing(began, found, found, found, found - began)
        status, reason = _why_none(query, first, time_limit)
        return PlanResult(
            problem=problem,
            status=status,
            reason=reason,
            timing_s=timing,
            counts={"expansions": first.expansions, "collision_queries": first.queries},
            nodes=first.nodes,
        )
    if problem.moves:
        _let_pass(query, table, deadline, progress)
    word = progress.words[-1]
    bound = lattice_bound(query)
    better = improve(
        query,
        word,
        deadline=deadline,
        patience=Patience(),
        floor=bound,
        max_expansions=_left(problem, first),
        table=table,
        better=progress.heard,
        meanwhile=lambda: load_checks(problem),
    )
    refined = time.monotonic()
    chosen = _checked(progress, better, alternatives)
    first_s = progress.improvements[0][0]
    timing = _timing(began, found, refined, time.monotonic(), first_s)
    counts = {
        "expansions": first.expansions + better.expansions,
        "collision_queries": first.queries,
        "attempts": better.attempts,
        "searches": 1 + better.passes,
        "rejected_by_fcl": chosen.rejected_by_fcl,
        "rejected_by_audit": chosen.rejected_by_audit,
    }
    if not chosen.plans:
        return PlanResult(
            problem=problem,
            status=PlanStatus.NO_PLAN,
            reason=f"every plan found was refused: {chosen.reason}",
            timing_s=timing,
            counts=counts,
        )
    best = chosen.plans[0]
    audit = best.checked.audit
    assert audit is not None
    goal = problem.goals[best.goal_index]
    bound = min(best.cost, bound)
    return PlanResult(
        problem=problem,
        status=PlanStatus.FOUND,
        reason="",
        plan=best.plan,
        goal_index=best.goal_index,
        cost=best.cost,
        lower_bound=bound,
        gap=0.0 if best.cost <= bound else (best.cost - bound) / best.cost,
        terminal_error=terminal_error(best.plan, goal),
        clearance_m=audit.min_clearance_m,
        audit=audit,
        alternatives=tuple(
            Alternative(
                plan=other.plan,
                cost=other.cost,
                terminal_error=terminal_error(other.plan, problem.goals[other.goal_index]),
            )
            for other in chosen.plans[1:]
        ),
        timing_s=timing,
        counts=counts,
        improvements=tuple(progress.improvements),
        nodes=first.nodes,
    )


def _first(
    query: LatticeQuery, table: CostTable, deadline: float, progress: _Progress
) -> FirstPlan:
    """The first plan; where something moves, a way that lets it pass if a quick look finds none."""
    most = query.problem.search.max_expansions
    if query.problem.moves:
        quick = min(most or QUICK, QUICK)
        first = first_plan(query, deadline=deadline, max_expansions=quick, table=table)
        if first.word is not None:
            progress.heard(with_cost(first.word, query))
            return first
        calm = _among_what_stands(query)
        way = first_plan(calm, deadline=deadline, max_expansions=most, table=table)
        timed = None if way.word is None else with_waits(query, way.word)
        if timed is not None:
            progress.heard(timed)
            return first
    first = first_plan(query, deadline=deadline, max_expansions=most, table=table)
    if first.word is not None:
        progress.heard(with_cost(first.word, query))
    return first


def _let_pass(query: LatticeQuery, table: CostTable, deadline: float, progress: _Progress) -> None:
    """Hear of the cheapest way among what stands still, with rests that let pass what moves."""
    calm = _among_what_stands(query)
    begin = time.monotonic()
    soon = begin + 0.3 * (deadline - begin)
    most = query.problem.search.max_expansions
    found = first_plan(calm, deadline=soon, max_expansions=most, table=table)
    if found.word is None:
        return
    better = improve(calm, found.word, deadline=soon, patience=BRIEF, table=table)
    ways = sorted([found.word, better.word, *better.others], key=lambda one: one.cost)
    distinct = {tuple(way.trims.tolist()): way for way in reversed(ways)}
    for way in list(distinct.values())[::-1][:MOST_WAYS]:
        timed = with_waits(query, way)
        if timed is not None and timed.cost < progress.words[-1].cost:
            progress.heard(timed)


def _among_what_stands(query: LatticeQuery) -> LatticeQuery:
    """The query without what moves."""
    problem = query.problem
    still = tuple(obstacle for obstacle in problem.obstacles if not moves(obstacle))
    return lattice_query(replace(problem, obstacles=still), query.goal_index)


def prepare_lattice(problem: Problem) -> None:
    """Kernels, the table, and the map as the search, FCL and the audit see it."""
    load_lattice()
    library_table(problem)
    lattice_query(problem, tuple(range(len(problem.goals))))
    load_checks(problem)


def library_table(problem: Problem) -> CostTable:
    """The cost to go of the library, made once for all problems; none for several aims at once."""
    if len(problem.goals) > 1 or problem.goals[0].free_heading:
        return NO_TABLE
    return cost_to_go_table(problem)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Accepted:
    """A plan that passed every check."""

    plan: Plan
    goal_index: int
    cost: float
    checked: Checked


@dataclass(slots=True, eq=False)
class _Chosen:
    """What the checks left, cheapest first."""

    plans: list[_Accepted] = field(default_factory=list)
    rejected_by_fcl: int = 0
    rejected_by_audit: int = 0
    reason: str = ""


def _checked(progress: _Progress, better: Improved, alternatives: int) -> _Chosen:
    """The cheapest plans that pass; of equal words one."""
    query = progress.query
    chosen = _Chosen()
    seen: set[tuple[int, ...]] = set()
    words = sorted([*progress.words, *better.others], key=lambda word: word.cost)
    for word in words:
        key = (word.goal, *word.trims.tolist())
        if len(chosen.plans) > alternatives or key in seen:
            continue
        if chosen.rejected_by_fcl + chosen.rejected_by_audit >= REJECTED and not chosen.plans:
            break
        plan = plan_of_word(query, word)
        most = query.problem.horizon.max_trims
        if most is not None and len(plan.trims) > most:
            continue
        index = query.goal_index[word.goal]
        checked = check_plan(query.problem, plan, query.problem.goals[index])
        if checked.passed:
            seen.add(key)
            chosen.plans.append(
                _Accepted(
                    plan=plan,
                    goal_index=index,
                    cost=query.problem.cost_of(plan),
                    checked=checked,
                )
            )
        elif checked.audit is None:
            chosen.rejected_by_fcl += 1
            chosen.reason = chosen.reason or checked.reason
        else:
            chosen.rejected_by_audit += 1
            chosen.reason = chosen.reason or checked.reason
    chosen.plans.sort(key=lambda one: one.cost)
    return chosen


def plan_of_word(query: LatticeQuery, word: Word) -> Plan:
    """The word from the problem's own start, its times corrected until it ends at the goal."""
    problem = query.problem
    goal = problem.goals[query.goal_index[word.goal]]
    trims = [problem.automaton.trims[k] for k in query.library.trims[word.trims]]
    twists = np.array([trim.body_velocity for trim in trims]).reshape(-1, 3)
    durations = closed_at(
        problem.start, twists, word.durations, goal.pose, free_heading=goal.free_heading
    )
    total = float(durations.sum())
    fixed, rest = problem.horizon.time, query.library.rest
    if fixed is not None and rest is not None and total < fixed:
        trims.append(problem.automaton.trims[rest])
        durations = np.append(durations, fixed - total)
    return Plan(problem.start, tuple(trims), durations=durations, start_time=problem.start_time)


def _left(problem: Problem, first: FirstPlan) -> int | None:
    """Expansions that may still be spent."""
    most = problem.search.max_expansions
    return None if most is None else max(0, most - first.expansions)


def _timing(
    began: float, found: float, refined: float, checked: float, first: float
) -> dict[str, float]:
    return {
        "search": found - began,
        "first_plan": first,
        "refine": refined - found,
        "audit": checked - refined,
    }


def _why_none(query: LatticeQuery, first: FirstPlan, time_limit: float) -> tuple[PlanStatus, str]:
    if first.enclosed:
        return PlanStatus.UNREACHABLE, first.enclosed
    nearest = (
        "" if math.isinf(first.nearest) else f"; the nearest node is {first.nearest:.3g} m off"
    )
    if first.exhausted:
        return PlanStatus.NO_PLAN, (f"none at any resolution tried, which proves nothing{nearest}")
    return PlanStatus.OUT_OF_BUDGET, (
        f"no plan within {time_limit:g} s and {first.expansions} expansions{nearest}"
    )

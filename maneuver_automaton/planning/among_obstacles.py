"""Plans among obstacles: first the lattice's, then better ones, then the checks."""

from __future__ import annotations

import functools
import math
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.same_motion import UNFINISHED, is_new
from maneuver_automaton.planning.blocked import why_goal_blocked
from maneuver_automaton.planning.bounds import lattice_bound
from maneuver_automaton.planning.checking import check_plan, load_checks
from maneuver_automaton.planning.detours import with_stones
from maneuver_automaton.planning.result import Accepted, PlanResult, PlanStatus, found_plans
from maneuver_automaton.problem import Problem, moves
from maneuver_automaton.refinement.improve import Improved, Patience, improve
from maneuver_automaton.search.choose import search_goal
from maneuver_automaton.search.cost_to_go import CostTable, cost_to_go_table
from maneuver_automaton.search.lattice import FirstPlan, first_plan
from maneuver_automaton.search.lattice_pass import with_cost
from maneuver_automaton.search.lattice_query import LatticeQuery, lattice_query
from maneuver_automaton.search.limits import why_impossible
from maneuver_automaton.search.result import plan_of
from maneuver_automaton.search.waiting import with_waits
from maneuver_automaton.search.word_plan import plan_of_word
from maneuver_automaton.words.word import Word

AT_ONCE = Patience(attempts=0, passes=0)
SOME = Patience(attempts=400, passes=0)  # of a plan beside a stone
BRIEF = Patience(attempts=1000, passes=3)  # of the way among what stands still
MOST_WAYS = 4  # that are tried with rests
QUICK = 1500  # expansions in space and time before a way with rests is tried
FOR_THE_BEST = 0.6  # share of what is left that the best plan gets where alternatives are asked for
FREE_WORDS = 4  # words of free space that are looked at for every alternative
FREE_WORDS_SHARE = 0.3  # of the time that is left for alternatives
MOST_DETOURS = 8  # known ways beside which others are looked for
CHEAPER = 1e-7  # share of a cost that closing the end of a plan may change it by
REJECTED = 8  # plans in a row that the checks may refuse before it is given up


@dataclass(slots=True, eq=False)
class _Progress:
    """What was found so far, the cheapest last, and what it took."""

    query: LatticeQuery
    table: CostTable
    began: float  # as `time.monotonic` counts
    deadline: float
    words: list[Word] = field(default_factory=list)
    improvements: list[tuple[float, float]] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)

    def heard(self, word: Word) -> None:
        """A better word was found."""
        self.words.append(word)
        self.improvements.append((time.monotonic() - self.began, word.cost + self.query.padding))

    def first_plan(
        self, query: LatticeQuery, *, most: int | None, deadline: float | None = None
    ) -> FirstPlan:
        """A first plan for a query, its expansions counted."""
        limit = self.deadline if deadline is None else deadline
        found = first_plan(query, deadline=limit, max_expansions=most, table=self.table)
        self.counts["expansions"] += found.expansions
        self.counts["collision_queries"] += found.queries
        self.counts["searches"] += 1
        return found

    def improve(
        self, query: LatticeQuery, word: Word, *, deadline: float, patience: Patience, **more: Any
    ) -> Improved:
        """A better word for a query, its attempts and expansions counted."""
        found = improve(query, word, deadline=deadline, patience=patience, table=self.table, **more)
        self.counts["expansions"] += found.expansions
        self.counts["collision_queries"] += found.queries
        self.counts["searches"] += found.passes
        self.counts["attempts"] += found.attempts
        return found


def plan_on_lattice(
    problem: Problem, *, began: float, time_limit: float, alternatives: int
) -> PlanResult:
    """The cheapest free plan found within the time limit [s], counted from `began`."""
    goals = tuple(k for k, goal in enumerate(problem.goals) if not why_goal_blocked(problem, goal))
    query = lattice_query(problem, goals)
    progress = _Progress(query, library_table(problem), began, began + time_limit)
    first = _first(progress)
    found = time.monotonic()
    timing = {"search": found - began, "first_plan": found - began, "refine": 0.0, "audit": 0.0}
    if not progress.words:
        del timing["first_plan"]
        status, reason = _why_none(query, first, time_limit)
        return PlanResult(
            problem=problem,
            status=status,
            reason=reason,
            timing_s=timing,
            counts=dict(progress.counts),
            nodes=first.nodes,
        )
    if problem.moves:
        _let_pass(progress)
    bound = lattice_bound(query)
    share = FOR_THE_BEST if alternatives else 1.0
    left = _left(progress)
    better = progress.improve(
        query,
        progress.words[-1],
        deadline=found + share * (progress.deadline - found),
        patience=Patience(),
        floor=bound - query.padding,
        max_expansions=None if left is None else int(share * left),
        better=progress.heard,
        meanwhile=lambda: load_checks(problem),
    )
    candidates = [_candidate(query, word) for word in (*progress.words, *better.others)]
    if alternatives:
        candidates += [*_free_words(progress, alternatives)]
        candidates += _detours(progress, better.word, 2 * alternatives)
    refined = time.monotonic()
    chosen = _checked(progress, candidates, alternatives)
    if chosen.plans and chosen.plans[0].cost < progress.improvements[-1][1] * (1.0 - CHEAPER):
        progress.improvements.append((refined - began, chosen.plans[0].cost))
    timing["first_plan"] = progress.improvements[0][0]
    timing["refine"], timing["audit"] = refined - found, time.monotonic() - refined
    if not chosen.plans:
        return PlanResult(
            problem=problem,
            status=PlanStatus.NO_PLAN,
            reason=f"every plan found was refused: {chosen.reason}",
            timing_s=timing,
            counts=dict(progress.counts),
        )
    return found_plans(
        problem,
        chosen.plans,
        bound=bound,
        timing_s=timing,
        counts=dict(progress.counts),
        improvements=tuple(progress.improvements),
        nodes=first.nodes,
    )


def _first(progress: _Progress) -> FirstPlan:
    """The first plan; where something moves, a way that lets it pass if a quick look finds none."""
    query = progress.query
    most = query.problem.search.max_expansions
    if query.problem.moves:
        first = progress.first_plan(query, most=min(most or QUICK, QUICK))
        if first.word is not None:
            progress.heard(with_cost(first.word, query))
            return first
        way = progress.first_plan(_among_what_stands(query), most=most)
        timed = None if way.word is None else with_waits(query, way.word)
        if timed is not None:
            progress.heard(timed)
            return first
    first = progress.first_plan(query, most=most)
    if first.word is not None:
        progress.heard(with_cost(first.word, query))
    return first


def _let_pass(progress: _Progress) -> None:
    """Hear of the cheapest way among what stands still, with rests that let pass what moves."""
    query = progress.query
    calm = _among_what_stands(query)
    begin = time.monotonic()
    soon = begin + 0.3 * (progress.deadline - begin)
    most = query.problem.search.max_expansions
    found = progress.first_plan(calm, most=most, deadline=soon)
    if found.word is None:
        return
    better = progress.improve(calm, found.word, deadline=soon, patience=BRIEF)
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


def prepare_map(problem: Problem) -> None:
    """The map as the search, FCL and the audit see it."""
    lattice_query(problem, tuple(range(len(problem.goals))))
    load_checks(problem)


def library_table(problem: Problem) -> CostTable:
    """The cost to go of the library, made once for all problems."""
    return cost_to_go_table(problem)


@dataclass(slots=True, eq=False)
class _Chosen:
    """What the checks left, cheapest first."""

    plans: list[Accepted] = field(default_factory=list)
    rejected: int = 0
    reason: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class _Candidate:
    """A plan that has still to be checked; it is made when it is its turn."""

    cost: float
    goal_index: int
    plan: Callable[[], Plan]
    proven: bool = True  # the search took it to be free


def _candidate(query: LatticeQuery, word: Word) -> _Candidate:
    make = functools.partial(plan_of_word, query, word)
    return _Candidate(word.cost + query.padding, query.goal_index[word.goal], make)


def _free_words(progress: _Progress, alternatives: int) -> Iterator[_Candidate]:
    """Words that are locally optimal in free space: those that hit nothing are so here, too."""
    problem = progress.query.problem
    for index in progress.query.goal_index:
        left = FREE_WORDS_SHARE * (progress.deadline - time.monotonic())
        if left <= 0.0:
            return
        found = search_goal(
            problem, problem.goals[index], alternatives=FREE_WORDS * alternatives, time_limit=left
        )
        for solution in (one for result in found for one in result.solutions):
            make = functools.partial(plan_of, problem, solution)
            yield _Candidate(solution.cost, index, make, proven=False)


def _detours(progress: _Progress, best: Word, most: int) -> Iterator[_Candidate]:
    """Up to `most` plans on other ways round the obstacles: a stone closes each known way."""
    query = progress.query
    known = [plan_of_word(query, best)]
    for n_th in range(MOST_DETOURS):
        if n_th >= len(known) or len(known) > most:
            return
        for problem in with_stones(query, known[n_th]):
            left = _left(progress)
            if time.monotonic() >= progress.deadline or left == 0:
                return
            closed = lattice_query(problem, query.goal_index)
            first = progress.first_plan(closed, most=left)
            if first.word is None:
                continue
            word = with_cost(first.word, closed)
            for where in (closed, query):  # away from the stone, then without it
                left = _left(progress)
                word = progress.improve(
                    where,
                    word,
                    deadline=progress.deadline,
                    patience=SOME if where is closed else AT_ONCE,
                    max_expansions=left,
                ).word
            plan = plan_of_word(query, word)
            if is_new(plan, known, UNFINISHED):
                known.append(plan)
                yield _candidate(query, word)


def _checked(progress: _Progress, candidates: list[_Candidate], alternatives: int) -> _Chosen:
    """The cheapest plans that pass; of plans that are one motion, the cheapest."""
    problem = progress.query.problem
    progress.counts["rejected_by_fcl"] = progress.counts["rejected_by_audit"] = 0
    chosen = _Chosen()
    for candidate in sorted(candidates, key=lambda one: one.cost):
        if len(chosen.plans) > alternatives:
            break
        if chosen.rejected >= REJECTED and not chosen.plans:
            break
        plan, index = candidate.plan(), candidate.goal_index
        if not is_new(plan, (one.plan for one in chosen.plans), UNFINISHED):
            continue
        checked = check_plan(problem, plan, problem.goals[index])
        if checked.audit is not None and checked.passed:
            cost = problem.cost_of(plan)
            chosen.plans.append(
                Accepted(plan=plan, goal_index=index, cost=cost, audit=checked.audit)
            )
            continue
        if not (candidate.proven and checked.admitted):
            continue
        by = "fcl" if checked.audit is None else "audit"
        progress.counts[f"rejected_by_{by}"] += 1
        chosen.rejected += 1
        chosen.reason = chosen.reason or checked.reason
    chosen.plans.sort(key=lambda one: one.cost)
    return chosen


def _left(progress: _Progress) -> int | None:
    """Expansions that may still be spent."""
    most = progress.query.problem.search.max_expansions
    return None if most is None else max(0, most - progress.counts["expansions"])


def _why_none(query: LatticeQuery, first: FirstPlan, time_limit: float) -> tuple[PlanStatus, str]:
    if first.enclosed:
        return PlanStatus.UNREACHABLE, first.enclosed
    impossible = why_impossible(query.problem)
    if impossible:
        return PlanStatus.UNREACHABLE, impossible
    nearest = (
        "" if math.isinf(first.nearest) else f"; the nearest node is {first.nearest:.3g} m off"
    )
    if first.exhausted:
        return PlanStatus.NO_PLAN, (f"none at any resolution tried, which proves nothing{nearest}")
    return PlanStatus.OUT_OF_BUDGET, (
        f"no plan within {time_limit:g} s and {first.expansions} expansions{nearest}"
    )

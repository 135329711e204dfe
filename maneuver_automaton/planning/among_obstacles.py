"""Plans among obstacles: first the lattice's, then better ones, then the checks."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

from maneuver_automaton.automaton.same_motion import UNFINISHED, is_new
from maneuver_automaton.planning.blocked import open_goals
from maneuver_automaton.planning.bounds import lattice_bound
from maneuver_automaton.planning.checking import Condition, load_checks
from maneuver_automaton.planning.detours import with_stones
from maneuver_automaton.planning.incumbents import Candidate, Incumbents
from maneuver_automaton.planning.result import PlanResult, PlanStatus
from maneuver_automaton.planning.workspace import Workspace
from maneuver_automaton.problem import Problem, moves
from maneuver_automaton.refinement.improve import Improved, Patience, improve
from maneuver_automaton.search.budget import Budget
from maneuver_automaton.search.choose import search_goal
from maneuver_automaton.search.cost_to_go import CostTable, cost_to_go_table
from maneuver_automaton.search.lattice import FirstPlan, first_plan
from maneuver_automaton.search.lattice_pass import with_cost
from maneuver_automaton.search.lattice_query import LatticeQuery, lattice_query
from maneuver_automaton.search.limits import why_impossible
from maneuver_automaton.search.prepared import RECENT
from maneuver_automaton.search.result import plan_of
from maneuver_automaton.search.waiting import with_waits
from maneuver_automaton.search.word_plan import plan_of_word
from maneuver_automaton.words.word import Word

AT_ONCE = Patience(attempts=0, passes=0)
SOME = Patience(attempts=400, passes=0)  # of a plan beside a stone
BRIEF = Patience(attempts=1000, passes=3)  # of the path among static obstacles
MOST_WAYS = 4  # that are tried with rests
QUICK = 1500  # expansions in space and time before a way with rests is tried
PASSING_SHARE = 0.3  # of the time that is left, for paths that let moving obstacles pass
FOR_THE_BEST = 0.6  # share of what is left that the best plan gets where alternatives are asked for
FREE_WORDS = 4  # words of free space that are looked at for every alternative
FREE_WORDS_SHARE = 0.3  # of the time that is left for alternatives
MOST_DETOURS = 8  # known ways beside which others are looked for


@dataclass(slots=True, eq=False)
class _Progress:
    """The words found so far, the cheapest last, and the table that guides the search."""

    query: LatticeQuery
    table: CostTable
    found: Incumbents
    words: list[Word] = field(default_factory=list)

    @property
    def budget(self) -> Budget:
        """What is left."""
        return self.found.budget.less(self.found.counts["expansions"])

    def improved(self, word: Word) -> None:
        """A better word was found."""
        self.words.append(word)
        self.found.note(word.cost + self.query.padding)

    def first_plan(
        self, query: LatticeQuery, budget: Budget, *, most: int | None = None
    ) -> FirstPlan:
        """A first plan for a query, its expansions counted."""
        limits = [one for one in (most, budget.expansions) if one is not None]
        found = first_plan(
            query,
            deadline=budget.deadline,
            max_expansions=min(limits, default=None),
            table=self.table,
        )
        self.found.counts.update(
            expansions=found.expansions, collision_queries=found.queries, searches=1
        )
        return found

    def improve(
        self, query: LatticeQuery, word: Word, budget: Budget, *, patience: Patience, **more: Any
    ) -> Improved:
        """A better word for a query, its attempts and expansions counted."""
        found = improve(
            query,
            word,
            deadline=budget.deadline,
            max_expansions=budget.expansions,
            patience=patience,
            table=self.table,
            **more,
        )
        self.found.counts.update(
            expansions=found.expansions,
            collision_queries=found.queries,
            searches=found.passes,
            attempts=found.attempts,
        )
        return found


def plan_on_lattice(
    problem: Problem, budget: Budget, workspace: Workspace, /, *, alternatives: int
) -> PlanResult:
    """The cheapest free plan found."""
    goals = open_goals(problem)
    query = lattice_query(problem, goals, prepared=workspace.prepared)
    found = Incumbents(problem, budget, workspace.on(problem.obstacles), alternatives, UNFINISHED)
    progress = _Progress(query, library_table(problem, workspace), found)
    first = _first(progress)
    if not progress.words:
        return found.none(*_why_none(query, first, budget), nodes=first.nodes)
    searched = budget.elapsed
    if problem.moves:
        _let_pass(progress)
    bound = lattice_bound(query)
    found.offer_in_turn(_candidates(progress, bound))
    found.counts["rejected_by_fcl"] = found.rejected - found.refused[Condition.AUDIT]
    found.counts["rejected_by_audit"] = found.refused[Condition.AUDIT]
    if not found.plans:
        return found.none(PlanStatus.NO_PLAN, f"every plan found was refused: {found.why_refused}")
    return found.found(bound=bound, searched=searched, nodes=first.nodes)


def _first(progress: _Progress) -> FirstPlan:
    """The first plan; where something moves, a way that lets it pass if a quick look finds none."""
    query, budget = progress.query, progress.found.budget
    if query.problem.moves:
        first = progress.first_plan(query, budget, most=QUICK)
        if first.word is not None:
            progress.improved(with_cost(first.word, query))
            return first
        way = progress.first_plan(_among_what_stands(query), budget)
        timed = None if way.word is None else with_waits(query, way.word)
        if timed is not None:
            progress.improved(timed)
            return first
    first = progress.first_plan(query, budget)
    if first.word is not None:
        progress.improved(with_cost(first.word, query))
    return first


def _let_pass(progress: _Progress) -> None:
    """Take note of the cheapest path among static obstacles, with rests that let others pass."""
    query, calm = progress.query, _among_what_stands(progress.query)
    soon = progress.found.budget.part(PASSING_SHARE)
    found = progress.first_plan(calm, soon)
    if found.word is None:
        return
    better = progress.improve(calm, found.word, replace(soon, expansions=None), patience=BRIEF)
    ways = sorted([found.word, better.word, *better.others], key=lambda one: one.cost)
    distinct = {tuple(way.trims.tolist()): way for way in reversed(ways)}
    for way in list(distinct.values())[::-1][:MOST_WAYS]:
        timed = with_waits(query, way)
        if timed is not None and timed.cost < progress.words[-1].cost:
            progress.improved(timed)


def _among_what_stands(query: LatticeQuery) -> LatticeQuery:
    """The query without moving obstacles."""
    problem = query.problem
    still = tuple(obstacle for obstacle in problem.obstacles if not moves(obstacle))
    return lattice_query(
        replace(problem, obstacles=still), query.goal_index, prepared=query.prepared
    )


def _candidates(progress: _Progress, bound: float) -> list[Candidate]:
    """Plans to be checked, the cheapest first: what was found, and others if they are asked for."""
    query, alternatives = progress.query, progress.found.alternatives
    share = FOR_THE_BEST if alternatives else 1.0
    left = progress.budget
    most = None if left.expansions is None else int(share * left.expansions)
    better = progress.improve(
        query,
        progress.words[-1],
        replace(left.part(share), expansions=most),
        patience=Patience(),
        floor=bound - query.padding,
        better=progress.improved,
        meanwhile=lambda: load_checks(query.problem, progress.found.workspace),
    )
    candidates = [_candidate(query, word) for word in (*progress.words, *better.others)]
    if alternatives:
        candidates += _free_words(progress, alternatives)
        candidates += _detours(progress, better.word, 2 * alternatives)
    return sorted(candidates, key=lambda one: one.cost)


def prepare_map(problem: Problem, workspace: Workspace) -> None:
    """The map as the search, FCL and the audit see it."""
    lattice_query(problem, tuple(range(len(problem.goals))), prepared=workspace.prepared)
    load_checks(problem, workspace)


def library_table(problem: Problem, workspace: Workspace | None = None) -> CostTable:
    """The cost to go of the library, made once for all problems."""
    return cost_to_go_table(problem, prepared=workspace.prepared if workspace else RECENT)


def _candidate(query: LatticeQuery, word: Word) -> Candidate:
    make = functools.partial(plan_of_word, query, word)
    return Candidate(word.cost + query.padding, query.goal_index[word.goal], make)


def _free_words(progress: _Progress, alternatives: int) -> Iterator[Candidate]:
    """Words that are locally optimal in free space: those that hit nothing are so here, too."""
    problem = progress.query.problem
    for index in progress.query.goal_index:
        left = FREE_WORDS_SHARE * progress.budget.left
        if left <= 0.0:
            return
        found = search_goal(
            problem, problem.goals[index], alternatives=FREE_WORDS * alternatives, time_limit=left
        )
        for solution in (one for result in found for one in result.solutions):
            make = functools.partial(plan_of, problem, solution)
            yield Candidate(solution.cost, index, make, proven=False)


def _detours(progress: _Progress, best: Word, most: int) -> Iterator[Candidate]:
    """Up to `most` plans on other ways round the obstacles: a stone closes each known way."""
    query = progress.query
    known = [plan_of_word(query, best)]
    for n_th in range(MOST_DETOURS):
        if n_th >= len(known) or len(known) > most:
            return
        for problem in with_stones(query.problem, known[n_th]):
            if progress.budget.is_over or progress.budget.expansions == 0:
                return
            closed = lattice_query(problem, query.goal_index, prepared=query.prepared)
            first = progress.first_plan(closed, progress.budget)
            if first.word is None:
                continue
            word = with_cost(first.word, closed)
            for where in (closed, query):  # away from the stone, then without it
                patience = SOME if where is closed else AT_ONCE
                word = progress.improve(where, word, progress.budget, patience=patience).word
            plan = plan_of_word(query, word)
            if is_new(plan, known, UNFINISHED):
                known.append(plan)
                yield _candidate(query, word)


def _why_none(query: LatticeQuery, first: FirstPlan, budget: Budget) -> tuple[PlanStatus, str]:
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
        f"no plan within {budget.seconds:g} s and {first.expansions} expansions{nearest}"
    )

"""Words of the lattice among obstacles: a first one, then better ones, and others beside it.

Others lead round the other sides of obstacles: a stone is laid on each path that is known.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.same_motion import UNFINISHED, is_new
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision import Disc, Obstacle
from maneuver_automaton.planning.blocked import blocked_ends, goals_left
from maneuver_automaton.planning.bounds import lattice_bound
from maneuver_automaton.planning.checking import load_checks
from maneuver_automaton.planning.free_space import free_words, word_candidate, words_once
from maneuver_automaton.planning.incumbents import Candidate, Incumbents
from maneuver_automaton.planning.no_way import along_free_path, before_proof
from maneuver_automaton.planning.result import LowerBound
from maneuver_automaton.planning.steps import BY_TIME, Steps
from maneuver_automaton.problem import Problem, moves
from maneuver_automaton.refinement.clear_insertion import has_paces, paced, whole_of
from maneuver_automaton.refinement.improve import Improved, Patience, improve
from maneuver_automaton.refinement.incumbent_words import quick_word
from maneuver_automaton.refinement.relaxed_end import with_relaxed_end
from maneuver_automaton.refinement.restarts import restarts_of
from maneuver_automaton.search.arrays import CostTable
from maneuver_automaton.search.beginning import Begun
from maneuver_automaton.search.cost_to_go import NO_TABLE, cost_to_go_table
from maneuver_automaton.search.lattice import FirstPlan, first_plan
from maneuver_automaton.search.lattice_pass import plan_of_word
from maneuver_automaton.search.lattice_query import LatticeQuery, lattice_query
from maneuver_automaton.search.scene import Ends
from maneuver_automaton.search.waiting import with_waits
from maneuver_automaton.words.word import Word

AT_ONCE = Patience(attempts=0, passes=0)
SOME = Patience(attempts=400, passes=0)  # of a plan beside a stone
BRIEF = Patience(attempts=1000, passes=3)  # of the path among static obstacles
MOST_PATHS = 4  # among static obstacles that are tried with rests
QUICK = 1500  # expansions in space and time before a path with rests is tried
PASSING_SHARE = 0.3  # of the time that is left, for paths that let moving obstacles pass
BEFORE_POLISHING = 0.2  # share of what is left that the lattice gets, where there was a plan
ALONE_BEFORE_POLISHING = 0.4  # the same for better words where its own was the first
FOR_THE_BEST = 0.6  # the same where alternatives are asked for
TIMES_SHARE = 0.2  # of the time that is left, for the best times of one word
FREE_WORDS = 4  # words of free space that are looked at for every alternative
FREE_WORDS_SHARE = 0.3  # of the time that is left for alternatives
MOST_DETOURS = 8  # known paths beside which others are looked for
STONES = (  # where stones are laid and their radii, in shares of the path
    (0.5, 0.12),  # so wide that the other side of an obstacle is the shorter path
    (0.5, 0.02),  # so small that it closes a narrow passage alone
    (0.3, 0.08),
    (0.7, 0.08),
)


@dataclass(slots=True, eq=False)
class LatticeWords:
    """The words that the lattice has found so far, the cheapest last."""

    query: LatticeQuery
    table: CostTable
    found: Incumbents
    steps: Steps
    alone: bool  # no other step has found a plan
    limit: Budget
    words: list[Word] = field(default_factory=list)
    spent: int = 0  # expansions of first plans and improvements
    first: FirstPlan | None = None  # how the search for a first plan ended
    bound: LowerBound | None = None  # no word is cheaper; None where they are not all there is

    @property
    def budget(self) -> Budget:
        """The budget that remains."""
        return self.limit.less(self.spent)

    @property
    def for_others(self) -> Budget:
        """The budget that remains, less the time to check what is found."""
        left, better = self.budget, self.found.for_better
        return replace(left, deadline=min(left.deadline, better.deadline))

    @property
    def knows_all(self) -> bool:
        """Whether the lattice knows every condition and price, so that its words are plans.

        It does where trims in the plane are switched at will. What others find is checked, with
        its best times, as soon as it is found: a later word may be refused.
        """
        return self.query.library.at_will

    @property
    def candidates(self) -> list[Candidate]:
        """Words that are to be checked, the cheapest first."""
        return [_candidate(self.query, word) for word in self.words[::-1] if self.knows_all]

    def gained(self, word: Word) -> None:
        """A better word was found."""
        self.words.append(word)
        if self.knows_all:
            self.found.note(word.cost + self.query.padding)
            # The first is checked at once: whatever comes between, there is something to return.
            wanted = self.found.budget.shows is not None or not self.found.plans
            if wanted and self.found.may_check:
                goal_index = self.query.goal_index[word.goal]
                self.found.offer(plan_of_word(self.query, word), goal_index)
            return
        if not self.found.may_check:
            return
        self.found.offer(plan_of_word(self.query, word), self.query.goal_index[word.goal])
        # Polishing finds better times, and takes what time there is.
        if not (self.steps.polishes or self.found.budget.is_over or self.found.is_enough):
            self.offer_best_times()

    def offer_best_times(self) -> None:
        """Offer the cheapest word with the best of its coasting times."""
        word, problem = self.words[-1], self.query.problem
        index = self.query.goal_index[word.goal]
        plan, part = plan_of_word(self.query, word), self.found.for_better.stage(TIMES_SHARE)
        better = with_relaxed_end(problem, plan, problem.goals[index], budget=part)
        if better is not None and self.found.may_check:
            self.found.offer(better, index, proven=False)  # it ends its coasts elsewhere

    def first_plan(
        self,
        query: LatticeQuery,
        budget: Budget,
        *,
        most: int | None = None,
        **more: Any,
    ) -> FirstPlan:
        """A first plan for a query, its expansions counted."""
        limits = [one for one in (most, budget.expansions) if one is not None]
        counted = replace(budget, expansions=min(limits, default=None))
        found = first_plan(query, budget=counted, table=self.table, **more)
        self._count(found.expansions, found.queries, searches=1)
        return found

    def improve(
        self, query: LatticeQuery, word: Word, budget: Budget, *, patience: Patience, **more: Any
    ) -> Improved:
        """A better word for a query, its attempts and expansions counted."""
        found = improve(
            query,
            word,
            budget=budget,
            patience=patience,
            table=self.table,
            restarts=restarts_of(query.library),
            **more,
        )
        self._count(found.expansions, found.queries, searches=found.passes, attempts=found.attempts)
        return found

    def _count(self, expansions: int, queries: int, **more: int) -> None:
        self.spent += expansions
        self.found.counts.update(expansions=expansions, collision_queries=queries)
        if self.knows_all:
            self.found.counts.update(more)


def search_lattice(
    found: Incumbents, steps: Steps, begun: Begun | None = None, *, share: float = 1.0
) -> LatticeWords:
    """The words found for a problem: a first one, and better ones for as long as there is time.

    A share of the time that is left may go by; where there is no plan, the last is for a proof that
    there is none.
    """
    problem, prepared = found.problem, found.workspace.prepared
    goals = goals_left(problem) if begun is None else tuple(range(len(problem.goals)))
    ends = None
    if begun is not None:
        ends = Ends(begun.call.arrays.seen[:, :3].copy(), begun.call.arrays.clear.copy())
    query = lattice_query(problem, goals, prepared=prepared, ends=ends)
    known = query.library.at_will
    table = cost_to_go_table(problem, prepared=prepared) if known else NO_TABLE
    query = query if known else late_at_first(query)
    limit = found.for_first.stage(share)
    lattice = LatticeWords(query, table, found, steps, not found.plans, limit)
    lattice.first = _first(lattice, begun)
    # The path in the plane, where a way leads far round, takes longer than a first plan.
    lattice.bound = lattice_bound(query) if steps.at_will and problem.search.improve else None
    return lattice


def _first(lattice: LatticeWords, begun: Begun | None = None) -> FirstPlan | None:
    """The first plan; where obstacles move, one with rests if a quick search finds none."""
    query, limit = lattice.query, lattice.limit
    if query.problem.obstacles and not lattice.found.plans:
        last = before_proof(lattice.found.for_first)
        limit = replace(limit, deadline=min(limit.deadline, last.deadline))
    # where a search by cost alone would look everywhere, or for too long motions
    in_time = math.isfinite(query.most_time) or query.library.per_metre == 0.0
    if not lattice.knows_all and in_time and _quick(lattice):
        return None
    if query.problem.moves and lattice.knows_all:
        first = lattice.first_plan(query, limit, most=QUICK)
        if first.word is not None:
            lattice.gained(first.word)
            return first
        path = lattice.first_plan(_among_static(query), limit)
        timed = None if path.word is None else with_waits(query, path.word)
        if timed is not None:
            lattice.gained(timed)
            return first
    aside = along_free_path(query, lattice.table)
    first = lattice.first_plan(query, limit, begun=begun, aside=aside)
    if first.word is not None:
        lattice.gained(first.word)
    return first


def _quick(lattice: LatticeWords) -> bool:
    """Whether a search at the price of time alone found a word in time."""
    query, limit = lattice.query, lattice.limit
    in_time = replace(query.problem, cost=BY_TIME)
    quick = lattice_query(in_time, _goals(query), prepared=query.prepared)
    known, more = quick_word(query, late_at_first(quick), budget=limit)
    lattice.found.counts.update(expansions=more)
    if known is not None:
        lattice.gained(known)
    return known is not None


def late_at_first(query: LatticeQuery) -> LatticeQuery:
    """The query with no longest time where cheaper is quicker: shortcuts and polishing hasten."""
    edges, trims = query.library.arrays.edges, query.library.arrays.library
    rates = trims.rates[: trims.n_trims]  # the last row is the turn of a free heading
    close = functools.partial(np.allclose, rtol=1e-9, atol=1e-12)
    timed = close(rates, rates[0]) and close(edges.cost, rates[0] * edges.time)
    return replace(query, most_time=math.inf) if timed else query


def improved(lattice: LatticeWords) -> list[Candidate]:
    """Plans to be checked, the cheapest first: what was found, and others if they are asked for."""
    if not lattice.words:
        return []
    if has_paces(lattice.query):
        # take the trims of a large library that fill the time, once the first word is shortened
        query, left = lattice.query, lattice.for_others
        lattice.improve(query, lattice.words[-1], left, patience=AT_ONCE, better=lattice.gained)
        lattice.query, word = paced(query, lattice.words[-1])
        if word is not lattice.words[-1]:
            lattice.gained(word)
    query, found = lattice.query, lattice.found
    if query.problem.moves and lattice.knows_all:
        _let_pass(lattice)
    better = lattice.improve(
        query,
        lattice.words[-1],
        _for_the_best(lattice),
        patience=Patience(),
        floor=lattice.bound.value - query.padding if lattice.bound else -math.inf,
        better=lattice.gained,
        every_trim=whole_of(query),
        meanwhile=lambda: load_checks(query.problem, found.workspace),
    )
    if not lattice.knows_all:
        return []
    candidates = [_candidate(query, word) for word in (*lattice.words, *better.others)]
    if found.alternatives and not lattice.for_others.is_over:
        # words that are locally optimal in free space: collision-free ones are so here, too
        goals, most = _goals(query), FREE_WORDS * found.alternatives
        stages = free_words(found, goals, others=most, share=FREE_WORDS_SHARE)
        for word, index in words_once(stages):
            candidates.append(word_candidate(found.problem, word, index, proven=False))
        candidates += _detours(lattice, better.word, 2 * found.alternatives)
    return sorted(candidates, key=lambda one: one.cost)


def _for_the_best(lattice: LatticeWords) -> Budget:
    """Budget for the improvement of the best plan."""
    left = lattice.for_others
    if lattice.steps.polishes:
        return left.stage(ALONE_BEFORE_POLISHING if lattice.alone else BEFORE_POLISHING)
    share = FOR_THE_BEST if lattice.knows_all and lattice.found.alternatives else 1.0
    most = None if left.expansions is None else int(share * left.expansions)
    return replace(left.part(share), expansions=most)


def _let_pass(lattice: LatticeWords) -> None:
    """Take note of the cheapest path among static obstacles, with rests that let others pass."""
    query, calm = lattice.query, _among_static(lattice.query)
    soon = lattice.limit.part(PASSING_SHARE)
    found = lattice.first_plan(calm, soon)
    if found.word is None:
        return
    better = lattice.improve(calm, found.word, replace(soon, expansions=None), patience=BRIEF)
    paths = sorted([found.word, better.word, *better.others], key=lambda one: one.cost)
    distinct = {tuple(path.trims.tolist()): path for path in reversed(paths)}
    for path in list(distinct.values())[::-1][:MOST_PATHS]:
        if soon.is_over:
            return
        timed = with_waits(query, path)
        if timed is not None and timed.cost < lattice.words[-1].cost:
            lattice.gained(timed)


def _among_static(query: LatticeQuery) -> LatticeQuery:
    """The query without moving obstacles."""
    problem = query.problem
    static = tuple(obstacle for obstacle in problem.obstacles if not moves(obstacle))
    return lattice_query(replace(problem, obstacles=static), _goals(query), prepared=query.prepared)


def _goals(query: LatticeQuery) -> list[int]:
    """Which of the problem's goals a query leads to, each once, however many headings it has."""
    return list(dict.fromkeys(query.goal_index))


def _candidate(query: LatticeQuery, word: Word) -> Candidate:
    make = functools.partial(plan_of_word, query, word)
    return Candidate(word.cost + query.padding, query.goal_index[word.goal], make)


def _detours(lattice: LatticeWords, best: Word, most: int) -> Iterator[Candidate]:
    """Up to `most` plans round other sides of the obstacles: a stone closes each known path."""
    query = lattice.query
    known: list[Plan] = [plan_of_word(query, best)]
    for n_th in range(MOST_DETOURS):
        if n_th >= len(known) or len(known) > most or lattice.for_others.is_over:
            return
        for problem in with_stones(query.problem, known[n_th]):
            if lattice.for_others.is_over or lattice.for_others.expansions == 0:
                return
            closed = lattice_query(problem, _goals(query), prepared=query.prepared)
            first = lattice.first_plan(closed, lattice.for_others)
            if first.word is None:
                continue
            word = first.word
            for where in (closed, query):  # away from the stone, then without it
                patience = SOME if where is closed else AT_ONCE
                word = lattice.improve(where, word, lattice.for_others, patience=patience).word
            plan = plan_of_word(query, word)
            if is_new(plan, known, UNFINISHED):
                known.append(plan)
                yield _candidate(query, word)


def with_stones(problem: Problem, known: Plan) -> Iterator[Problem]:
    """Problems with one more obstacle each, which closes the path of a known plan.

    Problems whose start or goal the stone touches are left out.
    """
    times = np.linspace(0.0, known.duration, 101)
    poses = known.pose_at(times)
    driven = np.append(0.0, np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T)))
    if not driven[-1] > 0.0:
        return
    for share, radius in STONES:
        place = poses[int(np.searchsorted(driven, share * driven[-1]))]
        disc = Obstacle(Disc(radius * float(driven[-1]), place[:2].tolist()), name="stone")
        closed = replace(problem, obstacles=(*problem.obstacles, disc))
        if blocked_ends(closed) is None:
            yield closed

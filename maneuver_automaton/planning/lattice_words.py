"""Words of the lattice among obstacles: a first one, then better ones, and others beside it.

Others lead round the other sides of obstacles: a disc blocks each path that is known.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from maneuver_automaton._kept import kept_by_first
from maneuver_automaton._kernel_list import load_kernels
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.automaton.same_motion import UNFINISHED, is_new
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision import Disc, Obstacle
from maneuver_automaton.costs import prices_switches, terms_of, without_switches
from maneuver_automaton.planning.blocked import blocked_ends, goals_left
from maneuver_automaton.planning.bounds import lattice_bound
from maneuver_automaton.planning.cheap_ground import with_cheapest_way_left
from maneuver_automaton.planning.checking import Condition, load_checks
from maneuver_automaton.planning.free_space import free_words, word_candidate, words_once
from maneuver_automaton.planning.incumbents import Candidate, Incumbents, PlanningStep
from maneuver_automaton.planning.no_way import along_free_path, before_proof, proven_apart
from maneuver_automaton.planning.polishing import BY_TIME, Polish
from maneuver_automaton.planning.result import Workspace
from maneuver_automaton.planning.tracking import AT_ONCE
from maneuver_automaton.problem import Problem, moves
from maneuver_automaton.refinement.clear_insertion import has_paces, paced
from maneuver_automaton.refinement.improve import (
    NO_WORD,
    Patience,
    WordSchedule,
    WordSearch,
    words_of,
)
from maneuver_automaton.refinement.relaxed_end import with_relaxed_end
from maneuver_automaton.search.arrays import CostTable
from maneuver_automaton.search.cost_to_go import NO_TABLE, cost_to_go_table
from maneuver_automaton.search.lattice import FirstPlan, first_plan
from maneuver_automaton.search.lattice_library import lattice_library
from maneuver_automaton.search.lattice_pass import plan_of_word, with_cost
from maneuver_automaton.search.lattice_query import LEAST_MARGIN, LatticeQuery, lattice_query
from maneuver_automaton.search.lattice_trims import stands_for_more
from maneuver_automaton.search.waiting import with_waits
from maneuver_automaton.words.word import Word, with_price

SOME = Patience(attempts=400, passes=0)  # of a plan beside such a disc
BRIEF = Patience(attempts=1000, passes=3)  # of the path among static obstacles
FIRST_POLISHED = 0.7  # of what is left, for polishing where there is no plan yet
MOST_PATHS = 4  # among static obstacles that are tried with rests
QUICK = 1500  # expansions in space and time before a path with rests is tried
PASSING_SHARE = 0.3  # of the time that is left, for paths that let moving obstacles pass
BEFORE_POLISHING = 0.2  # share of what is left that the lattice gets, where there was a plan
ALONE_BEFORE_POLISHING = 0.4  # the same for better words where its own was the first
FOR_THE_BEST = 0.6  # the same where alternatives are asked for
TIMES_SHARE = 0.2  # of the time that is left, for the best times of one word
ROUND_SHARE, COUNTED_ROUND = 0.2, 0.7  # of the time left, of expansions: each way round
STEERED_SHARE = 0.3  # of time and expansions left: for a way that heeds the price at once
PAID = 0.02  # share of a cost that its places have to cost for that
FREE_WORDS = 4  # words of free space that are looked at for every alternative
FREE_WORDS_SHARE = 0.3  # of the time that is left for alternatives
MOST_DETOURS = 8  # known paths beside which others are looked for
BLOCKING = (  # where discs block a way and their radii, in shares of the path
    (0.5, 0.12),  # so wide that the other side of an obstacle is the shorter path
    (0.5, 0.02),  # so small that it closes a narrow passage alone
    (0.3, 0.08),
    (0.7, 0.08),
)


@dataclass(slots=True, eq=False)
class LatticeWords(PlanningStep):
    """The words that the lattice finds: a first one, then better ones, and others beside it."""

    polish: Polish | None = None  # of what it finds; it then gets a share of the time alone
    words: list[Word] = field(default_factory=list)  # found so far, the cheapest last
    passed: Word | None = None  # the last that was offered, and passed the checks
    spent: int = 0  # expansions of first plans and improvements
    found: Incumbents = field(init=False)
    query: LatticeQuery = field(init=False)
    table: CostTable = field(init=False)
    limit: Budget = field(init=False)
    alone: bool = field(init=False)  # no other step has found a plan

    def prepare(self, problem: Problem, workspace: Workspace) -> None:
        """Load the kernels, price the maneuvers, make the library and its table."""
        load_kernels("lattice", "improvement")
        if problem.has_inertia:
            goals, horizon = range(len(problem.goals)), problem.horizon
            library = lattice_library(problem, goals, prepared=workspace.prepared)
            if horizon.time or horizon.max_time or library.per_metre == 0.0:
                lattice_library(replace(problem, cost=BY_TIME), goals, prepared=workspace.prepared)
            if (freely := _steered_freely(problem)) is not None:
                lattice_library(freely, goals, prepared=workspace.prepared)
        elif problem.start.size == 3:
            cost_to_go_table(problem, prepared=workspace.prepared)
            if stands_for_more(problem):
                load_kernels("insertion")

    def offer(self, found: Incumbents) -> None:
        """Offer words as they are found, then what improving them finds.

        Where no plan fits but one nearly does, which polishing may mend, it does not wait for all
        that the lattice tries: each has its share, and the lattice what is left.
        """
        if not found.wants_more:
            return
        ended, known = found.ended, bool(found.plans)
        soon = self.polish is not None and (known or found.misfits)
        self.search(found, share=BEFORE_POLISHING if soon else 1.0)
        if not known:  # only the first search had a share
            self.limit = found.for_first
        if self.polish and found.misfits and not found.plans:
            tried = self.polish.polish(found, share=FIRST_POLISHED)
            first = ended.lattice
            done = first is None or first.exhausted or found.budget.expansions is not None
            if not (self.words or found.plans or done):
                self.search(found)
            self.alone = not found.plans
            self.polish.tried = found.cost if tried else math.inf
        if self.finds_plans:
            ended.searched = found.budget.elapsed
        if not found.problem.search.improve:
            found.offer_in_turn(self.candidates)
        if not found.is_enough:
            found.offer_in_turn(self.improved())
        if self.finds_plans and self.words and not found.plans:
            # a goal next to the start counts as met in the lattice: other words lead round to it
            found.offer_in_turn(self._free_words(FREE_WORDS))
        if self.polish and self.words:
            self.polish.otherwise = self.offer_best_times
        if self.finds_plans and self.words:  # which words the checks did not confirm
            by_audit = found.refused(Condition.AUDIT)
            found.counts["rejected_by_fcl"] = found.rejected - by_audit
            found.counts["rejected_by_audit"] = by_audit

    def search(self, found: Incumbents, *, share: float = 1.0) -> None:
        """Search for a first word within a share of the time that is left.

        Where there is no plan, the last of it is for a proof that there is none.
        """
        problem, ended, prepared = found.problem, found.ended, found.workspace.prepared
        begun = ended.begun
        goals = range(len(problem.goals)) if begun else goals_left(problem)
        query = None if begun is None else begun.query_of(problem)
        query = self.query = query or lattice_query(problem, goals, prepared=prepared)
        known = self.finds_plans
        self.table = cost_to_go_table(problem, prepared=prepared) if known else NO_TABLE
        query = self.query = query if known else late_at_first(query)
        self.found, self.words, self.spent = found, [], 0
        limit = self.limit = found.for_first.stage(share)
        self.alone, ended.finds_plans = not found.plans, known
        if problem.obstacles and not found.plans:
            limit = min(limit, before_proof(found.for_first), key=lambda one: one.deadline)
        word, first = None, None
        if not known and (math.isfinite(query.most_time) or query.library.per_metre == 0.0):
            # where a search by cost alone would look everywhere, or for too long motions
            by_time = replace(problem, cost=BY_TIME)
            quick = late_at_first(lattice_query(by_time, _goals(query), prepared=prepared))
            search = words_of(quick, budget=limit, schedule=WordSchedule())
            in_time = (one for one in search if one.duration <= query.most_time)
            if (soon := next(in_time, None)) is not None:
                word = with_cost(soon, query)
            found.counts.update(expansions=search.expansions)
        elif problem.moves and known:  # one with rests, if a quick search finds none
            most = QUICK if limit.expansions is None else min(QUICK, limit.expansions)
            first = first_plan(query, budget=limit._replace(expansions=most), table=self.table)
            self._count(first, searches=1)
            word = first.word
            if word is None:
                static = _among_static(query)
                aside = along_free_path(static, self.table)
                path = first_plan(static, budget=limit, table=self.table, aside=aside)
                self._count(path, searches=1)
                if path.word is not None:
                    close = replace(query, around=query.scene(LEAST_MARGIN))  # through narrow bends
                    word = with_waits(query, path.word) or with_waits(close, path.word)
        if word is None:
            freely = _steered_freely(problem)  # finds at once what a price hides for long
            easy = lattice_query(freely, goals, prepared=prepared) if freely else query
            aside = along_free_path(easy, self.table)
            proven = functools.partial(proven_apart, problem)
            first = first_plan(
                easy, budget=limit, table=self.table, begun=begun, aside=aside, is_proven=proven
            )
            self._count(first, searches=1)
            word = first.word if easy is query else first.word and with_cost(first.word, query)
        if word is not None:
            self.gained(word)
        ended.lattice, ended.nodes = first, first.nodes if first else None
        # The path in the plane, where a way leads far round, takes longer than a first plan.
        at_once = not problem.has_inertia and problem.search.improve
        ended.bound = lattice_bound(query) if at_once else None

    @property
    def budget(self) -> Budget:
        """The budget that remains."""
        return self.limit.less(self.spent)

    @property
    def for_others(self) -> Budget:
        """The budget that remains, less the time to check what is found."""
        left, better = self.budget, self.found.for_better
        return left._replace(deadline=min(left.deadline, better.deadline))

    @property
    def finds_plans(self) -> bool:
        """Whether the lattice knows every condition and price, so that its words are plans.

        It does where trims in the plane are switched at will. What others find is checked, with
        its best times, as soon as it is found: a later word may be refused.
        """
        return self.query.library.at_will

    @property
    def candidates(self) -> list[Candidate]:
        """Words that are to be checked, the cheapest first."""
        words = [word for word in self.words[::-1] if word is not self.passed]
        return [_candidate(self.query, word) for word in words if self.finds_plans]

    def gained(self, word: Word) -> None:
        """A better word was found."""
        self.words.append(word)
        if self.finds_plans:
            self.found.note(word.cost + self.query.padding)
            # The first is checked at once: whatever comes between, there is something to return.
            if self.found.budget.shows is None and self.found.plans:
                return
        if not self.found.may_check:
            return
        if self.found.offer(plan_of_word(self.query, word), self.query.goal_index[word.goal]):
            self.passed = word
        # Polishing finds better times, and takes what time there is.
        if not self.finds_plans and self.polish is None and self.found.wants_more:
            self.offer_best_times()

    def offer_best_times(self) -> None:
        """Offer the cheapest word with the best of its coasting times."""
        word, problem = self.words[-1], self.query.problem
        index = self.query.goal_index[word.goal]
        plan, part = plan_of_word(self.query, word), self.found.for_better.stage(TIMES_SHARE)
        better = with_relaxed_end(problem, plan, problem.goals[index], budget=part)
        if better is not None and self.found.may_check:
            self.found.offer(better, index, proven=False)  # it ends its coasts elsewhere

    def words_of(
        self,
        query: LatticeQuery,
        budget: Budget,
        *,
        known: Word | None = None,
        better: Callable[[Word], None] = lambda word: None,
        **schedule: Any,
    ) -> WordSearch:
        """A search for ever better words to its end, its attempts and expansions counted."""
        found = words_of(
            query, budget=budget, schedule=WordSchedule(table=self.table, **schedule), known=known
        )
        for word in found:
            better(word)
        self._count(found, searches=found.passes, attempts=found.attempts)
        return found

    def _count(self, search: FirstPlan | WordSearch, **more: int) -> None:
        self.spent += search.expansions
        counts = {"expansions": search.expansions, "collision_queries": search.queries}
        for name, n in (counts | more if self.finds_plans else counts).items():
            self.found.counts[name] += n

    def improved(self) -> list[Candidate]:
        """Plans to be checked, the cheapest first: what was found, and others if asked for."""
        if not self.words:
            return []
        if has_paces(self.query):
            # take the trims of a large library that fill the time, once the first word is shortened
            query, left = self.query, self.for_others
            self.words_of(query, left, known=self.words[-1], better=self.gained, patience=AT_ONCE)
            self.query, word = paced(query, self.words[-1])
            if word is not self.words[-1]:
                self.gained(word)
        query, found = self.query, self.found
        if query.problem.moves and self.finds_plans:
            self._let_pass()
        if query.problem.place_costs:
            self._go_round()
        own = self.words[-1]  # where others are improved from, too: they lead to other minima
        if (freely := _steered_freely(query.problem)) is not None:  # the first heeded no price
            if self.polish:  # whose motion is one maneuver, however many it was made from
                easy = lattice_query(freely, _goals(query), prepared=query.prepared)
                part = self._part(STEERED_SHARE, STEERED_SHARE)
                word = self.words_of(easy, part, known=own, patience=AT_ONCE).word
                if found.may_check:
                    found.offer(plan_of_word(query, word), query.goal_index[word.goal])
            self._by_way_of(query, STEERED_SHARE, counted=STEERED_SHARE)
        better = self.words_of(
            query,
            self._for_the_best(),
            known=own,
            better=self._gained_if_cheaper,
            patience=Patience(),
            floor=found.ended.bound.value - query.padding if found.ended.bound else -math.inf,
            every_trim=True,
            meanwhile=lambda: load_checks(query.problem, found.workspace),
        )
        if not self.finds_plans:
            return []
        candidates = [_candidate(query, word) for word in (*self.words, *better.others)]
        if found.alternatives and not self.for_others.is_over:
            # words that are locally optimal in free space: collision-free ones are so here, too
            candidates += self._free_words(FREE_WORDS * found.alternatives)
            candidates += self._detours(better.word, 2 * found.alternatives)
        return sorted(candidates, key=lambda one: one.cost)

    def _free_words(self, most: int) -> list[Candidate]:
        found = self.found
        stages = free_words(found, _goals(self.query), others=most, share=FREE_WORDS_SHARE)
        return [
            word_candidate(found.problem, word, index, proven=False)
            for word, index in words_once(stages)
        ]

    def _for_the_best(self) -> Budget:
        """Budget for the improvement of the best plan."""
        left = self.for_others
        if self.polish:
            return left.stage(ALONE_BEFORE_POLISHING if self.alone else BEFORE_POLISHING)
        share = FOR_THE_BEST if self.finds_plans and self.found.alternatives else 1.0
        if self.query.problem.place_costs:  # whose best times are found after that
            left = left.part(1.0 - TIMES_SHARE)
        most = None if left.expansions is None else int(share * left.expansions)
        return left.part(share)._replace(expansions=most)

    def _part(self, share: float, counted: float) -> Budget:
        """Shares of the time and of the expansions that are left."""
        left = self.for_others
        most = None if left.expansions is None else int(counted * left.expansions)
        return left.part(share)._replace(expansions=most)

    def _let_pass(self) -> None:
        """Note the cheapest path among static obstacles, with rests that let others pass."""
        query, static = self.query, _among_static(self.query)
        soon = self.limit.part(PASSING_SHARE)
        in_time = soon._replace(expansions=None)
        better = self.words_of(static, in_time, most=soon.expansions, patience=BRIEF)
        if better.first is None or better.first.word is None:
            return
        paths = sorted([better.first.word, better.word, *better.others], key=lambda one: one.cost)
        distinct = {tuple(path.trims.tolist()): path for path in reversed(paths)}
        for path in list(distinct.values())[::-1][:MOST_PATHS]:
            if soon.is_over:
                return
            timed = with_waits(query, path)
            if timed is not None and timed.cost < self.words[-1].cost:
                self.gained(timed)

    def _go_round(self) -> None:
        """Note a word along the cheapest way of a point, if it costs less than what is known."""
        # Estimates of the search are too low there to find a way round: it expands the places
        # first.
        query, best = self.query, self.words[-1]
        paid = best.cost - with_price(query.library.priced, best).cost
        for problem in with_cheapest_way_left(query) if paid > PAID * best.cost else ():
            closed = lattice_query(
                problem, _goals(query), prepared=query.prepared, library=query.library
            )
            self._by_way_of(closed, ROUND_SHARE, counted=COUNTED_ROUND)

    def _by_way_of(self, other: LatticeQuery, share: float, *, counted: float) -> None:
        """Note the word of another query with the same maneuvers, if it costs less than known."""
        query, left = self.query, self._part(share, counted)
        other = other if self.finds_plans else late_at_first(other)
        word = self.words_of(other, left, patience=AT_ONCE).word
        if word is NO_WORD:
            return
        word = self.words_of(query, left, known=word, patience=AT_ONCE).word
        self._gained_if_cheaper(word)

    def _gained_if_cheaper(self, word: Word) -> None:
        if word.cost < self.words[-1].cost:
            self.gained(word)

    def _detours(self, best: Word, most: int) -> Iterator[Candidate]:
        """Up to `most` plans round other sides of the obstacles: a disc blocks each known path."""
        query = self.query
        known: list[Plan] = [plan_of_word(query, best)]
        for n_th in range(MOST_DETOURS):
            if n_th >= len(known) or len(known) > most or self.for_others.is_over:
                return
            for problem in with_way_blocked(query.problem, known[n_th]):
                if self.for_others.is_over or self.for_others.expansions == 0:
                    return
                closed = lattice_query(problem, _goals(query), prepared=query.prepared)
                beside = self.words_of(closed, self.for_others, patience=SOME).word
                if beside is NO_WORD:
                    continue
                # past the disc, then without it
                word = self.words_of(query, self.for_others, known=beside, patience=AT_ONCE).word
                plan = plan_of_word(query, word)
                if is_new(plan, known, UNFINISHED):
                    known.append(plan)
                    yield _candidate(query, word)


def late_at_first(query: LatticeQuery) -> LatticeQuery:
    """The query with no longest time where cheaper is quicker: shortcuts and polishing hasten."""
    edges, trims = query.library.arrays.edges, query.library.arrays.library
    rates = trims.rates[: trims.n_trims]  # the last row is the turn of a free heading
    close = functools.partial(np.allclose, rtol=1e-9, atol=1e-12)
    timed = close(rates, rates[0]) and close(edges.cost, rates[0] * edges.time)
    return replace(query, most_time=math.inf) if timed else query


def _steered_freely(problem: Problem) -> Problem | None:
    """The problem without prices of steering at rest and of maneuvers' switches; None if free."""
    automaton, cost, terms = problem.automaton, problem.cost, terms_of(problem.cost)
    if 0.0 < getattr(automaton.model, "steering_at_rest", 0.0) < math.inf:
        automaton = _without_price_at_rest(automaton)
    if automaton.maneuvers and terms is not None and prices_switches(terms):
        cost = without_switches(terms)
    free = automaton is problem.automaton and cost is problem.cost
    return None if free else replace(problem, automaton=automaton, cost=cost)


@kept_by_first
def _without_price_at_rest(automaton: Automaton) -> Automaton:
    model: Any = automaton.model
    return replace(automaton, model=replace(model, steering_at_rest=0.0))


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


def with_way_blocked(problem: Problem, known: Plan) -> Iterator[Problem]:
    """Problems with one more obstacle each, which closes the path of a known plan.

    Problems whose start or goal the disc touches are left out.
    """
    poses = known.pose_at(np.linspace(0.0, known.duration, 101))
    driven = np.append(0.0, np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T)))
    if not driven[-1] > 0.0:
        return
    for share, radius in BLOCKING:
        place = poses[int(np.searchsorted(driven, share * driven[-1]))]
        disc = Obstacle(Disc(radius * float(driven[-1]), place[:2].tolist()), name="blocked way")
        closed = replace(problem, obstacles=(*problem.obstacles, disc))
        if blocked_ends(closed) is None:
            yield closed

"""Words of free space, and plans from them alone: obstacles only sort out what hits them."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace

from maneuver_automaton._kernel_list import load_kernels
from maneuver_automaton.automaton import Plan
from maneuver_automaton.budget import Budget
from maneuver_automaton.costs import Cost
from maneuver_automaton.planning import bounds
from maneuver_automaton.planning.blocked import goals_left
from maneuver_automaton.planning.checking import Condition, load_checking
from maneuver_automaton.planning.incumbents import Candidate, Incumbents, PlanningStep
from maneuver_automaton.planning.result import LowerBound, PlanStatus, Workspace
from maneuver_automaton.problem import Horizon, Problem
from maneuver_automaton.search import linked_words, word_setup
from maneuver_automaton.search.certificate import certificate
from maneuver_automaton.search.choose import insertion_stages, load_search, search_goal
from maneuver_automaton.search.limits import outside, why_impossible
from maneuver_automaton.search.result import InsertionTask, SearchResult, SearchStatus, plan_of
from maneuver_automaton.words import maneuver_words as of_maneuvers
from maneuver_automaton.words.word import Word, word_of_plan

WORDS_SHARE = 0.4  # of what is left, for words of free space where there is no plan yet
LATER_SHARE = 0.2  # the same where there is a plan already, or the lattice will find one
OTHERS = 6  # costlier words that are looked at where bounds or obstacles may refuse the cheapest
IN_SPACE = 23  # the same where some may pass above or below
SPARE = 2  # solutions for every alternative, as some may be one motion
LEAST_TIME = 1e-3  # [s] for each goal, also where the time is over


def free_words(
    found: Incumbents, goals: Iterable[int], *, others: int | None, share: float = 1.0
) -> Iterator[tuple[int, SearchResult]]:
    """Results of the searches for words to some goals, stage by stage, each with its goal.

    Each search may take a `share` of the time that is left, and finds `others` words beside the
    cheapest; None asks for all there are. Words with maneuvers count their work where the problem
    limits it, and then may take all the time. Where only the cheapest of these counts, the
    best plan known bounds its cost.
    """
    problem = found.problem
    for index in goals:
        goal = problem.goals[index]
        if problem.automaton.is_kinematic:
            part = found.budget.part(share, at_least=LEAST_TIME)
            for result in search_goal(problem, goal, alternatives=others, budget=part):
                yield index, result
            continue
        task = InsertionTask(
            problem=problem,
            goal=goal,
            alternatives=others or 0,
            budget=found.budget.stage(share),
            upper_bound=math.inf if others else found.cost,
        )
        for result in insertion_stages(task):
            yield index, result


def words_once(stages: Iterable[tuple[int, SearchResult]]) -> Iterator[tuple[Word, int]]:
    """The words of all stages as they are found, each once, with the goals they reach."""
    seen: list[Word] = []
    for index, result in stages:
        for word in result.solutions:
            if not any(word is one for one in seen):
                seen.append(word)
                yield word, index


def word_candidate(
    problem: Problem, word: Word, goal_index: int, *, proven: bool = True
) -> Candidate:
    """A word as a plan that is still to be checked, `proven` as in `Candidate`."""
    make = functools.partial(plan_of, problem, word)
    return Candidate(word.cost, goal_index, make, proven=proven)


def certificate_of(found: Incumbents) -> float | None:
    """The certificate of the cheapest plan; None for no word of the library, or priced places."""
    problem, best = found.problem, found.plans[0]
    if problem.place_costs:  # reduced costs are those of the invariant part alone
        return None
    word = word_of_plan(problem.automaton, best.plan)
    return None if word is None else certificate(problem, problem.goals[best.goal_index], word)


@dataclass(slots=True, eq=False)
class AllWords(PlanningStep):
    """The words of free space, by exhaustive search or insertion: obstacles sort out what hits."""

    candidates: list[Candidate] = field(default_factory=list)  # cheapest first, then the shortest
    exhausted: bool = True  # no search was cut short
    proven: bool = False  # no admitted word is cheaper

    def prepare(self, problem: Problem, workspace: Workspace) -> None:
        """Load the kernels."""
        if problem.obstacles or problem.zones:
            load_kernels("lattice", "improvement")
        load_search(problem)

    def offer(self, found: Incumbents) -> None:
        """Offer the cheapest ones that stay free and inside, as many as are asked for."""
        problem, ended = found.problem, found.ended
        sorted_out = not problem.bounds.are_open or bool(
            problem.obstacles or problem.zones or problem.place_costs
        )
        goals = [
            k for k, goal in enumerate(problem.goals) if not outside(goal.pose, problem.bounds)
        ]
        others = None if sorted_out else SPARE * found.alternatives
        words: list[tuple[Word, int]] = []
        proven = set[int]()  # goals to which no admitted word is cheaper
        for index, result in free_words(found, goals, others=others):
            self.exhausted &= result.status is not SearchStatus.OUT_OF_BUDGET
            proven |= {index} if result.exhaustive else set()
            found.counts.update(result.counts)
            words += [(word, index) for word in result.solutions]
        words.sort(key=lambda row: (float(f"{row[0].cost:.9g}"), len(row[0].trims), *row[0].trims))
        self.candidates = [word_candidate(problem, word, index) for word, index in words]
        self.proven = len(proven) == len(goals)
        ended.is_complete, ended.searched = True, found.budget.elapsed
        found.offer_in_turn(self.candidates)
        found.counts["rejected_by_audit"] = found.refused(Condition.AUDIT)
        if problem.obstacles:
            found.counts["words_that_hit"] = found.refused(Condition.COLLISION)
        if not found.plans:
            ended.why = self._why_none(found)
        elif self.proven and self.candidates and not problem.has_tolerance:
            ended.bound = LowerBound(value=self.candidates[0].cost, kind="exhaustive")
        else:
            ended.bound = bounds.formula_bound(problem)

    def _why_none(self, found: Incumbents) -> tuple[PlanStatus, str]:
        problem, refused = found.problem, found.refused
        if found.why_unchecked:
            return PlanStatus.OUT_OF_BUDGET, found.why_unchecked
        if refused(Condition.AUDIT):
            first = next(said for broken, said in found.refusals if broken is Condition.AUDIT)
            return PlanStatus.NO_PLAN, (
                f"the audit rejected {refused(Condition.AUDIT)} plans: {first}; "
                "do the trims belong to the model?"
            )
        if not self.exhausted:
            return PlanStatus.OUT_OF_BUDGET, (
                f"no plan within {found.budget.seconds:g} s and the expansions allowed"
            )
        beyond, hit = refused(Condition.BOUNDS), refused(Condition.COLLISION)
        if beyond and not hit:
            return PlanStatus.NO_PLAN, f"all {beyond} plans found leave the bounds"
        if hit:
            return PlanStatus.NO_PLAN, (
                f"all {beyond + hit} words found hit an obstacle or leave the bounds; "
                "the method lattice knows the obstacles"
            )
        impossible = why_impossible(problem)
        if impossible:
            return PlanStatus.UNREACHABLE, impossible
        if any(goal.tolerance_m or goal.tolerance_rad for goal in problem.goals):
            return PlanStatus.NO_PLAN, "no word was found to end within the tolerance of the goal"
        too_short = _least_time(problem, found.budget)
        if too_short is not None:
            return too_short
        limit = problem.horizon.max_trims
        if self.proven and limit is not None:
            return PlanStatus.UNREACHABLE, (
                f"no word of at most {limit} trims of this library ends at the goal"
            )
        return PlanStatus.NO_PLAN, "no word of this library was found to end at the goal"


def _least_time(problem: Problem, budget: Budget) -> tuple[PlanStatus, str] | None:
    """Verdict where the time is what stands in the way: the least time to any goal is named."""
    limit = problem.horizon.time or problem.horizon.max_time
    if limit is None or budget.is_over:
        return None
    hurry = replace(
        problem, cost=Cost(time=1.0), horizon=Horizon(max_trims=problem.horizon.max_trims)
    )
    quickest: list[float] = []
    proven = True
    for goal in problem.goals:
        results = search_goal(hurry, goal, alternatives=0, budget=budget)
        # Only a search over all admitted words is a proof: a certificate is but necessary.
        proven = proven and any(result.exhaustive for result in results)
        quickest += [one.duration for result in results for one in result.solutions]
    least = min(quickest, default=0.0)
    if least <= limit:
        return None
    return (PlanStatus.UNREACHABLE if proven else PlanStatus.NO_PLAN), (
        f"the goal cannot be reached in {limit:g} s: the least time found is {least:.6g} s"
    )


class FreeWords(PlanningStep):
    """Words of free space before the lattice is searched; among obstacles some may be free."""

    first_share = LATER_SHARE  # of the time, where there is no plan yet
    others = IN_SPACE

    def prepare(self, problem: Problem, workspace: Workspace) -> None:
        """Load the kernels."""
        load_checking()
        load_search(problem)

    def offer(self, found: Incumbents) -> None:
        """Offer words as they are found."""
        if not found.wants_more:
            return
        problem = found.problem
        guarded = bool(problem.obstacles) or not problem.bounds.are_open
        others = max(found.alternatives, self.others * guarded)
        share = LATER_SHARE if found.plans else self.first_share
        stages = free_words(found, goals_left(problem), others=others, share=share)
        plans = ((plan_of(problem, word), index) for word, index in words_once(stages))
        found.offer_as_they_come(plans, proven=not problem.obstacles)


class LinkedWords(FreeWords):
    """The same of trims that maneuvers link."""

    first_share = WORDS_SHARE
    others = OTHERS

    def prepare(self, problem: Problem, workspace: Workspace) -> None:
        """Load the kernels, and what the words of each goal are made of."""
        load_checking()
        load_kernels("words", "linked words")
        for goal in problem.goals:
            word_setup.word_setup(problem, goal, most_trims=linked_words.ALPHABET, steers=True)


class TurnedByManeuvers(PlanningStep):
    """Maneuvers in a row with straight coasts, where no word of trims turns the vehicle."""

    def offer(self, found: Incumbents) -> None:
        """Offer such words."""
        problem = found.problem
        if found.plans:
            return

        def plans() -> Iterator[tuple[Plan, int]]:
            for index in goals_left(problem):
                part = found.budget.stage(WORDS_SHARE)
                for plan in of_maneuvers.maneuver_words(
                    problem, problem.goals[index], others=OTHERS, budget=part
                ):
                    yield plan, index

        found.offer_as_they_come(plans(), proven=not problem.obstacles)

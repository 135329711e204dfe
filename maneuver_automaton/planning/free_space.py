"""Words of free space, and plans from them alone: obstacles only sort out what hits them."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from maneuver_automaton.budget import Budget
from maneuver_automaton.costs import Cost
from maneuver_automaton.planning.bounds import formula_bound
from maneuver_automaton.planning.checking import Condition
from maneuver_automaton.planning.incumbents import Candidate, Incumbents
from maneuver_automaton.planning.result import LowerBound, PlanResult, PlanStatus, Workspace
from maneuver_automaton.problem import Horizon, Problem
from maneuver_automaton.search import SearchStatus
from maneuver_automaton.search.certificate import certificate
from maneuver_automaton.search.choose import insertion_stages, search_goal
from maneuver_automaton.search.limits import outside, why_impossible
from maneuver_automaton.search.result import InsertionTask, SearchResult, plan_of
from maneuver_automaton.words.word import Word, word_of_plan

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


def plan_by_words(
    problem: Problem, budget: Budget, workspace: Workspace, /, *, alternatives: int
) -> PlanResult:
    """The cheapest word, by exhaustive search or insertion, that stays free and inside."""
    found = Incumbents(problem, budget, workspace.on(problem.obstacles), alternatives).begun()
    listed = _search_goals(found)
    searched = budget.elapsed
    found.offer_in_turn(listed.candidates)
    found.counts["rejected_by_audit"] = found.refused[Condition.AUDIT]
    if problem.obstacles:
        found.counts["words_that_hit"] = found.refused[Condition.COLLISION]
    if not found.plans:
        return found.none(*_why_none(found, listed))
    exact = not any(goal.tolerance_m or goal.tolerance_rad for goal in problem.goals)
    if listed.proven and exact:
        bound = LowerBound(value=listed.candidates[0].cost, kind="exhaustive")
    else:
        bound = formula_bound(problem)
    return found.found(bound=bound, searched=searched, certificate=certificate_of(found))


def certificate_of(found: Incumbents) -> float | None:
    """The certificate of the cheapest plan; None for one that is no word of the library."""
    problem, best = found.problem, found.plans[0]
    word = word_of_plan(problem.automaton, best.plan)
    return None if word is None else certificate(problem, problem.goals[best.goal_index], word)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Listed:
    """Candidates from the searches for all goals, and how these ended."""

    candidates: list[Candidate]  # cheapest first, of equals the shortest
    exhausted: bool  # no search was cut short
    proven: bool  # every admitted word was searched


def _search_goals(found: Incumbents) -> _Listed:
    """Search for every goal that is inside the bounds."""
    problem = found.problem
    sorted_out = not problem.bounds.are_open or bool(problem.obstacles or problem.zones)
    goals = [k for k, goal in enumerate(problem.goals) if not outside(goal.pose, problem.bounds)]
    others = None if sorted_out else SPARE * found.alternatives
    words: list[tuple[Word, int]] = []
    exhausted, proven = True, set[int]()  # goals whose every admitted word was searched
    for index, result in free_words(found, goals, others=others):
        exhausted = exhausted and result.status is not SearchStatus.OUT_OF_BUDGET
        proven |= {index} if result.exhaustive else set()
        found.counts.update(result.counts)
        words += [(word, index) for word in result.solutions]
    words.sort(key=lambda row: (float(f"{row[0].cost:.9g}"), len(row[0].trims), *row[0].trims))
    candidates = [word_candidate(problem, word, index) for word, index in words]
    return _Listed(candidates=candidates, exhausted=exhausted, proven=len(proven) == len(goals))


def _why_none(found: Incumbents, listed: _Listed) -> tuple[PlanStatus, str]:
    problem, refused = found.problem, found.refused
    if found.why_unchecked:
        return PlanStatus.OUT_OF_BUDGET, found.why_unchecked
    if refused[Condition.AUDIT]:
        return PlanStatus.NO_PLAN, (
            f"the audit rejected {refused[Condition.AUDIT]} plans: "
            f"{found.reasons[Condition.AUDIT]}; do the trims belong to the model?"
        )
    if not listed.exhausted:
        return PlanStatus.OUT_OF_BUDGET, (
            f"no plan within {found.budget.seconds:g} s and the expansions allowed"
        )
    beyond, hit = refused[Condition.BOUNDS], refused[Condition.COLLISION]
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
    if listed.proven and limit is not None:
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

"""One sequence of steps to a plan, for every vehicle: see `steps`."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from maneuver_automaton.automaton import Plan
from maneuver_automaton.budget import Budget
from maneuver_automaton.planning.along_paths import AlongPaths
from maneuver_automaton.planning.blocked import goals_left
from maneuver_automaton.planning.bounds import bound_along_paths
from maneuver_automaton.planning.checking import Condition, load_checks
from maneuver_automaton.planning.free_words import free_words, words_once
from maneuver_automaton.planning.incumbents import Accepted, Incumbents
from maneuver_automaton.planning.lattice_words import LatticeWords, improved, search_lattice
from maneuver_automaton.planning.polishing import polish_found
from maneuver_automaton.planning.result import PlanResult, PlanStatus
from maneuver_automaton.planning.steps import Steps, steps_of
from maneuver_automaton.planning.workspace import Workspace
from maneuver_automaton.problem import Problem
from maneuver_automaton.search.beginning import Begun
from maneuver_automaton.search.certificate import certificate
from maneuver_automaton.search.limits import why_impossible
from maneuver_automaton.search.result import plan_of
from maneuver_automaton.words.word import word_of_plan

WORDS_SHARE = 0.4  # of what is left, for words of free space where there is no plan yet
LATER_SHARE = 0.2  # the same where there is a plan already, or the lattice will find one
OTHERS = 6  # costlier words that are looked at where bounds or obstacles may refuse the cheapest
IN_SPACE = 23  # the same where some may pass above or below


def plan_in_steps(
    problem: Problem,
    budget: Budget,
    workspace: Workspace,
    /,
    *,
    alternatives: int,
    begun: Begun | None = None,
) -> PlanResult:
    """The cheapest plan found: words and paths, the lattice, better words, checks, polishing.

    Where the problem limits its expansions, all steps count their work: the plan is then the same
    at every call, unless the time is over before. The lattice goes on from what is `begun`.
    """
    steps = steps_of(problem)
    found = Incumbents(
        problem, budget, workspace.on(problem.obstacles), alternatives, steps.likeness
    )
    found.counts.update(expansions=0, collision_queries=0)
    paths, lattice, searched = AlongPaths(found), None, None
    if (steps.along_paths or steps.words or not steps.at_will) and not budget.is_over:
        load_checks(problem, found.workspace)
    if steps.along_paths and not budget.is_over:
        _offer(found, paths.plans())
    if steps.words and not (budget.is_over or found.is_enough):
        _offer(found, _free_words(found, steps), proven=not problem.obstacles)
    if steps.lattice and not (budget.is_over or found.is_enough):
        lattice = search_lattice(found, steps, begun)
        searched = budget.elapsed if lattice.knows_all else None
        if not problem.search.improve:
            found.offer_in_turn(lattice.candidates)
        if not found.is_enough:
            found.offer_in_turn(improved(lattice))
    if steps.polishes and not (found.for_better.is_over or found.is_enough):
        known = found.cost
        polish_found(found, paths.guesses)
        if lattice and lattice.words and found.cost == known and not budget.is_over:
            lattice.offer_best_times()
    _count_refused(found, lattice)
    nodes = lattice.first.nodes if lattice and lattice.first else None
    if not found.plans:
        return found.none(*_why_none(found, steps, paths, lattice), nodes=nodes)
    return found.found(
        bound=(lattice and lattice.bound) or bound_along_paths(problem),
        searched=searched,
        certificate=None if steps.at_will else _certificate(problem, found.plans[0]),
        nodes=nodes,
    )


def _offer(found: Incumbents, plans: Iterable[tuple[Plan, int]], *, proven: bool = True) -> None:
    """Offer plans to goals as they are found, until the time is over; `proven` as there."""
    for plan, goal_index in plans:
        if not found.may_check:
            return
        found.offer(plan, goal_index, proven=proven)
        if found.budget.is_over or found.is_enough:
            return


def _free_words(found: Incumbents, steps: Steps) -> Iterator[tuple[Plan, int]]:
    """Words of free space as plans, and the goals they reach."""
    problem = found.problem
    guarded = bool(problem.obstacles) or not problem.bounds.are_open
    most = IN_SPACE if steps.at_will else OTHERS
    others = max(found.alternatives, most if guarded else 0)
    share = LATER_SHARE if found.plans or steps.at_will else WORDS_SHARE
    for word, index in words_once(
        free_words(found, goals_left(problem), others=others, share=share)
    ):
        yield plan_of(problem, word), index


def _count_refused(found: Incumbents, lattice: LatticeWords | None) -> None:
    """Count the plans that were refused, by the check where the lattice took them for plans."""
    if lattice is None or not lattice.knows_all:
        found.counts["rejected"] = found.rejected
    elif lattice.words:
        by_audit = found.refused[Condition.AUDIT]
        found.counts["rejected_by_fcl"] = found.rejected - by_audit
        found.counts["rejected_by_audit"] = by_audit


def _certificate(problem: Problem, best: Accepted) -> float | None:
    """The certificate of a plan that is a word of the library; None for one that is not."""
    word = word_of_plan(problem.automaton, best.plan)
    return None if word is None else certificate(problem, problem.goals[best.goal_index], word)


def _why_none(
    found: Incumbents, steps: Steps, paths: AlongPaths, lattice: LatticeWords | None
) -> tuple[PlanStatus, str]:
    """How it ended where no plan was accepted, and why."""
    first = lattice.first if lattice else None
    proof = paths.enclosed or (first.enclosed if first else "")
    proof = proof or (why_impossible(found.problem) if steps.at_will else "")
    if proof:
        return PlanStatus.UNREACHABLE, proof
    if found.why_unchecked:
        return PlanStatus.OUT_OF_BUDGET, found.why_unchecked
    if found.why_refused:
        return PlanStatus.NO_PLAN, f"every plan found was refused: {found.why_refused}"
    near = ""
    if first and math.isfinite(first.nearest[0]):
        near = "; the nearest node is {:.3g} m and {:.3g} rad off".format(*first.nearest)
    if first and first.exhausted:
        return PlanStatus.NO_PLAN, f"none at any resolution tried, which proves nothing{near}"
    spent = f"{found.counts['expansions']} expansions" if lattice else "the expansions allowed"
    return PlanStatus.OUT_OF_BUDGET, (
        f"no plan within {found.budget.seconds:.4g} s and {spent}{paths.reason}{near}"
    )

"""One sequence of steps to a plan, for every vehicle: see `steps`.

A vehicle that can follows the paths of a simpler one, which switches at will: it stops at each
switch.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from maneuver_automaton.automaton import Plan
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision import Obstacle
from maneuver_automaton.planning.blocked import goals_left
from maneuver_automaton.planning.bounds import bound_along_paths
from maneuver_automaton.planning.checking import Condition, TooLate, load_checks, what_is_hit
from maneuver_automaton.planning.free_space import certificate_of, free_words, words_once
from maneuver_automaton.planning.incumbents import Incumbents
from maneuver_automaton.planning.lattice_words import (
    AT_ONCE,
    BEFORE_POLISHING,
    LatticeWords,
    improved,
    search_lattice,
)
from maneuver_automaton.planning.polishing import Aimed, guess_along, polish_found
from maneuver_automaton.planning.result import PlanResult, PlanStatus, Workspace
from maneuver_automaton.planning.steps import Steps, steps_of
from maneuver_automaton.planning.tracking import Tracked, track
from maneuver_automaton.problem import Problem
from maneuver_automaton.refinement.guesses import path_guesses
from maneuver_automaton.refinement.stop_and_steer import kinematic_problem, stop_and_steer
from maneuver_automaton.search.beginning import Begun
from maneuver_automaton.search.limits import why_impossible
from maneuver_automaton.search.result import plan_of
from maneuver_automaton.words.maneuver_words import maneuver_words, only_maneuvers_turn

WORDS_SHARE = 0.4  # of what is left, for words of free space where there is no plan yet
LATER_SHARE = 0.2  # the same where there is a plan already, or the lattice will find one
OTHERS = 6  # costlier words that are looked at where bounds or obstacles may refuse the cheapest
IN_SPACE = 23  # the same where some may pass above or below
FIRST_POLISHED = 0.7  # of what is left, for polishing where there is no plan yet
FIRST_SHARE = 0.8  # of the time limit, for a first path
IMPROVED_SHARE = 0.2  # of what is left, for a path that is faster to follow
STOPPING_S = 0.01  # [s] that it takes to stop and steer along a path
WAITS = 9  # at rest, before a path is followed among moving obstacles


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
    ).begun()
    found.counts.update(expansions=0, collision_queries=0)
    paths, lattice, searched = AlongPaths(found), None, None
    tried = math.inf
    if (steps.along_paths or steps.words or not steps.at_will) and not budget.is_over:
        load_checks(problem, found.workspace)
    if steps.along_paths and not budget.is_over:
        _offer(found, paths.plans())
    if steps.words and not (budget.is_over or found.is_enough):
        _offer(found, _free_words(found, steps), proven=not problem.obstacles)
    if only_maneuvers_turn(problem.automaton) and not found.plans:
        _offer(found, _turned_by_maneuvers(found), proven=not problem.obstacles)
    if steps.lattice and not (budget.is_over or found.is_enough):
        lattice, tried = _search_lattice(found, steps, paths, begun)
        searched = budget.elapsed if lattice.knows_all else None
        if not problem.search.improve:
            found.offer_in_turn(lattice.candidates)
        if not found.is_enough:
            found.offer_in_turn(improved(lattice))
    done = found.for_better.is_over or found.is_enough or found.cost == tried < math.inf
    if steps.polishes and not done:
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
        certificate=None if steps.at_will else certificate_of(found),
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


def _search_lattice(
    found: Incumbents, steps: Steps, paths: AlongPaths, begun: Begun | None
) -> tuple[LatticeWords, float]:
    """What the lattice finds, and the cost that polishing has come to; inf if it may go on.

    Where no plan fits but one nearly does, which polishing may mend, it does not wait for all that
    the lattice tries: each has its share, and the lattice what is left.
    """
    known = bool(found.plans)
    soon = steps.polishes and (known or found.misfits)
    lattice = search_lattice(found, steps, begun, share=BEFORE_POLISHING if soon else 1.0)
    if not known:  # only the first search had a share
        lattice.limit = found.for_first
    if found.plans or not (steps.polishes and found.misfits):
        return lattice, math.inf
    tried = polish_found(found, paths.guesses, share=FIRST_POLISHED)
    ended = lattice.first is None or lattice.first.exhausted or found.budget.expansions is not None
    if not (lattice.words or found.plans or ended):
        lattice = search_lattice(found, steps)
    lattice.alone = not found.plans
    return lattice, found.cost if tried else math.inf


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


def _turned_by_maneuvers(found: Incumbents) -> Iterator[tuple[Plan, int]]:
    """Maneuvers in a row with straight coasts, where no word of trims turns the vehicle."""
    for index in goals_left(found.problem):
        goal, part = found.problem.goals[index], found.budget.stage(WORDS_SHARE)
        for plan in maneuver_words(found.problem, goal, others=OTHERS, budget=part):
            yield plan, index


def _count_refused(found: Incumbents, lattice: LatticeWords | None) -> None:
    """Count the plans that were refused, by the check where the lattice took them for plans."""
    if lattice is None or not lattice.knows_all:
        found.counts["rejected"] = found.rejected
    elif lattice.words:
        by_audit = found.refused[Condition.AUDIT]
        found.counts["rejected_by_fcl"] = found.rejected - by_audit
        found.counts["rejected_by_audit"] = by_audit


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


@dataclass(slots=True, eq=False)
class AlongPaths:
    """Paths of the simpler vehicle, and what came of them."""

    found: Incumbents
    reason: str = ""  # why there is no path
    enclosed: str = ""  # why no plan can exist
    guesses: list[Aimed] = field(default_factory=list)  # along the paths, for polishing

    def plans(self) -> Iterator[tuple[Plan, int]]:
        """Stop and steer along a first path, then along one that is fast to follow so."""
        found, problem = self.found, self.found.problem
        free = kinematic_problem(problem, switch=0.0)
        first = self._track(free, found.budget.stage(FIRST_SHARE), patience=AT_ONCE)
        if first.plan is None or first.goal_index is None:
            self.enclosed = first.reason if first.enclosed else ""
            self.reason = f" ({first.reason})" if first.reason else ""
            return
        yield from _stopping(found, first.plan, first.goal_index)
        if found.budget.is_over:
            return
        along = path_guesses(problem.automaton.model)
        if along is not None and first.plan.duration > 0.0:
            self.guesses.append(guess_along(problem, along, first.plan))
        soon = found.budget.stage(IMPROVED_SHARE)
        better = self._track(kinematic_problem(problem), soon, known=first.plan)
        if better.plan is not None and better.goal_index is not None and found.may_check:
            yield from _stopping(found, better.plan, better.goal_index)

    def _track(self, problem: Problem, budget: Budget, **more: Any) -> Tracked:
        """A path of the simpler vehicle; what it takes is counted."""
        prepared = self.found.workspace.prepared
        path = track(problem, budget=budget, prepared=prepared, **more)
        self.found.counts.update(expansions=path.expansions, collision_queries=path.queries)
        return path


def _stopping(found: Incumbents, path: Plan, goal_index: int) -> Iterator[tuple[Plan, int]]:
    """Stop and steer along a path, once moving obstacles let it pass.

    The path was free at the pace of the simpler vehicle. This one is slower, so that it meets
    moving obstacles elsewhere: it waits before it starts, as long as it takes, or does not go.
    """
    problem, goal = found.problem, found.problem.goals[goal_index]
    if found.for_checks.left_to_check < STOPPING_S:
        return
    plan = stop_and_steer(
        problem.automaton.model,  # type: ignore[arg-type]
        path,
        first=problem.first_trim,
        last=problem.last_trim(goal),
    )
    if not problem.moves:
        yield plan, goal_index
        return
    settled = max(
        float(one.motion.time[-1])
        for one in problem.obstacles
        if isinstance(one, Obstacle) and one.motion is not None
    )
    for wait in np.linspace(0.0, max(settled - problem.start_time, 0.0), WAITS):
        if found.budget.is_over:
            return
        durations = plan.durations.copy()
        durations[0] += wait
        later = replace(plan, durations=durations)
        try:
            hit = what_is_hit(problem, later, goal, found.workspace, budget=found.for_checks)
        except TooLate:
            return
        if not hit:
            yield later, goal_index
            return

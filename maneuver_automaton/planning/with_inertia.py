"""Plans of vehicles with inertia: a plan that stops and steers at once, then better ones."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.same_motion import POLISHED
from maneuver_automaton.collision import Obstacle
from maneuver_automaton.costs import Cost
from maneuver_automaton.planning.among_obstacles import library_table
from maneuver_automaton.planning.blocked import open_goals
from maneuver_automaton.planning.bounds import lattice_bound, speed_bound, word_bound
from maneuver_automaton.planning.checking import load_checking, load_checks, what_is_hit
from maneuver_automaton.planning.incumbents import Accepted, Incumbents
from maneuver_automaton.planning.polishing import (
    Aimed,
    guess_along,
    load_polishing,
    polish_found,
    rests_at_both_ends,
    why_not_polished,
)
from maneuver_automaton.planning.result import PlanResult, PlanStatus
from maneuver_automaton.planning.tracking import Tracked, track
from maneuver_automaton.planning.workspace import Workspace
from maneuver_automaton.problem import Problem
from maneuver_automaton.refinement.fitting import with_best_times
from maneuver_automaton.refinement.improve import Patience
from maneuver_automaton.refinement.kinematic_paths import follows_paths, kinematic_problem
from maneuver_automaton.refinement.maneuver_lattice import maneuver_words, plan_of, quick_word
from maneuver_automaton.refinement.ready import load_lattice, load_maneuver_kernels
from maneuver_automaton.refinement.stop_and_steer import stop_and_steer
from maneuver_automaton.search import SearchStatus
from maneuver_automaton.search.budget import COUNTED, Budget
from maneuver_automaton.search.certificate import certificate
from maneuver_automaton.search.lattice_query import LatticeQuery, lattice_query
from maneuver_automaton.search.linked_words import load_linked_words
from maneuver_automaton.search.result import plan_of as plan_of_word
from maneuver_automaton.search.word_stages import maneuver_word_stages
from maneuver_automaton.words.word import Word, word_of_plan

FIRST_SHARE = 0.8  # of the time limit, for a first path
IMPROVED_SHARE = 0.2  # of what is left, for a path that is faster to follow
WORDS_SHARE = 0.4  # of what is left, for words in free space where there is no plan yet
MANEUVER_SHARE = 0.2  # of what is left, for words of maneuvers where there is a plan already
AT_ONCE = Patience(attempts=0, passes=0)
WAITS = 9  # at rest, before a path is followed among obstacles that move
OTHERS = 6  # dearer words that are looked at where bounds or obstacles may refuse the cheapest


def plan_with_inertia(
    problem: Problem, budget: Budget, workspace: Workspace, /, *, alternatives: int
) -> PlanResult:
    """The cheapest plan found for a vehicle with inertia.

    Where the problem limits its expansions, all stages count their work: the plan is then the same
    at every call, unless the time is over before.
    """
    found = Incumbents(problem, budget, workspace.on(problem.obstacles), alternatives, POLISHED)
    found.counts.update(expansions=0, collision_queries=0)
    search = _Search(found)
    for plan, goal_index in _candidates(search):
        found.offer(plan, goal_index)
        if budget.is_over:
            break
    polish_found(found, search.paths)
    found.counts["rejected"] = found.rejected
    if not found.plans:
        return found.none(*_why_none(search))
    return found.found(
        bound=_lower_bound(problem), certificate=_certificate(problem, found.plans[0])
    )


@dataclass(slots=True, eq=False)
class _Search:
    """What the stages hand on to each other beside plans."""

    found: Incumbents
    reason: str = ""  # why a stage came to nothing
    enclosed: str = ""  # why no plan can exist
    paths: list[Aimed] = field(default_factory=list)  # guesses along kinematic plans

    def track(self, problem: Problem, budget: Budget, **more: Any) -> Tracked:
        """A path of the kinematic vehicle; what it takes is counted."""
        prepared = self.found.workspace.prepared
        found = track(problem, time_limit=budget.left, prepared=prepared, **more)
        self.found.counts.update(expansions=found.expansions, collision_queries=found.queries)
        return found


def _why_none(search: _Search) -> tuple[PlanStatus, str]:
    """How a search ended that found no plan, and why."""
    found = search.found
    if search.enclosed:
        return PlanStatus.UNREACHABLE, search.enclosed
    if found.why_refused:
        return PlanStatus.NO_PLAN, f"every plan found was refused: {found.why_refused}"
    return PlanStatus.OUT_OF_BUDGET, (
        f"no plan within {found.budget.seconds:g} s and the expansions allowed{search.reason}"
    )


def _candidates(search: _Search) -> Iterator[tuple[Plan, int]]:
    """Plans as they are found, and the goals they reach.

    Where nothing is in the way, words come before the lattice: they are found sooner, and keep to
    every condition of the horizon. Among obstacles the lattice alone finds its way round.
    """
    problem, method = search.found.problem, search.found.problem.search.method
    load_checks(problem, search.found.workspace)
    if (
        method in ("auto", "lattice")
        and follows_paths(problem.automaton.model)
        and rests_at_both_ends(problem)
    ):
        yield from _along_paths(search)
    if not problem.automaton.maneuvers:
        return
    if method in ("words", "insertion") or (method == "auto" and _suits_words(problem)):
        yield from _by_words(search.found)
    if method in ("auto", "lattice"):
        yield from _over_maneuvers(search)


def _over_maneuvers(search: _Search) -> Iterator[tuple[Plan, int]]:
    """Words of trims and maneuvers from the lattice, each cheaper than the one before.

    All the time that is left may go by until there is a plan; a share of it is for better ones
    where polishing comes after.
    """
    found, problem, budget = search.found, search.found.problem, search.found.budget
    goals = open_goals(problem)
    prepared = found.workspace.prepared
    query = late_at_first(lattice_query(problem, goals, prepared=prepared))
    before = found.counts["expansions"]
    counted = budget.expansions is not None
    share = COUNTED if counted else MANEUVER_SHARE
    share = 1.0 if why_not_polished(problem) else share
    until = budget.stage(share if found.plans else 1.0).deadline
    known: Word | None = None
    if _needs_quick_word(query):
        in_time = replace(problem, cost=Cost(time=1.0))
        quick = late_at_first(lattice_query(in_time, goals, prepared=prepared))
        known, more = quick_word(query, quick, deadline=until, max_expansions=budget.expansions)
        before += more
        if known is not None:
            yield plan_of(query, known), query.goal_index[known.goal]
    for incumbent in maneuver_words(
        query,
        deadline=until,
        max_expansions=budget.expansions,
        better_share=share,
        known=known,
    ):
        found.counts["expansions"] = before + incumbent.expansions
        if incumbent.word is not None:
            owner = query.goal_index[incumbent.word.goal]
            plan = plan_of(query, incumbent.word)
            yield plan, owner
            if problem.goals[owner].free_heading:
                better = with_best_times(problem, plan, problem.goals[owner])
                if better is not None:
                    yield better, owner
        elif not found.plans:
            if incumbent.status is SearchStatus.EXHAUSTED:
                search.reason = "; none over trims and maneuvers at any resolution tried"
            if math.isfinite(incumbent.nearest):
                near = f"{incumbent.nearest:.3g} m from the goal"
                search.reason += f"; the nearest place that was reached is {near}"


def late_at_first(query: LatticeQuery) -> LatticeQuery:
    """The query with no longest time where what costs less is what lasts less.

    There a first word may be late, and what shortcuts and polishing make of it is in time; whatever
    stays late is refused.
    """
    edges, trims = query.library.arrays, query.library.arrays.library
    rates = trims.rates[: trims.n_trims]  # the last row is the turn of a free heading
    close = functools.partial(np.allclose, rtol=1e-9, atol=1e-12)
    timed = close(rates, rates[0]) and close(edges.edge_cost, rates[0] * edges.edge_time)
    return replace(query, most_time=math.inf) if timed else query


def _needs_quick_word(query: LatticeQuery) -> bool:
    """Whether a search by cost alone would look everywhere, or for too long motions."""
    return math.isfinite(query.most_time) or query.library.per_metre == 0.0


def _suits_words(problem: Problem) -> bool:
    """Whether words may be searched first: nothing is in the way, or the time is to be met exactly.

    Where no rest fills a fixed time, words alone have times that add up to it.
    """
    rests = problem.first_trim.is_rest or problem.last_trim(problem.goals[0]).is_rest
    return not problem.obstacles or (problem.horizon.time is not None and not rests)


def _by_words(found: Incumbents) -> Iterator[tuple[Plan, int]]:
    """Words of trims and maneuvers that look at no obstacle: short ones, then insertion."""
    problem = found.problem
    guarded = bool(problem.obstacles) or not problem.bounds.are_open
    others = max(found.alternatives, OTHERS if guarded else 0)
    seen: list[Word] = []
    for index, goal in enumerate(problem.goals):
        for stage in maneuver_word_stages(
            problem,
            goal,
            time_limit=found.budget.stage(MANEUVER_SHARE if found.plans else WORDS_SHARE).left,
            alternatives=others,
            upper_bound=found.cost if others == 0 else math.inf,
        ):
            for word in stage.solutions:
                if not any(word is one for one in seen):
                    seen.append(word)
                    yield plan_of_word(problem, word), index


def _along_paths(search: _Search) -> Iterator[tuple[Plan, int]]:
    """Stop and steer along a first path, then along one that is fast to follow so."""
    found, problem = search.found, search.found.problem
    free = kinematic_problem(problem, switch=0.0)
    first = search.track(free, found.budget.stage(FIRST_SHARE), patience=AT_ONCE)
    if first.plan is None or first.goal_index is None:
        search.enclosed = first.reason if first.enclosed else ""
        search.reason = f" ({first.reason})" if first.reason else ""
        return
    yield from _stopping(found, first.plan, first.goal_index)
    if first.plan.duration > 0.0:
        search.paths.append(guess_along(problem, first.plan))
    soon = found.budget.stage(IMPROVED_SHARE)
    better = search.track(kinematic_problem(problem), soon, known=first.plan)
    if better.plan is not None and better.goal_index is not None:
        yield from _stopping(found, better.plan, better.goal_index)


def _stopping(found: Incumbents, path: Plan, goal_index: int) -> Iterator[tuple[Plan, int]]:
    """Stop and steer along a path, once obstacles that move let it.

    The path was free at the pace of the kinematic vehicle. This one is slower, so that it meets
    moving obstacles elsewhere: it waits before it starts, as long as it takes, or does not go.
    """
    problem, goal = found.problem, found.problem.goals[goal_index]
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
        durations = plan.durations.copy()
        durations[0] += wait
        later = replace(plan, durations=durations)
        if not what_is_hit(problem, later, goal, found.workspace):
            yield later, goal_index
            return


def load_inertia(problem: Problem, workspace: Workspace) -> None:
    """Compile or load what `plan_with_inertia` needs, before the clock runs."""
    load_lattice()
    load_checking()
    if follows_paths(problem.automaton.model) and rests_at_both_ends(problem):
        library_table(kinematic_problem(problem, switch=0.0), workspace)
        if not why_not_polished(problem):
            load_polishing(problem)
    if problem.automaton.maneuvers:
        load_maneuver_kernels()
        if _suits_words(problem) or problem.search.method in ("words", "insertion"):
            load_linked_words()


def _certificate(problem: Problem, best: Accepted) -> float | None:
    """The certificate of a plan that is a word of the library; None for one that is not."""
    word = word_of_plan(problem.automaton, best.plan)
    return None if word is None else certificate(problem, problem.goals[best.goal_index], word)


def _lower_bound(problem: Problem) -> float:
    """No plan is cheaper: the shortest way, driven from rest to rest at the limits.

    A way that the kinematic vehicle needs B seconds for at full speed v takes ``B + v / a`` with
    the acceleration a, or ``2 sqrt(B v / a)`` where v is not reached.
    """
    model, cost = problem.automaton.model, problem.cost
    known = speed_bound(problem)
    if why_not_polished(problem) and not follows_paths(model):  # all plans are words
        known = max(known, word_bound(problem))
    if not (follows_paths(model) and rests_at_both_ends(problem) and isinstance(cost, Cost)):
        return known
    simpler = kinematic_problem(problem, switch=0.0)
    least = lattice_bound(lattice_query(simpler, tuple(range(len(problem.goals)))))
    fastest = float(np.abs(model.reduced_limits[0]).max())
    ramp = fastest / float(model.control_limits[0, 1])
    duration = least + ramp if least >= ramp else 2.0 * math.sqrt(least * ramp)
    return max(known, cost.time * duration + cost.length * least * fastest)

"""Planning, from top to bottom: the steps that lead to the plans of a problem, one after the other.

What a vehicle and its library can do decides which steps there are. All of them offer what they
find to the same incumbents, where it is checked; the answer is made of these.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from maneuver_automaton._kept import kept_by_first
from maneuver_automaton._kernel_list import load_kernels
from maneuver_automaton.automaton import Automaton, validation
from maneuver_automaton.automaton.same_motion import CONVERGED, POLISHED, UNFINISHED, Likeness
from maneuver_automaton.budget import Budget
from maneuver_automaton.models.speeds import steers_at_rest
from maneuver_automaton.planning import (
    along_paths,
    along_poses,
    among_zones,
    bounds,
    from_state,
    lattice_words,
    on_state_lattice,
    polished_price,
    polishing,
    within_tolerance,
)
from maneuver_automaton.planning.blocked import blocked_ends, goals_off_lattice
from maneuver_automaton.planning.checking import load_checking, load_checks
from maneuver_automaton.planning.free_space import (
    AllWords,
    FreeWords,
    LinkedWords,
    TurnedByManeuvers,
    certificate_of,
)
from maneuver_automaton.planning.incumbents import Incumbents, PlanningStep
from maneuver_automaton.planning.result import PlanResult, PlanStatus, Workspace
from maneuver_automaton.problem import Problem
from maneuver_automaton.refinement import relaxed_end, stop_and_steer
from maneuver_automaton.search import beginning
from maneuver_automaton.search.limits import why_impossible
from maneuver_automaton.words import maneuver_words

SAVING = 1e-3  # share of a cost that better times have to save for others to be looked for


class Steps(NamedTuple):
    """The steps of a problem in their order, and how what they find is looked at."""

    steps: Sequence[PlanningStep]
    likeness: Likeness = CONVERGED  # of plans that count as one motion
    certified: bool = False  # whether reduced costs say something of the cheapest plan


def answer(
    problem: Problem,
    budget: Budget,
    workspace: Workspace,
    /,
    *,
    alternatives: int,
    course: Callable[[Problem], Steps] | None = None,
) -> PlanResult:
    """The answer to a problem within a budget, the checks included; kernels are loaded already.

    Where the problem limits its expansions, all steps count their work: the plan is then the same
    at every call, unless the time is over before. The steps are those of `course`, by default
    `steps_of`.
    """
    steps, likeness, certified = (course or steps_of)(problem)
    workspace = workspace.on(problem.obstacles)
    found = Incumbents(problem, budget, workspace, alternatives, likeness)
    ended = found.ended
    try:
        for step in steps:
            if not ended.is_complete:
                step.offer(found)
    finally:
        if ended.begun is not None:  # whose memory serves the next query
            ended.begun.free.append(ended.begun.call)
    if ended.verdict is not None:
        return ended.verdict
    if not ended.is_complete:
        found.counts.update(expansions=0, collision_queries=0)
        if not ended.finds_plans:
            found.counts["rejected"] = found.rejected
    if not found.plans:
        return found.none(*(ended.why or _why_none(found)), nodes=ended.nodes)
    return found.found(
        bound=ended.bound or bounds.bound_along_paths(problem),
        searched=ended.searched,
        certificate=certificate_of(found) if certified else None,
        nodes=ended.nodes,
    )


def steps_of(problem: Problem) -> Steps:
    """The steps of a problem: along the poses on its way, or those of a leg to its goals."""
    if problem.via:
        return Steps([along_poses.AlongPoses(functools.partial(answer, course=leg_steps))])
    return leg_steps(problem)


def leg_steps(problem: Problem) -> Steps:
    """The steps to the goals of a problem: its graph, if it has one, then its searches.

    Where it starts or ends in a state of no trim, problems between trims are answered instead.
    """
    if problem.has_states:
        legs = functools.partial(answer, course=leg_steps)
        return Steps([from_state.FromState(legs, prepare_steps)], POLISHED)
    graph = [on_state_lattice.OnStateLattice()] if _may_be_a_graph(problem) else []
    if problem.has_tolerance:
        exact = functools.partial(answer, course=exact_steps)
        return Steps([*graph, within_tolerance.WithinTolerance(exact)])
    rest = exact_steps(problem)
    return rest._replace(steps=[*graph, *rest.steps])


def exact_steps(problem: Problem) -> Steps:
    """The steps to plans that end exactly at a goal: of the search, or of several among zones."""
    if problem.zones:
        zones = among_zones.AmongZones(functools.partial(answer, course=search_steps))
        return Steps([FreeEnds(), NearlyMet(), zones])
    rest = search_steps(problem)
    return rest._replace(steps=[FreeEnds(), *rest.steps])


def search_steps(problem: Problem) -> Steps:
    """The steps of one search, from a start and to goals that are free.

    Where nothing is in the way, words come before the lattice: they are found sooner, and keep to
    every condition of the horizon. Among obstacles the lattice alone finds a path round them; but
    in space, where it has one more dimension, a word that passes above or below is found sooner.
    """
    method, automaton = problem.search.method, problem.automaton
    invariant = not problem.place_costs  # then reduced costs are those of the whole
    if not problem.has_inertia:
        if not uses_lattice(problem):
            return Steps([NearlyMet(), AllWords(), BestTimes()], certified=invariant)
        climbs = problem.start.size > 3
        first: list[PlanningStep] = [Checks(), FreeWords()] if climbs else []
        lattice = [lattice_words.LatticeWords()] if method in ("auto", "lattice") else []
        return Steps([NearlyMet(), *first, *lattice, BestTimes()], UNFINISHED)
    searched, linked = method in ("auto", "lattice"), bool(automaton.maneuvers)
    stops = stop_and_steer.follows_paths(automaton.model) and steers_at_rest(automaton.model)
    along = searched and stops and problem.rests_at_both_ends
    # To stop and steer costs no metre.
    shortest = along and polished_price.prices_metres_alone(problem.cost)
    polish = None if shortest or polishing.why_not_polished(problem) else polishing.Polish()
    steps: list[PlanningStep] = [NearlyMet(), Checks()]
    if along:
        steps.append(along_paths.AlongPaths(polish))
    rests = problem.first_trim.is_rest or problem.last_trim(problem.goals[0]).is_rest
    alone_in_time = problem.horizon.time is not None and not rests  # words alone meet the time
    first_words = method == "auto" and (not problem.obstacles or alone_in_time)
    if linked and (first_words or not searched):
        steps.append(LinkedWords())
    on_nodes = automaton.lattice is not None and not automaton.body_velocities.any() and searched
    if maneuver_words.only_maneuvers_turn(automaton) and not on_nodes:  # there it is by chance
        steps.append(TurnedByManeuvers())
    if linked and searched:
        steps.append(lattice_words.LatticeWords(polish))
    if polish:
        steps.append(polish)
    steps.append(BestTimes())
    return Steps(steps, POLISHED, certified=invariant)


def prepare_steps(problem: Problem, workspace: Workspace) -> None:
    """Have ready what the steps of a problem need, before the clock runs."""
    if problem.obstacles or problem.zones:
        load_checking()  # what is imported in the first check would make it late
    if problem.has_states:
        from_state.FromState(answer, prepare_steps).prepare(problem, workspace)
        return
    if _may_be_a_graph(problem) and on_state_lattice.OnStateLattice().prepare(problem, workspace):
        return
    for step in search_steps(problem).steps:
        step.prepare(problem, workspace)


def _may_be_a_graph(problem: Problem) -> bool:
    # A graph is searched to a proof, for which the prices of places are not exact enough.
    searched = problem.search.method in ("auto", "lattice") and not problem.place_costs
    return problem.automaton.lattice is not None and searched


def uses_lattice(problem: Problem) -> bool:
    """Whether the lattice plans: it was asked for, or there is something in the way.

    In the plane it needs two trims that move, one of which turns or leads to another side; and a
    rest where the time is fixed. Otherwise words are searched, and those that meet obstacles are
    refused.
    """
    method, automaton = problem.search.method, problem.automaton
    placed = bool(problem.place_costs) and method in ("auto", "lattice")
    climbs = problem.start.size > 3 and automaton.is_kinematic
    if problem.climbs_among_obstacles or (climbs and placed):
        return True
    steers, rests = _steers(automaton)
    if not steers or (problem.horizon.time is not None and not rests):
        return False
    return placed or method == "lattice" or (method == "auto" and bool(problem.obstacles))


@kept_by_first
def _steers(automaton: Automaton) -> tuple[bool, bool]:
    """Whether trims lead to more than one side in the plane, and whether any stands still."""
    velocities = automaton.body_velocities
    moving = velocities[velocities.any(axis=1)]
    sides = moving[:, 2].any() or np.linalg.matrix_rank(moving[:, :2]) == 2
    steers = len(moving) > 1 and bool(sides) and velocities.shape[1] == 3
    return steers, len(moving) < len(velocities)


class FreeEnds(PlanningStep):
    """Tell where no vehicle can be; where all ends are free, begin the search of the lattice."""

    def offer(self, found: Incumbents) -> None:
        """Offer nothing, but a verdict."""
        problem, ended = found.problem, found.ended
        if uses_lattice(problem):
            ended.begun = beginning.begin(problem, found.workspace.prepared, found.budget)
        if ended.begun is None:
            ended.verdict = blocked_ends(problem) or goals_off_lattice(problem)
            ended.is_complete = ended.verdict is not None


class NearlyMet(PlanningStep):
    """What meets a goal for the checks, however far an exact end is from it."""

    def offer(self, found: Incumbents) -> None:
        """Offer the first that passes the checks."""
        found.offer_nearly_met()


class BestTimes(PlanningStep):
    """The cheapest plan with the best of its coasting times, by what its places cost."""

    def offer(self, found: Incumbents) -> None:
        """Offer such plans as long as they save enough; they are checked as others are."""
        placed, improves = found.problem.place_costs, found.problem.search.improve
        if not (placed and improves and found.plans) or found.budget.is_over:
            return
        before = math.inf
        while found.cost < before * (1.0 - SAVING) and found.may_check:
            before, best = found.cost, found.plans[0]
            goal = found.problem.goals[best.goal_index]
            within, problem = found.for_better, found.problem
            better = relaxed_end.with_relaxed_end(problem, best.plan, goal, budget=within)
            if better is not None and found.may_check:
                found.offer(better, best.goal_index, proven=False)


class Checks(PlanningStep):
    """Have the map ready for checks, where plans are checked as they come."""

    def prepare(self, problem: Problem, workspace: Workspace) -> None:
        """Import what checks, and price the maneuvers, which bounds and certificates need."""
        load_checking()
        if problem.automaton.maneuvers:
            load_kernels("times")
            bounds.least_price_per_metre(problem.automaton, problem.cost)

    def offer(self, found: Incumbents) -> None:
        """Offer nothing."""
        if not found.budget.is_over:
            load_checks(found.problem, found.workspace)


def _why_none(found: Incumbents) -> tuple[PlanStatus, str]:
    """How it ended where no plan was accepted, and why."""
    first = found.ended.lattice
    proof = found.ended.proof or (first.enclosed if first else "")
    proof = proof or ("" if found.problem.has_inertia else why_impossible(found.problem))
    if proof:
        return PlanStatus.UNREACHABLE, proof
    if why := found.why_none():
        return why
    if unlinked := _why_unlinked(found.problem):
        return PlanStatus.NO_PLAN, unlinked
    near = ""
    if first and math.isfinite(first.nearest[0]):
        near = "; the nearest node is {:.3g} m and {:.3g} rad off".format(*first.nearest)
    if first and first.exhausted:
        return PlanStatus.NO_PLAN, f"none at any resolution tried, which proves nothing{near}"
    spent = f"{found.counts['expansions']} expansions" if first else "the expansions allowed"
    return PlanStatus.OUT_OF_BUDGET, (
        f"no plan within {found.budget.seconds:.4g} s and {spent}{found.ended.remark}{near}"
    )


def _why_unlinked(problem: Problem) -> str:
    """Why no word of the library may lead to a goal, by its trims alone; empty if some may."""
    automaton = problem.automaton
    if problem.has_states:
        return ""
    start, lasts = problem.first_trim, [problem.last_trim(goal) for goal in problem.goals]
    index = automaton.index_of
    ends = [index(one.name) for one in lasts]
    between = validation.trims_between(automaton, index(start.name), ends)
    if not between.size:
        named = " or ".join(dict.fromkeys(repr(one.name) for one in lasts))
        return f"no maneuvers of the library lead from trim {start.name!r} to {named}"
    if automaton.maneuvers or between.size > 1:
        return ""
    hit = " or meets an obstacle" if problem.obstacles or problem.zones else ""
    return (
        f"the library has no maneuvers, and to coast in trim {start.name!r} leads to no goal{hit}"
    )

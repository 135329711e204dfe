"""Plans among obstacles of vehicles that climb and switch at will between their trims.

A kinematic vehicle is the maneuver automaton whose transitions are identities, so the search over
trims and maneuvers, which knows heights, serves it as it is. It begins in any trim that lasts no
time. Beside what it finds, words of free space that hit nothing are looked at.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.same_motion import UNFINISHED
from maneuver_automaton.planning.blocked import open_goals
from maneuver_automaton.planning.checking import load_checks
from maneuver_automaton.planning.detours import with_stones
from maneuver_automaton.planning.incumbents import Incumbents
from maneuver_automaton.planning.result import PlanResult, PlanStatus
from maneuver_automaton.planning.workspace import Workspace
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.refinement.fitting import without_nothing
from maneuver_automaton.refinement.maneuver_lattice import maneuver_words
from maneuver_automaton.refinement.maneuver_lattice import plan_of as plan_of_maneuvers
from maneuver_automaton.refinement.ready import load_maneuver_kernels
from maneuver_automaton.refinement.relaxed_end import with_relaxed_end
from maneuver_automaton.search.budget import Budget
from maneuver_automaton.search.choose import load_search, search_goal
from maneuver_automaton.search.lattice_query import LatticeQuery, lattice_query
from maneuver_automaton.search.limits import closed_bound, why_impossible
from maneuver_automaton.search.result import SearchStatus, plan_of

WORDS = 24  # of free space that are looked at, for all goals together
FEWEST_WORDS = 2  # for each goal
WORDS_SHARE = 0.2  # of the time that they may take
DETOURS_SHARE = 0.5  # of the time, for other ways, where they are asked for
HEADINGS = 16  # that are aimed at where the goal's heading is free


def climbs_among_obstacles(problem: Problem) -> bool:
    """Whether a vehicle that switches at will has more than a plane, and something is in its way.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Disc, Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1.0, 0.0), "left": (0.0, 1.0)})
    >>> climbs_among_obstacles(Problem(robot, [0, 0, 0], [9, 0, 0], obstacles=Disc(1.0, [4, 0])))
    False
    """
    in_space = problem.start.size > 3 and problem.automaton.is_kinematic
    return in_space and bool(problem.obstacles) and problem.search.method in ("auto", "lattice")


def load_in_space(problem: Problem) -> None:
    """Compile or load what `plan_in_space` needs, before the clock runs."""
    load_search(problem)
    load_maneuver_kernels()


def plan_in_space(
    problem: Problem, budget: Budget, workspace: Workspace, /, *, alternatives: int
) -> PlanResult:
    """The cheapest plan found that no obstacle of its heights is in the way of."""
    found = Incumbents(problem, budget, workspace.on(problem.obstacles), alternatives, UNFINISHED)
    found.counts.update(expansions=0)
    load_checks(problem, found.workspace)
    goals = open_goals(problem)
    lattice = _Lattice(found, goals)
    share = DETOURS_SHARE if alternatives else 0.0
    first = lattice.plans(problem, budget.part(1.0 - share))
    for plan, index in itertools.chain(_words(found, goals), first, _detours(lattice)):
        found.offer(plan, index)
        if found.plans and budget.is_over:
            break
    found.counts["rejected"] = found.rejected
    if not found.plans:
        return found.none(*_why_none(found, exhausted=lattice.exhausted))
    return found.found(bound=min(closed_bound(problem, goal) for goal in problem.goals))


def _words(found: Incumbents, goals: tuple[int, ...]) -> Iterator[tuple[Plan, int]]:
    """Words of free space, and the goals they reach."""
    problem = found.problem
    words = max(FEWEST_WORDS, WORDS // max(1, len(goals)))
    for index in goals:
        for result in search_goal(
            problem,
            problem.goals[index],
            alternatives=words - 1,
            time_limit=WORDS_SHARE * found.budget.left / len(goals),
        ):
            for word in result.solutions[:words]:
                yield plan_of(problem, word), index


@dataclass(slots=True, eq=False)
class _Lattice:
    """The search over trims and maneuvers, and whether it came to an end."""

    found: Incumbents
    goals: tuple[int, ...]
    exhausted: bool = False

    def plans(self, problem: Problem, budget: Budget) -> Iterator[tuple[Plan, int]]:
        """Plans as they are found, each also with its best times, and the goals they reach."""
        found = self.found
        query, numbers = _query(found, problem, self.goals)
        before = found.counts["expansions"]
        for incumbent in maneuver_words(
            query, deadline=budget.deadline, max_expansions=budget.expansions
        ):
            found.counts["expansions"] = before + incumbent.expansions
            if incumbent.word is None:
                self.exhausted = incumbent.status is SearchStatus.EXHAUSTED
                continue
            index = numbers[incumbent.word.goal]
            plan = without_nothing(replace(plan_of_maneuvers(query, incumbent.word), maneuvers=()))
            better = with_relaxed_end(problem, plan, problem.goals[index])
            if better is not None:
                yield better, index
            yield _in_time(problem, plan), index


def _detours(lattice: _Lattice) -> Iterator[tuple[Plan, int]]:
    """Plans on other ways, as long as there are too few: a stone closes the one that is known."""
    found = lattice.found
    known = found.plans[:1]
    for one in known:
        closed = list(with_stones(found.problem, one.plan))
        for k, problem in enumerate(closed):
            if len(found.plans) > found.alternatives or found.budget.is_over:
                return
            yield from lattice.plans(problem, found.budget.part(1.0 / (len(closed) - k)))


def _in_time(problem: Problem, plan: Plan) -> Plan:
    """The plan with a rest at its end that fills a fixed time."""
    fixed, rest = problem.horizon.time, problem.automaton.rest
    if fixed is None or rest is None or plan.duration >= fixed:
        return plan
    trims = (*plan.trims, problem.automaton.trims[rest])
    return replace(plan, trims=trims, durations=np.append(plan.durations, fixed - plan.duration))


def _why_none(found: Incumbents, *, exhausted: bool) -> tuple[PlanStatus, str]:
    """The verdict where nothing was accepted."""
    impossible = why_impossible(found.problem)
    if impossible:
        return PlanStatus.UNREACHABLE, impossible
    refused = f"; plans were refused: {found.why_refused}" if found.why_refused else ""
    if exhausted:
        return PlanStatus.NO_PLAN, f"none at any resolution tried, which proves nothing{refused}"
    return PlanStatus.OUT_OF_BUDGET, (
        f"no plan within {found.budget.seconds:g} s and {found.counts['expansions']} "
        f"expansions{refused}"
    )


def _query(
    found: Incumbents, problem: Problem, goals: tuple[int, ...]
) -> tuple[LatticeQuery, list[int]]:
    """What the search over trims and maneuvers is asked, and which goal each of its aims is."""
    aims = list[Goal]()
    numbers: list[int] = []
    any_trim = problem.automaton.trim_names[0]
    for index in goals:
        goal = problem.goals[index]
        for pose in _headings(goal):
            aims.append(replace(goal, pose=pose, trim=any_trim, free_heading=False))
            numbers.append(index)
    aimed = replace(problem, goals=tuple(aims), start_trim=any_trim)
    query = lattice_query(aimed, range(len(aims)), prepared=found.workspace.prepared)
    return query, numbers


def _headings(goal: Goal) -> Iterator[Array]:
    """The pose of a goal, turned to several headings where any will do."""
    for k in range(HEADINGS if goal.free_heading else 1):
        pose = np.array(goal.pose)
        pose[2] += k * 2.0 * math.pi / HEADINGS
        yield pose

"""Plans among obstacles of vehicles that climb and switch at will between their trims.

A kinematic vehicle is the maneuver automaton whose transitions are identities, so the search over
trims and maneuvers, which knows heights, serves it as it is. It begins in any trim that lasts no
time. Beside what it finds, words of free space that hit nothing are looked at.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.same_motion import UNFINISHED, is_new
from maneuver_automaton.planning.blocked import why_goal_blocked
from maneuver_automaton.planning.checking import check_plan, load_checks
from maneuver_automaton.planning.result import Accepted, PlanResult, PlanStatus, found_plans
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.refinement.fitting import without_nothing
from maneuver_automaton.refinement.relaxed_end import with_relaxed_end
from maneuver_automaton.search.choose import load_search, search_goal
from maneuver_automaton.search.limits import closed_bound, why_impossible
from maneuver_automaton.search.maneuver_lattice import maneuver_words
from maneuver_automaton.search.maneuver_lattice import plan_of as plan_of_maneuvers
from maneuver_automaton.search.maneuver_problem import maneuver_problem_query
from maneuver_automaton.search.maneuver_query import ManeuverQuery
from maneuver_automaton.search.maneuver_ready import load_maneuver_kernels
from maneuver_automaton.search.result import SearchStatus, plan_of

WORDS = 24  # of free space that are looked at, for all goals together
FEWEST_WORDS = 2  # for each goal
WORDS_SHARE = 0.2  # of the time that they may take
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
    problem: Problem, *, began: float, time_limit: float, alternatives: int
) -> PlanResult:
    """The cheapest plan found that no obstacle of its heights is in the way of; all were audited.

    The time limit [s] counts from `began`, as `time.monotonic` does.
    """
    work = _Work(problem, began, began + time_limit)
    load_checks(problem)
    for plan, index in work.candidates():
        work.check(plan, index)
        if work.accepted and time.monotonic() > work.deadline:
            break
    done = time.monotonic()
    timing = {"search": done - began - work.checking, "refine": 0.0, "audit": work.checking}
    if not work.accepted:
        status, reason = work.why_none(time_limit)
        return PlanResult(
            problem=problem, status=status, reason=reason, timing_s=timing, counts=work.counts
        )
    timing["first_plan"] = work.improvements[0][0]
    kept: list[Accepted] = []
    for one in sorted(work.accepted, key=lambda one: one.cost):
        known = [other.plan for other in kept]
        if len(kept) <= alternatives and is_new(one.plan, known, UNFINISHED):
            kept.append(one)
    return found_plans(
        problem,
        kept,
        bound=min(closed_bound(problem, goal) for goal in problem.goals),
        timing_s=timing,
        counts=work.counts,
        improvements=tuple(work.improvements),
    )


@dataclass(slots=True, eq=False)
class _Work:
    """What was found so far, and what it took."""

    problem: Problem
    began: float
    deadline: float
    accepted: list[Accepted] = field(default_factory=list)
    improvements: list[tuple[float, float]] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=lambda: {"expansions": 0, "rejected": 0})
    checking: float = 0.0
    refused: str = ""
    exhausted: bool = False

    def candidates(self) -> Iterator[tuple[Plan, int]]:
        """Plans as they are found, and the goals they reach."""
        goals = tuple(
            k
            for k, goal in enumerate(self.problem.goals)
            if not why_goal_blocked(self.problem, goal)
        )
        words = max(FEWEST_WORDS, WORDS // max(1, len(goals)))
        for index in goals:
            left = WORDS_SHARE * (self.deadline - time.monotonic()) / len(goals)
            for found in search_goal(
                self.problem, self.problem.goals[index], alternatives=words - 1, time_limit=left
            ):
                for solution in found.solutions[:words]:
                    yield plan_of(self.problem, solution), index
        yield from self._on_lattice(goals)

    def _on_lattice(self, goals: tuple[int, ...]) -> Iterator[tuple[Plan, int]]:
        problem = self.problem
        query, numbers = _query(problem, goals)
        most = problem.search.max_expansions
        before = self.counts["expansions"]
        for found in maneuver_words(query, deadline=self.deadline, max_expansions=most):
            self.counts["expansions"] = before + found.expansions
            if found.word is None:
                self.exhausted = found.status is SearchStatus.EXHAUSTED
                continue
            index = numbers[found.word.goal]
            plan = without_nothing(replace(plan_of_maneuvers(query, found.word), maneuvers=()))
            yield from self._in_time(plan, index)

    def _in_time(self, plan: Plan, index: int) -> Iterator[tuple[Plan, int]]:
        """A plan, and the same word with its best times, which last as long as is asked for."""
        goal = self.problem.goals[index]
        better = with_relaxed_end(self.problem, plan, goal)
        if better is not None:
            yield better, index
        fixed, rest = self.problem.horizon.time, self.problem.automaton.rest
        if fixed is not None and rest is not None and plan.duration < fixed:
            trims = (*plan.trims, self.problem.automaton.trims[rest])
            padded = np.append(plan.durations, fixed - plan.duration)
            plan = replace(plan, trims=trims, durations=padded)
        yield plan, index

    def check(self, plan: Plan, index: int) -> None:
        """Keep a plan if it passes every check."""
        begin = time.monotonic()
        checked = check_plan(self.problem, plan, self.problem.goals[index])
        now = time.monotonic()
        self.checking += now - begin
        if checked.audit is None or not checked.passed:
            self.counts["rejected"] += 1
            self.refused = self.refused or checked.reason
            return
        cost = self.problem.cost_of(plan)
        if cost < min((one.cost for one in self.accepted), default=math.inf):
            self.improvements.append((now - self.began, cost))
        self.accepted.append(Accepted(plan=plan, goal_index=index, cost=cost, audit=checked.audit))

    def why_none(self, time_limit: float) -> tuple[PlanStatus, str]:
        """The verdict where nothing was accepted."""
        impossible = why_impossible(self.problem)
        if impossible:
            return PlanStatus.UNREACHABLE, impossible
        refused = f"; plans were refused: {self.refused}" if self.refused else ""
        if self.exhausted:
            return PlanStatus.NO_PLAN, (
                f"none at any resolution tried, which proves nothing{refused}"
            )
        return PlanStatus.OUT_OF_BUDGET, (
            f"no plan within {time_limit:g} s and {self.counts['expansions']} expansions{refused}"
        )


def _query(problem: Problem, goals: tuple[int, ...]) -> tuple[ManeuverQuery, list[int]]:
    """What the search over trims and maneuvers is asked, and which goal each of its aims is."""
    aims: list[Goal] = []
    numbers: list[int] = []
    any_trim = problem.automaton.trim_names[0]
    for index in goals:
        goal = problem.goals[index]
        for pose in _headings(goal):
            aims.append(replace(goal, pose=pose, trim=any_trim, free_heading=False))
            numbers.append(index)
    aimed = replace(problem, goals=tuple(aims), start_trim=any_trim)
    return maneuver_problem_query(aimed, tuple(range(len(aims)))), numbers


def _headings(goal: Goal) -> Iterator[Array]:
    """The pose of a goal, turned to several headings where any will do."""
    for k in range(HEADINGS if goal.free_heading else 1):
        pose = np.array(goal.pose)
        pose[2] += k * 2.0 * math.pi / HEADINGS
        yield pose

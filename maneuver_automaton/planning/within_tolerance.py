"""Plans that end anywhere within the tolerance of their goal, for every search there is.

A search aims at poses. It is asked for the goal itself and for a few poses within its tolerance:
towards the start, around, and turned to both sides. The end of what it finds is then let loose: the
coasting times of its word are solved for once more, and the end must be within the tolerance only.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Protocol, TypeVar

import numpy as np

from maneuver_automaton._arrays import Array, wrapped
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.headings import trim_headings
from maneuver_automaton.automaton.same_motion import is_new
from maneuver_automaton.planning.blocked import why_goal_blocked
from maneuver_automaton.planning.checking import check_plan
from maneuver_automaton.planning.result import Accepted, PlanResult, PlanStatus, found_plans
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.refinement.relaxed_end import with_relaxed_end
from maneuver_automaton.search.limits import closed_bound, why_impossible

INSIDE = 1e-6  # share of a tolerance by which poses that are aimed at stay within it
AROUND = 4  # directions in which poses at a distance lie, the first towards the start
DENSE = 16  # the same where the goal itself is blocked
RINGS = (1.0, 0.5)  # shares of the tolerance at which these lie
MOST_AIMS = 12  # poses that are aimed at where the goal itself is blocked
SHARES = (1.0, 0.5, 0.25)  # of the tolerance that an end may use, until it is free
LATER = (0.45, 0.8)  # shares of the time left for the first question, and for the second of three
MOST_LAST = 4  # trims at the end whose times alone are changed where all of them hit something
SPARE = 3  # plans asked for each alternative: with loose ends some are one motion


T = TypeVar("T", int, float)


class Answer(Protocol):
    """A planner of problems whose goals are met exactly."""

    def __call__(
        self, problem: Problem, /, *, began: float, time_limit: float, alternatives: int
    ) -> PlanResult:
        """The cheapest plan found."""
        ...


def has_tolerance(problem: Problem) -> bool:
    """Whether a plan may end beside a goal."""
    return any(goal.tolerance_m > 0.0 or goal.tolerance_rad > 0.0 for goal in problem.goals)


def plan_within_tolerance(
    problem: Problem, answer: Answer, *, began: float, time_limit: float, alternatives: int
) -> PlanResult:
    """The cheapest plan found that ends within the tolerance of a goal; every one was audited.

    The time limit [s] counts from `began`, as `time.monotonic` does.
    """
    asked = list(_questions(problem))
    results: list[PlanResult] = []
    improvements: list[tuple[float, float]] = []
    for k, question in enumerate(asked):
        now = time.monotonic()
        share = 1.0 if k == len(asked) - 1 else LATER[k]
        left = share * max(began + time_limit - now, 1e-3)
        result = answer(question, began=now, time_limit=left, alternatives=SPARE * alternatives)
        results.append(result)
        best = improvements[-1][1] if improvements else math.inf
        found = [(now - began + at, cost) for at, cost in result.improvements if cost < best]
        improvements += found
    counts = _sums(result.counts for result in results)
    timing = _sums(result.timing_s for result in results)
    begin = time.monotonic()
    accepted: list[Accepted] = []
    reason = ""
    for result in results:
        if result.plan is None:
            continue
        for plan in (result.plan, *(other.plan for other in result.alternatives)):
            one, why = _loosened(problem, plan)
            reason = reason or why
            if one is not None:
                accepted.append(one)
    if not accepted:
        timing.pop("first_plan", None)
        return _none(problem, results[0], reason, timing, counts)
    accepted.sort(key=lambda one: one.cost)
    kept: list[Accepted] = []
    for one in accepted:
        if len(kept) <= alternatives and is_new(one.plan, (other.plan for other in kept)):
            kept.append(one)
    done = time.monotonic()
    timing["refine"] = timing.get("refine", 0.0) + done - begin
    timing["first_plan"] = next(
        result.timing_s["first_plan"] for result in results if "first_plan" in result.timing_s
    )
    if improvements and kept[0].cost < improvements[-1][1]:
        improvements.append((done - began, kept[0].cost))
    return found_plans(
        problem,
        kept,
        bound=_lower_bound(problem, results[0]),
        timing_s=timing,
        counts=counts,
        improvements=tuple(improvements),
        nodes=results[0].nodes,
    )


def _questions(problem: Problem) -> Iterator[Problem]:
    """The goals themselves where a plan may end there, the poses nearest to the start, all others.

    Each has its share of the time and of the expansions: many aims at once would take from the
    searches that improve one plan what they need, and cost more than the exact goal alone.
    """
    aims = list(_aims(problem))
    exact, beside = tuple(aims[: len(problem.goals)]), tuple(aims[len(problem.goals) :])
    near, others = beside[:1], beside[1:]
    blocked = all(why_goal_blocked(problem, goal) for goal in exact)
    asked = [goals for goals in (() if blocked and beside else exact, near, others) if goals]
    most = problem.search.max_expansions
    share = None if most is None else max(1, most // len(asked))
    for goals in asked:
        yield replace(problem, goals=goals, search=replace(problem.search, max_expansions=share))


def _lower_bound(problem: Problem, exact: PlanResult) -> float:
    """No plan that ends within a tolerance is cheaper: bounds count it for the goals themselves."""
    if exact.lower_bound is not None and exact.problem.goals == problem.goals:
        return exact.lower_bound
    return min(closed_bound(problem, goal) for goal in problem.goals)


def _sums(rows: Iterable[dict[str, T]]) -> dict[str, T]:
    """Sums by name."""
    sums: dict[str, T] = {}
    for row in rows:
        for name, value in row.items():
            sums[name] = sums[name] + value if name in sums else value
    return sums


def _aims(problem: Problem) -> Iterator[Goal]:
    """The goals themselves, then poses within their tolerances that are aimed at exactly."""
    yield from problem.goals
    for goal in problem.goals:
        blocked = bool(why_goal_blocked(problem, goal))
        poses = list(_poses_within(goal, problem.start, AROUND, RINGS[:1]))
        if blocked:
            poses += _poses_within(goal, problem.start, DENSE, RINGS)
        if trim_headings(problem.automaton) is not None:  # a trim keeps its heading
            poses = [pose for pose in poses if pose[2] == goal.pose[2]]
        aims = [replace(goal, pose=pose, tolerance_m=0.0, tolerance_rad=0.0) for pose in poses]
        if blocked:
            aims = [aim for aim in aims if not why_goal_blocked(problem, aim)][:MOST_AIMS]
        yield from aims


def _poses_within(
    goal: Goal, start: Array, directions: int, rings: tuple[float, ...]
) -> Iterator[Array]:
    """Poses (dof,) within the tolerance of a goal, those nearer to the start first."""
    far, turned = ((1.0 - INSIDE) * value for value in (goal.tolerance_m, goal.tolerance_rad))
    places = [0, 1, *range(3, start.size)]
    way = start[places] - goal.pose[places]
    distance = float(np.linalg.norm(way))
    turn = float(wrapped(start[2] - goal.pose[2]))
    if distance <= far and (goal.free_heading or abs(turn) <= turned):
        yield np.array(start)  # it is there already
    if goal.free_heading or abs(turn) <= turned:  # straight ahead: some libraries know no other way
        ahead = np.array([math.cos(start[2]), math.sin(start[2])])
        foot = np.array(start)
        foot[:2] -= (way[:2] @ ahead) * ahead
        if np.linalg.norm(foot[places] - goal.pose[places]) <= far:
            yield foot
    turns = [0.0]
    if turned and not goal.free_heading:
        turns = [float(np.clip(turn, -turned, turned)), turned, -turned, 0.0]
        turns = list(dict.fromkeys(turns))
    shifts = [np.zeros(len(places))]
    if far:
        towards = math.atan2(way[1], way[0])
        shifts = [way * min(1.0, far / distance)] if distance > 0.0 else []
        for share in rings:
            for k in range(1 if shifts else 0, directions):
                angle = towards + k * 2.0 * math.pi / directions
                shift = np.zeros(len(places))
                shift[:2] = share * far * np.array([math.cos(angle), math.sin(angle)])
                shifts.append(shift)
        shifts.append(np.zeros(len(places)))
    for n_th, shift in enumerate(shifts):
        for angle in turns if n_th in (0, len(shifts) - 1) or directions > AROUND else (0.0,):
            if shift.any() or angle:
                pose = np.array(goal.pose)
                pose[places] += shift
                pose[2] += angle
                yield pose


def _loosened(problem: Problem, plan: Plan) -> tuple[Accepted | None, str]:
    """The plan with the cheapest end within the tolerance that passes the checks; why not if none.

    Its own end, where no other is better.
    """
    reason = ""
    for index in _goals_met(problem, plan):
        goal = problem.goals[index]
        for candidate in _with_loose_ends(problem, plan, goal):
            checked = check_plan(problem, candidate, goal)
            if checked.audit is not None and checked.passed:
                cost = problem.cost_of(candidate)
                return (
                    Accepted(plan=candidate, goal_index=index, cost=cost, audit=checked.audit),
                    "",
                )
            reason = reason or checked.reason
    return None, reason


def _with_loose_ends(problem: Problem, plan: Plan, goal: Goal) -> list[Plan]:
    """The plan with other coasting times, all of them or the last ones, the cheapest first.

    Where nothing is in the way the times of the whole word are the best there are.
    """
    guarded = bool(problem.obstacles or problem.zones or not problem.bounds.are_open)
    n = len(plan.trims)
    firsts = sorted({0, *range(max(0, n - MOST_LAST), n)}) if guarded else [0]
    loose = [
        with_relaxed_end(problem, plan, goal, share=share, first=first)
        for first in firsts
        for share in (SHARES if guarded else SHARES[:1])
    ]
    return sorted([plan, *(one for one in loose if one is not None)], key=problem.cost_of)


def _goals_met(problem: Problem, plan: Plan) -> Iterator[int]:
    """Goals within whose tolerance a plan ends, the nearest first."""
    off = [goal.off(plan.end) for goal in problem.goals]
    for index in sorted(range(len(off)), key=lambda k: sum(off[k])):
        goal, (way, turn) = problem.goals[index], off[index]
        slack = 1e-9 * (1.0 + float(np.abs(plan.end).max()))
        if way <= goal.tolerance_m + slack and turn <= goal.tolerance_rad + slack:
            yield index


def _none(
    problem: Problem,
    result: PlanResult,
    refused: str,
    timing: dict[str, float],
    counts: dict[str, int],
) -> PlanResult:
    """The verdict on the poses that were aimed at, as far as it holds for all within tolerance."""
    status, reason = result.status, result.reason
    if refused:
        status, reason = PlanStatus.NO_PLAN, f"every plan found was refused: {refused}"
    elif status is PlanStatus.UNREACHABLE and not why_impossible(problem):
        status = PlanStatus.NO_PLAN  # proven for these poses alone
    return PlanResult(problem=problem, status=status, reason=reason, timing_s=timing, counts=counts)

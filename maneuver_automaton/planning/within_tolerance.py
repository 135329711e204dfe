"""Plans that end anywhere within the tolerance of their goal, for every search there is.

A search aims at poses. It is asked for the goal itself and for a few poses within its tolerance:
towards the start, around, and turned to both sides; where none of these is free, for one that boxes
of poses show to be. The end of what it finds is then let loose: the coasting times of its word are
solved for once more, and the end must be within the tolerance only.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton._arrays import Array, wrapped
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.headings import trim_headings
from maneuver_automaton.automaton.same_motion import CONVERGED
from maneuver_automaton.budget import Budget
from maneuver_automaton.planning.blocked import proven_free, why_goal_blocked
from maneuver_automaton.planning.bounds import formula_bound
from maneuver_automaton.planning.incumbents import Incumbents, PlanningStep
from maneuver_automaton.planning.no_way import free_ends
from maneuver_automaton.planning.result import Answer, PlanResult, PlanStatus
from maneuver_automaton.problem import Goal, Problem, moves
from maneuver_automaton.refinement.relaxed_end import with_relaxed_end
from maneuver_automaton.search.lattice_goals import nodes_within
from maneuver_automaton.search.limits import why_impossible

INSIDE = 1e-6  # share of a tolerance by which poses that are aimed at stay within it
AROUND = 4  # directions in which poses at a distance lie, the first towards the start
MOST_NODES = 32  # of a lattice that are aimed at for each goal
MOST_AIMS = 12  # poses that are aimed at where the goal itself is blocked
SPREAD, FEW = 4096, 32  # poses all over the tolerance of one in the plane, and in space
STEPS = 0.8191725134, 0.6710436067, 0.5497004779  # whose multiples cut each unit interval evenly
SHARES = (1.0, 0.5, 0.25)  # of the tolerance that an end may use, until it is free
LATER = (0.45, 0.8, 0.8)  # shares of the time left for each question but the last
MOST_LAST = 4  # trims at the end whose times alone are changed where all of them hit something
LOOSENED_SHARE = 0.1  # of the time, that is kept back for letting ends loose
SPARE = 3  # plans asked for each alternative: with loose ends some are one motion


@dataclass(frozen=True, slots=True, eq=False)
class WithinTolerance(PlanningStep):
    """Plans that end within the tolerance of a goal, by `answer` to simpler questions."""

    answer: Answer

    def offer(self, found: Incumbents) -> None:
        """Offer the answers, their ends let loose."""
        problem, budget, ended = found.problem, found.budget, found.ended
        found.likeness, ended.is_complete = CONVERGED, True
        results: dict[int, PlanResult] = {}

        def offer(result: PlanResult) -> None:
            assert result.plan is not None
            any(found.offer(result.plan, index) for index in _goals_met(problem, result.plan))

        questions, ends_blocked = _questions(problem, budget)
        turns = found.ask(
            questions,
            self.answer,
            offer,
            budget=budget.before(LOOSENED_SHARE * budget.seconds),
            alternatives=SPARE * found.alternatives,
            shares=LATER,
        )
        for k, result, _ in turns:
            results[k] = result
            for at, cost in result.improvements:
                found.note(cost, at=at)
            for plan in filter(None, (result.plan, *(one.plan for one in result.alternatives))):
                for index in _goals_met(problem, plan):
                    loose = _with_loose_ends(problem, plan, problem.goals[index], found.for_better)
                    if any(not found.may_check or found.offer(one, index) for one in loose):
                        break  # with the cheapest end that passes
        exact = results[0]
        if not found.plans:
            ended.why = _why_none(found, results, ends_blocked)
            return
        bound = exact.bound if exact.problem.goals == problem.goals else None
        formula = None if problem.has_inertia else formula_bound(problem)  # trims may be slow
        ended.bound, ended.nodes = ended.bound or bound or formula, exact.nodes


def _questions(problem: Problem, budget: Budget) -> tuple[list[Problem], bool]:
    """The goals where a plan may end there, then the poses nearest to the start, all others."""
    # Also whether every pose within the tolerances is proven to collide.
    lattice, proven = problem.automaton.lattice is not None, False
    if lattice:
        nodes = (nodes_within(problem, goal)[:MOST_NODES] for goal in problem.goals)
        exact, beside = tuple(itertools.chain(*nodes)) or problem.goals, tuple[Goal, ...]()
        blocked = all(why_goal_blocked(problem, goal) for goal in exact)
    else:
        touching = [bool(why_goal_blocked(problem, goal)) for goal in problem.goals]
        exact, beside = problem.goals, tuple(_aims(problem, touching))
        blocked = all(touching)
    if blocked and not beside:
        ends = free_ends(problem, budget)
        proven = all(end is None for end in ends)
        shown = [
            aim
            for goal, end in zip(problem.goals, ends, strict=True)
            if end is not None and math.isfinite(end[0])
            for aim in _exactly(problem, goal, [np.append(end, goal.pose[3:])])
        ]
        free = tuple(aim for aim in shown if not why_goal_blocked(problem, aim))
        beside = () if lattice else free
    first = () if blocked and beside else exact
    asked = [goals for goals in (first, beside[:1], beside[1:]) if goals]
    most = problem.search.max_expansions
    share = None if most is None else max(1, most // len(asked))
    search = replace(problem.search, max_expansions=share)
    return [replace(problem, goals=goals, search=search) for goals in asked], proven


def _aims(problem: Problem, blocked: Sequence[bool]) -> Iterator[Goal]:
    """Poses within the tolerances of goals that are aimed at exactly."""
    for goal, is_blocked in zip(problem.goals, blocked, strict=True):
        if is_blocked:
            yield from itertools.islice(free_aims(problem, goal), MOST_AIMS)
        else:
            yield from _exactly(problem, goal, _poses_within(goal, problem.start))


def free_aims(problem: Problem, goal: Goal) -> Iterator[Goal]:
    """Poses within the tolerance of a goal that is blocked itself, clear of all that stands.

    In the plane the kernels look at thousands of them at once: shapely takes 10 to 50 ms for each.
    """
    if problem.automaton.lattice is not None:
        aims: Iterable[Goal] = nodes_within(problem, goal)[:MOST_NODES]
    else:
        poses = np.array([*_poses_within(goal, problem.start), *_spread(problem, goal)])
        if problem.start.size == 3:
            still = tuple(one for one in problem.obstacles if not moves(one))
            poses = poses[proven_free(replace(problem, obstacles=still), poses)]
        aims = _exactly(problem, goal, poses)
    return (aim for aim in aims if not why_goal_blocked(problem, aim))


def _spread(problem: Problem, goal: Goal) -> Array:
    """Poses (n, dof) spread evenly over the tolerance of a goal, by additive recurrences."""
    # Source: Roberts (2018), The unreasonable effectiveness of quasirandom sequences.
    n = SPREAD if goal.pose.size == 3 else FEW
    far, angle, turn = (np.outer(np.arange(1.0, n + 1.0), STEPS) % 1.0).T
    off = goal.tolerance_m * np.sqrt(far) * np.exp(1j * (goal.pose[2] + 2.0 * math.pi * angle))
    poses = np.tile(goal.pose, (n, 1))
    poses[:, :2] += (1.0 - INSIDE) * np.column_stack([off.real, off.imag])
    if trim_headings(problem.automaton) is None:
        most = math.pi if goal.free_heading else (1.0 - INSIDE) * goal.tolerance_rad
        poses[:, 2] += most * (2.0 * turn - 1.0)
    return poses


def _exactly(problem: Problem, goal: Goal, poses: Iterable[Array]) -> Iterator[Goal]:
    """Poses as goals without a tolerance; only those at the goal's heading if trims keep theirs."""
    turns = trim_headings(problem.automaton) is None
    for pose in poses:
        if turns or pose[2] == goal.pose[2]:
            yield replace(goal, pose=pose, tolerance_m=0.0, tolerance_rad=0.0)


def _poses_within(goal: Goal, start: Array) -> Iterator[Array]:
    """Poses (dof,) within the tolerance of a goal, those nearer to the start first."""
    far, turned = ((1.0 - INSIDE) * value for value in (goal.tolerance_m, goal.tolerance_rad))
    places = [0, 1, *range(3, start.size)]
    offset = start[places] - goal.pose[places]
    distance = float(np.linalg.norm(offset))
    turn = float(wrapped(start[2] - goal.pose[2]))
    if distance <= far and (goal.free_heading or abs(turn) <= turned):
        yield np.array(start)  # it is there already
    if goal.free_heading or abs(turn) <= turned:  # straight ahead: some libraries lead nowhere else
        ahead = np.array([math.cos(start[2]), math.sin(start[2])])
        foot = np.array(start)
        foot[:2] -= (offset[:2] @ ahead) * ahead
        if np.linalg.norm(foot[places] - goal.pose[places]) <= far:
            yield foot
    turns = [0.0]
    if turned and not goal.free_heading:
        turns = [*dict.fromkeys([float(np.clip(turn, -turned, turned)), turned, -turned, 0.0])]
    shifts = [np.zeros(len(places))]
    if far:
        towards = math.atan2(offset[1], offset[0])
        shifts = [offset * min(1.0, far / distance)] if distance > 0.0 else []
        for k in range(1 if shifts else 0, AROUND):
            angle = towards + k * 2.0 * math.pi / AROUND
            shift = np.zeros(len(places))
            shift[:2] = far * np.array([math.cos(angle), math.sin(angle)])
            shifts.append(shift)
        shifts.append(np.zeros(len(places)))
    for n_th, shift in enumerate(shifts):
        for angle in turns if n_th in (0, len(shifts) - 1) else (0.0,):
            if shift.any() or angle:
                pose = np.array(goal.pose)
                pose[places] += shift
                pose[2] += angle
                yield pose


def _with_loose_ends(problem: Problem, plan: Plan, goal: Goal, budget: Budget) -> list[Plan]:
    """The plan with other coasting times, all of them or the last ones, the cheapest first."""
    if budget.is_over:
        return [plan]
    guarded = bool(problem.obstacles or problem.zones or not problem.bounds.are_open)
    n = len(plan.trims)
    firsts = sorted({0, *range(max(0, n - MOST_LAST), n)}) if guarded else [0]
    loose = [
        with_relaxed_end(problem, plan, goal, share=share, first=first, budget=budget)
        for first in firsts
        for share in (SHARES if guarded else SHARES[:1])
        if not budget.is_over
    ]
    return sorted([plan, *(one for one in loose if one is not None)], key=problem.cost_of)


def _goals_met(problem: Problem, plan: Plan) -> Iterator[int]:
    """Goals within whose tolerance a plan ends, the nearest first."""
    off = [goal.off(plan.end) for goal in problem.goals]
    for index in sorted(range(len(off)), key=lambda k: sum(off[k])):
        goal, (distance, turn) = problem.goals[index], off[index]
        slack = 1e-9 * (1.0 + float(np.abs(plan.end).max()))
        if distance <= goal.tolerance_m + slack and turn <= goal.tolerance_rad + slack:
            yield index


def _why_none(
    found: Incumbents, results: Mapping[int, PlanResult], ends_blocked: bool
) -> tuple[PlanStatus, str]:
    """The verdict on the poses that were aimed at, as far as it holds for all within tolerance."""
    exact = results[0]
    unreachable = exact.status is PlanStatus.UNREACHABLE
    if unreachable and why_impossible(found.problem):
        return exact.status, exact.reason
    if why := found.why_none(results.values()):
        return why
    if unreachable:
        return PlanStatus.NO_PLAN, exact.reason  # proven for these poses alone
    if exact.status is PlanStatus.GOAL_BLOCKED and not ends_blocked:
        return PlanStatus.NO_PLAN, f"no free pose was found within the tolerance: {exact.reason}"
    return exact.status, exact.reason

"""The rest of a plan: as it is, in another order, or made to meet its goal from elsewhere."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._kept import MOST
from maneuver_automaton._limits import FASTEST
from maneuver_automaton.automaton import Plan, Primitive
from maneuver_automaton.automaton.cutting import NOTHING, joined, last_times, tail_of
from maneuver_automaton.budget import UNLIMITED
from maneuver_automaton.costs import Cost
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.problem import Goal, Horizon, Problem
from maneuver_automaton.search.result import plan_of
from maneuver_automaton.search.setup import search_setup, sub_library
from maneuver_automaton.search.words import search_setup_words
from maneuver_automaton.words import TimesStatus, solve_switching_times


def rest_of(
    plan: Plan, after: float, *, start: Array | None = None, pad: Trim | None = None
) -> Plan:
    """The rest of a plan after `after` seconds, from `start` (dof,); `pad` makes it last as long.

    Of a maneuver under way its end remains. This is the plan that makes the loop recursively
    feasible: where the goal was to be met after T, it is met after T - `after`, and the vehicle
    rests there.

    Source: the paper, Sec. 4, after Algorithm 14.
    """
    if plan.maneuvers:
        left = without_nothing(tail_of(plan, after, start=start))
        return left if pad is None else rested(left, pad, after)
    times, at = last_times(plan.durations.tolist(), after), plan.start_time + after
    word, times = merged(plan.trims[len(plan.trims) - len(times) :], times)
    if pad is not None and after > NOTHING:
        word, times = _and_rest(word, times, pad, after)
    return Plan.of_parts(plan.pose_at(at) if start is None else start, word, times, start_time=at)


def rested(plan: Plan, pad: Trim, duration: float) -> Plan:
    """The plan with `duration` more seconds of rest: of the one it ends in, otherwise of `pad`."""
    if not duration > NOTHING:
        return plan
    word, times = _and_rest(plan.trims, plan.durations.tolist(), pad, duration)
    if not plan.maneuvers:
        return Plan.of_parts(plan.start, *merged(word, times), start_time=plan.start_time)
    between = (*plan.maneuvers, None)[: len(word) - 1]
    return without_nothing(replace(plan, trims=word, durations=np.array(times), maneuvers=between))


def _and_rest(
    word: tuple[Trim, ...], times: list[float], pad: Trim, duration: float
) -> tuple[tuple[Trim, ...], list[float]]:
    if word and word[-1].is_rest:
        return word, [*times[:-1], times[-1] + duration]
    return (*word, pad), [*times, duration]


def followed_by(first: Plan, second: Plan) -> Plan:
    """One plan, then another that begins where the first one ends."""
    if not first.trims:
        return replace(second, start=first.start, start_time=first.start_time)
    return without_nothing(joined(first, second)) if second.trims else first


def without_nothing(plan: Plan) -> Plan:
    """The plan without trims that last no time; beside maneuvers they stay."""
    if plan.maneuvers:
        return plan
    word, times = merged(plan.trims, plan.durations.tolist())
    if len(word) == len(plan.trims):
        return plan
    return Plan.of_parts(plan.start, word, times, start_time=plan.start_time)


def moving_pieces(plan: Plan) -> Iterator[Primitive]:
    """The trims and maneuvers of a plan that last, without those that stand still."""
    pieces: tuple[Primitive, ...] = plan.primitives if plan.maneuvers else plan.trims
    times = plan.primitive_durations if plan.maneuvers else plan.durations
    for piece, duration in zip(pieces, times.tolist(), strict=True):
        if isinstance(piece, Maneuver) or (duration > NOTHING and not piece.is_rest):
            yield piece


def moves_on(plan: Plan) -> bool:
    """Whether a plan is more than to stand still."""
    return next(moving_pieces(plan), None) is not None


def merged(
    trims: Sequence[Trim], durations: Sequence[float]
) -> tuple[tuple[Trim, ...], list[float]]:
    """Equal neighbours as one trim, and trims that last no time left out."""
    word: list[Trim] = []
    times: list[float] = []
    for trim, duration in zip(trims, durations, strict=True):
        if duration <= NOTHING:
            continue
        last = word[-1] if word else None
        if last is trim or (
            last is not None
            and last.name == trim.name
            and bool((last.body_velocity == trim.body_velocity).all())
        ):
            times[-1] += duration
        else:
            word.append(trim)
            times.append(duration)
    return tuple(word), times


def costliest_first(plan: Plan, problem: Problem) -> Plan:
    """A plan whose trims that commute are ordered by falling cost per second, rest last.

    The order of trims that share a centre, or are all straight, does not change where they lead.
    Among these orders this one costs most early on, which the paper's tie rule asks for: with the
    opposite one the closed loop of its Table 1 never arrives.

    Source: the paper, Sec. 4.2 (rest to the end) and 5.1 (greatest cost first).
    """
    twists, moving, is_sole = _orders(plan.trims)
    if is_sole:
        return plan
    order: list[int] = []
    block: list[int] = []
    costly: list[float] = (-problem.rates_of(plan)).tolist()
    for k in moving:
        if not all(commute(twists[j], twists[k]) for j in block):  # a climb commutes with both
            order += block if len(block) == 1 else sorted(block, key=costly.__getitem__)
            block = []
        block.append(k)
    order += sorted(block, key=costly.__getitem__)
    order += [k for k, twist in enumerate(twists) if not any(twist)]
    if order == list(range(len(twists))):
        return plan
    word, times = merged([plan.trims[k] for k in order], plan.durations[order].tolist())
    return Plan.of_parts(plan.start, word, times, start_time=plan.start_time)


@functools.lru_cache(maxsize=MOST)
def _orders(trims: tuple[Trim, ...]) -> tuple[list[list[float]], list[int], bool]:
    """Twists, places of those that move, and whether rest is last and no neighbours commute."""
    twists = [trim.body_velocity.tolist() for trim in trims]
    moving = [k for k, twist in enumerate(twists) if any(twist)]
    rests_last = moving == list(range(len(moving)))
    return twists, moving, rests_last and not any(map(commute, twists, twists[1 : len(moving)]))


def commute(one: Sequence[float] | Array, other: Sequence[float] | Array) -> bool:
    """Whether two twists commute: their Lie bracket is zero."""
    bracket = max(
        abs(one[2] * other[0] - other[2] * one[0]), abs(one[2] * other[1] - other[2] * one[1])
    )
    if not bracket:
        return True
    if bracket > 1e-12 * FASTEST * FASTEST:  # no trim is faster
        return False
    return bool(bracket <= 1e-12 * (max(map(abs, one)) * max(map(abs, other))))


LOOK_AHEAD = 3  # joints of a plan that steering tries to rejoin
NEAR = 1e-9  # [m, rad] a plan that ends so close to the goal leads there
EASED = 0.5  # share of a goal's tolerance that may be given up before the end


def reanchored(
    problem: Problem, plan: Plan, goal: Goal, *, pad: Trim | None, under_way: bool = False
) -> Iterator[Plan]:
    """Plans from the problem's start that go on with `plan` as far as they can, and end at `goal`.

    First the same word with other times. Then, where trims are switched at will, the steering
    function: three trims that rejoin the plan at one of its next joints, or lead to the goal. Each
    ends exactly at the goal; with a fixed time, in it. A vehicle that does not switch at will may
    not get there exactly: its word with times that lead to within the goal's tolerance comes last.

    The `plan` was about to be driven, from nearby, and may begin within a maneuver that is
    `under_way`; `pad` is the rest that fills the remainder of a fixed time.
    """
    same = same_word(problem, plan, goal, pad=pad, under_way=under_way)
    if same is not None:
        yield same
    if not problem.has_inertia:
        yield from rejoining(problem, plan, goal, pad=pad)
    elif goal.tolerance_m or goal.tolerance_rad:
        from_here = replace(plan, start=problem.start)
        # The goal moved, within its tolerance, towards where a plan ends.
        places = [0, 1, *range(3, from_here.end.size)]
        off = from_here.end - goal.pose
        off[2] = 0.0 if goal.free_heading else math.remainder(float(off[2]), 2.0 * math.pi)
        distance_m, turn = float(np.linalg.norm(off[places])), abs(float(off[2]))
        pose = np.array(goal.pose)
        pose[places] += off[places] * min(1.0, EASED * goal.tolerance_m / max(distance_m, NEAR))
        pose[2] += off[2] * min(1.0, EASED * goal.tolerance_rad / max(turn, NEAR))
        near = same_word(problem, plan, replace(goal, pose=pose), pad=pad, under_way=under_way)
        if near is not None:
            yield near


def same_word(
    problem: Problem, plan: Plan, goal: Goal, *, pad: Trim | None, under_way: bool = False
) -> Plan | None:
    """The word of `plan` with the best times that lead from the problem's start to the goal.

    The maneuvers of the word stay. `under_way`: it begins within one, the trim before that is over.
    """
    if not plan.trims:
        return None
    total, limit = problem.horizon.time, problem.horizon.max_time
    if total is not None and pad is not None and not plan.trims[-1].is_rest:
        between = (*plan.maneuvers, None) if plan.maneuvers else ()
        lasting = np.append(plan.durations, 0.0)
        plan = replace(plan, trims=(*plan.trims, pad), durations=lasting, maneuvers=between)
    maneuvers = sum(one.duration for one in plan.maneuvers if one)
    if total is not None and total < maneuvers:
        return None
    size = problem.start.size
    still = np.zeros(size)
    between = plan.maneuvers or (None,) * (len(plan.trims) - 1)
    displacements = [still if one is None else one.displacement for one in between]
    longest = np.array([trim.max_duration for trim in plan.trims])
    if total is None:  # rest may cost nothing, and then last for ever
        longest = np.where([one.is_rest for one in plan.trims], plan.durations, longest)
    if math.isfinite(longest[0]):
        longest[0] = plan.durations[0]  # how long it has lasted already is not known
    if under_way:
        longest[0] = 0.0
    solved = solve_switching_times(
        np.array([trim.body_velocity for trim in plan.trims]),
        problem.rates_of(plan),
        search_setup(problem, goal).goal[:size],
        displacements=np.array(displacements).reshape(-1, size),  # none beside one trim
        total=None if total is None else total - maneuvers,
        free_heading=goal.free_heading,
        longest=longest,
        guesses=[plan.durations],
        restarts=2,
    )
    if solved.status is TimesStatus.FAILED or not math.isfinite(solved.cost):
        return None
    again = replace(
        plan, start=problem.start, durations=solved.durations, start_time=problem.start_time
    )
    if limit is not None and again.duration > limit * (1.0 + NEAR):
        return None
    if missed(again, goal) > NEAR * (1.0 + float(np.abs(again.start).max())):
        return None
    return without_nothing(again)


def rejoining(problem: Problem, plan: Plan, goal: Goal, *, pad: Trim | None) -> Iterator[Plan]:
    """Three trims to a joint of `plan` or to its end, then its trims from there, then rest."""
    moving = [k for k, trim in enumerate(plan.trims) if trim.body_velocity.any()]
    leads_there = missed(plan, goal) <= NEAR * (1.0 + float(np.abs(plan.start).max()))
    joints = [k + 1 for k in moving[:LOOK_AHEAD]] if leads_there else []
    hurry = replace(problem, horizon=Horizon(), search=replace(problem.search, method="auto"))
    end = moving[-1] + 1 if moving else 0
    for joint in dict.fromkeys([*joints, end]):
        ahead = plan.switching_poses[joint]
        last = joint == end
        target = goal if last else Goal(pose=ahead)
        for variant in (hurry, quickest(hurry)):
            found = False
            for first in _connections(replace(variant, goals=(target,)), target):
                trims = (*first.trims, *(() if last else plan.trims[joint:end]))
                times = [*first.durations.tolist(), *(() if last else plan.durations[joint:end])]
                padded = _in_time(problem, trims, times, pad)
                if padded is not None:
                    found = True
                    yield padded
            if found:
                break  # otherwise the quickest connection may be in time


def _connections(problem: Problem, goal: Goal) -> Iterator[Plan]:
    """Cheapest words of three trims from a sub-library, in any time."""
    setup = search_setup(problem, goal)
    if setup.start_is_goal:
        yield Plan(problem.start, (), durations=[], start_time=problem.start_time)
        return
    small = sub_library(setup)
    solutions = search_setup_words(problem, small, alternatives=0, budget=UNLIMITED, spare=True)
    for solution in solutions:
        yield plan_of(problem, solution)


def _in_time(
    problem: Problem, trims: tuple[Trim, ...], times: list[float], pad: Trim | None
) -> Plan | None:
    """A plan that rests for the remainder of a fixed time; None if it takes longer."""
    total, longest, spent = problem.horizon.time, problem.horizon.max_time, math.fsum(times)
    left = (math.inf if longest is None else longest) - spent if total is None else total - spent
    if left < -1e-9 or (total is not None and left > 1e-9 and pad is None):
        return None
    if total is not None and pad is not None and left > 1e-9:
        trims, times = (*trims, pad), [*times, left]
    word, durations = merged(trims, times)
    return Plan(problem.start, word, durations=durations, start_time=problem.start_time)


def quickest(problem: Problem) -> Problem:
    """The problem in least time, without a limit of time."""
    return replace(
        problem, cost=Cost(time=1.0), horizon=Horizon(max_trims=problem.horizon.max_trims)
    )


def missed(plan: Plan, goal: Goal) -> float:
    """Largest of distance [m] and heading error [rad] between the end of a plan and a goal."""
    return max(goal.off(plan.end))

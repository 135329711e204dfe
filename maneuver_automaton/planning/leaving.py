"""Plans that begin in contact: the shortest coast out of it first, then a plan as any other.

On its way out the body gets no deeper into anything that it touched at the start, and touches
nothing else.
"""

from __future__ import annotations

import heapq
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.cutting import joined, tail_of
from maneuver_automaton.collision import AnyObstacle
from maneuver_automaton.collision.blocked import Contact
from maneuver_automaton.planning.blocked import where_touched
from maneuver_automaton.planning.checking import Checked, Condition, check_plan
from maneuver_automaton.planning.result import PlanResult, PlanStatus
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Goal, Horizon, Problem
from maneuver_automaton.search.limits import outside

LEFT = "left the start, which touches "  # how the note of such a plan begins
LEAST = 1e-3  # [s] that are left to plan in, or to drive
EVERY = 5  # samples of a first trim after which a second one is tried
MOST_WAYS, MOST_MIDDLES, MOST_SECONDS = 4, 60, 12  # planned from; first coasts; trims after them

_Way = tuple[float, tuple[Trim, ...], tuple[float, ...]]  # [m] the body goes at most; trims, [s]


def plan_leaving(
    problem: Problem, plan: Callable[..., PlanResult], *, time_limit: float
) -> PlanResult:
    """The plan of a problem whose start touches something, by `plan` from where it is left."""
    deadline = time.perf_counter() + time_limit
    touched = _touched_at_start(problem)
    if not touched or outside(problem.start, problem.bounds):
        return plan(problem, time_limit=time_limit)
    refused = [
        (problem.moves, "an obstacle moves"),
        (not problem.automaton.is_kinematic, "the vehicle has inertia, or its library maneuvers"),
        (problem.start.size > 3, "the vehicle flies"),
        (bool(problem.parts), "the vehicle carries something"),
        (problem.horizon.time is not None, "the time is fixed"),
    ]
    if why := next((words for one, words in refused if one), ""):
        return _blocked(problem, f"no way out is looked for where {why}")
    rest = tuple(one for k, one in enumerate(problem.obstacles) if k not in touched)
    others = replace(problem, obstacles=rest)
    contact, none, planned = _contact(problem, touched), None, 0
    for length, trims, times in _ways_out(problem, contact, deadline - 0.5 * time_limit):
        first = Plan(problem.start, trims, durations=times, start_time=problem.start_time)
        goal = Goal(pose=first.end)
        alone = replace(others, goals=(goal,), horizon=Horizon(), start_trim=None)
        if not check_plan(alone, first, goal).passed:
            continue
        left = deadline - time.perf_counter()
        if none is not None and (left <= 0.0 or planned == MOST_WAYS):
            break
        last, planned = plan(_after(problem, first), time_limit=max(left, LEAST)), planned + 1
        none = none or last
        if last.plan is None or last.goal_index is None:
            continue
        whole = joined(first, last.plan) if last.plan.trims else first
        checked = check_leaving(problem, whole, problem.goals[last.goal_index])
        if checked.audit is None or not checked.passed:
            continue
        names = [one.name or f"obstacle {k}" for k, one in touched.items()]
        note = (
            f"{LEFT}{' and '.join(names)} ({contact.depth:.3g} m deep, the margin included), "
            f"by {length:.3g} m of {' - '.join(first.word)} in "
            f"{first.duration:.3g} s: never deeper, clear of all else; the audit admits this "
            "contact alone, and clearance counts from there"
        )
        return replace(
            last,
            problem=problem,
            plan=replace(whole, notes=(note,)),
            cost=problem.cost_of(whole),
            lower_bound=None,
            gap=None,
            bound=None,
            certificate=None,
            clearance_m=checked.audit.min_clearance_m,
            audit=checked.audit,
            improvements=(),
            notes=(*last.notes, note),
        )
    if none is None:
        return _blocked(problem, "no coast of one trim or two leads out, clear of all else")
    said = none.reason or "no plan from where the contact is left passes the checks"
    # Nothing is proven of other ways out.
    kept = none.status in (PlanStatus.GOAL_BLOCKED, PlanStatus.OUT_OF_BUDGET)
    status = none.status if kept else PlanStatus.NO_PLAN
    return PlanResult(problem=problem, status=status, reason=said, notes=none.notes)


def _touched_at_start(problem: Problem) -> dict[int, AnyObstacle]:
    return {
        k: one
        for k, one in enumerate(problem.obstacles)
        if where_touched(replace(problem, obstacles=(one,)), problem.start, problem.start_time)
    }


def says_left(plan: Plan) -> str:
    """The note of a plan that leaves a start in contact; empty of any other."""
    return next((note for note in plan.notes if note.startswith(LEFT)), "")


def check_leaving(problem: Problem, plan: Plan, goal: Goal) -> Checked:
    """As `check_plan`; what is touched at the start may be, until the body is out, never deeper."""
    touched = _touched_at_start(problem)
    if not touched or plan.maneuvers or problem.moves or problem.start.size > 3 or problem.parts:
        return check_plan(problem, plan, goal)
    rest = tuple(one for k, one in enumerate(problem.obstacles) if k not in touched)
    checked = check_plan(replace(problem, obstacles=rest), plan, goal)
    if not checked.passed:
        return checked
    begin, out, clear = problem.start, 0.0, False
    contact = _contact(problem, touched)
    for trim, lasting in zip(plan.trims, plan.durations.tolist(), strict=True):
        steps = [(0.0, 0.0, begin, False)]
        for step in contact.coast(trim.body_velocity, begin, lasting):
            steps.append(step)
            if step[3]:
                break
        after, _, begin, clear = steps[-1]
        out += after
        if clear or after < lasting:
            break
    if not clear:
        reason = f"what is touched at the start is touched deeper, or still, {out:.3g} s later"
        return Checked(audit=None, broken=Condition.COLLISION, reason=reason)
    at = plan.start_time + out
    left = replace(problem, start=begin, start_time=at, start_trim=None, horizon=Horizon())
    later = check_plan(left, tail_of(plan, out), goal)
    if not later.passed or later.audit is None or checked.audit is None:
        return later
    apart = later.audit.min_clearance_m, checked.audit.min_clearance_m
    least = min((one for one in apart if one is not None), default=None)
    return replace(checked, audit=replace(checked.audit, min_clearance_m=least))


def _contact(problem: Problem, touched: dict[int, AnyObstacle]) -> Contact:
    return Contact(problem.footprint, problem.start, touched.values(), margin=problem.margin)


def _blocked(problem: Problem, why: str) -> PlanResult:
    reason = f"at the start {where_touched(problem, problem.start, problem.start_time)}; {why}"
    return PlanResult(problem=problem, status=PlanStatus.START_BLOCKED, reason=reason)


def _after(problem: Problem, first: Plan) -> Problem:
    """What is left to plan once the first trims are driven."""
    horizon = problem.horizon
    trims = horizon.max_trims and max(horizon.max_trims - len(first.trims), 1)
    left = horizon.max_time and max(horizon.max_time - first.duration, LEAST)
    horizon = replace(horizon, max_trims=trims, max_time=left)
    begin = first.start_time + first.duration
    return replace(problem, start=first.end, start_time=begin, start_trim=None, horizon=horizon)


def _ways_out(problem: Problem, contact: Contact, deadline: float) -> Iterator[_Way]:
    """Ways out of one trim, the shortest first, then those of two; none is driven on for longer."""
    trims: Sequence[Trim] = problem.automaton.trims
    begun: list[tuple[_Way, Array]] = [((0.0, (), ()), problem.start)]
    for _ in range(2):
        coasts = [_coasts(problem, contact, one, trim) for one in begun for trim in trims]
        middles, seen = [], set()
        for _, way, n, pose, clear in heapq.merge(*coasts, key=lambda one: one[0]):
            if len(way[1]) > 1 and time.perf_counter() > deadline:
                return
            names = tuple(one.name for one in way[1])
            if not clear and n % EVERY == 0:
                middles.append((way, pose))
            if clear and names not in seen:
                seen.add(names)
                yield way
        trims = trims[:: -(-len(trims) // MOST_SECONDS)]
        begun = middles[:: max(-(-len(middles) // MOST_MIDDLES), 1)]


def _coasts(
    problem: Problem, contact: Contact, begun: tuple[_Way, Array], trim: Trim
) -> Iterator[tuple[tuple[float, float], _Way, int, Array, bool]]:
    """A trim driven on, until it is clear: length [m] and cost, the way, its number, its end."""
    (far, word, times), begin = begun
    coast = contact.coast(trim.body_velocity, begin, trim.max_duration)
    for n, (after, length, pose, clear) in enumerate(coast):
        if after >= problem.horizon.min_coast:
            way = far + length, (*word, trim), (*times, after)
            cost = problem.cost_of_trims(way[1], np.array(way[2]))
            yield (round(way[0], 9), round(cost, 9)), way, n, pose, clear
            if clear:
                return

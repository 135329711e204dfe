"""Plans where not every motion is admitted everywhere.

A search that knows nothing of zones is asked simpler questions, whose answers keep to all zones:
each zone is either entered, then only motions that it admits are used, or it is an obstacle. What
comes out is quickened outside of the zones, and the cheapest plan that passes every check is kept.
The first question is the one without zones: if its answer keeps to them, none is better. Where it
does not, a vehicle that does not switch at will follows it from zone to zone, each stretch planned
on its own, and coasts through every zone in a trim that is admitted there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from itertools import chain, islice, product
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision import Obstacle, Zone
from maneuver_automaton.collision.checker import origin_near
from maneuver_automaton.collision.surroundings import fastest_point, parts_of, surroundings_of
from maneuver_automaton.models import Model
from maneuver_automaton.models.lateral import lateral_limit
from maneuver_automaton.planning.blocked import blocked_ends
from maneuver_automaton.planning.crossing import crossed_slowly, nearest_goal, polish_slowed
from maneuver_automaton.planning.incumbents import Incumbents
from maneuver_automaton.planning.result import Answer, LowerBound, PlanResult, PlanStatus
from maneuver_automaton.planning.workspace import Workspace
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Problem
from maneuver_automaton.search.admission import admitted_stretches, piece_is_admitted

MOST_QUESTIONS = 8  # choices of zones to enter and zones to go around
CROSSED_SHARE = 0.5  # of the time left, for a plan from zone to zone
LEAST_TIME = 1e-3  # [s] for each question, also where the time is over
STEP = 0.02  # [m, rad] between places where a trim may be replaced by a faster one
PARALLEL = 1e-12  # of twists, relative


def plan_among_zones(
    problem: Problem, search: Answer, budget: Budget, workspace: Workspace, *, alternatives: int
) -> PlanResult:
    """The cheapest plan found that keeps to the zones of a problem.

    The answer need not be the best: only where the plan that knows of no zones keeps to them, it is
    as good as that one.
    """
    found = Incumbents(problem, budget, workspace, alternatives)
    free = replace(problem, zones=())
    # vehicles with inertia are searched with the zones themselves: crossed slowly, left fast
    itself = [] if problem.automaton.is_kinematic else [problem]
    questions = [free, *itself, *(one for one in _questions(problem) if blocked_ends(one) is None)]
    first: PlanResult | None = None
    for k, question in enumerate(questions):
        if budget.is_over and first is not None:
            break
        part = budget.part(1.0 / (len(questions) - k), at_least=LEAST_TIME)
        result = search(question, part, workspace, alternatives=alternatives)
        first = first or result
        found.counts.update(result.counts)
        for plan, goal_index in _plans(problem, result):
            if found.may_check:
                found.offer(plan, goal_index)
        if k == 0 and found.plans and result.plan is found.plans[0].plan and not alternatives:
            return replace(result, problem=problem)
        if k == 0 and itself and result.plan is not None:
            polish_slowed(found, problem, result.plan, budget)
        if k == 0 and itself and result.plan is not None and not (found.plans or budget.is_over):
            part = budget.part(CROSSED_SHARE, at_least=LEAST_TIME)
            crossed = crossed_slowly(problem, result.plan, search, part, workspace)
            if crossed is not None and found.may_check:
                found.offer(*crossed)
        if k > 0 and question is not problem and first.plan is not None:
            polish_slowed(found, question, first.plan, budget)
    assert first is not None
    if found.plans:
        return found.found(bound=first.bound or LowerBound(value=0.0, kind="distance"))
    reason = first.reason or (
        "no plan was found that keeps to the zones, by going around them, or through them with "
        "what they admit"
    )
    return found.none(PlanStatus.NO_PLAN if first.plan is not None else first.status, reason)


def _plans(problem: Problem, result: PlanResult) -> Iterator[tuple[Plan, int]]:
    """Plans of a result, the best first, each also quickened outside of the zones."""
    if result.plan is None or result.goal_index is None:
        return
    found = [result.plan, *(other.plan for other in result.alternatives)]
    for plan in found:
        goal_index = result.goal_index if plan is result.plan else nearest_goal(problem, plan)
        yield plan, goal_index
        quick = quickened(problem, plan)
        if quick is not None:
            yield quick, goal_index


def _questions(problem: Problem) -> Iterator[Problem]:
    """Problems without zones whose plans keep to all of them: through all, around all, mixed."""
    count = len(problem.zones)
    mixed = (one for one in product((True, False), repeat=count) if 0 < sum(one) < count)
    for through in islice(chain(((True,) * count, (False,) * count), mixed), MOST_QUESTIONS):
        entered = tuple(zone for zone, enter in zip(problem.zones, through, strict=True) if enter)
        avoided = tuple(
            Obstacle(zone.shape, name=zone.words)
            for zone, enter in zip(problem.zones, through, strict=True)
            if not enter
        )
        automaton = admitted_automaton(problem.automaton, entered)
        if automaton is None:
            continue
        named = [problem.start_trim, *(goal.trim for goal in problem.goals)]
        if any(name is not None and name not in automaton.trim_names for name in named):
            continue
        yield replace(
            problem,
            automaton=automaton,
            zones=(),
            obstacles=(*problem.obstacles, *avoided),
        )


def admitted_automaton(automaton: Automaton, zones: tuple[Zone, ...]) -> Automaton | None:
    """The part of an automaton that all of these zones admit; None if no trim of it moves.

    The limits of a vehicle with inertia become those of the zones, as far as it states them.
    """
    if not zones:
        return automaton
    trims = tuple(
        trim for trim in automaton.trims if all(piece_is_admitted(zone, trim) for zone in zones)
    )
    if not any(not trim.is_rest for trim in trims) and not automaton.model.reduced_names:
        return None
    names = {trim.name for trim in trims}
    maneuvers = tuple(
        maneuver
        for maneuver in automaton.maneuvers
        if {maneuver.source, maneuver.target} <= names
        and maneuver.course is not None
        and all(admitted_stretches(zone, maneuver, automaton.model).all() for zone in zones)
    )
    if not trims:
        return None
    model: Model = automaton.model
    if model.reduced_names:
        for zone in zones:
            model = _limited(model, zone)
    return replace(automaton, model=model, trims=trims, maneuvers=maneuvers)


def _limited(model: Model, zone: Zone) -> Model:
    """A vehicle with inertia that keeps to a zone's limits, as far as its class states them."""
    known: set[str] = {field.name for field in fields(model)} if is_dataclass(model) else set()
    changes: dict[str, Any] = {}
    if zone.max_speed is not None and "max_speed" in known:
        changes["max_speed"] = min(zone.max_speed, model.max_speed)  # type: ignore[attr-defined]
    most = zone.max_lateral_acceleration
    if most and "max_lateral_acceleration" in known:
        changes["max_lateral_acceleration"] = min(most, lateral_limit(model))
    if not zone.reverse and "min_speed" in known:
        changes["min_speed"] = 0.0
    return replace(model, **changes) if changes else model  # type: ignore[type-var]


def quickened(problem: Problem, plan: Plan) -> Plan | None:
    """A plan along the same path with cheaper trims where zones admit them; None without a gain.

    A trim is replaced by others of a parallel twist, as from a slow one to a fast one where a
    speed limit ends. Only for vehicles that switch at will.
    """
    if any(plan.maneuvers) or not problem.automaton.is_kinematic or not plan.trims:
        return None
    word: list[Trim] = []
    times: list[float] = []
    for k, (trim, duration) in enumerate(zip(plan.trims, plan.durations.tolist(), strict=True)):
        choices = _parallel(problem, trim)
        if trim.is_rest or len(choices) < 2:
            word.append(trim)
            times.append(duration)
            continue
        n = max(1, math.ceil(float(np.abs(trim.body_velocity).sum()) * duration / STEP))
        clear = _clear(problem, plan, k, n)
        for row in clear:
            faster, pace = next(
                (one, pace)
                for one, pace in choices
                if one is trim
                or all(
                    out or piece_is_admitted(zone, one)
                    for zone, out in zip(problem.zones, row, strict=True)
                )
            )
            if word and word[-1] is faster:
                times[-1] += duration / n / pace
            else:
                word.append(faster)
                times.append(duration / n / pace)
    quick = replace(plan, trims=tuple(word), durations=np.array(times))
    gains = problem.cost_of(quick) < problem.cost_of(plan)
    most = problem.horizon.max_trims
    fits = problem.horizon.time is None and (most is None or len(word) <= most)
    return quick if gains and fits else None


def _parallel(problem: Problem, trim: Trim) -> list[tuple[Trim, float]]:
    """Trims of a parallel twist and how much faster they are, the cheapest path first."""
    size = float(np.linalg.norm(trim.body_velocity))
    found = []
    for one, rate in zip(problem.automaton.trims, problem.rates.tolist(), strict=True):
        pace = float(one.body_velocity @ trim.body_velocity) / (size * size) if size else 0.0
        off = float(np.abs(one.body_velocity - pace * trim.body_velocity).max())
        if pace > 0.0 and off <= PARALLEL * max(1.0, pace) * max(size, 1.0):
            found.append((rate / pace, trim if one.name == trim.name else one, pace))
    if not any(one is trim for _, one, _ in found):
        found.append((math.inf, trim, 1.0))
    found.sort(key=lambda row: row[0])
    return [(one, pace) for _, one, pace in found]


def _clear(problem: Problem, plan: Plan, k: int, n: int) -> Array:
    """Whether each of `n` equal stretches of trim `k` is surely out of each zone (n, zones)."""
    begin, duration = plan.switching_times[k], float(plan.durations[k])
    middles = begin + duration * (np.arange(n) + 0.5) / n
    origin = origin_near(plan.start[:2])
    poses = plan.pose_at(middles)[:, :3].copy()
    poses[:, :2] -= origin
    body = parts_of(problem.footprint)
    reach = 0.5 * duration / n * fastest_point(body, plan.trims[k].body_velocity[None, :3])[0]
    columns = [
        surroundings_of((Obstacle(zone.shape),), origin).nearest(body, poses, middles).distance
        > reach + STEP / 2.0
        for zone in problem.zones
    ]
    return np.array(columns).T

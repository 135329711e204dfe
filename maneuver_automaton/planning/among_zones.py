"""Plans where not every motion is admitted everywhere.

A search that knows nothing of zones is asked simpler questions, whose answers keep to all zones:
each zone is either entered, then only motions that it admits are used, or it is an obstacle. What
comes out is quickened outside of the zones, and the cheapest plan that passes every check is kept.
The first question is the one without zones: if its answer keeps to them, none is better. Where it
does not, a vehicle that does not switch at will follows it from zone to zone, each stretch planned
on its own, and coasts through every zone in a trim that is admitted there.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass, replace
from itertools import chain, islice, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.automaton.cutting import joined
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision import Obstacle, Zone
from maneuver_automaton.collision.shapes import origin_near
from maneuver_automaton.collision.surroundings import fastest_point, parts_of, surroundings_of
from maneuver_automaton.models import Model
from maneuver_automaton.models.speeds import lateral_limit
from maneuver_automaton.planning.blocked import blocked_ends
from maneuver_automaton.planning.checking import bodies_along
from maneuver_automaton.planning.incumbents import LEAST_TIME, Incumbents, PlanningStep
from maneuver_automaton.planning.polishing import (
    guess_of_plan,
    iterations_within,
    polish_plans,
    why_not_polished,
)
from maneuver_automaton.planning.result import Answer, LowerBound, PlanResult, PlanStatus, Workspace
from maneuver_automaton.primitives import Trim
from maneuver_automaton.primitives.turning import HEADING_TOLERANCE
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.search.scene import admitted_stretches, piece_is_admitted

MOST_QUESTIONS = 8  # choices of zones to enter and zones to go around
SLOWED_SHARE = 0.4  # of the time left, for slowing a plan down where there is none yet
CROSSED_SHARE = 0.5  # of the time left, for a plan from zone to zone
STEP = 0.02  # [m, rad] between places where a trim may be replaced by a faster one
PARALLEL = 1e-12  # of twists, relative
CLEAR = 0.02  # [m] between body and zone where a coast through the zone begins
SAMPLES = 1000  # of a plan, between which a zone may be touched


@dataclass(frozen=True, slots=True, eq=False)
class AmongZones(PlanningStep):
    """Plans that keep to zones, by `search`, which asks nothing of zones but what it is told.

    The answer need not be the best: only where the plan that knows of no zones keeps to them, it is
    as good as that one.
    """

    search: Answer

    def offer(self, found: Incumbents) -> None:
        """Offer the answers that keep to all zones, quickened outside of them."""
        problem, budget, alternatives = found.problem, found.budget, found.alternatives
        ended = found.ended
        ended.is_complete = True
        free = replace(problem, zones=())
        # vehicles with inertia are searched with the zones themselves: crossed slowly, left fast
        itself = [] if problem.automaton.is_kinematic else [problem]
        questions = [
            free,
            *itself,
            *(one for one in _questions(problem) if blocked_ends(one) is None),
        ]
        first: PlanResult | None = None
        waits = False  # the first question lets others try

        def offer(result: PlanResult) -> None:
            for plan, goal_index in _plans(problem, result):
                if found.may_check:
                    found.offer(plan, goal_index)

        turns = found.ask(questions, self.search, offer, budget=budget, alternatives=alternatives)
        for k, result, is_over in turns:
            offer(result)
            waits = not is_over if k == 0 else waits
            if first is None or (k == 0 and result.plan is not None):
                first = result
            if k == 0 and found.plans and result.plan is found.plans[0].plan and not alternatives:
                ended.verdict = replace(result, problem=problem)
                return
            stuck = waits and not found.plans and k == len(questions) - 1
            if itself and first.plan is not None and (stuck or (k == 0 and is_over)):
                share = 1.0 if found.plans else SLOWED_SHARE
                polish_slowed(found, problem, first.plan, budget.stage(share))
                waits = False
            none = is_over and not (found.plans or budget.is_over)
            if k == 0 and itself and result.plan is not None and none:
                part = budget.part(CROSSED_SHARE, at_least=LEAST_TIME)._replace(shows=None)
                crossed = crossed_slowly(problem, result.plan, self.search, part, found.workspace)
                if crossed is not None and found.may_check:
                    found.offer(*crossed)
            if k > 0 and is_over and questions[k] is not problem and first.plan is not None:
                polish_slowed(found, questions[k], first.plan, budget)
        assert first is not None
        ended.bound = first.bound or LowerBound(value=0.0, kind="distance")
        reason = first.reason or (
            "no plan was found that keeps to the zones, by going around them, or through them with "
            "what they admit"
        )
        status = PlanStatus.OUT_OF_BUDGET if budget.is_over else PlanStatus.NO_PLAN
        ended.why = status if first.plan is not None else first.status, reason


def _plans(problem: Problem, result: PlanResult) -> Iterator[tuple[Plan, int]]:
    """Plans of a result, the best first, each also quickened outside of the zones."""
    if result.plan is None or result.goal_index is None:
        return
    for plan in [result.plan, *(other.plan for other in result.alternatives)]:
        goal_index = result.goal_index if plan is result.plan else nearest_goal(problem, plan)
        yield plan, goal_index
        quick = quickened(problem, plan)
        if quick is not None:
            yield quick, goal_index


def _questions(problem: Problem) -> Iterator[Problem]:
    """Problems without zones whose plans keep to all of them: through all, around all, mixed."""
    model, choices = problem.automaton.model, list[list[bool]]()
    for zone in problem.zones:  # what admits no motion is not entered, what an end is in, is
        moving = (trim for trim in problem.automaton.trims if not trim.is_rest)
        driven = bool(model.reduced_names) and (
            zone.max_speed is None or zone.max_speed > _slowest(model)
        )
        may = driven or any(piece_is_admitted(zone, one) for one in moving)
        alone = replace(problem, zones=(), obstacles=(Obstacle(zone.shape),))
        must = may and blocked_ends(alone) is not None
        choices.append([True] * may + [False] * (not must))
    through, around = (tuple(one[k] for one in choices) for k in (0, -1))
    mixed = (one for one in product(*choices) if one not in (through, around))
    for chosen in islice(chain(dict.fromkeys((through, around)), mixed), MOST_QUESTIONS):
        entered = tuple(zone for zone, enter in zip(problem.zones, chosen, strict=True) if enter)
        avoided = tuple(
            Obstacle(zone.shape, name=zone.words)
            for zone, enter in zip(problem.zones, chosen, strict=True)
            if not enter
        )
        automaton = admitted_automaton(problem.automaton, entered)
        if automaton is None:
            continue
        named = [problem.start_trim, *(goal.trim for goal in problem.goals)]
        if any(name is not None and name not in automaton for name in named):
            continue
        yield replace(
            problem, automaton=automaton, zones=(), obstacles=(*problem.obstacles, *avoided)
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
    if zone.max_speed is not None and zone.max_speed > _slowest(model) and "max_speed" in known:
        changes["max_speed"] = min(zone.max_speed, model.max_speed)  # type: ignore[attr-defined]
    most = zone.max_lateral_acceleration
    if most and "max_lateral_acceleration" in known:
        changes["max_lateral_acceleration"] = min(most, lateral_limit(model))
    if not zone.reverse and "min_speed" in known:
        changes["min_speed"] = _slowest(model)
    return replace(model, **changes) if changes else model  # type: ignore[type-var]


def _slowest(model: Model) -> float:
    """The least speed ahead [m/s], of a vehicle whose class states one; otherwise 0."""
    return max(0.0, getattr(model, "min_speed", None) or 0.0)


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
        for row in _clear(problem, plan, k, n):
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


def crossed_slowly(
    problem: Problem, known: Plan, search: Answer, budget: Budget, workspace: Workspace
) -> tuple[Plan, int] | None:
    """A plan from zone to zone, where a `known` plan touches them, and the goal it reaches.

    Each zone is crossed in one trim that it admits. What lies between is searched on its own.
    """
    coasts = coasts_through(problem, known)
    if not coasts:
        return None
    whole: Plan | None = None
    at_leisure = replace(problem.horizon, time=None, max_time=None, max_trims=None)
    open_space = replace(problem, zones=(), horizon=at_leisure)
    for k, coast in enumerate([*coasts, None]):
        part = budget.part(1.0 / (len(coasts) + 1 - k), at_least=LEAST_TIME)
        leg = open_space
        if whole is not None:
            last = whole.trims[-1].name
            leg = replace(
                leg, start=whole.end, start_trim=last, start_time=whole.start_time + whole.duration
            )
        if coast is not None:
            leg = replace(leg, goals=(Goal(pose=coast.start, trim=coast.trims[0].name),))
        result = search(leg, part, workspace, alternatives=0)
        if result.plan is None or result.goal_index is None:
            return None
        whole = result.plan if whole is None else joined(whole, result.plan)
        if coast is None:
            return whole, result.goal_index
        whole = joined(whole, coast)
    return None


def coasts_through(problem: Problem, known: Plan) -> list[Plan]:
    """Coasts through the zones that a `known` plan touches, each from where it comes near.

    None if it begins or ends in a zone, or a zone admits no trim that leads through.
    """
    times = known.start_time + np.linspace(0.0, known.duration, SAMPLES)
    touched = _touched(problem, known, times)
    inside = np.asarray(touched.any(axis=1))
    if inside[0] or inside[-1]:
        return []
    edges = np.flatnonzero(np.diff(inside.astype(int)))
    coasts = []
    for before, last in zip(edges[::2], edges[1::2], strict=True):
        enters = np.asarray(touched[before : last + 2].any(axis=0))
        zones = [problem.zones[k] for k in np.flatnonzero(enters)]
        ends = known.pose_at(times[[before, last + 1]])
        coast = _coast(problem, zones, ends[0], ends[1])
        if coast is None:
            return []
        coasts.append(coast)
    return coasts


def _has_heading(problem: Problem, trim: Trim, heading: float) -> bool:
    """Whether the vehicle may be in a trim at a heading [rad]: where headings belong to trims."""
    model = problem.automaton.translated
    if model is None:
        return True
    off = math.remainder(heading - model.heading(trim.reduced_state), 2.0 * math.pi)
    return abs(off) <= HEADING_TOLERANCE


def _coast(problem: Problem, zones: list[Zone], begin: Array, end: Array) -> Plan | None:
    """A coast through zones from a pose, in the trim that leads most nearly to another pose."""
    group = problem.automaton.model.group
    move = np.asarray((group(begin).inverse() @ group(end)).log())
    chord = float(np.linalg.norm(move[:2]))
    trims = [
        trim
        for trim in problem.automaton.trims
        if trim.body_velocity[:2].any()
        and all(piece_is_admitted(zone, trim) for zone in zones)
        and _has_heading(problem, trim, float(begin[2]))
    ]
    if not trims or not chord > 0.0:
        return None
    lengths = np.array([1.0, 1.0, chord / 2.0, 1.0])[: move.size]
    twists = np.array([trim.body_velocity for trim in trims]) * lengths
    speeds = np.linalg.norm(twists, axis=1)
    along = move * lengths / np.linalg.norm(move * lengths)
    off = np.round(np.linalg.norm(twists / speeds[:, None] - along, axis=1), 2)
    trim = trims[int(np.lexsort((-speeds, off))[0])]
    longest = 2.0 * chord / float(np.linalg.norm(trim.body_velocity[:2]))
    whole = Plan(begin, (trim,), durations=[longest])
    times = np.linspace(0.0, longest, SAMPLES)
    inside = np.asarray(_touched(problem, whole, times).any(axis=1))
    leaves = np.flatnonzero(inside[:-1] & ~inside[1:])
    if inside[0] or not leaves.size:
        return None
    return replace(whole, durations=np.array([times[leaves[-1] + 1]]))


def _touched(problem: Problem, plan: Plan, times: Array) -> NDArray[np.bool_]:
    """Whether any part comes near each zone at each time (n, zones)."""
    origin, bodies = origin_near(plan.start[:2]), [*bodies_along(problem, plan)]
    columns = []
    for zone in problem.zones:
        near = np.zeros(len(times), dtype=np.bool_)
        around = surroundings_of((Obstacle(zone.shape),), origin)
        for _, moving, shapes in bodies:
            poses = moving.pose_at(times)[:, :3].copy()
            poses[:, :2] -= origin
            aside = around.nearest(parts_of(shapes), poses, times).distance
            near |= aside <= problem.margin + CLEAR
        columns.append(near)
    return np.array(columns).T


def polish_slowed(found: Incumbents, question: Problem, known: Plan, budget: Budget) -> None:
    """Polish a `known` plan within the zones of a question, and the limits of its vehicle.

    The library may have no trim that goes on so slowly; the vehicle can all the same.
    """
    model, free = question.automaton.model, found.problem.automaton.model
    alike = model is free and not question.zones
    if alike or budget.is_over or why_not_polished(question):
        return
    guess = guess_of_plan(known)
    dof, limits = known.start.size, model.reduced_limits
    reduced = guess.state[:, dof:]
    over = np.abs(reduced) / np.maximum(np.abs(limits).max(axis=1), 1e-9)
    slower = max(1.0, float(over.max()))
    state = np.hstack([guess.state[:, :dof], np.clip(reduced, *limits.T)])
    slowed = replace(guess, state=state, duration=slower * guess.duration)
    goal_index = nearest_goal(question, known)
    try:
        polish_plans(
            question,
            [slowed],
            goal_index,
            None,
            budget=budget,
            most_iterations=iterations_within(budget),
            accepts=functools.partial(found.offer, goal_index=goal_index),
        )
    except RuntimeError:  # the solver gave up on a number; the plan in hand stays
        found.counts.update(solver_errors=1)


def nearest_goal(problem: Problem, plan: Plan) -> int:
    """The goal that a plan ends at."""
    return min(range(len(problem.goals)), key=lambda k: sum(problem.goals[k].off(plan.end)))

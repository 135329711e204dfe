"""Zones that a vehicle crosses that does not switch at will: slowly in them, or all the way.

A plan that knows of no zones shows where they are met. From zone to zone the vehicle is planned on
its own; each is crossed in one trim that it admits. Where the library has none, the plan is driven
so slowly throughout.
"""

from __future__ import annotations

import functools
import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.carried import carried
from maneuver_automaton.automaton.cutting import joined
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision import Obstacle, Zone
from maneuver_automaton.collision.checker import origin_near
from maneuver_automaton.collision.surroundings import parts_of, surroundings_of
from maneuver_automaton.planning.incumbents import Incumbents
from maneuver_automaton.planning.polishing import (
    guess_of_plan,
    iterations_within,
    polish_plans,
    why_not_polished,
)
from maneuver_automaton.planning.result import Answer
from maneuver_automaton.planning.workspace import Workspace
from maneuver_automaton.primitives import Trim
from maneuver_automaton.primitives.turning import HEADING_TOLERANCE
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.search.admission import piece_is_admitted

CLEAR = 0.02  # [m] between body and zone where a coast through the zone begins
LEAST_TIME = 1e-3  # [s] for each stretch, also where the time is over
SAMPLES = 1000  # of a plan, between which a zone may be touched


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
    origin, model = origin_near(plan.start[:2]), problem.automaton.model
    bodies = [(plan, problem.footprint)]
    bodies += [(carried(plan, model, name), shapes) for name, shapes in problem.parts.items()]
    columns = []
    for zone in problem.zones:
        near = np.zeros(len(times), dtype=np.bool_)
        around = surroundings_of((Obstacle(zone.shape),), origin)
        for moving, shapes in bodies:
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

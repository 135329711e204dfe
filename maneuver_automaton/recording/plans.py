"""Recordings of plans, and of answers for one vehicle."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from maneuver_automaton.automaton import Plan, Primitive
from maneuver_automaton.costs import Cost
from maneuver_automaton.models import Model
from maneuver_automaton.planning import PlanResult
from maneuver_automaton.planning.on_the_way import Passed
from maneuver_automaton.primitives import Maneuver
from maneuver_automaton.recording.values import (
    Fact,
    Mover,
    Recording,
    Search,
    Table,
    asked_for,
    effort_facts,
    mover_of,
    world_of,
)

STRAIGHT = 0.01  # [1/m, rad/s] of curvature, or turning on the spot, that is called straight
AT_REST = 1e-3  # [m/s]
SIDES = (", left", ", right")
BRIEF_S = 0.2  # straight between two bends, or at rest: what is shorter is joined to a neighbour


def _alone(plan: Plan) -> Recording:
    duration = Fact(label="duration", value=plan.duration, unit="s")
    return Recording(kind="plan", title="Plan", facts=(duration,), movers=(Mover(pieces=(plan,)),))


def _answer(result: PlanResult) -> Recording:
    problem, bound, narrow = result.problem, result.bound, result.narrowest
    mover = mover_of(problem, result.plan, reason=result.reason, cost=result.cost)
    return Recording(
        kind="plan",
        title="Plan",
        status=result.status.value,
        reason=result.reason,
        ending=result.reason,
        facts=tuple(_facts(result)),
        movers=(mover,),
        world=world_of(problem),
        alternatives=tuple(
            replace(mover, pieces=(one.plan,), end=None, cost=one.cost)
            for one in result.alternatives
        ),
        search=Search(
            improvements=result.improvements,
            bounds=() if bound is None else bound.history,
            cost=result.cost,
            bound=result.lower_bound,
            kind="" if bound is None else bound.kind,
            nodes=result.nodes,
            reached=result.reached,
            narrowest=None if narrow is None else np.array(narrow.place),
            missing_m=0.0 if narrow is None else narrow.missing,
        ),
    )


def stated(document: Mapping[str, Any], plan: Plan | None) -> Recording:
    """The recording of a loaded plan.json alone: of its `plan`, without body and obstacles."""
    if plan is None:
        ended = f"{str(document['status']).replace('_', ' ')}: {document.get('reason') or ''}"
        stands = Plan(np.zeros(3), (), durations=[])
        fact = Fact(label="no plan", value=ended.rstrip(": "))
        mover = Mover(pieces=(stands,), has_plan=False, reached=False)
        return Recording(
            kind="plan", title="Plan", status=document["status"], facts=(fact,), movers=(mover,)
        )
    error, vehicle = document.get("terminal_error") or {}, document.get("vehicle") or {}
    apart, turned = error.get("position_m"), error.get("heading_rad")
    cost, bound = document.get("cost"), document.get("lower_bound")
    if cost is not None and bound is not None:
        bound = None if document.get("gap") is None else min(cost, bound)
    facts = plan_facts(
        cost=cost,
        duration=plan.duration,
        bound=bound,
        clearance=document.get("clearance_m"),
        error=None if apart is None or turned is None else (apart, turned),
    )
    names = tuple(vehicle.get("reduced_state") or ()), tuple(vehicle.get("control") or ())
    mover = Mover(pieces=(plan,), names=names, cost=document.get("cost"))
    return Recording(kind="plan", title="Plan", facts=tuple(facts), movers=(mover,))


def plan_facts(
    *,
    cost: float | None,
    duration: float,
    bound: float | None = None,
    clearance: float | None = None,
    margin: float = 0.0,
    error: tuple[float, float] | None = None,
) -> list[Fact]:
    """The numbers that head a plan, those that are known; `error` is in metres and radians."""
    facts = [] if cost is None else [Fact(label="cost", value=cost, bound=bound)]
    facts.append(Fact(label="duration", value=duration, unit="s"))
    if clearance is not None and math.isfinite(clearance):
        near = f" to the nearest obstacle{asked_for(clearance, margin)}"
        facts.append(Fact(label="clearance", value=clearance, unit="m", digits=3, more=near))
    if error is not None:
        apart, turned = error
        facts.append(Fact(label="terminal error", value=f"{apart:.2g} m, {turned:.2g} rad"))
    return facts


def _facts(result: PlanResult) -> list[Fact]:
    plan, error, bound = result.plan, result.terminal_error, result.bound
    if plan is None:
        ended = f"{result.status.value.replace('_', ' ')}: {result.reason}"
        return [Fact(label="no plan", value=ended)]
    below = None
    if result.lower_bound is not None and result.gap is not None:
        is_best = result.gap <= 0.0 or (bound is not None and bound.kind == "incumbent")
        below = result.cost if is_best else result.lower_bound
    changes = replace(result.problem, cost=Cost(direction_change=1.0)).invariant_cost_of(plan)
    turns = f"{round(changes)} between forward and reverse"
    return [
        *plan_facts(
            cost=result.cost,
            duration=plan.duration,
            bound=below,
            clearance=result.clearance_m,
            margin=result.problem.margin,
            error=None if error is None else (error.position_m, error.heading_rad),
        ),
        *passed_on_the_way(result.via),
        Fact(label="turning points", value=turns, heads=False),
        *effort_facts(result.timing_s, result.counts),
        Fact(label="notes", value="; ".join(result.notes), heads=False),
    ]


def passed_on_the_way(passed: Sequence[Passed]) -> list[Fact]:
    """When each pose on the way is passed."""
    listed = ", ".join(f"{one.number} at {one.time:.4g} s" for one in passed)
    return [Fact(label="on the way", value=listed, heads=False)] if listed else []


def tables(result: PlanResult) -> list[Table]:
    """The word with its controls and durations, and the alternatives; nothing without a plan."""
    plan, automaton = result.plan, result.problem.automaton
    if plan is None:
        return []
    known = {one.name for one in automaton.maneuvers}
    pairs = zip(plan.primitives, plan.primitive_durations, strict=True)
    parts = [
        row
        for one, duration in pairs
        for row in _rows(one, duration, None if one.name in known else automaton.model)
    ]
    what = "primitive" if any(plan.maneuvers) else "trim"
    word = Table(
        columns=("", what, ", ".join(automaton.model.control_names), "duration [s]"),
        rows=[[str(k + 1), *row] for k, row in enumerate(parts)],
        numbers=(0, 2, 3),
        instead="nothing to do: the start is the goal",
    )
    others = [
        [str(k + 1), f"{one.cost:.6g}", f"{one.plan.duration:.6g}",
         " - ".join(one.plan.word) or "(stays)"]
        for k, one in enumerate(result.alternatives)
    ]  # fmt: skip
    columns = ("", "cost", "duration [s]", "word")
    more = Table(title="Alternatives", columns=columns, rows=others, numbers=(0, 1, 2))
    return [word, more] if others else [word]


def _rows(primitive: Primitive, duration: float, model: Model | None) -> list[list[str]]:
    """Name, control and duration of a trim or maneuver; with a model, of a maneuver's stretches."""
    if not isinstance(primitive, Maneuver):
        control = ", ".join(f"{value:.6g}" for value in primitive.control)
        return [[primitive.name, control, f"{duration:.6g}"]]
    found = [] if model is None else stretches(primitive, model)
    return [
        [f"{primitive.name}: {what}", "varies", f"{seconds:.6g}"] for what, seconds in found
    ] or [[primitive.name, "maneuver", f"{duration:.6g}"]]


def stretches(maneuver: Maneuver, model: Model) -> list[tuple[str, float]]:
    """What a maneuver does, and for how long [s], until direction or side of its bend change."""
    course = maneuver.course
    if course is None or course.time.size < 2:
        return []
    middles = (course.reduced_state[:-1] + course.reduced_state[1:]) / 2.0
    twists = model.body_velocity(middles, course.control[:-1])
    words = [_motion(*twist[:3]) for twist in twists.tolist()]
    lasting = _runs(zip(words, np.diff(course.time).tolist(), strict=True))
    clear = [one for one in lasting if one[1] >= BRIEF_S or one[0].endswith(SIDES)]
    if not clear:
        return lasting
    listed: list[tuple[str, float]] = []
    early = 0.0  # what is brief goes with what came before, or else with the first
    for what, seconds in lasting:
        if listed or (what, seconds) == clear[0]:
            listed.append((what if (what, seconds) in clear else listed[-1][0], seconds))
        else:
            early += seconds
    listed[0] = (listed[0][0], listed[0][1] + early)
    return _runs(listed)


def _runs(parts: Iterable[tuple[str, float]]) -> list[tuple[str, float]]:
    """Equal neighbours as one, with the sum of their durations."""
    return [
        (what, math.fsum(seconds for _, seconds in run))
        for what, run in itertools.groupby(parts, key=lambda one: one[0])
    ]


def _motion(ahead: float, aside: float, turn: float) -> str:
    """A twist [m/s, m/s, rad/s] in words."""
    speed = math.hypot(ahead, aside)
    if speed < AT_REST:
        where, bend = "on the spot", turn
    elif abs(aside) > abs(ahead):
        where, bend = "sideways " + ("left" if aside > 0.0 else "right"), turn / speed
    else:
        where, bend = "ahead" if ahead > 0.0 else "reverse", turn / ahead
    if abs(bend) <= STRAIGHT:
        return "at rest" if speed < AT_REST else where
    return f"{where}, {'left' if bend > 0.0 else 'right'}"


RECORDED = {Plan: _alone, PlanResult: _answer}

"""Recordings of plans, and of answers for one vehicle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from maneuver_automaton.automaton import Plan
from maneuver_automaton.planning import PlanResult
from maneuver_automaton.recording.values import Fact, Mover, Recording, Search, mover_of, world_of


def recorded(result: Plan | PlanResult) -> Recording | None:
    """The recording of a plan, or of the answer to a problem."""
    if isinstance(result, Plan):
        duration = Fact(label="duration", value=result.duration, unit="s")
        return Recording(
            kind="plan", title="Plan", facts=(duration,), movers=(Mover(pieces=(result,)),)
        )
    return _answer(result) if isinstance(result, PlanResult) else None


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
    facts = plan_facts(
        cost=document.get("cost"),
        duration=plan.duration,
        bound=None if document.get("gap") is None else document.get("lower_bound"),
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
    error: tuple[float, float] | None = None,
) -> list[Fact]:
    """The numbers that head a plan, those that are known; `error` is in metres and radians."""
    facts = [] if cost is None else [Fact(label="cost", value=cost, digits=6)]
    facts.append(Fact(label="duration", value=duration, unit="s"))
    if bound is not None and cost is not None:
        proven = "optimal" if cost <= bound else f"at least {bound:.6g}"
        facts.append(Fact(label="proven", value=proven))
    if clearance is not None:
        facts.append(Fact(label="clearance", value=clearance, unit="m", digits=3))
    if error is not None:
        apart, turned = error
        facts.append(Fact(label="terminal error", value=f"{apart:.2g} m, {turned:.2g} rad"))
    return facts


def _facts(result: PlanResult) -> list[Fact]:
    plan, error = result.plan, result.terminal_error
    if plan is None:
        ended = f"{result.status.value.replace('_', ' ')}: {result.reason}"
        return [Fact(label="no plan", value=ended)]
    return plan_facts(
        cost=result.cost,
        duration=plan.duration,
        bound=None if result.gap is None else result.lower_bound,
        clearance=result.clearance_m,
        error=None if error is None else (error.position_m, error.heading_rad),
    )

"""Recordings of plans of a fleet, and of its closed loop."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.fleet import FleetLog, FleetResult
from maneuver_automaton.fleet.driven import whole_pieces
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Problem
from maneuver_automaton.recording.values import (
    Curve,
    Event,
    Fact,
    Mover,
    Recording,
    Search,
    mover_of,
    world_of,
)

STANDS = "stands"  # the name of what a vehicle does while it has nothing to do
SHORT = 1e-9  # [s] that is no time


def recorded(result: FleetResult | FleetLog) -> Recording | None:
    """The recording of a fleet's plans, or of its closed loop."""
    if isinstance(result, FleetResult):
        return _plans(result)
    return _loop(result) if isinstance(result, FleetLog) else None


def _plans(result: FleetResult) -> Recording:
    fleet = result.problem
    return Recording(
        kind="fleet",
        title="Fleet",
        status=result.status.value,
        reason="; ".join(f"{name}: {why}" for name, why in result.reasons.items()),
        facts=tuple(_plan_facts(result)),
        movers=tuple(_planned(result, k) for k in range(len(fleet))),
        world=world_of(*fleet.problems, margin=fleet.margin),
        search=Search(improvements=result.improvements, bound=result.lower_bound),
    )


def _planned(result: FleetResult, k: int) -> Mover:
    fleet = result.problem
    name, problem = fleet.names[k], fleet.problems[k]
    answer = result.results[name]
    plan = answer.plan
    if plan is None:
        why = result.reasons.get(name) or answer.reason
        return _standing(problem, name=name, reason=why, cost=answer.cost)
    gone = float(plan.start_time + plan.duration) if fleet.leaves[k] else math.inf
    return mover_of(problem, plan, name=name, cost=answer.cost, there=(-math.inf, gone))


def _standing(problem: Problem, **more: Any) -> Mover:
    """Who has no plan: a piece of no time, with the names of its states."""
    first, when = problem.first_trim, problem.start_time
    stands = Plan(problem.start, (first,), durations=[0.0], start_time=when)
    return mover_of(problem, None, pieces=(stands,), **more)


def _plan_facts(result: FleetResult) -> list[Fact]:
    count, found = len(result.problem), len(result.plans)
    number = str(count) if found == count else f"{found} of {count} with a plan"
    facts = [Fact(label="vehicles", value=number)]
    if found:
        facts.append(Fact(label="sum", value=result.sum_s, unit="s"))
        facts.append(Fact(label="last", value=result.last_s, unit="s"))
        if math.isfinite(result.clearance_m):
            facts.append(Fact(label="clearance", value=result.clearance_m, unit="m", digits=3))
    if result.gap is not None:
        proven = f"at least {result.lower_bound:.6g}" if result.gap else "optimal"
        facts.append(Fact(label="proven", value=proven))
    return facts + _margin(result.problem.margin)


def _margin(margin: float) -> list[Fact]:
    return [Fact(label="margin", value=f"{margin:g} m")] if margin > 0.0 else []


def _loop(log: FleetLog) -> Recording:
    fleet = log.problem
    last = max((float(log.arrived_s.get(name, log.times[-1])) for name in fleet.names), default=0.0)
    times = np.minimum(log.times, last)
    total = np.where(np.isfinite(log.values), log.values, math.nan)
    total = np.append(total, 0.0 if log.reached else math.nan)[: log.times.size]
    spent = np.zeros(log.times.size)
    for name in fleet.names:
        for step, cost in log.costs_of(name).items():
            spent[step + 1] += cost
    curves = [
        Curve(label="value", time=times, value=total),
        Curve(label="spent", time=times, value=np.cumsum(spent)),
    ]
    curves += [
        Curve(label="value", time=times, value=_values(log, name), mover=name)
        for name in fleet.names
    ]
    return Recording(
        kind="fleet_loop",
        title="Closed loop of a fleet",
        status=log.status,
        reason=log.reason,
        ending="all have arrived" if log.reached else log.reason,
        facts=tuple(_loop_facts(log)),
        movers=tuple(_driven(log, k) for k in range(len(fleet))),
        world=world_of(*fleet.problems, margin=fleet.margin),
        events=tuple(_events(log)),
        curves=tuple(curves),
    )


def _driven(log: FleetLog, k: int) -> Mover:
    fleet = log.problem
    name, problem = fleet.names[k], fleet.problems[k]
    pieces, begin, arrived = _filled(log, name), float(log.times[0]), log.arrived_s.get(name)
    if not pieces:
        why, never = "it was never let in", (math.inf, math.inf)
        return _standing(problem, name=name, reason=why, there=never)
    why = "it broke down" if name in log.broken_down else "it is under way still"
    first = pieces[0].start_time
    joins = first > begin and next(iter(log.pieces_of(name))) > 0
    gone = arrived if fleet.leaves[k] and arrived is not None else math.inf
    return mover_of(
        problem,
        pieces[0],
        name=name,
        pieces=pieces,
        reached=arrived is not None,
        arrived_s=arrived,
        reason="" if arrived is not None else why,
        there=(first if joins else -math.inf, gone),
        held=_held(log, name),
    )


def _filled(log: FleetLog, name: str) -> tuple[Plan, ...]:
    """The pieces of a vehicle until it arrived, each with a rest until the next step begins."""
    filled: list[Plan] = []
    arrived = log.arrived_s.get(name, math.inf)
    for step, piece in whole_pieces(log, name).items():
        if filled and piece.start_time >= arrived:
            break
        until = min(float(log.times[step + 1]), max(arrived, piece.start_time + piece.duration))
        left = until - piece.start_time - piece.duration
        filled.append(piece if left <= SHORT else _standing_after(piece, left))
    return tuple(filled)


def _standing_after(piece: Plan, lasting: float) -> Plan:
    last = piece.trims[-1]
    still = Trim(
        name=STANDS,
        body_velocity=np.zeros(piece.start.size),
        control=np.zeros_like(last.control),
        reduced_state=last.reduced_state,
    )
    between = (*piece.maneuvers, None) if piece.maneuvers else ()
    return Plan(
        piece.start,
        (*piece.trims, still),
        durations=[*piece.durations.tolist(), lasting],
        maneuvers=between,
        start_time=piece.start_time,
    )


def _held(log: FleetLog, name: str) -> tuple[tuple[float, Plan], ...]:
    """When a vehicle held another plan than before [s], and what is left of it from there on."""
    rows: list[tuple[float, Plan]] = []
    held: Plan | None = None
    for step in log.steps:
        if name in step.plans and step.plans[name] is not held:
            held = step.plans[name]
            rows.append((float(step.time), step.driven[name]))
    return tuple(rows)


def _values(log: FleetLog, name: str) -> Array:
    """What a vehicle has left to pay at the times of the log; nothing once it has arrived."""
    values = np.array([step.values.get(name, math.nan) for step in log.steps] or [math.nan])
    last = 0.0 if name in log.arrived_s else math.nan
    values = np.append(values, last) if log.steps else values
    values[~np.isfinite(values)] = math.nan
    values[log.times >= log.arrived_s.get(name, math.inf)] = 0.0
    return values


def _events(log: FleetLog) -> list[Event]:
    rows: list[Event] = []
    for step in log.steps:
        exchanges = [" and ".join(swap.names) for swap in step.swaps]
        broken = [str(one) for one in step.violations]
        for kind, texts in (("exchanged", exchanges), ("broken", broken)):
            rows += [Event(time=float(step.time), kind=kind, text=text) for text in texts]
        rows += [Event(time=float(step.time), kind="void", mover=name) for name in step.void]
    return rows


def _loop_facts(log: FleetLog) -> list[Fact]:
    broken, swaps = len(list(log.violations)), len(list(log.swaps))
    facts = [
        Fact(label="vehicles", value=f"{len(log.arrived_s)} of {len(log.problem)} arrived"),
        Fact(label="sum", value=log.sum_s, unit="s"),
        Fact(label="last", value=log.last_s, unit="s"),
        Fact(label="cost", value=log.cost, digits=6),
        Fact(label="steps", value=f"{len(log.steps)}, {swaps} exchange{'' if swaps == 1 else 's'}"),
    ]
    if math.isfinite(log.distance_m):
        facts.append(Fact(label="nearest", value=log.distance_m, unit="m", digits=3))
    facts += _margin(log.problem.margin)
    return [*facts, Fact(label="guarantees", value=f"{broken} broken" if broken else "all kept")]

"""Recordings of plans of a fleet, and of its closed loop."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.fleet import DrivenVerdict, FleetLog, FleetResult, verify_driven
from maneuver_automaton.fleet.driven import whole_pieces
from maneuver_automaton.planning.polishing import left_out
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Problem
from maneuver_automaton.recording.values import (
    Curve,
    Event,
    Fact,
    Mover,
    Recording,
    Search,
    Table,
    asked_for,
    effort_facts,
    few,
    mover_of,
    nearest_fact,
    shown,
    times_of,
    world_of,
)

STANDS = "stands"  # the name of what a vehicle does while it has nothing to do
SHORT = 1e-9  # [s] that is no time


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
    below, unit = None, ""
    if result.gap is not None:
        below = result.cost if result.gap <= 0.0 else result.lower_bound or 0.0
        unit = " s of the last arrival" if result.objective == "last" else ""
    facts = [
        Fact(label="plans", value=f"{len(result.plans)} of {len(result.results)}"),
        Fact(label="cost", value=result.cost, bound=below, note=unit),
    ]
    if result.alone_cost:
        facts.append(Fact(label="each alone", value=result.alone_cost, heads=False))
    facts += _arrivals(result)
    facts += _apart(result.clearance_m, result.problem.margin)
    known = [one.clearance_m for one in result.results.values() if one.clearance_m is not None]
    facts += clearance_facts(min(known, default=math.inf))
    return [
        *facts,
        nearest_fact(result.closest),
        Fact(label="order", value=", ".join(result.order), heads=False),
        *effort_facts(result.timing_s, result.counts),
        Fact(label="left out", value="; ".join(result.notes), heads=False),
    ]


def _arrivals(result: FleetResult | FleetLog) -> list[Fact]:
    return [
        Fact(label="sum", value=result.sum_s, unit="s", heads=False),
        Fact(label="last arrival", value=result.last_s, unit="s"),
    ]


def _apart(distance: float, margin: float) -> list[Fact]:
    """The least distance of any two [m]; nothing if no two are there at once."""
    if math.isinf(distance):
        return []
    kept = f" at least{asked_for(distance, margin)}"
    return [Fact(label="apart", value=distance, unit="m", digits=3, more=kept)]


def clearance_facts(distance: float) -> list[Fact]:
    """The least distance of anybody to an obstacle [m]; nothing where there is none."""
    if math.isinf(distance):
        return []
    near = " to the nearest obstacle"
    return [Fact(label="clearance", value=distance, unit="m", digits=3, more=near, heads=False)]


def _loop(log: FleetLog) -> Recording:
    fleet = log.problem
    last = max((float(log.arrived_s.get(name, log.times[-1])) for name in fleet.names), default=0.0)
    times = np.minimum(log.times, last)
    total = np.where(np.isfinite(log.values), log.values, math.nan)
    total = np.append(total, 0.0 if log.reached else math.nan)[: log.times.size]
    curves = [
        Curve(label="value", time=times, value=total),
        Curve(label="spent", time=times, value=_spent(log)),
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
    durations = np.append(piece.durations, lasting)
    return replace(piece, trims=(*piece.trims, still), durations=durations, maneuvers=between)


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


def judged_facts(driven: DrivenVerdict, margin: float) -> tuple[Fact, ...]:
    """What was measured again of all that a fleet drove in closed loop."""
    count = len(driven.collisions)
    return (
        *(_apart(driven.distance_m, margin) if driven.closest else ()),
        nearest_fact(driven.closest),
        *clearance_facts(driven.clearance_m),
        Fact(label="collisions", value=str(count) if count else "none"),
    )


def _loop_facts(log: FleetLog) -> list[Fact]:
    broken = len({number for number, _ in log.violations})
    swaps = len(list(log.swaps))
    number = f"{len(log.arrived_s)} of {len(log.problem)} arrived"
    steps = f"{len(log.steps)}, {swaps} exchange{'' if swaps == 1 else 's'}"
    kept = f"broken in {broken} steps" if broken else "hold in every step"
    duration = float(log.times[-1] - log.times[0])
    return [
        Fact(label="goals", value="reached" if log.reached else log.reason, heads=False),
        Fact(label="vehicles", value=number),
        Fact(label="cost", value=log.cost),
        *_arrivals(log),
        Fact(label="duration", value=duration, unit="s", heads=False),
        Fact(label="steps", value=steps),
        Fact(label="guarantees", value=kept),
        *_apart(log.distance_m, log.problem.margin),
        Fact(label="left out", value="; ".join(left_out(*log.problem.problems)), heads=False),
        Fact(label="time per step", value=times_of(one.solve_s for one in log.steps), heads=False),
    ]


def tables(result: FleetResult | FleetLog, driven: DrivenVerdict | None = None) -> list[Table]:
    """Every vehicle; of a closed loop every step, and what was `driven` measured again."""
    if isinstance(result, FleetLog):
        return [_steps(result), _vehicles(result, driven or verify_driven(result))]
    rows = [
        [
            name,
            one.status.value,
            shown(one.cost, 6),
            "" if one.plan is None else f"{one.plan.start_time + one.plan.duration:.6g}",
            shown(one.clearance_m, 3),
            "" if one.plan is None else str(len(one.plan.primitives)),
        ]
        for name, one in result.results.items()
    ]
    columns = ("vehicle", "status", "cost", "arrival [s]", "clearance [m]", "primitives")
    return [Table(columns=columns, rows=rows, numbers=(2, 3, 4, 5))]


def _steps(log: FleetLog) -> Table:
    rows = [
        [
            str(step.number),
            f"{step.time:.6g}",
            shown(value, 6),
            f"{spent:.6g}",
            shown(step.distance_m, 3),
            few([" and ".join(swap.names) for swap in step.swaps]),
            str(len(step.asked)),
            "; ".join(
                f"{what}: {few(names)}"
                for what, names in (
                    ("plan void", step.void),
                    ("not let in", step.refused),
                    ("broken", [one.guarantee.value for one in step.violations]),
                )
                if names
            ),
            f"{1e3 * step.solve_s:.2f}",
        ]
        for step, value, spent in zip(log.steps, log.values.tolist(), _spent(log), strict=False)
    ]
    columns = ("", "time [s]", "value", "spent", "apart [m]", "swaps", "asked", "events",
               "solved [ms]")  # fmt: skip
    return Table(columns=columns, rows=rows, numbers=(0, 1, 2, 3, 4, 6, 8))


def _spent(log: FleetLog) -> Array:
    """What all had spent at the times of the log."""
    spent = np.zeros(log.times.size)
    for name in log.problem.names:
        for step, cost in log.costs_of(name).items():
            spent[step + 1] += cost
    return np.cumsum(spent)


def _vehicles(log: FleetLog, driven: DrivenVerdict) -> Table:
    rows = []
    for name in log.problem.names:
        arrived = log.arrived_s.get(name)
        status = "under way" if arrived is None else "arrived"
        status = "broken down" if name in log.broken_down else status
        rows.append([
            name,
            status if log.driven[name] or arrived is not None else "not there",
            shown(arrived, 6),
            f"{math.fsum(log.costs_of(name).values()):.6g}",
            str(sum(name in swap.names for _, swap in log.swaps)),
            f"{max((one.off_plan.get(name, 0.0) for one in log.steps), default=0.0):.2g}",
            shown(driven.clearances_m[name], 3),
        ])  # fmt: skip
    columns = ("vehicle", "status", "arrival [s]", "cost", "swaps", "off plan [m]", "clearance [m]")
    return Table(columns=columns, rows=rows, numbers=(2, 3, 4, 5, 6))


RECORDED = {FleetResult: _plans, FleetLog: _loop}

"""Recordings of closed loops of one vehicle, and of many of them."""

from __future__ import annotations

import numpy as np

from maneuver_automaton.automaton import Plan
from maneuver_automaton.receding_horizon import ClosedLoop
from maneuver_automaton.receding_horizon.statistics import Statistics
from maneuver_automaton.recording.values import Curve, Event, Fact, Recording, mover_of, world_of


def recorded(result: ClosedLoop | Statistics) -> Recording | None:
    """The recording of a closed loop."""
    if isinstance(result, Statistics):
        raise TypeError(
            "recording: got Statistics, which keep no motion of their loops; need one loop"
        )
    return _loop(result) if isinstance(result, ClosedLoop) else None


def _loop(loop: ClosedLoop) -> Recording:
    problem, begin = loop.problem, float(loop.times[0])
    still = Plan(loop.poses[0], (), durations=[], start_time=begin)
    mover = mover_of(
        problem,
        still,
        pieces=loop.driven or (still,),
        end=loop.poses[-1],
        reached=loop.reached,
        reason=loop.reason,
        cost=loop.cost,
        held=tuple((float(step.time), step.plan) for step in loop.steps),
    )
    values = np.array([*(step.value for step in loop.steps), loop.value])
    spent = np.array([*(step.accumulated_cost for step in loop.steps), loop.cost])
    begins, bounds = loop.times[:-1], np.array([step.lower_bound for step in loop.steps])
    return Recording(
        kind="closed_loop",
        title="Closed loop",
        status=loop.status,
        reason=loop.reason,
        ending="goal reached" if loop.reached else loop.reason,
        facts=tuple(_facts(loop)),
        movers=(mover,),
        world=world_of(problem),
        events=tuple(_events(loop)),
        curves=(
            Curve(label="value", time=loop.times, value=values),
            Curve(label="spent", time=loop.times, value=spent),
            Curve(label="lower bound", time=begins, value=bounds),
            Curve(label="solve time", unit="s", time=begins, value=loop.solve_s),
        ),
    )


def _facts(loop: ClosedLoop) -> list[Fact]:
    replanned = sum(step.replanned for step in loop.steps)
    facts = [
        Fact(label="cost", value=loop.cost, digits=6),
        Fact(label="duration", value=float(loop.times[-1] - loop.times[0]), unit="s"),
        Fact(label="steps", value=f"{len(loop.steps)}, {replanned} replanned"),
    ]
    if loop.min_clearance_m is not None:
        facts.append(Fact(label="clearance", value=loop.min_clearance_m, unit="m", digits=3))
    broken, taken = len(list(loop.violations)), len(list(loop.disturbed))
    kept = f"kept but {taken}, taken by noise" if taken else "all kept"
    return [*facts, Fact(label="guarantees", value=f"{broken} broken" if broken else kept)]


def _events(loop: ClosedLoop) -> list[Event]:
    rows = []
    for step in loop.steps:
        time = float(step.time)
        if step.replanned:
            rows.append(Event(time=time, kind="replanned", text=step.decision.value))
        rows += [Event(time=time, kind="broken", text=str(one)) for one in step.violations]
        rows += [Event(time=time, kind="disturbed", text=str(one)) for one in step.disturbed]
    return rows

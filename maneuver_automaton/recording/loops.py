"""Recordings of closed loops of one vehicle, and of many of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from maneuver_automaton.automaton import Plan
from maneuver_automaton.planning.polishing import left_out
from maneuver_automaton.receding_horizon import ClosedLoop, Guarantee
from maneuver_automaton.receding_horizon.statistics import Statistics
from maneuver_automaton.recording.plans import passed_on_the_way
from maneuver_automaton.recording.values import (
    Curve,
    Event,
    Fact,
    Recording,
    Table,
    asked_for,
    mover_of,
    times_of,
    world_of,
)


def _loop(loop: ClosedLoop | Statistics) -> Recording:
    if isinstance(loop, Statistics):
        raise TypeError(
            "recording: got Statistics, which keep no motion of their loops; need one loop"
        )
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
    problem, count = loop.problem, len(loop.steps)
    replanned = sum(step.replanned for step in loop.steps)
    disturbed = sum(bool(step.off_plan) for step in loop.steps)
    bound = loop.steps_bound if not disturbed else None  # the paper's is of undisturbed loops
    facts = [
        Fact(label="goal", value="reached" if loop.reached else loop.reason, heads=False),
        Fact(label="cost", value=loop.cost),
        Fact(label="duration", value=float(loop.times[-1] - loop.times[0]), unit="s"),
        Fact(
            label="steps",
            value=f"{count}, {replanned} replanned",
            more="" if bound is None else f" (the paper's bound: {bound})",
        ),
        *passed_on_the_way([one for one in loop.passed if not one.stay_left]),
        Fact(label="guarantees", value=_guarantees(loop, count - disturbed)),
    ]
    if disturbed:
        facts.append(Fact(label="under noise", value=_under_noise(loop, disturbed), heads=False))
    if problem.obstacles:
        least, hits = loop.min_clearance_m, len({number for number, _ in loop.collisions})
        said = f"in {hits} step{'' if hits == 1 else 's'}" if hits else "none"
        if least is None:
            facts.append(Fact(label="least clearance", value="nothing was driven", heads=False))
        else:
            kept = asked_for(least, problem.margin) if least > 0.0 else ""
            facts.append(Fact(label="least clearance", value=least, unit="m", digits=4, more=kept))
        facts.append(Fact(label="collisions", value=said, heads=bool(hits)))
    return [
        *facts,
        Fact(label="left out", value="; ".join(left_out(problem)), heads=False),
        Fact(label="time per step", value=times_of(loop.solve_s), heads=False),
    ]


def _guarantees(loop: ClosedLoop, undisturbed: int) -> str:
    """Whether what is promised holds in the steps that nothing disturbed, so many as given."""
    broken = len({number for number, _ in loop.violations})
    if broken:
        return f"broken in {broken} step{'' if broken == 1 else 's'}"
    if undisturbed == len(loop.steps):
        return "hold in every step"
    return f"hold in {undisturbed} of {len(loop.steps)} steps, those that nothing disturbed"


def _under_noise(loop: ClosedLoop, disturbed: int) -> str:
    """Which guarantees of the undisturbed loop hold under the noise that was met all the same."""
    taken = Counter(one.guarantee for _, one in loop.disturbed)
    rises = taken.pop(Guarantee.DECREASE, 0)
    said = (
        [f"it raised the value above the plan's in {rises} of {disturbed} steps"] if rises else []
    )
    if Guarantee.FEASIBILITY not in taken:
        said.append("recursive feasibility held" + ("" if rises else ", and the value decrease"))
    said += [f"{one.value} was lost in {count}" for one, count in taken.items()]
    return "; ".join(said)


def tables(loop: ClosedLoop) -> list[Table]:
    """Every step with its pose, value, decision and what is driven."""
    rows = [
        [
            str(step.number),
            f"{step.time:.5g}",
            " ".join(f"{value:.3f}" for value in step.pose + 0.0),
            f"{step.value:.5g}",
            f"{step.accumulated_cost:.5g}",
            step.decision.value,
            _driven(step.piece.word),
        ]
        for step in loop.steps
    ]
    nothing = "nothing to do: the start is the goal" if loop.reached else "nothing was driven"
    return [
        Table(
            columns=("", "t [s]", "pose", "value", "spent", "decision", "driven"),
            rows=rows,
            numbers=(0, 1, 2, 3, 4),
            instead=nothing,
        )
    ]


def _driven(word: Sequence[str]) -> str:
    """The first trim or maneuver of a step, and how many follow before the next one."""
    return f"{word[0]} +{len(word) - 1}" if len(word) > 1 else "".join(word)


def _events(loop: ClosedLoop) -> list[Event]:
    rows = []
    for step in loop.steps:
        time = float(step.time)
        if step.replanned:
            rows.append(Event(time=time, kind="replanned", text=step.decision.value))
        rows += [Event(time=time, kind="broken", text=str(one)) for one in step.violations]
        rows += [Event(time=time, kind="disturbed", text=str(one)) for one in step.disturbed]
    return rows


def statistics_facts(statistics: Statistics) -> tuple[Fact, ...]:
    """Shares of many loops, their costs, and what their steps took."""
    milliseconds, costs = 1e3 * statistics.solve_s, [one.cost for one in statistics.outcomes]
    middle = f"{np.median(costs):.6g} median, {min(costs):.6g} to {max(costs):.6g}"
    kept = "none that was given is broken"
    if statistics.broken:
        kept = f"broken in {statistics.broken} of {len(milliseconds)} steps"
    times = ""
    if milliseconds.size:
        late = np.percentile(milliseconds, 99)
        times = f"{np.median(milliseconds):.2f} ms median, {late:.2f} ms p99"
    return (
        Fact(label="loops", value=str(len(costs))),
        Fact(label="reached", value=f"{statistics.reached:.1%}"),
        Fact(label="stayed", value=f"{statistics.stayed:.1%}"),
        Fact(label="cost", value=middle),
        Fact(label="guarantees", value=kept),
        Fact(label="time per step", value=times),
    )


def causes(statistics: Statistics) -> Iterator[str]:
    """How often which guarantee was broken, and why loops ended without their goal."""
    outcomes = statistics.outcomes
    for what, found in (
        ("broken", [violation for one in outcomes for _, violation in one.violations]),
        ("taken by noise", [violation for one in outcomes for _, violation in one.disturbed]),
    ):
        for cause, count in Counter(one.guarantee.value for one in found).most_common():
            yield f"{count} x {what}: {cause}"
    yield from (f"seed {one.seed}: {one.reason}" for one in outcomes if one.reason)


RECORDED = {ClosedLoop: _loop, Statistics: _loop}

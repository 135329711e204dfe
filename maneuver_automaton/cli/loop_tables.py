"""Tables that `mpc` prints."""

from __future__ import annotations

import collections
from collections.abc import Iterable, Sequence

import numpy as np
from rich.text import Text

from maneuver_automaton.cli.tables import console, kept_text, print_facts, table
from maneuver_automaton.planning.polishing import left_out
from maneuver_automaton.receding_horizon import ClosedLoop, Guarantee, Statistics

MOST_ROWS = 60  # of the table of steps; the file has all of them


def print_loop(name: str, loop: ClosedLoop, *, folder: str) -> None:
    """Every step with its pose, value, decision and what is driven, and how the loop ended."""
    out = console()
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
    columns = ["", "t [s]", "pose", "value", "spent", "decision", "driven"]
    if rows:
        out.print(table(name, columns, shortened(rows), numbers=(0, 1, 2, 3, 4)))
    else:
        said = "nothing to do: the start is the goal" if loop.reached else "nothing was driven"
        out.print(Text(f"{name}\n\n  {said}\n"))
    disturbed = sum(bool(step.off_plan) for step in loop.steps)
    known = loop.steps_bound is not None and not disturbed  # the paper's is of undisturbed loops
    bound = f" (the paper's bound: {loop.steps_bound})" if known else ""
    facts = {
        "goal": "reached" if loop.reached else loop.reason,
        "cost": f"{loop.cost:.9g}",
        "steps": f"{len(loop.steps)}{bound}",
        "guarantees": _guarantees(loop, len(loop.steps) - disturbed),
    }
    if disturbed:
        facts["under noise"] = _under_noise(loop, disturbed)
    if loop.problem.obstacles:
        hits = len({number for number, _ in loop.collisions})
        said = f"in {hits} step{'' if hits == 1 else 's'}" if hits else "none"
        facts |= {"least clearance": _clearance(loop), "collisions": said}
    if missing := left_out(loop.problem):
        facts["left out"] = "; ".join(missing)
    facts["written to"] = folder
    if rows:
        facts["time per step"] = times_of(loop.solve_s)
    print_facts(facts)


def times_of(solve_s: Iterable[float]) -> str:
    """What steps took [s], in words; empty if there is none."""
    milliseconds = [1e3 * one for one in solve_s]
    if not milliseconds:
        return ""
    return f"{np.median(milliseconds):.2f} ms median, {max(milliseconds):.2f} ms at most"


def shortened(rows: list[list[str]]) -> list[list[str]]:
    """The first and the last rows of a table that has many."""
    if len(rows) <= MOST_ROWS:
        return rows
    gap = ["...", *[""] * (len(rows[0]) - 1)]
    return [*rows[: MOST_ROWS - 5], gap, *rows[-4:]]


def _driven(word: Sequence[str]) -> str:
    """The first trim or maneuver of a step, and how many follow before the next one."""
    return f"{word[0]} +{len(word) - 1}" if len(word) > 1 else "".join(word)


def _guarantees(loop: ClosedLoop, calm: int) -> str:
    """Whether what is promised to the undisturbed loop holds; `calm`: how many steps that were."""
    broken = len({number for number, _ in loop.violations})
    if broken:
        return f"broken in {broken} step{'' if broken == 1 else 's'}"
    if calm == len(loop.steps):
        return "hold in every step"
    return f"hold in {calm} of {len(loop.steps)} steps, those that nothing disturbed"


def _under_noise(loop: ClosedLoop, disturbed: int) -> str:
    """Which guarantees of the undisturbed loop hold under the noise that was met all the same."""
    taken = collections.Counter(one.guarantee for _, one in loop.disturbed)
    rises = taken.pop(Guarantee.DECREASE, 0)
    said = (
        [f"it raised the value above the plan's in {rises} of {disturbed} steps"] if rises else []
    )
    if Guarantee.FEASIBILITY not in taken:
        said.append("recursive feasibility held" + ("" if rises else ", and the value decrease"))
    said += [f"{one.value} was lost in {count}" for one, count in taken.items()]
    return "; ".join(said)


def _clearance(loop: ClosedLoop) -> str:
    least = loop.min_clearance_m
    if least is None:
        return "nothing was driven"
    return f"{least:.4g} m{kept_text(least, loop.problem.margin) if least > 0.0 else ''}"


def print_statistics(name: str, statistics: Statistics, *, folder: str) -> None:
    """Shares, and the cause of every failure."""
    out = console()
    outcomes = statistics.outcomes
    milliseconds = 1e3 * statistics.solve_s
    costs = [one.cost for one in outcomes]
    facts = {
        "loops": str(len(outcomes)),
        "reached": f"{statistics.reached:.1%}",
        "stayed": f"{statistics.stayed:.1%}",
        "cost": f"{np.median(costs):.6g} median, {min(costs):.6g} to {max(costs):.6g}",
        "guarantees": f"broken in {statistics.broken} of {len(milliseconds)} steps"
        if statistics.broken
        else "none that was given is broken",
        "written to": folder,
    }
    if milliseconds.size:
        facts["time per step"] = (
            f"{np.median(milliseconds):.2f} ms median, {np.percentile(milliseconds, 99):.2f} ms p99"
        )
    out.print(Text(f"{name}\n"))
    print_facts(facts)
    for what, found in (
        ("broken", [violation for one in outcomes for _, violation in one.violations]),
        ("taken by noise", [violation for one in outcomes for _, violation in one.disturbed]),
    ):
        causes = collections.Counter(violation.guarantee.value for violation in found)
        for cause, count in causes.most_common():
            out.print(Text(f"  {count} x {what}: {cause}"), soft_wrap=True)
    for one in outcomes:
        if one.reason:
            out.print(Text(f"  seed {one.seed}: {one.reason}"), soft_wrap=True)

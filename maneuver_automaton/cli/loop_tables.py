"""Tables that `mpc` prints."""

from __future__ import annotations

import collections

import numpy as np
from rich.text import Text

from maneuver_automaton.cli.tables import console, table
from maneuver_automaton.planning.polishing import left_out
from maneuver_automaton.receding_horizon import ClosedLoop, Statistics

MOST_ROWS = 60  # of the table of steps; the file has all of them


def print_loop(name: str, loop: ClosedLoop, *, folder: str) -> None:
    """Every step with its value, word and origin, and how it ended."""
    out = console()
    rows = [
        [
            str(step.number),
            f"{step.time:.6g}",
            ", ".join(f"{value:.4f}" for value in step.pose),
            "" if step.control is None else ", ".join(f"{value:.4g}" for value in step.control),
            f"{step.value:.6g}",
            f"{step.accumulated_cost:.6g}",
            " - ".join(step.plan.word),
            step.deed.value,
            step.origin.value,
            f"{1e3 * step.solve_s:.2f}",
        ]
        for step in loop.steps
    ]
    columns = ["", "time [s]", "pose", "control", "value", "spent", "word", "deed", "plan",
               "solved [ms]"]  # fmt: skip
    if rows:
        out.print(table(name, columns, shortened(rows), numbers=(0, 1, 4, 5, 9)))
    else:
        out.print(Text(f"{name}\n\n  nothing to do: the start is the goal\n"))
    broken = len({number for number, _ in loop.violations})
    bound = "" if loop.steps_bound is None else f" (the paper's bound: {loop.steps_bound})"
    facts = {
        "goal": "reached" if loop.reached else loop.reason,
        "cost": f"{loop.cost:.9g}",
        "steps": f"{len(loop.steps)}{bound}",
        "guarantees": f"broken in {broken} steps" if broken else "hold in every step",
    }
    if loop.problem.obstacles:
        facts |= {"least clearance": _clearance(loop), "collisions": _collisions(loop)}
    if missing := left_out(loop.problem):
        facts["left out"] = "; ".join(missing)
    facts["written to"] = folder
    if rows:
        milliseconds = 1e3 * loop.solve_s
        facts["time per step"] = (
            f"{np.median(milliseconds):.2f} ms median, {milliseconds.max():.2f} ms at most"
        )
    for what, value in facts.items():
        out.print(Text(f"  {what + ':':<16}{value}"), soft_wrap=True)


def shortened(rows: list[list[str]]) -> list[list[str]]:
    """The first and the last rows of a table that has many."""
    if len(rows) <= MOST_ROWS:
        return rows
    gap = ["...", *[""] * (len(rows[0]) - 1)]
    return [*rows[: MOST_ROWS - 5], gap, *rows[-4:]]


def _clearance(loop: ClosedLoop) -> str:
    least = loop.min_clearance_m
    return "nothing was driven" if least is None else f"{least:.4g} m"


def _collisions(loop: ClosedLoop) -> str:
    hits = len({number for number, _ in loop.collisions})
    return f"in {hits} step{'' if hits == 1 else 's'}" if hits else "none"


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
        "guarantees": f"broken in {statistics.broken} of {len(milliseconds)} steps",
        "written to": folder,
    }
    if milliseconds.size:
        facts["time per step"] = (
            f"{np.median(milliseconds):.2f} ms median, {np.percentile(milliseconds, 99):.2f} ms p99"
        )
    out.print(Text(f"{name}\n"))
    for what, value in facts.items():
        out.print(Text(f"  {what + ':':<16}{value}"), soft_wrap=True)
    causes = collections.Counter(
        violation.guarantee.value for one in outcomes for _, violation in one.violations
    )
    for cause, count in causes.most_common():
        out.print(Text(f"  {count} x broken: {cause}"), soft_wrap=True)
    for one in outcomes:
        if one.reason:
            out.print(Text(f"  seed {one.seed}: {one.reason}"), soft_wrap=True)

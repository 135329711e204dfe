"""Tables that the commands print: values in, rich tables out."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from rich import box
from rich.console import Console, JustifyMethod
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from maneuver_automaton.automaton import Plan, Primitive
    from maneuver_automaton.planning import PlanResult
    from maneuver_automaton.problem import Problem

WIDE = 160  # columns where the output goes to no terminal, and COLUMNS does not say


def console() -> Console:
    """Standard output, without markup: names are printed as they are."""
    return Console(
        file=sys.stdout,
        width=None if sys.stdout.isatty() or "COLUMNS" in os.environ else WIDE,
        markup=False,
        emoji=False,
        highlight=False,
    )


def table(
    title: str,
    columns: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    numbers: Sequence[int] = (),
) -> Table:
    """Rows under `columns`; those in `numbers` are aligned to the right."""
    made = Table(
        title=title or None,
        box=box.SIMPLE_HEAD,
        title_justify="left",
        title_style="bold",
        padding=(0, 1, 0, 0),
        pad_edge=False,
    )
    for k, column in enumerate(columns):
        number = k in numbers
        justify: JustifyMethod = "right" if number else "left"
        made.add_column(column, justify=justify, overflow="fold", no_wrap=number)
    for row in rows:
        made.add_row(*(Text(cell) for cell in row))
    return made


def print_result(name: str, result: PlanResult, *, folder: str) -> None:
    """Word, durations, cost, what it keeps to and what it took; and the alternatives."""
    plan, error = result.plan, result.terminal_error
    if plan is None or result.cost is None or error is None:
        return
    out, names = console(), result.problem.automaton.model.control_names
    rows = [
        [str(k + 1), one.name, _control(one), f"{duration:.6g}"]
        for k, (one, duration) in enumerate(
            zip(plan.primitives, plan.primitive_durations, strict=True)
        )
    ]
    columns = ["", "primitive" if any(plan.maneuvers) else "trim", ", ".join(names), "duration [s]"]
    if rows:
        out.print(table(name, columns, rows, numbers=(0, 2, 3)))
    else:
        out.print(Text(f"{name}\n\n  nothing to do: the start is the goal\n"))
    facts = {
        "cost": f"{result.cost:.9g}{_bound(result)}",
        "duration": f"{plan.duration:.9g} s",
        "turning points": f"{_direction_changes(result.problem, plan)} between forward and reverse",
        "clearance": _clearance(result),
        "terminal error": f"{error.position_m:.2g} m, {error.heading_rad:.2g} rad",
        "timing": ", ".join(f"{spoken(k)} {v:.3f} s" for k, v in result.timing_s.items()),
        "counts": ", ".join(f"{spoken(k)} {n}" for k, n in result.counts.items()),
        "left out": "; ".join(result.notes),
        "written to": folder,
    }
    for what, value in facts.items():
        if value:
            out.print(Text(f"  {what + ':':<16}{value}"), soft_wrap=True)
    if result.alternatives:
        out.print()
        _print_alternatives(out, result)


def _print_alternatives(out: Console, result: PlanResult) -> None:
    rows = [
        [str(k + 1), f"{one.cost:.6g}", f"{one.plan.duration:.6g}", _word(one.plan.word)]
        for k, one in enumerate(result.alternatives)
    ]
    columns = ["", "cost", "duration [s]", "word"]
    out.print(table("Alternatives", columns, rows, numbers=(0, 1, 2)))


def _bound(result: PlanResult) -> str:
    if result.lower_bound is None or result.gap is None:
        return ""
    if result.bound is not None and result.bound.kind == "incumbent":
        return " (proven optimal)"
    return f" (at least {result.lower_bound:.9g}, gap {100 * result.gap:.2g} %)"


def _clearance(result: PlanResult) -> str:
    if result.clearance_m is None or math.isinf(result.clearance_m):
        return ""
    kept = f", {result.problem.margin:g} m asked for" if result.problem.margin else ""
    return f"{result.clearance_m:.3g} m to the nearest obstacle{kept}"


def _control(primitive: Primitive) -> str:
    """The control of a trim; that of a maneuver varies."""
    from maneuver_automaton.primitives import Maneuver

    return "maneuver" if isinstance(primitive, Maneuver) else _numbers(primitive.control)


def _direction_changes(problem: Problem, plan: Plan) -> int:
    """How often the plan changes between ahead and back: its price, where that is all."""
    from maneuver_automaton.costs import Cost

    return round(replace(problem, cost=Cost(direction_change=1.0)).cost_of(plan))


def spoken(name: str) -> str:
    """A key of plan.json as people say it."""
    return name.replace("_", " ").replace("fcl", "FCL")


def _word(names: Sequence[str]) -> str:
    return " - ".join(names) or "(stays)"


def _numbers(values: Iterable[float]) -> str:
    return ", ".join(f"{value:.6g}" for value in values)

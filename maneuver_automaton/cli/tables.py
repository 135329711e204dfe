"""Tables that the commands print: values in, rich tables out."""

from __future__ import annotations

import itertools
import math
import os
import sys
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from rich import box
from rich.console import Console, JustifyMethod
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from pathlib import Path

    from maneuver_automaton.automaton import Primitive
    from maneuver_automaton.models import Model
    from maneuver_automaton.planning import PlanResult
    from maneuver_automaton.primitives import Maneuver

STRAIGHT = 0.01  # [1/m, rad/s] of curvature, or turning on the spot, that is called straight
TIGHT_M = 1e-3  # [m] a clearance that is smaller is remarked on
FACTS = 18  # columns before what is said of a fact
AT_REST = 1e-3  # [m/s]
SIDES = (", left", ", right")
BRIEF_S = 0.2  # straight between two bends, or at rest: what is shorter is told with a neighbour
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


def print_written(*paths: Path) -> None:
    """Say which files were written."""
    console().print(f"wrote {' and '.join(map(str, paths))}", soft_wrap=True)


def print_facts(facts: Mapping[str, str]) -> None:
    """A line for each fact that is known, wrapped where the terminal ends."""
    out = console()
    for what, value in facts.items():
        if value:
            line = f"  {what + ':':<{FACTS - 3}} {value}"
            wrapped = textwrap.wrap(
                line, out.width, subsequent_indent=" " * FACTS,
                break_long_words=False, break_on_hyphens=False,
            )  # fmt: skip
            out.print(Text("\n".join(wrapped)), soft_wrap=True)


def print_result(name: str, result: PlanResult, *, folder: str, share: bool = False) -> None:
    """Word, durations, cost, what it keeps to and what it took; and the alternatives.

    With `share` the gap is told, too, as a share of the cost.
    """
    plan, error = result.plan, result.terminal_error
    if plan is None or result.cost is None or error is None:
        return
    from maneuver_automaton.costs import Cost

    by_changes = replace(result.problem, cost=Cost(direction_change=1.0))  # what they are alone
    out, automaton = console(), result.problem.automaton
    known = {one.name for one in automaton.maneuvers}
    rows = [
        [str(k + 1), *row]
        for k, row in enumerate(
            row
            for one, duration in zip(plan.primitives, plan.primitive_durations, strict=True)
            for row in _rows(one, duration, None if one.name in known else automaton.model)
        )
    ]
    columns = ["", "primitive" if any(plan.maneuvers) else "trim"]
    columns += [", ".join(automaton.model.control_names), "duration [s]"]
    if rows:
        out.print(table(name, columns, rows, numbers=(0, 2, 3)))
    else:
        out.print(Text(f"{name}\n\n  nothing to do: the start is the goal\n"))
    facts = {
        "cost": f"{result.cost:.9g}{_bound(result, share=share)}",
        "duration": f"{plan.duration:.9g} s",
        "turning points": f"{round(by_changes.cost_of(plan))} between forward and reverse",
        "clearance": _clearance(result),
        "terminal error": f"{error.position_m:.2g} m, {error.heading_rad:.2g} rad",
        "timing": ", ".join(f"{spoken(k)} {v:.3f} s" for k, v in result.timing_s.items()),
        "counts": ", ".join(f"{spoken(k)} {n}" for k, n in result.counts.items()),
        "notes": "; ".join(result.notes),
        "written to": folder,
    }
    print_facts(facts)
    if result.alternatives:
        out.print()
        rows = [
            [str(k + 1), f"{one.cost:.6g}", f"{one.plan.duration:.6g}", _word(one.plan.word)]
            for k, one in enumerate(result.alternatives)
        ]
        columns = ["", "cost", "duration [s]", "word"]
        out.print(table("Alternatives", columns, rows, numbers=(0, 1, 2)))


def _bound(result: PlanResult, *, share: bool) -> str:
    if result.lower_bound is None or result.gap is None:
        return ""
    optimal = result.gap <= 0.0 or (result.bound is not None and result.bound.kind == "incumbent")
    gap = f", gap {100 * result.gap:.2g} %" if share and not optimal else ""
    return f" ({proven(result.lower_bound, optimal=optimal)}{gap})"


def proven(bound: float, *, optimal: bool) -> str:
    """What a lower bound proves, in words.

    Examples
    --------
    >>> proven(2.9512, optimal=False), proven(3.0, optimal=True)
    ('proven: at least 2.9512', 'proven optimal')
    """
    return "proven optimal" if optimal else f"proven: at least {bound:.9g}"


def _clearance(result: PlanResult) -> str:
    if result.clearance_m is None or math.isinf(result.clearance_m):
        return ""
    kept = kept_text(result.clearance_m, result.problem.margin)
    return f"{result.clearance_m:.3g} m to the nearest obstacle{kept}"


def kept_text(distance: float, margin: float) -> str:
    """What is to be said of a least distance [m]: the margin, or that there is next to none.

    Examples
    --------
    >>> kept_text(0.2, 0.1), kept_text(0.2, 0.0), kept_text(2e-5, 0.0)
    (', 0.1 m asked for', '', ': less than 1 mm, as margin_m is 0')
    """
    if margin:
        return f", {margin:g} m asked for"
    return ": less than 1 mm, as margin_m is 0" if distance < TIGHT_M else ""


def _rows(primitive: Primitive, duration: float, model: Model | None) -> list[list[str]]:
    """Name, control and duration of a trim or maneuver; with a model, of a maneuver's stretches."""
    from maneuver_automaton.primitives import Maneuver

    if not isinstance(primitive, Maneuver):
        return [[primitive.name, _numbers(primitive.control), f"{duration:.6g}"]]
    found = [] if model is None else stretches(primitive, model)
    return [
        [f"{primitive.name}: {what}", "varies", f"{seconds:.6g}"] for what, seconds in found
    ] or [[primitive.name, "maneuver", f"{duration:.6g}"]]


def stretches(maneuver: Maneuver, model: Model) -> list[tuple[str, float]]:
    """What a maneuver does one after the other, in words, and for how long [s].

    A stretch ends where the direction of travel or the side to which it bends changes.

    Examples
    --------
    >>> from maneuver_automaton.models import Car
    >>> from maneuver_automaton.primitives import Maneuver, Trajectory
    >>> course = Trajectory(
    ...     time=np.array([0.0, 1.0, 3.0]), pose=np.array([[0.0, 0, 0], [1, 0, 0], [-1, 0, 0]]),
    ...     reduced_state=np.zeros((3, 0)), control=np.array([[1.0, 0.0], [-1.0, 0.0], [-1.0, 0]]))
    >>> hop = Maneuver.along(course, name="hop", source="a", target="b")
    >>> stretches(hop, Car(wheelbase=2.0))
    [('ahead', 1.0), ('reverse', 2.0)]
    """
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
    told: list[tuple[str, float]] = []
    early = 0.0  # what is brief goes with what came before, or else with the first
    for what, seconds in lasting:
        if told or (what, seconds) == clear[0]:
            told.append((what if (what, seconds) in clear else told[-1][0], seconds))
        else:
            early += seconds
    told[0] = (told[0][0], told[0][1] + early)
    return _runs(told)


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


def spoken(name: str) -> str:
    """A key of plan.json as people say it."""
    return name.replace("_", " ").replace("fcl", "FCL")


def _word(names: Sequence[str]) -> str:
    return " - ".join(names) or "(stays)"


def _numbers(values: Iterable[float]) -> str:
    return ", ".join(f"{value:.6g}" for value in values)

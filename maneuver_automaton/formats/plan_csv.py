"""A plan as a table of text: one line an instant, numbers that read back to the last bit."""

from __future__ import annotations

import csv
import io
from pathlib import Path

from maneuver_automaton._files import write_text_atomically
from maneuver_automaton.automaton import Plan
from maneuver_automaton.models import Model
from maneuver_automaton.planning import PlanResult


def save_csv(
    plan: Plan | PlanResult,
    path: Path | str,
    *,
    step: float | None = None,
    model: Model | None = None,
) -> None:
    """Write a plan as CSV: a line of names, then the rows of `Plan.as_arrays`.

    Parameters
    ----------
    plan : Plan or PlanResult
        A result brings the model along.
    path : Path or str
        The file.
    step, model : optional
        See `Plan.as_arrays`.

    Raises
    ------
    ValueError
        If a result has no plan, or a maneuver no course.
    OSError
        If the file cannot be written.
    """
    if isinstance(plan, PlanResult):
        if plan.plan is None:
            raise ValueError(f"{path}: the result has no plan to write: {plan.reason}")
        model = plan.problem.automaton.model if model is None else model
        plan = plan.plan
    columns = plan.as_arrays(step=step, model=model).columns()
    text = io.StringIO()
    lines = csv.writer(text, lineterminator="\n")
    lines.writerow(columns)
    lines.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))
    write_text_atomically(Path(path), text.getvalue())

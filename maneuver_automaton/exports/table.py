"""A table of text: one line an instant, numbers that read back to the last bit."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import TYPE_CHECKING

from maneuver_automaton._files import write_text_atomically
from maneuver_automaton.exports.driven import driven_of
from maneuver_automaton.exports.kinematics import kinematics
from maneuver_automaton.models import Model

if TYPE_CHECKING:
    from maneuver_automaton.exports.driven import Exportable


def save_csv(
    value: Exportable,
    path: Path | str,
    *,
    step: float | None = None,
    model: Model | None = None,
) -> None:
    """Write a plan, a closed loop or a drive as CSV: a line of names, then one line an instant.

    Before the last column of `Plan.as_arrays`, the primitive, stand those of the path: arc length,
    curvature, steering angle, and, where the model is known, accelerations and jerk, as far as the
    vehicle has them.

    Parameters
    ----------
    value : Plan, PlanResult, ClosedLoop, RoadPlanResult or RoadDrive
        All but a Plan bring their model along.
    path : Path or str
        The file.
    step : float, optional
        Time between lines [s]; lines are at most 0.05 m and 0.05 rad apart if left out.
    model : Model, optional
        The vehicle of a Plan, see `Plan.as_arrays`.

    Raises
    ------
    ValueError
        If a result has no plan, or a maneuver no course.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> from maneuver_automaton.automaton import Plan
    >>> from maneuver_automaton.primitives import Trim
    >>> ahead = Trim(name="ahead", body_velocity=[1.0, 0.0, 0.0], control=[1.0])
    >>> folder = getfixture("tmp_path")
    >>> save_csv(Plan([0, 0, 0], (ahead,), durations=[2.0]), folder / "plan.csv", step=1.0)
    >>> print((folder / "plan.csv").read_text().splitlines()[2])
    1.0,1.0,0.0,0.0,1.0,0.0,0.0,1.0,1.0,0.0,ahead
    """
    driven = driven_of(value, model=model)
    samples = driven.rows()
    rows = samples if step is None else driven.rows(step=step)
    columns = rows.columns()
    primitive = columns.pop("primitive")  # stays the last one
    columns |= {**kinematics(rows, samples, driven.model), "primitive": primitive}
    text = io.StringIO()
    lines = csv.writer(text, lineterminator="\n")
    lines.writerow(columns)
    lines.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))
    write_text_atomically(Path(path), text.getvalue())

"""A table of text: one line an instant, numbers that read back to the last bit."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike

from maneuver_automaton._files import write_text_atomically
from maneuver_automaton.exports.earth import degrees_of
from maneuver_automaton.exports.kinematics import kinematics
from maneuver_automaton.models import Model
from maneuver_automaton.recording import Mover, recording_to_write


def save_csv(
    value: Any,
    path: Path | str,
    *,
    step: float | None = None,
    model: Model | None = None,
    origin: ArrayLike | None = None,
) -> None:
    """Write a plan, a closed loop, a fleet or a drive as CSV: names, then one line an instant.

    Before the last column of `Plan.as_arrays`, the primitive, stand those of the path: arc length,
    curvature, steering angle, and, where the model is known, accelerations and jerk, as far as the
    vehicle has them. Of several vehicles the first column names the vehicle, whose lines follow
    each other; a column that it does not have is empty.

    Parameters
    ----------
    value : any result, or a Recording
        All but a Plan bring their models along.
    path : Path or str
        The file.
    step : float, optional
        Time between lines [s]; lines are at most 0.05 m and 0.05 rad apart if left out.
    model : Model, optional
        The vehicle of a Plan, see `Plan.as_arrays`.
    origin : (float, float), optional
        Latitude and longitude [deg] of the point x = y = 0; x is east, y north. Then there are
        columns ``longitude_deg`` and ``latitude_deg``, see `degrees_of`.

    Raises
    ------
    TypeError
        If nobody moves in the value.
    ValueError
        If nobody has a plan, a maneuver has no course, or the origin is no place of the Earth.
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
    recording = recording_to_write(value, model=model)
    tables = {one.name: _columns(one, step, origin) for one in recording.drivers}
    names = list(dict.fromkeys(name for table in tables.values() for name in table))
    names.append(names.pop(names.index("primitive")))  # stays the last one
    several = len(recording.movers) > 1
    text = io.StringIO()
    lines = csv.writer(text, lineterminator="\n")
    lines.writerow(["vehicle", *names] if several else names)
    for name, table in tables.items():
        nothing = [""] * len(table["primitive"])
        rows = zip(*(table.get(column, nothing) for column in names), strict=True)
        lines.writerows([name, *row] if several else row for row in rows)
    write_text_atomically(Path(path), text.getvalue())


def _columns(mover: Mover, step: float | None, origin: ArrayLike | None) -> dict[str, list[Any]]:
    samples = mover.rows()
    rows = samples if step is None else mover.rows(step=step)
    columns = rows.columns() | kinematics(rows, samples, mover.model)
    if origin is not None:
        degrees = degrees_of(rows.pose[:, :2], origin=origin)
        columns["longitude_deg"], columns["latitude_deg"] = degrees.T
    return {name: column.tolist() for name, column in columns.items()}

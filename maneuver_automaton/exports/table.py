"""Rows of a motion: what it feels like at each of them, and a table of text of that."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array
from maneuver_automaton._files import write_text_atomically
from maneuver_automaton.automaton.plan_arrays import PlanArrays
from maneuver_automaton.exports.earth import degrees_of
from maneuver_automaton.models import Model
from maneuver_automaton.recording import Mover, recording_to_write

TINY = 1e-30  # of a complex step, which no digit is lost to
AT_REST = 1e-9  # [m/s, rad/s]
STEP_S = 1e-5  # [s] of a difference where a function does not take complex numbers, and of jerk


def kinematics(rows: PlanArrays, samples: PlanArrays, model: Model | None) -> dict[str, Array]:
    """Columns (n,) for rows of a motion, those that its vehicle has.

    Accelerations are those of the point that the pose is of, along the body's axes, and follow from
    the model's equations under the control that begins at the row; so do their rates, the jerk, to
    which the jumps of a control add what is infinite. Without the model they are not known.

    Parameters
    ----------
    rows : PlanArrays
        Of a plan or of what was driven, at any times.
    samples : PlanArrays
        The same motion at its own times, between which the velocity is taken as linear in time.
    model : Model, optional
        The vehicle.

    Returns
    -------
    dict of arrays
        ``arc_length_m`` driven since the start, backwards too; ``curvature_1_m``, turn rate by
        ``v_x``, of a vehicle that slips sideways that of its path, nan where it turns on the spot;
        ``steering_rad`` of what steers; ``lateral_acceleration_m_s2``; and, with inertia,
        ``acceleration_m_s2``, ``jerk_m_s3`` and ``lateral_jerk_m_s3``.
    """
    columns = {"arc_length_m": _arc_length(rows.time, samples, model)}
    rates, felt = np.zeros_like(rows.twist), np.zeros((len(rows.time), 2))
    inertia = False
    if model is not None:
        rates = twist_rates(model, rows.reduced_state, rows.control)
        felt = accelerations(rows.twist, rates)
        inertia = any(  # the velocity depends on the reduced state: it changes at a finite rate
            _derivative(model, rows.reduced_state, rows.control, along, 0.0).any()
            for along in np.eye(len(model.reduced_names))
        )
    columns["curvature_1_m"] = _curvature(rows, rates, model)
    if (steering := component(rows, "steering")) is not None:
        columns["steering_rad"] = steering
    if model is None:
        return columns
    if inertia:
        columns["acceleration_m_s2"] = felt[:, 0]
    columns["lateral_acceleration_m_s2"] = felt[:, 1]
    if inertia:
        columns["jerk_m_s3"], columns["lateral_jerk_m_s3"] = _jerk(model, rows).T
    return columns


def component(rows: PlanArrays, name: str) -> Array | None:
    """A component (n,) of the reduced state or the control; None if the model has none."""
    for names, values in (
        (rows.reduced_names, rows.reduced_state),
        (rows.control_names, rows.control),
    ):
        if name in names:
            return np.asarray(values[:, names.index(name)])
    return None


def _arc_length(times: Array, samples: PlanArrays, model: Model | None) -> Array:
    """Distance (n,) driven until each time: between samples the velocity is linear in time."""
    axes = [0, 1, *range(3, samples.twist.shape[1])]
    begin = samples.twist[:-1, axes]
    change = np.zeros_like(begin)
    if model is not None:
        control, state = samples.control[:-1], samples.reduced_state
        gained = model.body_velocity(state[1:], control) - model.body_velocity(state[:-1], control)
        change = gained[:, axes]
    spans = np.diff(samples.time)
    upto = np.append(0.0, np.cumsum(_length(begin, begin + change, spans)))
    if not spans.size:
        return np.zeros_like(times)
    k = np.clip(np.searchsorted(samples.time, times, side="right") - 1, 0, spans.size - 1)
    since = np.clip(times - samples.time[k], 0.0, spans[k])
    share = np.where(spans[k] > 0.0, since / np.where(spans[k] > 0.0, spans[k], 1.0), 0.0)
    end = begin[k] + share[:, None] * change[k]
    return np.asarray(upto[k] + _length(begin[k], end, since))


def _length(begin: Array, end: Array, seconds: Array) -> Array:
    """Length (n,) of paths whose velocities (n, m) change linearly: along one axis, exact."""
    a, b = begin[:, 0], end[:, 0]
    both = np.abs(a) + np.abs(b)
    turned = np.where(both > 0.0, (a * a + b * b) / np.where(both > 0.0, both, 1.0), 0.0)
    along = np.where(a * b < 0.0, turned, both) / 2.0
    first, middle, last = (np.linalg.norm(v, axis=1) for v in (begin, (begin + end) / 2.0, end))
    aside = begin[:, 1:].any(axis=1) | end[:, 1:].any(axis=1)
    return np.asarray(seconds * np.where(aside, (first + 4.0 * middle + last) / 6.0, along))


def accelerations(twist: Array, rates: Array) -> Array:
    """Acceleration (n, 2) ahead and to the left, of a twist (n, dof) that changes at `rates`."""
    turn = twist[:, 2]
    return np.stack([rates[:, 0] - turn * twist[:, 1], rates[:, 1] + turn * twist[:, 0]], axis=-1)


def _curvature(rows: PlanArrays, rates: Array, model: Model | None) -> Array:
    ahead, aside, turn = rows.twist[:, 0], rows.twist[:, 1], rows.twist[:, 2]
    speed = np.hypot(ahead, aside)
    with np.errstate(divide="ignore", invalid="ignore"):
        if aside.any():  # by its direction of travel
            felt = accelerations(rows.twist, rates)
            bend = (ahead * felt[:, 1] - aside * felt[:, 0]) / speed**3
        else:
            bend = turn / ahead
    stands = speed < AT_REST
    bend, n_z = np.where(stands, 0.0, bend), rows.reduced_state.shape[1]
    if model is not None:  # at rest it is that with which the vehicle would set off
        for along in np.eye(n_z + rows.control.shape[1]):
            change = _derivative(model, rows.reduced_state, rows.control, along[:n_z], along[n_z:])
            moves = stands & (change[:, 0] != 0.0)
            bend[moves] = change[moves, 2] / change[moves, 0]  # of turn rate to speed, as both rise
    return np.where(stands & (np.abs(turn) >= AT_REST), np.nan, bend)


def twist_rates(model: Model, state: Array, control: Array) -> Array:
    """Rates (n, dof) of the twist while a control holds."""
    if not state.shape[1]:
        return np.zeros((len(state), model.group.dof))
    return _derivative(model, state, control, model.reduced_dynamics(state, control), 0.0)


def _derivative(model: Model, state: Array, control: Array, along: Array, push: Any) -> Array:
    """Derivative (n, dof) of the twist along changes of state and control: by a complex step."""
    try:
        twist = model.velocity(
            np.moveaxis(state + 1j * TINY * along, -1, 0),
            np.moveaxis(control + 1j * TINY * push, -1, 0),
        )
        columns = [np.broadcast_to(np.imag(one) / TINY, len(state)) for one in twist]
        return np.stack(columns, axis=-1)
    except TypeError:  # a function that takes real numbers alone
        after = model.body_velocity(state + STEP_S * along, control + STEP_S * push)
        before = model.body_velocity(state - STEP_S * along, control - STEP_S * push)
        return np.asarray((after - before) / (2.0 * STEP_S))


def _jerk(model: Model, rows: PlanArrays) -> Array:
    """Rates (n, 2) of the accelerations while a control holds: a difference over `STEP_S`."""
    rates = model.reduced_dynamics(rows.reduced_state, rows.control)
    felt = []
    for sign in (1.0, -1.0):
        state = rows.reduced_state + sign * STEP_S * rates
        twist = model.body_velocity(state, rows.control)
        felt.append(accelerations(twist, twist_rates(model, state, rows.control)))
    return np.asarray((felt[0] - felt[1]) / (2.0 * STEP_S))


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

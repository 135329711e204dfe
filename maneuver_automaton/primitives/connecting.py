"""From trim to trim by optimal control: solved, closed to rounding, and driven again as a proof."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array, freeze
from maneuver_automaton.models import Model, VectorField, rollout
from maneuver_automaton.models.speeds import is_too_sharp
from maneuver_automaton.optimal_control.ipopt import SolveStatus
from maneuver_automaton.optimal_control.maneuvers import (
    Transfer,
    TransferProgram,
    drawn_in,
    duration_guess,
    ends_of,
    solve_transfer,
    transfer_program,
)
from maneuver_automaton.optimal_control.problem import moving_frame
from maneuver_automaton.primitives.driving import drive
from maneuver_automaton.primitives.primitive import Maneuver, Trajectory, Trim

RTOL, ATOL = 1e-10, 1e-12


def maneuver_defect(model: Model, maneuver: Maneuver, *, source: Trim, target: Trim) -> float:
    """Greatest error of the end that a maneuver claims: of its pose and of its reduced state.

    Raises
    ------
    ValueError
        If the maneuver has no course, so that nobody knows how it is driven.
    """
    course = maneuver.known_course("so it cannot be driven again")
    state = np.concatenate([np.zeros(model.group.dof), source.reduced_state])
    rates = _rates(model)
    for begin, end, control in pieces(course.time, course.control):
        times = [begin, end]
        state = rollout(rates, state, control=control, times=times, rtol=RTOL, atol=ATOL)[-1]
    claimed = np.concatenate([maneuver.displacement, target.reduced_state])
    return float(np.abs(state - claimed).max())


def _rates(model: Model) -> VectorField:
    """The whole vector field, component by component: quicker than on arrays."""
    rates = moving_frame(model.group, velocity=model.velocity, reduced=model.dynamics)
    return lambda state, control: np.array(rates(state.tolist(), control.tolist()))


def pieces(time: Array, control: Array) -> list[tuple[float, float, Array]]:
    """Stretches (begin, end, control) of one control each, of samples in time."""
    changes = 1 + np.flatnonzero((control[1:-1] != control[:-2]).any(axis=-1))
    firsts = [0, *changes.tolist()]
    lasts = [*changes.tolist(), time.size - 1]
    return [
        (float(time[a]), float(time[b]), control[a])
        for a, b in zip(firsts, lasts, strict=True)
        if time[b] > time[a]
    ]


CLOSED = 1e-10  # [units of the reduced state] between the last one and the target's
WITHIN = 1e-9  # how far a reduced state may be out of its limits, as a share of their range
ADMITTED_DEFECT = 1e-6  # [m, rad, units of the reduced state] against an ODE solver
TRIES = (
    (1e-6, 1.0, 0.0),
    (1e-6, 3.0, 0.0),
    (1e-6, 2.0, 0.5),
    (1e-4, 1.0, 0.0),
    (1e-2, 2.0, -0.5),
    (1e-6, 0.4, 0.0),
    (1e-6, 8.0, 0.2),
)
"""(share by which the limits are drawn in, factor of the guessed duration, swing), in turn."""

NEWTON_STEPS = 8
DIGITS = 7  # after the point, of inputs and intervals that need no more
RUNGE_KUTTA_STEPS = 4  # in an interval, for derivatives
PERTURBATION = 1e-6  # [-] of the range of a control, for derivatives


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Inputs:
    """Controls (n, n_u), each for the same `interval` [s]: from them a maneuver is driven again."""

    control: Array
    interval: float

    def __post_init__(self) -> None:
        freeze(self, "control")

    def drive(self, model: Model, reduced_state: Array) -> Trajectory:
        """Motion from the identity pose."""
        n = len(self.control)
        return drive(model, reduced_state, control=self.control, durations=[self.interval] * n)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class TrimConnection:
    """A maneuver from trim to trim, or the reason why there is none."""

    source: str
    target: str
    maneuver: Maneuver | None
    inputs: Inputs | None = None  # of the maneuver, in equal intervals
    reason: str = ""  # empty if there is a maneuver
    defect: float = np.inf  # against an ODE solver, in the units of pose and reduced state
    cost: float = np.inf  # what the solver made it out to be
    tries: int = 0
    solve_s: float = 0.0


def connect(
    model: Model,
    source: Trim,
    target: Trim,
    *,
    program: TransferProgram | None = None,
    control_limits: Array | None = None,
) -> TrimConnection:
    """The maneuver of least cost from one trim to another, wherever it ends.

    The inputs are constant in equal intervals. The solver's answer is driven again to rounding,
    corrected until it meets the target's reduced state, and checked against an ODE solver; where
    a step fails it is tried again from other guesses and with limits drawn in.

    Source: Frazzoli, Dahleh, Feron (2005), Sec. III-B.
    """
    program = program or transfer_program(model)
    outside = _outside(model, source) or _outside(model, target)
    if np.array_equal(source.reduced_state, target.reduced_state):
        raise ValueError(
            f"connect: trims {source.name!r} and {target.name!r} have one reduced state, so the "
            "vehicle switches between them at will; need two trims of different reduced state"
        )
    if outside:
        return TrimConnection(source=source.name, target=target.name, maneuver=None, reason=outside)
    limits = model.control_limits if control_limits is None else control_limits
    reasons: list[str] = []
    solve_s = 0.0
    for tightening, factor, swing in TRIES:
        transfer = solve_transfer(
            program,
            start=source.reduced_state,
            end=target.reduced_state,
            controls=np.stack([source.control, target.control]),
            control_limits=limits,
            tightening=tightening,
            duration=factor * duration_guess(model, source.reduced_state, target.reduced_state),
            swing=swing,
        )
        solve_s += transfer.solve_s
        found = _checked(model, source, target, transfer=transfer, limits=limits)
        if found.maneuver is not None:
            return replace(found, tries=len(reasons) + 1, solve_s=solve_s)
        reasons.append(found.reason)
    shown = "; ".join(dict.fromkeys(reasons))
    return replace(found, reason=shown, tries=len(reasons), solve_s=solve_s)


def _checked(
    model: Model, source: Trim, target: Trim, *, transfer: Transfer, limits: Array
) -> TrimConnection:
    """The transfer as a maneuver if it holds, else the reason."""
    nothing = TrimConnection(
        source=source.name, target=target.name, maneuver=None, cost=transfer.cost
    )
    if transfer.status is not SolveStatus.SOLVED:
        return replace(nothing, reason=f"the solver ended with {transfer.reason}")
    start, end, count = source.reduced_state, target.reduced_state, len(transfer.control)
    raw = Inputs(control=transfer.control, interval=transfer.duration / count)
    # Of few digits but in the last third, so that files are half as long.
    short = Inputs(control=raw.control.round(DIGITS), interval=round(raw.interval, DIGITS))
    inputs, course = closed(model, start, end, inputs=short, limits=limits, last=max(1, count // 3))
    if not np.abs(course.reduced_state[-1] - end).max() <= CLOSED / 100.0:
        inputs, course = closed(model, start, end, inputs=raw, limits=limits)
    miss = float(np.abs(course.reduced_state[-1] - target.reduced_state).max())
    if not miss <= CLOSED:
        return replace(nothing, reason=f"it could not be closed: {miss:.2g} is left")
    excess = beyond_limits(model.reduced_limits, course.reduced_state)
    if excess.max() > WITHIN:
        worst = model.reduced_names[int(excess.argmax())]
        return replace(nothing, reason=f"{worst} leaves its limits by {excess.max():.2g} of them")
    if is_too_sharp(model, course.twists(model)).any():
        return replace(nothing, reason="it leaves the lateral acceleration of the vehicle")
    maneuver = Maneuver.along(
        course, name=f"{source.name} to {target.name}", source=source.name, target=target.name
    )
    defect = maneuver_defect(model, maneuver, source=source, target=target)
    if not defect <= ADMITTED_DEFECT:
        return replace(
            nothing, defect=defect, reason=f"driven again it ends {defect:.2g} off its target"
        )
    return replace(nothing, maneuver=maneuver, inputs=inputs, defect=defect)


def closed(
    model: Model,
    start: Array,
    end: Array,
    *,
    inputs: Inputs,
    limits: Array,
    last: int | None = None,
    enough: float = 0.0,
    ends: Any = None,
) -> tuple[Inputs, Trajectory]:
    """Correct inputs that nearly lead from one reduced state to another, until they do.

    Newton's method on all inputs and a common factor of the time; of all corrections the least,
    each input measured by its room within its limits, so that those at a limit stay there. Where
    inputs lead is what the model does, or what the program `ends` makes of it, which is quicker.
    """
    control, interval = np.clip(inputs.control, *limits.T), inputs.interval
    width = np.where(np.isfinite(limits[:, 1] - limits[:, 0]), limits[:, 1] - limits[:, 0], 2.0)
    scale = np.maximum(1.0, np.abs(end))
    best, least, course = None, np.inf, None
    for _ in range(NEWTON_STEPS):
        tried = Inputs(control=control, interval=interval)
        if ends is None:
            course = tried.drive(model, start)
            reached = course.reduced_state[-1]
        else:
            reached, gradient, by_duration = ends_of(ends, start, control, interval)
        miss = reached - end
        size = float(np.abs(miss / scale).max())
        if best is not None and not size < 0.5 * least:
            break  # rounding
        best, least = (tried, course), size
        if size <= enough:
            break
        if ends is None:
            gradient, by_duration = _sensitivities(model, start, tried)
        room = np.minimum(control - limits[:, 0], limits[:, 1] - control)
        weight = np.where(np.isfinite(room), room, width) + 1e-9 * width
        if last is not None:
            weight[: len(weight) - last] = 0.0
        columns = np.concatenate(
            [(gradient * weight).reshape(end.size, -1), by_duration[:, None] * (last is None)],
            axis=1,
        )
        step = -np.linalg.lstsq(columns, miss, rcond=None)[0]
        control = np.clip(control + weight * step[:-1].reshape(control.shape), *limits.T)
        interval *= 1.0 + max(-0.5, float(step[-1]))
    assert best is not None  # the first is
    inputs, course = best
    return inputs, course or inputs.drive(model, start)


def _sensitivities(model: Model, start: Array, inputs: Inputs) -> tuple[Array, Array]:
    """Derivatives of the last reduced state by inputs (n_z, n, n_u) and a time factor (n_z,)."""
    control = inputs.control
    n, n_u = control.shape
    by = PERTURBATION * np.maximum(1.0, np.abs(control))
    shifts = by.ravel()[:, None, None] * np.eye(n * n_u).reshape(n * n_u, n, n_u)
    controls = np.concatenate([control + shifts, control - shifts, control[None], control[None]])
    factors = np.ones(len(controls))
    factors[-2:] = 1.0 + PERTURBATION, 1.0 - PERTURBATION
    ends = _last_states(model, start, controls, factors * inputs.interval)
    plus, minus = ends[: n * n_u], ends[n * n_u : -2]
    gradient = (plus - minus) / (2.0 * by.reshape(-1, 1))
    by_factor = (ends[-2] - ends[-1]) / (2.0 * PERTURBATION)
    return gradient.T.reshape(start.size, n, n_u), by_factor


def _last_states(model: Model, start: Array, controls: Array, intervals: Array) -> Array:
    """Reduced states (m, n_z) after inputs (m, n, n_u) in intervals (m,) [s], by Runge-Kutta."""
    state = np.broadcast_to(start, (len(controls), start.size))
    step = (intervals / RUNGE_KUTTA_STEPS)[:, None]
    for k in range(controls.shape[1]):
        for _ in range(RUNGE_KUTTA_STEPS):
            rate_1 = model.reduced_dynamics(state, controls[:, k])
            rate_2 = model.reduced_dynamics(state + step / 2.0 * rate_1, controls[:, k])
            rate_3 = model.reduced_dynamics(state + step / 2.0 * rate_2, controls[:, k])
            rate_4 = model.reduced_dynamics(state + step * rate_3, controls[:, k])
            state = state + step / 6.0 * (rate_1 + 2.0 * rate_2 + 2.0 * rate_3 + rate_4)
    return state


def _outside(model: Model, trim: Trim) -> str:
    """Which limit a trim breaks, empty if none."""
    for what, names, values, limits in (
        ("reduced state", model.reduced_names, trim.reduced_state, model.reduced_limits),
        ("control", model.control_names, trim.control, model.control_limits),
    ):
        if values.shape != (len(names),):
            raise ValueError(
                f"trim {trim.name!r}: {what} has {values.size} components, need {len(names)} "
                f"({', '.join(names)}) for the {model.name}"
            )
        excess = beyond_limits(limits, values[None])
        if excess.size and excess.max() > WITHIN:
            k = int(excess.argmax())
            return (
                f"trim {trim.name!r}: {names[k]} = {values[k]:.6g} is outside "
                f"[{limits[k, 0]:.6g}, {limits[k, 1]:.6g}]"
            )
    return ""


def beyond_limits(limits: Array, rows: Array) -> Array:
    """How far rows (n, k) leave limits (k, 2) at worst, as a share of their range, (k,)."""
    inner = drawn_in(limits, 0.0)
    width = np.where(np.isfinite(limits[:, 1] - limits[:, 0]), limits[:, 1] - limits[:, 0], 1.0)
    out = np.maximum(inner[:, 0] - rows, rows - inner[:, 1]).max(axis=0)
    share: Array = np.maximum(0.0, out) / np.where(width > 0.0, width, 1.0)
    return share

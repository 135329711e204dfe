"""Close the last digits of a motion under piecewise constant controls: it ends at its goal."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.budget import UNLIMITED, Budget
from maneuver_automaton.groups import group_of
from maneuver_automaton.models import Model
from maneuver_automaton.primitives import Maneuver, Trajectory
from maneuver_automaton.primitives.driving import drive, drive_all

STEPS = 5  # of Newton's method
DIVERGED = 100.0  # times the least miss so far
EXACT = 1e-13  # [m, rad, units of z], over the size of the motion, at which it is over
AS_GOOD = 1e-3  # share of the miss that a step may leave without derivatives taken anew
PROBE = 1e-5  # of central differences, in units of each variable
INSIDE = 1e-12  # limits may be exceeded by rounding
FIRST_STEP = 3.0  # times the first drive, that a step of Newton's method takes at most, about


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PolishedMotion:
    """An exact motion from the start to the goal, seen from the start."""

    course: Trajectory  # from the identity pose and time 0
    control: Array  # (n, n_u)
    durations: Array  # (n,) [s]
    error: float  # [m, rad, units of z] of its end
    objective: float = math.inf  # of the solver, at its end

    @property
    def duration(self) -> float:
        """[s]."""
        return float(self.course.time[-1])

    def maneuver(self, name: str, *, source: str, target: str) -> Maneuver:
        """The motion as a maneuver from trim to trim."""
        return Maneuver.along(self.course, name=name, source=source, target=target)


def closed(
    model: Model,
    start_state: Array,
    end: Sequence[float | None],
    *,
    control: Array,
    durations: Array,
    budget: Budget = UNLIMITED,
) -> PolishedMotion | str:
    """The smallest change of controls, and of the pace, with which a motion ends exactly.

    Newton's method through the accurate integrator. Controls move in proportion to the room they
    have to their limits, so that those at a limit stay there.

    `end`: last pose, seen from the first, and last reduced state; None leaves a component free.
    `control` (n, n_u), within its limits, holds for `durations` (n,) [s]. No further step is made
    that would leave no time to check what comes out. Otherwise why there is none.
    """
    wanted = np.array([k for k, value in enumerate(end) if value is not None], dtype=np.int64)
    aim = np.array([value for value in end if value is not None], dtype=np.float64)
    low, high = model.control_limits.T
    best: PolishedMotion | None = None
    u, h = np.clip(control, low, high), np.array(durations)
    since, longest, before, slopes = budget.elapsed, 0.0, math.inf, None
    for step in range(STEPS):
        try:
            course = drive(model, start_state, control=u, durations=h)
        except ValueError as why:  # a step of Newton's method led where no motion is
            if best is None:
                return f"the end could not be closed: {why}"
            break
        last = np.concatenate([course.pose[-1], course.reduced_state[-1]])
        miss = aim - last[wanted]
        error = float(np.abs(miss).max(initial=0.0))
        if best is not None and error > DIVERGED * best.error:
            break  # no step comes back from there, and to follow such motions may take minutes
        if best is None or error < best.error:
            best = PolishedMotion(control=u, durations=h, course=course, error=error)
        if error <= EXACT * max(1.0, float(np.abs(course.pose).max())):
            break
        now = budget.elapsed
        longest = max(longest, (now - since) * (1.0 if step else FIRST_STEP))
        if budget.left_to_check <= longest:
            break
        since = now
        if slopes is None or error > AS_GOOD * before:
            slopes = _derivatives(model, course, u, h)
        before, (by_control, by_pace) = error, slopes
        room = np.minimum(np.minimum(u - low, high - u), 1.0)
        columns = np.hstack([(by_control * room).reshape(len(by_control), -1), by_pace[:, None]])
        change = np.linalg.lstsq(columns[wanted], miss, rcond=None)[0]
        if not abs(change[-1]) < 1.0:
            break  # times would be negative, or so long that to follow the motion takes minutes
        u = np.clip(u + room * change[:-1].reshape(u.shape), low, high)
        h = h * (1.0 + change[-1])
    assert best is not None
    return _why_not(model, best) or best


def _why_not(model: Model, found: PolishedMotion) -> str:
    if not found.error <= 1e-9:
        return f"the end could not be closed: {found.error:.3g} are left"
    low, high = model.reduced_limits.T
    over = np.maximum(low - found.course.reduced_state, found.course.reduced_state - high)
    worst = over.max(axis=0, initial=-math.inf)
    if worst.size and worst.max() > INSIDE:
        k = int(np.argmax(worst))
        name = model.reduced_names[k]
        return f"{name} exceeds its limit by {worst[k]:.3g} once the end is closed"
    return ""


def _derivatives(model: Model, course: Trajectory, control: Array, h: Array) -> tuple[Array, Array]:
    """Derivatives of the end (pose, reduced state) by all controls (n_e, n, n_u), by the pace."""
    n, n_u = control.shape
    dof, n_z = model.group.dof, course.reduced_state.shape[1]
    begins = np.searchsorted(course.time, np.cumsum(h) - h)  # there is a sample at each
    poses = course.pose[[*begins, -1]]
    columns = _local(model, course.reduced_state[begins], control, h)
    # columns: (n, dof + n_z, n_z + n_u + 1)
    moved, by_control = _carried(poses), np.empty((dof + n_z, n, n_u))
    by_pace = np.zeros(dof + n_z)
    by_state = np.vstack([np.zeros((dof, n_z)), np.eye(n_z)])  # of the end, by each node
    for k in range(n - 1, -1, -1):
        effect = by_state @ columns[k, dof:]
        effect[:dof] += moved[k] @ columns[k, :dof]
        by_control[:, k] = effect[:, n_z : n_z + n_u]
        by_pace += effect[:, -1] * h[k]
        by_state = effect[:, :n_z]
    return by_control, by_pace


def _local(model: Model, states: Array, control: Array, h: Array) -> Array:
    """Central differences of each interval's gain (pose, then state) by state, control, time."""
    n, n_z, n_u = len(h), states.shape[1], control.shape[1]
    variables = np.hstack([states, control, h[:, None]])
    probes = np.diag([*(n_z + n_u) * [PROBE], PROBE])
    probes[-1, -1] = PROBE * float(h.min())
    moved = np.concatenate([variables + sign * row for row in probes for sign in (1.0, -1.0)])
    rides = drive_all(model, moved[:, :n_z], control=moved[:, None, n_z:-1],
                      durations=moved[:, -1:], max_step_m=9e9, max_step_rad=9e9)  # fmt: skip
    ends = np.array([np.concatenate([r.pose[-1], r.reduced_state[-1]]) for r in rides])
    ends = ends.reshape(len(probes), 2, n, -1)
    slopes = (ends[:, 0] - ends[:, 1]) / (2.0 * probes.max(axis=1)[:, None, None])
    return np.moveaxis(slopes, 0, -1)


def _carried(poses: Array) -> Array:
    """How the last pose follows the gain of each interval: (n, dof, dof)."""
    n, dof = len(poses) - 1, poses.shape[1]
    group_of(dof)  # a pose of the package
    matrices = np.tile(np.eye(dof), (n, 1, 1))
    cosine, sine = np.cos(poses[:-1, 2]), np.sin(poses[:-1, 2])
    matrices[:, 0, 0], matrices[:, 0, 1] = cosine, -sine
    matrices[:, 1, 0], matrices[:, 1, 1] = sine, cosine
    arm = poses[-1, :2] - poses[1:, :2]
    matrices[:, 0, 2], matrices[:, 1, 2] = -arm[:, 1], arm[:, 0]
    return matrices

"""A plan as arrays, one row an instant, for other programs and tables."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maneuver_automaton._arrays import Array, IntArray, as_number, check_range
from maneuver_automaton._brief import brief
from maneuver_automaton.groups import group_of
from maneuver_automaton.models import Model
from maneuver_automaton.primitives import Maneuver, Trajectory, Trim

POSE_COLUMNS = ("x_m", "y_m", "heading_rad", "z_m")
TWIST_COLUMNS = ("v_x_m_s", "v_y_m_s", "turn_rate_rad_s", "v_z_m_s")
COLUMNS = ("time", "pose", "twist", "reduced_state", "control")  # arrays with a row an instant
ROUNDING = 1e-9  # steps, by which a duration may miss a whole number of them


class _Sampled(Protocol):
    """A `Plan`, as far as its rows are made of it."""

    @property
    def start(self) -> Array: ...
    @property
    def start_time(self) -> float: ...
    @property
    def duration(self) -> float: ...
    @property
    def switching_times(self) -> Array: ...
    @property
    def primitives(self) -> Sequence[Trim | Maneuver]: ...
    @property
    def word(self) -> tuple[str, ...]: ...
    def sample(self) -> Trajectory: ...
    def pose_at(self, time: ArrayLike, /) -> Array: ...


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlanArrays:
    """Rows of a plan; twist and control are those that begin at the row's time.

    The last row, at the end, has those of the last primitive.
    """

    time: Array  # (n,) [s]
    pose: Array  # (n, dof), headings continuous [m, m, rad(, m)]
    twist: Array  # (n, dof) in the body frame [m/s, m/s, rad/s(, m/s)]
    reduced_state: Array  # (n, n_z)
    control: Array  # (n, n_u)
    index: IntArray  # (n,) of the primitive in `word`; -1 of an empty plan
    word: tuple[str, ...]  # names of the primitives
    reduced_names: tuple[str, ...]
    control_names: tuple[str, ...]

    __repr__ = brief

    @property
    def primitive(self) -> NDArray[np.str_]:
        """Name (n,) of the trim or maneuver of each row; empty of an empty plan."""
        return np.array([*self.word, ""], dtype=np.str_)[self.index]

    def columns(self) -> dict[str, NDArray[Any]]:
        """Arrays (n,) by name, with the unit at its end, as a table has them.

        Names of reduced state and control begin with ``state_`` and ``control_``.
        """
        dof = self.pose.shape[1]
        blocks = (
            (POSE_COLUMNS[:dof], self.pose),
            (TWIST_COLUMNS[:dof], self.twist),
            ([f"state_{name}" for name in self.reduced_names], self.reduced_state),
            ([f"control_{name}" for name in self.control_names], self.control),
        )
        named = {name: block[:, k] for names, block in blocks for k, name in enumerate(names)}
        return {"time_s": self.time, **named, "primitive": self.primitive}


def plan_arrays(plan: _Sampled, *, step: float | None, model: Model | None) -> PlanArrays:
    """The arrays of `Plan.as_arrays`."""
    samples = plan.sample()
    if step is not None:
        times = step_times(plan.start_time, plan.duration, step)
        samples = _at_times(plan, samples, times, model)
    return _arrays(plan, samples, model)


def arrays_at(plan: _Sampled, times: Array, *, model: Model | None) -> PlanArrays:
    """As `Plan.as_arrays`, at times (n,) that rise [s]."""
    return _arrays(plan, _at_times(plan, plan.sample(), times, model), model)


def joined(parts: Sequence[PlanArrays]) -> PlanArrays:
    """Rows of one plan after the other; where one ends, those of the next count."""
    upto = [slice(0, -1)] * (len(parts) - 1) + [slice(None)]

    def stacked(name: str) -> Array:
        rows = [getattr(one, name)[rows] for one, rows in zip(parts, upto, strict=True)]
        return np.concatenate(rows)

    before = np.cumsum([0, *(len(one.word) for one in parts[:-1])])
    index = [one.index[rows] + k for one, rows, k in zip(parts, upto, before, strict=True)]
    return PlanArrays(
        **{name: stacked(name) for name in COLUMNS},
        index=np.concatenate(index),
        word=tuple(name for one in parts for name in one.word),
        reduced_names=parts[0].reduced_names,
        control_names=parts[0].control_names,
    )


def _arrays(plan: _Sampled, samples: Trajectory, model: Model | None) -> PlanArrays:
    after = np.searchsorted(plan.switching_times[1:-1], samples.time, side="right")
    index = after if plan.primitives else np.full(samples.time.shape, -1)
    n_states, n_controls = samples.reduced_state.shape[1], samples.control.shape[1]
    return PlanArrays(
        time=samples.time,
        pose=samples.pose,
        twist=_twists(plan, samples, index, model),
        reduced_state=samples.reduced_state,
        control=samples.control,
        index=index,
        word=plan.word,
        reduced_names=_names(None if model is None else model.reduced_names, n_states),
        control_names=_names(None if model is None else model.control_names, n_controls),
    )


def step_times(start: float, duration: float, step: float) -> Array:
    """Times (n,) from start to end [s]: every step, and the end."""
    step = as_number("as_arrays: step", step)
    check_range("as_arrays: step", step, unit="s")
    count = max(0, math.ceil(duration / step - ROUNDING))
    return np.append(start + step * np.arange(count), start + duration)


def _at_times(plan: _Sampled, samples: Trajectory, times: Array, model: Model | None) -> Trajectory:
    """The plan at other times: poses exact, reduced states cubic between samples."""
    last = samples.time.size - 1
    k = np.clip(np.searchsorted(samples.time, times, side="right") - 1, 0, max(last - 1, 0))
    ahead = np.minimum(k + 1, last)
    span = samples.time[ahead] - samples.time[k]
    share = np.where(span > 0.0, (times - samples.time[k]) / np.where(span > 0.0, span, 1.0), 0.0)
    before, after, control = (
        samples.reduced_state[k],
        samples.reduced_state[ahead],
        samples.control[k],
    )
    change, share, span = after - before, share[:, None], span[:, None]
    state = before + share * change
    if model is not None and before.shape[1]:
        early = span * model.reduced_dynamics(before, control) - change
        late = span * model.reduced_dynamics(after, control) - change
        state += share * (1.0 - share) * ((1.0 - share) * early - share * late)
    return Trajectory(time=times, pose=plan.pose_at(times), reduced_state=state, control=control)


def _twists(plan: _Sampled, samples: Trajectory, index: IntArray, model: Model | None) -> Array:
    """Twists (n, dof): a trim's own; of a maneuver what its model says, or else the mean."""
    twists = np.zeros_like(samples.pose)
    for k, primitive in enumerate(plan.primitives):
        here = np.flatnonzero(index == k)
        if isinstance(primitive, Trim):
            twists[here] = primitive.body_velocity
        elif model is not None:
            states, controls = samples.reduced_state[here], samples.control[here]
            twists[here] = model.body_velocity(states, controls)
        elif here.size:
            # Constant twist (m, dof) that leads from the pose of each row to that of the next.
            begin = np.minimum(here, samples.time.size - 2)
            group = group_of(plan.start.size)
            poses, span = plan.pose_at(samples.time), samples.time[begin + 1] - samples.time[begin]
            steps = (group(poses[begin]).inverse() @ group(poses[begin + 1])).log()
            twists[here] = np.asarray(steps / np.where(span > 0.0, span, np.inf)[:, None])
    return twists


def _names(known: tuple[str, ...] | None, n: int) -> tuple[str, ...]:
    """Names of `n` numbers; counted from 0 where no model names them."""
    return known if known is not None and len(known) == n else tuple(map(str, range(n)))

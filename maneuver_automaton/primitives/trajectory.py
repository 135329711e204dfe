"""Samples of a motion, as plan.json has them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array
from maneuver_automaton._brief import brief
from maneuver_automaton.groups import group_of
from maneuver_automaton.models import Model


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Trajectory:
    """Samples of a motion: `control[i]` holds from time i to i + 1; the last one is repeated.

    Examples
    --------
    >>> course = Trajectory(time=np.array([0.0, 2.0]), pose=np.array([[0.0, 0, 0], [2.0, 0, 0]]),
    ...                     reduced_state=np.zeros((2, 0)), control=np.array([[1.0, 0], [1.0, 0]]))
    >>> course.pose_at(1.5).tolist()
    [1.5, 0.0, 0.0]
    """

    time: Array  # (n,) [s]
    pose: Array  # (n, dof), headings continuous [m, m, rad(, m)]
    reduced_state: Array  # (n, n_z)
    control: Array  # (n, n_u)
    model: Model | None = None  # whose equations lead from sample to sample; None: nobody knows

    __repr__ = brief

    def twists(self, model: Model) -> Array:
        """Body velocities (3, n - 1, dof) at the begin, middle and end of every step."""
        begin, end, control = self.reduced_state[:-1], self.reduced_state[1:], self.control[:-1]
        states = np.stack([begin, 0.5 * (begin + end), end])
        return model.body_velocity(states, np.broadcast_to(control, (3, *control.shape)))

    def pose_at(self, time: ArrayLike) -> Array:
        """Poses (..., dof) at times (...,) [s]: exact at samples, by constant twists between them.

        Between samples the error is that of a constant twist: an eighth of the change of the body
        velocity times the spacing.
        """
        times = np.asarray(time, dtype=np.float64)
        group = group_of(self.pose.shape[1])
        if self.time.size == 1:
            return np.broadcast_to(self.pose[0], (*times.shape, self.pose.shape[1])).copy()
        k = np.clip(np.searchsorted(self.time, times, side="right") - 1, 0, self.time.size - 2)
        span = self.time[k + 1] - self.time[k]
        since = np.clip(times - self.time[k], 0.0, span)
        share = np.where(span > 0.0, since / np.where(span > 0.0, span, 1.0), 0.0)
        begin = group(self.pose[k])
        step = (begin.inverse() @ group(self.pose[k + 1])).log()
        poses = (begin @ group.exp(share[..., None] * step)).pose
        at_end = (share == 1.0)[..., None]
        return np.where(at_end, self.pose[k + 1], poses)

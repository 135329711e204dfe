"""A plan: a word of trims and maneuvers with a coasting time for every trim."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, freeze
from maneuver_automaton.groups import LieGroup, group_of
from maneuver_automaton.groups.chain import chained
from maneuver_automaton.primitives import Trim


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Trajectory:
    """Samples of a motion: `control[i]` holds from time i to i + 1; the last one is repeated."""

    time: Array  # (n,) [s]
    pose: Array  # (n, dof), headings continuous [m, m, rad(, m)]
    reduced_state: Array  # (n, n_z)
    control: Array  # (n, n_u)


@dataclass(frozen=True, eq=False)
class Plan:
    """A word of trims, each with its coasting time, from a start pose.

    Examples
    --------
    >>> ahead = Trim(name="ahead", body_velocity=[1.0, 0.0, 0.0], control=[1.0, 0.0])
    >>> plan = Plan([0.0, 0.0, 0.0], (ahead,), durations=[2.0])
    >>> plan.duration, plan.pose_at(1.5).tolist()
    (2.0, [1.5, 0.0, 0.0])
    """

    start: Array  # (dof,) [m, m, rad(, m)]
    trims: tuple[Trim, ...]
    durations: Array = field(kw_only=True)  # (n,) [s]
    start_time: float = field(default=0.0, kw_only=True)  # [s]

    if TYPE_CHECKING:  # any numbers will do

        def __init__(
            self,
            start: ArrayLike,
            trims: Sequence[Trim],
            *,
            durations: ArrayLike,
            start_time: float = 0.0,
        ) -> None: ...

    def __post_init__(self) -> None:
        freeze(self, "start", last=(3, 4))
        object.__setattr__(self, "trims", tuple(self.trims))
        freeze(self, "durations")
        if self.durations.shape != (len(self.trims),):
            raise ValueError(
                f"plan: got {self.durations.shape} durations for {len(self.trims)} trims"
            )
        if (self.durations < 0.0).any():
            raise ValueError(f"plan: durations must not be negative, got {self.durations.min()} s")

    @property
    def word(self) -> tuple[str, ...]:
        """Names of the trims, in order."""
        return tuple(trim.name for trim in self.trims)

    @property
    def duration(self) -> float:
        """Time the plan takes [s], rest included."""
        return float(self.durations.sum())

    @cached_property
    def switching_times(self) -> Array:
        """Times (n + 1,) at which trims begin and the plan ends [s]."""
        return self.start_time + np.concatenate([[0.0], np.cumsum(self.durations)])

    @cached_property
    def switching_poses(self) -> Array:
        """Poses (n + 1, dof) at the switching times."""
        if not self.trims:
            return self.start[None].copy()
        twists = np.array([trim.body_velocity for trim in self.trims])
        steps = group_of(self.start.size).exp(self.durations[:, None] * twists)
        return chained(self.start, steps.pose)

    @property
    def end(self) -> Array:
        """Pose (dof,) at the end."""
        return np.asarray(self.switching_poses[-1])

    def pose_at(self, time: ArrayLike) -> Array:
        """Poses (..., dof) at `time` (...,) [s]; held before the start and after the end."""
        times = np.asarray(time, dtype=np.float64)
        if not self.trims:
            return np.broadcast_to(self.start, (*times.shape, self.start.size)).copy()
        index = self._index_at(times)
        begin = group_of(self.start.size)(self.switching_poses[index])
        since = np.clip(times - self.switching_times[index], 0.0, self.durations[index])
        twists = np.array([trim.body_velocity for trim in self.trims])[index]
        return (begin @ begin.exp(since[..., None] * twists)).pose

    def control_at(self, time: ArrayLike) -> Array:
        """Controls (..., n_u) at `time` (...,) [s]; at a switch, that of the trim that begins."""
        if not self.trims:
            raise ValueError("plan: an empty word has no control")
        controls = np.array([trim.control for trim in self.trims])
        return np.asarray(controls[self._index_at(np.asarray(time, dtype=np.float64))])

    def _index_at(self, times: Array) -> np.ndarray[tuple[int, ...], np.dtype[np.intp]]:
        after = np.searchsorted(self.switching_times[1:-1], times, side="right")
        return np.asarray(after, dtype=np.intp)

    def sample(self, *, max_step_m: float = 0.05, max_step_rad: float = 0.05) -> Trajectory:
        """Samples at every switching time and closer than both steps in between."""
        times, owners = [self.start_time], [0]
        for k, (trim, duration) in enumerate(zip(self.trims, self.durations, strict=True)):
            twist = trim.body_velocity
            speed = float(np.linalg.norm(twist[[0, 1, *range(3, twist.size)]]))
            steps = max(speed * duration / max_step_m, abs(twist[2]) * duration / max_step_rad)
            n = max(1, int(np.ceil(steps * (1.0 + 1e-9))))
            begin, end = self.switching_times[k], self.switching_times[k + 1]
            times += [*np.linspace(begin, end, n + 1)[1:-1].tolist(), float(end)]
            owners += [k] * (n - 1) + [min(k + 1, len(self.trims) - 1)]
        time = np.array(times)
        return Trajectory(
            time=time,
            pose=self._poses_of(time),
            reduced_state=self._rows(owners, [trim.reduced_state for trim in self.trims]),
            control=self._rows(owners, [trim.control for trim in self.trims]),
        )

    def _poses_of(self, time: Array) -> Array:
        poses = self.pose_at(time).copy()
        if self.trims:
            poses[-1] = self.end
        return poses

    def _rows(self, owners: list[int], values: Sequence[Array]) -> Array:
        if not values:
            return np.zeros((1, 0))
        return np.array(values)[owners]

    def moved(self, by: LieGroup) -> Plan:
        """The same word from a start moved by the group element `by`: the law of the project."""
        start = by @ type(by)(self.start)
        return Plan(start.pose, self.trims, durations=self.durations, start_time=self.start_time)

"""A plan: a word of trims and maneuvers with a coasting time for every trim."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import accumulate
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import (
    Array,
    as_array,
    as_number,
    check_range,
    freeze,
    plain_numbers,
)
from maneuver_automaton._brief import brief
from maneuver_automaton._display import Played
from maneuver_automaton.automaton.plan_arrays import PlanArrays, plan_arrays
from maneuver_automaton.errors import MissingExtra
from maneuver_automaton.groups import SE2, LieGroup, group_of
from maneuver_automaton.groups.se2 import chained, coasted, end_of_coasting
from maneuver_automaton.models import Model
from maneuver_automaton.primitives import Maneuver, Trajectory, Trim
from maneuver_automaton.primitives.driving import along

Primitive: TypeAlias = Trim | Maneuver


@dataclass(frozen=True, eq=False)
class Plan(Played):
    """A word of trims, each with its coasting time, from a start pose.

    Between two trims stands a maneuver, or nothing where the vehicle switches at will: `maneuvers`
    is empty for a kinematic vehicle, otherwise it has one entry for every switch, None for those
    that change nothing. A trim between two maneuvers may last no time.

    Examples
    --------
    >>> ahead = Trim(name="ahead", body_velocity=[1.0, 0.0, 0.0], control=[1.0, 0.0])
    >>> plan = Plan([0.0, 0.0, 0.0], (ahead,), durations=[2.0])
    >>> plan.duration, plan.pose_at(1.5).tolist()
    (2.0, [1.5, 0.0, 0.0])
    >>> rest = Trim(name="rest", body_velocity=[0.0, 0.0, 0.0], control=[0.0, 0.0])
    >>> brake = Maneuver(name="brake", source="ahead", target="rest", displacement=[0.5, 0, 0],
    ...                  duration=1.0)
    >>> plan = Plan([0, 0, 0], (ahead, rest), durations=[2.0, 0.0], maneuvers=(brake,))
    >>> plan.word, plan.duration, plan.end.tolist()
    (('ahead', 'brake'), 3.0, [2.5, 0.0, 0.0])
    """

    start: Array  # (dof,) [m, m, rad(, m)]
    trims: tuple[Trim, ...]
    durations: Array = field(kw_only=True)  # (n,) [s] of the trims
    maneuvers: tuple[Maneuver | None, ...] = field(default=(), kw_only=True)  # (n - 1,) or none
    start_time: float = field(default=0.0, kw_only=True)  # [s]
    notes: tuple[str, ...] = field(default=(), kw_only=True)  # of the file that it was read from

    __repr__ = brief

    if TYPE_CHECKING:  # any numbers will do

        def __init__(
            self,
            start: ArrayLike,
            trims: Sequence[Trim],
            *,
            durations: ArrayLike,
            maneuvers: Sequence[Maneuver | None] = (),
            start_time: float = 0.0,
            notes: tuple[str, ...] = (),
        ) -> None: ...

    def __post_init__(self) -> None:
        plain_numbers(self)
        freeze(self, "start", last=(3, 4))
        object.__setattr__(self, "trims", tuple(self.trims))
        object.__setattr__(self, "maneuvers", tuple(self.maneuvers))
        freeze(self, "durations")
        if self.durations.shape != (len(self.trims),):
            raise ValueError(
                f"plan: got {self.durations.shape} durations for {len(self.trims)} trims"
            )
        if min(self.durations.tolist(), default=0.0) < 0.0:
            raise ValueError(f"plan: durations must not be negative, got {self.durations.min()} s")
        if self.maneuvers and len(self.maneuvers) != len(self.trims) - 1:
            raise ValueError(
                f"plan: got {len(self.maneuvers)} maneuvers for {len(self.trims)} trims, "
                "need one between each two"
            )
        for source, maneuver, target in zip(
            self.trims, self.maneuvers, self.trims[1:], strict=False
        ):
            if maneuver and (maneuver.source, maneuver.target) != (source.name, target.name):
                raise ValueError(
                    f"plan: maneuver {maneuver.name!r} leads from {maneuver.source!r} to "
                    f"{maneuver.target!r}, but stands between {source.name!r} and {target.name!r}"
                )

    @classmethod
    def of_parts(
        cls, start: Array, trims: tuple[Trim, ...], durations: Sequence[float], *, start_time: float
    ) -> Plan:
        """A plan of trims alone, from parts of another plan, which was checked when it was made.

        Checks would take most of the time of cutting a plan.

        Examples
        --------
        >>> ahead = Trim(name="ahead", body_velocity=[1.0, 0.0, 0.0], control=[1.0, 0.0])
        >>> plan = Plan([0.0, 0.0, 0.0], (ahead,), durations=[2.0])
        >>> Plan.of_parts(plan.start, plan.trims, [0.5], start_time=1.0).end.tolist()
        [0.5, 0.0, 0.0]
        """
        lasting = np.array(durations, dtype=np.float64)
        lasting.setflags(write=False)
        if start.flags.writeable:
            start = start.copy()
            start.setflags(write=False)
        plan: Plan = object.__new__(cls)
        vars(plan).update(
            start=start, trims=trims, durations=lasting, maneuvers=(), start_time=start_time
        )
        return plan

    @classmethod
    def of_primitives(
        cls,
        start: ArrayLike,
        primitives: Sequence[Primitive],
        *,
        durations: ArrayLike,
        trims: Mapping[str, Trim],
        start_time: float = 0.0,
    ) -> Plan:
        """Plan of trims and maneuvers in order; `trims` has those that last no time, by name.

        Parameters
        ----------
        start : (dof,) array
            Pose at the begin.
        primitives : sequence of Trim or Maneuver
            In order; a maneuver may follow a maneuver.
        durations : (n,) array
            Of all of them [s]; those of maneuvers are their own.
        trims : mapping of str to Trim
            Trims that stand between maneuvers, or at the ends, for no time.
        start_time : float
            [s].

        Examples
        --------
        >>> rest = Trim(name="rest", body_velocity=[0.0, 0.0, 0.0], control=[0.0])
        >>> hop = Maneuver(name="hop", source="rest", target="rest", displacement=[1, 0, 0],
        ...                duration=2.0)
        >>> plan = Plan.of_primitives([0, 0, 0], [hop, hop], durations=[2, 2], trims={"rest": rest})
        >>> len(plan.trims), plan.word, plan.duration
        (3, ('hop', 'hop'), 4.0)
        """
        word: list[Trim] = []
        lasting: list[float] = []
        between: list[Maneuver | None] = []

        def put(trim: Trim, duration: float) -> None:
            arrived = word and len(between) == len(word) and between[-1]
            if arrived and arrived.target != trim.name:
                word.append(trims[arrived.target])
                lasting.append(0.0)
            if len(between) < len(word):
                between.append(None)
            word.append(trim)
            lasting.append(duration)

        for primitive, duration in zip(primitives, as_array("durations", durations), strict=True):
            if isinstance(primitive, Trim):
                put(primitive, float(duration))
                continue
            ready = len(between) < len(word) and word[-1].name == primitive.source
            if not ready:
                put(trims[primitive.source], 0.0)
            between.append(primitive)
        if word and len(between) == len(word):
            last = primitives[-1]
            assert isinstance(last, Maneuver)
            word.append(trims[last.target])
            lasting.append(0.0)
        maneuvers = tuple(between) if any(between) else ()
        return cls(start, word, durations=lasting, maneuvers=maneuvers, start_time=start_time)

    @cached_property
    def primitives(self) -> tuple[Primitive, ...]:
        """Trims and maneuvers in order; beside maneuvers without the trims that last no time."""
        if not self.maneuvers:
            return self.trims
        return tuple(primitive for primitive, _ in self._pieces)

    @cached_property
    def primitive_durations(self) -> Array:
        """Duration (m,) of each primitive [s]."""
        if not self.maneuvers:
            return self.durations
        return np.array([duration for _, duration in self._pieces], dtype=np.float64)

    @cached_property
    def _pieces(self) -> list[tuple[Primitive, float]]:
        durations: list[float] = self.durations.tolist()
        if not any(self.maneuvers):
            return list(zip(self.trims, durations, strict=True))
        pieces: list[tuple[Primitive, float]] = []
        for k, (trim, duration) in enumerate(zip(self.trims, durations, strict=True)):
            if duration > 0.0:
                pieces.append((trim, duration))
            maneuver = self.maneuvers[k] if k < len(self.maneuvers) else None
            if maneuver is not None:
                pieces.append((maneuver, maneuver.duration))
        return pieces

    def begun_at(self, start: ArrayLike, *, start_time: float) -> Plan:
        """The same motions from another pose (dof,) and time [s].

        What is known of the motions alone is kept.

        Examples
        --------
        >>> trim = Trim(name="ahead", body_velocity=[1.0, 0.0, 0.0], control=[1.0, 0.0])
        >>> plan = Plan([0.0, 0.0, 0.0], (trim,), durations=[2.0])
        >>> plan.begun_at([0.0, 5.0, np.pi], start_time=1.0).end.round(9).tolist()
        [-2.0, 5.0, 3.141592654]
        """
        other: Plan = object.__new__(Plan)
        placed = ("_kept", "_asked", "switching_times", "switching_poses")
        known = {name: one for name, one in vars(self).items() if name not in placed}
        vars(other).update(known, start=start, start_time=start_time)
        plain_numbers(other)
        freeze(other, "start", last=self.start.size)
        return other

    @property
    def word(self) -> tuple[str, ...]:
        """Names of the primitives, in order."""
        return tuple(primitive.name for primitive in self.primitives)

    @cached_property
    def duration(self) -> float:
        """Time the plan takes [s], rest included."""
        return float(np.add.reduce(self.primitive_durations if self.maneuvers else self.durations))

    @cached_property
    def switching_times(self) -> Array:
        """Times (m + 1,) at which primitives begin and the plan ends [s]."""
        ends = list(accumulate(self.primitive_durations.tolist(), initial=0.0))
        return self.start_time + np.array(ends)

    @cached_property
    def switching_poses(self) -> Array:
        """Poses (m + 1, dof) at the switching times."""
        if not self.primitives:
            return self.start[None].copy()
        if not (any(self.maneuvers) or "_steps" in vars(self)):
            return coasted(self.start, self.twists, self.primitive_durations)
        return chained(self.start, self._steps)

    @property
    def coasts(self) -> tuple[Array, Array, Array]:
        """The plan in the plane as coasts: times (n,) [s], poses (n, 3), twists (n - 1, 3) between.

        Trims are whole; a maneuver coasts from sample to sample of its course.

        Raises
        ------
        ValueError
            If a maneuver has no course.
        """
        times, poses = [self.start_time], [self.start[:3]]
        twists: list[Array] = []
        begins = self.switching_times
        for k, primitive in enumerate(self.primitives):
            lasting = float(self.primitive_durations[k])
            if not begins[k + 1] > times[-1]:
                continue
            here, after = self.switching_poses[k], self.switching_poses[k + 1, :3]
            if isinstance(primitive, Trim):
                times.append(float(begins[k + 1]))
                poses.append(after)
                twists.append(primitive.body_velocity[:3])
                continue
            course = primitive.known_course("so no motion")
            samples = np.array((SE2(here[:3]) @ SE2(course.pose[:, :3])).pose)
            samples[:, 2] = here[2] + course.pose[:, 2]
            scale = lasting / float(course.time[-1])
            since = scale * course.time
            steps = (SE2(samples[:-1]).inverse() @ SE2(samples[1:])).pose.copy()
            steps[:, 2] = np.diff(samples[:, 2])
            for n in range(1, len(since)):
                at = float(begins[k]) + float(since[n])
                if not at > times[-1]:
                    continue
                twists.append(SE2(steps[n - 1]).log() / (at - times[-1]))
                times.append(at)
                poses.append(samples[n])
        return np.array(times), np.array(poses), np.array(twists).reshape(-1, 3)

    @cached_property
    def _steps(self) -> Array:
        """Motion (m, dof) of every primitive, seen from where it begins."""
        steps = group_of(self.start.size).exp(self.primitive_durations[:, None] * self.twists).pose
        steps = steps.copy()
        for k, primitive in enumerate(self.primitives):
            if isinstance(primitive, Maneuver):
                steps[k] = primitive.displacement
        return steps

    @cached_property
    def twists(self) -> Array:
        """Twist (m, dof) of every trim; zero for maneuvers."""
        still = np.zeros(self.start.size)
        rows = [getattr(one, "body_velocity", still) for one in self.primitives]
        return np.array(rows).reshape(-1, self.start.size)

    @property
    def end(self) -> Array:
        """Pose (dof,) at the end."""
        if any(self.maneuvers) or "switching_poses" in vars(self):
            return np.asarray(self.switching_poses[-1])
        twists = [trim.body_velocity for trim in self.trims]
        return end_of_coasting(self.start, twists, self.durations.tolist())

    def pose_at(self, time: ArrayLike) -> Array:
        """Poses (..., dof) at `time` (...,) [s]; held before the start and after the end."""
        plain = isinstance(time, float) and abs(time) >= 0.0  # no NaN
        times = np.asarray(time) if plain else as_array("time", time, infinite=True)
        if not self.trims:
            return np.broadcast_to(self.start, (*times.shape, self.start.size)).copy()
        if not (times.ndim or any(self.maneuvers)):  # one time, of trims alone: plain numbers
            return self._pose_at(float(times)).copy()
        index = self._index_at(times)
        begin = group_of(self.start.size)(self.switching_poses[index])
        since = np.clip(times - self.switching_times[index], 0.0, self.primitive_durations[index])
        steps = np.array(begin.exp(since[..., None] * self.twists[index]).pose)
        for k, primitive in enumerate(self.primitives):
            if isinstance(primitive, Maneuver) and (here := index == k).any():
                steps[here] = _within(primitive, since[here])
        return (begin @ type(begin)(steps)).pose

    def _pose_at(self, time: float) -> Array:
        """The pose (dof,) at one time, of trims alone; kept, as loops ask for it a step later."""
        known: tuple[float, Array] | None = vars(self).get("_asked")
        if known is None or known[0] != time:
            durations = self.durations.tolist()
            begins = [self.start_time + since for since in accumulate(durations[:-1], initial=0.0)]
            k = bisect_right(begins, time, lo=1) - 1
            lasting = [*durations[:k], min(max(time - begins[k], 0.0), durations[k])]
            twists = [trim.body_velocity for trim in self.trims[: k + 1]]
            known = vars(self)["_asked"] = time, end_of_coasting(self.start, twists, lasting)
        return known[1]

    def control_at(self, time: ArrayLike) -> Array:
        """Controls (..., n_u) at `time` (...,) [s]; at a switch, that of what begins."""
        if not self.primitives:
            raise ValueError("plan: an empty word has no control")
        times = as_array("time", time, infinite=True)
        samples = self.sample()
        if any(self.maneuvers):
            after = np.searchsorted(samples.time[1:-1], times, side="right")
            return np.asarray(samples.control[after])
        controls = np.array([trim.control for trim in self.trims])
        return np.asarray(controls[self._index_at(times)])

    def _index_at(self, times: Array) -> np.ndarray[tuple[int, ...], np.dtype[np.intp]]:
        return np.searchsorted(self.switching_times[1:-1], times, side="right")

    def sample(self, *, max_step_m: float = 0.05, max_step_rad: float = 0.05) -> Trajectory:
        """Samples at every switching time and closer than both steps in between.

        Maneuvers are sampled where their courses are, and between if that is too wide.

        Raises
        ------
        ValueError
            If a maneuver has no course, or a step is not positive.
        """
        max_step_m = as_number("plan: max_step_m", max_step_m)
        max_step_rad = as_number("plan: max_step_rad", max_step_rad)
        check_range("plan: max_step_m", max_step_m, unit="m", infinite=True)
        check_range("plan: max_step_rad", max_step_rad, unit="rad", infinite=True)
        if not self.primitives:
            states = [trim.reduced_state for trim in self.trims]
            return Trajectory(
                time=np.array([self.start_time]),
                pose=self.start[None].copy(),
                reduced_state=np.array(states[:1]).reshape(1, -1) if states else np.zeros((1, 0)),
                control=np.array([trim.control for trim in self.trims[:1]]).reshape(1, -1),
            )
        parts = [
            _trim_samples(primitive, duration, max_step_m, max_step_rad)
            if isinstance(primitive, Trim)
            else _finer(primitive.known_course("so it cannot be sampled"), max_step_m, max_step_rad)
            for primitive, duration in self._pieces
        ]
        group = group_of(self.start.size)
        begins = zip(self.switching_poses, self.switching_times, parts, strict=False)
        moved = [
            ((group(pose) @ group(part.pose[:-1])).pose, time + part.time[:-1])
            for pose, time, part in begins
        ]
        last = parts[-1]
        return Trajectory(
            time=np.concatenate([*(times for _, times in moved), self.switching_times[-1:]]),
            pose=np.concatenate([*(poses for poses, _ in moved), self.end[None]]),
            reduced_state=np.concatenate(
                [*(part.reduced_state[:-1] for part in parts), last.reduced_state[-1:]]
            ),
            control=np.concatenate([*(part.control[:-1] for part in parts), last.control[-1:]]),
        )

    def as_arrays(self, *, step: float | None = None, model: Model | None = None) -> PlanArrays:
        """Time, pose, twist, reduced state, control and primitive, one row an instant.

        Parameters
        ----------
        step : float, optional
            Time between two rows [s], and a row at the end; if left out, the samples of `sample`.
        model : Model, optional
            The vehicle, ``automaton.model``: it names the columns of reduced state and control, and
            says the twists within maneuvers, else the mean from row to row.

        Raises
        ------
        ValueError
            If a maneuver has no course, or the step is not positive.

        Examples
        --------
        >>> ahead = Trim(name="ahead", body_velocity=[1.0, 0.0, 0.0], control=[1.0, 0.0])
        >>> rows = Plan([0.0, 0.0, 0.0], (ahead,), durations=[2.0]).as_arrays(step=1.0)
        >>> rows.time.tolist(), rows.pose[:, 0].tolist(), rows.primitive.tolist()
        ([0.0, 1.0, 2.0], [0.0, 1.0, 2.0], ['ahead', 'ahead', 'ahead'])
        """
        return plan_arrays(self, step=step, model=model)

    def to_frame(self, *, step: float | None = None, model: Model | None = None) -> Any:
        """The columns of `as_arrays` as a DataFrame of pandas, which must be installed.

        Raises
        ------
        MissingExtra
            If pandas is not installed.
        """
        try:
            import pandas
        except ImportError as error:
            raise MissingExtra(
                "to_frame: pandas is not installed; need "
                "`pip install 'maneuver-automaton[pandas]'`, or as_arrays or save_csv, "
                "which do without"
            ) from error
        return pandas.DataFrame(self.as_arrays(step=step, model=model).columns())

    def moved(self, by: LieGroup) -> Plan:
        """A plan of the same word from the start moved by `by`: the law of the project."""
        return replace(self, start=(by @ type(by)(self.start)).pose)


def _within(maneuver: Maneuver, since: Array) -> Array:
    """Poses (..., dof) of a maneuver at times since its begin; of one twist if it has no course."""
    if (course := maneuver.course) is not None:
        if course.model is None:
            return course.pose_at(since)
        return along(course, since.ravel(), course.model)[0].reshape(*since.shape, -1)
    group = group_of(maneuver.displacement.size)
    share = since / maneuver.duration if maneuver.duration > 0.0 else np.ones_like(since)
    return group.exp(share[..., None] * group(maneuver.displacement).log()).pose


def _trim_samples(
    trim: Trim, duration: float, max_step_m: float, max_step_rad: float
) -> Trajectory:
    twist = trim.body_velocity
    speed = float(np.linalg.norm(twist[[0, 1, *range(3, twist.size)]]))
    steps = max(speed * duration / max_step_m, abs(twist[2]) * duration / max_step_rad)
    n = max(1, int(np.ceil(steps * (1.0 + 1e-9))))
    time = np.linspace(0.0, duration, n + 1)
    return Trajectory(
        time=time,
        pose=group_of(twist.size).exp(time[:, None] * twist).pose,
        reduced_state=np.tile(trim.reduced_state, (n + 1, 1)),
        control=np.tile(trim.control, (n + 1, 1)),
    )


def _finer(course: Trajectory, max_step_m: float, max_step_rad: float) -> Trajectory:
    """The course with poses between its samples where these are too far apart."""
    steps = np.abs(np.diff(course.pose, axis=0))
    places = [0, 1, *range(3, steps.shape[1])]
    lengths = np.linalg.norm(steps[:, places], axis=1)
    parts = np.ceil(np.maximum(lengths / max_step_m, steps[:, 2] / max_step_rad) - 1e-9)
    count = np.maximum(parts, 1.0).astype(np.int64)
    if not (count > 1).any():
        return course
    index = np.repeat(np.arange(count.size), count)
    first = np.concatenate([[0], np.cumsum(count)[:-1]])
    share = (np.arange(index.size) - first[index]) / count[index]
    time = np.append(course.time[index] + share * np.diff(course.time)[index], course.time[-1])
    if course.model is not None:
        pose, reduced = along(course, time, course.model)
    else:
        change = np.diff(course.reduced_state, axis=0)
        reduced = course.reduced_state[index] + share[:, None] * change[index]
        pose, reduced = course.pose_at(time), np.vstack([reduced, course.reduced_state[-1:]])
    return replace(
        course,
        time=time,
        pose=pose,
        reduced_state=reduced,
        control=np.concatenate([course.control[index], course.control[-1:]]),
    )

"""Trims, maneuvers, and the courses that maneuvers take: the primitives of a maneuver automaton."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array, check_fields, freeze, plain_numbers
from maneuver_automaton._brief import brief
from maneuver_automaton._limits import FASTEST, FASTEST_SPIN
from maneuver_automaton.groups import LieGroup, group_of
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
        times = as_array("time", time, infinite=True)
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


Pose = TypeVar("Pose", bound=LieGroup)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Trim:
    """Motion that looks the same at every instant: constant control, constant twist.

    Source: Frazzoli, Dahleh, Feron (2005), Sec. III-A; the paper's Definition 5.

    Examples
    --------
    >>> from maneuver_automaton.groups import SE2
    >>> turn = Trim(name="turn", body_velocity=[1.0, 0.0, 1.0], control=[1.0, 1.0])
    >>> turn.coast(SE2([0.0, 0.0, 0.0]), np.pi).pose.round(3).tolist()
    [0.0, 2.0, 3.142]
    """

    name: str
    body_velocity: Array  # (dof,) [m/s, m/s, rad/s(, m/s)]; [m/s, m/s] where nothing turns
    control: Array  # (n_u,), the model's units
    reduced_state: Array = field(default_factory=lambda: np.zeros(0))  # (n_z,), the model's units
    max_duration: float = math.inf  # [s]
    is_rest: bool = field(default=False, init=False, repr=False)  # its twist is zero

    __repr__ = brief

    def __post_init__(self) -> None:
        plain_numbers(self)
        freeze(self, "body_velocity", last=(2, 3, 4))
        object.__setattr__(self, "is_rest", not any(self.body_velocity.ravel().tolist()))
        freeze(self, "control")
        freeze(self, "reduced_state")
        if not isinstance(self.name, str) or not self.name.strip():
            raise ValueError(
                f"trim: got the name {self.name!r}, need at least one visible character"
            )
        places = [0, 1, *range(3, self.body_velocity.shape[-1])]
        fastest = float(np.abs(self.body_velocity[..., places]).max(initial=0.0))
        if fastest > FASTEST:
            raise ValueError(
                f"trim {self.name!r}: body_velocity holds {fastest:g} m/s, "
                f"need at most {FASTEST:g} m/s"
            )
        spin = float(np.abs(self.body_velocity[..., 2:3]).max(initial=0.0))
        if spin > FASTEST_SPIN:
            raise ValueError(
                f"trim {self.name!r}: body_velocity turns at {spin:g} rad/s, "
                f"need at most {FASTEST_SPIN:g} rad/s"
            )
        check_fields(f"trim {self.name!r}", self, "max_duration", unit="s", infinite=True)

    def coast(self, start: Pose, duration: ArrayLike) -> Pose:
        """Poses after coasting from `start` for `duration` (...,) [s]."""
        return start @ start.exp(as_array("duration", duration)[..., None] * self.body_velocity)


CLOSED = 1e-9  # [m, rad, s] between what a maneuver states and where its course ends


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Maneuver:
    """A transition of fixed displacement, duration and cost from one trim to another.

    Its `course` runs from the identity pose and time 0, under controls that are constant between
    samples; without one it is not known what happens in between. It costs `cost_multiplier` times
    what the stage cost makes of its course.

    Source: Frazzoli, Dahleh, Feron (2005), Sec. III-B.

    Examples
    --------
    >>> Maneuver(name="brake", source="cruise", target="rest", displacement=[2.0, 0.0, 0.0],
    ...          duration=1.5).displacement.tolist()
    [2.0, 0.0, 0.0]
    """

    name: str
    source: str  # name of the trim it leaves
    target: str  # name of the trim it reaches
    displacement: Array  # (dof,) pose gained, in the frame where it starts
    duration: float = 0.0  # [s]
    course: Trajectory | None = None
    cost_multiplier: float = 1.0

    __repr__ = brief

    def __post_init__(self) -> None:
        plain_numbers(self)
        freeze(self, "displacement", last=(2, 3, 4))
        about = f"maneuver {self.name!r}"
        check_fields(about, self, "duration", least=0, unit="s", infinite=True)
        check_fields(about, self, "cost_multiplier", least=0)
        if self.course is None:
            return
        off = max(
            float(np.abs(self.course.pose[-1] - self.displacement).max()),
            float(np.abs(self.course.pose[0]).max()),
            abs(float(self.course.time[-1]) - self.duration),
            abs(float(self.course.time[0])),
        )
        scale = max(1.0, self.duration, float(np.abs(self.displacement).max()))
        if not off <= CLOSED * scale:
            raise ValueError(
                f"maneuver {self.name!r}: its course must run from the identity and time 0 to its "
                f"displacement and duration, got a difference of {off:.3g}"
            )

    def known_course(self, otherwise: str) -> Trajectory:
        """The course; a ValueError that ends with `otherwise` if there is none."""
        if self.course is None:
            raise ValueError(f"maneuver {self.name!r}: has no course, {otherwise}")
        return self.course

    @classmethod
    def along(
        cls,
        course: Trajectory,
        *,
        name: str,
        source: str,
        target: str,
        cost_multiplier: float = 1.0,
    ) -> Maneuver:
        """The maneuver that ends where its course does.

        Examples
        --------
        >>> course = Trajectory(
        ...     time=np.array([0.0, 2.0]), pose=np.array([[0.0, 0, 0], [2.0, 0, 0]]),
        ...     reduced_state=np.zeros((2, 0)), control=np.ones((2, 1)))
        >>> hop = Maneuver.along(course, name="hop", source="rest", target="rest")
        >>> hop.displacement.tolist(), hop.duration
        ([2.0, 0.0, 0.0], 2.0)
        """
        return cls(
            name=name,
            source=source,
            target=target,
            displacement=course.pose[-1],
            duration=float(course.time[-1]),
            course=course,
            cost_multiplier=cost_multiplier,
        )

"""Maneuvers: transitions between trims, the edges of a maneuver automaton."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from maneuver_automaton._arrays import Array, freeze, plain_numbers
from maneuver_automaton._brief import brief
from maneuver_automaton.primitives.trajectory import Trajectory

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
        if not self.duration >= 0.0:
            raise ValueError(
                f"maneuver {self.name!r}: duration must not be negative, got {self.duration} s"
            )
        if not 0.0 <= self.cost_multiplier < math.inf:
            raise ValueError(
                f"maneuver {self.name!r}: cost_multiplier must be a number of at least 0, got "
                f"{self.cost_multiplier}"
            )
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

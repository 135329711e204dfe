"""Obstacles that move: advance in time by no more than the distance allows.

From the exact distance at one time, the time at which two bodies can touch at the earliest; from
there again, until they are closer than what counts as contact or the motion is over. Nothing is
missed between, whatever turns, and what is reported is no further than that.

Solids in (x, y, c t) are the other sound way. Where all move straight they are exact, and one
query is cheaper. But the solid of what turns stands out by ``reach * turn / 2``, on the side of
the obstacle too, where symmetry does not help: an error of 1 mm takes thousands of sections a
second, or a new mesh for every slice of every query, each dearer than ten distances. And with time
as third axis no heights are left that tell the inside of a skin.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.collision.shapes import Motion
from maneuver_automaton.collision.swept import Twist
from maneuver_automaton.groups import SE2


class Rover(NamedTuple):
    """A body whose frame coasts from a pose."""

    start: Array  # (3,)
    twist: Twist
    middle: Array  # (2,) of a disc around the body, in its frame [m]
    reach: float  # [m] radius of that disc

    def at(self, time: float) -> Array:
        """Pose (3,) after `time` [s]."""
        return (SE2(self.start) @ SE2.exp(time * np.array(self.twist))).pose


class Mover(NamedTuple):
    """A body whose frame follows poses in time."""

    knots: Array  # (n,) [s]
    poses: Array  # (n, 3)
    reach: float  # [m] no point is further from the frame's origin

    @classmethod
    def of(cls, motion: Motion, reach: float, *, start_time: float) -> Mover:
        """A motion whose clock is set to zero at `start_time` [s]."""
        return cls(motion.time - start_time, motion.pose, reach)

    def at(self, time: float) -> Array:
        """Pose (3,) at `time` [s]."""
        return np.array([np.interp(time, self.knots, self.poses[:, k]) for k in range(3)])

    def rates(self, time: float) -> tuple[Array, float]:
        """Velocity of the pose (3,) from `time` [s] on, and until when it lasts [s]."""
        k = int(np.searchsorted(self.knots, time, side="right"))
        if k == self.knots.size:
            return np.zeros(3), math.inf
        if k == 0:
            return np.zeros(3), float(self.knots[0])
        step = (self.poses[k] - self.poses[k - 1]) / (self.knots[k] - self.knots[k - 1])
        return step, float(self.knots[k])


def meet(
    rover: Rover,
    mover: Mover,
    *,
    duration: float,
    distance: Callable[[Array, Array], float],
    contact: float,
) -> bool:
    """Whether two bodies come within `contact` > 0 [m] of each other until `duration` [s].

    True only if they do; False only if they never touch. `distance` is that of the bodies at a
    pose of the rover and one of the mover, and is asked for where discs around them are close.

    Source: conservative advancement, Mirtich (1996), *Impulse-based Dynamic Simulation of Rigid
    Body Systems*, Sec. 2.3, here with the least time in which ``a t + b t^2 / 2`` is the distance.

    Examples
    --------
    >>> still = Rover(np.zeros(3), (0.0, 0.0, 0.0), np.zeros(2), 0.5)
    >>> crossing = Mover(np.array([0.0, 4.0]), np.array([[-4.0, 0, 0], [4.0, 0, 0]]), 0.5)
    >>> def gap(one, other):
    ...     return max(0.0, math.hypot(*(one - other)[:2]) - 1.0)
    >>> meet(still, crossing, duration=1.0, distance=gap, contact=1e-3)
    False
    >>> meet(still, crossing, duration=2.0, distance=gap, contact=1e-3)
    True
    """
    v_x, v_y, turn_rate = rover.twist
    middle_twist = complex(v_x, v_y) + 1j * turn_rate * complex(*rover.middle)
    bend = abs(middle_twist) * abs(turn_rate)
    near = 0.5 * (rover.reach + mover.reach)
    time = 0.0
    while True:
        here, there = rover.at(time), mover.at(time)
        turned = complex(math.cos(here[2]), math.sin(here[2]))
        center = complex(here[0], here[1]) + turned * complex(*rover.middle)
        gap = abs(center - complex(there[0], there[1])) - rover.reach - mover.reach
        if gap <= near:
            gap = distance(here, there)
            if gap <= contact:
                return True
        if time >= duration:
            return False
        rates, until = mover.rates(time)
        closing = abs(turned * middle_twist - complex(rates[0], rates[1]))
        closing += abs(turn_rate) * rover.reach + abs(rates[2]) * mover.reach
        speed = closing + math.sqrt(closing * closing + 2.0 * bend * gap)
        step = 2.0 * gap / speed if speed > 0.0 else math.inf
        time = min(time + step, until, duration)

"""Motions as values: where a frame is at which time, on lines or on arcs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maneuver_automaton._arrays import Array, IntArray, as_array, freeze, wrapped
from maneuver_automaton._brief import brief
from maneuver_automaton._limits import FASTEST, FASTEST_TURN, check_size
from maneuver_automaton.groups import SE2, LieGroup

GAP = 1e-8  # of the size of a motion: how far beside its next pose a twist may lead


class Coasting(Protocol):
    """What coasts from pose to pose: a plan."""

    @property
    def coasts(self) -> tuple[Array, Array, Array]:
        """Times (n,) [s], planar poses (n, 3), and the twist (n - 1, 3) after each but the last."""


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Poses in time, still before and after; between two linear, the heading too, or on an arc.

    With twists it coasts from each pose with a constant body velocity until the next: the motion of
    a vehicle that holds its trims, exactly, with one pose for each.

    Examples
    --------
    >>> Motion([0.0, 2.0], [[0, 0, 0], [4, 0, 0]]).at(0.5).tolist()
    [1.0, 0.0, 0.0]
    >>> half_turn = Motion([0.0, 1.0], [[0, 0, 0], [0, 2, np.pi]], twist=[[np.pi, 0, np.pi]])
    >>> half_turn.at(0.5).round(9).tolist()
    [1.0, 1.0, 1.570796327]
    """

    time: Array  # (n,) [s], rising
    pose: Array  # (n, 3) [m, m, rad]
    twist: Array | None = None  # (n - 1, 3) [m/s, m/s, rad/s] in the body's frame, after each pose

    __repr__ = brief

    if TYPE_CHECKING:

        def __init__(
            self, time: ArrayLike, pose: ArrayLike, twist: ArrayLike | None = None
        ) -> None: ...

    def __post_init__(self) -> None:
        freeze(self, "time")
        freeze(self, "pose", last=3)
        if self.time.ndim != 1 or self.pose.shape != (self.time.size, 3) or not self.time.size:
            raise ValueError(
                f"motion: got {self.time.shape} times and poses {self.pose.shape}, "
                "need (n,) and (n, 3) with n >= 1"
            )
        if not (np.diff(self.time) > 0.0).all():
            raise ValueError(f"motion: times must rise, got {self.time.tolist()} s")
        check_size("motion: pose", self.pose[:, :2])
        if self.twist is None:
            self._refuse_jumps()
        else:
            self._refuse_gaps()

    @classmethod
    def of_plan(cls, plan: Coasting) -> Motion:
        """The motion of a vehicle that drives a plan, and stays where it ends.

        Along trims it is exact; along a maneuver it coasts from sample to sample of its course.

        Raises
        ------
        ValueError
            If a maneuver has no course.

        Examples
        --------
        >>> from maneuver_automaton.automaton import Plan
        >>> from maneuver_automaton.primitives import Trim
        >>> left = Trim(name="left", body_velocity=[1.0, 0.0, 0.5], control=[1.0, 0.5])
        >>> plan = Plan([0.0, 0.0, 0.0], (left,), durations=[np.pi], start_time=2.0)
        >>> Motion.of_plan(plan).at(2.0 + np.pi).round(6).tolist()
        [2.0, 2.0, 1.570796]
        """
        return cls(*plan.coasts)

    def _refuse_gaps(self) -> None:
        """Raise a ValueError at the first pose that its twist does not lead to, or too fast."""
        freeze(self, "twist", last=3)
        assert self.twist is not None
        if self.twist.shape != (self.time.size - 1, 3):
            raise ValueError(
                f"motion: got twists {self.twist.shape}, need one for all poses but the last, "
                f"({self.time.size - 1}, 3)"
            )
        lasting = np.diff(self.time)
        ends = (SE2(self.pose[:-1]) @ SE2.exp(lasting[:, None] * self.twist)).pose
        off = ends - self.pose[1:]
        off[:, 2] = wrapped(off[:, 2])
        far = 1.0 + np.abs(self.pose).max() + self.covered
        gaps = np.flatnonzero(np.abs(off).max(axis=1, initial=0.0) > GAP * far)
        if gaps.size:
            k = int(gaps[0])
            raise ValueError(
                f"motion: twist {k + 1} leads {np.hypot(*off[k, :2]):.3g} m and "
                f"{abs(off[k, 2]):.3g} rad beside pose {k + 2}"
            )
        speeds = np.hypot(self.twist[:, 0], self.twist[:, 1])
        for rates, most, units in (
            (speeds, FASTEST, "m/s"),
            (np.abs(self.twist[:, 2]), FASTEST_TURN, "rad/s"),
        ):
            if rates.size and rates.max() > most:
                k = int(np.argmax(rates))
                raise ValueError(
                    f"motion: twist {k + 1} is {rates[k]:.6g} {units}, need at most {most:g} "
                    f"{units}"
                )

    def _refuse_jumps(self) -> None:
        """Raise a ValueError at the first pose that nothing reaches in time."""
        lasting = np.diff(self.time)
        steps = np.diff(self.pose, axis=0)
        covered = np.hypot(steps[:, 0], steps[:, 1])
        for change, most, units in (
            (covered, FASTEST, ("m", "m/s")),
            (np.abs(steps[:, 2]), FASTEST_TURN, ("rad", "rad/s")),
        ):
            jumps = np.flatnonzero(change > most * lasting)
            if jumps.size:
                k = int(jumps[0])
                raise ValueError(
                    f"motion: pose {k + 2} at {self.time[k + 1]:.6g} s is {change[k]:.6g} "
                    f"{units[0]} from pose {k + 1}, {lasting[k]:.6g} s before: that is "
                    f"{change[k] / lasting[k]:.6g} {units[1]}, need at most {most:g} {units[1]}"
                )

    @property
    def rates(self) -> Array:
        """Rates (n - 1, 3) between poses: twists, or else those of the pose itself."""
        if self.twist is not None:
            return self.twist
        return np.asarray(np.diff(self.pose, axis=0) / np.diff(self.time)[:, None])

    @property
    def speeds(self) -> Array:
        """Speed (n - 1,) of the frame's origin between poses [m/s]."""
        rates = self.rates
        return np.hypot(rates[:, 0], rates[:, 1])

    @property
    def turn_rates(self) -> Array:
        """How fast the frame turns (n - 1,) between poses, in either sense [rad/s]."""
        return np.abs(self.rates[:, 2])

    @property
    def bends(self) -> Array:
        """Acceleration (n - 1,) of the frame's origin between poses [m/s^2]; 0 on lines."""
        return self.speeds * self.turn_rates if self.twist is not None else 0.0 * self.speeds

    @property
    def covered(self) -> float:
        """Path of the frame's origin [m]."""
        return float(self.speeds @ np.diff(self.time))

    def fastest(self, reach: float) -> float:
        """No point that is within `reach` [m] of the frame's origin is ever faster [m/s]."""
        return float((self.speeds + reach * self.turn_rates).max(initial=0.0))

    def at(self, time: ArrayLike) -> Array:
        """Poses (..., 3) at `time` (...,) [s]."""
        times = as_array("time", time, infinite=True)
        if self.twist is None or self.time.size == 1:
            columns = [np.interp(times, self.time, self.pose[:, k]) for k in range(3)]
            return np.stack(columns, axis=-1)
        since = np.clip(times, self.time[0], self.time[-1])
        k = np.clip(np.searchsorted(self.time, since, side="right") - 1, 0, len(self.twist) - 1)
        since = since - self.time[k]
        found = np.array((SE2(self.pose[k]) @ SE2.exp(since[..., None] * self.twist[k])).pose)
        # The heading of a group element is one of many; that of a motion goes on from pose to pose.
        found[..., 2] = self.pose[k, 2] + since * self.twist[k, 2]
        return np.where((times >= self.time[-1])[..., None], self.pose[-1], found)

    def times_for_lines(self, turn: float) -> Array:
        """Times (m,) between which lines stand for it: on arcs it turns no more than `turn` [rad].

        Examples
        --------
        >>> Motion([0, 1], [[0, 0, 0], [0, 2, np.pi]], [[np.pi, 0, np.pi]]).times_for_lines(2.0)
        array([0. , 0.5, 1. ])
        """
        if self.twist is None:
            return self.time
        lasting = np.diff(self.time)
        counts = np.maximum(np.ceil(self.turn_rates * lasting / turn), 1.0).astype(np.int64)
        lines = zip(self.time[:-1], lasting, counts.tolist(), strict=True)
        begins = [first + step * np.arange(n) / n for first, step, n in lines]
        return np.append(np.concatenate([np.zeros(0), *begins]), self.time[-1])

    def moved(self, by: LieGroup) -> Motion:
        """The motion moved by a planar pose."""
        return Motion(self.time, (planar(by) @ SE2(self.pose)).pose, self.twist)


class Knots(NamedTuple):
    """Several motions side by side, so that all are asked at once."""

    time: Array  # (k,) [s]
    pose: Array  # (k, 3)
    rate: Array  # (k, 3) after each knot, of the pose or as a twist; none after a motion's last
    first: IntArray  # (motions + 1,) where those of each begin
    arcs: NDArray[np.bool_]  # (motions,) whether the rates are twists

    @classmethod
    def of(cls, motions: Sequence[Motion]) -> Knots:
        """Those of some motions."""
        none = np.zeros((0, 3))
        return cls(
            time=np.concatenate([none[:, 0], *(one.time for one in motions)]),
            pose=np.concatenate([none, *(one.pose for one in motions)]),
            rate=np.concatenate([none, *(part for one in motions for part in (one.rates, REST))]),
            first=np.cumsum([0, *(one.time.size for one in motions)]),
            arcs=np.array([one.twist is not None for one in motions], dtype=np.bool_),
        )

    def at(self, motions: IntArray, times: Array) -> Array:
        """Poses (..., 3) of motions, by number, at times [s]; the shapes of both broadcast."""
        k = self._before(motions, times)
        since = np.maximum(times - self.time[k], 0.0)
        x, y, heading = np.moveaxis(self.pose[k], -1, 0)
        v_x, v_y, turn = np.moveaxis(self.rate[k], -1, 0)
        # A chord of an arc leads in the direction that the frame has half way.
        half = np.where(self.arcs[motions], 0.5 * turn * since, 0.0)
        along = np.where(self.arcs[motions], heading + half, 0.0)
        chord = since * np.sinc(half / np.pi)
        c, s = chord * np.cos(along), chord * np.sin(along)
        place = x + (v_x * c - v_y * s), y + (v_x * s + v_y * c)
        return np.stack([*place, heading + turn * since], axis=-1)

    def _before(self, motions: IntArray, times: Array) -> IntArray:
        """The last knot at or before a time, or the first one of a motion."""
        # One search for all: the times of each motion come after those of the motion before it.
        low = min(float(self.time.min()), float(times.min(initial=math.inf)))
        width = max(float(self.time.max()), float(times.max(initial=low))) - low + 1.0
        keys = self.time - low + width * np.repeat(np.arange(self.arcs.size), np.diff(self.first))
        found = np.searchsorted(keys, times - low + width * motions, side="right") - 1
        return np.clip(found, self.first[motions], self.first[1:][motions] - 1)


REST = np.zeros((1, 3))
STANDS = Motion([0.0], [[0.0, 0.0, 0.0]])


def point_speeds(twists: Array, points: Array) -> Array:
    """Speeds (m, n) [m/s] of points (n, 2) of a frame under twists (m, 3 or more) of it."""
    v_x, v_y, turn = twists[:, 0, None], twists[:, 1, None], twists[:, 2, None]
    return np.hypot(v_x - turn * points[:, 1], v_y + turn * points[:, 0])


def planar(by: LieGroup) -> SE2:
    """The part of a group element in the plane."""
    return SE2(by.pose[..., :3])

"""Poses on the way: what a plan passes between its start and its goal, and when it does."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array, check_fields, freeze, plain_numbers
from maneuver_automaton._brief import brief
from maneuver_automaton._limits import check_heading, check_size
from maneuver_automaton.groups import LieGroup

LONGER = 1.1  # a way, than the line between its ends
MET = 1e-9  # [m, rad] from a pose on the way, beyond its tolerance, as of goals
FINER = 8  # parts of a stretch of time in which a nearest instant is sought, again and again
FINEST = 1e-14  # of the time of a plan, at which that ends
STILL = 1e-9  # [m, rad] that a vehicle moves which stands


@dataclass(frozen=True, slots=True, eq=False)
class Via:
    """What a plan passes on its way: a pose, exactly or within a tolerance, or a gate.

    Parameters
    ----------
    pose : (dof,) array, optional
        [m, m, rad(, m)]; two numbers, the place in the plane, if any heading will do. Of a gate it
        states the heading, and must lie on it.
    free_heading : bool
        Whether any heading will do.
    tolerance_m : float
        Distance [m] that is near enough.
    stop : bool
        Whether the vehicle comes to rest there. One that switches at will may stop for no time.
    stay_s : float
        How long [s] it stands there.
    gate : two points, optional
        Ends (2 or 3 numbers each) [m] of a segment that is to be crossed anywhere; without a pose
        at any heading.

    Raises
    ------
    ValueError
        If a number is out of range, there is neither a pose nor a gate, or the pose is beside it.

    Examples
    --------
    >>> Via([1, 2], free_heading=True).pose.tolist()
    [1.0, 2.0, 0.0]
    >>> Via(gate=[[0, 0], [2, 0]]).off(np.array([1.5, 0.5, 2.0]))
    (0.5, 0.0)
    """

    pose: Array = None  # type: ignore[assignment]  # of a gate: its middle, the heading across
    free_heading: bool = field(default=False, kw_only=True)
    tolerance_m: float = field(default=0.0, kw_only=True)
    stop: bool = field(default=False, kw_only=True)
    stay_s: float = field(default=0.0, kw_only=True)
    gate: Array | None = field(default=None, kw_only=True)  # (2, 2 or 3) [m]

    __repr__ = brief

    if TYPE_CHECKING:  # any numbers will do

        def __init__(
            self,
            pose: ArrayLike | LieGroup | None = None,
            *,
            free_heading: bool = False,
            tolerance_m: float = 0.0,
            stop: bool = False,
            stay_s: float = 0.0,
            gate: ArrayLike | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        plain_numbers(self)
        if self.gate is not None:
            self._check_gate(self.gate)
        elif self.pose is None:
            raise ValueError("via: has neither a pose nor a gate, need one of them")
        pose = as_array("via: pose", self.pose)
        if pose.shape == (2,) and self.free_heading:
            pose = np.append(pose, 0.0)
        object.__setattr__(self, "pose", pose)
        freeze(self, "pose", last=(2, 3, 4))
        if self.pose.ndim != 1:
            raise ValueError(f"via: pose has shape {self.pose.shape}, need one pose")
        check_size("via: pose", self.place)
        check_heading("via: pose", self.pose)
        check_fields("via", self, "tolerance_m", "stay_s", least=0)
        object.__setattr__(self, "stop", bool(self.stop or self.stay_s > 0.0))
        if self.gate is None:
            return
        if self.gate.shape[1] != self.place.size:
            raise ValueError(
                f"via: gate: its ends have {self.gate.shape[1]} numbers, the place of the pose "
                f"{self.place.size}; need as many"
            )
        beside = self.off(self.pose)[0]
        if beside > 1e-6 * (1.0 + float(np.abs(self.gate).max())):
            raise ValueError(
                f"via: pose is {beside:.6g} m beside the gate, need one on it, whose heading is "
                "that of the crossing"
            )

    def _check_gate(self, gate: Array) -> None:
        """Two ends that are apart; without a pose the middle, with a heading across."""
        gate = as_array("via: gate", gate)
        if gate.shape not in ((2, 2), (2, 3)):
            raise ValueError(f"via: gate has shape {gate.shape}, need two points [x, y]")
        check_size("via: gate", gate)
        along = gate[1] - gate[0]
        if not along[:2].any():
            raise ValueError(f"via: gate: its ends are both {gate[0].tolist()}, need two places")
        object.__setattr__(self, "gate", gate)
        freeze(self, "gate")
        if self.pose is None:
            middle = (gate[0] + gate[1]) / 2.0
            object.__setattr__(self, "pose", np.insert(middle, 2, math.atan2(along[0], -along[1])))
            object.__setattr__(self, "free_heading", True)

    @property
    def place(self) -> Array:
        """Its place [m], of a gate that of its pose, without the heading."""
        return self.pose[[0, 1, *range(3, self.pose.size)]]

    @property
    def radius(self) -> float:
        """No place that will do is further from that of its pose [m]."""
        reach = 0.0
        if self.gate is not None:
            reach = float(np.linalg.norm(self.gate - self.place, axis=1).max())
        return reach + self.tolerance_m

    def offs(self, poses: Array) -> tuple[Array, Array]:
        """How far poses (..., dof) are off: distance beyond the tolerance [m] and turn [rad]."""
        places = poses[..., [0, 1, *range(3, poses.shape[-1])]]
        nearest: Array = self.place
        if self.gate is not None:
            along = self.gate[1] - self.gate[0]
            share = np.clip((places - self.gate[0]) @ along / (along @ along), 0.0, 1.0)
            nearest = self.gate[0] + share[..., None] * along
        distance = np.maximum(np.linalg.norm(places - nearest, axis=-1) - self.tolerance_m, 0.0)
        off = poses[..., 2] - self.pose[2]
        turn = np.abs(off - 2.0 * math.pi * np.round(off / (2.0 * math.pi)))
        return distance, np.zeros_like(turn) if self.free_heading else turn

    def off(self, pose: Array) -> tuple[float, float]:
        """How far a pose (dof,) is off: distance beyond the tolerance [m], and turn [rad]."""
        distance, turn = self.offs(pose)
        return float(distance), float(turn)

    def moved(self, by: LieGroup) -> Via:
        """The same, moved by the group element `by`."""
        group = type(by)
        gate = self.gate
        if gate is not None:
            gate = np.delete((by @ group(np.insert(gate, 2, 0.0, axis=1))).pose, 2, axis=1)
        return replace(self, pose=(by @ group(self.pose)).pose, gate=gate)

    def shifted(self, by: Array) -> Via:
        """The same, its place less `by` [m]: near an origin no digit is lost."""
        pose = np.array(self.pose)
        pose[[0, 1, *range(3, pose.size)]] -= by
        return replace(self, pose=pose, gate=None if self.gate is None else self.gate - by)


def instants_met(
    via: Via, times: Array, poses: Array, pose_at: Callable[[Array], Array]
) -> list[float]:
    """Times [s] at which it is met: of `times` (n,), which have `poses`, and the nearest between.

    Times are made finer around an instant of three at which distance and turn are least, and where
    both ends of a span are no further off than it leads: they may fall further, past a pose.
    """
    off, change = np.add(*via.offs(poses)), np.abs(np.diff(poses, axis=0)).sum(axis=1)
    found = times[off <= MET].tolist()
    padded, between = np.concatenate([[np.inf], off, [np.inf]]), off > MET
    lowest = (padded[1:-1] <= padded[:-2]) & (padded[1:-1] <= padded[2:]) & between
    lowest &= off < 2.0 * change.max(initial=0.0)
    spanned = (off[:-1] + off[1:] <= LONGER * change) & between[:-1] & between[1:]
    spanned &= ~(lowest[:-1] | lowest[1:])
    last = len(times) - 1
    spans = [(max(k - 1, 0), min(k + 1, last)) for k in np.flatnonzero(lowest).tolist()]
    spans += [(k, k + 1) for k in np.flatnonzero(spanned).tolist()]
    scale = FINEST * (1.0 + float(np.abs(times).max(initial=0.0)))
    for first, second in spans:
        low, high = times[first], times[second]
        while high - low > scale:
            fine = np.linspace(low, high, 2 * FINER + 1)
            off_fine = np.add(*via.offs(pose_at(fine)))
            least = int(np.argmin(off_fine))
            if off_fine[least] <= MET:
                found.append(float(fine[least]))
                break
            low, high = fine[max(least - 1, 0)], fine[min(least + 1, 2 * FINER)]
    return sorted(found)


def passages(
    vias: Sequence[Via],
    times: Array,
    pose_at: Callable[[Array], Array],
    rests: Callable[[float], bool],
    *,
    in_order: bool,
) -> list[float | None]:
    """When [s] each pose on the way is passed, as early as can be; None: it is missed."""
    found: list[float | None] = []
    earliest, poses = -math.inf, pose_at(times)
    for via in vias:
        at = None
        for time in instants_met(via, times, poses, pose_at):
            if time < earliest - MET or (via.stop and not rests(time)):
                continue
            last = time + via.stay_s
            if via.stay_s and not _stands(pose_at, time, last, float(times[-1])):
                continue
            at = time
            break
        found.append(at)
        if in_order and at is not None:
            earliest = at + via.stay_s
    return found


def _stands(pose_at: Callable[[Array], Array], first: float, last: float, end: float) -> bool:
    """Whether poses stay the same from one time to another [s]."""
    if last > end + MET:
        return False
    poses = pose_at(np.linspace(first, min(last, end), FINER + 1))
    return float(np.abs(poses - poses[0]).max()) <= STILL

"""Whether two plans are one motion, however their words spell it."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from maneuver_automaton._arrays import Array, wrapped
from maneuver_automaton.automaton.plan import Plan

SAME = 1e-3  # [m, rad] that poses of one motion differ by at most; less for ways below a metre
ROUNDING = 1e-9  # [m] that two turns on the spot may differ by


def same_motion(
    one: Plan, other: Plan, *, tolerance_m: float = SAME, tolerance_rad: float = SAME
) -> bool:
    """Whether two plans have the same pose at equal times, to within a tolerance.

    Parameters
    ----------
    one, other : Plan
        Each is taken to stand at its end once it has arrived.
    tolerance_m : float
        Distance [m] that counts as none; for plans of less than a metre, as a share of their way.
    tolerance_rad : float
        Difference of headings [rad] that counts as none.

    Returns
    -------
    bool
        Poses are compared at all switching times of both plans and halfway between.

    Examples
    --------
    >>> from maneuver_automaton.primitives import Trim
    >>> ahead = Trim(name="ahead", body_velocity=[1.0, 0.0, 0.0], control=[1.0, 0.0])
    >>> left = Trim(name="left", body_velocity=[1.0, 0.0, 1.0], control=[1.0, 1.0])
    >>> straight = Plan([0, 0, 0], (ahead,), durations=[2.0])
    >>> with_a_trace = Plan([0, 0, 0], (ahead, left), durations=[2.0 - 4e-7, 4e-7])
    >>> turning = Plan([0, 0, 0], (ahead, left), durations=[1.0, 1.0])
    >>> same_motion(straight, with_a_trace), same_motion(straight, turning)
    (True, False)
    """
    halfway = np.array([0.5 * max(one.duration, other.duration)])
    off, turned, _, _ = _apart(one, other, halfway)
    if off > tolerance_m + ROUNDING or turned > tolerance_rad:
        return False  # most plans differ there, and one instant is quick to look at
    switches = [plan.switching_times - plan.start_time for plan in (one, other)]
    times = np.unique(np.concatenate(switches))
    times = np.sort(np.concatenate([times, 0.5 * (times[1:] + times[:-1])]))
    off, turned, here, there = _apart(one, other, times)
    size = min(1.0, max(_way(here), _way(there)))
    return bool(off <= tolerance_m * size + ROUNDING and turned <= tolerance_rad)


def is_new(
    plan: Plan,
    known: Iterable[Plan],
    *,
    tolerance_m: float = SAME,
    tolerance_rad: float = SAME,
) -> bool:
    """Whether a plan is another motion than all that are known, to within tolerances."""
    return not any(
        same_motion(plan, other, tolerance_m=tolerance_m, tolerance_rad=tolerance_rad)
        for other in known
    )


def _apart(one: Plan, other: Plan, times: Array) -> tuple[float, float, Array, Array]:
    """Largest distance [m] and turn [rad] between plans these times [s] after their start; poses."""
    here, there = (
        plan.pose_at(plan.start_time + np.minimum(times, plan.duration)) for plan in (one, other)
    )
    places = [0, 1, *range(3, here.shape[-1])]
    off = np.linalg.norm((here - there)[:, places], axis=1).max()
    return float(off), float(np.abs(wrapped(here[:, 2] - there[:, 2])).max()), here, there


def _way(poses: Array) -> float:
    """Length of the way through poses (n, dof) [m]."""
    places = [0, 1, *range(3, poses.shape[-1])]
    return float(np.linalg.norm(np.diff(poses[:, places], axis=0), axis=1).sum())

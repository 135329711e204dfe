"""Whether two plans are one motion, whatever their words are."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from maneuver_automaton._arrays import Array, check_fields, wrapped
from maneuver_automaton.automaton.plan import Plan

ROUNDING = 1e-9  # [m] that two turns on the spot may differ by
INSTANTS = 33  # at which motions are compared beside their switching times


@dataclass(frozen=True, slots=True, kw_only=True)
class Likeness:
    """By how much two plans may differ and still count as one motion."""

    per_metre: float  # [m] between poses at equal times, per metre of the longer path
    most_metres: float = math.inf  # [m] of a path that count; a longer one counts as this long
    heading: float  # [rad] between headings at equal times

    def __post_init__(self) -> None:
        sizes = ("per_metre", "most_metres", "heading")
        check_fields("likeness", self, *sizes, least=0, infinite=True)


CONVERGED = Likeness(per_metre=1e-3, most_metres=1.0, heading=1e-3)  # times solved to the end
POLISHED = Likeness(per_metre=0.01, heading=0.02 * math.pi)  # ends of a local optimisation
UNFINISHED = Likeness(per_metre=0.02, heading=0.3)  # improved for as long as there was time


def same_motion(one: Plan, other: Plan, likeness: Likeness = CONVERGED) -> bool:
    """Whether two plans have the same pose at equal times, to within a tolerance.

    Parameters
    ----------
    one, other : Plan
        Each is taken to stand at its start before it begins, and at its end once it has arrived.
    likeness : Likeness
        What counts as the same.

    Returns
    -------
    bool
        Poses are compared at all switching times of both plans, halfway between them, and at
        instants spread evenly, which see what a maneuver does between its ends.

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
    switches = np.unique(np.concatenate([one.switching_times, other.switching_times]))
    halfway = np.array([0.5 * (switches[0] + switches[-1])])
    off, turned, _, _ = _apart(one, other, halfway)
    if off > likeness.per_metre * likeness.most_metres + ROUNDING or turned > likeness.heading:
        return False  # most plans differ there, and one instant is quick to look at
    middles = 0.5 * (switches[1:] + switches[:-1])
    spread = np.linspace(switches[0], switches[-1], INSTANTS)
    times = np.sort(np.concatenate([switches, middles, spread]))
    off, turned, here, there = _apart(one, other, times)
    size = min(likeness.most_metres, max(_path_length(here), _path_length(there)))
    return bool(off <= likeness.per_metre * size + ROUNDING and turned <= likeness.heading)


def is_new(plan: Plan, known: Iterable[Plan], likeness: Likeness = CONVERGED) -> bool:
    """Whether a plan is another motion than all that are known."""
    return not any(same_motion(plan, other, likeness) for other in known)


def _apart(one: Plan, other: Plan, times: Array) -> tuple[float, float, Array, Array]:
    """Largest distance [m] and turn [rad] between two plans at times of the clock; their poses."""
    here, there = one.pose_at(times), other.pose_at(times)
    places = [0, 1, *range(3, here.shape[-1])]
    off = np.linalg.norm((here - there)[:, places], axis=1).max()
    return float(off), float(np.abs(wrapped(here[:, 2] - there[:, 2])).max()), here, there


def _path_length(poses: Array) -> float:
    places = [0, 1, *range(3, poses.shape[-1])]
    return float(np.linalg.norm(np.diff(poses[:, places], axis=0), axis=1).sum())

"""Back onto a plan that is still held, where none that begins at the vehicle can be proven."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.cutting import NOTHING, tail_of, with_samples_at
from maneuver_automaton.fleet.held import beside, reach_of
from maneuver_automaton.fleet.vehicle import Found, Vehicle
from maneuver_automaton.groups import SE2
from maneuver_automaton.primitives import Trim
from maneuver_automaton.receding_horizon.settings import switches_at_will

MOST = 16  # trims that are tried, those most like what the plan drives
SHARES = 8  # of a step, at which one trim follows another
WIDE, NARROW = 24, 8  # pairs of trims that are refined, and again
SIDEWAYS = 0.5  # how much a heading counts
LOOKS = 8  # within a step, at which it is looked at how far beside the plan it leads


def back_onto(
    vehicle: Vehicle, found: Found, time: float, pose: Array, step: float, tube: float
) -> Plan | None:
    """Two trims for a step that lead nearest to where a plan then is, and where it then heads.

    They are followed by what is left of the plan. None for what does not switch at will in a plane,
    and where none of them stays within the tube.

    Parameters
    ----------
    vehicle : Vehicle
    found : Found
        The plan that is held.
    time : float
        [s]
    pose : (3,) array
        Where the vehicle is.
    step : float
        [s]
    tube : float
        How far beside its plan the vehicle may be [m].
    """
    problem = vehicle.problem
    if not switches_at_will(problem) or pose.size != 3 or problem.horizon.min_coast > 0.0:
        return None
    model = problem.automaton.model
    left = found.plan
    begun = max(time - left.start_time, 0.0)
    wanted = SE2(_poses(left, [time, time + step, time + 2.0 * step]))
    trims = _likely(problem.automaton.trims, left, begun, begun + step)
    twists = np.array([trim.body_velocity for trim in trims])
    here, reach = SE2(pose), reach_of(found, time)
    clock = time + step * np.linspace(0.0, 1.0, LOOKS + 1)
    planned = _poses(left, clock)
    for first, second, switch in _pairs(twists, here, wanted, step, reach):
        rows = [(trims[first], switch), (trims[second], step - switch)]
        word = [(trim, lasting) for trim, lasting in rows if lasting > NOTHING]
        plan = Plan(
            pose, tuple(trim for trim, _ in word), durations=[t for _, t in word], start_time=time
        )
        off = beside(_poses(plan, clock), planned, reach)
        if off.max() <= max(tube, float(off[0])):
            break
    else:
        return None
    if left.start_time + left.duration <= time + step + NOTHING:
        return plan
    cut = with_samples_at(left, [time + step], model)
    rest = tail_of(cut, time + step - left.start_time)
    return replace(
        plan,
        trims=(*plan.trims, *rest.trims),
        durations=np.concatenate([plan.durations, rest.durations]),
    )


def _pairs(
    twists: Array, here: SE2, wanted: SE2, step: float, reach: float
) -> list[tuple[int, int, float]]:
    """Pairs of trims, and when the second follows the first [s]: the best first.

    The place counts after the step and a step later, the heading by how far it moves a body.
    """
    count = len(twists)
    first, second = (one.ravel() for one in np.indices((count, count)))
    middle, near = np.full(first.size, 0.5), 0.5
    ahead, later = SE2(wanted.pose[1:2]), SE2(wanted.pose[2:3])
    onward = ahead.inverse() @ later
    for kept in (WIDE, NARROW, NARROW):
        shares = np.clip(middle + near * np.linspace(-1.0, 1.0, SHARES + 1)[:, None], 0.0, 1.0)
        times = step * shares[..., None]
        ends = here @ SE2.exp(times * twists[first]) @ SE2.exp((step - times) * twists[second])
        turn = np.abs(ends.pose[..., 2] - ahead.pose[..., 2])
        off = _off(ends, ahead) + _off(ends @ onward, later) + (SIDEWAYS * reach * turn) ** 2
        rows, columns = off.argmin(axis=0), np.arange(first.size)
        order = np.argsort(off[rows, columns], kind="stable")[:kept]
        first, second = first[order], second[order]
        middle, near = shares[rows[order], columns[order]], near / (0.5 * SHARES)
    switches = (step * middle).tolist()
    return list(zip(first.tolist(), second.tolist(), switches, strict=True))


def _poses(plan: Plan, times: ArrayLike) -> Array:
    """Where a plan is at times (n,) [s]: it stands before and after."""
    return plan.pose_at(np.clip(times, plan.start_time, plan.start_time + plan.duration))


def _likely(trims: tuple[Trim, ...], plan: Plan, begin: float, end: float) -> list[Trim]:
    """The trims most like those that a plan drives between two times of it [s], and a rest."""
    joints = np.cumsum([0.0, *plan.durations.tolist()])
    now = [
        trim
        for trim, a, b in zip(plan.trims, joints[:-1], joints[1:], strict=True)
        if a < end and b > begin
    ] or [*plan.trims[-1:]]
    twists = np.array([trim.body_velocity for trim in trims])
    if not now:
        return [trim for trim in trims if trim.is_rest] or [*trims[:1]]
    unlike = np.min([np.linalg.norm(twists - trim.body_velocity, axis=1) for trim in now], axis=0)
    order = np.argsort(unlike, kind="stable")[:MOST].tolist()
    rest = [k for k, trim in enumerate(trims) if trim.is_rest and k not in order]
    return [trims[k] for k in [*order, *rest[:1]]]


def _off(poses: SE2, wanted: SE2) -> Array:
    """Squares of distances [m^2]."""
    gap = poses.pose[..., :2] - wanted.pose[..., :2]
    return np.asarray((gap * gap).sum(axis=-1))

"""Plans of a loop kept valid: who joins, goes back to its plan, is planned anew, has arrived."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.automaton import same_state
from maneuver_automaton.automaton.cutting import NOTHING, end_state, tail_of, with_samples_at
from maneuver_automaton.fleet.held import begin_of, beside, off_plan, reach_of, why_not_free
from maneuver_automaton.fleet.meetings import meetings, near_pairs
from maneuver_automaton.fleet.moment import ROUNDING, Moment, search
from maneuver_automaton.fleet.result import FleetGuarantee
from maneuver_automaton.fleet.vehicle import LONG, FleetMember, OwnPlan
from maneuver_automaton.fleet.verdict import nearest
from maneuver_automaton.groups import SE2
from maneuver_automaton.primitives import Trim
from maneuver_automaton.receding_horizon.candidates import within
from maneuver_automaton.receding_horizon.settings import EXACT

NEARLY = 0.005  # share of its cost: a plan rejoined that is no costlier is the same one
LOOK_AT = (0.5, 1.0, 2.0)  # of a step, when it is looked at how far a plan is beside another one
REJOINS = 0.5  # share of the tube: farther beside its plan, a vehicle asks for one from there
IN_TIME = 0.4  # share of a step's limit, after which it does not where it can do without
TENTHS = 10  # of the tube, by which it is said who is farthest beside its plan
MOST = 16  # trims that are tried, those most like what the plan drives
SWITCHES = 8  # of a step, at which one trim follows another
WIDE, NARROW = 24, 8  # pairs of trims that are refined, and again
SIDEWAYS = 0.5  # how much a heading counts
LOOKS = 8  # within a step, at which it is looked at how far beside the plan it leads
EASED = (1.0, 0.5, 0.0)  # shares of the margin, where a void plan has none that keeps all of it
LEAST = 1e-3  # [m] kept even then


def let_in(now: Moment) -> None:
    """Let in, with their first plan or at rest, who keeps apart from all; refuse others for now."""
    agreement, at_first = now.state.agreement, now.state.last is None
    for k in [k for k in now.poses if k not in now.held]:
        vehicle = now.vehicles[k]
        stands = not vehicle.problem.has_inertia or vehicle.problem.first_trim.is_rest
        choices = [now.resting(k)] if stands else []
        first = now.state.first.pop(k, None)
        if first is not None and now.offset_from(k, first) == 0.0:
            choices.insert(0, first)
        others = {(j, id(one)): (j, one) for j, one in now.held.items()}
        for j, one in agreement.everything():
            if j in now.held:
                others.setdefault((j, id(one)), (j, one))
        for found in choices:
            proven = now.is_proven(k, found, list(others.values()))
            if proven and (at_first or agreement.enter(now.number, k, found, now.held)):
                now.held[k] = found
                effort = now.state.efforts[k]
                effort.version += 1
                effort.lineage += effort.version > 0
                now.disturbed.add(k)
                break
        else:
            now.refused.append(k)
    if at_first:
        agreement.start(now.held)
        for k in now.refused:
            now.flag(FleetGuarantee.HELD, [k], "it cannot stay where it begins")


def note_arrivals(now: Moment) -> None:
    """Whose plan is over: at the goal, or it has none that arrives."""
    for k, found in now.held.items():
        if k in now.state.arrived or not found.leads or not found.is_over(now.time):
            continue
        vehicle = now.vehicles[k]
        there = within(now.poses[k], vehicle.problem.goals[found.goal_index])
        # Who leaves is gone for all others once its plan is over: within its tube, it goes.
        if there or (vehicle.leaves and now.offset_from(k, found) <= now.state.settings.tube_m):
            now.state.arrived.add(k)
            continue
        # It stays where it is, or where its plan ends, and looks for another one.
        stay = now.resting(k, found)
        if not (now.is_proven(k, stay, now.expected_by(k)) and now.agreed(k, stay)):
            stay = found.given_up()
        now.hold(k, stay)


def rejoin(now: Moment) -> None:
    """Those within their tubes rejoin their plans, the farthest first; plans of others are void."""
    now.off = {k: now.offset_from(k, found) for k, found in now.held.items()}
    _note_pressed(now)
    tube = now.state.settings.tube_m
    for k in sorted(now.held, key=lambda k: -math.floor(TENTHS * now.off[k] / max(tube, EXACT))):
        off, found = now.off[k], now.held[k]
        if k in now.state.broken or off == 0.0:
            continue
        if off > tube:
            now.make_void(k)
        elif k not in now.state.arrived and not _tracks(now, k, found, REJOINS):
            _rejoin_within(now, k, found)
    _note_crossing(now)


def _note_pressed(now: Moment) -> None:
    """Pairs that stand nearer to each other than the margin: on their plans, or measured."""
    discs = [
        (k, *place, reach_of(found, now.time))
        for k, found in now.held.items()
        for place in [now.begin_of(k)[:2].tolist()]
    ]
    for one, other in near_pairs(discs, now.keep):
        pair = {k: now.standing(k) for k in (one, other)}
        if meetings(pair, keep=now.keep, frame=now.frame):
            least = nearest(pair[one], pair[other]).distance
            now.pressed[one, other] = max(min(least, now.keep) - ROUNDING, 0.0)
    for k, found in now.held.items():
        proven = now.state.proofs.apart.get(k) is found.course  # it stands on a plan that is free
        if not (found.leads or proven or k in now.state.broken):
            now.note_near(k)


def _note_crossing(now: Moment) -> None:
    """Plans that lead too near to others since the last step are void, if that is known."""
    for one, other in sorted(now.state.proofs.crossing):
        if one not in now.held or other not in now.held:
            continue
        if {one, other} & {*now.void} or {one, other} <= now.state.broken:
            continue
        if now.first_meeting(one, now.held[one], [(other, now.held[other])]) == math.inf:
            continue
        able = [k for k in (other, one) if k not in now.state.broken]
        moves = [k for k in able if not now.held[k].is_over(now.time)]
        for k, j in ((one, other), (other, one)):
            if k in (moves or able) and now.state.agreement.knows(k, j, now.held[j]):
                now.make_void(k)
                break


def _rejoin_within(now: Moment, k: int, found: OwnPlan) -> None:
    is_late = now.budget.elapsed > IN_TIME * now.budget.seconds
    if is_late and (_tracks(now, k, found) or _drives_beside(now, k, found, ())):
        return
    others, left = now.expected_by(k), now.left_to_pay(k)
    choices, again = [], None
    for one in now.rejoined(k, found):
        choices.append(one)
        if now.is_proven(k, one, others):
            again = one
            break
    if again is None or not now.agreed(k, again):
        if not (_tracks(now, k, found) or _drives_beside(now, k, found, choices)):
            now.make_void(k)
        return
    now.held[k] = again
    now.state.efforts[k].version += 1
    now.state.efforts[k].lineage += again.cost > left * (1.0 + NEARLY)
    now.disturbed.add(k)
    now.off[k] = 0.0
    if k in now.state.due:
        when, other, _ = now.state.due[k]
        now.state.due[k] = (when, other, again)


def _tracks(now: Moment, k: int, found: OwnPlan, share: float = 1.0) -> bool:
    """Whether a vehicle drives back onto the plan that it holds, without another one."""
    vehicle, step = now.vehicles[k], now.state.settings.step
    tube = share * now.state.settings.tube_m
    if vehicle.problem.obstacles:
        tube = min(tube, vehicle.problem.margin)
    if now.off[k] > tube or not found.leads:
        return False
    back = back_onto(vehicle, found, now.time, now.poses[k], step, tube)
    if back is not None:
        now.beside[k] = back
    return back is not None


def _drives_beside(now: Moment, k: int, found: OwnPlan, choices: Sequence[OwnPlan]) -> bool:
    """Of the ways back to a plan that is still held, drive the one that is nearest to it."""
    vehicle, step = now.vehicles[k], now.state.settings.step

    def farthest(plan: Plan) -> float:
        times = [now.time + share * step for share in LOOK_AT]
        return max(off_plan(vehicle, found, time, plan.pose_at(time)) for time in times)

    def state_after(plan: Plan) -> Array:
        begin = begin_of(vehicle, plan, step)
        return end_state(begin) if begin.trims else np.zeros(0)

    tube, here = now.state.settings.tube_m, now.from_here(k).plan
    back = back_onto(vehicle, found, now.time, now.poses[k], step, tube)
    # A step later all but the pose must be as the plan that is held has it.
    wanted, ways = state_after(here), [one.plan for one in choices]
    plans = [here, *(one for one in ways if same_state(state_after(one), wanted))]
    for plan in [*([] if back is None else [back]), *sorted(plans, key=farthest)]:
        if not why_not_free(vehicle, vehicle.course_of(begin_of(vehicle, plan, step)), 0.0):
            now.beside[k] = plan
            return True
    return False


def back_onto(
    vehicle: FleetMember, found: OwnPlan, time: float, pose: Array, step: float, tube: float
) -> Plan | None:
    """Two trims for a step that lead nearest to where a plan then is, and where it then heads.

    They are followed by what is left of the plan. None for what does not switch at will in a plane,
    and where none of them stays within the tube [m].
    """
    problem = vehicle.problem
    if problem.has_inertia or pose.size != 3 or problem.horizon.min_coast > 0.0:
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
    rest = tail_of(with_samples_at(left, [time + step], model), time + step - left.start_time)
    return replace(
        plan,
        trims=(*plan.trims, *rest.trims),
        durations=np.concatenate([plan.durations, rest.durations]),
    )


def _pairs(
    twists: Array, here: SE2, wanted: SE2, step: float, reach: float
) -> list[tuple[int, int, float]]:
    """Pairs of trims, and when the second follows the first [s]: the best first."""
    count = len(twists)
    first, second = (one.ravel() for one in np.indices((count, count)))
    middle, near = np.full(first.size, 0.5), 0.5
    ahead, later = SE2(wanted.pose[1:2]), SE2(wanted.pose[2:3])
    onward = ahead.inverse() @ later
    for kept in (WIDE, NARROW, NARROW):
        shares = np.clip(middle + near * np.linspace(-1.0, 1.0, SWITCHES + 1)[:, None], 0.0, 1.0)
        times = step * shares[..., None]
        ends = here @ SE2.exp(times * twists[first]) @ SE2.exp((step - times) * twists[second])
        turn = np.abs(ends.pose[..., 2] - ahead.pose[..., 2])
        off = _off(ends, ahead) + _off(ends @ onward, later) + (SIDEWAYS * reach * turn) ** 2
        rows, columns = off.argmin(axis=0), np.arange(first.size)
        order = np.argsort(off[rows, columns], kind="stable")[:kept]
        first, second = first[order], second[order]
        middle, near = shares[rows[order], columns[order]], near / (0.5 * SWITCHES)
    return list(zip(first.tolist(), second.tolist(), (step * middle).tolist(), strict=True))


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


def stop(now: Moment, broken_down: set[int]) -> None:
    """Who breaks down stops as soon as it can, or where it was to; plans it is hit by are void."""
    new = broken_down - now.state.broken
    tube = now.state.settings.tube_m
    beyond = {k for k in now.state.broken & set(now.held) if now.off[k] > tube}
    for k in sorted(new | beyond):
        now.hold(k, now.stopping(k))
    now.state.broken |= new
    now.void = [k for k in now.void if k not in now.state.broken]
    for k, found in now.held.items():
        if k in now.state.broken or k in now.void:
            continue
        stopped = [(j, now.held[j]) for j in sorted(new | beyond) if now.knows(k, j)]
        if now.first_meeting(k, found, stopped) < math.inf:
            now.make_void(k)


def plan_anew(now: Moment) -> None:
    """Plans for those whose plans are void, the most urgent first; the next in its order."""
    waiting = list(now.void)
    if len(waiting) > 1:
        waiting.sort(
            key=lambda k: now.first_meeting(k, now.held[k], now.expected_by(k, but=waiting))
        )
    stopped, anew = set(now.state.broken), set[int]()
    while waiting:
        k = waiting.pop(0)
        stop = now.stopping(k)
        found = None if k in anew or k in now.state.silent else _another(now, k, waiting)
        anew.add(k)
        if found is None:
            if now.held[k].leads:
                now.state.stopped[k] = replace(now.held[k], plan=now.rest_of(k))
            found = _stopped(now, k, stop, stopped)
            stopped.add(k)
        now.hold(k, found)
        now.state.arrived.discard(k)
        for j, other in now.held.items():
            if j in stopped or j in waiting or j == k:
                continue
            if now.first_meeting(j, other, [(k, found)]) == math.inf:
                continue
            if now.knows(j, k):
                waiting.append(j)
                now.make_void(j)
            else:
                when = now.first_meeting(j, other, [(k, found)])
                reason = f"at {when:.6g} s it meets a vehicle that did not receive its new plan"
                now.flag(FleetGuarantee.SAFETY, [k, j], reason)


def _another(now: Moment, k: int, waiting: Sequence[int]) -> OwnPlan | None:
    """A plan for a vehicle whose plan is void; None if none is found."""
    pose, everyone = now.begin_of(k), now.expected_by(k)
    for one in now.rejoined(k, now.held[k], pose):
        if now.is_proven(k, one, everyone):
            return one
    past = everyone
    for _ in range(2 if waiting else 1):
        found = search(now, k, now.from_here(k, pose), past, math.inf, most=LONG)[0]
        if found is not None and now.is_proven(k, found, past):
            return found
        past = [*now.expected_by(k, but=waiting), *[(j, now.stopping(j)) for j in waiting]]
    return None


def _stopped(now: Moment, k: int, stop: OwnPlan, stopped: Collection[int]) -> OwnPlan:
    """The plan of a vehicle that comes to rest, past those that do so already."""
    last = [(j, one) for j, one in now.held.items() if j in stopped and j != k]
    for share in EASED:
        keep = max(share * now.keep, LEAST)
        if now.first_meeting(k, stop, last, keep) < math.inf:
            continue
        if share < 1.0:
            reason = f"no plan was found that keeps more than {keep:.3g} m"
            now.flag(FleetGuarantee.APART, [k], reason)
        return stop
    motions = (stop, now.held[k])
    times = [now.first_meeting(k, one, last, LEAST) for one in motions]
    reason = f"unavoidable: at {max(times):.6g} s it meets another vehicle"
    now.flag(FleetGuarantee.SAFETY, [k], reason)
    return motions[times.index(max(times))]

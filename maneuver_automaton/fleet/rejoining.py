"""Back to the plans that are held, for those that are beside them; void beyond their tubes."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.automaton import same_state
from maneuver_automaton.automaton.cutting import end_state
from maneuver_automaton.fleet.conflicts import meetings
from maneuver_automaton.fleet.held import (
    begin_of,
    is_over,
    leads,
    off_plan,
    reach_of,
    rejoined,
    why_not_free,
)
from maneuver_automaton.fleet.moment import ROUNDING, Moment
from maneuver_automaton.fleet.nearby import near_pairs
from maneuver_automaton.fleet.tracking import back_onto
from maneuver_automaton.fleet.vehicle import Found
from maneuver_automaton.fleet.verdict import nearest
from maneuver_automaton.receding_horizon.settings import EXACT, switches_at_will

NEARLY = 0.005  # share of its cost: a plan rejoined that is no costlier is the same one
SHARES = (0.5, 1.0, 2.0)  # of a step, when it is looked at how far a plan is beside another one
REJOINS = 0.5  # share of the tube: farther beside its plan, a vehicle asks for one from there
IN_TIME = 0.4  # share of a step's limit, after which it does not where it can do without
TENTHS = 10  # of the tube, by which it is said who is farthest beside its plan


def rejoin(now: Moment) -> None:
    """Those off their plans by no more than their tubes rejoin them; the others' are void.

    The farthest first: where time gets short, the others drive on beside their plans.
    """
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
        proven = now.state.proven.get(k) is found.course  # it stands on a plan that is free
        if not (leads(found) or proven or k in now.state.broken):
            now.note_near(k)


def _note_crossing(now: Moment) -> None:
    """Plans that lead too near to others since the last step are void, if that is known.

    Who had not received another one's emergency drove on.
    """
    for one, other in sorted(now.state.crossing):
        if one not in now.held or other not in now.held:
            continue
        if {one, other} & {*now.void} or {one, other} <= now.state.broken:
            continue
        if now.first_meeting(one, now.held[one], [(other, now.held[other])]) == math.inf:
            continue
        able = [k for k in (other, one) if k not in now.state.broken]
        moves = [k for k in able if not is_over(now.held[k], now.time)]
        for k, j in ((one, other), (other, one)):
            if k in (moves or able) and now.state.agreement.knows(k, j, now.held[j]):
                now.make_void(k)
                break


def _rejoin_within(now: Moment, k: int, found: Found) -> None:
    is_late = now.budget.elapsed > IN_TIME * now.budget.seconds
    if is_late and (_tracks(now, k, found) or _drives_beside(now, k, found, ())):
        return
    others, left = now.expected_by(k), now.left_to_pay(k)
    choices, again = [], None
    for one in rejoined(now.vehicles[k], found, now.time, now.poses[k], now.tube):
        choices.append(one)
        if now.is_proven(k, one, others):
            again = one
            break
    if again is None or not now.agreed(k, again):
        if not (_tracks(now, k, found) or _drives_beside(now, k, found, choices)):
            now.make_void(k)
        return
    now.held[k] = again
    now.state.versions[k] += 1
    now.state.lineage[k] += int(again.cost > left * (1.0 + NEARLY))
    now.disturbed.add(k)
    now.off[k] = 0.0
    if k in now.state.due:
        when, other, _ = now.state.due[k]
        now.state.due[k] = (when, other, again)


def _tracks(now: Moment, k: int, found: Found, share: float = 1.0) -> bool:
    """Whether a vehicle drives back onto the plan that it holds, without another one.

    It stays nearer to it than a share of its tube, and than obstacles are.
    """
    vehicle, step = now.vehicles[k], now.state.settings.step
    tube = share * now.state.settings.tube_m
    if vehicle.problem.obstacles:
        tube = min(tube, vehicle.problem.margin)
    if now.off[k] > tube or not leads(found):
        return False
    back = back_onto(vehicle, found, now.time, now.poses[k], step, tube)
    if back is not None:
        now.beside[k] = back
    return back is not None


def _drives_beside(now: Moment, k: int, found: Found, choices: Sequence[Found]) -> bool:
    """Of the ways back to a plan that is still held, drive the one that is nearest to it.

    Whether there is one: it must not touch what is not of the fleet.
    """
    vehicle, step = now.vehicles[k], now.state.settings.step

    def farthest(plan: Plan) -> float:
        times = [now.time + share * step for share in SHARES]
        return max(off_plan(vehicle, found, time, plan.pose_at(time)) for time in times)

    def state_after(plan: Plan) -> Array:
        begin = begin_of(vehicle, plan, step)
        return end_state(begin) if begin.trims else np.zeros(0)

    tube, here = now.state.settings.tube_m, now.from_here(k).plan
    back = back_onto(vehicle, found, now.time, now.poses[k], step, tube)
    # A step later all but the pose must be as the plan that is held has it.
    at_will, wanted = switches_at_will(vehicle.problem), state_after(here)
    ways = [one.plan for one in choices]
    plans = [here, *(one for one in ways if at_will or same_state(state_after(one), wanted))]
    for plan in [*([] if back is None else [back]), *sorted(plans, key=farthest)]:
        if not why_not_free(vehicle, vehicle.course_of(begin_of(vehicle, plan, step)), 0.0):
            now.beside[k] = plan
            return True
    return False

"""Guarantees of a fleet's loop, asserted in every step."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from maneuver_automaton.fleet.agreement import Knowledge
from maneuver_automaton.fleet.courses import FleetCourse
from maneuver_automaton.fleet.held import CONTACT, LATER, arrival, left_to_pay, why_not_free
from maneuver_automaton.fleet.meetings import Encounters, Meeting, meetings
from maneuver_automaton.fleet.result import FleetGuarantee, FleetStep, FleetViolation, Swap
from maneuver_automaton.fleet.vehicle import FleetMember, OwnPlan
from maneuver_automaton.fleet.verdict import nearest

Frame = tuple[float, float, float]

ACCURACY = 1e-7  # relative, of values: a maneuver that is cut costs as much to within this
FAR = 1.0  # [m] beyond the margin: what keeps more is not measured
FINE = 0.02  # [m] to which the distance proven is known


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Before:
    """What was held when a step began, at its time."""

    values: dict[int, float]  # cost of what is left
    arrivals: dict[int, float]  # [s]
    promised: dict[int, float]  # values that the last step said, at its own time

    @classmethod
    def of(
        cls,
        vehicles: Sequence[FleetMember],
        held: Mapping[int, OwnPlan],
        time: float,
        last: FleetStep | None,
    ) -> Before:
        """At a step's begin."""
        known = {} if last is None else last.values
        return cls(
            values={k: left_to_pay(vehicles[k], one, time) for k, one in held.items()},
            arrivals={k: arrival(one) for k, one in held.items()},
            promised={k: known.get(vehicles[k].name, math.inf) for k in held},
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class After:
    """What is held when it ends."""

    time: float
    held: Mapping[int, OwnPlan]
    courses: Mapping[int, FleetCourse]  # what is left of those that are looked at
    off: Mapping[int, float]  # [m] beside the plans
    disturbed: set[int]  # who has another plan not by an exchange of its own
    in_group: set[int]  # who has another one by an exchange of several at once
    swaps: Sequence[Swap]
    tube_m: float
    keep: float  # [m]
    frame: Frame
    fresh: Mapping[int, Sequence[int]] | None = None  # who holds another plan, and who is near it


def broken(
    vehicles: Sequence[FleetMember], agreement: Knowledge, before: Before, after: After
) -> Iterator[FleetViolation]:
    """The guarantees that a step broke."""
    names = [one.name for one in vehicles]
    yield from _too_near(names, after)
    for k in after.held:
        if after.off[k] > after.tube_m:
            reason = f"it is {after.off[k]:.3g} m beside its plan, need at most {after.tube_m:g} m"
            yield FleetViolation(FleetGuarantee.HELD, (names[k],), reason)
        fresh = after.fresh is None or k in after.fresh
        if fresh and (said := why_not_free(vehicles[k], after.courses[k])):
            yield FleetViolation(FleetGuarantee.STILL, (names[k],), said)
    yield from _costlier(vehicles, before, after)
    yield from _out_of_order(after.swaps)
    for j, k in agreement.unknown(after.held):
        reason = f"{names[j]} does not know what it drives"
        yield FleetViolation(FleetGuarantee.KNOWN, (names[k],), reason)


def _too_near(names: Sequence[str], after: After) -> Iterator[FleetViolation]:
    """Pairs that the kernel cannot prove apart, and the audit's bounds neither.

    Only pairs of which one holds a plan that it did not hold a step ago, if these are given: the
    others were proven apart for all later times.
    """
    for row in _met(after):
        least = nearest(after.courses[row.one], after.courses[row.other]).distance
        if least <= max(after.keep - CONTACT, CONTACT):
            pair = (names[row.one], names[row.other])
            reason = f"at {row.time:.6g} s they come within {least:.6g} m, need {after.keep:g} m"
            yield FleetViolation(FleetGuarantee.APART, pair, reason)


def _met(after: After) -> list[Meeting]:
    if after.fresh is None:
        return meetings(after.courses, keep=after.keep, frame=after.frame)
    found = {}
    for k, others in after.fresh.items():
        courses = {j: after.courses[j] for j in (k, *others)}
        for row in meetings(courses, keep=after.keep, among=[k], frame=after.frame):
            found[row.one, row.other] = row
    return sorted(found.values(), key=lambda row: (row.time, row.one, row.other))


def _costlier(
    vehicles: Sequence[FleetMember], before: Before, after: After
) -> Iterator[FleetViolation]:
    """Whose value rose, or who arrives later, and whether the sum did."""
    sum_now = sum_before = 0.0
    fewer_arrive_not = False  # then the sum, which was infinite, has fallen
    for k, found in after.held.items():
        if k in after.disturbed:
            continue
        was, promised = before.values[k], before.promised[k]
        now = left_to_pay(vehicles[k], found, after.time)
        if was < math.inf:
            sum_now, sum_before = sum_now + now, sum_before + was
        fewer_arrive_not = fewer_arrive_not or now < was == math.inf
        rounding = ACCURACY * (1.0 + abs(was))
        costlier = now > was + rounding and k not in after.in_group
        if costlier or was > promised + rounding:
            reason = f"the value is {now:.9g}, was {was:.9g} and {promised:.9g} a step before"
            yield FleetViolation(FleetGuarantee.DECREASE, (vehicles[k].name,), reason)
        later = arrival(found) - before.arrivals[k] if arrival(found) < math.inf else 0.0
        if later > LATER * (1.0 + abs(before.arrivals[k])) and k not in after.in_group:
            reason = f"it arrives {later:.3g} s later than its last plan said"
            yield FleetViolation(FleetGuarantee.ARRIVAL, (vehicles[k].name,), reason)
    if not fewer_arrive_not and sum_now > sum_before + ACCURACY * (1.0 + abs(sum_before)):
        everybody = tuple(vehicles[k].name for k in after.held)
        reason = f"the sum is {sum_now:.9g}, was {sum_before:.9g}"
        yield FleetViolation(FleetGuarantee.DECREASE, everybody, reason)


def _out_of_order(swaps: Sequence[Swap]) -> Iterator[FleetViolation]:
    """Swaps that were not proven past the plans that those before them had left held."""
    versions: dict[str, int] = {}
    for swap in swaps:
        known = dict(swap.past)
        stale = [name for name, version in versions.items() if known.get(name, version) != version]
        if stale:
            reason = f"swap {swap.order} was not proven past the plan that {stale[0]} held"
            yield FleetViolation(FleetGuarantee.ORDER, swap.names, reason)
        versions.update(known)
        versions.update(swap.holds)


class Gap(NamedTuple):
    """A distance that any two vehicles are proven to keep from a time on, and what shows it."""

    distance: float  # [m]
    nearest: Meeting | None  # that comes within 2 cm more; None: nobody is looked at so far out
    held: Mapping[int, FleetCourse]  # the courses of which it is proven


def gap_between(
    courses: Mapping[int, FleetCourse],
    *,
    keep: float,
    frame: Frame,
    time: float = -math.inf,
    held: Mapping[int, FleetCourse] | None = None,
    last: Gap | None = None,
) -> Gap:
    """A distance [m] that any two vehicles are proven to keep from now on, to within 2 cm.

    At most a metre more than the distance to keep; 0 if not even that is proven.

    Parameters
    ----------
    courses : mapping of int to FleetCourse
        What is left of those that are held.
    keep : float
        Distance to keep [m].
    frame : (x, y, 0)
        What places are counted from.
    time : float
        Now [s].
    held : mapping of int to FleetCourse, optional
        What is held; what is left of it if omitted.
    last : Gap, optional
        Of a step before. It still holds if those that hold another plan since keep it too, and the
        two that come nearest have not passed yet: the value is the same as without it.
    """
    held = courses if held is None else held
    if len(courses) < 2:
        return Gap(math.inf, None, held)
    if last is not None and _still_holds(last, courses, frame=frame, time=time, held=held):
        return last._replace(held=held)
    low, most, more = keep, keep + FAR, 2.0 * FINE
    rows = meetings(courses, keep=most, frame=frame)
    if not rows:
        return Gap(most, None, held)
    near = sorted({k for row in rows for k in (row.one, row.other)})
    among = {row.one for row in rows}
    met = Encounters({k: courses[k] for k in near}, frame).within
    if met(keep, among):
        return Gap(0.0, None, held)
    nearest, high = rows[0], math.inf
    while high == math.inf:
        wanted = min(low + more, most)
        if wanted >= most:
            high = most
        elif rows := met(wanted, among):
            high, nearest = wanted, rows[0]
        else:
            low, more = wanted, 2.0 * more
    while high - low > FINE:
        middle = 0.5 * (low + high)
        if rows := met(middle, among):
            high, nearest = middle, rows[0]
        else:
            low = middle
    return Gap(low, nearest, held)


def _still_holds(
    last: Gap,
    courses: Mapping[int, FleetCourse],
    *,
    frame: Frame,
    time: float,
    held: Mapping[int, FleetCourse],
) -> bool:
    """Whether a distance is what was proven a step before."""
    fresh = {k for k, one in held.items() if last.held.get(k) is not one}
    if last.nearest is None or last.nearest.time < time:
        return False
    if {last.nearest.one, last.nearest.other} & (fresh | (set(last.held) - set(held))):
        return False
    return not (fresh and meetings(courses, keep=last.distance, among=fresh, frame=frame))

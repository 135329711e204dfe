"""Guarantees of a fleet's loop, asserted in every step, and what a step leaves: its log."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence

from maneuver_automaton.fleet.courses import FleetCourse
from maneuver_automaton.fleet.held import CONTACT, LATER, why_not_free
from maneuver_automaton.fleet.meetings import Meeting, gap_between, meetings
from maneuver_automaton.fleet.moment import MANY, Moment
from maneuver_automaton.fleet.result import FleetGuarantee, FleetStep, FleetViolation, Swap
from maneuver_automaton.fleet.verdict import nearest

ACCURACY = 1e-7  # relative, of values: a maneuver that is cut costs as much to within this


def logged(now: Moment) -> FleetStep:
    """All of the step, and the guarantees that it broke."""
    state, proofs = now.state, now.state.proofs
    # Who holds a plan that is not proven yet, and whose plans may come near it.
    fresh = {
        k: now.near_to(k, found)
        for k, found in now.held.items()
        if proofs.apart.get(k) is not found.course
    }
    few = len(now.held) <= MANY
    looked_at = now.held if few else {k for j, near in fresh.items() for k in (j, *near)}
    courses = {k: now.left_of(now.held[k]) for k in looked_at}
    said = list(broken(now, courses, fresh))
    now.violations += said
    numbers = {one.name: one.number for one in now.vehicles}
    apart, still = FleetGuarantee.APART, FleetGuarantee.STILL
    unproven = {
        numbers[name] for one in said if one.guarantee in (apart, still) for name in one.names
    }
    proofs.apart = {k: one.course for k, one in now.held.items() if k not in unproven}
    pairs = [sorted(numbers[name] for name in one.names) for one in said if one.guarantee is apart]
    proofs.crossing = {(one, other) for one, other in pairs}
    gap = now.keep
    if few:
        held = {k: one.course for k, one in now.held.items()}
        proofs.gap = gap_between(
            courses, keep=now.keep, frame=now.frame, time=now.time, held=held, last=proofs.gap
        )
        gap = proofs.gap.distance
    names = [one.name for one in now.vehicles]

    def named(chosen: Collection[int]) -> tuple[str, ...]:
        return tuple(names[k] for k in chosen)

    return FleetStep(
        number=now.number,
        time=now.time,
        poses={names[k]: now.poses[k] for k in now.held},
        plans={names[k]: one.plan for k, one in now.held.items()},
        driven={names[k]: now.beside.get(k) or now.from_here(k).plan for k in now.held},
        values={names[k]: now.left_to_pay(k) for k in now.held},
        arrivals={names[k]: one.arrives for k, one in now.held.items()},
        off_plan={names[k]: now.off[k] for k in now.held},
        arrived=named(sorted(state.arrived & set(now.held))),
        swaps=tuple(now.swaps),
        asked=named(now.asked),
        void=named(now.void),
        refused=named(now.refused),
        silent=named(sorted(state.silent & set(now.held))),
        gap_m=0.0 if proofs.crossing else gap,
        violations=tuple(now.violations),
        solve_s=now.budget.elapsed,
    )


def broken(
    now: Moment,
    courses: Mapping[int, FleetCourse],
    fresh: Mapping[int, Sequence[int]] | None = None,
) -> Iterator[FleetViolation]:
    """The guarantees that a step broke; by what is left of those that are looked at.

    Only who is `fresh` holds a plan that it did not hold a step ago, and who is near it: the others
    were proven apart and free for all later times.
    """
    names, tube = [one.name for one in now.vehicles], now.tube
    for row in _met(now, courses, fresh):
        least = nearest(courses[row.one], courses[row.other]).distance
        # The kernel cannot prove them apart, and the audit's bounds neither.
        if least <= max(now.keep - CONTACT, CONTACT):
            pair = (names[row.one], names[row.other])
            reason = f"at {row.time:.6g} s they come within {least:.6g} m, need {now.keep:g} m"
            yield FleetViolation(FleetGuarantee.APART, pair, reason)
    for k in now.held:
        if now.off[k] > tube:
            reason = f"it is {now.off[k]:.3g} m beside its plan, need at most {tube:g} m"
            yield FleetViolation(FleetGuarantee.HELD, (names[k],), reason)
        if fresh is not None and k not in fresh:
            continue
        if said := why_not_free(now.vehicles[k], courses[k]):
            yield FleetViolation(FleetGuarantee.STILL, (names[k],), said)
    yield from _costlier(now)
    yield from _out_of_order(now.swaps)
    for j, k in now.state.agreement.unknown(now.held):
        reason = f"{names[j]} does not know what it drives"
        yield FleetViolation(FleetGuarantee.KNOWN, (names[k],), reason)


def _met(
    now: Moment, courses: Mapping[int, FleetCourse], fresh: Mapping[int, Sequence[int]] | None
) -> list[Meeting]:
    """Pairs that the kernel cannot prove apart."""
    if fresh is None:
        return meetings(courses, keep=now.keep, frame=now.frame)
    found = {}
    for k, others in fresh.items():
        some = {j: courses[j] for j in (k, *others)}
        for row in meetings(some, keep=now.keep, among=[k], frame=now.frame):
            found[row.one, row.other] = row
    return sorted(found.values(), key=lambda row: (row.time, row.one, row.other))


def _costlier(now: Moment) -> Iterator[FleetViolation]:
    """Whose value rose, or who arrives later, and whether the sum did."""
    vehicles, last = now.vehicles, now.state.last
    said_then = {} if last is None else last.values
    sum_now = sum_before = 0.0
    fewer_arrive_not = False  # then the sum, which was infinite, has fallen
    for k, found in now.held.items():
        (was, arrived), name, value = now.before[k], vehicles[k].name, now.left_to_pay(k)
        promised = math.inf if k in now.disturbed else said_then.get(name, math.inf)
        if was < math.inf:
            sum_now, sum_before = sum_now + value, sum_before + was
        fewer_arrive_not = fewer_arrive_not or value < was == math.inf
        rounding = ACCURACY * (1.0 + abs(was))
        costlier = value > was + rounding and k not in now.in_group
        if costlier or was > promised + rounding:
            reason = f"the value is {value:.9g}, was {was:.9g} and {promised:.9g} a step before"
            yield FleetViolation(FleetGuarantee.DECREASE, (name,), reason)
        later = found.arrives - arrived if found.arrives < math.inf else 0.0
        if later > LATER * (1.0 + abs(arrived)) and k not in now.in_group:
            reason = f"it arrives {later:.3g} s later than its last plan said"
            yield FleetViolation(FleetGuarantee.ARRIVAL, (name,), reason)
    if not fewer_arrive_not and sum_now > sum_before + ACCURACY * (1.0 + abs(sum_before)):
        everybody = tuple(vehicles[k].name for k in now.held)
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

"""The log of one step of a fleet's loop, and the guarantees that it broke."""

from __future__ import annotations

from collections.abc import Sequence

from maneuver_automaton.fleet.exchanges import Exchanges
from maneuver_automaton.fleet.guarantees import After, Before, broken, gap_between
from maneuver_automaton.fleet.held import (
    arrival,
)
from maneuver_automaton.fleet.log import FleetGuarantee, FleetStep, FleetViolation
from maneuver_automaton.fleet.moment import Moment
from maneuver_automaton.fleet.questions import MANY


def logged(now: Moment, before: Before, exchanges: Exchanges, refused: Sequence[int]) -> FleetStep:
    """All of the step, and the guarantees that it broke."""
    state = now.state
    fresh, few = _fresh(now), len(now.held) <= MANY
    looked_at = now.held if few else {k for j, near in fresh.items() for k in (j, *near)}
    courses = {k: now.left_of(now.held[k]) for k in looked_at}
    after = After(
        time=now.time,
        held=now.held,
        courses=courses,
        off=now.off,
        disturbed=now.disturbed,
        in_group=exchanges.in_group,
        swaps=exchanges.swaps,
        tube_m=state.settings.tube_m,
        keep=now.keep,
        frame=now.frame,
        fresh=fresh,
    )
    said = list(broken(now.vehicles, state.agreement, before, after))
    now.violations += said
    _note_proven(now, said)
    gap = now.keep
    if few:
        held = {k: one.course for k, one in now.held.items()}
        state.gap = gap_between(
            courses, keep=now.keep, frame=now.frame, time=now.time, held=held, last=state.gap
        )
        gap = state.gap.distance
    if state.crossing:
        gap = 0.0
    names = [one.name for one in now.vehicles]
    plans = {names[k]: one.plan for k, one in now.held.items()}
    return FleetStep(
        number=now.number,
        time=now.time,
        poses={names[k]: now.poses[k] for k in now.held},
        plans=plans,
        driven={names[k]: now.beside.get(k) or now.from_here(k).plan for k in now.held},
        values={names[k]: now.left_to_pay(k) for k in now.held},
        arrivals={names[k]: arrival(one) for k, one in now.held.items()},
        off_plan={names[k]: now.off[k] for k in now.held},
        arrived=tuple(names[k] for k in sorted(state.arrived & set(now.held))),
        swaps=tuple(exchanges.swaps),
        asked=tuple(names[k] for k in exchanges.asked),
        void=tuple(names[k] for k in now.void),
        refused=tuple(names[k] for k in refused),
        silent=tuple(names[k] for k in sorted(state.silent & set(now.held))),
        gap_m=gap,
        violations=tuple(now.violations),
        solve_s=now.budget.elapsed,
    )


def _fresh(now: Moment) -> dict[int, list[int]]:
    """Who holds a plan that is not proven yet, and whose plans may come near it."""
    held, proven = now.held, now.state.proven
    fresh = {}
    for k, found in held.items():
        if proven.get(k) is not found.course:
            others = [j for j in held if j != k]
            near = now.nearby.near(found.course, [held[j].course for j in others], keep=now.keep)
            fresh[k] = [j for j, is_near in zip(others, near, strict=True) if is_near]
    return fresh


def _note_proven(now: Moment, said: Sequence[FleetViolation]) -> None:
    """Which plans are proven for all later times, and which pairs are not apart."""
    state, numbers = now.state, {one.name: one.number for one in now.vehicles}
    unproven = {
        numbers[name]
        for one in said
        if one.guarantee in {FleetGuarantee.APART, FleetGuarantee.STILL}
        for name in one.names
    }
    state.proven = {k: one.course for k, one in now.held.items() if k not in unproven}
    state.crossing = {
        (min(pair), max(pair))
        for one in said
        if one.guarantee is FleetGuarantee.APART
        for pair in [[numbers[name] for name in one.names]]
    }

"""Exchanges of plans in one step: each is proven past all that is held, and pays."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace

from maneuver_automaton.fleet.held import LATER, goes_on, left_to_pay
from maneuver_automaton.fleet.meetings import meetings
from maneuver_automaton.fleet.moment import Around, Moment, answers_to, request_of, search
from maneuver_automaton.fleet.result import Swap
from maneuver_automaton.fleet.vehicle import LONG, QUICK, OwnPlan
from maneuver_automaton.fleet.workers import Proposal

WORTH = 1e-6  # share of its cost that another plan saves at least
AGAIN, AGAIN_LONG = 4, 16  # steps until who has no plan looks again past the same plans


def _better_than(now: Moment, cost: float) -> float:
    """What another plan must cost less than."""
    if cost == math.inf:
        return cost
    return cost - max(now.state.settings.margin, WORTH * (1.0 + abs(cost)))


def exchange_what_is_due(now: Moment) -> None:
    """Answers that come now: exchanged if the plan is still held, and they are proven now."""
    for k, (when, found, base) in [*now.state.due.items()]:
        gone = now.held.get(k) is not base
        if gone or now.number >= when:
            del now.state.due[k]
        if gone or now.number < when:
            continue
        on_it = now.offset_from(k, found) == 0.0
        for one in [found] if on_it else now.rejoined(k, found):
            if _swap(now, {k: one}):
                break


def go_on(now: Moment) -> None:
    """Who stopped goes on along its void plan, as soon as that is proven: nobody searches."""
    stopped = now.state.stopped
    for k, left in [*stopped.items()]:
        if k not in now.held or k in now.state.broken or now.held[k].leads:
            del stopped[k]
        elif k not in now.void:
            for one in now.rejoined(k, replace(left, plan=replace(left.plan, start_time=now.time))):
                if now.searches.is_over or _swap(now, {k: one}):
                    break


def exchange(now: Moment) -> None:
    """Some look for better plans in turn: those who looked in vain least, who may gain most."""
    state, settings = now.state, now.state.settings
    able = [
        k
        for k in now.held
        if k not in state.broken
        and k not in state.arrived
        and k not in now.void
        and k not in state.due
        and state.efforts[k].settled != state.efforts[k].lineage
    ]
    turn = now.number % max(len(able), 1)
    order = [*able[turn:], *able[:turn]]
    order.sort(key=lambda k: (state.efforts[k].attempts, -state.efforts[k].gain))
    most = len(order) if settings.swaps_per_step is None else settings.swaps_per_step
    waiting = iter([k for k in order if k not in state.silent])
    while not now.searches.is_over:
        turns = min(settings.at_once, most - len(now.asked))
        batch = list(itertools.islice((k for k in waiting if _may_gain(now, k)), turns))
        if not batch:
            return
        _look_for_better(now, batch)


def _around(now: Moment) -> Around:
    """What is held, as a number that changes with it."""
    efforts = now.state.efforts
    now_held = sum(efforts[k].lineage for k in now.held)
    return len(now.held), sum(one.lineage for one in efforts), now_held


def _may_gain(now: Moment, k: int) -> bool:
    """Whether something changed since a vehicle looked in vain."""
    again = not now.held[k].leads and (now.number + k) % AGAIN == 0
    return again or now.state.efforts[k].in_vain != _around(now)


def _look_for_better(now: Moment, batch: Sequence[int]) -> None:
    """Some look for better plans at once, past the same ones; then one after another swaps."""
    around = _around(now)
    bases = [now.held[k] for k in batch]
    values = [_better_than(now, now.left_to_pay(k)) for k in batch]
    requests = []
    for k, base, known in zip(batch, bases, values, strict=True):
        # Who has no plan searches for long, and without room at its goal, now and then.
        hard = not base.leads and (now.number + k) % AGAIN_LONG == 0
        most, others = LONG if hard else QUICK, now.expected_by(k)
        requests.append(request_of(now, k, base, others, known, most=most, room=not hard))
    now.asked += batch
    for k, base, known, answer in zip(batch, bases, values, answers_to(now, requests), strict=True):
        # An exchange of another one of the batch may have changed it.
        if now.held[k] is not base or k in now.state.silent:
            continue
        if answer.alone is not None:
            now.state.efforts[k].gain = known - answer.alone.cost
        if not _exchanges(now, k, base, answer) and not now.searches.is_over:
            now.state.efforts[k].in_vain = around
            now.state.efforts[k].attempts += 1


def _exchanges(now: Moment, k: int, base: OwnPlan, answer: Proposal) -> bool:
    """A vehicle exchanges its plan for one that arrives no later; else a group looks for one."""
    settings, (found, alone) = now.state.settings, answer
    if alone is None:
        if base.leads and not now.searches.is_over:
            now.state.efforts[k].settled = now.state.efforts[k].lineage
        return False
    if found is not None and found.arrival <= base.arrives * (1.0 + LATER) + LATER:
        if settings.delay_steps:
            now.state.due[k] = (now.number + settings.delay_steps, found, base)
        else:
            _swap(now, {k: found})
        return True
    if settings.group_size > 1 and not settings.delay_steps:
        return _look_in_group(now, k, alone)
    return False


def _look_in_group(now: Moment, k: int, alone: OwnPlan) -> bool:
    """A vehicle and those in its way look for plans whose sum is less."""
    state = now.state
    courses = {j: now.left_of(one) for j, one in now.held.items() if j != k}
    courses[k] = now.left_of(alone)
    met = meetings(courses, keep=now.keep, among=[k], frame=now.frame)
    fixed = state.broken | state.arrived | state.silent
    movable = [j for j in (row.other_than(k) for row in met) if j not in fixed]
    group = [k, *movable[: state.settings.group_size - 1]]
    if len(group) < 2 or any(j in state.due for j in group):
        return False
    return _exchange_in_order(now, group) or _exchange_in_order(now, group[::-1])


def _exchange_in_order(now: Moment, group: Sequence[int]) -> bool:
    """Plans of a group, one after another, exchanged at once if their sum is less."""
    others = now.expected_by(group[0], but=group)
    found: dict[int, OwnPlan] = {}
    for n, j in enumerate(group):
        here = [*others, *found.items()]
        still = [(i, now.resting(i, now.held[i])) for i in group[n + 1 :]]
        one = search(now, j, now.held[j], [*here, *still], math.inf)[0]
        if one is None and still:
            one = search(now, j, now.held[j], here, math.inf)[0]
        if one is None:
            return False
        found[j] = one
    return _swap(now, found)


def _swap(now: Moment, found: dict[int, OwnPlan]) -> bool:
    """Exchange plans if these pay and are proven past all that is held now, and each other."""
    vehicles, time = now.vehicles, now.time
    if not all(goes_on(vehicles[k], now.held[k], one, time) for k, one in found.items()):
        return False
    before = math.fsum(now.left_to_pay(k) for k in found)
    after = math.fsum(left_to_pay(vehicles[k], one, time) for k, one in found.items())
    if not after < _better_than(now, before):
        return False
    for n, (k, one) in enumerate(found.items()):
        others = [*now.expected_by(k, but=found), *list(found.items())[:n]]
        if not now.is_proven(k, one, others):
            return False
    efforts = now.state.efforts
    past = tuple((vehicles[j].name, efforts[j].version) for j in sorted(now.held) if j not in found)
    if len(found) == 1:
        ((k, one),) = found.items()
        if not now.agreed(k, one):
            return False
        now.take(k, one)
    else:
        for k, one in found.items():
            now.take(k, one)
            now.state.agreement.announce(k, one)
        now.in_group |= set(found)
    now.swaps.append(
        Swap(
            names=tuple(vehicles[k].name for k in found),
            before=before,
            after=after,
            past=past,
            holds=tuple((vehicles[k].name, efforts[k].version) for k in found),
            order=len(now.swaps),
        )
    )
    return True

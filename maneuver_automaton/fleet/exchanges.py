"""Exchanges of plans in one step: each is proven past all that is held, and pays."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace

from maneuver_automaton.fleet.held import (
    LATER,
    arrival,
    goes_on,
    leads,
    left_to_pay,
    rejoined,
    resting,
)
from maneuver_automaton.fleet.meetings import meetings
from maneuver_automaton.fleet.moment import Around, Moment, answers_to, question_of, search
from maneuver_automaton.fleet.result import Swap
from maneuver_automaton.fleet.vehicle import LONG, QUICK, OwnPlan
from maneuver_automaton.fleet.workers import Proposal

WORTH = 1e-6  # share of its cost that another plan saves at least
AGAIN, AGAIN_LONG = 4, 16  # steps until who has no plan looks again past the same plans


class Exchanges:
    """The exchanges of one step, in their order, and who was asked."""

    def __init__(self, now: Moment) -> None:
        self.now = now
        self.swaps: list[Swap] = []
        self.asked: list[int] = []
        self.in_group: set[int] = set()

    def _better_than(self, cost: float) -> float:
        """What another plan must cost less than."""
        now = self.now
        if cost == math.inf:
            return cost
        return cost - max(now.state.settings.margin, WORTH * (1.0 + abs(cost)))

    def exchange_what_is_due(self) -> None:
        """Answers that come now: exchanged if the plan is still held, and they are proven now."""
        now = self.now
        for k, (when, found, base) in [*now.state.due.items()]:
            gone = now.held.get(k) is not base
            if gone or now.number >= when:
                del now.state.due[k]
            if gone or now.number < when:
                continue
            on_it = now.offset_from(k, found) == 0.0
            again = rejoined(now.vehicles[k], found, now.time, now.poses[k], now.tube)
            for one in [found] if on_it else again:
                if self._swap({k: one}):
                    break

    def go_on(self) -> None:
        """Who stopped goes on along its void plan, as soon as that is proven: nobody searches."""
        now = self.now
        stopped = now.state.stopped
        for k, left in [*stopped.items()]:
            if k not in now.held or k in now.state.broken or leads(now.held[k]):
                del stopped[k]
            elif k not in now.void:
                again = replace(left, plan=replace(left.plan, start_time=now.time))
                onward = rejoined(now.vehicles[k], again, now.time, now.poses[k], now.tube)
                for one in onward:
                    if now.searches.is_over or self._swap({k: one}):
                        break

    def exchange(self) -> None:
        """Some look for better plans, one after another: who looked in vain least often first.

        Among these who may gain most: what its way alone would have saved when it looked last.
        """
        now, state, settings = self.now, self.now.state, self.now.state.settings
        able = [
            k
            for k in now.held
            if k not in state.broken
            and k not in state.arrived
            and k not in now.void
            and k not in state.due
            and state.settled.get(k) != state.lineage[k]
        ]
        turn = now.number % max(len(able), 1)
        order = [*able[turn:], *able[:turn]]
        order.sort(key=lambda k: (state.attempts.get(k, 0), -state.gains.get(k, math.inf)))
        most = len(order) if settings.swaps_per_step is None else settings.swaps_per_step
        waiting = iter([k for k in order if k not in state.silent])
        while not now.searches.is_over:
            turns = min(settings.at_once, most - len(self.asked))
            batch = list(itertools.islice((k for k in waiting if self._may_gain(k)), turns))
            if not batch:
                return
            self._look_for_better(batch)

    def _around(self) -> Around:
        """What is held, as a number that changes with it."""
        now = self.now
        lineage = now.state.lineage
        return len(now.held), sum(lineage.values()), sum(lineage[k] for k in now.held)

    def _may_gain(self, k: int) -> bool:
        """Whether something changed since a vehicle looked in vain.

        Later no more is to be had past the same plans: what is left of them is less. But who has
        none looks again, as as many expansions then lead farther.
        """
        now = self.now
        again = not leads(now.held[k]) and (now.number + k) % AGAIN == 0
        return again or now.state.in_vain.get(k) != self._around()

    def _tries_hard(self, k: int) -> bool:
        """Whether who has no plan searches for long, and without room at its goal: now and then."""
        now = self.now
        return not leads(now.held[k]) and (now.number + k) % AGAIN_LONG == 0

    def _look_for_better(self, batch: Sequence[int]) -> None:
        """Some look for better plans at once, past the same ones; then one after another swaps."""
        now = self.now
        around = self._around()
        bases = [now.held[k] for k in batch]
        values = [self._better_than(now.left_to_pay(k)) for k in batch]
        questions = []
        for k, base, known in zip(batch, bases, values, strict=True):
            hard = self._tries_hard(k)
            most = LONG if hard else QUICK
            others = now.expected_by(k)
            questions.append(question_of(now, k, base, others, known, most=most, room=not hard))
        self.asked += batch
        answers = answers_to(now, questions)
        for k, base, known, answer in zip(batch, bases, values, answers, strict=True):
            # An exchange of another one of the batch may have changed it.
            if now.held[k] is not base or k in now.state.silent:
                continue
            if answer.alone is not None:
                now.state.gains[k] = known - answer.alone.cost
            if not self._exchanges(k, base, answer) and not now.searches.is_over:
                now.state.in_vain[k] = around
                now.state.attempts[k] = now.state.attempts.get(k, 0) + 1

    def _exchanges(self, k: int, base: OwnPlan, answer: Proposal) -> bool:
        """A vehicle exchanges its plan for one that arrives no later; else a group looks for one.

        Whether there is one, also if not all agreed to it.
        """
        now = self.now
        settings, (found, alone) = now.state.settings, answer
        if alone is None:
            if leads(base) and not now.searches.is_over:
                now.state.settled[k] = now.state.lineage[k]
            return False
        if found is not None and found.arrival <= arrival(base) * (1.0 + LATER) + LATER:
            if settings.delay_steps:
                now.state.due[k] = (now.number + settings.delay_steps, found, base)
            else:
                self._swap({k: found})
            return True
        if settings.group_size > 1 and not settings.delay_steps:
            return self._look_in_group(k, alone)
        return False

    def _look_in_group(self, k: int, alone: OwnPlan) -> bool:
        """A vehicle and those in its way look for plans whose sum is less."""
        now = self.now
        state = now.state
        courses = {j: now.left_of(one) for j, one in now.held.items() if j != k}
        met = meetings(
            {**courses, k: now.left_of(alone)},
            keep=now.keep,
            among=[k],
            frame=now.frame,
        )
        near = [row.one if row.other == k else row.other for row in met]
        fixed = state.broken | state.arrived | state.silent
        movable = [j for j in near if j not in fixed]
        group = [k, *movable[: state.settings.group_size - 1]]
        if len(group) < 2 or any(j in state.due for j in group):
            return False
        return self._exchange_in_order(group) or self._exchange_in_order(group[::-1])

    def _exchange_in_order(self, group: Sequence[int]) -> bool:
        """Plans of a group, one after another, exchanged at once if their sum is less."""
        now = self.now
        others = now.expected_by(group[0], but=group)
        found: dict[int, OwnPlan] = {}
        for n, j in enumerate(group):
            here = [*others, *found.items()]
            still = [
                (i, resting(now.vehicles[i], now.poses[i], now.time, now.held[i]))
                for i in group[n + 1 :]
            ]
            one = search(now, j, now.held[j], [*here, *still], math.inf)[0]
            if one is None and still:
                one = search(now, j, now.held[j], here, math.inf)[0]
            if one is None:
                return False
            found[j] = one
        return self._swap(found)

    def _swap(self, found: dict[int, OwnPlan]) -> bool:
        """Exchange plans if these pay and are proven past all that is held now, and each other.

        An answer that comes late may be for a plan that was rejoined with other times since: one
        that has another speed than the vehicle by now is not taken.
        """
        now = self.now
        vehicles, time = now.vehicles, now.time
        if not all(goes_on(vehicles[k], now.held[k], one, time) for k, one in found.items()):
            return False
        before = math.fsum(now.left_to_pay(k) for k in found)
        after = math.fsum(left_to_pay(now.vehicles[k], one, now.time) for k, one in found.items())
        if not after < self._better_than(before):
            return False
        for n, (k, one) in enumerate(found.items()):
            others = [*now.expected_by(k, but=found), *list(found.items())[:n]]
            if not now.is_proven(k, one, others):
                return False
        versions = now.state.versions
        past = tuple(
            (now.vehicles[j].name, versions[j]) for j in sorted(now.held) if j not in found
        )
        if len(found) == 1:
            ((k, one),) = found.items()
            if not now.agreed(k, one):
                return False
            now.held[k] = one
        else:
            for k, one in found.items():
                now.held[k] = one
                now.state.agreement.announce(k, one)
            self.in_group |= set(found)
        for k, one in found.items():
            versions[k] += 1
            now.state.lineage[k] += 1
            now.state.attempts[k] = 0
            now.off[k] = now.offset_from(k, one)
            now.beside.pop(k, None)
        names = tuple(now.vehicles[k].name for k in found)
        self.swaps.append(
            Swap(
                names=names,
                before=before,
                after=after,
                past=past,
                holds=tuple((now.vehicles[k].name, versions[k]) for k in found),
                order=len(self.swaps),
            )
        )
        return True

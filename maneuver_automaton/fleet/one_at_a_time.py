"""Plans in which one vehicle drives at a time, past all others where they stand.

Where nobody has a way to its goal, those that stand in one's way drive aside first, and home later:
also those that stand at their goals. No search in time is needed. Then every leg begins as soon as
the legs before it allow.

Source: Čáp, Novák, Kleiner, Selecký (2015), *Prioritized Planning Algorithms for Trajectory
Coordination of Multiple Mobile Robots*, IEEE T-ASE 12(3), for fleets in which everybody has a way
past all starts and goals; Luna, Bekris (2011), *Push and Swap: Fast Cooperative Path-Finding with
Completeness Guarantees*, IJCAI 22, for those that make room.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from maneuver_automaton.budget import Budget
from maneuver_automaton.collision.shapes import Obstacle
from maneuver_automaton.fleet.conflicts import Course, meetings
from maneuver_automaton.fleet.turns import Held
from maneuver_automaton.fleet.vehicle import Found, Vehicle
from maneuver_automaton.problem import Goal

MOST_ASIDE = 3  # times that one vehicle makes room for others
BEGINS, HALVINGS = 24, 6  # of a leg that are tried, and how far the first free one is refined


def one_at_a_time(
    vehicles: Sequence[Vehicle], order: Sequence[int], margin: float, budget: Budget
) -> Held:
    """Plans of those in an order, of whom each drives past all others where they stand.

    Only those that have arrived where not all do; nobody has made room for them then.
    """
    return _Floor(vehicles, margin, budget).run(order)


@dataclass(slots=True, eq=False)
class _Floor:
    vehicles: Sequence[Vehicle]
    margin: float  # [m] that any two bodies keep
    budget: Budget
    driven: Held = field(default_factory=dict)  # so far
    waiting: list[int] = field(default_factory=list)  # who is not at its goal
    asides: Counter[int] = field(default_factory=Counter)

    def run(self, order: Sequence[int]) -> Held:
        """The plans of those that arrive."""
        self.waiting = list(order)
        unaided: Held | None = None
        while self.waiting and not self.budget.is_over:
            if any(self._drives_home(k) for k in tuple(self.waiting)):
                continue
            unaided = dict(self.driven) if unaided is None else unaided
            if not any(self._is_made_room_for(k) for k in tuple(self.waiting)):
                break
        if self.waiting and unaided is not None:
            return unaided
        for k in self.asides:
            self.vehicles[k].keep_aside(self.driven[k])
        return {k: found for k, found in self.driven.items() if k not in self.waiting}

    def _drives_home(self, k: int) -> bool:
        """Whether a vehicle has a way to its goal past all others, which it drives then."""
        leg = self._leg(k, self._standing(but=k))
        if leg is not None:
            self.waiting.remove(k)
            self._drive(k, leg, leaves=self.vehicles[k].leaves)
        return leg is not None

    def _is_made_room_for(self, k: int) -> bool:
        """Whether those in the way of a vehicle drive aside, so that it arrives."""
        way = self._leg(k, [])
        if way is None:
            return False
        there = {j: one for j, one in self._courses().items() if j != k}
        met = meetings({**there, k: way.course}, keep=self.margin, among=[k])
        for row in met:
            j = row.one if row.other == k else row.other
            if self.asides[j] == MOST_ASIDE or not self._drives_aside(j, k, way):
                return False
        return self._drives_home(k)

    def _drives_aside(self, j: int, k: int, way: Found) -> bool:
        """Whether a vehicle finds a place off the way of another one, to which it drives then."""
        vehicle, before = self.vehicles[j], self.driven.get(j)
        if vehicle.problem.automaton.rest is None:
            return False
        others = self._standing(but=j)
        beside = [
            body for i, one in self._courses().items() if i not in (j, k) for body in one.arrived
        ]
        for goal in vehicle.refuges(before, way, beside, self._clock):
            if self.budget.is_over:
                return False
            leg = self._leg(j, others, aim=goal)
            if leg is None:
                continue
            there = replace(leg.course, until=math.inf).after(leg.arrival)
            if not meetings({j: there, k: way.course}, keep=self.margin):
                self.asides[j] += 1
                self.waiting += [] if j in self.waiting else [j]
                self._drive(j, leg, leaves=False)
                return True
        return False

    def _drive(self, k: int, leg: Found, *, leaves: bool) -> None:
        """Drive a leg, as soon as all that was driven before allows."""
        vehicle, before, clock = self.vehicles[k], self.driven.get(k), leg.plan.start_time
        others = {j: one for j, one in self._courses().items() if j != k}
        first = vehicle.problem.start_time if before is None else before.arrival

        def begun(time: float) -> Found:
            found = vehicle.then(before, leg, time)
            return replace(
                found, course=replace(found.course, until=found.arrival if leaves else math.inf)
            )

        def is_free(time: float) -> bool:
            return not meetings({**others, k: begun(time).course}, keep=self.margin, among=[k])

        begins = [clock] if vehicle.problem.moves else np.linspace(first, clock, BEGINS).tolist()
        n = next((n for n, time in enumerate(begins[:-1]) if is_free(time)), len(begins) - 1)
        soonest = begins[n]
        late = begins[max(n - 1, 0)]
        for _ in range(HALVINGS if n else 0):
            middle = 0.5 * (late + soonest)
            late, soonest = (late, middle) if is_free(middle) else (middle, soonest)
        self.driven[k] = begun(soonest)

    def _leg(self, k: int, others: Sequence[Obstacle], **aim: Goal) -> Found | None:
        return self.vehicles[k].leg(self.driven.get(k), others, self._clock, self.budget, **aim)

    def _courses(self) -> dict[int, Course]:
        """What everybody has driven so far."""
        return {
            k: self.driven[k].course if k in self.driven else one.standing
            for k, one in enumerate(self.vehicles)
        }

    def _standing(self, *, but: int) -> list[Obstacle]:
        """All others where they stand now."""
        return [body for k, one in self._courses().items() if k != but for body in one.arrived]

    @property
    def _clock(self) -> float:
        """When all that was driven so far is over [s]."""
        starts = [one.problem.start_time for one in self.vehicles]
        return max([*starts, *(one.arrival for one in self.driven.values())])

"""Vehicles planned one after another, past the plans of those before: in orders and groups.

Source: Čáp, Novák, Kleiner, Selecký (2015), *Prioritized Planning Algorithms for Trajectory
Coordination of Multiple Mobile Robots*, IEEE T-ASE 12(3): planned past the starts of those to come,
nobody is ever enclosed by them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from maneuver_automaton.budget import Budget
from maneuver_automaton.collision.shapes import Obstacle
from maneuver_automaton.fleet.conflicts import meetings
from maneuver_automaton.fleet.vehicle import LONG, QUICK, Found, Vehicle

Held: TypeAlias = dict[int, Found]
"""Plans by the numbers of their vehicles."""

MOST_EVICTED = 8  # times that plans are given up for one vehicle


@dataclass(slots=True, eq=False)
class Turns:
    """Searches for one vehicle after another, within a budget."""

    vehicles: Sequence[Vehicle]
    margin: float  # [m] that any two bodies keep
    budget: Budget
    queries: int = 0

    def one_after_another(self, order: Sequence[int], held: Held) -> Held:
        """Plans in an order, past those that are held; who fails goes before those it hits."""
        held, waiting, evicted = dict(held), list(order), 0
        failed: set[int] = set()
        while waiting and not self.budget.is_over:
            k = waiting.pop(0)
            to_come = [*waiting, *self.without_plan(held, {k, *waiting})]
            found = self.past(k, held, to_come)
            if found is None:
                found = self.past(k, held, self.without_plan(held, {k, *waiting}), most=LONG)
            if found is None and evicted < MOST_EVICTED and k not in failed:
                failed.add(k)
                found, out = self._before_those_it_hits(k, held)
                for other in out:
                    del held[other]
                waiting = [*out, *waiting]
                evicted += len(out)
            if found is not None:
                held[k] = found
        return held

    def anew(self, group: Sequence[int], held: Mapping[int, Found]) -> Held | None:
        """Better plans of a group, one after another, past all others; None if one has none."""
        now, others = dict(held), self.without_plan(held, set(group))
        for n, k in enumerate(group):
            if self.budget.is_over:
                return None
            found = self.past(k, now, [*group[n + 1 :], *others], again=True)
            if found is None and n + 1 < len(group):
                found = self.past(k, now, others, again=True)
            if found is None:
                return None
            now[k] = found
        return {k: now[k] for k in group}

    def without_plan(self, held: Mapping[int, Found], but: set[int]) -> list[int]:
        """Vehicles that stand at their starts for ever."""
        return [k for k in range(len(self.vehicles)) if k not in held and k not in but]

    def _before_those_it_hits(self, k: int, held: Held) -> tuple[Found | None, list[int]]:
        """A way past those that have no plan, and whose plans it needs to be given up."""
        found = self.past(k, {}, self.without_plan(held, {k}))
        if found is None:
            found = self.past(k, {}, [])
        if found is None:
            return None, []
        courses = {other: one.course for other, one in held.items()}
        met = meetings({**courses, k: found.course}, keep=self.margin, among=[k])
        return found, sorted({m.one if m.other == k else m.other for m in met})

    def past(
        self,
        k: int,
        held: Mapping[int, Found],
        standing: Sequence[int],
        *,
        most: int = QUICK,
        known: float = math.inf,
        again: bool = False,
        besides: Sequence[Obstacle] = (),
    ) -> Found | None:
        """A way of one vehicle past plans, others at their starts, and more; better `again`."""
        self.queries += 1
        others: list[Obstacle] = []
        for other in sorted({*held, *standing} - {k}):
            course = held[other].course if other in held else self.vehicles[other].standing
            others += course.obstacles
        others += besides
        return self.vehicles[k].past(others, self.budget, most=most, known=known, again=again)

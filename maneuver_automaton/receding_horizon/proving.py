"""What is proven of the steps of a loop: each starts from what the steps before have proven."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from maneuver_automaton._kernel_list import load_kernels
from maneuver_automaton.budget import Budget, Watch
from maneuver_automaton.costs import prices_switches
from maneuver_automaton.planning.lower_bound import Proving, in_costs
from maneuver_automaton.problem import Problem

if TYPE_CHECKING:
    from maneuver_automaton.bounds import CostToGo


@dataclass(slots=True, eq=False)
class LoopBounds:
    """Functions that were proven on the way, and what has been driven since.

    The way driven and any plan from here make one plan from where a function was proven: if it is
    cheaper than the plan known then, it stays in the function's cells.
    """

    gap: float  # share of the value that is small enough
    whole: CostToGo | None = None  # serves poses beside the way, too
    finest: CostToGo | None = None  # serves poses on the way from where it was proven
    since: float = 0.0  # cost accumulated there
    least: float = 0.0  # cost of any plan from where that much was accumulated ...
    at: float = 0.0

    @classmethod
    def ready(cls, gap: float) -> LoopBounds:
        """Bounds of a loop that begins, with all that is to be compiled."""
        load_kernels("cells")
        return cls(gap)

    def forget(self) -> None:
        """Other obstacles are seen: nothing holds any more."""
        self.whole = self.finest = None
        self.least = 0.0

    def leave(self) -> None:
        """The vehicle is off the plan: how it came here is not known."""
        self.finest = None
        self.least = 0.0

    def known(self, here: Problem, accumulated: float) -> float:
        """The best bound from here, after some cost of the whole loop; 0 if none is known."""
        pose = here.start[:3]
        driven = accumulated - self.since
        beside = 0.0 if self.whole is None else self.whole.anywhere(pose)
        on_the_way = 0.0 if self.finest is None else self.finest.after(pose, driven)
        best = max(beside, on_the_way)
        proven = in_costs(here, best) if best > 0.0 else 0.0
        return max(proven, self.least - (accumulated - self.at))

    def closed(self, value: float, bound: float) -> bool:
        """Whether a value is near enough to a bound."""
        return value < math.inf and value - bound <= self.gap * value

    def prove(self, here: Problem, value: float, accumulated: float, budget: Budget) -> float:
        """A better bound than that known, in the time that is left of a step."""
        known = self.known(here, accumulated)
        if value == math.inf or self.closed(value, known) or budget.is_over:
            return known
        watch = Watch(gap=self.gap, cost=value, bound=known)
        proving = Proving(here, budget, watch)
        proving.run()
        for function in proving.functions:
            if function.whole:
                self.whole = function
            if not function.priced:  # what a change between two steps costs is not counted
                self.finest, self.since = function, accumulated
        best = max(known, proving.bound(value).value)
        self._note(here, best, accumulated)
        return best

    def _note(self, here: Problem, least: float, accumulated: float) -> None:
        """Keep a bound of plans from here, for steps on the way.

        Not where a switch or a change of direction between two steps has a price, which neither
        step counts, nor for a fixed time, which every step begins anew.
        """
        if not prices_switches(here.cost) and here.horizon.time is None:
            self.least, self.at = least, accumulated

"""Budget of a search: time by one clock, and expansions."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace

COUNTED = 0.7  # share of the time left that a stage of counted work takes at most: others follow


@dataclass(slots=True, eq=False)
class Watch:
    """What a search and a proof beside it tell each other, and anybody who looks on.

    Examples
    --------
    >>> watch = Watch(gap=0.05)
    >>> watch.note(10.0)
    >>> watch.bound = 9.6
    >>> watch.is_closed
    True
    """

    gap: float  # share of the cost that is small enough
    problem: object = None  # of which the plans must be, for their cost to count
    cost: float = math.inf  # of the best plan found
    bound: float = 0.0  # no plan is cheaper
    is_abandoned: bool = False  # nobody waits for a better bound any more

    @property
    def is_closed(self) -> bool:
        """Whether the gap is small enough."""
        return self.cost < math.inf and self.cost - self.bound <= self.gap * self.cost

    def note(self, cost: float) -> None:
        """A plan was found."""
        self.cost = min(self.cost, cost)


@dataclass(frozen=True, slots=True, kw_only=True)
class Budget:
    """Time until a deadline, and expansions, that a search and all its stages may take together.

    Examples
    --------
    >>> budget = Budget.from_now(10.0, expansions=500)
    >>> budget.is_over, budget.less(400).expansions, budget.less(600).expansions
    (False, 100, 0)
    >>> budget.part(0.5).deadline < budget.stage(0.5).deadline < budget.deadline
    True
    """

    began: float  # as `time.monotonic` counts [s]
    deadline: float  # the same clock
    expansions: int | None = None  # that are left; None: only the time counts
    watch: Watch | None = None  # once its gap is closed, no time is left

    @classmethod
    def from_now(cls, seconds: float, *, expansions: int | None = None) -> Budget:
        """So many seconds from now on."""
        now = time.monotonic()
        return cls(began=now, deadline=now + seconds, expansions=expansions)

    @property
    def seconds(self) -> float:
        """All the time there was at the begin [s]."""
        return self.deadline - self.began

    @property
    def elapsed(self) -> float:
        """Time since the begin [s]."""
        return time.monotonic() - self.began

    @property
    def left(self) -> float:
        """Time that is left [s], at least 0."""
        return 0.0 if self.is_over else max(self.deadline - time.monotonic(), 0.0)

    @property
    def is_over(self) -> bool:
        """Whether no time is left."""
        closed = self.watch is not None and self.watch.is_closed
        return closed or time.monotonic() >= self.deadline

    def part(self, share: float, *, at_least: float = 0.0) -> Budget:
        """A budget of its own from now on: a share of the time left, at least so many seconds."""
        part = Budget.from_now(max(share * self.left, at_least), expansions=self.expansions)
        return replace(part, watch=self.watch)

    def stage(self, share: float) -> Budget:
        """Budget of one stage: a share of the time left, a large one where work is counted.

        Counted work ends every stage at the same place at every call, unless the time gets short.
        """
        if self.expansions is not None:
            share = max(share, COUNTED)
        return replace(self, deadline=time.monotonic() + share * self.left)

    def less(self, spent: int) -> Budget:
        """The budget that remains after so many expansions."""
        if self.expansions is None:
            return self
        return replace(self, expansions=max(0, self.expansions - spent))

"""Budget of a search: time by one clock, and expansions."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

from maneuver_automaton._interrupts import stopped

COUNTED = 0.7  # share of the time left that a stage of counted work takes at most: others follow
LATE_SHARE, LATE = 0.08, 0.006  # of the time, and [s], by which checks of an answer may be late
FIRST_LATE = 0.1  # [s] the same where there is nothing else to return
MOMENT, SHARE = 4e-3, 0.25  # [s], and of the time left, between two looks at the clock


@dataclass(slots=True, eq=False)
class Watch:
    """What a search and a proof beside it tell each other, and anybody who looks on."""

    gap: float  # share of the cost that is small enough
    problem: object = None  # of which the plans must be, for their cost to count
    cost: float = math.inf  # of the best plan found
    bound: float = 0.0  # no plan is cheaper
    is_abandoned: bool = False  # nobody waits for a better bound any more
    is_given_up: bool = False  # nor for a better plan

    @property
    def is_closed(self) -> bool:
        """Whether the gap is small enough."""
        return self.cost < math.inf and self.cost - self.bound <= self.gap * self.cost

    def note(self, cost: float) -> None:
        """A plan was found."""
        self.cost = min(self.cost, cost)


class Budget(NamedTuple):
    """Time until a deadline, and expansions, that a search and all its stages may take together.

    It is the one value that says when to stop: whatever loops is handed a budget and asks it.
    Kernels cannot ask; they are called for a number of steps that takes some milliseconds.
    """

    began: float  # as the clock counts [s]
    deadline: float  # the same clock
    expansions: int | None = None  # that are left; None: only the time counts
    clock: Callable[[], float] = time.monotonic  # seconds from some moment on
    watch: Watch | None = None  # once its gap is closed, no time is left
    worked: float = -math.inf  # [s] processor time of this process at the begin; -inf: no matter
    late: float = LATE  # [s] by which checks may be late, besides a share of the time
    shows: Callable[[Any], None] | None = None  # called when a better plan has passed its checks
    quits: Callable[[], bool] | None = None  # asked whether others shall try first

    @classmethod
    def from_now(
        cls,
        seconds: float,
        *,
        expansions: int | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> Budget:
        """So many seconds from now on."""
        now = clock()
        return cls(
            began=now,
            deadline=now + seconds,
            expansions=expansions,
            clock=clock,
            worked=time.process_time(),
        )

    @property
    def seconds(self) -> float:
        """All the time there was at the begin [s]."""
        return self.deadline - self.began

    @property
    def elapsed(self) -> float:
        """Time since the begin [s]."""
        return self.clock() - self.began

    @property
    def left(self) -> float:
        """Time that is left [s], at least 0."""
        return 0.0 if self.is_stopped else max(self.deadline - self.clock(), 0.0)

    @property
    def is_stopped(self) -> bool:
        """Whether the gap is closed, or somebody asks to come to an end."""
        watch = self.watch
        given_up = watch is not None and (watch.is_closed or watch.is_given_up)
        return stopped() or given_up or (self.quits is not None and self.quits())

    @property
    def is_over(self) -> bool:
        """Whether no time is left, or it is stopped."""
        return self.is_stopped or self.clock() >= self.deadline

    def part(self, share: float, *, at_least: float = 0.0) -> Budget:
        """A budget of its own from now on: a share of the time left, at least so many seconds."""
        now = self.clock()
        seconds = max(share * self.left, at_least)
        worked = time.process_time() if self.worked > -math.inf else self.worked
        return self._replace(began=now, deadline=now + seconds, worked=worked)

    def stage(self, share: float) -> Budget:
        """Budget of one stage: a share of the time left, a large one where work is counted.

        Counted work ends every stage at the same place at every call, unless the time gets short.
        """
        if self.expansions is not None:
            share = max(share, COUNTED)
        return self if share == 1.0 else self._replace(deadline=self.clock() + share * self.left)

    @property
    def left_to_check(self) -> float:
        """Time that is left to check what was found [s]: it may be a moment late.

        What other programs have delayed is not late yet: the processor time of this one counts.
        """
        seconds = self.deadline - self.began
        late, spent = seconds + LATE_SHARE * seconds + self.late, self.clock() - self.began
        if spent >= late:
            spent = min(spent, time.process_time() - self.worked)
        return max(late - spent, 0.0)

    def before(self, seconds: float) -> Budget:
        """The budget that ends so many seconds earlier: what follows takes these."""
        return self._replace(deadline=self.deadline - seconds) if seconds else self

    def less(self, spent: int) -> Budget:
        """The budget that remains after so many expansions."""
        if self.expansions is None:
            return self
        return self._replace(expansions=max(0, self.expansions - spent))


UNLIMITED = Budget(began=0.0, deadline=math.inf)


@dataclass(slots=True, eq=False)
class Pace:
    """Steps of a kernel in portions that take a moment each, by what the last one took.

    For work that is the same however it is parted. Where time gets short portions get smaller, so
    that a costly step among cheap ones delays little.
    """

    budget: Budget
    steps: int  # that are taken first
    most: int = 2**62
    _taken: int = 0
    _since: float = 0.0

    def take(self, steps: int) -> int:
        """How many of some steps to do now, those taken before being done; 0: the time is over."""
        now = self.budget.clock()
        left = self.budget.deadline - now
        if left <= 0.0 or self.budget.is_stopped:
            return 0
        if self._taken:
            fit = min(MOMENT, SHARE * left) * self._taken / max(now - self._since, 1e-9)
            self.steps = int(min(max(fit, 1.0), 4 * self.steps, self.most))
        self._taken, self._since = min(self.steps, steps), now
        return self._taken

    def go_on(self, budget: Budget) -> None:
        """Take further steps after a while."""
        self.budget, self._taken = budget, 0


@dataclass(slots=True, eq=False)
class EvenPace:
    """Steps that all cost about the same: as many as fit, at most so many at once.

    Portions are smaller than that, and a step that does not fit is not begun, only where time gets
    short: for work that depends on how it is parted.
    """

    budget: Budget
    most: int
    each: float  # [s] guessed at first, then measured
    _taken: int = 0
    _since: float = 0.0

    def take(self, steps: int) -> int:
        """How many of some steps to do now, those taken before being done; 0: none fits."""
        now = self.budget.clock()
        if self.budget.is_stopped:
            return 0
        if self._taken:
            self.each = max((now - self._since) / self._taken, 1e-9)
        fits = max(self.budget.deadline - now, 0.0) / self.each
        self._taken, self._since = int(min(steps, self.most, fits)), now
        return self._taken

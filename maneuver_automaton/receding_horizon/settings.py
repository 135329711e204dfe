"""How a loop is closed: the numbers, and whether they fit a problem."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from maneuver_automaton._arrays import check_fields, plain_numbers
from maneuver_automaton.automaton import Plan
from maneuver_automaton.costs import terms_of
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Problem

EXACT = 1e-9  # [m, rad] a pose this close to a goal is the goal; to a plan, on it


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Settings:
    """How a loop is closed."""

    step: float  # delta [s]
    margin: float = 0.0
    time_limit: float = 5.0  # [s] per step
    first: Plan | None = None
    hold: bool = False
    retimed: bool = False
    pieces: int = 0  # of equal time, with controls between those of the library; 0: its trims alone
    gap: float | None = None  # share of the cost that may be left to gain; None: nothing is proven
    pad: Trim | None = None  # the rest that prolongs a plan
    look_ahead: float = 60.0  # [s] that a fail-safe trajectory must be free
    stand: float = 2.0  # [s] that the goal must stay free after arrival

    def __post_init__(self) -> None:
        plain_numbers(self)
        about, times = "receding horizon", ("step", "time_limit", "look_ahead")
        check_fields(about, self, *times, unit="s", infinite=True)
        check_fields(about, self, "margin", least=0, infinite=True)
        check_fields(about, self, "stand", least=0, unit="s", infinite=True)
        if self.gap is not None and not 0.0 <= self.gap < 1.0:
            raise ValueError(
                f"receding horizon: gap must be a share from 0 to below 1, got {self.gap}"
            )
        if self.pieces < 0 or self.pieces == 1:
            raise ValueError(
                f"receding horizon: pieces must be at least 2, or 0 for none, got {self.pieces}"
            )

    @property
    def continuous(self) -> bool:
        """Whether plans may have other controls than the library."""
        return self.retimed or self.pieces > 0

    def pad_of(self, problem: Problem) -> Trim | None:
        """The rest that fills a fixed time; None where time is free."""
        return None if problem.horizon.time is None else self.pad

    def check(self, problem: Problem) -> None:
        """Raise ValueError if a loop with these settings cannot keep to a problem."""
        horizon = problem.horizon.time
        if horizon is not None and self.step > horizon * (1.0 + EXACT):
            raise ValueError(
                f"receding horizon: step is {self.step:g} s, need at most the horizon, "
                f"{horizon:g} s"
            )
        if self.continuous:
            self._check_continuous(problem)

    def _check_continuous(self, problem: Problem) -> None:
        """Raise ValueError if plans of a problem cannot be driven with other controls."""
        what = "plans with pieces" if self.pieces else "retimed plans"
        terms = terms_of(problem.cost)
        if problem.has_inertia or problem.zones or problem.climbs_among_obstacles:
            raise ValueError(
                f"receding horizon: {'pieces are' if self.pieces else 'retimed is'} for vehicles "
                "without inertia, and no zones or heights: at another pace a maneuver leads "
                "elsewhere, and a zone may forbid it"
            )
        if problem.horizon.time is None or terms is None or not terms.effort > 0.0:
            raise ValueError(
                f"receding horizon: {what} need a fixed horizon and a cost with effort"
            )
        if self.pad is None:
            raise ValueError(
                f"receding horizon: {what} need a rest trim, which fills the time they "
                "gain; the library has none"
            )
        if problem.moves:
            raise ValueError(
                f"receding horizon: {what} meet moving obstacles at other times; need static ones"
            )
        if self.pieces and (self.retimed or problem.horizon.max_trims is not None):
            raise ValueError(
                "receding horizon: plans with pieces have as many trims as pieces, at the best "
                "pace; need retimed and max_trims left out"
            )


def filling_rest(problem: Problem) -> Trim | None:
    """The cheapest rest of the library, which fills a fixed time; None if no plan may end in it.

    Where trims are not switched at will, a plan ends in the goal's trim.
    """
    moving = [not problem.last_trim(goal).is_rest for goal in problem.goals if goal.trim]
    if any(moving) and problem.has_inertia:
        return None
    still = np.flatnonzero(~problem.automaton.body_velocities.any(axis=1))
    if not still.size:
        return None
    return problem.automaton.trims[int(still[np.argmin(problem.rates[still])])]

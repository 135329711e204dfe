"""What one step of driving decides: controls tick by tick, and the settings of the search."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton._arrays import Array, freeze
from maneuver_automaton._brief import brief

AT_REST = 1e-9  # [m/s]


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadSettings:
    """How a drive is planned."""

    horizon_s: float = 6.0  # how far a plan looks ahead at most, its stop apart
    width: int = 80  # nodes of a level that the beam search goes on from
    narrow: int = 40  # the same where the last plan leads to a goal and is only to be improved
    off_edge_m: float = 0.04  # distances kept from the edge of the area
    off_traffic_m: float = 0.15  # and from all other road users
    top_speed: float = 36.0  # [m/s] of the trims, if the start is not faster still
    greed: float = 1.0  # weight of the cost-to-go
    gain: float = 0.02  # share of the cost by which a new plan has to be better than the old one

    __repr__ = brief


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RoadDecision:
    """Controls for the ticks to come: a plan, and the fail-safe stop after it.

    The kernels prove these states free again in every step, so they are kept as arrays;
    `RoadPlanner.plan_of` makes the `Plan` of them.
    """

    tick: int  # at which it begins
    states: Array  # (n + 1, 5) x, y, heading of the rear axle, speed, steering, the stop included
    controls: Array  # (n, 2) acceleration [m/s^2], steering rate [rad/s], the stop included
    lasting: int  # ticks before the stop begins
    reaches: bool  # whether it reaches a goal there

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "states", last=5)
        freeze(self, "controls", last=2)

    @property
    def stops(self) -> bool:
        """Whether it ends at rest."""
        return abs(float(self.states[-1, 3])) <= AT_REST

    @property
    def stands(self) -> bool:
        """Whether it is to stay at rest, as no motion on is free."""
        return not (self.lasting or self.reaches) and abs(float(self.states[0, 3])) <= AT_REST

    def tail(self) -> RoadDecision:
        """The rest of the plan a tick later."""
        return RoadDecision(
            tick=self.tick + 1,
            states=self.states[1:],
            controls=self.controls[1:],
            lasting=max(self.lasting - 1, 0),
            reaches=self.reaches,
        )

    def then(self, other: RoadDecision, *, after: int) -> RoadDecision:
        """The first ticks of the plan, and another one that begins where these end."""
        return replace(
            other,
            tick=self.tick,
            states=np.concatenate([self.states[:after], other.states]),
            controls=np.concatenate([self.controls[:after], other.controls]),
            lasting=after + other.lasting,
        )

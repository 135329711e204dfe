"""Moves by which plans to a goal are polished, and how many passes of them a plan gets."""

from __future__ import annotations

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.roads import _kernels_polish
from maneuver_automaton.roads.arrays import Horizon, Moves
from maneuver_automaton.roads.decision import RoadDecision

# Weights of the blocks of a move. All keep the speed, or the steering angle, after it; of the
# steering rate the second keeps the heading besides, and the last the place across, nearly.
PATTERNS = ((1.0, -1.0), (0.5, -1.0, 0.5), (1.0, -1.0, -1.0, 1.0), (1 / 3, -1.0, 1.0, -1 / 3))
SIZES = ((1.0, 0.2), (0.3, 0.06), (0.1, 0.02))  # [m/s^2], [rad/s]
ROUND = len(PATTERNS) * len(SIZES)  # passes in which every pattern has every size
ROUNDS = 40  # at most
MOVES = Moves(
    pattern=np.array([[*row, *np.zeros(4 - len(row))] for row in PATTERNS]),
    blocks=np.array([len(row) for row in PATTERNS]),
    size=np.array(SIZES),
)


def polished_controls(
    horizon: Horizon, plan: RoadDecision, *, passes: int = ROUND, rounds: int = 1
) -> Array | None:
    """Controls (n, 2) of a plan to a goal that cost less; None if no move makes it cheaper.

    It is free, at the goal at the same tick, and followed by the same stop, as it was. Where a
    pass begins depends on the plan's tick, so that step after step of a drive tries other moves.

    Parameters
    ----------
    horizon : Horizon
    plan : RoadDecision
    passes : int
        Each tries one pattern in one size.
    rounds : int
        How often at most, as long as moves are found.
    """
    controls, state = np.array(plan.controls), np.array(plan.states[0])
    for k in range(rounds):
        made = _kernels_polish.polish(
            horizon, MOVES, state, controls, plan.lasting, plan.tick, plan.tick + k * passes, passes
        )
        if not made:
            return controls if k else None
    return controls

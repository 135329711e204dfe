"""Libraries and problems without terminal constraint that tests and benchmarks share."""

from __future__ import annotations

import numpy as np

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.models import Unicycle
from maneuver_automaton.receding_horizon.unconstrained import (
    FixedHorizon,
    MixedOrderCost,
    UnconstrainedProblem,
)

SPEED, TURN_RATE = 1.0, np.pi / 4  # greatest of every library [m/s, rad/s]
POSE_WEIGHTS, CONTROL_WEIGHTS = (1.0, 1.0, 0.1), (1.0, 0.1)
MIXED = MixedOrderCost(
    pose_weights=np.array(POSE_WEIGHTS), control_weights=np.array(CONTROL_WEIGHTS)
)
QUADRATIC = MixedOrderCost.quadratic(POSE_WEIGHTS, CONTROL_WEIGHTS)
PARKING = (0.0, 1.0, 0.0)


def even(count):
    """A grid of `count` speeds and as many turn rates, evenly spaced, zero among them."""
    axis = np.linspace(-1.0, 1.0, count)
    return Automaton.of_grid(Unicycle(), [SPEED * axis, TURN_RATE * axis])


def octaves(count):
    """A grid of speeds and turn rates that halve `count` - 1 times, of both signs, and zero."""
    sizes = 2.0 ** -np.arange(count)
    axis = np.concatenate([-sizes, [0.0], sizes[::-1]])
    return Automaton.of_grid(Unicycle(), [SPEED * axis, TURN_RATE * axis])


def problem_of(library, cost, *, intervals=8, interval=0.5, applied=1, goal=(0.0, 0.0, 0.0)):
    horizon = FixedHorizon(interval=interval, intervals=intervals, applied=applied)
    return UnconstrainedProblem(library, goal, cost=cost, horizon=horizon)

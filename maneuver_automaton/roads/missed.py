"""Why no goal was reached: the sample that came nearest, and which of its values were wrong."""

from __future__ import annotations

import math
from collections.abc import Sequence

from maneuver_automaton._arrays import Array
from maneuver_automaton.roads.goal_region import EXACT, GoalRegion
from maneuver_automaton.roads.vehicle import RoadVehicle

PER_RADIAN, PER_SPEED = 5.0, 1.0  # [m/rad], [s]: what counts as one metre when samples are compared


def nearest_miss(
    goals: Sequence[GoalRegion], vehicle: RoadVehicle, times: Array, states: Array
) -> str:
    """Where and how a motion came nearest to a goal, in words without a full stop.

    Parameters
    ----------
    goals : sequence of GoalRegion
    vehicle : RoadVehicle
    times : (n,) array
        [s], those at which goals are looked at.
    states : (n, 5) array
        x, y, heading of the rear axle, speed, steering at these times, seen as the goals are.

    Examples
    --------
    >>> import numpy as np
    >>> goal = GoalRegion(speed=(5.0, 8.0), time=(1.0, 2.0))
    >>> states = np.array([[0.0, 0.0, 0.0, 3.0, 0.0], [3.0, 0.0, 0.0, 4.0, 0.0]])
    >>> nearest_miss([goal], RoadVehicle(), np.array([0.0, 1.0]), states)
    'nearest to it at 1 s: 1 m/s too slow'
    """
    middles = vehicle.middle_of(states[:, :3])
    best: tuple[float, str] = (math.inf, "")
    for goal in goals:
        within = (times >= goal.time[0] - EXACT) & (times <= goal.time[1] + EXACT)
        met: list[float] = []
        for k, time in enumerate(times.tolist()):
            away, turned, faster = goal.off_by(middles[k], speed=float(states[k, 3]))
            badness = away + PER_RADIAN * turned + PER_SPEED * abs(faster)
            if badness <= 0.0:
                met.append(time)
            elif within[k] and badness < best[0]:
                best = badness, f"nearest to it at {time:.6g} s: {_off_by(away, turned, faster)}"
        if met:
            window = f"{goal.time[0]:.6g} s to {goal.time[1]:.6g} s"
            best = 0.0, f"everything but the time was right at {met[0]:.6g} s, need {window}"
    if best[1]:
        return best[1]
    return f"its time begins at {min(goal.time[0] for goal in goals):.6g} s"


def _off_by(away: float, turned: float, faster: float) -> str:
    parts = []
    if away > 0.0:
        parts.append(f"{away:.3g} m away")
    if turned > 0.0:
        parts.append(f"heading {turned:.3g} rad off")
    if faster:
        parts.append(f"{abs(faster):.3g} m/s too {'fast' if faster > 0.0 else 'slow'}")
    return ", ".join(parts)

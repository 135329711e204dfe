"""Which condition of a problem a plan breaks, whatever search has found it."""

from __future__ import annotations

from maneuver_automaton.automaton import Plan
from maneuver_automaton.problem import Problem

TIME_TOLERANCE = 1e-9  # [s] by which a time may miss a limit, and as a share of the limit
NO_TIME = 0.0  # [s] a trim that lasts no longer is not one of the word


def broken_condition(problem: Problem, plan: Plan) -> str:
    """Which condition on its word and times a plan breaks, in one line; empty if it keeps them all.

    These are the conditions that no collision check and no simulation can see: the horizon, the
    number of trims, the least time of a trim that moves, and the longest time of every trim.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Horizon, Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1, 0), "left": (0, 1)})
    >>> problem = Problem(robot, [0, 0, 0], [5, 0, 0], horizon=Horizon(max_time=4.0))
    >>> broken_condition(problem, Plan([0, 0, 0], robot.trims[:1], durations=[5.0]))
    'it takes 5 s, at most 4 s are admitted'
    """
    horizon = problem.horizon
    duration = plan.duration
    if horizon.time is not None and abs(duration - horizon.time) > _slack(horizon.time):
        return f"it takes {duration:.6g} s, {horizon.time:g} s are asked"
    if horizon.max_time is not None and duration > horizon.max_time + _slack(horizon.max_time):
        return f"it takes {duration:.6g} s, at most {horizon.max_time:g} s are admitted"
    lasting = [
        (trim, float(time))
        for trim, time in zip(plan.trims, plan.durations, strict=True)
        if time > NO_TIME
    ]
    if horizon.max_trims is not None and len(lasting) > horizon.max_trims:
        return f"it has {len(lasting)} trims, {horizon.max_trims} are admitted"
    for trim, time in lasting:
        if time < horizon.min_coast - TIME_TOLERANCE and not trim.is_rest:
            return f"trim {trim.name!r} lasts {time:.6g} s, less than {horizon.min_coast:g} s"
        if time > trim.max_duration + _slack(trim.max_duration):
            return f"trim {trim.name!r} lasts {time:.6g} s, more than {trim.max_duration:g} s"
    return ""


def _slack(limit: float) -> float:
    """By how much rounding may exceed a limit [s]."""
    return TIME_TOLERANCE * (1.0 + limit)

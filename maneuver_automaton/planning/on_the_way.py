"""When a plan passes the poses on its way, and what it is at rest for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._brief import brief
from maneuver_automaton.automaton import Plan
from maneuver_automaton.problem import Problem
from maneuver_automaton.via import MET, passages

AT_REST = 1e-9  # [m/s, rad/s] of a trim in which a vehicle stands


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Passed:
    """A pose on the way, and when a plan passes it."""

    number: int  # of the pose on the way, from 1
    time: float  # [s] on the clock of the plan
    pose: Array  # (dof,) there

    __repr__ = brief


def passed_on_the_way(problem: Problem, plan: Plan) -> tuple[Passed, ...]:
    """The poses on the way that a plan passes, in the order in which it does.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Unicycle, Via
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1, 0)})
    >>> problem = Problem(robot, [0, 0, 0], [3, 0, 0], via=Via([2, 0, 0]))
    >>> [(one.number, round(one.time, 6)) for one in passed_on_the_way(
    ...     problem, Plan([0, 0, 0], robot.trims, durations=[3.0]))]
    [(1, 2.0)]
    """
    times = _times(problem, plan)
    found = [
        Passed(number=k, time=plan.start_time + at, pose=plan.pose_at(plan.start_time + at))
        for k, at in enumerate(times, 1)
        if at is not None
    ]
    return tuple(sorted(found, key=lambda one: one.time))


def what_is_missed(problem: Problem, plan: Plan) -> str:
    """The first pose on the way that a plan misses; empty if it misses none."""
    if not problem.via:
        return ""
    missed = [k for k, at in enumerate(_times(problem, plan), 1) if at is None]
    order = " after those before it" if problem.order == "given" and missed[:1] > [1] else ""
    return f"pose {missed[0]} on the way is not passed{order}" if missed else ""


def _times(problem: Problem, plan: Plan) -> list[float | None]:
    """When [s] after its start a plan passes each pose on the way; None: it does not."""
    if not problem.via:
        return []
    places = [0, 1, *range(3, plan.start.size)]
    start, origin = np.array(plan.start), problem.via[0].place
    start[places] -= origin
    near = plan.begun_at(start, start_time=0.0)
    rests = _rests(problem, near)

    def at_rest(time: float) -> bool:
        return not problem.has_inertia or any(
            first - MET <= time <= last + MET for first, last in rests
        )

    samples = np.unique(np.concatenate([near.sample().time, near.switching_times]))
    return passages(
        [one.shifted(origin) for one in problem.via],
        samples,
        near.pose_at,
        at_rest,
        in_order=problem.order == "given",
    )


def _rests(problem: Problem, plan: Plan) -> list[tuple[float, float]]:
    """From when to when [s] a plan is in trims in which the vehicle stands, for no time too."""
    found, time, model = [], 0.0, problem.automaton.model
    for k, (trim, lasting) in enumerate(zip(plan.trims, plan.durations.tolist(), strict=True)):
        if model.reduced_names:
            velocity = model.body_velocity(trim.reduced_state, trim.control)
            still = float(np.abs(velocity).max()) <= AT_REST
        else:
            still = trim.is_rest
        if still:
            found.append((time, time + lasting))
        time += lasting
        maneuver = plan.maneuvers[k] if k < len(plan.maneuvers) else None
        time += maneuver.duration if maneuver is not None else 0.0
    return found

"""When a plan passes the poses on its way, and what it is at rest for."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._brief import brief
from maneuver_automaton.automaton import Plan
from maneuver_automaton.groups import group_of
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.via import MET, Via, instants_met, passages

AT_REST = 1e-9  # [m/s, rad/s] of a trim in which a vehicle stands


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Passed:
    """A pose on the way, and when a plan passes it."""

    number: int  # of the pose on the way, from 1
    time: float  # [s] on the clock of the plan
    pose: Array  # (dof,) there
    until: float  # [s] it was passed then, or the vehicle stood there last
    stay_left: float = 0.0  # [s] that it has still to stand there; 0: it is passed

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
    found = [
        Passed(
            number=k,
            time=plan.start_time + at,
            pose=plan.pose_at(plan.start_time + at),
            until=plan.start_time + at + via.stay_s,
        )
        for k, (via, at) in enumerate(zip(problem.via, _times(problem, plan), strict=False), 1)
        if at is not None
    ]
    return tuple(sorted(found, key=lambda one: one.time))


def going_on(
    problem: Problem, known: Sequence[Passed], motion: Plan, *, ended: Array | None = None
) -> tuple[Passed, ...]:
    """What was passed on the way by the end of a motion, where some is `known` from before it.

    A stay may be made in parts: what is left of it counts down. A motion that was to go otherwise
    is taken to have left it steadily, to where it `ended` (dof,).

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Unicycle, Via
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1, 0), "rest": (0, 0)})
    >>> problem = Problem(robot, [0, 0, 0], [3, 0, 0], via=Via([2, 0, 0], stay_s=3.0))
    >>> (one,) = going_on(problem, (), Plan([0, 0, 0], robot.trims, durations=[2.0, 1.0]))
    >>> one.time, one.until, one.stay_left
    (2.0, 3.0, 2.0)
    """
    if not problem.via:
        return ()
    seen, begin = _seen(problem, motion, ended), motion.start_time
    found = {one.number: one for one in known}
    earliest = -math.inf
    for k, via in enumerate(problem.via, 1):
        one = found.get(k)
        if one is None or one.stay_left > MET:
            since = max(earliest, -math.inf if one is None else one.until - begin)
            one = seen.passing(k, via, one, since)
        if one is not None:
            found[k] = one
        if problem.order == "given":
            if one is None or one.stay_left > MET:
                break
            earliest = one.until - begin
    return tuple(sorted(found.values(), key=lambda one: one.time))


def still_ahead(problem: Problem, passed: Sequence[Passed]) -> tuple[Via, ...]:
    """What is still to be passed on the way, stays by what is left of them."""
    left = {one.number: one.stay_left for one in passed}
    return tuple(
        replace(via, stay_s=left[k]) if k in left else via
        for k, via in enumerate(problem.via, 1)
        if left.get(k, math.inf) > MET
    )


def goal_around(via: Via) -> Goal:
    """A goal that is met wherever and however a pose on the way is passed."""
    return Goal(pose=via.pose, free_heading=via.free_heading, tolerance_m=via.radius)


def what_is_missed(problem: Problem, plan: Plan) -> str:
    """The first pose on the way that a plan misses; empty if it misses none."""
    if not problem.via:
        return ""
    missed = [k for k, at in enumerate(_times(problem, plan), 1) if at is None]
    order = " after those before it" if problem.order == "given" and missed[:1] > [1] else ""
    return f"pose {missed[0]} on the way is not passed{order}" if missed else ""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Seen:
    """A motion near an origin, where no digit is lost; its times begin with 0."""

    origin: Array
    times: Array  # [s] between which it goes on smoothly
    pose_at: Callable[[Array], Array]
    rests: list[tuple[float, float]]  # [s] from when to when it stands
    stops: list[tuple[float, float]]  # [s] from when to when it may stop for no time
    begin: float  # [s] of the world's clock

    def may_stop(self, time: float) -> bool:
        """Whether the vehicle is at rest at a time, or may be for no time."""
        return _since(self.stops, time) >= 0.0 or self.standing(time) >= 0.0

    def standing(self, time: float) -> float:
        """How long it stands from a time on [s]; less than 0 if it does not."""
        return _since(self.rests, time)

    def passing(self, number: int, via: Via, before: Passed | None, since: float) -> Passed | None:
        """How a pose on the way is passed from a time on, or what is known of it already."""
        found, near = before, via.shifted(self.origin)
        left = via.stay_s if found is None else found.stay_left
        for time in instants_met(near, self.times, self.pose_at(self.times), self.pose_at):
            if time < since - MET or (via.stop and not self.may_stop(time)):
                continue
            stood = min(max(self.standing(time), 0.0), left)
            if left > MET and stood <= MET:
                continue
            left, since = left - stood, time + stood
            pose = np.array(self.pose_at(np.array([time]))[0])
            pose[[0, 1, *range(3, pose.size)]] += self.origin
            found = Passed(
                number=number,
                time=self.begin + time if found is None else found.time,
                pose=pose,
                until=self.begin + since,
                stay_left=left if left > MET else 0.0,
            )
            if left <= MET:
                break
        return found


def _seen(problem: Problem, plan: Plan, ended: Array | None = None) -> _Seen:
    """A plan near the first pose on the way; it may have ended elsewhere."""
    places = [0, 1, *range(3, plan.start.size)]
    start, origin = np.array(plan.start), problem.via[0].place
    start[places] -= origin
    near = plan.begun_at(start, start_time=0.0)
    pose_at: Callable[[Array], Array] = near.pose_at
    if ended is not None and near.duration > 0.0:
        end = np.array(ended)
        end[places] -= origin
        group = group_of(end.size)
        off = (group(near.end).inverse() @ group(end)).log()

        def bent(times: Array) -> Array:
            shares = np.asarray(times)[..., None] / near.duration
            return np.asarray((group(near.pose_at(times)) @ group.exp(shares * off)).pose)

        pose_at = bent

    return _Seen(
        origin=origin,
        times=np.unique(np.concatenate([near.sample().time, near.switching_times])),
        pose_at=pose_at,
        rests=_rests(problem, near),
        stops=_stops(problem, near),
        begin=plan.start_time,
    )


def _times(problem: Problem, plan: Plan) -> list[float | None]:
    """When [s] after its start a plan passes each pose on the way; None: it does not."""
    if not problem.via:
        return []
    seen = _seen(problem, plan)
    return passages(
        [one.shifted(seen.origin) for one in problem.via],
        seen.times,
        seen.pose_at,
        seen.may_stop,
        in_order=problem.order == "given",
    )


def _rests(problem: Problem, plan: Plan) -> list[tuple[float, float]]:
    """From when to when [s] a plan is in trims in which the vehicle stands, for no time too."""
    found, model = list[tuple[float, float]](), problem.automaton.model
    for trim, begin, end in coasts_of(plan):
        if model.reduced_names:
            velocity = model.body_velocity(trim.reduced_state, trim.control)
            still = float(np.abs(velocity).max()) <= AT_REST
        else:
            still = trim.is_rest
        if still and found and found[-1][1] == begin:
            found[-1] = found[-1][0], end
        elif still:
            found.append((begin, end))
    return found


def _stops(problem: Problem, plan: Plan) -> list[tuple[float, float]]:
    """From when to when [s] a plan is in trims from which the vehicle switches to rest at will."""
    if not problem.has_inertia:
        return [(0.0, plan.duration)]
    model, none = problem.automaton.model, np.zeros(len(problem.automaton.model.control_names))
    low, high = model.control_limits.T
    if (low > 0.0).any() or (high < 0.0).any():
        return []
    return [
        (begin, end)
        for trim, begin, end in coasts_of(plan)
        if not model.body_velocity(trim.reduced_state, none).any()
    ]


def coasts_of(plan: Plan) -> Iterator[tuple[Trim, float, float]]:
    """The trims of a plan, and from when to when [s] each is coasted in."""
    time = 0.0
    for k, (trim, lasting) in enumerate(zip(plan.trims, plan.durations.tolist(), strict=True)):
        yield trim, time, time + lasting
        time += lasting
        maneuver = plan.maneuvers[k] if k < len(plan.maneuvers) else None
        time += maneuver.duration if maneuver is not None else 0.0


def _since(spans: list[tuple[float, float]], time: float) -> float:
    """How long a span goes on from a time on [s]; less than 0 if the time is in none."""
    ends = [last for first, last in spans if first - MET <= time <= last + MET]
    return max(max(ends) - time, 0.0) if ends else -1.0

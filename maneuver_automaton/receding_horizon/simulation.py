"""The closed loop in simulation: what was done, and how it went."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.audit import Audit, audit_plan
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.cutting import NOTHING, tail_of
from maneuver_automaton.collision import AnyObstacle, Shape
from maneuver_automaton.collision.blocked import too_close
from maneuver_automaton.groups import group_of
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.receding_horizon.candidates import within
from maneuver_automaton.receding_horizon.controller import RecedingHorizon
from maneuver_automaton.receding_horizon.disturbance import (
    Disturbance,
    as_driven,
    checked,
    draws,
)
from maneuver_automaton.receding_horizon.log import ClosedLoop, Guarantee, Step, Violation
from maneuver_automaton.receding_horizon.shifting import moves_on

Seen = Callable[[int], Sequence[AnyObstacle | Shape]]


def simulate(
    problem: Problem,
    *,
    step: float,
    steps: int = 100,
    disturbance: Disturbance | None = None,
    margin: float = 0.0,
    time_limit: float = 5.0,
    last: Step | None = None,
    first: Plan | None = None,
    stay: bool = False,
    retimed: bool = False,
    look_ahead: float = 60.0,
    stand: float = 2.0,
    obstacles: Seen | None = None,
    audit: bool = True,
    progress: Callable[[Step], None] | None = None,
) -> ClosedLoop:
    """Close the loop until the goal is reached, or `steps` steps are spent.

    Parameters
    ----------
    problem : Problem
        Its start is where the vehicle is; with tolerances, the goal is a set.
    step : float
        delta [s].
    steps : int
        At most so many.
    disturbance : Disturbance, optional
        None: the vehicle does what its model says.
    margin, time_limit, first, retimed, look_ahead, stand
        As in `RecedingHorizon`.
    last : Step, optional
        To go on from the last step of another loop; the problem's start is where that led.
    stay : bool
        Go on for all steps after the goal's set is reached, and try to stay in it.
    obstacles : callable, optional
        What the controller sees and predicts at the step of a number; if omitted, the obstacles of
        the problem. Those are what there is: what was driven is judged by them.
    audit : bool
        Have an ODE solver drive every piece again that was applied, and measure its distance to
        the obstacles of the problem.
    progress : callable, optional
        Called with every step.

    Returns
    -------
    ClosedLoop

    Raises
    ------
    ValueError
        If a number is out of range.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Cost, Horizon, Problem, Unicycle
    >>> speeds = [0.1 * k for k in range(-20, 21)]
    >>> robot = Automaton.of_controls(Unicycle(), {f"{v:.1f}": (v, 0.0) for v in speeds})
    >>> problem = Problem(
    ...     robot, [-2, 0, 0], [0, 0, 0], cost=Cost(effort=1.0), horizon=Horizon(time=1.0)
    ... )
    >>> loop = simulate(problem, step=0.1)
    >>> loop.reached, len(loop.steps), round(loop.cost, 3)
    (True, 35, 2.182)
    """
    if steps < 1:
        raise ValueError(f"steps must be at least 1, got {steps}")
    upset = Disturbance() if disturbance is None else disturbance
    upset = checked(upset, problem.start.size)
    random = draws(upset, problem.start.size)
    controller = RecedingHorizon(
        problem,
        step=step,
        margin=margin,
        time_limit=time_limit,
        last=last,
        first=first,
        hold=stay,
        retimed=retimed,
        look_ahead=look_ahead,
        stand=stand,
    )
    at_will = controller.settings.at_will
    if upset.twist_scale is not None and not at_will:
        raise ValueError(
            "receding horizon: disturbance: twist_scale is for vehicles without inertia: "
            "a maneuver is driven as its model says"
        )
    begin = 0 if last is None else last.number + 1
    for _ in range(begin):  # the numbers that the steps before have used
        next(random)
    where = np.array(problem.start)
    before, measured_late = last, where
    if last is not None and last.measured is not None:
        measured_late = last.measured
    log: list[Step] = []
    poses, times, driven, audits = [where], [_begin(problem, last)], [], []
    inside: list[bool] = [_inside(problem, where)]
    stops = controller.arrival is None and at_will  # where it likes
    stands = at_will or problem.first_trim.is_rest
    arrived = inside[-1] and (stands if last is None else _arrives(last, stops=stops))
    for number in range(begin, begin + steps):
        if arrived and not stay:
            break
        draw = next(random)
        measured = where + draw.measurement
        seen = measured
        if upset.delay and before is not None:  # what has been applied since is a group element
            seen = _after(before, measured_late)
        measured_late = measured
        _, now = controller.step(seen, obstacles=None if obstacles is None else obstacles(number))
        if upset.delay:
            now = replace(now, measured=measured)
        before = now
        log.append(now)
        stuck = not (now.deed.leads or problem.moves or obstacles is not None)
        stuck = stuck and (stops or not moves_on(now.plan))
        if stuck:
            break
        piece = replace(now.piece, start=where)
        driven.append(as_driven(piece, upset))
        if audit and piece.trims:
            audits.append(_audited(problem, piece))
            real = audits[-1] if driven[-1] is piece else _audited(problem, driven[-1])
            log[-1] = _judged(now, real)
        if progress is not None:
            progress(log[-1])
        where = np.array(driven[-1].end) + draw.noise
        if number in upset.pushes:
            group = group_of(where.size)
            push = as_array("disturbance: push", upset.pushes[number], last=where.size)
            where = np.array((group(where) @ group(push)).pose)
        poses.append(where)
        times.append(now.time + now.applied)
        inside.append(_inside(problem, where))
        arrived = inside[-1] and _arrives(now, stops=stops)
    return _closed_loop(
        problem,
        controller,
        log,
        poses,
        times,
        driven,
        audits,
        inside,
        step=step,
        reached=any(inside) if stay else arrived,
        seen=obstacles,
    )


def _closed_loop(
    problem: Problem,
    controller: RecedingHorizon,
    log: list[Step],
    poses: list[Array],
    times: list[float],
    driven: list[Plan],
    audits: list[Audit],
    inside: list[bool],
    *,
    step: float,
    reached: bool,
    seen: Seen | None,
) -> ClosedLoop:
    helpless = len(log) > len(driven)
    applied = log[:-1] if helpless else log
    cost = log[-1].accumulated_cost if helpless else _spent(controller.last)
    value, reason, status, bound = 0.0, "", "reached", controller.most_steps
    if helpless:
        value, status = log[-1].lower_bound, "no_plan"
        reason = str(log[-1].violations[-1])
    elif not inside[-1]:
        if applied:  # what would have come next
            controller.last = applied[-1]
            then = applied[-1].number + 1
            value = controller.step(poses[-1], obstacles=seen and seen(then))[1].value
            controller.last = applied[-1]
        if not reached:
            status = "steps_spent"
            reason = f"the goal is not reached after {len(applied)} steps"
    return ClosedLoop(
        problem=problem,
        step=step,
        steps=tuple(applied),
        poses=np.array(poses),
        times=np.array(times),
        reached=reached,
        status=status,
        reason=reason,
        cost=cost,
        value=value,
        driven=tuple(driven),
        audits=tuple(audits),
        inside=tuple(inside),
        steps_bound=bound,
    )


def _arrives(step: Step, *, stops: bool) -> bool:
    """Whether a vehicle that is at the goal after a step stays there, and does not drive past it.

    If it `stops` where it likes, it does so on a plan to the goal; otherwise at the end of a plan.
    """
    if stops:
        return step.deed.leads
    left = tail_of(step.plan, step.applied)
    return left.duration <= NOTHING or not moves_on(left)


def _spent(last: Step | None) -> float:
    return 0.0 if last is None else last.accumulated_cost + last.applied_cost


def _after(step: Step, start: Array) -> Array:
    """Where the piece of a step leads from `start`."""
    return np.array(replace(step.piece, start=start).end)


def _audited(problem: Problem, piece: Plan) -> Audit:
    """A piece against the model's equations and the obstacles; it need not end at the goal."""
    return audit_plan(
        piece,
        Goal(pose=piece.end),
        problem.automaton.model,
        footprint=problem.footprint,
        obstacles=problem.obstacles,
        zones=problem.zones,
    )


def _judged(now: Step, driven: Audit) -> Step:
    """The step with the clearance of what was driven; a collision is flagged."""
    clearance = driven.min_clearance_m
    if clearance is None or clearance > too_close(0.0):
        return replace(now, clearance_m=clearance)
    hit = Violation(guarantee=Guarantee.NO_COLLISION, reason=driven.reason.split("; ")[-1])
    return replace(now, clearance_m=clearance, violations=(*now.violations, hit))


def _inside(problem: Problem, pose: Array) -> bool:
    return any(within(pose, goal) for goal in problem.goals)


def _begin(problem: Problem, last: Step | None) -> float:
    return problem.start_time if last is None else last.time + last.applied

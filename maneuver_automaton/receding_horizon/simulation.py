"""The closed loop in simulation, disturbed or not."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, cast

import numpy as np

from maneuver_automaton._arrays import (
    Array,
    as_array,
    as_number,
    as_whole,
    check_fields,
    check_range,
    plain_numbers,
)
from maneuver_automaton._brief import brief
from maneuver_automaton._interrupts import patient, stopped
from maneuver_automaton.audit import Audit, audit_plan
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.cutting import NOTHING, end_state, tail_of
from maneuver_automaton.collision import AnyObstacle, Shape
from maneuver_automaton.collision.blocked import too_close
from maneuver_automaton.groups import group_of
from maneuver_automaton.models import Model
from maneuver_automaton.planning.blocked import why_goal_blocked
from maneuver_automaton.planning.on_the_way import Passed, going_on, still_ahead
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.receding_horizon.candidates import within
from maneuver_automaton.receding_horizon.controller import RecedingHorizon
from maneuver_automaton.receding_horizon.failsafe import settled
from maneuver_automaton.receding_horizon.log import ClosedLoop, Guarantee, Step, Violation
from maneuver_automaton.receding_horizon.rest_of_plan import moves_on


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Disturbance:
    """How a real vehicle departs from its plan; every random number comes from `seed`.

    Noise shifts the pose after every step, as a person's push would: the place by a normal number
    per axis, the heading by another. Measurement errors are seen by the controller alone. A push
    is a displacement in the vehicle's own frame after the step of that number. A vehicle that
    differs from its model has other body velocities: `twist_scale` times those of the library.
    `reduced_state` shifts speeds and steering angles after every step in which the vehicle moves,
    within its limits: the controller sees it, and goes on from there.
    With `delay` 1 the controller sees every pose a step late, and plans from the predicted end of
    the piece that is driven meanwhile.
    """

    position_m: float = 0.0  # standard deviation per axis and step
    heading_rad: float = 0.0  # standard deviation per step
    measured_position_m: float = 0.0  # standard deviation of the measurement
    measured_heading_rad: float = 0.0
    reduced_state: tuple[float, ...] | None = None  # (n_z,) standard deviations per step
    twist_scale: tuple[float, ...] | None = None  # (dof,) none if None
    pushes: Mapping[int, tuple[float, ...]] = field(default_factory=lambda: MappingProxyType({}))
    delay: int = 0  # steps, 0 or 1
    seed: int = 0

    __repr__ = brief

    def __post_init__(self) -> None:
        plain_numbers(self)
        sizes = ("position_m", "heading_rad", "measured_position_m", "measured_heading_rad")
        check_fields("disturbance", self, *sizes, least=0)
        if any(not (math.isfinite(one) and one >= 0.0) for one in self.reduced_state or ()):
            raise ValueError(
                f"disturbance: reduced_state must be numbers of at least 0, got "
                f"{list(self.reduced_state or ())}"
            )
        if self.reduced_state is not None and self.delay:
            raise ValueError(
                "disturbance: reduced_state is for a delay of 0, got a delay of 1 step"
            )
        if self.delay not in (0, 1):
            raise ValueError(f"disturbance: delay must be 0 or 1 steps, got {self.delay}")
        if not (isinstance(self.seed, int | np.integer) and self.seed >= 0):
            raise ValueError(
                f"disturbance: seed must be a whole number of at least 0, got {self.seed}"
            )


@dataclass(frozen=True, slots=True, eq=False)
class Draw:
    """The random numbers of one step."""

    noise: Array
    measurement: Array
    state: Array  # (n_z,) of the reduced state; empty where nothing disturbs it

    __repr__ = brief


def checked(upset: Disturbance, dof: int) -> Disturbance:
    """The disturbance, if it has as many components as the pose."""
    if upset.twist_scale is not None:
        as_array("disturbance: twist_scale", upset.twist_scale, last=dof)
    for after, push in upset.pushes.items():
        as_array(f"disturbance: push after step {after}", push, last=dof)
    return upset


def draws(upset: Disturbance, dof: int) -> Iterator[Draw]:
    """Numbers for step after step: the same for a seed, whatever the loop does with them."""
    rng = np.random.default_rng(upset.seed)
    others = np.random.default_rng((upset.seed, 1))  # so that poses are disturbed as ever
    shifts = np.array(upset.reduced_state or ())
    spread = np.full(dof, upset.position_m)
    spread[2] = upset.heading_rad
    blur = np.full(dof, upset.measured_position_m)
    blur[2] = upset.measured_heading_rad
    while True:
        numbers = rng.standard_normal((2, dof))
        shift = shifts * others.standard_normal(shifts.size)
        yield Draw(spread * numbers[0], blur * numbers[1], shift)


def shifted_state(piece: Plan, by: Array, model: Model) -> Array | None:
    """The reduced state after a piece, shifted within the limits; None where nothing disturbs it.

    A vehicle that stands stays as it is.
    """
    if not by.size or not piece.trims:
        return None
    state = end_state(piece)
    if not np.abs(model.body_velocity(state, piece.trims[-1].control)).max() > NOTHING:
        return state
    return np.clip(state + by, *model.reduced_limits.T)


def pushed(pose: Array, upset: Disturbance, *, after: int) -> Array:
    """Where the push after the step of a number leads from a pose, if there is one."""
    if after not in upset.pushes:
        return pose
    group = group_of(pose.size)
    push = as_array("disturbance: push", upset.pushes[after], last=pose.size)
    return np.array((group(pose) @ group(push)).pose)


def as_driven(piece: Plan, upset: Disturbance) -> Plan:
    """A piece of plan as the disturbed vehicle drives it."""
    if upset.twist_scale is None:
        return piece
    scale = as_array("disturbance: twist_scale", upset.twist_scale, last=piece.start.size)
    trims = tuple(replace(trim, body_velocity=trim.body_velocity * scale) for trim in piece.trims)
    return replace(piece, trims=trims)


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
    pieces: int = 0,
    gap: float | None = None,
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
        None: the vehicle moves as its model says.
    margin, time_limit, first, retimed, pieces, gap, look_ahead, stand
        As in `RecedingHorizon`.
    last : Step, optional
        To go on from the last step of another loop; the problem's start is where that led.
    stay : bool
        Go on for all steps after the goal's set is reached, and try to stay in it.
    obstacles : callable, optional
        The obstacles that the controller sees and predicts at the step of a number; if omitted,
        those of the problem. By these, which are the true ones, the driven motion is judged.
    audit : bool
        Integrate every piece again that was applied, and bound its distance to the obstacles of
        the problem.
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
    step, steps = as_number("step", step), as_whole("steps", steps)
    check_range("steps", steps, least=1)
    upset = checked(Disturbance() if disturbance is None else disturbance, problem.start.size)
    controller = RecedingHorizon(
        problem,
        step=step,
        margin=margin,
        time_limit=time_limit,
        last=last,
        first=first,
        hold=stay,
        retimed=retimed,
        pieces=pieces,
        gap=gap,
        look_ahead=look_ahead,
        stand=stand,
    )
    stops_at_will = not problem.has_inertia
    if upset.twist_scale is not None and not stops_at_will:
        raise ValueError(
            "receding horizon: disturbance: twist_scale is for vehicles without inertia: "
            "a maneuver is driven as its model says"
        )
    names = problem.automaton.model.reduced_names
    if upset.reduced_state is not None and len(upset.reduced_state) != len(names):
        raise ValueError(
            f"disturbance: reduced_state has {len(upset.reduced_state)} numbers, need {len(names)} "
            f"for the {problem.automaton.model.name}: {', '.join(names) or 'it has no such state'}"
        )
    _check_met(problem, upset)
    begin = 0 if last is None else last.number + 1
    random = itertools.islice(draws(upset, problem.start.size), begin, None)  # after those used
    where = np.array(problem.start)
    track = _Track(
        problem=problem,
        upset=upset,
        last=last,
        measured=where if last is None or last.measured is None else last.measured,
        poses=[where],
        times=[problem.start_time if last is None else last.time + last.applied],
        inside=[],
        passed=() if last is None else last.passed,
    )
    track.inside.append(track.is_inside)
    stops = controller.arrival is None and stops_at_will  # where it likes
    arrived = track.inside[-1] and (
        _arrives(last, stops=stops)
        if last is not None  # within a maneuver, maybe, where there is no first trim
        else stops_at_will or problem.first_trim.is_rest
    )
    with patient():
        for number in range(begin, begin + steps):
            if stopped() or (arrived and not stay):
                break
            draw = next(random)
            measured = track.poses[-1] + draw.measurement
            there = None if obstacles is None else obstacles(number)
            _, now = controller.step(
                track.seen(measured), track.state, obstacles=there, passed=track.passed
            )
            if stopped():  # the search of this step was cut short: it never was
                controller.last = track.log[-1] if track.log else last
                break
            track.log.append(replace(now, measured=measured) if upset.delay else now)
            stuck = not (now.decision.leads or problem.moves or obstacles is not None)
            if stuck and (stops or not moves_on(now.plan)):
                break
            track.drive(audit=audit)
            if progress is not None:
                progress(track.log[-1])
            track.arrive(draw)
            arrived = track.inside[-1] and _arrives(now, stops=stops)
    reached = any(track.inside) if stay else arrived
    return _closed_loop(track, controller, step=step, reached=reached, seen=obstacles)


@dataclass(slots=True, kw_only=True)
class _Track:
    """The vehicle along the loop; `poses`, `times` and `inside` have one entry more than steps."""

    problem: Problem
    upset: Disturbance
    last: Step | None  # of the loop before
    measured: Array  # at the step before
    poses: list[Array]
    times: list[float]
    inside: list[bool]  # whether a pose is within a goal's tolerance, with nothing left on the way
    passed: tuple[Passed, ...]  # on the way, and the stays begun there
    state: Array | None = None  # the reduced state, where it is disturbed
    log: list[Step] = field(default_factory=list)
    driven: list[Plan] = field(default_factory=list)
    audits: list[Audit] = field(default_factory=list)

    @property
    def is_inside(self) -> bool:
        """Whether the vehicle has arrived, with nothing left on the way."""
        near = any(within(self.poses[-1], goal) for goal in self.problem.goals)
        return near and not still_ahead(self.problem, self.passed)

    def seen(self, measured: Array) -> Array:
        """The pose for the controller: the one measured, or the one predicted from the last."""
        late, self.measured = self.measured, measured
        before = self.log[-1] if self.log else self.last
        if self.upset.delay and before is not None:  # the piece applied since is a group element
            return np.array(replace(before.piece, start=late).end)
        return measured

    def drive(self, *, audit: bool) -> None:
        """Drive the piece of the last step with its disturbance; have it audited."""
        now = self.log[-1]
        piece = replace(now.piece, start=self.poses[-1])
        self.driven.append(as_driven(piece, self.upset))
        if audit and piece.trims:
            self.audits.append(_audited(self.problem, piece))
            same = self.driven[-1] is piece
            scale = self.upset.twist_scale
            real = self.audits[-1] if same else _audited(self.problem, self.driven[-1], scale)
            self.log[-1] = _judged(self.problem, now, real)
        self.passed = going_on(self.problem, self.passed, self.driven[-1])
        self.log[-1] = replace(self.log[-1], passed=self.passed)

    def arrive(self, draw: Draw) -> None:
        """Note pose and state after the last step: the end of its piece, with noise and pushes."""
        now = self.log[-1]
        where = pushed(np.array(self.driven[-1].end) + draw.noise, self.upset, after=now.number)
        self.state = shifted_state(self.driven[-1], draw.state, self.problem.automaton.model)
        self.poses.append(where)
        self.times.append(now.time + now.applied)
        self.inside.append(self.is_inside)


def _check_met(problem: Problem, upset: Disturbance) -> None:
    """Raise ValueError where a disturbance lets no vehicle meet what is on the way."""
    blurred = upset.measured_position_m or upset.measured_heading_rad or upset.twist_scale
    late = upset.delay and (upset.position_m or upset.heading_rad or upset.pushes)
    for k, via in enumerate(problem.via, 1):
        if (blurred or late) and not (
            via.free_heading and (via.tolerance_m or via.gate is not None)
        ):
            raise ValueError(
                f"via {k}: a vehicle that is measured late or wrongly, or differs from its model, "
                "meets no pose exactly; need free_heading, and tolerance_m above 0 or a gate"
            )


def _closed_loop(
    track: _Track, controller: RecedingHorizon, *, step: float, reached: bool, seen: Seen | None
) -> ClosedLoop:
    log, driven, inside = track.log, track.driven, track.inside
    helpless = len(log) > len(driven)
    applied = log[:-1] if helpless else log
    last, cost = controller.last, 0.0
    if last is not None:
        cost = last.accumulated_cost + (0.0 if helpless else last.applied_cost)
    value, reason, status, bound = 0.0, "", "reached", controller.most_steps
    if helpless:
        value, status = log[-1].lower_bound, "no_plan"
        reason = str((*log[-1].violations, *log[-1].disturbed)[-1])
    elif not inside[-1]:
        if applied and stopped():  # what the plan of the last step has left
            value = max(applied[-1].value - applied[-1].applied_cost, 0.0)
        elif applied:  # the value of the step that would have come next
            controller.last = applied[-1]
            then = applied[-1].number + 1
            now = controller.step(
                track.poses[-1], track.state, obstacles=seen and seen(then), passed=track.passed
            )[1]
            value = now.value
            controller.last = applied[-1]
        if not reached:
            status = "steps_spent"
            reason = f"the goal is not reached after {len(applied)} steps"
            left = len(still_ahead(track.problem, track.passed))
            reason += f", with {left} of {len(track.problem.via)} left on the way" if left else ""
            reason += ", when the loop was interrupted" if stopped() else ""
    there = settled(replace(controller.problem, start_time=track.times[-1]))
    blocked = [] if reached else [why_goal_blocked(there, goal) for goal in there.goals]
    if blocked and all(blocked):
        reason = f"the goal is blocked: {blocked[0]}{f'; {reason}' if applied else ''}"
    return ClosedLoop(
        problem=track.problem,
        step=step,
        steps=tuple(applied),
        poses=np.array(track.poses),
        times=np.array(track.times),
        reached=reached,
        status=status,
        reason=reason,
        cost=cost,
        value=value,
        driven=tuple(driven),
        audits=tuple(track.audits),
        inside=tuple(inside),
        steps_bound=bound,
    )


def _arrives(step: Step, *, stops: bool) -> bool:
    """Whether a vehicle that is at the goal after a step stays there, not driving past."""
    if stops:
        return step.decision.leads
    left = tail_of(step.plan, step.applied)
    return left.duration <= NOTHING or not moves_on(left)


class _Scaled:
    """A model whose vehicle moves at other velocities than it says."""

    def __init__(self, model: Model, scale: tuple[float, ...]) -> None:
        self.model, self.scale = model, np.array(scale)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.model, name)

    def body_velocity(self, reduced_state: Array, control: Array) -> Array:
        return np.asarray(self.model.body_velocity(reduced_state, control) * self.scale)


def _audited(problem: Problem, piece: Plan, scale: tuple[float, ...] | None = None) -> Audit:
    """A piece against the model's equations and the obstacles; it need not end at the goal."""
    model = problem.automaton.model
    return audit_plan(
        piece,
        Goal(pose=piece.end),
        cast("Model", _Scaled(model, scale)) if scale else model,
        footprint=problem.footprint,
        parts=problem.parts,
        obstacles=problem.obstacles,
        body_height=problem.body_height,
        zones=problem.zones,
    )


def _judged(problem: Problem, now: Step, driven: Audit) -> Step:
    """The step with the clearance of the driven motion; a collision is flagged."""
    # It is a disturbance's where the motion that was decided on is free.
    now = replace(now, clearance_m=driven.min_clearance_m)
    if _is_clear(driven):
        return now
    hit = Violation(guarantee=Guarantee.NO_COLLISION, reason=driven.reason.split("; ")[-1])
    if _is_clear(_audited(problem, now.piece)):
        return replace(now, disturbed=(*now.disturbed, hit))
    return replace(now, violations=(*now.violations, hit))


def _is_clear(driven: Audit) -> bool:
    return driven.min_clearance_m is None or driven.min_clearance_m > too_close(0.0)

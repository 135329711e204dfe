"""Independent check of a finished plan: an ODE solver drives it again, step by step.

Nothing of the search is used: no group formula, no trim, no closed form. The model's equations
are integrated under the plan's controls, and every pose of the plan is compared with them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton._arrays import Array, wrapped
from maneuver_automaton.automaton import Plan
from maneuver_automaton.models import Model, rollout
from maneuver_automaton.problem import Goal

DEFECT_TOLERANCE = 1e-7  # [m, rad] between plan and ODE solver, per metre, radian, second driven
TERMINAL_TOLERANCE = 1e-9  # [m, rad] of the last pose, beyond the goal's own tolerance


@dataclass(frozen=True, slots=True, kw_only=True)
class TerminalError:
    """Distance to the goal, and absolute heading difference modulo a full turn."""

    position_m: float
    heading_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Audit:
    """What the audit of one plan found."""

    passed: bool
    max_dynamics_defect: float  # [m, rad, model's units] worst difference to the ODE solver
    min_clearance_m: float | None
    terminal_position_m: float
    terminal_heading_rad: float
    reason: str = ""


def terminal_error(plan: Plan, goal: Goal) -> TerminalError:
    """How far a plan's last pose is from a goal, computed from the goal's place.

    Examples
    --------
    >>> terminal_error(Plan([1.0, 0.0, 0.0], (), durations=[]), Goal(pose=[1.0, 2.0, 0.0]))
    TerminalError(position_m=2.0, heading_rad=0.0)
    """
    return _distance(_seen_from(plan, goal).end, goal)


def audit_plan(plan: Plan, goal: Goal, model: Model) -> Audit:
    """Drive a finished plan again with an ODE solver, and compare every sample.

    Parameters
    ----------
    plan : Plan
        What is about to be returned.
    goal : Goal
        Where it must end, to within its tolerance.
    model : Model
        The vehicle's equations; they alone are used.

    Returns
    -------
    Audit
        ``passed`` if no sample is further than 1e-7 (relative to the way driven) from the solver's,
        and the last pose within 1e-9 of the goal.
    """
    near = _seen_from(plan, goal)
    defect = 0.0
    state = np.concatenate([near.start, near.trims[0].reduced_state if near.trims else []])
    for k, trim in enumerate(near.trims):
        begin, end = near.switching_times[k], near.switching_times[k + 1]
        if not end - begin > 1e-12:  # too short for the solver to take a step
            continue
        times = np.linspace(begin, end, _samples(trim.body_velocity, near.durations[k]))
        driven = rollout(model, state, control=trim.control, times=times, rtol=1e-11, atol=1e-12)
        poses = near.pose_at(times).copy()
        poses[-1] = near.switching_poses[k + 1]
        dof = poses.shape[1]
        defect = max(defect, float(np.abs(driven[:, :dof] - poses).max()))
        if driven.shape[1] > dof:
            defect = max(defect, float(np.abs(driven[:, dof:] - trim.reduced_state).max()))
        state = driven[-1]
    scale = 1.0 + near.duration + float(np.abs(near.switching_poses).max())
    missed = _distance(near.end, goal)
    reasons = []
    if not defect <= DEFECT_TOLERANCE * scale:
        reasons.append(f"the plan is {defect:.3g} off the model's equations")
    if not missed.position_m <= goal.tolerance_m + TERMINAL_TOLERANCE:
        reasons.append(f"it ends {missed.position_m:.3g} m from the goal")
    if not (goal.free_heading or missed.heading_rad <= goal.tolerance_rad + TERMINAL_TOLERANCE):
        reasons.append(f"its last heading is {missed.heading_rad:.3g} rad off")
    return Audit(
        passed=not reasons,
        max_dynamics_defect=defect,
        min_clearance_m=None,
        terminal_position_m=missed.position_m,
        terminal_heading_rad=missed.heading_rad,
        reason="; ".join(reasons),
    )


def _seen_from(plan: Plan, goal: Goal) -> Plan:
    """The plan with the goal's place as origin and from time 0: no digit is lost."""
    start = np.array(plan.start)
    places = [0, 1, *range(3, start.size)]
    start[places] -= goal.pose[places]
    return replace(plan, start=start, start_time=0.0)


def _distance(end: Array, goal: Goal) -> TerminalError:
    places = [0, 1, *range(3, end.size)]
    heading = 0.0 if goal.free_heading else float(abs(wrapped(end[2] - goal.pose[2])))
    return TerminalError(
        position_m=float(np.linalg.norm(end[places])),
        heading_rad=heading,
    )


def _samples(body_velocity: Array, duration: float) -> int:
    """Samples of one trim: every radian and every metre, two at least, a hundred at most."""
    way = float(np.linalg.norm(body_velocity)) * duration
    return 2 + min(98, int(np.ceil(way)))

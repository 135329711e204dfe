"""Findings of an audit, and how far a plan ends from its goal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from maneuver_automaton._arrays import Array, wrapped
from maneuver_automaton._kept import kept_by_first
from maneuver_automaton.automaton import Plan
from maneuver_automaton.problem import Goal


@dataclass(frozen=True, slots=True, kw_only=True)
class TerminalError:
    """Distance to the goal, and absolute heading difference modulo a full turn."""

    position_m: float
    heading_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Audit:
    """Findings of the audit of one plan."""

    passed: bool
    max_dynamics_defect: float  # [m, rad, model's units] to where the controls lead
    min_clearance_m: float | None  # guaranteed: never more than the true one
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
    return distance_to(seen_from(plan, goal).end, goal)


@kept_by_first
def seen_from(plan: Plan, goal: Goal) -> Plan:
    """The plan with the goal's place as origin and from time 0: no digit is lost."""
    start = np.array(plan.start)
    places = [0, 1, *range(3, start.size)]
    start[places] -= goal.pose[places]
    return plan.begun_at(start, start_time=0.0)


def distance_to(end: Array, goal: Goal) -> TerminalError:
    """How far a pose (dof,), counted from the goal's place, is from the goal."""
    places = [0, 1, *range(3, end.size)]
    heading = 0.0 if goal.free_heading else float(abs(wrapped(end[2] - goal.pose[2])))
    return TerminalError(
        position_m=float(np.linalg.norm(end[places])),
        heading_rad=heading,
    )

"""Collision mitigation: where no motion is free, the one whose first contact is latest."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton.automaton import Plan
from maneuver_automaton.planning.tracking import clearance_at, free_until, stands_free
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Problem
from maneuver_automaton.receding_horizon.candidates import allowed
from maneuver_automaton.receding_horizon.log import first_part
from maneuver_automaton.receding_horizon.shifting import followed_by

SHARES = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)  # of a step, after which a motion may stop
SAMPLES = 64  # at which the clearance is looked at
ALIKE = 1e-3  # [s] between contacts that come at the same time


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Mitigation:
    """A motion that is hit, or comes closer than it should."""

    plan: Plan
    contact: float  # [s] of the world's clock, when it is hit first; the time asked for if never
    clearance: float  # [m] least one until then, as far as looked for; inf if not measured
    reason: str  # the predicted contact


def mitigate(
    here: Problem, *, step: float, until: float, known: tuple[Plan, ...] = ()
) -> Mitigation:
    """The motion whose first contact is latest; of those alike, the one with most clearance.

    Tried are to stand still, the `known` plans, these stopped at several moments, and every trim of
    the library held for several moments and then stopped; a vehicle that cannot stop goes on with
    its last trim.

    Parameters
    ----------
    here : Problem
        Its margin does not count: contact alone does.
    step : float
        [s] of the loop.
    until : float
        [s] of the world's clock that is looked at.
    known : tuple of Plan
        From the problem's start, at its time.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Disc, Motion, Obstacle, Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"rest": (0, 0), "back": (-0.5, 0)})
    >>> chasing = Obstacle(Disc(1.0), motion=Motion([0, 9], [[4, 0, 0], [-5, 0, 0]]))
    >>> problem = Problem(robot, [0, 0, 0], [9, 9, 0], obstacles=chasing)
    >>> found = mitigate(problem, step=1.0, until=8.0)
    >>> found.plan.word[0], 5.9 < found.contact <= 6.0
    ('back', True)
    """
    bare = replace(here, margin=0.0)
    length = until - here.start_time
    tried = [_contact(bare, plan, until) for plan in _motions(bare, step, length, known)]
    latest = max(one.contact for one in tried)
    alike = [one for one in tried if one.contact >= latest - ALIKE]
    return max(alike, key=lambda one: one.clearance)


def _motions(here: Problem, step: float, length: float, known: tuple[Plan, ...]) -> Iterator[Plan]:
    """All that is tried, as long as is looked at."""
    trims = here.automaton.trims
    rests = [trim for trim in trims if trim.is_rest]
    at, start = here.start_time, here.start
    yield Plan(start, rests[:1], durations=[length] * len(rests[:1]), start_time=at)
    moving = [Plan(start, (trim,), durations=[length], start_time=at) for trim in trims]
    for plan in (*known, *moving):
        moments = [share * step for share in SHARES] if rests else []
        for after in (length, *moments):
            stopped = _stopped(plan, after, length, rests)
            if allowed(here, stopped):
                yield stopped


def _stopped(plan: Plan, after: float, length: float, rests: list[Trim]) -> Plan:
    """The beginning of a plan, then rest; without one its last trim goes on."""
    begun = first_part(plan, min(after, length))
    left = length - begun.duration
    if left <= 0.0 or not begun.trims:
        return begun
    last = rests[0] if rests else begun.trims[-1]
    return followed_by(
        begun, Plan(begun.end, (last,), durations=[left], start_time=plan.start_time)
    )


def _contact(here: Problem, plan: Plan, until: float) -> Mitigation:
    free = free_until(here, plan)
    contact = plan.start_time + free
    if free >= plan.duration and contact < until:
        contact += stands_free(here, plan.end, time=contact, duration=until - contact)
    times = np.linspace(plan.start_time, contact, SAMPLES)
    clearance = float(clearance_at(here, plan.pose_at(times), times).min())
    said = (
        f"contact is predicted at {contact:.6g} s"
        if contact < until
        else f"the clearance is predicted to fall to {clearance:.3g} m"
    )
    reason = f"no motion is free until {until:.6g} s; {said}"
    return Mitigation(plan=plan, contact=contact, clearance=clearance, reason=reason)

"""What vehicles ask for in a step, and who answers."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

import numpy as np

from maneuver_automaton.fleet.asking import Answer, Past, Question, answered
from maneuver_automaton.fleet.held import is_over
from maneuver_automaton.fleet.moment import Moment, Other
from maneuver_automaton.fleet.vehicle import QUICK, Found
from maneuver_automaton.receding_horizon.candidates import within

MANY = 40  # others that a search looks at; all that are proven
AWAY = 0.5  # of its way, from which on others are not looked at if there are many


def search(
    now: Moment, k: int, base: Found, others: Collection[Other], known: float, *, most: int = QUICK
) -> Answer:
    """Another plan past the others, and the way alone; None for what does not cost less."""
    (answer,) = answers_to(now, [question_of(now, k, base, others, known, most=most)])
    return answer


def question_of(
    now: Moment,
    k: int,
    base: Found,
    others: Collection[Other],
    known: float,
    *,
    most: int = QUICK,
    room: bool = True,
) -> Question:
    """What a vehicle is asked for; without room at its goal, noise may lead it out there."""
    settings = now.state.settings
    goals = now.vehicles[k].problem.goals
    if is_over(base, now.time) and any(within(base.plan.end, goal) for goal in goals):
        base = now.from_here(k)  # its plan says it is there, but it was measured elsewhere
    return Question(
        number=k,
        base=base,
        time=now.time,
        after=0.0 if k in now.void else settings.delay_steps * settings.step,
        others=tuple(Past(j, one, now.keep_of(k, j)) for j, one in _seen(now, k, base, others)),
        between=now.keep,
        known=known,
        most=most,
        tube_m=settings.tube_m if room else 0.0,
        keep=now.near.get(k, math.inf),
    )


def _seen(now: Moment, k: int, base: Found, others: Collection[Other]) -> Collection[Other]:
    """Of many others those that may come nearest to where a vehicle is, drives and wants to go.

    A plan that is found past these alone is proven past all.
    """
    if len(others) <= MANY:
        return others
    courses = [one.course for _, one in others]
    low, high = np.split(now.nearby.box_of(base.course), 2)
    for goal in now.vehicles[k].problem.goals:
        low, high = np.minimum(low, goal.pose[:2]), np.maximum(high, goal.pose[:2])
    gaps = now.nearby.gaps(np.concatenate([low, high]), courses)
    nearest_first = np.argsort(gaps, kind="stable")[:MANY].tolist()
    rows = list(others)
    return [rows[n] for n in sorted(nearest_first) if gaps[n] <= AWAY * (high - low).max()]


def answers_to(now: Moment, questions: Sequence[Question]) -> list[Answer]:
    """The answers to questions: of workers, or else found here."""
    if now.state.workers is None:
        return [
            answered(now.vehicles[one.number], one, now.searches, now.left_of) for one in questions
        ]
    asked = [one for one in questions if one.number not in now.state.silent]
    found = dict(zip(map(id, asked), now.state.workers.ask(asked, now.searches), strict=True))
    now.state.silent |= {one.number for one in asked if found[id(one)] is None}
    return [found.get(id(one)) or Answer(None, None) for one in questions]

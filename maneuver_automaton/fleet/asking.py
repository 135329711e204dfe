"""Who looks for a vehicle's better plan: this process, or a worker of its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

from maneuver_automaton._brief import brief
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision.shapes import Obstacle
from maneuver_automaton.fleet.conflicts import Course
from maneuver_automaton.fleet.held import proposal
from maneuver_automaton.fleet.vehicle import Found, Vehicle


class Past(NamedTuple):
    """A plan that another vehicle may drive, and what has to be kept from it [m]."""

    number: int
    found: Found
    keep: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Question:
    """What a vehicle is asked for: a plan past what the others may drive, below a cost."""

    number: int
    base: Found  # what it drives
    time: float  # [s]
    after: float  # [s] that it drives on with it
    others: tuple[Past, ...]
    between: float  # [m] that any two vehicles keep
    known: float  # what it must cost less than
    most: int  # expansions
    tube_m: float  # that the vehicle may be beside its plan
    keep: float  # [m] from obstacles, if that is less than its margin

    __repr__ = brief


class Answer(NamedTuple):
    """A plan past the others, and the way alone; None for what does not cost less."""

    found: Found | None
    alone: Found | None


class Workers(Protocol):
    """Those that look for plans, each for its vehicles; `ask` says what has come of it."""

    def ask(self, questions: Sequence[Question], budget: Budget) -> list[Answer | None]:
        """The answers in order; None from who does not answer any more."""

    @property
    def counts(self) -> dict[str, int]:
        """Messages and bytes so far, by name."""


def answered(
    vehicle: Vehicle, question: Question, budget: Budget, left_of: Callable[[Found], Course]
) -> Answer:
    """The answer of a vehicle; `left_of` says what is left of a plan's course."""
    seen: list[Obstacle] = []
    keep = question.keep
    for _, one, own in question.others:
        course = left_of(one)
        if own < question.between:  # it is seen smaller, so that there is a way out
            keep = min(keep, own)
            grown = max(course.grown - (question.between - own), 0.0)
            course = replace(course, grown=grown)
        seen += course.obstacles
    found, alone = proposal(
        vehicle,
        question.base,
        time=question.time,
        after=question.after,
        others=seen,
        budget=budget,
        known=question.known,
        most=question.most,
        tube_m=question.tube_m,
        keep=keep,
    )
    return Answer(found, alone)

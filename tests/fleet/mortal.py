"""Workers that die, in this process."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from maneuver_automaton.budget import Budget
from maneuver_automaton.fleet import FleetProblem
from maneuver_automaton.fleet.vehicle import vehicles_of
from maneuver_automaton.fleet.workers import PlanRequest, Proposal, answered


class Mortal:
    """Answers in this process, until a vehicle's worker dies at a time [s]."""

    def __init__(self, fleet: FleetProblem, dies: Mapping[int, float]) -> None:
        self.vehicles, self.dies = vehicles_of(fleet), dies
        self.counts = {"questions": 0}

    def ask(self, questions: Sequence[PlanRequest], budget: Budget) -> list[Proposal | None]:
        self.counts["questions"] += len(questions)
        return [
            None
            if one.terms.time >= self.dies.get(one.number, math.inf)
            else answered(
                self.vehicles[one.number],
                one,
                budget,
                lambda f, at=one.terms.time: f.course.after(at),
            )
            for one in questions
        ]

"""Features of what a plan costs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from maneuver_automaton.automaton import Plan
from maneuver_automaton.costs import Cost, StageCost
from maneuver_automaton.planning import PlanResult
from tests.matrix import outside
from tests.matrix.measuring import SAMPLED, asked, close, cost_of, found, no_dearer
from tests.matrix.outside import Course
from tests.matrix.rows import PACKAGE, Engine, feature, without
from tests.matrix.scenes import base, passing, pillar
from tests.matrix.vehicles import Vehicle


def _cheapest(vehicle: Vehicle, engine: Engine, cost: Cost, **changes: object) -> PlanResult:
    """A plan at a cost is no costlier than the quickest one, priced so."""
    result = asked(vehicle, engine, cost=cost, **changes)
    quick = cost_of(cost, found(base(vehicle)))
    no_dearer(result, quick, "the quickest plan", share=SAMPLED)
    return result


@feature(without("cost"), says="cost: ")
def effort(vehicle: Vehicle, engine: Engine) -> None:
    _ = _cheapest(vehicle, engine, Cost(effort=1.0, time=0.1))


@feature(without("cost"), says="cost: ")
def length(vehicle: Vehicle, engine: Engine) -> None:
    _ = _cheapest(vehicle, engine, Cost(length=1.0, time=0.01))


@feature(without("cost"), says="cost: ")
def norm(vehicle: Vehicle, engine: Engine) -> None:
    _ = _cheapest(vehicle, engine, Cost(norm=1.0, time=0.1))


@feature(without("cost"), says="cost: ")
def switch_price(vehicle: Vehicle, engine: Engine) -> None:
    _ = _cheapest(vehicle, engine, Cost(time=1.0, switch=0.05 * base(vehicle).cost))


@feature(without("cost"), says="cost: ")
def dear_switch(vehicle: Vehicle, engine: Engine) -> None:
    _ = _cheapest(vehicle, engine, Cost(time=1.0, switch=3.0 * base(vehicle).cost))


@feature(without("cost"), says="cost: ")
def dear_switch_among_obstacles(vehicle: Vehicle, engine: Engine) -> None:
    cost = Cost(time=1.0, switch=3.0 * base(vehicle).cost)
    result = asked(vehicle, engine, cost=cost, obstacles=[pillar(vehicle)])
    no_dearer(result, cost_of(cost, found(passing(vehicle))), "the quickest plan", share=SAMPLED)


@feature(without("cost"), on="car", applies=lambda vehicle: vehicle.reverses, says="cost: ")
def direction_price(vehicle: Vehicle, engine: Engine) -> None:
    """To the side, where a vehicle that drives back and forth changes its direction."""
    pose = np.zeros(len(vehicle.goal))
    pose[:2] = 0.1 * vehicle.reach, 0.3 * vehicle.reach
    goal = vehicle.target(pose=pose)
    quick = asked(vehicle, PACKAGE, goals=goal)
    cost = Cost(time=1.0, direction_change=0.3 * quick.cost)
    result = asked(vehicle, engine, goals=goal, cost=cost)
    no_dearer(result, cost_of(cost, quick.plan), "the quickest plan", share=SAMPLED)


@dataclass(frozen=True)
class Calm:
    """A user's cost: time, and what is turned [1/rad]; it knows nothing of controls."""

    turning: float

    def rates(self, controls: np.ndarray, body_velocities: np.ndarray) -> np.ndarray:
        del controls
        return 1.0 + self.turning * np.abs(outside.flat(body_velocities)[..., 2])

    def switching(self, body_velocities: np.ndarray) -> float:
        del body_velocities
        return 0.0

    def of(self, motion: Plan) -> float:
        course = fine_turns(motion)
        return course.duration + self.turning * float(np.abs(np.diff(course.flat[:, 2])).sum())


def fine_turns(motion: Plan) -> Course:
    return Course.of(motion, step_rad=0.002)


@feature(without("cost"), says="cost: ")
def stage_cost(vehicle: Vehicle, engine: Engine) -> None:
    """A user's own cost is what the plan costs, and it is no costlier than the quickest plan."""
    cost: StageCost = Calm(0.3 * base(vehicle).cost)
    assert isinstance(cost, Calm)
    result = asked(vehicle, engine, cost=cost)
    close(cost.of(found(result)), result.cost, "cost", share=5e-3)
    no_dearer(result, cost.of(found(base(vehicle))), "the quickest plan", share=5e-3)

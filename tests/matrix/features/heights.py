"""The feature of obstacles that reach from one height to another."""

from __future__ import annotations

from dataclasses import replace

from maneuver_automaton.collision import Obstacle
from maneuver_automaton.problem import Problem
from tests.matrix.measuring import asked, no_dearer
from tests.matrix.rows import Engine, changed, feature
from tests.matrix.scenes import base, midway, pillar
from tests.matrix.vehicles import Vehicle


def _tall(problem: Problem) -> Problem:
    solid = [replace(one, height=None) for one in problem.obstacles]  # type: ignore[type-var]
    return replace(problem, obstacles=solid)


@feature(
    changed(_tall),
    says="the plan without the bridge costs",
    on="helicopter",
    applies=lambda vehicle: vehicle.flies,
)
def heights(vehicle: Vehicle, engine: Engine) -> None:
    """It flies on under a bridge; what hangs lower it avoids."""
    height, disc = float(midway(vehicle)[3]), pillar(vehicle)
    body = (-0.5, 0.5)
    over = Obstacle(disc, height=(height + 2.0, height + 3.0))
    under = asked(vehicle, engine, obstacles=[over], body_height=body)
    no_dearer(under, base(vehicle).cost, "the plan without the bridge", share=1e-3)
    low = Obstacle(disc, height=(height + 0.2, height + 3.0))
    _ = asked(vehicle, engine, obstacles=[low], body_height=body)

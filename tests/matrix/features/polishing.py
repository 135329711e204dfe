"""The feature of motions that are polished beyond the library."""

from __future__ import annotations

from typing import Any
from unittest.mock import patch

from maneuver_automaton.collision import AnyObstacle
from maneuver_automaton.planning import PlanResult, plan
from maneuver_automaton.problem import Problem
from tests.matrix.measuring import TIME_LIMIT, Nothing, asked, found_cost, no_dearer
from tests.matrix.rows import Engine, feature
from tests.matrix.scenes import crossing, pillar
from tests.matrix.vehicles import Vehicle


def _unpolished(problem: Problem, **options: Any) -> PlanResult:
    """A planner that leaves what it finds as it is."""
    with patch("maneuver_automaton.planning.polishing.Polish.polish", lambda *_, **__: None):
        return plan(problem, **options)


@feature(
    Engine(plan=_unpolished),
    on="second_order_unicycle",
    applies=lambda vehicle: vehicle.inertia,
    says="nothing was polished",
)
def polishing(vehicle: Vehicle, engine: Engine) -> None:
    """A motion that the library does not have, cheaper than what it has."""
    _polished_past(vehicle, engine, pillar(vehicle))


@feature(
    Engine(plan=_unpolished),
    on="second_order_unicycle",
    applies=lambda vehicle: vehicle.inertia,
    says="nothing was polished",
)
def polishing_past_movers(vehicle: Vehicle, engine: Engine) -> None:
    """The same where something crosses its way."""
    _polished_past(vehicle, engine, crossing(vehicle))


def _polished_past(vehicle: Vehicle, engine: Engine, obstacle: AnyObstacle) -> None:
    result = asked(vehicle, engine, obstacles=[obstacle])
    known = {maneuver.name for maneuver in vehicle.automaton.maneuvers}
    own = [one for one in result.plan.maneuvers if one is not None and one.name not in known]
    if not own:
        raise Nothing("nothing was polished")
    plain = _unpolished(vehicle.problem(obstacles=[obstacle]), time_limit=TIME_LIMIT)
    no_dearer(result, found_cost(plain) * 0.999, "the plan before it was polished")

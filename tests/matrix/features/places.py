"""Features of what places cost: what is near, and what it drives over."""

from __future__ import annotations

from maneuver_automaton.collision import Box
from maneuver_automaton.places import Clearance, Ground
from maneuver_automaton.planning import plan
from maneuver_automaton.problem import SearchSettings
from tests.matrix.features.closed_loops import driven
from tests.matrix.measuring import (
    SAMPLED,
    asked,
    close,
    cost_of,
    found,
    no_dearer,
    price_of_places,
)
from tests.matrix.rows import Engine, feature, without
from tests.matrix.scenes import base, heading_midway, midway, passing, pillar
from tests.matrix.vehicles import Vehicle


def _near(vehicle: Vehicle) -> Clearance:
    """As dear, one body from what is near, as half of the time that the way takes anyway."""
    return Clearance(weight=2.0 / vehicle.fastest, within=2.0 * vehicle.size)


@feature(without("place_costs"), says="cost: ")
def clearance(vehicle: Vehicle, engine: Engine) -> None:
    """What it costs is seen along the plan, and less than what the quickest plan past it costs."""
    problem = vehicle.problem(obstacles=[pillar(vehicle)], place_costs=_near(vehicle))
    result = asked(vehicle, engine, obstacles=[pillar(vehicle)], place_costs=_near(vehicle))
    quick = found(passing(vehicle))
    near, nearer = (price_of_places(vehicle, problem, one) for one in (result.plan, quick))
    no_dearer(result, cost_of(problem.cost, quick) + nearer, "the quickest plan", share=SAMPLED)
    assert near <= nearer + SAMPLED * result.cost, f"{near:.6g} for what is near, {nearer:.6g}"


@feature(without("place_costs"), says="cost: ")
def ground(vehicle: Vehicle, engine: Engine) -> None:
    """The same for an area that lies across the way."""
    size = [0.2 * vehicle.reach, 0.5 * vehicle.reach]
    area = Box(size, midway(vehicle)[:2], heading_midway(vehicle))
    dear = Ground(area, 3.0 / vehicle.fastest)
    problem = vehicle.problem(place_costs=dear)
    result = asked(vehicle, engine, place_costs=dear)
    quick = found(base(vehicle))
    known = cost_of(problem.cost, quick) + price_of_places(vehicle, problem, quick)
    no_dearer(result, known, "the quickest plan", share=SAMPLED)


@feature(without("place_costs"), says="cost: ")
def ground_round(vehicle: Vehicle, engine: Engine) -> None:
    """Where it is cheaper, the way round dear ground is taken: as if nobody could drive there."""
    size = [0.2 * vehicle.reach, 0.5 * vehicle.reach]
    area = Box(size, midway(vehicle)[:2], heading_midway(vehicle))
    dear = Ground(area, 10.0 / vehicle.fastest)
    search = SearchSettings(max_expansions=3 * vehicle.max_expansions)  # two ways are searched
    problem = vehicle.problem(place_costs=dear, search=search)
    result = asked(vehicle, engine, place_costs=dear, search=search)
    for known in (found(base(vehicle)), plan(vehicle.problem(obstacles=[area])).plan):
        if known is not None:
            price = cost_of(problem.cost, known) + price_of_places(vehicle, problem, known)
            no_dearer(result, price, "a plan that is known", share=0.05)


@feature(without("place_costs"), says="cost of the whole loop")
def loop_clearance(vehicle: Vehicle, engine: Engine) -> None:
    """What a loop spends is what is seen along all that it drove, and what it promised at most."""
    changes = {"obstacles": [pillar(vehicle)], "place_costs": _near(vehicle)}
    problem, ended = vehicle.problem(**changes), driven(vehicle, engine, **changes)
    spent = sum(
        cost_of(problem.cost, one) + price_of_places(vehicle, problem, one)
        for one in ended.driven
        if one.primitives
    )
    close(spent, ended.cost, "cost of the whole loop", share=SAMPLED)
    promised = ended.steps[0].value
    assert ended.cost <= promised * (1.0 + SAMPLED), f"{ended.cost:.6g} of {promised:.6g} promised"

"""The vehicles of a fleet, with what is prepared for all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from maneuver_automaton.fleet.conflicts import load_meetings
from maneuver_automaton.fleet.problem import FleetProblem
from maneuver_automaton.fleet.vehicle import Vehicle
from maneuver_automaton.planning.plan import prepare
from maneuver_automaton.planning.result import Workspace
from maneuver_automaton.refinement.ready import load_lattice
from maneuver_automaton.search.prepared import Prepared


def prepare_vehicles(vehicles: Sequence[Vehicle]) -> None:
    """Have ready what every search of a fleet needs, once for each kind and map."""
    kinds = {(id(one.problem.automaton), id(one.workspace)): one for one in vehicles}
    for one in kinds.values():
        prepare(one.problem, one.workspace)
    load_lattice()
    load_meetings()


def vehicles_of(fleet: FleetProblem, prepared: Prepared | None = None) -> list[Vehicle]:
    """The vehicles of a fleet, which share what is prepared: anew, or with others."""
    prepared = Prepared() if prepared is None else prepared
    workspaces: dict[tuple[int, ...], Workspace] = {}
    keeps = [problem.margin for problem in fleet.problems]
    # Every search keeps its own margin from what it must not touch: what that lacks of the fleet's,
    # the others are larger by.
    grown = max(fleet.margin - min(keeps), 0.0)
    vehicles = []
    for k, problem in enumerate(fleet.problems):
        key = tuple(map(id, problem.obstacles))
        workspace = workspaces.setdefault(key, Workspace(problem.obstacles, prepared))
        settings = replace(problem.search, improve=False)
        # Obstacles of its own may move too, and pass where it stays.
        horizon = replace(problem.horizon, stay=not fleet.leaves[k])
        own = replace(problem, search=settings, obstacles=workspace.obstacles, horizon=horizon)
        vehicles.append(Vehicle(k, fleet.names[k], own, fleet.leaves[k], grown, workspace))
    return vehicles

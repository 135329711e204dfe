"""A plan.json or closed_loop.json, and the problem it answers, as a recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from maneuver_automaton._arrays import as_array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.library import automaton_hash
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.closed_loop_json import load_closed_loop, read_closed_loop_document
from maneuver_automaton.formats.documents import told_of
from maneuver_automaton.formats.fleet_json import load_fleet
from maneuver_automaton.formats.fleet_loop_json import load_fleet_loop
from maneuver_automaton.formats.plan_json import (
    load_plan,
    load_plans,
    plan_of_document,
    read_fleet_document,
    read_plan_document,
)
from maneuver_automaton.models import Model
from maneuver_automaton.recording import Mover, Recording, recording_of
from maneuver_automaton.recording.values import mover_of, world_of
from maneuver_automaton.roads import (
    RoadFleetResult,
    RoadPlanner,
    RoadPlanResult,
    RoadVerdict,
    road_planner,
)
from maneuver_automaton.roads.plans import plan_of_controls
from maneuver_automaton.roads.several import judged_together, nearest_pairs
from maneuver_automaton.scenario import (
    FleetScenario,
    RoadScenario,
    Scenario,
    load_roads,
    load_scenario,
)

START_TOLERANCE = 1e-6  # [m, rad] between the first pose of a plan and the start of its problem


def load_recording(
    path: Path | str,
    *,
    beside: Path | str | None = None,
    case: int | None = None,
    model: Model | None = None,
) -> Recording:
    """The plans, loops or drives of a plan.json or closed_loop.json.

    Parameters
    ----------
    path : Path or str
        The file.
    beside : Path or str, optional
        The scenario that was planned or driven, of CommonRoad too: obstacles, goals, bodies and the
        vehicle come from it. A closed loop cannot do without.
    case : int, optional
        Which problem of a CommonRoad or another file that holds several, from 0.
    model : Model, optional
        A vehicle of the user's own, which the scenario names.

    Raises
    ------
    InvalidScenario
        If a file cannot be read, or the scenario is another one.
    """
    path = Path(path)
    loop, fleet = read_closed_loop_document(path), read_fleet_document(path)
    if beside is None:
        if loop is not None:
            raise InvalidScenario(
                f"{path}: is a closed loop, need --with and the scenario it was driven in"
            )
        return _alone(path, fleet)
    # Of a road several problems are one scene: those of several vehicles, whichever is read first.
    scenario = load_scenario(beside, case=case if fleet is None else 0, model=model)
    if isinstance(scenario, RoadScenario):
        if fleet is not None:
            return recording_of(load_road_fleet(path, beside=beside))
        return _on_road(path, scenario, loop)
    if isinstance(scenario, FleetScenario):
        if fleet is None:
            raise InvalidScenario(f"{beside}: states several vehicles, need the scenario of one")
        load = load_fleet if loop is None else load_fleet_loop
        return replace(recording_of(load(path, scenario.fleet)), title=scenario.name)
    if fleet is not None:
        raise InvalidScenario(f"{path}: holds several vehicles, but {beside} states one")
    if loop is not None:
        recording = recording_of(load_closed_loop(path, scenario.problem))
        return replace(recording, title=scenario.name)
    return _planned(path, scenario)


def load_road_fleet(
    path: Path | str,
    *,
    beside: Path | str,
    vehicle: Path | str | None = None,
    case: int | None = None,
) -> RoadFleetResult:
    """What a plan.json or closed_loop.json holds of drives on the roads of the file `beside`.

    Of a loop the plans are what was driven, with the reasons of those that reached no goal. All
    are judged again, each past the others. One vehicle alone is a fleet of one.

    Parameters
    ----------
    path : Path or str
        The file.
    beside : Path or str
        The CommonRoad file that was planned or driven.
    vehicle : Path or str, optional
        A scenario that states the vehicle, if it is not CommonRoad's BMW 320i.
    case : int, optional
        Which planning problem one vehicle solves, from 0.

    Raises
    ------
    InvalidScenario
        If a file cannot be read, nobody has a plan, or a vehicle is none of the planning problems.
    """
    path, document = Path(path), read_fleet_document(path)
    roads = {
        str(k if one.scene.benchmark is None else one.scene.benchmark.problem): one
        for k, one in enumerate(load_roads(beside, beside=vehicle))
    }
    if document is None:
        name = [*roads][case or 0]
        document = {"vehicles": {name: read_closed_loop_document(path) or read_plan_document(path)}}
    stated = document["vehicles"]
    if others := [name for name in stated if name not in roads]:
        raise InvalidScenario(
            f"{path}: vehicles: got {others[0]!r}, need a planning problem of {beside}: "
            f"{', '.join(roads)}"
        )
    plans = {
        name: plan
        for name, one in stated.items()
        if (plan := _plan_on_road(path, one, roads[name])) is not None
    }
    # A loop of no step ends at its start, where one among several was never there.
    plans = {name: plan for name, plan in plans.items() if plan.duration or len(stated) == 1}
    if not plans:
        raise InvalidScenario(f"{path}: holds no plan, nobody has one")
    scenes = {name: roads[name].scene for name in stated}
    its = next(iter(roads.values())).vehicle
    verdicts = judged_together(scenes, its, plans)
    results = {
        name: _answer(road_planner(scenes[name], its), plans.get(name), one, verdicts.get(name))
        for name, one in stated.items()
    }
    return RoadFleetResult(
        name=str(document.get("name") or scenes[next(iter(stated))].name),
        results=results,
        pairs=nearest_pairs(its, plans),
        order=tuple(stated),
        search_s=0.0,
    )


def _answer(
    planner: RoadPlanner,
    plan: Plan | None,
    document: Mapping[str, Any],
    verdict: RoadVerdict | None = None,
) -> RoadPlanResult:
    reason = str(document.get("reason") or "")
    return RoadPlanResult(
        planner=planner, decision=None, plan=plan, verdict=verdict, reason=reason, search_s=0.0
    )


def _plan_on_road(path: Path, document: Mapping[str, Any], road: RoadScenario) -> Plan | None:
    """The plan of one vehicle, or what it drove; None if it has none."""
    plan: Plan | None = None
    with told_of(path):
        if "steps" in document:
            plan = _road_drive(document, road)
        elif document["status"] == "found":
            plan = plan_of_document(document)
    if plan is not None:
        _check_start(path, plan, road.vehicle.rear_of(road.scene.start.middle))
    return plan


def _alone(path: Path, fleet: Mapping[str, Any] | None) -> Recording:
    """The plans of a file, of which no more is known than it says."""
    if fleet is None:
        document, plan = read_plan_document(path), load_plan(path)
        names = (_names(document, "reduced_state"), _names(document, "control"))
        movers = [Mover(pieces=(plan,), cost=document.get("cost"), names=names)]
    else:
        movers = [Mover(name=name, pieces=(plan,)) for name, plan in load_plans(path).items()]
    return Recording(kind="plan" if fleet is None else "fleet", title="", movers=tuple(movers))


def _planned(path: Path, scenario: Scenario) -> Recording:
    """The plan of a plan.json in the world of its scenario."""
    document, plan, problem = read_plan_document(path), load_plan(path), scenario.problem
    if document["automaton_hash"] != automaton_hash(problem.automaton):
        raise InvalidScenario(
            f"{path}: automaton_hash: this plan was made with another library than that of --with"
        )
    _check_start(path, plan, problem.start)
    mover = mover_of(problem, plan, cost=document.get("cost"))
    return Recording(kind="plan", title=scenario.name, movers=(mover,), world=world_of(problem))


def _names(document: Mapping[str, Any], of: str) -> tuple[str, ...]:
    """What a plan.json says that its reduced states or its controls are; nothing if it does not."""
    vehicle = document.get("vehicle")
    names = vehicle.get(of) if isinstance(vehicle, Mapping) else None
    return tuple(map(str, names)) if isinstance(names, list) else ()


def _on_road(path: Path, road: RoadScenario, loop: Mapping[str, Any] | None) -> Recording:
    """The plan or drive on a road, whose file has the rear axle's poses."""
    document = read_plan_document(path) if loop is None else loop
    plan = _plan_on_road(path, document, road)
    if plan is None:
        raise InvalidScenario(f"{path}: holds no plan, its status is {document['status']!r}")
    found = _answer(road_planner(road.scene, road.vehicle), plan, document)
    recording = recording_of(found)
    reached = loop is None or bool(loop["reached"])
    mover = replace(recording.movers[0], cost=document.get("cost"), reached=reached)
    return replace(recording, movers=(mover,))


def _road_drive(loop: Mapping[str, Any], road: RoadScenario) -> Plan:
    """What was driven on a road: the controls of all steps from the first state."""
    first, *_ = steps = loop["steps"]
    if "vehicle_pose" in first:
        raise ValueError("is a closed loop, but the scenario of --with is a road; need its own")
    state = as_array("steps[0]", [*first["pose"], *first["reduced_state"]], last=5)
    controls = [as_array("steps: control", step["control"], last=2) for step in steps[:-1]]
    return plan_of_controls(
        road.vehicle.model,
        state,
        np.array(controls).reshape(-1, 2),
        tick=float(loop["step_s"]),
        start_time=float(first["time_s"]),
    )


def _check_start(path: Path, plan: Plan, start: Any) -> None:
    off = plan.start - np.asarray(start)
    off[2] = np.remainder(off[2] + np.pi, 2.0 * np.pi) - np.pi
    if np.abs(off).max() > START_TOLERANCE:
        raise InvalidScenario(
            f"{path}: starts at {plan.start.round(6).tolist()}, but the scenario of --with at "
            f"{np.asarray(start).round(6).tolist()}; need the scenario that was planned"
        )

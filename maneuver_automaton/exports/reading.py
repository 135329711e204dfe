"""A plan.json or closed_loop.json, and the problem it answers, as what is to be exported."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from maneuver_automaton._arrays import as_array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.library import automaton_hash
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.exports.driven import Driven, driven_of, driven_on_road
from maneuver_automaton.formats.driven_json import load_closed_loop, read_closed_loop_document
from maneuver_automaton.formats.plan_json import load_plan, read_plan_document
from maneuver_automaton.scenario import (
    FleetScenario,
    RoadScenario,
    Scenario,
    load_roads,
    load_scenario,
)

if TYPE_CHECKING:
    from maneuver_automaton.models import Model

START_TOLERANCE = 1e-6  # [m, rad] between the first pose of a plan and the start of its problem


def load_driven(
    path: Path | str,
    *,
    beside: Path | str | None = None,
    case: int | None = None,
    model: Model | None = None,
) -> Driven:
    """The plan, loop or drive of a plan.json or closed_loop.json.

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
    loop = read_closed_loop_document(path)
    problem = None
    if beside is not None:
        problem = load_scenario(beside, case=case, model=model)
    elif loop is not None:
        raise InvalidScenario(
            f"{path}: is a closed loop, need --with and the scenario it was driven in"
        )
    if isinstance(problem, RoadScenario):
        return _on_road(path, problem, loop)
    if isinstance(problem, FleetScenario):
        raise InvalidScenario(f"{beside}: states several vehicles, need the scenario of one")
    if loop is not None:
        assert problem is not None
        return replace(driven_of(load_closed_loop(path, problem.problem)), name=problem.name)
    return _planned(path, problem)


def load_road_fleet(
    path: Path | str, *, beside: Path | str, vehicle: Path | str | None = None
) -> tuple[Driven, ...]:
    """The plans of a plan.json of several vehicles on one road, in the CommonRoad file `beside`.

    The `vehicle` is that of a scenario, if it is not CommonRoad's BMW 320i.

    Raises
    ------
    InvalidScenario
        If a file cannot be read, nobody has a plan, or a vehicle is none of the planning problems.
    """
    from maneuver_automaton.formats.plan_json import load_plans

    scenes = {
        str(k if one.scene.benchmark is None else one.scene.benchmark.problem): one
        for k, one in enumerate(load_roads(beside, beside=vehicle))
    }
    found = []
    for name, plan in load_plans(path).items():
        if name not in scenes:
            raise InvalidScenario(
                f"{path}: vehicles: got {name!r}, need a planning problem of {beside}: "
                f"{', '.join(scenes)}"
            )
        road = scenes[name]
        _check_start(Path(path), plan, road.vehicle.rear_of(road.scene.start.middle))
        found.append(driven_on_road(road.scene, road.vehicle, plan))
    if not found:
        raise InvalidScenario(f"{path}: holds no plan, nobody has one")
    return tuple(found)


def _planned(path: Path, scenario: Scenario | None) -> Driven:
    """The plan of a plan.json, in the world of its scenario if that is known."""
    document, plan = read_plan_document(path), load_plan(path)
    if scenario is None:
        return Driven(
            pieces=(plan,),
            end=plan.end,
            cost=document.get("cost"),
            reduced_names=_names(document, "reduced_state"),
            control_names=_names(document, "control"),
        )
    problem = scenario.problem
    if document["automaton_hash"] != automaton_hash(problem.automaton):
        raise InvalidScenario(
            f"{path}: automaton_hash: this plan was made with another library than that of --with"
        )
    _check_start(path, plan, problem.start)
    return Driven(
        pieces=(plan,),
        end=plan.end,
        model=problem.automaton.model,
        problem=problem,
        name=scenario.name,
        cost=document.get("cost"),
    )


def _names(document: Mapping[str, Any], of: str) -> tuple[str, ...]:
    """What a plan.json says that its reduced states or its controls are; nothing if it does not."""
    vehicle = document.get("vehicle")
    names = vehicle.get(of) if isinstance(vehicle, Mapping) else None
    return tuple(map(str, names)) if isinstance(names, list) else ()


def _on_road(path: Path, road: RoadScenario, loop: Mapping[str, Any] | None) -> Driven:
    """The plan or drive on a road, whose file has the rear axle's poses."""
    document = read_plan_document(path) if loop is None else loop
    try:
        plan = load_plan(path) if loop is None else _road_drive(loop, road)
    except (ValueError, KeyError, TypeError, IndexError) as error:
        if isinstance(error, InvalidScenario):
            raise
        said = f"misses the key {error}" if isinstance(error, KeyError) else str(error)
        raise InvalidScenario(f"{path}: {said}") from error
    _check_start(path, plan, road.vehicle.rear_of(road.scene.start.middle))
    return driven_on_road(
        road.scene,
        road.vehicle,
        plan,
        cost=document.get("cost"),
        reached=loop is None or bool(loop["reached"]),
    )


def _road_drive(loop: Mapping[str, Any], road: RoadScenario) -> Plan:
    """What was driven on a road: the controls of all steps from the first state."""
    from maneuver_automaton.roads.plans import plan_of_controls

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

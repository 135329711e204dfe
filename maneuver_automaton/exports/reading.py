"""Result files opened: what they hold, in the world that they were made for; as a recording too."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from maneuver_automaton._arrays import as_array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.closed_loop_json import load_closed_loop
from maneuver_automaton.formats.documents import checked, errors_at, kind_of, parsed
from maneuver_automaton.formats.fleet_json import load_fleet, load_fleet_loop
from maneuver_automaton.formats.plan_json import (
    load_plan,
    load_plans,
    load_result,
    plan_of_document,
)
from maneuver_automaton.formats.registry import is_road
from maneuver_automaton.models import Model
from maneuver_automaton.recording import Mover, Recording, recording_of
from maneuver_automaton.recording.plans import stated
from maneuver_automaton.roads import RoadFleetResult, RoadPlanResult, road_planner
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
ALONE = {  # kinds of documents that do not state what they were made from
    "plan": ("a plan", "planned from"),
    "loop": ("a closed loop", "driven in"),
    "road-plan": ("a plan on a road", "planned from"),
    "drive": ("a drive on a road", "driven on"),
}


@dataclass(frozen=True, eq=False, kw_only=True)
class ResultFile:
    """A plan.json or closed_loop.json, and what it was made from; see `open_result`."""

    path: Path
    kind: str  # see `formats.documents.KINDS`
    document: Mapping[str, Any]
    scenario: Scenario | FleetScenario | None = None  # neither of a road, nor where none is named
    beside: Path | None = None  # the file of the scenario, or of the road
    roads: tuple[RoadScenario, ...] = ()

    @property
    def several(self) -> bool:
        """Whether it is of several vehicles, which name the file that they were made from."""
        return self.kind not in ALONE

    def needed(self) -> None:
        """Raise InvalidScenario if nobody names what it was made from."""
        if self.beside is None and self.several:
            raise InvalidScenario(
                f"{self.path}: source: is missing, need --with and the file it was planned from"
            )
        if self.beside is None:
            what, how = ALONE[self.kind]
            raise InvalidScenario(
                f"{self.path}: is {what}, which does not state its problem; need --with FILE, the "
                f"scenario that it was {how}"
            )

    def result(self) -> Any:
        """The PlanResult, ClosedLoop, FleetResult, FleetLog or RoadFleetResult that it holds.

        What was driven on roads is judged again, each past the others: of a loop the plans are what
        was driven, with the reasons of those that reached no goal. One alone is a fleet of one.

        Raises
        ------
        InvalidScenario
            If the file is damaged, or was made from another scenario, or from one unknown.
        """
        self.needed()
        if self.roads:
            return _driven_on_roads(self)
        if isinstance(self.scenario, FleetScenario):
            load = load_fleet if self.kind == "fleet" else load_fleet_loop
            return load(self.path, self.scenario.fleet)
        assert self.scenario is not None
        return {"plan": load_result, "loop": load_closed_loop}[self.kind](
            self.path, self.scenario.problem
        )


def open_result(
    path: Path | str,
    *,
    beside: Path | str | None = None,
    case: int | None = None,
    model: Model | None = None,
) -> ResultFile:
    """A plan.json or closed_loop.json of any kind, and the scenario that it was made from.

    Parameters
    ----------
    path : Path or str
        The file.
    beside : Path or str, optional
        The scenario that was planned or driven, of CommonRoad too: obstacles, goals, bodies and the
        vehicle come from it. Files of several vehicles may name theirs.
    case : int, optional
        Which problem of a CommonRoad or another file that holds several, from 0.
    model : Model, optional
        A vehicle of the user's own, which the scenario names.

    Raises
    ------
    InvalidScenario
        If a file cannot be read, holds statistics, or the scenario is that of another kind.
    """
    path = Path(path)
    value = parsed(path)
    kind = kind_of(value) or "plan"
    document, completed = checked(kind, value, path), None
    if kind == "statistics":
        raise InvalidScenario(
            f"{path}: holds statistics, which do not say what was driven; need a plan.json or a "
            "closed_loop.json"
        )
    if beside is None and isinstance(said := document.get("source"), dict):
        beside, completed, case = _source(path, said, case)
    if beside is None:
        return ResultFile(path=path, kind=kind, document=document)
    beside = Path(beside)
    if is_road(beside):
        roads = load_roads(beside, beside=completed)
        if kind in ALONE:
            road = load_scenario(beside, beside=completed, case=case or 0)
            roads = tuple(one for one in (road,) if isinstance(one, RoadScenario))
        return ResultFile(path=path, kind=kind, document=document, beside=beside, roads=roads)
    if "road" in kind or kind == "drive":
        raise InvalidScenario(f"{path}: was made on a road, need --with and its CommonRoad file")
    scenario = load_scenario(beside, beside=completed, case=case, model=model)
    assert not isinstance(scenario, RoadScenario)
    if isinstance(scenario, FleetScenario) and kind in ALONE:
        raise InvalidScenario(
            f"{beside}: states several vehicles, which only plan, mpc, check and convert know"
        )
    if isinstance(scenario, Scenario) and kind not in ALONE:
        raise InvalidScenario(f"{path}: holds plans of several vehicles, but {beside} states one")
    return ResultFile(path=path, kind=kind, document=document, scenario=scenario, beside=beside)


def _source(
    path: Path, said: Mapping[str, Any], case: int | None
) -> tuple[Path, Path | None, int | None]:
    """The file that results say they were made from, what completes it, and which of its cases."""
    # Files as seen from this one: by their names alone, whatever links are on the way.
    file, completed = (
        Path(os.path.normpath(path.parent / name)) if isinstance(name, str) else None
        for name in (said["file"], said.get("with"))
    )
    assert file is not None
    if not file.is_file():
        raise InvalidScenario(f"{path}: source: there is no {file}, need --with and that file")
    return file, completed, said.get("case") if case is None else case


def load_recording(
    path: Path | str,
    *,
    beside: Path | str | None = None,
    case: int | None = None,
    model: Model | None = None,
) -> Recording:
    """The plans, loops or drives of a plan.json or closed_loop.json.

    Parameters are those of `open_result`; a closed loop cannot do without its scenario.

    Raises
    ------
    InvalidScenario
        If a file cannot be read, or the scenario is another one.
    """
    file = open_result(path, beside=beside, case=case, model=model)
    if file.beside is None:
        return _alone(file)
    if file.roads and not file.several:
        return _on_road(file)
    recording = recording_of(file.result())
    if file.kind == "plan" and file.scenario is not None:
        (mover,), status = recording.movers, recording.status
        if not mover.has_plan:
            raise InvalidScenario(f"{file.path}: holds no plan, its status is {status!r}")
        _check_start(file.path, mover.pieces[0], file.scenario.problems[0].start)
    return replace(recording, title=file.scenario.name) if file.scenario else recording


def _driven_on_roads(file: ResultFile) -> RoadFleetResult:
    path, document = file.path, file.document
    roads = {
        str(k if one.scene.benchmark is None else one.scene.benchmark.problem): one
        for k, one in enumerate(file.roads)
    }
    stated = document["vehicles"] if file.several else {next(iter(roads)): document}
    if others := [name for name in stated if name not in roads]:
        raise InvalidScenario(
            f"{path}: vehicles: got {others[0]!r}, need a planning problem of {file.beside}: "
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
        name: RoadPlanResult(
            planner=road_planner(scenes[name], its),
            plan=plans.get(name),
            verdict=verdicts.get(name),
            reason=str(one.get("reason") or ""),
        )
        for name, one in stated.items()
    }
    return RoadFleetResult(
        name=str(document.get("name") or scenes[next(iter(stated))].name),
        results=results,
        pairs=nearest_pairs(its, plans),
        order=tuple(stated),
        search_s=0.0,
    )


def _plan_on_road(path: Path, document: Mapping[str, Any], road: RoadScenario) -> Plan | None:
    """The plan of one vehicle, or what it drove; None if it has none."""
    plan: Plan | None = None
    with errors_at(path):
        if "steps" in document:
            plan = _road_drive(document, road)
        elif document["status"] == "found":
            plan = plan_of_document(document, road.vehicle.model)
    if plan is not None:
        _check_start(path, plan, road.vehicle.rear_of(road.scene.start.middle))
    return plan


def _alone(file: ResultFile) -> Recording:
    """The plans of a file, of which no more is known than it says."""
    if "steps" in file.document:
        raise InvalidScenario(
            f"{file.path}: is a closed loop, need --with and the scenario it was driven in"
        )
    if file.several:
        plans = load_plans(file.path)
        movers = tuple(Mover(name=name, pieces=(plan,)) for name, plan in plans.items())
        return Recording(kind="fleet", title="", movers=movers)
    return replace(stated(file.document, load_plan(file.path)), title="")


def _on_road(file: ResultFile) -> Recording:
    """The plan or drive on a road, whose file has the rear axle's poses."""
    document, road = file.document, file.roads[0]
    plan = _plan_on_road(file.path, document, road)
    if plan is None:
        raise InvalidScenario(f"{file.path}: holds no plan, its status is {document['status']!r}")
    planner, why = road_planner(road.scene, road.vehicle), str(document.get("reason") or "")
    recording = recording_of(RoadPlanResult(planner=planner, plan=plan, reason=why))
    reached = "steps" not in document or bool(document["reached"])
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

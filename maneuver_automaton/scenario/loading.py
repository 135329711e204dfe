"""Files that state a problem, in whichever format, as scenarios."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from maneuver_automaton import roads
from maneuver_automaton._arrays import Array
from maneuver_automaton._brief import brief
from maneuver_automaton.collision import Box
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats import commonroad
from maneuver_automaton.formats.registry import reader_of, yaml_statements
from maneuver_automaton.formats.statement import Statement
from maneuver_automaton.formats.text_source import read_text
from maneuver_automaton.formats.yaml_source import Document, Where, parse
from maneuver_automaton.models import Model, SecondOrderCar
from maneuver_automaton.scenario import fleet
from maneuver_automaton.scenario.scenario import (
    Scenario,
    combined,
    scenario_of_document,
    states_several,
)

MANY_TURNS = 2.0 * math.pi + 0.01  # [rad] a full turn, however it was rounded


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RoadScenario:
    """A drive on roads that a file states, and who drives."""

    name: str
    scene: roads.RoadScene
    vehicle: roads.RoadVehicle

    __repr__ = brief


def load_scenario(
    path: Path | str,
    *,
    beside: Path | str | None = None,
    case: int | None = None,
    model: Model | None = None,
) -> Scenario | fleet.FleetScenario | RoadScenario:
    """The problem of a file: a scenario, or another format that states one or a part of one.

    A CommonRoad file states a drive on roads: `plan_road` and `drive_road` take its scene and its
    vehicle. That is the BMW 320i of CommonRoad, or the one of the scenario `beside`: a second-order
    car with a rectangular body along its axis.

    A scenario with `vehicles`, a problem of CL-CBS, and one of dynobench with several robots state
    a fleet: `plan_fleet` takes it.

    Parameters
    ----------
    path : Path or str
        Scenario, CommonRoad scenario, TPCAP case, Nav2 map, dynobench problem, CL-CBS problem,
        MovingAI map or queries, SBPL environment: told apart by their endings, YAML
        files by their keys.
    beside : Path or str, optional
        A scenario for what the file leaves out, such as the vehicle. What the file states wins;
        start and goal may be missing in the scenario where the file states them.
    case : int, optional
        Which problem of a file that holds several, from 0.
    model : Model, optional
        A vehicle of the user's own, which the scenario names: a file cannot state it.

    Raises
    ------
    InvalidScenario
        If a file cannot be read or used: one line with file, line, field, the value met, and
        what would be right.
    """
    begin, path = time.perf_counter(), Path(path)
    read = reader_of(path)
    if read is not None:
        statements = read(path)
    else:
        document = parse(read_text(path), name=str(path))
        found = yaml_statements(document, path)
        if found is None:
            if isinstance(document.value, dict) and "schema" in document.value:
                if beside is not None:
                    raise InvalidScenario(
                        f"--with: serves formats that state a part of a problem, but {path} is a "
                        "scenario, which states all of it"
                    )
                if case is not None and case != 0:
                    raise _no_case(path, 1, case)
            if states_several(document):
                return fleet.fleet_of_document(document, path=path, begin=begin, own=model)
            return scenario_of_document(document, path=path, begin=begin, own=model)
        statements = found
    n = len(statements)
    if case is None and n > 1:
        raise InvalidScenario(f"{path}: holds {n} problems, need --case and a number, 0 to {n - 1}")
    if case is not None and not 0 <= case < n:
        raise _no_case(path, n, case)
    statement = statements[case or 0]
    if statement.road is not None:
        vehicle = roads.RoadVehicle() if beside is None else _road_vehicle(Path(beside))
        return RoadScenario(name=statement.name, scene=statement.road, vehicle=vehicle)
    rest, settings, loop = None, None, None
    if beside is not None:
        stated = statement.fleet[0] if statement.fleet else statement
        document = _beside(Path(beside), start=stated.start, goal=stated.goal)
        with _errors_of_with():
            if statement.fleet:
                document, settings, loop = fleet.without_fleet(document)
            rest = scenario_of_document(document, path=Path(beside), begin=begin, own=model)
    elif model is not None:
        raise InvalidScenario(
            f"{path}: names no vehicle of yours; need --with and a scenario that does"
        )
    scenario: Scenario | fleet.FleetScenario
    if statement.fleet:
        how: dict[str, Any] = {"settings": settings, "loop": loop}
        scenario = fleet.fleet_of_statement(statement, rest, path=path, **how)
    else:
        scenario = combined(statement, rest, path=path)
    made = scenario.timing_s.get("automaton", 0.0)
    load = time.perf_counter() - begin - made
    return replace(scenario, timing_s={"load": load, "automaton": made})


def load_roads(path: Path | str, *, beside: Path | str | None = None) -> tuple[RoadScenario, ...]:
    """The drives on roads of a CommonRoad file, one for each of its planning problems.

    `plan_roads` takes their scenes.

    Raises
    ------
    InvalidScenario
        As `load_scenario`.
    """
    vehicle = roads.RoadVehicle() if beside is None else _road_vehicle(Path(beside))
    return tuple(
        RoadScenario(name=one.name, scene=one.road, vehicle=vehicle)
        for one in commonroad.read_commonroad(Path(path))
        if one.road is not None
    )


def _road_vehicle(beside: Path) -> roads.RoadVehicle:
    """The vehicle of a scenario beside a drive on roads."""
    anywhere, begin = np.zeros(3), time.perf_counter()  # the scene states its own
    document = _beside(beside, start=anywhere, goal=anywhere)
    with _errors_of_with():
        rest = scenario_of_document(document, path=beside, begin=begin).problem
    model, footprint = rest.automaton.model, rest.footprint
    if not isinstance(model, SecondOrderCar):
        raise InvalidScenario(
            f"--with: {beside}: vehicle: got the model {model.name}, need second_order_car on roads"
        )
    body = footprint[0] if len(footprint) == 1 else None
    if not isinstance(body, Box) or body.heading != 0.0 or float(body.center[1]) != 0.0:
        raise InvalidScenario(
            f"--with: {beside}: vehicle: footprint: need one rectangle along the axis of the car"
        )
    length, width = body.size.tolist()
    return roads.RoadVehicle(model=model, length=length, width=width, ahead=float(body.center[0]))


def statements_of(path: Path) -> tuple[Statement, ...] | None:
    """What a file of another format states, problem by problem; None for a scenario.

    Raises
    ------
    InvalidScenario
        As `load_scenario`.
    """
    read = reader_of(path)
    return read(path) if read else yaml_statements(parse(read_text(path), name=str(path)), path)


def _beside(path: Path, *, start: Array | None, goal: Array | None) -> Document:
    """The scenario of --with; it needs no start and goal where the problem states them."""
    with _errors_of_with():
        document = parse(read_text(path), name=str(path))
    if not isinstance(document.value, dict):
        return document
    known = {"start": start, "goal": goal}
    ends = {key: {"pose": pose.tolist()} for key, pose in known.items() if pose is not None}
    return replace(document, value=ends | document.value)


@contextlib.contextmanager
def _errors_of_with() -> Iterator[None]:
    try:
        yield
    except InvalidScenario as error:
        raise InvalidScenario(f"--with: {error}") from error


def remarks_on(path: Path | str) -> list[str]:
    """What a scenario file states that is legal, but hardly meant: headings that look like degrees.

    Raises
    ------
    InvalidScenario
        If the file cannot be read.
    """
    path = Path(path)
    if reader_of(path) is not None:
        return []
    document = parse(read_text(path), name=str(path))
    if not isinstance(document.value, dict) or "schema" not in document.value:
        return []
    return [
        str(
            document.error(
                where,
                f"{heading:g} rad is more than a full turn and looks like degrees; "
                f"{heading:g} degrees are {math.radians(heading):.4g} rad",
            )
        )
        for where, heading in _headings(document.value, ())
        if MANY_TURNS < abs(heading) < math.inf
    ]


def _headings(value: Any, where: Where) -> Iterator[tuple[Where, float]]:
    """Headings that a part of a file states, and where."""
    for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
        at = (*where, key)
        if key == "pose" and isinstance(inner, list) and len(inner) > 2:
            inner, at = inner[2], (*at, 2)
        elif key == "motion" and isinstance(inner, list) and inner and isinstance(inner[0], list):
            inner, at = inner[0][-1], (*at, 0, len(inner[0]) - 1)  # later ones may add up turns
        elif key not in ("heading_rad", "tolerance_rad"):
            if isinstance(inner, dict | list):
                yield from _headings(inner, at)
            continue
        if isinstance(inner, int | float):
            yield at, float(inner)


def _no_case(path: Path, n: int, case: int) -> InvalidScenario:
    holds = "one problem, need 0 or no case" if n == 1 else f"{n} problems, need 0 to {n - 1}"
    return InvalidScenario(f"--case: got {case}, but {path} holds {holds}")

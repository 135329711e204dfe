"""A scenario: a problem, and what a file says beside it."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from maneuver_automaton._brief import brief
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.collision import AnyObstacle, Shape
from maneuver_automaton.costs import Cost
from maneuver_automaton.formats.statement import MapFile
from maneuver_automaton.formats.yaml_source import Document, Where, parse
from maneuver_automaton.models import Model
from maneuver_automaton.problem import Bounds, Goal, Horizon, Problem, SearchSettings
from maneuver_automaton.scenario.automata import automaton_of
from maneuver_automaton.scenario.places import at
from maneuver_automaton.scenario.reading import values_of
from maneuver_automaton.scenario.schema import (
    AutomatonPart,
    CostPart,
    GoalPart,
    HorizonPart,
    RecedingHorizonPart,
    ScenarioFile,
    SearchPart,
)
from maneuver_automaton.scenario.shapes import (
    footprint_of,
    obstacles_of,
    stated_footprint,
    zones_of,
)
from maneuver_automaton.scenario.vehicles import carried_of, model_of

Footprint = tuple[Mapping[str, Any], ...]  # shapes, each {rectangle_m, reference_m} and so on


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Scenario:
    """What a scenario file describes, or a file of another format and a scenario beside it."""

    name: str
    problem: Problem
    time_limit_s: float = 5.0  # upper bound for search and refinement [s]
    receding_horizon: RecedingHorizonPart | None = None
    maps: tuple[MapFile, ...] = ()  # files of the maps among the obstacles
    stated: AutomatonPart | None = None  # the automaton, as the file states it
    path: Path | None = None
    timing_s: Mapping[str, float] = field(default_factory=dict)  # load, automaton [s]

    __repr__ = brief

    @property
    def footprint(self) -> Footprint:
        """The body of the vehicle in the words of a scenario file, for pictures."""
        return stated_footprint(self.problem.footprint)


def scenario_of_text(text: str, *, name: str) -> Scenario:
    """The scenario of a YAML text; `name` is what messages call it.

    Raises
    ------
    InvalidScenario
        If it cannot be used: one line with name, line, field, the value met, and what would be
        right.

    Examples
    --------
    >>> scenario = scenario_of_text('''
    ... schema: 1
    ... vehicle: {model: unicycle}
    ... automaton: {preset: table2}
    ... start: {pose: [0, 1, 0]}
    ... goal: {pose: [0, 0, 0]}
    ... ''', name="example")
    >>> scenario.problem.automaton.trim_names
    ('rest', 'straight', 'clockwise', 'anticlockwise', 'spin')
    """
    begin = time.perf_counter()
    return scenario_of_document(parse(text, name=name), path=None, begin=begin)


def scenario_of_document(
    document: Document, *, path: Path | None, begin: float, own: Model | None = None
) -> Scenario:
    """The scenario of a YAML file that was read since `begin` [s]; its vehicle is `own` if given.

    Raises
    ------
    InvalidScenario
        As `scenario_of_text`.
    """
    file = values_of(document, own=own)
    if file.search.method == "words":
        _refuse_long_words(document, file)
    folder = path.parent if path else Path()
    with at(document, ("vehicle",)):
        model = model_of(file.vehicle, own=own)
    bodies = _Bodies(
        vehicle=footprint_of(document, file.vehicle.footprint, key="footprint"),
        parts={
            name: footprint_of(document, body, key=name)
            for name, body in carried_of(file.vehicle).items()
        },
        height=_height_of(document, file.vehicle, model),
    )
    obstacles, maps = obstacles_of(document, file.obstacles, folder)
    read = time.perf_counter()
    automaton = automaton_of(document, file.automaton, model, folder=folder)
    made = time.perf_counter()
    return Scenario(
        name=(path.stem if path else document.name) if file.name is None else file.name,
        problem=_problem(document, file, automaton, bodies=bodies, obstacles=obstacles),
        time_limit_s=file.search.time_limit_s,
        receding_horizon=file.receding_horizon,
        maps=maps,
        stated=file.automaton,
        path=path,
        timing_s={"load": read - begin, "automaton": made - read},
    )


class _Bodies(NamedTuple):
    """The bodies of a vehicle and its parts, which must stay collision-free."""

    vehicle: tuple[Shape, ...]
    parts: Mapping[str, tuple[Shape, ...]]  # what it carries, by name
    height: tuple[float, float]  # [m] lowest and highest point about the altitude of the pose


def _height_of(document: Document, part: Any, model: Model) -> tuple[float, float]:
    """Lowest and highest point of the body about its altitude [m]; a flat one if not stated."""
    stated: tuple[float, float] | None = getattr(part, "footprint_height_m", None)
    if stated is not None and model.group.dof == 3:
        raise document.error(("vehicle", "footprint_height_m"), f"the {model.name} has no height")
    return stated or (0.0, 0.0)


def _refuse_long_words(document: Document, file: ScenarioFile) -> None:
    """Exhaustive search is for short words."""
    from maneuver_automaton.search.word_scan import MOST_TRIMS

    goals = file.goal if isinstance(file.goal, tuple) else (file.goal,)
    most = MOST_TRIMS - any(goal.heading == "free" for goal in goals)
    if file.horizon.max_trims is not None and file.horizon.max_trims > most:
        free = " where a heading is free" if most < MOST_TRIMS else ""
        raise document.error(
            ("horizon", "max_trims"),
            f"got {file.horizon.max_trims} for the method words, need at most {most}{free}; "
            "the method insertion has no limit",
        )


def _problem(
    document: Document,
    file: ScenarioFile,
    automaton: Automaton,
    *,
    bodies: _Bodies,
    obstacles: tuple[AnyObstacle, ...],
) -> Problem:
    goals = file.goal if isinstance(file.goal, tuple) else (file.goal,)
    many = isinstance(file.goal, tuple)
    dof = automaton.model.group.dof
    _check_pose(document, ("start", "pose"), file.start.pose, dof)
    _check_trim(document, ("start", "trim"), file.start.trim, automaton)
    for k, goal in enumerate(goals):
        where: Where = ("goal", k) if many else ("goal",)
        _check_pose(document, (*where, "pose"), goal.pose, dof)
        _check_trim(document, (*where, "trim"), goal.trim, automaton)
    if file.bounds_m.z is not None and dof == 3:
        raise document.error(("bounds_m", "z"), f"the {automaton.model.name} has no height")
    for k, zone in enumerate(file.zones):
        for n, name in enumerate(zone.trims or ()):
            _check_trim(document, ("zones", k, "trims", n), name, automaton)
    cost, horizon = _cost(document, file.cost, automaton), _horizon(document, file.horizon)
    with at(document, ()):
        return Problem(
            automaton,
            file.start.pose,
            tuple(_goal(goal) for goal in goals),
            cost=cost,
            horizon=horizon,
            start_trim=file.start.trim,
            start_time=file.start.time_s,
            bounds=Bounds(x=file.bounds_m.x, y=file.bounds_m.y, z=file.bounds_m.z),
            search=_search(file.search),
            obstacles=obstacles,
            footprint=bodies.vehicle,
            parts=bodies.parts,
            body_height=bodies.height,
            margin=file.margin_m,
            zones=zones_of(document, file.zones),
        )


def _check_pose(document: Document, where: Where, pose: tuple[float, ...], dof: int) -> None:
    if len(pose) != dof:
        names = "[x, y, heading]" if dof == 3 else "[x, y, heading, z]"
        raise document.error(where, f"got {len(pose)} numbers, need {dof}: {names}")


def _check_trim(document: Document, where: Where, trim: str | None, automaton: Automaton) -> None:
    if trim is not None:
        with at(document, where):
            automaton.index_of(trim)


def _goal(part: GoalPart) -> Goal:
    return Goal(
        pose=part.pose,
        trim=part.trim,
        free_heading=part.heading == "free",
        tolerance_m=part.tolerance_m,
        tolerance_rad=part.tolerance_rad,
    )


def _cost(document: Document, part: CostPart, automaton: Automaton) -> Cost:
    matrix = part.effort_matrix
    where: Where = ("cost",) if matrix is None else ("cost", "effort_matrix")
    if matrix is not None and len({len(row) for row in matrix} | {len(matrix)}) > 1:
        rows = ", ".join(str(len(row)) for row in matrix)
        raise document.error(
            where, f"got {len(matrix)} rows of {rows} numbers, need a square matrix"
        )
    order = math.inf if part.norm_order == "inf" else float(part.norm_order)
    with at(document, where):
        cost = Cost(
            effort=part.effort,
            norm=part.norm,
            time=part.time,
            effort_matrix=matrix,  # type: ignore[arg-type]
            norm_order=order,
            length=part.length,
            switch=part.switch,
            direction_change=part.direction_change,
        )
        cost.rates(automaton.controls[:1], automaton.body_velocities[:1])
    return cost


def _search(part: SearchPart) -> SearchSettings:
    return SearchSettings(
        method=part.method,
        max_expansions=part.max_expansions,
        cell=part.cell_m,
        headings=part.headings,
        weight=part.weight,
        show_nodes=part.show_nodes,
        improve=part.improve,
    )


def _horizon(document: Document, part: HorizonPart) -> Horizon:
    fixed = part.time_s != "free" and part.max_time_s is not None
    with at(document, ("horizon", "max_time_s") if fixed else ("horizon",)):
        return Horizon(
            time=None if part.time_s == "free" else part.time_s,
            max_trims=part.max_trims,
            min_coast=part.min_coast_s,
            max_time=part.max_time_s,
        )

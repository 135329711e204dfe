"""A scenario: a problem, and what a file says beside it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias, TypeVar

from maneuver_automaton._brief import brief
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.collision import AnyObstacle, Shape
from maneuver_automaton.formats.statement import MapFile
from maneuver_automaton.formats.yaml_source import Document, Where, parse
from maneuver_automaton.models import Model
from maneuver_automaton.problem import UNSTATED, Bounds, Goal, Horizon, Problem, SearchSettings
from maneuver_automaton.scenario.automata import automaton_of
from maneuver_automaton.scenario.places import at
from maneuver_automaton.scenario.prices import cost_of
from maneuver_automaton.scenario.reading import values_of
from maneuver_automaton.scenario.schema import (
    AutomatonPart,
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

T = TypeVar("T")
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
    def problems(self) -> tuple[Problem, ...]:
        """The one that it states."""
        return (self.problem,)

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


Made: TypeAlias = dict[tuple[object, ...], Any]
"""What was made of parts of a file: several vehicles of one file share it."""


def scenario_of_document(
    document: Document,
    *,
    path: Path | None,
    begin: float,
    own: Model | None = None,
    made: Made | None = None,
) -> Scenario:
    """The scenario of a YAML file that was read since `begin` [s]; its vehicle is `own` if given.

    What is in `made` is taken from there, and what is made is kept in it.

    Raises
    ------
    InvalidScenario
        As `scenario_of_text`.
    """
    file = values_of(document, own=own)
    if file.search.method == "words":
        _refuse_long_words(document, file)
    folder = path.parent if path else Path()
    once = _Once(document.value, {} if made is None else made)
    model, bodies = once.of(("vehicle",), lambda: _vehicle(document, file, own))
    obstacles, maps = once.of(
        ("obstacles",), lambda: obstacles_of(document, file.obstacles, folder)
    )
    read = time.perf_counter()
    automaton = once.of(
        ("vehicle", "automaton"),
        lambda: automaton_of(document, file.automaton, model, folder=folder),
    )
    built = time.perf_counter()
    return Scenario(
        name=(path.stem if path else document.name) if file.name is None else file.name,
        problem=_problem(
            document,
            file,
            automaton,
            bodies=bodies,
            obstacles=obstacles,
            folder=folder,
            once=once,
        ),
        time_limit_s=file.search.time_limit_s,
        receding_horizon=file.receding_horizon,
        maps=maps,
        stated=file.automaton,
        path=path,
        timing_s={"load": read - begin, "automaton": built - read},
    )


class _Once(NamedTuple):
    """What is made of a document, once of the same parts."""

    value: Mapping[str, Any]  # of the document
    made: Made

    def of(self, keys: tuple[str, ...], make: Callable[[], T]) -> T:
        """What `make` returns, of the parts at some keys of the document."""
        key = (*keys, *(id(self.value.get(key)) for key in keys))
        if key not in self.made:
            self.made[key] = make()
        found: T = self.made[key]
        return found


def _vehicle(document: Document, file: ScenarioFile, own: Model | None) -> tuple[Model, _Bodies]:
    """The model of a file, and the bodies that it moves."""
    with at(document, ("vehicle",)):
        model = model_of(file.vehicle, own=own)
    return model, _Bodies(
        vehicle=footprint_of(document, file.vehicle.footprint, key="footprint"),
        parts={
            name: footprint_of(document, body, key=name)
            for name, body in carried_of(file.vehicle).items()
        },
        height=getattr(file.vehicle, "footprint_height_m", None) or (0.0, 0.0),
    )


class _Bodies(NamedTuple):
    """The bodies of a vehicle and its parts, which must stay collision-free."""

    vehicle: tuple[Shape, ...]
    parts: Mapping[str, tuple[Shape, ...]]  # what it carries, by name
    height: tuple[float, float]  # [m] lowest and highest point about the altitude of the pose


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
    folder: Path,
    once: _Once,
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
    cost = once.of(
        ("vehicle", "automaton", "cost"), lambda: cost_of(document, file.cost, automaton)
    )
    speeds = [math.hypot(*trim.body_velocity[:2]) for trim in automaton.trims]
    zones = once.of(
        ("vehicle", "automaton", "zones"),
        lambda: zones_of(document, file.zones, folder, fastest=max(speeds)),
    )
    horizon = _horizon(document, file.horizon)
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
            zones=zones,
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


def _search(part: SearchPart) -> SearchSettings:
    return SearchSettings(
        method=part.method,
        max_expansions=part.max_expansions,
        cell=part.cell_m,
        headings=part.headings,
        weight=part.weight,
        backwards=part.backwards,
        show_nodes=part.show_nodes,
        improve=part.improve,
        polish=part.polish,
    )


def _horizon(document: Document, part: HorizonPart) -> Horizon:
    fixed = part.time_s != "free"
    wrong = "max_time_s" if part.max_time_s is not None else "stay"
    with at(document, ("horizon", wrong) if fixed else ("horizon",)):
        return Horizon(
            time=None if part.time_s == "free" else part.time_s,
            max_trims=part.max_trims,
            min_coast=UNSTATED if part.min_coast_s is None else part.min_coast_s,
            max_time=part.max_time_s,
            stay=part.stay,
        )

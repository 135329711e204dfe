"""A scenario: a problem, and what a file says beside it."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import numpy as np

from maneuver_automaton._arrays import Array, vector_text
from maneuver_automaton._brief import brief
from maneuver_automaton._files import stem_of
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.costs import Cost
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats import cl_cbs, tpcap
from maneuver_automaton.formats.statement import MapFile, StatedVehicle, Statement
from maneuver_automaton.formats.yaml_source import Document, Where, parse, shown
from maneuver_automaton.models import Model
from maneuver_automaton.models.kinds import KINDS
from maneuver_automaton.problem import (
    STATE_TOLERANCE,
    Bounds,
    Goal,
    Horizon,
    Problem,
    SearchSettings,
    Via,
    settled_state,
)
from maneuver_automaton.receding_horizon import simulation
from maneuver_automaton.scenario.automata import automaton_of
from maneuver_automaton.scenario.parts import at, checked, made
from maneuver_automaton.scenario.schema import (
    AutomatonPart,
    CostPart,
    GoalPart,
    NoisePart,
    RecedingHorizonPart,
    ScenarioFile,
    StartPart,
)
from maneuver_automaton.scenario.shapes import (
    GroundFile,
    footprint_of,
    obstacles_of,
    places_of,
    stated_footprint,
    zones_of,
)
from maneuver_automaton.scenario.vehicles import STATE_UNITS, carried_of, model_of, part_of
from maneuver_automaton.search import words

T = TypeVar("T")
Made: TypeAlias = dict[tuple[object, ...], Any]  # of parts of a file, which several vehicles share
OTHER_KINDS: Mapping[str, set[str]] = {  # of files, and what only they have
    "a library of trims": {"format", "trims"},
    "a plan": {"status", "primitives"},
    "a closed loop": {"status", "step_s", "steps"},
    "plans of a fleet": {"status", "kind", "vehicles"},
    "a build file": {"library", "trims"},
}


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Scenario:
    """What a scenario file describes, or a file of another format and a scenario beside it."""

    name: str
    problem: Problem
    time_limit_s: float = 5.0  # upper bound for search and refinement [s]
    receding_horizon: RecedingHorizonPart | None = None
    maps: tuple[MapFile, ...] = ()  # files of the maps among the obstacles
    ground_files: tuple[GroundFile, ...] = ()  # of what places cost
    stated: AutomatonPart | None = None  # the automaton, as the file states it
    path: Path | None = None
    timing_s: Mapping[str, float] = field(default_factory=dict)  # load, automaton [s]

    __repr__ = brief

    @property
    def problems(self) -> tuple[Problem, ...]:
        """The one that it states."""
        return (self.problem,)

    @property
    def footprint(self) -> tuple[Mapping[str, Any], ...]:
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


def check_schema(document: Document) -> None:
    """A file of another kind or schema is told before its keys are; raises InvalidScenario."""
    if not isinstance(document.value, dict):
        return
    for kind, keys in OTHER_KINDS.items():
        if keys <= document.value.keys():
            raise document.error((), f"is {kind}, need a scenario")
    if "schema" not in document.value:
        raise document.error((), "the key 'schema' is missing: no scenario, need schema: 1")
    schema = document.value["schema"]
    if schema != 1 or not isinstance(schema, int) or isinstance(schema, bool):
        what = "need 1, the schema that this version reads"
        raise document.error(("schema",), f"got {shown(schema)}, {what}")


def scenario_of_document(
    document: Document,
    *,
    path: Path | None,
    begin: float,
    own: Model | None = None,
    shared: Made | None = None,
) -> Scenario:
    """The scenario of a YAML file that was read since `begin` [s]; its vehicle is `own` if given.

    What is in `shared` is taken from there, and what is made is kept in it.
    """
    check_schema(document)
    file = checked(document, ScenarioFile, _names_of(document.value, own))
    if file.search.method == "words":
        _refuse_long_words(document, file)
    folder = path.parent if path else Path()
    kept: Made = {} if shared is None else shared

    def once(keys: tuple[str, ...], make: Callable[[], T]) -> T:
        """What `make` returns of the parts at some keys; the same, of the same parts."""
        key = (*keys, *(id(document.value.get(key)) for key in keys))
        if key not in kept:
            kept[key] = make()
        found: T = kept[key]
        return found

    model, bodies = once(("vehicle",), lambda: _vehicle(document, file, own))
    obstacles, maps = once(("obstacles",), lambda: obstacles_of(document, file.obstacles, folder))
    read = time.perf_counter()
    automaton = once(
        ("vehicle", "automaton"),
        lambda: automaton_of(document, file.automaton, model, folder=folder),
    )
    built = time.perf_counter()
    _check_ends(document, file, automaton)
    cost = once(("vehicle", "automaton", "cost"), lambda: cost_of(document, file.cost, automaton))
    place_costs, ground_files = once(
        ("vehicle", "cost", "obstacles"), lambda: places_of(document, file.cost, folder)
    )
    if walls := [one.walls for one in ground_files if one.walls is not None]:
        obstacles = (*obstacles, *walls)
    fastest = max(math.hypot(*trim.body_velocity[:2]) for trim in automaton.trims)
    zones = once(
        ("vehicle", "automaton", "zones"),
        lambda: zones_of(document, file.zones, folder, fastest=fastest),
    )
    time_s = None if file.horizon.time_s == "free" else file.horizon.time_s
    wrong = "max_time_s" if file.horizon.max_time_s is not None else "stay"
    with at(document, ("horizon",) if time_s is None else ("horizon", wrong)):
        horizon = made(Horizon, file.horizon, time=time_s)
    vias = []
    for k, part in enumerate(file.via):
        with at(document, ("via", k), about="via"):
            vias.append(made(Via, part))
    with at(document, ()):
        problem = Problem(
            automaton,
            file.start.pose,
            tuple(
                made(
                    Goal,
                    one,
                    free_heading=one.heading == "free",
                    state=_by_name(one.state, automaton),
                )
                for one in file.goals
            ),
            cost=cost,
            horizon=horizon,
            start_trim=file.start.trim,
            start_state=_by_name(file.start.state, automaton),
            start_time=file.start.time_s,
            bounds=made(Bounds, file.bounds_m),
            search=made(SearchSettings, file.search),
            obstacles=obstacles,
            margin=file.margin_m,
            zones=zones,
            place_costs=place_costs,
            via=tuple(vias),
            order=file.order,
            **bodies,
        )
    return Scenario(
        name=(stem_of(path) if path else document.name) if file.name is None else file.name,
        problem=problem,
        time_limit_s=file.search.time_limit_s,
        receding_horizon=file.receding_horizon,
        maps=maps,
        ground_files=ground_files,
        stated=file.automaton,
        path=path,
        timing_s={"load": read - begin, "automaton": built - read},
    )


def _vehicle(
    document: Document, file: ScenarioFile, own: Model | None
) -> tuple[Model, dict[str, Any]]:
    """The model of a file, and the bodies that it moves, as `Problem` takes them."""
    with at(document, ("vehicle",)):
        model = model_of(file.vehicle, own=own)
    carried = {
        name: footprint_of(document, body, key=name)
        for name, body in carried_of(file.vehicle).items()
    }
    return model, {
        "footprint": footprint_of(document, file.vehicle.footprint, key="footprint"),
        "parts": carried,
        "body_height": file.vehicle.footprint_height_m or (0.0, 0.0),
    }


def _names_of(value: Any, own: Model | None) -> dict[str, Any]:
    """How many numbers a control and a state have, and what they are called."""
    kind: Any = own
    if own is None:
        vehicle = value.get("vehicle") if isinstance(value, dict) else None
        model = vehicle.get("model") if isinstance(vehicle, dict) else None
        kind = KINDS.get(model) if isinstance(model, str) else None
        with contextlib.suppress(ValueError, LookupError):  # its trailers are counted where stated
            kind = kind and model_of(part_of(str(model)).model_validate(vehicle))
    names = {} if own is None else {"own": own.name}
    if kind is None:
        return names
    return {**names, "control_names": kind.control_names, "state_names": kind.reduced_names}


def _refuse_long_words(document: Document, file: ScenarioFile) -> None:
    """Exhaustive search is for short words."""
    turned = any(goal.heading == "free" for goal in file.goals)
    most = words.most_admitted(free_heading=turned, fixed=file.horizon.time_s != "free")
    if file.horizon.max_trims is not None and file.horizon.max_trims > most:
        free = " where a heading is free" if turned else ""
        raise document.error(
            ("horizon", "max_trims"),
            f"got {file.horizon.max_trims} for the method words, need at most {most}{free}; "
            "the method insertion has no limit",
        )


def _check_ends(document: Document, file: ScenarioFile, automaton: Automaton) -> None:
    """Raise where poses have not as many numbers as the vehicle's, or a trim is none of its own."""
    dof = automaton.model.group.dof
    many = isinstance(file.goal, tuple)
    goals = {("goal", k) if many else ("goal",): goal for k, goal in enumerate(file.goals)}
    for where, end in ({("start",): file.start} | goals).items():
        if len(end.pose) != dof:
            names = "[x, y, heading]" if dof == 3 else "[x, y, heading, z]"
            said = f"got {len(end.pose)} numbers, need {dof}: {names}"
            raise document.error((*where, "pose"), said)
        _check_trim(document, (*where, "trim"), end.trim, automaton)
        if end.state is not None:
            _check_state(document, (*where, "state"), end, automaton)
    if file.bounds_m.z is not None and dof == 3:
        raise document.error(("bounds_m", "z"), f"the {automaton.model.name} has no height")
    for k, zone in enumerate(file.zones):
        for n, name in enumerate(zone.trims or ()):
            _check_trim(document, ("zones", k, "trims", n), name, automaton)


def state_keys(names: Sequence[str]) -> dict[str, str]:
    """The key in a file of each component of a reduced state: its name, with the unit if known."""
    return {name: f"{name}_{STATE_UNITS[name]}" if name in STATE_UNITS else name for name in names}


def _by_name(state: Mapping[str, float] | None, automaton: Automaton) -> dict[str, float] | None:
    if state is None:
        return None
    keys = state_keys(automaton.model.reduced_names)
    return {name: state[key] for name, key in keys.items() if key in state}


def _check_state(
    document: Document, where: Where, end: StartPart | GoalPart, automaton: Automaton
) -> None:
    """Raise where a state is none of the vehicle."""
    keys = state_keys(automaton.model.reduced_names)
    for key in end.state or ():
        if keys and key not in keys.values():
            raise document.error(
                (*where, key), f"is no key here, need some of {', '.join(keys.values())}"
            )
    with at(document, where):
        settled_state(automaton, _by_name(end.state, automaton), str(where[0]), trim=end.trim)


def _check_trim(document: Document, where: Where, trim: str | None, automaton: Automaton) -> None:
    if trim is not None:
        with at(document, where):
            automaton.index_of(trim)


def cost_of(
    document: Document, part: CostPart, automaton: Automaton, *, within: Where = ()
) -> Cost:
    """The cost that a part of a document states, `within` another part of it."""
    matrix = part.effort_matrix
    where = (*within, "cost") if matrix is None else (*within, "cost", "effort_matrix")
    if matrix is not None and len({len(row) for row in matrix} | {len(matrix)}) > 1:
        rows = ", ".join(str(len(row)) for row in matrix)
        raise document.error(
            where, f"got {len(matrix)} rows of {rows} numbers, need a square matrix"
        )
    with at(document, where):
        cost = made(Cost, part, norm_order=float(part.norm_order))  # inf is a number, too
        cost.rates(automaton.controls[:1], automaton.body_velocities[:1])
    return cost


def states_several(document: Document) -> bool:
    """Whether a scenario file is one of several vehicles."""
    value = document.value
    return isinstance(value, dict) and not {"vehicles", "fleet"}.isdisjoint(value)


def disturbance_of(part: NoisePart, *, seed: int | None = None) -> simulation.Disturbance:
    """What a file says of disturbances, with another seed if one is given."""
    known: dict[str, Any] = {} if seed is None else {"seed": seed}
    known["pushes"] = {push.after_step: push.by for push in part.pushes}
    return made(simulation.Disturbance, part, **known)


TPCAP = """\
schema: 1
name: The car of TPCAP
vehicle:
  model: car
  wheelbase_m: 2.8
  max_steering_rad: 0.75
  footprint: {rectangle_m: [4.689, 1.942], reference_m: [-1.4155, 0.0]}
automaton: {preset: reeds_shepp}
start: {pose: [0.0, 0.0, 0.0]}
goal: {pose: [0.0, 0.0, 0.0]}
cost: {length: 1.0}
"""
CL_CBS = """\
schema: 1
name: The car of CL-CBS
vehicle:
  model: car
  wheelbase_m: 2.0
  max_steering_rad: 0.5880026035475675
  footprint: {rectangle_m: [3.0, 2.0], reference_m: [-0.5, 0.0]}
automaton:
  trims:
    - {name: rest, control: [0.0, 0.0]}
    - {name: left, control: [1.0, 0.5880026035475675]}
    - {name: straight, control: [1.0, 0.0]}
    - {name: right, control: [1.0, -0.5880026035475675]}
    - {name: back left, control: [-1.0, 0.5880026035475675]}
    - {name: back, control: [-1.0, 0.0]}
    - {name: back right, control: [-1.0, -0.5880026035475675]}
start: {pose: [0.0, 0.0, 0.0]}
goal: {pose: [0.0, 0.0, 0.0]}
cost: {time: 1.0}
"""


def combined(statement: Statement, beside: Scenario | None, *, path: Path) -> Scenario:
    """The problem that a file `path` states, completed by the scenario `beside` it."""
    rest = own_scenario(statement, path) if beside is None else beside
    problem = rest.problem
    start_trim, goals = problem.start_trim, problem.goals
    if statement.goal is not None:
        free = goals[0].free_heading and not statement.headings
        goals = (replace(goals[0], pose=statement.goal, free_heading=free),)
    if (vehicle := statement.vehicle) is not None:
        automaton = _automaton_of(vehicle, rest, path)
        if not automaton.is_kinematic:
            start_trim = _trim_at(automaton, statement.start_state, path=path)
            goal_trim = _trim_at(automaton, statement.goal_state, path=path)
            goals = tuple(replace(goal, trim=goal_trim) for goal in goals)
        problem = replace(
            problem,
            automaton=automaton,
            start_trim=start_trim,
            goals=goals,
            parts=dict(vehicle.parts),
        )
    return replace(
        rest,
        name=statement.name,
        problem=replace(
            problem,
            start=problem.start if statement.start is None else statement.start,
            goals=goals,
            bounds=Bounds(
                x=statement.bounds.x or problem.bounds.x,
                y=statement.bounds.y or problem.bounds.y,
                z=statement.bounds.z or problem.bounds.z,
            ),
            obstacles=statement.obstacles,
            footprint=problem.footprint if statement.footprint is None else statement.footprint,
        ),
        maps=statement.maps,
        path=path,
    )


def own_scenario(statement: Statement, path: Path) -> Scenario:
    """What a format means where no scenario stands beside the file; raises InvalidScenario."""
    cars = {tpcap.FORMAT: TPCAP, cl_cbs.FORMAT: CL_CBS}
    if statement.format in cars:
        return scenario_of_text(cars[statement.format], name=statement.format)
    vehicle, start, goal = statement.vehicle, statement.start, statement.goal
    if vehicle is not None and start is not None and goal is not None:
        problem = Problem(vehicle.automaton, start, goal, cost=Cost(time=1.0))
        return Scenario(name=statement.name, problem=problem)
    missing = "vehicle" if start is not None else "vehicle, start or goal"
    raise InvalidScenario(
        f"{path}: states no {missing} ({statement.format}); need --with and a scenario that does"
    )


def _trim_at(automaton: Automaton, state: Array | None, *, path: Path) -> str | None:
    """The name of a trim of a reduced state, rather one at rest; None if no state is stated."""
    if state is None:
        return None
    here = [
        trim
        for trim in automaton.trims
        if np.abs(trim.reduced_state - state).max() <= STATE_TOLERANCE
    ]
    if not here:
        names = ", ".join(automaton.model.reduced_names)
        raise InvalidScenario(
            f"{path}: starts or ends with ({names}) = {vector_text(state)}, where the library has "
            "no trim; need one"
        )
    return min(here, key=lambda trim: not trim.is_rest).name


def _automaton_of(vehicle: StatedVehicle, beside: Scenario, path: Path) -> Automaton:
    """The scenario's trims, driven by the vehicle that the file names."""
    given, model = beside.problem.automaton, vehicle.automaton.model
    if given is vehicle.automaton:
        return given
    what = f"{path}: its vehicle is {vehicle.name}"
    if given.model.name != model.name:
        raise InvalidScenario(
            f"{what}, a {model.name}, but the scenario of --with has a {given.model.name}; "
            "need the same"
        )
    if model.reduced_names:
        if given.model != model:
            raise InvalidScenario(
                f"{what}, a {model.name} of other size or limits than that of the scenario of "
                f"--with; need {model}"
            )
        return given
    for trim in given.trims:
        for name, value, (low, high) in zip(
            model.control_names, trim.control, vehicle.limits, strict=True
        ):
            if not low <= value <= high:
                raise InvalidScenario(
                    f"{what}, but trim {trim.name!r} of the scenario of --with has {name} "
                    f"{value:g}, need {low:g} to {high:g}"
                )
    return Automaton.of_controls(model, {trim.name: np.array(trim.control) for trim in given.trims})

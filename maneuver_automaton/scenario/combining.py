"""A file that states a part of a problem, and a scenario for the rest: together, a scenario.

What the file states wins. Its obstacles, bounds, start and goal replace those of the scenario; the
goal keeps the scenario's trim and tolerances, and, where the file states no heading, its free
heading. Cost, horizon, margin, search and closed loop are the scenario's, and so are automaton and
body, unless the file names its vehicle.

Three formats do without a scenario. TPCAP and CL-CBS have one car each; dynobench has its own
models, whose trims are then all combinations of extreme controls, or, with inertia, a grid of trims
and the maneuvers between them; its cost is time.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from maneuver_automaton._arrays import Array, vector_text
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.costs import Cost
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.statement import StatedVehicle, Statement
from maneuver_automaton.problem import Bounds, Problem
from maneuver_automaton.scenario.scenario import Scenario, scenario_of_text

STATE_TOLERANCE = 1e-9  # between a reduced state that a file states and a trim's, in its units
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
    from maneuver_automaton.formats import cl_cbs, tpcap

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

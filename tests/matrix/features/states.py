"""Features of reduced states: a start that no trim has, and wheels that do not turn at rest."""

from __future__ import annotations

import functools
import math
from dataclasses import replace
from typing import Any

import numpy as np

from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.library import load_stock_library
from maneuver_automaton.collision import Disc
from maneuver_automaton.problem import Problem
from maneuver_automaton.scenario.scenario import scenario_of_text
from maneuver_automaton.scenario.vehicles import MODELS
from tests.matrix.measuring import asked
from tests.matrix.outside import Course, defect
from tests.matrix.rows import Engine, changed, feature, without
from tests.matrix.scenes import pillar
from tests.matrix.vehicles import Vehicle

DRIVEN = 1e-6  # by which a motion may be off the dynamics from sample to sample


def _no_state(vehicle: Vehicle) -> str:
    if not vehicle.rotates:
        return "belong to headings, so it cannot start or end in a state between them"
    return "" if vehicle.inertia else "has no reduced state: it changes its velocity at will"


@feature(without("start_state"), on="user", refused=_no_state, says="reduced state")
def off_library_start(vehicle: Vehicle, engine: Engine) -> None:
    """It starts between two trims, past a pillar, and keeps to its dynamics from there."""
    library = vehicle.automaton
    rest = library.trims[library.rest or 0]
    one, other = (
        library[name] if name else rest for name in (vehicle.end_trim, vehicle.moving_trim)
    )
    state = 0.37 * one.reduced_state + 0.63 * other.reduced_state
    state = state if state.size else np.zeros(1)
    block = [pillar(vehicle)]
    result = asked(vehicle, engine, start_trim=None, start_state=state, obstacles=block)
    first = Course.driven(result.plan, vehicle.automaton.model, step_m=0.1).state[0]
    assert np.abs(first - state).max() <= 1e-9, f"it starts in {first}"
    off = defect(result.plan, vehicle.automaton.model)
    assert off <= DRIVEN, f"a motion is {off:.3g} off its dynamics"


FILE = """
schema: 1
vehicle: {{model: {}, steering_at_rest: forbidden}}
automaton: {{preset: table2}}
start: {{pose: [0, 0, 0]}}
goal: {{pose: [1, 3, 0]}}
"""
STANDS = 1e-3  # [m/s]


def _never(vehicle: Vehicle) -> Automaton:
    """Its library for a model that never turns its wheels, or bends, while it stands."""
    library = vehicle.automaton
    model = replace(library.model, steering_at_rest=math.inf)  # type: ignore[type-var]
    courses = [(one, one.course) for one in library.maneuvers if one.course]
    kept = [one for one, c in courses if _turned(model, c.reduced_state, c.control) == 0.0]
    return Automaton(model, library.trims, kept)


def _turned(model: Any, states: np.ndarray, controls: np.ndarray) -> float:
    """How far [rad] it steers between samples between which it stands."""
    speeds, angles = model.steered(states, controls)
    return float(np.abs(np.diff(angles))[speeds <= STANDS].sum())


def _takes_its_time_to_steer(vehicle: Vehicle) -> bool:
    return hasattr(vehicle.automaton.model, "steering_at_rest")


def _stops_and_steers(problem: Problem) -> Problem:
    """The same for a car that turns its wheels at rest, as it does along a first path."""
    search = replace(problem.search, improve=False, polish=False)
    return replace(problem, automaton=load_stock_library("second_order_car"), search=search)


@feature(
    changed(_stops_and_steers),
    on="second_order_car",
    applies=lambda vehicle: vehicle.automaton.model.name in MODELS,
    refused=lambda vehicle: "" if _takes_its_time_to_steer(vehicle) else "unknown key",
    says="they turn at rest",
)
def no_steering_at_rest(vehicle: Vehicle, engine: Engine) -> None:
    """To the side, where a car would turn its wheels between two strokes, it does so under way."""
    model = vehicle.automaton.model
    if not _takes_its_time_to_steer(vehicle):
        scenario_of_text(FILE.format(model.name), name="cell")
        return
    goal = vehicle.target(pose=[1.0, 3.0, 0.0])
    never = replace(vehicle, library=functools.partial(_never, vehicle))
    for obstacles in ([], [Disc(0.5, [6.0, 4.0])]):
        result = asked(never, engine, goals=goal, obstacles=obstacles)
        seen = Course.driven(result.plan, model, step_m=0.05)
        turned = _turned(model, seen.state, seen.control)
        assert turned <= 1e-6, f"they turn at rest by {turned:.3g}"

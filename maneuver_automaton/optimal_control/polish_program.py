"""Polishing in symbols: the transcription, paths of the body, walls and limits between nodes."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.models import Model
from maneuver_automaton.optimal_control._casadi import load_casadi, numpy_on_symbols
from maneuver_automaton.optimal_control.polish_values import (
    Ends,
    Point,
    PolishSettings,
    Scene,
)
from maneuver_automaton.optimal_control.problem import (
    Components,
    Grid,
    Guess,
    OptimalControlProblem,
    RunningCost,
)
from maneuver_automaton.optimal_control.separation import (
    BodyPart,
    Frames,
    Lines,
    Pairs,
    Paths,
    Reach,
    first_lines,
    near_pairs,
    paths,
    reaches,
)
from maneuver_automaton.optimal_control.transcription import Transcription, transcribe
from maneuver_automaton.optimal_control.vehicles import moving_frame

POINT = BodyPart(solids=((np.zeros((1, 2)), 0.0),))  # the reference point alone
LEAST_PACE, MOST_PACE = 0.02, 50.0  # of a phase, against the even pace of the guess
CURVED = 20.0  # times the tightening for reduced states that do not run straight


class Program(NamedTuple):
    """The problem in symbols, but for the lines."""

    casadi: Any
    scene: Scene
    settings: PolishSettings
    written: Transcription
    paths: list[Paths]
    numbers: Any  # function: variables of the transcription -> x and y of the control points
    objective: Any
    below: Any  # (m,) further expressions that must not be positive
    zero: Any  # (m,) further expressions that must be zero
    paced: bool

    @property
    def n_intervals(self) -> int:
        """Number of intervals."""
        return self.written.grid.n_nodes - 1

    @property
    def size(self) -> int:
        """Number of variables without lines."""
        return len(self.written.bounds)

    def values(self, point: Point) -> tuple[Array, Array, float]:
        """State, control and duration as the transcription has them."""
        duration = float(point.durations.sum())
        pace = point.durations[:, None] * (self.n_intervals / duration)
        control = np.hstack([point.control, pace]) if self.paced else point.control
        return point.state, control, duration

    def points(self, point: Point) -> list[tuple[Array, Array]]:
        """Control points of every solid of the body, in numbers."""
        if not self.paths:
            return []
        state, control, duration = self.values(point)
        found = [m.full() for m in self.numbers(state.T, control.T, duration)]
        return list(zip(found[0::2], found[1::2], strict=True))


def program_of(
    model: Model,
    ends: Ends,
    scene: Scene,
    settings: PolishSettings,
    stage_cost: RunningCost | None,
    gears: Array | None,
    guess: Guess,
) -> Program:
    """The program of a vehicle, its ends and its scene, on as many intervals as the guess has.

    With `gears`, the sign of the speed ahead in every interval, time has a pace of its own in every
    stretch of one sign.
    """
    casadi = load_casadi()
    problem = _problem(model, ends, settings, stage_cost)
    n_u, count = problem.n_controls, len(guess.control) if gears is None else len(gears)
    if gears is not None:
        problem = _paced(problem, guess.duration)
    written = transcribe(problem, Grid(n_nodes=count + 1, rule="rk4"))
    state, control = written.state, written.control[:n_u, :]
    pace = casadi.SX.ones(1, count) if gears is None else written.control[n_u, :]
    step = (written.duration / count) * pace
    with numpy_on_symbols(casadi):
        begin = _frames(casadi, model, state[:, :count], control)
        end = _frames(casadi, model, state[:, 1:], control)
        found = paths(casadi, scene.parts, begin, end, step=step)
        (swing,) = paths(casadi, (POINT,), begin, end, step=step)
        below = _between(model, begin, end, step=step, settings=settings)
    zero = []
    for a, b, c in scene.walls:
        along = a * swing.x + b * swing.y - (c - settings.tightening)
        below.append(casadi.vec(along[1, : count - 1]))  # nodes but for the first and the last
        below.append(casadi.vec(along[2:, :]) - 2.0 * settings.tightening)
    if gears is not None:
        sign = casadi.DM(np.asarray(gears, dtype=np.float64)).T
        below += [-(sign * at.twist[0]).T for at in (begin, end)]
        same = np.flatnonzero(np.diff(gears) == 0)
        zero.append((pace[:, (same + 1).tolist()] - pace[:, same.tolist()]).T)
    variables = [written.state, written.control, written.duration]
    return Program(
        casadi=casadi,
        scene=scene,
        settings=settings,
        written=written,
        paths=found,
        numbers=casadi.Function("paths", variables, [m for path in found for m in path]),
        objective=written.objective + settings.change * _changes(casadi, model, control),
        below=casadi.vertcat(*below),
        zero=casadi.vertcat(*zero),
        paced=gears is not None,
    )


def _between(
    model: Model, begin: Frames, end: Frames, *, step: Any, settings: PolishSettings
) -> list[Any]:
    """What keeps reduced states inside their limits between nodes, where they do not run straight.

    The control points of the cubic with the same values and rates at both nodes are kept inside.
    """
    rows = []
    limits = _tight(model, settings)
    for k in _curved(model):
        low, high = limits[k]
        points = (begin.reduced[k, :] + step / 3.0 * begin.reduced_rates[k, :],
                  end.reduced[k, :] - step / 3.0 * end.reduced_rates[k, :])  # fmt: skip
        for point in points:
            rows += [(point - high).T] if np.isfinite(high) else []
            rows += [(low - point).T] if np.isfinite(low) else []
    return rows


def _tight(model: Model, settings: PolishSettings) -> Array:
    """Limits (n_z, 2) of the reduced state with room for closure, more where it runs curved."""
    by = np.full((len(model.reduced_names), 1), settings.tightening)
    by[_curved(model)] *= CURVED
    return np.asarray(model.reduced_limits + by * np.array([1.0, -1.0]))


def _curved(model: Model) -> list[int]:
    """Numbers of the reduced states whose rates depend on reduced states."""
    casadi = load_casadi()
    z = casadi.SX.sym("z", len(model.reduced_names))
    u = casadi.SX.sym("u", len(model.control_names))
    with numpy_on_symbols(casadi):
        rates = list(model.dynamics(casadi.vertsplit(z), casadi.vertsplit(u)))
    if not rates:
        return []
    depends = casadi.which_depends(casadi.vertcat(*map(casadi.SX, rates)), z, 1, True)
    return [k for k, bent in enumerate(depends) if bent]


def _problem(
    model: Model, ends: Ends, settings: PolishSettings, stage_cost: RunningCost | None
) -> OptimalControlProblem:
    """Least time, a little effort, and what else is asked for."""
    dof = model.group.dof
    scale = _scales(model)
    rates = _ends_in_rates(model)

    def cost(x: Components, u: Components) -> Any:
        effort = sum((u[k] / scale[k]) ** 2 for k in rates)
        more = 0.0 if stage_cost is None else stage_cost(x[dof:], u)
        return 1.0 + settings.effort * effort + more

    limits = np.vstack([np.tile([-np.inf, np.inf], (dof, 1)), _tight(model, settings)])
    for state in (ends.start, ends.end):
        values = np.array([math.nan if value is None else value for value in state])
        limits[:, 0], limits[:, 1] = np.fmin(limits[:, 0], values), np.fmax(limits[:, 1], values)
    return OptimalControlProblem(
        state_names=(*model.group.coordinates, *model.reduced_names),
        control_names=model.control_names,
        dynamics=moving_frame(model.group, velocity=model.velocity, reduced=model.dynamics),
        start=ends.start,
        end=ends.end,
        duration=ends.duration,
        stage_cost=cost,
        state_limits=limits,
        control_limits=_within(model.control_limits, settings.tightening),
    )


def _paced(problem: OptimalControlProblem, duration: float) -> OptimalControlProblem:
    """The problem with a pace as a further control: time runs faster or slower."""
    assert problem.control_limits is not None
    dynamics, cost = problem.dynamics, problem.stage_cost
    assert cost is not None
    return replace(
        problem,
        control_names=(*problem.control_names, "pace"),
        dynamics=lambda x, u: [u[-1] * rate for rate in dynamics(x, u[:-1])],
        stage_cost=lambda x, u: u[-1] * cost(x, u[:-1]),
        duration=(duration, duration),
        control_limits=np.vstack([problem.control_limits, [[LEAST_PACE, MOST_PACE]]]),
    )


def _frames(casadi: Any, model: Model, state: Any, control: Any) -> Frames:
    dof = model.group.dof
    z, u = casadi.vertsplit(state[dof:, :]), casadi.vertsplit(control)
    ones = casadi.SX.ones(1, state.shape[1])
    rates = [casadi.SX(rate) * ones for rate in model.dynamics(z, u)]
    return Frames(
        pose=state[:dof, :],
        twist=[casadi.SX(v) * ones for v in model.velocity(z, u)],
        reduced=state[dof:, :],
        reduced_rates=casadi.vertcat(*rates),
    )


def _changes(casadi: Any, model: Model, control: Any) -> Any:
    """How much the controls change from interval to interval, squared and scaled."""
    scaled = control / casadi.DM(_scales(model))
    steps = scaled[:, 1:] - scaled[:, :-1]
    return casadi.sumsqr(steps)


def _scales(model: Model) -> Array:
    """Sizes (n_u,) of the controls: their greatest values, 1 where there is no limit."""
    most = np.abs(model.control_limits).max(axis=1)
    return np.where(np.isfinite(most), most, 1.0)


def _ends_in_rates(model: Model) -> list[int]:
    """Numbers of the controls that the velocity does not depend on: accelerations and such."""
    casadi = load_casadi()
    z = casadi.SX.sym("z", len(model.reduced_names))
    u = casadi.SX.sym("u", len(model.control_names))
    with numpy_on_symbols(casadi):
        velocity = model.velocity(casadi.vertsplit(z), casadi.vertsplit(u))
    twist = casadi.vertcat(*(casadi.SX(v) for v in velocity))
    depends = casadi.which_depends(twist, u, 1, False)
    return [k for k, used in enumerate(depends) if not used]


def _within(limits: Array, by: float) -> Array:
    return np.asarray(limits + np.array([by, -by]))


def lines_at(program: Program, point: Point, pairs: Pairs) -> Lines:
    """First lines for pairs, from a point; see `first_lines`."""
    return first_lines(program.points(point), program.scene.body, program.scene.pieces, pairs)


def pairs_near(program: Program, point: Point, within: float) -> Pairs:
    """Pairs nearer than `within` [m] at a point; see `near_pairs`."""
    scene = program.scene
    if not (scene.pieces and scene.parts):
        empty = np.zeros(0, dtype=np.int64)
        return Pairs(empty, empty, empty)
    return near_pairs(program.points(point), scene.body, scene.pieces, within=within)


def reaches_at(program: Program, point: Point, pairs: Pairs, lines: Lines) -> Reach:
    """How far both sides of lines come at a point; see `reaches`."""
    return reaches(program.points(point), program.scene.both, pairs, lines)

"""Turnpikes: the longer the path, the longer the best motion stays near a trim."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from maneuver_automaton._arrays import Array, as_number
from maneuver_automaton.models import Model
from maneuver_automaton.optimal_control import (
    Guess,
    OptimalControlProblem,
    OptimalControlSolution,
    SolverSettings,
    TimeGrid,
    moving_frame,
    solve,
)
from maneuver_automaton.optimal_control.problem import RunningCost, increments
from maneuver_automaton.primitives import Maneuver, Trajectory, Trim


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class TurnpikeCase:
    """One path: what the automaton pays for it, and the best motion between the same ends."""

    coast: float  # [s] in the trim, in the automaton's plan
    duration: float  # [s] of both
    goal: Array  # (dof,) where both end
    automaton_cost: float
    optimum: OptimalControlSolution
    away: float  # [s] for which the optimum is far from the trim

    @property
    def gap(self) -> float:
        """What the automaton pays more than the optimum."""
        return self.automaton_cost - self.optimum.cost


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Turnpike:
    """A trim held over longer and longer paths, and the optimum for each of them."""

    trim: Trim
    reduced_names: tuple[str, ...]
    unit_cost: float  # of the trim, per second
    distance: float  # from the trim's reduced state that counts as far [its units]
    cases: tuple[TurnpikeCase, ...]


def turnpike(
    model: Model,
    *,
    source: Trim,
    up: Maneuver,
    trim: Trim,
    down: Maneuver,
    target: Trim,
    stage_cost: RunningCost,
    coasts: Sequence[float],
    distance: float = 0.1,
    step: float = 0.1,
    settings: SolverSettings | None = None,
) -> Turnpike:
    """Hold the word (maneuver up, trim, maneuver down) against the full optimal control problem.

    The goal is where the automaton comes to, after as long as it takes. If the trim
    gets on at the least cost, the optimum follows it but for a while at either end that does not
    grow with the path, and the automaton pays more by a sum that does not grow either.

    Source: Faulwasser, Flaßkamp, Ober-Blöbaum, Worthmann (2019), *Towards velocity turnpikes in
    optimal control of mechanical systems*; the paper, Sec. 5.

    Parameters
    ----------
    model : Model
        The vehicle.
    source, up, trim, down, target : Trim and Maneuver
        The word; both maneuvers have a course.
    stage_cost : callable
        ``l(z, u)`` per second, of the components of reduced state and control.
    coasts : sequence of float
        Times in the trim [s].
    distance : float
        How far a component of the reduced state may be from the trim's to be near, in its units.
    step : float
        Time between nodes of the optimal control problem [s].
    settings : SolverSettings, optional
        When the solver stops.

    Raises
    ------
    MissingExtra
        If CasADi is not installed.
    ValueError
        If a maneuver has no course, or a coast is no positive time.
    """
    for maneuver in (up, down):
        if maneuver.course is None:
            raise ValueError(f"turnpike: maneuver {maneuver.name!r} has no course")
    distance, step = as_number("distance", distance), as_number("step", step)
    coasts = [as_number("coasts", coast) for coast in coasts]
    if not len(coasts) or not min(coasts) > 0.0:
        raise ValueError(f"turnpike: coasts must be positive times, got {list(coasts)} s")
    unit_cost = float(stage_cost(list(trim.reduced_state), list(trim.control)))
    ends = sum(_course_cost(model, one.course, stage_cost) for one in (up, down) if one.course)
    cases = []
    for coast in coasts:
        word = _trajectory_of(model, source, up, trim, down, coast=float(coast))
        optimum = _optimum(model, word, target, stage_cost, step=step, settings=settings)
        # Time [s] for which a component of the reduced state is farther from the trim's.
        off = np.abs(optimum.state[:, model.group.dof :] - trim.reduced_state).max(axis=1)
        far = np.maximum(off[:-1], off[1:]) > distance
        cases.append(
            TurnpikeCase(
                coast=float(coast),
                duration=float(word.time[-1]),
                goal=word.pose[-1],
                automaton_cost=ends + float(coast) * unit_cost,
                optimum=optimum,
                away=float(np.diff(optimum.time)[far].sum()),
            )
        )
    return Turnpike(
        trim=trim,
        reduced_names=model.reduced_names,
        unit_cost=unit_cost,
        distance=distance,
        cases=tuple(cases),
    )


def _trajectory_of(
    model: Model, source: Trim, up: Maneuver, trim: Trim, down: Maneuver, *, coast: float
) -> Trajectory:
    """The word as one trajectory from the identity."""
    assert up.course is not None
    assert down.course is not None
    group = model.group
    first = group(up.displacement)
    times = np.linspace(0.0, coast, max(2, math.ceil(coast / 0.1) + 1))
    coasting = trim.coast(first, times)
    last = trim.coast(first, coast) @ group(down.course.pose)
    begin, middle = up.course, coasting.pose
    return Trajectory(
        time=np.concatenate(
            [begin.time, up.duration + times[1:], up.duration + coast + down.course.time[1:]]
        ),
        pose=np.concatenate([begin.pose, middle[1:], last.pose[1:]]),
        reduced_state=np.concatenate(
            [
                begin.reduced_state,
                np.tile(trim.reduced_state, (times.size - 1, 1)),
                down.course.reduced_state[1:],
            ]
        ),
        control=np.concatenate(
            [begin.control[:-1], np.tile(trim.control, (times.size - 1, 1)), down.course.control]
        ),
    )


def _optimum(
    model: Model,
    word: Trajectory,
    target: Trim,
    stage_cost: RunningCost,
    *,
    step: float,
    settings: SolverSettings | None,
) -> OptimalControlSolution:
    """The best motion between the ends of the word, in its time, from the word as a guess."""
    dof, duration = model.group.dof, float(word.time[-1])
    free = np.tile([-np.inf, np.inf], (dof, 1))
    problem = OptimalControlProblem(
        state_names=(*model.group.coordinates, *model.reduced_names),
        control_names=model.control_names,
        dynamics=moving_frame(model.group, velocity=model.velocity, reduced=model.dynamics),
        start=(*word.pose[0], *word.reduced_state[0]),
        end=(*word.pose[-1], *target.reduced_state),
        duration=(duration, duration),
        stage_cost=lambda x, u: stage_cost(x[dof:], u),
        state_limits=np.concatenate([free, model.reduced_limits]),
        control_limits=model.control_limits,
    )
    n_nodes = 1 + math.ceil(duration / step)
    rows = np.concatenate([word.pose, word.reduced_state], axis=1)
    at = np.linspace(0.0, duration, n_nodes)
    guess = Guess.of_motion(at, known=word.time, state=rows, control=word.control)
    return solve(problem, TimeGrid(n_nodes=n_nodes, rule="rk4"), guess=guess, settings=settings)


def _course_cost(model: Model, course: Trajectory, stage_cost: RunningCost) -> float:
    """Cost along a course, by a step of Runge-Kutta from sample to sample."""

    def field(z: Array, u: Array) -> Array:
        rates = [*model.dynamics(list(z), list(u)), stage_cost(list(z), list(u))]
        return np.array([np.broadcast_to(rate, z.shape[1:]) for rate in rates])

    added = increments(
        "rk4",
        field,
        state=course.reduced_state.T,
        control=course.control[:-1].T,
        step=np.diff(course.time),
    )
    return float(added[-1].sum())

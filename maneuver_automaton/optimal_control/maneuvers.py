"""From one steady motion to another at least cost: a program built once, solved for every pair.

Where a maneuver ends is left free, so the pose is no part of the problem: states are the reduced
states of the vehicle alone, and what the ends are is a matter of bounds and parameters.
"""

from __future__ import annotations

import itertools
import math
import time
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array, plain_numbers
from maneuver_automaton.models import Model
from maneuver_automaton.models.speeds import lateral_limit
from maneuver_automaton.optimal_control.ipopt import (
    STATUS,
    SolverSettings,
    SolveStatus,
    ipopt_options,
    load_casadi,
    numpy_on_symbols,
)
from maneuver_automaton.optimal_control.problem import (
    Grid,
    OptimalControlProblem,
    control_scale,
    resampled,
)
from maneuver_automaton.optimal_control.transcription import (
    Transcription,
    bounds_of,
    transcribe,
    unpacked,
)

WITHIN_GRIP = 1e-3  # share of the squared lateral acceleration that is kept between nodes
LEAST_GUESS_S = 0.1  # a first guess of the duration is not shorter


@dataclass(frozen=True, slots=True, kw_only=True)
class ManeuverObjective:
    """Cost of a maneuver: a price of time, one of effort, and a little of restlessness.

    Least time alone leaves the inputs open that are not in a hurry, and solvers fill them with
    chatter; a small price of the changes of the input makes them unique.

    Examples
    --------
    >>> ManeuverObjective().text
    'time 1, smoothness 0.001'
    """

    time: float = 1.0  # per second
    effort: float = 0.0  # per second of the sum of (control / its greatest value)^2
    smoothness: float = 1e-3  # per change of a control by half its range, squared

    def __post_init__(self) -> None:
        plain_numbers(self)
        for name in ("time", "effort", "smoothness"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) >= 0.0):
                raise ValueError(
                    f"objective: {name} must not be negative, got {getattr(self, name)}"
                )
        if self.time == self.effort == 0.0:
            raise ValueError("objective: got no price of time nor of effort, need one of them")

    @property
    def text(self) -> str:
        """The prices in words."""
        prices = ((name, getattr(self, name)) for name in ("time", "effort", "smoothness"))
        return ", ".join(f"{name} {price:g}" for name, price in prices if price)


@dataclass(frozen=True, slots=True, kw_only=True)
class TransferSettings:
    """How finely a maneuver is looked at, and how long it may take."""

    intervals: int = 20  # of constant control
    steps: int = 2  # of Runge-Kutta in each of them
    duration: tuple[float, float] = (0.02, 60.0)  # least and greatest [s]
    solver: SolverSettings = field(
        default_factory=lambda: SolverSettings(tolerance=1e-8, max_iterations=250)
    )

    def __post_init__(self) -> None:
        plain_numbers(self)
        for name in ("intervals", "steps"):
            if getattr(self, name) < 1:
                raise ValueError(f"maneuver: {name} must be at least 1, got {getattr(self, name)}")
        low, high = self.duration
        if not 0.0 < low < high < math.inf:
            raise ValueError(
                f"maneuver: duration must be 0 < least < greatest, got ({low}, {high}) s"
            )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class TransferProgram:
    """The nonlinear program of one model and objective; ends and limits are put in when solving.

    Variables are the reduced states, then the controls, both instant by instant, then the
    duration; the parameters are the controls before and after.
    """

    model: Model
    objective: ManeuverObjective
    settings: TransferSettings
    written: Transcription
    solver: Any
    build_s: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Transfer:
    """Answer of the solver, whatever its status: inputs in equal intervals, and their duration."""

    status: SolveStatus
    reason: str  # the solver's own word
    duration: float  # [s]
    control: Array  # (intervals, n_u)
    reduced_state: Array  # (intervals * steps + 1, n_z)
    cost: float
    iterations: int
    solve_s: float


def transfer_program(
    model: Model,
    *,
    objective: ManeuverObjective | None = None,
    settings: TransferSettings | None = None,
) -> TransferProgram:
    """Write the maneuvers of a model down, in symbols, once for all pairs of trims.

    Raises
    ------
    MissingExtra
        If CasADi is not installed.
    ValueError
        If the model has no reduced state, or its dynamics do not fit it.

    Examples
    --------
    >>> from maneuver_automaton.groups import SE2
    >>> from maneuver_automaton.models import UserModel
    >>> cart = UserModel(name="cart", group=SE2, control_names=("push",), reduced_names=("speed",),
    ...                  velocity=lambda z, u: [z[0], 0.0, 0.0], dynamics=lambda z, u: [u[0]],
    ...                  control_limits=[[-2.0, 2.0]])
    >>> found = solve_transfer(transfer_program(cart), start=np.zeros(1), end=np.ones(1),
    ...                        controls=np.zeros((2, 1)))
    >>> found.status.value, round(found.duration, 2)
    ('solved', 0.5)
    """
    began = time.perf_counter()
    casadi = load_casadi()
    objective, settings = objective or ManeuverObjective(), settings or TransferSettings()
    n_z, scale = len(model.reduced_names), control_scale(model)
    if not n_z:
        raise ValueError(f"{model.name}: has no reduced state, so its trims need no maneuvers")
    problem = OptimalControlProblem(
        state_names=model.reduced_names,
        control_names=model.control_names,
        dynamics=model.dynamics,
        start=(None,) * n_z,
        end=(None,) * n_z,
        duration=settings.duration,
        stage_cost=lambda z, u: (
            objective.effort * sum((u_i / s) ** 2 for u_i, s in zip(u, scale, strict=True))
        ),
        state_limits=model.reduced_limits,
        control_limits=model.control_limits,
    )
    nodes = settings.intervals * settings.steps + 1
    written = transcribe(problem, Grid(n_nodes=nodes, rule="rk4", held=settings.steps))
    ends = casadi.SX.sym("p", problem.n_controls, 2)
    around = casadi.horzcat(ends[:, 0], written.control, ends[:, 1])
    sizes = casadi.repmat(casadi.DM(scale), 1, settings.intervals + 1)
    changes = (around[:, 1:] - around[:, :-1]) / sizes
    cost = (
        objective.time * written.duration
        + written.objective
        + objective.smoothness * casadi.sumsqr(changes)
    )
    beyond = casadi.SX(0, 1)
    if math.isfinite(lateral_limit(model)):
        with numpy_on_symbols(casadi):  # with the control before and after each node
            twists = [
                model.velocity(casadi.vertsplit(z), casadi.vertsplit(written.inputs))[:3]
                for z in (written.state[:, :-1], written.state[:, 1:])
            ]
        most = lateral_limit(model) ** 2 * (1.0 - WITHIN_GRIP)
        rows = [(v_x * v_x + v_y * v_y) * turn * turn / most - 1.0 for v_x, v_y, turn in twists]
        beyond = casadi.vertcat(*map(casadi.vec, rows))
    functions = {
        "x": written.variables,
        "f": cost,
        "g": casadi.vertcat(written.constraints, beyond),
        "p": casadi.vec(ends),
    }
    solver = casadi.nlpsol("transfer", "ipopt", functions, ipopt_options(settings.solver))
    return TransferProgram(
        model=model,
        objective=objective,
        settings=settings,
        written=written,
        solver=solver,
        build_s=time.perf_counter() - began,
    )


def solve_transfer(
    program: TransferProgram,
    *,
    start: Array,
    end: Array,
    controls: Array,
    control_limits: Array | None = None,
    tightening: float = 0.0,
    duration: float | None = None,
    swing: float = 0.0,
) -> Transfer:
    """A local optimum from one reduced state to another, from a guess between them.

    Parameters
    ----------
    program : TransferProgram
        Of the model.
    start, end : (n_z,) arrays
        Reduced states.
    controls : (2, n_u) array
        What is put in before and after.
    control_limits : (n_u, 2) array, optional
        Narrower limits than the model's.
    tightening : float
        By which share of their range the limits are drawn in, as far as the ends admit.
    duration : float, optional
        First guess [s]; from the fastest rates of the model if left out.
    swing : float
        The guess is a straight line if 0; else the inputs go this share of the way to one limit,
        then to the other, and the states are where that leads. Where nothing moves on the straight
        line, the solver does not leave it.
    """
    model, written = program.model, program.written
    limits = model.control_limits if control_limits is None else control_limits
    controls_within = drawn_in(limits, tightening)
    within = drawn_in(model.reduced_limits, tightening)
    within[:, 0] = np.minimum(within[:, 0], np.minimum(start, end))
    within[:, 1] = np.maximum(within[:, 1], np.maximum(start, end))
    problem = replace(
        written.problem,
        start=tuple(start.tolist()),
        end=tuple(end.tolist()),
        state_limits=within,
        control_limits=controls_within,
    )
    bounds = bounds_of(problem, written.grid)
    guess_s = duration_guess(model, start, end) if duration is None else duration
    inputs = resampled(controls, written.grid.n_controls)
    path = resampled(np.array([start, end]), written.grid.n_nodes)
    if swing:
        room = np.where(np.isfinite(controls_within), controls_within, np.array([-1.0, 1.0]))
        low, high = room.T[:, None] - inputs
        first = np.arange(len(inputs))[:, None] < len(inputs) / 2.0
        inputs = inputs + abs(swing) * np.where(first == (swing > 0.0), high, low)
        path = _led_to(model, path, inputs, guess_s)
    guess = np.concatenate([path.ravel(), inputs.ravel(), [guess_s]])
    began = time.perf_counter()
    answer = program.solver(
        x0=np.clip(guess, *bounds.T),
        p=controls.ravel(),
        lbx=bounds[:, 0],
        ubx=bounds[:, 1],
        lbg=np.where(np.arange(program.solver.size1_out("g")) < len(written.limits), 0.0, -np.inf),
        ubg=0.0,
    )
    solve_s = time.perf_counter() - began
    values = np.asarray(answer["x"].full(), dtype=np.float64).ravel()
    stats = program.solver.stats()
    state, control, seconds = unpacked(problem, written.grid, values)
    return Transfer(
        status=STATUS.get(str(stats["return_status"]), SolveStatus.FAILED),
        reason=str(stats["return_status"]),
        duration=seconds,
        control=control,
        reduced_state=state,
        cost=float(answer["f"]),
        iterations=int(stats["iter_count"]),
        solve_s=solve_s,
    )


def drawn_in(limits: Array, share: float) -> Array:
    """Limits (n, 2), each drawn in by a share of its range; infinite ones stay.

    Examples
    --------
    >>> drawn_in(np.array([[-1.0, 1.0], [0.0, np.inf]]), 0.25).tolist()
    [[-0.5, 0.5], [0.0, inf]]
    """
    width = limits[:, 1] - limits[:, 0]
    by = np.where(np.isfinite(width), share * np.where(np.isfinite(width), width, 0.0), 0.0)
    return np.stack([limits[:, 0] + by, limits[:, 1] - by], axis=-1)


def duration_guess(model: Model, start: Array, end: Array) -> float:
    """Time [s] for the slowest component at the fastest rates the limits admit, half way."""
    corners = np.where(np.isfinite(model.control_limits), model.control_limits, [[-1.0, 1.0]])
    controls = np.array(list(itertools.product(*corners)))
    middle = np.broadcast_to((start + end) / 2.0, (len(controls), start.size))
    fastest = np.abs(model.reduced_dynamics(middle, controls)).max(axis=0)
    change = np.abs(end - start)
    seconds = change / np.where(fastest > 0.0, fastest, np.inf)
    return max(LEAST_GUESS_S, 1.5 * float(seconds.max(initial=0.0)))


def _led_to(model: Model, path: Array, inputs: Array, duration: float) -> Array:
    """States (count + 1, n_z) under inputs, by Euler's method; `path` where that explodes."""
    count = len(path) - 1
    held = np.repeat(inputs, count // len(inputs), axis=0)
    states = path.copy()
    with np.errstate(all="ignore"):
        for k in range(count):
            rates = model.reduced_dynamics(states[k], held[k])
            states[k + 1] = states[k] + duration / count * rates
    sane = np.isfinite(states).all() and np.abs(states).max() < 1e3 * (1.0 + np.abs(path).max())
    return states if sane else path

"""From one steady motion to another at least cost: a program built once, solved for every pair.

Where a maneuver ends is left free, so the pose is no part of the problem: states are the reduced
states of the vehicle alone, and what the ends are is a matter of bounds and parameters.
"""

from __future__ import annotations

import itertools
import math
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array, check_fields, plain_numbers
from maneuver_automaton.models import Model
from maneuver_automaton.models.speeds import lateral_limit
from maneuver_automaton.optimal_control import problem as programs
from maneuver_automaton.optimal_control import transcription
from maneuver_automaton.optimal_control.ipopt import (
    SolverSettings,
    SolveStatus,
    answered,
    ipopt_options,
    load_casadi,
    numpy_on_symbols,
)

WITHIN_GRIP = 1e-3  # share of the squared lateral acceleration that is kept between nodes
LEAST_GUESS_S = 0.1  # a first guess of the duration is not shorter
MIDPOINTS = (2, 4, 6, 8, 10, 12, 14, 16)  # steps of the midpoint rule that are extrapolated


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
        check_fields("maneuver", self, "intervals", "steps", least=1)
        low, high = self.duration
        if not 0.0 < low < high < math.inf:
            raise ValueError(
                f"maneuver: duration must be 0 < least < greatest, got ({low}, {high}) s"
            )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class TransferProgram:
    """The nonlinear program of one model and objective; ends and limits are put in when solving.

    Each interval is a stage, whose state is the reduced state, the duration and the input before;
    its other variables are the reduced states inside it, then its input. So no row knows more than
    one stage and the state of the next.
    """

    model: Model
    objective: ManeuverObjective
    settings: TransferSettings
    equality: tuple[bool, ...]  # of each row
    solver: Any  # of IPOPT
    build_s: float

    @property
    def width(self) -> int:
        """Number of variables of a stage."""
        n_z, n_u = len(self.model.reduced_names), len(self.model.control_names)
        return self.settings.steps * n_z + 1 + 2 * n_u


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
    n_z, scale = len(model.reduced_names), programs.control_scale(model)
    if not n_z:
        raise ValueError(f"{model.name}: has no reduced state, so its trims need no maneuvers")
    n_u, n_stages, steps = len(model.control_names), settings.intervals, settings.steps
    grid = programs.TimeGrid(n_nodes=steps + 1, rule="rk4", held=steps)
    one = transcription.transcribe(_of_one_interval(model, objective, settings), grid)

    def too_fast(states: Any, control: Any) -> Any:  # rows that must not be positive
        if not math.isfinite(lateral_limit(model)):
            return casadi.SX(0, 1)
        with numpy_on_symbols(casadi):
            v_x, v_y, turn = model.velocity(casadi.vertsplit(states), casadi.vertsplit(control))[:3]
        felt = (v_x * v_x + v_y * v_y) * turn * turn
        return casadi.vec(felt / (lateral_limit(model) ** 2 * (1.0 - WITHIN_GRIP)) - 1.0)

    # With the controls of both sides of a node; that before an interval is a state of its stage.
    within = one.state[:, :-1], one.state[:, 1:-1]
    beyond = casadi.vertcat(*(too_fast(states, one.inputs) for states in within))
    interval = casadi.Function("interval", [one.state, one.control, one.duration],
                               [one.objective, one.constraints, beyond])  # fmt: skip
    before, state, own = n_z + 1 + n_u, casadi.SX.sym, (steps - 1) * n_z
    begins = [state("x", before) for _ in range(n_stages + 1)]
    others = [state("u", own + n_u) for _ in range(n_stages)]
    ends = casadi.SX.sym("p", 2 * (n_z + n_u))
    start, end, first, last = casadi.vertsplit(ends, [0, n_z, 2 * n_z, 2 * n_z + n_u, ends.numel()])
    cost = objective.time * begins[-1][n_z]
    g: list[Any] = []
    equality: list[bool] = []
    for k, (x, u, following) in enumerate(zip(begins, others, begins[1:], strict=False)):
        nodes = casadi.horzcat(x[:n_z], casadi.reshape(u[:own], n_z, steps - 1), following[:n_z])
        added, defects, beyond = interval(nodes, u[own:], x[n_z] / n_stages)
        within, last_ones = casadi.vertsplit(defects, [0, own, own + n_z])
        changes = (u[own:] - x[n_z + 1 :]) / casadi.DM(scale)
        cost += added + objective.smoothness * casadi.sumsqr(changes)
        g += [-last_ones, following[n_z:] - casadi.vertcat(x[n_z], u[own:]), within]
        if k == 0:
            g.append(casadi.vertcat(x[:n_z] - start, x[n_z + 1 :] - first))
        equality += [True] * (sum(row.numel() for row in g) - len(equality))
        g.append(casadi.vertcat(beyond, too_fast(x[:n_z], x[n_z + 1 :])))
        equality += [False] * g[-1].numel()
    g += [begins[-1][:n_z] - end, too_fast(begins[-1][:n_z], begins[-1][n_z + 1 :])]
    equality += [True] * n_z + [False] * g[-1].numel()
    cost += objective.smoothness * casadi.sumsqr((last - begins[-1][n_z + 1 :]) / casadi.DM(scale))
    stages = zip(begins, others, strict=False)
    x = casadi.vertcat(*(part for stage in stages for part in stage), begins[-1])
    functions = {"x": x, "f": cost, "g": casadi.vertcat(*g), "p": ends}

    return TransferProgram(
        model=model,
        objective=objective,
        settings=settings,
        equality=tuple(equality),
        solver=casadi.nlpsol("transfer", "ipopt", functions, ipopt_options(settings.solver)),
        build_s=time.perf_counter() - began,
    )


def _of_one_interval(
    model: Model, objective: ManeuverObjective, settings: TransferSettings
) -> programs.OptimalControlProblem:
    """The effort of the reduced state alone, from any one to any other."""
    free, scale = (None,) * len(model.reduced_names), programs.control_scale(model)
    return programs.OptimalControlProblem(
        state_names=model.reduced_names,
        control_names=model.control_names,
        dynamics=model.dynamics,
        start=free,
        end=free,
        duration=settings.duration,
        stage_cost=lambda z, u: (
            objective.effort * sum((u_i / s) ** 2 for u_i, s in zip(u, scale, strict=True))
        ),
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
    model, settings = program.model, program.settings
    n_z, n_u, count = start.size, controls.shape[1], settings.intervals
    limits = model.control_limits if control_limits is None else control_limits
    controls_within = drawn_in(limits, tightening)
    within = drawn_in(model.reduced_limits, tightening)
    within[:, 0] = np.minimum(within[:, 0], np.minimum(start, end))
    within[:, 1] = np.maximum(within[:, 1], np.maximum(start, end))
    guess_s = duration_guess(model, start, end) if duration is None else duration
    inputs = programs.resampled(controls, count)
    path = programs.resampled(np.array([start, end]), count * settings.steps + 1)
    if swing:
        room = np.where(np.isfinite(controls_within), controls_within, np.array([-1.0, 1.0]))
        low, high = room.T[:, None] - inputs
        first = np.arange(len(inputs))[:, None] < len(inputs) / 2.0
        inputs = inputs + abs(swing) * np.where(first == (swing > 0.0), high, low)
        path = _led_to(model, path, inputs, guess_s)

    def packed(states: Array, seconds: Any, before: Array, inputs: Array) -> Array:
        """Values of all variables: states (nodes, n_z), inputs before and in each interval."""
        nodes = states[:-1].reshape(count, -1)
        stages = np.hstack(
            [nodes[:, :n_z], np.full((count, 1), seconds), before[:-1], nodes[:, n_z:], inputs]
        )
        return np.concatenate([stages.ravel(), states[-1], [seconds], before[-1]])

    guess = packed(path, guess_s, np.vstack([controls[:1], inputs]), inputs)
    free = np.full((count + 1, n_u), np.inf)
    bounds = []
    for side, sign in ((0, -1.0), (1, 1.0)):
        states = np.tile(within[:, side], (len(path), 1))
        states[[0, -1]] = sign * np.inf  # rows of their own hold them
        held = np.tile(controls_within[:, side], (count, 1))
        bounds.append(packed(states, settings.duration[side], sign * free, held))
    began = time.perf_counter()
    low, high = bounds
    answer = program.solver(
        x0=np.clip(guess, low, high),
        p=np.concatenate([start, end, controls.ravel()]),
        lbx=low,
        ubx=high,
        lbg=np.where(program.equality, 0.0, -np.inf),
        ubg=0.0,
    )
    solve_s = time.perf_counter() - began
    values, status, reason, iterations = answered(program.solver, answer)
    stages = values[: count * program.width].reshape(count, -1)
    begins = stages[:, : n_z + 1 + n_u]
    nodes = np.hstack([begins[:, :n_z], stages[:, n_z + 1 + n_u : -n_u]]).reshape(-1, n_z)
    return Transfer(
        status=status,
        reason=reason,
        duration=float(begins[0, n_z]),
        control=stages[:, -n_u:],
        reduced_state=np.vstack([nodes, values[count * program.width :][:n_z]]),
        cost=float(answer["f"]),
        iterations=iterations,
        solve_s=solve_s,
    )


def ends_program(model: Model, *, intervals: int) -> Any:
    """Where constant controls in equal intervals lead, and its derivatives, for `ends_of`.

    Source: Hairer, Nørsett, Wanner (1993), *Solving Ordinary Differential Equations I*, Sec. II.9:
    the midpoint rule, extrapolated; of order 16 here.
    """
    casadi = load_casadi()
    z, u = (casadi.SX.sym("v", len(names)) for names in (model.reduced_names, model.control_names))
    h = casadi.SX.sym("h")
    ends: list[Any] = []
    with numpy_on_symbols(casadi):
        for n in MIDPOINTS:
            before, here, after = z, z, h / n
            for _ in range(n):
                rates = model.dynamics(casadi.vertsplit(here), casadi.vertsplit(u))
                before, here = here, before + after * casadi.vertcat(*rates)
                after = 2.0 * h / n
            ends.append(here)
    for k in range(1, len(ends)):
        for j in reversed(range(k, len(ends))):
            finer = (MIDPOINTS[j] / MIDPOINTS[j - k]) ** 2 - 1.0
            ends[j] += (ends[j] - ends[j - 1]) / finer
    slopes = [casadi.jacobian(ends[-1], by) for by in (z, u, h)]
    return casadi.Function("interval", [z, u, h], [ends[-1], *slopes]).mapaccum("ends", intervals)


def ends_of(
    program: Any, start: Array, control: Array, interval: float
) -> tuple[Array, Array, Array]:
    """The last reduced state (n_z,) under inputs (n, n_u), each for an interval [s].

    Then its derivatives by the inputs (n_z, n, n_u) and by a common factor of the time (n_z,).
    """
    (n, n_u), n_z = control.shape, start.size
    answers = program(start, control.T, np.full((1, n), interval))
    states, by_state, by_input, by_time = (np.asarray(one.full()) for one in answers)
    gradient, by_factor, onwards = np.empty((n_z, n, n_u)), np.zeros(n_z), np.eye(n_z)
    for k in reversed(range(n)):
        gradient[:, k] = onwards @ by_input[:, n_u * k : n_u * (k + 1)]
        by_factor += onwards @ by_time[:, k] * interval
        onwards = onwards @ by_state[:, n_z * k : n_z * (k + 1)]
    return states[:, -1], gradient, by_factor


def drawn_in(limits: Array, share: float) -> Array:
    """Limits (n, 2), each drawn in by a share of its range; infinite ones stay."""
    width = limits[:, 1] - limits[:, 0]
    by = np.where(np.isfinite(width), share * np.where(np.isfinite(width), width, 0.0), 0.0)
    return np.stack([limits[:, 0] + by, limits[:, 1] - by], axis=-1)


def duration_guess(model: Model, start: Array, end: Array) -> float:
    """Time [s] for the slowest component at its fastest rate, at an end or half way.

    Half way alone a rate may vanish that is great elsewhere.
    """
    corners = np.where(np.isfinite(model.control_limits), model.control_limits, [[-1.0, 1.0]])
    controls = np.array(list(itertools.product(*corners)))
    states = np.repeat([start, (start + end) / 2.0, end], len(controls), axis=0)
    fastest = np.abs(model.reduced_dynamics(states, np.tile(controls, (3, 1)))).max(axis=0)
    seconds = np.abs(end - start) / np.where(fastest > 0.0, fastest, np.inf)
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

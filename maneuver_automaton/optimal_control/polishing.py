"""Polishing: a vehicle among obstacles as one optimal control problem, from a guess.

Solver success proves nothing: what comes out is to be simulated and audited by others.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.models import Model
from maneuver_automaton.optimal_control._casadi import load_casadi, numpy_on_symbols
from maneuver_automaton.optimal_control.problem import (
    Components,
    Grid,
    Guess,
    OptimalControlProblem,
    RunningCost,
    resampled,
)
from maneuver_automaton.optimal_control.separation import (
    BodyPart,
    Frames,
    Lines,
    Pairs,
    Reach,
    Solid,
    Ways,
    first_lines,
    line_rows,
    near_pairs,
    reaches,
    ways,
)
from maneuver_automaton.optimal_control.solution import SolveStatus
from maneuver_automaton.optimal_control.transcription import STATUS, Transcription, transcribe
from maneuver_automaton.optimal_control.vehicles import moving_frame

POINT = BodyPart(solids=((np.zeros((1, 2)), 0.0),))  # the reference point alone
WARM = {"ipopt.mu_init": 1e-5}
LEAST_DURATION, MOST_DURATION = 1e-2, 1e4  # [s]
TOO_DEEP = 0.2  # radii of the body inside obstacles from where fixed planes lead nowhere
PRICE = 2.0  # of being inside obstacles, in durations of the guess per radius of the body
TRUST = 0.6  # share of the distance within which pairs have lines
CURVED = 20.0  # times the tightening for reduced states that do not run straight
SWING = 1.1  # of what corners swing out between nodes is kept as a margin
MISSED = 0.02  # radii of the body: pairs that came nearer than this need a line
LEAST_PACE, MOST_PACE = 0.02, 50.0  # of a phase, against the even pace of the guess


@dataclass(frozen=True, slots=True, kw_only=True)
class PolishSettings:
    """How the problem is put to the solver, and when that stops."""

    step: float = 0.12  # [s] between nodes, as far as their number allows
    nodes: tuple[int, int] = (40, 300)  # fewest and most intervals
    near: float = 0.8  # pairs nearer than this get a line, in radii of the body ...
    ahead: float = 0.8  # ... or than the guess drives at its fastest in this time [s]
    gap: float = 1e-4  # [m] kept between body and line, for the way between nodes
    tightening: float = 1e-6  # of all limits, in their units, so that closure has room
    effort: float = 3e-3  # price of full control, per second, for those that end in rates
    change: float = 1e-3  # price of a full change of control from one interval to the next
    tolerance: float = 1e-6
    violation: float = 1e-7
    acceptable: float = 1e-4
    acceptable_iterations: int = 8
    max_iterations: int = 300
    fixed_iterations: int = 150  # with fixed planes
    mu_init: float = 1e-3
    rounds: int = 8  # solves at most, with lines or margins added after each


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Scene:
    """The body, the obstacles around it, and half-planes for the reference point."""

    parts: tuple[BodyPart, ...] = ()
    pieces: tuple[Solid, ...] = ()
    walls: tuple[tuple[float, float, float], ...] = ()  # (a, b, c): a x + b y <= c

    @property
    def body(self) -> list[Solid]:
        """Solids of all parts."""
        return [solid for part in self.parts for solid in part.solids]

    @property
    def both(self) -> tuple[list[Solid], list[Solid]]:
        """Solids of the body, and of the obstacles."""
        return self.body, list(self.pieces)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Polished:
    """What the solver found: states at nodes, controls and durations between them."""

    status: SolveStatus
    reason: str  # the solver's own word
    state: Array  # (n, n_x)
    control: Array  # (n - 1, n_u)
    durations: Array  # (n - 1,) [s]
    objective: float
    iterations: int
    build_s: float
    solve_s: float

    @property
    def duration(self) -> float:
        """Final time [s]."""
        return float(self.durations.sum())

    @property
    def as_guess(self) -> Guess:
        """Guess for another grid of equal steps."""
        if np.ptp(self.durations) < 1e-12:
            return Guess(state=self.state, control=self.control, duration=self.duration)
        nodes = np.concatenate([[0.0], np.cumsum(self.durations)])
        even = np.linspace(0.0, nodes[-1], len(nodes))
        state = np.stack([np.interp(even, nodes, column) for column in self.state.T], axis=1)
        which = np.clip(np.searchsorted(nodes, even[:-1], side="right") - 1, 0, len(nodes) - 2)
        return Guess(state=state, control=self.control[which], duration=self.duration)


class Ends(NamedTuple):
    """First and last pose and reduced state; None leaves a component free."""

    start: tuple[float | None, ...]
    end: tuple[float | None, ...]


def polish(
    model: Model,
    ends: Ends,
    scene: Scene,
    guess: Guess,
    *,
    stage_cost: RunningCost | None = None,
    settings: PolishSettings | None = None,
    fixed_planes: bool = False,
    elastic: bool = False,
    gears: Array | None = None,
    max_seconds: float = 10.0,
) -> Polished:
    """A local optimum among obstacles near a guess.

    Parameters
    ----------
    model : Model
        The vehicle.
    ends : Ends
        First and last pose and reduced state, in the frame of the scene.
    scene : Scene
        What must not be touched, seen from a frame nearby.
    guess : Guess
        States at equal steps, controls between them, and how long it takes; it sets the number of
        intervals. Defects do no harm.
    stage_cost : callable, optional
        Cost per second ``l(z, u)`` on top of 1 for the time.
    settings : PolishSettings, optional
    fixed_planes : bool
        Keep the lines as the guess has them: quicker, and harder to fail.
    elastic : bool
        Let the body into obstacles at a price: a way out for guesses that are inside. Solved means
        that it is out of them, as far as the lines of the guess reach.
    gears : (n - 1,) array, optional
        Sign of the speed ahead in every interval; stretches of one sign take their own time.
    max_seconds : float
        For all there is to do [s].

    Raises
    ------
    MissingExtra
        If CasADi is not installed.
    """
    settings = settings or PolishSettings()
    began = time.perf_counter()
    program = _program(model, ends, scene, settings, stage_cost, gears, guess)
    point = _Point(
        resampled(guess.state, program.count + 1),
        _held(guess.control, program.count),
        np.full(program.count, guess.duration / program.count),
    )
    reach = max((part.reach for part in scene.parts), default=0.0)
    near = max(settings.near * reach, settings.ahead * _fastest(point))
    pairs = _near(program, point, near)
    lines = _first_lines(program, point, pairs)
    total = _Answer(SolveStatus.OUT_OF_BUDGET, "lines were missing to the end", math.inf, 0, 0.0)
    solver: _Solver | None = None
    margins, again, trust = np.zeros(len(pairs.interval)), False, math.inf
    if fixed_planes and _depth(program, point, pairs, lines) > TOO_DEEP * reach:
        total = total._replace(reason="the guess is too deep inside obstacles for fixed planes")
        return _polished(point, total, began)
    for _ in range(settings.rounds):
        left = began + max_seconds - time.perf_counter()
        if left <= 0.0:
            total = total._replace(status=SolveStatus.OUT_OF_BUDGET, reason="no time was left")
            break
        if solver is None:
            price = PRICE * guess.duration / reach if elastic else math.inf
            solver = _solver(program, pairs, fixed=fixed_planes, price=price, seconds=left)
        if fixed_planes:
            lines = lines.shifted(_reaches(program, point, pairs, lines).piece)
        margins = np.maximum(margins, _margins(program, point, pairs, lines))
        before = point
        found, moved, answer = _solve(
            solver, program, point, lines, margins, again=again, trust=trust
        )
        total = _Answer(*answer[:3], total.iterations + answer.iterations,
                        total.seconds + answer.seconds)  # fmt: skip
        if elastic or answer.status is not SolveStatus.SOLVED:
            point = found
            break
        missed = _near(program, found, MISSED * reach)
        far = float(np.abs(found.state[:, :2] - before.state[:, :2]).max())
        total = total._replace(status=SolveStatus.FAILED, reason="touches between nodes")
        if trust > near and far > near and len(pairs.joined(missed).interval) > len(pairs.interval):
            trust = TRUST * near  # it went through what was not near: once more, in short steps
            continue
        point, lines, again = found, moved, True
        if trust < near:
            missed = _near(program, found, near)
        more = pairs.joined(missed)
        if len(more.interval) > len(pairs.interval):
            new = Pairs(*(column[len(pairs.interval) :] for column in more))
            lines = lines.joined(_first_lines(program, point, new))
            margins = np.append(margins, np.zeros(len(new.interval)))
            pairs, solver, again = more, None, False
        elif far < 0.99 * trust and _kept(program, point, pairs, lines):
            total = total._replace(status=answer.status, reason=answer.reason)
            break
    return _polished(point, total, began)


def _polished(point: _Point, total: _Answer, began: float) -> Polished:
    return Polished(
        status=total.status,
        reason=total.reason,
        state=point.state,
        control=point.control,
        durations=point.durations,
        objective=total.objective,
        iterations=total.iterations,
        build_s=time.perf_counter() - began - total.seconds,
        solve_s=total.seconds,
    )


def intervals_for(duration: float, settings: PolishSettings) -> int:
    """How many intervals a motion of a duration [s] gets.

    Examples
    --------
    >>> [intervals_for(seconds, PolishSettings()) for seconds in (1.0, 12.0, 100.0)]
    [40, 100, 300]
    """
    fewest, most = settings.nodes
    return min(max(math.ceil(duration / settings.step), fewest), most)


class _Point(NamedTuple):
    """Numbers of all variables but the lines."""

    state: Array  # (n, n_x)
    control: Array  # (n - 1, n_u)
    durations: Array  # (n - 1,) [s]


class _Answer(NamedTuple):
    status: SolveStatus
    reason: str
    objective: float
    iterations: int
    seconds: float


class _Program(NamedTuple):
    """The problem in symbols, but for the lines."""

    casadi: Any
    scene: Scene
    settings: PolishSettings
    written: Transcription
    ways: list[Ways]
    numbers: Any  # function: variables of the transcription -> x and y of the control points
    objective: Any
    below: Any  # (m,) further expressions that must not be positive
    zero: Any  # (m,) further expressions that must be zero
    paced: bool

    @property
    def count(self) -> int:
        """Number of intervals."""
        return self.written.grid.n_nodes - 1

    @property
    def size(self) -> int:
        """Number of variables without lines."""
        return len(self.written.bounds)

    def values(self, point: _Point) -> tuple[Array, Array, float]:
        """State, control and duration as the transcription has them."""
        duration = float(point.durations.sum())
        pace = point.durations[:, None] * (self.count / duration)
        control = np.hstack([point.control, pace]) if self.paced else point.control
        return point.state, control, duration

    def points(self, point: _Point) -> list[tuple[Array, Array]]:
        """Control points of every solid of the body, in numbers."""
        state, control, duration = self.values(point)
        found = [m.full() for m in self.numbers(state.T, control.T, duration)]
        return list(zip(found[0::2], found[1::2], strict=True))


def _program(
    model: Model,
    ends: Ends,
    scene: Scene,
    settings: PolishSettings,
    stage_cost: RunningCost | None,
    gears: Array | None,
    guess: Guess,
) -> _Program:
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
        found = ways(casadi, scene.parts, begin, end, step=step)
        (swing,) = ways(casadi, (POINT,), begin, end, step=step)
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
    return _Program(
        casadi=casadi,
        scene=scene,
        settings=settings,
        written=written,
        ways=found,
        numbers=casadi.Function("ways", variables, [m for way in found for m in way]),
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
    for state in ends:
        values = np.array([math.nan if value is None else value for value in state])
        limits[:, 0], limits[:, 1] = np.fmin(limits[:, 0], values), np.fmax(limits[:, 1], values)
    return OptimalControlProblem(
        state_names=(*model.group.coordinates, *model.reduced_names),
        control_names=model.control_names,
        dynamics=moving_frame(model.group, velocity=model.velocity, reduced=model.dynamics),
        start=ends.start,
        end=ends.end,
        duration=(LEAST_DURATION, MOST_DURATION),
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


def _fastest(point: _Point) -> float:
    """Greatest speed of the reference point from node to node [m/s]."""
    steps = np.hypot(*np.diff(point.state[:, :2], axis=0).T)
    return float((steps / point.durations).max(initial=0.0))


def _near(program: _Program, point: _Point, within: float) -> Pairs:
    scene = program.scene
    if not (scene.pieces and scene.parts):
        empty = np.zeros(0, dtype=np.int64)
        return Pairs(empty, empty, empty)
    return near_pairs(program.points(point), scene.body, scene.pieces, within=within)


def _first_lines(program: _Program, point: _Point, pairs: Pairs) -> Lines:
    return first_lines(program.points(point), program.scene.body, program.scene.pieces, pairs)


def _reaches(program: _Program, point: _Point, pairs: Pairs, lines: Lines) -> Reach:
    return reaches(program.points(point), program.scene.both, pairs, lines)


def _margins(program: _Program, point: _Point, pairs: Pairs, lines: Lines) -> Array:
    """Margins (n,) [m] at the nodes for what the corners swing out between them."""
    reach = _reaches(program, point, pairs, lines)
    return program.settings.gap + SWING * (reach.between - reach.nodes)


def _depth(program: _Program, point: _Point, pairs: Pairs, lines: Lines) -> float:
    """How deep the body is inside obstacles [m]."""
    reach = _reaches(program, point, pairs, lines)
    return float((reach.between - reach.piece).max(initial=0.0))


def _kept(program: _Program, point: _Point, pairs: Pairs, lines: Lines) -> bool:
    """Whether every way keeps half the gap to its piece."""
    reach = _reaches(program, point, pairs, lines)
    return bool((reach.between - reach.piece <= -0.5 * program.settings.gap).all())


class _Solver(NamedTuple):
    """The program with lines for some pairs, built."""

    function: Any
    warm: Any  # the same with a smaller barrier, for another solve from nearby
    bounds: Array  # (variables, 2)
    limits: Array  # (rows, 2)
    fixed: bool


def _solver(
    program: _Program, pairs: Pairs, *, fixed: bool, price: float, seconds: float
) -> _Solver:
    casadi, written, scene = program.casadi, program.written, program.scene
    variables = [casadi.vec(written.state), casadi.vec(written.control), written.duration]
    bounds = [written.bounds]
    rows = [written.constraints, program.zero, program.below]
    equations = written.constraints.shape[0] + program.zero.shape[0]
    count = len(pairs.interval)
    given = casadi.SX.sym("given", 4, count)  # margin, anchor, angle
    objective = program.objective
    if count:
        angle, offset = casadi.SX.sym("angle", 1, count), casadi.SX.sym("offset", 1, count)
        if fixed:
            angle, offset = given[3, :], casadi.SX.zeros(1, count)
        else:
            variables += [angle.T, offset.T]
            bounds.append(np.tile([-np.inf, np.inf], (2 * count, 1)))
        margin = given[0, :]
        if math.isfinite(price):
            inside = casadi.SX.sym("inside", 1, program.count)
            variables.append(inside.T)
            bounds.append(np.tile([0.0, np.inf], (program.count, 1)))
            objective += price * casadi.sum2(inside)
            margin -= inside[:, pairs.interval.tolist()]
        rows.append(
            line_rows(casadi, program.ways, scene.both, pairs, anchor=given[1:3, :],
                      lines=(angle, offset), margin=margin, pieces_too=not fixed)
        )  # fmt: skip
    constraints = casadi.vertcat(*rows)
    limits = np.zeros((constraints.shape[0], 2))
    limits[equations:, 0] = -np.inf
    functions = {
        "x": casadi.vertcat(*variables),
        "p": casadi.vec(given),
        "f": objective,
        "g": constraints,
    }
    most = program.settings.fixed_iterations if fixed else program.settings.max_iterations
    options = _options(program.settings, most, seconds)
    solver = casadi.nlpsol("solver", "ipopt", functions, options)
    warm = casadi.nlpsol("again", "ipopt", functions, options | WARM | _derivatives(solver))
    return _Solver(solver, warm, np.vstack(bounds), limits, fixed)


def _derivatives(solver: Any) -> dict[str, Any]:
    """Derivatives that one solver has and another can use."""
    names = {"grad_f": "nlp_grad_f", "jac_g": "nlp_jac_g", "hess_lag": "nlp_hess_l"}
    return {option: solver.get_function(name) for option, name in names.items()}


def _solve(
    solver: _Solver,
    program: _Program,
    point: _Point,
    lines: Lines,
    margins: Array,
    *,
    again: bool,
    trust: float,
) -> tuple[_Point, Lines, _Answer]:
    """The solver's answer from a point and lines with their margins, places within `trust` [m]."""
    state, control, duration = program.values(point)
    first = [state.ravel(), control.ravel(), np.array([duration])]
    if not solver.fixed:
        first += [lines.angle, np.zeros(lines.angle.size)]
    first.append(np.zeros(len(solver.bounds) - sum(map(len, first))))  # how deep inside
    given = np.column_stack([margins, lines.anchor, lines.angle])
    began = time.perf_counter()
    bounds = solver.bounds.copy()
    if math.isfinite(trust):
        n_x = state.shape[1]
        for axis in (0, 1):
            inner = slice(n_x + axis, n_x * program.count + axis, n_x)  # nodes but for the ends
            bounds[inner] = state[1:-1, axis, None] + np.array([-trust, trust])
    function = solver.warm if again else solver.function
    answer = function(
        x0=np.clip(np.concatenate(first), *bounds.T),
        p=given.ravel(),
        lbx=bounds[:, 0],
        ubx=bounds[:, 1],
        lbg=solver.limits[:, 0],
        ubg=solver.limits[:, 1],
    )
    solving = time.perf_counter() - began
    stats = function.stats()
    values = np.asarray(answer["x"].full(), dtype=np.float64).ravel()
    if not solver.fixed:
        both = values[program.size :][: 2 * lines.angle.size]
        angle, offset = both.reshape(2, -1)
        lines = Lines(angle, lines.anchor).shifted(offset)
    reason = str(stats["return_status"])
    return (
        _point_of(program, values),
        lines,
        _Answer(
            status=STATUS.get(reason, SolveStatus.FAILED),
            reason=reason,
            objective=float(answer["f"]),
            iterations=int(stats["iter_count"]),
            seconds=solving,
        ),
    )


def _point_of(program: _Program, values: Array) -> _Point:
    problem, n = program.written.problem, program.count + 1
    n_x, n_u = problem.n_states, problem.n_controls
    state = values[: n * n_x].reshape(n, n_x)
    control = values[n * n_x : n * n_x + (n - 1) * n_u].reshape(n - 1, n_u)
    duration = float(values[n * n_x + (n - 1) * n_u])
    durations = np.full(n - 1, duration / (n - 1))
    if program.paced:
        return _Point(state, control[:, :-1], durations * control[:, -1])
    return _Point(state, control, durations)


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


def _held(control: Array, count: int) -> Array:
    """Controls (count, n_u) from some that hold over equal steps."""
    at = (np.arange(count) + 0.5) / count
    return control[np.minimum((at * len(control)).astype(np.int64), len(control) - 1)]


def _options(settings: PolishSettings, most: int, seconds: float) -> dict[str, Any]:
    return {
        "print_time": False,
        "error_on_fail": False,
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",  # no banner
        "ipopt.mu_strategy": "monotone",
        "ipopt.mu_init": settings.mu_init,
        "ipopt.tol": settings.tolerance,
        "ipopt.constr_viol_tol": settings.violation,
        "ipopt.acceptable_tol": settings.acceptable,
        "ipopt.acceptable_iter": settings.acceptable_iterations,
        "ipopt.max_iter": most,
        "ipopt.max_wall_time": seconds,
    }

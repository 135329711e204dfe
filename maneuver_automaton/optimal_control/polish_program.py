"""Polishing in symbols: one interval of each kind, with paths of the body, walls and limits."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.models import Model
from maneuver_automaton.models.vehicle import Components
from maneuver_automaton.optimal_control.blocks import Blocks, Kind, kind_of
from maneuver_automaton.optimal_control.ipopt import load_casadi, numpy_on_symbols
from maneuver_automaton.optimal_control.place_term import place_kind, second_kind
from maneuver_automaton.optimal_control.problem import (
    OptimalControlProblem,
    RunningCost,
    TimeGrid,
    control_scale,
    moving_frame,
)
from maneuver_automaton.optimal_control.scene import (
    BodyPart,
    Guard,
    MotionEnds,
    NodeOnTheWay,
    ObstaclePieces,
    Point,
    PolishScene,
    PolishSettings,
)
from maneuver_automaton.optimal_control.transcription import bounds_of, transcribe


class Paths(NamedTuple):
    """Control points of the paths of m corners: first all begins, all ends, then those between."""

    x: Any  # (4 m, n - 1)
    y: Any  # (4 m, n - 1)


class NodeMotion(NamedTuple):
    """Where the vehicle is and how it moves, in symbols: at one node of each interval."""

    pose: Any  # (dof, n - 1)
    twist: Sequence[Any]  # dof rows (1, n - 1)
    reduced: Any  # (n_z, n - 1)
    reduced_rates: Any  # (n_z, n - 1)


def paths(
    casadi: Any, parts: Sequence[BodyPart], begin: NodeMotion, end: NodeMotion, *, step: Any
) -> list[Paths]:
    """Control points of every solid's corners in every interval, in symbols.

    `begin`, `end`: of each interval, with its control. `step` (1, n - 1): its duration [s].

    Source: Farin (2002), *Curves and Surfaces for CAGD*, Sec. 7.5 (cubic Hermite interpolation in
    Bernstein form).
    """
    found = []
    for part in parts:
        for corners, _ in part.solids:
            x_0, y_0, v_0, w_0 = _corners(casadi, part, corners, begin)
            x_1, y_1, v_1, w_1 = _corners(casadi, part, corners, end)
            third = casadi.repmat(step / 3.0, len(corners), 1)
            x = casadi.vertcat(x_0, x_1, x_0 + third * v_0, x_1 - third * v_1)
            found.append(Paths(x, casadi.vertcat(y_0, y_1, y_0 + third * w_0, y_1 - third * w_1)))
    return found


def _corners(casadi: Any, part: BodyPart, corners: Array, at: NodeMotion) -> tuple[Any, ...]:
    """Places x, y and velocities (m, n - 1) of the corners of a part."""
    count = at.pose.shape[1]
    ones = casadi.SX.ones(1, count)
    along, aside = casadi.DM(corners[:, 0]), casadi.DM(corners[:, 1])
    if part.pose is None:
        x, y = along @ ones, aside @ ones
        v = w = casadi.SX.zeros(len(corners), count)
    else:
        place = part.pose(casadi.vertsplit(at.reduced))
        p_x, p_y, turn = (casadi.SX(value) * ones for value in place)
        every = casadi.SX.ones(len(corners), 1)
        x = every @ p_x + along @ casadi.cos(turn) - aside @ casadi.sin(turn)
        y = every @ p_y + along @ casadi.sin(turn) + aside @ casadi.cos(turn)
        v = casadi.jtimes(x, at.reduced, at.reduced_rates)
        w = casadi.jtimes(y, at.reduced, at.reduced_rates)
    heading, twist = at.pose[2, :], [casadi.SX(v) * ones for v in at.twist[:3]]
    rows = [*twist, casadi.cos(heading), casadi.sin(heading), at.pose[0, :], at.pose[1, :]]
    every = [casadi.repmat(row, len(corners), 1) for row in rows]
    ahead, sideways, turning, cosine, sine, p_x, p_y = every
    v, w = ahead - turning * y + v, sideways + turning * x + w
    places = p_x + cosine * x - sine * y, p_y + sine * x + cosine * y
    return *places, cosine * v - sine * w, sine * v + cosine * w


POINT = BodyPart(solids=((np.zeros((1, 2)), 0.0),))  # the reference point alone
LEAST_PACE, MOST_PACE = 0.02, 50.0  # of a phase, against the even pace of the guess
STILL = 1e-9  # [m^2/s^2] that keeps the speed of a vehicle that drifts smooth at rest
CURVED = 20.0  # times the tightening for reduced states that do not run straight


class PolishProgram(NamedTuple):
    """The problem in blocks, but for the lines."""

    casadi: Any
    scene: PolishScene
    settings: PolishSettings
    problem: OptimalControlProblem
    dof: int
    n_intervals: int
    bounds: Array  # (variables, 2)
    blocks: tuple[Blocks, ...]
    wall: tuple[Kind, Kind]  # of a node, and of an interval
    path: Any  # function of one interval: states, control, step -> x and y of the control points
    paced: bool
    model: Model

    @property
    def size(self) -> int:
        """Number of variables without lines: states, controls, the duration."""
        return len(self.bounds)

    def states_at(self, node: IntArray) -> IntArray:
        """Numbers (n_x, n) of the variables that are the states at nodes."""
        n_x = self.problem.n_states
        return np.arange(n_x)[:, None] + n_x * node

    def values(self, point: Point) -> tuple[Array, Array, float]:
        """State, control and duration as the program has them."""
        duration = float(point.durations.sum())
        pace = point.durations[:, None] * (self.n_intervals / duration)
        control = np.hstack([point.control, pace]) if self.paced else point.control
        return point.state, control, duration

    def pieces(self, point: Point) -> ObstaclePieces:
        """Pieces of the obstacles while the motion of a point is driven."""
        return self.scene.during(point.durations)

    def points(self, point: Point) -> list[tuple[Array, Array]]:
        """Control points of every solid of the body, in numbers."""
        if not self.scene.parts:
            return []
        return _points(self.path, *(array.tobytes() for array in point), self.n_intervals)


@functools.lru_cache(maxsize=4)  # a round asks for the same ones several times
def _points(
    path: Any, states: bytes, controls: bytes, durations: bytes, count: int
) -> list[tuple[Array, Array]]:
    state = np.frombuffer(states).reshape(count + 1, -1)
    control, step = np.frombuffer(controls).reshape(count, -1), np.frombuffer(durations)
    found = [m.full() for m in path.map(count)(state[:-1].T, state[1:].T, control.T, step[None])]
    return list(zip(found[0::2], found[1::2], strict=True))


class IntervalKinds(NamedTuple):
    """Kinds of blocks that intervals are made of."""

    stage: Kind  # states at both nodes, control, duration; given the share of the duration
    change: Kind  # controls of two intervals
    place: Kind  # x and y of a node; given a wall
    swing: Kind  # as the stage; given a wall and the share
    gear: Kind  # states at both nodes, control; given a sign
    pace: Kind  # paces of two intervals


def program_of(
    model: Model,
    ends: MotionEnds,
    scene: PolishScene,
    settings: PolishSettings,
    stage_cost: RunningCost | None,
    gears: Array | None,
    point: Point,
    via: Sequence[NodeOnTheWay] = (),
) -> PolishProgram:
    """The program of a vehicle, its ends and its scene, on as many intervals as the point has.

    With `gears`, the sign of the speed ahead in every interval, time has a pace of its own in every
    stretch of one sign, and so it has between nodes at which poses on the way are passed.
    """
    casadi = load_casadi()
    paced, count = gears is not None or bool(via), len(point.durations)
    problem = _problem(model, ends, settings, stage_cost)
    if paced:
        problem = _paced(problem, float(point.durations.sum()))
    weights = settings.effort, settings.change, settings.tightening
    kinds = _kinds(model, *weights, stage_cost, paced)  # type: ignore[arg-type]  # values all
    bounds = bounds_of(problem, TimeGrid(n_nodes=count + 1, rule="rk4"))
    for node, state in via:
        for k, value in enumerate(state):
            if value is not None:
                bounds[problem.n_states * node + k] = value
    return PolishProgram(
        casadi=casadi,
        scene=scene,
        settings=settings,
        problem=problem,
        dof=model.group.dof,
        n_intervals=count,
        bounds=bounds,
        blocks=tuple(_blocks(problem, model, kinds, gears, count, via)),
        wall=(kinds.place, kinds.swing),
        path=_path(model, scene),  # type: ignore[arg-type]  # values both
        paced=paced,
        model=model,
    )


def _every(problem: OptimalControlProblem, count: int) -> IntArray:
    """Numbers of the variables of each interval (n, count): both states, control, duration."""
    n_x, n_u = problem.n_states, problem.n_controls
    states = np.arange((count + 1) * n_x).reshape(count + 1, n_x).T
    controls = (count + 1) * n_x + np.arange(count * n_u).reshape(count, n_u).T
    duration = np.full((1, count), (count + 1) * n_x + count * n_u)
    return np.vstack([states[:, :-1], states[:, 1:], controls, duration])


def guard_blocks(program: PolishProgram, held: Sequence[IntArray]) -> list[Blocks]:
    """What keeps each guard of the scene, then each wall, in the intervals where it is `held`."""
    every, weight = _every(program.problem, program.n_intervals), program.settings.tightening
    blocks = []
    for guard, which in zip(program.scene.guards, held, strict=False):
        if len(which):
            given = (program.model, guard._replace(solids=None), weight, program.paced)
            kind = _guard_kind(*given)  # type: ignore[arg-type]  # values all
            share = np.full(len(which), 1.0 / program.n_intervals)
            blocks.append(Blocks(kind, every[:, which], np.vstack([share, which > 0])))
    for (a, b, c), which in zip(
        program.scene.walls, held[len(program.scene.guards) :], strict=True
    ):
        wall = np.tile([[a], [b], [c - weight], [1.0 / program.n_intervals]], (1, len(which)))
        inner, (node, swing) = which > 0, program.wall
        blocks.append(Blocks(node, every[:2, which[inner]], wall[:3, inner]))
        blocks.append(Blocks(swing, every[:, which], wall))
    return [one for one in blocks if one.number]


def place_blocks(program: PolishProgram, first: int) -> list[Blocks]:
    """What places cost, by nodes and intervals, of parameters from the `first` on."""
    if program.scene.places is None:
        return []
    count, own = program.n_intervals, len(program.model.control_names)
    node, interval = place_kind(program.dof), second_kind(program.paced, count)
    poses = program.states_at(np.arange(count + 1))[: program.dof]
    given = first + np.arange((count + 1) * node.given)
    controls = _every(program.problem, count)[2 * program.problem.n_states :]
    lasting = controls[[own, -1]] if program.paced else controls[-1:]
    return [
        Blocks(node, poses, given.reshape(count + 1, node.given).T),
        Blocks(interval, lasting, given[-1] + 1 + np.arange(count)[None]),
    ]


@functools.lru_cache(maxsize=16)
def _guard_kind(model: Model, guard: Guard, tightening: float, paced: bool) -> Kind:
    """One interval within the limits of a guard; the node where all begins gets no room."""
    # The control points of the cubics with the same values and rates at both nodes keep them.
    casadi = load_casadi()
    dof, own = model.group.dof, len(model.control_names)
    n_x = dof + len(model.reduced_names)
    first, last = casadi.SX.sym("a", n_x), casadi.SX.sym("b", n_x)
    control = casadi.SX.sym("u", own + int(paced))
    duration, share, inner = casadi.SX.sym("T"), casadi.SX.sym("share"), casadi.SX.sym("inner")
    third = duration * share * (control[own] if paced else 1.0) / 3.0
    at_ends = len(_ends_in_rates(model)) < own  # otherwise the next interval has the last node
    room, within = CURVED * tightening, list[tuple[Any, float, float]]()
    with numpy_on_symbols(casadi):
        for state, sign, node in ((first, 1.0, inner), (last, -1.0, 1.0)):
            z, u = state[dof:], control[:own]
            rates = casadi.vertcat(*model.dynamics(casadi.vertsplit(z), casadi.vertsplit(u)))
            for size, low, high in _guarded(casadi, model, guard, z, u):
                least, most = low + room, high - room
                (bent,) = casadi.which_depends(size, z, 1, True)  # in the interval: not constant
                if bent:
                    beside = size + sign * third * casadi.jtimes(size, z, casadi.SX(rates))
                    within.append((beside, least, most))
                if sign > 0.0:
                    wider = 1.0 if math.isinf(high) else -size / high
                    within.append((size + (1.0 - node) * room * wider, least, most))
                elif at_ends and bent:
                    within.append((size, least, most))
    every = casadi.vertcat(first, last, control, duration)
    return kind_of(casadi, every, casadi.vertcat(share, inner), within=within)


def _guarded(
    casadi: Any, model: Model, guard: Guard, z: Any, u: Any
) -> list[tuple[Any, float, float]]:
    """What a guard limits of a state and a control, and its limits."""
    v_x, v_y, turn = (
        casadi.SX(v) for v in model.velocity(casadi.vertsplit(z), casadi.vertsplit(u))[:3]
    )
    aside = not v_y.is_zero()
    speed = casadi.sqrt(v_x * v_x + v_y * v_y + STILL) if aside else v_x
    ahead = [] if guard.reverse else [(v_x, 0.0, math.inf)]
    limited = ((speed, guard.speed), (speed * turn, guard.lateral))
    return ahead + [(size, -most, most) for size, most in limited if math.isfinite(most)]


def _blocks(
    problem: OptimalControlProblem,
    model: Model,
    kinds: IntervalKinds,
    gears: Array | None,
    count: int,
    via: Sequence[NodeOnTheWay],
) -> list[Blocks]:
    n_x, own = problem.n_states, len(model.control_names)
    every = _every(problem, count)
    controls = every[2 * n_x : -1]
    found = [Blocks(kinds.stage, every, np.full((1, count), 1.0 / count))]
    if count > 1:
        found.append(Blocks(kinds.change, np.vstack([controls[:own, :-1], controls[:own, 1:]]),
                            np.zeros((0, count - 1))))  # fmt: skip
    if gears is not None:
        signs = np.asarray(gears, dtype=np.float64)[None]
        found.append(Blocks(kinds.gear, every[: 2 * n_x + own], signs))
    if gears is not None or via:
        changes = np.zeros(count - 1) if gears is None else np.diff(gears)
        changes[[node - 1 for node, _ in via]] = 1.0
        same = np.flatnonzero(changes == 0)
        if len(same):
            paces = np.vstack([controls[own, same], controls[own, same + 1]])
            found.append(Blocks(kinds.pace, paces, np.zeros((0, len(same)))))
    return [one for one in found if one.number]


@functools.lru_cache(maxsize=16)
def _kinds(
    model: Model,
    effort: float,
    change: float,
    tightening: float,
    stage_cost: RunningCost | None,
    paced: bool,
) -> IntervalKinds:
    """One interval of a vehicle, differentiated; the same for all scenes and all its lengths."""
    casadi = load_casadi()
    settings = PolishSettings(effort=effort, change=change, tightening=tightening)
    free = (None,) * (model.group.dof + len(model.reduced_names))
    problem = _problem(model, MotionEnds(free, free), settings, stage_cost)
    own = problem.n_controls
    if paced:
        problem = _paced(problem, 1.0)
    written = transcribe(problem, TimeGrid(n_nodes=2, rule="rk4"))
    sizes = (problem.n_states, problem.n_states, problem.n_controls)
    first, last, control = (casadi.SX.sym(name, k) for name, k in zip("abu", sizes, strict=True))
    duration, share = casadi.SX.sym("T"), casadi.SX.sym("share")
    whole = casadi.Function("whole", [written.state, written.control, written.duration],
                            [written.objective, written.constraints])  # fmt: skip
    price, defects = whole(casadi.horzcat(first, last), control, duration * share)
    step = duration * share * (control[own] if paced else 1.0)
    with numpy_on_symbols(casadi):
        begin, end = (_frames(casadi, model, x, control[:own]) for x in (first, last))
        (swing,) = paths(casadi, (POINT,), begin, end, step=step)
        within = _between(model, begin, end, step=step, settings=settings)
    every = casadi.vertcat(first, last, control, duration)
    nothing = casadi.SX.sym("nothing", 0)
    before, after = casadi.SX.sym("before", own), casadi.SX.sym("after", own)
    changed = casadi.sumsqr((after - before) / casadi.DM(control_scale(model)))
    wall, place, sign = casadi.SX.sym("w", 3), casadi.SX.sym("p", 2), casadi.SX.sym("sign")
    beyond = [wall[0] * swing.x[k] + wall[1] * swing.y[k] - wall[2] for k in (2, 3)]
    paces = casadi.SX.sym("paces", 2)
    return IntervalKinds(
        stage=kind_of(casadi, every, share, price=price, zero=defects, within=within),
        change=kind_of(casadi, casadi.vertcat(before, after), nothing, price=change * changed),
        place=kind_of(casadi, place, wall, below=casadi.dot(wall[:2], place) - wall[2]),
        swing=kind_of(casadi, every, casadi.vertcat(wall, share),
                      below=casadi.vertcat(*beyond) - 2.0 * tightening),
        gear=kind_of(casadi, casadi.vertcat(first, last, control[:own]), sign,
                     below=-sign * casadi.vertcat(begin.twist[0], end.twist[0])),
        pace=kind_of(casadi, paces, nothing, zero=paces[1] - paces[0]),
    )  # fmt: skip


@functools.lru_cache(maxsize=8)  # of a scene it is asked for with every guess
def _path(model: Model, scene: PolishScene) -> Any:
    """Control points of every solid of the body in one interval, as a function."""
    casadi = load_casadi()
    n_x = model.group.dof + len(model.reduced_names)
    first, last = casadi.SX.sym("a", n_x), casadi.SX.sym("b", n_x)
    control, step = casadi.SX.sym("u", len(model.control_names)), casadi.SX.sym("h")
    with numpy_on_symbols(casadi):
        begin, end = (_frames(casadi, model, x, control) for x in (first, last))
        found = paths(casadi, scene.parts, begin, end, step=step)
    return casadi.Function(
        "path", [first, last, control, step], [m for path in found for m in path]
    )


def _between(
    model: Model, begin: NodeMotion, end: NodeMotion, *, step: Any, settings: PolishSettings
) -> list[tuple[Any, float, float]]:
    """Keeps reduced states inside their limits between nodes where they do not run straight."""
    # The control points of the cubic with the same values and rates at both nodes are kept inside.
    rows = []
    limits = _tight(model, settings)
    for k in _curved(model):
        low, high = limits[k]
        points = (begin.reduced[k, :] + step / 3.0 * begin.reduced_rates[k, :],
                  end.reduced[k, :] - step / 3.0 * end.reduced_rates[k, :])  # fmt: skip
        if np.isfinite([low, high]).any():
            rows += [(point, low, high) for point in points]
    return rows


def _tight(model: Model, settings: PolishSettings) -> Array:
    """Limits (n_z, 2) of the reduced state with room for closure, more where it runs curved."""
    by = np.full((len(model.reduced_names), 1), settings.tightening)
    by[_curved(model)] *= CURVED
    return np.asarray(model.reduced_limits + by * np.array([1.0, -1.0]))


def _curved(model: Model) -> list[int]:
    """Numbers of the reduced states whose rates depend on reduced states."""
    casadi, z, _, rates = _in_symbols(model, model.dynamics)
    if not len(model.reduced_names):
        return []
    return [k for k, bent in enumerate(casadi.which_depends(rates, z, 1, True)) if bent]


def _in_symbols(model: Model, of: Callable[[Any, Any], Any]) -> tuple[Any, Any, Any, Any]:
    """CasADi, reduced state and control, and what is made `of` these, in a column."""
    casadi = load_casadi()
    z = casadi.SX.sym("z", len(model.reduced_names))
    u = casadi.SX.sym("u", len(model.control_names))
    with numpy_on_symbols(casadi):
        made = of(casadi.vertsplit(z), casadi.vertsplit(u))
    return casadi, z, u, casadi.vertcat(*map(casadi.SX, made))


def _problem(
    model: Model, ends: MotionEnds, settings: PolishSettings, stage_cost: RunningCost | None
) -> OptimalControlProblem:
    """Least time, a little effort, and what else is asked for."""
    dof = model.group.dof
    scale = control_scale(model)
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
        control_limits=model.control_limits + settings.tightening * np.array([1.0, -1.0]),
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


def _frames(casadi: Any, model: Model, state: Any, control: Any) -> NodeMotion:
    dof = model.group.dof
    z, u = casadi.vertsplit(state[dof:, :]), casadi.vertsplit(control)
    ones = casadi.SX.ones(1, state.shape[1])
    return NodeMotion(
        pose=state[:dof, :],
        twist=[casadi.SX(v) * ones for v in model.velocity(z, u)],
        reduced=state[dof:, :],
        reduced_rates=casadi.vertcat(*[casadi.SX(rate) * ones for rate in model.dynamics(z, u)]),
    )


def _ends_in_rates(model: Model) -> list[int]:
    """Numbers of the controls that the velocity does not depend on: accelerations and such."""
    casadi, _, u, twist = _in_symbols(model, model.velocity)
    return [k for k, used in enumerate(casadi.which_depends(twist, u, 1, False)) if not used]

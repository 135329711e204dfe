"""The program of polishing with its lines, built for IPOPT and solved from a point."""

from __future__ import annotations

import enum
import functools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.budget import Budget
from maneuver_automaton.optimal_control._casadi import load_casadi, numpy_on_symbols
from maneuver_automaton.optimal_control.blocks import Blocks, Kind, assembled, kind_of
from maneuver_automaton.optimal_control.parting import Parting
from maneuver_automaton.optimal_control.polish_program import Program, guard_blocks
from maneuver_automaton.optimal_control.polish_values import Answer, Point, PolishSettings
from maneuver_automaton.optimal_control.separation import PartPose
from maneuver_automaton.optimal_control.solution import SolveStatus
from maneuver_automaton.optimal_control.stopping import Watcher, watcher_of
from maneuver_automaton.optimal_control.transcription import STATUS

ROW_S = 1e-5  # [s] for each row of a program, to put it together: measured, generous
ORDERING = 2  # approximate minimum fill: factorises twice as quickly as the default
OF_LINE = 4  # parameters of a line: margin, anchor, angle
OF_CORNER = 3  # parameters of a corner: its place, and the radius that rounds it
OF_SHIFT = 2  # parameters of how a corner shifts with the duration
WITHIN = 0.2  # share of the duration by which it changes at once where something moves


class Begin(enum.Enum):
    """Where a solve begins: its options are for that."""

    GUESS = "guess"
    NEARBY = "nearby"
    SAME = "same"


BEGINS: dict[Begin, dict[str, Any]] = {
    Begin.GUESS: {},
    Begin.NEARBY: {"ipopt.mu_init": 1e-5},  # found with other rows
    Begin.SAME: {  # found with the same rows, multipliers too: half the iterations
        "ipopt.mu_init": 1e-6,
        "ipopt.warm_start_init_point": "yes",
        "ipopt.warm_start_bound_push": 1e-7,
        "ipopt.warm_start_bound_frac": 1e-7,
        "ipopt.warm_start_slack_bound_push": 1e-7,
        "ipopt.warm_start_slack_bound_frac": 1e-7,
        "ipopt.warm_start_mult_bound_push": 1e-7,
    },
}


class Multipliers(NamedTuple):
    """Of bounds and rows, as a solve found them."""

    bounds: Array  # (variables,)
    rows: Array  # (rows,)


class Solver(NamedTuple):
    """The program with lines for some pairs, built."""

    function: Callable[[Begin], Any]  # by where it begins
    watcher: Watcher  # asks the budget at every iteration, and keeps the best
    bounds: Array  # (variables, 2)
    limits: Array  # (rows, 2)
    corners: Array  # (k,) parameters of corners
    fixed: bool


def solver_of(
    program: Program,
    point: Point,
    parting: Parting,
    held: Sequence[IntArray],
    *,
    fixed: bool,
    price: float,
    budget: Budget,
) -> Solver | float:
    """The program with its lines; where no time is left to build it, what it takes [s].

    Parameters
    ----------
    program : Program
    point : Point
        Near which obstacles are where the motion of it meets them.
    parting : Parting
    held : sequence of (k,) arrays
        The intervals that keep the limits of each guard.
    fixed : bool
        Whether the lines stand still.
    price : float
        Of being inside obstacles, per metre and interval; infinite: it must not be.
    budget : Budget
        Every iteration asks it: a solve ends with what it has once the time is over.
    """
    casadi, own = program.casadi, parting.own
    elastic = math.isfinite(price) and len(own) > 0
    free = np.tile([-np.inf, np.inf], (0 if fixed else 2 * len(own), 1))
    inside = np.tile([0.0, np.inf], (program.n_intervals if elastic else 0, 1))
    bounds = np.vstack([program.bounds, free, inside])
    corners, places = _corners(program, point, parting)
    blocks = [*program.blocks, *guard_blocks(program, held)]
    blocks += [*_line_blocks(program, parting, places, fixed, elastic)]
    if elastic:
        numbers = np.arange(len(bounds) - len(inside), len(bounds))[None]
        blocks.append(Blocks(_priced(price), numbers, np.zeros((0, numbers.size))))
    takes = ROW_S * sum(one.kind.rows * one.number for one in blocks)
    if takes > budget.left:
        return float(takes)
    given = OF_LINE * len(own) + corners.size
    built = assembled(casadi, blocks, size=len(bounds), given=given)
    watcher = watcher_of(budget, built.limits, n_variables=len(bounds), n_given=given)
    most = program.settings.fixed_iterations if fixed else program.settings.max_iterations
    options = _options(program.settings, most) | built.derivatives
    options["iteration_callback"] = watcher

    @functools.cache
    def function(begin: Begin) -> Any:
        return casadi.nlpsol("solver", "ipopt", built.functions, options | BEGINS[begin])

    return Solver(function, watcher, bounds, built.limits, corners, fixed)


class Places(NamedTuple):
    """Where the parameters of corners begin, among those of all corners."""

    body: IntArray  # of each solid
    piece: IntArray  # of the piece of each pair
    shift: IntArray  # how its corners shift; negative where it stands still


def _corners(program: Program, point: Point, parting: Parting) -> tuple[Array, Places]:
    """Parameters of corners of both sides, and where those of each solid begin.

    Of the pieces only those that are in pairs: a map may have thousands. A corner that shifts is
    where it would be if the motion took no time, and shifts with the duration from there.
    """
    body, pieces = program.scene.body, program.pieces(point)
    used, owner = np.unique(parting.pairs.piece, return_inverse=True)
    moving = used >= pieces.first
    shifts = pieces.shifts[used[moving] - pieces.first]
    solids = [*body, *(pieces.solids[k] for k in used.tolist())]
    rows = [np.column_stack([corners, np.full(len(corners), by)]) for corners, by in solids]
    duration = float(point.durations.sum())
    for k, shift in zip(np.flatnonzero(moving).tolist(), shifts, strict=True):
        row = rows[len(body) + k]
        row[:, :2] -= duration * shift[: len(row)]
    begins = np.cumsum([0, *map(len, rows)])
    every = np.vstack([np.zeros((0, OF_CORNER)), *rows]).ravel()
    shift_at = np.full(len(used), -1)
    shift_at[moving] = every.size + OF_SHIFT * shifts.shape[1] * np.arange(len(shifts))
    places = Places(begins[: len(body)], begins[len(body) :][owner], shift_at[owner])
    return np.concatenate([every, shifts.ravel()]), places


def _line_blocks(
    program: Program,
    parting: Parting,
    places: Places,
    fixed: bool,
    elastic: bool,
) -> list[Blocks]:
    """How far corners of the body, and of the pieces, reach over the lines."""
    pairs, own = parting.pairs, parting.own
    if not len(own):
        return []
    n_lines = len(own)
    slot = np.full(len(parting.owner), -1)
    slot[own] = np.arange(n_lines)
    angle = program.size + np.arange(n_lines)
    inside = program.size + (0 if fixed else 2 * n_lines) + np.arange(program.n_intervals)
    first = OF_LINE * n_lines
    model_pose = [part.pose for part in program.scene.parts for _ in part.solids]
    blocks = []
    for number, pose in enumerate(model_pose):
        line, node, corner = np.nonzero(parting.facing.body[own])
        some = pairs.body[own[line]] == number
        line, node, corner = line[some], node[some], corner[some]
        if not len(line):
            continue
        interval = pairs.interval[own[line]]
        states = program.states_at(interval + node)
        variables = [states if pose else states[:3]]
        if not fixed:
            variables += [angle[line][None], angle[line][None] + n_lines]
        if elastic:
            variables.append(inside[interval][None])
        at = first + OF_CORNER * (places.body[number] + corner)
        told = [OF_LINE * line + k for k in range(OF_LINE)] + [at + k for k in range(OF_CORNER)]
        kind = _corner_kind(pose, program.problem.n_states, program.dof, fixed, elastic)
        blocks.append(Blocks(kind, np.vstack(variables), np.array(told)))
    if not fixed:
        for moves in (False, True):
            which = (places.shift >= 0) == moves
            pair, corner = np.nonzero(parting.facing.piece & which[:, None])
            if not len(pair):
                continue
            line = slot[parting.owner[pair]]
            at = first + OF_CORNER * (places.piece[pair] + corner)
            told = [OF_LINE * line + k for k in range(OF_LINE)] + [at + k for k in range(OF_CORNER)]
            variables = [angle[line], angle[line] + n_lines]
            if moves:
                at = first + places.shift[pair] + OF_SHIFT * corner
                told += [at + k for k in range(OF_SHIFT)]
                variables.append(np.full(len(pair), program.size - 1))
            blocks.append(Blocks(_piece_kind(moves), np.vstack(variables), np.array(told)))
    return blocks


@functools.lru_cache(maxsize=16)
def _corner_kind(
    pose: PartPose | None, n_states: int, dof: int, fixed: bool, elastic: bool
) -> Kind:
    """How far a corner of the body reaches over a line, less what it may be inside."""
    casadi = load_casadi()
    state = casadi.SX.sym("x", n_states if pose else 3)
    line, inside = casadi.SX.sym("line", 0 if fixed else 2), casadi.SX.sym("inside", int(elastic))
    given = casadi.SX.sym("given", OF_LINE + OF_CORNER)
    margin, anchor_x, anchor_y, known, along, aside, rounding = casadi.vertsplit(given)
    angle, offset = (known, 0.0) if fixed else casadi.vertsplit(line)
    x, y, heading = state[0], state[1], state[2]
    if pose:
        with numpy_on_symbols(casadi):
            p_x, p_y, turn = pose(casadi.vertsplit(state[dof:]))
        cosine, sine = casadi.cos(heading), casadi.sin(heading)
        x, y = x + cosine * p_x - sine * p_y, y + sine * p_x + cosine * p_y
        heading += turn
    c, s = casadi.cos(angle), casadi.sin(angle)
    over = c * (x - anchor_x) + s * (y - anchor_y) - offset + margin + rounding
    over += along * casadi.cos(heading - angle) - aside * casadi.sin(heading - angle)
    if elastic:
        over -= inside
    return kind_of(casadi, casadi.vertcat(state, line, inside), given, below=over)


@functools.cache
def _piece_kind(moves: bool) -> Kind:
    """How far a corner of a piece reaches over a line; one that moves shifts with the duration."""
    casadi = load_casadi()
    line = casadi.SX.sym("line", 2 + int(moves))
    given = casadi.SX.sym("given", OF_LINE + OF_CORNER + OF_SHIFT * int(moves))
    _, anchor_x, anchor_y, _, x, y, rounding, *shift = casadi.vertsplit(given)
    angle, offset, *duration = casadi.vertsplit(line)
    if moves:
        x, y = x + shift[0] * duration[0], y + shift[1] * duration[0]
    beyond = casadi.cos(angle) * (x - anchor_x) + casadi.sin(angle) * (y - anchor_y)
    return kind_of(casadi, line, given, below=offset + rounding - beyond)


@functools.lru_cache(maxsize=16)
def _priced(price: float) -> Kind:
    """What it costs to be inside obstacles."""
    casadi = load_casadi()
    inside = casadi.SX.sym("inside")
    return kind_of(casadi, inside, casadi.SX.sym("nothing", 0), price=price * inside)


def solve_from(
    solver: Solver,
    program: Program,
    point: Point,
    apart: Parting,
    *,
    begin: Begin,
    known: Multipliers | None,
    trust: float,
) -> tuple[Point, Parting, Multipliers, Answer]:
    """The solver's answer from a point and lines, with places within `trust` [m] of the point.

    The `known` multipliers count where it begins at what the same solver has found. Where it does
    not come to its end, its best iterate that breaks no condition is the answer, if there is one.
    """
    state, control, duration = program.values(point)
    own, lines = apart.own, apart.lines.of(apart.own)
    first = [state.ravel(), control.ravel(), np.array([duration])]
    if not solver.fixed:
        first += [lines.angle, np.zeros(len(own))]
    first.append(np.zeros(len(solver.bounds) - sum(map(len, first))))  # how deep inside
    given = np.column_stack([apart.margins[own], lines.anchor, lines.angle])
    watcher = solver.watcher
    began = watcher.budget.elapsed
    bounds, corners = solver.bounds.copy(), solver.corners
    if program.scene.movers:  # they are where the motion meets them, to first order
        corners, _ = _corners(program, point, apart)
        last = program.size - 1
        near = duration * np.array([1.0 - WITHIN, 1.0 + WITHIN])
        bounds[last] = np.clip(near, *bounds[last])
    if math.isfinite(trust):
        n_x = state.shape[1]
        for axis in (0, 1):
            # nodes but for the ends
            inner = slice(n_x + axis, n_x * program.n_intervals + axis, n_x)
            bounds[inner] = state[1:-1, axis, None] + np.array([-trust, trust])
    function = solver.function(begin)
    watcher.forget()
    answer = function(
        x0=np.clip(np.concatenate(first), *bounds.T),
        p=np.concatenate([given.ravel(), corners]),
        lbx=bounds[:, 0],
        ubx=bounds[:, 1],
        lbg=solver.limits[:, 0],
        ubg=solver.limits[:, 1],
        **({"lam_x0": known.bounds, "lam_g0": known.rows} if known and begin is Begin.SAME else {}),
    )
    stats = function.stats()
    reason = str(stats["return_status"])
    status = STATUS.get(reason, SolveStatus.FAILED)
    values = np.asarray(answer["x"].full(), dtype=np.float64).ravel()
    objective, is_solved = float(answer["f"]), status is SolveStatus.SOLVED
    if not is_solved and watcher.best is not None:
        values, objective = watcher.best, watcher.least
    if not solver.fixed:
        apart = apart.moved(*values[program.size :][: 2 * len(own)].reshape(2, -1))
    return (
        _point_of(program, values),
        apart,
        Multipliers(*(answer[name].full().ravel() for name in ("lam_x", "lam_g"))),
        Answer(
            status=status,
            reason=reason,
            objective=objective,
            iterations=int(stats["iter_count"]),
            seconds=watcher.budget.elapsed - began,
            is_feasible=is_solved or watcher.best is not None,
        ),
    )


def _point_of(program: Program, values: Array) -> Point:
    problem, n = program.problem, program.n_intervals + 1
    n_x, n_u = problem.n_states, problem.n_controls
    state = values[: n * n_x].reshape(n, n_x)
    control = values[n * n_x : n * n_x + (n - 1) * n_u].reshape(n - 1, n_u)
    duration = float(values[n * n_x + (n - 1) * n_u])
    durations = np.full(n - 1, duration / (n - 1))
    if program.paced:
        return Point(state, control[:, :-1], durations * control[:, -1])
    return Point(state, control, durations)


def _options(settings: PolishSettings, most: int) -> dict[str, Any]:
    return {
        "print_time": False,
        "error_on_fail": False,
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",  # no banner
        "ipopt.mumps_pivot_order": ORDERING,
        "ipopt.mu_strategy": "monotone",
        "ipopt.mu_init": settings.mu_init,
        "ipopt.tol": settings.tolerance,
        "ipopt.constr_viol_tol": settings.violation,
        "ipopt.acceptable_tol": settings.acceptable,
        "ipopt.acceptable_iter": settings.acceptable_iterations,
        "ipopt.max_iter": most,
    }

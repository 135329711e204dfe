"""Polishing: a vehicle among obstacles as one optimal control problem, from a guess.

Solver success proves nothing: what comes out is to be simulated and audited by others.

The solver is IPOPT. An iteration takes 8 ms of processor time for 527 variables and 1,362 rows, and
13 ms for 944 and 2,469; a third of it are values and derivatives of the program, which any solver
needs. Fatrop is not used: it has no limit of time, and was seen never to come back.
"""

from __future__ import annotations

import enum
import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.budget import UNLIMITED, Budget
from maneuver_automaton.models import Model
from maneuver_automaton.optimal_control.blocks import Blocks, Kind, assembled, kind_of
from maneuver_automaton.optimal_control.ipopt import (
    QUIET,
    SolveStatus,
    Watcher,
    answered,
    load_casadi,
    numpy_on_symbols,
    watcher_of,
)
from maneuver_automaton.optimal_control.place_term import place_term, price_of_places
from maneuver_automaton.optimal_control.polish_program import (
    PolishProgram,
    guard_blocks,
    place_blocks,
    program_of,
)
from maneuver_automaton.optimal_control.problem import Guess, RunningCost, TimeGrid, resampled
from maneuver_automaton.optimal_control.scene import (
    DIGITS,
    USUAL,
    MotionEnds,
    NodeOnTheWay,
    PartPose,
    Point,
    Polished,
    PolishScene,
    PolishSettings,
    SolverAnswer,
    settled,
    settled_state,
)
from maneuver_automaton.optimal_control.separation import Parting, held_near, pairs_near, parted
from maneuver_automaton.optimal_control.transcription import unpacked

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
    program: PolishProgram,
    point: Point,
    parting: Parting,
    held: Sequence[IntArray],
    *,
    fixed: bool,
    price: float,
    budget: Budget,
) -> Solver | float:
    """The program with its lines; where no time is left to build it, what it takes [s].

    `point`: near which obstacles are where the motion of it meets them. `held`: the intervals that
    keep the limits of each guard. `fixed`: whether the lines stand still. `price`: of being inside
    obstacles, per metre and interval; infinite: it must not be. `budget`: every iteration asks it:
    a solve ends with what it has once the time is over.
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
    takes = ROW_S * sum(one.rows for one in blocks)
    if takes > budget.left:
        return float(takes)
    given = OF_LINE * len(own) + corners.size
    priced = place_blocks(program, given)
    blocks += priced
    given += sum(one.given.size for one in priced)
    functions, derivatives, limits = assembled(casadi, blocks, size=len(bounds), given=given)
    watcher = watcher_of(budget, limits, n_variables=len(bounds), n_given=given)
    most = program.settings.fixed_iterations if fixed else program.settings.max_iterations
    options = _options(program.settings, most) | derivatives
    options["iteration_callback"] = watcher

    @functools.cache
    def function(begin: Begin) -> Any:
        return casadi.nlpsol("solver", "ipopt", functions, options | BEGINS[begin])

    return Solver(function, watcher, bounds, limits, corners, fixed)


class CornerPlaces(NamedTuple):
    """Where the parameters of corners begin, among those of all corners."""

    body: IntArray  # of each solid
    piece: IntArray  # of the piece of each pair
    shift: IntArray  # how its corners shift; negative where it stands still


def _corners(program: PolishProgram, point: Point, parting: Parting) -> tuple[Array, CornerPlaces]:
    """Parameters of corners of both sides, and where those of each solid begin."""
    # Of the pieces only those that are in pairs: a map may have thousands. A corner that shifts is
    # where it would be if the motion took no time, and shifts with the duration from there.
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
    places = CornerPlaces(begins[: len(body)], begins[len(body) :][owner], shift_at[owner])
    return np.concatenate([every, shifts.ravel()]), places


def _line_blocks(
    program: PolishProgram, parting: Parting, places: CornerPlaces, fixed: bool, elastic: bool
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
        given = _parameters(line, at)
        kind = _corner_kind(pose, program.problem.n_states, program.dof, fixed, elastic)
        blocks.append(Blocks(kind, np.vstack(variables), np.array(given)))
    if not fixed:
        for moves in (False, True):
            which = (places.shift >= 0) == moves
            pair, corner = np.nonzero(parting.facing.piece & which[:, None])
            if not len(pair):
                continue
            line = slot[parting.owner[pair]]
            at = first + OF_CORNER * (places.piece[pair] + corner)
            given = _parameters(line, at)
            variables = [angle[line], angle[line] + n_lines]
            if moves:
                at = first + places.shift[pair] + OF_SHIFT * corner
                given += [at + k for k in range(OF_SHIFT)]
                variables.append(np.full(len(pair), program.size - 1))
            blocks.append(Blocks(_piece_kind(moves), np.vstack(variables), np.array(given)))
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
    program: PolishProgram,
    point: Point,
    apart: Parting,
    *,
    begin: Begin,
    known: Multipliers | None,
    trust: float,
) -> tuple[Point, Parting, Multipliers, SolverAnswer]:
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
    places, dof = program.scene.places, program.dof
    term = place_term(places, point, dof, beside=BESIDE * trust) if places else None
    watcher = solver.watcher
    began = watcher.budget.elapsed
    bounds, corners = solver.bounds.copy(), solver.corners
    if program.scene.movers:  # they are where the motion meets them, to first order
        corners, _ = _corners(program, point, apart)
        last = program.size - 1
        near = np.array([1.0 - WITHIN, 1.0 + WITHIN])
        bounds[last] = np.clip(duration * near, *bounds[last])
        if program.paced:
            paces = slice(state.size + control.shape[1] - 1, last, control.shape[1])
            bounds[paces] = np.clip(control[:, -1:] * near, *bounds[paces].T[..., None])
    if math.isfinite(trust):
        n_x = state.shape[1]
        for axis in (0, 1):
            # nodes but for the ends
            inner = slice(n_x + axis, n_x * program.n_intervals + axis, n_x)
            near = state[1:-1, axis, None] + np.array([-trust, trust])
            bounds[inner] = np.clip(near, *bounds[inner].T[..., None])
    function = solver.function(begin)
    watcher.forget()
    answer = function(
        x0=np.clip(np.concatenate(first), *bounds.T),
        p=np.concatenate([given.ravel(), corners, *([term.given] if term else [])]),
        lbx=bounds[:, 0],
        ubx=bounds[:, 1],
        lbg=solver.limits[:, 0],
        ubg=solver.limits[:, 1],
        **({"lam_x0": known.bounds, "lam_g0": known.rows} if known and begin is Begin.SAME else {}),
    )
    values, status, reason, iterations = answered(function, answer)
    objective, is_solved = float(answer["f"]), status is SolveStatus.SOLVED
    if not is_solved and watcher.best is not None:
        values, objective = watcher.best, watcher.least
    if not solver.fixed:
        apart = apart.moved(*values[program.size :][: 2 * len(own)].reshape(2, -1))
    found = _point_at(program, values[: program.size])
    if places and term:
        objective += price_of_places(places, found, dof) - term.price(found)
    return (
        found,
        apart,
        Multipliers(*(answer[name].full().ravel() for name in ("lam_x", "lam_g"))),
        SolverAnswer(
            status=status,
            reason=reason,
            objective=objective,
            iterations=iterations,
            seconds=watcher.budget.elapsed - began,
            is_feasible=is_solved or watcher.best is not None,
        ),
    )


def _point_at(program: PolishProgram, values: Array) -> Point:
    """Numbers of the variables but those of lines, as states, controls and durations."""
    n = program.n_intervals
    times = TimeGrid(n_nodes=n + 1, rule="rk4")
    state, control, duration = unpacked(program.problem, times, values)
    durations = np.full(n, duration / n)
    if program.paced:
        return Point(state, control[:, :-1], durations * control[:, -1])
    return Point(state, control, durations)


def _options(settings: PolishSettings, most: int) -> dict[str, Any]:
    return QUIET | {
        "ipopt.mumps_pivot_order": ORDERING,
        "ipopt.mumps_scaling": 0,  # none: the same iterates, without a look at all entries
        "ipopt.mu_init": settings.mu_init,
        "ipopt.tol": settings.tolerance,
        "ipopt.constr_viol_tol": settings.violation,
        "ipopt.acceptable_tol": settings.acceptable[0],
        "ipopt.acceptable_iter": settings.acceptable[1],
        "ipopt.max_iter": most,
    }


HELD = 0.1  # radii of the body: where it comes nearer to a zone than this, it keeps its limits
MISSED = 0.02  # radii of the body: pairs that came nearer than this need a line
TOO_DEEP = 0.2  # radii of the body inside obstacles from where fixed planes lead nowhere
PRICE = 2.0  # of being inside obstacles, in durations of the guess per radius of the body
FIXED_ROUNDS = 2  # solves with fixed planes: what comes out is a guess
TRUST = 0.6  # share of the distance within which pairs have lines
QUICKER = 1.0 - 0.99 * WITHIN  # share of the duration that is as quick as a solve may get
PLACE_ROUNDS = 8  # more solves at most, with prices of places about each answer
BESIDE = 0.2  # of the trust: how far from a node it is looked what places cost
SETTLED = 1e-3  # share of the objective by which another of them must gain
ALIKE = 0.02  # radii of the body: of points so near prices of places are nearly the same
SHORT = 1e-3  # radii of the body: a step so short is not made shorter
TIGHT = 2e-3  # radii of the body: pieces nearer than this are held back by their line


@dataclass(slots=True, eq=False)
class _Steps:
    """How far a solve may lead, and the best so far where places have a price, told anew each time.

    Far from the point about which it is told a place may cost more than was said.
    """

    shortest: float = 0.0  # [m] so short a step is not made shorter
    trust: float = math.inf  # [m] from the point
    before: float = math.inf  # objective at the point
    finder: Solver | None = None  # that found the point
    kept: Point | None = None  # the best whose lines held
    least: float = math.inf  # its objective

    def is_refused(self, solver: Solver, answer: SolverAnswer, far: float) -> bool:
        """Whether it cost more with the same lines; of what costs more the next step is shorter."""
        costs_more = answer.objective > self.before and far > self.shortest
        if costs_more:
            self.trust = 0.5 * far
        refused = costs_more and solver is self.finder
        self.finder = solver
        return refused

    def is_settled(self, found: Point, answer: SolverAnswer) -> bool:
        """Whether another solve would gain little; keeps what lines held and costs least."""
        if answer.objective < self.least:
            self.kept, self.least = found, answer.objective
        return answer.objective > (1.0 - SETTLED) * self.before


def polish(
    model: Model,
    ends: MotionEnds,
    scene: PolishScene,
    guess: Guess,
    *,
    stage_cost: RunningCost | None = None,
    settings: PolishSettings = USUAL,
    fixed_planes: bool = False,
    elastic: bool = False,
    gears: Array | None = None,
    via: Sequence[NodeOnTheWay] = (),
    begin: Begin = Begin.GUESS,
    budget: Budget = UNLIMITED,
) -> Polished:
    """A local optimum among obstacles near a guess; raises MissingExtra without CasADi.

    `ends`: first and last pose and reduced state, in the frame of the scene. `guess`: at equal
    steps, which set the number of intervals; defects are allowed. `stage_cost`: per second, on top
    of 1 for the time. `fixed_planes`: the lines stay as the guess has them: quicker, and harder to
    fail. `elastic`: the body may be inside obstacles at a price, for guesses that are; what comes
    out may still touch, and is a guess itself. `gears` (n - 1,): sign of the speed ahead in every
    interval; stretches of one sign take their own time, and so do those between nodes that are
    passed on the way, `via`. `begin`: nearby, where the guess is a solution with other steps.
    `budget`: its time is for all there is to do; every iteration of the solver asks it.
    """
    began, ends = budget.elapsed, ends.settled
    via = [(node, settled_state(state)) for node, state in via]
    point = _point_of(guess, len(guess.control) if gears is None else len(gears))
    program = program_of(model, ends, scene, settings, stage_cost, gears, point, via)
    lengths = np.hypot(*np.diff(point.state[:, :2], axis=0).T)
    ahead = settings.ahead * float((lengths / point.durations).max(initial=0.0))  # at the fastest
    reach = max((part.reach for part in scene.parts), default=0.0) or 0.5 * ahead or 1.0
    near = max(settings.near * reach, ahead)
    apart = parted(program, point, pairs_near(program, point, near))
    held = held_near(program, point, HELD * reach)
    if fixed_planes and apart.depth(program, point) > TOO_DEEP * reach:
        why = "the guess is too deep inside obstacles for fixed planes"
        spent = budget.elapsed - began
        return Polished._make((*point, *_nothing(why), len(apart.own), spent))
    price = PRICE * float(point.durations.sum()) / reach if elastic else math.inf
    best, total = point, _nothing("lines were missing to the end")
    solver: Solver | None = None
    needed = 0.0  # [s] to build a program that was not built
    known = None
    steps = _Steps(SHORT * reach, near) if scene.places else _Steps()
    rounds = settings.rounds + (PLACE_ROUNDS if scene.places else 0)
    for _ in range(FIXED_ROUNDS if fixed_planes else rounds):
        if budget.is_over:
            total = total._replace(status=SolveStatus.OUT_OF_BUDGET, reason="no time was left")
            break
        if solver is None:
            built = solver_of(
                program, point, apart, held, fixed=fixed_planes, price=price, budget=budget
            )
            if isinstance(built, float):
                reason = f"no time was left: to build the program would take {built:.2g} s"
                total = total._replace(status=SolveStatus.OUT_OF_BUDGET, reason=reason)
                needed = built
                break
            solver = built
        apart = apart.with_margins(program, point, fixed=fixed_planes)
        found, moved, known, answer = solve_from(
            solver, program, point, apart, begin=begin, known=known, trust=steps.trust
        )
        far = float(np.abs(found.state[:, :2] - point.state[:, :2]).max())
        total = total.then(answer)
        if scene.places and steps.is_refused(solver, answer, far):
            begin = Begin.NEARBY
            continue
        if answer.is_feasible or not total.is_feasible:
            best = found
        if elastic or answer.status is not SolveStatus.SOLVED:
            break
        total = total._replace(status=SolveStatus.FAILED, reason="touches between nodes")
        missed = pairs_near(program, found, MISSED * reach)
        held_back = program.scene.movers and found.durations.sum() < QUICKER * point.durations.sum()
        if steps.trust > near and far > near and apart.lacks(missed):
            steps.trust = TRUST * near  # it went through what was not near: in short steps
            continue
        needs = held_near(program, found, MISSED * reach)
        if not all(np.isin(need, have).all() for have, need in zip(held, needs, strict=True)):
            # it is in a zone where it was not, or for longer
            wider = held_near(program, found, HELD * reach)
            point, held = found, list(map(np.union1d, held, wider))
            solver, begin = None, Begin.NEARBY
            continue
        here, there = (program.pieces(one).interval for one in (point, found))
        if not np.array_equal(here, there):  # what moves is there in other intervals now
            point, apart = found, parted(program, found, pairs_near(program, found, near))
            solver, begin = None, Begin.NEARBY
            continue
        point = found
        if steps.trust < near:
            missed = pairs_near(program, found, near)
        apart = moved.joined(program, point, missed)
        alike = apart is moved and (not scene.places or far < ALIKE * reach)
        begin = Begin.SAME if alike else Begin.GUESS
        if apart is moved and not fixed_planes:
            apart = moved.split(program, point, TIGHT * reach)
        if apart is moved and moved.is_kept(program, point):
            settled = not scene.places or steps.is_settled(found, answer)
            if settled and far < 0.99 * steps.trust and not held_back:
                total = total._replace(status=answer.status, reason=answer.reason)
                break
        else:
            apart = apart.faced(program, point)
        steps.before = answer.objective
        if apart is not moved:
            solver, begin = None, Begin.NEARBY if begin is Begin.SAME else begin
    if steps.kept is not None:
        best = steps.kept
        total = total._replace(status=SolveStatus.SOLVED, reason="settled", objective=steps.least)
    lines = len(apart.own)
    if fixed_planes and total.status is SolveStatus.SOLVED:  # free ones that are slack gain nothing
        lines = apart.binding(program, best, TIGHT * reach)
    return Polished._make((*best, *total, lines, max(budget.elapsed - began, needed)))


def _parameters(line: IntArray, corner: IntArray) -> list[IntArray]:
    """Where the parameters of lines stand, and those of the corners beside them."""
    return [OF_LINE * line + k for k in range(OF_LINE)] + [corner + k for k in range(OF_CORNER)]


def intervals_for(duration: float) -> int:
    """How many intervals a motion of a duration [s] gets."""
    fewest, most = USUAL.nodes
    return min(max(math.ceil(duration / USUAL.step), fewest), most)


def _nothing(reason: str) -> SolverAnswer:
    """No answer yet."""
    return SolverAnswer(SolveStatus.OUT_OF_BUDGET, reason, math.inf, 0, 0.0, False)


def _point_of(guess: Guess, count: int) -> Point:
    """The guess on so many intervals."""
    return Point(
        settled(resampled(guess.state, count + 1)),
        settled(held(guess.control, count)),
        np.full(count, float(f"{guess.duration / count:.{DIGITS}g}")),
    )


def held(control: Array, count: int) -> Array:
    """Controls (count, n_u) from some that hold over equal steps."""
    at = (np.arange(count) + 0.5) / count
    return control[np.minimum((at * len(control)).astype(np.int64), len(control) - 1)]

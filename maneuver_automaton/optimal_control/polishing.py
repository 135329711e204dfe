"""Polishing: a vehicle among obstacles as one optimal control problem, from a guess.

Solver success proves nothing: what comes out is to be simulated and audited by others.
"""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.budget import UNLIMITED, Budget
from maneuver_automaton.models import Model
from maneuver_automaton.optimal_control.parting import held_near, pairs_near, parted
from maneuver_automaton.optimal_control.polish_program import Program, program_of
from maneuver_automaton.optimal_control.polish_solver import (
    WITHIN,
    Begin,
    Solver,
    solve_from,
    solver_of,
)
from maneuver_automaton.optimal_control.polish_values import (
    Answer,
    Ends,
    Point,
    Polished,
    PolishSettings,
    Scene,
)
from maneuver_automaton.optimal_control.problem import Guess, RunningCost, resampled
from maneuver_automaton.optimal_control.solution import SolveStatus

HELD = 0.1  # radii of the body: where it comes nearer to a zone than this, it keeps its limits
MISSED = 0.02  # radii of the body: pairs that came nearer than this need a line
TOO_DEEP = 0.2  # radii of the body inside obstacles from where fixed planes lead nowhere
PRICE = 2.0  # of being inside obstacles, in durations of the guess per radius of the body
FIXED_ROUNDS = 2  # solves with fixed planes: what comes out is a guess
TRUST = 0.6  # share of the distance within which pairs have lines
QUICKER = 1.0 - 0.99 * WITHIN  # share of the duration that is as quick as a solve may get
TIGHT = 2e-3  # radii of the body: pieces nearer than this are held back by their line


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
    budget: Budget = UNLIMITED,
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
        intervals. Defects are allowed.
    stage_cost : callable, optional
        Cost per second ``l(z, u)`` on top of 1 for the time.
    settings : PolishSettings, optional
    fixed_planes : bool
        Keep the lines as the guess has them: quicker, and harder to fail.
    elastic : bool
        Let the body into obstacles at a price: for guesses that are inside. What comes
        out may still touch, and is a guess itself.
    gears : (n - 1,) array, optional
        Sign of the speed ahead in every interval; stretches of one sign take their own time.
    budget : Budget
        Its time is for all there is to do; every iteration of the solver asks it.

    Raises
    ------
    MissingExtra
        If CasADi is not installed.
    """
    settings = settings or PolishSettings()
    began = budget.elapsed
    point = _point_of(guess, len(guess.control) if gears is None else len(gears))
    program = program_of(model, ends, scene, settings, stage_cost, gears, point)
    ahead = settings.ahead * _fastest(point)
    reach = max((part.reach for part in scene.parts), default=0.0) or 0.5 * ahead or 1.0
    near = max(settings.near * reach, ahead)
    apart = parted(program, point, pairs_near(program, point, near))
    held = held_near(program, point, HELD * reach)
    if fixed_planes and apart.depth(program, point) > TOO_DEEP * reach:
        why = "the guess is too deep inside obstacles for fixed planes"
        return _polished(point, _nothing(why), budget.elapsed - began)
    price = PRICE * guess.duration / reach if elastic else math.inf
    best, total = point, _nothing("lines were missing to the end")
    solver: Solver | None = None
    needed = 0.0  # [s] to build a program that was not built
    begin, trust, known = Begin.GUESS, math.inf, None
    for _ in range(FIXED_ROUNDS if fixed_planes else settings.rounds):
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
            solver, program, point, apart, begin=begin, known=known, trust=trust
        )
        total = total.then(answer)
        if answer.is_feasible or not total.is_feasible:
            best = found
        if elastic or answer.status is not SolveStatus.SOLVED:
            break
        total = total._replace(status=SolveStatus.FAILED, reason="touches between nodes")
        missed = pairs_near(program, found, MISSED * reach)
        far = float(np.abs(found.state[:, :2] - point.state[:, :2]).max())
        held_back = program.scene.movers and found.durations.sum() < QUICKER * point.durations.sum()
        if trust > near and far > near and apart.lacks(missed):
            trust = TRUST * near  # it went through what was not near: once more, in short steps
            continue
        if not all(map(_covers, held, held_near(program, found, MISSED * reach))):
            # it is in a zone where it was not, or for longer
            wider = held_near(program, found, HELD * reach)
            point, held = found, list(map(np.union1d, held, wider))
            solver, begin = None, Begin.NEARBY
            continue
        if _comes_and_goes(program, point, found):
            point, apart = found, parted(program, found, pairs_near(program, found, near))
            solver, begin = None, Begin.NEARBY
            continue
        point = found
        if trust < near:
            missed = pairs_near(program, found, near)
        apart = moved.joined(program, point, missed)
        begin = Begin.SAME if apart is moved else Begin.GUESS
        if apart is moved and not fixed_planes:
            apart = moved.split(program, point, TIGHT * reach)
        if apart is moved and moved.is_kept(program, point):
            if far < 0.99 * trust and not held_back:
                total = total._replace(status=answer.status, reason=answer.reason)
                break
        else:
            apart = apart.faced(program, point)
        if apart is not moved:
            solver, begin = None, Begin.NEARBY if begin is Begin.SAME else begin
    return _polished(best, total, max(budget.elapsed - began, needed))


def _covers(held: IntArray, needed: IntArray) -> bool:
    """Whether intervals hold all those that are needed."""
    return bool(np.isin(needed, held).all())


def _comes_and_goes(program: Program, before: Point, after: Point) -> bool:
    """Whether something is there in other intervals of one motion than of another one."""
    if not program.scene.movers:
        return False
    here, there = (program.pieces(one).interval for one in (before, after))
    return not np.array_equal(here, there)


def _polished(point: Point, total: Answer, seconds: float) -> Polished:
    return Polished(
        status=total.status,
        reason=total.reason,
        state=point.state,
        control=point.control,
        durations=point.durations,
        objective=total.objective,
        is_feasible=total.is_feasible,
        iterations=total.iterations,
        build_s=seconds - total.seconds,
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


def _fastest(point: Point) -> float:
    """Greatest speed of the reference point from node to node [m/s]."""
    steps = np.hypot(*np.diff(point.state[:, :2], axis=0).T)
    return float((steps / point.durations).max(initial=0.0))


def _nothing(reason: str) -> Answer:
    """No answer yet."""
    return Answer(SolveStatus.OUT_OF_BUDGET, reason, math.inf, 0, 0.0, False)


def _point_of(guess: Guess, count: int) -> Point:
    """The guess on so many intervals."""
    return Point(
        resampled(guess.state, count + 1),
        held(guess.control, count),
        np.full(count, guess.duration / count),
    )


def held(control: Array, count: int) -> Array:
    """Controls (count, n_u) from some that hold over equal steps."""
    at = (np.arange(count) + 0.5) / count
    return control[np.minimum((at * len(control)).astype(np.int64), len(control) - 1)]

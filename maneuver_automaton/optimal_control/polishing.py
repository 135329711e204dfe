"""Polishing: a vehicle among obstacles as one optimal control problem, from a guess.

Solver success proves nothing: what comes out is to be simulated and audited by others.
"""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.budget import UNLIMITED, Budget
from maneuver_automaton.models import Model
from maneuver_automaton.optimal_control.polish_program import (
    Program,
    lines_at,
    pairs_near,
    program_of,
    reaches_at,
)
from maneuver_automaton.optimal_control.polish_solver import (
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
from maneuver_automaton.optimal_control.separation import Lines, Pairs
from maneuver_automaton.optimal_control.solution import SolveStatus

SWING = 1.1  # of what corners swing out between nodes is kept as a margin
MISSED = 0.02  # radii of the body: pairs that came nearer than this need a line
TOO_DEEP = 0.2  # radii of the body inside obstacles from where fixed planes lead nowhere
PRICE = 2.0  # of being inside obstacles, in durations of the guess per radius of the body
TRUST = 0.6  # share of the distance within which pairs have lines


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
    program = program_of(model, ends, scene, settings, stage_cost, gears, guess)
    point = Point(
        resampled(guess.state, program.n_intervals + 1),
        held(guess.control, program.n_intervals),
        np.full(program.n_intervals, guess.duration / program.n_intervals),
    )
    ahead = settings.ahead * _fastest(point)
    reach = max((part.reach for part in scene.parts), default=0.0) or 0.5 * ahead or 1.0
    near = max(settings.near * reach, ahead)
    pairs = pairs_near(program, point, near)
    lines = lines_at(program, point, pairs)
    total = Answer(SolveStatus.OUT_OF_BUDGET, "lines were missing to the end", math.inf, 0, 0.0)
    solver: Solver | None = None
    needed = 0.0  # [s] to build a program that was not built
    margins, again, trust = np.zeros(len(pairs.interval)), False, math.inf
    if fixed_planes and _depth(program, point, pairs, lines) > TOO_DEEP * reach:
        total = total._replace(reason="the guess is too deep inside obstacles for fixed planes")
        return _polished(point, total, budget.elapsed - began)
    for _ in range(settings.rounds):
        if budget.is_over:
            total = total._replace(status=SolveStatus.OUT_OF_BUDGET, reason="no time was left")
            break
        if solver is None:
            price = PRICE * guess.duration / reach if elastic else math.inf
            built = solver_of(program, pairs, fixed=fixed_planes, price=price, budget=budget)
            if isinstance(built, float):
                reason = f"no time was left: to build the program would take {built:.2g} s"
                total = total._replace(status=SolveStatus.OUT_OF_BUDGET, reason=reason)
                needed = built
                break
            solver = built
        if fixed_planes:
            lines = lines.shifted(reaches_at(program, point, pairs, lines).piece)
        margins = np.maximum(margins, _margins(program, point, pairs, lines))
        before = point
        found, moved, answer = solve_from(
            solver, program, point, lines, margins, again=again, trust=trust
        )
        total = Answer(*answer[:3], total.iterations + answer.iterations,
                        total.seconds + answer.seconds)  # fmt: skip
        if elastic or answer.status is not SolveStatus.SOLVED:
            point = found
            break
        missed = pairs_near(program, found, MISSED * reach)
        far = float(np.abs(found.state[:, :2] - before.state[:, :2]).max())
        total = total._replace(status=SolveStatus.FAILED, reason="touches between nodes")
        if (
            trust > near
            and far > near
            and len(pairs.extended(missed).interval) > len(pairs.interval)
        ):
            trust = TRUST * near  # it went through what was not near: once more, in short steps
            continue
        point, lines, again = found, moved, True
        if trust < near:
            missed = pairs_near(program, found, near)
        more = pairs.extended(missed)
        if len(more.interval) > len(pairs.interval):
            new = Pairs(*(column[len(pairs.interval) :] for column in more))
            lines = lines.extended(lines_at(program, point, new))
            margins = np.append(margins, np.zeros(len(new.interval)))
            pairs, solver, again = more, None, False
        elif far < 0.99 * trust and _kept(program, point, pairs, lines):
            total = total._replace(status=answer.status, reason=answer.reason)
            break
    return _polished(point, total, max(budget.elapsed - began, needed))


def _polished(point: Point, total: Answer, seconds: float) -> Polished:
    return Polished(
        status=total.status,
        reason=total.reason,
        state=point.state,
        control=point.control,
        durations=point.durations,
        objective=total.objective,
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


def _margins(program: Program, point: Point, pairs: Pairs, lines: Lines) -> Array:
    """Margins (n,) [m] at the nodes for what the corners swing out between them."""
    reach = reaches_at(program, point, pairs, lines)
    return program.settings.clearance + SWING * (reach.between - reach.nodes)


def _depth(program: Program, point: Point, pairs: Pairs, lines: Lines) -> float:
    """How deep the body is inside obstacles [m]."""
    reach = reaches_at(program, point, pairs, lines)
    return float((reach.between - reach.piece).max(initial=0.0))


def _kept(program: Program, point: Point, pairs: Pairs, lines: Lines) -> bool:
    """Whether every path keeps half of the margin to its piece."""
    reach = reaches_at(program, point, pairs, lines)
    return bool((reach.between - reach.piece <= -0.5 * program.settings.clearance).all())


def held(control: Array, count: int) -> Array:
    """Controls (count, n_u) from some that hold over equal steps."""
    at = (np.arange(count) + 0.5) / count
    return control[np.minimum((at * len(control)).astype(np.int64), len(control) - 1)]

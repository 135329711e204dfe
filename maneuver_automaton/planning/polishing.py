"""Polish plans: a full optimal control problem from their geometry, closed to the last digit.

What a solver says proves nothing: whoever takes these plans checks and audits them.
"""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import Obstacle
from maneuver_automaton.collision.convex import convex_pieces, pieces_seen_from
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import Model
from maneuver_automaton.optimal_control import Guess, SolveStatus
from maneuver_automaton.optimal_control.polishing import (
    Ends,
    Polished,
    PolishSettings,
    Scene,
    intervals_for,
    polish,
)
from maneuver_automaton.optimal_control.separation import BodyPart
from maneuver_automaton.primitives import Maneuver
from maneuver_automaton.problem import Goal, Problem, moves
from maneuver_automaton.refinement.closure import closed
from maneuver_automaton.refinement.guesses import course_guess

POINT = ((np.zeros((1, 2)), 0.0),)  # the body of a vehicle without a footprint


def why_not_polished(problem: Problem) -> str:
    """Why plans of a problem cannot be polished; empty if they can."""
    if any(moves(obstacle) for obstacle in problem.obstacles):
        return "something moves"
    if not all(isinstance(obstacle, Obstacle) for obstacle in problem.obstacles):
        return "there is an occupancy map"
    if problem.start.size != 3:
        return "the vehicle leaves the plane"
    if not _has_casadi():
        return "CasADi is not installed"
    return ""


def scene_of(problem: Problem) -> Scene:
    """Body, obstacles and bounds seen from the start: a moved problem has the same scene."""
    shapes = [one.shape for one in problem.obstacles if isinstance(one, Obstacle)]
    pieces = pieces_seen_from(shapes, problem.start)
    return Scene(
        parts=_body_parts(problem),
        pieces=tuple((corners, radius + problem.margin) for corners, radius in pieces),
        walls=tuple(_walls(problem)),
    )


def guess_of_plan(plan: Plan, *, settings: PolishSettings) -> Guess:
    """States and controls of a plan of any vehicle, seen from its start."""
    course = replace(plan, start=np.zeros(plan.start.size), start_time=0.0).sample()
    return course_guess(course, intervals=functools.partial(intervals_for, settings=settings))


def polished_plan(
    problem: Problem,
    goal: Goal,
    scene: Scene,
    guess: Guess,
    *,
    settings: PolishSettings,
    seconds: float,
    gears: Array | None = None,
) -> tuple[Plan | None, Polished]:
    """A plan near a guess that is locally optimal, and what the solver came to.

    With lines that turn; if that fails, from what planes that stay as the guess has them come to.

    Parameters
    ----------
    problem : Problem
    goal : Goal
        Where it ends.
    scene : Scene
        See `scene_of`.
    guess : Guess
        Seen from the start of the problem.
    settings : PolishSettings
    seconds : float
        For all there is to do [s].
    gears : (n - 1,) array, optional
        Sign of the speed in every interval, to be kept.
    """
    ends = _ends(problem, goal, guess)
    model: Any = problem.automaton.model
    deadline = time.monotonic() + seconds

    def solve(near: Guess, *, fixed_planes: bool = False) -> Polished:
        return polish(
            model,
            ends,
            scene,
            near,
            settings=settings,
            gears=gears,
            fixed_planes=fixed_planes,
            max_seconds=max(deadline - time.monotonic(), 1e-3),
        )

    answer = solve(guess)
    if answer.status is not SolveStatus.SOLVED:
        plain = solve(guess, fixed_planes=True)
        if plain.status is not SolveStatus.SOLVED:
            return None, answer
        answer = solve(plain.as_guess)
        answer = answer if answer.status is SolveStatus.SOLVED else plain
    return _closed_plan(problem, goal, ends, answer), answer


def _closed_plan(problem: Problem, goal: Goal, ends: Ends, answer: Polished) -> Plan | None:
    first, last = problem.first_trim, problem.last_trim(goal)
    found = closed(
        problem.automaton.model,
        first.reduced_state,
        ends.end,
        control=answer.control,
        durations=answer.durations,
    )
    if isinstance(found, str):
        return None
    maneuver = Maneuver(
        name="polished",
        source=first.name,
        target=last.name,
        displacement=found.course.pose[-1],
        duration=found.duration,
        course=found.course,
    )
    return Plan(
        problem.start,
        (first, last),
        durations=[0.0, 0.0],
        maneuvers=(maneuver,),
        start_time=problem.start_time,
    )


def _ends(problem: Problem, goal: Goal, guess: Guess) -> Ends:
    """First and last state seen from the start; the heading goes on as the guess turned."""
    pose = (SE2(problem.start).inverse() @ SE2(goal.pose)).pose.tolist()
    turned = float(guess.state[-1, 2])
    pose[2] = turned + math.remainder(pose[2] - turned, 2.0 * math.pi)
    last = problem.last_trim(goal).reduced_state.tolist()
    end = (*pose[:2], None if goal.free_heading else pose[2], *last)
    return Ends((0.0, 0.0, 0.0, *problem.first_trim.reduced_state.tolist()), end)


def _body_parts(problem: Problem) -> tuple[BodyPart, ...]:
    own = tuple(piece for shape in problem.footprint for piece in convex_pieces(shape))
    parts = [BodyPart(solids=own or POINT)]
    model = problem.automaton.model
    for name, shapes in problem.parts.items():
        solids = tuple(piece for shape in shapes for piece in convex_pieces(shape))
        parts.append(BodyPart(solids=solids, pose=_frame_of(model, model.part_names.index(name))))
    return tuple(parts)


def _frame_of(model: Model, which: int) -> Callable[[Sequence[Any]], Sequence[Any]]:
    frames = model.part_frames  # type: ignore[attr-defined]
    return lambda z: frames(z)[which]


def _walls(problem: Problem) -> list[tuple[float, float, float]]:
    """Bounds of the reference point as half-planes a x + b y <= c, seen from the start."""
    x, y, heading = problem.start.tolist()
    ahead, aside = math.cos(heading), math.sin(heading)
    walls = []
    for pair, normal, here in (
        (problem.bounds.x, (ahead, -aside), x),
        (problem.bounds.y, (aside, ahead), y),
    ):
        if pair is not None:
            low, high = pair
            walls += [(*normal, high - here), (-normal[0], -normal[1], here - low)]
    return walls


@functools.cache
def _has_casadi() -> bool:
    import importlib.util

    return importlib.util.find_spec("casadi") is not None

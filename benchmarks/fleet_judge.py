"""What a fleet drove, judged by shapely alone: at 5 ms, with a bound for what lies between.

Between two looks no point of a body moves farther than its greatest speed times the time to the
nearer look: so much is taken off what was seen.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.cutting import carried
from maneuver_automaton.collision import Disc
from maneuver_automaton.collision.surroundings import parts_of
from maneuver_automaton.fleet import FleetLog, FleetProblem, FleetStep
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Problem

LOOK = 0.005  # [s] between two looks
NEAR = 0.5  # [m] what is proven to keep more is not measured


class Least(NamedTuple):
    """The least distance of any two bodies, proven, and of a body to an obstacle [m]."""

    pair_m: float = math.inf
    names: tuple[str, str] | tuple[()] = ()
    time_s: float = math.nan
    still_m: float = math.inf
    who: str = ""


@dataclass(frozen=True, eq=False)
class _Body:
    """A vehicle's bodies at every look of one step."""

    name: str
    centre: Array  # (looks, 2)
    reach: float  # [m] of all its points from there
    parts: list[tuple[Array, float]]  # geometries (looks,), and by how much they are grown
    travel: float  # [m] that any point moves to the nearer look, at most


def judged(log: FleetLog) -> Least:
    """Least distances along all that a loop drove; a lower bound of the true ones."""
    problems = dict(zip(log.problem.names, log.problem.problems, strict=True))
    pieces = {
        name: {round(one.start_time, 9): one for one in some} for name, some in log.driven.items()
    }
    least = Least()
    stood = {name: problem.first_trim for name, problem in problems.items()}
    for step in log.steps:
        times = step.time + np.append(np.arange(0.0, log.step, LOOK), log.step)
        here = []
        for name, some in pieces.items():
            piece = some.get(round(step.time, 9))
            if piece is not None:
                stood[name] = piece.trims[-1] if piece.trims else stood[name]
                here.append(_body(name, problems[name], piece, times, stood[name]))
        for body in here:
            still = _to_obstacles(body, problems[body.name])
            if still < least.still_m:
                least = least._replace(still_m=still, who=body.name)
        for one, other in itertools.combinations(here, 2):
            distance, number = _between(one, other)
            if distance < least.pair_m:
                names = (one.name, other.name)
                least = least._replace(pair_m=distance, names=names, time_s=float(times[number]))
    return least


def distance_to(
    fleet: FleetProblem, name: str, plan: Plan, other: str, step: FleetStep, since: float
) -> float:
    """Least distance [m] of a plan's rest, from a time on, to another vehicle as a step has it.

    Who breaks down within a maneuver drives it to its end.
    """
    problems = dict(zip(fleet.names, fleet.problems, strict=True))
    stops = step.plans[other]
    end = max(since, *(one.start_time + one.duration for one in (plan, stops)))
    times = np.append(np.arange(since, end, LOOK), end)
    bodies = [
        _body(who, problems[who], one, np.maximum(times, one.start_time))
        for who, one in ((name, plan), (other, stops))
    ]
    return _between(*bodies)[0]


def _body(
    name: str, problem: Problem, piece: Plan, times: Array, stood: Trim | None = None
) -> _Body:
    """A vehicle's bodies; where it did nothing its parts are as in the trim in which it stood."""
    clock = np.minimum(times, piece.start_time + piece.duration)
    plans = [(problem.footprint or (Disc(1e-6),), piece)]
    whole = piece
    if not piece.trims:
        still = stood or problem.first_trim
        whole = Plan(piece.start, (still,), durations=[0.0], start_time=piece.start_time)
    for part, shapes in problem.parts.items():
        plans.append((shapes, carried(whole, problem.automaton.model, part)))
    parts, centre, reach, travel = [], np.zeros((len(times), 2)), 0.0, 0.0
    for number, (shapes, plan) in enumerate(plans):
        poses = plan.pose_at(np.minimum(clock, plan.start_time + plan.duration))[:, :3]
        if number == 0:
            centre = poses[:, :2]
        away = float(np.hypot(*(poses[:, :2] - centre).T).max())
        steps = np.hypot(*np.diff(poses[:, :2], axis=0).T)
        turns = np.abs(np.diff(poses[:, 2]))
        for part in parts_of(shapes):
            placed = np.array(part.at(poses))
            own = _reach(part)
            parts.append((placed, part.radius))
            reach = max(reach, away + own)
            # A chord is a little shorter than its arc: 1e-3 of it covers turns of 0.15 rad.
            travel = max(travel, 1.001 * float((steps + own * turns).max(initial=0.0)) / 2.0)
    return _Body(name, centre, reach, parts, travel)


def _reach(part: object) -> float:
    """Farthest point of a body from the origin of its frame [m]."""
    corners = shapely.get_coordinates(np.atleast_1d(part.at(np.zeros((1, 3))))[0])
    return float(np.hypot(*corners.T).max()) + part.radius


def _between(one: _Body, other: _Body) -> tuple[float, int]:
    slack = one.travel + other.travel
    centres = np.hypot(*(one.centre - other.centre).T) - one.reach - other.reach
    near = np.flatnonzero(centres < NEAR)
    if not near.size:
        return float(centres.min()) - slack, int(centres.argmin())
    best, when = math.inf, 0
    for (a, grown), (b, wide) in itertools.product(one.parts, other.parts):
        distances = shapely.distance(a[near], b[near]) - grown - wide
        if distances.min() < best:
            best, when = float(distances.min()), int(near[distances.argmin()])
    return best - slack, when


def _to_obstacles(body: _Body, problem: Problem) -> float:
    least = math.inf
    for obstacle in problem.obstacles:
        for core, radius, *_ in parts_of((obstacle.shape,)):
            for placed, grown in body.parts:
                least = min(least, float(shapely.distance(placed, core).min()) - grown - radius)
    return least - body.travel

"""Whether a plan keeps to the zones of its problem, by FCL."""

from __future__ import annotations

import numpy as np

from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.carried import carried
from maneuver_automaton.collision import Obstacle, Zone
from maneuver_automaton.collision.fcl_checker import Course, FclChecker
from maneuver_automaton.models import Model
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.problem import Problem
from maneuver_automaton.search.admission import admitted_stretches, piece_is_admitted


def what_zone_forbids(problem: Problem, plan: Plan, origin: tuple[float, float]) -> str:
    """The first motion of a plan that a zone does not admit where it is driven; empty if none.

    A trim that a zone does not admit must not touch it, neither with the body nor with a carried
    part; of a maneuver, the stretches of its course that are not admitted. Zones are counted from
    `origin` [m], so that no digit is lost.
    """
    model = problem.automaton.model
    bodies = [(plan, problem.footprint)]
    bodies += [(carried(plan, model, name), shapes) for name, shapes in problem.parts.items()]
    for zone in problem.zones:
        for moving, shapes in bodies:
            checker = FclChecker(shapes, (Obstacle(zone.shape),), origin=origin)
            number = _first_forbidden(zone, checker, plan, moving, model)
            if number is not None:
                own = plan.primitives[number]
                kind = "trim" if isinstance(own, Trim) else "maneuver"
                return f"{zone.words} does not admit {kind} {number}, {own.name!r}"
    return ""


def _first_forbidden(
    zone: Zone, checker: FclChecker, plan: Plan, moving: Plan, model: Model
) -> int | None:
    """The first primitive that touches a zone with one body where it is not admitted."""
    trims = [
        k
        for k, own in enumerate(plan.primitives)
        if isinstance(own, Trim) and not piece_is_admitted(zone, own)
    ]
    twists = [moving.primitives[k].body_velocity[:3] for k in trims]  # type: ignore[union-attr]
    hit = checker.motions_hit(
        moving.switching_poses[trims, :3],
        np.array(twists).reshape(-1, 3),
        plan.primitive_durations[trims],
    )
    first = None if hit is None else trims[hit[0]]
    numbers: list[int] = []
    courses: list[Course] = []
    unknown = None  # the first maneuver of which nobody knows where it leads
    for k, (own, seen) in enumerate(zip(plan.primitives, moving.primitives, strict=True)):
        if isinstance(own, Trim) or isinstance(seen, Trim) or (first is not None and k > first):
            continue
        if seen.course is None:
            unknown = k
            break
        start = moving.switching_poses[k, :3]
        for rows in _forbidden_rows(zone, own, model):
            numbers.append(k)
            courses.append(Course(start, seen.course.pose[rows, :3], seen.course.time[rows], 0.0))
    entered = checker.courses_hit(courses)
    found = [first, unknown, None if entered is None else numbers[entered[0]]]
    return min((one for one in found if one is not None), default=None)


def _forbidden_rows(zone: Zone, maneuver: Maneuver, model: Model) -> list[slice]:
    """Runs of samples of a maneuver's course along which a zone does not admit it."""
    forbidden = ~admitted_stretches(zone, maneuver, model)
    runs = np.flatnonzero(np.diff(np.concatenate([[False], forbidden, [False]]).astype(np.int8)))
    return [slice(first, last + 1) for first, last in runs.reshape(-1, 2).tolist()]

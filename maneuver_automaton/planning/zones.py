"""Whether a plan keeps to the zones of its problem, by FCL."""

from __future__ import annotations

from itertools import groupby

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.carried import carried
from maneuver_automaton.collision import Obstacle, Zone
from maneuver_automaton.collision.fcl_checker import FclChecker
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
            for k, (own, seen) in enumerate(zip(plan.primitives, moving.primitives, strict=True)):
                start, duration = moving.switching_poses[k], float(plan.primitive_durations[k])
                if isinstance(own, Trim):
                    if not piece_is_admitted(zone, own):
                        assert isinstance(seen, Trim)
                        hit = checker.motion_hit(start[:3], seen.body_velocity[:3], duration)
                        if hit is not None:
                            return f"{zone.words} does not admit trim {k}, {own.name!r}"
                else:
                    assert isinstance(seen, Maneuver)
                    if _course_enters(zone, checker, own, seen, start, model):
                        return f"{zone.words} does not admit maneuver {k}, {own.name!r}"
    return ""


def _course_enters(
    zone: Zone, checker: FclChecker, maneuver: Maneuver, seen: Maneuver, start: Array, model: Model
) -> bool:
    """Whether a maneuver, `seen` at one part, touches a zone where it is not admitted."""
    course = seen.course
    if course is None:
        return True
    forbidden = ~admitted_stretches(zone, maneuver, model)
    for is_forbidden, group in groupby(range(forbidden.size), key=lambda k: bool(forbidden[k])):
        stretch = list(group)
        if is_forbidden:
            rows = slice(stretch[0], stretch[-1] + 2)
            hit = checker.course_hit(start[:3], course.pose[rows, :3], course.time[rows])
            if hit is not None:
                return True
    return False

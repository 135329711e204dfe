"""The last word on the plans of a fleet: each past static obstacles, and every pair."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from maneuver_automaton._brief import brief
from maneuver_automaton.audit import Least, closest_to, terminal_error
from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import AnyObstacle, Shape
from maneuver_automaton.collision.motion import Motion
from maneuver_automaton.fleet.courses import FleetCourse, Levels
from maneuver_automaton.fleet.meetings import meetings
from maneuver_automaton.fleet.problem import FleetProblem
from maneuver_automaton.fleet.result import Closest, FleetResult, FleetStatus
from maneuver_automaton.fleet.vehicle import FleetMember, OwnPlan, vehicles_of
from maneuver_automaton.groups import SE2xR
from maneuver_automaton.models import Omnidirectional, UserModel
from maneuver_automaton.planning.checking import check_plan
from maneuver_automaton.planning.polishing import left_out
from maneuver_automaton.planning.result import PlanResult, PlanStatus
from maneuver_automaton.planning.verdict import Verdict, verify
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import SearchSettings

NEAR = 1.0  # [m] beyond the margin: pairs that come so near are measured
KnownPairs: TypeAlias = dict[tuple[FleetCourse, FleetCourse], Least]
CONTACT = 1e-9  # [m] what is closer touches
IN_SPACE = UserModel(
    name="at will in space",
    group=SE2xR,
    control_names=("speed", "lateral_speed", "turn_rate", "climb"),
    velocity=lambda z, u: u,
)
STANDS = " (which has no plan itself, and stands)"


def verified(
    fleet: FleetProblem,
    vehicles: Sequence[FleetMember],
    held: Mapping[int, OwnPlan],
    reasons: Mapping[int, str],
) -> FleetResult:
    """The answer for these plans; a plan that does not pass is left out, with its reason."""
    results: dict[str, PlanResult] = {}
    why = {vehicles[k].name: said for k, said in reasons.items()}
    passed: dict[int, FleetCourse] = {}
    for one in vehicles:
        result, said = _checked(one, held.get(one.number), fleet.problems[one.number].search)
        if said:
            why.setdefault(one.name, said)
        results[one.name] = result
        if result.plan is not None:
            passed[one.number] = held[one.number].course
    names = [one.name for one in vehicles]
    known: KnownPairs = {}
    while True:
        courses = {one.number: passed.get(one.number, one.standing) for one in vehicles}
        closest = measured(courses, names, keep=fleet.margin, known=known)
        driving = {names[k] for k in passed}
        near = [row for row in closest if row.distance_m <= enough_for(fleet.margin)]
        pairs = [(row, [name for name in row.pair if name in driving]) for row in near]
        row, driven = next(((row, some) for row, some in pairs if some), (None, []))
        if row is None:
            break
        # Past a vehicle that has no plan nobody may drive; and what two libraries do not agree on
        # is not returned. Who stands all the time stands there without its plan too.
        name = max(driven, key=lambda one: (passed[names.index(one)].quiet_after, one))
        other = row.pair[0] if name == row.pair[1] else row.pair[1]
        x, y = passed[names.index(name)].motions[0].at(row.time_s)[:2]
        other += "" if other in driving else STANDS
        why[name] = (
            f"its plan comes within {max(row.distance_m, 0.0):.3g} m of {other} "
            f"at {row.time_s:.4g} s near ({x:.4g}, {y:.4g})"
        )
        results[name] = PlanResult(
            problem=results[name].problem, status=PlanStatus.NO_PLAN, reason=why[name]
        )
        del passed[names.index(name)]
    far = math.inf if len(fleet) < 2 else fleet.margin + NEAR
    n = sum(result.plan is not None for result in results.values())
    status = FleetStatus.FOUND if n == len(vehicles) else FleetStatus.PARTIAL
    return FleetResult(
        problem=fleet,
        status=status if n else FleetStatus.NO_PLAN,
        results=results,
        closest=closest,
        # pairs that are not measured keep a metre more
        clearance_m=min(far, *(row.distance_m for row in closest)) if closest else far,
        reasons=why,
    )


def enough_for(keep: float) -> float:
    """The distance [m] that two bodies must exceed which are to keep one; touching never is."""
    return max(keep - CONTACT, CONTACT)


def _checked(
    one: FleetMember, found: OwnPlan | None, settings: SearchSettings
) -> tuple[PlanResult, str]:
    """The answer for one vehicle, and why its plan was refused."""
    problem = replace(one.problem, search=settings)
    if found is None:
        reason = one.why_none or "it has no plan past the others"
        return PlanResult(problem=problem, status=PlanStatus.NO_PLAN, reason=reason), ""
    goal = problem.goals[found.goal_index]
    checked = check_plan(problem, found.plan, goal, one.workspace)
    if checked.broken is not None or checked.audit is None:
        said = f"its plan was refused: {checked.reason}"
        return PlanResult(problem=problem, status=PlanStatus.NO_PLAN, reason=said), said
    cost = problem.cost_of(found.plan)
    bound = one.bound
    lower = min(cost, bound.value if bound is not None else 0.0)
    return (
        PlanResult(
            problem=problem,
            status=PlanStatus.FOUND,
            reason="",
            plan=found.plan,
            goal_index=found.goal_index,
            cost=cost,
            lower_bound=lower,
            gap=(cost - lower) / cost if cost > 0.0 else 0.0,
            bound=None if bound is None else replace(bound, value=lower, optimal=lower == cost),
            terminal_error=terminal_error(found.plan, goal),
            clearance_m=checked.audit.min_clearance_m,
            audit=checked.audit,
            notes=left_out(problem),
        ),
        "",
    )


def measured(
    courses: Mapping[int, FleetCourse],
    names: Sequence[str],
    *,
    keep: float,
    known: KnownPairs | None = None,
) -> tuple[Closest, ...]:
    """Pairs of vehicles that come near each other, the nearest first, by the audit's bounds.

    Those that are left out keep a metre more than the distance to keep, for all times. What is
    `known` of a pair is not measured again, and added to if it is not.
    """
    rows, known = [], {} if known is None else known
    for meeting in meetings(courses, keep=keep + NEAR):
        both = courses[meeting.one], courses[meeting.other]
        least = known.get(both)
        if least is None:
            least = known[both] = nearest(*both, enough=enough_for(keep))
        rows.append(Closest((names[meeting.one], names[meeting.other]), least.time, least.distance))
    return tuple(sorted(rows, key=lambda row: row.distance_m))


def nearest(one: FleetCourse, other: FleetCourse, *, enough: float = 0.0) -> Least:
    """Least distance of two vehicles at all times [m], and when, by the audit's bounds.

    From the first begin of the two on, as who begins later stands at its start until then, until
    both have come to rest. `enough` decides: the bound is sharp enough to tell its side. Of two
    that climb, each is taken once as it is, past the other in bands: the better bound counts.
    """
    if len(other.bands) > len(one.bands):
        one, other = other, one
    pairs = [(one, other), (other, one)] if len(other.bands) > 1 else [(one, other)]
    return max((_nearest(*pair, enough=enough) for pair in pairs), key=lambda least: least.distance)


def _nearest(one: FleetCourse, other: FleetCourse, *, enough: float) -> Least:
    """The same, the first driven as it is past the other's bodies."""
    begin = min(float(way.time[0]) for way in (*one.motions, *other.motions))
    quiet = min(max(one.quiet_after, other.quiet_after), one.until)
    above = (mine.above(its.low, its.high) > 0.0 for mine in one.bands for its in other.bands)
    levels = one.levels if any(above) else None
    found = [
        nearest_obstacle(
            shapes, motion, other.bodies, until=quiet, since=begin, levels=levels, enough=enough
        )
        for shapes, motion in zip(one.shapes, one.motions, strict=True)
    ]
    return min(found, key=lambda least: least.distance)


def nearest_obstacle(
    shapes: tuple[Shape, ...],
    motion: Motion,
    obstacles: tuple[AnyObstacle, ...],
    *,
    until: float,
    since: float = math.inf,
    levels: Levels | None = None,
    enough: float = 0.0,
) -> Least:
    """A lower bound of the distance to obstacles until a time [s], sharp at `enough` [m]."""
    plan = plan_of_motion(motion, until, since=since, levels=levels)
    reach = (0.0, 0.0) if levels is None else levels.reach
    return least_of(plan, shapes, obstacles, reach=reach, enough=enough)


def least_of(
    plan: Plan,
    shapes: tuple[Shape, ...],
    obstacles: tuple[AnyObstacle, ...],
    *,
    reach: tuple[float, float],
    enough: float,
) -> Least:
    """The same of a plan of something that moves at will; `reach` is its height about the plan."""
    in_space = plan.start.size > 3
    return closest_to(
        plan,
        IN_SPACE if in_space else Omnidirectional(),
        obstacles,
        footprint=shapes,
        body_height=reach if in_space else (0.0, 0.0),
        enough=enough,
    )


def plan_of_motion(
    motion: Motion, until: float, *, since: float = math.inf, levels: Levels | None = None
) -> Plan:
    """A motion on arcs as a plan of something that moves at will; it stands before and after.

    From a time `since` [s], or when the motion begins if that is sooner, until another. In space,
    if `levels` say at which altitudes.

    Examples
    --------
    >>> motion = Motion([0.0, 2.0], [[0, 0, 0], [2, 0, 0]], [[1.0, 0, 0]])
    >>> plan = plan_of_motion(motion, 5.0, since=-1.0)
    >>> plan.start_time, plan.duration, plan.end.tolist()
    (-1.0, 6.0, [2.0, 0.0, 0.0])
    >>> climb = Levels([0.0, 2.0], [5.0, 9.0], (0.0, 1.0))
    >>> plan_of_motion(motion, 5.0, levels=climb).end.tolist()
    [2.0, 0.0, 0.0, 9.0]
    """
    begin, still = min(float(motion.time[0]), since), np.zeros(3)
    twists = np.array([still, *motion.rates, still])
    durations = np.diff(np.minimum([begin, *motion.time, until], until))
    start = motion.pose[0]
    if levels is not None:
        altitudes = levels.at(motion.time)
        twists = np.column_stack([twists, [0.0, *(np.diff(altitudes) / np.diff(motion.time)), 0.0]])
        start = np.append(start, altitudes[0])
    trims = tuple(
        Trim(name=str(k), body_velocity=twist, control=twist) for k, twist in enumerate(twists)
    )
    return Plan(start, trims, durations=durations, start_time=begin)


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetVerdict:
    """What the checks say of the plans of a fleet, each alone and every pair."""

    passed: bool
    verdicts: dict[str, Verdict]  # of each that has a plan
    closest: tuple[Closest, ...]  # pairs that come near each other, the nearest first
    too_near: tuple[Closest, ...]  # those of them that do not keep the fleet's margin

    __repr__ = brief


def verify_fleet(fleet: FleetProblem, plans: Mapping[str, Plan]) -> FleetVerdict:
    """Check plans of a fleet, say from a file, as `plan_fleet` checks its own.

    Each plan is verified past static obstacles, and every pair of vehicles is proven apart at all
    times, also after all have arrived. Who has no plan stands at its start.

    Parameters
    ----------
    fleet : FleetProblem
    plans : mapping of str to Plan
        By the names of the vehicles.

    Returns
    -------
    FleetVerdict
        ``passed`` if every vehicle has a plan that passes, and every pair keeps the margin.

    Raises
    ------
    ValueError
        If a plan is of no vehicle of the fleet, or does not live in its group.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Disc, Plan, Problem, Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"on": (1, 0)})
    >>> there = Problem(robot, [0, 0, 0], [4, 0, 0], footprint=Disc(0.3))
    >>> back = Problem(robot, [4, 0.5, 3.0], [0, 0.5, 3.0], footprint=Disc(0.3))
    >>> fleet = FleetProblem([there, back], names=["a", "b"])
    >>> verdict = verify_fleet(fleet, {"a": Plan([0, 0, 0], robot.trims, durations=[4.0])})
    >>> verdict.passed, verdict.verdicts["a"].passed, verdict.too_near[0].pair
    (False, True, ('a', 'b'))
    """
    unknown = [name for name in plans if name not in fleet.names]
    if unknown:
        raise ValueError(
            f"plans: there is no vehicle {unknown[0]!r}, need some of {', '.join(fleet.names)}"
        )
    vehicles = vehicles_of(fleet)
    problems = {one.name: one.problem for one in vehicles}
    verdicts = {name: verify(problems[name], plan) for name, plan in plans.items()}
    courses = {
        one.number: one.course_of(plans[one.name]) if one.name in plans else one.standing
        for one in vehicles
    }
    closest = measured(courses, fleet.names, keep=fleet.margin)
    too_near = tuple(row for row in closest if row.distance_m <= enough_for(fleet.margin))
    complete = len(plans) == len(fleet) and all(one.passed for one in verdicts.values())
    return FleetVerdict(
        passed=complete and not too_near, verdicts=verdicts, closest=closest, too_near=too_near
    )

"""Nothing leaves the planner unchecked: FCL on every edge and zone, then the audit.

FCL is the authority on static obstacles and zones. Of moving ones there are two opinions that share
no code: the proof in the search, and the bounds of the audit, which are asked here.
"""

from __future__ import annotations

import enum
import functools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.audit import Audit, StatedPrices, audit_plan, closest_to
from maneuver_automaton.automaton import Automaton, Plan, cutting
from maneuver_automaton.budget import UNLIMITED, Budget
from maneuver_automaton.collision import Box, Obstacle, Shape, Zone, blocked, fcl_checker
from maneuver_automaton.collision.layers import Layer, layers_of
from maneuver_automaton.collision.shapes import origin_near
from maneuver_automaton.groups import group_of
from maneuver_automaton.models import Model, Unicycle
from maneuver_automaton.places import Clearance
from maneuver_automaton.planning.on_the_way import what_is_missed
from maneuver_automaton.planning.result import Workspace, workspace_of
from maneuver_automaton.primitives import Trim, closed_form
from maneuver_automaton.primitives.primitive import Trajectory
from maneuver_automaton.problem import Goal, Problem, moves
from maneuver_automaton.refinement.fitting import broken_condition
from maneuver_automaton.search import scene
from maneuver_automaton.search.limits import stays_inside

PROVEN = (1e-3, 2e-5)  # [m] a hit counts if it is one for the finer cover of round shapes too
AUDIT_S, SAMPLE_S = 5e-3, 1.5e-5  # [s] that an audit takes, in all and a sample among obstacles


class Condition(enum.Enum):
    """Conditions that a plan may break, in the order of the checks."""

    WORD = "word"  # the horizon, the number of trims, and how long each of them lasts
    BOUNDS = "bounds"
    VIA = "via"  # a pose on the way is missed
    COLLISION = "collision"  # with an obstacle, or with a zone that does not admit the motion
    AUDIT = "audit"
    TIME = "time"  # of the checks themselves: nothing else is known to be broken


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Checked:
    """Findings of the checks of one plan."""

    audit: Audit | None  # None if an earlier check failed
    broken: Condition | None = None  # the first that is broken
    reason: str = ""

    @property
    def passed(self) -> bool:
        """Whether the plan may be returned."""
        return self.broken is None


class TooLate(Exception):
    """There is no time left to check a plan."""


def check_plan(
    problem: Problem,
    plan: Plan,
    goal: Goal,
    workspace: Workspace | None = None,
    *,
    budget: Budget = UNLIMITED,
) -> Checked:
    """Horizon and limits, bounds, poses on the way, FCL, audit; the first that fails ends it.

    They are given up, too, a moment after the time of a `budget` is over.
    """
    workspace = workspace or workspace_of(problem.obstacles)
    reason = broken_condition(problem, plan)
    if reason:
        return Checked(audit=None, broken=Condition.WORD, reason=reason)
    for maneuver in plan.maneuvers:
        if maneuver is not None and not closed_form.may_drive(problem.automaton.model, maneuver):
            reason = f"the wheels turn while the vehicle stands, in maneuver {maneuver.name!r}"
            return Checked(audit=None, broken=Condition.WORD, reason=reason)
    if not stays_inside(plan, problem.bounds):
        return Checked(audit=None, broken=Condition.BOUNDS, reason="it leaves the bounds")
    reason = what_is_missed(problem, plan)
    if reason:
        return Checked(audit=None, broken=Condition.VIA, reason=reason)
    try:
        reason = _static_hit(problem, plan, goal, workspace, budget=budget)
        reason = reason or what_passes_later(problem, plan)
        if reason:
            return Checked(audit=None, broken=Condition.COLLISION, reason=reason)
        # About how long the audit takes: one that is begun late would be given up.
        courses = [m.course for m in plan.maneuvers if m is not None and m.course is not None]
        samples = sum(len(course.time) for course in courses) if problem.obstacles else 0
        _ask(budget, AUDIT_S + SAMPLE_S * samples * (1 + len(problem.parts)))
        places = None
        if problem.place_costs:
            prices = problem.place_prices_of(plan)
            refused = min((one.refused for one in prices if one.refused is not None), default=None)
            if refused is not None:
                reason = f"at {refused:.6g} s it is where a place cost does not allow it"
                return Checked(audit=None, broken=Condition.COLLISION, reason=reason)
            both = zip(problem.place_costs, problem.bound_place_costs, strict=True)
            places = StatedPrices(  # the audit has distances of its own
                costs=tuple(one if isinstance(one, Clearance) else known for one, known in both),
                prices=tuple(one.price for one in prices),
                whole=problem.cost_of(plan),
            )
        arrived = goal if problem.automaton.lattice is None else replace(goal, pose=plan.end)
        audit = audit_plan(
            plan,
            goal,
            problem.automaton.model,
            footprint=problem.footprint,
            parts=problem.parts,
            obstacles=problem.obstacles,
            body_height=problem.body_height,
            margin=problem.margin,
            states=(problem.first_trim.reduced_state, problem.last_trim(arrived).reduced_state),
            zones=problem.zones,
            places=places,
            via=problem.via,
            order=problem.order,
            around=workspace.surroundings,
            ask=lambda: _ask(budget),
        )
    except TooLate:
        return Checked(audit=None, broken=Condition.TIME)
    broken = None if audit.passed else Condition.AUDIT
    clearance = math.inf if audit.min_clearance_m is None else audit.min_clearance_m
    if problem.moves and broken and clearance <= blocked.too_close(problem.margin):
        broken = Condition.COLLISION
    return Checked(audit=audit, broken=broken, reason=audit.reason)


def bodies_along(problem: Problem, plan: Plan) -> Iterator[tuple[str, Plan, tuple[Shape, ...]]]:
    """What messages call the vehicle and each part it carries, the motion of each, its shapes."""
    yield "", plan, problem.footprint
    for name, shapes in problem.parts.items():
        yield f"the {name}: ", cutting.carried(plan, problem.automaton.model, name), shapes


def what_passes_later(problem: Problem, plan: Plan) -> str:
    """What comes too near to a vehicle that stays where its plan ends; empty if nothing does."""
    arrival = plan.start_time + plan.duration
    lasting = problem.quiet_after - arrival if problem.horizon.stay else 0.0
    if not 0.0 < lasting < math.inf:
        return ""
    still = Trim(name="at the goal", body_velocity=np.zeros(3), control=np.zeros(2))
    for what, moved, shapes in bodies_along(problem, plan):
        pose = moved.end
        stands = Plan(pose[:3], (still,), durations=[lasting], start_time=arrival)
        for layer in layers_of(problem.obstacles, in_space=pose.size > 3):
            height = pose[3:].sum(keepdims=True)
            if layer.clearance(height, problem.body_height)[0] > problem.margin:
                continue
            moving = tuple(one for one in layer.obstacles if moves(one))
            least = closest_to(stands, Unicycle(), moving, footprint=shapes)
            if least.distance <= blocked.too_close(problem.margin):
                return f"{what}at {least.time:.6g} s an obstacle comes too near to where it stays"
    return ""


def _ask(budget: Budget, needed: float = 0.0) -> None:
    """Go on only if more than the time needed [s] is left."""
    if budget.left_to_check <= needed:
        raise TooLate


def load_checks(problem: Problem, workspace: Workspace) -> None:
    """Prepare what FCL and the audit compare with."""
    origin = origin_near(problem.goals[0].pose)
    for layer in layers_of(problem.obstacles, in_space=problem.start.size > 3):
        checker = workspace.checker(
            problem.footprint, layer.obstacles, problem.margin, origin, proven=PROVEN[0]
        )
        checker.lay_all()
    if problem.obstacles:
        workspace.surroundings(problem.obstacles, origin)


@functools.cache
def load_checking() -> None:
    """Import what checks: the audit, shapely, FCL."""
    ahead = Automaton.of_controls(Unicycle(), {"ahead": (1.0, 0.0)})
    wall = Box([1.0, 1.0], [5.0, 5.0])
    problem = Problem(ahead, [0, 0, 0], [1, 0, 0], obstacles=wall, footprint=Box([0.1, 0.1]))
    check_plan(problem, Plan([0, 0, 0], ahead.trims, durations=[1.0]), problem.goals[0])


def what_is_hit(
    problem: Problem,
    plan: Plan,
    goal: Goal,
    workspace: Workspace | None = None,
    *,
    budget: Budget = UNLIMITED,
) -> str:
    """Which edge hits what, or what a zone does not admit; empty if none does.

    By FCL, and of moving obstacles by the audit's bounds.

    Raises TooLate: a moment after the time of a `budget` is over.
    """
    static = _static_hit(problem, plan, goal, workspace, budget=budget)
    if static or not problem.moves:
        return static
    numbers = [k for k, one in enumerate(problem.obstacles) if moves(one)]
    least = closest_to(
        plan,
        problem.automaton.model,
        tuple(problem.obstacles[k] for k in numbers),
        footprint=problem.footprint,
        parts=problem.parts,
        body_height=problem.body_height,
        enough=blocked.too_close(problem.margin),
        ask=lambda: _ask(budget),
    )
    if least.obstacle < 0:
        return ""
    what = f"the {least.part}: " if least.part else ""
    met = f"{what}obstacle {numbers[least.obstacle]} is hit"
    if not plan.primitives:
        return f"{met} at the start"
    k = int(np.searchsorted(plan.switching_times[1:], least.time))
    return f"{met} in {_named(plan, min(k, len(plan.primitives) - 1))}"


def _named(plan: Plan, number: int) -> str:
    """What messages call a primitive of a plan."""
    one = plan.primitives[number]
    return f"{'trim' if isinstance(one, Trim) else 'maneuver'} {number}, {one.name!r}"


def _static_hit(
    problem: Problem,
    plan: Plan,
    goal: Goal,
    workspace: Workspace | None = None,
    *,
    budget: Budget = UNLIMITED,
) -> str:
    """Which edge hits a static obstacle, or what a zone does not admit, by FCL."""
    workspace = workspace or workspace_of(problem.obstacles)
    forbidden = what_zone_forbids(problem, plan, origin_near(goal.pose)) if problem.zones else ""
    if forbidden or not problem.obstacles:
        return forbidden
    layers = layers_of(problem.obstacles, in_space=plan.start.size > 3)
    for what, moving, shapes in bodies_along(problem, plan):
        if what:
            _ask(budget)
        for layer in layers:
            for proven in PROVEN:
                checker = workspace.checker(
                    shapes, layer.obstacles, problem.margin, origin_near(goal.pose), proven=proven
                )
                hit = _what_hits(checker, moving, layer, problem, budget)
                if not hit:
                    break
            if hit:
                return what + hit
    return ""


def _what_hits(
    checker: fcl_checker.FclChecker, plan: Plan, layer: Layer, problem: Problem, budget: Budget
) -> str:
    """Which primitive hits what of a layer, while its altitude is within reach of it."""
    if not plan.primitives:
        height = plan.start[3:].sum(keepdims=True)
        if layer.clearance(height, problem.body_height)[0] > problem.margin:
            return ""
        here = checker.pose_hit(plan.start[:3])
        return "" if here is None else f"obstacle {layer.numbers[here]} is hit at the start"
    coasts, *motions = _coasts_within_reach(plan, layer, problem)
    hit = checker.motions_hit(*motions, ask=lambda: _ask(budget))
    number = len(plan.primitives) if hit is None else int(coasts[hit[0]])
    numbers, courses, missing = _courses_within_reach(plan, layer, problem, before=number)
    sooner = checker.courses_hit(courses, ask=lambda: _ask(budget))
    if sooner is not None:
        number, obstacle = numbers[sooner[0]], sooner[1]
        return f"obstacle {layer.numbers[obstacle]} is hit in {_named(plan, number)}"
    if missing:
        return f"maneuver {missing!r} has no course, so it cannot be checked"
    if hit is None:
        return ""
    return f"obstacle {layer.numbers[hit[1]]} is hit in {_named(plan, number)}"


def _courses_within_reach(
    plan: Plan, layer: Layer, problem: Problem, *, before: int
) -> tuple[list[int], list[fcl_checker.Course], str]:
    """What may come near a layer before a primitive, and the first maneuver without a course."""
    numbers: list[int] = []
    courses: list[fcl_checker.Course] = []
    for k, primitive in enumerate(plan.primitives[:before] if plan.maneuvers else ()):
        if isinstance(primitive, Trim):
            continue
        course = primitive.course
        if course is None:
            return numbers, courses, primitive.name
        start = plan.switching_poses[k]
        for rows in _rows_within_reach(course, start, layer, problem):
            numbers.append(k)
            courses.append(fcl_checker.Course(start[:3], course.pose[rows, :3]))
    return numbers, courses, ""


def _coasts_within_reach(
    plan: Plan, layer: Layer, problem: Problem
) -> tuple[IntArray, Array, Array, Array]:
    """The parts of trims in which the altitude is within the margin of a layer."""
    # Numbers of their primitives (m,), starts (m, 3), twists (m, 3) and durations (m,) [s].
    number = np.arange(len(plan.primitives))
    velocity, lasting, start = plan.twists, plan.primitive_durations, plan.switching_poses[:-1]
    if plan.maneuvers:
        number = np.flatnonzero([isinstance(one, Trim) for one in plan.primitives])
        velocity, lasting, start = velocity[number], lasting[number], start[number]
    if not (math.isinf(layer.high) or plan.start.size == 3):
        low = layer.low - problem.body_height[1] - problem.margin - start[:, 3]
        high = layer.high - problem.body_height[0] + problem.margin - start[:, 3]
        climb = velocity[:, 3]
        with np.errstate(divide="ignore", invalid="ignore"):  # what is level stays where it is
            meets = np.sort([low / climb, high / climb], axis=0)
        level, within = climb == 0.0, (low <= 0.0) & (high >= 0.0)
        first = np.where(level, 0.0, np.clip(meets[0], 0.0, lasting))
        last = np.where(level, lasting, np.clip(meets[1], 0.0, lasting))
        kept = np.where(level, within, (meets[1] >= 0.0) & (meets[0] <= lasting))
        number, velocity, start = number[kept], velocity[kept], start[kept]
        first, last = first[kept], last[kept]
        group, lasting = group_of(plan.start.size), last - first
        start = (group(start) @ group.exp(first[:, None] * velocity)).pose
    return number, start[:, :3], velocity[:, :3], lasting


def _rows_within_reach(
    course: Trajectory, start: Array, layer: Layer, problem: Problem
) -> list[slice]:
    """Runs of samples of a course, begun at a pose, whose altitude is within reach of a layer."""
    if math.isinf(layer.high) or start.size == 3:
        return [slice(None)]
    altitude = course.pose[:, 3]
    step = float(np.abs(np.diff(altitude)).max(initial=0.0))  # so that no run is a sample
    near = layer.clearance(start[3] + altitude, problem.body_height) <= problem.margin + step
    runs = np.flatnonzero(np.diff(np.concatenate([[False], near, [False]]).astype(np.int8)))
    return [slice(first, last) for first, last in runs.reshape(-1, 2).tolist() if last - first > 1]


def what_zone_forbids(problem: Problem, plan: Plan, origin: tuple[float, float]) -> str:
    """The first motion of a plan that a zone does not admit where it is driven; empty if none.

    A trim that a zone does not admit must not touch it, neither with the body nor with a carried
    part; of a maneuver, the stretches of its course that are not admitted. Zones are counted from
    `origin` [m], so that no digit is lost.
    """
    model, bodies = problem.automaton.model, [*bodies_along(problem, plan)]
    for zone in problem.zones:
        for _, moving, shapes in bodies:
            checker = fcl_checker.FclChecker(shapes, (Obstacle(zone.shape),), origin=origin)
            number = _first_forbidden(zone, checker, plan, moving, model)
            if number is not None:
                return f"{zone.words} does not admit {_named(plan, number)}"
    return ""


def _first_forbidden(
    zone: Zone, checker: fcl_checker.FclChecker, plan: Plan, moving: Plan, model: Model
) -> int | None:
    """The first primitive that touches a zone with one body where it is not admitted."""
    trims = [
        k
        for k, own in enumerate(plan.primitives)
        if isinstance(own, Trim) and not scene.piece_is_admitted(zone, own)
    ]
    twists = [moving.primitives[k].body_velocity[:3] for k in trims]  # type: ignore[union-attr]
    hit = checker.motions_hit(
        moving.switching_poses[trims, :3],
        np.array(twists).reshape(-1, 3),
        plan.primitive_durations[trims],
    )
    first = None if hit is None else trims[hit[0]]
    numbers: list[int] = []
    courses: list[fcl_checker.Course] = []
    unknown = None  # the first maneuver of which nobody knows where it leads
    for k, (own, seen) in enumerate(zip(plan.primitives, moving.primitives, strict=True)):
        if isinstance(own, Trim) or isinstance(seen, Trim) or (first is not None and k > first):
            continue
        if seen.course is None:
            unknown = k
            break
        start = moving.switching_poses[k, :3]
        forbidden = np.r_[False, ~scene.admitted_stretches(zone, own, model), False]
        for first_row, end in np.flatnonzero(np.diff(forbidden)).reshape(-1, 2).tolist():
            numbers.append(k)
            courses.append(fcl_checker.Course(start, seen.course.pose[first_row : end + 1, :3]))
    entered = checker.courses_hit(courses)
    found = [first, unknown, None if entered is None else numbers[entered[0]]]
    return min((one for one in found if one is not None), default=None)

"""How the answer to a problem is measured: every condition and the cost, by samples of the plan."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import Shape, Zone
from maneuver_automaton.costs import Cost
from maneuver_automaton.places import Clearance, Ground
from maneuver_automaton.planning import PlanResult, PlanStatus
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.problem import Goal, Problem
from tests.matrix import outside
from tests.matrix.outside import Bodies, Course
from tests.matrix.rows import Engine
from tests.matrix.vehicles import Vehicle

TIME_LIMIT = 600.0  # [s] the work is limited by expansions: some 20 of processor time at most
EXACT = 1e-9  # [m, rad] of a last pose, and relative of sums of durations
SAME = 1e-6  # relative, between costs that should be equal
SAMPLED = 1e-3  # relative, between a cost and what samples say it is
SLOW = 1e-3  # [m/s] slower is no direction of travel


class Nothing(AssertionError):
    """No plan, or no other answer, was found."""


class Costlier(AssertionError):
    """It works, but costs more than a plan that is known."""


def found(result: PlanResult) -> Plan:
    """The plan of an answer; raises Nothing if there is none."""
    if result.status is not PlanStatus.FOUND or result.plan is None:
        raise Nothing(f"{result.status.value}: {result.reason}")
    return result.plan


def found_cost(result: PlanResult) -> float:
    found(result)
    assert result.cost is not None
    return result.cost


def asked(
    vehicle: Vehicle, engine: Engine, *, cost_is: bool = True, **changes: object
) -> PlanResult:
    """The answer to the vehicle's problem with changes, once it is seen to keep what it says."""
    problem = vehicle.problem(**changes)
    result = engine.plan(problem, time_limit=TIME_LIMIT)
    obeys(vehicle, problem, found(result), result.goal_index or 0)
    if cost_is and isinstance(problem.cost, Cost):
        seen = cost_of(problem.cost, result.plan) + price_of_places(vehicle, problem, result.plan)
        close(seen, result.cost, "cost", share=SAMPLED)
    return result


def price_of_places(vehicle: Vehicle, problem: Problem, motion: Plan | None) -> float:
    """What the places along a plan cost, by samples of its body: obstacles near, priced areas."""
    if not problem.place_costs or motion is None:
        return 0.0
    course = Course.driven(motion, vehicle.automaton.model, step_m=0.02 * vehicle.size)
    price = 0.0
    for cost in problem.place_costs:
        if isinstance(cost, Clearance):
            bodies = around(vehicle, course, problem.footprint)
            apart = outside.clearances(
                course, bodies, problem.obstacles, body_height=problem.body_height
            )
            price += outside.price_near(course, apart, weight=cost.weight, within=cost.within)
        else:
            assert isinstance(cost, Ground)
            price += sum(cost.price * outside.way_within(course, area) for area in cost.areas)
    return price


def close(measured: float, stated: float | None, what: str, *, share: float = SAME) -> None:
    """Fail unless a number is what it should be."""
    assert stated is not None, f"no {what} is stated"
    off = abs(measured - stated)
    assert off <= share * max(1.0, abs(stated)), f"{what}: {stated:.9g} stated, {measured:.9g} seen"


def no_dearer(result: PlanResult, than: float, what: str, *, share: float = SAME) -> None:
    """Fail if a plan costs more than a known one."""
    assert result.cost is not None
    if result.cost > than * (1.0 + share):
        raise Costlier(f"costs {result.cost:.6g}, but {what} costs {than:.6g}")


def cost_of(cost: Cost, motion: Plan | None) -> float:
    """What a plan costs, by its samples: time, length, effort, norm, switches, directions."""
    assert motion is not None
    course = Course.of(motion, step_m=0.02)
    changes = course.changes_of_direction(slow=SLOW) if cost.direction_change else 0
    return (
        cost.time * course.duration
        + cost.length * course.length
        + cost.effort * course.effort
        + cost.norm * course.norm
        + cost.switch * switches(motion)
        + cost.direction_change * changes
    )


def switches(motion: Plan) -> int:
    """How often one primitive follows another; each direction within a maneuver is one."""
    count = 0
    for primitive in motion.primitives:
        count += 1
        if isinstance(primitive, Maneuver) and primitive.course is not None:
            trims = [
                Trim(name=name, body_velocity=np.zeros_like(motion.start), control=[0.0])
                for name in (primitive.source, primitive.target)
            ]
            alone = Plan(
                np.zeros_like(motion.start), trims, durations=[0.0, 0.0], maneuvers=[primitive]
            )
            count += Course.of(alone).changes_of_direction(slow=SLOW)
    return max(count - 1, 0)


def trims_lasting(motion: Plan) -> list[tuple[Trim, float]]:
    """Trims of a plan that take time."""
    return [
        (one, time)
        for one, time in zip(motion.primitives, motion.primitive_durations, strict=True)
        if isinstance(one, Trim) and time > 0.0
    ]


def joints(vehicle: Vehicle) -> list[tuple[float, float]]:
    """How far [m] each joint is behind the axle that pulls it, and the next axle behind that."""
    model: Any = vehicle.automaton.model
    if model.name == "articulated_vehicle":
        return [(model.front, model.rear)]
    if model.name == "tractor_with_trailers":
        offsets = (model.hitch_offset, model.hitch_offset_2, model.hitch_offset_3)
        return list(zip(offsets, model.lengths, strict=False))
    return [(0.0, model.hitch_length)] if model.name == "car_with_trailer" else []


def around(vehicle: Vehicle, course: Course, footprint: Sequence[Shape]) -> Bodies:
    """Geometries of the vehicle and what it carries along a course."""
    return outside.bodies(course, footprint, vehicle.parts, joints=joints(vehicle))


def fine(vehicle: Vehicle, motion: Plan) -> Course:
    """Samples a small share of the body apart."""
    step = min(0.1 * vehicle.size, 0.1)
    return Course.driven(motion, vehicle.automaton.model, step_m=step)


def obeys(
    vehicle: Vehicle, problem: Problem, motion: Plan, goal_index: int = 0, *, ends: bool = True
) -> None:
    """Fail unless a plan keeps every condition of a problem, by what its samples do."""
    course = fine(vehicle, motion)
    if ends:
        assert np.abs(motion.pose_at(motion.start_time) - problem.start).max() <= EXACT
        _ends(problem, course, motion, problem.goals[goal_index])
        _lasts(problem, motion)
    jumps = float(np.nanmax(np.append(course.speed, 0.0)))
    assert jumps <= 1.5 * vehicle.fastest + 1.0, f"it moves at {jumps:.3g} m/s"
    bodies = around(vehicle, course, problem.footprint)
    if problem.obstacles:
        least = outside.clearances(
            course, bodies, problem.obstacles, body_height=problem.body_height
        )
        at = int(np.argmin(least))
        enough = least[at] > 0.0 and least[at] >= problem.margin - 1e-6
        assert enough, f"clearance {least[at]:.6g} m at {course.time[at]:.4g} s"
    assert outside.outside_bounds(course, problem.bounds) <= EXACT, "it leaves the bounds"
    for zone in problem.zones:
        _keeps_to(zone, vehicle, course, bodies)


def _ends(problem: Problem, course: Course, motion: Plan, goal: Goal) -> None:
    way, turn = outside.off_goal(course.pose[-1], goal)
    assert way <= goal.tolerance_m + EXACT, f"it ends {way:.3g} m from the goal"
    assert goal.free_heading or turn <= goal.tolerance_rad + EXACT, f"its heading is {turn:.3g} off"
    if problem.automaton.is_kinematic or not motion.primitives:
        return
    for state, trim in ((0, problem.first_trim), (-1, problem.last_trim(goal))):
        off = float(np.abs(course.state[state] - trim.reduced_state).max())
        assert off <= 1e-8, f"reduced state {course.state[state]} is not that of {trim.name!r}"


def _lasts(problem: Problem, motion: Plan) -> None:
    horizon, duration = problem.horizon, Course.of(motion).duration
    if horizon.time is not None:
        assert abs(duration - horizon.time) <= EXACT * horizon.time, f"it takes {duration:.9g} s"
    if horizon.max_time is not None:
        assert duration <= horizon.max_time * (1.0 + EXACT), f"it takes {duration:.9g} s"
    lasting = trims_lasting(motion)
    if horizon.max_trims is not None:
        assert len(lasting) <= horizon.max_trims, f"it has {len(lasting)} trims"
    for trim, time in lasting:
        if trim.body_velocity.any():
            assert time >= horizon.min_coast - EXACT, f"{trim.name!r} lasts {time:.6g} s"


def _keeps_to(zone: Zone, vehicle: Vehicle, course: Course, bodies: Bodies) -> None:
    """Speeds between two samples in a zone, by a little, are those it admits."""
    there = outside.inside(bodies, zone.shape, depth=0.01 * vehicle.size)
    both = there[1:] & there[:-1] & (course.lasting > 1e-12)
    if zone.max_speed is not None and both.any():
        fastest = float(course.speed[both].max())
        assert fastest <= zone.max_speed * (1.0 + SAMPLED), f"{fastest:.6g} m/s in a zone"
    if not zone.reverse and both.any():
        assert float(course.forward[both].min()) >= -SLOW, "it drives backwards in a zone"

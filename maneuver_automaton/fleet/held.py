"""What is left of a plan that a vehicle holds, and how it may go on from there."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterator
from dataclasses import replace

import networkx as nx
import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.automaton.automaton import same_state
from maneuver_automaton.automaton.cutting import (
    NOTHING,
    begin_state,
    committed,
    end_state,
    head_of,
    joined,
    tail_of,
    with_samples_at,
)
from maneuver_automaton.collision.advancement import free_times
from maneuver_automaton.collision.world import own_frame, world_of
from maneuver_automaton.fleet.courses import FleetCourse, radius_of
from maneuver_automaton.fleet.problem import FleetProblem
from maneuver_automaton.fleet.vehicle import FleetMember, OwnPlan
from maneuver_automaton.fleet.verdict import nearest_obstacle
from maneuver_automaton.planning.tracking import PROVEN, PROVEN_SHARE
from maneuver_automaton.primitives import Trim
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.receding_horizon.candidates import allowed, within
from maneuver_automaton.receding_horizon.rest_of_plan import followed_by, moves_on, reanchored

LEFT = 0.5  # share of a tolerance that is left at least
CONTACT = 1e-9  # [m] what is closer touches
LATER = 1e-9  # [s], relative too: what arrives by so much later is as soon


def with_room(problem: Problem, tube_m: float) -> Problem:
    """The problem with goals whose tolerances are less by what a vehicle may be beside its plan.

    A plan that ends at the edge of a tolerance arrives only where nothing disturbs it; one that
    ends within these arrives from anywhere in its tube [m]. At least half of a tolerance is left.
    """
    reach = radius_of(problem.footprint)
    turn = 2.0 * math.asin(min(1.0, tube_m / (2.0 * reach))) if reach > 0.0 else math.pi
    goals = tuple(
        replace(
            goal,
            tolerance_m=max(goal.tolerance_m - tube_m, LEFT * goal.tolerance_m),
            tolerance_rad=max(goal.tolerance_rad - turn, LEFT * goal.tolerance_rad),
        )
        for goal in problem.goals
    )
    return replace(problem, goals=goals)


def fleet_with_room(fleet: FleetProblem, tube_m: float) -> FleetProblem:
    """The fleet as a loop plans it at first: each with goals that keep room; see `with_room`.

    With inertia by maneuvers of the library alone: a motion in one piece could not be left where
    another one breaks down.
    """
    roomy = (with_room(one, tube_m) for one in fleet.problems)
    words = (replace(one, search=replace(one.search, polish=False)) for one in roomy)
    return replace(fleet, problems=tuple(words))


def tube_of(fleet: FleetProblem, tube_m: float | None) -> float:
    """How far any point of a body may be beside its plan [m]; half of the margin if not given."""
    return 0.5 * fleet.margin if tube_m is None else tube_m


def aimed_at(plan: Plan, goal: Goal) -> Goal:
    """A goal as a plan aims at it: where the plan ends, if that is beside but within tolerance."""
    if not within(plan.end, goal) or within(
        plan.end, replace(goal, tolerance_m=0.0, tolerance_rad=0.0)
    ):
        return goal
    return replace(goal, pose=plan.end)


def resting(
    vehicle: FleetMember, pose: Array, time: float, found: OwnPlan | None = None
) -> OwnPlan:
    """A vehicle's plan if it has none: it stays where it is, and does not arrive.

    What it carries stays as it is too: as at the end of a plan, or else as in its first trim.
    """
    rests = [one for one in vehicle.problem.automaton.trims if one.is_rest]
    word = () if found is None else found.plan.trims
    if not rests:
        return _not_leading(vehicle, Plan(pose, (), durations=[], start_time=time))
    last = word[-1] if word else vehicle.problem.first_trim
    off = [np.abs(one.reduced_state - last.reduced_state).sum() for one in rests]
    rest = rests[int(np.argmin(off))]
    return _not_leading(vehicle, Plan(pose, (rest,), durations=[0.0], start_time=time))


def _not_leading(vehicle: FleetMember, plan: Plan) -> OwnPlan:
    """A plan that does not arrive: the vehicle stays where it ends, also if it was to leave."""
    return OwnPlan(plan, math.inf, 0, vehicle.course_of(plan).staying)


@functools.lru_cache(maxsize=4096)  # a step asks for the same ones several times
def rest_of_plan(vehicle: FleetMember, found: OwnPlan, time: float) -> Plan:
    """What is left of a plan from a time on [s]."""
    plan = found.plan
    if time <= plan.start_time or not plan.trims:
        return replace(plan, start_time=max(time, plan.start_time))
    cut = with_samples_at(plan, [time], vehicle.problem.automaton.model)
    return tail_of(cut, time - plan.start_time)


def begin_of(vehicle: FleetMember, plan: Plan, lasting: float) -> Plan:
    """The first seconds of a plan."""
    if not plan.trims or plan.duration <= lasting:
        return plan
    cut = with_samples_at(plan, [plan.start_time + lasting], vehicle.problem.automaton.model)
    return head_of(cut, lasting)


@functools.lru_cache(maxsize=4096)
def left_to_pay(vehicle: FleetMember, found: OwnPlan, time: float) -> float:
    """Cost of what is left of a plan; inf if it does not arrive."""
    if not found.leads or time <= found.plan.start_time:
        return found.cost
    if time >= found.arrival - NOTHING:
        return 0.0
    return vehicle.problem.cost_of(rest_of_plan(vehicle, found, time))


def goes_on(vehicle: FleetMember, found: OwnPlan, other: OwnPlan, time: float) -> bool:
    """Whether another plan has, at a time [s], the reduced state in which the held one then is."""
    rests = [rest_of_plan(vehicle, one, time) for one in (found, other)]
    if not vehicle.problem.has_inertia or not all(one.trims for one in rests):
        return True
    return same_state(begin_state(rests[1]), begin_state(rests[0]))


def off_plan(vehicle: FleetMember, found: OwnPlan, time: float, pose: Array) -> float:
    """How far any point of the body is from where its plan has it [m]: an upper bound."""
    return float(beside(pose, found.plan.pose_at(time), reach_of(found, time)))


def beside(poses: Array, planned: Array, reach: float) -> Array:
    """How far any point of a body is from where it should be [m], at poses (..., dof)."""
    gap = poses - planned
    turn = np.abs(np.remainder(gap[..., 2] + math.pi, 2.0 * math.pi) - math.pi)
    gap[..., 2] = 0.0
    distance = np.sqrt((gap * gap).sum(axis=-1))
    return np.asarray(distance + 2.0 * reach * np.sin(0.5 * np.minimum(turn, math.pi)))


def reach_of(found: OwnPlan, time: float) -> float:
    """How far any point of a vehicle is from its pose at a time of its plan [m]."""
    reaches = [radius_of(shapes) for shapes in found.course.shapes]
    if len(reaches) == 1:
        return reaches[0]
    places = [motion.at(time)[:2] for motion in found.course.motions]
    return max(
        math.dist(place, places[0]) + reach for place, reach in zip(places, reaches, strict=True)
    )


def onward(
    vehicle: FleetMember, found: OwnPlan, time: float, after: float = 0.0
) -> tuple[Plan | None, Problem | None]:
    """What is committed from a time on, `after` seconds at least, and the problem from its end.

    With inertia, the maneuver under way is driven to its end, and on to the next trim that the
    library has; there is no problem where none comes. Who stands goes on from the trim in which it
    stands, not from that of its start.
    """
    rest, own = rest_of_plan(vehicle, found, time), vehicle.problem
    if not moves_on(rest):
        here = _from_where_it_stands(own, rest, rest.start_time + after)
        if here is None:
            return None, None
        return _standing(rest, after) if after > NOTHING else None, here
    if not vehicle.problem.has_inertia:
        busy, name = after, None
    else:
        known = _next_in_library(vehicle, rest, max(after, after + committed(rest, after)))
        if known is None:
            return None, None
        busy, name = known
    if busy <= NOTHING:
        return None, own.starting_at(rest.start, time=rest.start_time, trim=name)
    head = rest
    if busy < rest.duration - NOTHING:
        head = head_of(with_samples_at(rest, [rest.start_time + busy], own.automaton.model), busy)
    elif busy > rest.duration + NOTHING:
        head = followed_by(rest, _standing(replace(rest, start=rest.end), busy - rest.duration))
    return head, own.starting_at(head.end, time=rest.start_time + busy, trim=name)


def _from_where_it_stands(own: Problem, rest: Plan, time: float) -> Problem | None:
    """The problem from where a plan is over, in a trim like its last; None if there is none."""
    here = own.starting_at(rest.end, time=time)
    if not own.has_inertia or not rest.trims:
        return here
    state = end_state(rest)
    if same_state(own.first_trim.reduced_state, state):
        return here
    trim = next((one for one in own.automaton.trims if same_state(one.reduced_state, state)), None)
    return None if trim is None else replace(here, start_trim=trim.name)


def _next_in_library(vehicle: FleetMember, rest: Plan, busy: float) -> tuple[float, str] | None:
    """When, `busy` seconds on at least, a plan is next in a trim of the library, and in which."""
    names, begin = vehicle.problem.automaton.trim_names, 0.0
    between = (*(rest.maneuvers or (None,) * (len(rest.trims) - 1)), None)
    for trim, lasting, maneuver in zip(rest.trims, rest.durations, between, strict=True):
        end = begin + float(lasting)
        if end >= busy - NOTHING and trim.name in names:
            return max(begin, busy), trim.name
        begin = end + (0.0 if maneuver is None else maneuver.duration)
    last = rest.trims[-1]
    return (max(busy, rest.duration), last.name) if last.name in names else None


def _standing(rest: Plan, lasting: float) -> Plan:
    """To stand for a time [s] in the rest that a plan ends in."""
    trim = rest.trims[-1] if rest.trims and rest.trims[-1].is_rest else None
    if trim is None:
        still = np.zeros(rest.start.size)
        trim = Trim(name="rest", body_velocity=still, control=np.zeros(2))
    return Plan(rest.start, (trim,), durations=[lasting], start_time=rest.start_time)


def after_head(vehicle: FleetMember, head: Plan | None, found: OwnPlan) -> OwnPlan:
    """What is committed, then a plan from its end."""
    if head is None:
        return found
    plan = head
    if found.plan.trims:
        follows = joined if vehicle.problem.has_inertia else followed_by
        plan = follows(head, found.plan)
    return vehicle.own(plan, found.goal_index)


def rejoined(
    vehicle: FleetMember, found: OwnPlan, time: float, pose: Array, tube_m: float
) -> Iterator[OwnPlan]:
    """A plan made to start where the vehicle was measured, in several ways; it arrives if that did.

    As it is, if it then ends where the vehicle arrives from anywhere in its tube; the same word
    with other times; three trims to one of its next joints; or as it is, if it ends within the
    goal's tolerance at all.
    """
    rest = rest_of_plan(vehicle, found, time)
    if not found.leads:
        stands = not vehicle.problem.has_inertia or not moves_on(rest)
        still = replace(rest, start=pose)
        yield resting(vehicle, pose, time, found) if stands else _not_leading(vehicle, still)
        return
    goal = vehicle.problem.goals[found.goal_index]
    here = vehicle.problem.starting_at(pose, time=rest.start_time)
    moved = replace(rest, start=pose)
    well = within(moved.end, with_room(here, tube_m).goals[found.goal_index])
    plans: Iterator[Plan] = iter(())
    if moves_on(rest):
        aim = goal if here.has_inertia else aimed_at(rest, goal)
        again = reanchored(here, rest, aim, pad=None, under_way=committed(rest, 0.0) > 0.0)
        plans = (plan for plan in again if allowed(here, plan))
    asis = [moved] if within(moved.end, goal) else []
    for plan in itertools.chain(asis, plans) if well else itertools.chain(plans, asis):
        yield vehicle.own(plan, found.goal_index)


def stopping(vehicle: FleetMember, found: OwnPlan, time: float, pose: Array) -> OwnPlan:
    """The plan that comes to rest soonest; what is held where nothing stops it."""
    rest = rest_of_plan(vehicle, found, time)
    if not vehicle.problem.has_inertia or not moves_on(rest):
        return resting(vehicle, pose, time, found)
    head, problem = onward(vehicle, found, time)
    plans = [_without_coasts(vehicle, rest)]
    if problem is not None and problem.first_trim.is_rest:
        plans.append(head)
    elif problem is not None:
        brake = _brake(problem)
        plans.append(brake if brake is None or head is None else joined(head, brake))
    able = [plan for plan in plans if plan is not None]
    if not able:
        return found.given_up()
    return _not_leading(vehicle, replace(min(able, key=lambda plan: plan.duration), start=pose))


def _without_coasts(vehicle: FleetMember, rest: Plan) -> Plan | None:
    """What is left of a plan, by its maneuvers alone, until it can rest; None if it never can."""
    rests = [one for one in vehicle.problem.automaton.trims if one.is_rest]
    between = rest.maneuvers or (None,) * (len(rest.trims) - 1)
    for n, trim in [*enumerate(rest.trims)][int(committed(rest, 0.0) > NOTHING) :]:
        alike = (one for one in rests if same_state(one.reduced_state, trim.reduced_state))
        stands = trim if trim.is_rest else next(alike, None)
        if stands is not None:
            more = () if stands is trim else (stands,)
            return replace(
                rest,
                trims=(*rest.trims[: n + 1], *more),
                durations=np.zeros(n + 1 + len(more)),
                maneuvers=(*between[:n], *(None for _ in more)),
            )
    return None


def _brake(problem: Problem) -> Plan | None:
    """The maneuvers that lead soonest from a problem's first trim to one that rests."""
    automaton = problem.automaton
    begin = problem.first_trim.name
    graph: nx.DiGraph[str] = nx.DiGraph()
    graph.add_node(begin)
    for one in automaton.maneuvers:
        known = graph.get_edge_data(one.source, one.target)
        if known is None or one.duration < known["maneuver"].duration:
            graph.add_edge(one.source, one.target, weight=one.duration, maneuver=one)
    times = nx.single_source_dijkstra_path_length(graph, begin)
    rests = [one.name for one in automaton.trims if one.is_rest and one.name in times]
    if not rests:
        return None
    path = nx.dijkstra_path(graph, begin, min(rests, key=lambda name: times[name]))
    return Plan(
        problem.start,
        tuple(automaton[name] for name in path),
        durations=[0.0] * len(path),
        maneuvers=tuple(graph[a][b]["maneuver"] for a, b in itertools.pairwise(path)),
        start_time=problem.start_time,
    )


def why_not_free(vehicle: FleetMember, course: FleetCourse, keep: float = math.inf) -> str:
    """Why a course is not free of what is not of the fleet; empty if it is.

    By the kernels, and where they cannot prove it by the audit's bounds. It keeps the vehicle's
    margin, or a distance [m] that is less.
    """
    problem = vehicle.problem
    if not problem.obstacles:
        return ""
    keep = min(problem.margin, keep)
    levels = course.levels if problem.start.size > 3 else None
    frame = own_frame(problem.obstacles, problem.goals[0].pose)
    for shapes, motion in zip(vehicle.standing.shapes, course.motions, strict=True):
        until = min(course.until, max(problem.quiet_after, float(motion.time[-1])) + 1.0)
        enough = max(keep - CONTACT, CONTACT)
        if levels is None:
            world = world_of(problem.obstacles, shapes, frame, keep=keep)
            lasting = np.diff(motion.time, append=max(until, float(motion.time[-1])))
            free = free_times(
                world,
                world.into(motion.pose),
                twists=np.concatenate([motion.rates, np.zeros((1, 3))]),
                durations=lasting,
                margin=PROVEN if keep <= 0.0 else min(PROVEN, PROVEN_SHARE * keep),
                keep=keep,
                times=motion.time,
            )
            if (free >= lasting).all():
                continue
        least = nearest_obstacle(
            shapes, motion, problem.obstacles, until=until, levels=levels, enough=enough
        )
        if least.distance <= enough:
            return f"at {least.time:.6g} s it comes within {least.distance:.3g} m of an obstacle"
    return ""


def distance_to_obstacles(vehicle: FleetMember, course: FleetCourse) -> float:
    """A lower bound of the distance [m] of a course to what is not of the fleet."""
    problem = vehicle.problem
    levels = course.levels if problem.start.size > 3 else None
    found = [
        nearest_obstacle(
            shapes,
            motion,
            problem.obstacles,
            until=max(float(motion.time[-1]), problem.quiet_after),
            levels=levels,
        ).distance
        for shapes, motion in zip(vehicle.standing.shapes, course.motions, strict=True)
    ]
    return min(found, default=math.inf)

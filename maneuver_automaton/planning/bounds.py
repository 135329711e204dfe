"""Lower bounds of plans among obstacles, and what they cover."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from maneuver_automaton._kept import kept_by_first
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.headings import origin_of
from maneuver_automaton.costs import StageCost, terms_of
from maneuver_automaton.models.speeds import greatest_speed
from maneuver_automaton.planning.result import LowerBound
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.search.lattice_query import LatticeQuery, lattice_query
from maneuver_automaton.search.limits import closed_bounds
from maneuver_automaton.words.library import moving_trims


def formula_bound(problem: Problem, goals: Sequence[Goal] = ()) -> LowerBound:
    """No plan is cheaper: the best formula for the goal that is the cheapest by it."""
    bounds = [closed_bounds(problem, goal) for goal in goals or problem.goals]
    cheapest = min(bounds, key=lambda one: max(one.values()))
    kind = max(cheapest, key=cheapest.__getitem__)
    return LowerBound(value=cheapest[kind], kind=kind)


def lattice_bound(query: LatticeQuery) -> LowerBound:
    """No plan is cheaper, whatever its word: the largest of the bounds that hold.

    The closed bounds hold without obstacles too; the path in the plane knows the static ones.
    """
    problem = query.problem
    closed = formula_bound(problem, [problem.goals[k] for k in query.goal_index])
    library = moving_trims(problem.automaton, problem.cost)
    pads = problem.horizon.time is not None and library.rest is not None
    rates = library.rates - (library.rest_rate if pads else 0.0)
    drives = library.speeds > 0.0
    if not drives.any() or (rates < 0.0).any():
        return closed
    per_metre = float((rates[drives] / library.speeds[drives]).min())
    fixed = library.rest_rate * (problem.horizon.time or 0.0) if pads else 0.0
    disc = fixed + per_metre * _in_the_plane(query)
    return LowerBound(value=disc, kind="disc") if disc > closed.value else closed


def _in_the_plane(query: LatticeQuery) -> float:
    """Lower bound [m] of the path in the plane."""
    from maneuver_automaton.search.lattice import plane_bound

    return plane_bound(query)


@kept_by_first
def _greatest_speeds(automaton: Automaton) -> tuple[float, float, float]:
    """Greatest speeds [m/s] of the model: in all, in the plane, and up or down."""
    model = automaton.model
    every, level, climb = (greatest_speed(model, axes=axes) for axes in ((0, 1, 3), (0, 1), (3,)))
    return every, level, climb


def _quickest(problem: Problem, goal: Goal, far: float) -> float:
    """Least time [s] to a goal that is so far [m], at the model's greatest speeds."""
    x, y, _, *up = (goal.pose - problem.start).tolist()
    ways = far, math.hypot(x, y), sum(map(abs, up))
    pairs = zip(ways, _greatest_speeds(problem.automaton), strict=True)
    times = ((way - goal.tolerance_m) / speed for way, speed in pairs if speed > 0.0)
    return float(max(0.0, max(times, default=0.0)))


@kept_by_first
def least_price_per_metre(automaton: Automaton, cost: StageCost, parts: bool = False) -> float:
    """Cost per metre of a library's cheapest trim or maneuver, by its displacement; at least 0.

    Of maneuvers that may begin and end in their middle, by the way of their `parts`.
    """
    still, name = origin_of(automaton, automaton.trims[0]), automaton.trim_names[0]
    priced = Problem(automaton, still, Goal(pose=still, trim=name), cost=cost, start_trim=name)
    places = [0, 1, *range(3, still.size)]
    speeds = np.linalg.norm(automaton.body_velocities[:, places], axis=1)
    prices = (priced.rates[speeds > 0.0] / speeds[speeds > 0.0]).tolist()
    for maneuver in automaton.maneuvers:
        ways = np.linalg.norm(maneuver.displacement[None, places], axis=1)
        costs = np.array([priced.maneuver_cost(maneuver)])
        if parts and (course := maneuver.course) is not None:
            states = np.concatenate([course.reduced_state[:-1], course.reduced_state[1:]])
            controls = np.tile(course.control[:-1], (2, 1))
            twists = automaton.model.body_velocity(states, controls)
            costs = maneuver.cost_multiplier * cost.rates(controls, twists)
            ways = np.linalg.norm(twists[:, places], axis=1)
        prices += (costs[ways > 0.0] / ways[ways > 0.0]).tolist()
    return max(0.0, min(prices, default=0.0))


def straight_bound(problem: Problem, goals: Sequence[Goal], *, parts: bool = False) -> float:
    """No plan to one of some goals costs less: at the greatest speed, or the best price of words.

    It holds whatever the trims at both ends are, and within maneuvers where `parts` of them count.
    """
    cost = terms_of(problem.cost)
    far = [(goal, goal.off(problem.start)[0]) for goal in goals]
    straight = min(max(0.0, off - goal.tolerance_m) for goal, off in far)
    known = cost.length * straight if cost else 0.0
    if cost:
        known += cost.time * min(_quickest(problem, goal, off) for goal, off in far)
    if problem.has_states:
        return known
    return max(known, straight * _price_of_words(problem.setting, parts))


@kept_by_first
def _price_of_words(setting: Problem, parts: bool) -> float:
    """Cost per metre of the cheapest word, where all plans are words of the library; else 0."""
    from maneuver_automaton.planning.polishing import why_not_polished
    from maneuver_automaton.refinement.stop_and_steer import follows_paths

    words = why_not_polished(setting) and not follows_paths(setting.automaton.model)
    return least_price_per_metre(setting.automaton, setting.cost, parts) if words else 0.0


def bound_along_paths(problem: Problem) -> LowerBound:
    """No plan is cheaper: the shortest path, driven from rest to rest at the limits.

    A path that the kinematic vehicle needs B seconds for at full speed v takes ``B + v / a`` with
    the acceleration a, or ``2 sqrt(B v / a)`` where v is not reached; so does a turn on the spot
    with its own rate and acceleration. On a way a turn may be driven slower than at full speed.
    """
    from maneuver_automaton.refinement.stop_and_steer import follows_paths, kinematic_problem

    model, cost = problem.automaton.model, terms_of(problem.cost)
    known = straight_bound(problem, problem.goals)
    if not (follows_paths(model) and problem.rests_at_both_ends and cost):
        return LowerBound(value=known, kind="distance")
    simpler = kinematic_problem(replace(problem, place_costs=()), switch=0.0)
    spins = not simpler.automaton.body_velocities[:, 0].all()
    fastest: list[float] = np.abs(model.reduced_limits).max(axis=1).tolist()
    ramps = (fastest / model.control_limits[:, 1]).tolist()

    def lasting(least: float, ramp: float) -> float:
        return least + ramp if least >= ramp else 2.0 * math.sqrt(least * ramp)

    def driven(least: float) -> float:
        return cost.time * lasting(least, ramps[0]) + cost.length * least * fastest[0]

    found = []
    for goal in simpler.goals:
        closed = closed_bounds(simpler, goal)
        turn = closed.pop("turn", 0.0)
        turned = cost.time * (lasting(turn, ramps[1]) if spins else turn)
        found.append(max((turned, "turn"), *((driven(b), kind) for kind, b in closed.items())))
    query = lattice_query(simpler, tuple(range(len(problem.goals))))
    value, kind = max(min(found), (driven(_in_the_plane(query) / fastest[0]), "disc"))
    return LowerBound(value=max(known, value), kind=kind if value > known else "distance")

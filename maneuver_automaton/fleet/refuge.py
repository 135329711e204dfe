"""A path by a refuge: where a vehicle stands aside until those that need its place have passed."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Plan
from maneuver_automaton.budget import Budget
from maneuver_automaton.collision.advancement import free_times
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.search.lattice import first_plan
from maneuver_automaton.search.lattice_query import LatticeQuery
from maneuver_automaton.search.limits import outside
from maneuver_automaton.search.waiting import with_waits
from maneuver_automaton.words.transitions import SWITCH
from maneuver_automaton.words.word import Word, word_of_steps

SAMPLES = 4000  # places that are looked at
MOST_TRIED = 40  # refuges that ways are searched to
AS_NOW = 0.5  # share of the places at which the vehicle keeps its heading
ALIKE, TURNED = 0.5, 0.8  # [lengths of the body], [rad]: of refuges so near only one is tried
SEED = 14  # of the places
FAR = 8.0  # [lengths of the body] from the way alone
EXPANSIONS = 4000  # of the way to a refuge, and of that from there


def by_a_refuge(
    problem: Problem,
    query: LatticeQuery,
    query_of: Callable[[Problem], LatticeQuery],
    way: Plan,
    budget: Budget,
) -> Word | None:
    """The cheapest path past moving obstacles, with a stop where none ever passes; None if none.

    Places beside the `way` alone, the nearest first; the vehicle drives there, waits, and goes on,
    as soon as rests along that way allow.
    """
    best: Word | None = None
    counted = replace(budget, expansions=EXPANSIONS)
    for pose in refuges(problem, query, way):
        if budget.is_over:
            break
        aim = problem.starting_at(problem.start, time=problem.start_time, goals=Goal(pose))
        there = first_plan(query_of(aim), budget=counted).word
        if there is None or (best is not None and there.cost >= best.cost):
            continue
        leaving = problem.starting_at(pose, time=problem.start_time)
        back = first_plan(query_of(leaving), budget=counted).word
        if back is None:
            continue
        steps = [
            (SWITCH, int(k), float(t))
            for word in (there, back)
            for k, t in zip(word.trims, word.durations, strict=True)
        ]
        timed = with_waits(query, word_of_steps(steps, goal=back.goal))
        if timed is not None and (best is None or timed.cost < best.cost):
            best = timed
    return best


def refuges(problem: Problem, query: LatticeQuery, way: Plan, *, off: bool = False) -> list[Array]:
    """Poses (3,) beside a way at which the vehicle may stand from when it gets there, for ever.

    The nearest to the way first. `off` the way of another vehicle it stands from its start on: near
    that way, or near its start.
    """
    rng, world = np.random.default_rng(SEED), query.world
    size = max(world.body.reach, query.library.radius * 0.5)
    # Seen from the way, so that a moved problem has the moved refuges.
    since = way.duration * rng.uniform(0.0, 1.0, SAMPLES)
    bases = np.array(way.pose_at(way.start_time + since)[:, :3])
    if off:
        since[:], bases[::2] = 0.0, problem.start[:3]
    away = size * rng.uniform(0.0, FAR, SAMPLES)
    bearing, turned = rng.uniform(-math.pi, math.pi, (2, SAMPLES))
    turned[: int(AS_NOW * SAMPLES)] = 0.0
    heading, bearing = bases[:, 2] + turned, bases[:, 2] + bearing
    if problem.automaton.translated is not None:
        heading[:] = problem.start[2]
    poses = np.column_stack(
        [bases[:, 0] + away * np.cos(bearing), bases[:, 1] + away * np.sin(bearing), heading]
    )
    begins = problem.start_time + since
    lasting = np.maximum(world.last_event - begins, 0.0) + 1.0
    stands = free_times(
        world,
        world.into(poses),
        twists=np.zeros((SAMPLES, 3)),
        durations=lasting,
        margin=query.margin,
        keep=problem.margin,
        times=begins,
    )
    kept = np.flatnonzero(stands >= lasting)
    found: list[Array] = []
    for k in kept[np.argsort(away[kept], kind="stable")]:
        pose, others = poses[k], np.array(found).reshape(-1, 3)
        near = np.hypot(*(others[:, :2] - pose[:2]).T) < ALIKE * size
        turn = np.abs(np.remainder(others[:, 2] - pose[2] + math.pi, 2.0 * math.pi) - math.pi)
        if not (near & (turn < TURNED)).any() and not outside(pose, problem.bounds):
            found.append(pose)
            if len(found) == MOST_TRIED:
                break
    return found

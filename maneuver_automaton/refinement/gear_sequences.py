"""Kinematic plans that differ in their gears, a promising one first.

The sequence of gears, and the side on which obstacles are passed, decide the result of polishing.
So several plans are made, by pricing changes of direction differently and by turning less
tightly than the vehicle could, and ranked by the time they would take from stop to stop.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.budget import Budget
from maneuver_automaton.costs import Cost, terms_of
from maneuver_automaton.models import Car, Model, Unicycle
from maneuver_automaton.optimal_control import Guess
from maneuver_automaton.optimal_control.scene import Point, Polished
from maneuver_automaton.problem import STANDING, Problem
from maneuver_automaton.refinement.improve import NO_WORD, Patience, WordSchedule, words_of
from maneuver_automaton.search.cost_to_go import cost_to_go_table
from maneuver_automaton.search.lattice_pass import plan_of_word
from maneuver_automaton.search.lattice_query import lattice_query

# of a change of direction, and of a switch of trims, in the time of a turning radius
PRICES = (0.8, 0.0), (0.3, 0.8), (0.3, 0.3), (2.0, 0.0)
BRIEF = Patience(attempts=300, passes=1)
MOST = 20_000  # expansions of one search, unless the problem asks for fewer
STROKE_TOLERANCE = 0.15  # share of a stroke by which like sequences may differ
SMALL = 0.02  # share of the whole path by which a stroke counts as longer
OTHERS = 8  # further words of each search that are looked at
KEPT = 6  # plans of all, at most


Estimate = Callable[[Plan], float]
"""Time [s] a vehicle with inertia takes along a kinematic plan, roughly."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class TimedDrive:
    """A kinematic plan, and its motion from stop to stop."""

    plan: Plan
    estimate: float  # [s]
    strokes: Array  # (m,) signed lengths of its strokes [m]; turns on the spot are no stroke

    def resembles(self, other: TimedDrive) -> bool:
        """Whether it has the same gears, for about as long each."""
        if self.strokes.shape != other.strokes.shape:
            return False
        mine, theirs = np.abs(self.strokes), np.abs(other.strokes)
        longer = np.maximum(mine, theirs) + SMALL * (mine.sum() + theirs.sum())
        signs = (np.sign(self.strokes) == np.sign(other.strokes)).all()
        return bool(signs and (np.abs(mine - theirs) <= STROKE_TOLERANCE * longer).all())


@functools.lru_cache(maxsize=16)
def car_library(
    *, wheelbase: float, max_steering: float, share: float = 1.0, reverses: bool = True
) -> Automaton:
    """Straight on and as tightly as a share of the greatest curvature allows, to both sides."""
    angle = math.atan(share * math.tan(max_steering))
    turns = {"left": angle, "straight": 0.0, "right": -angle}
    gears = {"ahead": 1.0, "back": -1.0} if reverses else {"ahead": 1.0}
    controls = {f"{g} {t}": (gears[g], turns[t]) for g in gears for t in turns}
    return Automaton.of_controls(Car(wheelbase=wheelbase, max_steering=max_steering), controls)


@functools.lru_cache(maxsize=16)
def unicycle_library(
    *, max_speed: float, max_turn_rate: float, share: float = 1.0, reverses: bool = True
) -> Automaton:
    """Straight on, arcs at a share of the greatest turn rate, and turns on the spot."""
    gears = {"ahead": max_speed, "back": -max_speed} if reverses else {"ahead": max_speed}
    turns = {"left": share * max_turn_rate, "straight": 0.0, "right": -share * max_turn_rate}
    controls = {f"{g} {t}": (gears[g], turns[t]) for g in gears for t in turns}
    spins = {"spin left": (0.0, max_turn_rate), "spin right": (0.0, -max_turn_rate)}
    return Automaton.of_controls(Unicycle(), controls | spins)


def gear_sequences(
    problem: Problem, libraries: Sequence[Automaton], estimate: Estimate, *, budget: Budget
) -> Iterator[TimedDrive]:
    """Kinematic plans that differ: a promising one soon, then those that take the least time.

    `problem`: start, goal, obstacles and what places cost, beside its price of a second; its
    automaton is replaced, and the prices of changes of direction. `libraries`: kinematic ones, from
    `car_library` or `unicycle_library`. `estimate`: duration of a plan. `budget`: its
    time is for all searches together; they are counted in expansions and attempts, so it only cuts
    them short. Yields the best of the first prices before
    the others are tried; then the others, by estimate.
    """
    terms = terms_of(problem.cost)
    second = terms.time if terms and terms.time else 1.0
    found: list[TimedDrive] = []
    first: TimedDrive | None = None
    for turning, switching in PRICES:
        for library in libraries:
            if budget.is_over:
                break
            # of the time in which the tightest arc turns by one radian
            unit = second * (1.0 / float(np.abs(library.body_velocities[:, 2]).max()))
            cost = Cost(time=second, direction_change=turning * unit, switch=switching * unit)
            variant = replace(problem, automaton=library, cost=cost)
            for plan in (one for one in _plans(variant, budget) if one.duration > 0.0):
                drive = TimedDrive(plan=plan, estimate=estimate(plan), strokes=_strokes(plan))
                alike = [other for other in found if drive.resembles(other)]
                if not any(drive.estimate >= other.estimate for other in alike):
                    found = [other for other in found if other not in alike] + [drive]
        if first is None and found:
            first = min(found, key=lambda one: one.estimate)
            yield first
    if first is not None:
        others = sorted(found, key=lambda one: one.estimate)[:KEPT]
        yield from (one for one in others if not one.resembles(first))


def _plans(problem: Problem, budget: Budget) -> Iterator[Plan]:
    """Plans of one search: its first one improved, and the others that it found."""
    query = lattice_query(problem, tuple(range(len(problem.goals))))
    most = min(MOST, problem.search.max_expansions or MOST)  # the clock decides nothing
    schedule = WordSchedule(most=most, patience=BRIEF, table=cost_to_go_table(problem))
    timed = budget._replace(expansions=None)
    found = words_of(query, budget=timed, schedule=schedule).to_the_end()
    words = (found.word, *found.others[:OTHERS]) if found.word is not NO_WORD else ()
    yield from (plan_of_word(query, word) for word in words)


def _strokes(plan: Plan) -> Array:
    """Signed lengths of the stretches without a change of direction [m]."""
    lengths = np.array([trim.body_velocity[0] for trim in plan.trims]) * plan.durations
    lengths = lengths[np.abs(lengths) > 1e-6]
    if not lengths.size:
        return lengths
    begins = np.flatnonzero(np.diff(np.sign(lengths), prepend=0.0))
    return np.add.reduceat(lengths, begins)


def gears_of(model: Model, guess: Guess | Point | Polished) -> Array:
    """Sign (n - 1,) of the speed ahead in every interval; where it is zero, that of the next."""
    signs = np.sign(_speeds(model, guess)[:, 0])
    for k in range(len(signs) - 2, -1, -1):
        signs[k] = signs[k] or signs[k + 1]
    for k in range(1, len(signs)):
        signs[k] = signs[k] or signs[k - 1]
    return np.where(signs == 0.0, 1.0, signs)


def without_shuffles(model: Model, found: Point | Polished, shortest: float) -> Array | None:
    """Gears (n - 1,) without stretches shorter than `shortest` [m]; None if there are none.

    A solver may go back and forth by millimetres about a change of direction, which gains nothing.
    None for vehicles that move sideways too: it has no gears.
    """
    speeds = _speeds(model, found)
    if speeds[:, 1].any():
        return None
    driven = np.abs(speeds[:, 0]) * found.durations
    gears = gears_of(model, found)
    longer = _merged(gears, driven, shortest)
    changed = (longer != gears) & (np.abs(speeds[:, 0]) > STANDING)
    return longer if changed.any() else None


def _merged(gears: Array, driven: Array, shortest: float) -> Array:
    """Gears (n,) of which no stretch is shorter, the shortest ones turned first."""
    gears = gears.copy()
    while True:
        begins = np.flatnonzero(np.diff(gears, prepend=0.0))
        lengths = np.add.reduceat(driven, begins)
        least = int(np.argmin(lengths))
        if len(begins) == 1 or lengths[least] >= shortest:
            return gears
        gears[begins[least] : [*begins, len(gears)][least + 1]] *= -1.0


def _speeds(model: Model, motion: Guess | Point | Polished) -> Array:
    """Mean body velocities (n - 1, dof) in every interval."""
    reduced = motion.state[:, model.group.dof :]
    begin = model.body_velocity(reduced[:-1], motion.control)
    return np.asarray((begin + model.body_velocity(reduced[1:], motion.control)) / 2.0)

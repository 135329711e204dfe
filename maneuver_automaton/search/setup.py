"""A planning problem as the arrays that search kernels share, and the few trims of large ones."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._kept import kept_by_first
from maneuver_automaton.groups.chain import seen_from
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.words.library import FULL_TURN, MovingTrims, moving_trims
from maneuver_automaton.words.transitions import Transitions, identities

STILL = 1e-12  # [m, rad] start and goal that are no farther apart are one


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SearchSetup:
    """The moving trims of a problem, and the goal seen from its start (altitude 0 in the plane)."""

    trims: IntArray  # (M,) their indices in the automaton, of equal twists only the cheapest
    twists: Array  # (M, 4)
    rates: Array  # (M,) cost per second
    periods: Array  # (M,) [s] time of a full turn, inf for straights
    goal: Array  # (4,) relative to the start
    free_heading: bool
    rest: int | None  # index of the cheapest rest
    rest_rate: float
    climbs: bool  # whether altitude is a condition
    library: MovingTrims  # where the trims come from
    transitions: Transitions  # between the classes of the automaton's trims
    start_class: int = 0  # of the trim before the word
    goal_class: int = 0  # of the trim after it
    shortest: float = 0.0  # [s] words with shorter coasting times are left out

    @property
    def start_is_goal(self) -> bool:
        """Whether nothing need be done."""
        return is_still(self.goal, free_heading=self.free_heading)


def search_setup(problem: Problem, goal: Goal) -> SearchSetup:
    """Arrays from which every search for one goal starts."""
    library = moving_trims(problem.automaton, problem.cost)
    relative = goal_from_start(problem, goal)
    return SearchSetup(
        trims=library.trims,
        twists=library.twists,
        rates=library.rates,
        periods=library.periods,
        goal=relative,
        free_heading=goal.free_heading,
        rest=library.rest,
        rest_rate=library.rest_rate,
        climbs=bool(library.climbs or relative[3] != 0.0),
        library=library,
        transitions=identities(problem.automaton),
        shortest=problem.horizon.min_coast,
    )


def is_still(goal: Array, *, free_heading: bool) -> bool:
    """Whether a goal (4,) seen from the start is the start."""
    x, y, turn, z = goal.tolist()
    if abs(x) > STILL or abs(y) > STILL or abs(z) > STILL:
        return False
    return free_heading or abs(math.remainder(turn, FULL_TURN)) <= STILL


def goal_from_start(problem: Problem, goal: Goal) -> Array:
    """The goal (4,) seen from the problem's start, at an altitude of zero in the plane."""
    relative = np.zeros(4)
    relative[: problem.start.size] = seen_from(problem.start, goal.pose)
    relative.setflags(write=False)
    return relative


FEW = 14  # a library of up to this many moving trims is its own sub-library


def sub_library(setup: SearchSetup) -> SearchSetup:
    """A few trims that reach far: extreme in eight directions, fast and cheap straights, spins."""
    if len(setup.trims) <= FEW:
        return setup
    few = few_of(setup.library)
    return replace(setup, trims=few.trims, twists=few.twists, rates=few.rates, periods=few.periods)


@kept_by_first
def few_of(library: MovingTrims) -> MovingTrims:
    """The few trims that stand for a library: the same for every start and goal."""
    twists, rates = library.twists, library.rates
    scaled = twists / np.abs(twists).max(axis=0).clip(min=1e-300)
    chosen: list[int] = []

    def choose(score: Array, mask: Array) -> None:
        rows = np.flatnonzero(mask)
        if rows.size:
            order = np.lexsort((rates[rows], -score[rows].round(12)))
            chosen.append(int(rows[order[0]]))

    everything = np.ones(len(twists), dtype=bool)
    straight = twists[:, 2] == 0.0
    spin = np.linalg.norm(scaled[:, :2], axis=1) == 0.0
    speed = np.linalg.norm(twists[:, :2], axis=1)
    for sign in (1.0, -1.0):
        forward = sign * twists[:, 0] > 0.0
        choose(speed, straight & forward)
        choose(-rates / speed.clip(min=1e-300), straight & forward)
        choose(sign * twists[:, 2], spin)
        if twists[:, 1].any():
            choose(sign * twists[:, 1], straight)
        if twists[:, 3].any():
            choose(sign * twists[:, 3], everything)
    for angle in np.arange(8) * np.pi / 4.0:
        choose(np.cos(angle) * scaled[:, 0] + np.sin(angle) * scaled[:, 2], everything)
    few = list(dict.fromkeys(chosen))
    return replace(
        library,
        trims=library.trims[few],
        twists=twists[few],
        rates=rates[few],
        periods=library.periods[few],
        speeds=library.speeds[few],
        turn_rates=library.turn_rates[few],
    )

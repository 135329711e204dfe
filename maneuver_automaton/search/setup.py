"""A planning problem as the library that words are made of, and what they have to meet.

A library is packed once, for every start and goal: the moving trims of an automaton, or a few that
stand for them, then what fills up the time of a word, then the turn of a free heading. Whatever
searches numbers trims by the rows of that packing, and `trims` leads from a row to the automaton.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._kept import kept_by_first
from maneuver_automaton.groups.se2 import seen_from
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.words._kernels_closing import MET, close_times
from maneuver_automaton.words._kernels_times import TimesProblem
from maneuver_automaton.words.library import (
    FULL_TURN,
    MovingTrims,
    Transitions,
    identities,
    moving_trims,
)

STILL = 1e-12  # [m, rad] start and goal that are no farther apart are one


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SearchSetup:
    """The trims that words are made of, and the goal seen from the start (altitude 0 in the plane).

    Its library has the rest that fills a fixed time, if there is one.
    """

    library: MovingTrims
    goal: Array  # (4,) relative to the start
    free_heading: bool
    climbs: bool  # whether altitude is a condition
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
        library=library,
        goal=relative,
        free_heading=goal.free_heading,
        climbs=bool(library.climbs or relative[3] != 0.0),
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
    relative = np.array([*seen_from(problem.start, goal.pose), 0.0][:4])
    relative.setflags(write=False)
    return relative


FEW = 14  # a library of up to this many moving trims is its own sub-library


def sub_library(setup: SearchSetup) -> SearchSetup:
    """The setup with the few trims that stand for its library."""
    return replace(setup, library=few_of(setup.library))


@kept_by_first
def few_of(library: MovingTrims) -> MovingTrims:
    """A few trims that reach far: extreme in eight directions, fast and cheap straights, spins."""
    if len(library.trims) <= FEW:
        return library
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
    columns = "trims", "twists", "rates", "periods", "speeds", "turn_rates"
    return replace(library, **{name: getattr(library, name)[few] for name in columns})


@dataclass(frozen=True, eq=False, kw_only=True)
class Columns:
    """The packing of a library: its trims, what fills up the time, the turn of a free heading."""

    trims: IntArray  # (M,) their indices in the automaton, -1 for the free turn
    twists: Array  # (M, 4)
    rates: Array  # (M,) that of rest taken off where it pads
    rows: Array  # (2, M) altitude and time that a second of each adds up to
    weights: Array  # (M,) the second one: 0 for the free turn, which takes no time, otherwise 1
    number_of: IntArray  # (m,) of the automaton's trims their row here, -1 where there is none
    scale: float  # size of a typical rate


@kept_by_first
def columns(library: MovingTrims, *, pads: bool, free_heading: bool) -> Columns:
    """The trims of a library, its rest where that `pads` a time, a free turn."""
    trims, twists, rates = library.trims, library.twists, library.rates
    if pads and library.rest is not None:
        trims = np.append(trims, library.rest)
        twists = np.vstack([twists, np.zeros(4)])
        rates = np.append(rates - library.rest_rate, 0.0)
    weights, number_of = np.ones(len(trims)), np.full(library.of, -1, dtype=np.int64)
    number_of[trims] = np.arange(len(trims))
    if free_heading:
        trims = np.append(trims, UNUSED)
        twists = np.vstack([twists, [0.0, 0.0, 1.0, 0.0]])
        rates = np.append(rates, 0.0)
        weights = np.append(weights, 0.0)
    # kernels are compiled for arrays that can be written
    return Columns(
        trims=trims,
        twists=np.array(twists, order="C"),
        rates=np.array(rates),
        rows=np.array([twists[:, 3], weights]),
        weights=weights,
        number_of=number_of,
        scale=float(np.abs(rates).max(initial=1.0)),
    )


UNUSED = -1  # stands in `trims` for what is no trim of the automaton


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class InsertionLibrary:
    """A library in which trims are priced, and what its words have to meet."""

    trims: IntArray  # (M,) their indices in the automaton, UNUSED for what is none
    number_of: IntArray  # from the automaton's indices to these, -1 where there is none
    problem: TimesProblem  # (M,) trims
    rest: int | None  # its number here
    tail: int  # how many turns of a free heading follow every word: 0 or 1
    climbs: bool  # whether the first row is altitude
    n_priced: int  # all but the free turn
    fixed_cost: float  # of the whole fixed time at rest
    scale: float  # size of a typical rate

    def within_time(self, limit: float) -> InsertionLibrary:
        """The library with a column for unused time, so that words last at most `limit` [s].

        The inequality becomes the equality "coasting times and unused time add up to `limit`".
        Unused time has no twist and no cost; its reduced cost is the price of time, which must not
        be negative. There must not be a condition on the time already.
        """
        at, known = self.n_priced, self.problem
        weights = np.append(np.ones(at + 1), np.zeros(self.tail))
        return replace(
            self,
            trims=np.insert(self.trims, at, UNUSED),
            problem=TimesProblem(
                twists=np.insert(known.twists, at, 0.0, axis=0),
                rates=np.insert(known.rates, at, 0.0),
                rows=np.vstack([np.insert(known.rows, at, 0.0, axis=1), weights]),
                goal=known.goal,
                targets=np.append(known.targets, limit),
            ),
            rest=at,
            n_priced=at + 1,
        )

    def corrected(self, word: IntArray, times: Array, goal: Array) -> Array | None:
        """Times (n,) near `times` with which the word ends at `goal`; None if there are none.

        The smallest change: the goal is less than 1e-9 away, and less for small ones.
        """
        first, known = int(self.climbs), self.problem  # an end's altitude is a condition anyway
        start = 0.0 - goal  # from the goal's place no digit is lost
        start[2] = 0.0
        end = start, known.twists[word], float(goal[2]), np.zeros(4), False
        rows, targets = known.rows[first:].take(word, axis=1), known.targets[first:]
        best, missing = close_times(*end, rows, targets, np.array(times), RANK, -math.inf)
        if not missing < MET or min(best.tolist(), default=0.0) < -MET:
            return None
        return np.maximum(best, 0.0)


def insertion_library(problem: Problem, setup: SearchSetup) -> InsertionLibrary:
    """Every trim that can be inserted, and the conditions of a problem."""
    limit, library = problem.horizon.time, setup.library
    pads = limit is not None and library.rest is not None
    kept = columns(library, pads=pads, free_heading=setup.free_heading)
    met = [float(setup.goal[3])] if setup.climbs else []
    met += [] if limit is None else [limit]
    return InsertionLibrary(
        trims=kept.trims,
        number_of=kept.number_of,
        problem=TimesProblem(
            twists=kept.twists,
            rates=kept.rates,
            rows=kept.rows[int(not setup.climbs) : 2 - int(limit is None)],
            goal=np.array(setup.goal),
            targets=np.array(met, dtype=np.float64),
        ),
        rest=len(library.trims) if pads else None,
        tail=int(setup.free_heading),
        climbs=setup.climbs,
        n_priced=len(kept.trims) - int(setup.free_heading),
        fixed_cost=library.rest_rate * limit if pads and limit is not None else 0.0,
        scale=kept.scale,
    )


DIGITS = 9  # of the goal that is searched for, after the point [m, rad]
UNUSUAL = 1.7  # keeps steps in the number of digits away from the sizes people choose
TINY = 1e-12  # [m, rad] below this start and goal are one
RANK = 1e-11  # singular values below this, relative, count as none


def with_fewer_digits(setup: SearchSetup) -> SearchSetup:
    """The setup with its goal rounded; as it is where start and goal would become one.

    Start and goal seen from each other are the same for a moved problem but for rounding, and
    rounding decides where insertion has a choice among equals. So it searches for a goal with fewer
    digits, and its times are corrected afterwards until the goal itself is met.
    """
    x, y, turn, z = setup.goal.tolist()
    size = max(abs(x), abs(y), abs(z), abs(math.remainder(turn, 2.0 * math.pi)), TINY)
    finer = max(0, math.ceil(-math.log10(UNUSUAL * size)))
    unit = 10.0 ** (DIGITS + finer)
    goal = np.array([round(value * unit) / unit for value in setup.goal.tolist()])
    rounded = replace(setup, goal=goal)
    return setup if rounded.start_is_goal else rounded

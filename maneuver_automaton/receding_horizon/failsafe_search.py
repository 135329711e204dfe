"""Fail-safe trajectories: any motion that stays free for a while, where no plan does."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

from maneuver_automaton._interrupts import clock
from maneuver_automaton.automaton import Plan
from maneuver_automaton.planning.tracking import stands_free
from maneuver_automaton.problem import Problem
from maneuver_automaton.receding_horizon import _kernels_failsafe as kernels
from maneuver_automaton.receding_horizon.shifting import merged
from maneuver_automaton.search._kernels_cells import EMPTY
from maneuver_automaton.search.lattice_query import LatticeQuery, lattice_query

CELL = 0.25  # of the search, in turning radii
HEADINGS = 24
LONGEST = 32  # shortest edge durations that a trim is held
IMPATIENCE = 0.1  # seconds of safety that a second of driving is worth
MOST_NODES = 2**16
TIMELY = 16  # expansions between two looks at the clock
MOST_EXPANSIONS = 4000


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FailSafe:
    """A motion that stays free as long as was found possible."""

    plan: Plan
    free_until: float  # [s] of the world's clock
    complete: bool  # whether that is as long as was asked for
    expansions: int


def search_fail_safe(
    problem: Problem,
    *,
    until: float,
    deadline: float = math.inf,
    max_expansions: int = MOST_EXPANSIONS,
) -> FailSafe:
    """A motion from the problem's start that is free of its obstacles until a time, if possible.

    A vehicle that can rest ends at rest. Where no motion is free until then, the one that
    is free for longest comes back.

    Parameters
    ----------
    problem : Problem
        Its goals do not matter.
    until : float
        [s] of the world's clock.
    deadline : float
        As `time.monotonic` counts [s].
    max_expansions : int
        Poses to go on from.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Disc, Motion, Obstacle, Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"rest": (0, 0), "on": (1, 0), "back": (-1, 0)})
    >>> passing = Obstacle(Disc(1.0), motion=Motion([0, 4], [[2, -4, 0], [2, 4, 0]]))
    >>> problem = Problem(robot, [2, 0, 0], [9, 0, 0], obstacles=passing)
    >>> found = search_fail_safe(problem, until=4.0)
    >>> found.complete, found.plan.word[-1], bool(abs(found.plan.end[0] - 2.0) > 1.0)
    (True, 'rest', True)
    """
    query = lattice_query(problem, (0,))
    library = query.library.arrays
    twists = library.library.twists
    still = np.flatnonzero(~twists[: library.library.n_trims].any(axis=1))
    rest = int(still[0]) if still.size else -1
    task = _task(query, rest, until)
    search = _arrays(MOST_NODES)
    around = (query.world.arrays, query.world.body, search)
    kernels.begin(task, library, *around)
    left = max_expansions
    while left > 0 and kernels.expand(task, library, *around, min(TIMELY, left)):
        left -= TIMELY
        if clock() >= deadline:
            break
    state = search.state
    node = int(state[kernels.BEST])
    free_until = float(search.nodes[node, kernels.SAFE])
    return FailSafe(
        plan=_plan(query, search, node, rest),
        free_until=free_until,
        complete=bool(state[kernels.FOUND]),
        expansions=int(state[kernels.EXPANSIONS]),
    )


def _task(query: LatticeQuery, rest: int, until: float) -> kernels.FailSafeTask:
    library = query.library
    shortest = float(library.arrays.edge_durations[:, 0].min())
    open_ = query.problem.bounds.x is None and query.problem.bounds.y is None
    window = np.array(query.window)
    if open_:
        window[:4] = [-math.inf, -math.inf, math.inf, math.inf]
    return kernels.FailSafeTask(
        x=float(query.start[0]),
        y=float(query.start[1]),
        heading=float(query.start[2]),
        clock=float(query.problem.start_time),
        until=float(until),
        rest=rest,
        keep=float(query.keep),
        margin=float(query.margin),
        cell=CELL * library.radius,
        headings=HEADINGS,
        tick=shortest,
        longest=LONGEST * shortest,
        impatience=IMPATIENCE,
        window=window,
    )


def _arrays(n: int) -> kernels.FailSafeArrays:
    """Room for `n` nodes, a power of two."""
    return kernels.FailSafeArrays(
        nodes=np.empty((n, 6)),
        links=np.empty((n, 2), dtype=np.int64),
        cells=np.full(4 * n, EMPTY),
        heap_key=np.empty(n),
        heap_node=np.empty(n, dtype=np.int64),
        state=np.zeros(5, dtype=np.int64),
    )


def _plan(query: LatticeQuery, search: kernels.FailSafeArrays, node: int, rest: int) -> Plan:
    """The path to a node, and rest there as long as it is free."""
    problem = query.problem
    edges: list[tuple[int, float]] = []
    if rest >= 0:
        left = search.nodes[node, kernels.SAFE] - search.nodes[node, kernels.CLOCK]
        edges.append((rest, float(left)))
    while search.links[node, kernels.PARENT] >= 0:
        trim, t = search.links[node, kernels.TRIM], search.nodes[node, kernels.LASTING]
        edges.append((int(trim), float(t)))
        node = int(search.links[node, kernels.PARENT])
    trims = [problem.automaton.trims[query.library.trims[k]] for k, _ in reversed(edges)]
    word, times = merged(trims, [t for _, t in reversed(edges)])
    return Plan(problem.start, word, durations=times, start_time=problem.start_time)


@functools.cache
def load_fail_safe() -> None:
    """Have the kernels ready before the clock runs."""
    from maneuver_automaton.search.ready import smallest_lattice_query

    problem = smallest_lattice_query().problem
    stands_free(problem, search_fail_safe(problem, until=1.0).plan.end, time=1.0, duration=1.0)

"""Whether words of at most three trims between two poses are free, transitions included."""

from __future__ import annotations

import math

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import bare_inner_kernel, inlined_kernel
from maneuver_automaton.search._kernels_coast import coast_free, coast_inside, coasted
from maneuver_automaton.search._kernels_maneuver import edge_end, edge_free
from maneuver_automaton.search.lattice_arrays import LatticeArrays
from maneuver_automaton.search.scene import Scene
from maneuver_automaton.words._kernels_library import class_of
from maneuver_automaton.words.library import Scratch


@bare_inner_kernel
def transition_free(
    scene: Scene,
    lib: LatticeArrays,
    source: int,
    target: int,
    pose: tuple[float, float, float, float],
    clock: float,
) -> tuple[bool, tuple[float, float, float, float], float]:
    """Whether the transition between two trims is free; then the pose and time at its end."""
    at, goal = class_of(lib.library, source), class_of(lib.library, target)
    while at != goal:  # within a class the transition is the identity
        edge = lib.via_edge[at, goal]
        if not edge_free(scene, lib, edge, pose, clock):
            return False, pose, clock
        pose = edge_end(lib, edge, pose)
        clock += lib.edge_time[edge]
        at = class_of(lib.library, lib.edge_target[edge])
    return True, pose, clock


@inlined_kernel
def connection_free(
    scene: Scene,
    lib: LatticeArrays,
    ends: tuple[tuple[float, float, float, float], int, int],
    word: IntArray,
    climb: int,
    times: Array,
    clock: float,
) -> bool:
    """Whether a connection is free all the way: three trims, a climb, and the trim of its goal.

    `ends` are the pose it begins at, the trim before it, and the trim after it (-1 for any). A trim
    of the word that is none, or the turn in place of a free heading, is passed over.
    """
    # (pose, before, clock) is where, in which trim and when the word is: at first its begin. The
    # fifth trim is the one of the goal, which lasts no time: only what leads to it is tested.
    pose, before, after = ends
    for n in range(5):
        trim, t = after, 0.0
        if n < 3:
            trim, t = word[n], times[n]
        elif n == 3:
            trim, t = climb, times[3]
        if trim < 0 or trim >= lib.library.n_trims:
            continue
        if class_of(lib.library, before) != class_of(lib.library, trim):
            free, pose, clock = transition_free(scene, lib, before, trim, pose, clock)
            if not free:
                return False
        before = trim
        if t > 0.0:
            # The window is a few sums, the proof a loop over obstacles.
            if not coast_inside(scene, lib, trim, pose, t):
                return False
            if not coast_free(scene, lib, trim, pose, t, clock):
                return False
            pose = coasted(lib, trim, pose, t)
            clock += t
    return True


@inlined_kernel
def free_candidate(
    scene: Scene,
    lib: LatticeArrays,
    words: IntArray,
    ends: tuple[tuple[float, float, float, float], int, int],
    n: int,
    limits: tuple[int, float, float],
    clock: float,
    scratch: Scratch,
) -> int:
    """Cheapest of `n` candidates that is proven free; -1 if none of the first few is.

    `ends` as in `connection_free`; `limits` are how many are tried, the cost that a candidate has
    to undercut, and the time [s] it may last. A candidate that was tried costs inf from then on.
    """
    # The least is sought anew each time: few are tried, so that sorting all would cost more.
    tries, most_cost, most_time = limits
    for _ in range(tries):
        best, which = most_cost, -1
        for k in range(n):
            if scratch.costs[k] < best and scratch.durations[k] <= most_time:
                best, which = scratch.costs[k], k
        if which < 0:
            return -1
        word = words[scratch.rows[which]]
        climb, times = scratch.climbs[which], scratch.times[which]
        if connection_free(scene, lib, ends, word, climb, times, clock):
            return which
        scratch.costs[which] = math.inf
    return -1

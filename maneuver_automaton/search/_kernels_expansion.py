"""Analytic expansion: reach the other end from a node by a word in closed form."""

from __future__ import annotations

import math

from maneuver_automaton._arrays import IntArray
from maneuver_automaton._compile import bare_inner_kernel, inlined_kernel
from maneuver_automaton.search._kernels_coast import may_stay, too_short
from maneuver_automaton.search._kernels_connection import free_candidate
from maneuver_automaton.search._kernels_nodes import (
    CLIMB,
    COST,
    COUNT,
    FOUND,
    FREE,
    GEAR,
    GOAL,
    HEADING,
    NODE,
    PARENT,
    QUERIES,
    ROW,
    RUN,
    TIME,
    TRIM,
    X,
    Y,
    Z,
)
from maneuver_automaton.search.arrays import SearchArrays, Task
from maneuver_automaton.search.lattice_arrays import LatticeArrays
from maneuver_automaton.search.scene import Scene
from maneuver_automaton.words._kernels_candidates import candidates, trim_and_gear


@inlined_kernel
def connect_ends(
    search: SearchArrays,
    task: Task,
    lib: LatticeArrays,
    scene: Scene,
    node: int,
    upper_bound: float,
    estimate: float,
) -> None:
    """Analytic expansion: reach the other end by a word; keeps the cheapest plan found.

    Only words that cost not much more than the estimate are tried. From a root all words of the
    library are, from other nodes those of its few trims.
    """
    nodes, links, state, found = search.nodes, search.links, search.state, search.found
    scratch = search.scratch
    pose = (nodes[node, X], nodes[node, Y], nodes[node, HEADING], nodes[node, Z])
    done, spent = nodes[node, COST], nodes[node, TIME]
    here = trim_and_gear(int(links[node, TRIM]), int(links[node, GEAR]))
    for g in range(task.aims.shape[0]):
        free_heading = task.sign > 0.0 and task.aim_free[g]
        words = lib.library.tried.free_words if free_heading else lib.library.tried.words
        n_words = words.shape[0]
        if not free_heading and links[node, PARENT] >= 0:
            n_words = lib.library.tried.n_few
        aim = (task.aims[g, 0], task.aims[g, 1], task.aims[g, 2], task.aims[g, 3])
        # What a connection may cost: less than is left to the best plan, and not much more than the
        # estimate.
        most = min(upper_bound, found[0]) - done
        if estimate < math.inf:
            most = min(most, task.connection_factor * estimate + task.connection_slack)
        there = trim_and_gear(task.aim_trims[g], 0)
        begin, first, end, last = pose, here, aim, there
        clock = task.clock + spent
        if task.sign < 0.0:  # the node is nearer to the goal: the word leads from the start to it
            begin, first, end, last = aim, there, pose, here
            clock = task.clock
        # In the order of their price: words in closed form, limits of words, then the proofs, the
        # cheapest word first, until one is free or `tries` are not.
        n = candidates(lib.library, words, n_words, begin, first, end, last, most, scratch)
        if task.checks_words:
            for k in range(n):
                if not word_admitted(search, task, lib, words, node, k):
                    scratch.costs[k] = math.inf
        ends = (begin, int(first[0]), int(last[0]))
        limits = (task.tries, most, task.most_time - spent)
        which = free_candidate(scene, lib, words, ends, n, limits, clock, scratch)
        state[QUERIES] += 1
        if which >= 0 and task.sign > 0.0:
            trim = max(ends[2], 0)
            arrival = clock + scratch.durations[which]
            if not may_stay(scene, lib, trim, aim, arrival, task.stay_until):
                which = -1
        if which >= 0:
            # It is cheaper than what was found before: `most` says so.
            found[0] = done + scratch.costs[which]
            for n_th in range(4):
                found[1 + n_th] = scratch.times[which, n_th]
            state[FOUND], state[NODE], state[GOAL] = 1, node, g
            state[ROW], state[CLIMB] = scratch.rows[which], scratch.climbs[which]
            state[FREE] = 1 if free_heading else 0


@bare_inner_kernel
def word_admitted(
    search: SearchArrays, task: Task, lib: LatticeArrays, words: IntArray, node: int, k: int
) -> bool:
    """Whether the word through a node and one candidate keeps the limits of single words.

    They are the number of trims, the least time of a trim that moves, and the longest of any. The
    candidate is read away from the node, whose own trim may go on.
    """
    scratch, links, nodes = search.scratch, search.links, search.nodes
    row = scratch.rows[k]
    count = links[node, COUNT]
    # (trim, run) is the trim that lasts and its time so far; the last one is judged after the loop.
    trim, run = links[node, TRIM], nodes[node, RUN]
    forward = task.sign > 0.0
    for step in range(4):
        n_th = step if forward else 3 - step
        this, t = scratch.climbs[k], scratch.times[k, 3]
        if n_th < 3:
            this, t = words[row, n_th], scratch.times[k, n_th]
        if t == 0.0 or this < 0 or this >= lib.library.n_trims:
            continue
        if this == trim:
            run += t
        else:
            if too_short(task, lib, trim, run):
                return False
            count += 1
            trim, run = this, t
        if run > lib.library.longest[trim]:
            return False
    if too_short(task, lib, trim, run):
        return False
    return task.most_trims == 0 or count <= task.most_trims

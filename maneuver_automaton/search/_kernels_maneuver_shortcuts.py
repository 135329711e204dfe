"""Shortcuts along a word: dynamic programming over its points with transfers between them."""

from __future__ import annotations

import math

from maneuver_automaton._compile import bare_kernel
from maneuver_automaton.search._kernels_maneuver_motion import transfer_free
from maneuver_automaton.words._kernels_candidates import candidates

AS_BEFORE = -1


@bare_kernel
def shorten_to(task, lib, n_words, layers, j, points, trims, costs, spent, least, plan, scratch):
    """Cheapest way to point `j` of a word, through points (n, 4) before it or past them.

    `costs` (n,) and `spent` (n,) [s] are those of the word up to each point. Fills `plan`: the cost
    and time up to the point, the point before it, the word of the transfer between (or
    AS_BEFORE), its climb, and its times. A transfer counts if it saves at least `least`.
    """
    plan.costs[j] = plan.costs[j - 1] + costs[j] - costs[j - 1]
    plan.spent[j] = plan.spent[j - 1] + spent[j] - spent[j - 1]
    plan.before[j], plan.rows[j] = j - 1, AS_BEFORE
    goal = (points[j, 0], points[j, 1], points[j, 2], points[j, 3])
    for i in range(j - 1):
        start = (points[i, 0], points[i, 1], points[i, 2], points[i, 3])
        most = plan.costs[j] - plan.costs[i] - least
        words, here, there = lib.transfer.words, (trims[i], 0), (trims[j], 0)
        n = candidates(lib.transfer, words, n_words, start, here, goal, there, most, scratch)
        for _ in range(task.tries):
            best, which = most, -1
            for k in range(n):
                if scratch.costs[k] < best:
                    best, which = scratch.costs[k], k
            if which < 0:
                break
            row = scratch.rows[which]
            if transfer_free(
                task,
                lib,
                layers,
                start,
                trims[i],
                trims[j],
                lib.transfer.words[row],
                scratch.climbs[which],
                scratch.times[which],
                task.clock + plan.spent[i],
            ):
                plan.costs[j] = plan.costs[i] + best
                plan.spent[j] = plan.spent[i] + scratch.durations[which]
                plan.before[j], plan.rows[j] = i, row
                plan.climbs[j] = scratch.climbs[which]
                for k in range(4):
                    plan.times[j, k] = scratch.times[which, k]
                break
            scratch.costs[which] = math.inf

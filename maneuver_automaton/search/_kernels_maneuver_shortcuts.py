"""Shortcuts along a word: dynamic programming over its points with transfers between them."""

from __future__ import annotations

import math

from maneuver_automaton._compile import bare_kernel
from maneuver_automaton.search._kernels_motion import free_candidate
from maneuver_automaton.words._kernels_candidates import candidates, trim_and_gear

AS_BEFORE = -1


@bare_kernel
def shorten_to(scene, lib, n_words, limits, j, points, trims, costs, spent, least, plan, scratch):
    """Cheapest way to point `j` of a word, through points (n, 4) before it or past them.

    `costs` (n,) and `spent` (n,) [s] are those of the word up to each point. Fills `plan`: the cost
    and time up to the point, the point before it, the word of the connection between (or
    AS_BEFORE), its climb, and its times. A connection counts if it saves at least `least`. `limits`
    are how many words are tried for each, and the time of the world at the first point.
    """
    tries, clock = limits
    plan.costs[j] = plan.costs[j - 1] + costs[j] - costs[j - 1]
    plan.spent[j] = plan.spent[j - 1] + spent[j] - spent[j - 1]
    plan.before[j], plan.rows[j] = j - 1, AS_BEFORE
    goal, there = (
        (points[j, 0], points[j, 1], points[j, 2], points[j, 3]),
        trim_and_gear(trims[j], 0),
    )
    words = lib.library.words
    for i in range(j - 1):
        start, here = (
            (points[i, 0], points[i, 1], points[i, 2], points[i, 3]),
            trim_and_gear(trims[i], 0),
        )
        most = plan.costs[j] - plan.costs[i] - least
        n = candidates(lib.library, words, n_words, start, here, goal, there, most, scratch)
        which = free_candidate(
            scene,
            lib,
            words,
            (start, trims[i], trims[j]),
            n,
            (tries, most, math.inf),
            clock + plan.spent[i],
            scratch,
        )
        if which < 0:
            continue
        plan.costs[j] = plan.costs[i] + scratch.costs[which]
        plan.spent[j] = plan.spent[i] + scratch.durations[which]
        plan.before[j], plan.rows[j] = i, scratch.rows[which]
        plan.climbs[j] = scratch.climbs[which]
        for k in range(4):
            plan.times[j, k] = scratch.times[which, k]

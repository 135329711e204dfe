"""References that tests of words compare with: candidates of one steering call as a list."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from maneuver_automaton.words import _kernels_candidates as kernels
from maneuver_automaton.words.library import Library


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Candidate:
    """One word that leads exactly from one pose and trim to another."""

    trims: tuple[int, ...]  # up to three, and a climb
    durations: np.ndarray  # (n,) [s] of these trims
    cost: float
    duration: float  # [s] transitions included


def candidates(
    library: Library, start, goal, *, start_trim: int, goal_trim: int, upper_bound=math.inf
) -> list[Candidate]:
    """Words of up to three trims that lead exactly from start to goal, cheapest first.

    Words of fewer trims are listed where they fit exactly. In SE(2) x R one more trim makes up for
    the altitude, before the goal's trim: a vertical one, or after words of level trims a straight
    one that climbs.
    """
    begin, end = np.zeros((1, 4)), np.zeros((1, 4))
    begin[0, : len(start)], end[0, : len(goal)] = start, goal
    scratch, arrays = library.scratch(), library.arrays
    n = kernels.candidate_batch(
        arrays,
        len(arrays.tried.words),
        begin,
        start_trim,
        end,
        goal_trim,
        float(upper_bound),
        scratch,
    )
    found = []
    for k in np.argsort(scratch.costs[:n], kind="stable"):
        word = arrays.tried.words[scratch.rows[k], :3]
        trims, times = word[word >= 0], scratch.times[k, :3][word >= 0]
        if scratch.climbs[k] >= 0:
            trims = np.append(trims, scratch.climbs[k])
            times = np.append(times, scratch.times[k, 3])
        found.append(
            Candidate(
                trims=tuple(trims.tolist()),
                durations=np.array(times),
                cost=float(scratch.costs[k]),
                duration=float(scratch.durations[k]),
            )
        )
    return found

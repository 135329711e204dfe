"""A few trims that stand for a large library, where all words of them can be searched."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._kept import kept_by_first
from maneuver_automaton.search.setup import SearchSetup
from maneuver_automaton.words.library import MovingTrims

FEW = 14  # a library of up to this many moving trims is its own sub-library


def sub_library(setup: SearchSetup) -> SearchSetup:
    """A few trims that reach far: extreme in eight directions, fast and cheap straights, spins."""
    if len(setup.trims) <= FEW:
        return setup
    few = few_of(setup.library)
    return replace(setup, trims=few.trims, twists=few.twists, rates=few.rates, periods=few.periods)


class FewTrims(NamedTuple):
    """The trims of a sub-library: the same for every start and goal."""

    trims: IntArray  # (M,) by the automaton's numbers
    twists: Array  # (M, 4)
    rates: Array  # (M,)
    periods: Array  # (M,) [s]


@kept_by_first
def few_of(library: MovingTrims) -> FewTrims:
    """The few trims that stand for a library."""
    rows = _far_reaching(library)
    return FewTrims(
        library.trims[rows], library.twists[rows], library.rates[rows], library.periods[rows]
    )


def _far_reaching(library: MovingTrims) -> IntArray:
    """Rows of the few trims."""
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
    return np.array(list(dict.fromkeys(chosen)))

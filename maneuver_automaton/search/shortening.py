"""From a word with more trims than are admitted to the best short one that resembles it.

Insertion under a limit fills the word with the trims that pay first, and stops. It is better to let
it grow, and to take out again the trims that are missed least.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.search.result import TimedWord
from maneuver_automaton.search.setup import InsertionLibrary
from maneuver_automaton.words import TimesStatus, solve_switching_times
from maneuver_automaton.words.word import normal_form

AT_ONCE = 4  # of the shortest trims, how many are tried to be left out
LAST = 2  # trims too many, from when on everything is tried
NEAR_MEAN = 5  # trims near the mean of two that may stand for both
NEAR = 4  # trims of similar twist that one trim is exchanged for
SWEEPS = 3  # over all trims of a word, at most
VANISHING = 1e-9  # [s] what lasts no longer lasts no time
GAIN = 1e-9  # relative, by which an exchange must be cheaper


def shortened(library: InsertionLibrary, word: TimedWord, most: int) -> TimedWord | None:
    """A word of at most `most` trims, made from a longer one; None if none is found.

    Trims are taken out one at a time, the one whose absence costs least, and the times are solved
    again; then each trim is exchanged for similar ones as long as that pays. Not for goals with a
    free heading.
    """
    if library.tail:
        return None
    best = _solved(library, word.numbers, word.durations)
    while best is not None and len(best.trims) > most:
        fewer = _some_less(library, best, most)
        best = fewer if fewer is not None else _one_less(library, best, most)
    return None if best is None else _exchanged(library, best)


def _some_less(library: InsertionLibrary, now: TimedWord, most: int) -> TimedWord | None:
    """The word without a third of the trims too many, the shortest; None near the end."""
    many = (len(now.trims) - most) // 3
    if len(now.trims) <= most + LAST or many < 2:
        return None
    kept = np.sort(_by_size(now.durations)[many:])
    left = float(now.durations.sum() - now.durations[kept].sum())
    return _solved(library, now.numbers[kept], _spread(now.durations[kept], left))


def _one_less(library: InsertionLibrary, now: TimedWord, most: int) -> TimedWord | None:
    """The cheapest word with one trim less: one left out, or two neighbours made one."""
    order = _by_size(now.durations)
    trials = [_without(library, now, k) for k in order[:AT_ONCE]]
    if len(now.trims) <= most + LAST or all(one is None for one in trials):
        trials += [_without(library, now, k) for k in order[AT_ONCE:]]
        for k in range(len(now.trims) - 1):
            trials += list(_with_mean_trim(library, now, k))
    found = [one for one in trials if one is not None and len(one.trims) < len(now.trims)]
    return min(found, key=lambda one: float(f"{one.cost:.9g}"), default=None)


def _without(library: InsertionLibrary, now: TimedWord, k: int) -> TimedWord | None:
    times = _spread(np.delete(now.durations, k), now.durations[k])
    return _solved(library, np.delete(now.numbers, k), times)


def _with_mean_trim(
    library: InsertionLibrary, now: TimedWord, k: int
) -> Iterator[TimedWord | None]:
    """Trims `k` and `k + 1` as one of the library near their mean."""
    pair = slice(k, k + 2)
    lasting = now.durations[pair].sum()
    mean = now.durations[pair] @ library.problem.twists[now.numbers[pair]] / lasting
    word, times = np.delete(now.numbers, k), np.delete(now.durations, k)
    times[k] = lasting
    for other in _similar(library, mean)[:NEAR_MEAN]:
        word[k] = other
        yield _solved(library, word.copy(), times)


def _similar(library: InsertionLibrary, twist: Array) -> IntArray:
    """Trims by how far they are from a twist, the nearest first."""
    scale = np.abs(library.problem.twists).max(axis=0).clip(min=1e-300)
    away = (np.abs(library.problem.twists - twist) / scale).sum(axis=1)
    return _by_size(away)


def _by_size(values: Array) -> IntArray:
    """Indices by rising value; values that differ by rounding only keep their order."""
    return np.argsort(values.round(9), kind="stable")


def _spread(times: Array, left: float) -> Array:
    """Times that take over the duration of a trim left out."""
    return np.asarray(times + left / max(times.size, 1))


def _exchanged(library: InsertionLibrary, now: TimedWord) -> TimedWord:
    """Each trim exchanged for one of similar twist as long as that pays."""
    for _ in range(SWEEPS):
        before = now.cost
        for k in range(len(now.trims)):
            if k >= len(now.trims):
                break
            for other in _similar(library, library.problem.twists[now.trims[k]])[1 : NEAR + 1]:
                word = now.numbers
                word[k] = other
                trial = _solved(library, word, now.durations)
                if trial is not None and trial.cost < now.cost - GAIN * (1.0 + abs(now.cost)):
                    now = trial
                    break
        if now.cost >= before - GAIN * (1.0 + abs(before)):
            break
    return now


def _solved(library: InsertionLibrary, word: IntArray, times: Array) -> TimedWord | None:
    """The best times of a word; trims that last no time are left out."""
    if not word.size:
        return None
    total = None
    if library.problem.targets.size > int(library.climbs):
        total = float(library.problem.targets[-1])
    solved = solve_switching_times(
        library.problem.twists[word],
        library.problem.rates[word],
        library.problem.goal,
        total=total,
        guesses=[times],
        restarts=0,
    )
    if solved.status is TimesStatus.FAILED or not math.isfinite(solved.cost):
        return None
    kept, lasting = normal_form(word, solved.durations, shortest=VANISHING)
    return TimedWord(tuple(kept.tolist()), lasting, solved.cost)

"""Shorten a word of trims and maneuvers by transfers between its own points."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.groups import SE2xR
from maneuver_automaton.search import _kernels_maneuver_shortcuts as kernels
from maneuver_automaton.search import _kernels_motion as motion
from maneuver_automaton.search.lattice_query import LatticeQuery
from maneuver_automaton.search.lattice_task import TRIES
from maneuver_automaton.words.library import Library
from maneuver_automaton.words.transitions import SWITCH
from maneuver_automaton.words.word import Word

MOST_POINTS = 32
LEAST = 1e-5  # share of the cost that a shortcut has to save
WORTH = 1e-3  # share that a round has to save for another one of its kind
ROUNDS = 8
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)


class ShortcutPlan(NamedTuple):
    """What the kernel fills; see there."""

    costs: Array
    spent: Array
    before: IntArray
    rows: IntArray
    climbs: IntArray
    times: Array


class _Steps(NamedTuple):
    """A word cut at its points: step k leads from point k to point k + 1."""

    transitions: IntArray  # maneuver, or SWITCH where the step coasts or changes trims at will
    trims: IntArray  # trim after the step
    times: Array  # [s] of coasts
    points: Array  # (n + 1, 4) in the world's frame
    costs: Array  # (n + 1,)
    spent: Array  # (n + 1,) [s]


def shortened(
    query: LatticeQuery,
    word: Word,
    *,
    rounds: int = ROUNDS,
    all_words: bool = True,
    deadline: float = math.inf,
) -> Iterator[Word]:
    """Words that rounds of shortcuts make of `word`, each cheaper than the one before.

    Every round cuts the trims at other places, so that points lie elsewhere; first with words of
    few trims, then, unless `all_words` says otherwise, with all.
    """
    arrays = query.library.priced.arrays
    best = word
    for n_words in sorted({arrays.n_few, len(arrays.words) if all_words else arrays.n_few}):
        for n in range(rounds):
            if time.monotonic() >= deadline:
                return
            before, cut = best.cost, (GOLDEN * n) % 1.0
            better = _once(query, best, cut=cut, n_words=n_words, deadline=deadline)
            if better is not None:
                best = better
                yield best
            if n >= 1 and before - best.cost < WORTH * before:
                break


def word_is_free(query: LatticeQuery, word: Word) -> bool:
    """Whether a word is proven free all the way, at the times when it is where."""
    steps = _steps(query, word, cut=0.0, most=0)
    library = query.library
    edge_of = np.full(len(query.automaton.maneuvers) + 1, SWITCH)
    edge_of[library.edge_maneuver] = np.arange(len(library.edge_maneuver))
    free = motion.word_free(
        query.scene(),
        library.arrays,
        np.array(query.start),
        edge_of[steps.transitions],
        steps.trims,
        steps.times,
        float(query.start_time),
    )
    return bool(free)


def _once(
    query: LatticeQuery, word: Word, *, cut: float, n_words: int, deadline: float
) -> Word | None:
    """One round; None if nothing is gained."""
    steps = _steps(query, word, cut=cut, most=MOST_POINTS)
    n = len(steps.points)
    plan = ShortcutPlan(
        costs=np.zeros(n),
        spent=np.zeros(n),
        before=np.zeros(n, dtype=np.int64),
        rows=np.full(n, kernels.AS_BEFORE),
        climbs=np.full(n, -1),
        times=np.zeros((n, 4)),
    )
    least = LEAST * max(word.cost, 1e-12)
    trims = np.concatenate([[word.trims[0]], steps.trims]).astype(np.int64)
    scene, scratch = query.scene(), query.library.priced.scratch()
    for j in range(1, n):
        if time.monotonic() >= deadline:
            return None
        kernels.shorten_to(
            scene,
            query.library.arrays,
            n_words,
            (TRIES, float(query.start_time)),
            j,
            steps.points,
            trims,
            steps.costs,
            steps.spent,
            least,
            plan,
            scratch,
        )
    if not plan.costs[-1] < word.cost - 0.5 * least:
        return None
    found = [(SWITCH, int(word.trims[0]), 0.0)]
    j = n - 1
    links = []
    while j > 0:
        links.append(j)
        j = int(plan.before[j])
    for j in reversed(links):
        i = int(plan.before[j])
        if plan.rows[j] == kernels.AS_BEFORE:
            step = (int(steps.transitions[i]), int(steps.trims[i]), float(steps.times[i]))
            found.append(step)
            continue
        row = query.library.priced.arrays.words[plan.rows[j]].tolist()
        through = [*row, int(plan.climbs[j]), int(trims[j])]
        times = [*plan.times[j].tolist(), 0.0]
        found += connection_steps(query.library.priced, int(trims[i]), through, times)
    better = query.word_of(found, word.goal)
    late = better.duration > query.most_time
    if late or (query.moves and not word_is_free(query, better)):
        return None
    lasting = zip(better.trims, better.durations.tolist(), strict=True)
    if any(
        0.0 < time < query.least_coast and not query.automaton.trims[trim].is_rest
        for trim, time in lasting
    ):
        return None
    return better


def _steps(query: LatticeQuery, word: Word, *, cut: float, most: int) -> _Steps:
    """The word as steps, its longest trims cut in parts until there are `most` points."""
    transfer, automaton = query.library.priced, query.automaton
    durations = np.asarray(word.durations)
    room = max(0, most - 2 * len(word.trims))
    total = float(durations.sum())
    rows: list[tuple[int, int, float]] = []
    for k, trim in enumerate(word.trims.tolist()):
        if durations[k] > 0.0:
            parts = 1 + int(room * durations[k] / total)
            inner = (np.arange(1, parts) - cut) / parts if parts > 1 else np.zeros(0)
            ends = np.concatenate([[0.0], inner[inner > 0.0], [1.0]]) * durations[k]
            rows += [(SWITCH, trim, t) for t in np.diff(ends).tolist()]
        if k < len(word.transitions):
            rows.append((int(word.transitions[k]), int(word.trims[k + 1]), 0.0))
    pose = SE2xR(query.start)
    points, costs, spent = [pose.pose], [0.0], [0.0]
    for transition, trim, t in rows:
        if transition == SWITCH:
            move = SE2xR.exp(t * transfer.arrays.twists[trim])
            cost = t * float(transfer.arrays.rates[trim])
        else:
            maneuver = automaton.maneuvers[transition]
            shift = np.zeros(4)
            shift[: maneuver.displacement.size] = maneuver.displacement
            move, t = SE2xR(shift), maneuver.duration
            cost = float(transfer.maneuver_costs[transition])
        pose = pose @ move
        points.append(pose.pose)
        costs.append(costs[-1] + cost)
        spent.append(spent[-1] + t)
    if rows:
        points[-1] = query.goals[word.goal]
    return _Steps(
        transitions=np.array([row[0] for row in rows], dtype=np.int64),
        trims=np.array([row[1] for row in rows], dtype=np.int64),
        times=np.array([row[2] for row in rows], dtype=np.float64),
        points=np.array(points),
        costs=np.array(costs),
        spent=np.array(spent),
    )


def connection_steps(
    library: Library, start_trim: int, trims: list[int], times: list[float]
) -> list[tuple[int, int, float]]:
    """Steps (transition, trim, time) of a connection through trims, -1 for none."""
    steps: list[tuple[int, int, float]] = []
    at = start_trim
    for trim, t in zip(trims, times, strict=True):
        if trim < 0:
            continue
        steps += [(maneuver, target, 0.0) for maneuver, target in library.chain(at, trim)]
        steps.append((SWITCH, trim, t))
        at = trim
    return steps

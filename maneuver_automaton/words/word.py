"""Words of trims and maneuvers: what a search found, until it becomes a plan."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from maneuver_automaton._arrays import Array, wrapped
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.groups import SE2xR
from maneuver_automaton.primitives import Maneuver
from maneuver_automaton.words.library import TransferLibrary

CLOSED = 1e-14  # [m, rad] relative to the size of the motion: nothing is left to correct
STEPS = 8
RANK = 1e-9  # singular values below this, relative, count as none
TRIM, EDGE = 0, 1  # kinds of steps


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ManeuverWord:
    """Trims with their times, and the maneuver after each but the last.

    A maneuver of -1 is a switch at will. Trims between maneuvers may last no time.
    """

    trims: tuple[int, ...]  # (n,) indices in the automaton
    durations: Array  # (n,) [s]
    maneuvers: tuple[int, ...]  # (n - 1,) indices in the automaton
    goal: int  # among the goals of the query
    cost: float = float("nan")
    duration: float = float("nan")  # [s] maneuvers included


def word_of(
    library: TransferLibrary,
    *,
    start_trim: int,
    steps: Iterable[tuple[int, int, float]],
    targets: Iterable[int],
    goal: int,
) -> ManeuverWord:
    """A word from its steps: (TRIM, trim, time) or (EDGE, maneuver, 0), maneuvers with `targets`.

    Examples
    --------
    >>> from maneuver_automaton.models import Unicycle
    >>> from maneuver_automaton.words.library import transfer_library
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1, 0), "left": (1, 1)})
    >>> steps = [(TRIM, 0, 1.0), (TRIM, 0, 0.5), (EDGE, -1, 0.0), (TRIM, 1, 2.0)]
    >>> word = word_of(transfer_library(robot), start_trim=0, steps=steps, targets=[1], goal=0)
    >>> word.trims, word.durations.tolist(), word.cost
    ((0, 1), [1.5, 2.0], 3.5)
    """
    trims, durations, maneuvers = [start_trim], [0.0], []
    following = iter(targets)
    for kind, number, time in steps:
        if kind == TRIM:
            durations[-1] += time
        else:
            maneuvers.append(number)
            trims.append(next(following))
            durations.append(0.0)
    word = ManeuverWord(
        trims=tuple(trims),
        durations=np.array(durations),
        maneuvers=tuple(maneuvers),
        goal=goal,
    )
    return priced(library, _without_idle_switches(word))


def priced(library: TransferLibrary, word: ManeuverWord) -> ManeuverWord:
    """The word with its cost and duration."""
    held = [k for k in word.maneuvers if k >= 0]
    lasting = sum(library.automaton.maneuvers[k].duration for k in held)
    cost = float(library.arrays.rates[list(word.trims)] @ word.durations)
    cost += float(library.maneuver_costs[held].sum()) if held else 0.0
    return replace(word, cost=cost, duration=float(word.durations.sum()) + lasting)


def closed_word(library: TransferLibrary, word: ManeuverWord, start: Array, goal: Array) -> Array:
    """Durations (n,) with which the word from `start` (dof,) ends exactly at `goal` (dof,).

    Gauss-Newton with the smallest change of the times that are not zero, as good as it gets.

    Source: the derivative of the end by a time, as a twist in its frame, is Ad(after^-1) xi.
    """
    twists = library.arrays.twists[list(word.trims)]
    gaps = gaps_of(library.automaton, word)
    begin, aim = np.zeros(4), np.zeros(4)
    begin[: start.size], aim[: goal.size] = start, goal
    begin[[0, 1, 3]] -= aim[[0, 1, 3]]  # seen from the goal's place no digit is lost
    aim[[0, 1, 3]] = 0.0
    now, best, least = np.array(word.durations), np.array(word.durations), np.inf
    for _ in range(STEPS):
        missing, columns = _missing(begin, aim, twists, gaps, now)
        size = float(np.abs(missing).max())
        if size < least:
            best, least = now, size
        free = now > 0.0
        if size <= CLOSED or not free.any():
            break
        change = np.zeros(len(now))
        change[free] = np.linalg.lstsq(columns[:, free], missing, rcond=RANK)[0]
        now = np.maximum(now + change, 0.0)
    return best


def gaps_of(automaton: Automaton, word: ManeuverWord) -> Array:
    """Displacement (n - 1, 4) after every trim but the last."""
    gaps = np.zeros((len(word.maneuvers), 4))
    for n, k in enumerate(word.maneuvers):
        if k >= 0:
            displacement = automaton.maneuvers[k].displacement
            gaps[n, : displacement.size] = displacement
    return gaps


def plan_of_word(
    library: TransferLibrary,
    word: ManeuverWord,
    *,
    start: Array,
    goal: Array,
    start_time: float = 0.0,
) -> Plan:
    """The word as a plan from `start` (dof,), its times corrected to end at `goal` (dof,)."""
    automaton = library.automaton
    maneuvers: list[Maneuver | None] = [
        None if k < 0 else automaton.maneuvers[k] for k in word.maneuvers
    ]
    return Plan(
        start,
        tuple(automaton.trims[k] for k in word.trims),
        durations=closed_word(library, word, start, goal),
        maneuvers=tuple(maneuvers),
        start_time=start_time,
    )


def _missing(
    begin: Array, aim: Array, twists: Array, gaps: Array, times: Array
) -> tuple[Array, Array]:
    """Twist (4,) of the end frame that is missing to the goal, and what each time adds (4, n)."""
    coasts = SE2xR.exp(times[:, None] * twists)
    after = [SE2xR.identity()]
    for k in range(len(times) - 1, 0, -1):
        motion = SE2xR(gaps[k - 1]) @ SE2xR(coasts.pose[k])
        after.append(motion @ after[-1])
    end = SE2xR(begin) @ SE2xR(coasts.pose[0]) @ after[-1]
    missing = np.array((end.inverse() @ SE2xR(aim)).pose)
    missing[2] = wrapped(missing[2])
    back = SE2xR(np.array([motion.pose for motion in reversed(after)])).inverse()
    columns = (back.adjoint() @ twists[:, :, None])[:, :, 0]
    return missing, columns.T


def _without_idle_switches(word: ManeuverWord) -> ManeuverWord:
    """The same motion without trims that last no time beside switches at will."""
    trims, durations = list(word.trims), word.durations.tolist()
    maneuvers = list(word.maneuvers)
    k = 0
    while k < len(trims):
        idle = durations[k] == 0.0 and len(trims) > 1
        before = maneuvers[k - 1] if k > 0 else None
        after = maneuvers[k] if k < len(maneuvers) else None
        if idle and before == -1 and (after == -1 or after is None) and 0 < k < len(trims) - 1:
            del trims[k], durations[k], maneuvers[k]
            if k < len(trims) and trims[k - 1] == trims[k]:
                durations[k - 1] += durations.pop(k)
                del trims[k], maneuvers[k - 1]
            continue
        k += 1
    return replace(
        word, trims=tuple(trims), durations=np.array(durations), maneuvers=tuple(maneuvers)
    )

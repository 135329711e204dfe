"""A word: trims, how long each lasts, and the transition after each but the last."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, IntArray, freeze
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.words.closing import closed_at
from maneuver_automaton.words.library import Library
from maneuver_automaton.words.transitions import SWITCH

TRIM, MANEUVER = 0, 1  # kinds of steps


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Word:
    """What every search finds, until it becomes a plan.

    A transition is a maneuver of the automaton, or SWITCH where the vehicle changes trims at will.
    Trims between two maneuvers may last no time. A word of a kinematic vehicle has switches only.

    Examples
    --------
    >>> Word(trims=[2, 0], durations=[1.0, 0.5]).transitions.tolist()
    [-1]
    """

    trims: IntArray  # (n,) indices in the automaton
    durations: Array  # (n,) [s]
    transitions: IntArray = None  # type: ignore[assignment]  # (n - 1,); all SWITCH if omitted
    goal: int = 0  # among the goals of the search
    cost: float = math.nan
    maneuver_time: float = 0.0  # [s] that its maneuvers take together
    certificate: float | None = None  # smallest reduced cost over the library, all times

    def __post_init__(self) -> None:
        freeze(self, "durations")
        _freeze_numbers(self, "trims", self.trims)
        held = self.transitions
        n = max(0, self.trims.size - 1)
        _freeze_numbers(self, "transitions", np.full(n, SWITCH) if held is None else held)

    @property
    def duration(self) -> float:
        """Time the motion takes, maneuvers included [s]."""
        return float(self.durations.sum()) + self.maneuver_time


def word_of_steps(
    library: Library,
    *,
    start_trim: int,
    steps: Iterable[tuple[int, int, float]],
    targets: Iterable[int],
    goal: int,
) -> Word:
    """A word from its steps: (TRIM, trim, time) or (MANEUVER, maneuver, 0), each with its target.

    Examples
    --------
    >>> from maneuver_automaton.models import Unicycle
    >>> from maneuver_automaton.words.library import library_of
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1, 0), "left": (1, 1)})
    >>> steps = [(TRIM, 0, 1.0), (TRIM, 0, 0.5), (MANEUVER, SWITCH, 0.0), (TRIM, 1, 2.0)]
    >>> word = word_of_steps(library_of(robot), start_trim=0, steps=steps, targets=[1], goal=0)
    >>> word.trims.tolist(), word.durations.tolist(), word.cost
    ([0, 1], [1.5, 2.0], 3.5)
    """
    trims, durations, transitions = [start_trim], [0.0], list[int]()
    following = iter(targets)
    for kind, number, time in steps:
        if kind == TRIM:
            durations[-1] += time
        else:
            transitions.append(number)
            trims.append(next(following))
            durations.append(0.0)
    _drop_idle_switches(trims, durations, transitions)
    word = Word(
        trims=np.array(trims),
        durations=np.array(durations),
        transitions=np.array(transitions, dtype=np.int64),
        goal=goal,
    )
    return with_price(library, word)


def with_price(library: Library, word: Word) -> Word:
    """The word with its cost, prices of switches left out, and the time of its maneuvers."""
    held = word.transitions[word.transitions != SWITCH]
    lasting = sum(library.automaton.maneuvers[k].duration for k in held)
    cost = float(library.arrays.rates[word.trims] @ word.durations)
    cost += float(library.maneuver_costs[held].sum())
    return replace(word, cost=cost, maneuver_time=float(lasting))


def plan_of(
    automaton: Automaton,
    word: Word,
    start: Array,
    *,
    goal: Array | None = None,
    free_heading: bool = False,
    start_time: float = 0.0,
) -> Plan:
    """The word as a plan from `start` (dof,), its times corrected to end at `goal` (dof,).

    Without a goal the times are taken as they are.
    """
    trims = [automaton.trims[k] for k in word.trims]
    durations = word.durations
    if goal is not None:
        twists = np.array([trim.body_velocity for trim in trims]).reshape(-1, start.size)
        durations = closed_at(
            start,
            twists,
            durations,
            goal,
            displacements=displacements_of(automaton, word.transitions),
            free_heading=free_heading,
        )
    maneuvers = [None if k == SWITCH else automaton.maneuvers[k] for k in word.transitions]
    return Plan(
        start,
        tuple(trims),
        durations=durations,
        maneuvers=tuple(maneuvers) if any(maneuvers) else (),
        start_time=start_time,
    )


def displacements_of(automaton: Automaton, transitions: Sequence[int] | IntArray) -> Array:
    """Displacement (n, dof) of each transition of a word."""
    steps = np.zeros((len(transitions), automaton.model.group.dof))
    for n, k in enumerate(transitions):
        if k != SWITCH:
            steps[n] = automaton.maneuvers[k].displacement
    return steps


def _drop_idle_switches(trims: list[int], durations: list[float], transitions: list[int]) -> None:
    """Take out, in place, trims that last no time and stand beside switches alone."""
    k = 1
    while k < len(trims) - 1:
        if durations[k] == 0.0 and transitions[k - 1] == transitions[k] == SWITCH:
            del trims[k], durations[k], transitions[k]
            if trims[k - 1] == trims[k]:
                durations[k - 1] += durations.pop(k)
                del trims[k], transitions[k - 1]
            continue
        k += 1


def _freeze_numbers(word: Word, name: str, value: ArrayLike) -> None:
    numbers = np.array(value, dtype=np.int64)
    numbers.setflags(write=False)
    object.__setattr__(word, name, numbers)

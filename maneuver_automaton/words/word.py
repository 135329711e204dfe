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
from maneuver_automaton.words.library import SWITCH, Library

SAME_TIME = 1e-9  # [s] coasting times that differ by less are the same


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Word:
    """Trims, coasting times and transitions: the answer of every search, until it is a plan.

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
        held, n = self.transitions, self.trims.size
        _freeze_numbers(self, "transitions", [SWITCH] * (n - 1) if held is None else held)

    @property
    def duration(self) -> float:
        """Time the motion takes, maneuvers included [s]."""
        return float(self.durations.sum()) + self.maneuver_time


def word_of_steps(
    steps: Iterable[tuple[int, int, float]], *, goal: int, library: Library | None = None
) -> Word:
    """A word from its steps: the transition that leads to a trim, the trim, and its time [s].

    With a library it has its price. A trim that goes on is one trim; one that lasts no time stands
    only beside a maneuver, or at an end. The transition of the first step is none.
    """
    trims, durations, transitions = list[int](), list[float](), list[int]()
    for transition, trim, time in steps:
        if trims and transition == SWITCH and trims[-1] == trim:
            durations[-1] += time
            continue
        if trims:
            transitions.append(transition)
        trims.append(trim)
        durations.append(time)
    _drop_idle_switches(trims, durations, transitions)
    numbers = np.array(trims, dtype=np.int64)
    times = np.array(durations, dtype=np.float64)
    held = np.array(transitions, dtype=np.int64)
    cost, lasting = _price(library, numbers, times, held) if library else (math.nan, 0.0)
    for array in (numbers, times, held):
        array.setflags(write=False)
    word: Word = object.__new__(Word)  # its arrays are its own, and of the right kinds
    for name, value in (
        ("trims", numbers),
        ("durations", times),
        ("transitions", held),
        ("goal", goal),
        ("cost", cost),
        ("maneuver_time", lasting),
        ("certificate", None),
    ):
        object.__setattr__(word, name, value)
    return word


def normal_form(
    trims: IntArray, durations: Array, *, shortest: float = 0.0
) -> tuple[IntArray, Array]:
    """A word of trims that switch at will without what lasts no longer than `shortest` [s].

    A trim that goes on is one trim.
    """
    used = durations > shortest
    trims, durations = trims[used], durations[used]
    if not trims.size:
        return trims, durations
    begins = np.flatnonzero(np.append(True, trims[1:] != trims[:-1]))
    return trims[begins], np.add.reduceat(durations, begins)


def with_price(library: Library, word: Word) -> Word:
    """The word with its cost at the prices of a library, and the time of its maneuvers."""
    cost, lasting = _price(library, word.trims, word.durations, word.transitions)
    return replace(word, cost=cost, maneuver_time=lasting)


def _price(
    library: Library, trims: IntArray, durations: Array, transitions: IntArray
) -> tuple[float, float]:
    """Cost of a word at the prices of a library, and the time of its maneuvers [s]."""
    arrays, numbers = library.arrays, library.number_of[trims]
    cost, lasting, switches = float(arrays.rates[numbers] @ durations), 0.0, len(transitions)
    if library.automaton.maneuvers:
        held = transitions[transitions != SWITCH]
        lasting = float(sum(library.automaton.maneuvers[k].duration for k in held))
        cost += float(library.maneuver_costs[held].sum())
        switches -= held.size
    cost += arrays.switch * switches
    if arrays.direction_change == 0.0:
        return cost, lasting
    gears = arrays.gears[numbers]
    gears = gears[gears != 0]
    return cost + arrays.direction_change * int(np.count_nonzero(gears[1:] != gears[:-1])), lasting


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

    Without a goal the times are taken as they are. Beside maneuvers, trims at its ends that last no
    time are left out: a file of the plan does not hold them.
    """
    trims = tuple(automaton.trims[k] for k in word.trims.tolist())
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
    maneuvers = [None if k == SWITCH else automaton.maneuvers[k] for k in word.transitions.tolist()]
    if not any(maneuvers):
        return Plan.of_parts(start, trims, durations.tolist(), start_time=start_time)
    a, b = 0, len(trims)
    while maneuvers[a] is None and durations[a] == 0.0:
        a += 1
    while maneuvers[b - 2] is None and durations[b - 1] == 0.0:
        b -= 1
    lasting, between = durations[a:b], tuple(maneuvers[a : b - 1])
    return Plan(start, trims[a:b], durations=lasting, maneuvers=between, start_time=start_time)


def word_of_plan(automaton: Automaton, plan: Plan) -> Word | None:
    """A plan as a word of an automaton; None if it has trims or maneuvers of its own."""
    numbers = {id(maneuver): k for k, maneuver in enumerate(automaton.maneuvers)}
    between = plan.maneuvers or (None,) * max(0, len(plan.trims) - 1)
    transitions = [SWITCH if one is None else numbers.get(id(one)) for one in between]
    known = all(trim.name in automaton and automaton[trim.name] is trim for trim in plan.trims)
    if not known or None in transitions:
        return None
    return Word(
        trims=np.array([automaton.index_of(trim.name) for trim in plan.trims], dtype=np.int64),
        durations=plan.durations,
        transitions=np.array(transitions, dtype=np.int64),
        maneuver_time=sum(one.duration for one in plan.maneuvers if one),
    )


def is_word_of(automaton: Automaton, plan: Plan, word: Word) -> bool:
    """Whether a word of trims that switch at will is that of a plan, with the same times."""
    if word.trims.size != len(plan.trims) or plan.maneuvers:
        return False
    times = zip(plan.durations.tolist(), word.durations.tolist(), strict=True)
    pairs = zip(plan.trims, word.trims.tolist(), strict=True)
    same = all(trim is automaton.trims[k] for trim, k in pairs)
    return same and all(abs(a - b) <= SAME_TIME for a, b in times)


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

"""Schedules of the searches for a first plan: at which resolutions, when, from which ends."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from maneuver_automaton.problem import SearchSettings
from maneuver_automaton.search.lattice_arrays import LatticeLibrary
from maneuver_automaton.search.lattice_task import Resolution

FAST = 1.5  # length scales of the tightest turn from which on there is a search of its size
FAST_WEIGHT = 1.0  # of that: a fast vehicle cannot make up for greed once it is near the goal
FAST_ALONE = 2000  # expansions of a search as wide as the turns, until others run in turn with it


class Schedule(NamedTuple):
    """Which resolutions begin after so many expansions of all together, or when none is left.

    They run in turn, each twice as many expansions as in its turn before.
    """

    stages: tuple[tuple[int, tuple[Resolution, ...]], ...]
    first_chunk: int
    most_chunk: int
    ends: tuple[float, ...] = (1.0,)  # where each begins: 1 at the start, -1 at the goals


AT_WILL = Schedule(
    (
        (0, (Resolution(coarse=True),)),
        (
            300,
            (
                Resolution(truncated=True, guided=True, coarse=True),
                Resolution(scale=0.5, durations=0.5, truncated=True, guided=True, coarse=True),
            ),
        ),
        (1500, (Resolution(scale=0.24, durations=0.25, truncated=True, guided=True),)),
        (
            8000,
            (
                Resolution(scale=0.5, durations=0.5, truncated=True, fine=0.2, guided=True),
                Resolution(scale=0.5, durations=0.5, truncated=True),
                Resolution(scale=0.12, durations=0.17),
            ),
        ),
        (
            2**62,
            (Resolution(scale=0.24, durations=0.25, truncated=True, margin=0.1, guided=True),),
        ),
    ),
    first_chunk=64,
    most_chunk=8192,
    ends=(1.0, -1.0),
)
LINKED = Schedule(
    (
        (0, (Resolution(),)),
        (300, (Resolution(scale=0.5, durations=0.5), Resolution(durations=0.7))),
        (2000, (Resolution(scale=0.25, durations=0.25), Resolution(scale=0.5, durations=0.7))),
        (2000, (Resolution(backwards=True),)),
        (8000, (Resolution(scale=0.5, durations=0.5, weight=1.5, backwards=True),)),
        (40000, (Resolution(scale=0.25, durations=0.25, margin=0.1),)),
    ),
    first_chunk=128,
    most_chunk=16384,
)


def schedule_of(library: LatticeLibrary) -> Schedule:
    """The schedule for a library: trims that are switched at will, or linked by transitions.

    A vehicle that turns widely for its size begins with a search whose cells and coasts are as
    wide: it decides little from one length of its body to the next.
    """
    if library.at_will:
        return AT_WILL
    fast = as_wide_as_turns(library)
    (_, first), *later = LINKED.stages
    stages = ((0, fast), (FAST_ALONE, first), *later) if fast else LINKED.stages
    return LINKED._replace(
        stages=tuple(
            (after, tuple(replace(one, ends_early=True) for one in begun))
            for after, begun in stages
        )
    )


def first_resolutions(library: LatticeLibrary, settings: SearchSettings) -> tuple[Resolution, ...]:
    """The resolutions with which a search begins, at the weight that is asked for."""
    _, begun = schedule_of(library).stages[0]
    if settings.weight is None:
        return begun
    return tuple(replace(one, weight=settings.weight) for one in begun)


def as_wide_as_turns(library: LatticeLibrary) -> tuple[Resolution, ...]:
    """The resolution of a vehicle that turns widely for its size; none for others."""
    wide = library.turns
    return (Resolution(scale=wide, durations=wide, weight=FAST_WEIGHT),) if wide > FAST else ()

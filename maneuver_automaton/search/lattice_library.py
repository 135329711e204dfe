"""An automaton as the lattice uses it: trims, edges, sizes, for every start, goal and map."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton._kept import kept_by_first
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.between import part_between
from maneuver_automaton.collision import Shape
from maneuver_automaton.collision.body import body_of
from maneuver_automaton.costs import StageCost
from maneuver_automaton.problem import Problem
from maneuver_automaton.search.lattice_arrays import (
    CELL,
    LatticeLibrary,
    coasts_of,
    edge_durations_of,
    lattice_arrays,
    length_scale,
    tightest_turn,
)
from maneuver_automaton.search.lattice_edges import (
    edges_of,
    lags,
    motion_along,
    path_length,
    via_edges,
)
from maneuver_automaton.search.lattice_trims import (
    TURN,
    Chosen,
    PricedTrims,
    is_mirrored,
    priced_library,
    trims_at_will,
    trims_of,
)
from maneuver_automaton.search.part_motion import CLOSE, Part, posed_parts
from maneuver_automaton.search.prepared import RECENT, Prepared

OF_A_LATTICE = 0.7  # of its resolution: a cell's diagonal is shorter than the step between poses
Carried = tuple[tuple[str, tuple[Shape, ...]], ...]


def lattice_library(
    problem: Problem, goals: Sequence[int] = (), *, prepared: Prepared = RECENT
) -> LatticeLibrary:
    """The part of a lattice search that is the same for every start, goal and map.

    Trims that lead to none of the goals of these numbers are left out: their speeds would make the
    estimates of cost too low. A vehicle that switches at will can use all of them.

    Raises
    ------
    ValueError
        If a maneuver has no course, and so no known cost.
    """
    automaton = problem.automaton
    if automaton.is_kinematic:
        return _library_on(problem.setting, automaton, prepared)
    first = automaton.index_of(problem.first_trim.name)
    ends = [automaton.index_of(problem.last_trim(problem.goals[k]).name) for k in goals]
    return _library_on(problem.setting, part_between(automaton, first, ends), prepared)


@kept_by_first
def _library_on(setting: Problem, automaton: Automaton, prepared: Prepared) -> LatticeLibrary:
    return prepared.once(_library, automaton, *_asked(setting))


def library_with(problem: Problem, choice: Chosen) -> LatticeLibrary:
    """`lattice_library` with other trims, for a vehicle that switches at will; not kept."""
    return _library(problem.automaton, *_asked(problem), choice)


def _asked(
    problem: Problem,
) -> tuple[StageCost, tuple[Shape, ...], Carried, bool, bool, float, bool]:
    """What a library depends on beside its automaton, as `_library` takes it."""
    carried, horizon = tuple(problem.parts.items()), problem.horizon
    fixed, limited = horizon.time is not None, horizon.max_time is not None
    times = fixed, problem.moves, horizon.min_coast, fixed or limited
    return (problem.cost, problem.footprint, carried, *times)


def _library(
    automaton: Automaton,
    cost: StageCost,
    footprint: tuple[Shape, ...],
    carried: Carried,
    fixed_time: bool,
    waits: bool,
    min_coast: float,
    limited: bool,
    choice: Chosen | None = None,
) -> LatticeLibrary:
    if automaton.is_kinematic and automaton.model.group.dof == 3:
        trims = trims_at_will(
            automaton,
            cost,
            fixed_time=fixed_time,
            waits=waits,
            min_coast=min_coast,
            limited=limited,
            choice=choice,
        )
    else:
        trims = trims_of(priced_library(automaton, cost), cost)
    parts = posed_parts(automaton, footprint, dict(carried), trims.library.trims)
    return library_of_trims(trims, parts, waits=waits)


def library_of_trims(
    priced: PricedTrims, parts: tuple[Part, ...], *, waits: bool, close: float = CLOSE
) -> LatticeLibrary:
    """Trims and the maneuvers between them; `waits`: obstacles move, and rest is an edge.

    Courses are followed as closely as `motion_along` says.
    """
    library, arrays = priced.library, priced.library.arrays
    lattice = library.automaton.lattice
    twists, rates = arrays.twists[: arrays.n_trims], arrays.rates[: arrays.n_trims]
    edges = edges_of(library)
    motion, spans = motion_along(library, parts, edges, timed=waits, close=close)
    radius = length_scale(twists, body_of(parts[0].shapes), wide=priced.wide)
    speed = np.hypot(twists[:, 0], twists[:, 1])
    lengths = np.array([path_length(library.automaton, k) for k in edges.maneuver])
    # where no trim moves, only maneuvers cover ground
    per_metre = _least(rates, speed) if speed.any() else _least(edges.cost, lengths)
    surplus = np.maximum(edges.cost - per_metre * lengths, 0.0)
    pose_rows = motion.first_piece[len(parts) * len(edges.cost)]
    durations = edge_durations_of(twists, radius, waits=waits)
    made = lattice_arrays(
        arrays,
        parts,
        edges,
        motion,
        edge_durations=durations,
        via_edge=via_edges(library, edges),
    )
    return LatticeLibrary(
        arrays=made,
        backwards=made._replace(**coasts_of(twists, -durations, made.body)._asdict()),
        priced=library,
        parts=parts,
        trims=library.trims,
        number_of=library.number_of,
        edge_maneuver=edges.maneuver,
        radius=radius,
        # poses of a lattice must not share a cell, since each has to be reached
        cell=CELL * radius if lattice is None else OF_A_LATTICE * lattice.resolution,
        turns=tightest_turn(twists) / radius or 1.0,
        per_metre=per_metre,
        per_climb=_least(rates, np.abs(twists[:, 3])),
        per_turn=TURN * radius * per_metre if priced.per_turn is None else priced.per_turn,
        lag=lags(library, surplus, edges),
        worst_error=float(motion.piece_error[pose_rows:].max(initial=0.0)),
        spans=spans,
        rest=priced.rest,
        rest_rate=priced.rest_rate,
        interval=priced.interval,
        at_will=priced.at_will,
        mirrored=is_mirrored(twists[:, :3], rates),
    )


def _least(rates: Array, speed: Array) -> float:
    """Least cost per metre; 0 if no trim moves."""
    moving = speed > 0.0
    return float((rates[moving] / speed[moving]).min()) if moving.any() else 0.0

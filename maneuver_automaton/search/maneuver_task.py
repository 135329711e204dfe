"""One pass of the lattice of maneuvers: its resolution, and its limits as the kernels see them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.collision.layers import LayerArrays
from maneuver_automaton.search.maneuver_query import ManeuverQuery
from maneuver_automaton.words.library import Library
from maneuver_automaton.words.word import MANEUVER, TRIM

RISE = 0.25  # of altitude
HEADINGS = 72
TRIES = 6  # candidates of one transfer that are tried
PATIENCE = 1.5  # a connection may cost so much more than the estimate ...
SLACK = 6.0  # ... and so many times the way of a length scale
SHOTS = 0.25  # of a length scale's cost between two transfers that are tried, times the estimate
MOST_PATIENCE = 400.0  # expansions between two transfers
ROUNDING = 1e-12  # relative, by which a coast may fall short of the least one
WORDS_AN_EXPANSION = 150.0  # words of a transfer that take as long as an expansion


@dataclass(frozen=True, slots=True, kw_only=True)
class Rung:
    """One resolution and weight of the lattice."""

    scale: float = 1.0  # of the cells
    quanta: float = 1.0  # of the lengths of coasts
    weight: float = 2.0
    stop: bool = False  # at the first connection
    margin: float = 1.0  # of the proven clearance
    most: int = 2**62  # expansions
    backwards: bool = False  # from the goal


class Task(NamedTuple):
    """One pass, as the kernels see it."""

    start: Array  # (4,)
    start_trim: int
    aims: Array  # (A, 4)
    aim_trims: IntArray  # (A,)
    lag: Array  # (m,) least surplus of maneuvers to a goal's trim
    frame_x: float
    frame_y: float
    frame_heading: float
    frame_cos: float
    frame_sin: float
    cell: float
    rise: float  # [m] of altitude that makes another cell
    headings: int
    tick: float
    weight: float
    per_metre: float
    per_climb: float
    per_shot: float
    most_patience: float  # expansions between two transfers
    least_patience: float
    patience: float
    slack: float
    tries: int
    stop_at_first: bool
    keep: float
    margin: float
    far: float  # [m] clearance that is as good as any
    clock: float
    most_time: float
    window: Array
    edge_window: Array  # narrower by what courses may be off
    lowest: float  # [m] altitudes
    highest: float
    least_coast: float  # [s] that a trim which moves lasts at least
    zones: LayerArrays  # a world for every zone; where there is none, one that is not looked at
    zone_trims: NDArray[np.bool_]  # (Z, m) trims that a zone admits
    zone_pieces: NDArray[np.bool_]  # (Z, N) pieces of edges that a zone admits


def task_of(query: ManeuverQuery, rung: Rung) -> Task:
    """Limits and sizes of a pass, as the kernels see them."""
    library, world, settings = query.library, query.world, query.settings
    scale = library.radius * library.per_metre
    frame = query.seen_goals[0]
    window = query.window[1]
    edge_window = window.copy()
    edge_window[8] -= library.worst_error
    goal_trims, classes = query.goal_trims, query.transfer.transitions.class_of
    tick = 0.0
    if query.moves or math.isfinite(
        query.searched_time
    ):  # a dearer way to a cell may be the one that is in time
        lengths = library.arrays.quanta[library.arrays.quanta > 0.0]
        tick = rung.quanta * float(lengths.min()) if lengths.size else 1.0
    return Task(
        start=np.array(query.seen_start),
        start_trim=int(query.start_trim),
        aims=np.array(query.seen_goals),
        aim_trims=np.array(goal_trims),
        lag=library.lag[:, classes[goal_trims]].min(axis=1)[classes],
        frame_x=float(frame[0]),
        frame_y=float(frame[1]),
        frame_heading=float(frame[2]),
        frame_cos=math.cos(float(frame[2])),
        frame_sin=math.sin(float(frame[2])),
        cell=float(rung.scale * (settings.cell or library.cell)),
        rise=float(rung.scale * RISE * library.radius),
        headings=settings.headings or HEADINGS,
        tick=float(tick),
        weight=float(rung.weight if settings.weight is None or not rung.stop else settings.weight),
        per_metre=library.per_metre,
        per_climb=library.per_climb,
        # the way to the goal says how long to wait, unless no trim moves: then nothing is solved
        # for, and the node that ends at the goal must not be missed
        per_shot=float(SHOTS * scale) or 1.0 if query.transfer.arrays.n_few > 1 else math.inf,
        most_patience=MOST_PATIENCE,
        least_patience=float(len(goal_trims) * query.transfer.arrays.n_few / WORDS_AN_EXPANSION),
        patience=PATIENCE,
        slack=float(SLACK * scale) or math.inf,
        tries=TRIES,
        stop_at_first=rung.stop,
        keep=float(query.keep),
        margin=float(query.margin * rung.margin),
        far=float(world.arrays.field.outside),
        clock=float(query.start_time),
        most_time=float(query.searched_time),
        window=window,
        edge_window=edge_window,
        lowest=query.altitudes[0],
        highest=query.altitudes[1],
        least_coast=float(query.least_coast * (1.0 - ROUNDING)),
        zones=query.zone_layers,
        zone_trims=query.zone_trims,
        zone_pieces=query.zone_pieces,
    )


def transfer_steps(
    library: Library, start_trim: int, trims: list[int], times: list[float]
) -> tuple[list[tuple[int, int, float]], list[int]]:
    """Steps of a transfer through trims (-1 for none) and the trims its maneuvers lead to."""
    steps: list[tuple[int, int, float]] = []
    targets: list[int] = []
    at = start_trim
    for trim, t in zip(trims, times, strict=True):
        if trim < 0:
            continue
        for maneuver, following in library.chain(at, trim):
            steps.append((MANEUVER, maneuver, 0.0))
            targets.append(following)
        steps.append((TRIM, trim, t))
        at = trim
    return steps, targets

"""An automaton as the lattice uses it: trims, edges, sizes, for every start, goal and map."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._kept import RECENT, Prepared, kept_by_first
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.automaton.validation import part_between
from maneuver_automaton.collision import Shape
from maneuver_automaton.collision.advancement import swept_areas
from maneuver_automaton.collision.body import Body, body_of
from maneuver_automaton.costs import StageCost, terms_of
from maneuver_automaton.groups import SE2
from maneuver_automaton.primitives import Maneuver
from maneuver_automaton.problem import Problem
from maneuver_automaton.search.arrays import (
    CoastArrays,
    EdgeArrays,
    LatticeArrays,
    PartArrays,
    PieceArrays,
)
from maneuver_automaton.search.lattice_trims import (
    TURN,
    Chosen,
    PricedTrims,
    Times,
    priced_library,
    switched_in_plane,
    trims_at_will,
    trims_of,
)
from maneuver_automaton.search.part_motion import (
    CLOSE,
    Part,
    bodies_of,
    body_arrays,
    carried_twists,
    course_of,
    fastest_of,
    pieces_of,
    posed_parts,
)
from maneuver_automaton.words.library import SWITCH, Library, transitions_of

DURATIONS = (0.17, 0.5)  # of the coasts of edges, in the time a length scale takes
SPINS = (math.pi / 12.0, math.pi / 4.0)  # [rad] of turns on the spot
CELL = 0.122  # side of a cell at the first resolution, in length scales
OF_A_LATTICE = 0.7  # of its resolution: a cell's diagonal is shorter than the step between poses
Carried = tuple[tuple[str, tuple[Shape, ...]], ...]


@dataclass(frozen=True, eq=False, kw_only=True)
class LatticeLibrary:
    """The arrays, and the values that the wrapper needs beside them."""

    arrays: LatticeArrays
    priced: Library  # its trims and maneuvers, with their costs
    parts: tuple[Part, ...]  # rigid parts of the vehicle, posed in these trims
    radius: float  # [m] length scale: the tightest turn, or the size of the body
    cell: float  # [m] side of a cell at the first resolution
    turns: float  # radius of the tightest turn, in length scales; 1 for none
    per_metre: float  # least cost per metre
    per_climb: float  # least cost per metre of altitude
    per_turn: float  # cost of the cheapest full turn
    surplus: Array  # (C, C) least cost of maneuvers between classes beyond that of their path
    spans: IntArray  # (N, 2) samples of its course between which each piece of a part lies
    rest: int | None  # index in the automaton of the rest that pads
    rest_rate: float
    interval: tuple[float, float]  # least expansions, for each goal, and most, between connections

    @property
    def at_will(self) -> bool:
        """Whether plans begin and end in any trim, and may end with a turn on the spot."""
        return switched_in_plane(self.priced.automaton)

    @property
    def trims(self) -> IntArray:
        """Indices in the automaton (m,) of its trims."""
        return self.priced.trims

    @property
    def number_of(self) -> IntArray:
        """Number of each trim of the automaton among these, -1 for those left out."""
        return self.priced.number_of

    @functools.cached_property
    def backwards(self) -> LatticeArrays:
        """The arrays with coasts that lead against time."""
        arrays = self.arrays
        twists, durations = arrays.library.twists[:-1], arrays.coasts.durations
        return arrays._replace(coasts=coasts_of(twists, -durations, arrays.parts.body, durations))

    @functools.cached_property
    def worst_error(self) -> float:
        """How far the pose may be from any piece of a course [m]."""
        pieces = self.arrays.pieces
        of_pose = pieces.first[self.arrays.parts.n * len(self.arrays.edges.cost)]
        return float(pieces.error[of_pose:].max(initial=0.0))

    @functools.cached_property
    def half_width(self) -> float:
        """Half the width of the narrowest part [m]."""
        return min(body_of(part.shapes).half_width for part in self.parts)

    @functools.cached_property
    def drives(self) -> bool:
        """Whether a trim moves."""
        numbered = self.arrays.library
        return bool(numbered.twists[: numbered.n_trims].any())

    @functools.cached_property
    def climbs(self) -> bool:
        """Whether a trim or a maneuver leads up or down."""
        arrays = self.arrays
        return bool(arrays.library.twists[:, 3].any() or arrays.edges.displacement[:, 3].any())

    @functools.cached_property
    def limits_coasts(self) -> bool:
        """Whether a trim has a longest time."""
        numbered = self.arrays.library
        return bool(np.isfinite(numbered.longest[: numbered.n_trims]).any())

    def edges_of(self, maneuvers: IntArray) -> IntArray:
        """Edges of maneuvers of the automaton."""
        order = np.argsort(self.arrays.edges.maneuver)
        places = np.searchsorted(self.arrays.edges.maneuver, maneuvers, sorter=order)
        return np.asarray(order[places], dtype=np.int64)


def lattice_library(
    problem: Problem, goals: Sequence[int] = (), *, prepared: Prepared = RECENT
) -> LatticeLibrary:
    """The part of a lattice search that is the same for every start, goal and map.

    Trims that lead to none of the goals of these numbers, if any, are left out: their speeds would
    make the estimates of cost too low. Where trims are switched at will, all lead there.
    """
    automaton = problem.automaton
    if not goals:
        return _library_on(problem.setting, automaton, prepared)
    first = automaton.index_of(problem.first_trim.name)
    lasts = {automaton.index_of(problem.last_trim(problem.goals[k]).name) for k in goals}
    part = part_between(automaton, first, tuple(sorted(lasts)))
    return _library_on(problem.setting, part, prepared)


@kept_by_first
def _library_on(setting: Problem, automaton: Automaton, prepared: Prepared) -> LatticeLibrary:
    return prepared.once(_library, automaton, *_asked(setting))


def library_with(problem: Problem, choice: Chosen) -> LatticeLibrary:
    """`lattice_library` with other trims, for a vehicle that switches at will; not kept."""
    return _library(problem.automaton, *_asked(problem), choice)


def _asked(problem: Problem) -> tuple[StageCost, tuple[Shape, ...], Carried, Times]:
    """What a library depends on beside its automaton, as `_library` takes it."""
    carried, horizon, terms = tuple(problem.parts.items()), problem.horizon, terms_of(problem.cost)
    fixed = horizon.time is not None
    limited = fixed or horizon.max_time is not None
    priced = terms is not None and (terms.switch > 0.0 or terms.direction_change > 0.0)
    few = horizon.max_trims is not None or horizon.min_coast > 0.0
    saving = not limited and (priced or few)
    times = Times(fixed, problem.moves, float(horizon.min_coast), limited, saving)
    return problem.cost, problem.footprint, carried, times


def _library(
    automaton: Automaton,
    cost: StageCost,
    footprint: tuple[Shape, ...],
    carried: Carried,
    times: Times,
    choice: Chosen | None = None,
) -> LatticeLibrary:
    if switched_in_plane(automaton):
        trims = trims_at_will(automaton, cost, times, choice)
    else:
        trims = trims_of(priced_library(automaton, cost), cost)
    parts = posed_parts(automaton, footprint, dict(carried), trims.library.trims)
    return library_of_trims(trims, parts, waits=times.waits)


def library_of_trims(
    priced: PricedTrims, parts: tuple[Part, ...], *, waits: bool, close: float = CLOSE
) -> LatticeLibrary:
    """Trims and the maneuvers between them; `waits`: obstacles move, and rest is an edge.

    Courses are followed as closely as `motion_along` says.
    """
    library, numbered = priced.library, priced.library.arrays
    lattice, m = library.automaton.lattice, numbered.n_trims
    twists, rates, classes = numbered.twists[:m], numbered.rates[:m], numbered.class_of[:m]
    edges = edges_of(library)
    pieces, spans = motion_along(library, parts, edges, timed=waits, close=close)
    bodies, of_pose = bodies_of(parts), len(parts) * len(edges.cost)
    if len(edges.cost):
        reach = pieces.speed * pieces.time + 2.0 * pieces.error
        sums = np.add.reduceat(np.append(reach, 0.0), pieces.first[:-1])
        sums = np.where(np.diff(pieces.first) > 0, sums, 0.0).reshape(len(parts) + 1, -1)
        ends = pieces.first[of_pose:-1]
        edges = edges._replace(
            reach=np.asarray(sums[:-1].max(axis=0)),
            low=np.minimum.reduceat(pieces.low, ends),
            high=np.maximum.reduceat(pieces.high, ends),
        )
    radius = length_scale(twists, body_of(parts[0].shapes), wide=priced.wide)
    speed = np.hypot(twists[:, 0], twists[:, 1])
    lengths = np.array([path_length(library.automaton.maneuvers[k]) for k in edges.maneuver])
    # where no trim moves, only maneuvers cover ground
    per_metre = _least(rates, speed) if speed.any() else _least(edges.cost, lengths)
    by_maneuver = np.zeros(len(library.maneuver_costs))
    by_maneuver[edges.maneuver] = np.maximum(edges.cost - per_metre * lengths, 0.0)
    offsets = np.array([part.trim_poses for part in parts])
    turned = np.array([carried_twists(twists, poses) for poses in offsets])
    speeds = np.array([fastest_of(b, t) for b, t in zip(bodies, turned, strict=True)])
    durations = edge_durations_of(twists, radius, waits=waits)
    in_class = np.bincount(classes, minlength=len(numbered.transitions.cost))
    children = in_class * durations.shape[1] + np.diff(edges.first)
    return LatticeLibrary(
        arrays=LatticeArrays(
            library=numbered,
            parts=PartArrays(
                n=len(parts),
                body=bodies[0],
                bodies=body_arrays(bodies),
                offsets=offsets,
                twists=turned,
                speeds=speeds,
                fastest=speeds.max(axis=0),
            ),
            coasts=coasts_of(twists, durations, bodies[0]),
            edges=edges,
            pieces=pieces,
            first_trim=np.concatenate([[0], np.cumsum(in_class)]),
            trims_of=np.argsort(classes, kind="stable"),
            most_children=int(children.max(initial=0)),
        ),
        priced=library,
        parts=parts,
        radius=radius,
        # poses of a lattice must not share a cell, since each has to be reached
        cell=CELL * radius if lattice is None else OF_A_LATTICE * lattice.resolution,
        turns=tightest_turn(twists) / radius or 1.0,
        per_metre=per_metre,
        per_climb=_least(rates, np.abs(twists[:, 3])),
        per_turn=TURN * radius * per_metre if priced.per_turn is None else priced.per_turn,
        surplus=transitions_of(library.automaton, by_maneuver).cost,
        spans=spans,
        rest=priced.rest,
        rest_rate=priced.rest_rate,
        interval=priced.interval,
    )


def _least(rates: Array, speed: Array) -> float:
    """Least cost per metre; 0 if no trim moves."""
    moving = speed > 0.0
    return float((rates[moving] / speed[moving]).min()) if moving.any() else 0.0


def edges_of(library: Library) -> EdgeArrays:
    """The maneuvers, sorted by the class they lead out of, then as the automaton lists them.

    Where they lead to on their way follows from their pieces, and is 0 here.
    """
    automaton, transitions = library.automaton, library.transitions
    leaves = transitions.class_of[transitions.sources]
    order = np.argsort(leaves, kind="stable")
    edge_of = np.full(len(order) + 1, SWITCH)  # the last is that of none
    edge_of[order] = np.arange(len(order))
    counts = np.bincount(leaves, minlength=len(library.arrays.transitions.cost))
    none = np.zeros(len(order))
    displacement, time = np.zeros((len(order), 4)), np.zeros(len(order))
    for e, k in enumerate(order.tolist()):
        displacement[e, : automaton.model.group.dof] = automaton.maneuvers[k].displacement
        time[e] = automaton.maneuvers[k].duration
    return EdgeArrays(
        first=np.concatenate([[0], np.cumsum(counts)]),
        source=transitions.sources[order],
        target=transitions.targets[order],
        maneuver=order,
        displacement=displacement,
        cost=library.maneuver_costs[order],
        time=time,
        reach=none,
        low=none,
        high=none,
        via=np.asarray(edge_of[transitions.first], dtype=np.int64),
    )


def motion_along(
    library: Library, parts: Sequence[Part], edges: EdgeArrays, *, timed: bool, close: float = CLOSE
) -> tuple[PieceArrays, IntArray]:
    """Pieces of every part, then of the pose alone, along every edge; samples of the parts.

    `timed`: obstacles move, so that it matters when the vehicle is where. Pieces follow the course
    to within so many half widths of the body as `close` says.
    """
    if not edges.maneuver.size:
        first, rows, none = np.zeros(1, dtype=np.int64), np.zeros((0, 3)), np.zeros(0)
        return PieceArrays(first, rows, rows, *[none] * 5), np.zeros((0, 2), dtype=np.int64)
    automaton, bodies = library.automaton, bodies_of(parts)
    trim_twists = library.arrays.twists[: library.arrays.n_trims]
    twists = [carried_twists(trim_twists, part.trim_poses) for part in parts]
    own = carried_twists(automaton.body_velocities, np.zeros((len(automaton), 3)))
    close *= min(b.half_width or 0.05 * max(b.reach, 1.0) for b in bodies)
    sources, targets = edges.source, edges.target
    chosen = [automaton.maneuvers[k] for k in edges.maneuver]
    climbs = automaton.body_velocities[:, 3:].sum(axis=1)
    ends = np.stack([climbs[sources], climbs[targets]], axis=1)
    found, counts, speeds, heights = [], [np.zeros(1, dtype=np.int64)], [], []
    spans = list[IntArray]()
    for p in range(len(parts) + 1):
        body = bodies[p] if p < len(parts) else None
        table = own if body is None else twists[p]
        reach = 0.0  # of the farthest point of the body from the pose of its part [m]
        if body is not None:
            reach = float(np.hypot(body.middle_x, body.middle_y)) + body.reach
        courses = []
        for k, maneuver in zip(edges.maneuver, chosen, strict=True):
            n = 2 if maneuver.course is None else len(maneuver.course.time)
            poses = np.zeros((n, 3)) if body is None else parts[p].course_poses[k]
            courses.append(course_of(maneuver, poses))
        pieces = pieces_of(
            courses,
            ends=np.stack([table[sources], table[targets]], axis=1),
            reach=reach,
            close=close,
            timed=timed,
            stepwise=automaton.lattice is not None,
        )
        if body is not None:
            sizes = np.array([len(times) for _, times in courses], dtype=np.int64)
            begins = np.repeat(np.cumsum(sizes) - sizes, np.diff(pieces.first))
            spans.append(np.stack([pieces.begin - begins, pieces.end - begins], axis=1))
        counts.append(np.diff(pieces.first))
        found.append(pieces)
        flat = np.hypot(pieces.twist[:, 0], pieces.twist[:, 1])
        speeds.append(flat if body is None else fastest_of(body, pieces.twist))
        heights.append(altitude_ranges(chosen, ends, pieces.begin, pieces.end))
    motion = PieceArrays(
        first=np.cumsum(np.concatenate(counts)),
        pose=np.concatenate([row.pose for row in found]),
        twist=np.concatenate([row.twist for row in found]),
        time=np.concatenate([row.time for row in found]),
        error=np.concatenate([row.error for row in found]),
        speed=np.concatenate(speeds),
        low=np.concatenate([row for row, _ in heights]),
        high=np.concatenate([row for _, row in heights]),
    )
    return motion, np.concatenate(spans)


def path_length(maneuver: Maneuver) -> float:
    """Length of the path of a maneuver [m]; of the straight line where the path is not known."""
    if maneuver.course is None:
        return float(np.hypot(*maneuver.displacement[:2]))
    return float(np.hypot(*np.diff(maneuver.course.pose[:, :2], axis=0).T).sum())


def coasts_of(
    twists: Array, times: Array, body: Body, durations: Array | None = None
) -> CoastArrays:
    """Coasts by twists (m, 4) for times (m, k) [s], negative ones backwards; what they last."""
    steps = times[..., None] * twists[:, None, :]
    moves = np.concatenate([SE2.exp(steps[..., :3]).pose, steps[..., 3:]], axis=-1)
    lasting = times if durations is None else durations
    return CoastArrays(lasting, moves, swept_areas(body, twists, times))


def edge_durations_of(twists: Array, radius: float, *, waits: bool) -> Array:
    """Coasting times (m, 2) of edges [s]; none for rest unless it waits.

    A trim that moves makes a share of the length scale, one that turns on the spot a share of a
    turn; one that only climbs, or rests, goes on for as long as the fastest takes for its share.
    """
    speed, turn = np.hypot(twists[:, 0], twists[:, 1]), np.abs(twists[:, 2])
    fastest = max(float(speed.max(initial=0.0)), 1e-9)
    columns = []
    for share, angle in zip(DURATIONS, SPINS, strict=True):
        with np.errstate(divide="ignore"):
            straight = np.where(speed > 0.0, share * radius / speed, np.inf)
            turning = np.where(turn > 0.0, angle / turn, np.inf)
        t = np.where(speed > 0.1 * turn * radius, straight, turning)
        waiting = share * radius / fastest if waits else 0.0
        still = (speed == 0.0) & (turn == 0.0)
        climbing = share * radius / np.maximum(np.abs(twists[:, 3]), 1e-9)
        columns.append(np.where(still, np.where(twists[:, 3] != 0.0, climbing, waiting), t))
    return np.stack(columns, axis=1)


def tightest_turn(twists: Array) -> float:
    """Radius of the tightest turn that drives [m]; 0 if none does."""
    speed, turn = np.hypot(twists[:, 0], twists[:, 1]), np.abs(twists[:, 2])
    turns = (turn > 0.0) & (speed > 0.0)
    return float((speed[turns] / turn[turns]).min()) if turns.any() else 0.0


def length_scale(twists: Array, body: Body, *, wide: bool) -> float:
    """Radius of the tightest turn that drives; a few widths of the body where there is none.

    Unless turns may be `wide`, it is at most that: a vehicle that can turn without driving a
    circle decides on the scale of its body.
    """
    radius, size = tightest_turn(twists), 4.0 * body.half_width or 4.0 * body.reach
    if radius == 0.0:
        return size or 1.0
    radius = max(radius, 0.5 * size)
    return min(radius, 2.0 * size) if size and not wide else radius


BETWEEN = 0.25  # of the change of climb from sample to sample times their spacing


def altitude_ranges(
    maneuvers: Sequence[Maneuver], climbs: Array, begin: IntArray, end: IntArray
) -> tuple[Array, Array]:
    """Least and greatest altitude (n,) [m] of pieces, seen from where their maneuver begins.

    `climbs` (k, 2) [m/s] in the trims before and after each maneuver; `begin` and `end` (n,) are
    the first and last sample of every piece, of all courses one after the other.
    """
    if not begin.size:
        return np.zeros(0), np.zeros(0)
    rows, swings = [], []
    for maneuver, (before, after) in zip(maneuvers, climbs.tolist(), strict=True):
        if maneuver.displacement.size == 3:
            none = np.zeros(2 if maneuver.course is None else len(maneuver.course.time))
            rows.append(none)
            swings.append(none)
            continue
        if maneuver.course is None:
            z, t = np.array([0.0, maneuver.displacement[3]]), np.array([0.0, maneuver.duration])
        else:
            z, t = maneuver.course.pose[:, 3], maneuver.course.time
        spacing = np.maximum(np.diff(t), 1e-300)
        rates = np.concatenate([[before], np.diff(z) / spacing, [after]])
        change = np.abs(np.diff(rates))
        rows.append(z)
        swings.append(np.append(BETWEEN * np.maximum(change[:-1], change[1:]) * np.diff(t), 0.0))
    altitude, swing = np.concatenate(rows), np.concatenate(swings)
    span = np.stack([begin, end + 1], axis=1).ravel()
    more = np.maximum.reduceat(np.append(swing, 0.0), span)[::2]
    low = np.minimum.reduceat(np.append(altitude, np.inf), span)[::2] - more
    high = np.maximum.reduceat(np.append(altitude, -np.inf), span)[::2] + more
    return np.asarray(low), np.asarray(high)

"""What a search over trims and maneuvers is asked, as a value."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maneuver_automaton._arrays import Array, IntArray, as_array
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.collision import AnyObstacle, Obstacle, Zone
from maneuver_automaton.collision.advancement import clearances
from maneuver_automaton.collision.body import body_of
from maneuver_automaton.collision.convex import DIGITS
from maneuver_automaton.collision.heights import Layer
from maneuver_automaton.collision.layers import (
    ROUNDED,
    LayerArrays,
    always,
    bands_of,
    layer_arrays,
)
from maneuver_automaton.collision.world import World, own_frame, world_of
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Bounds, SearchSettings
from maneuver_automaton.search.admission import admitted_stretches, piece_is_admitted
from maneuver_automaton.search.lattice_arrays import LatticeLibrary
from maneuver_automaton.search.lattice_query import window_of
from maneuver_automaton.search.maneuver_library import maneuver_library
from maneuver_automaton.search.maneuver_motion import Part
from maneuver_automaton.search.scene import Scene
from maneuver_automaton.words.library import Library
from maneuver_automaton.words.word import Word, with_price, word_of_steps

MARGIN = 0.005  # proven clearance of every pose looked at, in half widths of the body
LEAST_MARGIN = 1e-7  # [m]
MOST_PATIENCE = 400.0  # expansions between two connections that are tried
WORDS_AN_EXPANSION = 150.0  # words of a connection that take as long as an expansion


@dataclass(frozen=True, eq=False, kw_only=True)
class ManeuverQuery:
    """One start and its goals, each a pose and a trim, among obstacles.

    Parameters
    ----------
    transfer : Library
        The automaton with its prices.
    parts : tuple of Part
        Rigid parts of the vehicle; the pose of the first is that of the vehicle.
    start : (dof,) array
        Pose [m, m, rad(, m)].
    goals : (n, dof) array
    start_trim : int
        Trim at the start, with no need to coast in it.
    goal_trims : (n,) array of int
    obstacles : tuple of obstacles
    bounds : Bounds
        Of the pose.
    keep : float
        Distance kept from everything [m].
    start_time : float
        [s] of the clock by which obstacles move.
    most_time : float
        [s] that a plan may last.
    body_height : (float, float)
        Lowest and highest point of the vehicle about its altitude [m].
    zones : tuple of Zone
        Where not every motion is admitted.
    least_coast : float
        [s] that every trim which moves lasts at least.
    settings : SearchSettings
        Cells, headings and weight of the lattice.
    owners : (n,) array of int, optional
        Which goal of the problem each goal stands for: several headings stand for a free one.
    """

    transfer: Library
    parts: tuple[Part, ...]
    start: Array
    goals: Array
    start_trim: int
    goal_trims: IntArray
    obstacles: tuple[AnyObstacle, ...] = ()
    bounds: Bounds = field(default_factory=Bounds)
    keep: float = 0.0
    start_time: float = 0.0
    most_time: float = math.inf
    body_height: tuple[float, float] = (0.0, 0.0)
    zones: tuple[Zone, ...] = ()
    least_coast: float = 0.0
    settings: SearchSettings = field(default_factory=SearchSettings)
    owners: IntArray | None = None

    def __post_init__(self) -> None:
        dof = self.automaton.model.group.dof
        start = np.array(as_array("start", self.start, last=dof))
        goals = np.atleast_2d(np.array(as_array("goals", self.goals, last=dof)))
        trims = np.atleast_1d(np.array(self.goal_trims, dtype=np.int64))
        if start.shape != (dof,):
            raise ValueError(f"start: got shape {start.shape}, need ({dof},)")
        if not len(goals) or trims.shape != goals.shape[:1]:
            raise ValueError(f"goals: got {len(goals)} poses and {trims.size} trims")
        numbers = [self.start_trim, *trims.tolist()]
        if min(numbers) < 0 or max(numbers) >= len(self.automaton):
            raise ValueError(f"trims: got {numbers}, need 0 to {len(self.automaton) - 1}")
        for name, value in (("start", start), ("goals", goals), ("goal_trims", trims)):
            value.setflags(write=False)
            object.__setattr__(self, name, value)

    @property
    def automaton(self) -> Automaton:
        """The automaton."""
        return self.transfer.automaton

    @cached_property
    def world(self) -> World:
        """All obstacles, whatever their heights, prepared for the vehicle's largest part."""
        return self._world_of(self.obstacles)

    @cached_property
    def bands(self) -> tuple[Layer, ...]:
        """Obstacles between neighbouring heights, in the problem's altitudes."""
        return bands_of(self.obstacles, in_space=self.start.size > 3)

    @cached_property
    def plane(self) -> World:
        """Those obstacles that are in the way at every altitude within the bounds."""
        if self.start.size == 3:
            return self.world
        low, high = self.bounds.z or (-math.inf, math.inf)
        below, above = self.body_height
        return self._world_of(always(self.bands, low=low + below, high=high + above))

    @cached_property
    def layers(self) -> LayerArrays:
        """The obstacles between neighbouring heights, then the zones, as the kernels see them."""
        (below, above), pad = self.body_height, self.keep + self.margin + ROUNDED
        low = [band.low - above - pad - self.level for band in self.bands]
        high = [band.high - below + pad - self.level for band in self.bands]
        everywhere = [math.inf] * len(self.zones)
        return layer_arrays(
            [
                *(self._world_of(band.obstacles) for band in self.bands),
                *(self._world_of((Obstacle(zone.shape),)) for zone in self.zones),
            ],
            low=np.append(np.round(low, DIGITS), np.negative(everywhere)),
            high=np.append(np.round(high, DIGITS), everywhere),
            plane=self.plane,
        )

    @cached_property
    def zone_trims(self) -> NDArray[np.bool_]:
        """Which trims each zone admits, (Z, m)."""
        trims = self.automaton.trims
        rows = [[piece_is_admitted(zone, trim) for trim in trims] for zone in self.zones]
        return np.array(rows, dtype=np.bool_).reshape(len(self.zones), len(trims))

    @cached_property
    def zone_pieces(self) -> NDArray[np.bool_]:
        """Which pieces of the motion of each part along edges each zone admits, (Z, N)."""
        library = self.library
        first, spans, n_parts = library.arrays.first_piece, library.spans, library.arrays.n_parts
        n_edges = len(library.edge_maneuver)
        admitted = np.zeros((len(self.zones), len(spans)), dtype=np.bool_)
        for z, zone in enumerate(self.zones):
            for edge, k in enumerate(library.edge_maneuver.tolist()):
                maneuver = self.automaton.maneuvers[k]
                if maneuver.course is None:
                    continue
                good = admitted_stretches(zone, maneuver, self.automaton.model)
                for group in range(edge, n_parts * n_edges, n_edges):  # one of every part
                    for n in range(first[group], first[group + 1]):
                        admitted[z, n] = good[spans[n, 0] : spans[n, 1]].all()
        return admitted

    @property
    def level(self) -> float:
        """Altitude from which the kernels count [m]."""
        return float(self.goals[0, 3]) if self.start.size > 3 else 0.0

    @property
    def altitudes(self) -> tuple[float, float]:
        """Lowest and highest altitude within the bounds, as the kernels count it."""
        if self.bounds.z is None or self.start.size == 3:
            return -math.inf, math.inf
        low, high = self.bounds.z
        return low - self.level - ROUNDED, high - self.level + ROUNDED

    def around(self, part: Part, world: World) -> World:
        """A world around one part."""
        return replace(world, body=body_of(part.shapes))

    @property
    def moves(self) -> bool:
        """Whether an obstacle moves."""
        return bool(self.world.arrays.movers.speed.size)

    @property
    def searched_time(self) -> float:
        """Longest time [s] that a search admits: none where cheaper words are quicker ones.

        There a first word may be late, and what it is improved to is in time.
        """
        return math.inf if self.costs_are_times else self.most_time

    def owner(self, word: Word) -> int:
        """Which goal of the problem a word leads to."""
        return word.goal if self.owners is None else int(self.owners[word.goal])

    @property
    def costs_are_times(self) -> bool:
        """Whether what a motion costs is how long it lasts, at one price."""
        arrays = self.transfer.arrays
        rates = arrays.rates[: arrays.n_trims]  # the last row is the turn of a free heading
        lasting = np.array([one.duration for one in self.automaton.maneuvers])
        price = float(rates[0])
        close = functools.partial(np.allclose, rtol=1e-9, atol=1e-12)
        return bool(close(rates, price) and close(self.transfer.maneuver_costs, price * lasting))

    @property
    def free_heading(self) -> NDArray[np.bool_]:
        """No goal has a free heading (n,): several goals stand for one."""
        return np.zeros(len(self.goals), dtype=np.bool_)

    @property
    def box(self) -> Array:
        """Where to search (4,), in the world's frame."""
        return self.window[0]

    @property
    def stay_until(self) -> float:
        """A plan ends at its arrival."""
        return -math.inf

    @property
    def most_trims(self) -> int:
        """Words have any number of trims."""
        return 0

    @property
    def interval(self) -> tuple[float, float]:
        """Least and most expansions between two connections: one takes as long as some of these."""
        words = len(self.goal_trims) * self.transfer.arrays.n_few
        return words / WORDS_AN_EXPANSION, MOST_PATIENCE

    def scene(self, margin: float | None = None) -> Scene:
        """What motions are tested against, with a proven clearance [m], by default the usual."""
        window = self.window[1]
        edge_window = window.copy()
        edge_window[8] -= self.library.worst_error
        return Scene(
            layers=self.layers,
            keep=float(self.keep),
            margin=float(self.margin if margin is None else margin),
            far=float(self.world.arrays.field.outside),
            window=window,
            edge_window=edge_window,
            lowest=self.altitudes[0],
            highest=self.altitudes[1],
            zone_trims=self.zone_trims,
            zone_pieces=self.zone_pieces,
        )

    def word_of(self, steps: Iterable[tuple[int, int, float]], goal: int) -> Word:
        """A word of steps, with its cost."""
        return with_price(self.transfer, word_of_steps(steps, goal=goal))

    @cached_property
    def library(self) -> LatticeLibrary:
        """Edges and pieces of motion of the automaton."""
        return maneuver_library(self.transfer, self.parts, timed=self.moves, waits=self.moves)

    @cached_property
    def seen_start(self) -> Array:
        """Start (4,) seen from the world's frame."""
        return np.asarray(self._seen(self.start[None])[0])

    @cached_property
    def seen_goals(self) -> Array:
        """Goals (n, 4) seen from the world's frame."""
        return self._seen(self.goals)

    @cached_property
    def half_width(self) -> float:
        """Half the width of the narrowest part [m]."""
        return min(body_of(part.shapes).half_width for part in self.parts)

    @cached_property
    def margin(self) -> float:
        """Proven clearance [m]: a share of the body, at most half of what the ends have."""
        usual = MARGIN * (self.half_width or 0.1 * self.library.radius)
        known = [0.5 * gap for gap in self.end_clearances().tolist() if gap > 0.0]
        return float(max(LEAST_MARGIN, min([usual, *known])))

    def end_clearances(self) -> Array:
        """Clearance (1 + n,) beyond `keep` at the start and every goal, over all parts [m].

        Where something moves, at the start time, and after everything has come to rest.
        """
        settled = max(self.start_time, self.world.last_event)
        rows = []
        ends = [(self.seen_start, self.start_trim, self.start_time)]
        ends += [
            (goal, int(trim), settled)
            for goal, trim in zip(self.seen_goals, self.goal_trims, strict=True)
        ]
        for pose, trim, time in ends:
            gaps = []
            for part in self.parts:
                there = (SE2(pose[:3]) @ SE2(part.trim_poses[trim])).pose
                for band in self.bands:
                    own = self.around(part, self._world_of(band.obstacles))
                    aside = float(clearances(own, there, times=time)[0])
                    beside = band.gap(pose[3:] + self.level, self.body_height)[0]
                    gaps.append(max(aside, float(beside)))
            rows.append(min(gaps) - self.keep)
        return np.array(rows)

    @cached_property
    def window(self) -> tuple[Array, Array, bool]:
        """Box in the world's frame, window as in `_kernels_motion.inside_window`, if bounded."""
        ends = np.vstack([self.seen_start[None], self.seen_goals])
        around = tuple(Obstacle(zone.shape) for zone in self.zones)  # so that ways lead round them
        world = self._world_of((*self.obstacles, *around)) if around else self.world
        return window_of(self.bounds, world, ends, radius=self.library.radius)

    def _seen(self, poses: Array) -> Array:
        planar = self.world.into(poses[:, :3])
        if poses.shape[1] == 3:
            return np.hstack([planar, np.zeros((len(poses), 1))])
        return np.hstack([planar, np.round(poses[:, 3:] - self.level, DIGITS)])

    def _world_of(self, obstacles: tuple[AnyObstacle, ...]) -> World:
        largest = max(self.parts, key=lambda part: body_of(part.shapes).reach)
        frame = own_frame(self.obstacles, self.goals[0])
        return world_of(obstacles, largest.shapes, frame, keep=self.keep)


def maneuver_query(
    transfer: Library,
    parts: tuple[Part, ...],
    start: ArrayLike,
    goals: ArrayLike | Sequence[ArrayLike],
    *,
    start_trim: str,
    goal_trim: str,
    obstacles: tuple[AnyObstacle, ...] = (),
    bounds: Bounds | None = None,
    keep: float = 0.0,
    body_height: tuple[float, float] = (0.0, 0.0),
) -> ManeuverQuery:
    """A query by the names of trims, one for all goals; raises UnknownTrim."""
    rows = np.atleast_2d(as_array("goals", goals))  # type: ignore[arg-type]
    automaton = transfer.automaton
    return ManeuverQuery(
        transfer=transfer,
        parts=parts,
        start=as_array("start", start),
        goals=rows,
        start_trim=automaton.index_of(start_trim),
        goal_trims=np.full(len(rows), automaton.index_of(goal_trim), dtype=np.int64),
        obstacles=obstacles,
        bounds=Bounds() if bounds is None else bounds,
        keep=keep,
        body_height=body_height,
    )

"""One start and its goals, each a pose and a trim, with all that a lattice search is told."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import plain
from maneuver_automaton._kept import RECENT, Prepared
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.collision.advancement import clearances
from maneuver_automaton.collision.body import body_of
from maneuver_automaton.collision.convex import DIGITS
from maneuver_automaton.collision.world import World
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Problem
from maneuver_automaton.search._kernels_place import places_cost, word_place
from maneuver_automaton.search.arrays import DistanceGrid, LeastPrices, Scene
from maneuver_automaton.search.lattice_goals import poses_aimed_at
from maneuver_automaton.search.lattice_library import LatticeLibrary, lattice_library
from maneuver_automaton.search.place_arrays import least_prices
from maneuver_automaton.search.scene import Worlds, ends_of, scene_of, window_of, worlds_around
from maneuver_automaton.words.library import NO_TRIM, SWITCH
from maneuver_automaton.words.word import Word, word_of_steps

MARGIN = 0.005  # proven clearance of every pose looked at, in half widths of the body
LEAST_MARGIN = 1e-7  # [m]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LatticeQuery:
    """Values that every pass of the lattice shares, for a vehicle of any kind.

    Poses are seen from the world's frame and have four components; altitudes are counted from that
    of the first goal, and are 0 in the plane. Trims are numbered as in the library.
    """

    problem: Problem
    library: LatticeLibrary
    worlds: Worlds
    around: Scene  # that motions are tested against
    start: Array  # (4,)
    start_trim: int  # NO_TRIM: any will do
    goals: Array  # (n, 4) those that can be reached at all
    goal_trims: IntArray  # (n,) NO_TRIM: any will do
    free_heading: NDArray[np.bool_]  # (n,)
    goal_poses: Array  # (n, dof) the goals as the problem sees them
    goal_index: tuple[int, ...]  # which of the problem's goals they are
    box: Array  # (4,) of the window in the world's frame
    bounded: bool  # whether the window's rim is a wall on every side
    most_time: float  # [s] that a plan may last, inf if free
    prepared: Prepared  # where its library and its worlds are kept

    @property
    def automaton(self) -> Automaton:
        """The automaton, without trims and maneuvers that lead to no goal."""
        return self.library.priced.automaton

    @property
    def world(self) -> World:
        """All obstacles, whatever their heights, around the largest part."""
        return self.worlds.whole

    @property
    def plane(self) -> World:
        """Obstacles at every altitude, around the first part."""
        return self.worlds.plane

    @property
    def margin(self) -> float:
        """Proven clearance beyond the problem's own margin [m]."""
        return self.around.margin

    @property
    def window(self) -> Array:
        """Window (9,) as in `_kernels_coast.inside_window`."""
        return self.around.window

    @property
    def least_coast(self) -> float:
        """Least time of a trim that moves [s]."""
        return self.problem.horizon.min_coast

    @property
    def moves(self) -> bool:
        """Whether an obstacle moves."""
        return bool(self.world.arrays.moving.speed.size)

    @property
    def padding(self) -> float:
        """Cost to every word of the rest that pads a fixed time, its switch included."""
        library, fixed = self.library, self.problem.horizon.time
        if fixed is None or library.rest is None:
            return 0.0
        return library.rest_rate * fixed + library.arrays.library.switch

    @property
    def most_trims(self) -> int:
        """Trims a word may have before the rest that pads it; 0: no limit.

        No limit where maneuvers link trims: words of too many are guesses for words of fewer.
        """
        most = self.problem.horizon.max_trims
        if most is None or not self.automaton.is_kinematic:
            return 0
        pads = self.problem.horizon.time is not None and self.library.rest is not None
        return max(1, most - int(pads))

    def scene(self, margin: float | None = None) -> Scene:
        """The scene for tests of motions, with a proven clearance [m], by default the usual."""
        return self.around if margin is None else self.around._replace(margin=float(margin))

    def word_of(self, steps: Iterable[tuple[int, int, float]], goal: int) -> Word:
        """A word of steps in the automaton's numbers, with its cost."""
        return self.with_places(word_of_steps(steps, goal=goal, library=self.library.priced))

    def least_prices(self, grid: DistanceGrid) -> LeastPrices:
        """What places cost at least in cells of a grid."""
        return least_prices(
            self.problem,
            self.around.place,
            grid.layout.cell,
            inscribed=self.plane.body.inscribed,
            per_metre=float(self.library.per_metre),
        )

    def with_places(self, word: Word) -> Word:
        """The word with what its places cost added to its cost."""
        if not plain(places_cost)(self.around):
            return word
        trims, edges = self.library.number_of[word.trims], self.edges_along(word)
        lib, durations = self.library.arrays, np.array(word.durations)
        paid = word_place(self.around, lib, np.array(self.start), trims, durations, edges)
        return replace(word, cost=word.cost + paid)

    def edges_along(self, word: Word) -> IntArray:
        """The edge (n,) that leads to each trim of a word, -1 for a switch, and to the first."""
        edges = np.full(len(word.trims), SWITCH)
        led = np.flatnonzero(word.transitions != SWITCH)
        edges[led + 1] = self.library.edges_of(word.transitions[led])
        return edges


def lattice_query(
    problem: Problem,
    goals: Sequence[int],
    *,
    prepared: Prepared = RECENT,
    library: LatticeLibrary | None = None,
) -> LatticeQuery:
    """The query of a search from the start of a problem to the goals of these numbers.

    A vehicle that switches at will begins and ends in any trim. Unless it does so in a plane,
    several headings are asked for where any will do: best times then let the heading go. A fixed
    time is a longest one, since rest fills it. A `library` takes the place of the usual one.
    """
    library = library or lattice_library(problem, goals, prepared=prepared)
    worlds, horizon = worlds_around(problem, library.parts, prepared=prepared), problem.horizon
    turns = library.at_will  # at the end, to any heading
    aimed = [
        problem.goals[k].pose[None] if turns else poses_aimed_at(problem, problem.goals[k])
        for k in goals
    ]
    index = [k for k, rows in zip(goals, aimed, strict=True) for _ in rows]
    poses = np.concatenate([problem.start[None], *aimed])
    level = float(poses[1, 3]) if poses.shape[1] > 3 else 0.0
    trims, automaton = np.full(len(poses), NO_TRIM), library.priced.automaton
    if not automaton.is_kinematic:
        last = [problem.last_trim(problem.goals[k]).name for k in index]
        numbers = [automaton.index_of(name) for name in (problem.first_trim.name, *last)]
        trims = np.asarray(library.number_of[numbers], dtype=np.int64)
    seen = np.zeros((len(poses), 4))
    if turns and not (problem.parts or problem.moves):
        asked = [0, *(1 + k for k in index)]
        seen[:, :3], clear = (one[asked] for one in ends_of(problem))
        clear = clear - problem.margin
    else:
        seen[:, :3] = worlds.whole.into(poses[:, :3])
        if poses.shape[1] > 3:
            seen[:, 3] = np.round(poses[:, 3] - level, DIGITS)
        clear = _end_clearances(problem, library, worlds, seen, trims, level)
    # The clearance at one heading says nothing of a goal at which the vehicle may turn; nor that
    # after the last event of one that is reached before.
    if not (turns or problem.moves) and (clear[1:] > 0.0).any():
        kept = np.append(0, 1 + np.flatnonzero(clear[1:] > 0.0))
        clear, seen, trims, poses = clear[kept], seen[kept], trims[kept], poses[kept]
        index = [index[k - 1] for k in kept[1:].tolist()]
    # the usual clearance, at most half of that at start and goals
    halves = [0.5 * one for one in clear.tolist() if one > 0.0]
    margin = float(max(LEAST_MARGIN, min([usual_margin(library, worlds.whole), *halves])))
    box, window, bounded = window_of(problem.bounds, worlds.outer, seen, radius=library.radius)
    most = horizon.max_time if horizon.time is None else horizon.time
    return LatticeQuery(
        problem=problem,
        library=library,
        worlds=worlds,
        around=scene_of(problem, library, worlds, window, box, margin=margin, level=level),
        start=seen[0],
        start_trim=int(trims[0]),
        goals=seen[1:],
        goal_trims=trims[1:],
        free_heading=np.array([turns and problem.goals[k].free_heading for k in index], np.bool_),
        goal_poses=poses[1:],
        goal_index=tuple(index),
        box=box,
        bounded=bounded,
        most_time=math.inf if most is None else most * (1.0 + 1e-12),
        prepared=prepared,
    )


def _end_clearances(
    problem: Problem,
    library: LatticeLibrary,
    worlds: Worlds,
    ends: Array,
    trims: IntArray,
    level: float,
) -> Array:
    """Clearance (1 + n,) beyond the margin at all ends [m]; at goals once all has come to rest."""
    after = max(problem.start_time, worlds.whole.last_event)
    times = np.array([problem.start_time] + [after] * (len(ends) - 1))
    found = []
    for part in library.parts:
        offsets, there = part.trim_poses[trims], ends[:, :3]
        if offsets.any():
            there = (SE2(there) @ SE2(offsets)).pose
        for band, world in zip(worlds.bands, worlds.between, strict=True):
            body = body_of(part.shapes)
            around = world if world.body is body else replace(world, body=body)
            aside = clearances(around, there, times=times)
            if worlds.flat is None:
                aside = np.maximum(aside, band.clearance(ends[:, 3] + level, problem.body_height))
            found.append(aside)
    least: Array = found[0] if len(found) == 1 else np.min(found, axis=0)
    return least - problem.margin


def usual_margin(library: LatticeLibrary, world: World) -> float:
    """Proven clearance if start and goals allow it, a share of the body [m]."""
    if library.half_width:
        return MARGIN * library.half_width
    width = world.box[2:] - world.box[:2]  # a length of the world, for vehicles that are points
    length = 0.02 * width.max() if np.isfinite(width).all() else 1.0
    return MARGIN * float(np.clip(length, 1e-3, 1.0))

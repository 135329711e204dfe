"""One start and its goals among obstacles, seen from the world's own frame."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.collision.advancement import clearances
from maneuver_automaton.collision.layers import LayerArrays, single_layer
from maneuver_automaton.collision.world import World, own_frame, world_of
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Bounds, Problem, SearchSettings
from maneuver_automaton.search.lattice_arrays import LatticeLibrary
from maneuver_automaton.search.lattice_library import lattice_library
from maneuver_automaton.search.scene import Scene, planar_scene
from maneuver_automaton.words.library import NO_TRIM
from maneuver_automaton.words.word import Word, word_of_steps

MARGIN = 0.005  # proven clearance of every pose looked at, in half widths of the body
LEAST_MARGIN = 1e-7  # [m]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LatticeQuery:
    """What every pass of the lattice shares."""

    problem: Problem
    library: LatticeLibrary
    world: World
    layers: LayerArrays  # the world as the only layer there is
    start: Array  # (3,) in the world's frame
    goals: Array  # (n, 3) those that can be reached at all
    seen_start: Array  # (4,) the same at no altitude
    seen_goals: Array  # (n, 4)
    goal_trims: IntArray  # (n,) -1: the vehicle ends in any trim
    goal_index: tuple[int, ...]  # which of the problem's goals they are
    free_heading: NDArray[np.bool_]  # (n,)
    window: Array  # (9,) as in `_kernels_motion.inside_window`
    box: Array  # (4,) of the window in the world's frame
    bounded: bool  # whether the window's rim is a wall on every side
    margin: float  # [m] proven clearance beyond the problem's own margin
    most_time: float  # [s] inf if free

    @property
    def settings(self) -> SearchSettings:
        """Cells, headings and weight of the lattice."""
        return self.problem.search

    @property
    def start_trim(self) -> int:
        """The vehicle begins in any trim."""
        return NO_TRIM

    @property
    def half_width(self) -> float:
        """Half the width of the body [m]."""
        return self.world.body.half_width

    @property
    def start_time(self) -> float:
        """Time of the world at the start [s]."""
        return self.problem.start_time

    @property
    def searched_time(self) -> float:
        """Longest duration that is looked at [s]."""
        return self.most_time

    @property
    def least_coast(self) -> float:
        """Least time of a trim that moves [s]."""
        return self.problem.horizon.min_coast

    @property
    def moves(self) -> bool:
        """Whether an obstacle moves."""
        return self.problem.moves

    @property
    def interval(self) -> tuple[float, float]:
        """Expansions between two connections: as many as the estimate says."""
        return 0.0, math.inf

    def scene(self, margin: float | None = None) -> Scene:
        """What motions are tested against, with a proven clearance [m], by default the usual."""
        return planar_scene(
            self.layers,
            self.window,
            keep=self.keep,
            margin=self.margin if margin is None else margin,
            n_trims=len(self.library.trims),
        )

    def word_of(self, steps: Iterable[tuple[int, int, float]], goal: int) -> Word:
        """A word of steps in the automaton's numbers, as yet without its cost."""
        return word_of_steps(steps, goal=goal)

    @property
    def padding(self) -> float:
        """What the rest that pads a fixed time costs every word, its switch included."""
        library, fixed = self.library, self.problem.horizon.time
        if fixed is None or library.rest is None:
            return 0.0
        return library.rest_rate * fixed + library.arrays.library.switch

    @property
    def most_trims(self) -> int:
        """Trims a word may have before the rest that pads it; 0: no limit."""
        most = self.problem.horizon.max_trims
        if most is None:
            return 0
        pads = self.problem.horizon.time is not None and self.library.rest is not None
        return max(1, most - int(pads))

    @property
    def stay_until(self) -> float:
        """Time of the world [s] until which a plan rests at its goal; -inf if it need not."""
        fixed = self.problem.horizon.time
        return -math.inf if fixed is None else self.problem.start_time + fixed

    @property
    def keep(self) -> float:
        """Distance kept from everything [m]."""
        return self.problem.margin


def lattice_query(problem: Problem, goal_index: tuple[int, ...]) -> LatticeQuery:
    """Start and the goals of these numbers, with the world around them."""
    library = lattice_library(problem)
    world = world_around(problem)
    start = world.into(problem.start)
    goals = world.into(np.array([problem.goals[k].pose for k in goal_index]))
    box, window, bounded = window_of(
        problem.bounds, world, np.vstack([start, goals]), radius=library.radius
    )
    horizon = problem.horizon
    limit = horizon.time if horizon.time is not None else horizon.max_time
    return LatticeQuery(
        problem=problem,
        library=library,
        world=world,
        layers=single_layer(world),
        start=start,
        goals=goals,
        seen_start=np.append(start, 0.0),
        seen_goals=np.hstack([goals, np.zeros((len(goals), 1))]),
        goal_trims=np.full(len(goals), NO_TRIM),
        goal_index=goal_index,
        free_heading=np.array([problem.goals[k].free_heading for k in goal_index]),
        window=window,
        box=box,
        bounded=bounded,
        margin=_margin(problem, world, start, goals),
        most_time=math.inf if limit is None else limit * (1.0 + 1e-12),
    )


def world_around(problem: Problem) -> World:
    """The obstacles of a problem around its footprint, prepared once for a map."""
    frame = own_frame(problem.obstacles, problem.goals[0].pose)
    return world_of(problem.obstacles, problem.footprint, frame, keep=problem.margin)


def _margin(problem: Problem, world: World, start: Array, goals: Array) -> float:
    """Proven clearance: a share of the body, at most half of what start and goals have."""
    usual = MARGIN * (world.body.half_width or _typical(world))
    poses = np.vstack([start, goals])
    here = clearances(world, poses[:1], times=problem.start_time) - problem.margin
    settled = max(problem.start_time, world.last_event)
    there = clearances(world, poses[1:], times=settled) - problem.margin
    known = [float(value) for value in np.append(here, there) if value > 0.0]
    return max(LEAST_MARGIN, min([usual, *(0.5 * value for value in known)]))


def _typical(world: World) -> float:
    """A length of the world, for vehicles that are points."""
    width = world.box[2:] - world.box[:2]
    return float(np.clip(0.02 * width.max(), 1e-3, 1.0)) if np.isfinite(width).all() else 1.0


def window_of(
    bounds: Bounds, world: World, poses: Array, *, radius: float
) -> tuple[Array, Array, bool]:
    """Where to search: the bounds, and where there are none, some way around everything.

    A box (4,) in the world's frame, a window as in `_kernels_motion.inside_window`, and whether
    the window's rim is a wall on every side. `poses` (n, 3 or more) lie inside.
    """
    pad = 4.0 * radius + 4.0 * world.body.reach
    low = np.minimum(world.box[:2], poses[:, :2].min(axis=0)) - pad
    high = np.maximum(world.box[2:], poses[:, :2].max(axis=0)) + pad
    if bounds.x is None and bounds.y is None:
        box = np.concatenate([low, high])
        return box, np.concatenate([box, [0.0, 0.0, 1.0, 0.0, 0.0]]), False
    turn = float(world.frame[2])
    c, s = math.cos(turn), math.sin(turn)
    corners = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    seen = corners @ np.array([[c, s], [-s, c]])  # along the axes of the problem
    low, high = seen.min(axis=0), seen.max(axis=0)
    for axis, pair in enumerate((bounds.x, bounds.y)):
        if pair is not None:
            low[axis], high[axis] = pair[0] - world.frame[axis], pair[1] - world.frame[axis]
    slack = 1e-9 * (1.0 + float(np.abs(np.append(low, high)).max()))
    window = np.array([low[0], low[1], high[0], high[1], 0.0, 0.0, c, s, slack])
    inner = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    back = np.asarray(SE2(np.array([0.0, 0.0, -turn])).act(inner))
    box = np.concatenate([back.min(axis=0), back.max(axis=0)])
    return box, window, bounds.x is not None and bounds.y is not None

"""What motions of a search are tested against: the worlds of a map, zones, and the window."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array
from maneuver_automaton._kept import RECENT, Prepared, kept_by_first, kept_with
from maneuver_automaton.collision import AnyObstacle, Obstacle, Shape, Zone
from maneuver_automaton.collision.advancement import clearances
from maneuver_automaton.collision.body import body_of
from maneuver_automaton.collision.convex import DIGITS
from maneuver_automaton.collision.layers import (
    ROUNDED,
    Layer,
    LayerArrays,
    always,
    bands_of,
    layer_arrays,
)
from maneuver_automaton.collision.world import World, frame_at_first, world_of
from maneuver_automaton.groups import SE2
from maneuver_automaton.models import Model
from maneuver_automaton.places import PlaceCost, extent_of
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.problem import Bounds, Problem
from maneuver_automaton.search.arrays import Scene
from maneuver_automaton.search.lattice_library import LatticeLibrary
from maneuver_automaton.search.part_motion import Part
from maneuver_automaton.search.place_arrays import known_distance, place_arrays

CLEARLY = 1e-6  # [m] a clearance beyond the margin that leaves no doubt
_Shapes = tuple[Shape, ...]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Worlds:
    """A map around the largest part of a vehicle, in one frame."""

    whole: World  # all obstacles, whatever their heights
    plane: World  # obstacles at every altitude within the bounds, around the first part
    bands: tuple[Layer, ...]  # obstacles between neighbouring heights, in the problem's altitudes
    between: tuple[World, ...]  # the worlds of these
    zones: tuple[World, ...]  # every zone as if it were an obstacle
    outer: World  # all obstacles, zones and dear places, so that paths lead round them
    flat: LayerArrays | None  # they as arrays, where heights do not matter


@kept_by_first
def ends_of(problem: Problem) -> tuple[Array, Array]:
    """Start and goals of a problem in the plane; nothing of it moves, and no part is carried.

    Poses (1 + n, 3) seen from the world's frame [m, m, rad], and clearances (1 + n,) [m] to what
    stands there, lower bounds as in `clearances`.
    """
    world = world_around(problem)
    poses = world.into(np.array([problem.start, *(goal.pose for goal in problem.goals)]))
    return poses, clearances(world, poses)


def world_around(problem: Problem) -> World:
    """The obstacles of a problem around its footprint, prepared once for a map."""
    return _world(problem.setting, _frame(problem))


@kept_by_first
def _world(setting: Problem, frame: tuple[float, ...]) -> World:
    keep = known_distance(setting)
    return world_of(setting.obstacles, setting.footprint, frame, keep=keep)


def _frame(problem: Problem) -> tuple[float, ...]:
    """The frame of the worlds of a problem."""
    first = kept_with(problem.setting, "frame", lambda: frame_at_first(problem.setting.obstacles))
    return first or tuple(problem.goals[0].pose[:3].tolist())


def worlds_around(
    problem: Problem, parts: tuple[Part, ...], *, prepared: Prepared = RECENT
) -> Worlds:
    """The obstacles and zones of a problem around the parts of its vehicle."""
    return _worlds_on(problem.setting, parts, _frame(problem), prepared)


@kept_by_first
def _worlds_on(
    setting: Problem, parts: tuple[Part, ...], frame: tuple[float, ...], prepared: Prepared
) -> Worlds:
    low, high = setting.bounds.z or (-math.inf, math.inf)
    below, above = setting.body_height
    return prepared.once(
        _worlds,
        setting.obstacles,
        setting.zones,
        setting.place_costs,
        tuple(part.shapes for part in parts),
        frame,
        (low + below, high + above) if setting.start.size > 3 else None,
        keep=known_distance(setting),
    )


def _worlds(
    obstacles: tuple[AnyObstacle, ...],
    zones: tuple[Zone, ...],
    costs: tuple[PlaceCost, ...],
    bodies: tuple[_Shapes, ...],
    frame: tuple[float, ...],
    heights: tuple[float, float] | None,
    *,
    keep: float,
) -> Worlds:
    """`heights` [m]: lowest and highest point of the vehicle within the bounds; None in a plane."""
    largest = max(bodies, key=lambda shapes: body_of(shapes).reach)

    def around(these: tuple[AnyObstacle, ...]) -> World:
        return world_of(these, largest, frame, keep=keep)

    bands = bands_of(obstacles, in_space=heights is not None)
    whole = around(obstacles)
    plane = whole if heights is None else around(always(obstacles, low=heights[0], high=heights[1]))
    plane = replace(plane, body=body_of(bodies[0]))
    solid = tuple(Obstacle(zone.shape) for zone in zones)
    dear = tuple(Obstacle(shape) for cost in costs for shape in extent_of(cost))
    between = tuple(around(band.obstacles) for band in bands)
    beside = tuple(around((one,)) for one in solid)
    high, flat = np.full(len(between) + len(beside), np.inf), None
    if heights is None:
        flat = layer_arrays([*between, *beside], low=-high, high=high, plane=plane)
    return Worlds(
        whole=whole,
        plane=plane,
        bands=bands,
        between=between,
        zones=beside,
        outer=around((*obstacles, *solid, *dear)) if solid or dear else whole,
        flat=flat,
    )


def pad_around(world: World, radius: float) -> float:
    """How far [m] a window without bounds goes beyond all that stands, and the ends."""
    return 4.0 * radius + 4.0 * world.body.reach


def window_of(
    bounds: Bounds, world: World, poses: Array, *, radius: float
) -> tuple[Array, Array, bool]:
    """The window to search: the bounds, and where there are none, a box around everything.

    A box (4,) in the world's frame, a window as in `_kernels_coast.inside_window`, and whether
    the window's rim is a wall on every side. `poses` (n, 3 or more) lie inside.
    """
    pad = pad_around(world, radius)
    walled = bounds.x is not None and bounds.y is not None
    # Plain numbers: arrays of two take longer than a first plan may.
    low_x, low_y, high_x, high_y = [0.0] * 4 if walled else world.box.tolist()
    xs, ys = poses[:, 0].tolist(), poses[:, 1].tolist()
    low_x, low_y = min(low_x, *xs) - pad, min(low_y, *ys) - pad
    high_x, high_y = max(high_x, *xs) + pad, max(high_y, *ys) + pad
    if bounds.x is None and bounds.y is None:
        window = np.array([low_x, low_y, high_x, high_y, 0.0, 0.0, 1.0, 0.0, 0.0])
        return window[:4], window, False
    turn = float(world.frame[2])
    c, s = math.cos(turn), math.sin(turn)
    corners = np.array([[low_x, low_y], [high_x, low_y], [high_x, high_y], [low_x, high_y]])
    seen = corners @ np.array([[c, s], [-s, c]])  # along the axes of the problem
    low, high = seen.min(axis=0), seen.max(axis=0)
    for axis, pair in enumerate((bounds.x, bounds.y)):
        if pair is not None:
            low[axis], high[axis] = pair[0] - world.frame[axis], pair[1] - world.frame[axis]
    slack = 1e-9 * (1.0 + float(np.abs(np.append(low, high)).max()))
    window = np.array([low[0], low[1], high[0], high[1], 0.0, 0.0, c, s, slack])
    inner = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    back = np.asarray(SE2(np.array([0.0, 0.0, -turn])).act(inner))
    # What lies on a bound is inside of it, wherever its place is rounded to.
    box = np.concatenate([back.min(axis=0) - slack, back.max(axis=0) + slack])
    return box, window, walled


def scene_of(
    problem: Problem,
    library: LatticeLibrary,
    worlds: Worlds,
    window: Array,
    box: Array,
    *,
    margin: float,
    level: float,
) -> Scene:
    """The scene of a problem inside a window (9,), seen from an altitude `level` [m].

    `box` (4,) is that of the window in the world's frame.
    `margin` is the clearance that a proof needs beyond the problem's own [m].
    """
    admitted = _admitted(library, problem.setting)
    edge_window = window.copy()
    edge_window[8] -= library.worst_error
    heights = problem.bounds.z if problem.start.size > 3 else None
    lowest, highest = heights or (-math.inf, math.inf)
    return Scene(
        layers=_layers(problem, worlds, problem.margin + margin + ROUNDED, level),
        keep=float(problem.margin),
        margin=float(margin),
        far=float(worlds.whole.arrays.field.outside),
        window=window,
        edge_window=edge_window,
        lowest=lowest - level - ROUNDED,
        highest=highest - level + ROUNDED,
        zone_trims=admitted[0],
        zone_pieces=admitted[1],
        place=place_arrays(problem, library, worlds.whole.frame, box),
    )


@kept_by_first
def _admitted(
    library: LatticeLibrary, setting: Problem
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which trims, and which pieces of maneuvers, each zone of a problem admits."""
    trims = [library.priced.automaton.trims[k] for k in library.trims] if setting.zones else []
    rows = [[piece_is_admitted(zone, trim) for trim in trims] for zone in setting.zones]
    admitted = np.array(rows, dtype=np.bool_).reshape(len(setting.zones), len(library.trims))
    return admitted, _admitted_pieces(setting, library)


def for_library(scene: Scene, problem: Problem, library: LatticeLibrary) -> Scene:
    """A scene for another library of the same trims."""
    edge_window = scene.window.copy()
    edge_window[8] -= library.worst_error
    zone_pieces = _admitted(library, problem.setting)[1]
    return scene._replace(edge_window=edge_window, zone_pieces=zone_pieces)


def _layers(problem: Problem, worlds: Worlds, pad: float, level: float) -> LayerArrays:
    """The obstacles between neighbouring heights, then the zones, as the kernels see them."""
    if worlds.flat is not None:
        return worlds.flat
    below, above = problem.body_height
    low = [band.low - above - pad - level for band in worlds.bands]
    high = [band.high - below + pad - level for band in worlds.bands]
    everywhere = [math.inf] * len(worlds.zones)
    return layer_arrays(
        [*worlds.between, *worlds.zones],
        low=np.append(np.round(low, DIGITS), np.negative(everywhere)),
        high=np.append(np.round(high, DIGITS), everywhere),
        plane=worlds.plane,
    )


def _admitted_pieces(problem: Problem, library: LatticeLibrary) -> NDArray[np.bool_]:
    """Which pieces of the motion of each part along edges each zone admits, (Z, N)."""
    automaton, spans = library.priced.automaton, library.spans
    first, n_parts = library.arrays.pieces.first, library.arrays.parts.n
    n_edges = len(library.arrays.edges.maneuver)
    admitted = np.zeros((len(problem.zones), len(spans)), dtype=np.bool_)
    for z, zone in enumerate(problem.zones):
        for edge, k in enumerate(library.arrays.edges.maneuver.tolist()):
            maneuver = automaton.maneuvers[k]
            if maneuver.course is None:
                continue
            good = admitted_stretches(zone, maneuver, automaton.model)
            for group in range(edge, n_parts * n_edges, n_edges):  # one of every part
                for n in range(first[group], first[group + 1]):
                    admitted[z, n] = good[spans[n, 0] : spans[n, 1]].all()
    return admitted


def piece_is_admitted(zone: Zone, trim: Trim) -> bool:
    """Whether a zone admits a trim."""
    return zone.admits_names([trim.name]) and bool(zone.admits(trim.body_velocity))


def admitted_stretches(zone: Zone, maneuver: Maneuver, model: Model) -> NDArray[np.bool_]:
    """Which stretches (n - 1,) of a maneuver a zone admits, by their begin, middle and end."""
    course = maneuver.course
    assert course is not None
    if not zone.admits_names([maneuver.source, maneuver.target]):
        return np.zeros(course.time.size - 1, dtype=np.bool_)
    return np.asarray(zone.admits(course.twists(model)).all(axis=0))

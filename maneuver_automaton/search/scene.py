"""The scene that motions of a search are tested against: obstacles, zones, and the window."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array
from maneuver_automaton._kept import kept_by_first
from maneuver_automaton.collision import Zone
from maneuver_automaton.collision.convex import DIGITS
from maneuver_automaton.collision.layers import ROUNDED, LayerArrays, layer_arrays
from maneuver_automaton.models import Model
from maneuver_automaton.primitives import Maneuver, Trim
from maneuver_automaton.problem import Problem
from maneuver_automaton.search.lattice_arrays import LatticeLibrary
from maneuver_automaton.search.lattice_worlds import Worlds


class Scene(NamedTuple):
    """Where a motion is free, as the kernels see it."""

    layers: LayerArrays  # a planar world for every range of altitudes, then one for every zone
    keep: float  # [m] distance kept from obstacles ...
    margin: float  # [m] ... and the clearance beyond it that a proof needs
    far: float  # [m] clearance where no obstacle is near
    window: Array  # (9,) as in `_kernels_window.inside_window`
    edge_window: Array  # (9,) narrower by the deviation of the courses of maneuvers
    lowest: float  # [m] altitudes within the bounds
    highest: float
    zone_trims: NDArray[np.bool_]  # (Z, m) trims that a zone admits
    zone_pieces: NDArray[np.bool_]  # (Z, N) pieces of maneuvers that a zone admits


def scene_of(
    problem: Problem,
    library: LatticeLibrary,
    worlds: Worlds,
    window: Array,
    *,
    margin: float,
    level: float,
) -> Scene:
    """The scene of a problem inside a window (9,), seen from an altitude `level` [m].

    `margin` is the clearance that a proof needs beyond the problem's own [m].
    """
    admitted = _admitted(library, problem.setting)
    edge_window = window.copy()
    edge_window[8] -= library.worst_error
    lowest, highest = -math.inf, math.inf
    if problem.bounds.z is not None and problem.start.size > 3:
        lowest, highest = problem.bounds.z
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
    return scene._replace(
        edge_window=edge_window, zone_pieces=_admitted(library, problem.setting)[1]
    )


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
    first, n_parts = library.arrays.first_piece, library.arrays.n_parts
    n_edges = len(library.edge_maneuver)
    admitted = np.zeros((len(problem.zones), len(spans)), dtype=np.bool_)
    for z, zone in enumerate(problem.zones):
        for edge, k in enumerate(library.edge_maneuver.tolist()):
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

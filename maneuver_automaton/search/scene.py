"""What the motions of a search are tested against: obstacles, zones, and the window."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array
from maneuver_automaton.collision.layers import LayerArrays


class Scene(NamedTuple):
    """Where a motion is free, as the kernels see it."""

    layers: LayerArrays  # a planar world for every range of altitudes, then one for every zone
    keep: float  # [m] distance kept from obstacles ...
    margin: float  # [m] ... and the clearance beyond it that a proof needs
    far: float  # [m] clearance where no obstacle is near
    window: Array  # (9,) as in `_kernels_motion.inside_window`
    edge_window: Array  # (9,) narrower by what the courses of maneuvers may be off
    lowest: float  # [m] altitudes within the bounds
    highest: float
    zone_trims: NDArray[np.bool_]  # (Z, m) trims that a zone admits
    zone_pieces: NDArray[np.bool_]  # (Z, N) pieces of maneuvers that a zone admits


def planar_scene(
    layers: LayerArrays, window: Array, *, keep: float, margin: float, n_trims: int
) -> Scene:
    """The scene of a vehicle in the plane, without zones."""
    return Scene(
        layers=layers,
        keep=float(keep),
        margin=float(margin),
        far=float(layers.first.field.outside),
        window=window,
        edge_window=window,
        lowest=-math.inf,
        highest=math.inf,
        zone_trims=np.zeros((0, n_trims), dtype=np.bool_),
        zone_pieces=np.zeros((0, 0), dtype=np.bool_),
    )

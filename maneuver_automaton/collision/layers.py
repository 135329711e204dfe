"""Worlds one above the other: obstacles between two heights, as a world in the plane each."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from itertools import chain, pairwise
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.collision import _kernels_field
from maneuver_automaton.collision.arrays import Field, MovingObstacles, WorldArrays
from maneuver_automaton.collision.convex import Solids
from maneuver_automaton.collision.shapes import AnyObstacle, Obstacle
from maneuver_automaton.collision.world import NO_SLABS, World

MOST_LAYERS = 24  # more are joined, the thinnest first
ROUNDED = 1e-8  # [m] by which heights may be off
OF_EACH = ("time", "pose", "speed", "middle", "reach", "present", "rate", "arcs")  # what moves


class LayerArrays(NamedTuple):
    """Arrays of all layers for the kernels; a body meets the layers in which its altitude is."""

    low: Array  # (L,) [m] altitudes of a pose
    high: Array  # (L,)
    first: WorldArrays  # the first layer, all there is in the plane
    solids: Solids  # of all layers
    start: IntArray  # (L, cells + 1) buckets
    items: IntArray
    sizes: Array  # (L, 10) numbers of buckets, field and slabs, as `layer_world` has them
    counts: IntArray  # (L, 4)
    distance: Array  # (L, rows, columns)
    moving: MovingObstacles
    first_moving: IntArray  # (L + 1,)
    plane: Field  # of what blocks every altitude
    flat: bool  # whether heights do not matter


def bands_of(obstacles: tuple[AnyObstacle, ...], *, in_space: bool) -> tuple[Layer, ...]:
    """All obstacles that stand anywhere between neighbouring heights; no band without any."""
    layers = layers_of(obstacles, in_space=in_space)
    heights = {height for layer in layers for height in (layer.low, layer.high)}
    bands, kept = (list[Layer](), sorted(heights)) if in_space else ([*layers], [])
    while len(kept) - 1 > MOST_LAYERS:  # the thinnest band joins its lower neighbour
        thinnest = int(np.argmin(np.diff(kept)))
        del kept[max(thinnest, 1)]
    for low, high in pairwise(kept):
        within = (layer.numbers for layer in layers if layer.low < high and layer.high > low)
        if numbers := sorted(chain.from_iterable(within)):
            standing = tuple(obstacles[k] for k in numbers)
            bands.append(Layer(low, high, standing, tuple(numbers)))
    return tuple(bands) or (Layer(-math.inf, math.inf, (), ()),)


def always(
    obstacles: tuple[AnyObstacle, ...], *, low: float, high: float
) -> tuple[AnyObstacle, ...]:
    """Obstacles at every height between two, so that no path leads over or under them."""
    layers = layers_of(obstacles, in_space=True)
    lasting = (layer.numbers for layer in layers if layer.low <= low and layer.high >= high)
    return tuple(obstacles[number] for number in sorted(chain.from_iterable(lasting)))


def layer_arrays(worlds: Sequence[World], *, low: Array, high: Array, plane: World) -> LayerArrays:
    """Worlds as the kernels see them, each for poses between the altitudes `low` and `high`."""
    arrays = [world.arrays for world in worlds]
    if len(worlds) == 1:
        return single_layer(worlds[0])._replace(
            low=np.array(low, dtype=np.float64),
            high=np.array(high, dtype=np.float64),
            plane=plane.arrays.field,
            flat=bool(np.isinf(low).all() and np.isinf(high).all()),
        )
    pairs = [(one.solids, one.moving.solids) for one in arrays]
    solids, of_static, of_moving = _concatenated(pairs)
    shapes = np.array([one.field.distance.shape for one in arrays])
    distance = np.zeros((len(arrays), *shapes.max(axis=0)))
    most = max(len(one.buckets.start) for one in arrays)
    start = np.zeros((len(arrays), most), dtype=np.int64)
    items: list[IntArray] = []
    for k, one in enumerate(arrays):
        rows, columns = shapes[k]
        distance[k] = one.field.outside
        _kernels_field.write_all(one.field)
        distance[k, :rows, :columns] = one.field.distance
        known = len(one.buckets.start)
        offset = sum(len(part) for part in items)
        start[k, :known] = one.buckets.start + offset
        start[k, known:] = start[k, known - 1]
        items.append(one.buckets.items + of_static[k])
    boxes = np.cumsum([0, *(len(one.moving.slabs.box) for one in arrays)]).tolist()
    sizes, counts = zip(*map(_numbers, arrays, boxes[:-1]), strict=True)
    return LayerArrays(
        low=np.array(low, dtype=np.float64),
        high=np.array(high, dtype=np.float64),
        first=arrays[0],
        solids=solids,
        start=start,
        items=np.concatenate(items),
        sizes=np.array(sizes, dtype=np.float64),
        counts=np.array(counts, dtype=np.int64),
        distance=distance,
        moving=_all_moving([one.moving for one in arrays], solids, of_moving),
        first_moving=np.cumsum([0, *(len(one.moving.speed) for one in arrays)]),
        plane=plane.arrays.field,
        flat=bool(np.isinf(low).all() and np.isinf(high).all()),
    )


def single_layer(world: World) -> LayerArrays:
    """One world at all altitudes: kernels take it as it is, so that nothing is copied."""
    only = world.arrays
    buckets, field = only.buckets, only.field
    sizes, counts = _numbers(only, 0)
    everywhere = np.full(1, math.inf)
    return LayerArrays(
        low=-everywhere,
        high=everywhere,
        first=only,
        solids=only.solids,
        start=buckets.start[None],
        items=buckets.items,
        sizes=np.array([sizes], dtype=np.float64),
        counts=np.array([counts], dtype=np.int64),
        distance=field.distance[None],
        moving=only.moving,
        first_moving=np.array([0, len(only.moving.speed)]),
        plane=field,
        flat=True,
    )


def _numbers(one: WorldArrays, first_box: int) -> tuple[tuple[float, ...], tuple[int, ...]]:
    """Sizes (10,) and counts (4,) of a layer, whose boxes of slabs begin at a row."""
    buckets, field, slabs = one.buckets, one.field, one.moving.slabs
    return (
        *(buckets.origin_x, buckets.origin_y, buckets.cell, buckets.reach),
        *(field.origin_x, field.origin_y, field.cell, field.outside),
        *(slabs.begin, slabs.width),
    ), (buckets.columns, buckets.rows, slabs.leaves, first_box)


def _concatenated(pairs: Sequence[tuple[Solids, Solids]]) -> tuple[Solids, list[int], list[int]]:
    """All solids as one, and with which piece those of each pair begin."""
    edges, plates, firsts = [], [], [np.zeros(1, dtype=np.int64)]
    begins: tuple[list[int], list[int]] = ([], [])
    n_edges = n_pieces = 0
    for pair in pairs:
        for solids, begin in zip(pair, begins, strict=True):
            begin.append(n_pieces)
            edges.append(solids.edges)
            plates.append(solids.plates)
            firsts.append(solids.first[1:] + n_edges)
            n_edges += len(solids.edges)
            n_pieces += len(solids.plates)
    return (Solids(np.concatenate(edges), np.concatenate(firsts), np.concatenate(plates)), *begins)


def _all_moving(
    moving: Sequence[MovingObstacles], solids: Solids, begins: Sequence[int]
) -> MovingObstacles:
    """Moving obstacles, layer by layer, its pieces and knots among those of all layers."""
    knots = np.cumsum([0, *(len(one.time) for one in moving)]).tolist()
    return MovingObstacles(
        solids=solids,
        first_piece=_offset([one.first_piece for one in moving], begins),
        first_knot=_offset([one.first_knot for one in moving], knots[:-1]),
        slabs=NO_SLABS._replace(box=np.concatenate([one.slabs.box for one in moving])),
        **{name: np.concatenate([getattr(one, name) for one in moving]) for name in OF_EACH},
    )


def _offset(firsts: Sequence[IntArray], offsets: Sequence[int]) -> IntArray:
    """Ranges of all layers in one list, for a slice of it to end where its layer does."""
    rows = [first + offset for first, offset in zip(firsts, offsets, strict=True)]
    return np.concatenate([*(row[:-1] for row in rows), rows[-1][-1:]])


class Layer(NamedTuple):
    """Obstacles that stand between the same heights [m]; infinite ones block every altitude."""

    low: float
    high: float
    obstacles: tuple[AnyObstacle, ...]
    numbers: tuple[int, ...]  # where they are among all obstacles

    def clearance(self, altitude: Array, body: tuple[float, float]) -> Array:
        """Vertical clearance (n,) [m] to a body reaching from low to high about its altitude."""
        above = altitude + body[0] - self.high
        below = self.low - (altitude + body[1])
        return np.maximum(np.maximum(above, below), 0.0)


@functools.lru_cache(maxsize=16)
def layers_of(obstacles: tuple[AnyObstacle, ...], *, in_space: bool) -> tuple[Layer, ...]:
    """Obstacles by height; in the plane all of them are one layer that blocks every altitude."""
    if obstacles and not in_space:
        return (Layer(-math.inf, math.inf, obstacles, tuple(range(len(obstacles)))),)
    groups: dict[tuple[float, float], list[int]] = {}
    for k, obstacle in enumerate(obstacles):
        height = obstacle.height if isinstance(obstacle, Obstacle) else None
        groups.setdefault(height or (-np.inf, np.inf), []).append(k)
    return tuple(
        Layer(low, high, tuple(obstacles[k] for k in index), tuple(index))
        for (low, high), index in groups.items()
    )

"""One of several planar worlds that lie between heights."""

from __future__ import annotations

from maneuver_automaton._compile import bare_inner_kernel
from maneuver_automaton.collision.arrays import Buckets, Field, MovingObstacles, Slabs, WorldArrays
from maneuver_automaton.collision.convex import Solids
from maneuver_automaton.collision.layers import LayerArrays


@bare_inner_kernel
def layer_world(layers: LayerArrays, k: int) -> WorldArrays:
    """The planar world of layer `k`; the first is at hand, the others are cut out."""
    if k == 0:
        return layers.first
    m_0, m_1 = layers.first_moving[k], layers.first_moving[k + 1]
    sizes, counts = layers.sizes, layers.counts
    moving, solids = layers.moving, layers.solids
    whole = Solids(solids.edges, solids.first, solids.plates[:0])
    return WorldArrays(
        Solids(solids.edges, solids.first, solids.plates),
        Buckets(
            layers.start[k],
            layers.items,
            sizes[k, 0],
            sizes[k, 1],
            sizes[k, 2],
            counts[k, 0],
            counts[k, 1],
            sizes[k, 3],
        ),
        Field(layers.distance[k], sizes[k, 4], sizes[k, 5], sizes[k, 6], sizes[k, 7], whole),
        MovingObstacles(
            layers.solids,
            moving.first_piece[m_0 : m_1 + 1],
            moving.first_knot[m_0 : m_1 + 1],
            moving.time,
            moving.pose,
            moving.speed[m_0:m_1],
            moving.middle[m_0:m_1],
            moving.reach[m_0:m_1],
            moving.present[m_0:m_1],
            moving.rate,
            moving.arcs[m_0:m_1],
            Slabs(sizes[k, 8], sizes[k, 9], counts[k, 2], counts[k, 3], moving.slabs.box),
        ),
    )


@bare_inner_kernel
def times_between(
    altitude: float, climb: float, low: float, high: float, duration: float
) -> tuple[float, float]:
    """First and last time of a steady climb between two heights; the last is less for never."""
    if climb == 0.0:
        return 0.0, duration if low <= altitude <= high else -1.0
    first, last = (low - altitude) / climb, (high - altitude) / climb
    if climb < 0.0:
        first, last = last, first
    return max(first, 0.0), min(last, duration)

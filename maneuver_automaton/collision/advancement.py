"""The proof along a trim, for callers outside the search: how long a motion is free."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.collision import _kernels_advancement, _kernels_swept
from maneuver_automaton.collision.arrays import SweptAreas
from maneuver_automaton.collision.body import Body, fastest_points
from maneuver_automaton.collision.world import World


def free_times(
    world: World,
    poses: ArrayLike,
    *,
    twists: ArrayLike,
    durations: ArrayLike,
    margin: float,
    keep: float = 0.0,
    times: ArrayLike = 0.0,
) -> Array:
    """How long motions are proven free, at most as long as they last.

    `poses`: where the motions begin, seen from the world's frame [m, m, rad]. `twists`: constant
    body velocities [m/s, m/s, rad/s]. `durations`: [s]; a negative one is driven backwards, into
    the past. `margin`: clearance beyond `keep` that every pose looked at has, positive [m]. `keep`:
    distance kept from everything, also between the poses looked at [m]. `times`: time of the world
    at the beginning [s]. Returns [s]; 0 where the motion begins too near to something.
    """
    if not margin > 0.0:
        raise ValueError(f"margin must be positive, got {margin} m")
    starts = np.atleast_2d(as_array("poses", poses, last=3))
    velocities = np.atleast_2d(as_array("twists", twists, last=3))
    n = len(starts)
    lasting = np.broadcast_to(as_array("durations", durations), n)
    clocks = np.broadcast_to(as_array("times", times), n)
    fastest = fastest_points(world.body, velocities)
    motions = np.column_stack([starts, velocities, fastest, lasting, clocks])
    free: Array = _kernels_advancement.free_times(
        world.arrays, world.body, np.ascontiguousarray(motions), keep, margin
    )
    return free


def clearances(world: World, poses: ArrayLike, *, times: ArrayLike = 0.0) -> Array:
    """Clearance (k,) at poses (k, 3) seen from the world's frame: a lower bound [m].

    Exact near contact, and capped where nothing is near; not positive only on contact.
    """
    places = np.atleast_2d(as_array("poses", poses, last=3))
    clocks = np.zeros(len(places))
    if world.arrays.moving.speed.size:
        clocks += as_array("times", times)
    found: Array = _kernels_advancement.clearances(
        world.arrays, world.body, np.array(places), clocks
    )
    return found


def swept_areas(body: Body, twists: Array, durations: Array) -> SweptAreas:
    """What a body covers while it moves by each twist for each duration.

    `twists`: body velocities [m/s, m/s, rad/s]. `durations`: how long each motion lasts [s]; a
    negative one is driven backwards. Motion ``j k + q`` is that of twist j for duration q.
    The radius is inf, so that nothing is ever concluded, where a motion turns by more than a
    quarter of a turn.
    """
    return SweptAreas(
        *_kernels_swept.sweep(
            body.edges,
            body.first,
            body.radius,
            np.ascontiguousarray(twists[:, :3]),
            np.ascontiguousarray(durations),
        )
    )

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

    Parameters
    ----------
    world : World
    poses : (k, 3) array
        Where the motions begin, seen from the world's frame [m, m, rad].
    twists : (k, 3) array
        Constant body velocities [m/s, m/s, rad/s].
    durations : (k,) array
        [s]; a negative one is driven backwards, into the past.
    margin : float
        Clearance beyond `keep` that every pose looked at has, positive [m].
    keep : float
        Distance kept from everything, also between the poses looked at [m].
    times : (k,) array
        Time of the world at the beginning [s].

    Returns
    -------
    (k,) array
        [s]; 0 where the motion begins too near to something.

    Raises
    ------
    ValueError
        If the margin is not positive.

    Examples
    --------
    >>> from maneuver_automaton.collision import Box, Disc, Obstacle
    >>> from maneuver_automaton.collision.world import world_of
    >>> wall = Obstacle(Box([1.0, 4.0], [5.5, 0.0]))
    >>> world = world_of((wall,), (Disc(1.0),), (0.0, 0.0, 0.0))
    >>> ahead = {"twists": [[2.0, 0.0, 0.0]], "margin": 0.01}
    >>> free = free_times(world, [[0, 0, 0]], durations=[5.0], **ahead)
    >>> bool(1.9 < free[0] <= 2.0)
    True
    """
    if not margin > 0.0:
        raise ValueError(f"margin must be positive, got {margin} m")
    starts = np.atleast_2d(as_array("poses", poses, last=3))
    velocities = np.atleast_2d(as_array("twists", twists, last=3))
    n = len(starts)
    lasting = np.array(np.broadcast_to(as_array("durations", durations), n))
    clocks = np.array(np.broadcast_to(as_array("times", times), n))
    free: Array = _kernels_advancement.free_times(
        world.arrays,
        world.body,
        np.array(starts),
        np.array(velocities),
        fastest_points(world.body, velocities),
        lasting,
        keep,
        margin,
        clocks,
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

    Parameters
    ----------
    body : Body
    twists : (m, 3 or more) array
        Body velocities [m/s, m/s, rad/s].
    durations : (m, k) array
        How long each motion lasts [s]; a negative one is driven backwards.

    Returns
    -------
    SweptAreas
        Motion ``j k + q`` is that of twist j for duration q. The radius is inf, so that nothing is
        ever concluded, where a motion turns by more than a quarter of a turn.

    Examples
    --------
    >>> from maneuver_automaton.collision import Box
    >>> from maneuver_automaton.collision.body import body_of
    >>> ahead = np.array([[1.0, 0.0, 0.0]])
    >>> swept = swept_areas(body_of((Box([4.0, 2.0]),)), ahead, np.array([[3.0]]))
    >>> swept.edges[:, :2].tolist()
    [[-2.0, -1.0], [5.0, -1.0], [5.0, 1.0], [-2.0, 1.0]]
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

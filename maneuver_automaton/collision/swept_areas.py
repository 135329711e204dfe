"""What a body covers along short motions, in the frame where they begin: by symmetry, once for all.

For the exact solids of a finished plan see `swept`; these are for the proof along an edge.
"""

from __future__ import annotations

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.collision import _kernels_swept
from maneuver_automaton.collision.arrays import SweptAreas
from maneuver_automaton.collision.body import Body


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

"""How long one rigid part of a vehicle stays free, along a trim or along a piece of a maneuver.

A vehicle is one rigid part or several, each with its own offset and twist in every trim. A robot
in the plane is the case of one part. The proof is conservative advancement (`free_time`): what it
calls free is free between the poses that it looks at, too.
"""

from __future__ import annotations

from maneuver_automaton._arrays import Array
from maneuver_automaton._compile import bare_inner_kernel
from maneuver_automaton.collision._kernels_advancement import free_time
from maneuver_automaton.collision.arrays import WorldArrays
from maneuver_automaton.collision.body import Body
from maneuver_automaton.groups._kernels import coast, compose
from maneuver_automaton.search.lattice_arrays import LatticeArrays
from maneuver_automaton.search.part_motion import BodyArrays


@bare_inner_kernel
def part_body(bodies: BodyArrays, p: int) -> Body:
    """One rigid part of the vehicle, cut out of the arrays of all."""
    # The polygons of part p are those from `piece_of[p]` to `piece_of[p + 1]`, its discs those of
    # `disc_of`; `first` says where the edges of each polygon begin, and where the last ones end.
    return Body(
        bodies.edges,
        bodies.first[bodies.piece_of[p] : bodies.piece_of[p + 1] + 1],
        bodies.radius[bodies.piece_of[p] : bodies.piece_of[p + 1]],
        bodies.discs[bodies.disc_of[p] : bodies.disc_of[p + 1]],
        bodies.sizes[p, 0],
        bodies.sizes[p, 1],
        bodies.sizes[p, 2],
        bodies.sizes[p, 3],
        bodies.sizes[p, 4],
    )


@bare_inner_kernel
def part_free(
    world: WorldArrays,
    lib: LatticeArrays,
    p: int,
    start: tuple[float, float, float],
    twist: Array,
    speed: float,
    t: float,
    keep: float,
    margin: float,
    clock: float,
) -> tuple[float, float]:
    """How long part `p` is free along a constant twist from its pose `start`; the last clearance.

    No point of the part is faster than `speed`: the proof of `free_time` rests on that.
    """
    x, y, heading = start
    body = part_body(lib.bodies, p)
    v_x, v_y, turn = twist[0], twist[1], twist[2]
    return free_time(world, body, x, y, heading, v_x, v_y, turn, speed, t, keep, margin, clock)


@bare_inner_kernel
def part_coast(
    world: WorldArrays,
    lib: LatticeArrays,
    p: int,
    trim: int,
    place: tuple[float, float, float],
    begin: float,
    t: float,
    keep: float,
    margin: float,
    clock: float,
) -> tuple[float, float]:
    """How long part `p` is free while the vehicle, at `place`, coasts a trim; the last clearance.

    The stretch that is looked at begins `begin` seconds after `place` and lasts `t`; both are
    negative for a motion that is driven backwards in time.
    """
    x, y, heading = place
    offset, twist = lib.offsets[p, trim], lib.part_twists[p, trim]
    start = compose(x, y, heading, offset[0], offset[1], offset[2])
    if begin != 0.0:
        d_x, d_y, turn = coast(twist[0], twist[1], twist[2], begin)
        start = compose(start[0], start[1], start[2], d_x, d_y, turn)
    speed = lib.speeds[p, trim]
    return part_free(world, lib, p, start, twist, speed, t, keep, margin, clock + begin)


@bare_inner_kernel
def part_piece(
    world: WorldArrays,
    lib: LatticeArrays,
    p: int,
    k: int,
    place: tuple[float, float, float],
    keep: float,
    margin: float,
    clock: float,
) -> tuple[float, float]:
    """How long part `p` is free along piece `k` of a maneuver begun at `place`; the clearance."""
    x, y, heading = place
    pose, twist = lib.piece_pose[k], lib.piece_twist[k]
    start = compose(x, y, heading, pose[0], pose[1], pose[2])
    speed, t, error = lib.piece_speed[k], lib.piece_time[k], lib.piece_error[k]
    return part_free(world, lib, p, start, twist, speed, t, keep + error, margin, clock)

"""Whether a vehicle that coasts in a trim, or stands, stays free: part by part, layer by layer.

The world is one plane or several, one above the other. One body in one plane is the common case.
"""

from __future__ import annotations

import math

from maneuver_automaton._compile import bare_inner_kernel, inlined_kernel
from maneuver_automaton.collision._kernels_advancement import free_time
from maneuver_automaton.collision._kernels_layers import layer_world, times_between
from maneuver_automaton.collision._kernels_swept import UNKNOWN, not_parted
from maneuver_automaton.groups._kernels import coast, compose
from maneuver_automaton.search._kernels_parts import part_body, part_coast
from maneuver_automaton.search._kernels_window import inside_window
from maneuver_automaton.search.arrays import Task
from maneuver_automaton.search.lattice_arrays import LatticeArrays
from maneuver_automaton.search.scene import Scene
from maneuver_automaton.words._kernels_library import NO_TRIM


@inlined_kernel
def coast_proven(
    scene: Scene,
    lib: LatticeArrays,
    trim: int,
    pose: tuple[float, float, float, float],
    t: float,
    clock: float,
) -> tuple[float, float]:
    """How long coasting a trim from a pose (x, y, heading, z) is proven free; the last clearance.

    A negative `t` drives the motion backwards, and the world's clock too. The time that comes back
    has no sign. One body among obstacles in one plane has a line of its own: it is asked for at
    every edge, and to choose a part and a layer copies more than the proof takes.
    """
    if scene.layers.low.shape[0] == 1 and scene.layers.flat and lib.n_parts == 1:
        free, clearance = free_time(
            scene.layers.first,
            lib.body,
            pose[0],
            pose[1],
            pose[2],
            lib.library.twists[trim, 0],
            lib.library.twists[trim, 1],
            lib.library.twists[trim, 2],
            lib.fastest[trim],
            t,
            scene.keep,
            scene.margin,
            clock,
        )
    else:
        free, clearance = coast_proven_everywhere(scene, lib, trim, pose, t, clock)
    return free, clearance


@inlined_kernel
def edge_swept(
    scene: Scene, lib: LatticeArrays, motion: int, pose: tuple[float, float, float, float]
) -> int:
    """A solid that may be in the way of an edge of coasting, FREE for none, or UNKNOWN.

    `motion` is its place in `lib.swept`. FREE is a proof, and what it calls free `coast_proven`
    would too: no pose along the edge comes as near to a solid as it would stop at.
    """
    if not (scene.layers.low.shape[0] == 1 and scene.layers.flat and lib.n_parts == 1):
        return UNKNOWN
    c, s = math.cos(pose[2]), math.sin(pose[2])
    enough = scene.keep + scene.margin
    return not_parted(
        scene.layers.first, lib.body, lib.swept, motion, pose[0], pose[1], c, s, enough
    )


@inlined_kernel
def swept_end(
    lib: LatticeArrays, motion: int, pose: tuple[float, float, float, float]
) -> tuple[float, float]:
    """Cosine and sine of the heading at the end of an edge of coasting."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    turn_c, turn_s = lib.swept.places[motion, 3], lib.swept.places[motion, 4]
    return c * turn_c - s * turn_s, s * turn_c + c * turn_s


@bare_inner_kernel
def coast_proven_everywhere(
    scene: Scene,
    lib: LatticeArrays,
    trim: int,
    pose: tuple[float, float, float, float],
    t: float,
    clock: float,
) -> tuple[float, float]:
    """`coast_proven` for several parts, in every layer that the altitude passes, and among zones.

    A layer counts while the altitude is in it, so that a climb is no cylinder.
    """
    # `free` is how long all that was looked at is free: each part and layer is asked for no more,
    # so the least of them remains, and all of it is proven. `nearest` is the clearance at the end:
    # only layers that the vehicle is in there count.
    x, y, heading, z = pose
    sign = 1.0 if t >= 0.0 else -1.0
    length = abs(t)
    free, nearest = length, math.inf
    climb = sign * lib.library.twists[trim, 3]
    n_layers = scene.layers.low.shape[0] - scene.zone_trims.shape[0]
    for k in range(n_layers):
        begin, end = times_between(z, climb, scene.layers.low[k], scene.layers.high[k], length)
        if end < begin or begin > free:
            continue  # never in this layer, or only after the motion is blocked
        world = layer_world(scene.layers, k)
        for p in range(lib.n_parts):
            span = min(end, free) - begin
            proven, clearance = part_coast(
                world,
                lib,
                p,
                trim,
                (x, y, heading),
                sign * begin,
                sign * span,
                scene.keep,
                scene.margin,
                clock,
            )
            if proven < span:
                free = begin + proven
            elif end == length:
                nearest = min(nearest, clearance)
    for k in range(scene.zone_trims.shape[0]):
        if scene.zone_trims[k, trim]:
            continue
        # The body keeps out of zones that do not admit the trim. Their distance is not part of the
        # clearance, since the next motion may be admitted.
        world = layer_world(scene.layers, n_layers + k)
        for p in range(lib.n_parts):
            span, place = free, (x, y, heading)
            free, _ = part_coast(
                world, lib, p, trim, place, 0.0, sign * span, 0.0, scene.margin, clock
            )
    return free, nearest if nearest < math.inf else scene.far


@inlined_kernel
def coast_inside(
    scene: Scene, lib: LatticeArrays, trim: int, pose: tuple[float, float, float, float], t: float
) -> bool:
    """Whether coasting a trim stays inside the window."""
    end = pose[3] + t * lib.library.twists[trim, 3]
    inside = min(pose[3], end) >= scene.lowest and max(pose[3], end) <= scene.highest
    return inside and inside_window(
        scene.window,
        pose[0],
        pose[1],
        pose[2],
        lib.library.twists[trim, 0],
        lib.library.twists[trim, 1],
        lib.library.twists[trim, 2],
        t,
    )


@inlined_kernel
def coasted(
    lib: LatticeArrays, trim: int, pose: tuple[float, float, float, float], t: float
) -> tuple[float, float, float, float]:
    """Pose (x, y, heading, z) after coasting a trim."""
    d_x, d_y, turn = coast(
        lib.library.twists[trim, 0], lib.library.twists[trim, 1], lib.library.twists[trim, 2], t
    )
    x, y, heading = compose(pose[0], pose[1], pose[2], d_x, d_y, turn)
    return x, y, heading, pose[3] + t * lib.library.twists[trim, 3]


@inlined_kernel
def coast_free(
    scene: Scene,
    lib: LatticeArrays,
    trim: int,
    pose: tuple[float, float, float, float],
    t: float,
    clock: float,
) -> bool:
    """Whether coasting a trim from a pose for `t` is proven free; the world's time is `clock`."""
    free, _ = coast_proven(scene, lib, trim, pose, t, clock)
    return free >= t


@bare_inner_kernel
def may_stay(
    scene: Scene,
    lib: LatticeArrays,
    trim: int,
    pose: tuple[float, float, float, float],
    clock: float,
    until: float,
) -> bool:
    """Whether a vehicle that stands as in `trim` from `clock` on is free until a time."""
    # Static obstacles were proven clear along the motion that ends here; without moving obstacles
    # that holds for good.
    n_moving = scene.layers.moving.speed.shape[0]
    if not until > clock or n_moving == 0:
        return True
    x, y, heading, z = pose
    for k in range(scene.layers.low.shape[0] - scene.zone_trims.shape[0]):
        if z < scene.layers.low[k] or z > scene.layers.high[k]:
            continue
        world = layer_world(scene.layers, k)
        for p in range(lib.n_parts):
            at = lib.offsets[p, trim]
            p_x, p_y, p_heading = compose(x, y, heading, at[0], at[1], at[2])
            body, t = part_body(lib.bodies, p), until - clock
            keep, margin = scene.keep, scene.margin
            proven, _ = free_time(
                world, body, p_x, p_y, p_heading, 0.0, 0.0, 0.0, 0.0, t, keep, margin, clock
            )
            if proven < t:
                return False
    return True


@inlined_kernel
def is_still(lib: LatticeArrays, trim: int) -> bool:
    """Whether a trim stands still; a rest may be as short as it likes."""
    twist = lib.library.twists[trim]
    return not (twist[0] != 0.0 or twist[1] != 0.0 or twist[2] != 0.0 or twist[3] != 0.0)


@inlined_kernel
def too_short(task: Task, lib: LatticeArrays, trim: int, run: float) -> bool:
    """Whether a trim that moves has begun, and does not yet last as long as it must."""
    return trim != NO_TRIM and 0.0 < run < task.least_coast and not is_still(lib, trim)

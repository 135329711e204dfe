"""Whether a vehicle that coasts in a trim, or stands, stays free: part by part, layer by layer.

The world is one plane or several, one above the other. One body in one plane is the common case. A
vehicle is one rigid part or several, each with its own offset and twist in every trim. The proof is
conservative advancement (`free_time`): what it calls free is free between the poses that it looks
at, too.
"""

from __future__ import annotations

import math

from maneuver_automaton._arrays import Array
from maneuver_automaton._compile import bare_inner_kernel, bare_shared_kernel
from maneuver_automaton.collision._kernels_advancement import free_of_static, free_time
from maneuver_automaton.collision._kernels_clearance import field_look
from maneuver_automaton.collision._kernels_layers import layer_world, times_between
from maneuver_automaton.collision._kernels_swept import not_parted
from maneuver_automaton.collision.arrays import Coast, Place, WorldArrays
from maneuver_automaton.collision.body import Body
from maneuver_automaton.groups._kernels import coast, compose
from maneuver_automaton.search.arrays import BodyArrays, LatticeArrays, Scene
from maneuver_automaton.words._kernels_library import NO_TRIM

LOOKS = 40  # poses of a coast that are looked at, at most


@bare_inner_kernel
def inside_window(
    window: Array, x: float, y: float, heading: float, twist: Array, t: float
) -> bool:
    """Whether a motion stays inside a window (9,) as the bounds' frame sees it."""
    # The window is [low x, low y, high x, high y], the frame's (x, y, cos, sin) that take a pose of
    # the world to it, and what the pose may be outside [m].
    # a is the pose where the motion begins, seen from the frame, e the one where it ends. The box
    # [low, high] holds both, and grows by the extreme points of the arc between them.
    v_x, v_y, turn = twist[0], twist[1], twist[2]
    c, s = window[6], window[7]
    d_x, d_y = x - window[4], y - window[5]
    a_x, a_y = c * d_x - s * d_y, s * d_x + c * d_y
    # Most motions are too short to reach a side.
    reach = math.sqrt(v_x * v_x + v_y * v_y) * abs(t)
    if (
        a_x - reach > window[0]
        and a_y - reach > window[1]
        and a_x + reach < window[2]
        and a_y + reach < window[3]
    ):
        return True
    a_heading = heading + math.atan2(s, c)
    m_x, m_y, angle = coast(v_x, v_y, turn, t)
    e_x, e_y, _ = compose(a_x, a_y, a_heading, m_x, m_y, angle)
    low_x, high_x = min(a_x, e_x), max(a_x, e_x)
    low_y, high_y = min(a_y, e_y), max(a_y, e_y)
    if turn != 0.0:
        radius_x, radius_y = -v_y / turn, v_x / turn  # from the pose to the centre of the circle
        cos, sin = math.cos(a_heading), math.sin(a_heading)
        m_x = a_x + cos * radius_x - sin * radius_y
        m_y = a_y + sin * radius_x + cos * radius_y
        radius = math.sqrt(radius_x * radius_x + radius_y * radius_y)
        # (m_x, m_y) is the centre. The proof: along an axis an arc is extreme at its ends or at a
        # multiple of a quarter turn, and four of these in a row are all there are.
        begin = math.atan2(a_y - m_y, a_x - m_x)
        end = begin + angle
        first, last = min(begin, end), max(begin, end)
        quarter = 0.5 * math.pi
        k = math.ceil(first / quarter)
        while k * quarter <= last and k <= math.ceil(first / quarter) + 4:
            side = k % 4
            if side == 0:
                high_x = max(high_x, m_x + radius)
            elif side == 1:
                high_y = max(high_y, m_y + radius)
            elif side == 2:
                low_x = min(low_x, m_x - radius)
            else:
                low_y = min(low_y, m_y - radius)
            k += 1
    slack = window[8]
    return (
        low_x >= window[0] - slack
        and low_y >= window[1] - slack
        and high_x <= window[2] + slack
        and high_y <= window[3] + slack
    )


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
    body: Body,
    place: tuple[float, float, float],
    offset: Array,
    motion: tuple[Array, float, float, float],
    asked: tuple[float, float, float],
) -> tuple[float, float]:
    """How long a part with an `offset` on a vehicle at `place` is free; the last clearance."""
    # `motion`: constant twist, speed of the part's fastest point, on which the proof rests, begin
    # after the vehicle was at `place`, and duration [s]; both negative for one driven backwards in
    # time. `asked`: distance to keep, clearance beyond it that a proof needs, the world's time at
    # `place`.
    twist, speed, begin, t = motion
    keep, margin, clock = asked
    v_x, v_y, turn = twist[0], twist[1], twist[2]
    x, y, heading = compose(place[0], place[1], place[2], offset[0], offset[1], offset[2])
    if begin != 0.0:
        d_x, d_y, angle = coast(v_x, v_y, turn, begin)
        x, y, heading = compose(x, y, heading, d_x, d_y, angle)
    whole = Coast(x, y, heading, v_x, v_y, turn, speed, t, clock + begin)
    return free_time(world, body, whole, keep, margin)


@bare_inner_kernel
def is_one_in_plane(scene: Scene, lib: LatticeArrays) -> bool:
    """Whether one body moves among obstacles in one plane, without zones."""
    return scene.layers.low.shape[0] == 1 and scene.layers.flat and lib.parts.n == 1


@bare_inner_kernel
def coast_proven(
    scene: Scene,
    lib: LatticeArrays,
    trim: int,
    pose: tuple[float, float, float, float],
    t: float,
    clock: float,
) -> tuple[float, float]:
    """How long coasting from a pose (x, y, heading, z) is proven free; the last clearance."""
    # A negative `t` drives the motion backwards, and the world's clock too; what comes back has no
    # sign. One body among obstacles in one plane has a line of its own: it is asked for at every
    # edge, and to choose a part and a layer copies more than the proof takes.
    if is_one_in_plane(scene, lib):
        twist, fastest = lib.library.twists[trim], lib.parts.fastest[trim]
        x, y, heading, _ = pose
        motion = Coast(x, y, heading, twist[0], twist[1], twist[2], fastest, t, clock)
        world = scene.layers.first
        free, clearance = free_time(world, lib.parts.body, motion, scene.keep, scene.margin)
    else:
        free, clearance = coast_proven_everywhere(scene, lib, trim, pose, t, clock)
    return free, clearance


@bare_inner_kernel
def edge_swept(scene: Scene, lib: LatticeArrays, motion: int, place: Place) -> int:
    """A solid that may be in the way of an edge of coasting, FREE for none, or UNKNOWN."""
    # `motion`: place in `lib.coasts.swept`. Asked of one body in one plane. FREE is a proof, and
    # what it calls free `coast_proven` would too: no pose along the edge comes as near to a solid
    # as it would stop at.
    swept, enough = lib.coasts.swept, scene.keep + scene.margin
    return not_parted(scene.layers.first, lib.parts.body, swept, motion, place, enough)


@bare_inner_kernel
def swept_end(
    lib: LatticeArrays, motion: int, place: Place, end: tuple[float, float, float, float]
) -> Place:
    """The end of an edge of coasting from a place, without a cosine and a sine of its own."""
    _, _, c, s = place
    places = lib.coasts.swept.places
    turn_c, turn_s = places[motion, 3], places[motion, 4]
    return Place(end[0], end[1], c * turn_c - s * turn_s, s * turn_c + c * turn_s)


@bare_shared_kernel
def coast_proven_everywhere(
    scene: Scene,
    lib: LatticeArrays,
    trim: int,
    pose: tuple[float, float, float, float],
    t: float,
    clock: float,
) -> tuple[float, float]:
    """`coast_proven` for several parts, in every layer that the altitude passes, among zones."""
    # A layer counts while the altitude is in it, so that a climb is no cylinder.
    # `free` is how long all that was looked at is free: each part and layer is asked for no more,
    # so the least of them remains, and all of it is proven. `nearest` is the clearance at the end:
    # only layers that the vehicle is in there count.
    x, y, heading, z = pose
    place = (x, y, heading)
    parts, sign = lib.parts, 1.0 if t >= 0.0 else -1.0
    length = abs(t)
    free, nearest = length, math.inf
    climb = sign * lib.library.twists[trim, 3]
    n_layers = scene.layers.low.shape[0] - scene.zone_trims.shape[0]
    for k in range(n_layers):
        begin, end = times_between(z, climb, scene.layers.low[k], scene.layers.high[k], length)
        if end < begin or begin > free:
            continue  # never in this layer, or only after the motion is blocked
        world, asked = layer_world(scene.layers, k), (scene.keep, scene.margin, clock)
        for p in range(parts.n):
            span = min(end, free) - begin
            motion = (parts.twists[p, trim], parts.speeds[p, trim], sign * begin, sign * span)
            body = part_body(parts.bodies, p)
            proven, clearance = part_free(world, body, place, parts.offsets[p, trim], motion, asked)
            if proven < span:
                free = begin + proven
            elif end == length:
                nearest = min(nearest, clearance)
    for k in range(scene.zone_trims.shape[0]):
        if scene.zone_trims[k, trim]:
            continue
        # The body keeps out of zones that do not admit the trim. Their distance is not part of the
        # clearance, since the next motion may be admitted.
        world, asked = layer_world(scene.layers, n_layers + k), (0.0, scene.margin, clock)
        for p in range(parts.n):
            motion = (parts.twists[p, trim], parts.speeds[p, trim], 0.0, sign * free)
            body = part_body(parts.bodies, p)
            free, _ = part_free(world, body, place, parts.offsets[p, trim], motion, asked)
    return free, nearest if nearest < math.inf else scene.far


@bare_inner_kernel
def coast_inside(
    scene: Scene, lib: LatticeArrays, trim: int, pose: tuple[float, float, float, float], t: float
) -> bool:
    """Whether coasting a trim stays inside the window."""
    twist = lib.library.twists[trim]
    end = pose[3] + t * twist[3]
    inside = min(pose[3], end) >= scene.lowest and max(pose[3], end) <= scene.highest
    return inside and inside_window(scene.window, pose[0], pose[1], pose[2], twist, t)


@bare_inner_kernel
def coast_hits(
    scene: Scene, lib: LatticeArrays, trim: int, pose: tuple[float, float, float, float], t: float
) -> bool:
    """Whether coasting surely is not free: poses about a body's width apart are looked at."""
    # What hits cannot be proven free, and a look at the field costs a small part of a proof.
    body, twist = lib.parts.body, lib.library.twists[trim]
    if not body.half_width > 0.0 or not is_one_in_plane(scene, lib):
        return False
    steps = math.ceil(min(0.5 * abs(t) * lib.parts.fastest[trim] / body.half_width, LOOKS))
    if steps < 1:
        return False
    d_x, d_y, turn = coast(twist[0], twist[1], twist[2], t / steps)
    turn_c, turn_s = math.cos(turn), math.sin(turn)
    x, y, c, s = pose[0], pose[1], math.cos(pose[2]), math.sin(pose[2])
    for _ in range(steps):
        x, y = x + c * d_x - s * d_y, y + s * d_x + c * d_y
        c, s = c * turn_c - s * turn_s, s * turn_c + c * turn_s
        if field_look(scene.layers.first.field, body, Place(x, y, c, s))[1]:
            return True
    return False


@bare_inner_kernel
def coasted(
    lib: LatticeArrays, trim: int, pose: tuple[float, float, float, float], t: float
) -> tuple[float, float, float, float]:
    """Pose (x, y, heading, z) after coasting a trim."""
    d_x, d_y, turn = coast(
        lib.library.twists[trim, 0], lib.library.twists[trim, 1], lib.library.twists[trim, 2], t
    )
    x, y, heading = compose(pose[0], pose[1], pose[2], d_x, d_y, turn)
    return x, y, heading, pose[3] + t * lib.library.twists[trim, 3]


@bare_inner_kernel
def coast_end(
    lib: LatticeArrays, trim: int, pose: tuple[float, float, float, float], t: float
) -> Place:
    """The end of coasting a trim from a pose, as `swept_end` for any time."""
    x, y, heading, _ = coasted(lib, trim, pose, t)
    return Place(x, y, math.cos(heading), math.sin(heading))


@bare_inner_kernel
def edge_end(
    lib: LatticeArrays, edge: int, pose: tuple[float, float, float, float]
) -> tuple[float, float, float, float]:
    """Pose at the end of a maneuver."""
    moved = lib.edges.displacement[edge]
    x, y, heading = compose(pose[0], pose[1], pose[2], moved[0], moved[1], moved[2])
    return x, y, heading, pose[3] + moved[3]


@bare_inner_kernel
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
def clear_of_static(
    scene: Scene, lib: LatticeArrays, trim: int, pose: tuple[float, float, float, float], t: float
) -> bool:
    """Whether coasting is proven free of all that never moves; asked of one body in one plane."""
    if not is_one_in_plane(scene, lib):
        return True
    twist, fastest = lib.library.twists[trim], lib.parts.fastest[trim]
    motion = Coast(pose[0], pose[1], pose[2], twist[0], twist[1], twist[2], fastest, t, 0.0)
    free, _ = free_of_static(scene.layers.first, lib.parts.body, motion, scene.keep, scene.margin)
    return free >= t


@bare_shared_kernel
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
        for p in range(lib.parts.n):
            at = lib.parts.offsets[p, trim]
            p_x, p_y, p_heading = compose(x, y, heading, at[0], at[1], at[2])
            body, t = part_body(lib.parts.bodies, p), until - clock
            stay = Coast(p_x, p_y, p_heading, 0.0, 0.0, 0.0, 0.0, t, clock)
            proven, _ = free_time(world, body, stay, scene.keep, scene.margin)
            if proven < t:
                return False
    return True


@bare_inner_kernel
def is_still(lib: LatticeArrays, trim: int) -> bool:
    """Whether a trim stands still; a rest may be as short as it likes."""
    twist = lib.library.twists[trim]
    return not (twist[0] != 0.0 or twist[1] != 0.0 or twist[2] != 0.0 or twist[3] != 0.0)


@bare_inner_kernel
def too_short(lib: LatticeArrays, trim: int, run: float, least_coast: float) -> bool:
    """Whether a trim that moves has begun, and does not yet last as long as it must."""
    return trim != NO_TRIM and 0.0 < run < least_coast and not is_still(lib, trim)

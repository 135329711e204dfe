"""Whether motions stay free: trims, maneuvers, and the words of at most three trims between poses.

A vehicle is one rigid part or several, each with its own offset and twist in every trim; its world
is one plane or several, one above the other. A robot in the plane is the case of one part in one
layer. Every test is a proof by conservative advancement (`free_time`), part by part and layer by
layer: what it calls free is free between the poses that it looks at, too.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from maneuver_automaton._compile import bare_inner_kernel, inlined_kernel, merged_kernel
from maneuver_automaton.collision._kernels_advancement import free_time
from maneuver_automaton.collision._kernels_layers import layer_world, times_between
from maneuver_automaton.collision.body import Body
from maneuver_automaton.groups._kernels import coast, compose
from maneuver_automaton.words._kernels_candidates import class_of

if TYPE_CHECKING:
    from maneuver_automaton._arrays import Array, IntArray
    from maneuver_automaton.collision.world import WorldArrays
    from maneuver_automaton.search.lattice_arrays import LatticeArrays
    from maneuver_automaton.search.part_motion import BodyArrays
    from maneuver_automaton.search.scene import Scene
    from maneuver_automaton.words.library import Scratch


@bare_inner_kernel
def inside_window(
    window: Array, x: float, y: float, heading: float, v_x: float, v_y: float, turn: float, t: float
) -> bool:
    """Whether a motion stays inside [low x, low y, high x, high y], seen from the bounds' frame.

    `window` (9,) is those four, the frame's (x, y, cos, sin) that take a pose of the world to it,
    and what the pose may be outside [m].
    """
    # a is the pose where the motion begins, seen from the frame, e the one where it ends. The box
    # [low, high] holds both, and grows by the extreme points of the arc between them.
    c, s = window[6], window[7]
    d_x, d_y = x - window[4], y - window[5]
    a_x, a_y = c * d_x - s * d_y, s * d_x + c * d_y
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
        radius = math.hypot(radius_x, radius_y)
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


@bare_inner_kernel
def edge_proven(
    scene: Scene,
    lib: LatticeArrays,
    edge: int,
    pose: tuple[float, float, float, float],
    clock: float,
) -> float:
    """Least clearance at the end of a maneuver, -1 if it is not proven free.

    Each piece of its course moves by one twist. The true motion deviates from it by at most
    `piece_error`, which is kept in addition to `keep`: so the proof holds for the true motion.
    A layer counts for all of a piece that is in it.
    """
    # Pieces of part p along an edge are those from `first_piece[p * n_edges + edge]` to the next
    # entry; their times add up to `time`. `nearest` is the clearance after the last of them.
    x, y, heading, z = pose
    place = (x, y, heading)
    nearest = scene.far
    layers = scene.layers
    n_layers, n_edges = layers.low.shape[0] - scene.zone_trims.shape[0], lib.edge_cost.shape[0]
    low, high = z + lib.edge_low[edge], z + lib.edge_high[edge]
    for n in range(n_layers):
        if high < layers.low[n] or low > layers.high[n]:
            continue
        world = layer_world(layers, n)
        for p in range(lib.n_parts):
            begin = lib.first_piece[p * n_edges + edge]
            end = lib.first_piece[p * n_edges + edge + 1]
            time = clock
            for k in range(begin, end):
                t = lib.piece_time[k]
                if z + lib.piece_high[k] < layers.low[n] or z + lib.piece_low[k] > layers.high[n]:
                    time += t
                    continue
                proven, clearance = part_piece(
                    world, lib, p, k, place, scene.keep, scene.margin, time
                )
                if proven < t:
                    return -1.0
                time += t
                if k == end - 1:
                    nearest = min(nearest, clearance)
    for n in range(scene.zone_trims.shape[0]):
        world = layer_world(layers, n_layers + n)
        for p in range(lib.n_parts):
            group = p * n_edges + edge
            for k in range(lib.first_piece[group], lib.first_piece[group + 1]):
                if scene.zone_pieces[n, k]:
                    continue
                # Zones stand still, so the time does not matter.
                proven, _ = part_piece(world, lib, p, k, place, 0.0, scene.margin, clock)
                if proven < lib.piece_time[k]:
                    return -1.0
    return nearest


@bare_inner_kernel
def edge_inside(
    scene: Scene, lib: LatticeArrays, edge: int, pose: tuple[float, float, float, float]
) -> bool:
    """Whether a maneuver stays inside the window."""
    x, y, heading, z = pose
    if z + lib.edge_low[edge] < scene.lowest or z + lib.edge_high[edge] > scene.highest:
        return False
    group = lib.n_parts * lib.edge_cost.shape[0] + edge  # the pieces of the pose come last
    for k in range(lib.first_piece[group], lib.first_piece[group + 1]):
        at, twist = lib.piece_pose[k], lib.piece_twist[k]
        p_x, p_y, p_heading = compose(x, y, heading, at[0], at[1], at[2])
        if not inside_window(
            scene.edge_window, p_x, p_y, p_heading, twist[0], twist[1], twist[2], lib.piece_time[k]
        ):
            return False
    return True


@bare_inner_kernel
def edge_end(
    lib: LatticeArrays, edge: int, pose: tuple[float, float, float, float]
) -> tuple[float, float, float, float]:
    """Pose at the end of a maneuver."""
    moved = lib.edge_displacement[edge]
    x, y, heading = compose(pose[0], pose[1], pose[2], moved[0], moved[1], moved[2])
    return x, y, heading, pose[3] + moved[3]


@bare_inner_kernel
def edge_free(
    scene: Scene,
    lib: LatticeArrays,
    edge: int,
    pose: tuple[float, float, float, float],
    clock: float,
) -> bool:
    """Whether a maneuver from a pose stays inside and is proven free."""
    inside = edge_inside(scene, lib, edge, pose)
    return inside and edge_proven(scene, lib, edge, pose, clock) >= 0.0


@bare_inner_kernel
def transition_free(
    scene: Scene,
    lib: LatticeArrays,
    source: int,
    target: int,
    pose: tuple[float, float, float, float],
    clock: float,
) -> tuple[bool, tuple[float, float, float, float], float]:
    """Whether the transition between two trims is free; then the pose and time at its end."""
    at, goal = class_of(lib.library, source), class_of(lib.library, target)
    while at != goal:  # within a class the transition is the identity
        edge = lib.via_edge[at, goal]
        if not edge_free(scene, lib, edge, pose, clock):
            return False, pose, clock
        pose = edge_end(lib, edge, pose)
        clock += lib.edge_time[edge]
        at = class_of(lib.library, lib.edge_target[edge])
    return True, pose, clock


@merged_kernel
def connection_free(
    scene: Scene,
    lib: LatticeArrays,
    ends: tuple[tuple[float, float, float, float], int, int],
    word: IntArray,
    climb: int,
    times: Array,
    clock: float,
) -> bool:
    """Whether a connection is free all the way: three trims, a climb, and the trim of its goal.

    `ends` are the pose it begins at, the trim before it, and the trim after it (-1 for any). A trim
    of the word that is none, or the turn in place of a free heading, is passed over.
    """
    # (pose, before, clock) is where, in which trim and when the word is: at first its begin. The
    # fifth trim is the one of the goal, which lasts no time: only what leads to it is tested.
    pose, before, after = ends
    for n in range(5):
        trim, t = after, 0.0
        if n < 3:
            trim, t = word[n], times[n]
        elif n == 3:
            trim, t = climb, times[3]
        if trim < 0 or trim >= lib.library.n_trims:
            continue
        if class_of(lib.library, before) != class_of(lib.library, trim):
            free, pose, clock = transition_free(scene, lib, before, trim, pose, clock)
            if not free:
                return False
        before = trim
        if t > 0.0:
            # The window is a few sums, the proof a loop over obstacles.
            if not coast_inside(scene, lib, trim, pose, t):
                return False
            if not coast_free(scene, lib, trim, pose, t, clock):
                return False
            pose = coasted(lib, trim, pose, t)
            clock += t
    return True


@merged_kernel
def free_candidate(
    scene: Scene,
    lib: LatticeArrays,
    words: IntArray,
    ends: tuple[tuple[float, float, float, float], int, int],
    n: int,
    limits: tuple[int, float, float],
    clock: float,
    scratch: Scratch,
) -> int:
    """Cheapest of `n` candidates that is proven free; -1 if none of the first few is.

    `ends` as in `connection_free`; `limits` are how many are tried, the cost that a candidate has
    to undercut, and the time [s] it may last. A candidate that was tried costs inf from then on.
    """
    # The least is sought anew each time: few are tried, so that sorting all would cost more.
    tries, most_cost, most_time = limits
    for _ in range(tries):
        best, which = most_cost, -1
        for k in range(n):
            if scratch.costs[k] < best and scratch.durations[k] <= most_time:
                best, which = scratch.costs[k], k
        if which < 0:
            return -1
        word = words[scratch.rows[which]]
        climb, times = scratch.climbs[which], scratch.times[which]
        if connection_free(scene, lib, ends, word, climb, times, clock):
            return which
        scratch.costs[which] = math.inf
    return -1


@inlined_kernel
def is_still(lib: LatticeArrays, trim: int) -> bool:
    """Whether a trim stands still; a rest may be as short as it likes."""
    twist = lib.library.twists[trim]
    return not (twist[0] != 0.0 or twist[1] != 0.0 or twist[2] != 0.0 or twist[3] != 0.0)

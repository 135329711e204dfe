"""Whether trims, maneuvers and chains of them stay free, part by part of the vehicle."""

from __future__ import annotations

from maneuver_automaton._compile import bare_inner_kernel, bare_kernel
from maneuver_automaton.collision._kernels_advancement import free_time
from maneuver_automaton.collision._kernels_layers import layer_world, times_between
from maneuver_automaton.collision.body import Body
from maneuver_automaton.groups._kernels import coast, compose
from maneuver_automaton.search._kernels_connect import inside_window


@bare_inner_kernel
def part_body(bodies, p):
    """One rigid part of the vehicle."""
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
def trim_proven(task, lib, layers, trim, x, y, heading, z, t, clock):
    """Least clearance at the end of coasting a trim for `t`, -1 if it is not proven free.

    In every layer while the altitude is there, so that a climb is no cylinder.
    """
    nearest = task.far
    climb = lib.transfer.twists[trim, 3]
    for k in range(layers.low.shape[0]):
        begin, end = times_between(z, climb, layers.low[k], layers.high[k], t)
        if end < begin:
            continue
        world = layer_world(layers, k)
        for p in range(lib.n_parts):
            v_x, v_y = lib.part_twists[p, trim, 0], lib.part_twists[p, trim, 1]
            turn_rate = lib.part_twists[p, trim, 2]
            p_x, p_y, p_heading = compose(
                x,
                y,
                heading,
                lib.offsets[p, trim, 0],
                lib.offsets[p, trim, 1],
                lib.offsets[p, trim, 2],
            )
            if begin > 0.0:
                d_x, d_y, turn = coast(v_x, v_y, turn_rate, begin)
                p_x, p_y, p_heading = compose(p_x, p_y, p_heading, d_x, d_y, turn)
            proven, gap = free_time(
                world,
                part_body(lib.bodies, p),
                p_x,
                p_y,
                p_heading,
                v_x,
                v_y,
                turn_rate,
                lib.speeds[p, trim],
                end - begin,
                task.keep,
                task.margin,
                clock + begin,
            )
            if proven < end - begin:
                return -1.0
            if end == t:
                nearest = min(nearest, gap)
    for k in range(task.zone_trims.shape[0]):
        if not task.zone_trims[k, trim]:
            # the body keeps out of zones that do not admit the trim; their distance is not part of
            # the clearance, since the next motion may be admitted
            for p in range(lib.n_parts):
                p_x, p_y, p_heading = compose(
                    x,
                    y,
                    heading,
                    lib.offsets[p, trim, 0],
                    lib.offsets[p, trim, 1],
                    lib.offsets[p, trim, 2],
                )
                proven, _ = free_time(
                    layer_world(task.zones, k),
                    part_body(lib.bodies, p),
                    p_x,
                    p_y,
                    p_heading,
                    lib.part_twists[p, trim, 0],
                    lib.part_twists[p, trim, 1],
                    lib.part_twists[p, trim, 2],
                    lib.speeds[p, trim],
                    t,
                    0.0,
                    task.margin,
                    clock,
                )
                if proven < t:
                    return -1.0
    return nearest


@bare_inner_kernel
def trim_inside(task, lib, trim, x, y, heading, z, t):
    """Whether coasting a trim stays inside the window."""
    twists = lib.transfer.twists
    end = z + t * twists[trim, 3]
    if min(z, end) < task.lowest or max(z, end) > task.highest:
        return False
    return inside_window(
        task.window, x, y, heading, twists[trim, 0], twists[trim, 1], twists[trim, 2], t
    )


@bare_inner_kernel
def edge_proven(task, lib, layers, edge, x, y, heading, z, clock):
    """Least clearance at the end of a maneuver, -1 if it is not proven free.

    Each piece of its course moves by one twist; what the true motion deviates from that is kept
    as a distance beside what is asked for. A layer counts for all of a piece that is in it.
    """
    nearest = task.far
    n_edges = lib.edge_cost.shape[0]
    low, high = z + lib.edge_low[edge], z + lib.edge_high[edge]
    for n in range(layers.low.shape[0]):
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
                p_x, p_y, p_heading = compose(
                    x, y, heading, lib.piece_pose[k, 0], lib.piece_pose[k, 1], lib.piece_pose[k, 2]
                )
                proven, gap = free_time(
                    world,
                    part_body(lib.bodies, p),
                    p_x,
                    p_y,
                    p_heading,
                    lib.piece_twist[k, 0],
                    lib.piece_twist[k, 1],
                    lib.piece_twist[k, 2],
                    lib.piece_speed[k],
                    t,
                    task.keep + lib.piece_error[k],
                    task.margin,
                    time,
                )
                if proven < t:
                    return -1.0
                time += t
                if k == end - 1:
                    nearest = min(nearest, gap)
    for n in range(task.zone_trims.shape[0]):
        for p in range(lib.n_parts):
            group = p * n_edges + edge
            for k in range(lib.first_piece[group], lib.first_piece[group + 1]):
                if task.zone_pieces[n, k]:
                    continue
                p_x, p_y, p_heading = compose(
                    x, y, heading, lib.piece_pose[k, 0], lib.piece_pose[k, 1], lib.piece_pose[k, 2]
                )
                proven, _ = free_time(
                    layer_world(task.zones, n),
                    part_body(lib.bodies, p),
                    p_x,
                    p_y,
                    p_heading,
                    lib.piece_twist[k, 0],
                    lib.piece_twist[k, 1],
                    lib.piece_twist[k, 2],
                    lib.piece_speed[k],
                    lib.piece_time[k],
                    lib.piece_error[k],
                    task.margin,
                    clock,
                )
                if proven < lib.piece_time[k]:
                    return -1.0
    return nearest


@bare_inner_kernel
def edge_inside(task, lib, edge, x, y, heading, z):
    """Whether a maneuver stays inside the window."""
    if z + lib.edge_low[edge] < task.lowest or z + lib.edge_high[edge] > task.highest:
        return False
    group = lib.n_parts * lib.edge_cost.shape[0] + edge
    for k in range(lib.first_piece[group], lib.first_piece[group + 1]):
        p_x, p_y, p_heading = compose(
            x, y, heading, lib.piece_pose[k, 0], lib.piece_pose[k, 1], lib.piece_pose[k, 2]
        )
        if not inside_window(
            task.edge_window,
            p_x,
            p_y,
            p_heading,
            lib.piece_twist[k, 0],
            lib.piece_twist[k, 1],
            lib.piece_twist[k, 2],
            lib.piece_time[k],
        ):
            return False
    return True


@bare_inner_kernel
def chain_free(task, lib, layers, source, target, pose, clock):
    """Whether the transition between two trims is free; then the pose and time at its end."""
    x, y, heading, z = pose
    trim = source
    classes = lib.transfer.class_of
    while classes[trim] != classes[target]:  # within a class the transition is the identity
        edge = lib.via_edge[classes[trim], classes[target]]
        if not edge_inside(task, lib, edge, x, y, heading, z) or not (
            edge_proven(task, lib, layers, edge, x, y, heading, z, clock) >= 0.0
        ):
            return False, (x, y, heading, z), clock
        x, y, heading = compose(
            x, y, heading, lib.edge_shift[edge, 0], lib.edge_shift[edge, 1], lib.edge_shift[edge, 2]
        )
        z += lib.edge_shift[edge, 3]
        clock += lib.edge_time[edge]
        trim = lib.edge_target[edge]
    return True, (x, y, heading, z), clock


@bare_inner_kernel
def coast_free(task, lib, layers, trim, pose, t, clock):
    """Whether coasting a trim is free and inside; then the pose at its end."""
    x, y, heading, z = pose
    if not trim_inside(task, lib, trim, x, y, heading, z, t):
        return False, pose
    if not trim_proven(task, lib, layers, trim, x, y, heading, z, t, clock) >= 0.0:
        return False, pose
    twists = lib.transfer.twists
    d_x, d_y, turn = coast(twists[trim, 0], twists[trim, 1], twists[trim, 2], t)
    x, y, heading = compose(x, y, heading, d_x, d_y, turn)
    return True, (x, y, heading, z + t * twists[trim, 3])


@bare_inner_kernel
def coasts_long_enough(task, lib, start_trim, run, word, climb, times):
    """Whether every trim of a transfer that moves lasts for no time, or for the least one.

    `run` is how long `start_trim` has lasted already: the first trim may go on with it.
    """
    before = run
    trim_before = start_trim
    for n in range(4):
        trim, t = climb, times[3]
        if n < 3:
            trim, t = word[n], times[n]
        if trim < 0:
            continue
        lasting = t
        if trim == trim_before:
            lasting += before
        elif 0.0 < before < task.least_coast and not is_still(lib, trim_before):
            return False
        trim_before, before = trim, lasting
    return not 0.0 < before < task.least_coast or is_still(lib, trim_before)


@bare_inner_kernel
def is_still(lib, trim):
    """Whether a trim stands still: a rest may last as short as it likes."""
    twists = lib.transfer.twists
    turns = twists[trim, 2] != 0.0
    return not (turns or twists[trim, 0] != 0.0 or twists[trim, 1] != 0.0 or twists[trim, 3] != 0.0)


@bare_inner_kernel
def transfer_free(task, lib, layers, start, start_trim, goal_trim, word, climb, times, clock):
    """Whether a transfer from the pose `start` (x, y, heading, z) is free all the way."""
    pose = start
    before = start_trim
    for n in range(5):
        trim, t = goal_trim, 0.0
        if n < 3:
            trim, t = word[n], times[n]
        elif n == 3:
            trim, t = climb, times[3]
        if trim < 0:
            continue
        free, pose, clock = chain_free(task, lib, layers, before, trim, pose, clock)
        if not free:
            return False
        before = trim
        if t > 0.0:
            free, pose = coast_free(task, lib, layers, trim, pose, t, clock)
            if not free:
                return False
            clock += t
    return True


@bare_kernel
def word_free(task, lib, layers, start, kinds, numbers, durations, clock):
    """Whether a whole word from `start` (4,) is free: steps are trims (0) or edges (1)."""
    x, y, heading, z = start[0], start[1], start[2], start[3]
    for k in range(kinds.shape[0]):
        if kinds[k] == 1:
            edge = numbers[k]
            if not edge_inside(task, lib, edge, x, y, heading, z):
                return False
            if not edge_proven(task, lib, layers, edge, x, y, heading, z, clock) >= 0.0:
                return False
            x, y, heading = compose(
                x,
                y,
                heading,
                lib.edge_shift[edge, 0],
                lib.edge_shift[edge, 1],
                lib.edge_shift[edge, 2],
            )
            z += lib.edge_shift[edge, 3]
            clock += lib.edge_time[edge]
        else:
            trim, t = numbers[k], durations[k]
            free, pose = coast_free(task, lib, layers, trim, (x, y, heading, z), t, clock)
            if not free:
                return False
            x, y, heading, z = pose
            clock += t
    return True

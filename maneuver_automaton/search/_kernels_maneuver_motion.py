"""Whether trims, maneuvers and chains of them stay free, part by part of the vehicle."""

from __future__ import annotations

from maneuver_automaton._compile import bare_inner_kernel, bare_kernel
from maneuver_automaton.collision._kernels_advancement import free_time
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
def trim_proven(task, lib, world, trim, x, y, heading, t, clock):
    """How long coasting a trim is proven free for all parts; the least clearance at the end."""
    nearest = task.far
    for p in range(lib.n_parts):
        p_x, p_y, p_heading = compose(
            x,
            y,
            heading,
            lib.offsets[p, trim, 0],
            lib.offsets[p, trim, 1],
            lib.offsets[p, trim, 2],
        )
        proven, gap = free_time(
            world,
            part_body(lib.bodies, p),
            p_x,
            p_y,
            p_heading,
            lib.part_twists[p, trim, 0],
            lib.part_twists[p, trim, 1],
            lib.part_twists[p, trim, 2],
            lib.speeds[p, trim],
            t,
            task.keep,
            task.margin,
            clock,
        )
        if proven < t:
            return proven, 0.0
        nearest = min(nearest, gap)
    return t, nearest


@bare_inner_kernel
def trim_inside(task, lib, trim, x, y, heading, t):
    """Whether coasting a trim stays inside the window."""
    twists = lib.transfer.twists
    return inside_window(
        task.window, x, y, heading, twists[trim, 0], twists[trim, 1], twists[trim, 2], t
    )


@bare_inner_kernel
def edge_proven(task, lib, world, edge, x, y, heading, clock):
    """Least clearance at the end of a maneuver, -1 if it is not proven free.

    Each piece of its course moves by one twist; what the true motion deviates from that is kept
    as a distance beside what is asked for.
    """
    nearest = task.far
    n_edges = lib.edge_cost.shape[0]
    for p in range(lib.n_parts):
        begin = lib.first_piece[p * n_edges + edge]
        end = lib.first_piece[p * n_edges + edge + 1]
        time = clock
        for k in range(begin, end):
            p_x, p_y, p_heading = compose(
                x, y, heading, lib.piece_pose[k, 0], lib.piece_pose[k, 1], lib.piece_pose[k, 2]
            )
            t = lib.piece_time[k]
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
    return nearest


@bare_inner_kernel
def edge_inside(task, lib, edge, x, y, heading):
    """Whether a maneuver stays inside the window."""
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
def chain_free(task, lib, world, source, target, x, y, heading, clock):
    """Whether the transition between two trims is free; then the pose and time at its end."""
    trim = source
    while trim != target:
        edge = lib.via_edge[trim, target]
        if not edge_inside(task, lib, edge, x, y, heading) or not (
            edge_proven(task, lib, world, edge, x, y, heading, clock) >= 0.0
        ):
            return False, x, y, heading, clock
        x, y, heading = compose(
            x, y, heading, lib.edge_shift[edge, 0], lib.edge_shift[edge, 1], lib.edge_shift[edge, 2]
        )
        clock += lib.edge_time[edge]
        trim = lib.edge_target[edge]
    return True, x, y, heading, clock


@bare_inner_kernel
def transfer_free(task, lib, world, start, start_trim, goal_trim, word, climb, times, clock):
    """Whether a transfer from the pose `start` (x, y, heading) is free all the way."""
    x, y, heading = start
    before = start_trim
    for n in range(5):
        trim, t = goal_trim, 0.0
        if n < 3:
            trim, t = word[n], times[n]
        elif n == 3:
            trim, t = climb, times[3]
        if trim < 0:
            continue
        free, x, y, heading, clock = chain_free(
            task, lib, world, before, trim, x, y, heading, clock
        )
        if not free:
            return False
        before = trim
        if t > 0.0:
            if not trim_inside(task, lib, trim, x, y, heading, t):
                return False
            proven, _ = trim_proven(task, lib, world, trim, x, y, heading, t, clock)
            if proven < t:
                return False
            twists = lib.transfer.twists
            d_x, d_y, turn = coast(twists[trim, 0], twists[trim, 1], twists[trim, 2], t)
            x, y, heading = compose(x, y, heading, d_x, d_y, turn)
            clock += t
    return True


@bare_kernel
def word_free(task, lib, world, start, kinds, numbers, durations, clock):
    """Whether a whole word from `start` (3,) is free: steps are trims (0) or edges (1)."""
    x, y, heading = start[0], start[1], start[2]
    for k in range(kinds.shape[0]):
        if kinds[k] == 1:
            edge = numbers[k]
            if not edge_inside(task, lib, edge, x, y, heading):
                return False
            if not edge_proven(task, lib, world, edge, x, y, heading, clock) >= 0.0:
                return False
            d_x, d_y, turn = (
                lib.edge_shift[edge, 0],
                lib.edge_shift[edge, 1],
                lib.edge_shift[edge, 2],
            )
            t = lib.edge_time[edge]
        else:
            trim, t = numbers[k], durations[k]
            if not trim_inside(task, lib, trim, x, y, heading, t):
                return False
            proven, _ = trim_proven(task, lib, world, trim, x, y, heading, t, clock)
            if proven < t:
                return False
            twists = lib.transfer.twists
            d_x, d_y, turn = coast(twists[trim, 0], twists[trim, 1], twists[trim, 2], t)
        x, y, heading = compose(x, y, heading, d_x, d_y, turn)
        clock += t
    return True

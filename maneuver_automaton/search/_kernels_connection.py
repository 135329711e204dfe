"""Whether maneuvers, and words of at most three trims between two poses, are free.

A maneuver is looked at piece by piece of its course, a word with the transitions between its trims.
"""

from __future__ import annotations

import math

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import bare_inner_kernel, bare_shared_kernel
from maneuver_automaton.collision._kernels_layers import layer_world
from maneuver_automaton.groups._kernels import compose
from maneuver_automaton.search._kernels_coast import (
    coast_free,
    coast_hits,
    coast_inside,
    coasted,
    edge_end,
    inside_window,
    part_body,
    part_free,
)
from maneuver_automaton.search._kernels_place import coast_place, edge_place, places_cost
from maneuver_automaton.search.arrays import Joint, LatticeArrays, Scene
from maneuver_automaton.words._kernels_library import class_of
from maneuver_automaton.words.library import Scratch


@bare_shared_kernel
def edge_proven(
    scene: Scene,
    lib: LatticeArrays,
    edge: int,
    pose: tuple[float, float, float, float],
    clock: float,
) -> float:
    """Least clearance at the end of a maneuver, -1 if it is not proven free."""
    # Each piece of its course moves by one twist. The true motion deviates from it by at most its
    # `error`, kept in addition to `keep`: so the proof holds for the true motion. A layer counts
    # for all of a piece that is in it.
    # Pieces of part p along an edge are those from `first[p * n_edges + edge]` to the next
    # entry; their times add up to `time`. `nearest` is the clearance after the last of them.
    x, y, heading, z = pose
    place = (x, y, heading)
    nearest = scene.far
    layers, bodies, pieces = scene.layers, lib.parts.bodies, lib.pieces
    n_layers, n_edges = layers.low.shape[0] - scene.zone_trims.shape[0], lib.edges.cost.shape[0]
    low, high = z + lib.edges.low[edge], z + lib.edges.high[edge]
    for n in range(n_layers):
        if high < layers.low[n] or low > layers.high[n]:
            continue
        world = layer_world(layers, n)
        for p in range(lib.parts.n):
            begin, end = pieces.first[p * n_edges + edge], pieces.first[p * n_edges + edge + 1]
            body, time = part_body(bodies, p), clock
            for k in range(begin, end):
                t = pieces.time[k]
                if z + pieces.high[k] < layers.low[n] or z + pieces.low[k] > layers.high[n]:
                    time += t
                    continue
                motion = (pieces.twist[k], pieces.speed[k], 0.0, t)
                asked = (scene.keep + pieces.error[k], scene.margin, time)
                proven, clearance = part_free(world, body, place, pieces.pose[k], motion, asked)
                if proven < t:
                    return -1.0
                time += t
                if k == end - 1:
                    nearest = min(nearest, clearance)
    for n in range(scene.zone_trims.shape[0]):
        world = layer_world(layers, n_layers + n)
        for p in range(lib.parts.n):
            group, body = p * n_edges + edge, part_body(bodies, p)
            for k in range(pieces.first[group], pieces.first[group + 1]):
                if scene.zone_pieces[n, k]:
                    continue
                # Zones stand still, so the time does not matter.
                motion = (pieces.twist[k], pieces.speed[k], 0.0, pieces.time[k])
                asked = (pieces.error[k], scene.margin, clock)
                proven, _ = part_free(world, body, place, pieces.pose[k], motion, asked)
                if proven < pieces.time[k]:
                    return -1.0
    return nearest


@bare_inner_kernel
def edge_inside(
    scene: Scene, lib: LatticeArrays, edge: int, pose: tuple[float, float, float, float]
) -> bool:
    """Whether a maneuver stays inside the window."""
    x, y, heading, z = pose
    edges, pieces = lib.edges, lib.pieces
    if z + edges.low[edge] < scene.lowest or z + edges.high[edge] > scene.highest:
        return False
    group = lib.parts.n * edges.cost.shape[0] + edge  # the pieces of the pose come last
    for k in range(pieces.first[group], pieces.first[group + 1]):
        at, window = pieces.pose[k], scene.edge_window
        p_x, p_y, p_heading = compose(x, y, heading, at[0], at[1], at[2])
        if not inside_window(window, p_x, p_y, p_heading, pieces.twist[k], pieces.time[k]):
            return False
    return True


@bare_shared_kernel
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
        edge = lib.edges.via[at, goal]
        if not edge_free(scene, lib, edge, pose, clock):
            return False, pose, clock
        pose = edge_end(lib, edge, pose)
        clock += lib.edges.time[edge]
        at = class_of(lib.library, lib.edges.target[edge])
    return True, pose, clock


@bare_shared_kernel
def connection_free(
    scene: Scene, lib: LatticeArrays, joint: Joint, word: IntArray, climb: int, times: Array
) -> bool:
    """Whether a connection is free all the way: three trims, a climb, and the trim of its goal."""
    # Most words are not free. Where no transition comes between, a look along all of a word says so
    # of most of these, before any part of it is proven.
    pose, one_class = joint.pose, lib.library.transitions.cost.shape[0] == 1
    for n in range(3):
        trim, t = word[n], times[n]
        if one_class and 0 <= trim < lib.library.n_trims and t > 0.0:
            if not coast_inside(scene, lib, trim, pose, t) or coast_hits(scene, lib, trim, pose, t):
                return False
            pose = coasted(lib, trim, pose, t)
    # (pose, before, clock) is where, in which trim and when the word is: at first its begin. The
    # fifth trim is the one of the goal, which lasts no time: only what leads to it is tested.
    pose, before, clock = joint.pose, joint.before, joint.clock
    for n in range(5):
        trim, t = joint.after, 0.0
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


@bare_inner_kernel
def connection_place(
    scene: Scene,
    lib: LatticeArrays,
    joint: Joint,
    word: IntArray,
    climb: int,
    times: Array,
    enough: float,
) -> float:
    """Price of places along a connection, as `connection_free`; of a part that is `enough`."""
    pose, before, total = joint.pose, joint.before, 0.0
    for n in range(5):
        trim, t = joint.after, 0.0
        if n < 3:
            trim, t = word[n], times[n]
        elif n == 3:
            trim, t = climb, times[3]
        if trim < 0 or trim >= lib.library.n_trims:
            continue
        at, goal = class_of(lib.library, before), class_of(lib.library, trim)
        while at != goal:
            edge = lib.edges.via[at, goal]
            total += edge_place(scene, lib, edge, pose)
            pose = edge_end(lib, edge, pose)
            at = class_of(lib.library, lib.edges.target[edge])
        before = trim
        total += coast_place(scene, lib, trim, pose, t)
        if total >= enough:
            break
        pose = coasted(lib, trim, pose, t)
    return total


@bare_inner_kernel
def free_candidate(
    scene: Scene, lib: LatticeArrays, words: IntArray, joint: Joint, n: int, scratch: Scratch
) -> int:
    """Cheapest of `n` candidates that is proven free, places priced; -1 if none soon is."""
    # A candidate that was tried costs inf from then on.
    # The least is sought anew each time: few are tried, so that sorting all would cost more.
    # Without the places a candidate costs less than with them: once the next one costs more than
    # the best does with them, no other is better.
    priced = places_cost(scene)
    whole, found = joint.most_cost, -1
    for _ in range(joint.tries):
        best, which = whole, -1
        for k in range(n):
            if scratch.costs[k] < best and scratch.durations[k] <= joint.most_time:
                best, which = scratch.costs[k], k
        if which < 0:
            break
        word = words[scratch.rows[which]]
        climb, times = scratch.climbs[which], scratch.times[which]
        # Most that are not free meet something soon: that is known before their price is.
        if connection_free(scene, lib, joint, word, climb, times):
            if not priced:
                return which
            best += connection_place(scene, lib, joint, word, climb, times, whole - best)
            if best < whole:
                whole, found = best, which
        scratch.costs[which] = math.inf
    if found >= 0:
        scratch.costs[found] = whole
    return found

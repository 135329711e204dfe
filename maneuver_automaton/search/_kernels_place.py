"""What places cost along motions: clearance of the body that there is, and a raster of rates.

Prices are integrals over time by Gauss's rule with two points a step. A step is so short that no
point of the vehicle moves farther than `place.step`, which goes with the cells of the raster and
with the distance within which obstacles are costly: so costs of parts add up to those of the whole.
"""

from __future__ import annotations

import math

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import bare_inner_kernel, bare_kernel, bare_shared_kernel
from maneuver_automaton.collision._kernels_clearance import SHARP, field_bound, near_clearance
from maneuver_automaton.collision._kernels_layers import layer_world
from maneuver_automaton.collision.arrays import Place, WorldArrays
from maneuver_automaton.collision.body import Body
from maneuver_automaton.groups._kernels import coast, compose
from maneuver_automaton.search._kernels_coast import coasted, edge_end, is_one_in_plane, part_body
from maneuver_automaton.search.arrays import LatticeArrays, PlaceArrays, Scene

GAUSS = 0.5 / math.sqrt(3.0)  # of a step: both points of the rule from its middle
AHEAD, BACK, LASTING = range(3)  # sheets of the raster: per metre ahead and back, per second


@bare_inner_kernel
def places_cost(scene: Scene) -> bool:
    """Whether there is anything to be paid for places."""
    return scene.place.weight > 0.0 or scene.place.value.shape[3] > 0


@bare_inner_kernel
def distance_within(
    world: WorldArrays, body: Body, x: float, y: float, heading: float, within: float
) -> float:
    """Distance [m] of a body to what stands around it, exact below `within`, at most that."""
    # The world has to know all that is nearer than `within`, as one does that keeps that distance.
    place = Place(x, y, math.cos(heading), math.sin(heading))
    if field_bound(world.field, body, place, -math.inf) >= within:
        return within
    # Corners are looked at where a clearance is below `SHARP` times the last argument.
    return max(near_clearance(world, body, place, within / SHARP, within), 0.0)


@bare_inner_kernel
def part_distance(
    scene: Scene, lib: LatticeArrays, p: int, at: tuple[float, float, float, float], within: float
) -> float:
    """`distance_within` of part `p` at a pose of its own (x, y, heading, z), in all its layers."""
    layers, body = scene.layers, part_body(lib.parts.bodies, p)
    x, y, heading, z = at
    for n in range(layers.low.shape[0] - scene.zone_trims.shape[0]):
        if layers.low[n] <= z <= layers.high[n]:
            within = distance_within(layer_world(layers, n), body, x, y, heading, within)
    return within


@bare_inner_kernel
def raster_rate(place: PlaceArrays, x: float, y: float, heading: float, sheet: int) -> float:
    """Value of a sheet of the raster between its samples, by lines along all three axes."""
    value = place.value
    turns, rows, columns = value.shape[1], value.shape[2], value.shape[3]
    at_x = min(max((x - place.origin_x) / place.cell, 0.0), columns - 1.0)
    at_y = min(max((y - place.origin_y) / place.cell, 0.0), rows - 1.0)
    at_turn = heading / (2.0 * math.pi)
    at_turn = (at_turn - math.floor(at_turn)) * turns
    i, j, k = int(at_x), int(at_y), int(at_turn)
    u, v, w = at_x - i, at_y - j, at_turn - k
    i_1, j_1 = min(i + 1, columns - 1), min(j + 1, rows - 1)
    found = 0.0
    for side in range(2 if turns > 1 else 1):
        flat = value[sheet, (k + side) % turns]
        near = (1.0 - u) * flat[j, i] + u * flat[j, i_1]
        far = (1.0 - u) * flat[j_1, i] + u * flat[j_1, i_1]
        share = 1.0 if turns == 1 else w if side == 1 else 1.0 - w
        found += share * ((1.0 - v) * near + v * far)
    return found


@bare_inner_kernel
def place_rate(
    place: PlaceArrays, pose: tuple[float, float, float, float], twist: Array, nearest: float
) -> float:
    """Cost per second of a place for a vehicle whose distance to obstacles is `nearest` [m]."""
    v_x, v_y, v_z = twist[0], twist[1], twist[3] if twist.shape[0] > 3 else 0.0
    speed = math.sqrt(v_x * v_x + v_y * v_y + v_z * v_z)
    rate = 0.0
    if place.weight > 0.0 and nearest < place.within:
        near = 1.0 - nearest / place.within
        rate = (1.0 if place.per_second else speed) * place.weight * near * near
    if place.value.shape[3] > 0:
        sheet = BACK if v_x < 0.0 and place.value.shape[0] > 1 else AHEAD
        rate += speed * raster_rate(place, pose[0], pose[1], pose[2], sheet)
        if place.value.shape[0] > LASTING:
            rate += raster_rate(place, pose[0], pose[1], pose[2], LASTING)
    return rate


@bare_shared_kernel
def coast_place(
    scene: Scene, lib: LatticeArrays, trim: int, pose: tuple[float, float, float, float], t: float
) -> float:
    """Price of the places along a coast from a pose; a negative `t` [s] drives it backwards."""
    place, parts = scene.place, lib.parts
    if t == 0.0:
        return 0.0
    n = max(math.ceil(parts.fastest[trim] * abs(t) / place.step), 1)
    step, twist = t / n, lib.library.twists[trim]
    total = 0.0
    alone = is_one_in_plane(scene, lib)
    for k in range(2 * n):
        middle = k // 2 + 0.5
        at = coasted(lib, trim, pose, step * (middle + (GAUSS if k % 2 == 1 else -GAUSS)))
        nearest = place.within
        if place.weight > 0.0 and alone:
            world = scene.layers.first
            nearest = distance_within(world, parts.body, at[0], at[1], at[2], nearest)
        elif place.weight > 0.0:
            for p in range(parts.n):
                off = parts.offsets[p, trim]
                x, y, heading = compose(at[0], at[1], at[2], off[0], off[1], off[2])
                nearest = part_distance(scene, lib, p, (x, y, heading, at[3]), nearest)
        total += place_rate(place, at, twist, nearest)
    return float(0.5 * abs(step) * total)


@bare_inner_kernel
def part_along(
    lib: LatticeArrays, group: int, pose: tuple[float, float, float, float], time: float
) -> tuple[float, float, float, float]:
    """Pose of a part, or of the vehicle, a time after it began a maneuver; z is in the middle."""
    pieces = lib.pieces
    k, last = pieces.first[group], pieces.first[group + 1] - 1
    while k < last and time > pieces.time[k]:
        time -= pieces.time[k]
        k += 1
    at, twist = pieces.pose[k], pieces.twist[k]
    x, y, heading = compose(pose[0], pose[1], pose[2], at[0], at[1], at[2])
    d_x, d_y, turn = coast(twist[0], twist[1], twist[2], time)
    x, y, heading = compose(x, y, heading, d_x, d_y, turn)
    return x, y, heading, pose[3] + 0.5 * (pieces.low[k] + pieces.high[k])


@bare_shared_kernel
def edge_place(
    scene: Scene, lib: LatticeArrays, edge: int, pose: tuple[float, float, float, float]
) -> float:
    """Price of the places along a maneuver from a pose."""
    place, parts, pieces, edges = scene.place, lib.parts, lib.pieces, lib.edges
    n_edges = edges.cost.shape[0]
    group, total, begun = parts.n * n_edges + edge, 0.0, 0.0
    for k in range(pieces.first[group], pieces.first[group + 1]):
        lasting = pieces.time[k]
        if not lasting > 0.0:
            continue
        reach = edges.reach[edge] * lasting / max(edges.time[edge], lasting)
        n = max(math.ceil(reach / place.step), 1)
        step = lasting / n
        for i in range(2 * n):
            time = begun + step * (i // 2 + 0.5 + (GAUSS if i % 2 == 1 else -GAUSS))
            nearest = place.within
            if place.weight > 0.0:
                for p in range(parts.n):
                    there = part_along(lib, p * n_edges + edge, pose, time)
                    nearest = part_distance(scene, lib, p, there, nearest)
            at = part_along(lib, group, pose, time)
            total += 0.5 * step * place_rate(place, at, pieces.twist[k], nearest)
        begun += lasting
    return total


@bare_kernel
def word_place(
    scene: Scene,
    lib: LatticeArrays,
    start: Array,
    trims: IntArray,
    durations: Array,
    edges: IntArray,
) -> float:
    """Price of the places along a word from a pose (4,); an edge leads to a trim, -1 for none."""
    return steps_place(scene, lib, start, trims, durations, edges, trims.shape[0])


@bare_inner_kernel
def steps_place(
    scene: Scene,
    lib: LatticeArrays,
    start: Array,
    trims: IntArray,
    durations: Array,
    edges: IntArray,
    n: int,
) -> float:
    """`word_place` of the first `n` steps."""
    pose, total = (start[0], start[1], start[2], start[3]), 0.0
    for k in range(n):
        if edges[k] >= 0:
            total += edge_place(scene, lib, edges[k], pose)
            pose = edge_end(lib, edges[k], pose)
        total += coast_place(scene, lib, trims[k], pose, durations[k])
        pose = coasted(lib, trims[k], pose, durations[k])
    return total

"""Whether a maneuver stays free, piece by piece of its course, and where it ends."""

from __future__ import annotations

from maneuver_automaton._compile import bare_inner_kernel
from maneuver_automaton.collision._kernels_layers import layer_world
from maneuver_automaton.groups._kernels import compose
from maneuver_automaton.search._kernels_parts import part_piece
from maneuver_automaton.search._kernels_window import inside_window
from maneuver_automaton.search.lattice_arrays import LatticeArrays
from maneuver_automaton.search.scene import Scene


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

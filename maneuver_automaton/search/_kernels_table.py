"""Cost to go without obstacles, by one dynamic program backwards from the goal."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array
from maneuver_automaton._compile import inlined_kernel, kernel
from maneuver_automaton.groups._kernels import coast, compose
from maneuver_automaton.search._kernels_distance import pop, push

FULL_TURN = 2.0 * math.pi


@inlined_kernel
def cell_of(x: float, y: float, heading: float, cell: float, half: int, n_headings: int) -> int:
    """Number of the cell of a pose, of all headings, rows and columns; -1 outside."""
    i = math.floor(x / cell + 0.5) + half
    j = math.floor(y / cell + 0.5) + half
    size = 2 * half + 1
    if not (0 <= i < size and 0 <= j < size):
        return -1
    turn = heading / FULL_TURN
    k = math.floor((turn - math.floor(turn)) * n_headings + 0.5) % n_headings
    return (k * size + j) * size + i


@kernel
def fill_table(
    twists: Array,
    rates: Array,
    edge_durations: Array,
    cell: float,
    half: int,
    n_headings: int,
    mirrored: bool,
) -> NDArray[np.float32]:
    """Cost (headings, rows, columns) from each cell to the goal in the middle; inf if not reached.

    Dijkstra over cells that each hold the exact pose of the cheapest path found. Where the library
    is its own mirror image, only poses on the left are looked at, and written twice.
    """
    size = 2 * half + 1
    n = n_headings * size * size
    value = np.full(n, np.inf)  # least cost from each cell to the goal that is known so far
    poses = np.empty((n, 3))  # where the path of that cost begins, of cells with a finite value
    closed = np.zeros(n, dtype=np.uint8)  # 1 once the value of a cell is final
    # The open list, a binary heap. A cell is pushed again each time that its value falls; its older
    # entries are passed over once it is closed. Where the heap is full, a lower value is left out.
    room = 4 * n + 16
    keys, items = np.empty(room), np.empty(room, dtype=np.int64)
    goal = cell_of(0.0, 0.0, 0.0, cell, half, n_headings)
    value[goal] = 0.0
    poses[goal, 0] = poses[goal, 1] = poses[goal, 2] = 0.0
    push(keys, items, 0, 0.0, goal)
    queued = 1
    while queued > 0:
        here = pop(keys, items, queued)
        queued -= 1
        if closed[here]:
            continue
        closed[here] = 1
        x, y, heading, cost = poses[here, 0], poses[here, 1], poses[here, 2], value[here]
        for trim in range(twists.shape[0]):
            for q in range(edge_durations.shape[1]):
                t = edge_durations[trim, q]
                if not t > 0.0:
                    continue
                # Backwards in time: from there the coast leads here.
                d_x, d_y, turn = coast(twists[trim, 0], twists[trim, 1], twists[trim, 2], -t)
                n_x, n_y, n_heading = compose(x, y, heading, d_x, d_y, turn)
                if mirrored and n_y < 0.0:
                    n_y, n_heading = -n_y, -n_heading  # costs as much as its image
                there = cell_of(n_x, n_y, n_heading, cell, half, n_headings)
                if there < 0 or closed[there]:
                    continue
                candidate = cost + t * rates[trim]
                if candidate < value[there] and queued < room:
                    value[there] = candidate
                    poses[there, 0], poses[there, 1], poses[there, 2] = n_x, n_y, n_heading
                    push(keys, items, queued, candidate, there)
                    queued += 1
    out = np.empty((n_headings, size, size), dtype=np.float32)
    for k in range(n_headings):
        for j in range(size):
            for i in range(size):
                best = value[(k * size + j) * size + i]
                if mirrored:  # (x, -y, -heading)
                    image = ((n_headings - k) % n_headings * size + size - 1 - j) * size + i
                    best = min(best, value[image])
                out[k, j, i] = best
    return out

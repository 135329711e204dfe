"""Slow twins of what the lattice looks up: Dijkstra by SciPy, by a dictionary, by sight."""

from __future__ import annotations

import itertools
import math

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from maneuver_automaton._arrays import Array
from tests.reference import plain_end
from tests.reference_collision import distances_of


def centre_clearances(grid, field) -> Array:
    """Clearance (rows, columns) of a point in the middle of every cell of a distance grid."""
    f_j = np.arange(grid.layout.rows) * grid.layout.stride + grid.layout.shift_y
    f_i = np.arange(grid.layout.columns) * grid.layout.stride + grid.layout.shift_x
    in_j = (f_j >= 0) & (f_j < field.distance.shape[0])
    in_i = (f_i >= 0) & (f_i < field.distance.shape[1])
    clear = np.full((grid.layout.rows, grid.layout.columns), np.inf)
    clear[np.ix_(in_j, in_i)] = distances_of(field)[np.ix_(f_j[in_j], f_i[in_i])]
    return clear


def cells_open(grid, field) -> Array:
    """Which cells (rows, columns) of a distance grid the pose may be in."""
    return np.asarray(centre_clearances(grid, field) >= grid.walls.inflation)


def grid_distances(open_: Array, price: Array, cell: float, seeds: list[tuple[int, int]]) -> Array:
    """Octile distance [m] of every open cell (rows, columns) from seeds (row, column), or inf.

    A step costs its length times the `price` (rows, columns) of the cell it leads into, one across
    a corner 41 / 29 of another. Seeds may be closed; no way leads through another closed cell.
    """
    rows, columns = open_.shape
    number = np.arange(open_.size).reshape(open_.shape)
    leave = open_.copy()
    for seed in seeds:
        leave[seed] = True
    begins, ends, lengths = [], [], []
    for b, a in itertools.product((-1, 0, 1), repeat=2):
        if a == b == 0:
            continue
        here = (slice(max(0, -b), rows - max(0, b)), slice(max(0, -a), columns - max(0, a)))
        there = (slice(max(0, b), rows - max(0, -b)), slice(max(0, a), columns - max(0, -a)))
        step = leave[here] & open_[there]
        begins.append(number[here][step])
        ends.append(number[there][step])
        lengths.append(cell * (41 / 29 if a and b else 1.0) * price[there][step])
    graph = coo_array(
        (np.concatenate(lengths), (np.concatenate(begins), np.concatenate(ends))),
        shape=(open_.size, open_.size),
    ).tocsr()
    sources = [int(number[seed]) for seed in seeds]
    away = dijkstra(graph, indices=sources, min_only=True).reshape(open_.shape)
    return np.where(open_, away, np.inf)


def shortest_way(solids: shapely.Geometry, start: Array, goal: Array) -> float:
    """Length [m] of the shortest way of a point around polygons: over corners in sight."""
    parts = [p for p in shapely.get_parts(shapely.union_all(solids)) if not p.is_empty]
    corners = [shapely.get_coordinates(part)[:-1] for part in parts]
    points = np.concatenate([[start, goal], *corners])
    blocked = shapely.union_all(parts).buffer(-1e-7)
    shapely.prepare(blocked)
    n = len(points)
    i, j = np.triu_indices(n, 1)
    lines = shapely.linestrings(np.stack([points[i], points[j]], axis=1))
    clear = ~shapely.intersects(blocked, lines)
    lengths = np.hypot(*(points[i] - points[j]).T)
    graph = coo_array((lengths[clear] + 1e-300, (i[clear], j[clear])), shape=(n, n)).tocsr()
    return float(dijkstra(graph, directed=False, indices=0)[1])


class Heap:
    """A binary heap as in a textbook: of what costs the same, its order decides."""

    def __init__(self) -> None:
        self.keys: list[float] = []
        self.items: list[object] = []

    def push(self, key: float, item: object) -> None:
        self.keys.append(key)
        self.items.append(item)
        k = len(self.keys) - 1
        while k and self.keys[k] < self.keys[(k - 1) // 2]:
            self._swap(k, (k - 1) // 2)
            k = (k - 1) // 2

    def pop(self) -> object:
        self._swap(0, len(self.keys) - 1)
        self.keys.pop()
        item = self.items.pop()
        k = 0
        while (down := 2 * k + 1) < len(self.keys):
            if down + 1 < len(self.keys) and self.keys[down + 1] < self.keys[down]:
                down += 1
            if self.keys[k] <= self.keys[down]:
                break
            self._swap(k, down)
            k = down
        return item

    def _swap(self, i: int, j: int) -> None:
        self.keys[i], self.keys[j] = self.keys[j], self.keys[i]
        self.items[i], self.items[j] = self.items[j], self.items[i]


def cost_table(twists, rates, edge_durations, cell: float, half: int, n_headings: int) -> Array:
    """Cost (headings, rows, columns) to the goal in the middle, inf where none was found.

    Dijkstra backwards over a dictionary of cells, each with the pose by which it was reached.
    """

    def cell_of(pose):
        i, j = (math.floor(value / cell + 0.5) for value in pose[:2])
        k = math.floor((pose[2] / (2 * math.pi)) % 1.0 * n_headings + 0.5) % n_headings
        return (k, j, i) if max(abs(i), abs(j)) <= half else None

    settled: dict[tuple[int, int, int], float] = {}
    best = {cell_of((0.0, 0.0, 0.0)): (0.0, (0.0, 0.0, 0.0))}
    frontier = Heap()
    frontier.push(0.0, cell_of((0.0, 0.0, 0.0)))
    while frontier.keys:
        here = frontier.pop()
        if here in settled:
            continue
        cost, (x, y, heading) = best[here]
        settled[here] = cost
        for twist, rate, times in zip(twists, rates, edge_durations, strict=True):
            for t in times:
                if t == 0.0:
                    continue
                step = plain_end([twist], [-t])
                place = complex(x, y) + complex(step[0], step[1]) * np.exp(1j * heading)
                there = (place.real, place.imag, heading + step[2])
                key = cell_of(there)
                if key is None or key in settled:
                    continue
                if cost + t * rate < best.get(key, (math.inf,))[0]:
                    best[key] = cost + t * rate, there
                    frontier.push(cost + t * rate, key)
    table = np.full((n_headings, 2 * half + 1, 2 * half + 1), np.inf)
    for (k, j, i), cost in settled.items():
        table[k, j + half, i + half] = cost
    return table

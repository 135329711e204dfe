"""The cheapest way of a point over ground that has a price, as a corridor for a vehicle."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.collision import OccupancyMap
from maneuver_automaton.collision._kernels_field import write_all
from maneuver_automaton.groups import SE2
from maneuver_automaton.planning.blocked import blocked_ends
from maneuver_automaton.problem import Problem
from maneuver_automaton.search.lattice_query import LatticeQuery
from maneuver_automaton.search.place_arrays import FORBIDDEN

CELLS, MOST_CELLS = 20_000, 200_000  # of the grid that a way is found on: at first, at last
NARROW = 1.1  # times what a way costs at the least rate of each cell, above which cells are halved
STEPS = [(i, j) for i in range(-2, 3) for j in range(-2, 3) if math.gcd(i, j) == 1]  # 16 ways on
WIDE = 3.0  # half widths of a corridor, in length scales of the vehicle
COSTLIER = 1.1  # times what a metre costs on the way


def with_cheapest_way_left(query: LatticeQuery) -> Iterator[Problem]:
    """Problems with all closed but a corridor along the cheapest way of a point, where ends allow.

    The way leads over cells of a grid, halved while that may pay, each at what its place costs
    under the heading of a step, and at the invariant cost of a metre. What costs more than the way
    beside it is closed, too, but for around the ends: in the second problem from a length scale on,
    in the last not at all. In the first nothing has a price for a vehicle with maneuvers. There is
    none where none is sampled: near obstacles nothing costs more than elsewhere.
    """
    from scipy import ndimage

    place, library = query.around.place, query.library
    if not place.value.size:
        return
    whole = _rates_ahead(query) + library.per_metre
    every, finest = (math.ceil(math.sqrt(whole[0].size / most)) for most in (CELLS, MOST_CELLS))
    low = np.array([place.origin_x, place.origin_y])
    places = np.vstack([query.start, *query.goals])[:, :2] - low
    while True:
        rates, cell = whole[:, ::every, ::every], every * place.cell
        ends = np.rint(places / cell).clip(0, np.array(rates.shape[:0:-1]) - 1).astype(np.int64)
        cost, way = _cheapest_way(rates, ends)
        if every <= finest:
            break
        around = ndimage.minimum_filter(whole, (1, every, every))[:, ::every, ::every]
        if cost <= NARROW * _cheapest_way(around, ends)[0]:
            break
        every = max(finest, every // 2)
    least = rates.min(axis=0)
    aside, out = np.ones(least.shape, dtype=np.bool_), np.ones(least.shape, dtype=np.bool_)
    aside[tuple(way.T)], out[ends[:, 1], ends[:, 0]] = False, False
    far, (i, j) = ndimage.distance_transform_edt(aside, return_indices=True)
    near = max(library.radius, query.world.body.reach) / cell
    half = WIDE * near + 1.0
    costlier = (least > COSTLIER * least[i, j]) & (ndimage.distance_transform_edt(out) > half)
    corner = SE2(query.world.frame) @ SE2(np.array([*(low - 0.5 * cell), 0.0]))
    for off in (0.0, near, half):
        closed = (far > half) | (costlier & (far > off))
        walls = OccupancyMap(closed, resolution=cell, origin=corner.pose, name="beside the way")
        costs = query.problem.place_costs if off or library.at_will else ()
        obstacles = (*query.problem.obstacles, walls)
        problem = replace(query.problem, obstacles=obstacles, place_costs=costs)
        if blocked_ends(problem) is None:
            yield problem


def _rates_ahead(query: LatticeQuery) -> Array:
    """Rates (n, rows, columns) a metre of places under way in n headings; where it hits, more."""
    place, field = query.around.place, query.plane.arrays.field
    rates = place.value[0].astype(np.float64)
    if len(place.value) > 1:
        twists = query.library.arrays.library.twists
        rates += place.value[2] / np.hypot(twists[:, 0], twists[:, 1]).max()
    if field.distance.size:
        write_all(field)
        far = np.pad(field.distance, 1, constant_values=field.outside)
        rows, columns = rates.shape[1:]
        x = place.origin_x + place.cell * np.arange(columns) - field.origin_x
        y = place.origin_y + place.cell * np.arange(rows) - field.origin_y
        i, j = (
            np.clip(np.rint(along / field.cell).astype(np.int64) + 1, 0, n - 1)
            for along, n in ((y, far.shape[0]), (x, far.shape[1]))
        )
        rates += FORBIDDEN * (far[np.ix_(i, j)] < query.plane.body.inscribed)
    return np.asarray(rates)


def _cheapest_way(rates: Array, ends: IntArray) -> tuple[float, IntArray]:
    """Cost in cells, and cells (n, 2) row and column, from the first end (x, y) to another."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import dijkstra

    turns, rows, columns = rates.shape
    number = np.arange(rows * columns).reshape(rows, columns)
    steps = []
    for i, j in STEPS:
        here = number[max(-i, 0) : rows - max(i, 0), max(-j, 0) : columns - max(j, 0)].ravel()
        there = here + i * columns + j
        rate = rates[round(turns * math.atan2(i, j) / math.tau) % turns].ravel()
        steps.append((0.5 * math.hypot(i, j) * (rate[here] + rate[there]), here, there))
    cost, first, second = map(np.concatenate, zip(*steps, strict=True))
    graph = coo_array((cost, (first, second)), shape=(number.size, number.size)).tocsr()
    begin, *goals = (ends[:, 1] * columns + ends[:, 0]).tolist()
    value, before = dijkstra(graph, indices=begin, return_predecessors=True)
    cells = [min(goals, key=lambda goal: float(value[goal]))]
    while cells[-1] != begin:
        cells.append(int(before[cells[-1]]))
    return float(value[cells[0]]), np.column_stack(np.divmod(cells, columns))

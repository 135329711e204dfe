"""What places cost, as searches see it: one clearance by itself, all else sampled on a raster."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array
from maneuver_automaton._kept import kept_with
from maneuver_automaton.collision.surroundings import parts_of
from maneuver_automaton.groups import SE2
from maneuver_automaton.places import (
    Clearance,
    PlaceCost,
    allowed,
    bound,
    extent_of,
    rates_along,
    scale_of,
)
from maneuver_automaton.problem import Problem
from maneuver_automaton.search.arrays import LeastPrices, PlaceArrays
from maneuver_automaton.search.distance_grid import NO_PRICES
from maneuver_automaton.search.lattice_library import LatticeLibrary

TURNS = 32  # headings of a raster, where they matter
FINE = 0.25  # cells of a raster, in half widths of the body ...
ROUGH = 0.1  # ... or in length scales of a vehicle that is a point
MOST_SAMPLES = 1 << 21  # of a raster: 8 MiB
ALONG = 1.0  # cells from sample to sample along a motion, at most ...
NEARING = 0.5  # ... and shares of the distance within which obstacles are dear
FORBIDDEN = 1e3  # per metre, where the vehicle must not be at all
FOUR = (-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)  # quarters of a cell
BESIDE = 4.0  # length scales, to whole multiples of which the box of a raster is widened

NOTHING = PlaceArrays(
    weight=0.0,
    within=0.0,
    per_second=False,
    step=math.inf,
    value=np.zeros((1, 1, 0, 0), dtype=np.float32),
    origin_x=0.0,
    origin_y=0.0,
    cell=1.0,
)


def place_arrays(
    problem: Problem, library: LatticeLibrary, frame: Array, box: Array
) -> PlaceArrays:
    """What places cost within a box (4,), seen from a frame (3,); of what is beyond, the border.

    The first clearance is that of the body that there is, whatever its parts. All other costs are
    kept with the setting, at samples as near as suits the vehicle.
    """
    found = NOTHING
    near = next((one for one in problem.place_costs if isinstance(one, Clearance)), None)
    others = [one for one in problem.place_costs if one is not near]
    if near is not None:
        found = found._replace(
            weight=float(near.weight),
            within=float(near.within),
            per_second=near.per == "second",
            step=NEARING * float(near.within),
        )
    if not others:
        return found
    unit = BESIDE * float(library.radius)
    low, high = np.floor(box[:2] / unit) * unit, np.ceil(box[2:] / unit) * unit
    own = FINE * library.half_width or ROUGH * library.radius
    key = "places", tuple(frame.tolist()), *low.tolist(), *high.tolist(), float(own)

    def sampled() -> PlaceArrays:
        costs = [bound(one, problem.setting) for one in others]
        return _sampled(problem, costs, frame, low, high, cell=float(own))

    kept = kept_with(problem.setting, key, sampled)
    step = min(found.step, ALONG * kept.cell)
    return kept._replace(
        weight=found.weight, within=found.within, per_second=found.per_second, step=step
    )


def least_prices(
    problem: Problem, place: PlaceArrays, cell: float, *, inscribed: float, per_metre: float
) -> LeastPrices:
    """What a step between cells of a grid [m] costs for its place at least, for its estimates.

    Whatever the heading, within a cell and a half: where the step begins and ends. A body whose
    inscribed disc is about its pose is nearer to obstacles than the pose by its radius.
    """
    if not per_metre > 0.0:
        return NO_PRICES
    found, samples = NO_PRICES, place.value
    if samples.size:

        def least() -> NDArray[np.float32]:
            from scipy import ndimage

            flat = samples[:2].min(axis=(0, 1)) / per_metre
            size = 2 * math.ceil((1.5 * cell + place.cell) / place.cell) + 1
            return np.asarray(ndimage.minimum_filter(flat, size, mode="nearest"), np.float32)

        key = ("least prices", cell, per_metre, place.cell, place.origin_x, place.origin_y)
        found = found._replace(
            value=kept_with(problem.setting, (*key, *samples.shape), least),
            origin_x=place.origin_x,
            origin_y=place.origin_y,
            cell=place.cell,
        )
    if place.weight > 0.0 and not place.per_second and inscribed > 0.0:
        reach = inscribed - 1.5 * math.sqrt(2.0) * cell
        near = place.weight / per_metre
        found = found._replace(near=near, within=place.within, reach=reach)
    return found


def known_distance(problem: Problem) -> float:
    """How far [m] from obstacles distances have to be known: where they are kept, or dear."""
    near = [one.within for one in problem.place_costs if isinstance(one, Clearance)]
    return max([float(problem.margin), *near])


def driven_back(place: PlaceArrays) -> PlaceArrays:
    """The same for a vehicle whose motions are those of another one in reverse."""
    if len(place.value) == 1:
        return place
    return place._replace(value=np.ascontiguousarray(place.value[[1, 0, 2]]))


def _sampled(
    problem: Problem,
    costs: Sequence[PlaceCost],
    frame: Array,
    low: Array,
    high: Array,
    *,
    cell: float,
) -> PlaceArrays:
    """Costs on a raster of cells, larger ones where it would have too many samples."""
    same = all(getattr(one, "isotropic", False) for one in costs)
    turns = 1 if same else TURNS
    sheets = 1 if same and all(one.per == "metre" for one in costs) else 3
    cell = max(cell, math.sqrt(float((high - low).prod()) * turns * sheets / MOST_SAMPLES))
    columns, rows = (np.ceil((high - low) / cell).astype(int) + 1).tolist()
    headings = np.arange(turns) * (2.0 * math.pi / turns)
    ahead = np.eye(problem.start.size)[0]
    value = np.zeros((sheets, turns, rows, columns))
    dear = [(one, _dear(one, frame, low, cell)) for one in costs]
    # Each sample is the mean of four about it: so the areas of what is sampled stay what they are.
    for (x, y), (one, (i, j)) in product((0.25 * cell * np.array(FOUR)).tolist(), dear):
        along = (x + low[0] + cell * np.arange(columns)[j], y + low[1] + cell * np.arange(rows)[i])
        at = np.meshgrid(headings, *along[::-1], indexing="ij")
        poses = (SE2(frame) @ SE2(np.stack(at[::-1], axis=-1))).pose
        higher = np.broadcast_to(problem.start[3:], (*poses.shape[:-1], problem.start.size - 3))
        poses = np.concatenate([poses, higher], axis=-1)
        for sheet in (2,) if one.per == "second" else range(min(sheets, 2)):
            velocities = np.broadcast_to(ahead * (1.0, -1.0, 1.0)[sheet], poses.shape)
            forbidden = np.where(allowed(one, poses, velocities), 0.0, FORBIDDEN)
            value[sheet, :, i, j] += 0.25 * (rates_along(one, poses, velocities) + forbidden)
    if (value == value[:, :1]).all():
        value = value[:, :1]
    if sheets == 3 and (value[0] == value[1]).all() and not value[2].any():
        value = value[:1]
    return NOTHING._replace(
        value=np.ascontiguousarray(value, dtype=np.float32),
        origin_x=float(low[0]),
        origin_y=float(low[1]),
        cell=float(cell),
    )


def _dear(one: PlaceCost, frame: Array, low: Array, cell: float) -> tuple[slice, slice]:
    """The rows and columns of a raster beyond which a place costs nothing."""
    if not (extent := extent_of(one)):
        return slice(None), slice(None)
    parts = parts_of(extent)
    places = SE2(frame).inverse().act([part.middle for part in parts])
    reach = np.array([[part.reach] for part in parts]) + scale_of(one) + cell
    ends = np.stack([(places - reach).min(axis=0), (places + reach).max(axis=0) + cell]) - low
    (j, i), (n, m) = np.maximum(ends // cell, 0.0).astype(int).tolist()
    return slice(i, m), slice(j, n)

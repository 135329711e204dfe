"""Cost-to-go tables: by symmetry one dynamic program serves every goal, and every later run.

An estimate, not a bound: cells round poses.
"""

from __future__ import annotations

import contextlib
import hashlib
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._cache_files import keep_within, read_checked, used_now, write_checked
from maneuver_automaton._kept import RECENT, Prepared, kept_by_first
from maneuver_automaton._kernel_folders import user_cache_folder
from maneuver_automaton.problem import Problem
from maneuver_automaton.search._kernels_estimate import fill_table
from maneuver_automaton.search.arrays import CostTable
from maneuver_automaton.search.lattice_library import LatticeLibrary, lattice_library
from maneuver_automaton.search.lattice_trims import is_mirrored

FOLDER = "cost_to_go"  # of the user's cache folder
HALF = 48  # cells from the middle to the rim
HEADINGS = 72
REACH = 3.0  # [turning radii] from the middle to the rim, where nothing else is asked for
SHAPE = (HEADINGS, 2 * HALF + 1, 2 * HALF + 1)
MOST_BYTES = 500_000_000  # of all tables that are kept on disk
SCALES = (0.09, 0.18, 0.36)  # lengths of the program's edges, in those of the lattice's longest


NOTHING = np.zeros((0, 1, 1), dtype=np.float32)
NO_TABLE = CostTable(NOTHING, NOTHING, 1.0, 0)


def cost_to_go_table(
    problem: Problem,
    *,
    reach: float | None = None,
    folder: Path | None = None,
    prepared: Prepared = RECENT,
) -> CostTable:
    """Cost from every pose within `reach` of the goal, without obstacles, for any goal.

    Half the side of the square around the goal is `reach` [m], three turning radii if None. Tables
    are kept in files of `folder`, the user's cache folder if None, named after a hash of their key;
    where nothing can be written it works without. ``value[k, j, i]`` belongs to the pose
    ``((i - half) cell, (j - half) cell, k 2 pi / n)`` seen from the goal.
    """
    library = lattice_library(problem, prepared=prepared)
    size = REACH * library.radius if reach is None else reach
    if not (math.isfinite(size) and size > 0.0):
        raise ValueError(f"reach must be positive, got {size} m")
    return prepared.once(_kept, *_made_from(library, size), folder)


@kept_by_first
def _made_from(library: LatticeLibrary, reach: float) -> tuple[bytes, bytes, bytes, float, bool]:
    """The key of a table: twists, rates and edge durations of the trims that move, and its size."""
    arrays = library.arrays.library
    m = arrays.n_trims
    moving = arrays.twists[:m].any(axis=1)
    twists, rates = arrays.twists[:m][moving, :3].copy(), arrays.rates[:m][moving].copy()
    longest = library.arrays.coasts.durations[moving].max(axis=1)
    edge_durations = np.multiply.outer(longest, SCALES)
    cell = reach / HALF
    smallest = np.where(arrays.twists[:m][moving, :2].any(axis=1), cell, 0.0)
    speed = np.hypot(twists[:, 0], twists[:, 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        least = np.where(speed > 0.0, smallest / speed, 0.0)
    edge_durations = np.maximum(edge_durations, np.multiply.outer(least, [1.0, 2.0, 4.0]))
    mirrored = is_mirrored(arrays.twists[:m, :3], arrays.rates[:m])
    return twists.tobytes(), rates.tobytes(), edge_durations.tobytes(), reach, mirrored


def _kept(
    twists: bytes,
    rates: bytes,
    edge_durations: bytes,
    reach: float,
    mirrored: bool,
    folder: Path | None,
) -> CostTable:
    """The table from memory, from the cache folder, or made anew."""
    cell = reach / HALF
    digest = hashlib.sha256(twists + rates + edge_durations)
    digest.update(repr((reach, mirrored, HALF, HEADINGS, 1)).encode())
    path = (folder or user_cache_folder() / FOLDER) / f"{digest.hexdigest()[:24]}.table"
    value = _load(path)
    if value is None:
        value = fill_table(
            np.frombuffer(twists).reshape(-1, 3).copy(),
            np.frombuffer(rates).copy(),
            np.frombuffer(edge_durations).reshape(-1, len(SCALES)).copy(),
            cell,
            (HEADINGS, HALF),
            mirrored,
        )
        _save(value, path)
    return CostTable(value, _to_any_heading(value), cell, HALF)


def _to_any_heading(value: NDArray[np.float32]) -> NDArray[np.float32]:
    """The least of a table over the headings of its goal, from every pose seen from the goal."""
    n, size, _ = value.shape
    half = size // 2
    turns = np.arange(n) * (2.0 * np.pi / n)
    # rings: from (r, 0) with a heading, turned around the goal by all turns
    reach = np.arange(half + 1)
    i = np.rint(reach[:, None] * np.cos(turns)).astype(int) + half
    j = np.rint(reach[:, None] * np.sin(turns)).astype(int) + half
    k = (np.arange(n)[:, None] + np.arange(n)) % n  # (heading, turn)
    rings = value[k[None], j[:, None, :], i[:, None, :]].min(axis=2)  # (r, heading)
    x, y = np.meshgrid(np.arange(size) - half, np.arange(size) - half)
    radius = np.rint(np.hypot(x, y)).astype(int)
    bearing = np.rint(np.arctan2(y, x) / (2.0 * np.pi / n)).astype(int)
    heading = (np.arange(n)[:, None, None] - bearing) % n
    rings = np.vstack([rings, np.full((1, n), np.inf, dtype=np.float32)])
    return np.ascontiguousarray(rings[np.minimum(radius, half + 1), heading])


def _load(path: Path) -> NDArray[np.float32] | None:
    """A table from a file; None if there is none that can be used."""
    try:
        content = read_checked(path)
        if content is None:
            return None
        table = np.frombuffer(content, dtype=np.float32).reshape(SHAPE)
    except (OSError, ValueError):
        return None  # damaged: it is made and written anew
    used_now(path)
    return table.copy()


def _save(value: NDArray[np.float32], path: Path) -> None:
    """Write a table, and keep the folder small; where nothing can be written it is made again."""
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_checked(path, value.tobytes())
        keep_within(path.parent, MOST_BYTES)

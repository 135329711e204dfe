"""Tables of the cost to go: those of a slow Dijkstra, halved by mirrors, kept whole on disk."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from maneuver_automaton._cache_files import write_checked
from maneuver_automaton._kept import RECENT
from maneuver_automaton.automaton import Automaton
from maneuver_automaton.costs import Cost
from maneuver_automaton.models import Unicycle
from maneuver_automaton.problem import Problem
from maneuver_automaton.search import cost_to_go
from maneuver_automaton.search._kernels_estimate import fill_table
from maneuver_automaton.search.cost_to_go import cost_to_go_table
from tests import scenes
from tests.reference_lattice import cost_table
from tests.search.cases import compiled_only

HALF, HEADINGS, CELL = 7, 12, 0.31
ODD = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 1.13], [0.9, 0.0, -1.27], [-0.7, 0.1, 0.3]])
RATES = np.array([1.0, 1.171, 1.313, 1.557])
EDGE_DURATIONS = np.array(
    [[0.37, 0.91, 0.0], [0.41, 0.83, 0.0], [0.43, 0.97, 0.0], [0.57, 1.13, 0.0]]
)
SIX = np.array([[v, 0.0, v * w] for v in (1.0, -1.0) for w in (1.0, 0.0, -1.0)])


@pytest.mark.parametrize("n", [1, 2, 4])
def test_the_table_is_that_of_a_dictionary(n):
    got = fill_table(ODD[:n], RATES[:n], EDGE_DURATIONS[:n], CELL, (HEADINGS, HALF), False)
    slow = cost_table(ODD[:n], RATES[:n], EDGE_DURATIONS[:n], CELL, HALF, HEADINGS)
    assert np.array_equal(np.isinf(got), np.isinf(slow))
    known = np.isfinite(slow)
    assert known.sum() > 7
    assert got[known] == pytest.approx(slow[known], rel=1e-6)
    assert got[0, HALF, HALF] == 0.0


def test_mirrored_and_whole_agree():
    edge_durations = np.tile([0.15, 0.31, 0.62], (6, 1))
    rates = np.full(6, 1.0)
    half = 16
    shared = (SIX, rates, edge_durations, 0.15, (36, half))
    whole, mirrored = fill_table(*shared, False), fill_table(*shared, True)
    image = mirrored[(36 - np.arange(36)) % 36, ::-1]
    assert np.array_equal(mirrored, image)
    both = np.isfinite(whole) & np.isfinite(mirrored)
    assert both.mean() > 0.9
    off = whole[both] - mirrored[both]
    assert np.abs(off).mean() < 0.1
    assert abs(off.mean()) < 0.05


def controls(**trims):
    return Automaton.of_controls(Unicycle(), trims)


# --- what is kept on disk ---

SMALL = Problem(controls(on=(1.0, 0.0), left=(1.0, 1.0)), [0, 0, 0], [1, 0, 0])


def kept_in(folder):
    """A table as another process would get it: from the folder, or made anew."""
    RECENT.__dict__.pop("_kept", None)
    return cost_to_go_table(SMALL, reach=1.5, folder=folder).value


@compiled_only
@pytest.mark.parametrize("damage", ["empty", "foreign", "short", "flipped", "another"])
def test_a_damaged_file_is_made_anew(tmp_path, damage):
    made = kept_in(tmp_path)
    (path,) = tmp_path.iterdir()
    whole = path.read_bytes()
    contents = {
        "empty": b"",
        "foreign": b"\x93NUMPY\x01\x00v\x00{'descr': '<f4'",
        "short": whole[:-1000],
        "flipped": whole[:5000] + bytes([whole[5000] ^ 1]) + whole[5001:],
    }
    if damage == "another":
        write_checked(path, np.zeros((2, 3, 3), dtype=np.float32).tobytes())
    else:
        path.write_bytes(contents[damage])
    assert np.array_equal(kept_in(tmp_path), made)
    assert path.read_bytes() == whole


@compiled_only
def test_tables_used_least_recently_go(tmp_path, monkeypatch):
    kept_in(tmp_path)
    (path,) = tmp_path.iterdir()
    size = path.stat().st_size
    monkeypatch.setattr(cost_to_go, "MOST_BYTES", 3 * size)
    others = [tmp_path / f"{k}.npy" for k in range(3)]  # as an earlier version wrote them
    for k, other in enumerate(others):
        other.write_bytes(bytes(size))
        os.utime(other, (1000 + k, 1000 + k))
    os.utime(path, (1, 1))
    kept_in(tmp_path)  # read, and so used now
    more = Problem(SMALL.automaton, [0, 0, 0], [1, 0, 0], cost=Cost(time=2.0))
    cost_to_go_table(more, reach=1.5, folder=tmp_path)
    assert path.exists()
    assert [other.exists() for other in others] == [False, False, True]


@compiled_only
def test_nothing_is_left_behind_when_writing_fails(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    assert kept_in(tmp_path).any()
    assert list(tmp_path.iterdir()) == []


def test_a_free_heading_costs_the_least_of_all_headings():
    table = cost_to_go_table(Problem(scenes.reeds_shepp(1.0), [0, 0, 0], [1, 0, 0]))
    n, half = len(table.value), table.half
    rng = np.random.default_rng(3)
    off = []
    for _ in range(200):
        x, y = rng.integers(-half // 2, half // 2, 2)
        k = int(rng.integers(n))
        turns = np.arange(n) * (2.0 * np.pi / n)  # of the goal: the pose is seen from it
        seen_x = np.rint(np.cos(turns) * x + np.sin(turns) * y).astype(int) + half
        seen_y = np.rint(np.cos(turns) * y - np.sin(turns) * x).astype(int) + half
        least = table.value[(k - np.arange(n)) % n, seen_y, seen_x].min()
        off.append(abs(table.free[k, y + half, x + half] - least))
    assert np.max(off) < 0.4  # cells are 1 / 16 of a turning radius, and are rounded twice
    assert np.mean(off) < 0.05

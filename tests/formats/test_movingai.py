"""Maps and queries of MovingAI: which way is up, where a cell's middle is, what is wrong."""

from __future__ import annotations

import heapq
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from maneuver_automaton.collision import OccupancyMap
from maneuver_automaton.formats.movingai import (
    load_movingai_map,
    read_movingai_map,
    read_movingai_scenario,
    save_movingai_map,
)
from tests.formats.outside import DATA, message_of, needs_data

MAP = "type octile\nheight 2\nwidth 3\nmap\n.@G\nTSW\n"
QUERY = "0\troom.map\t3\t2\t0\t0\t2\t0\t2.0\n"
SCEN = f"version 1\n{QUERY}1\troom.map\t3\t2\t2\t1\t0\t0\t2.5\n"


def queries(folder, text=SCEN):
    (folder / "room.map").write_text(MAP)
    path = folder / "room.map.scen"
    path.write_bytes(text.encode())
    return path


@pytest.mark.parametrize(
    "text", [MAP, MAP.replace("\n", "\r\n"), "\ufeff" + MAP, MAP + "\n\n", MAP[:-1]]
)
def test_the_first_row_is_the_highest(tmp_path, text):
    path = tmp_path / "room.map"
    path.write_bytes(text.encode())
    cells = load_movingai_map(path)
    assert cells.blocked.tolist() == [[True, True, True], [False, True, False]]
    assert (cells.resolution, cells.origin.tolist()) == (1.0, [0.0, 0.0, 0.0])
    (world,) = read_movingai_map(path)
    assert (world.bounds.x, world.bounds.y) == ((0.0, 3.0), (0.0, 2.0))
    assert world.start is None


def test_queries_begin_and_end_in_the_middle_of_cells(tmp_path):
    first, second = read_movingai_scenario(queries(tmp_path))
    assert first.start[:2].tolist() == [0.5, 1.5]
    assert first.goal[:2].tolist() == [2.5, 1.5]
    assert second.start[:2].tolist() == [2.5, 0.5]
    assert second.name == "room.map case 1"
    assert first.obstacles[0] is second.obstacles[0]


def test_headings_are_drawn_and_stay(tmp_path):
    one, two = (read_movingai_scenario(queries(tmp_path)) for _ in range(2))
    assert [q.start.tolist() for q in one] == [q.start.tolist() for q in two]
    assert one[0].start[2] != one[1].start[2]
    assert not one[0].headings
    assert all(abs(q.goal[2]) <= math.pi for q in one)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (MAP, "", ":1: got nothing, need 'type octile'"),
        ("type octile", "type", ":1: got 'type', need 'type octile'"),
        ("height 2", "height two", ":2: height: got 'two', need a whole number of at least 1"),
        ("height 2", "height 0", ":2: height: got '0', need a whole number of at least 1"),
        ("height 2", "height -2", ":2: height: got '-2', need a whole number of at least 1"),
        ("height 2", "width 2", ":2: got 'width 2', need 'height N'"),
        ("height 2", "height 1", ": got 2 rows, need 1, its height"),
        ("height 2", "height 3", ": got 2 rows, need 3, its height"),
        ("height 2", "height 99999999", ": got 3 x 99999999 cells, need at most 50 million"),
        ("\nmap\n", "\n", ":4: got '.@G', need 'map'"),
        (".@G", ".@", ":5: got 2 cells, need 3, the width"),
        ("TSW", "TSWW", ":6: got 4 cells, need 3, the width"),
        ("TSW", "T W", ":6: got the cell ' ', need one of .G@OTSW"),
        ("TSW", "TéW", ":6: got the cell 'é', need one of .G@OTSW"),
        ("TSW\n", "TSW\nrest\n", ": got 3 rows, need 2, its height"),
    ],
)
def test_what_is_wrong_with_a_map(tmp_path, old, new, message):
    assert MAP.count(old) == 1
    assert message_of(load_movingai_map, tmp_path / "x.map", MAP.replace(old, new)) == message


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", ":1: got nothing, need 'version 1'"),
        ("version 1\n", ": holds no query, need at least one"),
        ("verson 1\n" + QUERY, ":1: got 'verson 1', need 'version 1'"),
        ("version x\n" + QUERY, ":1: version: got 'x', need a finite number"),
        (SCEN + "1\troom.map\n", ":4: got 2 columns, need 9: bucket, map, width, height, "
         "start x, start y, goal x, goal y, optimal length"),
        ("version 1\n1\t2\n", ":2: got 2 columns, need 9: bucket, map, width, height, start x, "
         "start y, goal x, goal y, optimal length"),
        (SCEN + QUERY.replace("room", "hall"),
         ":4: map: got 'hall.map', need 'room.map' in every line"),
        (SCEN + QUERY.replace("\t3\t", "\t4\t"), ":4: width: got 4, need 3, that of room.map"),
        (SCEN + QUERY.replace("\t0\t0\t", "\t3\t0\t"),
         ":4: start x: got 3, need 0 to 2, a cell of the map"),
        (SCEN + QUERY.replace("\t0\t0\t", "\t0\t-1\t"),
         ":4: start y: got '-1', need a whole number of at least 0"),
        (SCEN + QUERY.replace("\t0\t0\t", "\t0\t0.5\t"),
         ":4: start y: got '0.5', need a whole number of at least 0"),
        (SCEN + QUERY.replace("2.0", "nan"),
         ":4: optimal length: got 'nan', need a finite number"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_queries(tmp_path, text, message):
    queries(tmp_path)
    assert message_of(read_movingai_scenario, tmp_path / "room.map.scen", text) == message


def test_a_map_that_is_not_there(tmp_path):
    path = queries(tmp_path)
    (tmp_path / "room.map").unlink()
    said = message_of(read_movingai_scenario, path, SCEN)
    assert said == f":2: map: got 'room.map', but there is no {tmp_path / 'room.map'}"


@given(cells=arrays(np.bool_, st.tuples(st.integers(1, 6), st.integers(1, 6))))
def test_any_map_comes_back(tmp_path_factory, cells):
    path = tmp_path_factory.mktemp("map") / "x.map"
    save_movingai_map(OccupancyMap(cells, resolution=0.1), path)
    assert load_movingai_map(path).blocked.tolist() == cells.tolist()


def octile(blocked, start, goal):
    """Least length of a way over free cells, as the benchmark counts it; a slow reference."""
    rows, columns = blocked.shape
    best, front = {start: 0.0}, [(0.0, start)]
    while front:
        way, (i, j) = heapq.heappop(front)
        if (i, j) == goal:
            return way
        if way > best[i, j]:
            continue
        for d_i, d_j in ((a, b) for a in (-1, 0, 1) for b in (-1, 0, 1) if a or b):
            to = i + d_i, j + d_j
            if not (0 <= to[0] < rows and 0 <= to[1] < columns) or blocked[to]:
                continue
            if d_i and d_j and (blocked[i + d_i, j] or blocked[i, j + d_j]):
                continue
            length = way + math.hypot(d_i, d_j)
            if length < best.get(to, math.inf) - 1e-12:
                best[to] = length
                heapq.heappush(front, (length, to))
    return math.inf


@needs_data
@pytest.mark.parametrize(("name", "n"), [("Berlin_0_256", 930), ("NewYork_1_512", 1820)])
def test_lengths_of_short_queries_are_those_of_the_file(name, n):
    """Read upside down or mirrored, the map would have other lengths."""
    path = DATA / "movingai" / f"{name}.map.scen"
    cases = read_movingai_scenario(path)
    assert len(cases) == n
    blocked = cases[0].obstacles[0].blocked
    lines = path.read_text().splitlines()[1:]
    for k in (*range(0, 100, 5), 150):
        ends = [(int(p[1]), int(p[0])) for p in (cases[k].start, cases[k].goal)]
        expected = float(lines[k].split("\t")[-1])
        assert octile(blocked, *ends) == pytest.approx(expected, abs=1e-6)
    for case in cases:
        for pose in (case.start, case.goal):
            assert not blocked[int(pose[1]), int(pose[0])]

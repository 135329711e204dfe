"""Environments of SBPL: metres or cells, which way is up, and what is wrong with a file."""

from __future__ import annotations

import numpy as np
import pytest

from maneuver_automaton.formats.sbpl_cfg import is_sbpl, read_sbpl
from tests.formats.outside import DATA, message_of, needs_data

NAV3D = """\
discretization(cells): 3 2
obsthresh: 10
cost_inscribed_thresh: 9
cost_possibly_circumscribed_thresh: 0
cellsize(meters): 0.5
nominalvel(mpersecs): 1.0
timetoturn45degsinplace(secs): 2.0
start(meters,rads): 0.11 0.12 0.3
end(meters,rads): 1.2 0.9 -1
environment:
0 9 10
0 255 0
"""
NAV2D = """\
discretization(cells): 3 2
obsthresh: 1
start(cells): 0 0
end(cells): 2 1
environment:
0 0 1
0 1 0
"""


def read(folder, text):
    path = folder / "env.cfg"
    path.write_bytes(text.encode())
    assert is_sbpl(path)
    (case,) = read_sbpl(path)
    return case


@pytest.mark.parametrize(
    "text",
    [
        NAV3D,
        NAV3D.replace("\n", "\r\n"),
        "\ufeff" + NAV3D,
        NAV3D.replace("0 9 10\n0 255 0\n", "0 9 10 0\n255\n 0"),
        NAV3D.replace("environment:\n", "environment: "),
        NAV3D.replace("obsthresh: 10", "NumThetaDirs: 16\nobsthresh:\n10"),
    ],
)
def test_metres_and_the_way_up(tmp_path, text):
    case = read(tmp_path, text)
    (cells,) = case.obstacles
    assert cells.blocked.tolist() == [[False, False, True], [False, True, False]]
    assert cells.resolution == 0.5
    assert case.start.tolist() == [0.11, 0.12, 0.3]
    assert case.goal.tolist() == [1.2, 0.9, -1.0]
    assert case.headings
    assert (case.bounds.x, case.bounds.y) == ((0.0, 1.5), (0.0, 1.0))


def test_cells_are_of_one_metre(tmp_path):
    case = read(tmp_path, NAV2D)
    assert case.start[:2].tolist() == [0.5, 0.5]
    assert case.goal[:2].tolist() == [2.5, 1.5]
    assert not case.headings
    assert case.obstacles[0].resolution == 1.0
    assert read(tmp_path, NAV2D).goal.tolist() == case.goal.tolist()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (NAV3D, "", ":1: the key 'environment' is missing"),
        ("environment:\n", "", ":11: the key 'environment' is missing"),
        ("discretization", "# a comment\ndiscretization", ":1: got '#', need one of"),
        ("discretization(cells): 3 2\n", "", ": the key 'discretization(cells)' is missing"),
        ("obsthresh: 10\n", "", ": the key 'obsthresh' is missing"),
        ("start(meters,rads): 0.11 0.12 0.3", "start(cells): 1 1",
         ": the key 'start(meters,rads)' is missing beside cellsize(meters)"),
        ("cellsize(meters): 0.5\n", "", ": the key 'start(cells)' is missing"),
        ("obsthresh", "obstresh", ":2: got 'obstresh:', need one of discretization(cells), "),
        ("obsthresh: 10", "obsthresh: 10\nobsthresh: 10", ":3: obsthresh: the key stands twice"),
        ("cells): 3 2", "cells): 3", ":1: discretization(cells): got 1 numbers, need 2"),
        ("cells): 3 2", "cells): 3 2 1", ":1: discretization(cells): got 3 numbers, need 2"),
        ("cells): 3 2", "cells): 3 -2",
         ":1: discretization(cells): got '-2', need a whole number of at least 0"),
        ("cells): 3 2", "cells): 0 2",
         ":1: discretization(cells): got 0 x 2 cells, need at least one"),
        ("cells): 3 2", "cells): 99999 99999",
         ":1: discretization(cells): got 99999 x 99999 cells, need at most 50 million"),
        ("meters): 0.5", "meters): 0",
         ":5: cellsize(meters): got 0 m, need a size of 1e-06 to 1e+06 m"),
        ("meters): 0.5", "meters): nan", ":5: cellsize(meters): got 'nan', need a finite number"),
        ("0.11 0.12 0.3", "0.11 0.12", ":8: start(meters,rads): got 2 numbers, need 3"),
        ("0.11 0.12 0.3", "0.11 x 0.3", ":8: start(meters,rads): got 'x', need a finite number"),
        ("0 255 0\n", "0 255\n", ":10: environment: got 5 cells, need 6, width x height of "
         "discretization(cells)"),
        ("0 255 0\n", "0 255 0 7\n", ":10: environment: got 7 cells, need 6, width x height of "
         "discretization(cells)"),
        ("0 255 0\n", "0 x 0\n", ":12: a cell: got 'x', need a whole number of at least 0"),
        ("0 255 0\n", "0 -1 0\n", ":12: a cell: got '-1', need a whole number of at least 0"),
        ("0 255 0\n", "0 nan 0\n", ":12: a cell: got 'nan', need a whole number of at least 0"),
    ],
)  # fmt: skip
def test_what_is_wrong(tmp_path, old, new, message):
    assert NAV3D.count(old) == 1
    said = message_of(read_sbpl, tmp_path / "env.cfg", NAV3D.replace(old, new))
    assert said.startswith(message)


@pytest.mark.parametrize(("word", "need"), [("3", "0 to 2"), ("-1", ""), ("1.5", "")])
def test_cells_outside(tmp_path, word, need):
    text = NAV2D.replace("start(cells): 0", f"start(cells): {word}")
    said = message_of(read_sbpl, tmp_path / "env.cfg", text)
    assert said.startswith(":3: start(cells): got ")
    assert need in said


@needs_data
@pytest.mark.parametrize(
    ("name", "shape", "cell"),
    [
        ("nav2d/env1", (15, 15), 1.0),
        ("nav3d/env1", (15, 15), 0.025),
        ("nav3d/env2", (1200, 100), 0.1),
    ],
)
def test_environments_of_sbpl(name, shape, cell):
    (case,) = read_sbpl(DATA / "sbpl" / "env_examples" / f"{name}.cfg")
    (cells,) = case.obstacles
    assert cells.blocked.shape == shape
    assert cells.resolution == cell
    # the first line of each: 0 0 0 0 0 0 1 1 0 ...; it is the lowest row
    assert np.flatnonzero(cells.blocked[0])[:2].tolist() == [6, 7]
    for pose in (case.start, case.goal):
        column, row = (pose[:2] / cell).astype(int)
        assert not cells.blocked[row, column]

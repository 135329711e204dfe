"""Cases of TPCAP: numbers in a row, and what is wrong with them."""

from __future__ import annotations

import csv
import re

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.tpcap import is_tpcap, read_tpcap
from maneuver_automaton.groups import SE2
from maneuver_automaton.scenario import load_scenario
from tests.formats.outside import DATA, message_of, needs_data

CASE = "1,2,0.5,-3,4,-7.5,2,3,4,0,0,1,0,0,1,5,5,7,5,7,7,5,7"


def test_what_the_numbers_mean(tmp_path):
    path = tmp_path / "Case0.csv"
    path.write_text(CASE)
    (case,) = read_tpcap(path)
    assert case.name == "Case0"
    assert case.start.tolist() == [1.0, 2.0, 0.5]
    assert case.goal.tolist() == [-3.0, 4.0, -7.5]
    assert [o.shape.corners.tolist() for o in case.obstacles] == [
        [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
        [[5.0, 5.0], [7.0, 5.0], [7.0, 7.0], [5.0, 7.0]],
    ]
    assert [o.name for o in case.obstacles] == ["obstacle 1", "obstacle 2"]
    assert case.bounds.x is None


@pytest.mark.parametrize(
    "text",
    [
        CASE + ",",
        CASE + ",\r\n",
        CASE + "\n\n",
        "\ufeff" + CASE,
        CASE.replace(",2,3,4,", ",2\n3,4,\n"),
        CASE.replace(",", " ,  "),
        CASE.replace("1,2,", "1.0e0,+2.,"),
    ],
)
def test_rows_spaces_and_marks_do_not_matter(tmp_path, text):
    path = tmp_path / "Case0.csv"
    path.write_bytes(text.encode())
    (case,) = read_tpcap(path)
    assert case.start.tolist() == [1.0, 2.0, 0.5]
    assert len(case.obstacles) == 2
    assert is_tpcap(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", ": got 0 numbers, need at least 7: x0, y0, theta0, xf, yf, thetaf, n"),
        ("1,2,3", ": got 3 numbers, need at least 7: x0, y0, theta0, xf, yf, thetaf, n"),
        (CASE.replace("0.5", "abc"), ":1: value 3: got 'abc', need a finite number"),
        (CASE.replace("0.5", "nan"), ":1: value 3: got 'nan', need a finite number"),
        (CASE.replace("0.5", "1e999"), ":1: value 3: got '1e999', need a finite number"),
        (CASE.replace("0.5", "-1e99"), ":1: value 3: got '-1e99', need at most 1e+10 in size"),
        (CASE.replace("0.5", "1_0"), ":1: value 3: got '1_0', need a finite number"),
        (CASE.replace("0.5", ""), ":1: value 3: got nothing, need a finite number"),
        (CASE + ",,", ": got 15 numbers after those of corners, need 14: x and y of 7 corners"),
        (CASE + ",9", ": got 15 numbers after those of corners, need 14: x and y of 7 corners"),
        (CASE[:-4], ": got 12 numbers after those of corners, need 14: x and y of 7 corners"),
        (CASE.replace(",2,3,", ",2.5,3,"), ":1: value 7 (number of obstacles): got '2.5', need "
         "a whole number of at least 0"),
        (CASE.replace(",2,3,", ",-2,3,"), ":1: value 7 (number of obstacles): got '-2', need "
         "a whole number of at least 0"),
        (CASE.replace(",2,3,", ",1e15,3,"), ":1: value 7: got 1000000000000000 obstacles, but "
         "16 numbers follow; need the number of corners of each"),
        (CASE.replace(",3,4,0", ",2,5,0"), ":1: value 8 (corners of obstacle 1): got '2', need "
         "a whole number of at least 3"),
        (CASE.replace("\n", "").replace("7,7,5,7", "7,7,6,x"), ":1: value 23: got 'x', need a "
         "finite number"),
        (CASE.replace("0,0,1,0,0,1", "0,0,1,1,2,2"), ":1: value 10: obstacle 1: the ring "
         "encloses no area, need corners that are not on one line"),
        (CASE.replace("7,5,7,7", "7,7,7,5"), ":1: value 16: obstacle 2: the ring crosses or "
         "touches itself at (6, 6), need a simple polygon"),
        (b"1,2,\xff", ":1: is not a text file in UTF-8"),
        (CASE.replace("0.5", "\x00"), ":1: value 3: got '\\x00', need a finite number"),
    ],
)  # fmt: skip
def test_what_is_wrong(tmp_path, text, message):
    assert message_of(read_tpcap, tmp_path / "Case0.csv", text) == message


@pytest.mark.parametrize("text", ["planner,case\nx,1\n", "", "x,y\n1,2\n", "\n"])
def test_other_tables_are_told_apart(tmp_path, text):
    path = tmp_path / "table.csv"
    path.write_text(text)
    assert not is_tpcap(path)


@given(st.lists(st.sampled_from(["0", "1", "-2.5", "3", "7", "1e3", "", "x", "nan"]), max_size=30))
def test_any_row_is_a_case_or_one_line(tmp_path_factory, words):
    path = tmp_path_factory.mktemp("any") / "Case0.csv"
    path.write_text(",".join(words))
    try:
        (case,) = read_tpcap(path)
    except InvalidScenario as error:
        said = str(error)
    else:
        said = str(path) * (len(case.start) == len(case.goal) == 3)
    assert re.fullmatch(rf"{re.escape(str(path))}[^\n]*", said)


@needs_data
def test_clearances_are_those_of_the_readme():
    """Computed there with the competition's body, to the centimetre."""
    table = (DATA / "tpcap" / "README.md").read_text()
    rows = re.findall(
        r"^\| (\d+) \| [^|]* \| (\d+) / (\d+) \| \d+ \| (\S+) / (\S+) \|", table, re.M
    )
    assert len(rows) == 10
    for case, obstacles, corners, at_start, at_goal in rows:
        problem = load_scenario(DATA / "tpcap" / f"Case{case}.csv").problem
        assert len(problem.obstacles) == int(obstacles)
        assert sum(len(o.shape.corners) for o in problem.obstacles) == int(corners)
        for pose, clearance in ((problem.start, at_start), (problem.goals[0].pose, at_goal)):
            (body,) = problem.footprint
            placed = shapely.Polygon(SE2(pose).act(body.corners))
            walls = [shapely.Polygon(o.shape.corners) for o in problem.obstacles]
            least = min(placed.distance(wall) for wall in walls)
            assert least == pytest.approx(float(clearance), abs=0.0051)


@needs_data
def test_numbers_are_those_of_the_file():
    path = DATA / "tpcap" / "Case15.csv"
    with path.open() as stream:
        words = next(csv.reader(stream))
    (case,) = read_tpcap(path)
    flat = np.concatenate([o.shape.corners.ravel() for o in case.obstacles])
    n = int(words[6])
    assert flat.tolist() == [float(word) for word in words[7 + n :] if word]

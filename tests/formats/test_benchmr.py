"""Worlds of Bench-MR: paths of a drawing, queries, outlines of robots."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from maneuver_automaton.formats.benchmr import (
    n_queries,
    outline,
    read_benchmr,
    read_benchmr_image,
    read_benchmr_queries,
    read_svg_paths,
)
from maneuver_automaton.groups import SE2
from tests.formats.outside import DATA, message_of, needs_data

SVG = """\
<?xml version="1.0" encoding="UTF-8"?>
<svg xmlns="http://www.w3.org/2000/svg">
  <defs><path d="M 9,9 h 1 v 1 z"/></defs>
  <g transform="translate(-10,-20)">
    <path d="m 12,21 2,0 v 1 h -2 z"/>
    <g transform="translate(1)"><path d="M 12 24 L13-25.5.5 26Z"/></g>
  </g>
</svg>
"""
ROBOT = '<svg><path d="m 5,5 h 4 v 2 h -4 v 0"/></svg>'
QUERIES = "world,robot,x0_m,y0_m,yaw0_rad,x1_m,y1_m,yaw1_rad\nyard,cart,3,-2,0,4,-5,1.5\n"


def yard(folder, queries=QUERIES):
    (folder / "worlds").mkdir(exist_ok=True)
    (folder / "worlds" / "yard.svg").write_text(SVG)
    (folder / "worlds" / "cart.svg").write_text(ROBOT)
    if queries:
        (folder / "queries.csv").write_text(queries)
    return folder / "worlds" / "yard.svg"


def test_paths_are_moved_and_turned_up(tmp_path):
    (world,) = read_benchmr(yard(tmp_path, queries=""))
    box, corner = (shapely.Polygon(o.shape.corners) for o in world.obstacles)
    assert box.bounds == (2.0, -2.0, 4.0, -1.0)
    assert corner.equals(shapely.Polygon([(3.0, -4.0), (4.0, 45.5), (-8.5, -6.0)]))
    assert (world.bounds.x, world.bounds.y) == ((-8.5, 4.0), (-6.0, 45.5))
    assert world.start is None
    assert world.footprint is None


def test_a_query_states_start_goal_and_body(tmp_path):
    path = yard(tmp_path)
    (case,) = read_benchmr(path)
    assert case.name == "yard"
    assert case.start.tolist() == [3.0, -2.0, 0.0]
    assert case.goal.tolist() == [4.0, -5.0, 1.5]
    (body,) = case.footprint
    assert sorted(body.corners.tolist()) == [[-2.0, -1.0], [-2.0, 1.0], [2.0, -1.0], [2.0, 1.0]]
    assert n_queries(path) == 1
    assert n_queries(path.with_name("cart.svg")) == 0


def test_several_queries_are_cases(tmp_path):
    path = yard(tmp_path, QUERIES + "\nhall,cart,0,0,0,1,1,1\nyard,cart,1,1,1,2,2,2\n")
    first, second = read_benchmr(path)
    assert (first.name, second.name) == ("yard case 0", "yard case 1")
    assert second.start.tolist() == [1.0, 1.0, 1.0]


def test_a_table_is_a_file_of_cases(tmp_path):
    yard(tmp_path)
    (case,) = read_benchmr_queries(tmp_path / "queries.csv")
    assert case.name == "yard case 0"
    assert len(case.obstacles) == 2
    text = QUERIES.replace("yard", "hall")
    said = message_of(read_benchmr_queries, tmp_path / "queries.csv", text)
    assert said == ": world: got 'hall', but there is no hall.svg"


@pytest.mark.parametrize(
    ("path", "points"),
    [
        ("M 1 2 3 4 5 6", [[1, 2], [3, 4], [5, 6]]),
        ("m 1 2 3 4 5 6", [[1, 2], [4, 6], [9, 12]]),
        ("M1,2H3V4h1v1", [[1, 2], [3, 2], [3, 4], [4, 4], [4, 5]]),
        ("m1 2h1 2 3", [[1, 2], [2, 2], [4, 2], [7, 2]]),
        ("M1 1l1 0 0 1z l2 2", [[1, 1], [2, 1], [2, 2], [3, 3]]),
        ("M1e1-2.5E-1.5", None),
        ("M1e1-2.5E-1 .5.5", [[10, -0.25], [0.5, 0.5]]),
        ("M 1 2 z m 1 1 l 0 1", [[1, 2], [2, 3], [2, 4]]),
    ],
)
def test_commands(tmp_path, path, points):
    file = tmp_path / "a.svg"
    text = f'<svg>\n<path d="{path}"/></svg>'
    if points is None:
        said = message_of(read_svg_paths, file, text)
        assert said == ":2: d: the command 'L' misses a number"
        return
    file.write_text(text)
    (drawn,) = read_svg_paths(file)
    assert drawn.points.tolist() == points
    assert drawn.line == 2


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (SVG, "", ":1: not valid XML: no element found"),
        ("</svg>\n", "", ":8: not valid XML: no element found"),
        ("</svg>\n", "</svg>\nrest", ":9: not valid XML: junk after document element"),
        ('encoding="UTF-8"', 'encoding="nonsense"', ": not valid XML: unknown encoding: nonsense"),
        ("<svg", "<!DOCTYPE svg [<!ENTITY a 'b'>]><svg",
         ":2: has a document type, need a file without one"),
        ("translate(1)", "matrix(1 0 0 1 2 3)",
         ":6: transform: got 'matrix(1 0 0 1 2 3)', need translate(x, y)"),
        ("translate(1)", "translate(x)", ":6: transform: got 'x', need a finite number"),
        ("v 1 h", "c 1 h", ":5: d: got the command 'c', need m, l, h, v or z"),
        ("m 12,21", "l 12,21", ":5: d: got the command 'l', need m first"),
        ("m 12,21", "12,21", ":5: d: got the command '', need m first"),
        ("m 12,21", "m 12,#", ":5: d: got ',# 2,0 v 1 h -2 z', need a number"),
        ("m 12,21", "m 1e999,21", ":5: d: got '1e999', need a finite number"),
        ("m 12,21 2,0 v 1 h -2 z", "m 1,1 h 5 h 2 z",
         ":5: the path encloses no area, need a polygon of at least 3 corners"),
        ("m 12,21 2,0 v 1 h -2 z", "",
         ":5: the path encloses no area, need a polygon of at least 3 corners"),
        (SVG, "<svg/>", ": holds no path, need at least one"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_drawing(tmp_path, old, new, message):
    path = yard(tmp_path, queries="")
    assert SVG.count(old) == 1
    assert message_of(read_benchmr, path, SVG.replace(old, new)) == message


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("robot,", "", "1: the column 'robot' is missing"),
        (QUERIES, "", "1: the column 'world' is missing"),
        (
            ",1.5\n",
            "\n",
            "2: got 7 columns, need 8: world, robot, x0_m, y0_m, yaw0_rad, x1_m, y1_m, yaw1_rad",
        ),
        ("-5,", "x,", "2: y1_m: got 'x', need a finite number"),
        ("cart", "", "2: robot: got '', need the name of a drawing"),
        ("cart", "../cart", "2: robot: got '../cart', need the name of a drawing"),
    ],
)
def test_what_is_wrong_with_queries(tmp_path, old, new, message):
    path = yard(tmp_path)
    table = tmp_path / "queries.csv"

    def read(_):
        read_benchmr(path)

    assert QUERIES.count(old) == 1
    assert message_of(read, table, QUERIES.replace(old, new)) == f":{message}"


def test_what_is_wrong_with_a_robot(tmp_path):
    two = ROBOT.replace("<path", '<path d="m 0,0 h 1 v 1"/><path')
    said = message_of(outline, tmp_path / "cart.svg", two)
    assert said == ": got 2 paths, need one, the robot's outline"


@needs_data
@pytest.mark.parametrize(
    ("name", "obstacles", "size"),
    [
        ("parking1", 13, (4.25, 2.43)),
        ("parking3", 18, (4.25, 2.43)),
        ("warehouse", 88, (3.78, 3.61)),
    ],
)
def test_worlds_of_benchmr(name, obstacles, size):
    """Their queries are known to be free with the centred outline; turned down, they are not."""
    (case,) = read_benchmr(DATA / "bench-mr" / "polygon_mazes" / f"{name}.svg")
    assert len(case.obstacles) == obstacles
    (body,) = case.footprint
    assert np.ptp(body.corners, axis=0) == pytest.approx(size, abs=0.006)
    walls = [shapely.Polygon(o.shape.corners) for o in case.obstacles]
    for pose in (case.start, case.goal):
        placed = shapely.Polygon(SE2(pose).act(body.corners))
        assert min(placed.distance(wall) for wall in walls) > 0.3
        assert case.bounds.x[0] < pose[0] < case.bounds.x[1]
        assert case.bounds.y[0] < pose[1] < case.bounds.y[1] < 0.0


@needs_data
def test_the_table_of_benchmr():
    cases = read_benchmr_queries(DATA / "bench-mr" / "queries.csv")
    assert [case.name for case in cases] == [
        "parking1 case 0",
        "parking3 case 1",
        "warehouse case 2",
    ]


@needs_data
def test_an_image_of_benchmr():
    (case,) = read_benchmr_image(DATA / "bench-mr" / "image_mazes" / "intel-lab.png")
    (cells,) = case.obstacles
    assert cells.blocked.shape == (581, 579)
    assert cells.resolution == 1.0
    assert 0.05 < cells.blocked.mean() < 0.95

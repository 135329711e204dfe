"""Occupancy maps from arrays: which way the rows run, and what counts as blocked."""

from __future__ import annotations

import matplotlib.image
import numpy as np
import pytest

import maneuver_automaton as ma

# A letter F, dark on white, as one sees it: its top is the first row.
LETTER = """
#####
#....
###..
#....
#....
"""
PICTURE = np.array([[cell == "." for cell in row] for row in LETTER.split()], dtype=np.float64)
RESOLUTION, ORIGIN = 0.5, [2.0, -1.0, 0.0]


def is_blocked(cells, x, y):
    """Whether a point robot at (x, y) would collide, by a plan that starts there."""
    robot = ma.Automaton.of_controls(ma.Unicycle(), {"ahead": (1.0, 0.0), "turn": (0.5, 1.0)})
    problem = ma.Problem(robot, [x, y, 0.0], [x + 50.0, y, 0.0], obstacles=cells)
    return ma.plan(problem, time_limit=0.5).status is ma.PlanStatus.START_BLOCKED


def letter_of_picture(path):
    matplotlib.image.imsave(path, PICTURE, cmap="gray", vmin=0.0, vmax=1.0)
    return matplotlib.image.imread(path)


def test_a_picture_stands_upright_in_the_world(tmp_path):
    pixels = letter_of_picture(tmp_path / "letter.png")
    assert pixels.shape == (5, 5, 4)
    cells = ma.OccupancyMap.of_picture(pixels, resolution=RESOLUTION, origin=ORIGIN)
    assert is_blocked(cells, 4.25, 1.25)  # the long bar of the F, at its top right
    assert is_blocked(cells, 2.25, -0.75)  # its foot, at the lower left
    assert not is_blocked(cells, 4.25, -0.75)  # nothing at the lower right


def test_the_first_row_of_an_array_is_the_lowest():
    cells = ma.OccupancyMap(PICTURE[::-1] == 0.0, resolution=RESOLUTION, origin=ORIGIN)
    upright = ma.OccupancyMap.of_picture(PICTURE, resolution=RESOLUTION, origin=ORIGIN)
    np.testing.assert_array_equal(cells.blocked, upright.blocked)
    assert is_blocked(cells, 4.25, 1.25)
    assert not is_blocked(cells, 4.25, -0.75)


def test_a_picture_in_a_file_of_nav2_is_the_same_map(tmp_path):
    letter_of_picture(tmp_path / "letter.png")
    (tmp_path / "letter.yaml").write_text(
        "{image: letter.png, resolution: 0.5, origin: [2, -1, 0], negate: 0, "
        "occupied_thresh: 0.65, free_thresh: 0.25}"
    )
    loaded = ma.load_map(tmp_path / "letter.yaml")
    ours = ma.OccupancyMap.of_picture(PICTURE, resolution=RESOLUTION, origin=ORIGIN)
    np.testing.assert_array_equal(loaded.blocked, ours.blocked)
    assert (loaded.resolution, loaded.origin.tolist()) == (RESOLUTION, ORIGIN)


def test_a_map_of_movingai_loads_too(tmp_path):
    rows = LETTER.strip().replace("#", "@")
    (tmp_path / "letter.map").write_text(f"type octile\nheight 5\nwidth 5\nmap\n{rows}\n")
    ours = ma.OccupancyMap.of_picture(PICTURE, resolution=1.0)
    np.testing.assert_array_equal(ma.load_map(tmp_path / "letter.map").blocked, ours.blocked)


@pytest.mark.parametrize("kind", [bool, np.int8, np.uint8, np.int64, np.float32, np.float64])
def test_any_array_of_numbers_will_do(kind):
    cells = ma.OccupancyMap(np.array([[0, 1], [1, 0]], dtype=kind), resolution=1.0)
    assert cells.blocked.tolist() == [[False, True], [True, False]]


def test_unknown_cells_of_ros_are_blocked():
    data = np.array([0, 100, -1, 0], dtype=np.int8)
    cells = ma.OccupancyMap(data.reshape(2, 2) != 0, resolution=1.0)
    assert cells.blocked.tolist() == [[False, True], [True, False]]


@pytest.mark.parametrize(
    "pixels",
    [
        np.array([[0, 255]], dtype=np.uint8),
        np.array([[0, 65535]], dtype=np.uint16),
        np.array([[False, True]]),
        np.array([[[0.0], [1.0]]]),
        np.array([[[0.2, 0.3, 0.4], [0.6, 0.6, 0.6]]]),
        np.array([[[255, 0], [255, 255]]], dtype=np.uint8),  # white, but transparent
    ],
)
def test_dark_and_transparent_pixels_are_blocked(pixels):
    cells = ma.OccupancyMap.of_picture(pixels, resolution=1.0)
    assert cells.blocked.tolist() == [[True, False]]


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: ma.OccupancyMap([1, 0], resolution=1.0),
         "map: cells have shape (2,), need (rows, columns)"),
        (lambda: ma.OccupancyMap([["a"]], resolution=1.0),
         "map: cells: got [['a']], need numbers"),
        (lambda: ma.OccupancyMap([[np.nan]], resolution=1.0),
         "map: cells: got nan, need finite numbers"),
        (lambda: ma.OccupancyMap.of_picture(np.zeros((2, 2, 5)), resolution=1.0),
         "map: pixels have shape (2, 2, 5), need (rows, columns) or (rows, columns, 1 to 4)"),
        (lambda: ma.OccupancyMap.of_picture([[0.0, 255.0]], resolution=1.0),
         "map: pixels reach from 0.0 to 255.0, need 0 (black) to 1 (white) as their type is "
         "float64"),
        (lambda: ma.load_map("hall.png"),
         "hall.png: is no map, need a file of Nav2 (.yaml, .yml) or MovingAI (.map); "
         "OccupancyMap.of_picture reads an image"),
        (lambda: ma.load_map("hall.yaml", unknown="maybe"),
         "hall.yaml: unknown: got 'maybe', need 'blocked' or 'free'"),
    ],
)  # fmt: skip
def test_what_is_no_map_is_refused(make, said):
    with pytest.raises(ValueError) as error:
        make()
    assert str(error.value) == said

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from maneuver_automaton.collision import Box, Disc, Motion, Obstacle, OccupancyMap, Polygon
from maneuver_automaton.groups import SE2
from maneuver_automaton.plotting import draw_obstacles
from maneuver_automaton.plotting.obstacles import (
    map_paths,
    obstacle_entries,
    round_times,
    shape_path,
)

RING = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])
AROUND = Motion([0.0, 2.0], [[0.0, 0.0, 0.0], [4.0, 0.0, np.pi / 2]])


def drawn(obstacles, **options):
    ax = Figure().add_subplot()
    return ax, draw_obstacles(ax, obstacles, **options)


def pixels(ax, points):
    """Colours (n, 3) of the picture at `points` (n, 2), between 0 and 1."""
    canvas = FigureCanvasAgg(ax.figure)
    canvas.draw()
    image = np.asarray(canvas.buffer_rgba())[::-1, :, :3] / 255.0
    columns, rows = np.floor(ax.transData.transform(points)).astype(int).T
    return image[rows, columns]


@pytest.mark.parametrize("clockwise", [False, True])
def test_holes_are_holes(clockwise):
    hole = (0.5 * RING + 1.0)[:: -1 if clockwise else 1]
    ax, _ = drawn(Polygon(RING, holes=[hole]))
    ax.set(xlim=(-1.0, 5.0), ylim=(-1.0, 5.0))
    solid, inside, outside = pixels(ax, [(0.5, 2.0), (2.0, 2.0), (-0.5, 2.0)])
    np.testing.assert_allclose(solid, (0.36, 0.38, 0.42), atol=0.01)
    assert (inside == 1.0).all()
    assert (outside == 1.0).all()


def test_a_ring_that_crosses_itself_is_solid_in_all_its_faces():
    path = shape_path(Polygon([[0, 0], [2, 2], [2, 0], [0, 2]]))
    assert path.contains_point((0.2, 1.0))
    assert path.contains_point((1.8, 1.0))
    assert not path.contains_point((1.0, 0.2))


@given(
    blocked=st.lists(st.lists(st.booleans(), min_size=4, max_size=4), min_size=1, max_size=6),
    origin=st.tuples(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0), st.floats(-3.0, 3.0)),
)
def test_blocked_cells_are_where_the_origin_puts_them(blocked, origin):
    cells = OccupancyMap(blocked, resolution=0.25, origin=origin)
    rows, columns = np.indices(cells.blocked.shape)
    middles = SE2(np.array(origin)).act(0.25 * (np.stack([columns, rows], axis=-1) + 0.5))
    paths = map_paths(cells)
    inside = [any(path.contains_point(place) for path in paths) for place in middles.reshape(-1, 2)]
    assert inside == cells.blocked.ravel().tolist()


def test_thin_walls_of_a_fine_map_stay_visible():
    blocked = np.zeros((2000, 2000), dtype=bool)
    blocked[1000] = True
    ax, _ = drawn(OccupancyMap(blocked, resolution=0.01))
    ax.set(xlim=(0.0, 20.0), ylim=(0.0, 20.0))
    ax.set_axis_off()
    column = pixels(ax, np.stack([np.full(801, 10.0), np.linspace(9.0, 11.0, 801)], axis=-1))
    assert column.min() < 0.75


def test_what_moves_is_where_it_is_at_the_time():
    _, artists = drawn(Obstacle(Box([1.0, 0.5]), motion=AROUND), time=1.0)
    (path,) = artists["traffic"].get_paths()
    expected = Box([1.0, 0.5], [2.0, 0.0], np.pi / 4).corners
    np.testing.assert_allclose(np.sort(path.vertices[:4], 0), np.sort(expected, 0), atol=1e-12)


def test_several_times_go_from_pale_to_dark_over_the_track():
    moving = [Obstacle(Disc(0.2, [0.0, y]), motion=AROUND) for y in (0.0, 1.0)]
    _, artists = drawn(moving, time=[0.5, 1.0, 1.5])
    assert len(artists["traffic"].get_paths()) == 6
    light = artists["traffic"].get_facecolor()[:, :3].sum(axis=1)
    assert light[0] == light[1] > light[2] == light[3] > light[4] == light[5]
    track = artists["tracks"].get_segments()[1]
    for row, time in ((0, 0.5), (-1, 1.5)):
        np.testing.assert_allclose(track[row], SE2(AROUND.at(time)).act([0.0, 1.0]), atol=1e-9)


def test_what_is_not_there_at_a_time_is_faint_and_dashed():
    door = Obstacle(Box([1.0, 0.2]), present_s=(0.0, 1.2))
    _, artists = drawn([door, Obstacle(Disc(0.2), motion=AROUND)], time=[0.5, 1.5])
    alphas = artists["traffic"].get_facecolor()[:, 3]
    assert alphas[2] < 0.2 < 0.5 < alphas[0] == alphas[1] == alphas[3]
    dashed = [pattern is not None for _, pattern in artists["traffic"].get_linestyle()]
    assert dashed == [False, False, True, False]
    names = [name for _, name in obstacle_entries([door], np.array([0.5, 1.5]))]
    assert names == ["moving, at 0.5 s", "at 1.5 s", "not there at that time"]


def test_the_track_on_an_arc_is_the_arc():
    turns = 20
    time = np.arange(turns + 1.0)
    poses = [[0.0, 0.0, np.pi * k] if k % 2 == 0 else [0.0, 2.0, np.pi * k] for k in range(21)]
    circling = Motion(time, poses, [[np.pi, 0.0, np.pi]] * turns)
    _, artists = drawn(Obstacle(Disc(0.2), motion=circling), time=[0.0, 20.0])
    track = artists["tracks"].get_segments()[0]
    np.testing.assert_allclose(np.linalg.norm(track - [0.0, 1.0], axis=1), 1.0, atol=1e-9)
    assert np.linalg.norm(np.diff(track, axis=0), axis=1).max() < 0.06


def test_what_stands_and_what_moves_have_different_colours():
    _, artists = drawn([Disc(1.0), Obstacle(Disc(0.2), motion=AROUND)])
    still, moving = (
        np.array(to_rgb(part.get_facecolor()[0]))
        for part in (artists["obstacles"], artists["traffic"])
    )
    assert np.ptp(still) < 0.1
    assert np.ptp(moving) > 0.3


def test_wrong_input_is_named():
    with pytest.raises(ValueError, match="obstacles: got 'wall', need Obstacle"):
        drawn("wall")
    with pytest.raises(ValueError, match="obstacles: time: got nan, need finite numbers"):
        drawn(Disc(1.0), time=np.nan)


@given(begin=st.floats(-1e3, 1e3), length=st.floats(1e-3, 1e4))
def test_times_are_few_and_rise(begin, length):
    times = round_times(begin, begin + length)
    assert 2 <= len(times) <= 7
    assert (np.diff(times) > 0.0).all()
    assert (times[0], times[-1]) == (begin, begin + length)

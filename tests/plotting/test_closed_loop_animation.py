from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from matplotlib.animation import FFMpegWriter
from PIL import Image

from maneuver_automaton.collision import Box, Disc, Motion, Obstacle
from maneuver_automaton.plotting import save_closed_loop_animation
from maneuver_automaton.plotting.closed_loop_animation import _film
from maneuver_automaton.plotting.film import MOST_FRAMES, picture_times
from tests.plotting.loops import LOOPS, moments, parking_loop, pushed_loop, unfinished_loop

CAR = {"rectangle_m": [0.5, 0.3]}


def shown(film):
    """The moving parts by what they are, in the order in which they are drawn."""
    return dict(
        zip(
            ("traffic", "old", "jumps", "trail", "ahead", "vehicle", "clock"),
            film.moving,
            strict=True,
        )
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", ["unfinished", "empty", "helpless"])
def test_frames_move_and_cover_the_loop(name, tmp_path):
    loop = LOOPS[name]()
    save_closed_loop_animation(loop, tmp_path / "loop.gif", footprint=CAR)
    file = tmp_path / "loop.gif"
    assert file.stat().st_size < 1e6
    assert [other.name for other in tmp_path.iterdir()] == ["loop.gif"]
    with Image.open(file) as film:
        assert film.n_frames == picture_times(loop.times[0], loop.times[-1]).size
        if film.n_frames > 1:
            first = np.asarray(film.convert("RGB")).copy()
            film.seek(film.n_frames // 2)
            assert (np.asarray(film.convert("RGB")) != first).any()


def test_the_vehicle_is_where_it_was_driven():
    loop = pushed_loop()
    film = _film(loop, footprint={"disc_m": 0.2})
    vehicle = shown(film)["vehicle"]
    for time in [*loop.times[:-1], *moments(loop, 7)[1:-1], loop.times[-1]]:
        film.show(time)
        (outline,) = vehicle.get_paths()
        k = int(np.searchsorted(loop.times, time, side="right")) - 1
        pose = loop.poses[-1] if time >= loop.times[-1] else loop.driven[k].pose_at(time)
        assert np.allclose(outline.vertices[:-1].mean(axis=0), pose[:2], atol=1e-9)


def test_the_plan_ahead_leads_from_the_vehicle_to_the_goal():
    loop = parking_loop()
    film = _film(loop, footprint=None)
    parts = shown(film)
    film.show(1.5)
    drawn = np.concatenate(parts["ahead"].get_segments())
    assert np.allclose(drawn[0], loop.driven[1].pose_at(1.5)[:2], atol=1e-3)
    assert np.allclose(drawn[-1], 0.0, atol=1e-9)
    trail = np.concatenate(parts["trail"].get_segments())
    assert np.allclose(trail[[0, -1]], [loop.poses[0, :2], drawn[0]], atol=1e-9)
    assert parts["clock"].get_text() == f"1.50 s · step 1 · V = {loop.steps[1].value:.4g}"
    film.show(loop.times[-1])
    assert parts["ahead"].get_segments() == []
    assert parts["clock"].get_text() == "4.00 s · goal reached"


def test_old_plans_fade():
    loop = pushed_loop()
    film = _film(loop, footprint=None)
    old = shown(film)["old"]
    film.show(loop.times[0])
    assert old.get_segments() == []
    film.show(loop.times[-2])
    assert len(old.get_segments()) == 6
    assert (np.diff(old.get_color()[:, 3]) > 0.0).all()


def test_nothing_is_cut_off():
    loop = parking_loop()
    film = _film(loop, footprint=CAR)
    (ax,) = film.figure.axes
    ax.apply_aspect()
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    for time in moments(loop, 30):
        film.show(time)
        corners = shown(film)["vehicle"].get_paths()[0].vertices
        assert (corners > [left, low]).all()
        assert (corners < [right, high]).all()


def test_obstacles_stand_and_move_around_the_loop():
    loop = parking_loop()
    bar, disc = Box([1.0, 0.2], [0.0, -0.6]), Disc(0.1)
    passing = Obstacle(disc, motion=Motion([0.0, 4.0], [[-1, -0.3, 0], [1, -0.3, 0]]))
    problem = dataclasses.replace(loop.problem, obstacles=(Obstacle(bar), passing))
    film = _film(dataclasses.replace(loop, problem=problem), footprint=CAR)
    for time, x in ((1.0, -0.5), (3.0, 0.5)):
        film.show(time)
        (path,) = shown(film)["traffic"].get_paths()
        assert np.allclose(path.get_extents().get_points().mean(axis=0), [x, -0.3])
    (ax,) = film.figure.axes
    ax.apply_aspect()
    assert ax.get_ylim()[0] < -0.7


def test_long_loops_are_shown_faster():
    assert picture_times(0.0, 1e4).size == MOST_FRAMES
    assert picture_times(3.0, 3.0).tolist() == [3.0]


def test_a_video_without_ffmpeg_says_what_is_missing(tmp_path, monkeypatch):
    monkeypatch.setattr(FFMpegWriter, "isAvailable", classmethod(lambda cls: False))
    with pytest.raises(ValueError) as error:
        save_closed_loop_animation(unfinished_loop(), tmp_path / "loop.mp4")
    assert str(error.value) == (
        "animation: got the file name loop.mp4, but Matplotlib finds no ffmpeg, which writes "
        ".mp4; install ffmpeg, or choose an ending of .gif"
    )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not FFMpegWriter.isAvailable(), reason="needs ffmpeg")
def test_a_video(tmp_path):
    save_closed_loop_animation(unfinished_loop(), tmp_path / "loop.mp4")
    assert (tmp_path / "loop.mp4").read_bytes()[4:8] == b"ftyp"


def test_other_endings_are_refused(tmp_path):
    with pytest.raises(ValueError) as error:
        save_closed_loop_animation(unfinished_loop(), tmp_path / "loop.avi")
    assert str(error.value) == (
        "animation: got the file name loop.avi, need one ending in .gif, .mp4"
    )


def test_an_old_file_stays_if_drawing_fails(tmp_path):
    file = tmp_path / "loop.gif"
    file.write_bytes(b"old")
    with pytest.raises(ValueError, match="footprint"):
        save_closed_loop_animation(unfinished_loop(), file, footprint="a car")
    assert file.read_bytes() == b"old"

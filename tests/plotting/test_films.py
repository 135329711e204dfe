"""Films of every kind of result."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from matplotlib.animation import FFMpegWriter
from PIL import Image

from maneuver_automaton.automaton import Plan
from maneuver_automaton.collision import Disc
from maneuver_automaton.groups import SE2
from maneuver_automaton.plotting import film_of, save_film
from maneuver_automaton.plotting import films as film
from maneuver_automaton.plotting.films import MOST_FRAMES, TRAIL_S, picture_times
from tests.plotting.cases import parking_plan, result_of, slalom_problem
from tests.plotting.fleets import crossing
from tests.plotting.loops import moments, parking_loop, pushed_loop, unfinished_loop

NAMES = ("traffic", "old", "jumps", "ahead", "trails", "bodies", "dots", "clock")
STILL = Plan([1.0, 2.0, 0.0], (), durations=[])


def among():
    return result_of(parking_plan(), problem=slalom_problem(parking_plan()))


def of_body(loop, body, obstacles=()):
    problem = dataclasses.replace(loop.problem, footprint=body, obstacles=obstacles)
    return dataclasses.replace(loop, problem=problem)


def parts_of(moving):
    """The moving parts by what they are, in the order in which they are drawn."""
    return dict(zip(NAMES, moving.moving, strict=True))


class TestPlans:
    def test_what_moves_is_where_it_is_at_the_time(self):
        plan = parking_plan()
        shown = film_of(among())
        parts = parts_of(shown)
        for time in (0.0, 2.0, 3.0):
            shown.show(time)
            (path,) = parts["traffic"].get_paths()
            pose = SE2([-2.0 + time, 2.5, 0.125 * time])
            middle = 0.25 * path.vertices[:4].sum(axis=0)
            np.testing.assert_allclose(middle, pose.act([0.1, 0.0]), atol=1e-12)
            body = parts["bodies"].get_paths()[0].vertices[:4].mean(axis=0)
            np.testing.assert_allclose(body, plan.pose_at(time)[:2], atol=1e-12)
            assert parts["clock"].get_text() == f"{time:.2f} s"
        last = parts["trails"].get_segments()[-1][-1]
        np.testing.assert_allclose(last, plan.pose_at(3.0)[:2], atol=1e-3)

    @pytest.mark.exhaustive
    @pytest.mark.slow
    def test_films_are_small_white_and_move(self, tmp_path):
        save_film(among(), tmp_path / "plan.gif")
        assert (tmp_path / "plan.gif").stat().st_size < 1e6
        with Image.open(tmp_path / "plan.gif") as pictures:
            assert pictures.n_frames > 20
            first = np.asarray(pictures.convert("RGB")).copy()
            assert first[2, 2].tolist() == [255, 255, 255]
            pictures.seek(pictures.n_frames // 2)
            assert (np.asarray(pictures.convert("RGB")) != first).any()

    def test_an_empty_plan_is_one_frame(self, tmp_path):
        save_film(STILL, tmp_path / "plan.gif")
        with Image.open(tmp_path / "plan.gif") as pictures:
            assert pictures.n_frames == 1


class TestLoops:
    def test_the_vehicle_is_where_it_was_driven(self):
        loop = pushed_loop()
        shown = film_of(of_body(loop, Disc(0.2)))
        for time in [*loop.times[:-1], *moments(loop, 7)[1:-1]]:
            shown.show(time)
            (outline,) = parts_of(shown)["bodies"].get_paths()
            k = int(np.searchsorted(loop.times, time, side="right")) - 1
            place = loop.driven[k].pose_at(time)[:2]
            assert np.allclose(outline.vertices[:-1].mean(axis=0), place, atol=1e-9)

    def test_the_plan_ahead_leads_from_the_vehicle_to_the_goal(self):
        loop = parking_loop()
        shown = film_of(loop)
        parts = parts_of(shown)
        shown.show(1.5)
        ahead = np.concatenate(parts["ahead"].get_segments())
        assert np.allclose(ahead[0], loop.driven[1].pose_at(1.5)[:2], atol=1e-3)
        assert np.allclose(ahead[-1], 0.0, atol=1e-9)
        trail = np.concatenate(parts["trails"].get_segments())
        assert np.allclose(trail[[0, -1]], [loop.poses[0, :2], ahead[0]], atol=1e-9)
        assert parts["clock"].get_text() == f"1.50 s · step 1 · V = {loop.steps[1].value:.4g}"
        shown.show(loop.times[-1])
        assert parts["ahead"].get_segments() == []
        assert parts["clock"].get_text() == "4.00 s · goal reached"


class TestFleets:
    def test_the_film_shows_where_all_are(self):
        result = crossing()
        shown = film_of(result)
        parts = parts_of(shown)
        assert (shown.times[0], shown.times[-1]) == (0.0, 5.5)
        shown.show(3.0)
        assert parts["clock"].get_text() == "3.00 s"
        assert len(parts["bodies"].get_paths()) == 2
        middle = parts["bodies"].get_paths()[0].vertices[:4].mean(axis=0)
        np.testing.assert_allclose(middle, result.plans["there"].pose_at(3.0)[:2], atol=1e-9)
        begin, end = parts["trails"].get_segments()[0][[0, -1]]
        np.testing.assert_allclose(end - begin, [1.5 * TRAIL_S, 0.0], atol=1e-9)
        shown.show(5.6)
        assert len(parts["bodies"].get_paths()) == 1  # the other has left
        cart, door = parts["traffic"].get_facecolor()[:, 3]
        assert door < 0.2 < cart


class TestFormats:
    def test_long_motions_are_shown_faster(self):
        assert picture_times(0.0, 1e4).size == MOST_FRAMES
        assert picture_times(3.0, 3.0).tolist() == [3.0]

    def test_a_video_without_ffmpeg_says_what_is_missing(self, tmp_path, monkeypatch):
        monkeypatch.setattr(FFMpegWriter, "isAvailable", classmethod(lambda cls: False))
        with pytest.raises(ValueError) as error:
            save_film(unfinished_loop(), tmp_path / "loop.mp4")
        assert str(error.value) == (
            "animation: got the file name loop.mp4, but Matplotlib finds no ffmpeg, which writes "
            ".mp4; install ffmpeg, or choose an ending of .gif"
        )
        assert list(tmp_path.iterdir()) == []

    @pytest.mark.parametrize("make", [parking_plan, unfinished_loop, crossing])
    def test_a_video_has_pages_of_even_height(self, make, tmp_path, monkeypatch):
        monkeypatch.setattr(FFMpegWriter, "isAvailable", classmethod(lambda cls: True))
        written = []
        monkeypatch.setattr(film, "_video", lambda shown: written.append(shown) or b"video")
        save_film(make(), tmp_path / "film.mp4")
        assert (tmp_path / "film.mp4").read_bytes() == b"video"
        wide, high = written[0].figure.bbox.size
        assert wide % 2 == pytest.approx(0.0, abs=1e-6)
        assert high % 2 == pytest.approx(0.0, abs=1e-6)

    @pytest.mark.skipif(not FFMpegWriter.isAvailable(), reason="needs ffmpeg")
    @pytest.mark.parametrize("make", [parking_plan, unfinished_loop])
    def test_a_video(self, make, tmp_path):
        save_film(make(), tmp_path / "film.mp4")
        assert (tmp_path / "film.mp4").read_bytes()[4:8] == b"ftyp"

    def test_other_endings_are_refused_before_anything_is_drawn(self, tmp_path):
        file = tmp_path / "loop.avi"
        file.write_bytes(b"old")
        with pytest.raises(ValueError) as error:
            save_film(unfinished_loop(), file)
        assert str(error.value) == (
            "animation: got the file name loop.avi, need one ending in .gif, .mp4"
        )
        assert file.read_bytes() == b"old"

    def test_what_is_nearly_white_is_not_taken_for_white(self):
        # Pillow looks a colour up in steps of four: 252 stands for white, and 247 is as near to it
        paper = Image.new("RGB", (1, 1), "white")
        palette = Image.new("P", (1, 1))
        palette.putpalette(film._with_white([255, 255, 255, 247, 251, 252, 0, 0, 0] + [0] * 759))
        seen = paper.quantize(palette=palette, dither=Image.Dither.NONE).convert("RGB")
        assert seen.getpixel((0, 0)) == (255, 255, 255)

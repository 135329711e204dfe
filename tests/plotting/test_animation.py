"""A plan in motion."""

import numpy as np
import pytest
from PIL import Image

from maneuver_automaton.automaton import Plan
from maneuver_automaton.groups import SE2
from maneuver_automaton.plotting.animation import _film, save_plan_animation
from maneuver_automaton.plotting.film import _with_white
from maneuver_automaton.primitives import Trim
from tests.plotting.cases import parking_plan, slalom_problem

ARC = Trim(name="arc", body_velocity=[1.0, 0.0, 0.5], control=[1.0, 0.5])
REST = Trim(name="rest", body_velocity=[0.0, 0.0, 0.0], control=[0.0, 0.0])


def test_frames_move_and_cover_the_plan(tmp_path):
    plan = Plan([0.0, 0.0, 0.0], (ARC, REST), durations=[1.5, 0.5])
    save_plan_animation(plan, tmp_path / "plan.gif", footprint={"rectangle_m": [0.4, 0.2]})
    with Image.open(tmp_path / "plan.gif") as film:
        assert film.n_frames > 20
        first = np.asarray(film.convert("RGB")).copy()
        film.seek(film.n_frames // 2)
        assert (np.asarray(film.convert("RGB")) != first).any()


def test_what_moves_is_where_it_is_at_the_time():
    plan = parking_plan()
    film = _film(plan, slalom_problem(plan), None)
    traffic, trail, vehicle, clock = film.moving
    for time in (0.0, 2.0, 3.0):
        film.show(time)
        (path,) = traffic.get_paths()
        pose = SE2([-2.0 + time, 2.5, 0.125 * time])
        middle = 0.25 * path.vertices[:4].sum(axis=0)
        np.testing.assert_allclose(middle, pose.act([0.1, 0.0]), atol=1e-12)
        body = vehicle.get_paths()[0].vertices[:4].mean(axis=0)
        np.testing.assert_allclose(body, plan.pose_at(time)[:2], atol=1e-12)
        assert clock.get_text() == f"{time:.2f} s"
    np.testing.assert_allclose(trail.get_segments()[-1][-1], plan.pose_at(3.0)[:2], atol=1e-3)


def test_the_path_grows():
    plan = parking_plan()
    film = _film(plan, None, None)
    trail = film.moving[1]
    film.show(0.5)
    assert len(trail.get_segments()) == 1
    film.show(plan.duration)
    assert len(trail.get_segments()) == 4


@pytest.mark.slow
def test_films_of_scenes_are_small_and_white(tmp_path):
    plan = parking_plan()
    save_plan_animation(plan, tmp_path / "plan.gif", problem=slalom_problem(plan))
    assert (tmp_path / "plan.gif").stat().st_size < 1e6
    with Image.open(tmp_path / "plan.gif") as film:
        assert film.convert("RGB").getpixel((2, 2)) == (255, 255, 255)


def test_an_empty_plan_is_one_frame(tmp_path):
    save_plan_animation(Plan([1.0, 2.0, 0.0], (), durations=[]), tmp_path / "plan.gif")
    with Image.open(tmp_path / "plan.gif") as film:
        assert film.n_frames == 1


def test_other_endings_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"got the file name plan\.mp4, need one ending in \.gif"):
        save_plan_animation(Plan([0.0, 0.0, 0.0], (), durations=[]), tmp_path / "plan.mp4")


def test_what_is_nearly_white_is_not_taken_for_white():
    # Pillow looks a colour up in steps of four: 252 stands for white, and 247 is as near to it
    paper = Image.new("RGB", (1, 1), "white")
    palette = Image.new("P", (1, 1))
    palette.putpalette(_with_white([255, 255, 255, 247, 251, 252, 0, 0, 0] + [0] * 759))
    seen = paper.quantize(palette=palette, dither=Image.Dither.NONE).convert("RGB")
    assert seen.getpixel((0, 0)) == (255, 255, 255)

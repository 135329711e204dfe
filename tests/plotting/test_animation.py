"""A plan in motion."""

import numpy as np
import pytest
from PIL import Image

from maneuver_automaton.automaton import Plan
from maneuver_automaton.plotting.animation import save_plan_animation
from maneuver_automaton.primitives import Trim

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


def test_an_empty_plan_is_one_frame(tmp_path):
    save_plan_animation(Plan([1.0, 2.0, 0.0], (), durations=[]), tmp_path / "plan.gif")
    with Image.open(tmp_path / "plan.gif") as film:
        assert film.n_frames == 1


def test_other_endings_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"got the file name plan\.mp4, need one ending in \.gif"):
        save_plan_animation(Plan([0.0, 0.0, 0.0], (), durations=[]), tmp_path / "plan.mp4")
